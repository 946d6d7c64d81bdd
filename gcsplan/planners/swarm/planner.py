"""Planning by a swarm: an optimiser, an encoding and a cost search for a curve, and the exact check judges it.

If few way points close to the curve pass the exact check, they are the path. Otherwise the curve is repaired (`repair`)
or the mission refused, and a note or the refusal states what was wrong. Nothing sampled passes a mission.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.errors import unknown_name
from gcsplan.optimisers.driver import Result, State, minimise
from gcsplan.optimisers.registry import get as get_optimiser
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution
from gcsplan.planners.refusal import check_ends
from gcsplan.planners.registry import VOLUME_KEYS
from gcsplan.planners.swarm.bspline import fewer
from gcsplan.planners.swarm.encodings import Code
from gcsplan.planners.swarm.objectives import Cost, Earlier, get_objective
from gcsplan.planners.swarm.repair import repair, violations
from gcsplan.planners.swarm.scene import Scene
from gcsplan.world.airspace import Violation
from gcsplan.world.path import Path

CORRIDORS = (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5, 0.0)
"""Corridors of the way points about the curve, as parts of the straight path, tried in turn; 0 keeps every sample."""

THRESHOLD = 1.5
"""Cost at which MSFOA switches from global to local search, as a multiple of JL + JH of the straight line (D)."""

COLLISIONS = frozenset({"min_agl", "terrain_clearance", "zone"})


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of a search; None stands for the default of the optimiser or of the encoding.

    ``parameters``: those of the optimiser, and the sides of the flight volume (`VOLUME_KEYS`). ``earlier``: polylines
    (N, 3) of vehicles that have the right of way and depart at the same time; all fly at ``speed_m_s``. For ants
    ``points`` is the number of sections.
    """

    encoding: str = "box"
    cost: str = "krill"
    points: int | None = None
    population: int | None = None
    iterations: int | None = None
    evaluations: int | None = None
    parameters: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    earlier: Sequence[Floats] = ()
    speed_m_s: float = 15.0

    @classmethod
    def of(cls, defaults: Mapping[str, object], options: Mapping[str, object]) -> Settings:
        """Settings of a planner's ``defaults``, replaced by ``options``. Raises InputError for an unknown key."""
        known = cls.__dataclass_fields__
        for key in options:
            if key not in known:
                raise unknown_name(f"swarm planners know no option {key!r}", key, known)
        given = {key: value for key, value in options.items() if value is not None}
        both = {**defaults, **given}
        if "points" not in given and both.get("encoding") != defaults.get("encoding"):
            both["points"] = None  # the paper's number belongs to the paper's encoding
        return cls(**both)  # type: ignore[arg-type]

    def split(self) -> tuple[dict[str, float], dict[str, Any]]:
        """The flight volume's sides, and the optimiser's own parameters."""
        volume = {key: float(value) for key, value in self.parameters.items() if key in VOLUME_KEYS}
        return volume, {key: value for key, value in self.parameters.items() if key not in VOLUME_KEYS}


@dataclass(frozen=True, eq=False, slots=True)
class Found:
    """The result of a search: its ``curve`` (S, 3), the indices of its ``terminals``, and the ``violations`` that the
    exact check finds. ``pitch_deg``, ``yaw_deg``: mean slope and mean turn between nodes (SSGWO's tables)."""

    result: Result
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


def search(problem: Problem, optimiser: str, settings: Settings) -> Found:
    """Run ``optimiser`` once. Raises InputError for options that it does not accept."""
    volume, parameters = settings.split()
    scene = Scene.of(problem, volume)
    code = Code.of(settings.encoding, scene, settings.points)
    earlier = [Earlier.at_speed(points, settings.speed_m_s) for points in settings.earlier]
    cost = Cost(problem, code, get_objective(settings.cost), earlier=earlier, speed_m_s=settings.speed_m_s)
    own = get_optimiser(optimiser).defaults
    if "threshold" in own and parameters.get("threshold") is None:
        parameters["threshold"] = THRESHOLD * cost.straight_cost()
    if "feedback" in own:
        # D: IB-ABC changes one way point, all its coordinates together.
        parameters.setdefault("group", code.encoding.variables)
    result = minimise(
        optimiser,
        cost,
        cost.dim,
        population=settings.population,
        iterations=settings.iterations,
        evaluations=settings.evaluations,
        seed=problem.seed,
        parameters=parameters,
        tell=None if problem.progress is None else _teller(problem),
    )
    curve = cost.curve.samples(code.controls(result.x[None]))[0]
    curve[cost.curve.terminals] = scene.terminals
    return judged(problem, result, scene, curve, cost.curve.terminals, cost.stride)


def judged(problem: Problem, result: Result, scene: Scene, curve: Floats, terminals: Indices, stride: int) -> Found:
    """The curve of a search with its violations; ``stride``: samples from node to node."""
    curve = np.ascontiguousarray(curve)
    d = np.diff(curve[::stride], axis=0)
    pitch = np.degrees(np.abs(np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1]))))
    turn = np.diff(np.arctan2(d[:, 1], d[:, 0]))
    yaw = np.degrees(np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi))
    found = violations(problem, curve)
    return Found(result, scene, curve, terminals, found, float(pitch.mean()), float(yaw.mean()) if len(yaw) else 0.0)


def plan(problem: Problem, optimiser: str, defaults: Mapping[str, object]) -> Solution:
    """A path that `Airspace.examine` passes: few way points along the curve that ``optimiser`` found, or its repair.

    Raises Refusal (NoMission, ``not_found``) if the curve cannot be repaired, InputError for bad options.
    """
    begun = time.perf_counter()
    check_ends(problem)
    return finish(problem, search(problem, optimiser, Settings.of(defaults, problem.options)), begun)


def finish(problem: Problem, found: Found, begun: float) -> Solution:
    """Make a solution of a search's curve, repaired if needed. Raises Refusal if it cannot be repaired."""
    searched_s = time.perf_counter() - begun
    name, wrong = found.result.optimiser, found.violations
    few = way_points_beside(problem, found)
    notes: tuple[str, ...]
    if few is not None:
        points, notes = few, ()
        if wrong:  # the curve broke a limit that the fewer way points keep
            notes = (f"the curve that {name} found breaks {summary_of(problem, wrong)}; its way points pass",)
    else:
        mended = repair(problem, found.scene, found.curve, found.terminals)
        if mended is None:
            raise Refusal(
                f"no mission: the curve that {name} found breaks {summary_of(problem, wrong)}, and pushing it sideways "
                f"and giving it new altitudes does not repair it: try another encoding (bspline, sections), seed or "
                f"more iterations, or the planner optimal",
                reason="not_found",
                place=(wrong[0].east_m, wrong[0].north_m) if wrong else None,
            )
        points = mended.points
        how = "it was given new altitudes"
        if mended.pushed_m > 0.0:
            how = f"it was pushed sideways by up to {mended.pushed_m:.0f} m and given new altitudes"
        notes = (f"the curve that {name} found breaks {summary_of(problem, wrong)}; {how}, and it passes the check",)
    return Solution(
        path=Path(points),
        stopped_by="evaluations" if found.result.stopped_by == "evaluations" else "exhausted",
        planning_s=time.perf_counter() - begun,
        first_path_s=searched_s,
        notes=notes,
        raw_violations=len(wrong),
        repaired=few is None,
    )


def way_points_beside(problem: Problem, found: Found) -> Floats | None:
    """Few way points (N, 3) that pass the exact check and stay within a corridor of the curve; None if none do."""
    if any(v.kind in COLLISIONS for v in found.violations):
        return None
    for part in CORRIDORS:
        points = found.curve[fewer(found.curve, found.terminals, part * found.scene.straight_m)].copy()
        points[0], points[-1] = problem.start, problem.goal
        if not violations(problem, points):
            return points
    return None


def summary_of(problem: Problem, wrong: Sequence[Violation]) -> str:
    """The broken limits in a few words: ``12 legs (min_agl by 3.2 m, zone 'x' by 10.0 m)``."""
    worst: dict[str, tuple[float, str]] = {}
    for v in wrong:
        what = f"zone {problem.airspace.zones[v.zone].name!r}" if v.kind == "zone" else v.kind
        if v.by > worst.get(what, (-1.0, ""))[0]:
            worst[what] = v.by, v.unit
    legs = Counter(v.leg for v in wrong)
    words = ", ".join(f"{what} by {by:.1f} {unit}" for what, (by, unit) in list(worst.items())[:4])
    more = f" and {len(worst) - 4} more" if len(worst) > 4 else ""
    return f"limits on {len(legs)} of its legs ({words}{more})" if wrong else "no limit, but its way points do"


def _teller(problem: Problem) -> Any:
    begun = time.perf_counter()
    last = [-1.0]

    def tell(state: State) -> None:
        now = time.perf_counter() - begun
        if problem.progress is not None and now - last[0] > 0.1:
            last[0] = now
            problem.progress(Progress(now, state.cost, None, "search"))

    return tell
