"""Commands that a flight passes over, because they move nothing; and params that make another flight of a command.

The whole table, command by autopilot by param, stands in docs/safety.md.
"""

from __future__ import annotations

import math

from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.vehicle import Autopilot

PARACHUTE, RELEASE = 208, 2.0
LOITER_TO_ALT = 31

UNMOVED = frozenset(
    {
        m.CONDITION_DELAY, 114, 115, m.DO_CHANGE_SPEED, 181, 182, 183, 184, 188, 189,
        195, 196, 197, 200, 201, 202, 203, 204, 205, 206, 207, 211, 214, 215, 216, 217,
        530, 531, 532, 534, 600, 1000, 1001, 2000, 2001, 2003, 2500, 2501,
    }
)  # fmt: skip
"""Commands that move nothing but cameras, servos, speeds and clocks (CONDITION_* delay only the next DO_ command).

Not among them, though they go nowhere themselves: DO_SET_PARAMETER 180, DO_AUTOTUNE_ENABLE 212, DO_AUX_FUNCTION 218
(which may change the mode), DO_GUIDED_LIMITS 222, DO_ENGINE_CONTROL 223, and a parachute that is released.
"""


def moves_nothing(command: int, first: float) -> bool:
    """True for a command (``first`` is its param1) after which the flight goes on as if it were not there."""
    return command in UNMOVED or (command == PARACHUTE and first != RELEASE)


LAND_STARTS = (188, 189)
"""DO_RETURN_PATH_START, DO_LAND_START."""

FW_DESCENT = 1.0  # NAV_VTOL_LAND_OPTIONS


def flown_otherwise(item: MissionItem, mission: Mission) -> str:
    """Why what ``item`` (as stored) makes its autopilot fly is not what its command says; empty where it is.

    PX4: a precision landing looks for its beacon (navigator/precland.cpp); a hold that is no number has no known end.
    ArduPlane: a VTOL landing may begin as a fixed wing's spiral (quadplane.cpp, `landing_with_fixed_wing_spiral_
    approach`); a return goes on to DO_LAND_START by RTL_AUTOLAND, without which it does not arm.
    """
    first, second = item.params[:2]
    if mission.autopilot is Autopilot.PX4:
        if item.command == m.LAND and second >= 1.0:
            return "a precision landing (param2) looks for its beacon, and where is not known"
        if item.command in (m.WAYPOINT, m.LOITER_TIME, m.DELAY) and not math.isfinite(first):
            return f"a hold of {first} s (param1) has no end that is known"
    if mission.autopilot is Autopilot.ARDUPLANE:
        if item.command == m.VTOL_LAND and first == FW_DESCENT:
            return "a descent as a fixed wing (param1) is flown as the autopilot likes"
        if item.command == m.RTL and any(i.command in LAND_STARTS for i in mission.items):
            return "a return leads on to DO_LAND_START, by RTL_AUTOLAND"
    return ""
