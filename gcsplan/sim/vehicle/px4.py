"""PX4's side of the mission protocol, and what it stores of an item.

It takes one transfer at a time, in order, and the new list replaces the old at the end. It stores floats unchanged, but
only the params that a command uses.

Source: PX4 1.16 to main ``mavlink_mission.cpp`` (`parse_mavlink_mission_item`, `format_mavlink_mission_item`),
``mavlink_mission.h`` and ``navigation.h``. `stored_lists` states the rules of the table.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Container, Mapping

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import ALL, FENCE, MISSION, NO_POSITION, RALLY, MissionItem, float32
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
from gcsplan.sim.vehicle.firmware import TAKES_ARM_ITEMS, TAKES_AUTOTUNE_ITEMS, Firmware
from gcsplan.sim.vehicle.misbehaviour import Faults
from gcsplan.sim.vehicle.stored_lists import (
    ACCEPTED,
    CANCELLED,
    ERROR,
    INVALID_PARAM1,
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


_COMMANDS = {cmd.COMPONENT_ARM_DISARM: TAKES_ARM_ITEMS, cmd.DO_AUTOTUNE_ENABLE: TAKES_AUTOTUNE_ITEMS}
"""Commands that not every version takes."""


class Px4Server:
    """One transfer at a time for all lists; atomic: the new list replaces the old one after its last item."""

    ASK_AGAIN_S = 0.25
    GIVE_UP_S = 5.0

    def __init__(self, board: Board, faults: Faults, firmware: Firmware) -> None:
        self._board, self._faults = board, faults
        self._unknown = {command for command, change in _COMMANDS.items() if not firmware.has(change)}
        self.reset()
        self._table: Mapping[tuple[Phase, type[MissionMessage]], Callable[..., Out]] = {
            (Phase.IDLE, Count): self._begin,
            (Phase.IDLE, Item): self._late_item,
            (Phase.IDLE, LegacyItem): self._late_item,
            (Phase.IDLE, RequestList): self._tell_count,
            (Phase.IDLE, ClearAll): self._clear,
            (Phase.RECEIVING, Count): self._count_again,
            (Phase.RECEIVING, Item): self._take,
            (Phase.RECEIVING, LegacyItem): self._take,
            (Phase.RECEIVING, RequestList): self._list_while_busy,
            (Phase.RECEIVING, Ack): self._stop_receiving,
            (Phase.SENDING, Count): self._busy,
            (Phase.SENDING, Item): self._item_while_sending,
            (Phase.SENDING, LegacyItem): self._item_while_sending,
            (Phase.SENDING, RequestList): self._list_while_busy,
            (Phase.SENDING, Request): self._tell_item,
            (Phase.SENDING, Ack): self._stop_sending,
            # Ignored: a request while idle or receiving, CLEAR_ALL during a transfer.
        }

    def reset(self) -> None:
        self._phase = Phase.IDLE
        self._partner = Address(0, 0)
        self._type = MISSION
        self._count = self._next = self._crc = 0
        self._sent_at = self._heard_at = 0.0
        self._new: list[MissionItem] = []
        self._int_mode = True

    def receive(self, message: MissionMessage, sender: Address, now: float) -> Out:
        if self._board.booting:
            return []  # the MAVLink module is not running yet
        if isinstance(message, Item):
            self._int_mode = not isinstance(message, LegacyItem)
        elif isinstance(message, Request):
            self._int_mode = not message.legacy
        handler = self._table.get((self._phase, type(message)))
        return handler(message, sender, now) if handler else []

    @property
    def deadline(self) -> float | None:
        if self._phase is Phase.IDLE:
            return None
        give_up = self._heard_at + self.GIVE_UP_S
        return min(self._sent_at + self.ASK_AGAIN_S, give_up) if self._phase is Phase.RECEIVING else give_up

    def on_timer(self, now: float) -> Out:
        if self._phase is Phase.IDLE:
            return []
        if now >= self._heard_at + self.GIVE_UP_S:
            self._phase = Phase.IDLE  # no message is sent; the old list stays
            return []
        asks = self._phase is Phase.RECEIVING and now >= self._sent_at + self.ASK_AGAIN_S
        return self._ask(now) if asks else []

    def _ask(self, now: float) -> Out:
        self._sent_at = now
        return [(self._partner, Request(self._next, self._type, legacy=not self._int_mode))]

    def _answer(self, code: int, to: Address, opaque_id: int = 0) -> Out:
        return [(to, Ack(code, self._type, opaque_id))]

    # uploads

    def _begin(self, message: Count, sender: Address, now: float) -> Out:
        self._heard_at, self._partner, self._type = now, sender, message.mission_type
        if self._type not in self._board.lists:
            # PX4 has no storage for this mission type.
            return self._answer(NO_SPACE if message.count else ACCEPTED, sender)
        if message.count > most_items(self._type) or (self._faults.no_space and message.count):
            return self._answer(NO_SPACE, sender)
        if message.count == 0:
            self._board.lists[self._type] = []
            self._board.uploads += self._type == MISSION
            return self._answer(ACCEPTED, sender)
        self._phase, self._count, self._next, self._new, self._crc = Phase.RECEIVING, message.count, 0, [], 0
        return self._ask(now)

    def _count_again(self, message: Count, sender: Address, now: float) -> Out:
        self._heard_at = now
        if sender != self._partner or self._next > 0:
            return self._answer(ERROR, sender)  # the upload goes on nevertheless
        return self._ask(now)  # the first request was lost; the number in the first COUNT stays valid

    def _take(self, message: Item, sender: Address, now: float) -> Out:
        if sender != self._partner:
            return []
        if message.mission_type != self._type:
            return self._answer(ERROR, sender)
        self._heard_at = now
        if message.seq != self._next:
            return []
        try:
            self._faults.refuse(self._type, message.seq)
            kept = keep_item(message.item, self._type, unknown=self._unknown)
        except ItemRefused as refused:
            self._phase = Phase.IDLE
            return self._answer(refused.code, sender)
        self._new.append(self._faults.spoil(self._type, message.seq, kept))
        self._crc = zlib.crc32(message.item.wire, self._crc)
        self._next += 1
        if self._next < self._count:
            return self._ask(now)
        self._phase = Phase.IDLE
        self._board.lists[self._type] = self._new
        self._board.uploads += self._type == MISSION
        return self._answer(ACCEPTED, sender, self._crc)

    def _late_item(self, message: Item, sender: Address, now: float) -> Out:
        if sender != self._partner:
            return []
        # "Assume this is a duplicate" of the last item whose ACK was lost; PX4 also does so after a timeout.
        again = message.mission_type == self._type and message.seq + 1 == self._next
        return self._answer(ACCEPTED, sender, self._crc) if again else self._answer(ERROR, sender)

    def _item_while_sending(self, message: Item, sender: Address, now: float) -> Out:
        return self._answer(ERROR, sender) if sender == self._partner else []

    def _busy(self, message: Count, sender: Address, now: float) -> Out:
        return self._answer(ERROR, sender)

    def _stop_receiving(self, message: Ack, sender: Address, now: float) -> Out:
        if sender == self._partner and message.code == CANCELLED:
            self._phase = Phase.IDLE
        elif sender == self._partner and message.code == UNSUPPORTED:
            self._int_mode = not self._int_mode
            return self._ask(now)
        return []

    def _clear(self, message: ClearAll, sender: Address, now: float) -> Out:
        self._heard_at, self._type = now, message.mission_type
        cleared = (MISSION, FENCE, RALLY) if message.mission_type == ALL else (message.mission_type,)
        for mission_type in cleared:
            if mission_type in self._board.lists:
                self._board.lists[mission_type] = []
        return self._answer(ACCEPTED, sender)

    # downloads

    def _stored(self) -> list[MissionItem]:
        return self._board.lists.get(self._type, [])

    def _tell_count(self, message: RequestList, sender: Address, now: float) -> Out:
        self._phase, self._partner, self._type = Phase.SENDING, sender, message.mission_type
        self._heard_at, self._next, self._count = now, 0, len(self._stored())
        return [(sender, Count(self._count, self._type, self._board.opaque_id(self._type)))]

    def _list_while_busy(self, message: RequestList, sender: Address, now: float) -> Out:
        all_sent = self._next == len(self._stored())
        same = self._phase is Phase.SENDING and message.mission_type == self._type and sender == self._partner
        return self._tell_count(message, sender, now) if all_sent or same else []

    def _tell_item(self, message: Request, sender: Address, now: float) -> Out:
        if sender != self._partner or message.mission_type != self._type:
            return []
        self._heard_at = now
        stored = self._stored()
        if message.seq == self._next and self._next < self._count:
            self._next += 1
        elif message.seq != self._next - 1:
            self._phase = Phase.IDLE  # a request out of order ends the download
            return self._answer(ERROR, sender)
        if message.seq >= len(stored):
            self._phase = Phase.IDLE
            return self._answer(ERROR, sender)
        item = stored[message.seq]
        if self._int_mode:
            return [(sender, Item(message.seq, item, self._type, current=int(message.seq == 0)))]
        frame = {5: 0, 6: 3}.get(item.frame, item.frame)
        old = MissionItem(item.command, frame, item.params, item.x, item.y, item.z, item.autocontinue)
        return [(sender, LegacyItem(message.seq, through_float(old), self._type, current=int(message.seq == 0)))]

    def _stop_sending(self, message: Ack, sender: Address, now: float) -> Out:
        if sender == self._partner and message.mission_type == self._type:
            self._phase = Phase.IDLE
        return []
