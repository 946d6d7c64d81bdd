"""The fence that zones make for a mission, and the places where a mission would breach one, its file's own included.

A fence that the mission would breach makes the vehicle turn round in the air. So a fence is made only after the whole
flight as the autopilot flies it, from the ground at the start to the ground at the goal, was found to keep the track
error and the clearance from every area of the fence: first with the mission file's values, and again with the vehicle's
parameters before the mission is sent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.flight.corners import round_corners
from gcsplan.check.flight.follow import follow_in
from gcsplan.check.judge import judge
from gcsplan.check.motion.project import legs_in_plane
from gcsplan.check.motion.stretch import on_globe
from gcsplan.check.motion.turn_parameters import DEFAULTS, Tuning
from gcsplan.check.verdict import Verdict
from gcsplan.errors import CheckFailed, InputError
from gcsplan.mavlink.build.fence import Area, Fence, areas_of, fence_of
from gcsplan.mavlink.mission.autopilots import profile_of
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.notes.note import Finding, Note
from gcsplan.vehicle import Vehicle
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.zones import Circle, Polygon, Zone
from gcsplan.world.world import World

FENCE_ROUNDING_M = 0.15


def fence_for(
    mission: Mission, vehicle: Vehicle, world: World, *, infinite: bool = False, rtl_rel_home_m: float | None = None,
    own: Sequence[MissionItem] = (),
) -> Fence:  # fmt: skip
    """The fence of ``mission``: the world's zones, and ``own``, the fence of its file; see `fence_of`.

    Raises CheckFailed if the mission itself would breach it, with zone and item; InputError if the autopilot cannot
    store or keep it.
    """
    home = mission.home.lat_e7 * 1e-7, mission.home.lon_e7 * 1e-7
    fence = fence_of(world.airspace.zones, world.frame, mission.autopilot, infinite=infinite, own=own, home=home)
    try:
        found = breaches_of(fence, mission, vehicle, world, rtl_rel_home_m=rtl_rel_home_m)
    except InputError as error:  # areas_of reads the items as stored, rounded to centimetres
        raise InputError(
            f"the fence would not be stored as it was made ({error.message}): a zone is too thin for it; widen the "
            "zone, or send no fence",
            where=vehicle.name,
        ) from None
    if found:
        cure = (
            "leave out --fence-infinite: those zones have a height, and a fence has none"
            if infinite
            else "the vehicle would turn round in the air; plan again, or send no fence"
        )
        raise CheckFailed(
            "the mission itself would breach this fence:", lines=[*(f"  {f.message}" for f in found), cure],
            where=vehicle.name, reason="fence",
        )  # fmt: skip
    return fence


def breaches_of(
    fence: Fence,
    mission: Mission,
    vehicle: Vehicle,
    world: World,
    *,
    rtl_rel_home_m: float | None = None,
    tuning: Tuning = DEFAULTS,
) -> list[Finding]:
    """The breaches of ``fence``, as the autopilot stores it: of its zones' areas, and of a file's own areas.

    Raises InputError for an area that is none as it is stored.
    """
    areas = areas_of([profile_of(mission.autopilot).stored(item) for item in fence.items], world.frame)
    zones = [replace(a, name=z.name) for a, z in zip(areas, fence.zones, strict=False)]
    found = breaches(zones, mission, vehicle, world, rtl_rel_home_m=rtl_rel_home_m, tuning=tuning)
    own = areas[len(zones) :]
    return found + breaches(own, mission, _plain(vehicle), world, rtl_rel_home_m=rtl_rel_home_m, tuning=tuning)


def own_breaches(items: Sequence[MissionItem], mission: Mission, vehicle: Vehicle, world: World) -> list[Finding]:
    """The breaches of a file's own fence. Raises InputError for an area that is none."""
    return breaches(areas_of(items, world.frame), mission, _plain(vehicle), world)


def _plain(vehicle: Vehicle) -> Vehicle:
    """The vehicle as a file's own fence sees it, which acts at its border.

    Only errors can carry the aircraft across, so the clearance from zones is left out.
    """
    return replace(vehicle, limits=replace(vehicle.limits, horizontal_clearance_m=0.0))


def breaches(
    areas: Sequence[Area],
    mission: Mission,
    vehicle: Vehicle,
    world: World,
    *,
    rtl_rel_home_m: float | None = None,
    tuning: Tuning = DEFAULTS,
) -> list[Finding]:
    """Findings where the flight of ``mission`` enters an exclusion area, or leaves an inclusion area, of a fence.

    The flight is widened by its track error and keeps the horizontal clearance from exclusion areas, as from zones. An
    aircraft must be inside every inclusion area. ``tuning``: where the autopilot turns, if that was read on board.
    """
    out = [Zone(a.name, shape) for a in areas if not a.inclusion for shape in a.shapes]
    found: list[Finding] = []
    if out:
        fenced = World(world.frame, Airspace(world.airspace.surface, out, scale=world.airspace.scale))
        # A fence is a zone rounded to the precision of its items, so that much is taken off the clearance.
        clearance_m = max(0.0, vehicle.limits.horizontal_clearance_m - FENCE_ROUNDING_M)
        craft = replace(vehicle, limits=replace(vehicle.limits, horizontal_clearance_m=clearance_m))
        verdict = judge(mission, craft, fenced, rtl_rel_home_m=rtl_rel_home_m, tuning=tuning)
        found += [_of_fence(f) for f in verdict.findings if f.kind == "zone"]
    inside = [a for a in areas if a.inclusion]
    return found + (_outside(inside, mission, vehicle, world, rtl_rel_home_m, tuning) if inside else [])


def _of_fence(f: Finding) -> Finding:
    """A finding on a zone, as one on an area of the fence."""
    way, lat, lon = f.note.data["way"], f.lat_deg, f.lon_deg
    note = Note("inside_fence_area", f.seq, way=way, zone=f.zone, by_m=f.by, lat=lat, lon=lon, amsl_m=f.amsl_m)
    return replace(f, kind="fence", note=note)


def _outside(
    areas: Sequence[Area],
    mission: Mission,
    vehicle: Vehicle,
    world: World,
    rtl_rel_home_m: float | None,
    tuning: Tuning,
) -> list[Finding]:
    """One finding for each inclusion area that the flight, as `judge` follows it, leaves: the first leg that does."""
    stored = replace(mission, items=tuple(profile_of(mission.autopilot).stored(i) for i in mission.items))
    flight = follow_in(world, stored, vehicle, rtl_rel_home_m=rtl_rel_home_m)
    round_corners(flight, stored, vehicle, world.frame, tuning)
    flown = [*flight.stretches, *flight.others]
    if not flown:
        return []
    plane = legs_in_plane(flown, vehicle.limits, world, 0.0)
    found = []
    for area in areas:
        beyond_m = _beyond_m(area, plane.legs, world.airspace.scale)
        if beyond_m.max() > 0.0:
            leg = int(np.argmax(beyond_m > 0.0))
            s, short_m = flown[plane.owner[leg]], float(beyond_m[leg])
            lat, lon, amsl = on_globe(s.end)
            note, by_m = Note("far_outside_fence_area", s.seq, way=s.kind, zone=area.name), math.nan
            if math.isfinite(short_m):
                note, by_m = Note("outside_fence_area", s.seq, way=s.kind, zone=area.name, by_m=short_m), short_m
            found.append(Finding(s.seq, "fence", note, lat, lon, amsl, -by_m, 0.0, by_m, "m", area.name))
    return found


def _beyond_m(area: Area, legs: Legs, scale: float) -> Floats:
    """How far each leg, widened by its track error, goes beyond an area's border, m; 0 where it stays inside.

    The shapes of an area with several are apart, so a leg inside the area is inside one of them.
    """
    beyond_m = np.full(len(legs.start), math.inf)
    for shape in area.shapes:
        np.minimum(beyond_m, _beyond_shape_m(shape, legs, scale), out=beyond_m)
    return beyond_m


def _beyond_shape_m(shape: Circle | Polygon, legs: Legs, scale: float) -> Floats:
    reach_m = legs.track_error_m * scale
    ends = np.stack([legs.start[:, :2], legs.end[:, :2]], axis=1)
    if isinstance(shape, Circle):  # a disc is convex, so the ends decide
        away = np.hypot(ends[..., 0] - shape.east_m, ends[..., 1] - shape.north_m).max(axis=1)
        return np.asarray(np.maximum(0.0, away + reach_m - shape.radius_m))
    import shapely

    polygon, lines = shapely.Polygon(shape.vertices), shapely.linestrings(ends)
    # A vertical leg is a line of length zero, and its difference with the polygon is empty: test its ends too.
    out = shapely.distance(polygon, shapely.points(ends)).max(axis=1)
    rest = shapely.difference(lines, polygon)
    points, owner = shapely.get_coordinates(rest, return_index=True)
    np.maximum.at(out, owner, shapely.distance(polygon, shapely.points(points)))
    crosses = (out > 0.0) | (shapely.length(rest) > 0.0)
    inside_m = shapely.distance(polygon.exterior, lines)
    return np.asarray(np.where(crosses, reach_m + out, np.maximum(0.0, reach_m - inside_m)))


def own_fence(
    items: Sequence[MissionItem], verdict: Verdict, vehicle: Vehicle, world: World, rtl_rel_home_m: float | None
) -> tuple[Verdict, tuple[Note, ...]]:
    """``verdict`` plus the breaches of the file's own fence, returns included, and notes on that fence."""
    if not items:
        return verdict, ()
    try:
        areas = areas_of(items, world.frame)
        flown, plain = verdict.mission, _plain(vehicle)
        found = breaches(areas, flown, plain, world, rtl_rel_home_m=rtl_rel_home_m) if verdict.legs else []
    except InputError as error:
        why = Note("fence_unread", why=error.message)
        return replace(verdict, not_judged=(*verdict.not_judged, why)), ()
    out = sum(not a.inclusion for a in areas)
    inside = len(areas) - out
    note = Note("brings_fence", out=out, inside=inside)
    return replace(verdict, findings=(*verdict.findings, *found)), (note,)
