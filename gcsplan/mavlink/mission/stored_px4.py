"""A mission item as PX4 stores it: floats unchanged, but only the params that a command uses; yaw in radians.

Source: PX4 1.15, ``mavlink_mission.cpp`` (`parse_mavlink_mission_item`, `format_mavlink_mission_item`),
``navigation.h``, ``Limits.hpp`` (`radians`, `degrees`) and ``helper_functions.hpp`` (`wrap_2pi`).
"""

from __future__ import annotations

import math

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import (
    FRAME_SYNONYMS,
    GLOBAL,
    NO_POSITION,
    RELATIVE,
    TERRAIN,
    MissionItem,
    NumberKept,
    float32,
)

_RADIANS_PER_DEGREE = float32(float32(math.pi) / 180.0)
_DEGREES_PER_RADIAN = float32(180.0 / float32(math.pi))
_FULL_TURN = float32(2.0 * math.pi)
_TURNS_PER_RADIAN = float32(1.0 / _FULL_TURN)


def _f32(value: float) -> float:
    return value


def _lost(value: float) -> float:
    return 0.0


def _flag(value: float) -> float:
    return 1.0 if value > 0 else 0.0


def _u16(value: float) -> float:
    return float(int(value) & 0xFFFF) if abs(value) < 2**31 else 0.0


def _i16(value: float) -> float:
    return (_u16(value) + 32768.0) % 65536.0 - 32768.0


def _vertices(value: float) -> float:
    return _u16(float32(value + 0.5))


def yaw(degrees: float) -> float:
    """Convert degrees to float32 radians within 0 … 2π and back: -90 reads back as 270, NaN stays NaN."""
    radians = float32(degrees * _RADIANS_PER_DEGREE)
    if not math.isfinite(radians):
        return math.nan
    if not 0.0 <= radians < _FULL_TURN:
        turns = math.floor(float32(radians * _TURNS_PER_RADIAN))
        radians = float32(radians - float32(_FULL_TURN * turns))
    return float32(radians * _DEGREES_PER_RADIAN)


_NumberRules = tuple[NumberKept, NumberKept, NumberKept, NumberKept]
_NOTHING_KEPT: _NumberRules = (_lost, _lost, _lost, _lost)
_YAW: _NumberRules = (_lost, _lost, _lost, yaw)

LOCATED: dict[int, _NumberRules] = {
    cmd.WAYPOINT: (_f32, _f32, _lost, yaw),  # hold, acceptance radius
    cmd.LOITER_UNLIM: (_lost, _lost, _f32, yaw),  # radius
    cmd.LOITER_TIME: (_f32, _flag, _f32, _flag),
    cmd.LAND: (_lost, _u16, _lost, yaw),  # precision
    cmd.TAKEOFF: _YAW,
    cmd.LOITER_TO_ALT: (_flag, _f32, _lost, _flag),
    cmd.ROI: _NOTHING_KEPT,
    cmd.VTOL_TAKEOFF: _YAW,
    cmd.VTOL_LAND: _YAW,
    cmd.DO_SET_ROI_LOCATION: _NOTHING_KEPT,
    cmd.DO_SET_ROI: _NOTHING_KEPT,  # with a location
    cmd.DO_AUTOTUNE_ENABLE: _NOTHING_KEPT,
    cmd.COMPONENT_ARM_DISARM: _NOTHING_KEPT,
    cmd.CONDITION_GATE: _NOTHING_KEPT,
    cmd.FENCE_RETURN_POINT: _NOTHING_KEPT,
    cmd.POLYGON_IN: (_vertices, _lost, _lost, _lost),
    cmd.POLYGON_OUT: (_vertices, _lost, _lost, _lost),
    cmd.CIRCLE_IN: (_f32, _lost, _lost, _lost),
    cmd.CIRCLE_OUT: (_f32, _lost, _lost, _lost),
    cmd.RALLY_POINT: _NOTHING_KEPT,
}
"""The stored parts of param1 … param4 of commands with a location (frames 0 and 3, also as 5 and 6)."""

PLACELESS = frozenset(
    {
        cmd.RTL, cmd.ROI, cmd.DELAY, cmd.CONDITION_DELAY, cmd.CONDITION_DISTANCE, cmd.DO_JUMP,
        cmd.DO_CHANGE_SPEED, cmd.DO_SET_HOME, cmd.DO_SET_SERVO, cmd.DO_SET_ACTUATOR, cmd.DO_LAND_START,
        cmd.DO_SET_ROI_NONE, cmd.DO_CONTROL_VIDEO, cmd.DO_SET_ROI, cmd.DO_DIGICAM_CONTROL,
        cmd.DO_MOUNT_CONFIGURE, cmd.DO_MOUNT_CONTROL, cmd.DO_SET_CAM_TRIGG_DIST, cmd.DO_GRIPPER,
        cmd.DO_AUTOTUNE_ENABLE, cmd.DO_SET_CAM_TRIGG_INTERVAL, cmd.OBLIQUE_SURVEY, cmd.COMPONENT_ARM_DISARM,
        cmd.SET_CAMERA_MODE, cmd.SET_CAMERA_ZOOM, cmd.SET_CAMERA_FOCUS, cmd.SET_CAMERA_SOURCE,
        cmd.DO_GIMBAL_MANAGER_PITCHYAW, cmd.DO_GIMBAL_MANAGER_CONFIGURE, cmd.IMAGE_START_CAPTURE,
        cmd.IMAGE_STOP_CAPTURE, cmd.DO_TRIGGER_CONTROL, cmd.VIDEO_START_CAPTURE, cmd.VIDEO_STOP_CAPTURE,
        cmd.DO_VTOL_TRANSITION, cmd.DO_WINCH,
    }
)  # fmt: skip
"""Commands that PX4 accepts in MAV_FRAME_MISSION (2); commands outside of `LOCATED`, in no other frame."""

KEPT_WHOLE = frozenset({cmd.POLYGON_IN, cmd.POLYGON_OUT, cmd.CIRCLE_IN, cmd.CIRCLE_OUT, cmd.RALLY_POINT})
_FENCE = range(cmd.FENCE_RETURN_POINT, cmd.CIRCLE_OUT + 1)

YAW_COMMANDS = frozenset(command for command, rule in LOCATED.items() if rule[3] is yaw)
"""Commands whose param4 PX4 converts to radians; a compiler may contract the product, so it is compared as an angle."""


def refused_by_px4(item: MissionItem) -> str:
    """Return why PX4 refuses ``item`` on upload; empty if it accepts it."""
    frame = FRAME_SYNONYMS.get(item.frame, item.frame)
    if frame not in (GLOBAL, RELATIVE, NO_POSITION):
        return f"PX4 takes no item in frame {item.frame}" + (" (above terrain)" if frame == TERRAIN else "")
    if item.command in KEPT_WHOLE:
        return f"PX4 takes command {item.command} in a fence or among rally points alone"
    known = PLACELESS if frame == NO_POSITION else LOCATED
    if item.command in known:
        modes = (0.0, 1.0, 2.0) if frame == NO_POSITION else (0.0, 3.0)
        refused = item.command in (cmd.ROI, cmd.DO_SET_ROI) and (
            not math.isfinite(item.params[0]) or math.trunc(item.params[0]) not in modes
        )
        return (
            f"PX4 takes no region of interest of the kind {item.params[0]:g} in frame {item.frame}" if refused else ""
        )
    other = LOCATED if frame == NO_POSITION else PLACELESS
    if item.command in other:
        frames = "frame 2 (without a place)" if frame != NO_POSITION else "a frame with a place (0 or 3)"
        return f"PX4 takes command {item.command} in {frames} alone, and it is in frame {item.frame}"
    return f"PX4 does not take command {item.command} in a mission"


def stored_by_px4(item: MissionItem) -> MissionItem:
    """Return ``item`` as it reads back from PX4 in MISSION_ITEM_INT, with frames 5 and 6 written as 0 and 3."""
    frame = FRAME_SYNONYMS.get(item.frame, item.frame)
    command = cmd.DO_SET_ROI if item.command == cmd.ROI else item.command
    if frame == NO_POSITION:
        params = item.params
        if item.command == cmd.DO_JUMP:
            params = (_i16(params[0]), _u16(params[1]), params[2], params[3])
        x, y = (max(-(2**31), min(2**31 - 1, round(float32(v)))) for v in (item.x, item.y))
        return MissionItem(command, frame, params, x, y, item.z, item.autocontinue)
    rule = LOCATED.get(item.command, (_f32, _f32, _f32, _f32))
    p1, p2, p3, p4 = (keep(value) for keep, value in zip(rule, item.params, strict=True))
    if item.command in _FENCE:  # a fence point is stored without "relative" and autocontinue
        return MissionItem(item.command, GLOBAL, (p1, p2, p3, p4), item.x, item.y, item.z, False)
    return MissionItem(command, frame, (p1, p2, p3, p4), item.x, item.y, item.z, item.autocontinue)
