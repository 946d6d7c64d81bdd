"""PX4's motion: by hand where a hand can, and against the same rules flown step by step."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.fleet.motion.px4 import Smoothed, smoothed
from gcsplan.fleet.motion.timing import at_own_speed, legs
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits
from tests.oracles.px4_smoothing import fly
from tests.support.effort import seeds
from tests.support.worlds import vehicle

RADIUS_M = 3.0


def px4(**changes: Any) -> Vehicle:
    own = {"accel_m_s2": 3.0, "corner_accel_m_s2": 1.5, "leg_jerk_m_s3": 4.0, "climb_m_s": 3.0, **changes}
    return Vehicle("a", 1, Autopilot.PX4, Limits(min_agl_m=5, track_error_m=RADIUS_M), **own)


def stretch(points: Floats, **changes: Any) -> Smoothed:
    made = smoothed(points, px4(**changes), np.arange(len(points) - 1))
    assert made is not None
    return made


def zigzag(turn_deg: float, leg_m: float, legs: int = 4) -> Floats:
    course = np.radians([turn_deg * (i % 2) for i in range(legs)])
    steps = leg_m * np.column_stack([np.cos(course), np.sin(course), np.zeros(legs)])
    return np.vstack([[0.0, 0.0, 90.0], np.array([0.0, 0.0, 90.0]) + np.cumsum(steps, axis=0)])


@pytest.mark.first_quick
@pytest.mark.parametrize(("turn_deg", "leg_m", "speed"), [
    (0.0, 60.0, 10.0), (19.5, 60.0, 10.0), (19.5, 50.0, 5.0), (45.0, 120.0, 12.0), (90.0, 40.0, 8.0),
    (120.0, 80.0, 10.0), (60.0, 15.0, 8.0), (20.0, 30.0, 12.0),
])  # fmt: skip
def test_a_step_by_step_flight_takes_as_long(turn_deg: float, leg_m: float, speed: float) -> None:
    points = zigzag(turn_deg, leg_m)
    flown_s, _ = fly(points[:, :2], speed, RADIUS_M)
    corners = len(points) - 2
    assert stretch(points).time_s(speed) == pytest.approx(flown_s, abs=0.2 + 0.3 * corners, rel=0.0)


@pytest.mark.first_quick
@pytest.mark.parametrize("turn_deg", [10.0, 19.5, 45.0, 90.0])
def test_a_corner_is_flown_at_the_speed_that_its_angle_and_radius_allow(turn_deg: float) -> None:
    points = zigzag(turn_deg, 150.0, 2)
    half = math.radians(0.5 * turn_deg)
    allowed = math.sqrt(0.5 * 3.0 * RADIUS_M / math.tan(half))
    least = 0.5 * (math.sqrt(81.0 + 8.0 * 3.0 * RADIUS_M + 4.0 * allowed**2) - 9.0)  # it brakes that late
    _, [flown] = fly(points[:, :2], 10.0, RADIUS_M)
    assert flown == pytest.approx(max(allowed, least), abs=0.15)
    s, v, _ = stretch(points).times(10.0)
    assert np.interp(150.0 - RADIUS_M, s, v) == pytest.approx(max(allowed, least), abs=0.01)


def test_a_wide_turn_slows_it_down_and_the_model_for_others_does_not_apply() -> None:
    straight, turned = stretch(zigzag(0.0, 300.0, 2)), stretch(zigzag(19.5, 300.0, 2))
    assert 1.0 < turned.time_s(10.0) - straight.time_s(10.0) < 3.0
    assert px4().smooths
    assert not px4(leg_jerk_m_s3=math.inf).smooths
    assert px4().acceptance_m == RADIUS_M


def test_a_slope_bounds_the_speed_by_the_rates_and_a_vertical_leg_is_flown_at_them() -> None:
    steep = stretch(np.array([[0.0, 0.0, 0.0], [400.0, 0.0, 400.0]]))
    assert steep.time_s(10.0) == pytest.approx(400.0 / 3.0, rel=0.03)
    upright = stretch(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 300.0]]))
    assert upright.time_s(10.0) == pytest.approx(100.0, rel=0.03)


def random_points(rng: np.random.Generator) -> Floats:
    n = int(rng.integers(1, 9))
    length = rng.choice([0.0, 0.5, 4.0, 25.0, 120.0], n, p=[0.08, 0.12, 0.2, 0.3, 0.3])
    course = np.cumsum(rng.choice([0.0, 0.02, 0.3, 1.2, math.pi], n) * rng.choice([-1, 1], n))
    rise = np.where(length == 0.0, 20.0, length * rng.choice([0.0, 0.1, -0.1, 0.8, -0.8], n))
    steps = np.column_stack([length * np.cos(course), length * np.sin(course), rise])
    return np.vstack([[0.0, 0.0, 100.0], np.array([0.0, 0.0, 100.0]) + np.cumsum(steps, axis=0)])


@pytest.mark.parametrize("seed", seeds(3, 3, 15))
def test_whatever_is_flown_the_motion_is_whole_and_faster_is_never_later(seed: int) -> None:
    points = random_points(np.random.default_rng(seed))
    way, legs = stretch(points), len(points) - 1
    times = [way.time_s(speed) for speed in (2.0, 5.0, 8.0, 12.0)]
    assert all(later <= sooner + 1e-6 for sooner, later in pairwise(times))
    assert way.shares_s(8.0, legs).sum() == pytest.approx(way.time_s(8.0))
    at, places, owner = way.motion(8.0, 0.25)
    assert (np.diff(at) > 0.0).all()
    assert at[-1] == pytest.approx(way.time_s(8.0))
    assert np.allclose(places[-1], points[-1])
    assert (np.diff(owner) >= 0).all()
    run = np.hypot(*np.diff(np.vstack([points[:1], places]), axis=0)[:, :2].T)
    assert (run <= 8.001 * np.diff(np.append(0.0, at)) + 1e-6).all()
    slower = at_own_speed(way, 3.0)
    assert slower.time_s(12.0) == slower.time_s(1.0) == way.time_s(3.0)


@pytest.mark.slow
@pytest.mark.parametrize(("length_m", "accel_m_s2", "jerk_m_s3"), [(118.086, 3.0, 4.0), (15.1, 4.47, 2.6)])
def test_a_faster_leg_is_never_later_where_its_speed_is_hardly_reached(
    length_m: float, accel_m_s2: float, jerk_m_s3: float
) -> None:
    craft = replace(vehicle(Autopilot.PX4), accel_m_s2=accel_m_s2, leg_jerk_m_s3=jerk_m_s3)
    leg, owner = np.array([[0.0, 0.0, 0.0], [length_m, 0.0, 0.0]]), np.zeros(1, dtype=np.intp)
    ways = [legs(leg, craft, owner, pace=np.array([m_s])) for m_s in np.linspace(2.0, 18.0, 81)]
    assert (np.diff([way.time_s(1.0) for way in ways if way is not None]) <= 1e-6).all()
