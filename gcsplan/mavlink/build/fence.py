"""No-fly zones and keep-in areas as the items of a MAVLink fence, and back.

A fence item is a circle or one corner of a polygon and has **no height**, so it cannot express a zone with a floor or a
ceiling. Such a zone is left out, or on request becomes a fence from the ground to the sky. A circle's radius is rounded
up to whole centimetres; the polygon of the fence deviates from a zone's outline by at most `FENCE_STRAIGHT_M`. Items
are in frame 0: ArduPilot refuses frame 2, and no autopilot stores the altitude.

Of keep-in areas one inclusion polygon is made, and an exclusion polygon for each hole in it: autopilots differ in what
several inclusion areas mean, and a flight cannot leave the piece in which its home is. It holds the areas whatever
their heights, drawn larger by `FENCE_GROWN_M`, or by as much as its corners must be fewer: it only guards what was
proved.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.figures import counted
from gcsplan.mavlink.mission.autopilots import max_items, profile_of
from gcsplan.mavlink.mission.commands import CIRCLE_IN, CIRCLE_OUT, FENCE_RETURN_POINT, POLYGON_IN, POLYGON_OUT
from gcsplan.mavlink.mission.mission import FENCE, GLOBAL, MissionItem, degrees_e7, float32
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot
from gcsplan.world.geodesy.degree_shapes import LARGEST_RADIUS_M, near_circle, near_polygons, outline_of, unwrapped
from gcsplan.world.geometry.outlines import WIDER_M, few_corners
from gcsplan.world.geometry.zones import Circle, KeepIn, Polygon, Zone, keep_in_of, no_fly_of

if TYPE_CHECKING:
    import shapely

    from gcsplan.world.geodesy.frame import Frame

FENCE_STRAIGHT_M = 0.1
"""Metres: a corner of the outline that lies within this of the line between its kept neighbours is left out."""

FENCE_GROWN_M = 0.2
"""Metres by which keep-in areas are drawn larger, more than rounding takes off."""

MOST_FENCE_CORNERS = 255  # of one polygon on ArduPilot, which stores the number in a byte (AC_PolyFence_loader.cpp)
STORAGE_BYTES = {Autopilot.ARDUCOPTER: 560, Autopilot.ARDUPLANE: 672}  # StorageManager.cpp, StorageFence
HEAD_BYTES, CIRCLE_BYTES, POLYGON_BYTES, CORNER_BYTES = 5, 13, 2, 8  # AC_PolyFence_loader.cpp; 42 circles fit a copter


@dataclass(frozen=True, slots=True)
class Area:
    """One area of a fence in the plane; ``inclusion``: the vehicle must stay inside.

    ``shapes``: its parts near the frame's origin: none if the area is far away, several if several parts are near.
    """

    name: str
    shapes: tuple[Circle | Polygon, ...]
    inclusion: bool


@dataclass(frozen=True, slots=True)
class Fence:
    """A fence for one autopilot: its items in wire order, the zones in it, and ``notes`` for the user.

    The areas of ``zones`` come first; the areas behind them are a file's own. ``left_out`` names the zones that a fence
    cannot express.
    """

    items: tuple[MissionItem, ...]
    zones: tuple[Zone, ...]
    left_out: tuple[str, ...] = ()
    notes: tuple[Note, ...] = ()


def fence_of(
    zones: Sequence[Zone], frame: Frame, autopilot: Autopilot, *, infinite: bool = False,
    own: Sequence[MissionItem] = (), home: tuple[float, float] | None = None,
) -> Fence:  # fmt: skip
    """Return the fence that keeps an aircraft out of ``zones`` and in the piece of keep-in areas around ``home``, and
    all of ``own``, a file's own fence.

    ``home``: latitude and longitude; None: the frame's origin. Zones with a floor or a ceiling are left out and named;
    with ``infinite`` they are included without floor and ceiling. A circle inside another one is dropped, and so is an
    area of ``own`` that is a zone's already. Raises InputError if the autopilot cannot store the fence, or ``own`` has
    parts that are not whole.
    """
    notes: list[Note] = []
    areas, zones = keep_in_of(zones), no_fly_of(zones)
    bounded = [z for z in zones if z.floor is not None or z.ceiling is not None]
    taken = list(zones) if infinite else [z for z in zones if z.floor is None and z.ceiling is None]
    if bounded and infinite:
        notes.append(Note("fence_without_heights", names=_names(bounded)))
    elif bounded:
        notes.append(Note("fence_leaves_out", names=_names(bounded)))
    inside = [z for k, z in enumerate(taken) if any(_holds(o, z, j < k) for j, o in enumerate(taken) if j != k)]
    if inside:
        notes.append(Note("fence_circles_inside", names=_names(inside)))
    taken = [z for z in taken if z not in inside]
    parts = [tuple(_circle(z.shape, frame) if isinstance(z.shape, Circle) else _corners(z, frame)) for z in taken]
    if areas:
        origin = (0.0, 0.0) if home is None else tuple(frame.to_plane(*home).tolist())
        outline, *holes = _kept_in(areas, origin, _corners_left([*parts, *parts_of(own)], autopilot), notes)
        parts += [tuple(_corners(outline, frame, POLYGON_IN)), *(tuple(_corners(hole, frame)) for hole in holes)]
        taken += [outline, *holes]
    known = {tuple(map(_wire, part)) for part in parts}
    more = [part for part in parts_of(own) if tuple(map(_wire, part)) not in known]
    names = [f"the zone {z.name!r}" for z in taken] + [f"the file's own area {k}" for k in range(1, len(more) + 1)]
    require_storage([*parts, *more], autopilot, names)
    left_out = () if infinite else tuple(z.name for z in bounded)
    return Fence(tuple(item for part in (*parts, *more) for item in part), tuple(taken), left_out, tuple(notes))


def parts_of(items: Sequence[MissionItem]) -> list[tuple[MissionItem, ...]]:
    """The items of each area of a fence; return points (5000) are skipped. Raises InputError for one not whole."""
    parts: list[tuple[MissionItem, ...]] = []
    index = 0
    while index < len(items):
        item = items[index]
        if item.command == FENCE_RETURN_POINT:
            index += 1
            continue
        if item.command not in (CIRCLE_IN, CIRCLE_OUT, POLYGON_IN, POLYGON_OUT):
            raise InputError(f"item {index} of the fence is command {item.command}, which no fence has")
        count = 1.0 if item.command in (CIRCLE_IN, CIRCLE_OUT) else item.params[0]
        corners = items[index : index + int(count)] if math.isfinite(count) and count >= 1 else []
        whole = [c for c in corners if c.command == item.command and (count == 1 or c.params[0] == count)]
        if len(whole) != count or (item.command in (POLYGON_IN, POLYGON_OUT) and count < 3):
            raise InputError(f"item {index} of the fence begins a polygon of {count:g} corners that is not whole")
        parts.append(tuple(whole))
        index += len(whole)
    return parts


def _wire(item: MissionItem) -> tuple[int, float, int, int]:
    """What an autopilot keeps of a fence's item."""
    return item.command, float32(item.params[0]), item.x, item.y


def areas_of(items: Sequence[MissionItem], frame: Frame) -> list[Area]:
    """Return the areas of a fence from its wire items; return points (5000) are skipped.

    Raises InputError for a polygon that is incomplete or not simple, a radius that is not positive or beyond
    `LARGEST_RADIUS_M`, latitudes or longitudes out of range, and other commands.
    """
    areas: list[Area] = []
    index = 0
    for part in parts_of(items):
        index = items.index(part[0], index)
        command = part[0].command
        circle = command in (CIRCLE_IN, CIRCLE_OUT)
        shapes = _circle_of(part[0], index, frame) if circle else _polygon_of(part, index, frame)
        areas.append(Area(f"fence {len(areas) + 1}", shapes, command in (CIRCLE_IN, POLYGON_IN)))
        index += len(part)
    return areas


def _circle_of(item: MissionItem, index: int, frame: Frame) -> tuple[Circle, ...]:
    radius_m = item.params[0]
    if not 0.0 < radius_m < math.inf:
        raise InputError(f"item {index} of the fence is a circle with a radius of {radius_m:g} m")
    if radius_m > LARGEST_RADIUS_M:
        raise InputError(
            f"item {index} of the fence is a circle with a radius of {radius_m:g} m, more than {LARGEST_RADIUS_M:g} m: "
            "use a polygon"
        )
    circle = near_circle(frame.to_plane(*_corner(item, index)).tolist(), radius_m)
    return () if circle is None else (circle,)


def _polygon_of(corners: Sequence[MissionItem], index: int, frame: Frame) -> tuple[Polygon, ...]:
    """Return the parts near the frame's origin of the polygon that begins at ``index``."""
    places = [_corner(c, index + k) for k, c in enumerate(corners)]  # the wire has no longitudes past the antimeridian
    ring, fault = outline_of([(float(lat), float(lon)) for lon, lat in unwrapped(places, places[0][1])])
    if fault:
        raise InputError(f"item {index} of the fence: {fault}")
    return tuple(near_polygons(ring, frame))


def _corner(item: MissionItem, index: int) -> tuple[float, float]:
    lat, lon = item.lat_deg, item.lon_deg
    if abs(lat) > 90.0 or abs(lon) > 180.0:
        raise InputError(f"item {index} of the fence lies at {lat:.7f}, {lon:.7f}: not a place on Earth")
    return lat, lon


def _circle(circle: Circle, frame: Frame) -> list[MissionItem]:
    lat, lon = (float(x) for x in frame.to_degrees(circle.east_m, circle.north_m))
    cm = circle.radius_m * 100.0
    radius_m = math.ceil(cm - max(1e-6, 1.2e-7 * cm)) / 100.0  # whole centimetres stay the same after float32
    return [MissionItem(CIRCLE_OUT, GLOBAL, (radius_m, 0.0, 0.0, 0.0), degrees_e7(lat), degrees_e7(lon))]


def _kept_in(
    areas: Sequence[KeepIn], home: tuple[float, ...], most_corners: int, notes: list[Note]
) -> list[Zone]:  # fmt: skip
    """The outline around the piece of keep-in areas that is nearest to ``home`` (east_m, north_m), and its holes."""
    import shapely

    names = tuple(repr(area.name) for area in areas)
    shapes = [part.shape() for area in areas for part in area.parts]
    if not shapes:
        raise InputError(f"the keep-in areas {', '.join(names)} are far from the mission: no fence is made of them")
    grown = shapely.buffer(shapely.union_all(shapes), FENCE_GROWN_M, join_style="mitre")
    pieces = list(shapely.get_parts(grown))
    piece = min(pieces, key=lambda p: float(p.distance(shapely.Point(home))))
    if len(pieces) > 1:
        notes.append(Note("fence_of_one_piece", count=len(pieces)))
    if any(area.floor is not None or area.ceiling is not None for area in areas):
        notes.append(Note("fence_areas_without_heights", names=names))
    title = "keep-in areas" if len(areas) > 1 else areas[0].name
    outline = _open_ring(piece.exterior)
    few = few_corners(outline, max(most_corners, 3), outward=True)
    if few is not None and len(few) < len(outline):
        notes.append(Note("fence_area_wider", given=len(outline), corners=len(few), wider_m=WIDER_M[-1]))
    found = [Zone(title, Polygon(outline if few is None else few))]
    return found + [Zone(f"hole in {title}", Polygon(_open_ring(hole))) for hole in piece.interiors]


def _open_ring(ring: shapely.LinearRing) -> Floats:
    """Its corners, counter-clockwise, not closed."""
    corners = np.asarray(ring.coords)[:-1]
    return np.ascontiguousarray(corners if ring.is_ccw else corners[::-1])


def _corners_left(parts: Sequence[Sequence[MissionItem]], autopilot: Autopilot) -> int:
    """How many corners one more polygon may have for the autopilot to store it beside other areas."""
    left = max_items(autopilot, FENCE) - sum(map(len, parts))
    if (storage := STORAGE_BYTES.get(autopilot)) is not None:
        left = min(left, MOST_FENCE_CORNERS, (storage - _bytes_of(parts) - POLYGON_BYTES) // CORNER_BYTES)
    return left


def _corners(zone: Zone, frame: Frame, command: int = POLYGON_OUT) -> list[MissionItem]:
    assert isinstance(zone.shape, Polygon)
    ring = _straightened(zone.shape.vertices)
    places = frame.to_degrees(ring[:, 0], ring[:, 1])
    count = float(len(ring))
    return [
        MissionItem(command, GLOBAL, (count, 0.0, 0.0, 0.0), degrees_e7(lat), degrees_e7(lon))
        for lat, lon in places.tolist()
    ]


def _straightened(ring: Floats) -> Floats:
    """Return the ring without the corners that lie within `FENCE_STRAIGHT_M` of the line between kept ones."""
    start = int(np.hypot(*(ring - ring.mean(axis=0)).T).argmax())  # the farthest point is certainly a corner
    points = np.roll(ring, -start, axis=0)
    kept = [0]
    while kept[-1] < len(points):
        here, last = kept[-1], kept[-1] + 1
        for end in range(here + 2, len(points) + 1):
            a, b = points[here], points[end % len(points)]
            along = b - a
            length = float(np.hypot(*along))
            between = points[here + 1 : end] - a
            if length <= 0.0:
                break
            off = np.abs(between[:, 0] * along[1] - between[:, 1] * along[0]) / length
            part = between @ along / length**2
            if off.max() > FENCE_STRAIGHT_M or part.min() < 0.0 or part.max() > 1.0:
                break
            last = end
        kept.append(last)
    chosen = kept[:-1]
    return points[chosen] if len(chosen) >= 3 else ring


def require_storage(parts: Sequence[Sequence[MissionItem]], autopilot: Autopilot, names: Sequence[str]) -> None:
    """Raise InputError if the autopilot cannot store a fence of these areas; ``names`` names them in messages."""
    label = profile_of(autopilot).label
    cure = "leave zones out, or join them into fewer and simpler ones"
    items = [item for part in parts for item in part]
    for part, name in zip(parts, names, strict=True):
        if autopilot.is_ardupilot and len(part) > MOST_FENCE_CORNERS:
            raise InputError(f"{name} has {len(part)} corners; {label} keeps {MOST_FENCE_CORNERS}: {cure}")
    circles = sum(item.command in (CIRCLE_IN, CIRCLE_OUT) for item in items)
    polygons = len(parts) - circles
    corners = len(items) - circles
    what = f"{counted(circles, 'circle')} and {counted(polygons, 'polygon')} with {counted(corners, 'corner')}"
    most = max_items(autopilot, FENCE)
    if len(items) > most:
        raise InputError(f"the fence has {counted(len(items), 'item')} ({what}) and {label} keeps {most}: {cure}")
    storage = STORAGE_BYTES.get(autopilot)
    if storage is not None and _bytes_of(parts) > storage:
        fits = (storage - HEAD_BYTES) // CIRCLE_BYTES
        raise InputError(f"the fence of {what} does not fit: {label} has room for {fits} circles, or so: {cure}")


def _bytes_of(parts: Sequence[Sequence[MissionItem]]) -> int:
    """The bytes that a fence takes in ArduPilot's storage."""
    circles = sum(part[0].command in (CIRCLE_IN, CIRCLE_OUT) for part in parts)
    polygons, corners = len(parts) - circles, sum(map(len, parts)) - circles
    return HEAD_BYTES + CIRCLE_BYTES * circles + POLYGON_BYTES * polygons + CORNER_BYTES * corners


def _holds(outer: Zone, inner: Zone, first: bool) -> bool:
    """Whether circle ``outer`` contains circle ``inner``; of two equal circles the ``first`` contains the other."""
    a, b = outer.shape, inner.shape
    if not (isinstance(a, Circle) and isinstance(b, Circle)):
        return False
    slack = a.radius_m - b.radius_m - math.hypot(a.east_m - b.east_m, a.north_m - b.north_m)
    return slack >= 0.0 and (a.radius_m > b.radius_m or first)


def _names(zones: Sequence[Zone]) -> tuple[str, ...]:
    return tuple(repr(z.name) for z in zones)
