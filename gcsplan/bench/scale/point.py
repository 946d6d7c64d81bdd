"""One measurement of `scale`, in a process of its own so that its memory is its own: ``python -m …scale.point JSON``.

Imports, kernels and workers are warm before the clock starts; the workers' start is measured apart.
"""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import yaml

from gcsplan.app.batch import BatchOptions, MissionBatch, Record, missions_of, record_of
from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.parallel.executor import Dask, Executor, Inline, executor
from gcsplan.bench.measure import peak_mb
from gcsplan.bench.scale.missions import mission
from gcsplan.errors import GcsplanError
from gcsplan.mission_file.source import file_of

EMPTY_PIECES = 1000
"""Pieces without work by which the scheduler's own time is measured."""


def batch_point(missions: str, out: str, jobs: int, kill: bool = False) -> dict[str, Any]:
    """Plan a folder of missions with ``jobs`` processes; with ``kill``, one of them is killed after a third."""
    work = MissionBatch(missions_of([missions]), Path(out), BatchOptions())
    done: list[Record] = []
    count = len(work.missions)
    begun_s = time.perf_counter()
    with executor(jobs, pieces=count, piece_s=1.0, start_s=0.0 if jobs > 1 else 1e9) as workers:
        spent = _Spent(workers)
        for _ in workers.each(_warm, None, range(4 * workers.count)):
            pass
        figures: dict[str, Any] = {"start_s": time.perf_counter() - begun_s}
        watched = _Watched(workers, Path(out) / "begun.log", count // 3 if kill else None)
        with spent.measured() as took:
            work.run(watched, range(count), done.append)
        figures |= took | watched.figures(count)
        if isinstance(workers, Dask):
            figures |= _scheduler(workers)
    codes = [r.code for r in done]
    return figures | {
        "missions": count, "jobs": jobs, "planned": codes.count(0), "refused": len(codes) - codes.count(0),
        "bytes_sha256": digest_of(Path(out)),
    }  # fmt: skip


def vehicles_point(count: int) -> dict[str, Any]:
    """Plan the first ``count`` vehicles of the sample fleet in one process: paths, times, separation."""
    content = yaml.safe_load(file_of("sample:fleet-100").read_text(encoding="utf-8"))
    content["vehicles"] = content["vehicles"][:count]
    if count < 2:
        del content["arrival"]
    return _planned(content) | {"vehicles": count}


def zones_point(zones: int, seed: int, tiles: str, missions: int) -> dict[str, Any]:
    """Plan ``missions`` missions with ``zones`` zones each."""
    return _mean([mission(number, seed, Path(tiles), zones) for number in range(missions)]) | {"zones": zones}


def cells_point(posts: int, seed: int, tiles: str, missions: int) -> dict[str, Any]:
    """Plan ``missions`` missions over a mosaic whose tiles have ``posts`` × ``posts`` cells."""
    contents = [mission(2 * number + 1, seed, Path(tiles)) for number in range(missions)]
    return _mean(contents) | {"posts": posts}


def _mean(contents: Sequence[dict[str, Any]]) -> dict[str, Any]:
    parts = [_planned(content) for content in contents]
    found = {key: sum(part[key] for part in parts) / len(parts) for key in ("wall_s", "cpu_s", "cells")}
    return found | {"peak_mb": max(part["peak_mb"] for part in parts), "planned": sum(p["planned"] for p in parts)}


def _planned(content: dict[str, Any]) -> dict[str, Any]:
    _warm(None, 0)
    spent, cells, planned = _Spent(Inline()), 0, 0
    with spent.measured() as took:
        try:
            result = plan(content)
            cells, planned = int(result.source.surface.ground_m.size), len(result.vehicles)
        except GcsplanError:
            pass  # a refusal takes its time too
    return took | {"cells": cells, "planned": planned}


def _warm(_: None, number: int) -> int:
    """Load and compile all code that planning over a DEM needs."""
    if not _warmed:
        _warmed.append(number)
        with suppress(GcsplanError):
            plan(mission(0, 1, Path(), 2))
    return os.getpid()


_warmed: list[int] = []


class _Spent:
    """Wall time, processor time and memory of this process and of its workers."""

    def __init__(self, workers: Executor) -> None:
        self._client = workers.client if isinstance(workers, Dask) else None

    def _workers(self) -> dict[int, tuple[float, float]]:
        found = {} if self._client is None else self._client.run(_usage)
        return {pid: usage for pid, *usage in found.values()}

    @contextmanager
    def measured(self) -> Iterator[dict[str, Any]]:
        """Yield a dict that holds the figures afterwards. Only workers that live at the end count."""
        took: dict[str, Any] = {}
        before, wall_s, cpu_s = self._workers(), time.perf_counter(), time.process_time()
        yield took
        took["wall_s"] = time.perf_counter() - wall_s
        took["cpu_s"] = took["own_cpu_s"] = time.process_time() - cpu_s
        took["peak_mb"] = _usage()[2]
        after = self._workers()
        if after:
            workers = {pid: cpu - before.get(pid, (0.0, 0.0))[0] for pid, (cpu, _) in after.items()}
            took["worker_cpu_s"] = sorted(workers.values())
            took["cpu_s"] += sum(workers.values())
            took["peak_mb"] = max(peak for _, peak in after.values())
            took["own_peak_mb"] = _usage()[2]


def _usage() -> tuple[int, float, float]:
    """Process id, processor seconds so far, and the most memory so far, MB."""
    return os.getpid(), time.process_time(), peak_mb()


class _Watched:
    """An executor whose pieces leave a line when they begin, and which counts the bytes that are sent."""

    def __init__(self, workers: Executor, log: Path, kill_after: int | None) -> None:
        self._workers, self._log, self._kill_after = workers, log, kill_after
        self._sent = self._returned = self._killed = 0
        log.parent.mkdir(parents=True, exist_ok=True)
        log.unlink(missing_ok=True)

    @property
    def count(self) -> int:
        return self._workers.count

    @property
    def dashboard(self) -> str:
        return ""

    def each(self, function: Any, shared: Any, items: Any, **more: Any) -> Iterator[tuple[int, Any]]:
        assert function is record_of
        self._sent = sum(len(pickle.dumps(item)) for item in items)
        for k, (number, result) in enumerate(self._workers.each(_logged, (str(self._log), shared), items, **more)):
            if isinstance(self._workers, Inline):
                self._returned += len(pickle.dumps(result))
            if k == self._kill_after and isinstance(self._workers, Dask):
                victim = next(iter(self._workers.client.run(os.getpid).values()))
                os.kill(victim, signal.SIGKILL)
                self._killed += 1
            yield number, result

    def figures(self, count: int) -> dict[str, Any]:
        begun = len(self._log.read_text(encoding="utf-8").splitlines())
        self._log.unlink()
        counts = {"begun": begun, "done_again": begun - count, "killed": self._killed, "item_bytes": self._sent / count}
        return counts | ({"result_bytes": self._returned / count} if self._returned else {})


def _logged(shared: tuple[str, BatchOptions], item: tuple[str, str]) -> Record:
    with open(shared[0], "a", encoding="utf-8") as log:  # a short line is written in one piece
        log.write(f"{item[0]}\n")
    return record_of(shared[1], item)


def _scheduler(workers: Dask) -> dict[str, Any]:
    """The time of a piece without work, wall and this process's, in which scheduler and client live."""
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    for _ in workers.each(_nothing, None, range(EMPTY_PIECES)):
        pass
    return {
        "scheduler_ms": 1e3 * (time.process_time() - cpu_s) / EMPTY_PIECES,
        "scheduler_wall_ms": 1e3 * (time.perf_counter() - wall_s) / EMPTY_PIECES,
    }


def _nothing(_: None, item: int) -> int:
    return item


def digest_of(out: Path) -> str:
    """The hash of all files of a directory, with their names."""
    total = hashlib.sha256()
    for file in sorted(p for p in out.rglob("*") if p.is_file()):
        total.update(file.relative_to(out).as_posix().encode() + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()


POINT_KINDS: dict[str, Callable[..., dict[str, Any]]] = {
    "batch": batch_point, "vehicles": vehicles_point, "zones": zones_point, "cells": cells_point,
}  # fmt: skip


def main() -> None:
    """Measure the point that the argument names, and print the figures as JSON."""
    request = json.loads(sys.argv[1])
    print(json.dumps(POINT_KINDS[request.pop("point")](**request)))


if __name__ == "__main__":
    main()
