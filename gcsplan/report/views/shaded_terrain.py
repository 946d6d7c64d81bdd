"""The ground as a picture: the extent of the plane, its shaded relief, contours, and a grid for the pointer."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import contourpy
import numpy as np
from PIL import Image

from gcsplan.arrays import Floats
from gcsplan.report.parts.track_samples import TrackLine
from gcsplan.units import METRE, Unit
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Zone
from gcsplan.world.world import World

UNITS = 10_000.0
"""Width of the map in map units; its height follows from the extent."""
PIXELS, CONTOUR_EVERY, GRID_EVERY = 720, 3, 5
"""Pixels along the map's longer side; contours use every third, the grid of the page's script every fifth of those."""
LATTICE = 9
SHAPE = (0.45, 1.3)
"""Least and greatest height over width of the map, so that it fits a page and a screen."""
NO_GROUND = 65535
PATCH_SIDE, PATCH_MARGIN = 48, 0.25
"""Heights along each side of a `GroundPatch`, and its margin as a part of half its longer side."""

TINTS = (
    (0.00, (172, 193, 152)), (0.25, (205, 209, 162)), (0.50, (224, 205, 160)),
    (0.75, (201, 168, 138)), (1.00, (236, 230, 225)),
)  # fmt: skip
"""Part of the height from the lowest ground to the highest, and its colour (red, green, blue)."""
UNKNOWN_TINT = (150, 150, 160)


@dataclass(frozen=True, slots=True)
class MapExtent:
    """The box of the plane that the map shows, metres."""

    west_m: float
    south_m: float
    east_m: float
    north_m: float

    @property
    def width_m(self) -> float:
        """West to east, m."""
        return self.east_m - self.west_m

    @property
    def height_m(self) -> float:
        """South to north, m."""
        return self.north_m - self.south_m

    @property
    def scale(self) -> float:
        """Map units per metre."""
        return UNITS / self.width_m

    def units(self, east_m: Floats, north_m: Floats) -> Floats:
        """(..., 2) x to the right and y down, in map units."""
        x = (np.asarray(east_m, float) - self.west_m) * self.scale
        return np.stack([x, (self.north_m - np.asarray(north_m, float)) * self.scale], axis=-1)

    def grid(self) -> tuple[Floats, Floats]:
        """East and north of the ground samples: columns from the west, rows from the north."""
        longer, every = max(self.width_m, self.height_m), CONTOUR_EVERY * GRID_EVERY
        cols, rows = (
            max(every, round(PIXELS * side / longer / every) * every) for side in (self.width_m, self.height_m)
        )
        return np.linspace(self.west_m, self.east_m, cols + 1), np.linspace(self.north_m, self.south_m, rows + 1)


def extent_of(lines: Sequence[TrackLine], zones: Sequence[Zone], surface: Surface) -> MapExtent:
    """The box around all lines with a margin; without lines, around the zones or the middle of the terrain."""
    if lines:
        e = np.concatenate([line.east_m for line in lines])
        n = np.concatenate([line.north_m for line in lines])
        low, high = np.array([e.min(), n.min()]), np.array([e.max(), n.max()])
    elif zones:
        boxes = np.array([z.bounds for z in zones])
        low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    else:
        rows, cols = surface.ground_m.shape
        low = high = surface.grid.to_plane(0.5 * (cols - 1), 0.5 * (rows - 1))
    longer = float((high - low).max())
    pad = max(0.08 * longer, 20.0 if longer > 200.0 else 5.0)
    low, high = low - pad, high + pad
    width, height = (float(v) for v in high - low)
    middle = 0.5 * (low + high)
    width, height = max(width, height / SHAPE[1]), max(height, width * SHAPE[0])
    return MapExtent(
        float(middle[0]) - 0.5 * width, float(middle[1]) - 0.5 * height,
        float(middle[0]) + 0.5 * width, float(middle[1]) + 0.5 * height,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Relief:
    """The ground of an extent, ready for display. ``low_m``, ``high_m`` are AMSL of known ground, NaN if none is known.

    ``picture`` is a data URI. ``contours`` is an SVG path in map units, with a line every ``interval_m``. ``grid`` is
    the data with which the page's script shows the ground under the pointer and builds the terrain's mesh.
    """

    extent: MapExtent
    low_m: float
    high_m: float
    picture: str
    contours: str
    interval_m: float
    cell_m: float
    all_known: bool
    grid: dict[str, object]


def relief_of(world: World, extent: MapExtent, unit: Unit = METRE) -> Relief:
    """Sample, shade and contour the ground under ``extent``; contours are at round numbers of ``unit``."""
    east, north = extent.grid()
    ground = world.airspace.surface.ground_at(east, north[:, None])
    known = ~np.isnan(ground)
    low, high = (float(ground[known].min()), float(ground[known].max())) if known.any() else (math.nan, math.nan)
    coarse = slice(None, None, CONTOUR_EVERY)
    contours, interval = _contours(ground[coarse, coarse], east[coarse], north[coarse], extent, (low, high), unit)
    return Relief(
        extent, low, high, picture_of(ground, east, north, low, high), contours, interval,
        float(east[GRID_EVERY] - east[0]), bool(known.all()),
        _grid(world, extent, ground[::GRID_EVERY, ::GRID_EVERY], low, high),
    )  # fmt: skip


def tints(part: Floats) -> Floats:
    """(..., 3) colour 0 … 255 of ground at ``part`` 0 … 1 of the height range."""
    at, colours = [t[0] for t in TINTS], np.array([t[1] for t in TINTS], float)
    return np.stack([np.interp(part, at, colours[:, k]) for k in range(3)], axis=-1)


def picture_of(
    ground: Floats, east_m: Floats, north_m: Floats, low: float, high: float, *, clear: bool = False
) -> str:  # fmt: skip
    """The shaded ground as WebP in a data URI; with ``clear``, unknown ground is not painted."""
    colour = np.rint(shaded(ground, east_m, north_m, low, high)).astype(np.uint8)
    if clear:
        colour = np.dstack([colour, np.where(np.isnan(ground), 0, 255).astype(np.uint8)])
    buffer = io.BytesIO()
    Image.fromarray(colour, "RGBA" if clear else "RGB").save(buffer, "WEBP", quality=78, method=2)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def shaded(ground: Floats, east_m: Floats, north_m: Floats, low: float, high: float) -> Floats:
    """(rows, cols, 3) colour 0 … 255 of tinted ground with light from the north-west."""
    known = ~np.isnan(ground)
    z = np.where(known, ground, low if known.any() else 0.0)
    south, east = np.gradient(z, float(north_m[0] - north_m[1]), float(east_m[1] - east_m[0]))
    steep = float(np.percentile(np.hypot(south, east), 95.0))
    more = 0.7 / steep if steep > 1e-6 else 0.0  # the steep ground of every world gets the same shade
    x, y = -more * east, more * south  # east and north parts of the normal
    light = (-0.5 * x + 0.5 * y + math.sqrt(0.5)) / np.sqrt(x * x + y * y + 1.0)
    shade = np.clip(0.25 + 0.75 * light / math.sqrt(0.5), 0.25, 1.25)
    part = (z - low) / (high - low) if high - low > 1e-6 else np.zeros_like(z)
    colour = tints(part) * np.where(shade > 1.0, 1.0 + 0.35 * (shade - 1.0), shade)[..., None]
    colour[~known] = UNKNOWN_TINT
    return np.asarray(np.clip(colour, 0.0, 255.0))


def _contours(
    ground: Floats, east_m: Floats, north_m: Floats, extent: MapExtent, heights_m: tuple[float, float], unit: Unit
) -> tuple[str, float]:
    """Contours as one SVG path, and their interval; an empty path on flat ground."""
    low, high = heights_m
    if not high - low > 0.5:
        return "", 0.0
    interval = unit.size * nice_step(unit.of(high - low) / 12.0)
    made = contourpy.contour_generator(east_m, north_m, np.ma.masked_invalid(ground), name="serial")
    levels = np.arange(math.ceil(low / interval), math.floor(high / interval) + 1) * interval
    parts: list[str] = []
    for level in levels:
        for line in made.lines(float(level)):
            curve = np.asarray(line, np.float64)
            xy = np.rint(extent.units(curve[:, 0], curve[:, 1])).astype(int)
            xy = xy[np.concatenate([[True], np.abs(np.diff(xy, axis=0)).sum(axis=1) > 6])]
            if len(xy) > 2:
                steps = np.diff(xy, axis=0)
                parts.append(f"M{xy[0, 0]} {xy[0, 1]}l" + " ".join(f"{dx} {dy}" for dx, dy in steps.tolist()))
    return "".join(parts), interval


def nice_step(at_least: float) -> float:
    """The least of 1, 2, 5 × 10ⁿ that is not below ``at_least``."""
    power = 10.0 ** math.floor(math.log10(at_least))
    return next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= at_least * (1.0 - 1e-9))


def _grid(world: World, extent: MapExtent, ground: Floats, low: float, high: float) -> dict[str, object]:
    """Packed heights, and latitudes and longitudes on a coarse lattice, to interpolate linearly."""
    lattice = np.meshgrid(
        np.linspace(extent.west_m, extent.east_m, LATTICE), np.linspace(extent.north_m, extent.south_m, LATTICE)
    )
    degrees = world.frame.to_degrees(*lattice)
    return {
        **packed(ground, low, high),
        "box": [round(v, 3) for v in (extent.west_m, extent.south_m, extent.east_m, extent.north_m)],
        "lattice": LATTICE,
        "lat": [round(float(v), 7) for v in degrees[..., 0].ravel()],
        "lon": [round(float(v), 7) for v in degrees[..., 1].ravel()],
    }  # fmt: skip


def packed(ground: Floats, low_m: float, high_m: float) -> dict[str, object]:
    """Heights (rows, cols) as 16-bit steps from ``low_m``; NaN, or no height at all, is `NO_GROUND`."""
    base, step = (low_m, max((high_m - low_m) / 65000.0, 1e-4)) if math.isfinite(low_m) else (0.0, 1.0)
    whole = np.where(np.isnan(ground), NO_GROUND, np.clip(np.nan_to_num((ground - base) / step), 0, 65000))
    return {
        "cols": ground.shape[1], "rows": ground.shape[0], "base": round(base, 3), "step": step, "unknown": NO_GROUND,
        "heights": base64.b64encode(np.rint(whole).astype("<u2").tobytes()).decode("ascii"),
    }  # fmt: skip


@dataclass(frozen=True, slots=True)
class GroundPatch:
    """The ground under one mission of a batch, coarsely: packed heights, and the box of degrees that they fill."""

    box_deg: tuple[float, float, float, float]
    """South, west, north, east; a box across 180° ends east of it."""
    heights: Mapping[str, Any]

    @classmethod
    def under(cls, world: World, tracks: Sequence[Sequence[Sequence[float]]]) -> GroundPatch | None:
        """The ground around tracks of [latitude, longitude]; None without a track, or known ground."""
        places = np.array([p for track in tracks for p in track])
        if not len(places):
            return None
        lons = places[0, 1] + (places[:, 1] - places[0, 1] + 180.0) % 360.0 - 180.0
        shrink = max(math.cos(math.radians(float(places[:, 0].mean()))), 0.05)
        low, high = (np.array([f(places[:, 0]), f(lons)]) for f in (np.min, np.max))
        half = 0.5 * (high - low) * np.array([1.0, shrink])
        half = (np.maximum(half, 0.5 * half.max()) + PATCH_MARGIN * half.max() + 1e-4) / np.array([1.0, shrink])
        (south, west), (north, east) = 0.5 * (low + high) - half, 0.5 * (low + high) + half
        lattice = np.meshgrid(np.linspace(north, south, PATCH_SIDE), np.linspace(west, east, PATCH_SIDE), indexing="ij")
        plane = world.frame.to_plane(*lattice)
        ground = world.airspace.surface.ground_at(plane[..., 0], plane[..., 1])
        if np.isnan(ground).all():
            return None
        box_deg = float(south), float(west), float(north), float(east)
        return cls(box_deg, packed(ground, float(np.nanmin(ground)), float(np.nanmax(ground))))

    def at(self, lat_deg: Floats, lon_deg: Floats) -> Floats:
        """(rows, cols) heights AMSL, m, over latitudes (rows,) and longitudes (cols,); NaN outside or unknown.

        They are smoothed, so that the picture has no edges where two heights are joined.
        """
        one, (south, west, north, east) = self.heights, self.box_deg
        whole = np.frombuffer(base64.b64decode(str(one["heights"])), "<u2").reshape(one["rows"], one["cols"])
        unknown = whole == one["unknown"]
        ground = np.where(unknown, float(one["base"]), one["base"] + one["step"] * whole)
        y = _spline_weights((north - lat_deg) / (north - south), ground.shape[0])
        x = _spline_weights((lon_deg - west) / (east - west), ground.shape[1])
        hidden = ~(y @ unknown.astype(float) @ x.T <= 1e-9)  # outside too, where weights are NaN
        return np.where(hidden, np.nan, y @ ground @ x.T)


def _spline_weights(part: Floats, count: int) -> Floats:
    """(N, count) weights of a uniform cubic B-spline at ``part`` 0 … 1 of its length; NaN outside."""
    at = np.where((part >= 0.0) & (part <= 1.0), part * (count - 1.0), np.nan)
    first = np.nan_to_num(np.floor(at)).clip(0, count - 2).astype(int)
    t = at - first
    each = ((1.0 - t) ** 3, 3.0 * t**3 - 6.0 * t**2 + 4.0, -3.0 * t**3 + 3.0 * t**2 + 3.0 * t + 1.0, t**3)
    weights = np.zeros((len(at), count))
    for k, weight in enumerate(each):
        np.add.at(weights, (np.arange(len(at)), np.clip(first + k - 1, 0, count - 1)), weight / 6.0)
    return weights
