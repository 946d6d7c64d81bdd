"""PX4's motion parameters on board, held against what a mission was planned with.

PX4 flies no faster than its parameters allow, and a mission can command the cruise speed alone. A vehicle that is
slower than planned keeps the legs, but not the times.
"""

from __future__ import annotations

import math

from gcsplan.mavlink.mission.parameter_names import ParameterValues
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle

__all__ = ["slower_words", "speed_shortage"]


_SAME = 0.01
"""Part by which a parameter may fall short of what was planned with."""


def speed_shortage(values: ParameterValues, vehicle: Vehicle, commanded_m_s: float) -> Note | None:
    """Why a vehicle with these parameters cannot fly the commanded speed, and the cure; None if it can.

    None, too, if MPC_XY_VEL_MAX was not read, or bounds nothing in the plan.
    """
    most = values.get("MPC_XY_VEL_MAX", math.nan)
    if vehicle.vel_max_m_s is None or not most < commanded_m_s * (1.0 - _SAME):
        return None
    return Note("velocity_too_small", value=most, speed_m_s=commanded_m_s, wanted=math.ceil(commanded_m_s))


def slower_words(values: ParameterValues, vehicle: Vehicle) -> list[Note]:
    """Which parameters on board make a vehicle slower than it was planned; empty for another autopilot."""
    if vehicle.autopilot is not Autopilot.PX4 or not vehicle.smooths:
        return []
    corner = values.get("MPC_XY_TRAJ_P", math.nan) * values.get("MPC_ACC_HOR", math.nan)
    planned = [
        ("MPC_ACC_HOR", values.get("MPC_ACC_HOR", math.nan), vehicle.accel_m_s2, "accel_m_s2"),
        ("MPC_JERK_AUTO", values.get("MPC_JERK_AUTO", math.nan), vehicle.leg_jerk_m_s3, "leg_jerk_m_s3"),
        ("MPC_XY_TRAJ_P times MPC_ACC_HOR", corner, vehicle.corner_accel_m_s2, "corner_accel_m_s2"),
        ("MPC_Z_V_AUTO_UP", values.get("MPC_Z_V_AUTO_UP", math.nan), vehicle.climb_m_s, "climb_m_s"),
        ("MPC_Z_V_AUTO_DN", values.get("MPC_Z_V_AUTO_DN", math.nan), vehicle.descent_m_s, "descent_m_s"),
    ]
    found = [
        Note("slower_than_planned", name=name, value=value, wanted=wanted, planned_key=key)
        for name, value, wanted, key in planned
        if value < wanted * (1.0 - _SAME)
    ]
    returns = values.get("MPC_XY_CRUISE", math.nan)
    if vehicle.return_speed_m_s is not None and returns < vehicle.return_speed_m_s * (1.0 - _SAME):
        found.append(Note("returns_slower_than_planned", value=returns, speed_m_s=vehicle.return_speed_m_s))
    return [Note("arrives_later", reasons=tuple(found))] if found else []
