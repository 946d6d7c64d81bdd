"""``gcsplan bench swarms``: swarms on 60 missions over real terrain with room, beside the planner `optimal`.

Every method minimises with the same number of cost evaluations on every mission, from the same seed. Its path is raw
legal, repaired or refused, by the planners' own steps. The missions are the kind ``room`` of `terrain.problems`.
"""

from __future__ import annotations

import json
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rich.table import Table

from gcsplan.app.parallel.executor import executor
from gcsplan.bench.files import kept_rows, write_all
from gcsplan.bench.measure import length_m, passes, percentile
from gcsplan.bench.terrain import swarms as terrain_swarms
from gcsplan.bench.terrain.ompl import release
from gcsplan.bench.terrain.problems import NamedProblem, problems
from gcsplan.errors import GcsplanError, InputError, unknown_name
from gcsplan.export.table import csv_of
from gcsplan.planners.budget import Budget
from gcsplan.planners.problem import Problem, Refusal
from gcsplan.planners.registry import get as get_planner
from gcsplan.plugins import OPTIMISERS_ADDED
from gcsplan.research.bench.papers.runs import code_digest
from gcsplan.research.optimisers.driver import History, OptimiserResult
from gcsplan.research.optimisers.registry import added_code
from gcsplan.research.optimisers.registry import get as get_optimiser
from gcsplan.research.swarm import SWARM_PLANNERS, SwarmEntry, entry, warm_start
from gcsplan.research.swarm.planner import Found, cost_of, drawn, search, settle, until_found
from gcsplan.research.swarm.settings import Settings
from gcsplan.research.swarm.warm_start import OPTIMAL

EVALUATIONS = 10_000
ATTEMPT_S = 0.5
"""Seconds that an attempt takes, about."""

PAPER_SWARMS = ("krill", "ssgwo", "msfoa", "abo", "ib-abc")
COMPARED_ENCODINGS = ("paper", "sections", "bspline", "offsets")
ATTEMPTS_FILE = "swarms.jsonl"

SWARM_COLUMNS = (
    "method", "encoding", "cost", "raw legal", "repaired", "refused", "solved %", "after restarts %", "over p50 %",
    "over p90 %", "over max %", "raw over p50 %", "repaired over p50 %", "search s", "repair s",
)  # fmt: skip


LENGTH_COST = "krill"
"""The cost that is the length, with penalties: every method's cost unless its row names another."""

AttemptStatus = Literal["raw legal", "repaired", "refused"]


@dataclass(frozen=True, slots=True)
class Method:
    """A row of the table: the optimiser's origin (``family``: gcsplan or mealpy), name, encoding and cost.

    ``cost`` own: the cost of the optimiser's paper. ``warm``: it begins around the path of `optimal`.
    """

    family: str
    name: str
    encoding: str = "offsets"
    cost: str = LENGTH_COST
    warm: bool = False

    @property
    def label(self) -> str:
        """Its name in the table."""
        return self.name if self.family == "gcsplan" else f"{self.family} {self.name}"


@dataclass(frozen=True, slots=True)
class Attempt:
    """A method on a mission. ``length_m`` is None if it was refused. Seconds are the processor's: of the search with
    the exact check of its curve, and of the repair. ``searches``: searches that the planner needs until one is legal
    or repaired, None if it refuses too."""

    mission: str
    group: str
    method: Method
    status: AttemptStatus
    length_m: float | None
    evaluations: int
    search_s: float
    repair_s: float
    searches: int | None


@dataclass(frozen=True, slots=True)
class Optimum:
    """The planner `optimal` on a mission: its length, its certified bound, its processor seconds."""

    length_m: float
    bound_m: float
    seconds: float


@dataclass(frozen=True, eq=False, slots=True)
class SwarmsResult:
    """All attempts, and the reference of each mission; ``redraws``: pairs and sets of zones drawn in vain before it."""

    seed: int
    evaluations: int
    optima: dict[str, Optimum]
    attempts: list[Attempt]
    redraws: list[tuple[int, int]]

    def over(self, attempt: Attempt) -> float | None:
        """Percent by which an attempt's path is longer than the reference's; None if it was refused."""
        if attempt.length_m is None:
            return None
        return 100.0 * (attempt.length_m / self.optima[attempt.mission].length_m - 1.0)

    def lines(self) -> list[tuple[str, ...]]:
        """A row of `SWARM_COLUMNS` for each method, in the order of their first attempts."""
        groups: dict[Method, list[Attempt]] = {}
        for attempt in self.attempts:
            groups.setdefault(attempt.method, []).append(attempt)
        return [self._line(method, found) for method, found in groups.items()]

    def _line(self, method: Method, found: Sequence[Attempt]) -> tuple[str, ...]:
        by = {status: [a for a in found if a.status == status] for status in ("raw legal", "repaired", "refused")}
        over = {status: [x for a in some if (x := self.over(a)) is not None] for status, some in by.items()}
        every = [*over["raw legal"], *over["repaired"]]
        restarted = sum(a.searches is not None for a in found)
        return (
            f"{method.label}, warm" if method.warm else method.label, method.encoding,
            {LENGTH_COST: "length", "own": "its paper's"}[method.cost],
            *(str(len(some)) for some in by.values()), f"{100.0 * len(every) / len(found):.0f}",
            "–" if method.family == "mealpy" else f"{100.0 * restarted / len(found):.0f}",
            *(_percent(percentile(every, p)) for p in (50, 90, 100)),
            _percent(percentile(over["raw legal"], 50)), _percent(percentile(over["repaired"], 50)),
            *(f"{statistics.median(s):.2f}" for s in ([a.search_s for a in found], [a.repair_s for a in found])),
        )  # fmt: skip

    @property
    def about(self) -> list[str]:
        """Lines on the measured missions."""
        gap = [100.0 * (o.length_m / o.bound_m - 1.0) for o in self.optima.values()]
        took = [o.seconds for o in self.optima.values()]
        pairs, sets = (max(r[i] for r in self.redraws) for i in (0, 1))
        return [
            f"{len(self.optima)} missions over real terrain with room, seed {self.seed}; {self.evaluations:,} cost "
            f"evaluations each; gcsplan {version('gcsplan')}, mealpy {_release('mealpy')}, cma {_release('cma')}, "
            f"Python {platform.python_version()}, {platform.machine()}.",
            f"`optimal`: gap to its certified bound {statistics.median(gap):.2f} % (median), {max(gap):.2f} % at most, "
            f"{statistics.median(took):.2f} s (median). Before one mission up to {pairs} pairs and {sets} sets of "
            "zones were drawn in vain.",
            "Over: longer than the path of `optimal`, of all solved missions. Seconds are the processor's, medians; "
            "the check of the curve is in the search. After restarts: solved by the planner, which searches again with "
            "other seeds.",
        ]

    def markdown(self) -> str:
        """The table as Markdown."""
        rows = [SWARM_COLUMNS, tuple("---" for _ in SWARM_COLUMNS), *self.lines()]
        return "\n".join(
            ["# Swarms over real terrain", "", *self.about, "", *(f"| {' | '.join(r)} |" for r in rows), ""]
        )

    def table(self) -> Table:
        """The table for the terminal."""
        out = Table(title=f"swarms, seed {self.seed}")
        for k, name in enumerate(SWARM_COLUMNS):
            out.add_column(name, justify="left" if k < 3 else "right")
        for line in self.lines():
            out.add_row(*line)
        return out

    def csv(self) -> str:
        """One row for each attempt."""
        rows = [self._row(a) for a in self.attempts]
        return csv_of([list(rows[0]) if rows else [], *(row.values() for row in rows)])

    def _row(self, attempt: Attempt) -> dict[str, object]:
        row = asdict(attempt)
        method = row.pop("method")
        best = self.optima[attempt.mission]
        return {
            "mission": row.pop("mission"), "group": row.pop("group"), **method, **row,
            "over_percent": self.over(attempt), "optimal_m": best.length_m, "bound_m": best.bound_m,
        }  # fmt: skip

    def write(self, directory: Path) -> list[Path]:
        """Write ``swarms.md`` and ``swarms.csv``; returns their paths."""
        return write_all(directory, {"swarms.md": self.markdown(), "swarms.csv": self.csv()})


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _release(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def methods(*, encodings: bool = False, warm: bool = False, names: Sequence[str] | None = None) -> list[Method]:
    """The rows of the table; with ``encodings`` the rows of the table that compares encodings.

    ``warm``: searches that begin around the path of `optimal`, too. ``names``: labels of the rows; None: all. An
    optimiser that was added, or is at ``MODULE:FUNCTION``, is one row more, and chooses none of the others. Raises
    InputError for an unknown name.
    """
    every = _own_methods(encodings=encodings, warm=warm)
    known = {m.label for m in every}
    added = [name for name in names or () if name not in known]
    for name in added:
        if ":" not in name and OPTIMISERS_ADDED.get(name) is None:
            raise unknown_name(f"there is no method {name!r}", name, (*known, *OPTIMISERS_ADDED.names()))
        get_optimiser(name)
    chosen = set(names or ()) & known or known
    return [m for m in every if m.label in chosen] + [Method("gcsplan", name) for name in dict.fromkeys(added)]


def _own_methods(*, encodings: bool, warm: bool) -> list[Method]:
    if encodings:
        return [Method("gcsplan", name, encoding)
                for encoding in COMPARED_ENCODINGS for name in (*PAPER_SWARMS, "lshade")
                if (name, encoding) != ("lshade", "paper")]  # fmt: skip
    ours = [Method("gcsplan", name) for name in (*PAPER_SWARMS, "lshade", "cmaes")]
    ours += [Method("mealpy", name) for name in terrain_swarms.BASELINES]
    return ours + [Method("gcsplan", name, warm=True) for name in ("ib-abc", "lshade") if warm]


def run(
    directory: Path,
    *,
    seed: int = 1,
    count: int | None = None,
    evaluations: int = EVALUATIONS,
    names: Sequence[str] | None = None,
    encodings: bool = False,
    warm: bool = False,
    jobs: int | None = 1,
    tell: Callable[[str], None] = lambda words: None,
) -> SwarmsResult:
    """Measure, and write ``swarms.md`` and ``swarms.csv`` to ``directory``.

    ``count``: missions of each group; ``names``, ``encodings``, ``warm``: see `methods`; ``jobs``: see
    `parallel.executor`. Attempts are kept in the directory, and the same command goes on there. Raises InputError for
    an unknown name, and if mealpy or cma is not installed.
    """
    if evaluations < 1 or (count is not None and count < 1):
        raise InputError("evaluations and count must be 1 or more")
    chosen = methods(encodings=encodings, warm=warm, names=names)
    if any(m.family == "mealpy" for m in chosen):
        release("mealpy")
    named = problems("room", seed, count=count)
    jobs_of = [SwarmJob(seed, evaluations, one.name, method) for method in [None, *chosen] for one in named]
    kept = Kept(directory / ATTEMPTS_FILE)
    left = [job for job in jobs_of if job.key not in kept.known]
    with executor(jobs, pieces=len(left), piece_s=ATTEMPT_S) as workers:
        for done, (number, answer) in enumerate(workers.each(answer_of, None, left), 1):
            job = left[number]
            kept.add(job.key, answer)
            tell(f"{done} of {len(left)}: {job.mission}, {job.method.label if job.method else OPTIMAL}")
    optima: dict[str, Optimum] = {}
    attempts: list[Attempt] = []
    for job in jobs_of:
        known_answer = kept.known[job.key]
        if job.method is None:
            optima[job.mission] = Optimum(**known_answer)
        else:
            attempts.append(Attempt(**{**known_answer, "method": job.method}))
    result = SwarmsResult(seed, evaluations, optima, attempts, [one.redraws for one in named])
    result.write(directory)
    return result


@dataclass(frozen=True, slots=True)
class SwarmJob:
    """An attempt to make; ``method`` None: the reference."""

    seed: int
    evaluations: int
    mission: str
    method: Method | None

    @property
    def key(self) -> str:
        """All that decides the answer, the code included."""
        added = self.method and self.method.family == "gcsplan" and self.method.name not in SWARM_PLANNERS
        code = f" {added_code(self.method.name)}" if self.method and added else ""
        return f"{self.seed} {self.evaluations} {self.mission} {self.method} {code_digest()}{code}"


class Kept:
    """A file of answers, one JSON line each; a line that cannot be read counts as not written."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.known: dict[str, dict[str, Any]] = {}
        for row in kept_rows(path):
            with suppress(KeyError, TypeError):
                self.known[row["key"]] = row["answer"]

    def add(self, key: str, answer: dict[str, Any]) -> None:
        """Keep an answer; it is written when this returns."""
        self.known[key] = answer
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write("\n" + json.dumps({"key": key, "answer": answer}))


@lru_cache(maxsize=2)
def _missions(seed: int) -> dict[str, NamedProblem]:
    return {one.name: one for one in problems("room", seed)}


def answer_of(_: None, job: SwarmJob) -> dict[str, Any]:
    """Do one job, in whatever process."""
    one = _missions(job.seed)[job.mission]
    if job.method is None:
        return asdict(optimum_of(one.problem))
    return asdict(attempt_of(one, job.method, job.evaluations))


def optimum_of(problem: Problem) -> Optimum:
    """The reference's length and bound; counted work alone stops it, so that it does not move."""
    began = time.process_time()
    solution = get_planner(OPTIMAL).plan(replace(problem, budget=Budget.endless(clocked=False)))
    assert solution.lower_bound is not None
    return Optimum(solution.path.length_m, solution.lower_bound, time.process_time() - began)


def attempt_of(one: NamedProblem, method: Method, evaluations: int) -> Attempt:
    """One method on one mission. Raises GcsplanError if its path does not pass the exact check, which is a bug."""
    problem = replace(one.problem, budget=Budget.endless(clocked=False))
    options: dict[str, Any] = {"encoding": method.encoding}
    if method.cost != "own":
        options["cost"] = method.cost
    if method.warm:
        options["warm_start"] = OPTIMAL
    ours = method.family == "gcsplan"
    row = entry(method.name if ours else "de")
    settings = replace(Settings.of(row, options), iterations=None, evaluations=evaluations)
    settings = warm_start.resolved(problem, settings)
    began = time.process_time()
    found = search(problem, row.optimiser, settings) if ours else _mealpy(problem, settings, method.name, evaluations)
    searched = time.process_time()
    ended = settle(problem, found)
    repaired = time.process_time()
    status: AttemptStatus = "refused" if ended is None else "raw legal" if ended[1] is None else "repaired"
    way_m, searches = None, None if ended is None else 1
    if ended is not None:
        if not passes(problem, ended[0]):
            raise GcsplanError(f"{one.name}, {method}: the path does not pass the exact check")
        way_m = length_m(ended[0])
    elif ours:
        searches = _searches(one.problem, row, settings)
    return Attempt(
        one.name, one.group, method, status, way_m, found.result.evaluations, searched - began, repaired - searched,
        searches,
    )  # fmt: skip


def _searches(problem: Problem, row: SwarmEntry, settings: Settings) -> int | None:
    """Searches that the planner needs until one is legal or repaired; None if it refuses."""
    count = 0

    def once(again: Problem, _: Settings) -> Found:
        nonlocal count
        count += 1
        return search(again, row.optimiser, settings)

    try:
        until_found(replace(problem, budget=Budget.endless(clocked=False), options={}), row, once)
    except Refusal:
        return None
    return count


def _mealpy(problem: Problem, settings: Settings, name: str, evaluations: int) -> Found:
    cost = cost_of(problem, settings)
    best, least = terrain_swarms.minimised(cost, cost.dim, name, evaluations, problem.seed)
    history = History(np.arange(len(least)), np.zeros(len(least), dtype=int), least)
    return drawn(
        problem, cost,
        OptimiserResult(best, float(least[-1]), len(least) - 1, 0, history, "evaluations", f"mealpy {name}"),
    )  # fmt: skip
