"""`VehicleDesk`: the one thread of the page that talks with vehicles, so that no two conversations share a link.

It does one task at a time. Between tasks it listens to the vehicles that the user connected; a task ends that, and it
begins again behind the task. `stop` ends a task as Ctrl-C ends a command: the vehicle is informed, nothing more is
sent.
"""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

from gcsplan.errors import Cancelled, GcsplanError, cancelled_by
from gcsplan.mavlink.mission.mission import Mission

DeskTask = Callable[[], dict[str, Any]]
"""Talks with vehicles, and returns its answer to the page."""
Listen = Callable[[], None]

MOST_SIMULATED = 4
"""Most groups of simulated vehicles that run at once."""

_log = logging.getLogger(__name__)


class VehicleDesk:
    """``answered`` takes the answer of each task, once another may begin; ``failed`` an error that ends listening.

    Both are called from the desk's thread.
    """

    def __init__(self, answered: Callable[[dict[str, Any]], None], failed: Callable[[GcsplanError], None]) -> None:
        self._answered, self._failed = answered, failed
        self._tasks: queue.SimpleQueue[DeskTask | None] = queue.SimpleQueue()
        self._listen: Listen | None = None
        self._busy = self._stopping = False
        self._lock = threading.Lock()
        self._simulated: dict[tuple[object, ...], tuple[ExitStack, str]] = {}
        self._thread = threading.Thread(target=self._run, name="vehicles", daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """Whether a task waits or runs."""
        return self._busy

    def do(self, task: DeskTask) -> bool:
        """Run a task next; False if there is one already."""
        with self._lock:
            if self._busy:
                return False
            self._busy, self._stopping = True, False
        self._tasks.put(task)
        return True

    def stop(self) -> None:
        """End the task that runs or waits, as Ctrl-C would; it says what that left behind."""
        with self._lock:
            self._stopping = self._busy

    def listen(self, listen: Listen | None) -> None:
        """Call ``listen`` whenever there is no task, until another one is given; it ends when it is cancelled."""
        self._listen = listen
        self._tasks.put(_nothing)

    def close(self) -> None:
        """Stop all, and wait for the end."""
        self.stop()
        self._listen = None
        self._tasks.put(None)
        self._thread.join()

    @contextmanager
    def simulator(self, missions: Sequence[Mission]) -> Iterator[str]:
        """A `run.Simulator` whose vehicles stay, with what they hold, as long as their missions begin at one place."""
        from gcsplan.sim.vehicle.server import loopback_fleet

        seats = tuple((m.name, m.sysid, m.autopilot, m.home) for m in missions)
        if seats not in self._simulated:
            while len(self._simulated) >= MOST_SIMULATED:
                self._simulated.pop(next(iter(self._simulated)))[0].close()
            stack = ExitStack()
            self._simulated[seats] = stack, stack.enter_context(loopback_fleet(missions))
        yield self._simulated[seats][1]

    def _run(self) -> None:
        while True:
            try:
                task = self._tasks.get(block=self._listen is None)
            except queue.Empty:
                self._listen_now()
                continue
            if task is None:
                break
            if task is _nothing:
                continue
            try:
                with cancelled_by(lambda: self._stopping):
                    answer = task()
            finally:
                with self._lock:
                    self._busy = False
            self._answered(answer)
        for stack, _ in self._simulated.values():
            stack.close()

    def _listen_now(self) -> None:
        listen = self._listen
        if listen is None:
            return
        try:
            with cancelled_by(lambda: not self._tasks.empty()):
                listen()
        except Cancelled:
            pass
        except GcsplanError as why:
            self._listen = None
            self._failed(why)
        except Exception as why:
            _log.exception("listening to vehicles failed")
            self._listen = None
            self._failed(GcsplanError(f"a bug of gcsplan: {why!r}"))


def _nothing() -> dict[str, Any]:
    """No task: it wakes the desk."""
    return {}
