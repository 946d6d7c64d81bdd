"""How long a flight takes."""

from __future__ import annotations

import math

import pytest

from tests.check.test_judge import verdict_of
from tests.support.worlds import world


def test_a_leg_takes_the_time_of_its_acceleration_its_corner_and_its_braking_too() -> None:
    up, out, on, down = verdict_of(world(), [[0.0, 0, 366], [900, 0, 366], [1800, 900, 366]]).legs
    assert up.time_s == pytest.approx(66 / 2.5 + 2.5 / 1.0, rel=1e-9)
    # The corner is cut by 2 m, on an arc that a corner acceleration of 2.5 m/s² allows to be flown at v = √(2.5·R).
    bend = math.atan2(900, 900)
    radius_m = 2.0 / (1.0 / math.cos(0.5 * bend) - 1.0)
    slow_m_s = min(math.sqrt(2.5 * radius_m), 15.0)
    assert slow_m_s < 15.0
    tangent_m, arc_m = radius_m * math.tan(0.5 * bend), 0.5 * radius_m * bend
    for leg, long_m in ((out, 900.0), (on, math.hypot(900, 900))):
        speeding_m = (15.0**2 / 2 + (15.0**2 - slow_m_s**2) / 2) / 1.5
        by_hand_s = (15.0 + 15.0 - slow_m_s) / 1.5 + (long_m - tangent_m - speeding_m) / 15.0 + arc_m / slow_m_s
        assert leg.time_s == pytest.approx(by_hand_s, rel=2e-3)
    # A landing brakes to the slow rate for its last 10 m, and does not stop.
    braking_m = (1.5**2 - 0.5**2) / 2
    by_hand_s = 1.5 + (56 - 1.5**2 / 2 - braking_m) / 1.5 + (1.5 - 0.5) + 10 / 0.5
    assert down.time_s == pytest.approx(by_hand_s, rel=1e-6)
