"""A file's own rally points, each judged as a place to land at: a return may end there.

Returns to them are judged with the way home (`check/returns/rally.py`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from gcsplan.app.check.fence_breaches import own_breaches
from gcsplan.check.judge import judge
from gcsplan.check.motion.return_rules import RETURN_RULES, RallyAltitude
from gcsplan.check.verdict import Verdict
from gcsplan.errors import InputError
from gcsplan.mavlink.mission.autopilots import profile_of
from gcsplan.mavlink.mission.commands import LAND, LOITER_TURNS, TAKEOFF
from gcsplan.mavlink.mission.mission import GLOBAL, RELATIVE, Home, Mission, MissionItem
from gcsplan.mission_file import VehicleRequest
from gcsplan.notes.note import Finding, Note
from gcsplan.world.world import World

AT_A_POINT = frozenset({"zone", "coverage", "fence", "min_agl", "terrain_clearance"})
"""Limits that count at a rally point: the way home judges how high a return may be."""


def own_rally(
    points: Sequence[MissionItem],
    fence: Sequence[MissionItem],
    verdict: Verdict,
    request: VehicleRequest,
    world: World,
) -> tuple[Verdict, tuple[Note, ...]]:
    """``verdict`` plus what is wrong with the places of the file's rally points, and a note on them.

    ``fence`` is the file's own, which is on board with them.
    """
    if not points:
        return verdict, ()
    home = verdict.mission.home
    home_amsl_m = world.ground_amsl(home.lat_e7 / 1e7, home.lon_e7 / 1e7)
    rule, given = RETURN_RULES[request.vehicle.autopilot], request.rtl_rel_home_m
    returns_m = rule.default_rel_home_m if given is None else given
    found: list[Finding] = []
    unknown: list[Note] = []
    for number, point in enumerate(points, start=1):
        kept = profile_of(request.vehicle.autopilot).stored(point)
        lat, lon = kept.lat_deg, kept.lon_deg
        ground_m = world.ground_amsl(lat, lon)
        high_m = ground_m + world.spread_m(lat, lon)
        if math.isnan(ground_m + home_amsl_m):
            unknown.append(Note("rally_point_off_terrain", number=number, lat=lat, lon=lon))
            continue
        own_m = home_amsl_m + kept.z
        level_m = max(own_m, home_amsl_m + returns_m) if rule.rally is RallyAltitude.RAISES else own_m
        on_ground = rule.rally is RallyAltitude.GROUND
        error_m = request.vehicle.limits.altitude_error_m
        least_m = high_m - error_m if on_ground else high_m + error_m
        if level_m < least_m:
            by_m = least_m - level_m
            note = Note("rally_point_too_low", number=number, level_m=level_m, ground_m=high_m, by_m=by_m)
            found.append(Finding(0, "rally", note, lat, lon, level_m, level_m, least_m, by_m, "m"))
            continue
        over_m = level_m + returns_m if on_ground else level_m
        found += _at(number, _landing(verdict.mission, kept, ground_m, over_m, rule.rally), fence, request, world)
    note = Note("brings_rally", count=len(points))
    more = replace(verdict, findings=(*verdict.findings, *found), not_judged=(*verdict.not_judged, *unknown))
    return more, (note,)


def _landing(mission: Mission, point: MissionItem, ground_m: float, over_m: float, rally: RallyAltitude) -> Mission:
    """A mission at the point alone: up to where a return comes and down again, or once round for one that circles."""
    home = Home(point.x, point.y, ground_m)
    circle = MissionItem(LOITER_TURNS, GLOBAL, (1.0, 0.0, 0.0, 0.0), point.x, point.y, over_m)
    column = (
        MissionItem(TAKEOFF, RELATIVE, x=point.x, y=point.y, z=over_m - ground_m),
        MissionItem(LAND, RELATIVE, x=point.x, y=point.y),
    )
    return replace(mission, home=home, items=(circle,) if rally is RallyAltitude.OWN else column)


def _at(
    number: int, landing: Mission, fence: Sequence[MissionItem], request: VehicleRequest, world: World
) -> list[Finding]:
    found = list(judge(landing, request.vehicle, world, misses=False, times=False).findings)
    with suppress(InputError):  # a fence that cannot be read is not judged, and says so
        found += own_breaches(fence, landing, request.vehicle, world)
    worst: dict[tuple[str, str], Finding] = {}
    for f in found:
        held = worst.get((f.kind, f.zone))
        if f.kind in AT_A_POINT and not (held is not None and held.by >= f.by):
            worst[f.kind, f.zone] = f
    return [_of_point(number, f) for f in worst.values()]


def _of_point(number: int, f: Finding) -> Finding:
    """A finding on the flight over a point, as one on the point."""
    note = Note("rally_point_not_clear", number=number, why=f.note.of_no_item())
    return replace(f, seq=0, kind="rally", note=note)
