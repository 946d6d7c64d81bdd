"""`Download`: read a list from a vehicle. We request item by item, in order; the vehicle answers.

=============  =============  =============================================================================
state          event          what happens
=============  =============  =============================================================================
IDLE           START          send REQUEST_LIST
LISTING        RETRY          send REQUEST_LIST again
LISTING        COUNT          send REQUEST_INT 0
LISTING        EMPTY          COUNT 0: send the final ACK; accepted with no items
LISTING        REFUSED        COUNT above what the vehicle can hold: request nothing
FETCHING       ITEM           the requested item came: request the next; any other item is ignored
FETCHING       RETRY          send the same REQUEST_INT again
FETCHING       LAST_ITEM      send the final ACK; accepted
LISTING, …     AGAIN          vehicle busy, confused or silent, or list changed: pause, then start over
PAUSING        RETRY          send REQUEST_LIST
…              REFUSED        an ACK that a repetition will not change, or items in the old float form
ENDED          LAST_ITEM      send the final ACK again: the first one was lost
=============  =============  =============================================================================

PX4 accepts requests in order only; when an old one arrives late it answers ERROR once and ignores all that follow.
ArduPilot answers DENIED while somebody writes to it. In both cases the download starts over and keeps no item.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import auto
from typing import Any, ClassVar

from gcsplan.figures import counted
from gcsplan.mavlink.mission.mission import MISSION, MissionItem
from gcsplan.mavlink.protocol.machine import (
    Machine,
    StateLabel,
    Timers,
    TransferProgress,
    checked_type,
)
from gcsplan.mavlink.protocol.messages import (
    Ack,
    Address,
    Count,
    Item,
    LegacyItem,
    MissionMessage,
    Packet,
    Request,
    RequestList,
)
from gcsplan.mavlink.protocol.outcome import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    ERROR,
    INVALID,
    INVALID_SEQUENCE,
    OUR_REFUSAL,
    UNSUPPORTED,
    Accepted,
    Refused,
    Unknown,
    code_words,
)

_BUSY = frozenset({ERROR, INVALID, INVALID_SEQUENCE, DENIED, CANCELLED})
_MOST_ITEMS = 65535
_RESTARTS = 16  # × pauses of 1.5 s: much longer than the 8 s for which ArduPilot denies after a broken upload


class DownloadState(StateLabel):
    """The states of a download."""

    IDLE = auto()
    LISTING = auto()
    FETCHING = auto()
    PAUSING = auto()
    ENDED = auto()


class DownloadEvent(StateLabel):
    """The events of a download."""

    START = auto()
    RETRY = auto()
    COUNT = auto()
    EMPTY = auto()
    ITEM = auto()
    LAST_ITEM = auto()
    AGAIN = auto()
    REFUSED = auto()
    TIMEOUT = auto()
    CANCEL = auto()


S, E = DownloadState, DownloadEvent


class Download(Machine):
    """Read ``vehicle``'s list. When ``outcome`` is `Accepted`, ``items`` is the whole list in wire order.

    ``most``: the number of items that the vehicle can hold; if it announces more, no item is requested.
    """

    ROLE = "download"
    CANCEL = E.CANCEL
    TABLE: ClassVar[Mapping[Any, Any]] = (
        {
            (S.IDLE, E.START): S.LISTING,
            (S.LISTING, E.RETRY): S.LISTING,
            (S.LISTING, E.COUNT): S.FETCHING,
            (S.LISTING, E.EMPTY): S.ENDED,
            (S.FETCHING, E.RETRY): S.FETCHING,
            (S.FETCHING, E.ITEM): S.FETCHING,
            (S.FETCHING, E.LAST_ITEM): S.ENDED,
            (S.PAUSING, E.RETRY): S.LISTING,
            (S.ENDED, E.LAST_ITEM): S.ENDED,
        }
        | {(state, E.AGAIN): S.PAUSING for state in (S.LISTING, S.FETCHING)}
        | {
            (state, event): S.ENDED
            for state in (S.LISTING, S.FETCHING, S.PAUSING)
            for event in (E.REFUSED, E.TIMEOUT, E.CANCEL)
        }
    )

    def __init__(
        self,
        *,
        us: Address,
        vehicle: Address,
        mission_type: int = MISSION,
        timers: Timers | None = None,
        most: int = _MOST_ITEMS,
    ) -> None:
        super().__init__(
            us=us, vehicle=vehicle, mission_type=checked_type(mission_type), timers=timers or Timers(), state=S.IDLE
        )
        self.opaque_id = 0
        self._most = most
        self._items: list[MissionItem] = []
        self._count: int | None = None
        self._restarts = 0
        self._tries = 0  # repetitions of the request that awaits its answer
        self._first_request_at = self._requested_at = 0.0
        self._heard_at = 0.0
        self._round_trip_s = self._quickest_s = 0.0

    @property
    def items(self) -> tuple[MissionItem, ...]:
        """The items in wire order; complete only if ``outcome`` is `Accepted`."""
        return tuple(self._items)

    @property
    def progress(self) -> TransferProgress:
        """Items read so far."""
        return TransferProgress("read back", len(self._items), self._count or 0)

    def start(self, now: float) -> list[Packet]:
        """Send REQUEST_LIST."""
        self._step(E.START)
        return self._ask_list(now)

    def _ask_list(self, now: float) -> list[Packet]:
        self._items, self._count, self._first_request_at, self._requested_at = [], None, now, now
        self._deadline = now + self.timers.response_s
        return [self._to_vehicle(RequestList(self.mission_type))]

    def _ask_item(self, now: float) -> list[Packet]:
        self._requested_at = now
        if self._tries == 0:
            self._first_request_at = now
        self._deadline = now + self._wait_s
        return [self._to_vehicle(Request(len(self._items), self.mission_type))]

    @property
    def _wait_s(self) -> float:
        """Seconds until an item is requested again: repeated requests must not fill up a slow link."""
        return min(max(self.timers.item_s, 1.5 * self._round_trip_s), 2 * self.timers.response_s)

    def _react(self, message: MissionMessage, now: float) -> list[Packet]:
        if isinstance(message, Count):
            return self._take_count(message, now)
        if isinstance(message, LegacyItem):
            if self._state is S.FETCHING:
                words = "it answers with MISSION_ITEM, whose float32 degrees are half a metre coarse"
                self._end(E.REFUSED, Refused(UNSUPPORTED, len(self._items), words))
            return []
        if isinstance(message, Item):
            return self._take_item(message, now)
        if isinstance(message, Ack) and self._state in (S.LISTING, S.FETCHING):
            self._judge(message.code, now)
        return []

    def _take_count(self, message: Count, now: float) -> list[Packet]:
        if self._state is S.LISTING:
            self._measure(now)
            self._heard_at, self._tries, self.opaque_id = now, 0, message.opaque_id
            self._count = message.count
            if message.count > self._most:
                words = f"it announces {counted(message.count, 'item')}, and can hold at most {self._most}"
                self._end(E.REFUSED, Refused(OUR_REFUSAL, None, words))
                return []
            if message.count == 0:
                return self._finish(E.EMPTY)
            self._step(E.COUNT)
            return self._ask_item(now)
        if self._state is S.FETCHING and (message.count, message.opaque_id) != (self._count, self.opaque_id):
            self._again(
                now,
                f"the vehicle's list changed from {self._count} to {counted(message.count, 'item')} while being read",
            )
        return []

    def _take_item(self, message: Item, now: float) -> list[Packet]:
        if self._state is S.ENDED and self._count and message.seq == self._count - 1:
            return self._finish(E.LAST_ITEM) if isinstance(self.outcome, Accepted) else []
        if self._state is not S.FETCHING or message.seq != len(self._items):
            return []
        late_question = self._tries > 0 and now - self._requested_at < 0.9 * self._quickest_s
        self._measure(now, late_question)
        self._heard_at, self._tries = now, 0
        self._items.append(message.item)
        if len(self._items) == self._count:
            return self._finish(E.LAST_ITEM)
        self._step(E.ITEM)
        if late_question:  # let the repeated request arrive before the next one is sent
            self._tries, self._deadline = -1, now + self._round_trip_s
            return []
        return self._ask_item(now)

    def _finish(self, event: DownloadEvent) -> list[Packet]:
        self._end(event, Accepted(self.opaque_id))
        return [self._to_vehicle(Ack(ACCEPTED, self.mission_type))]

    def _measure(self, now: float, late_question: bool = False) -> None:
        """Update the slowest round trip (decays by 10 % each time) and the quickest, both in seconds.

        A repeated request is not measured (Karn's rule) unless its answer comes sooner than any answer before: then it
        answers the first request, and the repeated one is still on its way. PX4 ends a download if that one arrives
        after the next request.
        """
        took = now - self._first_request_at
        if self._tries == 0:
            self._quickest_s = min(took, self._quickest_s or took)
        if self._tries == 0 or late_question:
            self._round_trip_s = max(took, 0.9 * self._round_trip_s)

    def _judge(self, code: int, now: float) -> None:
        if code == ACCEPTED:
            return  # a late ACK of an earlier transfer
        if code in _BUSY:
            self._again(now, code_words(code))
        else:
            self._end(E.REFUSED, Refused(code))

    def _again(self, now: float, why: str) -> None:
        if self._restarts >= _RESTARTS:
            self._end(E.TIMEOUT, Unknown(f"reading was begun {_RESTARTS + 1} times, last stopped by: {why}"))
            return
        self._step(E.AGAIN)
        self._restarts += 1
        self.retries += 1
        self._tries = 0
        self._deadline = now + self.timers.response_s

    def _expire(self, now: float) -> list[Packet]:
        if self._state is S.PAUSING:
            self._step(E.RETRY)
            return self._ask_list(now)
        self._tries += 1
        if self._state is S.LISTING:
            if self._tries > self.timers.retries:
                why = f"no answer to {self._tries} requests for the list"
                self._end(E.TIMEOUT, Unknown(why, silent=True))
                return []
            self._step(E.RETRY)
            self.retries += 1
            return self._ask_list(now)
        if now - self._heard_at >= max(2 * self.timers.response_s, 4 * self._wait_s):
            self._again(now, f"silence after {len(self._items)} of {counted(self._count or 0, 'item')}")
            return []
        self._step(E.RETRY)
        self.retries += int(self._tries > 0)
        return self._ask_item(now)
