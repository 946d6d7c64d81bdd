"""Our optimisers beside MetaEvoBox's own on UAV problems of its family, at its budget.

MetaEvoBox (MetaBox 2) has 56 published instances, which its package does not contain. Its generator is in the package,
so the instances here are of the same family: terrain of 900 × 900 cells, 15 and 30 threats in turn, ten way
points in polar coordinates (30 variables), and a cost of five weighted terms. Its optimisers run in its own code, in an
environment of its own (`link`); ours search the same cost over the unit box. Each has its own population.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any, TypeVar

import numpy as np

from gcsplan.bench.files import ready
from gcsplan.bench.metabox.link import Worker
from gcsplan.errors import InputError, unknown_name
from gcsplan.optimisers.driver import minimise
from gcsplan.optimisers.registry import TABLE

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


def ours() -> tuple[str, ...]:
    """Our optimisers; of those with the same rule and defaults the last."""
    known = {(row.update, row.population, tuple(sorted(row.defaults.items()))): name for name, row in TABLE.items()}
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
            f"1 to {MOST_INSTANCES} instances, 1 to {MOST_METABOX_RUNS} runs, {LEAST_BUDGET} evaluations or more and "
            f"1 job or more are wanted, given {instances}, {runs}, {evaluations} and {jobs}"
        )
    names = tuple(dict.fromkeys(algorithms)) if algorithms else known
    asked = [_OptimiserRun(i, name, k, seed) for i in range(instances) for name in names for k in range(runs)]
    ready(out)
    files = [out / f"instance-{k}-threats-{_threats(k)}-seed-{seed}.pkl" for k in range(instances)]
    with ExitStack() as stack:
        python = Path(sys.executable) if python is None else python
        workers = [stack.enter_context(Worker(python)) for _ in range(min(jobs, len(asked)))]
        missing = [k for k in range(instances) if not files[k].exists()]
        for _ in _each(workers, missing, lambda worker, k: _generate(worker, files[k], k, seed)):
            pass
        for worker in workers:
            worker.load(files)
        records = []
        for record in _each(workers, asked, lambda worker, job: _record(worker, job, evaluations)):
            records.append(record)
            if done is not None:
                done(len(records), len(asked))
        told = {"instances": instances, "runs": runs, "seed": seed, "evaluations": evaluations}
        return {
            "settings": told | {"algorithms": list(names), "dims": workers[0].dims, "threats": workers[0].threats},
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
    workers: Sequence[Worker], asked: Sequence[Question], work: Callable[[Worker, Question], Reply]
) -> Iterator[Reply]:
    """The results of ``work`` in the order of ``asked``; each worker does one thing at a time."""
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
            yield from pool.map(one, asked)
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _record(worker: Worker, job: _OptimiserRun, evaluations: int) -> dict[str, Any]:
    """One run. ``cost`` and ``clear`` are those of the best point; ``outside``: evaluated points out of the box."""
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
    told = {"evaluations": best.evaluations, "outside": 0, "failed": ""}
    return record | {"cost": judged["costs"][0], "clear": judged["clear"][0]} | told
