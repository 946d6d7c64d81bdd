"""What ArduPilot makes of a mission item: 15 bytes of storage each, so numbers come back other than they were sent.

Source: ArduPilot 4.6, ``AP_Mission.cpp`` (`mavlink_int_to_mission_cmd`, `mission_cmd_to_mavlink_int`, the packed
structs of ``AP_Mission.h``), ``MissionItemProtocol_Fence.cpp`` and ``MissionItemProtocol_Rally.cpp``; the common
commands were uploaded to and read back from an ArduCopter 4.6.0 in SITL.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from gcsplan.mavlink.mission.mission import (
    FRAME_SYNONYMS,
    GLOBAL,
    LOITER_TURNS,
    NO_POSITION,
    WAYPOINT,
    MissionItem,
    float32,
)

Keep = Callable[[float], float]
Params = tuple[float, float, float, float]
FLT_EPSILON = 1.1920929e-07
_CM_PER_M = 100.0
_M_PER_CM = float32(0.01)


# ── C's conversions ───────────────────────────────────────────────────────────────────────────────────────────────


def _whole(value: float) -> int:
    """``(int32_t)value``: towards zero. Beyond int32 C leaves it open; x86 gives INT_MIN, as here."""
    return int(value) if abs(value) < 2**31 else -(2**31)  # NaN compares False


def _u8(value: float) -> float:
    return float(_whole(value) & 0xFF)


def _u16(value: float) -> float:
    return float(_whole(value) & 0xFFFF)


def _i8(value: float) -> float:
    return float((_whole(value) + 0x80 & 0xFF) - 0x80)


def _i16(value: float) -> float:
    return float((_whole(value) + 0x8000 & 0xFFFF) - 0x8000)


def _f32(value: float) -> float:
    return value


def _lost(value: float) -> float:
    return 0.0


def _flag(value: float) -> float:
    return 1.0 if value > 0 else 0.0


# ── params that are packed in a way of their own ──────────────────────────────────────────────────────────────────


def _radius_u16(value: float) -> float:
    """A radius in 16 bits, its turning direction in a flag."""
    return math.copysign(_u16(abs(value)), -1.0 if value < 0 else 1.0)


def _direction(value: float) -> float:
    """Of a loiter's radius the sign alone is kept."""
    return -1.0 if value < 0 else 1.0


def _land_direction(value: float) -> float:
    """NAV_LAND's yaw: a flag as well, so that 0 and NaN read back as 1."""
    return -1.0 if value <= -FLT_EPSILON else 1.0


def _byte(value: float) -> float:
    """ArduPlane's acceptance radius and pass-by distance: whole metres up to 255."""
    return min(255.0, _u16(value))


def _loiter_turns(params: Params) -> Params:
    """Turns and radius share 16 bits, with flags for the direction, for turns below one and for radii beyond 255 m.

    Negative turns spill into the radius' byte, as they do on board.
    """
    turns, _, radius, _ = params
    fraction = 0 < turns < 1
    small = abs(radius) <= 255
    low = int(_u16(min(255.0, float32(turns * 256.0) if fraction else turns)))
    both = low | int(_u8(abs(radius) if small else min(255.0, abs(radius) * 0.1))) << 8
    size = float(both >> 8) * (1.0 if small else 10.0)
    kept_turns = float(both & 0xFF) / (256.0 if fraction else 1.0)
    return kept_turns, 0.0, -size if radius < 0 else size, _flag(params[3])


def _payload_descent(value: float) -> float:
    return float32(_u16(float32(value * 100.0)) * _M_PER_CM)


def stored_cm(altitude_m: float) -> int:
    """The whole centimetres that ArduPilot keeps of ``altitude_m``: a float32 product, cut towards zero."""
    return _whole(float32(float32(altitude_m) * _CM_PER_M))


def read_back_altitudes(cm: int) -> tuple[float, float]:
    """How stored centimetres read back, metres as float32: ``* 0.01f`` today, ``/ 100.0f`` before 4.1."""
    return float32(float32(cm) * _M_PER_CM), float32(cm / 100.0)


# ── the table ─────────────────────────────────────────────────────────────────────────────────────────────────────


class Rule(NamedTuple):
    """What is kept of param1 … param4; ``located``: latitude, longitude, altitude and frame are kept too."""

    located: bool
    params: tuple[Keep, Keep, Keep, Keep]


def _at(p1: Keep = _lost, p2: Keep = _lost, p3: Keep = _lost, p4: Keep = _lost) -> Rule:
    return Rule(True, (p1, p2, p3, p4))


def _do(p1: Keep = _lost, p2: Keep = _lost, p3: Keep = _lost, p4: Keep = _lost) -> Rule:
    return Rule(False, (p1, p2, p3, p4))


RULES: dict[int, Rule] = {
    16: _at(_u16),  # NAV_WAYPOINT: hold (ArduPlane: below)
    17: _at(p3=_radius_u16),  # NAV_LOITER_UNLIM
    18: _at(),  # NAV_LOITER_TURNS: `_loiter_turns`
    19: _at(_u16, p3=_direction, p4=_flag),  # NAV_LOITER_TIME
    20: _do(),  # NAV_RETURN_TO_LAUNCH
    21: _at(_u16, p4=_land_direction),  # NAV_LAND
    22: _at(_u16),  # NAV_TAKEOFF
    30: _at(_u16),  # NAV_CONTINUE_AND_CHANGE_ALT
    31: _at(p2=_radius_u16, p4=_flag),  # NAV_LOITER_TO_ALT
    82: _at(_u16),  # NAV_SPLINE_WAYPOINT (ArduPlane refuses it)
    83: _do(_f32, _f32, _u8),  # NAV_ALTITUDE_WAIT
    84: _at(),  # NAV_VTOL_TAKEOFF
    85: _at(_u16),  # NAV_VTOL_LAND
    92: _at(_u16),  # NAV_GUIDED_ENABLE
    93: _do(_f32, _i8, _i8, _i8),  # NAV_DELAY
    94: _at(_payload_descent),  # NAV_PAYLOAD_PLACE
    112: _do(_f32),  # CONDITION_DELAY
    114: _do(_f32),  # CONDITION_DISTANCE
    115: _do(_f32, _f32, _i8, _u8),  # CONDITION_YAW
    177: _do(_u16, _i16),  # DO_JUMP
    178: _do(_u8, _f32, _f32),  # DO_CHANGE_SPEED
    179: _at(_u16),  # DO_SET_HOME
    181: _do(_u8, _u8),  # DO_SET_RELAY
    182: _do(_u8, _i16, _f32),  # DO_REPEAT_RELAY
    183: _do(_u8, _u16),  # DO_SET_SERVO
    184: _do(_u8, _u16, _i16, _f32),  # DO_REPEAT_SERVO
    188: _at(),  # DO_RETURN_PATH_START
    189: _at(),  # DO_LAND_START
    191: _at(),  # DO_GO_AROUND
    193: _do(_u16),  # DO_PAUSE_CONTINUE
    194: _do(_u16),  # DO_SET_REVERSE
    195: _at(_u16),  # DO_SET_ROI_LOCATION
    197: _do(_u16),  # DO_SET_ROI_NONE
    201: _at(_u16),  # DO_SET_ROI
    206: _do(_f32, p3=_u8),  # DO_SET_CAM_TRIGG_DIST
    207: _do(_u16),  # DO_FENCE_ENABLE
    208: _do(_u16),  # DO_PARACHUTE
    210: _do(_u16),  # DO_INVERTED_FLIGHT
    211: _do(_u8, _u8),  # DO_GRIPPER
    212: _do(_u16),  # DO_AUTOTUNE_ENABLE
    213: _do(_f32, _f32, _u8),  # NAV_SET_YAW_SPEED
    215: _do(_u16),  # DO_SET_RESUME_REPEAT_DIST
    216: _do(_u16),  # DO_SPRAYER
    217: _do(_u16, _f32, _f32, _f32),  # DO_SEND_SCRIPT_MESSAGE
    218: _do(_u16, _u8),  # DO_AUX_FUNCTION
    222: _do(_u16, _f32, _f32, _f32),  # DO_GUIDED_LIMITS
    531: _do(_u8, _f32),  # SET_CAMERA_ZOOM
    532: _do(_u8, _f32),  # SET_CAMERA_FOCUS
    534: _do(_u8, _u8, _u8),  # SET_CAMERA_SOURCE
    600: _do(_u16),  # JUMP_TAG
    601: _do(_u16, _i16),  # DO_JUMP_TAG
    2000: _do(_u8, _f32, _u16, _u16),  # IMAGE_START_CAPTURE
    2001: _do(_u16),  # IMAGE_STOP_CAPTURE
    2500: _do(_u8),  # VIDEO_START_CAPTURE
    2501: _do(_u8),  # VIDEO_STOP_CAPTURE
    3000: _do(_u8),  # DO_VTOL_TRANSITION
    42600: _do(_u8, _u8, _f32, _f32),  # DO_WINCH
}
_PLANE_WAYPOINT = _at(p2=_byte, p3=_byte)

_FENCE_VERTEX, _FENCE_CIRCLE, _FENCE_RETURN, _RALLY = (5001, 5002), (5003, 5004), 5000, 5100


NAN_TAKEN = {16: (3,), 17: (3,), 21: (3,), 22: (3,), 84: (3,), 85: (2, 3)}
"""Commands of which a param (by index) may be NaN (`mavlink_int_to_mission_cmd`, `sanity_check_params`)."""

_FRAMES = (0, 2, 3, 5, 6, 10, 11)
SPLINE_WAYPOINT = 82


def refused_by_copter(item: MissionItem) -> str:
    """Why ArduCopter refuses ``item`` on upload; empty where it takes it, or is not known to refuse it."""
    for index, value in enumerate(item.params):
        if math.isinf(value) or (math.isnan(value) and index not in NAN_TAKEN.get(item.command, ())):
            return f"ArduPilot refuses param{index + 1} of command {item.command}, which is {value}"
    rule = RULES.get(item.command)
    if rule is None or not rule.located:
        return ""
    if item.frame not in _FRAMES:
        return f"ArduPilot takes no item in frame {item.frame}"
    return f"ArduPilot refuses an altitude of {item.z}" if math.isnan(item.z) else ""


def refused_by_plane(item: MissionItem) -> str:
    """Why ArduPlane refuses ``item`` on upload; empty where it takes it, or is not known to refuse it."""
    if item.command == SPLINE_WAYPOINT:
        return "ArduPlane takes no splines (command 82)"
    return refused_by_copter(item)


def stored_by_copter(item: MissionItem) -> MissionItem:
    """``item`` as ArduCopter reads it back."""
    return _stored(item, RULES.get(item.command))


def stored_by_plane(item: MissionItem) -> MissionItem:
    """``item`` as ArduPlane reads it back."""
    return _stored(item, _PLANE_WAYPOINT if item.command == WAYPOINT else RULES.get(item.command))


def _stored(item: MissionItem, rule: Rule | None) -> MissionItem:
    frame = FRAME_SYNONYMS.get(item.frame, item.frame)
    if item.command in _FENCE_VERTEX or item.command in _FENCE_CIRCLE or item.command == _FENCE_RETURN:
        return _stored_fence(item)
    if item.command == _RALLY:
        return MissionItem(item.command, frame, (0.0, 0.0, 0.0, 0.0), item.x, item.y, _i16(item.z), False)
    located = MissionItem(
        item.command,
        GLOBAL if frame == NO_POSITION else frame,
        item.params,
        item.x,
        item.y,
        read_back_altitudes(stored_cm(item.z))[0],
    )
    if rule is None:  # not a command that we know: the numbers are expected back, and a difference is named
        return located
    p1, p2, p3, p4 = (keep(value) for keep, value in zip(rule.params, item.params, strict=True))
    if item.command == LOITER_TURNS:
        p1, p2, p3, p4 = _loiter_turns(item.params)
    if not rule.located:
        return MissionItem(item.command, GLOBAL, (p1, p2, p3, p4))
    return MissionItem(item.command, located.frame, (p1, p2, p3, p4), item.x, item.y, located.z)


def _stored_fence(item: MissionItem) -> MissionItem:
    """Fence points keep a place and one number; frame, altitude and autocontinue read back as 0."""
    first = item.params[0]
    if item.command in _FENCE_VERTEX:
        first = _u8(first)
    elif item.command in _FENCE_CIRCLE and 0 < first < 2**31 and first - int(first) < 0.001:
        first = float32(float(int(first)))  # whole metres, to the millimetre, are kept as an integer
    elif item.command == _FENCE_RETURN:
        first = 0.0
    return MissionItem(item.command, GLOBAL, (first, 0.0, 0.0, 0.0), item.x, item.y, 0.0, False)
