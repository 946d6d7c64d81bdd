"""The outcome of a planner's attempt: its gap, and how far a cost is beyond a bound."""

from __future__ import annotations

import math

import pytest

from gcsplan.bench.terrain.outcome import beyond
from tests.bench.terrain.made import outcome


def test_a_gap_is_percent_above_the_bound_and_none_without_one() -> None:
    assert outcome("a", "gcsplan", 102.0, bound=100.0).gap_percent == pytest.approx(2.0)
    assert outcome("a", "gcsplan", 102.0).gap_percent is None
    assert outcome("a", "gcsplan", None, bound=100.0).gap_percent is None


def test_a_cost_is_beyond_a_finite_bound_alone() -> None:
    assert beyond(110.0, 100.0) == pytest.approx(10.0)
    assert beyond(None, 100.0) is None
    assert beyond(110.0, None) is None
    assert beyond(110.0, math.inf) is None
