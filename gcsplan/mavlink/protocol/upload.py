"""`Upload` and `Clear`: our side of writing a list to a vehicle. The vehicle requests items, we answer.

=============  =============  =============================================================================
state          event          action
=============  =============  =============================================================================
IDLE           START          send COUNT as soon as the gate permits
ANNOUNCED      RETRY          send COUNT again if the gate permits: no item was requested yet
ANNOUNCED      REQUESTED      send the item; from now on only requests are answered, nothing else is sent
SENDING        REQUESTED      send the item: any seq in range, in any order, any number of times
…              ALL_REQUESTED  the same, and every item has now been requested at least once
ALL_SENT       TAKEN          ACK 0 after every item was requested: accepted
…              DOUBT          an ACK that may be stale or premature: wait ``response_s`` for the next request
DOUBTING       REQUESTED      the ACK was not the end: go on
…              TIMEOUT        the doubtful ACK, or the silence, becomes the outcome
ENDED          REQUESTED      send the item nevertheless: the vehicle may be finishing, or starting over
=============  =============  =============================================================================

No item is sent on a timer, and no request resets what was recorded. ACKs are doubted because an ACK of an earlier
transfer may be late, PX4 answers a duplicated COUNT with ERROR and goes on, and ArduPilot answers duplicated items with
INVALID_SEQUENCE and goes on. An ERROR after the last item does not show which list is on board.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import auto
from typing import Any, ClassVar

from gcsplan.errors import InputError
from gcsplan.mavlink.mission.mission import ALL, MISSION, MissionItem
from gcsplan.mavlink.protocol.machine import (
    CANCELLED_BY_US,
    Gate,
    Machine,
    StateLabel,
    Timers,
    TransferProgress,
    Wait,
    always,
    checked_type,
)
from gcsplan.mavlink.protocol.messages import Ack, Address, ClearAll, Count, Item, MissionMessage, Packet, Request
from gcsplan.mavlink.protocol.outcome import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    ERROR,
    INVALID_SEQUENCE,
    NO_SPACE,
    Accepted,
    Outcome,
    Refused,
    Unknown,
)

_MOST_ITEMS = 65535


class UploadState(StateLabel):
    """The states of an upload or a clearing."""

    IDLE = auto()
    ANNOUNCED = auto()
    SENDING = auto()
    ALL_SENT = auto()
    DOUBTING = auto()
    ENDED = auto()


class UploadEvent(StateLabel):
    """The events of an upload or a clearing."""

    START = auto()
    RETRY = auto()
    REQUESTED = auto()
    ALL_REQUESTED = auto()
    TAKEN = auto()
    DOUBT = auto()
    TIMEOUT = auto()
    CANCEL = auto()


S, E = UploadState, UploadEvent


class Upload(Machine):
    """Send ``items`` in wire order (seq is the index) to ``vehicle``.

    ``outcome`` is `Accepted`, `Refused` or `Unknown` at the end, or the gate's. Raises InputError for an empty list
    (use `Clear`: COUNT 0 hangs some vehicles) and for more than 65535 items.
    """

    ROLE = "upload"
    CANCEL = E.CANCEL
    TABLE: ClassVar[Mapping[Any, Any]] = {
        (S.IDLE, E.START): S.ANNOUNCED,
        (S.ANNOUNCED, E.RETRY): S.ANNOUNCED,
        (S.ANNOUNCED, E.REQUESTED): S.SENDING,
        (S.ANNOUNCED, E.ALL_REQUESTED): S.ALL_SENT,
        (S.ANNOUNCED, E.DOUBT): S.ANNOUNCED,
        (S.ANNOUNCED, E.TIMEOUT): S.ENDED,
        (S.SENDING, E.REQUESTED): S.SENDING,
        (S.SENDING, E.ALL_REQUESTED): S.ALL_SENT,
        (S.SENDING, E.DOUBT): S.DOUBTING,
        (S.SENDING, E.TIMEOUT): S.ENDED,
        (S.DOUBTING, E.REQUESTED): S.SENDING,
        (S.DOUBTING, E.ALL_REQUESTED): S.ALL_SENT,
        (S.DOUBTING, E.DOUBT): S.DOUBTING,
        (S.DOUBTING, E.TAKEN): S.ENDED,
        (S.DOUBTING, E.TIMEOUT): S.ENDED,
        (S.ALL_SENT, E.ALL_REQUESTED): S.ALL_SENT,
        (S.ALL_SENT, E.DOUBT): S.DOUBTING,
        (S.ALL_SENT, E.TAKEN): S.ENDED,
        (S.ALL_SENT, E.TIMEOUT): S.ENDED,
        (S.ENDED, E.REQUESTED): S.ENDED,
        (S.ENDED, E.ALL_REQUESTED): S.ENDED,
    } | {(state, E.CANCEL): S.ENDED for state in (S.ANNOUNCED, S.SENDING, S.ALL_SENT, S.DOUBTING)}

    def __init__(
        self,
        items: Sequence[MissionItem],
        *,
        us: Address,
        vehicle: Address,
        mission_type: int = MISSION,
        timers: Timers | None = None,
        gate: Gate = always,
    ) -> None:
        super().__init__(
            us=us, vehicle=vehicle, mission_type=checked_type(mission_type), timers=timers or Timers(), state=S.IDLE,
            gate=gate,
        )  # fmt: skip
        self.items = tuple(items)
        if not self.items:
            raise InputError("an empty list is not uploaded: clear the vehicle's list instead")
        if len(self.items) > _MOST_ITEMS:
            raise InputError(f"a list holds at most {_MOST_ITEMS} items, given {len(self.items)}")
        self._requested: set[int] = set()
        self._last_requested: int | None = None
        self._highest = -1  # highest seq requested in this round; a repeated request for item 0 begins a new round
        self._rounds = 0
        self._gives_up_at = 0.0  # a stall if no new item is requested by this time
        self._doubt: Outcome | None = None
        self._cancelled = False
        self._announced = 0
        self.barred = False  # whether the gate ended the upload

    @property
    def progress(self) -> TransferProgress:
        """Items that the vehicle has requested so far."""
        return TransferProgress("upload", len(self._requested), len(self.items))

    @property
    def began(self) -> bool:
        """Whether the vehicle has requested any item: from then on its old list may be gone."""
        return bool(self._requested)

    def start(self, now: float) -> list[Packet]:
        """Announce the list with COUNT."""
        self._step(E.START)
        return self._announce(now)

    @property
    def answers(self) -> Sequence[Item]:
        """The item that answers a request, by seq, at any time between `start` and `cancel`."""
        return [self._item(seq) for seq in range(len(self.items))]

    def answered(self, seqs: Iterable[int], now: float) -> None:
        """Record requests for ``seqs`` that were already answered."""
        for seq in seqs:
            self._on_request(seq, now)

    def stop(self, outcome: Outcome) -> None:
        """End with ``outcome`` and answer no more requests."""
        super().stop(outcome)
        self._cancelled = True

    def _announce(self, now: float) -> list[Packet]:
        held = self._gate(now)
        if isinstance(held, Wait):
            self._deadline = held.until
            return []
        if held is not None:
            self.barred = True
            self.stop(held)
            return []
        self.retries += int(self._announced > 0)
        self._announced += 1
        self._deadline = now + self.timers.response_s
        return [self._to_vehicle(Count(len(self.items), self.mission_type))]

    def _react(self, message: MissionMessage, now: float) -> list[Packet]:
        if isinstance(message, Request) and message.seq < len(self.items):
            return self._answer(message.seq, now)
        if isinstance(message, Ack) and self._announced and self._state is not S.ENDED:
            self._judge(message, now)
        return []

    def _answer(self, seq: int, now: float) -> list[Packet]:
        if not self._announced or self._cancelled:
            return []  # we announced nothing, so the request is for somebody else's list
        self._on_request(seq, now)
        return [self._to_vehicle(self._item(seq))]

    def _on_request(self, seq: int, now: float) -> None:
        self._note(seq, now)
        self._step(E.ALL_REQUESTED if len(self._requested) == len(self.items) else E.REQUESTED)
        if self._state is not S.ENDED:
            self._doubt = None
            wait = 2 * self.timers.response_s if self._state is S.ALL_SENT else self.timers.silence_s
            self._deadline = min(now + wait, self._gives_up_at)

    def _item(self, seq: int) -> Item:
        return Item(seq, self.items[seq], self.mission_type, int(seq == 0 and self.mission_type == MISSION))

    def _note(self, seq: int, now: float) -> None:
        if seq == 0 and self._highest > 0 and self._rounds < self.timers.retries:
            self._highest, self._rounds = -1, self._rounds + 1
        if seq > self._highest or self._last_requested is None:
            self._highest, self._gives_up_at = max(seq, self._highest), now + self.timers.stall_s
        elif seq == self._last_requested and self._state is not S.ENDED:
            self.retries += 1
        self._requested.add(seq)
        self._last_requested = seq

    def _judge(self, ack: Ack, now: float) -> None:
        if ack.code == INVALID_SEQUENCE:
            return
        complete = len(self._requested) == len(self.items)
        if ack.code == ACCEPTED and complete:
            self._end(E.TAKEN, Accepted(ack.opaque_id))
            return
        self._step(E.DOUBT)
        self._doubt = self._doubtful(ack.code, complete)
        self._deadline = now + self.timers.response_s

    def _doubtful(self, code: int, complete: bool) -> Outcome:
        """Return the outcome that a doubtful ACK stands for if no further request follows."""
        if code == ACCEPTED:
            count = f"{len(self._requested)} of {len(self.items)} items"
            return Unknown(f"the vehicle answered accepted after requests for {count}: to an earlier transfer?")
        if code == CANCELLED:
            return Unknown("the vehicle gave up the transfer")
        if code == ERROR and complete:
            return Unknown("the vehicle answered error after the last item: it may hold the list or not")
        return Refused(code, None if code in (NO_SPACE, DENIED) else self._last_requested)

    def _expire(self, now: float) -> list[Packet]:
        again = self._doubt is None or isinstance(self._doubt, Unknown) or self._doubt == Refused(ERROR)
        if self._state is S.ANNOUNCED and again and self._announced <= self.timers.retries:
            self._step(E.RETRY)
            return self._announce(now)
        self._end(E.TIMEOUT, self._doubt or self._silence(now))
        return []

    def _silence(self, now: float) -> Unknown:
        done, total = len(self._requested), len(self.items)
        if not done:
            return Unknown(f"no answer to {self._announced} announcements of the list", silent=True)
        if now >= self._gives_up_at:
            return Unknown(f"the vehicle asks on and on and gets no further than item {self._highest} of {total}")
        if done == total:
            return Unknown("the vehicle requested every item, but did not say whether it took the list")
        return Unknown(f"the vehicle fell silent after asking for {done} of {total} items")


class Clear(Machine):
    """Clear a list: send CLEAR_ALL until it is acknowledged. ``mission_type`` may be ALL (255)."""

    ROLE = "clear"
    CANCEL = E.CANCEL
    TABLE: ClassVar[Mapping[Any, Any]] = {
        (S.IDLE, E.START): S.ANNOUNCED,
        (S.ANNOUNCED, E.RETRY): S.ANNOUNCED,
        (S.ANNOUNCED, E.TAKEN): S.ENDED,
        (S.ANNOUNCED, E.DOUBT): S.ENDED,
        (S.ANNOUNCED, E.TIMEOUT): S.ENDED,
        (S.ANNOUNCED, E.CANCEL): S.ENDED,
    }

    def __init__(
        self,
        *,
        us: Address,
        vehicle: Address,
        mission_type: int = MISSION,
        timers: Timers | None = None,
        gate: Gate = always,
    ) -> None:
        kind = mission_type if mission_type == ALL else checked_type(mission_type)
        super().__init__(us=us, vehicle=vehicle, mission_type=kind, timers=timers or Timers(), state=S.IDLE, gate=gate)
        self._attempts = 0

    @property
    def progress(self) -> TransferProgress:
        """0 of 1 until the end, then 1 of 1."""
        return TransferProgress("clear", int(self.outcome is not None), 1)

    def start(self, now: float) -> list[Packet]:
        """Send CLEAR_ALL as soon as the gate permits."""
        self._step(E.START)
        return self._ask(now)

    def cancel(self, now: float, why: str = CANCELLED_BY_US) -> list[Packet]:
        """End with an unknown outcome and send nothing."""
        self.stop(Unknown(why))
        return []

    def _ask(self, now: float) -> list[Packet]:
        held = self._gate(now)
        if isinstance(held, Wait):
            self._deadline = held.until
            return []
        if held is not None:
            self.stop(held)
            return []
        self.retries += int(self._attempts > 0)
        self._attempts += 1
        self._deadline = now + self.timers.response_s
        return [self._to_vehicle(ClearAll(self.mission_type))]

    def _react(self, message: MissionMessage, now: float) -> list[Packet]:
        if isinstance(message, Ack) and self._attempts and self._state is S.ANNOUNCED:
            if message.code == ACCEPTED:
                self._end(E.TAKEN, Accepted(message.opaque_id))
            else:
                what = "error: a list that is being flown cannot be cleared" if message.code == ERROR else ""
                self._end(E.DOUBT, Refused(message.code, None, what))
        return []

    def _expire(self, now: float) -> list[Packet]:
        if self._attempts <= self.timers.retries:
            self._step(E.RETRY)
            return self._ask(now)
        self._end(E.TIMEOUT, Unknown(f"no answer to {self._attempts} requests to clear", silent=True))
        return []
