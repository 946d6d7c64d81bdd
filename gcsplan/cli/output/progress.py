"""The state of work while it runs: of one planning (`planning_display`), and of many pieces of work (`WorkDisplay`).

A separate thread redraws elapsed time, best path, bound and gap. A planner reports only changes, and may search for
seconds without one; the shown time continues meanwhile. Of an executor's work there is a line from time to time.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rich.console import Console
from rich.live import Live
from rich.text import Text

from gcsplan.app.parallel.executor import Executor
from gcsplan.cli.output import console as words
from gcsplan.cli.output.console import aside, remark
from gcsplan.planners.problem import Progress, gap_percent

REDRAWN_HZ = 4.0
"""Redraws per second on a terminal."""
LINE_S = 5.0
"""Seconds between two lines if there is no terminal."""


class PlanningBoard:
    """The state of the planning of some vehicles, as one line. ``objective``: length, energy or time."""

    def __init__(self, names: Sequence[str], objective: str = "length") -> None:
        self._names = list(names)
        self._unit, self._per_unit = {"energy": ("kJ", 1e3), "time": ("s", 1.0)}.get(objective, ("m", 1.0))
        self._begun_s = time.perf_counter()
        self._who = ""
        self._last = Progress(0.0, None, None)
        self._notice = ""

    def report(self, who: str, progress: Progress) -> None:
        """Take a report of the planner of vehicle ``who``. A report without figures keeps the last ones."""
        last = self._last
        if who == self._who and progress.lower_bound is None and progress.cost is None:
            progress = Progress(progress.elapsed_s, last.cost, last.lower_bound, progress.phase)
        self._who, self._last, self._notice = who, progress, ""

    def note(self, sentence: str) -> None:
        """Show that something else is being done."""
        self._notice = sentence

    def line(self) -> str:
        """The vehicle that is being planned, the elapsed time, and how good the path is so far."""
        parts = [f"planning {self._who}".rstrip()]
        if len(self._names) > 1 and self._who in self._names:
            parts[0] += f" ({self._names.index(self._who) + 1} of {len(self._names)})"
        parts.append(f"{time.perf_counter() - self._begun_s:.1f} s")
        best, bound = self._last.cost, self._last.lower_bound
        if best is not None:
            parts.append(f"best {words.number(best / self._per_unit)} {self._unit}")
        if bound is not None:
            parts.append(f"bound {words.number(bound / self._per_unit)} {self._unit}")
        if (gap := gap_percent(best, bound)) is not None:
            parts.append(f"gap {gap:.2f} %")
        parts.append(self._notice or self._last.phase)
        return ", ".join(part for part in parts if part)


@contextmanager
def planning_display(names: Sequence[str], objective: str = "length") -> Iterator[Callable[[str, Progress], None]]:
    """Show the state of the planning of ``names``; yields a function to call with (vehicle, progress).

    On a terminal it is one line that is redrawn several times a second and disappears at the end; elsewhere a line on
    standard error every `LINE_S` seconds. The compilation of kernels, which happens once, is reported there at once.
    """
    from gcsplan.native.kernel_unit import compilation_reported

    board, screen = PlanningBoard(names, objective), aside
    if screen.is_terminal and not screen.is_dumb_terminal:
        with _redrawn(board, screen), compilation_reported(board.note):
            yield board.report
    else:
        with _repeated(board), compilation_reported(words.remark):
            yield board.report


def _redrawn(board: PlanningBoard, screen: Console) -> Live:
    def drawn() -> Text:
        return Text(board.line(), no_wrap=True, overflow="ellipsis")

    return Live(get_renderable=drawn, console=screen, refresh_per_second=REDRAWN_HZ, transient=True)


@contextmanager
def _repeated(board: PlanningBoard) -> Iterator[None]:
    ended = threading.Event()

    def repeat() -> None:
        while not ended.wait(LINE_S):
            words.remark(board.line())

    thread = threading.Thread(target=repeat, name="planning display", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


class WorkDisplay:
    """Lines of how much of a whole is done, on standard error, at most one every `LINE_S` seconds."""

    def __init__(self, whole: int, what: str) -> None:
        self._whole, self._what = whole, what
        self._begun_s = self._printed_s = time.perf_counter()

    @property
    def elapsed_s(self) -> float:
        """Seconds since the work began."""
        return time.perf_counter() - self._begun_s

    def workers(self, executor: Executor) -> None:
        """Say where the workers can be watched, if somewhere."""
        if executor.dashboard:
            remark(f"the workers can be watched at {executor.dashboard}")

    def done(self, count: int, more: str = "") -> None:
        """Take note that ``count`` of the whole are done; ``more`` follows in the line."""
        now_s = time.perf_counter()
        if now_s - self._printed_s >= LINE_S:
            self._printed_s = now_s
            remark(f"{count} of {self._whole} {self._what}{more}, {self.elapsed_s:.0f} s")
