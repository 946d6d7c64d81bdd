"""A fixed wing's plan: a climb-out, a path of arcs, and an approach, joined end to end.

The ends are made first (`planners.turns.ends`): the climb-out goes straight from the start as far as it must climb, on
the requested heading or the first legal one near the direction of the path. If the vehicle lands, the approach to the
goal is made likewise, backwards. The planner joins the ends. Then the mission is built, and judged as flown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np

from gcsplan.app.plan.model import Brief, VehiclePlan
from gcsplan.app.plan.problem import built, looked_over, run_planner
from gcsplan.app.plan.replanning import Attempts, with_bound
from gcsplan.arrays import Floats
from gcsplan.check.fixed_wing.ends import (
    REACHED_M,
    above_slant,
    beside_strip,
    blown_slant,
    brakes_m,
    circle_missing_m,
    drift_of,
    flared,
    landing_speeds_m_s,
    over_m,
    slant_shortage,
)
from gcsplan.check.motion.circles import circle_reach_m
from gcsplan.errors import NoMission
from gcsplan.mavlink.build.fixed_wing import pitch_deg
from gcsplan.mavlink.build.order import FLOWN_SLOPE, MARGINS, Order, Wing
from gcsplan.mission_file import VehicleRequest
from gcsplan.notes.note import Note
from gcsplan.planners.problem import Problem, Solution, straight_bound
from gcsplan.planners.refusal.suggestions import FILLED
from gcsplan.planners.turns.ends import (
    FlightEnd,
    RequiredEnd,
    around_m,
    circling_ends,
    column_clear,
    cut_off_m,
    joined,
    numbers_of,
    pairs,
    problem_between,
    straight_ends,
    unfitting_legs,
)
from gcsplan.vehicle import Vehicle
from gcsplan.world.geometry.path import Path
from gcsplan.world.world import World

__all__ = ["bound_between", "solution_between", "starts", "wing_attempts"]


WING_ATTEMPTS = 5

MOST_JOINTS = 8
"""Most pairs of climb-out and approach for which a path is searched."""

LONG_CLIMB_OUT_M = 1000.0
"""A straight climb-out from here on, m, is one for which a climbing circle is offered."""

MOST_REFUSED = 3
"""Most pairs without a path: it may be that another climb-out leaves room for the first turn."""

JOINTS = "none that joins the climb-out and the approach: give another takeoff_heading_deg, or move start or goal"
UNFITTING = ("arcs_too_long", "turn_too_early")
"""Notes on arcs that do not fit."""

APART = "none whose turns all fit between its way points: put vias farther apart, or allow tighter turns"

ACCEPTED_M, CHORDS_M = 1.0, 0.2
"""Metres by which a turn begins early or late (acceptance radii are whole metres), and by which arcs are judged
wider."""


def wing_attempts(brief: Brief, request: VehicleRequest, limited: VehicleRequest, world: World) -> Attempts:
    """The attempts to plan a fixed wing; the search keeps ``limited``'s limits, over ``world``.

    The path without arcs shows where its ends should lead. Margins hardly move it, so it is found once.
    """
    sharp: list[Floats] = []

    def fly(problem: Problem) -> VehiclePlan:
        problem = _with_goal_circle(problem, limited)
        if not sharp:
            straight = replace(problem, turn_radius_m=0.0, progress=None)
            sharp.append(run_planner(brief.run, straight, request.vehicle, world).path.points)
        return _joined(brief, request, limited, problem, sharp[0], world)

    margins = replace(MARGINS, track_m=MARGINS.track_m + ACCEPTED_M + CHORDS_M)
    return Attempts(WING_ATTEMPTS, margins, fly)


def _joined(
    brief: Brief, request: VehicleRequest, limited: VehicleRequest, problem: Problem, sharp: Floats, world: World,
    *, trial: bool = False,
) -> VehiclePlan:  # fmt: skip
    """The mission with the first pair of ends that a path can be joined to; it may still break limits, and has no bound
    then, nor in a ``trial``."""
    vehicle = request.vehicle
    refused: list[NoMission] = []
    why = ""
    ends = pairs(starts(problem, limited, sharp), goals(problem, limited, sharp))
    for tried, (start, goal) in enumerate(ends):
        if tried == MOST_JOINTS:
            break
        inner = problem_between(problem, start, goal)
        try:
            found = solution_between(brief, inner, vehicle, world)
        except NoMission as refusal:
            refused.append(refusal)
            if refusal.reason != "not_found" or len(refused) == MOST_REFUSED:
                raise refused[0] from refused[0].__cause__
            continue
        solution = _whole(problem, found, start, goal)
        order = _order(brief, limited, start, goal)
        unfit = unfitting_legs(solution.path.points, start, goal, vehicle.turn_radius_m)
        if len(unfit):
            last = len(solution.path.points) - (0 if goal is None else len(goal.chain))
            inside = (unfit > len(start.chain)) & (unfit < last)
            why = APART if inside.any() else JOINTS
            continue
        over = looked_over(brief, solution)
        mission, verdict = built(over, request, solution, order)
        crowded = [note for note in verdict.not_judged if note.code in UNFITTING]
        if crowded:
            why = f"{APART}\n  {crowded[0]}"
            continue
        if not verdict.findings and found.lower_bound is not None and not trial:
            bound = bound_between(brief, inner, solution.path.points, start, goal, vehicle, world)
            solution = with_bound(solution, bound, problem)
        speed = vehicle.speed_max_m_s
        notes = (*_notes(start, goal), *_why_so(problem, request, goal))
        straight_m = 0.0 if start.circle is not None else math.dist(start.top[:2], start.ground[:2])
        if straight_m >= LONG_CLIMB_OUT_M and not verdict.findings:
            notes += tuple(_circles_instead(brief, request, limited, problem, sharp, world))
        return VehiclePlan(request, inner, solution, mission, verdict, speed, notes, order, over)
    if refused and not why:
        raise refused[0] from refused[0].__cause__
    raise NoMission(
        f"{vehicle.name}: paths with turns of turn_radius_m {vehicle.turn_radius_m:g} were found, but {why or JOINTS}",
        reason="not_found",
    )


def _with_goal_circle(problem: Problem, request: VehicleRequest) -> Problem:
    """Raise the goal as high as the flight around it needs: the circle of a loiter, or the turn for home."""
    east, north, amsl = problem.goal
    vehicle = request.vehicle
    circle_m = circle_reach_m(around_m(problem), amsl + 100.0, vehicle.speed_max_m_s, vehicle.wind_m_s)
    around = {"loiter": circle_m, "rtl": 2.0 * problem.turn_radius_m}
    reach_m = around.get(request.end)
    if reach_m is None:
        return problem
    wide = replace(problem.limits, track_error_m=problem.limits.track_error_m + reach_m)
    low = float(problem.airspace.floor_amsl(east, north, wide))
    if math.isinf(low):
        raise NoMission(
            f"{request.vehicle.name}: the ground within {reach_m:.0f} m of the goal is unknown to the terrain model: "
            f"{FILLED}",
            reason="not_found",
        )
    datum = request.start[2]
    raised = max(amsl, datum + math.ceil((low - datum) * 100.0 - 1e-6) / 100.0)
    return replace(problem, goal=(east, north, raised))


@dataclass(frozen=True, eq=False, slots=True)
class _EndRules:
    """The rules of the check for one end of a vehicle's flight, as the planner asks for them (`EndJudge`).

    ``lands_m_s`` is the speed of a landing, 0 for a take-off, and ``over``: how far a take-off gets above its altitude,
    m.
    """

    problem: Problem
    vehicle: Vehicle
    lands_m_s: float = 0.0
    over: float = 0.0
    reached_m: float = REACHED_M

    def slant_clear(self, ground: Floats, top: Floats) -> bool:
        """See `EndJudge.slant_clear`."""
        limits, air = self.problem.limits, self.problem.airspace
        lines = [(ground, top, 0.0)]
        if self.vehicle.vtol:
            return column_clear(ground, top, 0.0, limits, air)
        if self.lands_m_s > 0.0:
            run_m = math.dist(top[:2], ground[:2])
            for speed_m_s in landing_speeds_m_s(self.vehicle, self.lands_m_s):
                below = flared(numbers_of(top), numbers_of(ground), run_m, speed_m_s)
                lines += [(np.array(b), np.array(a), 0.0) for a, b in pairwise(below)]
        else:
            way, low, high = top[:2] - ground[:2], numbers_of(ground), numbers_of(top)
            aside_m, from_part = drift_of(self.vehicle, float(way[0]), float(way[1]))
            if not all(
                column_clear(np.array(a), np.array(b), aside_m, limits, air, band_m)
                for a, b, band_m in above_slant(low, high, limits, self.over)
            ):
                return False
            lines += [
                (np.array(a), np.array(b), reach_m) for a, b, reach_m in blown_slant(low, high, aside_m, from_part)
            ]
        return all(
            column_clear(a, b, reach_m, limits, air)
            and slant_shortage(np.array([a, b]), ground, reach_m, limits, air) is None
            for a, b, reach_m in lines
        )

    def circle_growth(self, amsl_m: float) -> float:
        """See `EndJudge.circle_growth`."""
        radius_m = around_m(self.problem)
        return circle_reach_m(radius_m, amsl_m, self.vehicle.speed_max_m_s, self.vehicle.wind_m_s) / radius_m

    def circle_missing_m(self, middle: Floats, reach_m: float) -> float:
        """See `EndJudge.circle_missing_m`."""
        return circle_missing_m(middle, reach_m, self.problem.limits, self.problem.airspace)


def starts(problem: Problem, request: VehicleRequest, sharp: Floats) -> Iterator[FlightEnd]:
    """Climb-outs, on the requested heading or the most natural ones first. Raises NoMission if there is none."""
    slope = math.tan(math.radians(pitch_deg(request.vehicle))) * request.vehicle.tail_ratio
    slope = math.inf if request.vehicle.vtol else slope
    given = request.takeoff_heading_deg
    heading = None if given is None else math.radians(90.0 - given)
    rules = _EndRules(problem, request.vehicle, over=over_m(request.vehicle))
    required = RequiredEnd(np.array(request.start), slope, request.takeoff_agl_m, heading, rules)
    if request.climb_out == "circles":
        return _some(
            circling_ends(problem, required, sharp),
            f"{request.vehicle.name}: no climb-out in circles clears the ground, the zones and the ceiling"
            f"{_blown(request.vehicle)}: write climb_out: straight, or give another start",
        )
    straight = straight_ends(problem, required, sharp)
    first = next(straight, None)
    if request.vehicle.vtol:
        return _some(
            chain([] if first is None else [first], straight),
            f"{request.vehicle.name}: no vertical take-off, on any heading, clears the zones and the ceiling and leads "
            "to where min AGL is met: give another start, or another takeoff_heading_deg",
        )
    which = "on any heading" if given is None else f"on takeoff_heading_deg {given:g}"
    other = "start" if given is None else "heading"
    return _some(
        circling_ends(problem, required, sharp) if first is None else chain([first], straight),
        f"{request.vehicle.name}: no climb-out {which} clears the ground, the zones and the ceiling"
        f"{_blown(request.vehicle)} at {pitch_deg(request.vehicle)}° (max_climb_deg, whole degrees) and leads to where "
        f"min AGL is met, straight or in circles: another {other} or a steeper climb may"
        f"{beside_strip(problem.airspace) or ''}",
    )


def _blown(vehicle: Vehicle) -> str:
    """What the declared winds have to do with a climb-out or an approach that is not clear."""
    return f" in winds and gusts of up to {vehicle.wind_m_s:.1f} m/s" if vehicle.blows_m_s else ""


def goals(problem: Problem, request: VehicleRequest, sharp: Floats) -> Iterator[FlightEnd | None]:
    """Approaches, the most natural ones first; one None if it does not land. Raises NoMission if there is none."""
    if request.end != "land":
        return iter([None])
    slope = request.vehicle.limits.max_descent_slope * (1.0 - FLOWN_SLOPE)
    rules = _EndRules(problem, request.vehicle, lands_m_s=request.vehicle.speed_max_m_s)
    rank = _landing_rank(problem, request)
    required = RequiredEnd(np.array(request.goal), slope, request.approach_agl_m, None, rules, rank)
    if request.vehicle.vtol:
        run_m = brakes_m(request.vehicle, problem.goal[2] + UPRIGHT_M)
        required = replace(required, slope=math.inf, rank=lambda heading: 0.0, run_m=run_m)
    return _some(
        straight_ends(problem, required, sharp[::-1]),
        f"{request.vehicle.name}: no straight approach to the goal, on any heading, clears the ground and the "
        f"zones at max_descent_deg {request.vehicle.limits.max_descent_deg:g}{_blown(request.vehicle)}: use end: "
        f"loiter, or another goal{beside_strip(problem.airspace) or ''}",
    )


UPRIGHT_M = 200.0
"""A VTOL brakes for a landing no more than this above the lowest legal height there, m, as far as is planned."""
INTO_WIND = 0.15
"""The part of the way from the best to the worst wind for landing within which a heading is into the wind: 45° of a
constant wind."""
LEAST_WIND_M_S = 1.0
"""Winds for landing that differ by less, m/s, decide nothing."""
UPHILL_M, UPHILL = 100.0, 0.05
"""How far before a landing its ground is looked at, m, and from which slope on a landing leads uphill or downhill."""


def _landing_rank(problem: Problem, request: VehicleRequest) -> Callable[[float], float]:
    """The rank of an approach's heading, seen outwards: a landing with a wind behind, or down a slope, comes later."""

    def rank(heading: float) -> float:
        return max(0.0, _from_behind(request.vehicle, heading)) + max(0.0, _falls(problem, request.goal, heading))

    return rank


def _from_behind(vehicle: Vehicle, heading: float) -> float:
    """How much the declared winds blow from behind in a landing, in steps from 0, into them; 0 without a wind."""
    blows_m_s = [vehicle.blows_along_m_s(heading + math.pi), *vehicle.blows_m_s]
    best, worst = min(blows_m_s), max(blows_m_s)
    if worst - best < LEAST_WIND_M_S:
        return 0.0
    return float(math.floor((blows_m_s[0] - best) / (worst - best) / INTO_WIND))


def _falls(problem: Problem, goal: tuple[float, float, float], heading: float) -> float:
    """1 if a landing leads downhill, -1 if uphill, 0 on about level or unknown ground."""
    east, north = (goal[k] + UPHILL_M * trig(heading) for k, trig in enumerate((math.cos, math.sin)))
    higher_m = float(problem.airspace.surface.ground_at(east, north)) - goal[2]
    steep = not math.isnan(higher_m) and abs(higher_m) >= UPHILL * UPHILL_M
    return math.copysign(1.0, higher_m) if steep else 0.0


def _some(ends: Iterator[FlightEnd], refusal: str) -> Iterator[FlightEnd]:
    """The ends; at the first one, NoMission with the words of ``refusal`` is raised if there is none."""
    first = next(ends, None)
    if first is None:
        raise NoMission(refusal, reason="not_found")
    yield first
    yield from ends


def _whole(problem: Problem, solution: Solution, start: FlightEnd, goal: FlightEnd | None) -> Solution:
    """The solution with both ends added, yet without a lower bound."""
    points = joined(problem, solution.path.points, start, goal)
    notes = solution.notes
    if solution.lower_bound is not None:
        notes = (*notes, Note("bound_with_climb_out", approach=goal is not None))
    return replace(solution, path=Path(points), flown=None, lower_bound=None, notes=notes)


def solution_between(brief: Brief, inner: Problem, vehicle: Vehicle, world: World) -> Solution:
    """The planner's part. Its bound only ends the search, and assumes the margins, which are metres here: against one
    without them the gap would stay open whatever is tried. A refusal is that of the limits of the check."""
    try:
        return run_planner(brief.run, replace(inner, checked=None, rounding_m=(0.0, 0.0)), vehicle, world)
    except NoMission as refusal:
        if refusal.reason != "infeasible" or inner.checked is None:
            raise
    return run_planner(brief.run, inner, vehicle, world)


def bound_between(
    brief: Brief, inner: Problem, points: Floats, start: FlightEnd, goal: FlightEnd | None, vehicle: Vehicle,
    world: World,
) -> float:  # fmt: skip
    """A lower bound of all paths from the end of the climb-out to the approach, under the limits of the check.

    Neither the turns that this plan makes there nor its turn radius count. What its arcs cut off at both joints, where
    it does not pass the ends themselves, is subtracted: its ``points`` (N, 3) begin behind the first joint.
    """
    first, last = start.leaves, np.array(inner.goal) if goal is None else goal.top
    outer = replace(
        inner, start=numbers_of(first), goal=numbers_of(last), limits=inner.checked or inner.limits, checked=None,
        turn_radius_m=0.0, progress=None, widen=None, budget_s=0.5 * inner.budget_s,
    )  # fmt: skip
    try:
        bound = run_planner(brief.run, outer, vehicle, world).lower_bound
    except NoMission:  # an end of a climb-out may lie lower than paths may
        bound = None
    if bound is None:
        bound = straight_bound(outer, outer.rounding_m)
    ends_m = cut_off_m(points, start, goal, vehicle.turn_radius_m)
    return max(bound - float(inner.slope_costs(ends_m, 0.0, float(points[:, 2].min()))), 0.0)


def _order(brief: Brief, request: VehicleRequest, start: FlightEnd, goal: FlightEnd | None) -> Order:
    wing = Wing(
        numbers_of(start.top), None if goal is None else numbers_of(goal.ground),
        float(math.ceil(request.vehicle.turn_radius_m)) if request.end == "loiter" else 0.0,
        None if start.circle is None else numbers_of(start.circle), start.circle_m,
    )  # fmt: skip
    return Order(request.end, brief.source.altitude_frame, wing=wing)


def _circles_instead(
    brief: Brief, request: VehicleRequest, limited: VehicleRequest, problem: Problem, sharp: Floats, world: World
) -> Iterator[Note]:
    """The climbing circle that may take the place of a climb-out of kilometres, if a mission with it is safe.

    All trials together take no more than the budget of the plan.
    """
    trial = replace(problem, budget_s=problem.budget_s / MOST_JOINTS, progress=None)
    circling = replace(request, climb_out="circles"), replace(limited, climb_out="circles")
    try:
        tried = _joined(brief, circling[0], circling[1], trial, sharp, world, trial=True)
    except NoMission:
        return
    made = next((note.data for note in tried.notes if note.code == "climb_out_in_circles"), None)
    if made is not None and tried.verdict.safe is True:
        yield Note(
            "circles_instead", far_m=made["far_m"], circle_m=made["circle_m"], up_m=made["circled_m"],
            length_m=tried.verdict.length_m,
        )  # fmt: skip


def _why_so(problem: Problem, request: VehicleRequest, goal: FlightEnd | None) -> Iterator[Note]:
    """Why it lands on its heading: into the wind, uphill; nothing where neither decides."""
    if goal is None or not goal.slant:
        return
    behind, falls = _from_behind(request.vehicle, goal.heading), _falls(problem, request.goal, goal.heading)
    windy = max(request.vehicle.blows_m_s, default=0.0) - min(request.vehicle.blows_m_s, default=0.0) >= LEAST_WIND_M_S
    into = windy and behind <= 0.0
    if into or falls < 0.0:
        yield Note("approach_into_wind", uphill=falls < 0.0) if into else Note("approach_uphill")


def _notes(start: FlightEnd, goal: FlightEnd | None) -> Iterator[Note]:
    """How to launch it, and how it lands."""
    heading_deg = (90.0 - math.degrees(start.heading)) % 360.0
    far_m, up_m = math.dist(start.top[:2], start.ground[:2]), float(start.top[2] - start.ground[2])
    if not start.slant:  # the check says how to stand it
        return
    if start.circle is None:
        yield Note("climb_out", heading_deg=heading_deg, far_m=far_m, up_m=up_m)
    else:
        yield Note(
            "climb_out_in_circles", heading_deg=heading_deg, far_m=far_m, up_m=up_m, circle_m=abs(start.circle_m),
            circled_m=float(start.circle[2] - start.ground[2]),
        )  # fmt: skip
    if goal is not None:
        yield Note(
            "approach", heading_deg=(270.0 - math.degrees(goal.heading)) % 360.0,
            far_m=math.dist(goal.top[:2], goal.ground[:2]), up_m=float(goal.top[2] - goal.ground[2]),
        )  # fmt: skip
