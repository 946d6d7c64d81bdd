"""One aircraft: which motion it has, what a metre and a second cost, how fast it returns."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.vehicle import (
    COPTER_RETURN_M_S,
    COPTER_RETURN_WAITS_S,
    OWN_METRES,
    PX4_RETURN_M_S,
    Autopilot,
    ClimbOut,
    Energy,
    Vehicle,
    fastest_at_m_s,
    lean_for_deg,
    lean_words,
)
from gcsplan.world.geometry.limits import Limits

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4


def vehicle(autopilot: Autopilot = COPTER, **more: float) -> Vehicle:
    return Vehicle("uav1", 1, autopilot, Limits(30.0, track_error_m=2.7), **more)  # type: ignore[arg-type]


IDEAL = {"accel_m_s2": math.inf, "corner_accel_m_s2": math.inf}


def test_energy_is_the_papers_model_with_a_base_power_of_each_second() -> None:
    up, along, seconds = np.array([10.0, 0.0]), np.array([50.0, 80.0]), np.array([9.0, math.nan])
    paper: Floats = Energy().under_way_j(up, along, seconds)
    assert paper.tolist() == [120.0 * 10.0 + 100.0 * 50.0, 100.0 * 80.0]  # seconds do not count
    assert Energy(vertical_j_per_m=1.0, horizontal_j_per_m=2.0, base_w=3.0).under_way_j(10.0, 50.0, 9.0) == 137.0


def test_a_hold_takes_its_own_power_or_that_of_flying_whichever_is_more() -> None:
    energy = Energy(horizontal_j_per_m=10.0, base_w=100.0, hover_w=150.0)
    assert [energy.hold_w(v) for v in (0.0, 5.0, 20.0)] == [150.0, 150.0, 300.0]


def test_an_airspeed_far_from_the_fitted_ones_is_told() -> None:
    fitted = Energy(fitted_m_s=(5.0, 10.0))
    assert [fitted.unlike_fitted(v) for v in (3.9, 4.0, 7.0, 12.0, 12.1)] == [True, False, False, False, True]
    assert not Energy().unlike_fitted(99.0)


@pytest.mark.parametrize(
    ("autopilot", "more", "lays_curves", "smooths", "can_hold"),
    [
        (COPTER, {}, False, False, True), (COPTER, {"leg_jerk_m_s3": 1.0}, True, False, True),
        (COPTER, IDEAL | {"leg_jerk_m_s3": 1.0}, False, False, True), (PX4, {"leg_jerk_m_s3": 4.0}, False, True, True),
        (PX4, {}, False, False, True), (PLANE, {"turn_radius_m": 80.0}, False, False, False),
        (PLANE, {}, False, False, False), (COPTER, {"turn_radius_m": 5.0}, False, False, False),
    ],
)  # fmt: skip
def test_an_autopilot_flies_legs_its_own_way_if_all_its_bounds_are_known(
    autopilot: Autopilot, more: dict[str, float], lays_curves: bool, smooths: bool, can_hold: bool
) -> None:
    v = vehicle(autopilot, **more)
    assert (v.lays_curves, v.smooths, v.can_hold) == (lays_curves, smooths, can_hold)


def test_a_return_has_the_autopilots_own_speed_and_wait() -> None:
    assert (vehicle().return_speed_m_s, vehicle().return_waits_s) == (COPTER_RETURN_M_S, COPTER_RETURN_WAITS_S)
    assert (vehicle(PX4).return_speed_m_s, vehicle(PX4).return_waits_s) == (PX4_RETURN_M_S, 0.0)
    wing = vehicle(PLANE, turn_radius_m=80.0, speed_max_m_s=22.0)
    assert (wing.return_speed_m_s, wing.return_waits_s) == (22.0, 0.0)
    assert (vehicle(**IDEAL).return_speed_m_s, vehicle(**IDEAL).return_waits_s) == (None, 0.0)
    assert replace(vehicle(), return_m_s=7.0, return_wait_s=1.0).return_speed_m_s == 7.0
    assert replace(vehicle(), return_m_s=7.0, return_wait_s=1.0).return_waits_s == 1.0


def test_speed_over_ground_is_the_true_airspeed_or_counted_in_ardupilots_metres() -> None:
    wing = vehicle(PLANE, turn_radius_m=80.0)
    # 1000 m up, the standard atmosphere has 0.9075 of the density at sea level.
    assert wing.fastest_over_ground_m_s(20.0, 1000.0) == pytest.approx(20.0 / math.sqrt(0.9075), rel=1e-3)
    assert vehicle(leg_jerk_m_s3=1.0).fastest_over_ground_m_s(10.0, 1000.0) == 10.0 * OWN_METRES
    assert vehicle(PX4).fastest_over_ground_m_s(10.0, 1000.0) == 10.0


@pytest.mark.parametrize(("track_error_m", "acceptance_m"), [(0.3, 1.0), (2.7, 2.0), (400.0, 255.0)])
def test_the_acceptance_radius_is_whole_metres_of_one_byte(track_error_m: float, acceptance_m: float) -> None:
    assert replace(vehicle(), limits=Limits(30.0, track_error_m=track_error_m)).acceptance_m == acceptance_m


def test_lean_and_speed_are_each_others_inverse_and_told_in_both_units() -> None:
    assert fastest_at_m_s(lean_for_deg(12.5)) == pytest.approx(12.5)
    assert str(lean_words(31.5, Autopilot.ARDUCOPTER)).startswith("ATC_ANGLE_MAX 31.5 (degrees")
    assert "ANGLE_MAX 3150 (hundredths" in str(lean_words(31.5, Autopilot.ARDUCOPTER))
    assert ClimbOut(3.0, 4.0).space_m_s == 5.0
