"""A vehicle's kinematics: where its legs are curves, and its airspeed."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.vehicle import Autopilot
from tests.support.short_flights import COPTER


def test_legs_are_curves_where_they_are_bounded_and_the_autopilot_is_ardupilot() -> None:
    jerky = replace(COPTER, leg_jerk_m_s3=1.0)
    assert Kinematics.of(jerky).lays_curves
    assert not Kinematics.of(replace(jerky, autopilot=Autopilot.PX4)).lays_curves
    assert not Kinematics.of(replace(jerky, accel_m_s2=math.inf)).lays_curves
    assert not Kinematics.of(replace(jerky, corner_accel_m_s2=math.inf)).lays_curves


def test_a_copter_has_the_airspeed_that_its_lean_allows() -> None:
    leans = replace(COPTER, lean_angle_deg=45.0)
    assert Kinematics.of(leans).airspeed_on(0.0, 0.0) == pytest.approx(14.73, abs=0.01)
    assert Kinematics.of(leans).airspeed_on(0.0, 600.0) == pytest.approx(15.16, abs=0.01)
    assert Kinematics.of(leans, 11.0).airspeed_on(0.0, 600.0) == 11.0
    assert Kinematics.of(leans, 20.0).airspeed_on(0.0, 600.0) == pytest.approx(15.16, abs=0.01)
    assert Kinematics.of(COPTER).airspeed_on(-0.1, 600.0) == 12.0
