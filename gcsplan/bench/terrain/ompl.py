"""OMPL's asymptotically optimal planners on a problem, with the same exact check, one leg at a time.

They search the box of the surface between the lowest legal altitude and the ceiling, for length in space or for the
least time, with OMPL's own defaults. States and motions are judged by `one_leg`: exact, with climb limit and zones,
without sampling. For a single leg, `Airspace.clear` spends a hundred times the kernel's own time on entering compiled
code. So everything but the leg's ends is kept in an object that is compiled around the same kernel, which leaves about
1.5 microseconds.

Their seconds are processor seconds, so that other work on the machine does not count. The crossing from C++ to Python
and back takes about as long as RRT*'s own work and is not counted either: its least time is measured before each run,
and subtracted for every check. So they get about the time that they would have with the check in their own language.
Of the least time, which OMPL does not know, the whole cost of a motion is subtracted; but `LEAST_OWN` of the
processor's time count in any case, so that a run ends.
The time to the first path is the processor's, with nothing subtracted.
"""

from __future__ import annotations

import inspect
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from gcsplan.errors import InputError
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.kernels.compiled import WORLD_UNIT
from gcsplan.world.kernels.entries import judge
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.neighbourhood import extrema_around
from gcsplan.world.kernels.shared import BOW_M, Demands

PLANNERS = {"RRT*": "RRTstar", "InformedRRT*": "InformedRRTstar", "BIT*": "BITstar"}
CROSSINGS, LEAST_OWN = 2000, 0.1
RIVALS_CURE = (
    "this benchmark compares with OMPL and mealpy: pip install 'gcsplan[bench]'; bench terrain goes without them by "
    "--no-rivals --no-swarms"
)

OneLeg = Callable[[float, float, float, float, float, float], bool]
"""``clear(east0_m, north0_m, amsl0_m, east1_m, north1_m, amsl1_m)``."""

KERNEL_ARGUMENTS = tuple(inspect.signature(judge).parameters)
"""Names of the kernel's arguments, in its order."""

_classes: dict[tuple[Any, ...], Any] = {}


@dataclass(frozen=True, slots=True)
class RivalAnswer:
    """A rival's answer: the path (None if there is none), its length as found and after simplification."""

    points: list[list[float]] | None
    cost: float | None
    raw_cost: float | None
    first_path_s: float | None
    planning_s: float
    checks: int
    detail: str = ""


def release(package: str) -> str:
    """A rival's package and its installed version. Raises InputError if it is missing."""
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        raise InputError(RIVALS_CURE) from None


def rival_module(name: str) -> Any:
    """A module of a rival's package. Raises InputError if it is missing."""
    try:
        return import_module(name)
    except ImportError:
        raise InputError(RIVALS_CURE) from None


def warm_up(problem: Problem) -> None:
    """Compile the check of one leg, so that no run's time contains it."""
    one_leg(problem.airspace, problem.limits)(*problem.start, *problem.start)


def plan(problem: Problem, name: str, seconds: float, seed: int) -> RivalAnswer:
    """Run the planner of `PLANNERS` called ``name`` for ``seconds``, then simplify its path, which takes milliseconds.

    The cheaper of the path as found and as simplified is kept. ``seed`` has an effect only in the first run of a
    process; planners that stop by the clock are not repeatable anyway. Raises InputError if OMPL is missing.
    """
    base, geometric, util = (rival_module(f"ompl.{part}") for part in ("base", "geometric", "util"))
    util.setLogLevel(util.LOG_NONE)
    util.RNG.setSeed(seed)
    space = base.RealVectorStateSpace(3)
    bounds = base.RealVectorBounds(3)
    for axis, (low, high) in enumerate(box_of(problem)):
        bounds.setLow(axis, low)
        bounds.setHigh(axis, high)
    space.setBounds(bounds)
    info = base.SpaceInformation(space)
    counts = [0]
    judges = _judges(base, info, problem, counts)
    info.setStateValidityChecker(judges[0])
    info.setMotionValidator(judges[1])
    info.setup()
    start, goal = space.allocState(), space.allocState()
    for axis in range(3):
        start[axis], goal[axis] = problem.start[axis], problem.goal[axis]
    definition = base.ProblemDefinition(info)
    definition.setStartAndGoalStates(start, goal)
    costs = [0]
    objective = _objective(base, info, problem, costs)
    definition.setOptimizationObjective(objective)
    planner = getattr(geometric, PLANNERS[name])(info)
    planner.setProblemDefinition(definition)
    planner.setup()
    crossing_s, costing_s = _crossing_s(info, start, problem), _costing_s(geometric, info, objective, (start, goal))
    first: list[float] = []
    counts[0] = costs[0] = 0
    began = time.process_time()

    def elapsed_s() -> float:
        gross_s = time.process_time() - began
        return max(gross_s - counts[0] * crossing_s - costs[0] * costing_s, LEAST_OWN * gross_s)

    def over() -> bool:
        if not first and math.isfinite(planner.bestCost().value()):
            first.append(time.process_time() - began)
        return elapsed_s() >= seconds

    planner.solve(base.PlannerTerminationCondition(over))
    planned_s = elapsed_s()
    if not definition.hasExactSolution():
        return RivalAnswer(None, None, None, None, planned_s, counts[0])
    path = definition.getSolutionPath()
    raw = _points(path)
    geometric.PathSimplifier(info).simplify(path, 10.0 * seconds)  # ends by itself long before that time
    simple = _points(path) if path.check() else raw
    cost, best = min((problem.cost_through(np.array(way)), way) for way in (raw, simple))
    took, raw_cost = elapsed_s(), problem.cost_through(np.array(raw))
    return RivalAnswer(best, cost, raw_cost, first[0] if first else planned_s, took, counts[0])


def box_of(problem: Problem) -> list[tuple[float, float]]:
    """East, north and altitude ranges of the search: the whole surface, lowest floor to highest ceiling."""
    surface, limits = problem.airspace.surface, problem.limits
    rows, cols = surface.ground_m.shape
    corners = surface.grid.to_plane([0, 0, cols - 1, cols - 1], [0, rows - 1, 0, rows - 1])
    low, high = corners.min(axis=0), corners.max(axis=0)
    bottom = float(np.nanmin(surface.top_m)) + limits.min_agl_m
    top = math.inf if limits.max_amsl_m is None else limits.max_amsl_m
    if limits.max_agl_m is not None:
        top = min(top, float(np.nanmax(surface.ground_m)) + limits.max_agl_m)
    if math.isinf(top):
        top = float(np.nanmax(surface.top_m)) + 2.0 * limits.min_agl_m
    return [(float(low[0]), float(high[0])), (float(low[1]), float(high[1])), (bottom, top)]


def _judges(base: Any, info: Any, problem: Problem, counts: list[int]) -> tuple[Any, Any]:
    """Validity of a state and of a motion, both by the exact check, with a count of the checks."""
    clear = one_leg(problem.airspace, problem.limits)

    class StateCheck(base.StateValidityChecker):  # type: ignore[misc]
        def isValid(self, state: Any) -> bool:
            e, n, h = state[0], state[1], state[2]
            counts[0] += 1
            return clear(e, n, h, e, n, h)

    class MotionCheck(base.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, a: Any, b: Any) -> bool:
            counts[0] += 1
            return clear(a[0], a[1], a[2], b[0], b[1], b[2])

    return StateCheck(info), MotionCheck(info)


def _objective(base: Any, info: Any, problem: Problem, costs: list[int]) -> Any:
    """What OMPL minimises: the length in space; or the time at full speed, with a count of its motions."""
    if problem.objective == "length":
        return base.PathLengthOptimizationObjective(info)
    speed_m_s, climb_m_s, descent_m_s = problem.speed_m_s, problem.climb_m_s, problem.descent_m_s

    def seconds(a: Any, b: Any) -> Any:
        costs[0] += 1
        rise_m = b[2] - a[2]
        run_s = math.hypot(b[0] - a[0], b[1] - a[1]) / speed_m_s
        return base.Cost(max(run_s, rise_m / climb_m_s if rise_m > 0.0 else -rise_m / descent_m_s))

    class LeastTime(base.OptimizationObjective):  # type: ignore[misc]
        def stateCost(self, _: Any) -> Any:
            return base.Cost(0.0)

        def motionCost(self, a: Any, b: Any) -> Any:
            return seconds(a, b)

        def motionCostHeuristic(self, a: Any, b: Any) -> Any:
            return seconds(a, b)  # no way between two places is faster than the straight one

    return LeastTime(info)


def _costing_s(geometric: Any, info: Any, objective: Any, ends: tuple[Any, Any]) -> float:
    """Seconds of the cost of one motion: the least of several timings of a path of `CROSSINGS` motions."""
    path = geometric.PathGeometric(info)
    for k in range(CROSSINGS + 1):
        path.append(ends[k % 2])
    taken = []
    for _ in range(9):
        began = time.process_time()
        path.cost(objective)
        taken.append(time.process_time() - began)
    return min(taken) / CROSSINGS


def _crossing_s(info: Any, state: Any, problem: Problem) -> float:
    """Seconds of one check that neither the planner nor the kernel uses: the least of several timings."""
    e, n, h = problem.start
    legs = Legs.of_path(np.tile([[e, n, h]], (CROSSINGS + 1, 1)), problem.limits)
    taken = []
    for _ in range(9):
        began = time.process_time()
        for _ in range(CROSSINGS):
            info.checkMotion(state, state)
        between = time.process_time()
        problem.airspace.clear(legs, problem.limits)
        taken.append((between - began) - (time.process_time() - between))
    return max(0.0, min(taken)) / CROSSINGS


def _points(path: Any) -> list[list[float]]:
    return [[float(state[axis]) for axis in range(3)] for state in path.getStates()]


# -- the check of one leg ----------------------------------------------------------------------------------------------


def one_leg(airspace: Airspace, limits: Limits) -> OneLeg:
    """A function with the answer of ``airspace.clear`` for one leg with the errors of ``limits``.

    The first one in a process takes half a minute to compile.
    """
    import numba  # imported here because only rivals need its compiler

    arguments = kernel_arguments(airspace, limits)
    types = tuple(numba.typeof(a) for a in arguments)  # type: ignore[no-untyped-call]
    if types not in _classes:
        _classes[types] = _compiled(types)
    checker = _classes[types](*arguments)
    clear: OneLeg = checker.clear
    return clear


def kernel_arguments(airspace: Airspace, limits: Limits) -> tuple[Any, ...]:
    """The arguments that `Airspace.clear` passes to the kernel, for one leg."""
    surface, scale = airspace.surface, airspace.scale
    field = Field.of(surface.grid)
    zones = airspace.zone_table.arrays
    near_m = limits.track_error_m * scale + (0.0 if field.affine else BOW_M + field.error_m)
    near = extrema_around(field, surface.top_m, near_m)
    far = extrema_around(field, surface.top_m, near_m + limits.horizontal_clearance_m * scale)
    over = extrema_around(field, surface.ground_m, near_m)
    nothing = np.zeros((0, 4)), np.zeros((0, 7, 2)), np.zeros(0, np.intp), np.zeros((0, 2), np.intp), np.zeros((0, 2))
    return (
        field.packed, surface.ground_m, surface.top_m, *near, *far, *over, *zones,
        np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1, np.bool_), np.full(1, limits.track_error_m),
        np.full(1, limits.altitude_error_m), *Demands.of(limits, scale), False, np.zeros(1, np.bool_), *nothing,
        np.empty((256, 8)), np.zeros(12), np.empty(2 * zones.most_corners), np.full(len(airspace.zones), -1),
        np.arange(len(airspace.zones)),
    )  # fmt: skip


def _compiled(types: tuple[Any, ...]) -> Any:
    """A class with a field for each of the kernel's arguments, from source text, since numba takes no list of them."""
    from numba.experimental import jitclass  # type: ignore[attr-defined]

    source = "\n".join(
        [
            "class OneLeg:",
            f"    def __init__(self, {', '.join(KERNEL_ARGUMENTS)}):",
            *(f"        self.{n} = {n}" for n in KERNEL_ARGUMENTS),
            "    def clear(self, e0, n0, h0, e1, n1, h1):",
            "        start, end = self.start, self.end",
            "        start[0, 0], start[0, 1], start[0, 2] = e0, n0, h0",
            "        end[0, 0], end[0, 1], end[0, 2] = e1, n1, h1",
            "        self.out[:] = 0.0",
            "        self.seen[:] = -1",
            f"        judge({', '.join('self.' + n for n in KERNEL_ARGUMENTS)})",
            "        return self.ok[0]",
        ]
    )
    scope = {"judge": WORLD_UNIT.with_numba()["judge"]}
    exec(source, scope)
    return jitclass(list(zip(KERNEL_ARGUMENTS, types, strict=True)))(scope["OneLeg"])
