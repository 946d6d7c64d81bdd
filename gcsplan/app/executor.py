"""Where independent work is done: in this process, in processes of this machine, or on a dask cluster.

The results are the same wherever it is done. Work is a function that can be imported, one value that all of it shares
(sent once to each worker), and an item for each piece.
"""

from __future__ import annotations

import math
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Protocol, TypeVar

from gcsplan import __version__
from gcsplan.errors import GcsplanError, InputError, UsageError

__all__ = ["Executor", "Inline", "executor", "in_order", "require_same_inputs"]

Shared = TypeVar("Shared")
Item = TypeVar("Item")
Result = TypeVar("Result")

ANSWER_S = 15.0
"""Seconds within which a scheduler must answer."""

AHEAD = 4
"""Pieces that are handed out for each worker at a time, so that none waits, and little is lost if the work ends."""

LEAD = 8
"""How far results may run ahead of a piece that is slow, as a multiple of the pieces that are handed out: so many of
them at most wait to be put in order."""

MOST_JOBS = 512
SILENT = 60
"""Level of the logs of dask's own processes: above all, since what matters is raised here."""

MISSING = "needs dask.distributed, which is not installed: pip install 'gcsplan[cluster]'"


class Executor(Protocol):
    """Does pieces of work."""

    def each(
        self, function: Callable[[Shared, Item], Result], shared: Shared, items: Sequence[Item]
    ) -> Iterator[tuple[int, Result]]:
        """Yield (number of the item, result) as results come; the order is free.

        An error of ``function`` is raised, and what still waits is given up. Raises GcsplanError if a worker dies over
        the same piece again and again.
        """
        ...


@dataclass(frozen=True, slots=True)
class Inline:
    """Does the work in this process, in order."""

    def each(
        self, function: Callable[[Shared, Item], Result], shared: Shared, items: Sequence[Item]
    ) -> Iterator[tuple[int, Result]]:
        """See `Executor.each`."""
        for number, item in enumerate(items):
            yield number, function(shared, item)


@dataclass(frozen=True, slots=True)
class Dask:
    """Does the work with the workers of a dask client; a piece whose worker dies is done again by another."""

    client: Any

    @property
    def dashboard(self) -> str:
        """Address of the page that shows what the workers do; empty if its library is not installed."""
        return str(self.client.dashboard_link or "") if find_spec("bokeh") else ""

    @property
    def count(self) -> int:
        """How many pieces are done at the same time."""
        return max(1, int(sum(self.client.nthreads().values())))

    def each(
        self, function: Callable[[Shared, Item], Result], shared: Shared, items: Sequence[Item]
    ) -> Iterator[tuple[int, Result]]:
        """See `Executor.each`."""
        distributed = import_module("distributed")
        client = self.client
        # A task, not scattered data: if the worker that holds the value dies, the scheduler makes it again.
        kept = client.submit(_itself, shared, pure=False)
        numbers: dict[Any, int] = {}
        begun, most = 0, AHEAD * self.count
        done = distributed.as_completed(loop=client.loop)

        def hand_out() -> None:
            nonlocal begun
            while begun < min(len(items), min(numbers.values(), default=begun) + LEAD * most) and len(numbers) < most:
                future = client.submit(_done, function, __version__, kept, items[begun], pure=False, priority=-begun)
                numbers[future] = begun
                begun += 1
                done.add(future)

        try:
            hand_out()
            for future in done:
                number = numbers.pop(future)
                try:
                    result = future.result()
                except distributed.KilledWorker as error:
                    raise GcsplanError(
                        f"workers died over piece {number + 1} of {len(items)} again and again (out of memory?)"
                    ) from error
                hand_out()
                yield number, result
        finally:
            client.cancel([kept, *numbers])


def _done(function: Callable[[Shared, Item], Result], version: str, shared: Shared, item: Item) -> Result:
    """A piece of work, if the worker has the version of gcsplan that asks for it."""
    if version != __version__:
        raise InputError(
            f"a worker of the cluster has gcsplan {__version__}, and this is {version}: install one version on all of "
            f"its machines"
        )
    return function(shared, item)


def in_order(results: Iterable[tuple[int, Result]]) -> Iterator[tuple[int, Result]]:
    """The results of `Executor.each` by number, from 0 on; those that come early wait."""
    early: dict[int, Result] = {}
    wanted = 0
    for number, result in results:
        early[number] = result
        while wanted in early:
            yield wanted, early.pop(wanted)
            wanted += 1


def require_same_inputs(found: Mapping[str, object], asked: Mapping[str, object], where: str) -> None:
    """Raise InputError if a worker's terrain or zones are others than those of the process that asks it."""
    other = sorted(k for k in {*found, *asked} if found.get(k) != asked.get(k))
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
    """Processes for ``--jobs`` if it is not given: as many as there are cores for this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


@contextmanager
def executor(
    jobs: int | None = None, cluster: Any = None, *, pieces: int, piece_s: float, start_s: float = 4.0
) -> Iterator[Executor]:
    """The executor for ``pieces`` of work of about ``piece_s`` seconds each; one piece is done in this process.

    ``cluster`` is the address of a dask scheduler or a ``distributed.Client``, whose workers do the work. Otherwise
    ``jobs`` processes of this machine do it (None: one for each core), if what they gain is more than the ``start_s``
    seconds that it takes to start them; else this process alone does, and dask is not imported.

    Raises InputError if dask is not installed and needed, or if no scheduler answers, UsageError for wrong ``jobs``.
    """
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        raise UsageError(f"--jobs {jobs}: 1 to {MOST_JOBS} processes are wanted")
    if pieces <= 1:
        yield Inline()
        return
    if cluster is not None:
        with _connected(cluster) as client:
            yield Dask(client)
        return
    count = min(sane_jobs() if jobs is None else jobs, max(1, pieces))
    gain_s = pieces * piece_s - math.ceil(pieces / count) * piece_s
    if count == 1 or gain_s <= start_s or (jobs is None and not _installed()):
        yield Inline()
        return
    with _processes(count) as client:
        yield Dask(client)


def _installed() -> bool:
    return find_spec("distributed") is not None


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
    try:
        client = distributed.Client(cluster, timeout=ANSWER_S, set_as_default=False)
    except (OSError, ValueError) as error:  # TimeoutError is an OSError
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
    """Workers of this machine, one thread each; their scheduler listens on the loopback address alone."""
    distributed = _distributed("--jobs")
    try:
        with _deaf():
            local = distributed.LocalCluster(
                n_workers=count, threads_per_worker=1, processes=True, host="127.0.0.1",
                dashboard_address="127.0.0.1:0", memory_limit=0, silence_logs=SILENT,
            )  # fmt: skip
    except RuntimeError as error:
        words = "the processes of --jobs do not start; a script that asks for them needs `if __name__ == '__main__':`"
        raise GcsplanError(f"{words} ({error})") from error
    with local, distributed.Client(local, set_as_default=False) as client:
        yield client


@contextmanager
def _deaf() -> Iterator[None]:
    """Processes that are started here do not hear Ctrl-C: this process ends them, without a traceback from each."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
