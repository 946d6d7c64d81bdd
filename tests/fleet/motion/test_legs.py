"""Which motion a vehicle's legs have; and a fixed wing, which keeps the airspeed that it indicates."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gcsplan.fleet.motion.ardupilot import Curved
from gcsplan.fleet.motion.px4 import Smoothed
from gcsplan.fleet.motion.speeds import Segments
from gcsplan.fleet.motion.timing import legs
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits

FREE = dict.fromkeys(("accel_m_s2", "corner_accel_m_s2", "vertical_accel_m_s2", "land_m_s"), math.inf)
COPTER = Vehicle("a", 1, Autopilot.ARDUCOPTER, Limits(min_agl_m=5), leg_jerk_m_s3=1.0)
WING = Vehicle(
    "a", 1, Autopilot.ARDUPLANE, Limits(min_agl_m=5), turn_radius_m=100.0, climb_m_s=20.0 * math.tan(math.radians(8)),
    descent_m_s=20.0 * math.tan(math.radians(8)), **FREE,
)  # fmt: skip

FLOWN_M_S = {499.0: 20.96, 799.0: 21.62, 1199.0: 22.49, 1799.0: 23.84}
"""Ground speed of ArduPlane 4.7.0-dev in SITL at altitudes AMSL, in still air, at an indicated airspeed of 20.00 m/s.
That SITL reduces the airspeed twice before it shows it to its sensor (ArduPilot's issue 31004): the true airspeed is
that of the density, and not of its root."""

AT_1199_M = 21.21
"""The same at 1199 m with ARSPD_RATIO changed so that the sensor is right there."""


def seconds(vehicle: Vehicle, *points: tuple[float, float, float], speed: float = 20.0, **more: Any) -> float:
    found = legs(np.array(points, dtype=float), vehicle, np.arange(len(points) - 1), **more)
    assert found is not None
    return found.time_s(speed)


def test_a_fixed_wing_flies_the_true_airspeed_of_the_one_it_indicates() -> None:
    for amsl, flown in FLOWN_M_S.items():
        speed = 5000.0 / seconds(WING, (0, 0, amsl), (5000, 0, amsl))
        assert speed**2 / 20.0 == pytest.approx(flown, rel=2e-3)
    assert 5000.0 / seconds(WING, (0, 0, 1199), (5000, 0, 1199)) == pytest.approx(AT_1199_M, rel=2e-3)


def test_its_airspeed_is_along_its_path_and_its_rates_are_of_its_slopes() -> None:
    level = seconds(WING, (0, 0, 800), (1000, 0, 800))
    steep = seconds(WING, (0, 0, 730), (1000, 0, 870))  # 7.97 degrees, and as high on average
    assert steep / level == pytest.approx(math.hypot(1000, 140) / 1000, rel=1e-4)
    slow = replace(WING, climb_m_s=1.0)
    assert seconds(slow, (0, 0, 0), (1000, 0, 100)) == pytest.approx(100.0, rel=3e-3)


def test_other_vehicles_are_as_fast_over_ground_at_any_altitude() -> None:
    for vehicle in (COPTER, replace(WING, turn_radius_m=0.0), replace(COPTER, autopilot=Autopilot.PX4)):
        high, low = (seconds(vehicle, (0, 0, z), (900, 0, z), (900, 700, z), speed=9.0) for z in (3000.0, 0.0))
        assert high == pytest.approx(low, rel=1e-12)


def test_only_bounded_motion_of_ardupilot_is_curved() -> None:
    points, owner = np.array([[0.0, 0.0, 50.0], [90.0, 0.0, 50.0]]), np.arange(1)
    assert isinstance(legs(points, COPTER, owner), Curved)
    for other in (
        replace(COPTER, leg_jerk_m_s3=math.inf),
        replace(COPTER, corner_accel_m_s2=math.inf), replace(COPTER, accel_m_s2=math.inf), WING,
    ):  # fmt: skip
        assert isinstance(legs(points, other, owner), Segments)
    assert isinstance(legs(points, replace(COPTER, autopilot=Autopilot.PX4), owner), Smoothed)
    assert legs(points[[0, 0]], COPTER, owner) is None
