"""The default planner: the shortest tracks in the plane below an altitude cap, and a bound that holds for every path.

**The idea.** Where only ground, zones and a ceiling are in the way, planning is a problem in the plane. Fix an altitude
cap: ground and zones that cannot be passed below it are walls in the plane, and the best ground track is the shortest
one between them. It can be found exactly (`polyanya`): around the zones' own outlines (`outline_tracks`), and on a
lattice of the terrain model's cells (`plane_search`). Over a given track, floor and ceiling form a tube, and the best
altitude profile is a taut string through it, found in one pass (`taut_string`). The exact check has the last word.

**The bound.** The same search between walls that *certainly* stand (outlines inside the zones; a linear surface that
lies nowhere above the ground) gives a length that no track below the cap can beat. A path is longer than its track
because it climbs: the altitudes that a short enough track must have along its length are bounded, too. For energy the
cap itself has a price: caps are searched from both sides until no altitude between two of them can hold a better path
(`searches/bound`, `searches/cap_pairs`). Close to its ends a path can be only as high as its track up to there lets it
climb, which moves the walls (`clearance`); and everywhere only those altitudes between zones count that a short enough
track can climb to and return from (`altitude_intervals`).

**Where that does not hold**, under a maximum AGL, or where the climb limit binds far from the ends, paths are searched
on a lattice of reachable altitudes (`lattice`); the bound from the plane is valid there as well.

Each search is a module of `searches`; the governor chooses among them (`loop/governor.py`).
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import replace

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.errors import NoMission
from gcsplan.notes.note import Note
from gcsplan.planners.airspeed import Airspeed, Shortest
from gcsplan.planners.border import exit_cost
from gcsplan.planners.optimal.loop.governor import govern
from gcsplan.planners.optimal.loop.search import Improves
from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.table import all_searches, kinds, left_out
from gcsplan.planners.optimal.wind_plane import WindPlane
from gcsplan.planners.optimal.window import plan_over
from gcsplan.planners.problem import PlanFunction, Problem, Progress, Refusal, Solution, ceiling_m, terminals_of
from gcsplan.planners.profile.climb_laps import on_the_spot
from gcsplan.planners.refusal.explain import check_ends, explain
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path


def plan(problem: Problem) -> Solution:
    """A path from start to goal that passes `Airspace.examine`, and a cost that no such path can beat.

    Finds a first path, then improves path and bound until they are ``gap_percent`` apart, the budget is spent, or no
    search is left to try. Deterministic: stops on counted work; the clock is a last stop, unless the problem's
    ``budget`` is not ``clocked``. With ``turn_radius_m`` the
    path's points are fly-by way points, passed on arcs of that radius, and the flown path is the legal one.
    ``options``: ``without``, names of searches to leave out. If no path is found, raises Refusal (a NoMission), which
    names the binding constraint and whether it is proved that there is no path.
    """
    if problem.objective == "time" and problem.airspeed is not None:
        return _WingTime(problem, problem.airspeed).solution()
    return _over_all(problem, _within)


def _over_all(problem: Problem, plan_surface: PlanFunction) -> Solution:
    """`plan` by a function that plans over one surface."""
    problem = replace(problem, budget=problem.budget.anew(problem.budget_s, problem.budget_mb))
    found = plan_over(problem, plan_surface)
    # The searches bound paths between the exact ends; the mission's ends may lie beside them.
    bound = None if found.lower_bound is None else problem.rounding().bound(found.lower_bound)
    return replace(found, lower_bound=bound)


class _WingTime:
    """The least time of a fixed wing: the fastest path that is found, and a time that no path beats.

    The shortest path is flown as high as is worth it (`turns`). While it is apart from its bound, two more are planned
    with half the budget: in a wind, the shortest in the stretched plane, for its bound; and, if rates of climb and
    descent bind, the shortest that is flown at full speed.
    """

    def __init__(self, problem: Problem, airspeed: Airspeed) -> None:
        self.problem, self.airspeed = problem, airspeed
        self.best: Solution | None = None
        self.cost_s, self.bound_s, self.length_m = math.inf, 0.0, 0.0

    @property
    def near(self) -> bool:
        """Whether path and bound are as near to each other as requested."""
        return self.cost_s <= self.bound_s * (1.0 + self.problem.gap_percent / 100.0)

    def solution(self) -> Solution:
        """The solution. Raises Refusal."""
        shorter = replace(self.problem, objective="length", progress=None)
        half = replace(shorter, budget_s=0.5 * shorter.budget_s)
        found, over = self._straight(shorter)
        if self.airspeed.blows_m_s > 0.0 and not self.near:
            self._stretch(replace(over, budget_s=half.budget_s), (found.flown or found.path).points)
        gentle = self.airspeed.at_full_speed(shorter.limits)
        if gentle != shorter.limits and not self.near:
            with contextlib.suppress(NoMission):
                self._take(plan(replace(half, limits=gentle, checked=None, widen=None)))
        assert self.best is not None
        now, stopped = self.best.problem, self.best.stopped_by
        return replace(
            self.best,
            lower_bound=self.bound_s or None,
            problem=None if now is None else replace(now, objective="time", progress=self.problem.progress),
            stopped_by="gap" if self.near else "exhausted" if stopped == "gap" else stopped,
        )

    def _straight(self, problem: Problem) -> tuple[Solution, Problem]:
        """Plan the shortest path in the true plane; return it, and the problem over the terrain that this took."""

        def in_seconds(now: Progress) -> None:
            cost = None if now.path is None else self.airspeed.path_s(now.path.points)
            self._tell(now, cost, problem, Shortest(now.lower_bound or 0.0))

        found = plan(replace(problem, progress=None if self.problem.progress is None else in_seconds))
        over = replace(found.problem or problem, objective="length", progress=None)
        if found.lower_bound is not None:
            self.length_m = found.lower_bound
            leaving = Shortest(max(found.lower_bound, over.rounding().bound(exit_cost(over))))
            self.bound_s = self._least_s(over, Shortest(found.lower_bound), leaving)
        self._take(found)
        return found, over

    def _stretch(self, over: Problem, flown: Floats) -> None:
        """Raise the bound by what the stretched plane bounds.

        No search there looks for paths alone: the path ``flown`` (N, 3), stretched, is short enough to begin with. It
        is taken without a check, because on a skew grid the check may refuse what is legal.
        """
        plane = WindPlane.of(self.airspeed, max(over.start[2], over.goal[2]))
        there = plane.problem(over)
        rounding, leaving = there.rounding(), exit_cost(there)

        def least(bound: float) -> Shortest:
            return Shortest(self.length_m, rounding.bound(bound), plane.true_m_s)

        def in_seconds(now: Progress) -> None:
            self._tell(replace(now, path=None), self.cost_s, over, least(min(now.lower_bound or 0.0, leaving)))

        there = replace(
            _without(there, "paths"),
            budget=there.budget.anew(there.budget_s, there.budget_mb),
            progress=None if self.problem.progress is None else in_seconds,
        )
        found = search(there, over.turn_radius_m <= 0.0, plane.stretched(flown)).incumbent.bound
        self.bound_s = max(self.bound_s, self._least_s(over, least(min(found, leaving)), least(leaving)))

    def _take(self, found: Solution) -> None:
        cost_s = self.airspeed.path_s((found.flown or found.path).points)
        if cost_s < self.cost_s:
            self.best, self.cost_s = found, cost_s

    def _tell(self, now: Progress, cost: float | None, over: Problem, least: Shortest) -> None:
        if self.problem.progress is not None:
            bound = max(self._least_s(over, least, least), self.bound_s)
            self.problem.progress(replace(now, cost=cost, lower_bound=bound))

    def _least_s(self, over: Problem, least: Shortest, leaving: Shortest) -> float:
        """No path takes less if none is shorter than ``least``, and none that leaves the terrain than ``leaving``;
        ``over``: the problem for lengths."""
        limits, ends, off_m = over.bound_limits, (over.start[2], over.goal[2]), over.rounding_m[1]
        way_m = over.goal[0] - over.start[0], over.goal[1] - over.start[1]
        rest = off_m, way_m, 2.0 * over.rounding_m[0]
        within_s = self.airspeed.least_s(least, ends, limits, ceiling_m(over, limits), *rest)
        # Beyond the terrain that is loaded the ground may be higher, but that is far.
        beyond = ceiling_m(over, replace(limits, max_agl_m=None))
        return min(within_s, self.airspeed.least_s(leaving, ends, limits, beyond, *rest))


def _without(problem: Problem, improves: Improves) -> Problem:
    """The problem without the searches that improve paths alone, or bounds alone."""
    names = tuple(kind.NAME for kind in kinds() if improves == kind.IMPROVES)
    return replace(problem, options={**problem.options, "without": (*left_out(problem), *names)})


def _within(problem: Problem) -> Solution:
    """`plan` over the problem's surface alone."""
    if problem.turn_radius_m > 0.0:
        return _turning(problem)
    return _sharp(problem)


def search(problem: Problem, sharp: bool = True, known: Floats | None = None) -> Workspace:
    """Run all searches on a problem; the result, with best path and bound, is in the ``incumbent`` of what returns.
    ``known`` (N, 3): a path that is legal, to begin with."""
    incumbent = Incumbent(_under_one_ceiling(problem), sharp)
    if known is not None:
        incumbent.take(known)
    incumbent.tell("search")
    work = Workspace(incumbent)
    govern(incumbent, all_searches(work))
    return work


def _sharp(problem: Problem, sharp: bool = True) -> Solution:
    """`_within` for paths with sharp corners; ``sharp``: whether they stay so, see `Incumbent`. Raises Refusal."""
    check_ends(problem)
    if all(math.dist(terminals_of(problem)[0], x) < 1e-3 for x in terminals_of(problem)):
        incumbent = Incumbent(problem)
        incumbent.take(on_the_spot(problem))
        return incumbent.solution()
    incumbent = _fastest(problem, sharp) if problem.objective == "time" else search(problem, sharp).incumbent
    if incumbent.best is None:
        raise explain(problem, proved=True if incumbent.proved_infeasible else None)
    found = incumbent.solution()
    if incumbent.problem.limits.max_agl_m is not None and found.stopped_by != "gap":
        found = replace(found, notes=(Note("bound_by_cells"),))
    return found


def _fastest(problem: Problem, sharp: bool) -> Incumbent:
    """`search` for the least time: over all slopes; then, for other paths, over slopes at full speed alone, where
    tracks are as long as their climbs need."""
    incumbent = search(problem, sharp).incumbent
    if incumbent.best is None:
        # Bounds count laps in place of a steep climb: what is proved of them need not hold of paths without.
        shorter = replace(problem, objective="length", progress=None, leaving=math.inf)
        shortest = search(shorter, sharp).incumbent
        shortest.bound = incumbent.bound
        incumbent.proved_infeasible = shortest.proved_infeasible
        incumbent.take_over(shortest)
    if incumbent.best is not None and incumbent.goes_on():
        gentle = replace(problem, limits=problem.at_full_speed(problem.limits))
        incumbent.take_over(search(_without(gentle, "bounds"), sharp).incumbent)
    return incumbent


def _under_one_ceiling(problem: Problem) -> Problem:
    """The same problem with a maximum altitude AMSL instead of AGL, if the ground is level: more searches apply."""
    if problem.limits.max_agl_m is None or (level_m := problem.airspace.surface.level_m) is None:
        return problem

    def amsl(limits: Limits) -> Limits:
        most = [level_m + m for m in (limits.max_agl_m,) if m is not None]
        most += [m for m in (limits.max_amsl_m,) if m is not None]
        return replace(limits, max_agl_m=None, max_amsl_m=min(most, default=None))

    checked = None if problem.checked is None else amsl(problem.checked)
    return replace(problem, limits=amsl(problem.limits), checked=checked)


def _turning(problem: Problem) -> Solution:
    """`_within` for a turn radius: a path with sharp corners, rounded to arcs; planned again with more clearance where
    the arcs need it. Raises Refusal."""
    from gcsplan.planners.turns.planner import rounded, with_more_clearance  # few missions have wings

    # Laps are short and have sharp corners: rounding them to arcs loses their gain.
    sharp = _sharp(replace(problem, turn_radius_m=0.0), sharp=False)
    points = sharp.path.points

    def replan(extra_m: float) -> tuple[Floats, Bools] | None:
        try:
            again = _sharp(with_more_clearance(problem, extra_m), sharp=False).path.points
        except NoMission:
            return None
        return again, _terminals(problem, again)

    found = rounded(problem, points, _terminals(problem, points), replan)
    if found is None:
        raise Refusal(
            f"a path with sharp corners was found, but none was whose arcs of turn_radius_m {problem.turn_radius_m:g} "
            f"keep the limits: allow tighter turns, or move the obstacle",
            reason="not_found",
        )
    near = sharp.lower_bound is not None and found.cost <= sharp.lower_bound * (1.0 + problem.gap_percent / 100.0)
    return replace(
        sharp,
        path=Path(found.way_points),
        flown=Path(found.flown),
        stopped_by=sharp.stopped_by if near or sharp.stopped_by == "time" else "exhausted",
        planning_s=problem.budget.elapsed_s,
        notes=(*sharp.notes, Note("bound_ignores_turns")),
    )


def _terminals(problem: Problem, points: Floats) -> Bools:
    """(N,) which points of a path are its terminals."""
    terminals = np.array(terminals_of(problem))
    away = np.hypot(*(points[:, None, :2] - terminals[None]).transpose(2, 0, 1)).min(axis=1)
    return np.asarray(away < 1e-3)
