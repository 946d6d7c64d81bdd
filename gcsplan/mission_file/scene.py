"""The place of a mission: its points, plane, part of the terrain, and zones, checked against each other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from gcsplan.dem.sources import source_or_path
from gcsplan.errors import InputError, Mistake, ProblemCode
from gcsplan.mission_file.published.times import Hours
from gcsplan.mission_file.values.places import Degrees
from gcsplan.mission_file.values.point_keys import LocalPoint
from gcsplan.mission_file.values.schema import FrameKeys, TerrainKeys, ZoneKeys
from gcsplan.mission_file.zones.draft import (
    SIZE_KEYS,
    Bounds,
    ZoneDraft,
    check_degrees,
    check_size,
    circle,
    corridor,
    polygon,
)
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.degree_shapes import MOST_LON_DEG
from gcsplan.world.geodesy.frame import FARTHEST_M, Frame, centre_of
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Box, Circle, KeepIn, Level, Polygon, Zone
from gcsplan.world.terrain.peaks import Peak
from gcsplan.world.terrain.terrain import OpenTerrain, TerrainSpec

MARGIN_M, MARGIN_PART, MARGIN_MOST_M = 3000.0, 1.0, 25_000.0
"""Margin for detours: the first, m, or this part of the points' extent if larger, up to the third, m."""

LOCAL_MARGIN_M, LOCAL_MARGIN_PART = 50.0, 0.5

FLOOR_NOISE_M = 1e-6
"""A floor of an area this much above the ground, m, is on it: rounding."""

OF_FILES = {"kinds", "authorised", "flight_level_error_m"}
"""Keys of a zone that belong to a file of an authority."""

_MANY_NODES = 250_000

NO_FILES: Mapping[str, bytes] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class MissionPlace:
    """A point as written: in degrees, or in metres of the local frame with a height above its zero or the ground."""

    where: str
    degrees: tuple[float, float] | None = None
    metres: tuple[float, float] | None = None
    up_m: float | None = None
    agl_m: float | None = None

    def in_plane(self, frame: Frame) -> tuple[float, float]:
        """East and north, metres."""
        if self.metres is not None:
            return self.metres
        assert self.degrees is not None
        east, north = frame.to_plane(*self.degrees)
        return float(east), float(north)

    def in_degrees(self, frame: Frame) -> tuple[float, float]:
        """Latitude and longitude; unchanged if they were written in degrees."""
        if self.degrees is not None:
            return self.degrees
        assert self.metres is not None
        lat, lon = frame.to_degrees(*self.metres)
        return float(lat), float(lon)


def make_place(
    point: Degrees | LocalPoint, where: str, problems: list[Mistake], notes: list[Note], *, local: bool,
    most_lon_deg: float = 180.0,
) -> MissionPlace | None:  # fmt: skip
    """A point of the file; None, and ``problems``, if it cannot be a place."""
    if isinstance(point, LocalPoint):
        if not local:
            problems.append(Mistake(where, "local metres need `frame: {origin: [lat, lon], amsl_m: …}` in the mission"))
            return None
        return MissionPlace(where, None, (point.east_m, point.north_m), point.up_m, point.agl_m)
    degrees = (point.lat_deg, point.lon_deg)
    if not check_degrees(degrees, where, problems, most_lon_deg):
        return None
    notes += place_notes(point, where)
    return MissionPlace(where, degrees, agl_m=point.agl_m)


def make_places(
    points: Sequence[Degrees | LocalPoint], where: str, problems: list[Mistake], notes: list[Note], *, local: bool
) -> list[MissionPlace | None]:
    """The points of a list of the file, as by `make_place`; ``where`` is its key."""
    return [make_place(p, f"{where}[{i}]", problems, notes, local=local) for i, p in enumerate(points)]


def place_notes(point: Degrees, where: str) -> list[Note]:
    """Notes for the user on how a place was read; ``where`` is its key behind the name of the file."""
    return [point.note.of(place=where.split(": ", 1)[-1])] if point.note else []


def make_spec(keys: TerrainKeys, folder: Path, held: Mapping[str, bytes] = NO_FILES) -> TerrainSpec:
    """The terrain in the form of `gcsplan.world.terrain.terrain`; paths are relative to the mission file's folder,
    but for the names of ``held`` files."""
    dem = () if keys.dem is None else (keys.dem,) if isinstance(keys.dem, str) else tuple(keys.dem)
    return TerrainSpec(
        dem=tuple(d if d.startswith("sample:") or d in held else source_or_path(d, folder) for d in dem),
        held={d: held[d] for d in dem if d in held},
        vertical_datum=keys.vertical_datum,
        geoid_grid=None if keys.geoid_grid is None else str(folder / keys.geoid_grid),
        crs=keys.crs,
        height_unit=keys.height_unit,
        nodata=keys.nodata,
        flat_m=keys.flat_m,
        peaks=tuple(Peak(p.center[0], p.center[1], p.height_m, p.decay_m[0], p.decay_m[1]) for p in keys.peaks or ()),
        obstacle_height_m=keys.obstacle_height_m,
        canopy=None if keys.canopy is None else str(folder / keys.canopy),
        canopy_nodata_m=keys.canopy_nodata_m,
        sea=keys.sea,
    )


def covered(places: Sequence[MissionPlace], terrain: OpenTerrain, problems: list[Mistake]) -> list[MissionPlace]:
    """The places that the DEM covers; the others go to ``problems``, with a guess at swapped numbers."""
    good = []
    for place in places:
        code: ProblemCode = ""
        if place.degrees is None or terrain.covers(*place.degrees):
            good.append(place)
            continue
        lat, lon = place.degrees
        if abs(lon) <= 90.0 and terrain.covers(lon, lat):
            code = "swapped"
            message = f"latitude and longitude look swapped: the DEM holds [{lon:g}, {lat:g}], not [{lat:g}, {lon:g}]"
        else:
            message = f"{lat:g}, {lon:g} lies outside the DEM, where the ground is unknown; add the tile of this place"
        problems.append(Mistake(place.where, message, code))
    return good


def make_frame(
    places: Sequence[MissionPlace], keys: FrameKeys | None, problems: list[Mistake], where: str
) -> Frame | None:
    """The mission's plane; None, and ``problems``, if the points are too far apart for one plane."""
    try:
        if keys is not None:
            frame = Frame(keys.origin.lat_deg, keys.origin.lon_deg, keys.amsl_m)
        else:
            points = np.array([p.degrees for p in places if p.degrees is not None])
            frame = Frame(*centre_of(points[:, 0], points[:, 1]))
    except InputError as why:
        problems.append(Mistake(f"{where}frame.origin" if keys is not None else places[0].where, why.message))
        return None
    away = [(math.hypot(*p.in_plane(frame)), p) for p in places]
    if all(d <= FARTHEST_M for d, _ in away):
        return frame
    distance, place = max(away, key=lambda x: math.inf if math.isnan(x[0]) else x[0])
    what = "from the frame's origin" if keys is not None else "from the middle of the mission's points"
    far = f"lies {distance / 1000:.0f} km" if math.isfinite(distance) else "lies too far"
    words = f"{far} {what}, more than {FARTHEST_M / 1000:.0f} km; {_slip(place, places) or 'is it the right place?'}"
    problems.append(Mistake(place.where, words))
    return None


def _slip(place: MissionPlace, places: Sequence[MissionPlace]) -> str:
    """The slip of the pen that sets one place far from the others, or an empty text."""
    others = [p.degrees for p in places if p is not place and p.degrees is not None]
    if place.degrees is None or not others:
        return ""

    def near(one: tuple[float, float], rest: Sequence[tuple[float, float]]) -> bool:
        lat, lon = np.array([one, *rest]).T
        if np.abs(lat).max() > 85.0:
            return False
        middle = Frame(*centre_of(lat, lon))
        return bool((np.linalg.norm(middle.to_plane(lat, lon), axis=-1) <= FARTHEST_M).all())

    lat, lon = place.degrees
    if near((lon, lat), others):
        return f"are latitude and longitude swapped? [{lon:.10g}, {lat:.10g}] lies near the others"
    # A minus is more easily forgotten than written without need, so that the positive number is the wrong one.
    for k, p in enumerate(places):
        if p.degrees is None:
            continue
        rest = [q.degrees for i, q in enumerate(places) if i != k and q.degrees is not None]
        own_lat, own_lon = p.degrees
        for mended, wrong in (((own_lat, -own_lon), own_lon), ((-own_lat, own_lon), own_lat)):
            if wrong > 0.0 and near(mended, rest):
                key = "it" if p is place else p.where.rpartition(": ")[2]
                return f"is a minus missing? With {-wrong:.10g} {key} lies near the others"
    return ""


def make_box(points: Sequence[tuple[float, float]], zones: Sequence[Zone], *, local: bool) -> Box:
    """The part of the plane that a planner may need: the points with room for detours, and around near zones."""
    p = np.asarray(points, float)
    low, high = p.min(axis=0), p.max(axis=0)
    least, part = (LOCAL_MARGIN_M, LOCAL_MARGIN_PART) if local else (MARGIN_M, MARGIN_PART)
    extent = float((high - low).max())
    # A detour around a ridge may be as long as the mission itself, and the map's border must not prevent it.
    margin = max(least, min(part * extent, MARGIN_MOST_M), 0.25 * extent)
    box = np.array([*(low - margin), *(high + margin)])
    grown = box.copy()
    # Past the end of a zone twice its clearance must fit: from the zone, and from unknown ground.
    beside = max(least, 0.1 * extent)
    for zone in zones:
        west, south, east, north = zone.bounds
        if west < box[2] and east > box[0] and south < box[3] and north > box[1]:
            grown[:2] = np.minimum(grown[:2], (west - beside, south - beside))
            grown[2:] = np.maximum(grown[2:], (east + beside, north + beside))
    # A zone as large as a country must not make gcsplan load a country's DEM.
    grown[:2] = np.maximum(grown[:2], low - 3.0 * margin)
    grown[2:] = np.minimum(grown[2:], high + 3.0 * margin)
    return float(grown[0]), float(grown[1]), float(grown[2]), float(grown[3])


def plane_again(
    plane: tuple[Frame, Box] | None, places: Sequence[MissionPlace], own: Frame | None, *, local: bool
) -> tuple[Frame, Box] | None:
    """``plane``, a plane and a window in it, if all places lie within the window with the least room for detours; else
    None. ``own`` is the mission's own plane; a ``local`` mission has no other."""
    if plane is None or own is None:
        return None
    frame, box = plane
    if frame.amsl_m != own.amsl_m or (local and (frame.lat_deg, frame.lon_deg) != (own.lat_deg, own.lon_deg)):
        return None
    p = np.array([place.in_plane(frame) for place in places])
    least = LOCAL_MARGIN_M if local else MARGIN_M
    low, high = p.min(axis=0) - least, p.max(axis=0) + least
    return plane if (low >= box[:2]).all() and (high <= box[2:]).all() else None


def make_zones(
    keys: ZoneKeys, where: str, folder: Path, fallback: str, problems: list[Mistake], notes: list[Note], *, local: bool,
    hours: Hours | None = None, keep_in: bool = False, held: Mapping[str, bytes] = NO_FILES,
) -> list[ZoneDraft]:  # fmt: skip
    """The zones of one entry of ``no_fly`` or ``keep_in``: a single one, or all of a file, at the mission's ``hours``.

    With ``keep_in`` a file's holes are left out of its areas, and no file of an authority is read.
    ``held``: files that lie on no disk, by their names.
    """
    kinds = [k for k in ("center", "polygon", "line", "file") if getattr(keys, k) is not None]
    if len(kinds) != 1:
        given = " and ".join(kinds) or "none"
        choices = "give one of center (with radius_m), polygon, line (with buffer_m) and file"
        problems.append(Mistake(where, f"{choices}, given {given}"))
        return []
    if keys.file is not None:
        data = held.get(keys.file)
        path = folder / keys.file if data is None else Path(keys.file)
        return _zones_of_file(keys, path, data, where, problems, notes, hours, keep_in=keep_in)
    for key in sorted({"on_bad", "ignore", *OF_FILES} & keys.given.keys()):
        whose = " of an authority" if key in OF_FILES else ""
        problems.append(Mistake(f"{where}.{key}", f"belongs to a file{whose}"))
    return _own_zone(keys, where, fallback, problems, notes, local=local)


def _zones_of_file(
    keys: ZoneKeys, path: Path, data: bytes | None, where: str, problems: list[Mistake], notes: list[Note],
    hours: Hours | None, *, keep_in: bool,
) -> list[ZoneDraft]:  # fmt: skip
    others = sorted(keys.given.keys() - {"file", "layer", "on_bad", "ignore", *SIZE_KEYS, *OF_FILES})
    words = "stands in the file itself, in a feature's properties; leave it out here"
    problems += [Mistake(f"{where}.{k}", words) for k in others]
    sizes = [(getattr(keys, size), f"{where}.{size}") for size in SIZE_KEYS if getattr(keys, size) is not None]
    good = [check_size(size_m, at, problems) for size_m, at in sizes]
    if not all(good):
        return []
    from gcsplan.mission_file.published.policy import Policy  # imported here because most missions name no files
    from gcsplan.mission_file.zone_reader import read_zones

    kinds = None if keys.kinds is None else tuple(keys.kinds)
    try:
        policy = Policy(
            kinds, tuple(keys.authorised), hours, keys.flight_level_error_m, where, keys.on_bad, tuple(keys.ignore)
        )
        found = read_zones(
            path, where=f"{where}.file", radius_m=keys.radius_m, buffer_m=keys.buffer_m, layer=keys.layer,
            policy=policy, data=data, keep_in=keep_in,
        )  # fmt: skip
    except InputError as why:
        problems += why.problems
        return []
    problems += found.problems
    notes += found.notes
    return found.zones


def _own_zone(
    keys: ZoneKeys, where: str, fallback: str, problems: list[Mistake], notes: list[Note], *, local: bool
) -> list[ZoneDraft]:
    """The zone whose shape stands in the mission file."""
    name = keys.name or fallback
    bounds = Bounds(keys.floor_agl_m, keys.ceiling_agl_m, keys.floor_amsl_m, keys.ceiling_amsl_m)
    before = len(problems)
    kind = "center" if keys.center is not None else "polygon" if keys.polygon is not None else "line"
    points = [keys.center] if keys.center is not None else keys.polygon or keys.line or []
    at = [f"{where}.{kind}" if kind == "center" else f"{where}.{kind}[{i}]" for i in range(len(points))]
    places = [
        make_place(p, a, problems, notes, local=local, most_lon_deg=MOST_LON_DEG)
        for p, a in zip(points, at, strict=True)
    ]
    if len(problems) == before and len({isinstance(p, LocalPoint) for p in points}) > 1:
        problems.append(Mistake(f"{where}.{kind}", "give all corners in degrees, or all in local metres"))
    for size, owner, words in zip(
        SIZE_KEYS, ("center", "line"), ("the radius", "half the corridor's width"), strict=True
    ):
        if kind == owner and getattr(keys, size) is None:
            problems.append(Mistake(f"{where}.{size}", f"is missing: {words}, m", "missing"))
        if kind != owner and getattr(keys, size) is not None:
            problems.append(Mistake(f"{where}.{size}", f"belongs to a {owner}, not to a {kind}"))
    if keys.layer is not None:
        problems.append(Mistake(f"{where}.layer", "belongs to a file; leave it out"))
    if len(problems) > before:
        return []
    flat = [p.degrees or p.metres or (0.0, 0.0) for p in places if p is not None]
    in_metres = isinstance(points[0], LocalPoint) if points else local
    if keys.center is not None and keys.radius_m is not None:
        draft = circle(name, where, flat[0], keys.radius_m, bounds, problems, local=in_metres)
    elif keys.buffer_m is not None:
        draft = corridor(name, where, flat, keys.buffer_m, bounds, problems, local=in_metres)
    else:
        draft = polygon(name, where, flat, bounds, problems, local=in_metres)
    return [draft] if draft is not None else []


def settle_zones(placed: Sequence[tuple[ZoneDraft, Zone]], surface: Surface, problems: list[Mistake]) -> list[Zone]:
    """The zones after comparison with the ground.

    A zone wholly under ground goes to ``problems``. A floor nowhere above ground is removed (nothing passes below).
    """
    zones = []
    rows, cols = surface.ground_m.shape
    corners = surface.grid.to_plane([-1, cols, cols, -1], [-1, -1, rows, rows])
    spare_m = 0.1 * np.ptp(corners, axis=0)  # a grid in degrees has bent edges
    (west_m, south_m), (east_m, north_m) = corners.min(axis=0) - spare_m, corners.max(axis=0) + spare_m
    for draft, zone in placed:
        floor, ceiling = zone.floor, zone.ceiling
        west, south, east, north = zone.bounds
        if west > east_m or east < west_m or south > north_m or north < south_m:
            zones.append(zone)  # beside the terrain that is loaded, as most zones of a country are
            continue
        amsl = [level for level in (floor, ceiling) if level is not None and level.datum == "amsl"]
        ground = _ground_under(zone, surface) if amsl else None
        if ground is not None:
            low, high = ground
            if ceiling is not None and ceiling.datum == "amsl" and ceiling.value_m <= low:
                problems.append(
                    Mistake(
                        f"{draft.where}.ceiling_amsl_m",
                        f"the zone {draft.name!r} lies wholly under ground: its ceiling is at {ceiling.value_m:g} m "
                        f"AMSL, the lowest ground in it at {low:.1f} m",
                    )
                )
            elif (bottom := _crossed(floor, ceiling, low, high)) is not None:
                problems.append(
                    Mistake(
                        draft.where,
                        f"the floor of the zone {draft.name!r} is nowhere below its ceiling (at best {bottom:.1f} m "
                        "above it)",
                    )
                )
            if floor is not None and floor.datum == "amsl" and floor.value_m <= low:
                zone = replace(zone, floor=None)
        zones.append(zone)
    return zones


def settle_areas(areas: Sequence[KeepIn], surface: Surface) -> list[KeepIn]:
    """The keep-in areas after comparison with the ground: a floor that is nowhere above it is removed."""
    settled = []
    for area in areas:
        if area.floor is not None and area.floor.datum == "amsl":
            ranges = [_ground_under(Zone(area.name, Polygon(part.outline)), surface) for part in area.parts]
            lows = [ground[0] for ground in ranges if ground is not None]
            if lows and area.floor.value_m <= min(lows) + FLOOR_NOISE_M:
                area = replace(area, floor=None)
        settled.append(area)
    return settled


def zone_around(zones: Sequence[Zone], east_m: float, north_m: float, amsl_m: float, ground_m: float) -> Zone | None:
    """The first zone with the point strictly inside; a point on the border is outside."""
    for zone in zones:
        west, south, east, north = zone.bounds
        if not (west < east_m < east and south < north_m < north):
            continue
        shape = zone.shape
        if isinstance(shape, Circle):
            inside = math.hypot(east_m - shape.east_m, north_m - shape.north_m) < shape.radius_m
        else:
            import shapely  # imported here because many missions have no polygons

            inside = bool(shapely.Polygon(shape.vertices).contains(shapely.Point(east_m, north_m)))
        if (
            inside
            and (zone.floor is None or _amsl(zone.floor, ground_m) < amsl_m)
            and (zone.ceiling is None or amsl_m < _amsl(zone.ceiling, ground_m))
        ):
            return zone
    return None


def _amsl(level: Level, ground_m: float) -> float:
    return level.value_m + (ground_m if level.datum == "agl" else 0.0)


def _crossed(floor: Level | None, ceiling: Level | None, low: float, high: float) -> float | None:
    """Least height of a floor of one datum above a ceiling of the other, if it is above everywhere; None otherwise."""
    if floor is None or ceiling is None or floor.datum == ceiling.datum:
        return None
    gap = floor.value_m - ceiling.value_m + (low if floor.datum == "agl" else -high)
    return gap if gap >= 0.0 else None


def _ground_under(zone: Zone, surface: Surface) -> tuple[float, float] | None:
    """Lowest and highest known ground within a zone's outline; None if none is known.

    A bilinear surface has its extremes over a region at the nodes inside it and on its border.
    """
    shape = zone.shape
    west, south, east, north = zone.bounds
    at = surface.grid([west, east, east, west], [south, south, north, north])
    rows, cols = surface.ground_m.shape
    c0, r0 = np.maximum(np.floor(at.min(axis=0)).astype(int), 0)
    c1, r1 = np.minimum(np.ceil(at.max(axis=0)).astype(int) + 1, (cols, rows))
    if c1 <= c0 or r1 <= r0:
        return None
    if isinstance(shape, Circle):
        turn = np.linspace(0.0, 2.0 * math.pi, 257)
        border = np.stack(
            [shape.east_m + shape.radius_m * np.cos(turn), shape.north_m + shape.radius_m * np.sin(turn)], axis=-1
        )
    else:
        ring, following = shape.vertices, np.roll(shape.vertices, -1, axis=0)
        pieces = max(1, 512 // len(ring))
        f = (np.arange(pieces) / pieces)[:, None, None]
        border = (ring + f * (following - ring)).reshape(-1, 2)
    heights = surface.ground_at(border[:, 0], border[:, 1])
    block = surface.ground_m[r0:r1, c0:c1]
    if block.size <= _MANY_NODES:
        plane = surface.grid.to_plane(*np.meshgrid(np.arange(c0, c1), np.arange(r0, r1)))
        if isinstance(shape, Circle):
            inside = np.hypot(plane[..., 0] - shape.east_m, plane[..., 1] - shape.north_m) < shape.radius_m
        else:
            import shapely

            inside = shapely.contains_xy(shapely.Polygon(shape.vertices), plane[..., 0], plane[..., 1])
        block = block[inside]
    # With more nodes the whole rectangle is used: its extremes enclose the true ones, so no zone is refused wrongly.
    heights = np.concatenate([heights, block.ravel()])
    heights = heights[np.isfinite(heights)]
    return (float(heights.min()), float(heights.max())) if heights.size else None
