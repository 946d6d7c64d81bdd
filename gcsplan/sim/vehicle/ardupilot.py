"""ArduPilot's side of the mission protocol, and what it stores of an item.

It keeps three independent lists, requested with the legacy MISSION_REQUEST. It stores 15 bytes per item, so some
numbers read back differently.

Source: ArduPilot 4.6.2 and 4.7 ``MissionItemProtocol.cpp`` with its three subclasses, ``AP_Mission.cpp``
(`sanity_check_params`, `mavlink_int_to_mission_cmd`, `mission_cmd_to_mavlink_int`), ``AC_PolyFence_loader.cpp``,
``StorageManager.cpp`` and ``GCS_Common.cpp``; `firmware` states what differs between the two. `stored_lists` states the
rules of the tables.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import FENCE, GLOBAL, MISSION, RALLY, RELATIVE, TERRAIN, Home, MissionItem, float32
from gcsplan.mavlink.protocol.messages import (
    Ack,
    Address,
    ClearAll,
    Count,
    Item,
    LegacyItem,
    MissionMessage,
    Request,
    RequestList,
)
from gcsplan.sim.vehicle.firmware import COUNTS_EVERY_LIST, KEEPS_HOME, KEEPS_RADII, TAKES_ARCS, Firmware
from gcsplan.sim.vehicle.misbehaviour import Faults
from gcsplan.sim.vehicle.stored_lists import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    ERROR,
    INVALID,
    INVALID_PARAM1,
    INVALID_SEQUENCE,
    INVALID_X,
    INVALID_Y,
    INVALID_Z,
    NO_SPACE,
    NOTHING_KEPT,
    UNSUPPORTED,
    UNSUPPORTED_FRAME,
    Board,
    ItemRefused,
    Out,
    ParamsKept,
    Phase,
    as_flag,
    as_sent,
    lost,
    through_float,
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


class ArduPilotServer:
    """Three independent lists; not atomic: COUNT truncates the old mission, and every item replaces one in place."""

    def __init__(self, board: Board, faults: Faults, firmware: Firmware, *, plane: bool) -> None:
        self._lists = {t: _ArduPilotList(t, board, faults, firmware, plane) for t in (MISSION, FENCE, RALLY)}
        if firmware.has(KEEPS_HOME):
            board.lists[MISSION] = [home_item(board.home)]

    def receive(self, message: MissionMessage, sender: Address, now: float) -> Out:
        one = self._lists.get(message.mission_type)
        if one is not None:
            return one.receive(message, sender, now)
        if isinstance(message, (Request, Ack)):
            return []
        return [(sender, Ack(UNSUPPORTED, message.mission_type))]

    @property
    def deadline(self) -> float | None:
        return min((d for one in self._lists.values() if (d := one.deadline) is not None), default=None)

    def on_timer(self, now: float) -> Out:
        return [sent for one in self._lists.values() for sent in one.on_timer(now)]

    def reset(self) -> None:
        for one in self._lists.values():
            one.reset()


class _ArduPilotList:
    ASK_AGAIN_S = 1.0
    GIVE_UP_S = 8.0
    HOME_RENEWED_S = 5.0
    """At most so long after clearing its mission, a plane that is not armed stores its home in it again."""

    def __init__(self, mission_type: int, board: Board, faults: Faults, firmware: Firmware, plane: bool) -> None:
        self._type, self._board, self._faults, self._plane = mission_type, board, faults, plane
        self._firmware = firmware
        self.reset()
        self._table: Mapping[tuple[Phase, type[MissionMessage]], Callable[..., Out]] = {
            (Phase.IDLE, Count): self._begin,
            (Phase.IDLE, Item): self._stray_item,
            (Phase.IDLE, LegacyItem): self._stray_item,
            (Phase.IDLE, RequestList): self._tell_count,
            (Phase.IDLE, Request): self._tell_item,
            (Phase.IDLE, ClearAll): self._clear,
            (Phase.RECEIVING, Count): self._begin_again,
            (Phase.RECEIVING, Item): self._take,
            (Phase.RECEIVING, LegacyItem): self._take,
            (Phase.RECEIVING, RequestList): self._deny,
            (Phase.RECEIVING, Request): self._tell_item_or_deny,
            (Phase.RECEIVING, ClearAll): self._clear_while_receiving,
            # ACK is ignored in both phases: an upload cannot be cancelled from the ground.
        }

    def reset(self) -> None:
        self._phase = Phase.IDLE
        self._partner = Address(0, 0)
        self._count = self._next = 0
        self._requested_at = self._heard_at = 0.0
        self._emptied_at: float | None = None
        self._new_fence: list[MissionItem] = []

    def receive(self, message: MissionMessage, sender: Address, now: float) -> Out:
        handler = self._table.get((self._phase, type(message)))
        return handler(message, sender, now) if handler else []

    @property
    def deadline(self) -> float | None:
        if self._phase is not Phase.RECEIVING:
            return self._home_due
        return min(self._requested_at + self.ASK_AGAIN_S, self._heard_at + self.GIVE_UP_S)

    @property
    def _home_due(self) -> float | None:
        renews = self._plane and self._type == MISSION and self._firmware.has(KEEPS_HOME) and not self._board.armed
        if not renews or self._emptied_at is None or self._board.lists[MISSION]:
            return None
        return self._emptied_at + self.HOME_RENEWED_S

    def on_timer(self, now: float) -> Out:
        if self._phase is not Phase.RECEIVING:
            if self._home_due is not None and now >= self._home_due:
                self._board.lists[MISSION] = [home_item(self._board.home)]
            return []
        if now >= self._heard_at + self.GIVE_UP_S:
            self._phase = Phase.IDLE  # items that were replaced stay replaced
            return [(self._partner, self._ack(CANCELLED))]
        return self._ask(now) if now >= self._requested_at + self.ASK_AGAIN_S else []

    def _ack(self, code: int) -> Ack:
        return Ack(code, self._type)

    def _ask(self, now: float) -> Out:
        self._requested_at = now
        return [(self._partner, Request(self._next, self._type, legacy=True))]

    # uploads

    def _begin(self, message: Count, sender: Address, now: float) -> Out:
        stored = self._board.lists[self._type]
        # Until the mission library has started, its capacity is 0.
        full = self._board.booting or self._faults.no_space
        if message.count > (0 if full else most_items(self._type, plane=self._plane)):
            return [(sender, self._ack(NO_SPACE))]
        if self._type == FENCE:
            self._new_fence = []
        else:
            del stored[message.count :]
        self._partner, self._count, self._next, self._heard_at = sender, message.count, 0, now
        if message.count == 0:
            self._emptied_at = now
            return self._finish(sender)
        self._phase = Phase.RECEIVING
        return self._ask(now)

    def _begin_again(self, message: Count, sender: Address, now: float) -> Out:
        if sender != self._partner:
            return self._deny(message, sender, now)
        self._phase = Phase.IDLE
        return self._begin(message, sender, now)

    def _take(self, message: Item, sender: Address, now: float) -> Out:
        if self._type == MISSION and message.current in (2, 3):
            return self._stray_item(message, sender, now)  # "guided" items are refused outside guided mode
        if message.seq != self._next:
            return [(sender, self._ack(INVALID_SEQUENCE))]
        if sender != self._partner:
            return self._deny(message, sender, now)
        try:
            self._store(message)
        except ItemRefused as refused:
            self._phase = Phase.IDLE
            return [(sender, self._ack(refused.code))]
        self._heard_at = now
        self._next += 1
        return self._finish(sender) if self._next == self._count else self._ask(now)

    def _store(self, message: Item) -> None:
        self._faults.refuse(self._type, message.seq)
        kept = self._faults.spoil(self._type, message.seq, self._kept(message))
        stored = self._new_fence if self._type == FENCE else self._board.lists[self._type]
        if not stored and self._type == MISSION and self._firmware.has(KEEPS_HOME):
            stored.append(home_item(self._board.home))
            stored.append(kept)
        elif message.seq < len(stored):
            stored[message.seq] = kept
        elif message.seq == len(stored):
            stored.append(kept)
        else:
            raise ItemRefused(ERROR)

    def _kept(self, message: Item) -> MissionItem:
        if self._type == FENCE:
            return keep_fence_item(message.item, whole_radii=not self._firmware.has(KEEPS_RADII))
        if self._type == RALLY:
            return keep_rally_item(message.item)
        arcs = self._firmware.has(TAKES_ARCS) and not self._plane
        kept = keep_mission_item(message.item, plane=self._plane, arcs=arcs)
        if kept.command == cmd.DO_JUMP:
            target, known = kept.params[0], max(len(self._board.lists[MISSION]), self._count)
            if target == 0 or target >= known:
                raise ItemRefused(ERROR)
        return kept

    def _finish(self, sender: Address) -> Out:
        self._phase = Phase.IDLE
        if self._type == FENCE:
            if not fence_is_valid(self._new_fence, fence_storage_bytes(plane=self._plane)):
                return [(sender, self._ack(ERROR))]
            self._board.lists[FENCE] = self._new_fence
        self._board.uploads += self._type == MISSION
        return [(sender, self._ack(ACCEPTED))]

    def _stray_item(self, message: Item, sender: Address, now: float) -> Out:
        return [(sender, self._ack(ERROR))]

    def _deny(self, message: MissionMessage, sender: Address, now: float) -> Out:
        return [(sender, self._ack(DENIED))]

    # clearing

    def _clear(self, message: ClearAll, sender: Address, now: float) -> Out:
        if self._type == MISSION and self._board.armed and self._board.flying_mission:
            return [(sender, self._ack(ERROR))]
        self._board.lists[self._type] = []
        self._emptied_at = now
        return [(sender, self._ack(ACCEPTED))]

    def _clear_while_receiving(self, message: ClearAll, sender: Address, now: float) -> Out:
        if sender != self._partner:
            return [(sender, self._ack(DENIED)), (sender, self._ack(ERROR))]  # ArduPilot sends both
        self._phase = Phase.IDLE
        return self._clear(message, sender, now)

    # downloads: no state is kept

    def _tell_count(self, message: RequestList, sender: Address, now: float) -> Out:
        return [(sender, Count(len(self._board.lists[self._type]), self._type))]

    def _tell_item(self, message: Request, sender: Address, now: float) -> Out:
        stored = self._board.lists[self._type]
        if self._type == MISSION and message.seq == 0:
            item = home_item(Home(0, 0, 0.0) if self._board.booting else self._board.home)
        elif message.seq < len(stored) and not (self._type == MISSION and self._board.booting):
            item = stored[message.seq]
        else:
            return self._past_the_end(message, sender, len(stored))
        if not message.legacy:
            return [(sender, Item(message.seq, item, self._type))]
        return [(sender, LegacyItem(message.seq, through_float(item), self._type))]

    def _past_the_end(self, message: Request, sender: Address, count: int) -> Out:
        """Answer a request for an item that the list has not."""
        # "Try to educate the GCS on the actual size of the mission."
        lesson: Out = [(sender, Count(count, self._type))]
        if self._firmware.has(COUNTS_EVERY_LIST):
            return [*([] if message.legacy else lesson), (sender, self._ack(INVALID_SEQUENCE))]
        if self._type == MISSION:
            return [*lesson, (sender, self._ack(ERROR))]
        right_after = self._type == FENCE and message.seq == count
        return [(sender, self._ack(ERROR if right_after else INVALID_SEQUENCE))]

    def _tell_item_or_deny(self, message: Request, sender: Address, now: float) -> Out:
        # During an upload, ArduPilot denies only MISSION_REQUEST_INT.
        return self._tell_item(message, sender, now) if message.legacy else self._deny(message, sender, now)
