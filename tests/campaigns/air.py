"""A simulated radio network: a ground station, vehicles at addresses, a bad radio between them, a simulated clock.

`Link`, `session` and everything above them run on it unchanged: `Air` is their transport, their clock and their wait.
At an address there is a `Hub`, as behind a simulator's socket, or anything else that accepts bytes.
"""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from gcsplan.mavlink.link.frames import Signing
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.transport import HeardBytes, Peer

STATION = "ground station"
EPOCH_S = 1_800_000_000.0
_MOST_FRAMES = 400_000


class Hang(AssertionError):
    """The limit of simulated time or of frames was exceeded."""


class Place(Protocol):
    """Anything at an address that receives and sends bytes."""

    @property
    def deadline(self) -> float | None: ...

    def take(self, client: str, data: bytes, now: float) -> list[tuple[Any, bytes]]: ...

    def on_timer(self, now: float) -> list[tuple[Any, bytes]]: ...


@dataclass(frozen=True)
class Radio:
    """Probabilities for each datagram in either direction; delays in seconds."""

    loss: float = 0.0
    duplicate: float = 0.0
    held_up: float = 0.0
    delay_s: float = 0.02
    jitter_s: float = 0.02
    hold_s: float = 0.4


class Air:
    """The ground station's transport.

    It calls ``written(address, data)`` for every frame that the station sends and ``heard(by, address, message)`` for
    every message that the station accepts.
    """

    datagrams = True
    handles: Sequence[int] = ()
    place = "127.0.0.1:0"

    def __init__(self, seed: int, radio: Radio, *, limit_s: float, default: Peer | None = None) -> None:
        self.now = 1000.0
        self.radio = radio
        self.default: Peer | None = default
        self.written: Callable[[Peer, bytes], None] = lambda peer, data: None
        self.heard: Callable[[object, Peer, Any], None] = lambda by, peer, message: None
        self._rng = random.Random(seed)
        self._limit_s = self.now + limit_s
        self._places: dict[Peer, list[Place]] = {}
        self._queue: list[tuple[float, int, Peer, object | None, bytes]] = []  # None: sent by us, not by a place
        self._acts: list[tuple[float, int, Callable[[], None]]] = []
        self._inbox: list[tuple[Peer, bytes, object]] = []
        self.senders: list[object] = []
        self._count = 0

    def clock(self) -> float:
        """The simulated time, seconds."""
        return self.now

    def wall_clock(self) -> float:
        """Seconds since 1970, for signatures."""
        return EPOCH_S + self.now

    def link(self, signing: Signing | None = None) -> Link:
        """A ground station's link over this network."""
        return _Link(self, "udpin:127.0.0.1:0", clock=self.clock, transport=self, wait=self.wait, signing=signing)

    # places and events

    def at(self, address: Peer) -> list[Place]:
        """The places at ``address``: the live list, which callers may change."""
        return self._places.setdefault(address, [])

    def later(self, after_s: float, act: Callable[[], None]) -> None:
        """Call ``act`` after ``after_s`` seconds."""
        self._count += 1
        heapq.heappush(self._acts, (self.now + after_s, self._count, act))

    def put(self, address: Peer, place: Place) -> None:
        """Add ``place`` at ``address``, beside the places that are there already."""
        self.at(address).append(place)
        self._answer(address, place, place.on_timer(self.now))

    def say(self, address: Peer, data: bytes, by: object) -> None:
        """Send ``data`` from ``address`` to the ground station; ``by`` is the true sender."""
        self._send(address, data, by)

    # the transport

    def read(self) -> list[HeardBytes]:
        heard, self._inbox = self._inbox, []
        self.senders = [by for *_, by in heard]
        return [(address, data) for address, data, _ in heard]

    def write(self, data: bytes, peer: Peer) -> None:
        self.written(peer, data)
        self._send(peer, data, None)

    def close(self) -> None:
        """Do nothing: there is nothing to close."""

    def wait(self, transports: Sequence[Any], timeout_s: float) -> None:
        """Advance time until the ground station receives something or ``timeout_s`` is over; raise Hang at a limit."""
        until = self.now + max(0.0, timeout_s)
        while not self._inbox:
            due = self._next()
            if due > until:
                break
            self.now = max(self.now, due)
            self._happen()
        self.now = max(self.now, until) if not self._inbox else self.now
        if self.now > self._limit_s or self._count > _MOST_FRAMES:
            raise Hang(f"it goes on after {self.now - 1000.0:.0f} simulated seconds and {self._count} frames")

    def _next(self) -> float:
        due = [at for places in self._places.values() for p in places if (at := p.deadline) is not None]
        due += [heap[0][0] for heap in (self._queue, self._acts) if heap]
        return min(due, default=float("inf"))

    def _happen(self) -> None:
        now = self.now
        while self._acts and self._acts[0][0] <= now:
            heapq.heappop(self._acts)[2]()
        while self._queue and self._queue[0][0] <= now:
            _, _, address, by, data = heapq.heappop(self._queue)
            if by is not None:
                self._inbox.append((address, data, by))
            else:
                for there in list(self.at(address)):
                    self._answer(address, there, there.take(STATION, data, now))
        for address, places in list(self._places.items()):
            for there in list(places):
                if there.deadline is not None and there.deadline <= now:
                    self._answer(address, there, there.on_timer(now))

    def _answer(self, address: Peer, by: Place, sent: list[tuple[Any, bytes]]) -> None:
        for _, data in sent:
            self._send(address, data, by)

    def _send(self, address: Peer, data: bytes, by: object | None) -> None:
        radio, rng = self.radio, self._rng
        for _ in range(1 + (rng.random() < radio.duplicate)):
            if rng.random() < radio.loss:
                continue
            late_s = radio.delay_s + rng.random() * radio.jitter_s
            if rng.random() < radio.held_up:
                late_s += rng.random() * radio.hold_s
            self._count += 1
            heapq.heappush(self._queue, (self.now + late_s, self._count, address, by, data))


class _Link(Link):
    """A link that reports each accepted message and its true sender to `Air.heard`."""

    def __init__(self, air: Air, url: str, **more: Any) -> None:
        self._air, self._by = air, None
        super().__init__(url, **more)

    def take_in(self, peer: Peer, data: bytes, now: float) -> None:
        self._by = self._air.senders.pop(0)
        super().take_in(peer, data, now)

    def route(self, peer: Peer, message: Any, now: float) -> None:
        if not message.late:
            self._air.heard(self._by, peer, message)
        super().route(peer, message, now)
