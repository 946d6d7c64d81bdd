"""A short run of the campaign `winds`, and that it finds planted faults."""

from __future__ import annotations

import pytest

from gcsplan.check.verdict import Verdict
from tests.campaigns import winds

Windows = tuple[tuple[float, float], ...] | None


@pytest.mark.nightly
def test_some_inputs_of_the_campaign_find_nothing() -> None:
    assert [fault for seed in range(40, 43) for fault in winds.attack(seed).faults] == []


@pytest.mark.nightly
def test_the_campaign_finds_windows_that_are_too_narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = Verdict.leg_windows_s

    def narrow(verdict: Verdict) -> Windows:
        windows = whole(verdict)
        return windows and tuple((0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b) for a, b in windows)

    monkeypatch.setattr(Verdict, "leg_windows_s", narrow)
    found = [fault for seed in range(1, 12) for fault in winds.attack(seed).faults if "window" in fault]
    assert found
