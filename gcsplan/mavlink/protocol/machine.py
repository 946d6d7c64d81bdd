"""The base class of `Upload`, `Clear` and `Download`: timers, the transition table, and the filter for packets.

Time is an argument and packets are values: ``start(now)``, ``receive(packet, now)`` and ``on_timer(now)`` return the
packets to send, and ``deadline`` is the next time to call `on_timer`. Nothing here opens a socket or reads a clock.

Two rules, after h11's state machine. (1) A state changes only through the machine's ``TABLE``, (state, event) → state.
(2) A packet from the vehicle never raises an error: one that does not fit the state is another event, or is ignored.
An event of our own that is not in the table (a second ``start``) is a bug and raises `ImpossibleTransition`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar

from gcsplan.errors import GcsplanError, InputError
from gcsplan.mavlink.protocol.messages import Ack, Address, Item, MissionMessage, Packet
from gcsplan.mavlink.protocol.outcome import CANCELLED, Outcome, Unknown


@dataclass(frozen=True, slots=True)
class Timers:
    """Waiting times of a transfer, in seconds; the first three fields have the protocol guide's recommended values.

    ``response_s``: wait for an answer before the message is repeated, at most ``retries`` times. ``item_s``: the same
    for an item of a download, repeated as long as the vehicle answers at all. ``silence_s``: wait of an upload for the
    next request of a vehicle that has requested items (ArduPilot itself gives up after 8 s). ``stall_s``: longest time
    of an upload without a request for a new item.
    """

    response_s: float = 1.5
    item_s: float = 0.25
    retries: int = 5
    silence_s: float = 10.0
    stall_s: float = 30.0

    def __post_init__(self) -> None:
        for name in ("response_s", "item_s", "silence_s", "stall_s"):
            value = getattr(self, name)
            if not 0 < value < 3600:
                raise InputError(f"{name} must lie within 0 … 3600 s, given {value}")
        if self.retries < 0:
            raise InputError(f"retries must not be negative, given {self.retries}")


@dataclass(frozen=True, slots=True)
class TransferProgress:
    """``done`` of ``total`` items are transferred; ``phase`` is one of: upload, read back, clear.

    ``failed``: None while it goes on. In the last report of an upload, whose phase is the outcome in a word, it tells
    whether that is another than verified.
    """

    phase: str
    done: int
    total: int
    failed: bool | None = None


@dataclass(frozen=True, slots=True)
class Wait:
    """A gate's answer "not yet": call the gate again at time ``until``."""

    until: float


Gate = Callable[[float], "Wait | Outcome | None"]
"""Called with the time before a COUNT or CLEAR_ALL is sent: None permits it, an outcome ends the transfer with it."""


def always(now: float) -> None:
    """Permit everything: the default gate."""


CANCELLED_BY_US = "cancelled by us"


class StateLabel(Enum):
    """A state or an event. Each member exists once, so its identity serves as its hash, which is fast."""

    __hash__ = object.__hash__


class ImpossibleTransition(GcsplanError, RuntimeError):
    """A machine was used in a way that its table does not allow: a bug in the caller."""


class Machine:
    """One transfer of one list with one vehicle. ``vehicle.compid`` 0 accepts every component of that system."""

    ROLE: ClassVar[str]
    TABLE: ClassVar[Mapping[tuple[Any, Any], Any]]
    CANCEL: ClassVar[StateLabel]
    """The event of `TABLE` that ends a transfer from outside."""

    def __init__(
        self,
        *,
        us: Address,
        vehicle: Address,
        mission_type: int,
        timers: Timers,
        state: StateLabel,
        gate: Gate = always,
    ) -> None:
        self.us = us
        self.vehicle = vehicle
        self.mission_type = mission_type
        self.timers = timers
        self.retries = 0
        self.outcome: Outcome | None = None
        self._state = state
        self._deadline: float | None = None
        self._gate = gate

    @property
    def deadline(self) -> float | None:
        """The next time to call `on_timer`; None before the start and after the end."""
        return self._deadline

    def receive(self, packet: Packet, now: float) -> list[Packet]:
        """Process ``packet``, from any sender, and return the answers."""
        if not self.concerns(packet):
            return []
        return self._react(packet.message, now)

    def on_timer(self, now: float) -> list[Packet]:
        """Return the packets that are due at ``now``: none before the deadline."""
        if self._deadline is None or now < self._deadline:
            return []
        return self._expire(now)

    def concerns(self, packet: Packet) -> bool:
        """Whether ``packet`` comes from our vehicle, is addressed to us or to everybody, and is of our list's type."""
        source, target = packet.source, packet.target
        return (
            source.sysid == self.vehicle.sysid
            and self.vehicle.compid in (0, source.compid)
            and target.sysid in (0, self.us.sysid)
            and target.compid in (0, self.us.compid)
            and packet.message.mission_type == self.mission_type
        )

    @property
    def answers(self) -> Sequence[Item]:
        """The item that answers a request, by seq, at any time between `start` and `cancel`; empty by default."""
        return ()

    def answered(self, seqs: Iterable[int], now: float) -> None:
        """Record requests for ``seqs`` that were already answered."""

    @property
    def mark(self) -> tuple[int, ...]:
        """A measure of progress: grows with every item that is requested or read for the first time."""
        return (self.progress.done,)

    @property
    def progress(self) -> TransferProgress:
        """Items transferred so far."""
        raise NotImplementedError

    def cancel(self, now: float, why: str = CANCELLED_BY_US) -> list[Packet]:
        """End with an unknown outcome and send ACK CANCELLED (which ArduPilot ignores in an upload)."""
        self.stop(Unknown(why))
        return [self._to_vehicle(Ack(CANCELLED, self.mission_type))]

    def stop(self, outcome: Outcome) -> None:
        """End with ``outcome`` and send nothing, because the link may lead to another vehicle by now."""
        if self.outcome is None:
            self._end(self.CANCEL, outcome)

    def _step(self, event: StateLabel) -> None:
        try:
            self._state = self.TABLE[self._state, event]
        except KeyError:
            raise ImpossibleTransition(
                f"{self.ROLE}: {event.name} is impossible in state {self._state.name}", where=f"vehicle {self.vehicle}"
            ) from None

    def _end(self, event: StateLabel, outcome: Outcome) -> None:
        self._step(event)
        self.outcome, self._deadline = outcome, None

    def _to_vehicle(self, message: MissionMessage) -> Packet:
        return Packet(self.us, self.vehicle, message)

    def _react(self, message: MissionMessage, now: float) -> list[Packet]:
        raise NotImplementedError

    def _expire(self, now: float) -> list[Packet]:
        raise NotImplementedError


def checked_type(mission_type: int, allowed: range = range(3)) -> int:
    """Return ``mission_type`` if it is in ``allowed`` (0 mission, 1 fence, 2 rally); else raise InputError."""
    if mission_type not in allowed:
        raise InputError(f"mission type must be 0 (mission), 1 (fence) or 2 (rally), given {mission_type}")
    return mission_type
