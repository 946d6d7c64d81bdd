"""A real ArduPilot stores items as our autopilot profile states, and our loopback vehicle of its version does the same.

Every test is for ArduCopter and ArduPlane alike; each is skipped where there is none.
"""

from __future__ import annotations

import math
import os
import random
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest

from gcsplan.mavlink.link.frames import FrameParser, FrameWriter
from gcsplan.mavlink.link.link import GCS, Link
from gcsplan.mavlink.link.session.session import (
    SessionOptions,
    clear_mission,
    download_items,
    download_mission,
    upload_items,
    upload_mission,
    verify_mission,
)
from gcsplan.mavlink.mission.autopilots import profile_of
from gcsplan.mavlink.mission.compare import faults
from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, TERRAIN, Home, Mission, MissionItem
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.messages import (
    Ack,
    Address,
    ClearAll,
    Count,
    Item,
    MissionMessage,
    Packet,
    Request,
    RequestList,
)
from gcsplan.mavlink.protocol.outcome import DENIED, INVALID_SEQUENCE
from gcsplan.sim.vehicle.firmware import Firmware
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.vehicle import Autopilot
from sitl_tests import sitl

COPTER, PLANE = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE
UNCHECKED = SessionOptions(unchecked=True, listen_s=0.0)
SYSID = int(os.environ.get("GCSPLAN_SITL_SYSID", "1"))
OTHER_GCS = Address(254, 190)
KINDS = (MISSION, FENCE, RALLY)


@dataclass
class Real:
    """The autopilot under test, with single messages to and from any ground station."""

    link: Link
    home: Home
    autopilot: Autopilot
    firmware: Firmware
    parser: FrameParser = field(default_factory=FrameParser)
    writers: dict[Address, FrameWriter] = field(default_factory=dict)

    def say(self, message: MissionMessage, source: Address = GCS) -> None:
        writer = self.writers.setdefault(source, FrameWriter(source))
        peer = self.link.transport.default
        assert peer is not None
        self.link.transport.write(writer.pack(wire.encode(message, Address(SYSID, 1))), peer)

    def hear(self, count: int, within_s: float, quiet_s: float) -> list[Packet]:
        """Mission packets: up to ``count`` within ``within_s``, and all that arrive in the ``quiet_s`` after them."""
        heard: list[Packet] = []
        end = time.monotonic() + (within_s if count else quiet_s)
        while time.monotonic() < end:
            had = len(heard)
            for _, data in self.link.transport.read():
                decoded = (wire.decode(m) for m in self.parser.feed(data, datagram=self.link.transport.datagrams))
                heard += [packet for packet in decoded if packet is not None]
            if had < count <= len(heard):
                end = min(end, time.monotonic() + quiet_s)
            time.sleep(0.001)
        return heard

    def twin(self) -> LoopbackVehicle:
        """A loopback vehicle of the same version at the same home."""
        home = self.home
        return LoopbackVehicle(
            SYSID, self.autopilot, lat_deg=home.lat_e7 / 1e7, lon_deg=home.lon_e7 / 1e7, amsl_m=home.amsl_m,
            firmware=self.firmware,
        )  # fmt: skip

    def upload(self, items: list[MissionItem], mission_type: int = MISSION) -> int:
        """Upload without our own session code; return the code of the last ACK."""
        self.say(Count(len(items), mission_type))
        end = time.monotonic() + 60.0
        while time.monotonic() < end:
            for packet in self.hear(1, 1.0, 0.0):
                if isinstance(packet.message, Request):
                    self.say(Item(packet.message.seq, items[packet.message.seq], mission_type))
                elif isinstance(packet.message, Ack) and packet.message.code != 13:
                    return packet.message.code
        raise AssertionError("the upload did not end within a minute")


def upload_to_twin(twin: LoopbackVehicle, items: list[MissionItem], mission_type: int = MISSION) -> int:
    """The same upload to a loopback vehicle; return the code of its ACK."""
    todo: MissionMessage = Count(len(items), mission_type)
    while True:
        (answer,) = twin.receive(Packet(GCS, Address(SYSID, 1), todo), 0.0)
        if isinstance(answer.message, Ack):
            return answer.message.code
        assert isinstance(answer.message, Request)
        todo = Item(answer.message.seq, items[answer.message.seq], mission_type)


@pytest.fixture(scope="module", params=[pytest.param(a, marks=sitl.needs(a), id=a.value) for a in (COPTER, PLANE)])
def real(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Real]:
    with sitl.running(request.param, tmp_path_factory.mktemp("sitl")) as link:
        state = sitl.ready(link, SYSID, request.param)
        assert state.home is not None
        yield Real(link, state.home, request.param, sitl.firmware(link, state))


def every_command(home: Home, autopilot: Autopilot) -> Mission:
    """A mission with every command that gcsplan writes for the vehicle, in its frames and kinds of numbers."""

    def at(command: int, n: int, z: float, frame: int = 3, *params: float) -> MissionItem:
        p = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
        return MissionItem(command, frame, (p[0], p[1], p[2], p[3]), home.lat_e7 + 7001 * n, home.lon_e7 - 9003 * n, z)

    copter = (
        at(22, 0, 65.005),
        MissionItem(178, 2, (1.0, 4.37, -1.0, 0.0)),
        at(16, 1, 70.005),
        at(16, 2, home.amsl_m + 80.015, 0),
        at(16, 3, 49.995, TERRAIN),
        at(16, 4, 65.125, 3, 12.0),
        MissionItem(93, 2, (2.5, -1.0, -1.0, -1.0)),
        MissionItem(93, 2, (-1.0, 4.0, 12.0, 30.0)),
        MissionItem(178, 2, (1.0, 15.0, -1.0, 0.0)),
        at(19, 5, 70.005, 3, 30.0),
        at(17, 6, 70.005),
        at(21, 7, 0.0),
        MissionItem(20, 2),
    )
    plane = (
        at(22, 0, 65.005, 3, 12.0),
        MissionItem(178, 2, (0.0, 20.5, -1.0, 0.0)),
        at(16, 1, 70.005, 3, 0.0, 40.0, 15.0),
        at(16, 2, home.amsl_m + 80.015, 0, 0.0, 300.0),
        at(16, 3, 49.995, TERRAIN),
        at(31, 4, 90.005, 3, 0.0, -120.0, 0.0, 1.0),
        at(18, 5, 90.005, 3, 2.0, 0.0, 100.0, 1.0),
        at(18, 6, 90.005, 3, 1.0, 0.0, -300.0, 0.0),
        at(19, 7, 90.005, 3, 30.0, 0.0, -1.0, 1.0),
        MissionItem(93, 2, (2.5, -1.0, -1.0, -1.0)),
        at(17, 8, 70.005, 3, 0.0, 0.0, -110.0),
        at(189, 9, 0.0),
        at(21, 10, 0.0),
        MissionItem(20, 2),
    )
    return Mission(autopilot, home, copter if autopilot is COPTER else plane, "sitl", SYSID)


def a_fence(home: Home) -> list[MissionItem]:
    circles = [MissionItem(5004, 3, (50.5 + n, 0, 0, 0), home.lat_e7 + 90_000 * n, home.lon_e7) for n in range(1, 6)]
    half = 2_500_000
    corners = [(-half, -half), (-half, half), (half, half), (half, -half)]
    return [
        *circles,
        *(MissionItem(5001, 3, (4.0, 0, 0, 0), home.lat_e7 + x, home.lon_e7 + y) for x, y in corners),
    ]  # fmt: skip


def wires(items: Any) -> list[bytes]:
    return [item.wire for item in items]


def test_a_mission_with_every_command_is_kept_as_expected(real: Real) -> None:
    mission = every_command(real.home, real.autopilot)
    result = upload_mission(real.link, mission, options=UNCHECKED)
    assert (result.outcome, result.verified, result.faults) == ("accepted", True, ())
    assert verify_mission(real.link, mission, options=UNCHECKED).verified
    read = download_mission(real.link, SYSID, real.autopilot, options=UNCHECKED)
    assert [i.command for i in read.items] == [i.command for i in mission.items]
    twin = real.twin()
    assert upload_to_twin(twin, list(mission.wire_items())) == 0
    assert wires(read.items) == wires(twin.items()[1:])


def test_another_mission_on_board_is_recognised(real: Real) -> None:
    mission = every_command(real.home, real.autopilot)
    assert upload_mission(real.link, mission, options=UNCHECKED).verified
    items = list(mission.items)
    items[2] = MissionItem(16, 3, items[2].params, items[2].x + 1, items[2].y, items[2].z)
    other = Mission(real.autopilot, mission.home, tuple(items), "sitl", SYSID)
    result = verify_mission(real.link, other, options=UNCHECKED)
    assert not result.verified
    assert [(d.seq, d.field) for d in faults(result.differences)] == [(3, "latitude")]


def test_a_mission_is_cleared_and_the_home_stays(real: Real) -> None:
    assert upload_mission(real.link, every_command(real.home, real.autopilot), options=UNCHECKED).verified
    assert clear_mission(real.link, SYSID, options=UNCHECKED).verified
    # Since 4.7 a plane, which renews its home until it is armed, may count it as an item again.
    assert len(download_items(real.link, SYSID, options=UNCHECKED)) <= (real.autopilot is PLANE)


def test_a_long_mission_and_one_that_is_too_long(real: Real) -> None:
    point = every_command(real.home, real.autopilot).items[2]
    points = [MissionItem(16, 3, x=point.x + n, y=point.y, z=60.005 + n / 10) for n in range(649)]
    mission = Mission(real.autopilot, real.home, tuple(points), "long", SYSID)
    assert upload_mission(real.link, mission, options=UNCHECKED).verified
    most = profile_of(real.autopilot).max_items if real.autopilot is COPTER else 655
    assert real.upload([point] * (most + 1)) == upload_to_twin(real.twin(), [point] * (most + 1)) == 4


def test_a_fence_is_kept_as_expected(real: Real) -> None:
    fence = a_fence(real.home)
    result = upload_items(real.link, SYSID, fence, real.autopilot, FENCE, options=UNCHECKED)
    assert result.verified, result.reason
    twin = real.twin()
    assert upload_to_twin(twin, fence, FENCE) == 0
    assert wires(download_items(real.link, SYSID, FENCE, options=UNCHECKED)) == wires(twin.items(FENCE))
    assert clear_mission(real.link, SYSID, FENCE, options=UNCHECKED).verified


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_random_items_are_kept_as_our_vehicle_keeps_them(real: Real, seed: int) -> None:
    rng = random.Random(seed)
    commands = (16, 17, 18, 19, 20, 21, 22, 31, 82, 93, 112, 115, 178, 179, 183, 195, 206)
    numbers = (0.0, 1.0, -1.0, 0.5, 2.5, 17.13, 254.9, 300.5, 70000.0)

    def number() -> float:
        return rng.choice([*numbers, rng.uniform(-500, 500)])

    taken: list[MissionItem] = [MissionItem(16, 0)]
    refused: list[tuple[MissionItem, int]] = []
    while len(taken) < 300:
        params = [number() for _ in range(4)]
        if rng.random() < 0.1:
            params[rng.randrange(4)] = math.nan
        item = MissionItem(
            rng.choice(commands), rng.choice([0, 2, 3, 5, 6, 10, 11, 1]), (params[0], params[1], params[2], params[3]),
            rng.randint(-910_000_000, 910_000_000), rng.randint(-1_810_000_000, 1_810_000_000),
            rng.choice([rng.uniform(-500, 9000), 17.13, 83_000.0]),
        )  # fmt: skip
        code = upload_to_twin(real.twin(), [taken[0], item])
        if code:
            refused.append((item, code))
        else:
            taken.append(item)
    twin = real.twin()
    assert real.upload(taken) == upload_to_twin(twin, taken) == 0
    on_board = download_items(real.link, SYSID, options=UNCHECKED)
    differing = [(s, k, r) for s, k, r in zip(taken, twin.items(), on_board, strict=True) if k.wire != r.wire]
    assert [d for d in differing if d[0] is not taken[0]] == []
    for item, code in refused[:30]:
        assert real.upload([taken[0], item]) == code, item


def an_item(rng: random.Random, kind: int, home: Home) -> MissionItem:
    usual = {MISSION: (16, 0.0), FENCE: (5004, 30.0), RALLY: (5100, 0.0)}
    command, first = rng.choice([usual[kind]] * 8 + [(9999, 0.0), (20, 0.0)])
    return MissionItem(command, 3, (first, 0.0, 0.0, 0.0), home.lat_e7 + rng.randint(0, 99999), home.lon_e7, 30.005)


def some_message(rng: random.Random, home: Home, uploading: list[int]) -> MissionMessage:
    """A random mission message of a ground station, sensible or not, mostly about lists that are being uploaded."""
    kind, seq = rng.choice([MISSION, FENCE, RALLY, *uploading * 3]), rng.randint(0, 4)
    return rng.choice([
        Count(rng.randint(0, 4), kind), Item(seq, an_item(rng, kind, home), kind), Request(seq, kind),
        Request(seq, kind, legacy=True), RequestList(kind), ClearAll(kind), Ack(0, kind), Ack(15, kind),
    ])  # fmt: skip


def comparable(packet: Packet) -> tuple[Any, ...]:
    """Target and content of a packet, for comparison; home's numbers are left out, as the real one drifts by cm."""
    message = packet.message
    if isinstance(message, Item):
        home = message.mission_type == MISSION and message.seq == 0
        return (packet.target, type(message), message.seq, message.mission_type, home or message.item.wire)
    return (packet.target, message)


@pytest.mark.parametrize("seed", range(8))
def test_our_vehicle_answers_any_message_as_the_real_one(real: Real, seed: int) -> None:
    """Compare every answer of the loopback vehicle with the real one's, for random messages of two ground stations."""
    rng, twin = random.Random(seed), real.twin()
    for kind in KINDS:
        for source in (GCS, OTHER_GCS):
            real.say(ClearAll(kind), source)  # ends any upload that is under way
            twin.receive(Packet(source, Address(SYSID, 1), ClearAll(kind)), 0.0)
    real.hear(0, 0.0, 0.3)
    asking: dict[int, Packet] = {}  # the request that each list is waiting for
    for _ in range(100):
        source, message = rng.choice((GCS, GCS, OTHER_GCS)), some_message(rng, real.home, sorted(asking))
        if asking and rng.random() < 0.5:  # continue an upload, or none would get far
            kind, request = rng.choice(sorted(asking.items()))
            assert isinstance(request.message, Request)
            source, message = request.target, Item(request.message.seq, an_item(rng, kind, real.home), kind)
        answers = twin.receive(Packet(source, Address(SYSID, 1), message), 0.0)
        expected = [comparable(p) for p in answers]
        real.say(message, source)
        got = [comparable(p) for p in real.hear(len(expected), 1.0, 0.01)]
        for again in map(comparable, asking.values()):  # the real one may repeat a request; the twin's clock stops
            while got.count(again) > expected.count(again):
                got.remove(again)
        assert got == expected, (source, message)
        for packet in answers:
            kind = packet.message.mission_type
            if isinstance(packet.message, Request):
                asking[kind] = packet
            elif _ends(packet, asking.get(kind)):
                del asking[kind]


def _ends(packet: Packet, asking: Packet | None) -> bool:
    """Whether ``packet`` ends the upload in which ``asking`` was the last request."""
    if asking is None or not isinstance(packet.message, Ack) or packet.target != asking.target:
        return False
    return packet.message.code not in (INVALID_SEQUENCE, DENIED)
