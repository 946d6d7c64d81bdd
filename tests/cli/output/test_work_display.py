"""How far work is: a line from time to time on standard error, whatever is done in between."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import pytest

from gcsplan.cli.output import work_display
from gcsplan.cli.output.work_display import LINE_S, WorkDisplay


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The display's clock, which stands still until it is set."""
    now = SimpleNamespace(s=100.0)
    monkeypatch.setattr(work_display, "time", SimpleNamespace(perf_counter=lambda: now.s))
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
