"""Planning of one vehicle: request to path, path to mission, and the verdict on the mission as it is stored."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gcsplan.app.plan.left_out import LeavingOut
from gcsplan.app.plan.model import Brief, VehiclePlan
from gcsplan.app.plan.problem import bow_margin_m, built, built_again, looked_over, make_problem, run_planner, unsafe
from gcsplan.app.plan.replanning import Attempts, on_path, replanned
from gcsplan.arrays import Floats
from gcsplan.check.verdict import Verdict
from gcsplan.errors import InputError, NoMission
from gcsplan.mavlink.build.multirotor import (
    acceptance_radius_m,
    corners_cut,
    cuts_corners,
    moved_corners,
    sharpened_corners,
    spaced_out,
)
from gcsplan.mavlink.build.order import MARGINS, Gates, Order
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.mission_file import VehicleRequest
from gcsplan.planners.problem import PASSED_M, Problem, Progress, Solution, passes_vias
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.world import World

__all__ = ["over_one_terrain", "plan_vehicle", "rebuilt"]

GATE_ROUNDS = 3
"""Times that gates are given their seconds: with a forecast the hours decide how long the flight to a gate may take."""
COPTER_ATTEMPTS = 4
"""Most plans for one vehicle, each with larger margins than the one before, until the decoded mission passes."""


def plan_vehicle(
    brief: Brief,
    request: VehicleRequest,
    progress: Callable[[Progress], None] | None = None,
    *,
    searched: World | None = None,
    limits: Limits | None = None,
    options: Mapping[str, object] | None = None,
) -> VehiclePlan:
    """One vehicle's path, mission and verdict. Raises InputError, NoMission.

    ``searched`` is a world with more zones, ``limits`` are tighter limits: another path is searched under them, and
    judged in the mission file's own world and limits. ``options`` are for the planner, on top of the brief's.
    """
    source, vehicle = brief.source, request.vehicle
    limited = request if limits is None else replace(request, vehicle=replace(vehicle, limits=limits))
    if request.return_route == "mission":
        limited = _both_ways(limited, source.altitude_frame)
    world = brief.world if searched is None else searched
    merged = {**brief.options, **(options or {})}
    if vehicle.turn_radius_m > 0.0:
        from gcsplan.app.plan.wings import wing_attempts  # imported here because most vehicles are multicopters

        attempts = wing_attempts(brief, request, limited, world)
    else:
        attempts = _copter_attempts(brief, request, limited, world)
    known = brief.known.get(vehicle.name)
    return replanned(
        attempts,
        lambda margins: make_problem(
            source, limited, world, brief.objective, brief.seed, margins, progress, merged, known
        ),
    )


def _copter_attempts(brief: Brief, request: VehicleRequest, limited: VehicleRequest, world: World) -> Attempts:
    """The attempts to plan an aircraft that can stand still; the search keeps ``limited``'s limits, over ``world``."""
    vehicle = request.vehicle

    def fly(problem: Problem) -> VehiclePlan:
        solution = run_planner(brief.run, problem, vehicle, world)
        over = looked_over(brief, solution)
        order = Order(
            request.end, brief.source.altitude_frame, return_path=request.return_route == "mission",
            bow_m=bow_margin_m(limited, world),
            exact=tuple((v.east_m, v.north_m) for v in problem.via if v.amsl_m is not None),
        )  # fmt: skip
        solution, order, mission, verdict = _built(over, request, problem, solution, order)
        return VehiclePlan(request, problem, solution, mission, verdict, vehicle.speed_max_m_s, (), order, over)

    return Attempts(COPTER_ATTEMPTS, MARGINS, fly, acceptance_radius_m(vehicle))


def _built(
    over: Brief, request: VehicleRequest, problem: Problem, solution: Solution, order: Order
) -> tuple[Solution, Order, Mission, Verdict]:
    """The mission of a solution, its verdict, and both as they were built: without way points nearer than the
    acceptance radii, if that is legal; else with all, and with corners mended that are cut too near."""
    vehicle, points = request.vehicle, solution.path.points
    spaced = spaced_out(points, vehicle)
    if passes_vias(problem, spaced):
        mission, verdict = built(over, request, solution, order)
        if not verdict.findings:
            return solution, order, mission, verdict
        if vehicle.autopilot is not Autopilot.ARDUCOPTER and cuts_corners(vehicle):
            points = spaced  # corners that are turned before at once are cut by more than one
            solution = replace(solution, path=Path(points))
    order = replace(order, spaced=False)
    corners: set[int] = set()
    while True:
        mission, verdict = built(over, request, solution, order)
        more: set[int] = set()
        if cuts_corners(vehicle):
            more = corners_cut(mission, on_path(mission, verdict), points, over.world) - corners
        if not more:
            return solution, order, mission, verdict
        corners |= more
        solution = replace(solution, path=Path(_mended(problem, vehicle, points, corners)))


def _mended(problem: Problem, vehicle: Vehicle, points: Floats, corners: set[int]) -> Floats:
    """The path (N, 3) with ``corners`` that are cut less; vias stay."""
    if vehicle.autopilot is Autopilot.ARDUCOPTER:
        return sharpened_corners(points, corners)
    for via in problem.via:
        corners = corners - set(np.flatnonzero(np.hypot(*(points[:, :2] - (via.east_m, via.north_m)).T) < PASSED_M))
    return moved_corners(points, corners, acceptance_radius_m(vehicle))


def _both_ways(request: VehicleRequest, altitude_frame: str) -> VehicleRequest:
    """``request`` with limits under which its path may be flown back, too, where a climb is a descent.

    Raises InputError if no path back is written for it.
    """
    vehicle, limits = request.vehicle, request.vehicle.limits
    why = ""
    if vehicle.autopilot is not Autopilot.ARDUCOPTER:
        why = f"return paths are written for ArduCopter alone, and it is {vehicle.autopilot}"
    elif altitude_frame == "terrain":
        why = "a return path in the terrain frame is not judged: use altitude_frame relative or amsl"
    elif request.end == "none":
        why = "with end: none the mission would go on along its return path: use end: land, loiter or rtl"
    if why:
        raise InputError(f"{vehicle.name}: return_route: mission: {why}")
    steepest = min(limits.max_climb_deg, limits.max_descent_deg)
    return replace(
        request,
        vehicle=replace(vehicle, limits=replace(limits, max_climb_deg=steepest, max_descent_deg=steepest)),
    )


def over_one_terrain(
    brief: Brief,
    vehicles: Sequence[VehiclePlan],
    progress: Callable[[str, Progress], None] | None = None,
    leaving: LeavingOut | None = None,
) -> tuple[Brief, list[VehiclePlan]]:
    """Judge all vehicles over the widest terrain that any of them needed; replan those that fail there."""
    leaving = leaving or LeavingOut(allowed=False)
    wide = widest(brief, vehicles)
    out = []
    for v in vehicles:
        if v.brief is None or v.brief.source is wide.source:
            out.append(v)
            continue
        mission, verdict = built_again(v, wide, v.order)
        if not verdict.findings:
            out.append(replace(v, mission=mission, verdict=verdict, brief=wide))
            continue
        report = None if progress is None else lambda what, who=v.name: progress(who, what)
        try:
            out.append(plan_vehicle(wide, v.request, report))
        except NoMission as why:
            leaving.leave(v.name, why)
    return wide, out


def rebuilt(
    v: VehiclePlan,
    brief: Brief,
    *,
    speed_m_s: float,
    hold_s: float = 0.0,
    gate_utc: tuple[int, int, int] | None = None,
    depart_s: float = 0.0,
) -> VehiclePlan:
    """The same path at another speed, after ``hold_s`` (whole seconds) at the gate: the mission is rebuilt and judged.

    ``depart_s``: when it leaves, after the common start; gates on its way open as many seconds later. Raises NoMission
    if the mission then breaks a limit: a hold costs energy and an item.
    """
    order = replace(v.order, speed_m_s=speed_m_s, hold_s=0 if gate_utc else round(hold_s), gate_utc=gate_utc)
    over = widest(brief, [v])
    if order.gates is not None:
        order, mission, verdict = _opening(replace(v, order=order), over, order.gates, depart_s, v.order.speed_m_s)
    elif order != v.order:
        mission, verdict = built_again(v, over, order)
    if order == v.order:
        return v
    if verdict.findings:
        raise unsafe(verdict, v.request.vehicle)
    return replace(v, mission=mission, verdict=verdict, speed_m_s=speed_m_s, order=order)


def _opening(
    v: VehiclePlan, brief: Brief, gates: Gates, depart_s: float, timed_m_s: float | None
) -> tuple[Order, Mission, Verdict]:
    """The order of a plan with its gates open as soon as the vehicle is surely there, if it leaves ``depart_s`` after
    the start, and its mission as judged; ``timed_m_s``: the speed of the plan's verdict."""
    leaves_s = gates.start_s + depart_s
    after_s = v.verdict.gates_after_s() if timed_m_s == v.order.speed_m_s else ()
    for _ in range(GATE_ROUNDS):
        if len(after_s) == len(gates.at_m):
            gates = replace(gates, opens_s=tuple(round(leaves_s + s) for s in after_s))
        order = replace(v.order, gates=replace(gates, leaves_s=leaves_s))
        mission, verdict = built_again(v, brief, order)
        found_s = verdict.gates_after_s()
        if found_s == after_s:
            break
        after_s = found_s
    return order, mission, verdict


def widest(brief: Brief, plans: Sequence[VehiclePlan]) -> Brief:
    """The brief with the most terrain, of ``brief`` and those that the vehicles were planned under."""
    return max([brief, *(v.brief for v in plans if v.brief is not None)], key=lambda b: b.source.level)
