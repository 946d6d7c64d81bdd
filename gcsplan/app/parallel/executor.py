"""Where independent work is done: in this process, in processes of this machine, or on a dask cluster.

The results are the same wherever it is done. Work is a function that can be imported, one value that all of it shares
(sent once to each worker), and an item for each piece.
"""

from __future__ import annotations

import math
import os
import queue
import signal
import sys
import threading
from abc import ABC
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Protocol, TypeVar
from uuid import uuid4

from gcsplan import __version__
from gcsplan.errors import GcsplanError, InputError, UsageError

__all__ = ["Executor", "Inline", "Lost", "Workers", "executor", "in_order", "require_same_inputs"]

Shared = TypeVar("Shared")
WorkItem = TypeVar("WorkItem")
WorkResult = TypeVar("WorkResult")

ANSWER_S = 15.0
"""Seconds within which a scheduler must answer."""

AHEAD = 2
"""Pieces that are handed out for each worker at a time, so that none waits, and little is lost if the work ends."""

LEAD = 8
"""How far results may run ahead of a piece that is slow, as a multiple of the pieces that are handed out: so many of
them at most wait to be put in order."""
LOOK_S, DESERTED_S = 2.0, 300.0
"""Seconds after which it is looked whether there still are workers, and for which a cluster may have none."""

JOB_BYTES = 2 << 30
"""Memory for each process of this machine, at least, if nobody says how many: a mission's budget and its terrain."""

KEPT_FREE_BYTES = 1 << 28
"""Most free memory that a process of this machine keeps."""

MOST_JOBS = 512
SILENT = 60
"""Level of the logs of dask's own processes: above all, since what matters is raised here."""

SCHEDULER_ENDED = "the dask scheduler has ended, or does not answer any more"
MISSING = "needs dask.distributed, which is not installed: pip install 'gcsplan[cluster]'"


Lost = Callable[[WorkItem, GcsplanError], WorkResult]
"""The result of a piece that no worker outlives."""


class Workers(ABC):  # noqa: B024 - it knows its instances by what they have
    """Objects that stand for workers: a client or a cluster of dask, or an `Executor`."""

    @classmethod
    def __subclasshook__(cls, kind: type) -> bool:
        return any(hasattr(kind, name) for name in ("scheduler_info", "scheduler_address", "each"))


class Executor(Protocol):
    """Does pieces of work."""

    @property
    def count(self) -> int:
        """How many pieces are done at the same time."""
        ...

    @property
    def dashboard(self) -> str:
        """Address of the page that shows what the workers do; empty if there is none."""
        ...

    def each(
        self, function: Callable[[Shared, WorkItem], WorkResult], shared: Shared, items: Sequence[WorkItem], *,
        lost: Lost[WorkItem, WorkResult] | None = None, finish: bool = False,
    ) -> Iterator[tuple[int, WorkResult]]:  # fmt: skip
        """Yield (number of the item, result) as results come; the order is free.

        An error of ``function`` is raised, and what still waits is given up. A piece whose worker dies is done again;
        if workers die over it again and again, ``lost(item, error)`` is its result, or without ``lost`` the
        GcsplanError is raised, after all others are done. With ``finish``, Ctrl-C gives up what waits, but what workers
        have begun is finished and yielded before KeyboardInterrupt is raised; a second Ctrl-C ends at once.

        Raises InputError if the cluster ends or stays without workers.
        """
        ...


@dataclass(frozen=True, slots=True)
class Inline:
    """Does the work in this process, in order."""

    @property
    def count(self) -> int:
        """See `Executor.count`."""
        return 1

    @property
    def dashboard(self) -> str:
        """See `Executor.dashboard`."""
        return ""

    def each(
        self, function: Callable[[Shared, WorkItem], WorkResult], shared: Shared, items: Sequence[WorkItem], *,
        lost: Lost[WorkItem, WorkResult] | None = None, finish: bool = False,
    ) -> Iterator[tuple[int, WorkResult]]:  # fmt: skip
        """See `Executor.each`."""
        for number, item in enumerate(items):
            yield number, function(shared, item)


@dataclass(frozen=True, slots=True)
class Dask:
    """Does the work with the workers of a dask client; a piece whose worker dies is done again by another."""

    client: Any

    @property
    def dashboard(self) -> str:
        """See `Executor.dashboard`; it needs the library bokeh."""
        return str(self.client.dashboard_link or "") if find_spec("bokeh") else ""

    @property
    def count(self) -> int:
        """See `Executor.count`."""
        return max(1, int(sum(self.client.nthreads().values())))

    def each(
        self, function: Callable[[Shared, WorkItem], WorkResult], shared: Shared, items: Sequence[WorkItem], *,
        lost: Lost[WorkItem, WorkResult] | None = None, finish: bool = False,
    ) -> Iterator[tuple[int, WorkResult]]:  # fmt: skip
        """See `Executor.each`."""
        suspects: list[int] = []
        yield from self._together(function, shared, items, range(len(items)), suspects, finish)
        # A dead worker is blamed on every piece that it had been given: alone, each shows whether it is to blame.
        for number in suspects:
            guilty: list[int] = []
            yield from self._together(function, shared, items, [number], guilty, finish)
            if guilty:
                error = GcsplanError(
                    f"workers died over piece {number + 1} of {len(items)} again and again; did it need more memory "
                    "than a worker has? Fewer processes (--jobs) have more each"
                )
                if lost is None:
                    raise error
                yield number, lost(items[number], error)

    def _together(
        self, function: Callable[[Shared, WorkItem], WorkResult], shared: Shared, items: Sequence[WorkItem],
        pending: Sequence[int], suspects: list[int], finish: bool,
    ) -> Iterator[tuple[int, WorkResult]]:  # fmt: skip
        """The results of the pieces ``pending``; ``suspects`` gets the pieces whose workers died too often."""
        distributed = import_module("distributed")
        client = self.client
        # A task, not scattered data: if the worker that holds the value dies, the scheduler makes it again.
        kept = client.submit(_itself, shared, pure=False)
        name = function.__name__  # the scheduler knows by the name how long such pieces take, and spreads them by it
        numbers: dict[Any, int] = {}
        begun, most = 0, AHEAD * self.count
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()

        def hand_out() -> None:
            nonlocal begun
            first = min(numbers.values(), default=pending[begun] if begun < len(pending) else 0)
            while begun < len(pending) and pending[begun] < first + LEAD * most and len(numbers) < most:
                number, begun = pending[begun], begun + 1
                future = client.submit(
                    piece_done,
                    function,
                    __version__,
                    kept,
                    items[number],
                    key=f"{name}-{uuid4().hex}",
                    priority=-number,
                )
                numbers[future] = number
                future.add_done_callback(done.put)

        stopped = False
        try:
            hand_out()
            while numbers:
                try:
                    future = self._next(done)
                except KeyboardInterrupt:
                    if stopped or not finish:
                        raise
                    stopped = True
                    self.keep_begun(numbers)
                    continue
                number = numbers.pop(future, None)
                if number is None:  # given up
                    continue
                try:
                    answers = [future.result()]
                except distributed.KilledWorker:
                    suspects.append(number)
                    answers = []
                except distributed.CancelledError as error:
                    raise InputError(SCHEDULER_ENDED) from error
                if not stopped:
                    hand_out()
                for result in answers:
                    yield number, result
            if stopped:
                raise KeyboardInterrupt
        finally:
            if client.status == "running":
                client.cancel([kept, *numbers])

    def keep_begun(self, numbers: dict[Any, int]) -> None:
        """Give up the pieces that no worker has begun."""
        # Called for all pieces: with the name of a piece that the scheduler does not know yet, the call fails.
        begun = {key for stacks in self.client.call_stack().values() for key in stacks}
        waiting = [f for f in numbers if not f.done() and f.key not in begun]
        for future in waiting:
            del numbers[future]
        self.client.cancel(waiting)

    def _next(self, done: queue.SimpleQueue[Any]) -> Any:
        """The next piece that is done. Raises InputError if there has been nobody for too long who could do one."""
        deserted_s = 0.0
        while True:
            try:
                return done.get(timeout=LOOK_S)
            except queue.Empty:
                pass
            if self.client.status != "running":
                raise InputError(SCHEDULER_ENDED)
            deserted_s = 0.0 if self.client.nthreads() else deserted_s + LOOK_S
            if deserted_s > DESERTED_S:
                raise InputError(f"the dask scheduler has had no worker for {DESERTED_S:g} s: start some")


def piece_done(
    function: Callable[[Shared, WorkItem], WorkResult], version: str, shared: Shared, item: WorkItem
) -> WorkResult:
    """A piece of work, if the worker has the version of gcsplan that asks for it."""
    if version != __version__:
        raise InputError(
            f"a worker of the cluster has gcsplan {__version__}, and this is {version}: install one version on all of "
            f"its machines"
        )
    return function(shared, item)


def in_order(results: Iterable[tuple[int, WorkResult]]) -> Iterator[tuple[int, WorkResult]]:
    """The results of `Executor.each` by number, from 0 on; early results wait."""
    early: dict[int, WorkResult] = {}
    next_number = 0
    for number, result in results:
        early[number] = result
        while next_number in early:
            yield next_number, early.pop(next_number)
            next_number += 1


def require_same_inputs(found: Mapping[str, object], expected: Mapping[str, object], where: str) -> None:
    """Raise InputError if a worker's terrain or zones differ from the terrain or zones of the process that asks it."""
    other = sorted(k for k in {*found, *expected} if found.get(k) != expected.get(k))
    if other:
        raise InputError(
            f"a worker reads other terrain or zones than the process that asks it ({', '.join(other)} differ): every "
            f"machine of the cluster must see the same files under the same paths",
            where=where,
        )


def _itself(value: Shared) -> Shared:
    """A value as the result of a task."""
    return value


def sane_jobs() -> int:
    """Processes for ``--jobs`` if it is not given: one for each core of this process, as far as the memory reaches."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not on every system
        return cores
    return max(1, min(cores, memory // JOB_BYTES))


@contextmanager
def executor(
    jobs: int | None = None, cluster: Any = None, *, pieces: int, piece_s: float, start_s: float = 4.0
) -> Iterator[Executor]:
    """The executor for ``pieces`` of work of about ``piece_s`` seconds each; one piece is done in this process.

    ``cluster`` is the address of a dask scheduler, the file that describes it (``dask scheduler --scheduler-file``),
    one of dask's cluster objects, or a ``distributed.Client``; its workers do the work. It may be an `Executor` of the
    caller's own, too. Otherwise ``jobs`` processes of this machine do it (None: one for each core), if what they gain
    is more than the ``start_s`` seconds that it takes to start them; else this process alone does, and dask is not
    imported.

    Raises InputError if dask is not installed and needed, or if no scheduler answers, UsageError for wrong ``jobs``.
    """
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        raise UsageError(f"--jobs {jobs}: give 1 to {MOST_JOBS} processes")
    if pieces <= 1:
        yield Inline()
        return
    if hasattr(cluster, "each"):
        yield cluster
        return
    if cluster is not None:
        with _connected(cluster) as client:
            yield Dask(client)
        return
    count = min(sane_jobs() if jobs is None else jobs, max(1, pieces))
    gain_s = pieces * piece_s - math.ceil(pieces / count) * piece_s
    if count == 1 or gain_s <= start_s or (jobs is None and find_spec("distributed") is None):
        yield Inline()
        return
    with _processes(count) as client:
        yield Dask(client)


def _distributed(option: str) -> Any:
    try:
        return import_module("distributed")
    except ImportError:
        raise InputError(f"{option} {MISSING}") from None


@contextmanager
def _connected(cluster: Any) -> Iterator[Any]:
    distributed = _distributed("--cluster")
    if isinstance(cluster, distributed.Client):
        yield cluster
        return
    named = isinstance(cluster, str) and os.path.isfile(cluster)
    where = {"scheduler_file": cluster} if named else {"address": cluster}
    try:
        client = distributed.Client(**where, timeout=ANSWER_S, set_as_default=False)
    # TimeoutError is an OSError; TLS without keys is a TypeError.
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"no dask scheduler answers: {error}", where=f"--cluster {cluster}") from error
    try:
        if not client.nthreads():
            _wait_for_workers(client, cluster)
        yield client
    finally:
        client.close()


def _wait_for_workers(client: Any, cluster: Any) -> None:
    try:
        client.wait_for_workers(1, timeout=ANSWER_S)
    except TimeoutError:
        words = f"the dask scheduler has had no worker for {ANSWER_S:g} s: start some (dask worker ADDRESS)"
        raise InputError(words, where=f"--cluster {cluster}") from None


@contextmanager
def _processes(count: int) -> Iterator[Any]:
    """Workers of this machine, one thread each; their scheduler listens on the loopback address alone.

    Each may take its share of the memory. Above it the worker is ended; it is never halted, since a planner's memory
    does not shrink while it waits. A worker that ends is started again, as often as it takes.
    """
    distributed = _distributed("--jobs")
    settings: dict[str, object] = {f"distributed.worker.memory.{key}": False for key in ("target", "spill", "pause")}
    settings["distributed.deploy.lost-worker-timeout"] = "1 day"
    settings["distributed.worker.profile.enabled"] = False  # it takes a fifth of a worker's time
    # dask gives freed memory back at once; with this, the allocator keeps it for the next large array.
    settings["distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_"] = KEPT_FREE_BYTES
    settings["distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_"] = KEPT_FREE_BYTES // 8
    with import_module("dask").config.set(settings):
        try:
            with _deaf():
                local = distributed.LocalCluster(
                    n_workers=count, threads_per_worker=1, processes=True, host="127.0.0.1",
                    dashboard_address="127.0.0.1:0", memory_limit=1.0 / count, silence_logs=SILENT,
                )  # fmt: skip
        except RuntimeError as error:
            words = (
                "the processes of --jobs do not start; a script that asks for them needs `if __name__ == '__main__':`"
            )
            raise GcsplanError(f"{words} ({error})") from error
        with local, distributed.Client(local, set_as_default=False) as client:
            try:
                yield client
            except BaseException:
                for nanny in local.workers.values():
                    nanny.auto_restart = False
                end_processes()
                raise


def end_processes() -> None:
    """End the processes that this one has started in the middle of their work, for which dask would wait."""
    started = sys.modules.get("multiprocessing")  # who has not imported it has started none
    for process in started.active_children() if started else ():
        process.kill()


@contextmanager
def _deaf() -> Iterator[None]:
    """Processes that are started here do not hear Ctrl-C: this process ends them, without a traceback from each."""
    if hasattr(signal, "pthread_sigmask"):
        # The block holds for this thread, its children and their processes; other threads still hear Ctrl-C.
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        return
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
