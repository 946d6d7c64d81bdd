"""How planning stands: redrawn on a terminal though the planner is silent, a line now and then elsewhere.

How far the work of an executor is: a line from time to time on standard error, whatever is done in between.
"""

from __future__ import annotations

import io
import json
import re
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from gcsplan.cli import command_table as commands
from gcsplan.cli.output import console as words
from gcsplan.cli.output import progress as display
from gcsplan.cli.output.progress import LINE_S, PlanningBoard, WorkDisplay, planning_display
from gcsplan.planners.problem import Progress
from tests.support.paths import MISSIONS

SHOWN = re.compile(r"planning [^\r\n\x1b]*")


def screen(monkeypatch: pytest.MonkeyPatch, *, terminal: bool, width: int = 100) -> io.StringIO:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    shown = io.StringIO()
    screen = Console(file=shown, force_terminal=terminal, width=width)
    for module in (display, words):
        monkeypatch.setattr(module, "aside", screen)
    return shown


def wait_until(seen: Callable[[], object]) -> None:
    """Wait for what a thread shows: a fraction of a second, far longer on a busy machine, never without end."""
    until = time.monotonic() + 60.0
    while not seen():
        assert time.monotonic() < until
        time.sleep(0.01)


def test_while_the_planner_is_silent_a_terminal_shows_the_time_twice_a_second(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert display.REDRAWN_HZ >= 2.0
    shown = screen(monkeypatch, terminal=True)

    def times() -> set[str]:
        return set(re.findall(r"planning uav1, ([\d.]+) s", shown.getvalue()))

    with planning_display(["uav1"]) as report:
        report("uav1", Progress(0.0, 20_134.0, 20_120.0, "bound"))
        wait_until(lambda: len(times()) >= 4)
    lines = SHOWN.findall(shown.getvalue())
    assert re.search(r"best 20\u2009134 m, bound 20\u2009120 m, gap 0\.07 %, bound", lines[1]), lines


def test_the_line_is_gone_when_planning_is_done_or_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    for fails in (False, True):
        shown = screen(monkeypatch, terminal=True)
        try:
            with planning_display(["uav1"]) as report:
                report("uav1", Progress(0.0, None, 20_120.0, "search"))
                wait_until(lambda: "search" in shown.getvalue())  # noqa: B023, waited for in this round
                assert not fails
        except AssertionError:
            assert fails
        assert shown.getvalue().rstrip("\r").endswith("\x1b[2K")


def test_one_line_even_on_a_narrow_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = screen(monkeypatch, terminal=True, width=30)
    with planning_display(["a" * 60, "uav2"]) as report:
        report("a" * 60, Progress(0.0, 1.0, 1.0, "search"))
        wait_until(lambda: len(SHOWN.findall(shown.getvalue())) >= 3)
    assert max(len(line) for line in SHOWN.findall(shown.getvalue())) <= 30
    assert "\x1b[1A" not in shown.getvalue().split("\x1b[?25h")[0]  # never up over a second line


def test_no_color_is_respected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("NO_COLOR", "1")
    shown = io.StringIO()
    screen = Console(file=shown, force_terminal=True, width=100)
    for module in (display, words):
        monkeypatch.setattr(module, "aside", screen)
    with planning_display(["uav1"]) as report:
        report("uav1", Progress(0.0, 2.0, 1.0, "bound"))
        wait_until(lambda: "bound" in shown.getvalue())
    assert SHOWN.search(shown.getvalue())
    assert re.search(r"\x1b\[[\d;]*m", shown.getvalue()) is None


@pytest.mark.slow
def test_elsewhere_there_is_a_line_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    assert display.LINE_S == 5.0
    monkeypatch.setattr(display, "LINE_S", 0.2)
    shown = screen(monkeypatch, terminal=False)
    with planning_display(["uav1", "uav2", "uav3"], "energy") as report:
        report("uav2", Progress(0.0, 2_040_000.0, 2_000_000.0, "improve"))
        begun = time.monotonic()
        wait_until(lambda: shown.getvalue().count("\n") >= 3)
        took_s = time.monotonic() - begun
    after = shown.getvalue()
    lines = after.splitlines()
    assert 3 <= len(lines) <= 1 + took_s / display.LINE_S + 1
    assert re.fullmatch(
        r"planning uav2 \(2 of 3\), \d\.\d s, best 2\u2009040 kJ, bound 2\u2009000 kJ, gap 2\.00 %, improve", lines[-1]
    )
    time.sleep(0.3)
    assert shown.getvalue() == after
    assert "\x1b" not in after


def test_a_dumb_terminal_gets_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(display, "LINE_S", 0.1)
    shown = screen(monkeypatch, terminal=True)
    monkeypatch.setenv("TERM", "dumb")
    with planning_display(["uav1"]):
        wait_until(lambda: "\n" in shown.getvalue())
    assert re.search(r"planning, .*\d\.\d.* s\n", shown.getvalue())
    assert "\x1b[2K" not in shown.getvalue()


def test_another_vehicle_does_not_inherit_figures() -> None:
    board = PlanningBoard(["uav1", "uav2"])
    board.report("uav1", Progress(0.0, 500.0, 400.0, "improve"))
    board.report("uav1", Progress(0.0, None, None, "search"))
    assert "best 500 m, bound 400 m, gap 25.00 %, search" in board.line()
    board.note("compiling the kernels")
    assert board.line().endswith("compiling the kernels")
    board.report("uav2", Progress(0.0, None, None, "search"))
    assert "best" not in board.line()
    assert board.line().startswith("planning uav2 (2 of 2), ")


@pytest.mark.nightly
def test_lines_go_to_standard_error_and_the_document_to_standard_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(display, "LINE_S", 0.02)
    reported, line, lines = PlanningBoard.report, PlanningBoard.line, list[str]()

    def kept(board: PlanningBoard) -> str:
        lines.append(line(board))
        return lines[-1]

    def report_and_wait(board: PlanningBoard, who: str, progress: Progress) -> None:
        reported(board, who, progress)
        wait_until(lambda: any(f"planning {who} " in shown for shown in lines))

    monkeypatch.setattr(PlanningBoard, "line", kept)
    monkeypatch.setattr(PlanningBoard, "report", report_and_wait)
    arguments = ["plan", str(MISSIONS / "fleet-4.yaml"), "-o", str(tmp_path / "out"), "--json"]
    assert commands.app(args=arguments, standalone_mode=False) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["planner"] == "optimal"
    assert {f"uav{k} ({k} of 4)" for k in (1, 4)} <= {
        line.split(", ")[0].removeprefix("planning ") for line in err.splitlines()
    }


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The display's clock, which stands still until it is set."""
    now = SimpleNamespace(s=100.0)
    monkeypatch.setattr(display, "time", SimpleNamespace(perf_counter=lambda: now.s))
    return now


def test_a_line_is_said_every_few_seconds_and_not_more_often(capfd: Any, clock: SimpleNamespace) -> None:
    display = WorkDisplay(40, "missions")
    for count in range(40):
        clock.s = 100.0 + 0.5 * count
        display.done(count, ", 3 refused")
    out, err = capfd.readouterr()
    assert out == ""
    assert [int(s) for s in re.findall(r"of 40 missions, 3 refused, (\d+) s", err)] == [5, 10, 15]
    assert re.findall(r"(\d+) of 40", err) == ["10", "20", "30"]
    assert LINE_S == 5.0
    assert display.elapsed_s == 19.5


def test_where_workers_can_be_watched_is_said_if_there_is_a_place(capfd: Any) -> None:
    display = WorkDisplay(1, "missions")
    display.workers(SimpleNamespace(dashboard=""))  # type: ignore[arg-type]
    assert capfd.readouterr().err == ""
    display.workers(SimpleNamespace(dashboard="http://127.0.0.1:8787"))  # type: ignore[arg-type]
    assert "can be watched at http://127.0.0.1:8787" in capfd.readouterr().err
