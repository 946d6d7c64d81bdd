"""A short run of the campaign `hours`, and that it finds planted faults."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest

from gcsplan.app.check import worlds as check_sites
from gcsplan.mission_file.published import times
from tests.campaigns import hours


@pytest.mark.slow
def test_some_inputs_of_the_campaign_find_nothing(tmp_path: Path) -> None:
    assert [hours.attack(seed, tmp_path)[1] for seed in range(900, 930)] == [[]] * 30


def test_the_campaign_finds_an_end_that_misses_its_day(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(times, "DAY", timedelta(hours=20))
    assert any(hours.attack(seed, tmp_path)[1] for seed in range(130, 210))


@pytest.mark.slow
def test_the_campaign_finds_flights_that_outlast_the_hours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check_sites, "beyond_hours", lambda *_: "")
    found = [fault for seed in range(1, 60) for fault in hours.attack(seed, tmp_path)[1]]
    assert any("which has no end" in fault for fault in found)
