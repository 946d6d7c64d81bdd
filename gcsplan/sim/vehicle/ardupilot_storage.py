"""An item as ArduPilot stores it: 15 bytes per item, so some numbers read back differently.

Source: ArduPilot 4.6, ``AP_Mission.cpp`` (`sanity_check_params`, `mavlink_int_to_mission_cmd`,
`mission_cmd_to_mavlink_int`), ``MissionItemProtocol_Fence.cpp``, ``MissionItemProtocol_Rally.cpp``,
``AC_PolyFence_loader.cpp`` and ``StorageManager.cpp``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import FENCE, GLOBAL, MISSION, RALLY, RELATIVE, TERRAIN, Home, MissionItem, float32
from gcsplan.sim.vehicle.stored_lists import (
    INVALID,
    INVALID_PARAM1,
    INVALID_X,
    INVALID_Y,
    INVALID_Z,
    NOTHING_KEPT,
    UNSUPPORTED,
    UNSUPPORTED_FRAME,
    ItemRefused,
    ParamsKept,
    as_flag,
    as_sent,
    lost,
)

FLT_EPSILON = 1.1920929e-07


# ── how one param is stored ───────────────────────────────────────────────────────────────────────────────────────


def _whole(value: float) -> int:
    """C's conversion of float to int32 as compiled for SITL: truncate towards zero; what does not fit is INT_MIN."""
    return int(value) if math.isfinite(value) and abs(value) < 2**31 else -(2**31)


def _u8(value: float) -> float:
    return float(_whole(value) & 0xFF)


def _u16(value: float) -> float:
    return float(_whole(value) & 0xFFFF)


def _i8(value: float) -> float:
    return float((_whole(value) + 0x80 & 0xFF) - 0x80)


def _i16(value: float) -> float:
    return float((_whole(value) + 0x8000 & 0xFFFF) - 0x8000)


def _byte_capped(value: float) -> float:
    return min(255.0, _u16(value))


def _signed_u16(value: float) -> float:
    return math.copysign(_u16(abs(value)), -1.0 if value < 0 else 1.0)


def _sign(value: float) -> float:
    return -1.0 if value < 0 else 1.0


def _land_sign(value: float) -> float:
    return -1.0 if value <= -FLT_EPSILON else 1.0


_FIRST_U16 = (_u16, lost, lost, lost)

# Commands with a location: latitude, longitude, altitude and frame are stored, and each param as listed here.
_ARDUPILOT_LOCATED: dict[int, ParamsKept] = {
    cmd.WAYPOINT: _FIRST_U16,  # waypoint: hold
    cmd.LOITER_UNLIM: (lost, lost, _signed_u16, lost),  # loiter unlimited: radius
    cmd.LOITER_TURNS: NOTHING_KEPT,  # loiter turns: `_loiter_turns`
    cmd.LOITER_TIME: (_u16, lost, _sign, as_flag),  # loiter time
    cmd.LAND: (_u16, lost, lost, _land_sign),  # land: the yaw reads back as 1
    cmd.TAKEOFF: _FIRST_U16,  # take-off
    cmd.CONTINUE_AND_CHANGE_ALT: _FIRST_U16,
    cmd.LOITER_TO_ALT: (lost, _signed_u16, lost, as_flag),
    cmd.SPLINE_WAYPOINT: _FIRST_U16,  # spline waypoint
    cmd.ARC_WAYPOINT: (as_sent, as_sent, as_sent, as_sent),
    cmd.VTOL_TAKEOFF: NOTHING_KEPT,
    cmd.VTOL_LAND: _FIRST_U16,
    cmd.GUIDED_ENABLE: _FIRST_U16,
    cmd.PAYLOAD_PLACE: (lambda p: float32(float32(0.01) * _u16(float32(p * 100.0))), lost, lost, lost),
    cmd.DO_SET_HOME: _FIRST_U16,  # set home
    cmd.DO_RETURN_PATH_START: NOTHING_KEPT,
    cmd.DO_LAND_START: NOTHING_KEPT,
    cmd.DO_GO_AROUND: NOTHING_KEPT,
    cmd.DO_SET_ROI_LOCATION: _FIRST_U16,
    cmd.DO_SET_ROI: _FIRST_U16,
}

# Commands without a location: they read back in frame 0 at 0, 0, 0.
_ARDUPILOT_PLACELESS: dict[int, ParamsKept] = {
    cmd.RTL: NOTHING_KEPT,  # return to launch
    cmd.ALTITUDE_WAIT: (as_sent, as_sent, _u8, lost),
    cmd.DELAY: (as_sent, _i8, _i8, _i8),  # delay: seconds, or hours, minutes, seconds UTC
    cmd.CONDITION_DELAY: (as_sent, lost, lost, lost),
    cmd.CONDITION_DISTANCE: (as_sent, lost, lost, lost),
    cmd.CONDITION_YAW: (as_sent, as_sent, _i8, _u8),
    cmd.DO_JUMP: (_u16, _i16, lost, lost),  # jump
    cmd.DO_CHANGE_SPEED: (_u8, as_sent, as_sent, lost),  # change speed
    cmd.DO_SET_RELAY: (_u8, _u8, lost, lost),
    cmd.DO_REPEAT_RELAY: (_u8, _i16, as_sent, lost),
    cmd.DO_SET_SERVO: (_u8, _u16, lost, lost),
    cmd.DO_REPEAT_SERVO: (_u8, _u16, _i16, as_sent),
    cmd.DO_SET_ROI_NONE: _FIRST_U16,
    cmd.DO_SET_CAM_TRIGG_DIST: (as_sent, lost, _u8, lost),
    cmd.DO_FENCE_ENABLE: _FIRST_U16,
    cmd.DO_PARACHUTE: _FIRST_U16,
    cmd.DO_INVERTED_FLIGHT: _FIRST_U16,
    cmd.DO_GRIPPER: (_u8, _u8, lost, lost),
    cmd.DO_AUTOTUNE_ENABLE: _FIRST_U16,
    cmd.DO_PAUSE_CONTINUE: _FIRST_U16,
    cmd.DO_SET_REVERSE: _FIRST_U16,
    cmd.SET_YAW_SPEED: (as_sent, as_sent, _u8, lost),  # angle, speed, relative
    cmd.DO_SEND_SCRIPT_MESSAGE: (_u16, as_sent, as_sent, as_sent),
    cmd.SET_CAMERA_ZOOM: (_u8, as_sent, lost, lost),
    cmd.SET_CAMERA_FOCUS: (_u8, as_sent, lost, lost),
    cmd.SET_CAMERA_SOURCE: (_u8, _u8, _u8, lost),
    cmd.IMAGE_START_CAPTURE: (_u8, as_sent, _u16, _u16),  # camera, interval, how many, number of the first
    cmd.IMAGE_STOP_CAPTURE: _FIRST_U16,
    cmd.VIDEO_START_CAPTURE: (_u8, lost, lost, lost),
    cmd.VIDEO_STOP_CAPTURE: (_u8, lost, lost, lost),
    cmd.DO_VTOL_TRANSITION: (_u8, lost, lost, lost),
    cmd.DO_WINCH: (_u8, _u8, as_sent, as_sent),
    cmd.DO_SET_RESUME_REPEAT_DIST: _FIRST_U16,
    cmd.DO_SPRAYER: _FIRST_U16,
    cmd.DO_AUX_FUNCTION: (_u16, _u8, lost, lost),
    cmd.DO_GUIDED_LIMITS: (_u16, as_sent, as_sent, as_sent),
    cmd.JUMP_TAG: (_u16, lost, lost, lost),
    cmd.DO_JUMP_TAG: (_u16, _i16, lost, lost),
}

_NAN_ALLOWED = {  # indices of params that may be NaN
    cmd.WAYPOINT: {3}, cmd.LOITER_UNLIM: {3}, cmd.LAND: {3}, cmd.TAKEOFF: {3}, cmd.VTOL_TAKEOFF: {3},
    cmd.VTOL_LAND: {2, 3},
}  # fmt: skip
_FRAME_STORED = {0: GLOBAL, 2: GLOBAL, 5: GLOBAL, 3: RELATIVE, 6: RELATIVE, 10: TERRAIN, 11: TERRAIN}
_ALT_LIMIT_M = 83_000.0


def keep_mission_item(item: MissionItem, *, plane: bool, arcs: bool = False) -> MissionItem:
    """Return ``item`` as it reads back from a mission; ``arcs``: arc way points are known. Raises `ItemRefused`."""
    allowed = _NAN_ALLOWED.get(item.command, set())
    for index, value in enumerate(item.params):
        if math.isinf(value) or (math.isnan(value) and index not in allowed):
            raise ItemRefused(INVALID_PARAM1 + index)
    if item.command in (0, 1):
        raise ItemRefused(INVALID)
    if (plane and item.command == cmd.SPLINE_WAYPOINT) or (item.command == cmd.ARC_WAYPOINT and not arcs):
        raise ItemRefused(UNSUPPORTED)
    if item.command in _ARDUPILOT_PLACELESS:
        keeps = _ARDUPILOT_PLACELESS[item.command]
        return MissionItem(item.command, GLOBAL, _kept_params(keeps, item))
    if item.command not in _ARDUPILOT_LOCATED:
        raise ItemRefused(UNSUPPORTED)
    keeps = _ARDUPILOT_LOCATED[item.command]
    if plane and item.command == cmd.WAYPOINT:
        keeps = (lost, _byte_capped, _byte_capped, lost)
    _need_place(item)
    if math.isnan(item.z) or abs(item.z) >= _ALT_LIMIT_M:
        raise ItemRefused(INVALID_Z)
    if item.frame not in _FRAME_STORED:
        raise ItemRefused(UNSUPPORTED_FRAME)
    return MissionItem(
        item.command, _FRAME_STORED[item.frame], _kept_params(keeps, item), item.x, item.y, in_whole_centimetres(item.z)
    )


def _kept_params(keeps: ParamsKept, item: MissionItem) -> tuple[float, float, float, float]:
    if item.command == cmd.LOITER_TURNS:
        return _loiter_turns(item.params)
    first, second, third, fourth = (keep(value) for keep, value in zip(keeps, item.params, strict=True))
    return first, second, third, fourth


def _loiter_turns(params: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Store turns in the lower byte and the radius in the upper byte of one 16-bit word.

    Less than one turn is stored in 256ths; a radius beyond 255 m in tens of metres; the radius' sign is the direction.
    Negative turns are not kept out of the upper byte: they set all its bits, and the radius reads back as 255.
    """
    turns, _, radius_m, exit_from = params
    part, far = 0 < turns < 1, abs(radius_m) > 255
    word = int(_u16(min(255.0, turns * 256.0 if part else turns)))
    word |= int(_u8(min(255.0, float32(abs(radius_m) * float32(0.1))) if far else abs(radius_m))) << 8
    size_m = (word >> 8) * (10.0 if far else 1.0)
    return (word & 0xFF) / (256.0 if part else 1.0), 0.0, math.copysign(size_m, _sign(radius_m)), as_flag(exit_from)


def _need_place(item: MissionItem) -> None:
    # ArduPilot compares in float32, so the limit is inexact by some units.
    if float32(abs(item.x)) > 9e8:
        raise ItemRefused(INVALID_X)
    if float32(abs(item.y)) > 1.8e9:
        raise ItemRefused(INVALID_Y)


def in_whole_centimetres(altitude_m: float) -> float:
    """Return an altitude as ArduPilot reads it back: times 100 in float32, truncated to cm, times 0.01 in float32."""
    return float32(float32(0.01) * int(float32(float32(altitude_m) * 100.0)))


def home_item(home: Home) -> MissionItem:
    """Return item 0 as it reads back: always the vehicle's home, not the item that was sent."""
    return MissionItem(cmd.WAYPOINT, GLOBAL, x=home.lat_e7, y=home.lon_e7, z=in_whole_centimetres(home.amsl_m))


# ── fences ────────────────────────────────────────────────────────────────────────────────────────────────────────

_VERTEX = {cmd.POLYGON_IN, cmd.POLYGON_OUT}
_CIRCLE = {cmd.CIRCLE_IN, cmd.CIRCLE_OUT}


def keep_fence_item(item: MissionItem, *, whole_radii: bool) -> MissionItem:
    """Return one fence item as it reads back. Raises `ItemRefused` for mistakes that the item alone shows.

    Frame 2 is refused, the altitude is dropped, and frame and autocontinue read back as 0. ``whole_radii``: a radius
    less than 1 mm above whole metres is stored as an integer.
    """
    if item.frame not in _FRAME_STORED or item.frame == 2:
        raise ItemRefused(UNSUPPORTED_FRAME)
    first = item.params[0]
    if item.command in _VERTEX:
        if first > 255:
            raise ItemRefused(INVALID_PARAM1)
        kept = _u8(first)
    elif item.command in _CIRCLE:
        whole = whole_radii and 0 < first < 2**31 and first - int(first) < 0.001
        kept = float(int(first)) if whole else first
    elif item.command == cmd.FENCE_RETURN_POINT:
        kept = 0.0
    else:
        raise ItemRefused(UNSUPPORTED)
    return MissionItem(item.command, GLOBAL, (kept, 0.0, 0.0, 0.0), item.x, item.y, 0.0, autocontinue=False)


def fence_is_valid(items: Sequence[MissionItem], storage_bytes: int) -> bool:
    """Check a whole fence at the end of an upload: complete polygons, positive radii, locations, storage."""
    left, polygon, needed, returns = 0, (0, 0.0), 5, 0
    for item in items:
        first = item.params[0]
        if item.command in _VERTEX:
            if first < 3 or (left and polygon != (item.command, first)):
                return False
            if not left:
                left, polygon = int(first), (item.command, first)
                needed += 2
            left -= 1
            needed += 8
        else:
            returns += item.command == cmd.FENCE_RETURN_POINT
            circle = item.command in _CIRCLE
            # A NaN radius fails here too (it has crashed a build with floating point traps).
            if left or returns > 1 or (circle and not first >= FLT_EPSILON):
                return False
            needed += 13 if circle else 9
        if float32(abs(item.x)) > 9e8 or float32(abs(item.y)) > 1.8e9:
            return False
    return left == 0 and needed <= storage_bytes


# ── rally points ──────────────────────────────────────────────────────────────────────────────────────────────────


def keep_rally_item(item: MissionItem) -> MissionItem:
    """Return a rally point as it reads back: whole metres, no params, autocontinue 0. Raises `ItemRefused`."""
    if item.command != cmd.RALLY_POINT:
        raise ItemRefused(UNSUPPORTED)
    _need_place(item)
    if item.z < -32768 or item.z > 32767:
        raise ItemRefused(INVALID_Z)
    if item.frame not in _FRAME_STORED or item.frame == 2:
        raise ItemRefused(UNSUPPORTED_FRAME)
    return MissionItem(
        item.command, _FRAME_STORED[item.frame], (0.0, 0.0, 0.0, 0.0), item.x, item.y, _i16(item.z), autocontinue=False
    )


# ── storage ───────────────────────────────────────────────────────────────────────────────────────────────────────


def most_items(mission_type: int, *, plane: bool) -> int:
    """Return the most items that COUNT may announce: a 16 KB board's storage, 15 bytes per item, 8 per fence point."""
    copter = {MISSION: 650, FENCE: 70, RALLY: 46}
    return {MISSION: 655, FENCE: 84, RALLY: 50}[mission_type] if plane else copter[mission_type]


def fence_storage_bytes(*, plane: bool) -> int:
    """Return the bytes of storage for a fence: 42 circles on Copter."""
    return 672 if plane else 560
