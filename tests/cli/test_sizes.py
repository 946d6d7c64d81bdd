"""Missions, rehearsals and logs as large as docs/safety.md says: judged, or refused by name."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.campaigns import sizes


@pytest.mark.slow
def test_items_are_counted(run: Any) -> None:
    code, _, err = run(*sizes.write("items", 10_001))
    assert code == 2
    assert "a mission of more than 10000 items is not read" in err


@pytest.mark.nightly
def test_ten_thousand_items_are_judged(run: Any) -> None:
    code, out, _ = run(*sizes.write("items", 10_000))
    assert code in (0, 4), json.loads(out)


@pytest.mark.nightly
def test_jumps_that_repeat_each_other_end(run: Any) -> None:
    assert run(*sizes.write("jumps", 60))[0] == 4  # 30,000 rounds to the power of fifteen


def test_runs_of_a_rehearsal_are_counted(run: Any) -> None:
    code, _, err = run(*sizes.write("runs", 10_001))
    assert code == 2
    assert "10000" in err


@pytest.mark.nightly
def test_a_log_of_half_a_million_lines_is_read(run: Any) -> None:
    assert run(*sizes.write("log", 500_000))[0] in (0, 4)  # 4: it tells too little of what metres and climbs take
