"""ArduPilot's S-curves: against flights of a real ArduCopter, and against curves that are stepped in time."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from gcsplan.arrays import Floats
from gcsplan.fleet.motion.ardupilot import CORNER_M, Curved, leaning_m_s
from gcsplan.fleet.motion.scurve import curves
from gcsplan.fleet.motion.timing import legs
from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.sim.flight.scurves import step_legs
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits
from tests.support.effort import seeds

FLOWN = json.loads((Path(__file__).parent / "arducopter_legs.json").read_text(encoding="utf-8"))
COPTER = Vehicle("a", 1, Autopilot.ARDUCOPTER, Limits(min_agl_m=5), leg_jerk_m_s3=1.0)


def through(points: Floats, lean_deg: float | None = None, **more: Any) -> Curved:
    craft = Vehicle("a", 1, Autopilot.ARDUCOPTER, Limits(min_agl_m=5), leg_jerk_m_s3=1.0, lean_angle_deg=lean_deg)
    found = legs(points, craft, np.arange(len(points) - 1), **more)
    assert isinstance(found, Curved)
    return found


def random_points(rng: np.random.Generator) -> Floats:
    n, far = int(rng.integers(2, 9)), rng.choice([5.0, 30.0, 200.0])
    steps = np.column_stack([rng.normal(0, far, (n, 2)), rng.normal(0, far / 8, n)])
    return np.array([0.0, 0.0, 500.0]) + np.cumsum(steps, axis=0)


@pytest.mark.parametrize("flight", FLOWN["flights"], ids=lambda f: f"{f['speed_m_s']:g}_{f['lean_deg']:g}")
def test_way_points_are_reached_when_a_real_arducopter_reached_them(flight: dict[str, Any]) -> None:
    points = np.array(flight["points"]) + np.array([0.0, 0.0, FLOWN["home_amsl_m"]])
    told = np.cumsum(through(points, flight["lean_deg"]).shares_s(flight["speed_m_s"], len(points) - 1))
    flown = np.array(flight["reached_s"])
    assert np.abs(told - flown).max() < 0.5
    assert abs(told[-1] - flown[-1]) < max(0.35, 0.001 * flown[-1])


@pytest.mark.parametrize("flight", FLOWN["flights"], ids=lambda f: f"{f['speed_m_s']:g}_{f['lean_deg']:g}")
def test_the_built_in_simulator_flies_as_a_real_arducopter_flew(flight: dict[str, Any]) -> None:
    points = np.array(flight["points"]) + np.array([0.0, 0.0, FLOWN["home_amsl_m"]])
    way = np.diff(points, axis=0)
    run, rise, length = np.hypot(way[:, 0], way[:, 1]), way[:, 2], np.linalg.norm(way, axis=1)
    kinematics = Kinematics(2.5, 1.5, 30.0, leg_jerk_m_s3=1.0, lean_deg=flight["lean_deg"])
    most = np.minimum(flight["speed_m_s"] * length / run, np.where(rise > 0, 2.5, 1.5) * length / np.abs(rise + 1e-12))
    high = 0.5 * (points[1:, 2] + points[:-1, 2])
    speed = [kinematics.leaning_m_s(*each) for each in zip(rise / length, high, most, strict=True)]
    accel = np.minimum(2.5 * length / run, 1.0 * length / np.abs(rise + 1e-12))
    times, _, leg = step_legs(
        [*sliding_window_view(points, 2, axis=0).swapaxes(1, 2)], np.array(speed), accel, kinematics
    )
    reached = np.append(times[1:][np.diff(leg) > 0], times[-1])
    assert len(reached) == len(flight["reached_s"])
    assert abs(times[-1] - flight["reached_s"][-1]) < max(0.35, 0.001 * times[-1])


@pytest.mark.parametrize("seed", range(12))
def test_times_and_places_of_the_flight_are_those_of_curves_stepped_in_time(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, speed_m_s = random_points(rng), float(rng.uniform(2, 16))
    way = np.diff(points, axis=0)
    run, rise, length = np.hypot(way[:, 0], way[:, 1]), way[:, 2], np.linalg.norm(way, axis=1)
    speed = np.minimum(speed_m_s * length / run, np.where(rise > 0, 2.5, 1.5) * length / np.abs(rise))
    accel = np.minimum(2.5 * length / run, 1.0 * length / np.abs(rise))
    times, places, _ = step_legs(
        [*sliding_window_view(points, 2, axis=0).swapaxes(1, 2)], speed, accel, Kinematics.of(COPTER)
    )
    stretch = through(points)
    assert stretch.time_s(speed_m_s) == pytest.approx(times[-1], abs=0.05)
    at, there, _ = stretch.motion(speed_m_s, 0.02)
    own = np.column_stack(
        [np.interp(times, np.append(0.0, at), np.append(points[0, k], there[:, k])) for k in range(3)]
    )
    assert np.linalg.norm(own - places, axis=1).max() < 0.4


@pytest.mark.parametrize("seed", seeds(2, 2, 20))
def test_flying_faster_never_takes_longer_and_legs_add_up(seed: int) -> None:
    points = random_points(np.random.default_rng(seed))
    stretch = through(points)
    times = [stretch.time_s(v) for v in np.linspace(2.0, 18.0, 33)]
    assert np.diff(times).max() <= 1e-9
    assert stretch.shares_s(9.0, len(points) - 1).sum() == pytest.approx(stretch.time_s(9.0), rel=1e-12)
    at, there, _ = stretch.motion(9.0)
    assert at[-1] == pytest.approx(stretch.time_s(9.0), rel=1e-9)
    assert there[-1] == pytest.approx(points[-1], abs=1e-6)
    near = np.linalg.norm(there[:, None] - points[None, 1:-1], axis=2)
    assert not near.size or near.min(axis=0).max() < CORNER_M + 5.0  # a sample is at most that far from the turn


def test_a_curve_keeps_its_bounds_and_covers_its_length() -> None:
    length = np.array([0.3, 3.0, 30.0, 300.0, 300.0, 40.0])
    speed = np.array([10.0, 10.0, 10.0, 15.0, 0.5, 3.0])
    accel = np.array([2.5, 2.5, 2.5, 2.5, 2.5, 0.6])
    flown = curves(length, speed, accel, 1.0)
    for i in range(len(length)):
        t = np.linspace(0.0, float(flown.time_s[i]), 20001)
        gone = flown.of(np.full(len(t), i)).gone_m(t)
        v = np.gradient(gone, t)
        a = np.gradient(v, t)
        assert gone[-1] == pytest.approx(length[i], abs=1e-9)
        assert np.diff(gone).min() >= -1e-9
        assert v.max() <= speed[i] + 1e-3
        assert np.abs(a[5:-5]).max() <= accel[i] + 1e-3
        assert np.abs(np.gradient(a, t)[10:-10]).max() <= 1.0 + 0.05


@pytest.mark.parametrize("lean_deg", [20.0, 30.0, 45.0, 60.0])
@pytest.mark.parametrize("slope_deg", [-12.0, -2.9, 0.0, 6.0])
@pytest.mark.parametrize("amsl_m", [0.0, 593.0, 2500.0])
def test_a_lean_angle_allows_the_same_speed_as_in_the_simulator(
    lean_deg: float, slope_deg: float, amsl_m: float
) -> None:
    kinematics = Kinematics(2.5, 1.5, 30.0, lean_deg=lean_deg)
    wanted = kinematics.leaning_m_s(math.sin(math.radians(slope_deg)), amsl_m, 60.0)
    found = leaning_m_s(lean_deg, np.array([math.radians(slope_deg)]), np.array([amsl_m]))
    assert found[0] == pytest.approx(wanted, rel=1e-3)


def test_down_a_slope_a_lean_of_45_degrees_is_not_enough_for_15_m_s() -> None:
    """A real ArduCopter flew 14.55 m/s down 2.98 degrees at 550 m, with 45 degrees, and 14.98 with 60."""
    speed = leaning_m_s(45.0, np.radians([-2.98, -5.96]), np.array([557.0, 565.0]))
    assert speed == pytest.approx([14.57, 14.08], abs=0.03)
    assert leaning_m_s(60.0, np.radians([-2.98]), np.array([557.0]))[0] > 15.0
