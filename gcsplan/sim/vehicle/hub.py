"""Vehicles and their listeners, without sockets: bytes from a client in, bytes to clients out; time is an argument.

An answer goes to the client that sent the request. What a vehicle sends on its own goes to every client heard recently.
"""

from __future__ import annotations

import logging
import random
from collections import OrderedDict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

from gcsplan.errors import UsageError
from gcsplan.mavlink.link.frames import FrameParser, FrameWriter, Signing
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.messages import Address, Packet
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.telemetry import Message, Telemetry

Client = Hashable
Sent = list[tuple[Client, bytes]]

MOST_CLIENTS = 16
MOST_STATIONS = 64  # ground stations (system and component ids) whose client is remembered
FORGOTTEN_AFTER_S = 60.0

_log = logging.getLogger(__name__)


@dataclass
class _Listener:
    heard_at: float
    parser: FrameParser


class Hub:
    """One or many vehicles behind one port.

    ``always``: a client that receives everything from the start. ``signing``: the vehicles sign their frames and accept
    only signed ones. ``mishandled`` counts messages that raised an error, which only a bug in the simulator causes.
    """

    def __init__(
        self, vehicles: Sequence[LoopbackVehicle], *, always: Client | None = None, signing: Signing | None = None
    ) -> None:
        ids = [v.sysid for v in vehicles]
        if not ids or len(set(ids)) != len(ids):
            raise UsageError(f"a simulator wants at least one vehicle and each system id once, given {ids}")
        self.vehicles = [(v, Telemetry(v), random.Random(v.misbehave.seed + 1)) for v in vehicles]
        self._always = always
        self._signing = signing or Signing()
        self._listeners: OrderedDict[Client, _Listener] = OrderedDict()
        self._whereabouts: OrderedDict[Address, Client] = OrderedDict()
        self._writers: dict[Address, FrameWriter] = {}  # each source counts its own frames
        self._next_second: float | None = None
        self.mishandled = 0

    @property
    def clients(self) -> list[Client]:
        """The clients that receive what a vehicle sends on its own."""
        heard = list(self._listeners)
        return heard if self._always is None or self._always in self._listeners else [self._always, *heard]

    def take(self, client: Client, data: bytes, now: float, *, datagram: bool = True) -> Sent:
        """Process what ``client`` sent, a whole datagram or the next piece of a stream, and return the answers."""
        self.welcome(client, now)
        listener = self._listeners.pop(client)
        listener.heard_at = now
        self._listeners[client] = listener  # keep the order of last contact
        while len(self._listeners) > MOST_CLIENTS:
            self.forget(next(iter(self._listeners)))
        sent: Sent = []
        for message in listener.parser.feed(data, datagram=datagram):
            if message.late:
                continue
            try:
                sent += self._handle(message, client, now)
            except (ArithmeticError, ValueError, TypeError, LookupError, AttributeError):
                # A simulator that others test against must survive its own bugs; its tests check the count.
                self.mishandled += 1
                _log.exception("cannot handle %s", message.get_type())
        return sent

    def _handle(self, message: Message, client: Client, now: float) -> Sent:
        source = Address(message.get_srcSystem(), message.get_srcComponent())
        if any(v.sysid == source.sysid for v, *_ in self.vehicles):
            return []  # our own message, sent back
        self._whereabouts[source] = client
        self._whereabouts.move_to_end(source)
        while len(self._whereabouts) > MOST_STATIONS:
            self._whereabouts.popitem(last=False)
        packet = wire.decode(message)
        sent: Sent = []
        for vehicle, telemetry, _ in self.vehicles:
            if packet is not None:
                sent += self._routed(vehicle.receive(packet, now), source, client)
            else:
                for answer in telemetry.answer(message, now):
                    sent.append((client, self._frame(answer, vehicle.address)))
        return sent

    def _frame(self, message: Message, source: Address) -> bytes:
        return self._writers.setdefault(source, FrameWriter(source, self._signing)).pack(message)

    def _routed(self, packets: Sequence[Packet], speaker: Address | None = None, client: Client | None = None) -> Sent:
        sent: Sent = []
        for packet in packets:
            frame = self._frame(wire.encode(packet.message, packet.target), packet.source)
            if packet.target == speaker:
                sent.append((client, frame))
            elif packet.target in self._whereabouts:
                sent.append((self._whereabouts[packet.target], frame))
            else:
                sent += [(one, frame) for one in self.clients]
        return sent

    @property
    def deadline(self) -> float | None:
        """The next time to call `on_timer`, or None if no vehicle needs it and it was never called."""
        due = (self._next_second, *(v.deadline for v, *_ in self.vehicles))
        return min((at for at in due if at is not None), default=None)

    def on_timer(self, now: float) -> Sent:
        """Return what is due at ``now``; the first call starts the heartbeats."""
        sent: Sent = []
        for vehicle, *_ in self.vehicles:
            sent += self._routed(vehicle.on_timer(now))
        if self._next_second is None or now >= self._next_second:
            # Not "+= 1": after a pause of the machine one heartbeat is due, not one for each missed second.
            self._next_second = now + 1.0
            sent += self._unasked(now)
        return sent

    def _unasked(self, now: float) -> Sent:
        gone = [c for c, listener in self._listeners.items() if now - listener.heard_at > FORGOTTEN_AFTER_S]
        for client in gone:
            self.forget(client)
        sent: Sent = []
        for vehicle, telemetry, rng in self.vehicles:
            for message in telemetry.each_second(now):
                if rng.random() >= vehicle.misbehave.drop:
                    frame = self._frame(message, vehicle.address)
                    sent += [(client, frame) for client in self.clients]
        return sent

    def welcome(self, client: Client, now: float) -> None:
        """Add a client, which may not have sent anything yet, so that it gets a heartbeat at once."""
        if client not in self._listeners:
            self._listeners[client] = _Listener(now, FrameParser(self._signing))
            self._next_second = now

    def forget(self, client: Client) -> None:
        """Remove a client that has left."""
        self._listeners.pop(client, None)
        for station in [s for s, where in self._whereabouts.items() if where == client]:
            del self._whereabouts[station]
