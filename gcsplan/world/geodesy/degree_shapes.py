"""Circles, polygons and corridors in degrees, converted to the plane and cut to the part near enough to matter.

The plane cannot hold points a quarter of the globe away, and it bends long edges. So zones and fences are converted
here: polygons and lines, straight in degrees from point to point, are cut in degrees to the mission's neighbourhood
and projected.

Longitudes count as they are written, from -360 to 360: an edge from 170 to 190 crosses the antimeridian, one from -95
to 95 would go through 0. An edge of 180 degrees and more is refused (`wide_fault`), because files mean either way by
it. The one exception are edges such as from 179.9 to -179.9 of a polygon that is no tall strip there: they cross the
antimeridian for a mission near it, and refuse one on the other side (`across`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Bools, Floats
from gcsplan.errors import InputError
from gcsplan.world.geodesy.frame import FARTHEST_M, Frame
from gcsplan.world.geometry.outlines import MOST_CROSSINGS, MOST_EDGE_PAIRS, crossings, overlapping_pairs
from gcsplan.world.geometry.zones import Circle, Polygon

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

MOST_EDGE_POINTS = 1000
"""A longer line becomes several corridors, since the time for one grows faster than its points."""

UNTANGLED, MOST_OF_POINT = 32, 4
"""A line of more points than the first that crosses itself more often than this for each point becomes several
corridors at once: the area that it surrounds would be found, at great length, and then cut into parts of its own."""

ZONE_FAR_M = 1.6 * FARTHEST_M
"""No mission goes farther than this from the frame's origin, m."""

MOST_LON_DEG = 360.0
"""Longitudes of zones lie within this, so that both conventions and zones across the antimeridian can be written."""

TURNS_DEG = (0.0, -360.0, 360.0)
"""Whole turns by which a zone may lie beside the mission's longitudes."""

HALF_TURN_DEG = 180.0
"""From this longitude difference on it is unknown on which side of the globe an edge runs."""

ACROSS_DEG, ACROSS_PART = 2.0, 0.5
"""Edges of a whole turn less the first may cross the antimeridian, if the polygon then is wide by this part of its
height: a mask of the world that leaves out a strip along the antimeridian is tall there, and narrow."""

SAME_PLACE_DEG = 1e-6
"""Corners of a hole may lie so far beyond its outline's: rounding, a decimetre."""

POLE_DEG = 89.999
"""A corner at a latitude from here on is the pole."""

GREAT_CIRCLE_M = 1.0
"""An edge that lies nearer to its great circle counts as that circle, m."""

MOST_PIECES, MOST_PIECES_OF_ALL = 20_000, 400_000
"""Most pieces of one great circle, and of all of one zone."""

FEW_EDGES = 64
"""So few edges cross too seldom to be counted: great circles meet straight ones three times at most."""


def near_circle(centre_m: Sequence[float], radius_m: float) -> Circle | None:
    """The circle around (east_m, north_m); None if it is too far away. ``radius_m`` is at most `LARGEST_RADIUS_M`."""
    east, north = centre_m
    distance = math.hypot(east, north)
    near = math.isfinite(distance) and distance <= ZONE_FAR_M + radius_m
    return Circle(float(east), float(north), radius_m) if near else None


def near_polygons(ring: Sequence[Corner], frame: Frame, *, great_circles: bool = False) -> list[Polygon]:
    """The parts of a polygon (latitude, longitude; simple, not closed) within `ZONE_FAR_M`; none if it is too far away.

    Its edges are cut to keep `EDGE_BOW_M`. With ``great_circles`` each edge may be the great circle as well as the line
    that is straight in degrees, and all that either encloses belongs to the polygon.
    """
    rings = turned(ring, frame.lon_deg)
    wholes = _with_great_circles(rings, frame) if great_circles else [rings]
    parts = [p for one in wholes for p in _near_parts(one, frame)]
    cut = [cut_edges(part, np.roll(part, -1, axis=0), frame) for part in parts]
    return [counter_clockwise(frame.to_plane(points[:, 1], points[:, 0])) for points in cut]


def plain_polygons(rings: Sequence[Sequence[Corner]], frame: Frame, *, great_circles: bool) -> list[Polygon | None]:
    """The result of `near_polygons` for each ring, computed for all of them together; None if it must look at the ring.

    A country's zones are many, and most are like this: near as a whole, with edges too short to bow.
    """
    if not rings:
        return []
    at = np.array([corner for ring in rings for corner in ring])[:, ::-1]
    count = np.array([len(ring) for ring in rings])
    first = np.cumsum(count) - count
    at[:, 0] += np.repeat(_turns(at[first, 0], frame.lon_deg), count)
    after = np.arange(1, len(at) + 1)
    after[first + count - 1] = first
    ends = at[after]
    cut = _may_bow(at, ends)
    if great_circles:
        cut |= _may_follow_great_circle(at, ends)
    west, south, east, north = _window(frame)
    cut |= ((at <= (west, south)) | (at >= (east, north))).any(axis=1)
    plain = ~np.logical_or.reduceat(cut, first)
    plane = frame.to_plane(at[:, 1], at[:, 0])
    parts = np.split(plane, first[1:])
    return [counter_clockwise(part) if good else None for part, good in zip(parts, plain.tolist(), strict=True)]


def near_corridors(
    line: Sequence[Corner], buffer_m: float, frame: Frame, *, local: bool = False, great_circles: bool = False
) -> list[Polygon]:
    """Polygons that together hold every point within ``buffer_m`` of the line; none if it is too far away.

    ``line`` is (latitude, longitude), straight in degrees from point to point, or (east_m, north_m) if ``local``. The
    polygons have no holes: where a line surrounds a place, its parts have polygons of their own. They reach beyond the
    buffer by at most 5 % and 0.1 m. With ``great_circles`` the line along great circles has corridors, too.
    """
    if local:
        parts = [np.asarray(line, float)]
    else:
        whole = unwrapped(line, frame.lon_deg)
        bent = _great_circles(whole[:-1], whole[1:], _window(frame, buffer_m)) if great_circles else None
        lines = [whole] if bent is None else [whole, np.concatenate([bent, whole[-1:]])]
        near = [p for one in lines for p in _near_parts(one, frame, spare_m=buffer_m, is_line=True)]
        cut = [np.concatenate([cut_edges(part[:-1], part[1:], frame), part[-1:]]) for part in near]
        parts = [frame.to_plane(points[:, 1], points[:, 0]) for points in cut]
    corridors = []
    for points in parts:
        scale = frame.scale_at(float(np.hypot(points[:, 0], points[:, 1]).max()) + buffer_m)
        corridors += [counter_clockwise(ring) for ring in rings_around(points, buffer_m * scale + EDGE_BOW_M)]
    return corridors


def rings_around(points: Floats, buffer_m: float) -> list[Floats]:
    """The outlines, not closed, of polygons without holes that hold every point within ``buffer_m`` of a line."""
    import shapely

    half = len(points) // 2
    most = MOST_OF_POINT * len(points)
    tangled = UNTANGLED < len(points) <= MOST_EDGE_POINTS and crossings(points, most, closed=False) > most
    if len(points) > MOST_EDGE_POINTS or tangled:
        return rings_around(points[: half + 1], buffer_m) + rings_around(points[half:], buffer_m)
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
        return rings_around(points[: half + 1], buffer_m) + rings_around(points[half:], buffer_m)
    raise InputError(
        f"no corridor of {buffer_m:g} m was found around a line of {len(points)} points; simplify the line"
    )


def _near_parts(points: Floats, frame: Frame, *, spare_m: float = 0.0, is_line: bool = False) -> list[Floats]:
    """The parts of a polygon or line (N, 2) longitude, latitude within `ZONE_FAR_M` and ``spare_m``, not closed."""
    window = _window(frame, spare_m)
    found: list[Floats] = []
    (west_most, south_most), (east_most, north_most) = points.min(axis=0), points.max(axis=0)
    for turn in TURNS_DEG:
        low, high = (west_most + turn, south_most), (east_most + turn, north_most)
        if low[0] >= window[2] or high[0] <= window[0] or low[1] >= window[3] or high[1] <= window[1]:
            continue
        turned = points + np.array([turn, 0.0])
        parts: list[Floats] = [turned]
        if low[0] < window[0] or high[0] > window[2] or low[1] < window[1] or high[1] > window[3]:
            import shapely

            whole = (shapely.LineString if is_line else shapely.Polygon)(turned)
            cut = shapely.intersection(whole, shapely.box(*window))
            near = [p for p in getattr(cut, "geoms", [cut]) if p.geom_type == whole.geom_type and not p.is_empty]
            parts = [np.asarray(p.coords) if is_line else np.asarray(p.exterior.coords)[:-1] for p in near]
        found += parts
    return found


def _window(frame: Frame, spare_m: float = 0.0) -> tuple[float, float, float, float]:
    """West, south, east, north (degrees) of all within `ZONE_FAR_M` and ``spare_m``."""
    tall = math.degrees((ZONE_FAR_M + spare_m) / 6_350_000.0)
    wide = min(tall / math.cos(math.radians(min(abs(frame.lat_deg) + tall, 89.0))), 80.0)
    return frame.lon_deg - wide, frame.lat_deg - tall, frame.lon_deg + wide, frame.lat_deg + tall


def counter_clockwise(vertices: Floats) -> Polygon:
    """The counter-clockwise polygon of ``vertices`` (N, 2) east_m, north_m, listed in either direction."""
    x, y = (vertices[1:] - vertices[0]).T
    area = float(x[:-1] @ y[1:] - x[1:] @ y[:-1])
    return Polygon(np.ascontiguousarray(vertices if area > 0.0 else vertices[::-1]))


def outline_of(points: Sequence[Corner], *, local: bool = False) -> tuple[list[Corner], str]:
    """The corners, not closed and without repetitions, and why they are no simple polygon ("" if they are one).

    ``points`` are (latitude, longitude), or (east_m, north_m) if ``local``. Of one in degrees `wide_fault` is empty.
    """
    ring = [p for i, p in enumerate(points) if i == 0 or p != points[i - 1]]
    if len(ring) > 1 and ring[0] == ring[-1]:
        ring.pop()
    if len(set(ring)) < 3:
        return ring, f"a polygon needs at least 3 different points, given {len(set(ring))}"
    import shapely  # many missions have no polygons

    shape = shapely.Polygon(np.asarray(ring, float) if local else np.asarray(ring, float)[:, ::-1])
    if overlapping_pairs(shapely.get_coordinates(shape)[:-1]) > MOST_EDGE_PAIRS:
        return ring, (
            f"the outline has {len(ring)} corners, and its edges lie beside each other in such numbers that it would "
            "take minutes to examine; simplify it, or draw an outline around it"
        )
    # The function, not the method: it lets other threads run, which hear signals.
    return ring, "" if shapely.is_valid(shape) and shape.area > 0.0 else _why_invalid(shape, local)


def beyond_outline(outline: Sequence[Corner], holes: Sequence[Sequence[Corner]], *, metres: bool = False) -> str:
    """Why holes of an outline, (latitude, longitude) each, are none; empty if they are within its rectangle.

    Only the outline becomes a zone. Rings in the wrong order would make it as small as a hole. Longitudes of a hole may
    be whole turns off, unless coordinates are ``metres``.
    """
    if not holes or not outline:
        return ""
    at = np.asarray(outline, float)
    low, high = at.min(axis=0) - SAME_PLACE_DEG, at.max(axis=0) + SAME_PLACE_DEG
    for k, hole in enumerate(holes, start=2):
        inner = np.array(hole, float).reshape(-1, 2)
        if not metres:
            inner[:, 1] += _turns(inner[:, 1], 0.5 * (low[1] + high[1]))
        if (inner < low).any() or (inner > high).any():
            return (
                f"ring {k} reaches beyond ring 1, which is the outline: put the outline first and holes after it, and "
                "draw any other part as a polygon of its own"
            )
    return ""


def wide_fault(points: Sequence[Corner], holes: int = 0, *, closed: bool = True) -> str:
    """Why a polygon (or a line, if not ``closed``) in degrees is too wide to be read; empty if it is not.

    An edge along a pole is a point, however far it goes in longitude.
    """
    if not (width := _width_deg(points)) >= HALF_TURN_DEG:
        return ""
    at = np.asarray(points, float)
    if holes:
        return (
            f"the polygon is {width:g}° of longitude wide and has a hole: it is a keep-in area, outside of which "
            "all is no-fly, and this format has none: draw the hole in a file of its own, and name that under keep_in"
        )
    ends = np.roll(at, -1, axis=0)[: None if closed else -1]
    at = at[: len(ends)]
    step = ends[:, 1] - at[:, 1]
    long = (np.abs(step) >= HALF_TURN_DEG) & ~((np.abs(at[:, 0]) == 90.0) & (ends[:, 0] == at[:, 0]))
    if not closed:  # nobody draws a line around the globe by one edge
        long &= np.abs((step + 180.0) % 360.0 - 180.0) > ACROSS_DEG
    if not long.any():
        return "" if width <= MOST_LON_DEG else f"the {width:g}° of longitude are more than {MOST_LON_DEG:g}°; cut it"
    k = int(long.argmax())
    (lat0, lon0), (lat1, lon1) = at[k], ends[k]
    cure = (
        f"across the 180° meridian write {_beyond(lon0, lon1)} (or cut the zone there in two), the other way put a "
        "corner between"
    )
    if round(float(np.sum((step + 180.0) % 360.0 - 180.0)) / 360.0):
        cure += "; a zone that holds a pole has corners at the pole with the first and the last longitude"
    return (
        f"the edge from {lat0:.6g}, {lon0:.7g} to {lat1:.6g}, {lon1:.7g} spans {abs(step[k]):.6g}° of longitude, and "
        f"from {HALF_TURN_DEG:g}° on it may run on either side of the globe: {cure}"
    )


def is_world(ring: Sequence[Corner]) -> bool:
    """Whether an outline in degrees is so wide that its holes, if it has some, are keep-in areas."""
    return _width_deg(ring) >= HALF_TURN_DEG


def across(points: Sequence[Corner], holes: int = 0) -> tuple[Sequence[Corner], tuple[Corner, ...]]:
    """The corners of a polygon with longitudes past the antimeridian where it crosses it, and where it lies if not.

    The second is a rectangle from which its surroundings are left out. It is empty, and the points are unchanged, if
    they do not cross the antimeridian by the rule of `ACROSS_DEG`, or if there are ``holes``.
    """
    if holes or len(points) < 3 or not _width_deg(points) >= 360.0 - ACROSS_DEG:
        return points, ()
    at = np.asarray(points, float)
    step = np.diff(at[:, 1], append=at[0, 1])
    short = (step + 180.0) % 360.0 - 180.0
    long = np.abs(step) >= HALF_TURN_DEG
    turned = unwrapped(points, float(at[0, 1]))
    (west, south), (east, north) = turned.min(axis=0), turned.max(axis=0)
    is_strip = east - west < ACROSS_PART * (north - south)
    if is_strip or not (long.any() and (np.abs(short[long]) <= ACROSS_DEG).all() and abs(short.sum()) < 1.0):
        return points, ()
    highest = min(max(abs(south), abs(north)) + 2.0, 89.0)
    spare = math.degrees(1.1 * ZONE_FAR_M / 6.35e6) / math.cos(math.radians(highest))
    low, high = float(east) + spare, float(west) + 360.0 - spare
    ring = [(float(lat), float(lon)) for lon, lat in turned]
    other = ((float(south), low), (float(south), high), (float(north), high), (float(north), low))
    return ring, other if low < high else ()


def _width_deg(points: Sequence[Corner]) -> float:
    """The range of longitudes as they are written; plain Python, as most outlines have few corners and are narrow."""
    lons = [lon for _, lon in points]
    return max(lons, default=0.0) - min(lons, default=0.0)


def _beyond(lon0: float, lon1: float) -> str:
    """Which longitude to write instead so that an edge runs the short way."""
    west, east = min(lon0, lon1), max(lon0, lon1)
    return (
        f"{west + 360.0:.7g} for {west:.7g}" if west + 360.0 <= MOST_LON_DEG else f"{east - 360.0:.7g} for {east:.7g}"
    )


def turned(points: Sequence[Corner], near_lon_deg: float) -> Floats:
    """(N, 2) longitude, latitude, all turned by the same whole turns so that the first is near ``near_lon_deg``."""
    p = np.asarray(points, float)
    return np.stack([p[:, 1] + _turns(p[0, 1], near_lon_deg), p[:, 0]], axis=-1)


def _turns(lon_deg: ArrayLike, near_lon_deg: float) -> Floats:
    """The whole turns, degrees, that bring longitudes near ``near_lon_deg``."""
    return np.asarray(360.0 * np.round((near_lon_deg - np.asarray(lon_deg)) / 360.0))


def _with_great_circles(ring: Floats, frame: Frame) -> list[Floats]:
    """The outlines near a place of all that a ring (N, 2) longitude, latitude encloses by either kind of edges."""
    bent = _great_circles(ring, np.roll(ring, -1, axis=0), _window(frame))
    if bent is None:
        return [ring]
    import shapely

    both = np.concatenate([ring, bent])  # one line along both, for they begin at the same corner
    most = MOST_CROSSINGS + 8 * len(ring)  # at a corner two edges touch two others, which counts for each
    if len(ring) > FEW_EDGES and (overlapping_pairs(both) > MOST_EDGE_PAIRS or crossings(both, most) > most):
        raise InputError(
            f"its outline of {len(ring)} corners has so many long edges beside each other that it would take minutes "
            "to find the area that they enclose along great circles; simplify it"
        )
    whole = shapely.union_all([shapely.Polygon(ring), shapely.make_valid(shapely.Polygon(bent))])
    parts = [p for p in shapely.get_parts(whole) if p.geom_type == "Polygon"]
    return [np.asarray(p.exterior.coords)[:-1] for p in parts]


def _great_circles(begins: Floats, ends: Floats, window: tuple[float, float, float, float]) -> Floats | None:
    """The edges (N, 2) longitude, latitude along great circles, without the last end; None if straight ones will do.

    On the sphere of geodetic latitudes; edges are shorter than half a turn. One that ends at a pole goes along the
    other end's meridian. Edges over other longitudes than the ``window``'s, and those that lie north or south of it
    either way, stay straight: the side of a place on which they cross its meridian decides which polygon holds it.
    """
    long = _may_follow_great_circle(begins, ends)
    west, east = np.minimum(begins[:, 0], ends[:, 0]), np.maximum(begins[:, 0], ends[:, 0])
    long &= np.any([(east >= window[0] + turn) & (west <= window[2] + turn) for turn in TURNS_DEG], axis=0)
    south, north = latitudes_between(begins[:, ::-1], ends[:, ::-1])
    long &= (north >= window[1]) & (south <= window[3])
    if not long.any():
        return None
    found: list[Floats] = []
    any_bent, count = False, 0
    for begin, end, is_long in zip(begins, ends, long.tolist(), strict=True):
        if is_long and max(abs(begin[1]), abs(end[1])) >= POLE_DEG:
            found.append(np.array([begin, (end[0], begin[1]) if abs(begin[1]) >= POLE_DEG else (begin[0], end[1])]))
            any_bent = True
            continue
        bow_m = _bow_m(begin, end) if is_long else 0.0
        if bow_m <= GREAT_CIRCLE_M:
            found.append(begin[None])
            continue
        any_bent = True
        part = np.arange(n := min(MOST_PIECES, math.ceil(2.0 * math.sqrt(bow_m / EDGE_BOW_M)))) / n
        if (count := count + n) > MOST_PIECES_OF_ALL:
            raise InputError(f"a zone of {len(begins)} corners has too many long edges for great circles; simplify it")
        along = _along_great_circle(begin, end, part)
        along[0] = begin
        found.append(along)
    return np.concatenate(found) if any_bent else None


def along_great_circles(ring: Sequence[Corner]) -> list[Corner] | None:
    """The corners of an outline (latitude, longitude) along great circles; None if straight edges will do.

    Raises InputError beyond `MOST_PIECES_OF_ALL`.
    """
    at = np.asarray(ring, float)[:, ::-1]
    bent = _great_circles(at, np.roll(at, -1, axis=0), (-720.0, -90.0, 720.0, 90.0))
    return None if bent is None else [(float(lat), float(lon)) for lon, lat in bent]


def _may_follow_great_circle(begins: Floats, ends: Floats) -> Bools:
    """(N,) whether edges, (N, 2) longitude, latitude, may lie farther than `GREAT_CIRCLE_M` from great circles."""
    (span, rise), high = np.abs(ends - begins).T, np.maximum(np.abs(begins[:, 1]), np.abs(ends[:, 1]))
    steep = np.tan(np.radians(np.minimum(high, 89.9)))
    # A geodesic turns by sin f cos f l² and by 2 sin f l b, over b and l of latitude and longitude.
    rough_m = steep * METRES_OF_DEGREE**2 * span * (span + 2.0 * rise) / (7.0 * 6.3e6)
    rough_m[span > 90.0] = np.inf
    level = (high >= POLE_DEG) & (begins[:, 1] == ends[:, 1])  # along the pole
    return np.asarray((rough_m > GREAT_CIRCLE_M) & ~level & (span < HALF_TURN_DEG))


def latitudes_between(begins: ArrayLike, ends: ArrayLike) -> tuple[Floats, Floats]:
    """(N,) least and greatest latitudes of edges (N, 2) latitude, longitude, as straight lines or great circles.

    With x from one end and D the longitudes between them, the tangent of a great circle's latitude is the sum of the
    ends' tangents, weighted by sin(D - x)/sin(D) and sin(x)/sin(D), whose sum is from 1 to 1/cos(D/2). The shorter way
    counts.
    """
    a, b = np.asarray(begins, float), np.asarray(ends, float)
    span = np.abs((b[:, 1] - a[:, 1] + 180.0) % 360.0 - 180.0)
    most = 1.0 / np.maximum(np.cos(np.radians(0.5 * span)), 1e-9)
    low, high = np.minimum(a[:, 0], b[:, 0]), np.maximum(a[:, 0], b[:, 0])
    bent = [np.degrees(np.arctan(most * np.tan(np.radians(lat)))) for lat in (low, high)]
    return np.where(low < 0.0, bent[0], low), np.where(high > 0.0, bent[1], high)


def _bow_m(begin: Floats, end: Floats) -> float:
    """How far an edge's great circle lies from the line that is straight in degrees at most, m; at 63 places of it."""
    span, rise = end - begin
    arc = _along_great_circle(begin, end, np.arange(1, 64) / 64.0)
    north = np.abs(arc[:, 1] - begin[1] - (arc[:, 0] - begin[0]) * (rise / span))
    wide = abs(span) * math.cos(math.radians(min(abs(begin[1]), abs(end[1])))) if begin[1] * end[1] > 0.0 else abs(span)
    return float(METRES_OF_DEGREE * north.max() * wide / math.hypot(wide, rise))


def _along_great_circle(begin: Floats, end: Floats, part: Floats) -> Floats:
    """(N, 2) longitude, latitude of places on an edge's great circle, at parts of its length."""
    lon, lat = np.radians([begin[0], end[0]]), np.radians([begin[1], end[1]])
    a, b = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)
    angle = 2.0 * math.atan2(float(np.linalg.norm(a - b)), float(np.linalg.norm(a + b)))
    x, y, z = (np.sin((1.0 - part) * angle)[:, None] * a + np.sin(part * angle)[:, None] * b).T
    turned = (np.degrees(np.arctan2(y, x)) - begin[0] + 180.0) % 360.0 - 180.0
    return np.stack([begin[0] + turned, np.degrees(np.arctan2(z, np.hypot(x, y)))], axis=-1)


def unwrapped(points: Sequence[Corner] | Floats, near_lon_deg: float) -> Floats:
    """(N, 2) longitude, latitude; the first near ``near_lon_deg``, each within half a turn of the one before."""
    p = np.asarray(points, float)
    steps = np.diff(p[:, 1], prepend=near_lon_deg)
    lon = near_lon_deg + np.cumsum((steps + 180.0) % 360.0 - 180.0)
    # The sum of steps loses bits, so each longitude is returned exactly, plus whole turns.
    return np.stack([p[:, 1] + 360.0 * np.round((lon - p[:, 1]) / 360.0), p[:, 0]], axis=-1)


def cut_edges(begins: Floats, ends: Floats, frame: Frame) -> Floats:
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


def _may_bow(start: Floats, end: Floats) -> Bools:
    """(N,) whether edges, (N, 2) longitude, latitude, may lie farther than `EDGE_BOW_M` from their chords in the plane.

    An edge of length s at latitude f bows by at most (0.18 tan f + 0.02) s²/R, a fifth of the value compared here.
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
