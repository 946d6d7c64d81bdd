"""``gcsplan bench terrain``: gcsplan's and other planners on one problem set, under the same exact check, in one run.

`problems` holds the problems, `rivals` measures the other planners. gcsplan's own is warm only in compiled code, and
run repeatedly, beside a sweep of the exact check.
"""

from __future__ import annotations

import math
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

from gcsplan.bench.check import LIMITS, scene
from gcsplan.bench.files import write_all
from gcsplan.bench.measure import Memory, passes
from gcsplan.bench.terrain import report
from gcsplan.bench.terrain import rivals as others
from gcsplan.bench.terrain.outcome import OUR_LONG_METHOD, OUR_METHOD, MethodOutcome, OutcomeStatus
from gcsplan.bench.terrain.problems import MOUNTAINS, PROBLEM_KINDS, NamedProblem, key_of, problems
from gcsplan.errors import InputError, NoMission
from gcsplan.planners.optimal.table import require_names
from gcsplan.planners.problem import Problem, Solution
from gcsplan.planners.registry import get as get_planner
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.surface import Surface

ANSWERS = "rivals.jsonl"
GAP_PERCENT = 0.1
"""Certified gap to which a mission is planned by default, percent."""


@dataclass
class TerrainResult:
    """All outcomes so far, and the report's lines about the run."""

    outcomes: list[MethodOutcome] = field(default_factory=list)
    about: list[str] = field(default_factory=list)

    @property
    def lines(self) -> list[report.MethodLine]:
        """The lines by group and method."""
        return report.lines(self.outcomes)

    def write(self, directory: Path) -> list[Path]:
        """Write ``terrain.md``, ``terrain.csv`` and ``terrain.png``; returns their paths."""
        return write_all(
            directory,
            {
                "terrain.md": report.markdown(self.lines, self.outcomes, self.about),
                "terrain.csv": report.as_csv(self.outcomes),
                "terrain.png": report.figure(self.outcomes),
            },
        )


def run(  # noqa: PLR0913 - options by name, each with a default
    directory: Path,
    *,
    seed: int = 1,
    kinds: Sequence[str] = MOUNTAINS,
    runs: int = 9,
    seconds: Sequence[float] = (1.0, 10.0),
    rivals: bool = True,
    swarms: bool = True,
    kept_only: bool = False,
    long: bool = False,
    errors: bool = False,
    count: int | None = None,
    planner: str = "optimal",
    gap_percent: float = GAP_PERCENT,
    without: Sequence[str] = (),
    methods: Sequence[str] = (),
    tell: Callable[[str], None] = lambda words: None,
) -> TerrainResult:
    """Measure and write the report to ``directory``; ``tell`` receives messages on the progress.

    ``seconds`` are the times of OMPL's planners. ``long`` runs gcsplan's again with a minute per problem. ``errors``
    uses the clearance and errors of a real mission. ``count`` is the number of problems of each group. ``gap_percent``
    is the certified gap at which gcsplan's may stop, ``without`` are searches that it must not use. ``methods`` are
    planners of others by name or ``MODULE:FUNCTION``, run in this process on every problem. The rivals' answers
    are kept in ``directory`` and not computed again; with ``kept_only`` no others are computed. However the run ends,
    all results so far are written. Raises InputError for unknown kinds and if a rival is not installed.
    """
    for kind in kinds:
        if kind not in PROBLEM_KINDS:
            raise InputError(f"the kinds of problems are {', '.join(PROBLEM_KINDS)}, given {kind!r}")
    if runs < 1 or (count is not None and count < 1) or any(not s > 0.0 for s in seconds):
        raise InputError("runs and count must be 1 or more, seconds more than 0")
    if not (math.isfinite(gap_percent) and gap_percent >= 0.0):
        raise InputError(f"gap_percent must be 0 or more, given {gap_percent:g}")
    compared_with = others.rivals(seconds, swarms=swarms) if rivals else []
    if rivals and not kept_only:
        others.require(compared_with)
    require_names(without)
    named_planners = [(OUR_METHOD, planner), *((method, method) for method in methods)]
    for _, name in named_planners:
        get_planner(name)  # find a mistake before the long run
    options = {"without": tuple(without)} if without else {}
    result = TerrainResult()
    redraws: list[tuple[int, int]] = []
    warm_s = 0.0

    def write() -> None:
        result.about = _about(result.outcomes, seed, runs, warm_s, redraws, errors, compared_with)
        result.write(directory)

    try:
        sweep = Sweep()
        compared: list[NamedProblem] = []
        for kind in kinds:
            tell(f"{kind}: making the problems")
            named = [
                replace(one, problem=replace(one.problem, gap_percent=gap_percent, options=options))
                for one in problems(kind, seed, errors=errors, count=count)
            ]
            redraws += [one.redraws for one in named]
            tell(f"{kind}: warming up")
            warm_s += warm_up(named, planner)
            for one in named:
                for method, name in named_planners:
                    tell(f"{method}: {one.name}")
                    result.outcomes.append(replace(measure(one, sweep, runs=runs, planner=name), method=method))
                if long:
                    tell(f"{OUR_LONG_METHOD}: {one.name}")
                    result.outcomes.append(measure(one, sweep, planner=planner, long=True))
            compared += others.solvable(named)
            write()
        if compared_with:
            kept = others.Answers(directory / ANSWERS)
            result.outcomes += others.compare(compared, compared_with, kept, seed, tell, kept_only=kept_only)
    finally:
        if result.outcomes:
            write()
    return result


def _about(
    outcomes: Sequence[MethodOutcome], seed: int, runs: int, warm_s: float, redraws: Sequence[tuple[int, int]],
    errors: bool, compared_with: Sequence[others.Rival],
) -> list[str]:  # fmt: skip
    """Lines on the measurement and its machine."""
    sweeps = [o.sweep_s for o in outcomes if o.sweep_s is not None]
    usual = errors or all(o.kind == "ceiling" for o in outcomes)  # these have them always
    held = "with the clearance and errors of a real mission" if usual else "with no clearance and no errors"
    pairs, sets = (max((r[i] for r in redraws), default=0) for i in (0, 1))
    lines = [
        f"Seed {seed}, {held}; gcsplan {version('gcsplan')}, Python {platform.python_version()}, {platform.machine()}.",
        "",
        f"Our times are medians of {runs} runs in process, warm (compiling and a first plan of each group took "
        f"{warm_s:.1f} s); each run starts with an airspace without any results of earlier runs.",
        f"The sweep, the exact check of {SWEEP_LEGS:,} one-kilometre legs, took {statistics.median(sweeps):.4f} s "
        "(median of all, one after every run); memory is the peak above the memory in use before.",
        "Gaps are above the highest certified lower bound; our gaps are above the bound of the same run; our runs may "
        f"stop at a certified gap of {_gaps_requested(outcomes)}. 'Done' is the time to our certificate.",
        f"Before one problem up to {pairs} pairs and {sets} sets of zones were drawn in vain.",
    ]
    if compared_with:
        releases = {o.version for o in outcomes if o.version}
        lines += [
            f"Others: {', '.join(sorted(releases)) or 'none yet'}; they get the same exact check of each "
            "leg, and OMPL's seconds are processor time without the time spent between C++ and Python.",
        ]
    return lines


def _gaps_requested(outcomes: Sequence[MethodOutcome]) -> str:
    """The requested gaps by method, in words."""
    gaps = {(o.method, o.gap_asked_percent) for o in outcomes if o.gap_asked_percent is not None}
    return ", ".join(f"{gap:g} % ({method})" for method, gap in sorted(gaps)) or "no size"


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
    Creating them is not counted, but the planner's own derived data are.
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
    # A path may leave the terrain that was loaded first: it is then judged over the terrain that was loaded for it.
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
