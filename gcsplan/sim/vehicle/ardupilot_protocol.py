"""ArduPilot's side of the mission protocol: three independent lists, requested with the legacy MISSION_REQUEST.

Source: ArduPilot 4.6.2 and 4.7 ``MissionItemProtocol.cpp`` with its three subclasses, ``AP_Mission.cpp`` and
``GCS_Common.cpp``; `firmware` states what differs between the two. `stored_lists` states the rules of the tables.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, Home, MissionItem
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
from gcsplan.sim.vehicle import ardupilot_storage as storage
from gcsplan.sim.vehicle.firmware import COUNTS_EVERY_LIST, KEEPS_HOME, KEEPS_RADII, TAKES_ARCS, Firmware
from gcsplan.sim.vehicle.misbehaviour import Faults
from gcsplan.sim.vehicle.stored_lists import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    ERROR,
    INVALID_SEQUENCE,
    NO_SPACE,
    UNSUPPORTED,
    Board,
    ItemRefused,
    Out,
    Phase,
    through_float,
)


class ArduPilotServer:
    """Three independent lists; not atomic: COUNT truncates the old mission, and every item replaces one in place."""

    def __init__(self, board: Board, faults: Faults, firmware: Firmware, *, plane: bool) -> None:
        self._lists = {t: _ArduPilotList(t, board, faults, firmware, plane) for t in (MISSION, FENCE, RALLY)}
        if firmware.has(KEEPS_HOME):
            board.lists[MISSION] = [storage.home_item(board.home)]

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
                self._board.lists[MISSION] = [storage.home_item(self._board.home)]
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
        if message.count > (0 if full else storage.most_items(self._type, plane=self._plane)):
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
            stored.append(storage.home_item(self._board.home))
            stored.append(kept)
        elif message.seq < len(stored):
            stored[message.seq] = kept
        elif message.seq == len(stored):
            stored.append(kept)
        else:
            raise ItemRefused(ERROR)

    def _kept(self, message: Item) -> MissionItem:
        if self._type == FENCE:
            return storage.keep_fence_item(message.item, whole_radii=not self._firmware.has(KEEPS_RADII))
        if self._type == RALLY:
            return storage.keep_rally_item(message.item)
        arcs = self._firmware.has(TAKES_ARCS) and not self._plane
        kept = storage.keep_mission_item(message.item, plane=self._plane, arcs=arcs)
        if kept.command == cmd.DO_JUMP:
            target, known = kept.params[0], max(len(self._board.lists[MISSION]), self._count)
            if target == 0 or target >= known:
                raise ItemRefused(ERROR)
        return kept

    def _finish(self, sender: Address) -> Out:
        self._phase = Phase.IDLE
        if self._type == FENCE:
            if not storage.fence_is_valid(self._new_fence, storage.fence_storage_bytes(plane=self._plane)):
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
            item = storage.home_item(Home(0, 0, 0.0) if self._board.booting else self._board.home)
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
