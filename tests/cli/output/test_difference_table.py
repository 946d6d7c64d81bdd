"""The difference of plans on the terminal: figures of a few vehicles, headlines of many, and how many are left out."""

from __future__ import annotations

import pytest

from gcsplan.check.difference import PlanDifference
from gcsplan.cli.output.difference_table import MOST_HEADLINES, MOST_WITH_FIGURES, say_differences
from gcsplan.units import METRIC


def difference(name: str, *, equal: bool = False) -> PlanDifference:
    """A vehicle whose way became 250 m longer, or one without a change."""
    before, after = {"length_m": 1000.0}, {"length_m": 1000.0 if equal else 1250.0}
    return PlanDifference(name, "the last plan", equal, 3, (), 0.0, before, after)


def test_a_vehicle_that_changed_has_its_figures_and_one_that_did_not_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    say_differences([difference("uav1"), difference("uav2", equal=True)], METRIC)
    out = capsys.readouterr().out
    assert "+250 m" in out
    assert out.count("1000 m") == 1
    assert "uav2: nothing changed since the last plan" in out


def test_of_many_vehicles_only_headlines_are_shown_and_the_rest_is_counted(capsys: pytest.CaptureFixture[str]) -> None:
    assert MOST_WITH_FIGURES < MOST_HEADLINES
    say_differences([difference(f"uav{k}") for k in range(MOST_HEADLINES + 5)], METRIC)
    out = capsys.readouterr().out
    assert "+250 m" not in out
    assert len([line for line in out.splitlines() if line.startswith("uav")]) == MOST_HEADLINES
    assert "and 5 more" in out
