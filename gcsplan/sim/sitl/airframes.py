"""The airframes that SITL instances fly, and their parameters, so that each can fly its plan.

A parameter that ArduPilot 4.7 renamed is given by both names: an instance passes over a name that it does not know.
"""

from __future__ import annotations

import math

from gcsplan.check.geodesy import offset_m
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.parameter_list import parameter_list
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


def parameters_of(part: Part) -> dict[str, float]:
    """Return an instance's parameters: those of its airframe, and the list of its plan as a pilot sets it."""
    given = dict(PLANE if part.vehicle.autopilot is Autopilot.ARDUPLANE else COPTER)
    for s in parameter_list(part.mission, part.vehicle, rtl_rel_home_m=part.rtl_rel_home_m):
        for name in s.parameter.names:
            listed = name.value(s.value)
            own = given.get(name.name, listed)
            kept = (s.rule == "at least" and own >= listed) or (s.rule == "at most" and own <= listed)
            given[name.name] = own if kept else listed
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
