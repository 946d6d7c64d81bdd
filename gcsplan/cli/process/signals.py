"""A signal ends a command within a second, also while a library or a kernel computes.

Python handles a signal between two of its own instructions. Geometry, terrain and planning run for seconds in code of
other languages, between which Python does nothing. So a second thread hears each signal as well: if Python has not
handled it `PATIENCE_S` later, that thread ends the process, with the same message and the same exit code. It waits as
long as files are being written: they are finished or undone first.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress

PATIENCE_S = 0.5
"""Seconds that Python has to handle a signal itself."""

LOOK_S = 0.05

LATE_S = 0.2
"""A look that comes this late was kept from looking, as Python was from handling signals."""


class SignalWatch:
    """Hears signals beside Python's handlers, which call `heard`. ``end(number)`` must end the process."""

    def __init__(self, end: Callable[[int], None]) -> None:
        self._end = end
        self._handled = 0
        self._reading, self._writing = os.pipe()
        os.set_blocking(self._writing, False)
        signal.set_wakeup_fd(self._writing, warn_on_full_buffer=False)
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=_deaf)
        threading.Thread(target=self._run, name="signals", daemon=True).start()

    def heard(self) -> None:
        """Note that Python handles a signal: the process ends by itself."""
        self._handled += 1

    def _run(self) -> None:
        while True:
            before = self._handled
            for number in os.read(self._reading, 64):
                if number in ENDING and self._is_lost(before):
                    self._end(number)

    def _is_lost(self, before: int) -> bool:
        """Whether Python does not handle the signal; returns once it does, or once that is known."""
        # Looks in time are counted, not seconds: where code kept Python from all of its threads meanwhile, or the
        # machine this process from running, the time is over before Python had a turn to handle the signal.
        looks = 0
        while self._handled == before:
            if looks * LOOK_S >= PATIENCE_S and not _writes():
                return True
            begun = time.monotonic()
            time.sleep(LOOK_S)
            looks += time.monotonic() - begun < LATE_S
        return False


ENDING = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)}


def _writes() -> bool:
    """Whether files are being written. What writes files takes long to import, and may not be imported yet."""
    durable = sys.modules.get("gcsplan.export.durable")
    return bool(durable is not None and getattr(durable, "in_progress", 0))


def _deaf() -> None:
    """A forked child would tell the parent of its own signals."""
    with suppress(ValueError):  # not in the main thread: it has no handlers either
        signal.set_wakeup_fd(-1)
