"""An item as PX4 stores it: floats unchanged, but only the params that a command uses.

Source: PX4 ``mavlink_mission.cpp`` (`parse_mavlink_mission_item`, `format_mavlink_mission_item`) and ``navigation.h``.
"""

from __future__ import annotations

import math
from collections.abc import Container

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import FENCE, MISSION, NO_POSITION, RALLY, MissionItem, float32
from gcsplan.sim.vehicle.stored_lists import (
    ERROR,
    INVALID_PARAM1,
    NOTHING_KEPT,
    UNSUPPORTED,
    UNSUPPORTED_FRAME,
    ItemRefused,
    ParamsKept,
    as_flag,
    as_sent,
    lost,
)


def _u16(value: float) -> float:
    return float(int(value) & 0xFFFF) if math.isfinite(value) and abs(value) < 2**31 else 0.0


def _i16(value: float) -> float:
    return (_u16(value) + 32768.0) % 65536.0 - 32768.0


def _heading(degrees: float) -> float:
    """Convert degrees to float32 radians in 0 … 2π and back: −90 becomes 270; 10 becomes 10 or an adjacent float32."""
    radians = float32(degrees * float32(float32(math.pi) / 180.0))
    if not math.isfinite(radians):
        return math.nan
    full = 2.0 * float32(math.pi)
    if not 0.0 <= radians < full:
        radians = float32(radians - float32(full * math.floor(radians / full)))
    return float32(radians * float32(180.0 / float32(math.pi)))


def _vertices(value: float) -> float:
    return _u16(value + 0.5)


_HEADING_ONLY = (lost, lost, lost, _heading)

# Commands with a location, in frames 0, 3, 5, 6: how each param reads back.
_PX4_LOCATED: dict[int, ParamsKept] = {
    cmd.WAYPOINT: (as_sent, as_sent, lost, _heading),  # waypoint: hold, acceptance radius
    cmd.LOITER_UNLIM: (lost, lost, as_sent, _heading),  # loiter unlimited
    cmd.LOITER_TIME: (as_sent, as_flag, as_sent, as_flag),  # loiter time
    cmd.LAND: (lost, _u16, lost, _heading),  # land: precision
    cmd.TAKEOFF: _HEADING_ONLY,  # take-off
    cmd.LOITER_TO_ALT: (as_flag, as_sent, lost, as_flag),
    cmd.VTOL_TAKEOFF: _HEADING_ONLY,
    cmd.VTOL_LAND: _HEADING_ONLY,
    cmd.ROI: NOTHING_KEPT,
    cmd.DO_SET_ROI: NOTHING_KEPT,
    cmd.DO_SET_ROI_LOCATION: NOTHING_KEPT,
    cmd.DO_AUTOTUNE_ENABLE: NOTHING_KEPT,
    cmd.COMPONENT_ARM_DISARM: NOTHING_KEPT,
    cmd.CONDITION_GATE: NOTHING_KEPT,
    cmd.FENCE_RETURN_POINT: NOTHING_KEPT,
    cmd.POLYGON_IN: (_vertices, lost, lost, lost),
    cmd.POLYGON_OUT: (_vertices, lost, lost, lost),
    cmd.CIRCLE_IN: (as_sent, lost, lost, lost),
    cmd.CIRCLE_OUT: (as_sent, lost, lost, lost),
    cmd.RALLY_POINT: NOTHING_KEPT,
}

# Commands that PX4 accepts only in frame 2.
_PX4_PLACELESS = frozenset({
        cmd.RTL, cmd.ROI, cmd.DELAY, cmd.CONDITION_DELAY, cmd.CONDITION_DISTANCE, cmd.DO_JUMP, cmd.DO_CHANGE_SPEED,
        cmd.DO_SET_HOME, cmd.DO_SET_SERVO, cmd.DO_SET_ACTUATOR, cmd.DO_LAND_START, cmd.DO_SET_ROI_NONE,
        cmd.DO_CONTROL_VIDEO, cmd.DO_SET_ROI, cmd.DO_DIGICAM_CONTROL, cmd.DO_MOUNT_CONFIGURE,
        cmd.DO_MOUNT_CONTROL, cmd.DO_SET_CAM_TRIGG_DIST, cmd.DO_GRIPPER, cmd.DO_AUTOTUNE_ENABLE,
        cmd.DO_SET_CAM_TRIGG_INTERVAL, cmd.OBLIQUE_SURVEY, cmd.COMPONENT_ARM_DISARM, cmd.SET_CAMERA_MODE,
        cmd.SET_CAMERA_ZOOM, cmd.SET_CAMERA_FOCUS, cmd.SET_CAMERA_SOURCE, cmd.DO_GIMBAL_MANAGER_PITCHYAW,
        cmd.DO_GIMBAL_MANAGER_CONFIGURE, cmd.IMAGE_START_CAPTURE, cmd.IMAGE_STOP_CAPTURE,
        cmd.DO_TRIGGER_CONTROL, cmd.VIDEO_START_CAPTURE, cmd.VIDEO_STOP_CAPTURE, cmd.DO_VTOL_TRANSITION,
        cmd.DO_WINCH,
    })  # fmt: skip

_FENCE_AND_RALLY = frozenset({cmd.POLYGON_IN, cmd.POLYGON_OUT, cmd.CIRCLE_IN, cmd.CIRCLE_OUT, cmd.RALLY_POINT})
_IN_INT_MODE = {0: 5, 5: 5, 3: 6, 6: 6}


def keep_item(item: MissionItem, mission_type: int, *, unknown: Container[int] = ()) -> MissionItem:
    """Return ``item`` as it reads back in MISSION_ITEM_INT: frames 0 and 3 become 5 and 6. Raises `ItemRefused`.

    ``unknown``: commands that this version does not know yet.
    """
    kept = _kept(item)
    if item.command in unknown:
        raise ItemRefused(UNSUPPORTED)
    if mission_type == MISSION and item.command in _FENCE_AND_RALLY:
        raise ItemRefused(ERROR)
    if mission_type == FENCE:
        if item.command in (cmd.POLYGON_IN, cmd.POLYGON_OUT) and kept.params[0] < 3:
            raise ItemRefused(ERROR)
        if kept.frame != NO_POSITION:
            # PX4 stores neither "relative to home" nor autocontinue with a fence point.
            return MissionItem(kept.command, 5, kept.params, kept.x, kept.y, kept.z, autocontinue=False)
    return kept


def _kept(item: MissionItem) -> MissionItem:
    if item.frame == NO_POSITION:
        if item.command not in _PX4_PLACELESS:
            raise ItemRefused(UNSUPPORTED)
        _need_mode(item, (0, 1, 2))
        params = item.params
        if item.command == cmd.DO_JUMP:
            params = (_i16(params[0]), _u16(params[1]), params[2], params[3])
        x, y = _through_float(item.x), _through_float(item.y)  # PX4 stores them as float32 in this frame
        return MissionItem(_renamed(item), NO_POSITION, params, x, y, item.z, item.autocontinue)
    if item.frame not in _IN_INT_MODE:
        raise ItemRefused(UNSUPPORTED_FRAME)
    if item.command not in _PX4_LOCATED:
        raise ItemRefused(UNSUPPORTED)
    _need_mode(item, (0, 3))
    first, second, third, fourth = (
        keep(value) for keep, value in zip(_PX4_LOCATED[item.command], item.params, strict=True)
    )
    frame = _IN_INT_MODE[item.frame]
    return MissionItem(_renamed(item), frame, (first, second, third, fourth), item.x, item.y, item.z, item.autocontinue)


def _need_mode(item: MissionItem, modes: tuple[int, ...]) -> None:
    """Refuse a region of interest whose mode, param1, does not go with its frame."""
    mode = item.params[0]
    if item.command in (cmd.ROI, cmd.DO_SET_ROI) and (not math.isfinite(mode) or int(mode) not in modes):
        raise ItemRefused(INVALID_PARAM1)


def _renamed(item: MissionItem) -> int:
    """The command as stored: the older name of a region of interest becomes the newer one."""
    return cmd.DO_SET_ROI if item.command == cmd.ROI else item.command


def _through_float(value: int) -> int:
    return max(-(2**31), min(2**31 - 1, round(float32(value))))


def most_items(mission_type: int) -> int:
    """Return the most items that COUNT may announce."""
    return {MISSION: 2000, FENCE: 64, RALLY: 32}[mission_type]
