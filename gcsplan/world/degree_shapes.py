"""Circles and polygons in degrees, converted to the plane and cut to the part near enough to matter.

The plane cannot hold points a quarter of the globe away, and it bends long edges. So zones and fences are converted
here: polygons, whose edges are straight in degrees, are cut in degrees to the mission's neighbourhood and projected.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.world.frame import FARTHEST_M, Frame
from gcsplan.world.zones import Circle, Polygon

if TYPE_CHECKING:
    import shapely

Corner = tuple[float, float]

LARGEST_RADIUS_M = 100_000.0
"""Largest radius, m: a circle in the plane is one on the ground only where the plane's scale hardly changes over it."""

EDGE_BOW_M = 0.05
"""An edge is straight in degrees; it is cut until its pieces in the plane are this near to it, m."""

FAR_M = 1.6 * FARTHEST_M
"""No mission goes farther than this from the frame's origin, m."""


def near_circle(centre: Corner, radius_m: float, frame: Frame, *, local: bool = False) -> Circle | None:
    """The circle around (latitude, longitude), or (east_m, north_m) if ``local``; None if it is too far away.

    ``radius_m`` is at most `LARGEST_RADIUS_M`.
    """
    east, north = centre if local else (float(x) for x in frame.to_plane(*centre))
    distance = math.hypot(east, north)
    near = math.isfinite(distance) and distance <= FAR_M + radius_m
    return Circle(float(east), float(north), radius_m) if near else None


def near_polygons(ring: Sequence[Corner], frame: Frame) -> list[Polygon]:
    """The parts of a polygon (latitude, longitude; simple, not closed) within `FAR_M`; none if it is too far away.

    Its edges are cut to keep `EDGE_BOW_M`.
    """
    points = unwrapped(ring, frame.lon_deg)
    tall = math.degrees(FAR_M / 6_350_000.0)
    wide = min(tall / math.cos(math.radians(min(abs(frame.lat_deg) + tall, 89.0))), 80.0)
    south, north = frame.lat_deg - tall, frame.lat_deg + tall
    window = (frame.lon_deg - wide, south, frame.lon_deg + wide, north)
    rings: list[Floats] = []
    for turn in (0.0, -360.0, 360.0):
        turned = points + np.array([turn, 0.0])
        low, high = turned.min(axis=0), turned.max(axis=0)
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
    return [counter_clockwise(frame.to_plane(ring[:, 1], ring[:, 0])) for ring in rings]


def counter_clockwise(vertices: Floats) -> Polygon:
    """The counter-clockwise polygon of ``vertices`` (N, 2) east_m, north_m, listed in either direction."""
    x, y = vertices[:, 0], vertices[:, 1]
    area = float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    return Polygon(np.ascontiguousarray(vertices if area > 0.0 else vertices[::-1]))


def outline_of(points: Sequence[Corner], *, local: bool = False) -> tuple[list[Corner], str]:
    """The corners, not closed and without repetitions, and why they are no simple polygon ("" if they are one).

    ``points`` are (latitude, longitude), or (east_m, north_m) if ``local``.
    """
    ring = [p for i, p in enumerate(points) if i == 0 or p != points[i - 1]]
    if len(ring) > 1 and ring[0] == ring[-1]:
        ring.pop()
    if len(set(ring)) < 3:
        return ring, f"a polygon needs at least 3 different points, given {len(set(ring))}"
    import shapely  # many missions have no polygons

    shape = shapely.Polygon(np.asarray(ring) if local else unwrapped(ring, ring[0][1]))
    return ring, "" if shape.is_valid and shape.area > 0.0 else _why_invalid(shape, local)


def unwrapped(points: Sequence[Corner], near_lon_deg: float) -> Floats:
    """(N, 2) longitude, latitude; the first near ``near_lon_deg``, each within half a turn of the one before."""
    p = np.asarray(points, float)
    steps = np.diff(p[:, 1], prepend=near_lon_deg)
    lon = near_lon_deg + np.cumsum((steps + 180.0) % 360.0 - 180.0)
    # The sum of steps loses bits, so each longitude is returned exactly, plus whole turns.
    return np.stack([p[:, 1] + 360.0 * np.round((lon - p[:, 1]) / 360.0), p[:, 0]], axis=-1)


def _cut_edges(ring: Floats, frame: Frame) -> Floats:
    """The ring (N, 2) longitude, latitude with every edge cut into equal pieces near their chords in the plane."""
    following = np.roll(ring, -1, axis=0)
    bow = frame.bow_m(ring[:, ::-1], following[:, ::-1])
    pieces = np.maximum(1, np.ceil(np.sqrt(bow / EDGE_BOW_M))).astype(int)
    return np.concatenate(
        [a + (b - a) * (np.arange(n) / n)[:, None] for a, b, n in zip(ring, following, pieces, strict=True)]
    )


def _why_invalid(shape: shapely.Polygon, local: bool) -> str:
    import shapely

    reason = shapely.is_valid_reason(shape)
    match = re.search(r"\[(\S+) (\S+)\]", reason)
    if match is None:
        return "the polygon has no area; give its corners in order around it"
    x, y = float(match[1]), float(match[2])
    at = f"{x:g} m east, {y:g} m north" if local else f"{y:.6f}, {(x + 180.0) % 360.0 - 180.0:.6f}"
    return f"the polygon's outline crosses or touches itself at {at}; give its corners in order around it"
