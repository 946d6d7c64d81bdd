"""The way home in every command: it is judged here, and here is decided whether it lets a mission fly.

`way_home: required` in the mission file, or `--require-way-home`, refuses a mission whose return is unsafe or not
judged. Otherwise the return is judged on request, and an unsafe one is a warning. `plan`, `check`, `upload` and
`rehearse` all ask `lets_fly`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.check.returns.proposal import ALIKE_M, ReturnProposal, best_first
from gcsplan.check.returns.words import together_m
from gcsplan.check.verdict import Verdict
from gcsplan.errors import CheckFailed, NoMission
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.mavlink.mission.return_parameters import (
    on_board,
    return_on_board_m,
    returns_otherwise,
    route_setting,
    setting,
    takes_another_route,
)
from gcsplan.mission_file import MissionFile, VehicleRequest
from gcsplan.notes.note import IN_FILES, Note, Wording
from gcsplan.vehicle import Autopilot
from gcsplan.world.world import World

if TYPE_CHECKING:
    from gcsplan.check.returns.verdict import WayHome

MOST_SHOWN = 5
"""Vehicles that a warning or a refusal names one by one."""

SAME_RETURN_M = 0.5
"""Return altitudes that differ by no more than this, m, count as the same."""


def is_required(source: MissionFile | None, option: bool) -> bool:
    """Whether the mission file or ``--require-way-home`` requires a safe return."""
    return option or (source is not None and source.way_home == "required")


def lets_fly(home: WayHome | None, *, required: bool) -> bool:
    """Whether the way home lets a mission fly: always if it is only reported, else only if it was judged and is safe.

    ``--allow-unjudged`` does not count here: who requires a safe return wants to know of one.
    """
    return not required or (home is not None and home.safe is True)


def home_of(
    verdict: Verdict,
    request: VehicleRequest,
    world: World,
    terrain_error_m: float,
    points: Sequence[MissionItem] = (),
) -> WayHome:
    """The way home of one mission, from every point of it; takes about a second for 20 km.

    ``points``: the rally points on board, to the nearest of which, or home, a return leads.
    """
    from gcsplan.check.returns.way_home import way_home

    return way_home(
        verdict, request.vehicle, world, rtl_rel_home_m=request.rtl_rel_home_m, terrain_error_m=terrain_error_m,
        rally=not points, route=request.return_route, points=points,
    )  # fmt: skip


def homes_of(plan: Plan) -> dict[str, WayHome]:
    """The way home of every vehicle of a plan."""
    error_m = plan.source.terrain_error_m
    return {v.name: _with_proposals(v, home_of(v.verdict, v.request, plan.world, error_m)) for v in plan.vehicles}


def _with_proposals(v: VehiclePlan, home: WayHome) -> WayHome:
    """``home`` with the changes that make more of it safe, each tried, the best first.

    An altitude that makes all returns safe, within max AGL, is enough; otherwise the highest one within it, rally
    points and a return path back along the track are tried, too.
    """
    if home.safe is not False or v.brief is None or home.route == "mission":
        return home
    tried = _by_altitude(v, home)
    least_m = min([home.no_return_m, *(p.leaves_m for p in tried)])
    enough = home.set_rel_home_m is not None and not home.set_leaves_m
    path = _path_back(v) if not enough or home.set_above_max_agl else None
    if path is not None:
        tried.append(_by_mission(v, path))
        if not enough and path.no_return_m < least_m:
            route = route_setting(v.request.vehicle.autopilot, path=True)
            helps = Note("path_back_helps", left_m=path.no_return_m, setting=route)
            home = replace(home, path_back=Note("path_back_makes_safe", setting=route) if path.safe else helps)
    better = [p for p in tried if p.leaves_m < home.no_return_m - ALIKE_M or not p.leaves_m]
    return replace(home, proposals=best_first(better))


def _by_altitude(v: VehiclePlan, home: WayHome) -> list[ReturnProposal]:
    """The altitude to set, also with rally points, and the highest one within max AGL."""
    found: list[ReturnProposal] = []
    ceiling_m = None if home.max_agl_m is None else float(math.floor(home.max_agl_m))
    heights = [home.set_rel_home_m, ceiling_m if home.set_above_max_agl else None]
    for height_m in dict.fromkeys(h for h in heights if h is not None and h > 0.0):
        known = height_m == home.set_rel_home_m and not home.rally
        then = None if known else _judged_at(v, height_m)
        if then is not None and then.not_judged:
            continue
        left_m = (home.set_leaves_m or 0.0) if then is None else then.no_return_m
        found.append(_altitude(home, height_m, left_m, first_m=None if then is None else first_unsafe_m(then)))
        if then is not None and home.rally and height_m == home.set_rel_home_m:
            # The battery counts as for a return home, which is farther than one to the nearest place.
            short = then.battery.short if then.battery is not None else ()
            left_m = together_m([*((s.from_m, s.to_m) for s in home.left), *short])
            found.append(_altitude(home, height_m, left_m, rally=len(home.rally)))
    return found


def first_unsafe_m(home: WayHome) -> float:
    """Where on the mission the first part without a safe return begins, m; inf without one."""
    short = home.battery.short if home.battery is not None else ()
    return min([*(s.from_m for s in home.unsafe), *(from_m for from_m, _ in short)], default=math.inf)


def _altitude(
    home: WayHome, height_m: float, left_m: float, rally: int = 0, first_m: float | None = None
) -> ReturnProposal:
    above = home.max_agl_m is not None and height_m > home.max_agl_m
    note = Note(
        "return_by_altitude", height_m=height_m, setting=setting(home.autopilot, height_m),
        above=Note("above_max_agl", max_agl_m=home.max_agl_m) if above else None,
        rally=Note("with_rally_points", count=rally) if rally else None,
    )  # fmt: skip
    return ReturnProposal(
        note, left_m, (("rtl_rel_home_m", height_m),), above_max_agl=above, rally=rally, first_m=first_m
    )  # fmt: skip


def _by_mission(v: VehiclePlan, path: WayHome) -> ReturnProposal:
    return ReturnProposal(
        Note("return_by_mission", setting=route_setting(v.request.vehicle.autopilot, path=True)), path.no_return_m,
        (("return_route", "mission"),), first_m=first_unsafe_m(path),
    )  # fmt: skip


def _judged_at(v: VehiclePlan, rel_home_m: float) -> WayHome:
    """The way home at another altitude, without rally points."""
    from gcsplan.check.returns.way_home import way_home

    assert v.brief is not None
    return way_home(
        v.verdict, v.request.vehicle, v.brief.world, rtl_rel_home_m=rel_home_m,
        terrain_error_m=v.brief.source.terrain_error_m, rally=False, route=v.request.return_route,
    )  # fmt: skip


def _path_back(v: VehiclePlan) -> WayHome | None:
    """The way home along a return path back along the track; None if none can be written, flown or judged."""
    request, brief = v.request, v.brief
    if brief is None or not writes_path_back(request, brief.source.altitude_frame):
        return None
    from gcsplan.app.plan.problem import built

    try:
        _, verdict = built(brief, request, v.solution, replace(v.order, return_path=True))
    except NoMission:  # too many items
        return None
    if verdict.findings:
        return None
    error_m = brief.source.terrain_error_m
    path = home_of(verdict, replace(request, return_route="mission"), brief.world, error_m)
    return None if path.not_judged else path


def writes_path_back(request: VehicleRequest, altitude_frame: str) -> bool:
    """Whether a return path can be written: for ArduCopter, behind an end, in a frame in which it is judged."""
    copter = request.vehicle.autopilot is Autopilot.ARDUCOPTER
    return copter and request.end != "none" and altitude_frame != "terrain"


def judged(plan: Plan, *, home: bool, option: bool = False) -> dict[str, WayHome]:
    """The ways home of a plan if ``home`` or the mission requires them, else none.

    ``option``: ``--require-way-home``. Raises CheckFailed if safe ones are required and one does not pass.
    """
    required = is_required(plan.source, option)
    homes = homes_of(plan) if home or required else {}
    require(homes, required=required)
    return homes


def require(homes: Mapping[str, WayHome | None], *, required: bool) -> None:
    """Raise CheckFailed if the way home of a vehicle does not let it fly; the message says why and what to set."""
    bad = {name: home for name, home in homes.items() if not lets_fly(home, required=required)}
    if not bad:
        return
    broken = any(home is not None and home.safe is False for home in bad.values())
    what = (
        "a safe return is required, and there is none" if broken else "a safe return is required, and it is not judged"
    )
    lines = [line for name, home in list(bad.items())[:MOST_SHOWN] for line in _lines(name, home)]
    if len(bad) > MOST_SHOWN:
        lines.append(f"… and {len(bad) - MOST_SHOWN} more")
    raise CheckFailed(what, lines=lines, reason="violation" if broken else "not_judged")


def _lines(name: str, home: WayHome | None, wording: Wording = IN_FILES) -> list[str]:
    """The headline, and what to set and what a return path would do, or all that was tried if that is more."""
    if home is None:
        return [f"{name}: the return was not judged"]
    tried = home.proposals if len(home.proposals) > 1 else ()
    listed = {key for p in tried for key, value in p.keys if key != "rtl_rel_home_m" or value == home.set_rel_home_m}
    notes = (
        home.headline,
        None if "rtl_rel_home_m" in listed else home.advice,
        None if "return_route" in listed else home.path_back,
        Note("proposals_tried", proposals=tuple(p.note for p in tried)) if tried else None,
    )
    return [f"{name}: {note.text(wording)}" for note in notes if note is not None]


def against_on_board(home: WayHome, values: Mapping[str, float], mission: Mission) -> Note | None:
    """Why a required return is not the one that a vehicle with these parameters would fly; None if it is."""
    if otherwise := takes_another_route(values, mission, home.route):
        return Note("return_required_and", why=otherwise)
    if home.route == "mission":
        return None
    height_m = return_on_board_m(values)
    parameter = on_board(values)
    if height_m is None or parameter is None:
        return Note("return_required_and", why=Note("return_altitude_unread"))
    if otherwise := returns_otherwise(values):
        return Note("return_required_and", why=otherwise)
    if abs(height_m - home.rtl_rel_home_m) <= SAME_RETURN_M:
        return None
    return Note(
        "return_required_elsewhere", judged_m=home.rtl_rel_home_m, returns_m=height_m,
        setting=parameter.setting(home.rtl_rel_home_m),
    )  # fmt: skip


def warnings(homes: Mapping[str, WayHome | None], wording: Wording = IN_FILES) -> list[str]:
    """A headline for each vehicle whose return is not safe, with what to set; one line for all others of a fleet."""
    bad = [(name, home) for name, home in homes.items() if home is not None and home.safe is not True]
    lines: list[str] = []
    for name, home in bad[:MOST_SHOWN]:
        lines += _lines(name, home, wording)
    if len(bad) > MOST_SHOWN:
        lines.append(f"… and {len(bad) - MOST_SHOWN} more of {len(homes)} vehicles: no safe return, or not judged")
    return lines
