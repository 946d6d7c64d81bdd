"""Commands that are no places: some move nothing, some set speeds, and some are flown differently.

The whole table, by command, autopilot and param, is in docs/safety.md. `Pace` holds the speeds of the flight, as a
mission's speed changes set them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle

RELEASE = 2.0  # PARACHUTE_ACTION

UNMOVED = frozenset(
    {
        cmd.CONDITION_DELAY, cmd.CONDITION_DISTANCE, cmd.CONDITION_YAW, cmd.DO_CHANGE_SPEED, cmd.DO_SET_RELAY,
        cmd.DO_REPEAT_RELAY, cmd.DO_SET_SERVO, cmd.DO_REPEAT_SERVO, cmd.DO_RETURN_PATH_START, cmd.DO_LAND_START,
        cmd.DO_SET_ROI_LOCATION, cmd.DO_SET_ROI_WPNEXT_OFFSET, cmd.DO_SET_ROI_NONE, cmd.DO_CONTROL_VIDEO,
        cmd.DO_SET_ROI, cmd.DO_DIGICAM_CONFIGURE, cmd.DO_DIGICAM_CONTROL, cmd.DO_MOUNT_CONFIGURE,
        cmd.DO_MOUNT_CONTROL, cmd.DO_SET_CAM_TRIGG_DIST, cmd.DO_FENCE_ENABLE, cmd.DO_GRIPPER,
        cmd.DO_SET_CAM_TRIGG_INTERVAL, cmd.DO_SET_RESUME_REPEAT_DIST, cmd.DO_SPRAYER,
        cmd.DO_SEND_SCRIPT_MESSAGE, cmd.SET_CAMERA_MODE, cmd.SET_CAMERA_ZOOM, cmd.SET_CAMERA_FOCUS,
        cmd.SET_CAMERA_SOURCE, cmd.JUMP_TAG, cmd.DO_GIMBAL_MANAGER_PITCHYAW, cmd.DO_GIMBAL_MANAGER_CONFIGURE,
        cmd.IMAGE_START_CAPTURE, cmd.IMAGE_STOP_CAPTURE, cmd.DO_TRIGGER_CONTROL, cmd.VIDEO_START_CAPTURE,
        cmd.VIDEO_STOP_CAPTURE,
    }
)  # fmt: skip
"""Commands that move nothing but cameras, servos, speeds and clocks (CONDITION_* delay only the next DO_ command).

These go nowhere themselves but are not in the set: DO_SET_PARAMETER 180, DO_AUTOTUNE_ENABLE 212, DO_AUX_FUNCTION 218
(it may change the mode), DO_GUIDED_LIMITS 222, DO_ENGINE_CONTROL 223, and DO_PARACHUTE with release.
"""


def moves_nothing(command: int, first: float) -> bool:
    """Return whether the flight goes on unchanged after a command; ``first`` is its param1."""
    return command in UNMOVED or (command == cmd.DO_PARACHUTE and first != RELEASE)


LAND_STARTS = (cmd.DO_RETURN_PATH_START, cmd.DO_LAND_START)

ENDS = (cmd.LAND, cmd.VTOL_LAND, cmd.RTL, cmd.LOITER_UNLIM)
"""Commands behind which the items of a mission are not flown in order."""


def flown_in_order(mission: Mission) -> tuple[MissionItem, ...]:
    """The items but for the ones to which only a return leads: behind an end and a start such as DO_LAND_START."""
    for k, (item, after) in enumerate(pairwise(mission.items), start=1):
        if item.command in ENDS and after.command in LAND_STARTS and mission.autopilot.is_ardupilot:
            return mission.items[:k]
    return mission.items


FW_DESCENT = 1.0  # NAV_VTOL_LAND_OPTIONS


WHY_LOST = {
    cmd.ARC_WAYPOINT: "arc_unknown",
    cmd.SPLINE_WAYPOINT: "spline_unknown",
    cmd.VTOL_TAKEOFF: "changes_to_forward_flight",
    cmd.TAKEOFF: "take_off_unknown",
    cmd.ALTITUDE_WAIT: "waits_for_altitude",
    cmd.GUIDED_ENABLE: "flown_by_computer",
    cmd.PAYLOAD_PLACE: "descends_until_ground",
    cmd.DO_SET_HOME: "moves_home",
    cmd.DO_PARACHUTE: "releases_parachute",
    cmd.DO_AUX_FUNCTION: "switches_mode",
    cmd.DO_ENGINE_CONTROL: "controls_engine",
    cmd.DO_SET_PARAMETER: "sets_parameter",
    cmd.DO_GO_AROUND: "breaks_off_landing",
}
"""Commands whose flight is never known, whatever the item's numbers, with the code of the note that says why."""


def why_lost(item: MissionItem, mission: Mission) -> Note:
    """Return why what the autopilot flies for an item is not known."""
    if item.command == cmd.WAYPOINT:
        return Note("way_point_unknown")
    name = cmd.command_name(item.command)
    if item.command in (cmd.TAKEOFF, cmd.VTOL_TAKEOFF) and mission.autopilot.is_ardupilot:
        return Note("take_off_unknown", name=name)
    if item.command in WHY_LOST:
        return Note(WHY_LOST[item.command], name=name)
    return Note("motion_unknown", name=name) if item.command in cmd.COMMAND_WORDS else Note("command_unknown")


def flown_otherwise(seq: int, item: MissionItem, mission: Mission) -> Note | None:
    """Return why the autopilot flies ``item`` (as stored) differently from what its command says; None if it does not.

    PX4: a precision landing searches for its beacon (navigator/precland.cpp); a hold time that is not finite has no
    known end. ArduPlane: a VTOL landing may begin as a fixed wing's spiral (quadplane.cpp,
    `landing_with_fixed_wing_spiral_approach`); a return continues to DO_LAND_START if RTL_AUTOLAND is set, and without
    RTL_AUTOLAND the vehicle does not arm.
    """
    first, second = item.params[:2]
    if mission.autopilot is Autopilot.PX4:
        if item.command == cmd.LAND and second >= 1.0:
            return Note("precision_landing", seq)
        if item.command in (cmd.WAYPOINT, cmd.LOITER_TIME, cmd.DELAY) and not math.isfinite(first):
            return Note("hold_without_known_end", seq, hold_s=first)
    if mission.autopilot is Autopilot.ARDUPLANE:
        if item.command == cmd.VTOL_LAND and first == FW_DESCENT:
            return Note("lands_as_wing", seq)
        if item.command == cmd.RTL and any(i.command in LAND_STARTS for i in mission.items):
            return Note("return_leads_to_landing", seq)
    return None


AIRSPEED, GROUND_SPEED, CLIMB, DESCENT = 0.0, 1.0, 2.0, 3.0  # SPEED_TYPE
DEFAULT = -2.0
"""This value resets a speed to its default; −1 leaves it unchanged."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Cruise speed over ground, and rates of climb and descent, m/s."""

    speed_m_s: float
    rates_m_s: tuple[float, float]

    @classmethod
    def of(cls, vehicle: Vehicle) -> Pace:
        """The pace at the beginning of a mission: the vehicle's own speeds."""
        return cls(vehicle.speed_max_m_s, (vehicle.climb_m_s, vehicle.descent_m_s))

    def changed(self, seq: int, item: MissionItem, vehicle: Vehicle) -> tuple[Pace, Note | None]:
        """The pace after a DO_CHANGE_SPEED, the item ``seq``, and a note on it (mostly there is none).

        On ArduPlane a ground speed is a lower bound, not a target (commands_logic.cpp, `do_change_speed`).
        """
        kind, value = item.params[0], item.params[1]
        plane = vehicle.autopilot is Autopilot.ARDUPLANE
        cruise = (AIRSPEED,) if plane else (AIRSPEED, GROUND_SPEED)
        if vehicle.autopilot is Autopilot.PX4 and kind in (CLIMB, DESCENT):
            return self, Note("climb_rate_uncounted", seq)
        if kind in cruise and value == DEFAULT:
            return replace(self, speed_m_s=vehicle.speed_max_m_s), None
        if not 0.0 < value < math.inf:
            return self, None
        if kind in cruise:
            return replace(self, speed_m_s=value), None
        if kind in (CLIMB, DESCENT) and not plane:
            up, down = self.rates_m_s
            return replace(self, rates_m_s=(value, down) if kind == CLIMB else (up, value)), None
        return self, None
