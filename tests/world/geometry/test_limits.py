"""Slopes of the climb limits: tangents, and no limit at 90 degrees."""

from __future__ import annotations

import math

import pytest

from gcsplan.world.geometry.limits import Limits


def test_slopes_are_tangents_of_the_angles() -> None:
    limits = Limits(10.0, max_climb_deg=45.0, max_descent_deg=30.0)
    assert limits.max_climb_slope == pytest.approx(1.0)
    assert limits.max_descent_slope == pytest.approx(1.0 / math.sqrt(3.0))


def test_straight_up_and_down_is_no_limit() -> None:
    limits = Limits(10.0)
    assert (limits.max_climb_slope, limits.max_descent_slope) == (math.inf, math.inf)
