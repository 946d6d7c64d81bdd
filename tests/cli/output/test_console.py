"""What the terminal shows of a large fleet: a line for each vehicle, few names in a line, one bar for all transfers."""

from __future__ import annotations

import io
from typing import Any

import pytest
from rich.console import Console

from gcsplan.app.fleet.pipeline import plan
from gcsplan.cli.output import console
from gcsplan.mavlink.protocol.machine import TransferProgress
from tests.support.noted import saying


def fleet(count: int) -> dict[str, Any]:
    vehicles = [
        {
            "name": f"uav{k:03d}", "sysid": k + 1, "autopilot": "arducopter", "speed_m_s": [3, 15],
            "start": {"east_m": 0, "north_m": 100 * k}, "goal": {"east_m": 400, "north_m": 100 * k},
        }
        for k in range(count)
    ]  # fmt: skip
    return {
        "version": 1, "terrain": {"flat_m": 100}, "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        "limits": {"min_agl_m": 30}, "vehicles": vehicles, "arrival": {"mode": "sequence", "interval_s": 2},
    }  # fmt: skip


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> tuple[io.StringIO, io.StringIO]:
    out, err = io.StringIO(), io.StringIO()
    for name, file in (("console", out), ("aside", err)):
        monkeypatch.setattr(console, name, Console(file=file, width=130, highlight=False, soft_wrap=True))
    return out, err


@pytest.mark.slow
def test_each_vehicle_of_a_large_fleet_has_one_line(shown: tuple[io.StringIO, io.StringIO]) -> None:
    out, _ = shown
    console.plan_table(plan(fleet(31)), {})
    lines = out.getvalue().splitlines()
    for k in range(31):
        [line] = [words for words in lines if words.startswith(f"uav{k:03d} ")]
        assert "safe" in line
        assert len(line) <= 130


def test_names_and_notes_of_a_thousand_are_few_lines(shown: tuple[io.StringIO, io.StringIO]) -> None:
    _, err = shown
    names = [f"uav{k:04d}" for k in range(1000)]
    assert console.names_of(names[:110]) == ", ".join(names[:110])
    words = console.names_of(names)
    assert words.startswith("uav0000, uav0001, ")
    assert words.endswith("uav0998, uav0999 (1000 in all)")
    assert len(words) < 700
    console.say_notes_of([(name, saying(words)) for name in names for words in ("the same", f"about {name}")])
    assert len(err.getvalue().splitlines()) == console.MOST_NOTES + 1
    assert "… and 881 more on vehicles" in err.getvalue()


def test_transfers_of_many_share_one_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Console(file=io.StringIO(), width=130, force_terminal=True, color_system=None)
    monkeypatch.setattr(console, "aside", screen)
    names = [f"uav{k}" for k in range(40)]
    with console.transfer_progress(names) as moved_on:
        for name in names[:7]:
            moved_on(name, TransferProgress("sending", 1, 5))
            moved_on(name, TransferProgress("verified", 5, 5, failed=False))
        moved_on("uav9", TransferProgress("refused", 0, 5, failed=True))
    text = screen.file.getvalue()
    assert "40 vehicles" in text
    assert "8/40" in text
    assert "1 failed" in text
    assert "uav3" not in text
