"""Planning by a swarm: an optimiser, an encoding and a cost search for a curve, and the exact check judges it.

If few way points close to the curve pass the exact check, they are the path. Otherwise the curve is repaired
(`repair`), and a note names the fault. A curve that cannot be repaired is thrown away, and the search begins
again with another seed, until the mission's budget is spent; then the mission is refused. Nothing sampled passes a
mission.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.notes.note import Note
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution
from gcsplan.planners.refusal.explain import check_ends
from gcsplan.planners.simplify import thinned
from gcsplan.research.optimisers.driver import OptimiserResult, State, minimise
from gcsplan.research.optimisers.registry import OptimiserEntry as Row
from gcsplan.research.optimisers.registry import get as get_optimiser
from gcsplan.research.swarm import SwarmEntry, cmaes, warm_start
from gcsplan.research.swarm.encodings import Code
from gcsplan.research.swarm.objectives import Cost, Earlier, get_objective
from gcsplan.research.swarm.repair import repair, violations
from gcsplan.research.swarm.scene import Scene
from gcsplan.research.swarm.settings import Settings
from gcsplan.world.airspace import Violation
from gcsplan.world.geometry.path import Path

CORRIDORS = (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 0.0)
"""Corridors of the way points about the curve, as parts of the straight path, tried in turn; 0 keeps every sample."""

THRESHOLD = 1.5
"""Cost at which MSFOA switches from global to local search, as a multiple of JL + JH of the straight line (D)."""

MOST_LIMITS = 4
"""Most broken limits that a note names."""
SEARCHES = 20
"""Most searches of one plan, each with another seed."""

COLLISIONS = frozenset({"min_agl", "terrain_clearance", "zone"})


@dataclass(frozen=True, eq=False, slots=True)
class Found:
    """The result of a search: its ``curve`` (S, 3), the indices of its ``terminals``, and the ``violations`` that the
    exact check finds. ``pitch_deg``, ``yaw_deg``: mean slope and mean turn between nodes (SSGWO's tables)."""

    result: OptimiserResult
    scene: Scene
    curve: Floats
    terminals: Indices
    violations: tuple[Violation, ...]
    pitch_deg: float
    yaw_deg: float

    @property
    def length_m(self) -> float:
        """Length of the curve in space."""
        return float(np.linalg.norm(np.diff(self.curve, axis=0), axis=1).sum())

    @property
    def collisions(self) -> int:
        """Number of legs of the curve that meet ground or zones."""
        return len({v.leg for v in self.violations if v.kind in COLLISIONS})


def row_of(optimiser: str) -> Row:
    """The row of an optimiser: of the table, or of an adapter. Raises InputError if it is unknown."""
    return cmaes.ENTRY if optimiser == cmaes.ENTRY.name else get_optimiser(optimiser)


def scene_of(problem: Problem, settings: Settings) -> Scene:
    """The scene of a search; it depends on neither seed nor earlier vehicles. Raises InputError for a bad volume."""
    return Scene.of(problem, settings.split()[0])


def cost_of(problem: Problem, settings: Settings, scene: Scene | None = None) -> Cost:
    """The objective of a search. Raises InputError for options that it does not accept.

    ``scene``: the result of `scene_of`, where it is known already.
    """
    scene = scene_of(problem, settings) if scene is None else scene
    code = Code.of(settings.encoding, scene, settings.points)
    earlier = [Earlier.at_speed(points, settings.speed_m_s) for points in settings.earlier]
    return Cost(problem, code, get_objective(settings.cost), earlier=earlier, speed_m_s=settings.speed_m_s)


def search(problem: Problem, optimiser: str, settings: Settings, scene: Scene | None = None) -> Found:
    """Run ``optimiser`` once; ``scene`` as in `cost_of`. Raises InputError for options that it does not accept."""
    parameters = settings.split()[1]
    cost = cost_of(problem, settings, scene)
    row = row_of(optimiser)
    if "threshold" in row.defaults and parameters.get("threshold") is None:
        parameters["threshold"] = THRESHOLD * cost.straight_cost()
    if "feedback" in row.defaults:
        # D: IB-ABC changes one way point, all its coordinates together.
        parameters.setdefault("group", cost.code.encoding.variables)
    start = None
    if settings.around is not None:
        start = warm_start.members(cost, settings.around, problem.seed, settings.population or row.population)
    result = minimise(
        row,
        cost,
        cost.dim,
        population=settings.population,
        iterations=settings.iterations,
        evaluations=settings.evaluations,
        seed=problem.seed,
        parameters=parameters,
        start=start,
        tell=None if problem.progress is None else _teller(problem),
    )
    problem.budget.spend("drawn", result.evaluations)
    return drawn(problem, cost, result)


def drawn(problem: Problem, cost: Cost, result: OptimiserResult, controls: Floats | None = None) -> Found:
    """The curve of a search's best numbers, or of its control points ``controls`` (N, 3), with its violations."""
    if controls is None:
        controls = cost.code.controls(result.x[None])[0]
    scene, terminals = cost.code.scene, cost.curve.terminals
    curve = cost.curve.samples(controls)
    curve[terminals] = scene.terminals
    d = np.diff(curve[:: cost.stride], axis=0)
    pitch = np.degrees(np.abs(np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1]))))
    turn = np.diff(np.arctan2(d[:, 1], d[:, 0]))
    yaw = np.degrees(np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi))
    found = violations(problem, curve)
    return Found(result, scene, curve, terminals, found, float(pitch.mean()), float(yaw.mean()) if len(yaw) else 0.0)


def plan(problem: Problem, row: SwarmEntry) -> Solution:
    """A path that `Airspace.examine` passes: few way points along the curve that the optimiser found, or its repair.

    Raises Refusal (NoMission, ``not_found``) if no curve within the budget can be repaired, InputError for bad options.
    """
    return until_found(problem, row, lambda again, settings: search(again, row.optimiser, settings))


def until_found(problem: Problem, row: SwarmEntry, once: Callable[[Problem, Settings], Found]) -> Solution:
    """The first solution of the searches ``once``, each with a seed of its own; the first with the problem's.

    At most `SEARCHES`, and none is begun when the budget for a first path is spent. The first search always runs to
    its end, for its size is the user's. Raises the last search's Refusal.
    """
    begun = time.perf_counter()
    check_ends(problem)
    settings = warm_start.resolved(problem, Settings.of(row, problem.options))
    budget = problem.budget.anew(problem.budget_s, problem.budget_mb)
    for number in range(SEARCHES):
        seed = problem.seed if number == 0 else int(np.random.SeedSequence([problem.seed, number]).generate_state(1)[0])
        try:
            again = replace(problem, seed=seed, budget=budget)
            solution = finish(again, once(again, settings), begun)
        except Refusal as refusal:
            if number + 1 < SEARCHES and budget.goes_on():
                continue
            if number == 0:
                raise
            raise Refusal(
                f"{refusal.message} ({number + 1} searches, each with another seed, ended without a path; more "
                f"budget_s allows more)",
                reason="not_found",
                place=None if refusal.east_m is None or refusal.north_m is None else (refusal.east_m, refusal.north_m),
            ) from None
        if number == 0:
            return solution
        note = Note("searches_failed", searches=number, optimiser=row.optimiser)
        return replace(solution, notes=(note, *solution.notes))
    raise AssertionError("the last search returns or raises")


def finish(problem: Problem, found: Found, begun: float) -> Solution:
    """Make a solution of a search's curve, repaired if needed. Raises Refusal if it cannot be repaired."""
    searched_s = time.perf_counter() - begun
    name, wrong = found.result.optimiser, found.violations
    ended = settle(problem, found)
    if ended is None:
        raise Refusal(
            f"no mission: the curve that {name} found breaks {broken_limits(problem, wrong)}, and pushing it sideways "
            f"and giving it new altitudes does not repair it: try another encoding (bspline, sections), seed or "
            f"more iterations, or the planner optimal",
            reason="not_found",
            place=(wrong[0].east_m, wrong[0].north_m) if wrong else None,
        )
    points, pushed_m = ended
    notes: list[Note] = []
    broken = broken_limits(problem, wrong)
    if pushed_m:
        notes.append(Note("curve_pushed", optimiser=name, broken=broken, pushed_m=pushed_m))
    elif pushed_m is not None:
        notes.append(Note("curve_lifted", optimiser=name, broken=broken))
    elif wrong:  # the curve broke a limit that the fewer way points keep
        notes.append(Note("curve_thinned", optimiser=name, broken=broken))
    return Solution(
        path=Path(points),
        stopped_by="evaluations" if found.result.stopped_by == "evaluations" else "exhausted",
        planning_s=time.perf_counter() - begun,
        first_path_s=searched_s,
        notes=tuple(notes),
        raw_violations=len(wrong),
        repaired=pushed_m is not None,
    )


def settle(problem: Problem, found: Found) -> tuple[Floats, float | None] | None:
    """Way points (N, 3) that pass the exact check, and the metres by which a repair pushed their track.

    The metres are None if nothing was repaired: the search's own curve is legal. None if it cannot be repaired.
    """
    few = way_points_beside(problem, found)
    if few is not None:
        return few, None
    problem.budget.spend("mend", 1)
    mended = repair(problem, found.scene, found.curve, found.terminals)
    return None if mended is None else (mended.points, mended.pushed_m)


def way_points_beside(problem: Problem, found: Found) -> Floats | None:
    """Few way points (N, 3) that pass the exact check and stay within a corridor of the curve; None if none do."""
    if any(v.kind in COLLISIONS for v in found.violations):
        return None
    for part in CORRIDORS:
        points = found.curve[thinned(found.curve, found.terminals, part * found.scene.straight_m)].copy()
        points[0], points[-1] = problem.start, problem.goal
        if not violations(problem, points):
            return points
    return None


def broken_limits(problem: Problem, wrong: Sequence[Violation]) -> Note:
    """The broken limits: ``limits on 12 of its legs (min_agl by 3.2 m, zone 'x' by 10.0 m)``."""
    if not wrong:
        return Note("only_way_points_break")
    worst: dict[str, Violation] = {}
    for v in wrong:
        what = f"zone {v.zone}" if v.kind == "zone" else v.kind
        if what not in worst or v.by > worst[what].by:
            worst[what] = v
    limits = [_broken(problem, v) for v in list(worst.values())[:MOST_LIMITS]]
    if len(worst) > MOST_LIMITS:
        limits.append(Note("more_limits", count=len(worst) - MOST_LIMITS))
    return Note("limits_broken", legs=len({v.leg for v in wrong}), limits=tuple(limits))


def _broken(problem: Problem, v: Violation) -> Note:
    if v.kind == "zone":
        return Note("zone_by", zone=problem.airspace.zones[v.zone].name, by_m=v.by)
    if v.unit == "m":
        return Note("limit_by_length", limit=v.kind, by_m=v.by)
    return Note("limit_by_angle", limit=v.kind, by_deg=v.by)


def _teller(problem: Problem) -> Any:
    begun = time.perf_counter()
    last = [-1.0]

    def tell(state: State) -> None:
        now = time.perf_counter() - begun
        if problem.progress is not None and now - last[0] > 0.1:
            last[0] = now
            problem.progress(Progress(now, state.cost, None, "search"))

    return tell
