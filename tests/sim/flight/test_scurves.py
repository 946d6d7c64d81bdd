"""Legs of a copter as S-curves, stepped in time: from rest to rest, within their limits, and one into the next."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.sim.flight.scurves import LAG_FROM, LAG_S, REST_M_S, step_legs

CURVED = Kinematics(2.5, 1.5, math.inf, leg_jerk_m_s3=1.0, leg_accel_m_s2=2.5)
SPEED_M_S, ACCEL_M_S2 = 10.0, 2.5


def flown(*corners: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    ways = [np.array(leg, dtype=float) for leg in pairwise(corners)]
    each = np.ones(len(ways))
    return step_legs(ways, SPEED_M_S * each, ACCEL_M_S2 * each, CURVED)


def test_a_straight_leg_is_flown_from_rest_to_rest_within_its_speed() -> None:
    times, places, leg = flown((0, 0, 0), (300, 0, 0))
    assert places[0] == pytest.approx([0, 0, 0])
    assert places[-1] == pytest.approx([300, 0, 0], abs=1e-6)
    assert set(leg.tolist()) == {0}
    speed = np.diff(places[:, 0]) / np.diff(times)
    assert speed.min() >= 0.0
    assert speed.max() == pytest.approx(SPEED_M_S, rel=1e-6)
    # Speeding up and slowing down each take v / a and the rise of the acceleration; the vehicle lags besides.
    ramp_s = SPEED_M_S / ACCEL_M_S2 + ACCEL_M_S2 / 1.0 + 0.3
    lag_s = LAG_S * (math.log(SPEED_M_S / REST_M_S) - LAG_FROM)
    assert times[-1] == pytest.approx(300 / SPEED_M_S + ramp_s + lag_s, rel=0.01)


def test_a_right_angle_is_cut_within_its_radius_and_without_a_stop() -> None:
    times, places, leg = flown((0, 0, 0), (200, 0, 0), (200, 200, 0))
    nearest_m = np.linalg.norm(places - [200, 0, 0], axis=1).min()
    assert 0.1 < nearest_m < CURVED.cut_m
    assert sorted(set(leg.tolist())) == [0, 1]
    turning = (times > times[-1] * 0.4) & (times < times[-1] * 0.6)
    speed = np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(times)
    assert speed[turning[1:]].min() > 1.0
