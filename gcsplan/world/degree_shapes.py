"""Circles, polygons and corridors in degrees, converted to the plane and cut to the part near enough to matter.

The plane cannot hold points a quarter of the globe away, and it bends long edges. So zones and fences are converted
here: polygons and lines, straight in degrees from point to point, are cut in degrees to the mission's neighbourhood
and projected.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.world.frame import FARTHEST_M, Frame
from gcsplan.world.outlines import MOST_PAIRS, crossings, overlapping_pairs
from gcsplan.world.zones import Circle, Polygon

if TYPE_CHECKING:
    import shapely

Corner = tuple[float, float]

LARGEST_RADIUS_M = 100_000.0
"""Largest radius, m: a circle in the plane is one on the ground only where the plane's scale hardly changes over it."""

LARGEST_BUFFER_M = 20_000.0
"""Largest half-width of a corridor, m."""

EDGE_BOW_M = 0.05
"""An edge is straight in degrees; it is cut until its pieces in the plane are this near to it, m."""

SIMPLER_M, SIMPLER_PART = 0.5, 0.005
"""A corridor leaves out what bends its line by less than the first, m, and this part of its half-width."""

WIDER_PART, MOST_WIDENINGS = 0.005, 8
"""A corridor is drawn wider by this part of its half-width until it holds all that it must, so many times at most."""

METRES_OF_DEGREE = 111_700.0
"""A degree of a meridian or of the equator is shorter, m."""

MOST_POINTS = 1000
"""A longer line becomes several corridors, since the time for one grows faster than its points."""

UNTANGLED, MOST_OF_POINT = 32, 4
"""A line of more points than the first that crosses itself more often than this for each point becomes several
corridors at once: what it surrounds would be found, at great length, and then cut into parts of its own."""

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
    parts = _near_parts(unwrapped(ring, frame.lon_deg), frame)
    cut = [_cut_edges(part, np.roll(part, -1, axis=0), frame) for part in parts]
    return [counter_clockwise(frame.to_plane(points[:, 1], points[:, 0])) for points in cut]


def near_corridors(line: Sequence[Corner], buffer_m: float, frame: Frame, *, local: bool = False) -> list[Polygon]:
    """Polygons that together hold every point within ``buffer_m`` of the line; none if it is too far away.

    ``line`` is (latitude, longitude), straight in degrees from point to point, or (east_m, north_m) if ``local``. The
    polygons have no holes: where a line surrounds a place, its parts have polygons of their own. They reach beyond the
    buffer by at most 5 % and 0.1 m.
    """
    if local:
        parts = [np.asarray(line, float)]
    else:
        near = _near_parts(unwrapped(line, frame.lon_deg), frame, spare_m=buffer_m, is_line=True)
        cut = [np.concatenate([_cut_edges(part[:-1], part[1:], frame), part[-1:]]) for part in near]
        parts = [frame.to_plane(points[:, 1], points[:, 0]) for points in cut]
    corridors = []
    for points in parts:
        scale = frame.scale_at(float(np.hypot(points[:, 0], points[:, 1]).max()) + buffer_m)
        corridors += [counter_clockwise(ring) for ring in _rings_around(points, buffer_m * scale + EDGE_BOW_M)]
    return corridors


def _rings_around(points: Floats, buffer_m: float) -> list[Floats]:
    """The outlines, not closed, of polygons without holes that hold every point within ``buffer_m`` of a line."""
    import shapely

    half = len(points) // 2
    most = MOST_OF_POINT * len(points)
    tangled = UNTANGLED < len(points) <= MOST_POINTS and crossings(points, most, closed=False) > most
    if len(points) > MOST_POINTS or tangled:
        return _rings_around(points[: half + 1], buffer_m) + _rings_around(points[half:], buffer_m)
    line, begin = shapely.LineString(points), shapely.Point(points[0])
    shapely.prepare(line)  # distances from all corners to all legs would take minutes
    # Corners closer to their neighbours' line than this are left out; the buffer that follows is measured from all.
    plain = line.simplify(min(SIMPLER_M, SIMPLER_PART * buffer_m))
    for more in range(1, MOST_WIDENINGS + 1):
        # A polygon of chords lies inside the round outline, so it is drawn wider until no point of it is too near.
        shape = shapely.buffer(plain, buffer_m * (1.0 + WIDER_PART * more), quad_segs=12)
        # GEOS loses a part of some lines that are closed and cross themselves.
        if shape.geom_type != "Polygon" or shape.interiors or not shape.contains(begin):
            break
        # The line begins inside, and stays so if the outline keeps away from it.
        if not line.dwithin(shape.exterior, buffer_m):
            return [np.asarray(shape.exterior.coords)[:-1]]
    if len(points) > 2:
        return _rings_around(points[: half + 1], buffer_m) + _rings_around(points[half:], buffer_m)
    raise InputError(
        f"no corridor of {buffer_m:g} m was found around a line of {len(points)} points; simplify the line"
    )


def _near_parts(points: Floats, frame: Frame, *, spare_m: float = 0.0, is_line: bool = False) -> list[Floats]:
    """The parts of a polygon or line (N, 2) longitude, latitude within `FAR_M` and ``spare_m``, not closed."""
    tall = math.degrees((FAR_M + spare_m) / 6_350_000.0)
    wide = min(tall / math.cos(math.radians(min(abs(frame.lat_deg) + tall, 89.0))), 80.0)
    south, north = frame.lat_deg - tall, frame.lat_deg + tall
    window = (frame.lon_deg - wide, south, frame.lon_deg + wide, north)
    found: list[Floats] = []
    (west_most, south_most), (east_most, north_most) = points.min(axis=0), points.max(axis=0)
    for turn in (0.0, -360.0, 360.0):
        low, high = (west_most + turn, south_most), (east_most + turn, north_most)
        if low[0] >= window[2] or high[0] <= window[0] or low[1] >= north or high[1] <= south:
            continue
        turned = points + np.array([turn, 0.0])
        parts: list[Floats] = [turned]
        if low[0] < window[0] or high[0] > window[2] or low[1] < south or high[1] > north:
            import shapely

            whole = (shapely.LineString if is_line else shapely.Polygon)(turned)
            cut = shapely.intersection(whole, shapely.box(*window))
            near = [p for p in getattr(cut, "geoms", [cut]) if p.geom_type == whole.geom_type and not p.is_empty]
            parts = [np.asarray(p.coords) if is_line else np.asarray(p.exterior.coords)[:-1] for p in near]
        found += parts
    return found


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
    if overlapping_pairs(shapely.get_coordinates(shape)[:-1]) > MOST_PAIRS:
        return ring, (
            f"the outline has {len(ring)} corners, and its edges lie beside each other in such numbers that it would "
            "take minutes to examine; simplify it, or draw what is around it"
        )
    # The function, not the method: it lets other threads run, which hear signals.
    return ring, "" if shapely.is_valid(shape) and shape.area > 0.0 else _why_invalid(shape, local)


def unwrapped(points: Sequence[Corner], near_lon_deg: float) -> Floats:
    """(N, 2) longitude, latitude; the first near ``near_lon_deg``, each within half a turn of the one before."""
    p = np.asarray(points, float)
    steps = np.diff(p[:, 1], prepend=near_lon_deg)
    lon = near_lon_deg + np.cumsum((steps + 180.0) % 360.0 - 180.0)
    # The sum of steps loses bits, so each longitude is returned exactly, plus whole turns.
    return np.stack([p[:, 1] + 360.0 * np.round((lon - p[:, 1]) / 360.0), p[:, 0]], axis=-1)


def _cut_edges(begins: Floats, ends: Floats, frame: Frame) -> Floats:
    """The edges (N, 2) longitude, latitude cut into equal pieces near their chords in the plane, without the last
    end."""
    long = _may_bow(begins, ends)
    if not long.any():
        return begins
    pieces = np.ones(len(begins), int)
    bow = frame.bow_m(begins[long, ::-1], ends[long, ::-1])
    pieces[long] = np.maximum(1, np.ceil(np.sqrt(bow / EDGE_BOW_M))).astype(int)
    edge = np.repeat(np.arange(len(begins)), pieces)
    part = (np.arange(len(edge)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[edge]
    return np.asarray(begins[edge] + (ends - begins)[edge] * part[:, None])


def _may_bow(start: Floats, end: Floats) -> NDArray[np.bool_]:
    """(N,) whether edges, (N, 2) longitude, latitude, may lie farther than `EDGE_BOW_M` from their chords in the plane.

    An edge of length s at latitude f bows by at most (0.18 tan f + 0.02) s²/R, a fifth of what is compared here.
    Most outlines have many short edges, and to measure them takes longer than all else.
    """
    high, low = np.maximum(np.abs(start[:, 1]), np.abs(end[:, 1])), np.minimum(np.abs(start[:, 1]), np.abs(end[:, 1]))
    lon, lat = METRES_OF_DEGREE * np.abs(end - start).T
    squared = (lon * np.cos(np.radians(low))) ** 2 + lat**2
    return np.asarray((np.tan(np.radians(np.minimum(high, 89.9))) + 0.1) * squared > EDGE_BOW_M * 6.3e6)


def _why_invalid(shape: shapely.Polygon, local: bool) -> str:
    import shapely

    reason = shapely.is_valid_reason(shape)
    match = re.search(r"\[(\S+) (\S+)\]", reason)
    if match is None:
        return "the polygon has no area; give its corners in order around it"
    x, y = float(match[1]), float(match[2])
    at = f"{x:g} m east, {y:g} m north" if local else f"{y:.6f}, {(x + 180.0) % 360.0 - 180.0:.6f}"
    return f"the polygon's outline crosses or touches itself at {at}; give its corners in order around it"
