"""A mission item as ArduPilot stores it: 15 bytes per item, so some numbers read back differently.

Source: ArduPilot 4.6, ``AP_Mission.cpp`` (`mavlink_int_to_mission_cmd`, `mission_cmd_to_mavlink_int`, the packed
structs of ``AP_Mission.h``), ``MissionItemProtocol_Fence.cpp`` and ``MissionItemProtocol_Rally.cpp``. The common
commands were also uploaded to an ArduCopter 4.6.0 in SITL and read back.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import FRAME_SYNONYMS, GLOBAL, NO_POSITION, MissionItem, NumberKept, float32

Params = tuple[float, float, float, float]
FLT_EPSILON = 1.1920929e-07
_CM_PER_M = 100.0
_M_PER_CM = float32(0.01)


# ── C's conversions ───────────────────────────────────────────────────────────────────────────────────────────────


def _whole(value: float) -> int:
    """``(int32_t)value``: truncate towards zero. C does not define it beyond int32; x86 gives INT_MIN, as here."""
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


# ── params with their own packing ─────────────────────────────────────────────────────────────────────────────────


def _radius_u16(value: float) -> float:
    """A radius stored in 16 bits, with the turning direction in a flag."""
    return math.copysign(_u16(abs(value)), -1.0 if value < 0 else 1.0)


def _direction(value: float) -> float:
    """A loiter radius of which only the sign is stored."""
    return -1.0 if value < 0 else 1.0


def _land_direction(value: float) -> float:
    """NAV_LAND's yaw, also stored as a flag, so that 0 and NaN read back as 1."""
    return -1.0 if value <= -FLT_EPSILON else 1.0


def _byte(value: float) -> float:
    """ArduPlane's acceptance radius and pass-by distance, stored as whole metres up to 255."""
    return min(255.0, _u16(value))


def _loiter_turns(params: Params) -> Params:
    """Turns and radius, which share 16 bits, with flags for the direction, turns below one and radii beyond 255 m.

    Negative turns overflow into the radius' byte, as they do on board.
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
    """Return the whole centimetres that ArduPilot stores: a float32 product, truncated towards zero."""
    return _whole(float32(float32(altitude_m) * _CM_PER_M))


def read_back_altitudes(cm: int) -> tuple[float, float]:
    """Return stored centimetres as they read back, float32 metres: ``* 0.01f`` today, ``/ 100.0f`` before 4.1."""
    return float32(float32(cm) * _M_PER_CM), float32(cm / 100.0)


# ── the table ─────────────────────────────────────────────────────────────────────────────────────────────────────


class StorageRule(NamedTuple):
    """The stored parts of param1 … param4; ``located``: latitude, longitude, altitude and frame are stored too."""

    located: bool
    params: tuple[NumberKept, NumberKept, NumberKept, NumberKept]


def _at(p1: NumberKept = _lost, p2: NumberKept = _lost, p3: NumberKept = _lost, p4: NumberKept = _lost) -> StorageRule:
    return StorageRule(True, (p1, p2, p3, p4))


def _do(p1: NumberKept = _lost, p2: NumberKept = _lost, p3: NumberKept = _lost, p4: NumberKept = _lost) -> StorageRule:
    return StorageRule(False, (p1, p2, p3, p4))


STORAGE_RULES: dict[int, StorageRule] = {
    cmd.WAYPOINT: _at(_u16),  # hold (ArduPlane: `_PLANE_WAYPOINT`)
    cmd.LOITER_UNLIM: _at(p3=_radius_u16),
    cmd.LOITER_TURNS: _at(),  # `_loiter_turns`
    cmd.LOITER_TIME: _at(_u16, p3=_direction, p4=_flag),
    cmd.RTL: _do(),
    cmd.LAND: _at(_u16, p4=_land_direction),
    cmd.TAKEOFF: _at(_u16),
    cmd.CONTINUE_AND_CHANGE_ALT: _at(_u16),
    cmd.LOITER_TO_ALT: _at(p2=_radius_u16, p4=_flag),
    cmd.SPLINE_WAYPOINT: _at(_u16),  # ArduPlane refuses it
    cmd.ALTITUDE_WAIT: _do(_f32, _f32, _u8),
    cmd.VTOL_TAKEOFF: _at(),
    cmd.VTOL_LAND: _at(_u16),
    cmd.GUIDED_ENABLE: _at(_u16),
    cmd.DELAY: _do(_f32, _i8, _i8, _i8),
    cmd.PAYLOAD_PLACE: _at(_payload_descent),
    cmd.CONDITION_DELAY: _do(_f32),
    cmd.CONDITION_DISTANCE: _do(_f32),
    cmd.CONDITION_YAW: _do(_f32, _f32, _i8, _u8),
    cmd.DO_JUMP: _do(_u16, _i16),
    cmd.DO_CHANGE_SPEED: _do(_u8, _f32, _f32),
    cmd.DO_SET_HOME: _at(_u16),
    cmd.DO_SET_RELAY: _do(_u8, _u8),
    cmd.DO_REPEAT_RELAY: _do(_u8, _i16, _f32),
    cmd.DO_SET_SERVO: _do(_u8, _u16),
    cmd.DO_REPEAT_SERVO: _do(_u8, _u16, _i16, _f32),
    cmd.DO_RETURN_PATH_START: _at(),
    cmd.DO_LAND_START: _at(),
    cmd.DO_GO_AROUND: _at(),
    cmd.DO_PAUSE_CONTINUE: _do(_u16),
    cmd.DO_SET_REVERSE: _do(_u16),
    cmd.DO_SET_ROI_LOCATION: _at(_u16),
    cmd.DO_SET_ROI_NONE: _do(_u16),
    cmd.DO_SET_ROI: _at(_u16),
    cmd.DO_SET_CAM_TRIGG_DIST: _do(_f32, p3=_u8),
    cmd.DO_FENCE_ENABLE: _do(_u16),
    cmd.DO_PARACHUTE: _do(_u16),
    cmd.DO_INVERTED_FLIGHT: _do(_u16),
    cmd.DO_GRIPPER: _do(_u8, _u8),
    cmd.DO_AUTOTUNE_ENABLE: _do(_u16),
    cmd.SET_YAW_SPEED: _do(_f32, _f32, _u8),
    cmd.DO_SET_RESUME_REPEAT_DIST: _do(_u16),
    cmd.DO_SPRAYER: _do(_u16),
    cmd.DO_SEND_SCRIPT_MESSAGE: _do(_u16, _f32, _f32, _f32),
    cmd.DO_AUX_FUNCTION: _do(_u16, _u8),
    cmd.DO_GUIDED_LIMITS: _do(_u16, _f32, _f32, _f32),
    cmd.SET_CAMERA_ZOOM: _do(_u8, _f32),
    cmd.SET_CAMERA_FOCUS: _do(_u8, _f32),
    cmd.SET_CAMERA_SOURCE: _do(_u8, _u8, _u8),
    cmd.JUMP_TAG: _do(_u16),
    cmd.DO_JUMP_TAG: _do(_u16, _i16),
    cmd.IMAGE_START_CAPTURE: _do(_u8, _f32, _u16, _u16),
    cmd.IMAGE_STOP_CAPTURE: _do(_u16),
    cmd.VIDEO_START_CAPTURE: _do(_u8),
    cmd.VIDEO_STOP_CAPTURE: _do(_u8),
    cmd.DO_VTOL_TRANSITION: _do(_u8),
    cmd.DO_WINCH: _do(_u8, _u8, _f32, _f32),
}
_PLANE_WAYPOINT = _at(p2=_byte, p3=_byte)

_FENCE_VERTEX, _FENCE_CIRCLE = (cmd.POLYGON_IN, cmd.POLYGON_OUT), (cmd.CIRCLE_IN, cmd.CIRCLE_OUT)


NAN_TAKEN = {
    cmd.WAYPOINT: (3,), cmd.LOITER_UNLIM: (3,), cmd.LAND: (3,), cmd.TAKEOFF: (3,), cmd.VTOL_TAKEOFF: (3,),
    cmd.VTOL_LAND: (2, 3),
}  # fmt: skip
"""Indices of the params that may be NaN, by command (`mavlink_int_to_mission_cmd`, `sanity_check_params`)."""

_FRAMES_KEPT = (0, 2, 3, 5, 6, 10, 11)

MOST_ALTITUDE_M = 83_000.0
"""ArduPilot stores altitudes in 24 bits of centimetres and refuses this and more (`LOCATION_ALT_MAX_M`)."""

_OF_INTEGERS = frozenset({_u8, _u16, _i8, _i16, _radius_u16, _byte})
_MOST_CONVERTED = 2.0**31
"""C does not say what an integer of a larger float is: a hold of 1e10 s is none on one processor, 18 h on another."""


def refused_by_copter(item: MissionItem) -> str:
    """Return why ArduCopter refuses ``item`` on upload; empty if it accepts it or is not known to refuse it."""
    for index, value in enumerate(item.params):
        if math.isinf(value) or (math.isnan(value) and index not in NAN_TAKEN.get(item.command, ())):
            return f"ArduPilot refuses param{index + 1} of command {item.command}, which is {value}"
    rule = STORAGE_RULES.get(item.command)
    if rule is None:
        return ""
    for number in _in_integers(item.command, rule):
        if abs(value := item.params[number - 1]) >= _MOST_CONVERTED:
            return (
                f"param{number} of command {item.command} is {value:g}, of which each processor stores something else"
            )
    if not rule.located:
        return ""
    if item.frame not in _FRAMES_KEPT:
        return f"ArduPilot takes no item in frame {item.frame}"
    if math.isnan(item.z):
        return f"ArduPilot refuses an altitude of {item.z}"
    return f"ArduPilot refuses an altitude of {item.z:g} m" if abs(item.z) >= MOST_ALTITUDE_M else ""


def _in_integers(command: int, rule: StorageRule) -> tuple[int, ...]:
    """Numbers of the params that are stored as integers."""
    if command == cmd.LOITER_TURNS:
        return 1, 3
    return tuple(number for number, keep in enumerate(rule.params, start=1) if keep in _OF_INTEGERS)


def refused_by_plane(item: MissionItem) -> str:
    """Return why ArduPlane refuses ``item`` on upload; empty if it accepts it or is not known to refuse it."""
    if item.command == cmd.SPLINE_WAYPOINT:
        return "ArduPlane takes no splines (command 82)"
    return refused_by_copter(item)


def stored_by_copter(item: MissionItem) -> MissionItem:
    """Return ``item`` as it reads back from ArduCopter."""
    return _stored(item, STORAGE_RULES.get(item.command))


def stored_by_plane(item: MissionItem) -> MissionItem:
    """Return ``item`` as it reads back from ArduPlane."""
    return _stored(item, _PLANE_WAYPOINT if item.command == cmd.WAYPOINT else STORAGE_RULES.get(item.command))


def _stored(item: MissionItem, rule: StorageRule | None) -> MissionItem:
    frame = FRAME_SYNONYMS.get(item.frame, item.frame)
    if item.command in _FENCE_VERTEX or item.command in _FENCE_CIRCLE or item.command == cmd.FENCE_RETURN_POINT:
        return _stored_fence(item)
    if item.command == cmd.RALLY_POINT:
        return MissionItem(item.command, frame, (0.0, 0.0, 0.0, 0.0), item.x, item.y, _i16(item.z), False)
    if frame == NO_POSITION:
        frame = GLOBAL
    if rule is None:  # unknown command: expect the same numbers back, so that every difference is reported
        altitude_m = read_back_altitudes(stored_cm(item.z))[0]
        return MissionItem(item.command, frame, item.params, item.x, item.y, altitude_m)
    p1, p2, p3, p4 = (keep(value) for keep, value in zip(rule.params, item.params, strict=True))
    if item.command == cmd.LOITER_TURNS:
        p1, p2, p3, p4 = _loiter_turns(item.params)
    if not rule.located:
        return MissionItem(item.command, GLOBAL, (p1, p2, p3, p4))
    altitude_m = read_back_altitudes(stored_cm(item.z))[0]
    return MissionItem(item.command, frame, (p1, p2, p3, p4), item.x, item.y, altitude_m)


def _stored_fence(item: MissionItem) -> MissionItem:
    """Return a fence point as it reads back: location and param1 are stored; frame, altitude, autocontinue read 0."""
    first = item.params[0]
    if item.command in _FENCE_VERTEX:
        first = _u8(first)
    elif item.command in _FENCE_CIRCLE and 0 < first < 2**31 and first - int(first) < 0.001:
        first = float32(float(int(first)))  # a radius less than 1 mm above whole metres is stored as an integer
    elif item.command == cmd.FENCE_RETURN_POINT:
        first = 0.0
    return MissionItem(item.command, GLOBAL, (first, 0.0, 0.0, 0.0), item.x, item.y, 0.0, False)
