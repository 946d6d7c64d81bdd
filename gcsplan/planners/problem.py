"""The input of every planner (`Problem`), its result (`Solution`), and its refusal where there is no result."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from types import MappingProxyType
from typing import Literal

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.errors import LimitValues, NoMission, NoMissionReason, wrong_argument
from gcsplan.notes.note import Note
from gcsplan.planners.airspeed import Airspeed
from gcsplan.planners.budget import Budget
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path

Objective = Literal["length", "energy", "time"]

UNIT_OF: Mapping[Objective, str] = MappingProxyType({"length": "m", "energy": "J", "time": "s"})
"""The unit of each objective's costs and bounds."""

ENDS_M = 25.0
"""Metres by which floors and ceilings over a line, which are conservative, are too strict in rough ground at worst. So
they do not decide whether start and goal themselves are legal (`explain.check_ends` does)."""
PASSED_M = 1e-3
"""Metres within which a path passes a via."""


@dataclass(frozen=True, slots=True)
class Via:
    """A point that the path must pass; ``amsl_m`` None leaves its altitude free."""

    east_m: float
    north_m: float
    amsl_m: float | None = None


@dataclass(frozen=True, slots=True)
class Progress:
    """A progress report of a plan: seconds since the call, best cost so far, lower bound (either may be None).

    ``path``: the best path so far, if it is one from start to goal. Its legs keep the limits; the mission made of it is
    not judged yet.
    """

    elapsed_s: float
    cost: float | None
    lower_bound: float | None
    phase: str = ""
    path: Path | None = None


@dataclass(frozen=True, slots=True)
class EndRounding:
    """The deduction from lower bounds for the rounding of ends and vias: `Problem.connectors`, and the cost of the
    ``straight`` line between places that lie as near to each other as they may."""

    connectors: float
    straight: float

    def bound(self, bound: float) -> float:
        """A lower bound of all paths, whose ends and vias may lie beside the exact ones, from a bound of paths between
        the exact ones: less the connectors, or the straight line if that is longer."""
        return max(bound - self.connectors, min(self.straight, bound))


@dataclass(frozen=True, eq=False, slots=True)
class Problem:
    """Find a path from ``start`` to ``goal`` (east_m, north_m, amsl_m) that passes every ``via`` in order.

    Paths keep ``limits``, which already include the planner's margins (wire rounding, bow, corners that are
    cut), so a path that passes `Airspace.examine` under them passes the final check too. ``checked`` are the same
    limits as the check applies them, without any margin (None: ``limits``): bounds and proofs assume only these, by
    `bound_limits` and `for_bounds`. ``rounding_m``: how far ends and vias of the paths that a bound speaks of may lie
    beside the problem's own, in the plane and in altitude. See docs/concepts/certificates.md.

    ``speed_m_s`` over ground and the rates of climb and descent are the fastest, and count for the objective ``time``
    alone. A fixed wing has an ``airspeed`` as well, which decides how long its legs take.

    Metres only: a planner never sees a degree. ``options`` are keys that only some planners know:
    the swarms' ``encoding``, ``cost``, ``points``, ``population``, ``iterations``, ``evaluations``, ``parameters``.

    ``widen(margin_m, budget_mb)``: the same problem over more terrain, at least ``margin_m`` around all terminals (inf:
    twice as far as here) if memory allows; None if it does not, or if there is no more terrain; `Surface.goes_on` shows
    which. ``leaving``: if a bound above this cost is found, the search ends, because paths that leave the surface may
    cost as little: more terrain is needed first.

    ``known`` (N, 3): east_m, north_m, amsl_m of the way points of a path that was legal before places or zones moved,
    with the ends that it had, without its vias. A planner may try it first.
    """

    airspace: Airspace
    limits: Limits
    start: tuple[float, float, float]
    goal: tuple[float, float, float]
    via: tuple[Via, ...] = ()
    objective: Objective = "length"
    vertical_j_per_m: float = 120.0
    horizontal_j_per_m: float = 100.0
    speed_m_s: float = 15.0
    climb_m_s: float = 2.5
    descent_m_s: float = 1.5
    airspeed: Airspeed | None = None
    turn_radius_m: float = 0.0
    seed: int = 1
    gap_percent: float = 0.1
    budget_s: float = 10.0
    budget_mb: float = 1024.0
    budget: Budget = field(default_factory=Budget.endless)
    progress: Callable[[Progress], None] | None = None
    options: Mapping[str, object] = field(default_factory=lambda: MappingProxyType({}))
    widen: Callable[[float, float], Problem | None] | None = None
    leaving: float = math.inf
    checked: Limits | None = None
    rounding_m: tuple[float, float] = (0.0, 0.0)
    known: Floats | None = None

    def __repr__(self) -> str:
        return f"<Problem from {self.start} to {self.goal}, {len(self.via)} vias, {len(self.airspace.zones)} zones>"

    def __getstate__(self) -> list[object]:
        """Without the caller's function and without what loads more terrain, which are of this process alone."""
        alone = {"progress": None, "widen": None, "options": dict(self.options)}
        return [alone.get(f.name, getattr(self, f.name)) for f in fields(self)]

    @property
    def bound_limits(self) -> Limits:
        """The limits that bounds and proofs assume: the check's limits, with less track error by `_aside_m`.

        So a path that begins a little beside the start is one from the start itself, with a connector that is legal.
        For the objective ``time`` they have the slopes of `at_full_speed`.
        """
        checked = self.at_full_speed(self._checked)
        return replace(checked, track_error_m=max(checked.track_error_m - self._aside_m, 0.0))

    @property
    def bound_spare_m(self) -> float:
        """Metres by which bounds assume zones to be smaller and floors lower, because the track error is less than
        `_aside_m`."""
        return max(self._aside_m - self._checked.track_error_m, 0.0)

    @property
    def _checked(self) -> Limits:
        return self.limits if self.checked is None else self.checked

    @property
    def _aside_m(self) -> float:
        """By how much bounds assume less track error, so that connectors are legal: the rounding; 0 if the ends alone
        are rounded and keep it themselves, under `limits`. A path may pass a via where the planner's own cannot."""
        checked, (flat_m, rise_m) = self._checked, self.rounding_m
        keep = (
            self.limits.track_error_m >= checked.track_error_m + flat_m
            and self.limits.altitude_error_m >= checked.altitude_error_m + rise_m
        )
        return 0.0 if keep and not self.via else flat_m

    def at_full_speed(self, limits: Limits) -> Limits:
        """``limits``; for the objective ``time`` with no slope on which a rate of climb or descent takes speed away.
        A bound of paths within them holds of all: docs/concepts/bound.md#time. With an ``airspeed`` they stay."""
        if self.objective != "time" or self.airspeed is not None:
            return limits
        up, down = (math.degrees(math.atan(rate / self.speed_m_s)) for rate in (self.climb_m_s, self.descent_m_s))
        return replace(
            limits, max_climb_deg=min(limits.max_climb_deg, up), max_descent_deg=min(limits.max_descent_deg, down)
        )

    @property
    def rates(self) -> tuple[float, float] | None:
        """The costs of a metre of track and of a metre climbed or descended besides, whose sum no path undercuts; None
        for the objective ``length``, which no such sum is near to. A climb at full speed costs nothing besides."""
        if self.objective == "time":
            return 1.0 / self.speed_m_s, 0.0
        return (self.horizontal_j_per_m, self.vertical_j_per_m) if self.objective == "energy" else None

    @property
    def for_bounds(self) -> Problem:
        """The same problem with the limits that bounds and proofs assume, for searches that serve them alone."""
        return replace(self, limits=self.bound_limits, checked=None, rounding_m=(0.0, 0.0))

    @property
    def connectors(self) -> float:
        """The most that connectors to the problem's own ends and vias add to the cost of a path: one at each end, two
        at each via. A bound of paths between the exact ends, less this, is one of all paths."""
        flat, rise = self.rounding_m
        each = max(float(self.slope_costs(flat, up)) for up in (rise, -rise))
        return (2 + 2 * len(self.via)) * each

    def rounding(self) -> EndRounding:
        """The deduction from lower bounds for the rounding of ends and vias."""
        return EndRounding(self.connectors, straight_bound(self, self.rounding_m) * (1.0 - 1e-12))

    def leg_costs(self, start: Floats, end: Floats) -> Floats:
        """(...) costs of straight legs between points (..., 3); `cost` of a path is their sum."""
        d = end - start
        middle_m = 0.5 * (start[..., 2] + end[..., 2])
        return self.slope_costs(np.hypot(d[..., 0], d[..., 1]), d[..., 2], middle_m, d[..., :2])

    def slope_costs(
        self, run_m: Floats | float, rise_m: Floats | float, amsl_m: Floats | float = 0.0, way_m: Floats | None = None
    ) -> Floats:
        """(...) costs of straight legs by their metres of track and the metres that they rise, below 0 where they
        descend. A leg costs no more than any other way between its ends, because costs grow in proportion to a leg and
        are convex in both numbers; but for an ``airspeed``, whose legs have their middles at ``amsl_m`` and lead
        ``way_m`` (..., 2) to east and to north; None: against its wind."""
        if self.objective == "energy":
            return np.asarray(self.horizontal_j_per_m * run_m + self.vertical_j_per_m * np.abs(rise_m))
        if self.objective == "time":
            if self.airspeed is not None:
                return self.airspeed.leg_s(run_m, rise_m, amsl_m, way_m)
            rise_s = np.maximum(np.divide(rise_m, self.climb_m_s), np.divide(rise_m, -self.descent_m_s))
            return np.maximum(np.divide(run_m, self.speed_m_s), rise_s)
        return np.asarray(np.hypot(run_m, rise_m))

    def least_cost(self, track_m: float, vertical_m: float) -> float:
        """The least cost of a path from start to goal whose track is at least so long, and which climbs and descends at
        least so many metres in all. For the objective ``time`` it climbs and descends one after the other, and flies
        its track meanwhile."""
        if self.objective != "time":
            return float(self.slope_costs(track_m, vertical_m))
        rise_m = self.goal[2] - self.start[2]
        up_m, down_m = (0.5 * max(vertical_m + rise, 0.0) for rise in (rise_m, -rise_m))
        return max(track_m / self.speed_m_s, up_m / self.climb_m_s + down_m / self.descent_m_s)

    def most_climbed_m(self, cost: float, track_m: float) -> float:
        """The most metres that such a path climbs and descends in all if it costs no more than ``cost``."""
        if self.objective == "length":
            return math.sqrt(max(cost**2 - track_m**2, 0.0))
        if self.objective == "energy":
            level, climbing = self.horizontal_j_per_m * track_m, self.vertical_j_per_m
        else:
            up, down = 0.5 / self.climb_m_s, 0.5 / self.descent_m_s
            level, climbing = (self.goal[2] - self.start[2]) * (up - down), up + down
        return (cost - level) / climbing if climbing else math.inf

    def cost_through(self, points: Floats) -> float:
        """Metres, joules or seconds of the path through ``points`` (N, 3)."""
        return float(self.leg_costs(points[:-1], points[1:]).sum())

    def legal(self, start: Floats, end: Floats) -> Bools:
        """(N,) whether straight legs from ``start`` (N, 3) to ``end`` (N, 3) pass the exact check; counted as work."""
        if not len(start):
            return np.zeros(0, np.bool_)
        grid = self.airspace.surface.grid
        metres = float(np.abs(end[:, :2] - start[:, :2]).sum())
        self.budget.spend("check", 1)
        self.budget.spend("leg", len(start))
        self.budget.spend("cell", metres / float(grid.metres_per_cell(*self.start[:2]).min()))
        legal, cut = self.airspace.clear_counted(Legs.between(start, end, self.limits), self.limits)
        self.budget.spend("cut", cut)
        return legal

    def floors(self, east_m: Floats, north_m: Floats) -> Floats:
        """Lowest legal altitudes AMSL over places, see `Airspace.floor_amsl`; counted as work."""
        self.budget.spend("place", np.size(east_m))
        return self.airspace.floor_amsl(east_m, north_m, self.limits)

    def cost(self, path: Path) -> float:
        """Metres, joules or seconds of ``path``, by the objective."""
        if self.objective == "energy":
            return path.energy_j(self.vertical_j_per_m, self.horizontal_j_per_m)
        return path.length_m if self.objective == "length" else self.cost_through(path.points)


@dataclass(frozen=True, slots=True)
class Step:
    """The record of one search of a plan: name, seconds by the clock, megabytes by count, and by how many percent it
    made the best path cheaper and the lower bound higher. ``refused``: it did not fit into the rest of the budget."""

    name: str
    s: float
    mb: float
    gained_percent: float = 0.0
    bound_percent: float = 0.0
    refused: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class Solution:
    """A path that passes `Airspace.examine`, and a lower bound of the best one.

    ``lower_bound`` holds for every feasible path of the stated model, in the objective's unit; None if the planner has
    none. ``stopped_by``: gap, exhausted, budget, evaluations, time. ``notes`` are shown to the user. ``flown``: the
    path on arcs that the aircraft flies past ``path``'s points, if there is a turn radius; None if corners are flown as
    they are. For planners that search by samples: ``raw_violations``, the number of limits that the exact check found
    broken in the search's own result, and whether it was ``repaired``; None for all others. ``problem``: the problem
    that was solved, if that is the original one over more terrain.
    """

    path: Path
    lower_bound: float | None = None
    stopped_by: str = "exhausted"
    planning_s: float = 0.0
    first_path_s: float = 0.0
    notes: tuple[Note, ...] = ()
    flown: Path | None = None
    raw_violations: int | None = None
    repaired: bool | None = None
    search: tuple[Step, ...] = ()
    problem: Problem | None = None

    def __repr__(self) -> str:
        return f"<Solution: {len(self.path.points)} points, bound {self.lower_bound}, stopped by {self.stopped_by}>"


def gap_percent(cost: float | None, lower_bound: float | None) -> float | None:
    """How far a path may be above the best one, in percent of the lower bound; None without either."""
    # A path is below its bound by rounding alone.
    return None if cost is None or not lower_bound else max(0.0, 100.0 * (cost / lower_bound - 1.0))


PlanFunction = Callable[[Problem], Solution]
"""Finds a path, or raises `Refusal`."""


class Refusal(NoMission):
    """There is no mission: the reason, and ``east_m``, ``north_m`` of the binding place, None without a single place.

    ``place_of``: the object at that place, if the message does not name it.
    ``untried``: another limit, or fewer zones, may help, and none has been tried yet (`with_cures` does so).
    ``cures``: see `NoMission`.
    """

    east_m: float | None
    north_m: float | None

    def __init__(
        self,
        message: str,
        *,
        reason: NoMissionReason,
        place: tuple[float, float] | None = None,
        place_of: str = "",
        untried: bool = False,
        cures: tuple[LimitValues, ...] = (),
    ) -> None:
        super().__init__(message, reason=reason, cures=cures)
        self.east_m = self.north_m = None
        if place is not None:
            try:
                self.east_m, self.north_m = map(float, place)
            except Exception as why:  # a planner of another package gives it
                raise wrong_argument("Refusal()", "place", place, "a pair of metres, east and north") from why
        self.place_of = place_of
        self.untried = untried


def terminals_of(problem: Problem) -> list[tuple[float, float]]:
    """(east_m, north_m) of the start, every via, and the goal."""
    return [problem.start[:2], *((v.east_m, v.north_m) for v in problem.via), problem.goal[:2]]


def passes_vias(problem: Problem, points: Floats) -> bool:
    """Whether a path (N, 3) has a point at each via, in order, within `PASSED_M` of its place and altitude."""
    at = 0
    for via in problem.via:
        off_m = np.hypot(points[at:, 0] - via.east_m, points[at:, 1] - via.north_m)
        if via.amsl_m is not None:
            off_m = np.maximum(off_m, np.abs(points[at:, 2] - via.amsl_m))
        if not (off_m <= PASSED_M).any():
            return False
        at += int(np.argmax(off_m <= PASSED_M))
    return True


def lowest_amsl(air: Airspace, east_m: float, north_m: float, limits: Limits) -> float:
    """The lowest altitude that a path may begin or end with, for any direction; inf over unknown ground.

    A path's altitudes are bounded piece by piece (`Airspace.tube`), a little higher than hovering at the point needs.
    """
    star = np.tile([east_m, north_m], (8, 1))  # half a metre out to each side, and back
    star[1::2] += [(0.5, 0.0), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5)]
    return max(float(air.floor_amsl(east_m, north_m, limits)), float(air.tube(star, limits).floor_m.max()))


def straight_way_m(problem: Problem) -> float:
    """Length in metres of the straight track from terminal to terminal."""
    return sum(math.dist(a, b) for a, b in pairwise(terminals_of(problem)))


def ceiling_m(problem: Problem, limits: Limits) -> float:
    """The highest altitude AMSL that ``limits`` allow anywhere over the problem's surface; inf without a maximum."""
    agl_m, amsl_m = limits.max_agl_m, limits.max_amsl_m
    over_ground_m = math.inf if agl_m is None else float(np.nanmax(problem.airspace.surface.ground_m)) + agl_m
    return over_ground_m if amsl_m is None else min(amsl_m, over_ground_m)


def straight_bound(problem: Problem, rounding_m: tuple[float, float] = (0.0, 0.0)) -> float:
    """A lower bound of the cost: the straight line from terminal to terminal, free altitudes left free.

    ``rounding_m``: how far each terminal may lie beside its place, in the plane and in altitude.
    """
    flat, rise = (2.0 * m for m in rounding_m)  # two terminals, nearer to each other
    known: list[tuple[float, float]] = [(0.0, problem.start[2])]  # (metres along the track, altitude)
    way, last = 0.0, problem.start[:2]
    for v in problem.via:
        way += max(math.dist(last, (v.east_m, v.north_m)) - flat, 0.0)
        last = (v.east_m, v.north_m)
        if v.amsl_m is not None:
            known.append((way, v.amsl_m))
    way += max(math.dist(last, problem.goal[:2]) - flat, 0.0)
    known.append((way, problem.goal[2]))
    legs = [
        (max(b[0] - a[0], least_run_m(problem, a, b)), max(abs(b[1] - a[1]) - rise, 0.0)) for a, b in pairwise(known)
    ]
    if problem.rates is not None:
        level, climbing = problem.rates
        return sum(climbing * up_m + level * run_m for run_m, up_m in legs)
    return sum(math.hypot(*leg) for leg in legs)


def least_run_m(problem: Problem, a: tuple[float, float], b: tuple[float, float]) -> float:
    """Least metres of track that the climb or descent from ``a`` to ``b`` (metres along, altitude) needs."""
    limits, rise = problem.bound_limits, abs(b[1] - a[1]) - 2.0 * problem.rounding_m[1]
    return max(rise, 0.0) / (limits.max_climb_slope if b[1] > a[1] else limits.max_descent_slope)
