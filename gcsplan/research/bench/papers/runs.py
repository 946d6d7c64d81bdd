"""One run of one algorithm in one scenario, the file that keeps the runs, and their parallel execution.

Runs are kept as JSON lines, each on the disk before the next is requested. A run is identified by scenario, algorithm,
seed, number and a digest of everything that decides its result: mission file, settings and the code itself.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.app.parallel.executor import executor
from gcsplan.arrays import Floats
from gcsplan.bench.files import kept_rows
from gcsplan.errors import InputError, NoMission
from gcsplan.planners.budget import Budget
from gcsplan.planners.problem import Problem
from gcsplan.planners.registry import get as get_planner
from gcsplan.planners.simplify import thinned
from gcsplan.research.bench.papers.scenarios import SCENARIOS, Contender, ReadyScenario, prepare, settings_of
from gcsplan.research.optimisers.registry import added_code
from gcsplan.research.swarm import aco
from gcsplan.research.swarm.planner import Found, scene_of, search
from gcsplan.research.swarm.scene import Scene
from gcsplan.research.swarm.settings import Settings
from gcsplan.world.geometry.path import Path as FlownPath
from gcsplan.world.geometry.zones import Circle

RunRecord = dict[str, Any]
Key = tuple[str, str, int, int, str]

OPTIMA = {"optimal": "length", "optimal-energy": "energy"}
"""Names under which the planner `optimal` runs, and the objective of each."""

POINTS_OF_HISTORY = 100
DRAWN_M = 1e-4
"""Part of a path's length by which the points kept for the map may be off its curve."""
RUN_S = 5.0
"""Seconds that a run takes, about."""
CONVERGED_PART = 0.01
"""A run has converged when its cost is within this part of its final cost."""

CODE = (
    "*.py", "app/fleet/pipeline.py", "app/plan/problem.py", "app/parallel/sites.py",
    "mavlink/build/*.py", "mavlink/mission/mission.py", "mission_file/**/*.py", "native/*.py", "planners/**/*.py",
    "research/bench/papers/runs.py", "research/bench/papers/scenarios.py", "research/optimisers/*.py",
    "research/swarm/*.py", "world/**/*.py",
)  # fmt: skip
"""Source files within the package that decide a run's result; a superfluous file is better than a missing one."""


@lru_cache(maxsize=1)
def code_digest() -> str:
    """Digest of everything but the run itself that decides a run's result: source files and library versions."""
    root, total = Path(__file__).parents[3], hashlib.sha256(f"{np.__version__} {version('scipy')}".encode())
    for pattern in CODE:
        for file in sorted(root.glob(pattern)):
            total.update(file.name.encode())
            total.update(file.read_bytes())
    return total.hexdigest()[:16]


@dataclass(frozen=True, slots=True)
class PaperRun:
    """One run to do. It carries the mission's text, so that a machine without the file can do it."""

    scenario: str
    algorithm: str
    text: str
    seed: int
    number: int
    code: str

    @property
    def key(self) -> Key:
        """The identity of the run."""
        return (self.scenario, self.algorithm, self.seed, self.number, self.digest)

    @property
    def digest(self) -> str:
        """Digest of everything that decides the result."""
        parts: list[object] = [self.text, self.code]
        if self.algorithm not in OPTIMA:
            c = self.contender
            parts += [c.planner, {k: dict(v) if isinstance(v, Mapping) else v for k, v in c.options.items()}]
            parts += [added_code(c.added)] if c.added else []
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]

    @property
    def contender(self) -> Contender:
        """The algorithm's entry in the paper's table, or that of an optimiser that was added."""
        return SCENARIOS[self.scenario].contender(self.algorithm)


def key_of(record: RunRecord) -> Key:
    """The identity of a record's run. Raises KeyError or TypeError for anything but a record."""
    return (record["scenario"], record["algorithm"], record["seed"], record["number"], record["digest"])


class Store:
    """The file of runs. A line that cannot be read, such as a truncated last one, counts as not written."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def load(self) -> dict[Key, RunRecord]:
        """Every run in the file. Raises InputError if the file cannot be read."""
        out: dict[Key, RunRecord] = {}
        for record in kept_rows(self.path):
            with suppress(KeyError, TypeError):
                out[key_of(record)] = record
        return out

    def append(self, record: RunRecord) -> None:
        """Append a run, on a line of its own even if the line before it is truncated."""
        try:
            with self.path.open("ab+") as file:
                if file.seek(0, os.SEEK_END):
                    file.seek(-1, os.SEEK_END)
                    if file.read(1) != b"\n":
                        file.write(b"\n")
                file.write(json.dumps(record, separators=(",", ":"), allow_nan=False).encode() + b"\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror or error}", where=str(self.path)) from error


def work(job: PaperRun) -> RunRecord:
    """Do one run. Raises InputError if the code on this machine differs from the code that requested the run."""
    optimal = job.algorithm in OPTIMA
    if job.code != code_digest():
        raise InputError(
            "a worker runs another version of gcsplan, numpy or scipy: install the same on every machine of the cluster"
        )
    ready = prepare(job.scenario, job.text)
    record: RunRecord = {
        "scenario": job.scenario, "algorithm": job.algorithm, "seed": job.seed, "number": job.number,
        "digest": job.digest,
    }  # fmt: skip
    try:
        record.update(_best(ready, OPTIMA[job.algorithm]) if optimal else _swarm(job, ready))
    except NoMission as refusal:
        record.update(status="refused", detail=str(refusal))
    return record


def _best(ready: ReadyScenario, objective: str) -> RunRecord:
    """The paths of the planner `optimal`, vehicle by vehicle, with their costs and lower bounds.

    Counted work alone stops it, so that the reference is the same on every machine and under any load.
    """
    began = time.thread_time()
    costs, bounds, paths, stopped = [], [], [], []
    for problem in ready.problems:
        reference = replace(
            problem, objective="energy" if objective == "energy" else "length", budget=Budget.endless(clocked=False)
        )
        solution = get_planner("optimal").plan(reference)
        costs.append(reference.cost(solution.path))
        bounds.append(solution.lower_bound)
        paths.append(solution.path.points)
        stopped.append(solution.stopped_by)
    return {
        "status": "found", "costs": costs, "bounds": bounds, "stopped_by": stopped,
        "time_s": time.thread_time() - began, "paths": [np.round(p, 2).tolist() for p in paths],
    }  # fmt: skip


def seed_of(seed: int, number: int, vehicle: int) -> int:
    """The seed of one vehicle's search: the same for every algorithm and scenario."""
    return int(np.random.SeedSequence([seed, number, vehicle]).generate_state(1)[0])


def _search(problem: Problem, contender: Contender, settings: Settings, scene: Scene) -> Found:
    if contender.planner == "aco":
        return aco.search(problem, settings, scene)
    return search(problem, contender.optimiser, settings, scene)


@lru_cache(maxsize=4)
def _warm(scenario: str, text: str, algorithm: str) -> list[Scene]:
    """The scenes of a contender's vehicles; it also compiles and loads all that a run needs.

    So no run's time contains them, and the runs of a contender, which follow each other, share them.
    """
    job = PaperRun(scenario, algorithm, text, 1, 0, "")
    ready = prepare(scenario, text)
    settings = settings_of(job.contender, ready.source)
    scenes = [scene_of(problem, settings) for problem in ready.problems]
    with suppress(NoMission):  # a single iteration of ants may not reach the goal
        _search(ready.problems[0], job.contender, replace(settings, iterations=1), scenes[0])
    return scenes


def _swarm(job: PaperRun, ready: ReadyScenario) -> RunRecord:
    contender = job.contender
    settings = settings_of(contender, ready.source)
    scenes = _warm(job.scenario, job.text, job.algorithm)
    by_priority = SCENARIOS[job.scenario].paper.fleet == "priority"
    found: list[Found] = []
    began = time.thread_time()
    for vehicle, (problem, scene) in enumerate(zip(ready.problems, scenes, strict=True)):
        own = replace(settings, earlier=tuple(f.curve for f in found)) if by_priority else settings
        found.append(_search(replace(problem, seed=seed_of(job.seed, job.number, vehicle)), contender, own, scene))
    took = time.thread_time() - began
    history = _history(found)
    cost = sum(f.result.cost for f in found)
    flown = [FlownPath(f.curve) for f in found]
    near = [_nearest_m(f, p) for f, p in zip(found, ready.problems, strict=True)]
    return {
        "status": "found",
        "cost": cost if math.isfinite(cost) else None,
        "length_m": sum(p.length_m for p in flown),
        "lengths_m": [p.length_m for p in flown],
        "energy_j": sum(
            p.energy_j(q.vertical_j_per_m, q.horizontal_j_per_m) for p, q in zip(flown, ready.problems, strict=True)
        ),
        "collisions": sum(f.collisions for f in found),
        "violations": sum(len(f.violations) for f in found),
        "time_s": took,
        "evaluations": sum(f.result.evaluations for f in found),
        "iterations": max(f.result.iterations for f in found),
        "converged": _converged(history),
        "pitch_deg": float(np.mean([f.pitch_deg for f in found])),
        "yaw_deg": float(np.mean([f.yaw_deg for f in found])),
        "nearest_m": None if None in near else float(np.mean(near)),  # type: ignore[arg-type]
        "history": history,
        "paths": [np.round(f.curve[thinned(f.curve, f.terminals, DRAWN_M * f.length_m)], 2).tolist() for f in found],
    }


def _history(found: Sequence[Found]) -> dict[str, list[Any]]:
    """Best cost and evaluations so far at ends of iterations, of the whole fleet; None before a cost is finite."""
    last = max(f.result.iterations for f in found)
    at = np.unique(np.linspace(0, last, min(last, POINTS_OF_HISTORY) + 1).round().astype(int))
    cost, evaluations = np.zeros(len(at)), np.zeros(len(at), np.int64)
    for f in found:
        h = f.result.history
        place = np.searchsorted(h.iterations, at, side="right") - 1
        cost += np.where(place < 0, np.inf, h.cost[np.maximum(place, 0)])
        evaluations += np.where(place < 0, 0, h.evaluations[np.maximum(place, 0)])
    plain = [float(f"{c:.8g}") if math.isfinite(c) else None for c in cost.tolist()]
    return {"iterations": at.tolist(), "evaluations": evaluations.tolist(), "cost": plain}


def _converged(history: dict[str, list[Any]]) -> int | None:
    """The first kept iteration whose best cost is within `CONVERGED_PART` of the final one."""
    costs = history["cost"]
    if costs[-1] is None:
        return None
    enough = costs[-1] + CONVERGED_PART * abs(costs[-1])
    return int(next(i for i, c in zip(history["iterations"], costs, strict=True) if c is not None and c <= enough))


def _nearest_m(found: Found, problem: Problem) -> float | None:
    """Mean over the curve of the plane distance to the nearest cylinder's wall, m; None if there is no cylinder."""
    zones = [z.shape for z in problem.airspace.zones if isinstance(z.shape, Circle)]
    if not zones:
        return None
    wall: list[Floats] = [
        np.hypot(found.curve[:, 0] - c.east_m, found.curve[:, 1] - c.north_m) - c.radius_m for c in zones
    ]
    return float(np.maximum(np.min(wall, axis=0), 0.0).mean())


def carry_out(
    todo: Sequence[PaperRun], jobs: int | None, cluster: str | None, keep: Callable[[RunRecord], None]
) -> None:
    """Do every job and ``keep`` each record at once; after Ctrl-C, runs in progress are finished and kept."""
    with executor(jobs, cluster, pieces=len(todo), piece_s=RUN_S) as workers:
        for _, record in workers.each(_piece, None, todo, finish=True):
            keep(record)


def _piece(_: None, job: PaperRun) -> RunRecord:
    return work(job)
