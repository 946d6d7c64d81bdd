"""No-fly zones as people write them, in degrees or local metres, and their way into the plane."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import Problem
from gcsplan.world.frame import FARTHEST_M, Frame
from gcsplan.world.zones import Circle, Level, Polygon, Zone

if TYPE_CHECKING:
    import shapely


LARGEST_RADIUS_M = 100_000.0
"""A circle in the plane is one on the ground only where the plane's scale hardly changes over it."""

MAX_VERTICES = 100_000
"""Of one polygon."""

EDGE_BOW_M = 0.05
"""An edge is straight in degrees; it is cut until its pieces in the plane are this near to it."""

_FAR_M = 1.6 * FARTHEST_M


@dataclass(frozen=True, slots=True)
class ZoneDraft:
    """A zone before there is a plane.

    ``points``: the centre alone (with ``radius_m``) or a polygon's vertices, not closed: (latitude, longitude)
    degrees, or (east_m, north_m) where ``local``. ``where`` is its place in the user's file.
    """

    name: str
    where: str
    points: tuple[tuple[float, float], ...]
    local: bool = False
    radius_m: float | None = None
    floor: Level | None = None
    ceiling: Level | None = None


@dataclass(frozen=True, slots=True)
class Bounds:
    """The four words for a zone's floor and ceiling, as given; None where not given."""

    floor_agl_m: float | None = None
    ceiling_agl_m: float | None = None
    floor_amsl_m: float | None = None
    ceiling_amsl_m: float | None = None

    def levels(self, where: str, problems: list[Problem]) -> tuple[Level | None, Level | None]:
        """Floor and ceiling; contradictions go to ``problems``.

        A floor at 0 m AGL is no floor: the zone reaches down without end, so nothing passes below it.
        """
        for bound in ("floor", "ceiling"):
            if getattr(self, f"{bound}_agl_m") is not None and getattr(self, f"{bound}_amsl_m") is not None:
                problems.append(
                    Problem(f"{where}.{bound}_agl_m", f"give {bound}_agl_m or {bound}_amsl_m, not both for one {bound}")
                )
        floor = _level(self.floor_agl_m, self.floor_amsl_m)
        ceiling = _level(self.ceiling_agl_m, self.ceiling_amsl_m)
        if floor is not None and floor.datum == "agl" and floor.value_m < 0.0:
            problems.append(Problem(f"{where}.floor_agl_m", f"must be at least 0, given {floor.value_m:g}"))
        if ceiling is not None and ceiling.datum == "agl" and ceiling.value_m <= 0.0:
            problems.append(
                Problem(
                    f"{where}.ceiling_agl_m",
                    f"must be above 0, given {ceiling.value_m:g}: the zone would lie wholly under ground",
                )
            )
        elif floor and ceiling and floor.datum == ceiling.datum and floor.value_m >= ceiling.value_m:
            problems.append(
                Problem(
                    f"{where}.floor_{floor.datum}_m",
                    f"the floor must be below the ceiling, given {floor.value_m:g} and {ceiling.value_m:g}",
                )
            )
        if floor == Level(0.0, "agl"):
            floor = None
        return floor, ceiling


def _level(agl_m: float | None, amsl_m: float | None) -> Level | None:
    if agl_m is not None:
        return Level(agl_m, "agl")
    return Level(amsl_m, "amsl") if amsl_m is not None else None


def circle(
    name: str, where: str, centre: tuple[float, float], radius_m: float, bounds: Bounds, problems: list[Problem],
    *, local: bool = False,
) -> ZoneDraft | None:  # fmt: skip
    """A cylinder; None, and ``problems`` grown, where it is not a good one."""
    before = len(problems)
    if not 0.0 < radius_m <= LARGEST_RADIUS_M:
        problems.append(
            Problem(
                f"{where}.radius_m",
                f"must be above 0 and at most {LARGEST_RADIUS_M:g} (a larger zone is a polygon), given {radius_m:g}",
            )
        )
    if not local:
        check_degrees(centre, f"{where}.center", problems)
    floor, ceiling = bounds.levels(where, problems)
    if len(problems) > before:
        return None
    return ZoneDraft(name, where, (centre,), local, radius_m, floor, ceiling)


def polygon(
    name: str, where: str, points: Sequence[tuple[float, float]], bounds: Bounds, problems: list[Problem],
    *, local: bool = False, key: str = "polygon",
) -> ZoneDraft | None:  # fmt: skip
    """A prism; None, and ``problems`` grown, where its outline is not simple or its bounds contradict."""
    before = len(problems)
    at = f"{where}.{key}" if key else where
    if len(points) > MAX_VERTICES:
        problems.append(Problem(at, f"has {len(points)} points, more than {MAX_VERTICES}; simplify it"))
        return None
    if not local:
        for i, point in enumerate(points):
            if not check_degrees(point, f"{at}[{i}]", problems):
                break  # one swapped point means that all are
    floor, ceiling = bounds.levels(where, problems)
    if len(problems) > before:
        return None
    ring = [p for i, p in enumerate(points) if i == 0 or p != points[i - 1]]
    if len(ring) > 1 and ring[0] == ring[-1]:
        ring.pop()
    if len(set(ring)) < 3:
        problems.append(Problem(at, f"a polygon needs at least 3 different points, given {len(set(ring))}"))
        return None
    import shapely  # many missions have no polygons

    shape = shapely.Polygon(np.asarray(ring) if local else _unwrapped(ring, ring[0][1]))
    if not shape.is_valid or not shape.area > 0.0:
        problems.append(Problem(at, _why_invalid(shape, local)))
        return None
    return ZoneDraft(name, where, tuple(ring), local, None, floor, ceiling)


def check_degrees(point: tuple[float, float], where: str, problems: list[Problem]) -> bool:
    """True where (latitude, longitude) may be a place; else ``problems`` grow, by a guess at swapped numbers too."""
    lat, lon = point
    if abs(lat) <= 90.0 and abs(lon) <= 180.0:
        return True
    if abs(lat) > 90.0 and abs(lon) <= 90.0 and abs(lat) <= 180.0:
        problems.append(
            Problem(where, f"latitude and longitude look swapped: {lat:g} is no latitude, wanted [lat, lon]")
        )
    elif abs(lat) > 90.0:
        problems.append(Problem(where, f"latitude must be within ±90°, given {lat:g}"))
    else:
        problems.append(Problem(where, f"longitude must be within ±180°, given {lon:g}"))
    return False


def place_zones(drafts: Sequence[ZoneDraft], frame: Frame) -> tuple[list[tuple[ZoneDraft, Zone]], list[ZoneDraft]]:
    """Each draft's zones in the plane (a polygon cut at the edge of the world may give several, or none).

    Also the drafts that lie too far away to matter. Polygons are cut to what is within `_FAR_M`: beyond that no
    mission goes.
    """
    placed: list[tuple[ZoneDraft, Zone]] = []
    far: list[ZoneDraft] = []
    for draft in drafts:
        shapes = _shapes(draft, frame)
        if not shapes:
            far.append(draft)
        for i, shape in enumerate(shapes):
            name = draft.name if len(shapes) == 1 else f"{draft.name}/{i + 1}"
            placed.append((draft, Zone(name, shape, draft.floor, draft.ceiling)))
    return placed, far


def looks_swapped(draft: ZoneDraft, frame: Frame) -> bool:
    """True where a zone that is far away would be near with latitude and longitude the other way round."""
    if draft.local or any(abs(lon) > 85.0 for _, lon in draft.points):
        return False
    turned = replace(draft, points=tuple((lon, lat) for lat, lon in draft.points))
    return bool(_shapes(turned, frame))


def one_line(text: str) -> str:
    """``text`` fit for tables, files and terminals: one line, no control characters, no halves of surrogates."""
    return "".join(c if c.isprintable() else " " if c.isspace() else "\ufffd" for c in text).strip()


def zones_sha256(drafts: Sequence[ZoneDraft]) -> str:
    """Hash of what the zones say, wherever they were written and however they were laid out."""
    plain = [
        [d.name, d.points, d.local, d.radius_m, d.floor and str(d.floor), d.ceiling and str(d.ceiling)] for d in drafts
    ]
    return hashlib.sha256(json.dumps(plain).encode()).hexdigest()


def _shapes(draft: ZoneDraft, frame: Frame) -> list[Circle | Polygon]:
    points = np.asarray(draft.points, float)
    if draft.radius_m is not None:
        east, north = points[0] if draft.local else frame.to_plane(points[0, 0], points[0, 1])
        distance = math.hypot(east, north)
        near = math.isfinite(distance) and distance <= _FAR_M + draft.radius_m
        return [Circle(float(east), float(north), draft.radius_m)] if near else []
    if draft.local:
        return [_polygon(points)]
    return [_polygon(frame.to_plane(ring[:, 1], ring[:, 0])) for ring in _near_rings(draft, frame)]


def _polygon(vertices: Floats) -> Polygon:
    x, y = vertices[:, 0], vertices[:, 1]
    area = float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    return Polygon(np.ascontiguousarray(vertices if area > 0.0 else vertices[::-1]))


def _near_rings(draft: ZoneDraft, frame: Frame) -> list[Floats]:
    """Rings (N, 2) longitude, latitude of the parts near the frame, edges cut as `EDGE_BOW_M` asks."""
    ring = _unwrapped(draft.points, frame.lon_deg)
    tall = math.degrees(_FAR_M / 6_350_000.0)
    wide = min(tall / math.cos(math.radians(min(abs(frame.lat_deg) + tall, 89.0))), 80.0)
    south, north = frame.lat_deg - tall, frame.lat_deg + tall
    rings = []
    for turn in (0.0, -360.0, 360.0):
        turned = ring + np.array([turn, 0.0])
        low, high = turned.min(axis=0), turned.max(axis=0)
        window = (frame.lon_deg - wide, south, frame.lon_deg + wide, north)
        if low[0] >= window[2] or high[0] <= window[0] or low[1] >= north or high[1] <= south:
            continue
        parts: list[Floats] = [turned]
        if low[0] < window[0] or high[0] > window[2] or low[1] < south or high[1] > north:
            import shapely

            cut = shapely.intersection(shapely.Polygon(turned), shapely.box(*window))
            parts = [
                np.asarray(p.exterior.coords)[:-1]
                for p in getattr(cut, "geoms", [cut])
                if p.geom_type == "Polygon" and not p.is_empty
            ]
        rings += [_cut_edges(part, frame) for part in parts]
    return rings


def _cut_edges(ring: Floats, frame: Frame) -> Floats:
    """The ring with every edge cut into equal pieces, each within `EDGE_BOW_M` of its chord in the plane."""
    following = np.roll(ring, -1, axis=0)
    bow = frame.bow_m(ring[:, ::-1], following[:, ::-1])
    pieces = np.maximum(1, np.ceil(np.sqrt(bow / EDGE_BOW_M))).astype(int)
    return np.concatenate(
        [a + (b - a) * (np.arange(n) / n)[:, None] for a, b, n in zip(ring, following, pieces, strict=True)]
    )


def _unwrapped(points: Sequence[tuple[float, float]], near_lon_deg: float) -> Floats:
    """(N, 2) longitude, latitude; the first one near ``near_lon_deg``, each within half a turn of the one before."""
    p = np.asarray(points, float)
    steps = np.diff(p[:, 1], prepend=near_lon_deg)
    lon = near_lon_deg + np.cumsum((steps + 180.0) % 360.0 - 180.0)
    # Adding up steps loses bits: each longitude is given back exactly, but for whole turns.
    return np.stack([p[:, 1] + 360.0 * np.round((lon - p[:, 1]) / 360.0), p[:, 0]], axis=-1)


def _why_invalid(shape: shapely.Polygon, local: bool) -> str:
    import shapely

    reason = shapely.is_valid_reason(shape)
    match = re.search(r"\[(\S+) (\S+)\]", reason)
    if match is None:
        return "the polygon has no area; give its corners in order around it"
    x, y = float(match[1]), float(match[2])
    at = f"{x:g} m east, {y:g} m north" if local else f"{y:.6f}, {(x + 180.0) % 360.0 - 180.0:.6f}"
    return f"the polygon's outline crosses or touches itself at {at}; give its corners in order around it"
