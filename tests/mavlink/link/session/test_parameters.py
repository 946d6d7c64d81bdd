"""A PX4's motion on board against the plan's: too slow for the commanded speed, or later than planned."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gcsplan.mavlink.link.session.parameters import slower_words, speed_shortage
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geometry.limits import Limits

PX4 = Vehicle("uav1", 1, Autopilot.PX4, Limits(30.0), leg_jerk_m_s3=4.0, vel_max_m_s=12.0)
AS_PLANNED = {
    "MPC_ACC_HOR": PX4.accel_m_s2, "MPC_JERK_AUTO": 4.0, "MPC_XY_TRAJ_P": PX4.corner_accel_m_s2 / PX4.accel_m_s2,
    "MPC_Z_V_AUTO_UP": PX4.climb_m_s, "MPC_Z_V_AUTO_DN": PX4.descent_m_s, "MPC_XY_CRUISE": 5.0,
}  # fmt: skip


def test_a_speed_above_the_vehicles_most_is_a_shortage_with_its_cure() -> None:
    assert speed_shortage({"MPC_XY_VEL_MAX": 12.0}, PX4, 12.0) is None
    found = speed_shortage({"MPC_XY_VEL_MAX": 8.0}, PX4, 11.2)
    assert found == Note("velocity_too_small", value=8.0, speed_m_s=11.2, wanted=12)
    assert str(found).startswith("MPC_XY_VEL_MAX is 8 on board")
    assert str(found).endswith("set MPC_XY_VEL_MAX 12, or plan with speed_m_s up to 8")


def test_what_was_not_read_or_bounds_nothing_is_no_shortage() -> None:
    assert speed_shortage({}, PX4, 12.0) is None
    assert speed_shortage({"MPC_XY_VEL_MAX": 1.0}, replace(PX4, vel_max_m_s=None), 12.0) is None


def test_a_vehicle_as_planned_or_faster_or_silent_is_not_later() -> None:
    assert slower_words(AS_PLANNED, PX4) == []
    assert slower_words({name: 2.0 * value for name, value in AS_PLANNED.items()}, PX4) == []
    assert slower_words({}, PX4) == []


@pytest.mark.parametrize("name", AS_PLANNED)
def test_each_parameter_that_is_slower_is_told(name: str) -> None:
    (found,) = slower_words(AS_PLANNED | {name: 0.5 * AS_PLANNED[name]}, PX4)
    assert found.code == "arrives_later"
    assert name in str(found)


def test_another_autopilot_is_not_asked() -> None:
    assert slower_words({"MPC_ACC_HOR": 0.1}, replace(PX4, autopilot=Autopilot.ARDUCOPTER)) == []
