"""A loopback vehicle: a mission server that answers like an autopilot; no sockets, time is an argument.

    vehicle = LoopbackVehicle(1, Autopilot.ARDUCOPTER, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.0)
    answers = vehicle.receive(packet, now)
    if vehicle.deadline is not None and now >= vehicle.deadline:
        answers += vehicle.on_timer(now)

``now`` is the time in seconds of any clock that does not run backwards; the vehicle is switched on at the first ``now``
that it gets. `ardupilot` and `px4` decide what it answers and stores, `misbehaviour` what goes wrong.
"""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Callable, Mapping, Sequence

from gcsplan.mavlink.mission.mission import MISSION, Home, Mission, MissionItem
from gcsplan.mavlink.protocol.messages import Ack, Address, Count, Item, MissionMessage, Packet, Request, RequestList
from gcsplan.sim.vehicle.ardupilot import ArduPilotServer, home_item
from gcsplan.sim.vehicle.firmware import Firmware, firmware_of
from gcsplan.sim.vehicle.misbehaviour import Faults, LossyChannel, Misbehaviour, spoilt
from gcsplan.sim.vehicle.px4 import Px4Server
from gcsplan.sim.vehicle.stored_lists import Board, MissionServer
from gcsplan.vehicle import Autopilot

_MISSION_PLANNER = 190  # a component id that PX4 also answers to


class LoopbackVehicle:
    """One vehicle that stands on the ground and stores a mission, a fence and rally points.

    ``lat_deg``, ``lon_deg``, ``amsl_m``: its position, which is also its home. ``boot_s``: seconds after being switched
    on for which it answers NO_SPACE (ArduPilot) or nothing (PX4). ``parameters``: values that differ from the
    defaults, by their oldest names. ``firmware``: its version, None: the default of `firmware_of`.
    """

    def __init__(  # noqa: PLR0913 - options by name, each with a default
        self,
        sysid: int,
        autopilot: Autopilot,
        *,
        lat_deg: float,
        lon_deg: float,
        amsl_m: float,
        compid: int = 1,
        misbehave: Misbehaviour | None = None,
        boot_s: float = 0.0,
        name: str = "",
        parameters: Mapping[str, float] | None = None,
        firmware: Firmware | None = None,
    ) -> None:
        self.address = Address(sysid, compid)
        self.autopilot, self.parameters = autopilot, dict(parameters or {})
        self.firmware = firmware or firmware_of(autopilot)
        self.name = name or f"vehicle {sysid}"
        self.misbehave = misbehave or Misbehaviour()
        self.mode = 0  # custom mode, as last set by a ground station
        self.wind: tuple[float, float] | None = None  # m/s and the direction it comes from; set before it is served
        self._boot_s = boot_s
        self._board = Board(Home.at(lat_deg, lon_deg, amsl_m), armed=self.misbehave.armed)
        faults = Faults(self.misbehave)
        self._server: MissionServer = (
            ArduPilotServer(self._board, faults, self.firmware, plane=autopilot is Autopilot.ARDUPLANE)
            if autopilot.is_ardupilot
            else Px4Server(self._board, faults, self.firmware)
        )
        rng = random.Random(self.misbehave.seed)
        self._inbound, self._outbound = LossyChannel(self.misbehave, rng), LossyChannel(self.misbehave, rng)
        self._dead_until: float | None = None  # None: not yet switched on
        self._ready_at = 0.0
        self._received = self._items_received = 0
        self._rebooted = False
        self._edit_due_after: int | None = 0 if self.misbehave.edit is not None else None

    @classmethod
    def for_mission(cls, mission: Mission, parameters: Mapping[str, float] | None = None) -> LoopbackVehicle:
        """Return a vehicle that stands at the start of its mission."""
        home = mission.home
        return cls(
            mission.sysid, mission.autopilot, lat_deg=home.lat_e7 / 1e7, lon_deg=home.lon_e7 / 1e7, amsl_m=home.amsl_m,
            name=mission.name, parameters=parameters,
        )  # fmt: skip

    # state for tests and servers

    @property
    def sysid(self) -> int:
        """The system id."""
        return self.address.sysid

    @property
    def compid(self) -> int:
        """The component id of the autopilot."""
        return self.address.compid

    @property
    def home(self) -> Home:
        """The vehicle's position, which is its home."""
        return self._board.home

    def carry_to(self, home: Home) -> None:
        """Move the vehicle, and its home, to another place."""
        self._board.home = home

    @property
    def armed(self) -> bool:
        """Whether it is armed."""
        return self._board.armed

    @armed.setter
    def armed(self, value: bool) -> None:
        self._board.armed = value

    @property
    def flying_mission(self) -> bool:
        """Whether it follows its mission (AUTO)."""
        return self._board.flying_mission

    @flying_mission.setter
    def flying_mission(self, value: bool) -> None:
        self._board.flying_mission = value

    @property
    def silent(self) -> bool:
        """Whether the link is dead for good (``silent_after``)."""
        limit = self.misbehave.silent_after
        return limit is not None and self._received >= limit

    def booting(self, now: float) -> bool:
        """Whether it is running but not ready (system_status below standby)."""
        self._switch_on(now)
        return self.reachable(now) and now < self._ready_at

    def reachable(self, now: float) -> bool:
        """Whether it sends anything at all at ``now``."""
        self._switch_on(now)
        assert self._dead_until is not None
        return not self.silent and now >= self._dead_until

    def items(self, mission_type: int = MISSION) -> tuple[MissionItem, ...]:
        """Return the list on board as it would be read back: on ArduPilot, a mission starts with the vehicle's home."""
        stored = self._board.lists[mission_type]
        if mission_type == MISSION and self.autopilot.is_ardupilot and stored:
            return (home_item(self._board.home), *stored[1:])
        return tuple(stored)

    def load(self, items: Sequence[MissionItem], mission_type: int = MISSION) -> None:
        """Store ``items`` (in wire order) unchanged, as if from an earlier flight."""
        self._board.lists[mission_type] = list(items)

    # the protocol

    def receive(self, packet: Packet, now: float) -> list[Packet]:
        """Process one packet and return the packets that are sent at once."""
        out = self.on_timer(now)
        if not self._is_for_us(packet.target):
            return out
        self._received += 1
        if self.silent or not self.reachable(now):
            return out
        self._inbound.push(packet, now)
        return out + self._run(now)

    @property
    def deadline(self) -> float | None:
        """The next time to call `on_timer`, or None."""
        if self.silent:
            return None
        due = (self._server.deadline, self._inbound.deadline, self._outbound.deadline)
        return min((at for at in due if at is not None), default=None)

    def on_timer(self, now: float) -> list[Packet]:
        """Return the packets due at ``now``: repeated requests, ACKs of transfers given up, delayed packets."""
        self._switch_on(now)
        if not self.reachable(now):
            return []
        self._board.booting = self.booting(now)
        self._send(self._server.on_timer(now), now)
        return self._run(now)

    def reboot(self, now: float) -> None:
        """Reboot: silent for half of ``reboot_s``, booting for the other half; every transfer is lost."""
        self._server.reset()
        self._inbound.clear()
        self._outbound.clear()
        self._board.armed = self._board.flying_mission = False
        if self.misbehave.reboot_loses:
            self._board.lists[MISSION] = []
        self._dead_until = now + self.misbehave.reboot_s / 2
        self._ready_at = now + self.misbehave.reboot_s

    def _switch_on(self, now: float) -> None:
        if self._dead_until is None:
            self._dead_until, self._ready_at = now, now + self._boot_s

    def _run(self, now: float) -> list[Packet]:
        for packet in self._inbound.due(now):
            self._edit_before(packet.message)
            self._board.booting = self.booting(now)
            self._send(self._server.receive(packet.message, packet.source, now), now)
            if isinstance(packet.message, Item) and self._reboots_now():
                self.reboot(now)
                return []
        return self._outbound.due(now)

    def _is_for_us(self, target: Address) -> bool:
        if self.autopilot.is_ardupilot:
            # ArduPilot accepts packets to a component that it has never heard of (MAVLink_routing.cpp).
            return target.sysid in (0, self.sysid)
        return target.sysid == self.sysid and target.compid in (0, self.compid, _MISSION_PLANNER)

    def _send(self, answers: Sequence[tuple[Address, MissionMessage]], now: float) -> None:
        order = self.misbehave
        for to, message in answers:
            source = self.address
            if order.stray_sysid is not None:
                for lie in _lies(message, message.mission_type):
                    self._outbound.push(Packet(Address(order.stray_sysid, self.compid), to, lie), now)
            if order.stale_type is not None and order.stale_type != message.mission_type:
                for lie in _lies(message, order.stale_type):
                    self._outbound.push(Packet(source, to, lie), now)
            if order.answer_sysid is not None:
                source = Address(order.answer_sysid, self.compid)
            self._outbound.push(Packet(source, to, message), now)

    def _reboots_now(self) -> bool:
        self._items_received += 1
        if self._rebooted or self.misbehave.reboot_at is None or self._items_received < self.misbehave.reboot_at:
            return False
        self._rebooted = True
        return True

    def _edit_before(self, message: MissionMessage) -> None:
        """Act as a second ground station: change one item once, after an upload and before it is read back."""
        due = self._edit_due_after
        if due is None or not isinstance(message, RequestList) or self._board.uploads <= due:
            return
        stored = self._board.lists[MISSION]
        if stored and self.misbehave.edit is not None:
            seq = min(self.misbehave.edit, len(stored) - 1)
            stored[seq] = spoilt(stored[seq], "z")
            self._edit_due_after = None


def _lies(truth: MissionMessage, mission_type: int) -> list[MissionMessage]:
    """Return messages of ``mission_type`` that a careless ground station could mistake for ``truth``."""
    lies: dict[type[MissionMessage], Callable[[], list[MissionMessage]]] = {
        Request: lambda: [Ack(0, mission_type), Request(65535, mission_type)],
        Count: lambda: [Count(1, mission_type), Ack(0, mission_type)],
        Ack: lambda: [Ack(0, mission_type), Ack(1, mission_type)],
    }
    if isinstance(truth, Item):
        moved = dataclasses.replace(truth.item, x=truth.item.x // 2, z=truth.item.z + 100.0)
        return [Item(truth.seq, moved, mission_type)]
    return lies[type(truth)]() if type(truth) in lies else []
