"""A mission is judged again with the vehicle's own parameters, before it is sent and once it is on board.

With parameters within the list that the mission was judged with (`parameter_list`) the vehicle flies as planned. With
others the mission is refused, or, if the user allows that, judged with the parameters on board; a mission that cannot
be judged with them stays refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from gcsplan.app.plan.flight_hours import beyond_forecast, beyond_hours
from gcsplan.app.plan.way_home import against_on_board
from gcsplan.app.upload.fence import against_fence
from gcsplan.check.judge import judge
from gcsplan.check.motion.stopping import braking_distance_m, run_past_m
from gcsplan.check.motion.turn_parameters import Tuning
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission.commands import RTL
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mavlink.mission.parameter_list import (
    Off,
    Setting,
    corners_as_it_leans,
    needed_groups,
    off,
    parameter_list,
    safety_list,
    vehicle_on_board,
)
from gcsplan.mavlink.mission.parameter_names import OnBoard, unanswered
from gcsplan.mavlink.mission.return_parameters import return_on_board_m
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle, fastest_at_m_s

if TYPE_CHECKING:
    from gcsplan.app.plan.model import VehiclePlan
    from gcsplan.app.upload.job import UploadJob
    from gcsplan.check.returns.verdict import WayHome
    from gcsplan.mavlink.link.session import session

__all__ = ["judge_on_board", "settings_of", "settings_of_plan"]

RIGHT_ANGLE_RAD = 0.5 * math.pi
SAME_S, SAME_PART = 1.0, 0.005
"""A flight whose time differs from the plan's by no more than this, s, or by this part of it, flies as planned."""


def settings_of(job: UploadJob) -> tuple[Setting, ...]:
    """The list of parameters that a job's mission was judged with; empty without a world."""
    if job.vehicle is None or job.world is None:
        return ()
    home = job.way_home
    returns = job.home_required and (home is None or home.route != "mission")
    return _listed(job.mission, job.vehicle, job.rtl_rel_home_m, home, job.verdict, returns=returns)


def settings_of_plan(v: VehiclePlan, home: WayHome | None) -> tuple[Setting, ...]:
    """The list of parameters that a planned mission was judged with; ``home``: its way home, if that was judged."""
    returns = home is not None and home.route != "mission"
    return _listed(v.mission, v.request.vehicle, v.request.rtl_rel_home_m, home, v.verdict, returns=returns)


def _listed(
    mission: Mission,
    vehicle: Vehicle,
    rtl_rel_home_m: float | None,
    home: WayHome | None,
    verdict: Verdict | None,
    *,
    returns: bool,
) -> tuple[Setting, ...]:
    by_mission = home is not None and home.route == "mission"
    height_m = rtl_rel_home_m if home is None or by_mission else home.rtl_rel_home_m
    rows = parameter_list(mission, vehicle, rtl_rel_home_m=height_m, returns=returns)
    if verdict is None or verdict.extent is None:
        return rows
    straight_m = height_m if returns or any(item.command == RTL for item in mission.items) else None
    return rows + safety_list(vehicle.autopilot, verdict.extent, rtl_rel_home_m=straight_m, by_mission=by_mission)


def judge_on_board(
    job: UploadJob, *, allow_unjudged: bool, allow_parameters: bool = False, simulated: bool = False
) -> session.ReadBackJudge | None:
    """The check of the mission that was read back, since the vehicle will fly what it holds; None without a world.

    Before the mission is sent it runs too, with the vehicle's parameters: where it turns, how fast it flies, climbs
    and returns, and how high it returns. ``allow_parameters``: those outside of the list are judged as they are. A
    simulated vehicle's parameters are nobody's, so the mission file's count there.
    """
    if job.world is None or job.vehicle is None:
        return None
    from gcsplan.mavlink.link.session.parameters import lean_shortage, speed_shortage
    from gcsplan.mavlink.link.terrain import TERRAIN_DECIDES, flies_terrain, odd_spacing, terrain_error_m

    world, vehicle, settings = job.world, job.vehicle, () if simulated else settings_of(job)
    straight = job.home_required and job.way_home is not None and job.way_home.route != "mission"
    planned_m_s = job.mission.commanded_m_s
    if vehicle.lean_angle_deg is not None:
        planned_m_s = min(planned_m_s, fastest_at_m_s(vehicle.lean_angle_deg))

    def again(read_back: Mission, values: Mapping[str, float]) -> Note | None:
        if job.home_required and job.way_home is not None and not simulated:
            against = against_on_board(job.way_home, values, job.mission)
            if against is not None:
                return against
        terrain = TERRAIN_DECIDES if not simulated and flies_terrain(read_back.wire_items()) else ()
        if silent := _silent(settings, values, vehicle.autopilot, terrain):
            return silent
        if vehicle.lean_angle_deg is not None and (short := lean_shortage(values, planned_m_s)):
            return short
        if short := speed_shortage(values, vehicle, planned_m_s):
            return short
        if flies_terrain(read_back.wire_items()) and (odd := odd_spacing(values)):
            return odd
        found = off(settings, values, vehicle.autopilot)
        decide = {"flight", "return"} | ({"turns"} if straight else set())
        if not allow_parameters or (job.fleet is not None and job.fleet.keeps_apart):
            decide.add("pace")
        if unlike := [o for o in found if o.setting.matters in decide]:
            allowed = {o.setting.matters for o in unlike} == {"pace"}
            return Note("parameters_not_judged", allowed=allowed, off=_notes(unlike))
        # Home on board is where the vehicle is now, but the altitudes count from the planned start.
        flown = replace(read_back, home=job.mission.home, leaves_s=job.mission.leaves_s)
        tuning = Tuning.of(values)
        flies = vehicle if simulated else vehicle_on_board(vehicle, flown, values)
        returns_m = None if simulated else return_on_board_m(values)
        rtl_rel_home_m = job.rtl_rel_home_m if returns_m is None else returns_m
        spacing = values.get("TERRAIN_SPACING", math.nan)
        spaced = world.with_posts(int(spacing)) if spacing >= 1.0 else world
        error_m = terrain_error_m(values, job.terrain_error_m)
        wind = None if job.verdict is None or job.verdict.in_wind is None else job.verdict.in_wind.flies_in
        verdict = judge(
            flown, flies, spaced, rtl_rel_home_m=rtl_rel_home_m, terrain_error_m=error_m, tuning=tuning, wind=wind
        )
        if not (verdict.safe is True or (verdict.safe is None and allow_unjudged)):
            unjudged = (Note("not_judged_on_board", why=note) for note in verdict.not_judged)
            return Note("breaks_limits_on_board", found=(*(f.note for f in verdict.findings), *unjudged))
        beyond = beyond_hours(verdict, job.hours) or beyond_forecast(verdict, job.waits_s)
        if beyond and not allow_unjudged:
            return Note("not_judged_on_board", why=beyond)
        if flies != vehicle:
            against = _against_motion(job, flies, verdict, found, values, allow_parameters=allow_parameters)
            if against is not None:
                return against
        return against_fence(job, flown, rtl_rel_home_m, tuning)

    return again


def _silent(
    settings: Sequence[Setting], values: Mapping[str, float], autopilot: Autopilot, others: tuple[tuple[str, ...], ...]
) -> Note | None:
    """Which parameters that the proof hangs on, or ``others``, gave no answer; None if all did.

    A peer that does not say what autopilot it is has no known parameters. Where gcsplan requested no parameters, the
    values that arrived say nothing of the others.
    """
    if not isinstance(values, OnBoard) or values.generic:
        return None
    silent = unanswered(values, [*needed_groups(settings, autopilot, values), *others])
    if not silent:
        return None
    return Note("parameters_unanswered", names=tuple(" or ".join(group) for group in silent))


def _against_motion(
    job: UploadJob,
    flies: Vehicle,
    verdict: Verdict,
    found: Sequence[Off],
    values: Mapping[str, float],
    *,
    allow_parameters: bool,
) -> Note | None:
    """Why a vehicle that moves otherwise than planned is refused: its return, its times, or its separation.

    A return that runs on farther from corners because the firmware has no other rule is judged with that.
    """
    leans = corners_as_it_leans(values)
    timed = [o for o in found if o.setting.matters == "time"]
    if job.home_required and job.way_home is not None and job.way_home.route != "mission":
        if not allow_parameters and job.vehicle is not None:
            turning = replace(flies, corner_accel_m_s2=job.vehicle.corner_accel_m_s2) if leans else flies
            if _runs_farther(job.vehicle, turning, job.mission):
                return Note("return_runs_farther", off=_notes(timed))
        if (allow_parameters or leans) and (against := _against_return(job, flies, verdict)):
            return against
    if job.verdict is not None and not allow_parameters:
        planned_s, takes_s = job.verdict.time_s, verdict.time_s
        late_s = takes_s - planned_s
        if math.isfinite(late_s) and abs(late_s) > max(SAME_S, SAME_PART * planned_s):
            return Note(
                "flight_takes_otherwise",
                takes_s=takes_s,
                told_s=planned_s,
                late_s=late_s,
                leans=leans,
                off=_notes(timed),
            )
    if job.fleet is not None and (near := job.fleet.against(job.name, flies, verdict)):
        return Note("too_near_on_board", near=near, off=_notes(timed))
    return None


def _runs_farther(judged: Vehicle, flies: Vehicle, mission: Mission) -> bool:
    """Whether a return runs on farther than was judged, from a leg or from a corner."""
    speed_m_s, more = max(mission.commanded_m_s, judged.speed_max_m_s), 1.0 + SAME_PART
    past_m = [run_past_m(v, speed_m_s, RIGHT_ANGLE_RAD) for v in (judged, flies)]
    return (
        braking_distance_m(flies, speed_m_s) > more * braking_distance_m(judged, speed_m_s)
        or past_m[1] > more * past_m[0]
    )


def _against_return(job: UploadJob, flies: Vehicle, verdict: Verdict) -> Note | None:
    """Why the return of a vehicle with these parameters is not safe; None if it is."""
    from gcsplan.check.returns.way_home import way_home

    assert job.world is not None
    assert job.way_home is not None
    home = way_home(
        verdict, flies, job.world, rtl_rel_home_m=job.way_home.rtl_rel_home_m, terrain_error_m=job.terrain_error_m,
        rally=False, route=job.way_home.route, points=job.rally,
    )  # fmt: skip
    return None if home.safe is True else Note("return_required_but", why=home.headline)


def _notes(found: Sequence[Off]) -> tuple[Note, ...]:
    return tuple(o.note() for o in found)
