"""How far the work of an executor is: a line from time to time, and where its workers can be watched."""

from __future__ import annotations

import time

from gcsplan.app.parallel.executor import Executor
from gcsplan.cli.output.console import remark

LINE_S = 5.0
"""Seconds between two lines."""


class WorkDisplay:
    """Lines of how much of a whole is done, on standard error, at most one every `LINE_S` seconds."""

    def __init__(self, whole: int, what: str) -> None:
        self._whole, self._what = whole, what
        self._begun_s = self._said_s = time.perf_counter()

    @property
    def elapsed_s(self) -> float:
        """Seconds since the work began."""
        return time.perf_counter() - self._begun_s

    def workers(self, executor: Executor) -> None:
        """Say where the workers can be watched, if somewhere."""
        if executor.dashboard:
            remark(f"the workers can be watched at {executor.dashboard}")

    def done(self, count: int, more: str = "") -> None:
        """Take note that ``count`` of the whole are done; ``more`` is said of them."""
        now_s = time.perf_counter()
        if now_s - self._said_s >= LINE_S:
            self._said_s = now_s
            remark(f"{count} of {self._whole} {self._what}{more}, {self.elapsed_s:.0f} s")
