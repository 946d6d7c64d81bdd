"""`gcsplan bench metabox`: our optimisers beside MetaEvoBox's own on UAV problems of its family, at its budget.

MetaEvoBox (MetaBox 2) has 56 published instances, which its package does not contain. Its generator is in the package,
so the instances here are of the same family: terrain of 900 × 900 cells, 15 and 30 threats in turn, ten way
points in polar coordinates (30 variables), and a cost of five weighted terms. Ours search the same cost over the unit
box. Each has its own population.

MetaEvoBox pins versions that clash with gcsplan's other extras, so its optimisers run in its own code, in an
environment of its own: `worker` runs there, and a `Worker` is such a process.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any, TypeVar

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.bench.files import ready, write_all
from gcsplan.bench.measure import compare, holm
from gcsplan.errors import InputError, unknown_name
from gcsplan.export.table import csv_of
from gcsplan.research.optimisers.driver import minimise
from gcsplan.research.optimisers.registry import OPTIMISERS

BUDGET = 2500
"""MetaEvoBox's number of cost evaluations for this family."""
THEIRS = (
    "CMAES", "DE", "GLPSO", "JDE21", "MADDE", "NLSHADELBC", "PSO", "Random_search", "SAHLPSO", "SDMSPSO", "SHADE",
)  # fmt: skip
"""MetaEvoBox's optimisers for one objective that need no training."""
THREATS = (15, 30)
MOST_INSTANCES, MOST_METABOX_RUNS, LEAST_BUDGET = 56, 51, 100

Question = TypeVar("Question")
Reply = TypeVar("Reply")

SCRIPT = Path(__file__).with_name("worker.py")
WORKER_START_S, WORKER_ANSWER_S = 600.0, 3600.0
"""Longest wait for the start of a process, and for an answer."""
TAIL = 400
"""Characters of MetaEvoBox's own complaint that a message repeats."""

METABOX_CURE = (
    "MetaEvoBox needs an environment of its own: python3.11 -m venv metabox-env, "
    "metabox-env/bin/pip install 'gcsplan[metabox]', then gcsplan bench metabox --python metabox-env/bin/python"
)


class Worker:
    """One process of ``python``, an interpreter that has MetaEvoBox. Raises InputError if it does not."""

    def __init__(self, python: Path) -> None:
        self._python = python
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        try:
            # -I: neither gcsplan's sources nor the user's site packages are seen there.
            self._process = subprocess.Popen(
                [str(python), "-I", str(SCRIPT)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log
            )
        except OSError as error:
            self._log.close()
            raise InputError(f"cannot be run: {error.strerror or error}. {METABOX_CURE}", where=str(python)) from error
        try:
            ready = self._answer(WORKER_START_S)
            if "error" in ready:
                raise InputError(
                    f"MetaEvoBox cannot be imported there: {ready['error']}. {METABOX_CURE}", where=str(python)
                )
        except BaseException:
            self.close()
            raise
        self.versions: dict[str, str] = ready["versions"]
        self.dims: list[int] = []
        self.threats: list[int] = []

    def __enter__(self) -> Worker:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._log):
            if stream is not None:
                stream.close()

    def ask(self, what: str, points: Floats | None = None, **request: Any) -> dict[str, Any]:
        """The answer to a request of `worker`. Raises InputError if there is none, or if it is an error."""
        shape = {} if points is None else {"shape": points.shape}
        data = b"" if points is None else np.ascontiguousarray(points, dtype=np.float64).tobytes()
        stream = self._process.stdin
        assert stream is not None
        try:
            stream.write(json.dumps({"what": what, **request, **shape}).encode() + b"\n" + data)
            stream.flush()
        except OSError:
            raise self._ended("ended") from None
        answer = self._answer(WORKER_ANSWER_S)
        if "error" in answer:
            raise InputError(f"MetaEvoBox failed at {what} {request}: {answer['error']}", where=str(self._python))
        return answer

    def load(self, files: Sequence[Path]) -> None:
        """Load the instances in ``files``; ``dims`` and ``threats`` hold the numbers of variables and of threats."""
        answer = self.ask("load", files=[str(file) for file in files])
        self.dims, self.threats = answer["dims"], answer["threats"]

    def cost(self, instance: int) -> Callable[[Floats], Floats]:
        """The cost of an instance, as a batch objective over the unit box."""
        return lambda points: np.array(self.ask("cost", points, instance=instance)["costs"])

    def _answer(self, wait_s: float) -> dict[str, Any]:
        stream = self._process.stdout
        assert stream is not None
        limit = threading.Timer(wait_s, self._process.kill)
        limit.start()
        try:
            line = stream.readline()
        finally:
            limit.cancel()
        if not line:
            raise self._ended(f"ended, or gave no answer within {wait_s:g} s")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def _ended(self, how: str) -> InputError:
        self._log.seek(0)
        log = self._log.read().decode(errors="replace").strip()
        return InputError(
            f"MetaEvoBox's process {how}. Its last words: {log[-TAIL:] or 'none'}", where=str(self._python)
        )


def ours() -> tuple[str, ...]:
    """Our optimisers; the last one of several with the same rule and defaults."""
    known = {
        (row.update, row.population, tuple(sorted(row.defaults.items()))): name for name, row in OPTIMISERS.items()
    }
    return tuple(known.values())


@dataclass(frozen=True, slots=True)
class _OptimiserRun:
    instance: int
    algorithm: str
    run: int
    seed: int


def run(
    out: Path,
    python: Path | None = None,
    *,
    instances: int = 2,
    runs: int = 5,
    seed: int = 1,
    evaluations: int = BUDGET,
    algorithms: Sequence[str] | None = None,
    jobs: int = 1,
    done: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Run every optimiser ``runs`` times on every instance; the same seed gives the same numbers.

    ``python``: the interpreter of MetaEvoBox's environment (default: this one). ``algorithms``: names of ours (as in
    the table of optimisers) and of `THEIRS`; all if None. The instances are kept in ``out``, because each takes one or
    two minutes to generate. ``done`` is called with the numbers of finished runs and of all. The result has
    ``settings``, the ``sha256`` of the instances, ``versions`` and ``runs``, a record each. Raises InputError for bad
    arguments, or without MetaEvoBox.
    """
    known = (*ours(), *THEIRS)
    for name in algorithms or ():
        if name not in known:
            raise unknown_name(f"there is no optimiser {name!r} in this benchmark", name, known)
    if not (
        1 <= instances <= MOST_INSTANCES
        and 1 <= runs <= MOST_METABOX_RUNS
        and evaluations >= LEAST_BUDGET
        and jobs >= 1
    ):
        raise InputError(
            f"give 1 to {MOST_INSTANCES} instances, 1 to {MOST_METABOX_RUNS} runs, {LEAST_BUDGET} evaluations or more "
            f"and 1 job or more, not {instances}, {runs}, {evaluations} and {jobs}"
        )
    names = tuple(dict.fromkeys(algorithms)) if algorithms else known
    every = [_OptimiserRun(i, name, k, seed) for i in range(instances) for name in names for k in range(runs)]
    ready(out)
    files = [out / f"instance-{k}-threats-{_threats(k)}-seed-{seed}.pkl" for k in range(instances)]
    with ExitStack() as stack:
        python = Path(sys.executable) if python is None else python
        workers = [stack.enter_context(Worker(python)) for _ in range(min(jobs, len(every)))]
        missing = [k for k in range(instances) if not files[k].exists()]
        for _ in _each(workers, missing, lambda worker, k: _generate(worker, files[k], k, seed)):
            pass
        for worker in workers:
            worker.load(files)
        records = []
        for record in _each(workers, every, lambda worker, job: _record(worker, job, evaluations)):
            records.append(record)
            if done is not None:
                done(len(records), len(every))
        settings = {"instances": instances, "runs": runs, "seed": seed, "evaluations": evaluations}
        return {
            "settings": settings | {"algorithms": list(names), "dims": workers[0].dims, "threats": workers[0].threats},
            "sha256": [hashlib.sha256(file.read_bytes()).hexdigest() for file in files],
            "versions": workers[0].versions,
            "runs": records,
        }


def _threats(instance: int) -> int:
    """MetaEvoBox's two kinds of instances, in turn."""
    return THREATS[instance % 2]


def _generate(worker: Worker, file: Path, instance: int, seed: int) -> None:
    part = file.with_suffix(".part")
    drawn = int(np.random.default_rng([seed, instance]).integers(2**31))
    worker.ask("make", file=str(part), threats=_threats(instance), seed=drawn)
    part.replace(file)


def _each(
    workers: Sequence[Worker], questions: Sequence[Question], work: Callable[[Worker, Question], Reply]
) -> Iterator[Reply]:
    """The results of ``work`` in the order of ``questions``; each worker does one item at a time."""
    idle: SimpleQueue[Worker] = SimpleQueue()
    for worker in workers:
        idle.put(worker)

    def one(item: Question) -> Reply:
        worker = idle.get()
        try:
            return work(worker, item)
        finally:
            idle.put(worker)

    with ThreadPoolExecutor(len(workers)) as pool:
        try:
            yield from pool.map(one, questions)
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _record(worker: Worker, job: _OptimiserRun, evaluations: int) -> dict[str, Any]:
    """One run. ``cost`` and ``clear``: of the best point; ``outside``: number of evaluated points out of the box."""
    record: dict[str, Any] = {"instance": job.instance, "algorithm": job.algorithm, "run": job.run}
    if job.algorithm in THEIRS:
        # MetaEvoBox's seeds are 32 bits.
        drawn = int(np.random.default_rng([job.seed, job.instance, job.run]).integers(1, 2**31))
        found = worker.ask(
            "solve", instance=job.instance, optimiser=job.algorithm, seed=drawn, evaluations=evaluations
        )  # fmt: skip
        return record | {key: found[key] for key in ("cost", "clear", "evaluations", "outside", "failed")}
    best = minimise(
        job.algorithm, worker.cost(job.instance), worker.dims[job.instance], evaluations=evaluations,
        seed=np.random.default_rng([job.seed, job.instance, job.run]),
    )  # fmt: skip
    judged = worker.ask("judge", best.x[None], instance=job.instance)
    ours = {"evaluations": best.evaluations, "outside": 0, "failed": ""}
    return record | {"cost": judged["costs"][0], "clear": judged["clear"][0]} | ours


METABOX_COLUMNS = ("optimiser", "of", "place, %", "p", "over the best, %", "clear", "remarks")


def rows(result: dict[str, Any]) -> list[dict[str, Any]]:
    """A row for each optimiser, best mean place first.

    ``place_percent``: mean place of its runs among all runs on an instance, by cost, from 0 (best) to 100. ``p``:
    probability of its places if they do not differ from the first row's (Mann and Whitney's U, Holm over the
    optimisers). ``over_percent``: median cost over the least cost that any run found on the instance, median over the
    instances; None if half of the runs found nothing. ``clear``: part of the runs whose best path has no penalty.
    ``outside``: part of its evaluated points that lie out of the box. ``medians``: median cost by instance; None as
    above.
    """
    settings = result["settings"]
    names, count, runs = settings["algorithms"], settings["instances"], settings["runs"]
    costs = np.full((count, len(names), runs), np.inf)
    tally = {name: np.zeros(4) for name in names}  # clear, outside, evaluated, failed
    for record in result["runs"]:
        cost = np.inf if record["cost"] is None else record["cost"]
        costs[record["instance"], names.index(record["algorithm"]), record["run"]] = cost
        tally[record["algorithm"]] += record["clear"], record["outside"], record["evaluations"], bool(record["failed"])
    medians, places = np.median(costs, axis=2), _places(costs)
    over = 100.0 * np.median(medians / costs.min(axis=(1, 2))[:, None] - 1.0, axis=0)
    best = places[int(places.mean(axis=1).argmin())]
    p = holm([compare(one, best)[0] for one in places])
    out = [
        {
            "optimiser": name, "of": "MetaEvoBox" if name in THEIRS else "gcsplan",
            "place_percent": float(places[a].mean()), "p": p[a], "over_percent": _finite(over[a]),
            "clear": float(tally[name][0] / (count * runs)), "outside": float(tally[name][1] / tally[name][2]),
            "failed": int(tally[name][3]), "medians": [_finite(m) for m in medians[:, a]],
        }
        for a, name in enumerate(names)
    ]  # fmt: skip
    return sorted(out, key=lambda row: (row["place_percent"], row["optimiser"]))


def report(result: dict[str, Any]) -> str:
    """The table as Markdown, which reads well on a terminal too."""
    return "\n".join(_markdown(result)) + "\n"


def write(result: dict[str, Any], out: Path) -> list[Path]:
    """Write ``metabox.json``, ``metabox.md`` and ``metabox-runs.csv``, each whole or not at all.

    Raises InputError if one cannot be written.
    """
    names = list(result["runs"][0])
    table = [names, *([run.get(name) for name in names] for run in result["runs"])]
    return write_all(
        out,
        {
            "metabox.json": json.dumps(result | {"rows": rows(result)}, indent=1) + "\n",
            "metabox.md": report(result),
            "metabox-runs.csv": csv_of(table, end="\r\n"),
        },
    )


def _finite(number: float) -> float | None:
    return float(number) if np.isfinite(number) else None


def _places(costs: Floats) -> Floats:
    """Places (optimisers, instances × runs) of ``costs`` (instances, optimisers, runs) among its instance's costs."""
    from scipy.stats import rankdata

    ranks = np.array([rankdata(one).reshape(one.shape) for one in costs])
    return np.asarray(100.0 * (ranks - 0.5) / costs[0].size).transpose(1, 0, 2).reshape(costs.shape[1], -1)


def _markdown(result: dict[str, Any]) -> Iterator[str]:
    settings = result["settings"]
    threats = ", ".join(map(str, settings["threats"]))
    yield (
        f"{settings['instances']} generated instances of MetaEvoBox's UAV family (threats: {threats}), seed "
        f"{settings['seed']}, {settings['evaluations']} evaluations, {settings['runs']} runs; its published instances "
        "are others."
    )
    yield ""
    yield f"| {' | '.join(METABOX_COLUMNS)} |"
    yield "| --- | --- | ---: | ---: | ---: | ---: | --- |"
    for row in rows(result):
        remarks = []
        if row["outside"] >= 0.0005:
            remarks.append(f"{100.0 * row['outside']:.1f} % of its points are out of the box")
        if row["failed"]:
            remarks.append(f"{row['failed']} runs failed")
        over = "–" if row["over_percent"] is None else f"{row['over_percent']:.1f}"
        yield (
            f"| {row['optimiser']} | {row['of']} | {row['place_percent']:.0f} | {row['p']:.2g} | "
            f"{over} | {100.0 * row['clear']:.0f} % | {'; '.join(remarks) or '–'} |"
        )
    yield ""
    yield "Versions: " + ", ".join(f"{name} {number}" for name, number in result["versions"].items()) + "."
