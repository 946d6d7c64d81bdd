"""The airframes that SITL instances fly, and their parameters, so that each can fly its plan.

A parameter that ArduPilot 4.7 renamed is given by both names: an instance passes over a name that it does not know.
"""

from __future__ import annotations

import math

from gcsplan.check.geodesy import offset_m
from gcsplan.check.tuning import DEFAULTS
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.sim.part import Part
from gcsplan.vehicle import Autopilot

MODELS = {Autopilot.ARDUCOPTER: "+", Autopilot.ARDUPLANE: "plane"}
"""The name of each vehicle's model in SITL."""

_EITHER: dict[str, float] = {
    "ARMING_CHECK": 0, "ARMING_SKIPCHK": -1, "TERRAIN_ENABLE": 0, "FENCE_ENABLE": 0, "SIM_BARO_RND": 0,
    "INS_ACCOFFS_X": 0.001, "INS_ACCOFFS_Y": 0.001, "INS_ACCOFFS_Z": 0.001, "INS_ACCSCAL_X": 1.001,
    "INS_ACCSCAL_Y": 1.001, "INS_ACCSCAL_Z": 1.001,
}  # fmt: skip
"""What lets a vehicle arm without pilot or calibration (from ArduPilot's SITL defaults)."""

COPTER: dict[str, float] = _EITHER | {
    "FRAME_CLASS": 1, "FRAME_TYPE": 0, "FS_THR_ENABLE": 0, "DISARM_DELAY": 0, "COMPASS_OFS_X": 5, "COMPASS_OFS_Y": 13,
    "COMPASS_OFS_Z": -18, "MOT_THST_EXPO": 0.65, "MOT_THST_HOVER": 0.39, "MOT_BAT_VOLT_MIN": 9.6,
    "MOT_BAT_VOLT_MAX": 12.8, "ATC_RAT_YAW_P": 0.3,
}  # fmt: skip
"""Parameters of a quadrotor."""

PLANE: dict[str, float] = _EITHER | {
    "THR_FAILSAFE": 0, "ARSPD_USE": 1, "AIRSPEED_MIN": 10, "AIRSPEED_MAX": 30, "KFF_RDDRMIX": 0.5, "TRIM_THROTTLE": 50,
    "RC3_MIN": 1000, "RC3_TRIM": 1000, "SERVO3_MIN": 1000, "SERVO3_MAX": 2000, "PTCH_LIM_MAX_DEG": 25,
    "PTCH_LIM_MIN_DEG": -20, "RLL2SRV_TCONST": 0.25, "RLL2SRV_RMAX": 90, "RLL_RATE_FF": 0.237, "RLL_RATE_P": 0.3,
    "RLL_RATE_I": 0.25, "RLL_RATE_D": 0.0174, "PTCH2SRV_TCONST": 0.25, "PTCH2SRV_RMAX_UP": 90, "PTCH2SRV_RMAX_DN": 90,
    "PTCH_RATE_FF": 0.596, "PTCH_RATE_P": 0.15, "PTCH_RATE_I": 0.11, "PTCH_RATE_D": 0.0073, "LAND_FLARE_SEC": 3,
    "LAND_PITCH_DEG": 1,
}  # fmt: skip
"""Parameters of SITL's plane: its limits, and controllers tuned for it."""

FAST_M_S, FAST_LEAN_DEG = 9.0, 45.0
"""Cruise speed (m/s) above which the largest lean is raised to this (degrees): 30° was measured to limit the speed to
about 10 m/s."""


def parameters_of(part: Part) -> dict[str, float]:
    """Return an instance's parameters: those of its airframe and the vehicle's own, so that it can fly the plan."""
    return _plane(part) if part.vehicle.autopilot is Autopilot.ARDUPLANE else _copter(part)


def _copter(part: Part) -> dict[str, float]:
    v = part.vehicle
    speeds = {
        ("WPNAV_SPEED", "WP_SPD"): v.speed_max_m_s, ("WPNAV_SPEED_UP", "WP_SPD_UP"): v.climb_m_s,
        ("WPNAV_SPEED_DN", "WP_SPD_DN"): v.descent_m_s, ("LAND_SPEED", "LAND_SPD_MS"): v.land_m_s,
    }  # fmt: skip
    if part.rtl_rel_home_m is not None:
        speeds["RTL_ALT", "RTL_ALT_M"] = part.rtl_rel_home_m
    if v.lean_angle_deg is not None:  # the planned times count with it
        speeds["ANGLE_MAX", "ATC_ANGLE_MAX"] = v.lean_angle_deg
    elif v.speed_max_m_s > FAST_M_S:
        speeds["ANGLE_MAX", "ATC_ANGLE_MAX"] = FAST_LEAN_DEG
    given = dict(COPTER)
    for (in_hundredths, today), value in speeds.items():
        given |= {in_hundredths: 100.0 * value, today: value}
    return given


def _plane(part: Part) -> dict[str, float]:
    v = part.vehicle
    given = PLANE | {
        "AIRSPEED_CRUISE": v.speed_max_m_s, "WP_RADIUS": DEFAULTS.plane_radius_m, "NAVL1_PERIOD": DEFAULTS.l1_period_s,
        "NAVL1_DAMPING": DEFAULTS.l1_damping, "TECS_CLMB_MAX": v.climb_m_s, "TECS_SINK_MAX": v.descent_m_s,
    }  # fmt: skip
    if v.speed_max_m_s > given["AIRSPEED_MAX"]:
        given["AIRSPEED_MAX"] = v.speed_max_m_s
    given["AIRSPEED_MIN"] = min(given["AIRSPEED_MIN"], v.speed_min_m_s)
    if v.turn_radius_m > 0.0:
        given["WP_LOITER_RAD"] = v.turn_radius_m
    if part.rtl_rel_home_m is not None:
        given["RTL_ALTITUDE"] = part.rtl_rel_home_m
    return given


def heading_of(part: Part) -> float:
    """The direction, degrees, in which a vehicle stands: a plane in that of its take-off, for it rolls straight."""
    if part.vehicle.autopilot is not Autopilot.ARDUPLANE:
        return 0.0
    home = part.mission.home
    start = (home.lat_e7 / 1e7, home.lon_e7 / 1e7, home.amsl_m)
    for item in part.mission.items:
        if cmd.is_nav(item.command) and (item.x or item.y):
            east, north = offset_m(start, (item.lat_deg, item.lon_deg, 0.0))
            if math.hypot(north, east) > 1.0:
                return math.degrees(math.atan2(east, north)) % 360.0
    return 0.0
