"""gcsplan's planner on the problems: warm only in compiled code, run repeatedly, beside a sweep of the exact check."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from gcsplan.bench.check import LIMITS, scene
from gcsplan.bench.measure import Memory, passes
from gcsplan.bench.terrain.outcome import OUR_LONG_METHOD, OUR_METHOD, MethodOutcome, OutcomeStatus
from gcsplan.bench.terrain.problems import NamedProblem, key_of
from gcsplan.errors import NoMission
from gcsplan.planners.problem import Problem, Solution
from gcsplan.planners.registry import get as get_planner
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.surface import Surface

SWEEP_LEGS = 100_000
LONG_RUN_S = 60.0


class Sweep:
    """The yardstick: seconds for the exact check of 100,000 random one-kilometre legs, on this machine at this time."""

    def __init__(self, legs: int = SWEEP_LEGS) -> None:
        self._airspace, self._legs = scene(legs, seed=1)
        self()  # compiles the kernel

    def __call__(self) -> float:
        began = time.perf_counter()
        self._airspace.clear(self._legs, LIMITS)
        return time.perf_counter() - began


def warm_up(problems: Sequence[NamedProblem], planner: str = "optimal") -> float:
    """Plan the first problem of every group once, so that every kernel is compiled; returns the seconds it took."""
    began = time.perf_counter()
    seen = set()
    for one in problems:
        if one.group not in seen:
            seen.add(one.group)
            _attempt(one.problem, planner)
    return time.perf_counter() - began


def measure(
    one: NamedProblem, sweep: Sweep, *, runs: int = 9, planner: str = "optimal", long: bool = False
) -> MethodOutcome:
    """The outcome of gcsplan's planner: medians of ``runs``; ``long`` runs it once with a minute and no gap.

    Every run gets its own airspace and surface (over the same heights), so that nothing kept from the run before helps.
    Creating them is not counted, but what the planner derives from them is.
    """
    problem = replace(one.problem, budget_s=LONG_RUN_S, gap_percent=0.0) if long else one.problem
    memory, answers, swept, took = Memory(), [], [], []
    for number in range(1 if long else runs):
        anew = _anew(problem)
        if number == 0:
            with memory.peak():
                answer = _attempt(anew, planner)
        else:
            answer = _attempt(anew, planner)
        answers.append(answer[0])
        took.append(answer[1])
        swept.append(sweep())
    found = [a for a in answers if isinstance(a, Solution)]
    base = MethodOutcome(
        key_of(one.problem), one.name, one.kind, one.group, OUR_LONG_METHOD if long else OUR_METHOD, "failed",
        planning_s=statistics.median(took), sweep_s=statistics.median(swept), memory_mb=memory.peak_mb, runs=len(took),
        gap_asked_percent=problem.gap_percent,
    )  # fmt: skip
    if len(found) < len(answers):
        return replace(base, status=_refused(answers[0]), detail=_words(answers[0], len(found), len(answers)))
    costs = [problem.cost(s.path) for s in found]
    bounds = [s.lower_bound for s in found if s.lower_bound is not None]
    # A path may leave the terrain that was loaded first: it is then judged over what was loaded for it.
    safe = all(passes(_anew(s.problem or problem), s.path.points) for s in found)
    worst = max(range(len(found)), key=lambda i: costs[i])
    return replace(
        base,
        status="solved" if safe else "unsafe",
        cost=costs[worst],
        bound=min(bounds) if len(bounds) == len(found) else None,
        first_path_s=statistics.median(s.first_path_s for s in found),
        stopped_by=found[worst].stopped_by,
        detail="" if max(costs) - min(costs) < 1e-9 * max(costs) else f"cost varies by {max(costs) - min(costs):.3g}",
    )


def _anew(problem: Problem) -> Problem:
    old = problem.airspace.surface
    surface = Surface(old.ground_m, old.top_m, old.grid, dict(old.info))
    airspace = Airspace(surface, problem.airspace.zones, scale=problem.airspace.scale)
    return replace(problem, airspace=airspace)


def _attempt(problem: Problem, planner: str) -> tuple[Solution | Exception, float]:
    """The answer and its seconds. An exception is an answer too, so that the other problems still run."""
    plan: Callable[[Problem], Solution] = get_planner(planner).plan
    began = time.perf_counter()
    try:
        answer: Solution | Exception = plan(problem)
    except Exception as error:
        answer = error
    return answer, time.perf_counter() - began


def _refused(answer: Solution | Exception) -> OutcomeStatus:
    if not isinstance(answer, NoMission):
        return "failed"
    return "infeasible" if answer.reason == "infeasible" else "not found"


def _words(answer: Solution | Exception, found: int, runs: int) -> str:
    if found:
        return f"solved in {found} of {runs} runs only"
    return f"{type(answer).__name__}: {answer}"
