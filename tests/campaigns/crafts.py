"""The participants of the links campaign: observed vehicles, forgers, and recorders that replay."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.mavlink.link.frames import FrameWriter, Signing
from gcsplan.mavlink.link.transport import Peer
from gcsplan.mavlink.mission.compare import compare, faults
from gcsplan.mavlink.mission.mission import MISSION, Home, MissionItem
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.messages import Ack, Address, Count, Item, Request
from gcsplan.sim.vehicle.firmware import firmware_of
from gcsplan.sim.vehicle.hub import Hub
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import spoilt
from gcsplan.sim.vehicle.parameters import REAL32, Parameters
from gcsplan.vehicle import Autopilot
from tests.campaigns.air import STATION, Air

US = Address(255, 190)
ODD = (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e-45, 2.0**31, -(2.0**31), 1e9, -1.0, 0.5, 65536.0)


class OddParameters(Parameters):
    """Parameters with values that no autopilot should send, some of types that do not exist."""

    def __init__(self, autopilot: Autopilot, sysid: int, rng: random.Random) -> None:
        super().__init__(autopilot, sysid, firmware_of(autopilot))
        self._rng = rng

    def on_wire(self, name: str) -> tuple[float, int]:
        """Value and type of a parameter; odd ones in 70 % of the calls."""
        if self._rng.random() < 0.3:
            return super().on_wire(name)
        return self._rng.choice(ODD), self._rng.choice((REAL32, 6, 1, 0, 255, 10))


class Craft:
    """A vehicle behind a hub. Records the items on board by time, and the messages that the station has heard."""

    def __init__(self, vehicle: LoopbackVehicle, air: Air, signing: Signing | None = None) -> None:
        self.vehicle, self.air = vehicle, air
        self.hub = Hub([vehicle], always=STATION, signing=signing)
        self.expected: tuple[MissionItem, ...] = ()
        self.deadline = self.hub.deadline
        self.silent = False
        self.address: Peer = ""
        self.there_since = air.now
        self.left_at = math.inf
        self.forget()
        self.start = vehicle.home
        self._last: list[MissionItem] | None = None
        self._equal_since = math.inf
        self.equal: list[tuple[float, float]] = []

    def forget(self) -> None:
        """Forget the messages that the ground station has heard: a new run of it begins without them."""
        self.known_since, self.last_heard = math.inf, -math.inf
        self.together = 0  # positions heard while another vehicle was at the same address
        self._beats_at: list[float] = []
        self.armed_reported = self.far_reported = math.inf

    def take(self, client: str, data: bytes, now: float) -> list[tuple[Any, bytes]]:
        """Receive bytes from the ground station; return the answers."""
        if self.silent:
            return []
        sent = self.hub.take(client, data, now)
        self.deadline = self.hub.deadline
        self.look()
        return sent

    def on_timer(self, now: float) -> list[tuple[Any, bytes]]:
        """The messages that it sends at this time on its own."""
        sent = self.hub.on_timer(now)
        self.deadline = self.hub.deadline
        self.look()
        return [] if self.silent else sent

    def look(self) -> None:
        items = list(self.vehicle.items())
        if items == self._last or not self.expected:
            return
        self._last, now = items, self.air.now
        same = not faults(compare(self.expected, items, self.vehicle.autopilot))
        if self._equal_since < now and not same:
            self.equal.append((self._equal_since, now))
        self._equal_since = min(self._equal_since, now) if same else math.inf

    def was_equal(self, since: float, until: float) -> bool:
        """Whether the expected items were on board at some time between ``since`` and ``until``."""
        self.look()
        spans = [*self.equal, (self._equal_since, math.inf)]
        return any(begin <= until and end >= since for begin, end in spans)

    def heard(self, message: Any) -> None:
        """Record that the ground station has accepted this message of the vehicle."""
        kind, now = message.get_type(), self.air.now
        self.last_heard = now
        if kind == "HEARTBEAT":
            self.known_since = min(self.known_since, now)
            self._beats_at.append(now)
            self.armed_reported = min(self.armed_reported, now) if message.base_mode & 128 else math.inf
        elif kind == "GLOBAL_POSITION_INT":
            far = max(abs(message.lat - self.start.lat_e7), abs(message.lon - self.start.lon_e7)) > 5000
            self.far_reported = min(self.far_reported, now) if far else math.inf

    def heard_between(self, since: float, until: float) -> bool:
        """Whether two of its heartbeats were heard between ``since`` and ``until``."""
        return sum(since <= at <= until for at in self._beats_at) >= 2

    # events

    def carry(self, far: bool) -> None:
        """Move it by 33 km, or by a few metres."""
        home, d = self.vehicle.home, 3_000_000 if far else 200
        self.vehicle.carry_to(Home(home.lat_e7 + d, home.lon_e7, home.amsl_m))

    def edit(self, rng: random.Random) -> None:
        """Change, drop or append items, as a second ground station would."""
        items = list(self.vehicle.items())
        if len(items) < 2:
            return
        i = rng.randrange(1, len(items))
        kind = rng.random()
        if kind < 0.6:
            items[i] = spoilt(items[i], rng.choice(("x", "z", "command", "param1")))
        elif kind < 0.8:
            del items[i:]
        else:
            items.append(items[i])
        self.vehicle.load(items)

    def arm(self) -> None:
        """Arm it."""
        self.vehicle.armed = True

    def disarm(self) -> None:
        """Disarm it."""
        self.vehicle.armed = False

    def go_silent(self) -> None:
        """Put it out of radio range."""
        self.silent = True

    def come_back(self) -> None:
        """Bring it back into radio range."""
        self.silent = False


SILENCE_S = 3.0


@dataclass
class Voice:
    """The messages that the ground station has heard in the name of one component at one address, whoever sent them."""

    last: float = -math.inf
    back_at: float = -math.inf
    beats_at: list[float] = field(default_factory=list)
    places_at: list[float] = field(default_factory=list)

    def heard(self, kind: str, now: float) -> None:
        """Record a message of the given kind."""
        if now - self.last > SILENCE_S + 1e-6:
            self.back_at = now
        self.last = now
        if kind == "HEARTBEAT":
            self.beats_at.append(now)
        elif kind in ("GLOBAL_POSITION_INT", "GPS_RAW_INT"):
            self.places_at.append(now)

    @property
    def looked_at(self) -> bool:
        """Whether a heartbeat, and a position if it ever sent one, came since its first message or its last silence."""
        return self.look_after(self.back_at) < math.inf

    def look_after(self, since: float) -> float:
        """The earliest time at which a look begun at ``since`` could end: after a heartbeat, and a position if any."""
        needed = [self.beats_at, *([self.places_at] if self.places_at else [])]
        return max(min((at for at in heard if at >= since), default=math.inf) for heard in needed)


class Forger:
    """Sends mission messages, parameters and telemetry in a vehicle's name from ``address``.

    A ``polite`` one sends only status texts and parameters.
    """

    def __init__(self, air: Air, address: Peer, victim: Address, rng: random.Random, *, polite: bool) -> None:
        self._air, self._address, self._rng, self._polite = air, address, rng, polite
        compid = victim.compid if rng.random() < 0.8 else rng.choice((0, 2, 154, 190))
        self._writer = FrameWriter(Address(victim.sysid, compid))

    def speak(self) -> None:
        """Send one forged message."""
        kinds = (self._telemetry, self._parameter) if self._polite else (self._telemetry, self._parameter, self._list)
        self._air.say(self._address, self._writer.pack(self._rng.choice(kinds)()), self)

    def _list(self) -> Any:
        rng = self._rng
        lies = (
            Ack(rng.choice((0, 0, 1, 5, 13, 15, 77))), Count(rng.choice((0, 1, 7, 700, 65535))),
            Request(rng.choice((0, 1, 3, 65535)), legacy=rng.random() < 0.5),
            Item(rng.choice((0, 1, 2, 60000)), MissionItem(16, 3, (math.nan,) * 4, 2**31 - 1, -(2**31), math.inf)),
        )  # fmt: skip
        return wire.encode(rng.choice(lies), US)

    def _telemetry(self) -> Any:
        rng = self._rng
        i32 = [rng.randrange(-(2**31), 2**31) for _ in range(3)]
        if self._polite:  # it uses the vehicle's own address, so it sends nothing that a look judges
            return dialect.MAVLink_statustext_message(rng.randrange(8), rng.randbytes(50))
        return rng.choice((
            dialect.MAVLink_global_position_int_message(rng.randrange(2**32), *i32, 0, 0, 0, 0, 0),
            dialect.MAVLink_gps_raw_int_message(0, rng.randrange(9), *i32, 0, 0, 0, 0, 0),
            dialect.MAVLink_home_position_message(*i32, 0, 0, 0, [math.nan] * 4, 0, 0, math.inf),
            dialect.MAVLink_autopilot_version_message(rng.randrange(2**64), 0, 0, 0, 0, *[[0] * 8] * 3, 0, 0, 0),
            dialect.MAVLink_statustext_message(rng.randrange(8), rng.randbytes(50)),
            dialect.MAVLink_heartbeat_message(rng.randrange(45), rng.randrange(20), rng.randrange(256), 0, 4, 3),
        ))  # fmt: skip

    def _parameter(self) -> Any:
        rng = self._rng
        name = rng.choice(
            (b"RTL_ALT", b"FENCE_TYPE", b"FENCE_ENABLE", b"RTL_RETURN_ALT", b"GF_ACTION", rng.randbytes(16))
        )
        return dialect.MAVLink_param_value_message(name, rng.choice(ODD), rng.randrange(256), 1, 65535)


class Recorder:
    """Records a vehicle's frames and replays them later."""

    MOST = 3000

    def __init__(self, air: Air) -> None:
        self._air = air
        self.frames: list[tuple[float, bytes]] = []

    def note(self, data: bytes) -> None:
        """Record a frame with its time."""
        if len(self.frames) < self.MOST:
            self.frames.append((self._air.now, data))

    def replay(self, address: Peer, after_s: float, most: int) -> None:
        """Send the first ``most`` frames again with their original timing, starting in ``after_s`` seconds."""
        if not self.frames:
            return
        began = self.frames[0][0]
        for at, data in self.frames[:most]:
            self._air.later(after_s + at - began, lambda data=data: self._air.say(address, data, self))  # type: ignore[misc]


__all__ = ["MISSION", "Craft", "Forger", "OddParameters", "Recorder", "Voice"]
