"""Other planners, run in a separate process; each answer is written to a file before the next is requested.

A run takes minutes to hours, so answers in the file are not computed again after an interruption. A rival that crashes
or hangs loses only its own answer.
"""

from __future__ import annotations

import json
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from multiprocessing.connection import Connection
from pathlib import Path

from gcsplan.bench.files import kept_rows
from gcsplan.bench.measure import Memory, passes
from gcsplan.bench.terrain import ompl as terrain_ompl
from gcsplan.bench.terrain import swarms as terrain_swarms
from gcsplan.bench.terrain.outcome import MethodOutcome
from gcsplan.bench.terrain.problems import NamedProblem, key_of, problems
from gcsplan.errors import InputError
from gcsplan.planners.problem import Problem

RIVAL_KINDS = ("main", "band", "everyday", "ceiling", "time")
"""The kinds with problems that rivals can solve."""

RIVAL_START_S = 180.0  # seconds to import, make the problems and compile


@dataclass(frozen=True, slots=True)
class Rival:
    """A method: ``family`` (ompl or mealpy), the planner's name, and its seconds (ompl only)."""

    family: str
    planner: str
    seconds: float = 0.0

    @property
    def method(self) -> str:
        """The name in the table."""
        return f"OMPL {self.planner} {self.seconds:g} s" if self.family == "ompl" else f"mealpy {self.planner}"

    @property
    def limit_s(self) -> float:
        """Wall-clock seconds after which it counts as hanging; generous, since the processor may be shared, and OMPL
        may take ten times its seconds of it (`ompl.LEAST_OWN`)."""
        return 120.0 + (200.0 * self.seconds if self.family == "ompl" else 1200.0)


def rivals(seconds: Sequence[float], *, ompl: bool = True, swarms: bool = True) -> list[Rival]:
    """All rivals: OMPL's planners at each of ``seconds``, and mealpy's swarms."""
    out = [Rival("ompl", p, s) for s in sorted(seconds) for p in terrain_ompl.PLANNERS] if ompl else []
    return out + [Rival("mealpy", p) for p in terrain_swarms.SWARMS] if swarms else out


def solvable(named: Sequence[NamedProblem]) -> list[NamedProblem]:
    """The problems that rivals can solve: the shortest or the fastest path, without a turn radius."""
    return [
        one
        for one in named
        if one.kind in RIVAL_KINDS and one.problem.objective != "energy" and one.problem.turn_radius_m == 0.0
    ]


def release(rival: Rival) -> str:
    """The version of the rival's package, which separates valid kept answers from outdated ones. Raises InputError."""
    return terrain_ompl.release(rival.family)


class Answers:
    """A file of answers, one JSON object per line, by problem, method and version; the last line of each counts."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._known: dict[tuple[str, str, str], MethodOutcome] = {}
        names = {f.name for f in fields(MethodOutcome)}
        for row in kept_rows(path):
            try:
                outcome = MethodOutcome(**{k: v for k, v in row.items() if k in names})
            except (TypeError, AttributeError):
                continue
            if outcome.status != "failed":  # a crash is tried again
                self._known[outcome.key, outcome.method, outcome.version] = outcome

    def get(self, key: str, method: str, version: str | None) -> MethodOutcome | None:
        """The known answer, or None; with ``version`` None, the last line of any version."""
        if version is not None:
            return self._known.get((key, method, version))
        found = [o for (k, m, _), o in self._known.items() if (k, m) == (key, method)]
        return found[-1] if found else None

    def add(self, outcome: MethodOutcome) -> None:
        """Keep an answer; it is on the disk when this returns."""
        self._known[outcome.key, outcome.method, outcome.version] = outcome
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            # Begin a new line, since the last one may be truncated; empty lines are skipped.
            file.write("\n" + json.dumps(asdict(outcome)) + "\n")
            file.flush()
            os.fsync(file.fileno())


def compare(
    named: Sequence[NamedProblem], chosen: Sequence[Rival], answers: Answers, seed: int,
    tell: Callable[[str], None] = lambda words: None, *, kept_only: bool = False,
) -> Iterator[MethodOutcome]:  # fmt: skip
    """Every rival's outcome on every problem, as they come; ``tell`` receives a message on each.

    Raises InputError if a rival is not installed. With ``kept_only``, answers come only from the file, of any version.

    Paths are judged again here by the exact check, also from earlier runs: the file is not trusted.
    """
    versions = {rival: None if kept_only else release(rival) for rival in chosen}
    worker: RivalProcess | None = None
    try:
        for one in named:
            key = key_of(one.problem)
            for rival in chosen:
                version = versions[rival]
                outcome = answers.get(key, rival.method, version)
                if outcome is None and version is None:
                    continue
                if outcome is None:
                    tell(f"{rival.method}: {one.name}")
                    worker = worker or RivalProcess()
                    outcome = worker.ask(one, rival, seed)
                    if outcome.status == "failed":
                        worker.close()
                        worker = None
                    outcome = replace(outcome, version=version or "")
                    answers.add(outcome)
                else:
                    tell(f"{rival.method}: {one.name} (kept)")
                yield judged(replace(outcome, name=one.name, group=one.group), one.problem)
    finally:
        if worker is not None:
            worker.close()


def judged(outcome: MethodOutcome, problem: Problem) -> MethodOutcome:
    """The outcome, which stays solved only if the exact check passes the path."""
    if outcome.status == "solved" and not passes(problem, outcome.points):
        return replace(outcome, status="unsafe", detail="the path does not pass the exact check")
    return outcome


class RivalProcess:
    """The worker process: it receives questions and sends answers."""

    def __init__(self) -> None:
        # A fresh interpreter shares neither memory nor random numbers nor threads with this process.
        context = multiprocessing.get_context("spawn")
        self._ours, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs,), daemon=True)
        self._process.start()
        theirs.close()
        self._room_s = RIVAL_START_S

    def ask(self, one: NamedProblem, rival: Rival, seed: int) -> MethodOutcome:
        """The rival's outcome; failed if it crashes or does not answer in time."""
        base = MethodOutcome(key_of(one.problem), one.name, one.kind, one.group, rival.method, "failed")
        try:
            self._ours.send((one.kind, one.name, one.seed, one.errors, rival, seed, base))
            if not self._ours.poll(self._room_s + rival.limit_s):
                return replace(base, detail=f"no answer within {self._room_s + rival.limit_s:g} s")
            answer = self._ours.recv()
        except (EOFError, OSError):
            return replace(base, detail="its process crashed")
        self._room_s = 0.0
        if isinstance(answer, MethodOutcome):
            return answer
        return replace(base, detail=str(answer))

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self._ours.close()


def _serve(questions: Connection) -> None:
    """The main loop of the worker process."""
    made: dict[tuple[str, int, bool], dict[str, Problem]] = {}
    while True:
        try:
            kind, name, problem_seed, errors, rival, seed, base = questions.recv()
        except EOFError:
            os._exit(0)  # skips the destructors of OMPL's bindings, which print complaints
        try:
            if (kind, problem_seed, errors) not in made:
                found = problems(kind, problem_seed, errors=errors)
                made[kind, problem_seed, errors] = {p.name: p.problem for p in found}
            questions.send(_attempt(made[kind, problem_seed, errors][name], rival, seed, base))
        except Exception as error:
            questions.send(f"{type(error).__name__}: {error}")


def _attempt(problem: Problem, rival: Rival, seed: int, base: MethodOutcome) -> MethodOutcome:
    if rival.family == "ompl":
        terrain_ompl.warm_up(problem)
    memory = Memory()
    with memory.peak():
        found = (
            terrain_ompl.plan(problem, rival.planner, rival.seconds, seed)
            if rival.family == "ompl"
            else terrain_swarms.plan(problem, rival.planner, seed)
        )
    done = replace(
        base, status="not found" if found.points is None else "solved", detail=found.detail, cost=found.cost,
        raw_cost=found.raw_cost, first_path_s=found.first_path_s, planning_s=found.planning_s, checks=found.checks,
        memory_mb=memory.peak_mb, points=found.points or [],
    )  # fmt: skip
    return judged(done, problem)


def require(chosen: Sequence[Rival]) -> None:
    """Raise InputError with a cure if a rival is not installed."""
    if not chosen:
        raise InputError("no rival is requested: give --seconds, or --no-rivals")
    for rival in chosen:
        release(rival)
