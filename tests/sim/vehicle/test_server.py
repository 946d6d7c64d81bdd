"""The simulator as ground stations see it: what it says and answers, to whom, and what cannot kill it."""

from __future__ import annotations

import signal
import socket
import struct
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mav

from gcsplan.errors import InputError, LinkError, UsageError
from gcsplan.mavlink.link.frames import FrameParser, FrameWriter
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.messages import Address, Count, Item, Request
from gcsplan.sim.vehicle.hub import FORGOTTEN_AFTER_S, MOST_CLIENTS, Client, Hub
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.support.effort import draws

GCS = Address(255, 190)
COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4


def a_vehicle(sysid: int = 1, autopilot: Autopilot = COPTER, trouble: str = "", **more: float) -> LoopbackVehicle:
    order = Misbehaviour.parse(trouble)
    return LoopbackVehicle(sysid, autopilot, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.25, misbehave=order, **more)


def frame(message: Any, source: Address = GCS) -> bytes:
    return FrameWriter(source).pack(message)


def command(number: int, *params: float, sysid: int = 1) -> Any:
    seven = (*params, *[0.0] * 7)[:7]
    return mav.MAVLink_command_long_message(sysid, 1, number, 0, *seven)


def messages(data: Iterable[bytes]) -> list[Any]:
    parser = FrameParser()
    return [m for piece in data for m in parser.feed(piece)]


def ask(hub: Hub, message: Any, now: float = 0.0, *, client: Client = "a", source: Address = GCS) -> list[Any]:
    """Say one thing to the hub; what came back to this client."""
    return messages(data for to, data in hub.take(client, frame(message, source), now) if to == client)


def unasked(hub: Hub, now: float) -> dict[str, Any]:
    ask(hub, mav.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3), now)
    return {m.get_type(): m for m in messages(data for _, data in hub.on_timer(now))}


# ── what a vehicle says ───────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("autopilot", "kind", "number"), [(COPTER, 2, 3), (PLANE, 1, 3), (PX4, 2, 12)]
)  # MAV_TYPE, MAV_AUTOPILOT
def test_a_heartbeat_tells_what_the_vehicle_is(autopilot: Autopilot, kind: int, number: int) -> None:
    heartbeat = unasked(Hub([a_vehicle(5, autopilot)]), 0.0)["HEARTBEAT"]
    assert (heartbeat.type, heartbeat.autopilot, heartbeat.system_status) == (kind, number, 3)
    assert (heartbeat.get_srcSystem(), heartbeat.get_srcComponent()) == (5, 1)
    assert not heartbeat.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED


def test_position_and_home_are_where_it_stands() -> None:
    said = unasked(Hub([a_vehicle()]), 0.0)
    here = said["GLOBAL_POSITION_INT"]
    assert (here.lat, here.lon, here.alt, here.relative_alt) == (366_000_000, -843_800_000, 371_250, 0)
    home = said["HOME_POSITION"]
    assert (home.latitude, home.longitude, home.altitude) == (366_000_000, -843_800_000, 371_250)
    assert said["GPS_RAW_INT"].fix_type == 3
    assert {"SYS_STATUS", "ATTITUDE", "MISSION_CURRENT"} <= set(said)


def test_it_speaks_once_a_second() -> None:
    hub = Hub([a_vehicle()], always="console")
    beats = 0
    now = 100.0
    while now < 110.0:
        beats += sum(m.get_type() == "HEARTBEAT" for m in messages(data for _, data in hub.on_timer(now)))
        assert hub.deadline is not None
        now = max(hub.deadline, now + 1e-3)
    assert beats == 10


def test_while_booting_it_only_beats_and_is_not_yet_in_standby() -> None:
    hub = Hub([a_vehicle(boot_s=3.0)])
    said = unasked(hub, 10.0)
    assert list(said) == ["HEARTBEAT"]
    assert said["HEARTBEAT"].system_status == 1
    assert unasked(hub, 13.0)["HEARTBEAT"].system_status == 3


def test_armed_shows_in_the_heartbeat() -> None:
    hub = Hub([a_vehicle(trouble="armed")])
    heartbeat = unasked(hub, 0.0)["HEARTBEAT"]
    assert heartbeat.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED
    assert heartbeat.system_status == 4


def test_a_dead_link_carries_no_heartbeats() -> None:
    hub = Hub([a_vehicle(trouble="silent_after=1")], always="a")
    assert hub.on_timer(0.0)
    ask(hub, wire.encode(Count(3), Address(1, 1)), 0.5)
    assert hub.on_timer(1.5) == []
    assert ask(hub, command(520), 2.0) == []


# ── what it answers ───────────────────────────────────────────────────────────────────────────────────────────────


def test_the_autopilot_version_is_told_in_both_ways_of_asking() -> None:
    for autopilot, terrain in ((COPTER, True), (PX4, False)):
        hub = Hub([a_vehicle(1, autopilot)])
        for number, param in ((512, 148), (520, 1)):
            ack, version = ask(hub, command(number, param))
            assert (ack.command, ack.result) == (number, 0)
            assert version.capabilities & 4  # MISSION_INT
            assert version.capabilities & 16384  # fence
            assert version.capabilities & 32768  # rally
            assert bool(version.capabilities & 512) is terrain


def test_messages_can_be_requested_and_unknown_ones_are_unsupported() -> None:
    hub = Hub([a_vehicle()])
    for number, name in ((242, "HOME_POSITION"), (33, "GLOBAL_POSITION_INT"), (42, "MISSION_CURRENT")):
        ack, message = ask(hub, command(512, number))
        assert (ack.result, message.get_type()) == (0, name)
    for params in ((9999.0,), (float("nan"),), (-5.0,), (float("inf"),)):
        assert [m.result for m in ask(hub, command(512, *params))] == [3]
    assert [m.result for m in ask(hub, command(31010))] == [3]
    assert [m.result for m in ask(hub, command(511, 33, 100_000))] == [0]


def test_arming_and_auto_make_it_fly_its_mission() -> None:
    vehicle = a_vehicle()
    hub = Hub([vehicle])
    assert ask(hub, command(300))[0].result == 2  # there is no mission to start
    vehicle.load([MissionItem(16, 0), MissionItem(16, 3)])
    assert ask(hub, command(400, 1))[0].result == 0
    assert vehicle.armed
    assert not vehicle.flying_mission
    assert ask(hub, command(176, 1, 3))[0].result == 0
    assert vehicle.flying_mission
    assert unasked(hub, 1.0)["MISSION_CURRENT"].mission_state == 3
    assert ask(hub, command(400, 0))[0].result == 0
    assert not vehicle.flying_mission
    assert ask(hub, command(400, 0.5))[0].result == 2


def test_it_does_not_arm_while_booting() -> None:
    hub = Hub([a_vehicle(boot_s=5.0)])
    assert ask(hub, command(400, 1), 0.0)[0].result == 1
    assert ask(hub, command(400, 1), 5.0)[0].result == 0


def test_parameters_are_listed_read_and_set() -> None:
    hub = Hub([a_vehicle(7)])
    values = ask(hub, mav.MAVLink_param_request_list_message(7, 1))
    table = {m.param_id: m.param_value for m in values}
    assert [m.param_index for m in values] == list(range(len(values)))
    assert values[0].param_count == len(values)
    assert (table["RTL_ALT"], table["WPNAV_SPEED"], table["SYSID_THISMAV"]) == (1500.0, 1000.0, 7.0)
    by_name = mav.MAVLink_param_request_read_message(7, 1, b"WPNAV_SPEED", -1)
    (speed,) = ask(hub, by_name)
    assert (speed.param_value, speed.param_type) == (1000.0, 9)
    by_index = mav.MAVLink_param_request_read_message(7, 1, b"", speed.param_index)
    assert [m.param_id for m in ask(hub, by_index)] == ["WPNAV_SPEED"]
    assert ask(hub, mav.MAVLink_param_request_read_message(7, 1, b"", 999)) == []
    (now,) = ask(hub, mav.MAVLink_param_set_message(7, 1, b"WPNAV_SPEED", 750.0, 9))
    assert now.param_value == 750.0
    for unfit in (float("nan"), float("inf")):
        assert ask(hub, mav.MAVLink_param_set_message(7, 1, b"WPNAV_SPEED", unfit, 9))[0].param_value == 750.0
    assert ask(hub, mav.MAVLink_param_set_message(7, 1, b"RTL_ALT_FINAL", 1e30, 6))[0].param_value == 0.0
    assert ask(hub, mav.MAVLink_param_set_message(7, 1, b"NO_SUCH_NAME", 1.0, 9)) == []


def test_px4_packs_whole_parameters_as_bytes() -> None:
    hub = Hub([a_vehicle(3, PX4)])
    values = {m.param_id: m for m in ask(hub, mav.MAVLink_param_request_list_message(3, 1))}
    assert values["RTL_RETURN_ALT"].param_value == 30.0
    assert struct.unpack("<i", struct.pack("<f", values["MAV_SYS_ID"].param_value)) == (3,)


def test_clocks_are_compared() -> None:
    hub = Hub([a_vehicle()])
    (answer,) = ask(hub, mav.MAVLink_timesync_message(0, 12345), 2.0)
    assert (answer.tc1, answer.ts1) == (2_000_000_000, 12345)
    assert ask(hub, mav.MAVLink_timesync_message(1, 12345), 2.0) == []
    (pong,) = ask(hub, mav.MAVLink_ping_message(5, 6, 0, 0), 2.0)
    assert (pong.time_usec, pong.seq, pong.target_system) == (5, 6, GCS.sysid)


def test_what_is_meant_for_others_is_not_answered() -> None:
    hub = Hub([a_vehicle(1)])
    assert ask(hub, command(520, sysid=2)) == []
    assert ask(hub, mav.MAVLink_param_request_list_message(2, 1)) == []


# ── to whom ───────────────────────────────────────────────────────────────────────────────────────────────────────


def test_an_answer_goes_to_the_client_that_spoke_and_heartbeats_to_all() -> None:
    hub = Hub([a_vehicle()])
    for client in "ab":
        ask(hub, mav.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3), client=client)
    assert {to for to, _ in hub.take("b", frame(command(520)), 0.0)} == {"b"}
    count = frame(wire.encode(Count(3), Address(1, 1)))
    assert [to for to, _ in hub.take("a", count, 0.0)] == ["a"]
    hub.on_timer(0.0)
    assert [to for to, _ in hub.on_timer(1.0 - 1e-3)] == []
    asked_again = [(to, m) for to, data in hub.on_timer(1.0) for m in messages([data])]
    assert {to for to, m in asked_again if m.get_type() == "MISSION_REQUEST"} == {"a"}
    assert {to for to, m in asked_again if m.get_type() == "HEARTBEAT"} == {"a", "b"}


def test_two_vehicles_share_a_port_and_answer_for_themselves() -> None:
    vehicles = [a_vehicle(1), a_vehicle(2, PX4)]
    hub = Hub(vehicles)
    (request,) = ask(hub, wire.encode(Count(3), Address(2, 1)))
    assert (request.get_type(), request.get_srcSystem()) == ("MISSION_REQUEST_INT", 2)
    everybody = ask(hub, mav.MAVLink_param_request_list_message(0, 0))
    assert {m.get_srcSystem() for m in everybody} == {1, 2}
    with pytest.raises(UsageError, match="each system id once"):
        Hub([a_vehicle(1), a_vehicle(1)])
    with pytest.raises(UsageError, match="at least one vehicle"):
        Hub([])


def test_clients_are_bounded_and_forgotten_when_silent() -> None:
    hub = Hub([a_vehicle()])
    beat = mav.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)
    for n in range(3 * MOST_CLIENTS):
        ask(hub, beat, client=n, source=Address(1 + n % 250 + 1, n % 200))
    assert hub.clients == list(range(2 * MOST_CLIENTS, 3 * MOST_CLIENTS))
    ask(hub, beat, FORGOTTEN_AFTER_S, client="late")
    hub.on_timer(FORGOTTEN_AFTER_S + 1.0)
    assert hub.clients == ["late"]


def test_its_own_words_reflected_are_not_answered() -> None:
    hub = Hub([a_vehicle(1)])
    assert ask(hub, command(520), source=Address(1, 1)) == []


def test_frames_of_one_source_are_numbered_without_gaps() -> None:
    hub = Hub([a_vehicle(1), a_vehicle(2)], always="a")
    numbers: dict[int, list[int]] = {1: [], 2: []}
    for second in range(3):
        for m in messages(data for _, data in hub.on_timer(float(second))):
            numbers[m.get_srcSystem()].append(m.get_seq())
    assert numbers[1] == list(range(len(numbers[1])))
    assert numbers[2] == list(range(len(numbers[2])))


# ── hostile input ─────────────────────────────────────────────────────────────────────────────────────────────────

KINDS = [kind for number, kind in sorted(mav.mavlink_map.items())]


def raw_frame(kind: Any, payload: bytes, seq: int, source: Address) -> bytes:
    """A frame with a right checksum around any payload."""
    header = struct.pack("<BBBBBBB", 0xFD, len(payload), 0, 0, seq, *source) + kind.id.to_bytes(3, "little")
    crc = mav.x25crc(bytearray(header[1:] + payload))
    crc.accumulate(bytearray([kind.crc_extra]))
    return header + payload + struct.pack("<H", crc.crc)


INTERESTING = [
    k
    for k in KINDS
    if k.msgname.startswith(("MISSION_", "PARAM_", "COMMAND_", "SET_MODE", "TIMESYNC", "PING", "AUTOPILOT_VERSION"))
]


@settings(max_examples=draws(150))
@given(
    autopilot=st.sampled_from(list(Autopilot)),
    said=st.lists(
        st.tuples(st.sampled_from(INTERESTING) | st.sampled_from(KINDS), st.binary(max_size=255), st.integers(0, 255)),
        max_size=8,
    ),
    for_us=st.booleans(),
)
def test_no_wellformed_message_is_mishandled(
    autopilot: Autopilot, said: list[tuple[Any, bytes, int]], for_us: bool
) -> None:
    hub = Hub([a_vehicle(1, autopilot)], always="console")
    for n, (kind, payload, seq) in enumerate(said):
        data = bytearray(payload.ljust(kind.unpacker.size, b"\0")[: kind.unpacker.size])
        if for_us and "target_system" in kind.fieldnames:
            data[_offset(kind, "target_system")] = 1
            if "target_component" in kind.fieldnames:
                data[_offset(kind, "target_component")] = 1
        hub.take("a", raw_frame(kind, bytes(data), seq, GCS), float(n))
    assert hub.mishandled == 0
    assert {m.get_type() for m in messages(data for _, data in hub.on_timer(99.0))} >= {"HEARTBEAT"}


def _offset(kind: Any, name: str) -> int:
    order = [kind.fieldnames[i] for i in sorted(range(len(kind.orders)), key=lambda i: kind.orders[i])]
    sizes = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
    width = {"uint8_t": 1, "int8_t": 1, "char": 1, "uint16_t": 2, "int16_t": 2, "uint32_t": 4, "int32_t": 4}
    at = 0
    for field in order:
        if field == name:
            return at
        at += width.get(sizes[field], 8 if "64" in sizes[field] or sizes[field] == "double" else 4)
    raise LookupError(name)


def test_half_a_frame_of_an_unknown_kind_does_not_swallow_the_next_datagram() -> None:
    sequences = FrameWriter(GCS)
    for _ in range(256):  # whatever the checksum's last byte is
        hub = Hub([a_vehicle()])
        hub.take("a", b"\xfe1\x00\x00\x00\x08" + bytes(7), 0.0)
        sent = hub.take("a", sequences.pack(command(520)), 0.0)
        assert len(sent) == 2


@settings(max_examples=draws(200))
@given(st.lists(st.binary(max_size=300), max_size=10), st.booleans())
def test_any_bytes_are_survived(pieces: list[bytes], datagram: bool) -> None:
    hub = Hub([a_vehicle()])
    for piece in pieces:
        hub.take("a", piece, 0.0, datagram=datagram)
    assert hub.mishandled == 0
    if datagram:
        assert len(ask(hub, command(520))) == 2


# ── sockets ───────────────────────────────────────────────────────────────────────────────────────────────────────


class Station:
    """The plainest ground station: one UDP socket, its own clock, nothing of gcsplan's link."""

    def __init__(self, place: tuple[str, int] | None) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.05)
        self.place = place
        self.parser, self.writer = FrameParser(), FrameWriter(GCS)

    def say(self, message: Any) -> None:
        assert self.place is not None
        self.socket.sendto(self.writer.pack(message), self.place)

    def wait(self, wanted: Callable[[Any], bool], within_s: float = 10.0) -> Any:
        end = time.monotonic() + within_s
        while time.monotonic() < end:
            try:
                data, self.place = self.socket.recvfrom(65536)
            except TimeoutError:
                continue
            for message in self.parser.feed(data, datagram=True):
                if wanted(message):
                    return message
        raise AssertionError(f"nothing of the kind came within {within_s} s")

    def upload(self, items: list[MissionItem], sysid: int = 1) -> int:
        self.say(wire.encode(Count(len(items)), Address(sysid, 1)))
        while True:
            message = self.wait(lambda m: m.get_type().startswith("MISSION_") and m.get_type() != "MISSION_CURRENT")
            packet = wire.decode(message)
            assert packet is not None
            if not isinstance(packet.message, Request):
                return int(message.type)
            seq = packet.message.seq
            self.say(wire.encode(Item(seq, items[seq]), Address(sysid, 1)))


@contextmanager
def station(place: tuple[str, int] | None = None) -> Iterator[Station]:
    one = Station(place)
    try:
        yield one
    finally:
        one.socket.close()


def some_items(n: int) -> list[MissionItem]:
    return [MissionItem(16, 3, x=366_000_000 + i, y=-843_800_000, z=60.0) for i in range(n)]


def test_a_mission_goes_up_over_a_real_socket() -> None:
    vehicle = a_vehicle()
    with SimServer([vehicle], "udpin:127.0.0.1:0") as server, station(server.address) as one:
        assert one.upload(some_items(30)) == 0
        assert [i.x for i in vehicle.items()[1:]] == [i.x for i in some_items(30)[1:]]
        assert server.url_for_gcs == f"udpout:127.0.0.1:{server.address[1]}"
        assert server.mishandled == 0


def test_garbage_between_does_no_harm_and_two_stations_are_served() -> None:
    with SimServer([a_vehicle()], "udpin:127.0.0.1:0") as server:
        with station(server.address) as one, station(server.address) as two:
            for junk in (b"", b"\xfd" * 300, bytes(range(256)), b"\xfd\x09\x00\x00"):
                two.socket.sendto(junk, server.address)
            two.say(command(520))
            two.wait(lambda m: m.get_type() == "AUTOPILOT_VERSION")
            assert one.upload(some_items(5)) == 0
            two.wait(lambda m: m.get_type() == "HEARTBEAT")
        with station(server.address) as three:  # the two are gone, and nobody minds
            assert three.upload(some_items(3)) == 0


def test_a_vehicle_that_speaks_first() -> None:
    with station() as one:
        url = f"udpout:127.0.0.1:{one.socket.getsockname()[1]}"
        with SimServer([a_vehicle(4)], url) as server:
            beat = one.wait(lambda m: m.get_type() == "HEARTBEAT")
            assert beat.get_srcSystem() == 4
            assert one.upload(some_items(3), sysid=4) == 0
            assert server.url_for_gcs == url.replace("udpout", "udpin")


def test_pymavlink_takes_it_for_a_vehicle_over_udp_and_tcp() -> None:
    for url in ("udpin:127.0.0.1:0", "tcpin:127.0.0.1:0"):
        with SimServer([a_vehicle(9)], url) as server:
            link = mavutil.mavlink_connection(server.url_for_gcs, dialect="ardupilotmega", source_system=250)
            try:
                link.mav.heartbeat_send(6, 8, 0, 0, 0)
                assert link.wait_heartbeat(timeout=10).type == 2
                assert link.target_system == 9
                link.waypoint_request_list_send()
                count = link.recv_match(type="MISSION_COUNT", blocking=True, timeout=10)
                assert count.count == 0
                assert link.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=10).alt == 371_250
            finally:
                link.close()


def test_a_tcp_client_that_hangs_up_is_forgotten() -> None:
    with SimServer([a_vehicle()], "tcpin:127.0.0.1:0") as server:
        for _ in range(3):
            with socket.create_connection(server.address, timeout=10) as connection:
                connection.settimeout(10)
                assert connection.recv(1) == b"\xfd"  # it is told heartbeats before it has said a word
        with socket.create_connection(server.address, timeout=10) as connection:
            connection.settimeout(10)
            data = frame(command(520))
            connection.sendall(data[:7])
            connection.sendall(data[7:])  # a frame in two pieces
            parser, seen = FrameParser(), set[str]()
            end = time.monotonic() + 10
            while "AUTOPILOT_VERSION" not in seen and time.monotonic() < end:
                seen |= {m.get_type() for m in parser.feed(connection.recv(4096))}
            assert "AUTOPILOT_VERSION" in seen


def test_a_server_in_a_process_of_its_own() -> None:
    with SimServer([a_vehicle(3)], "udpin:127.0.0.1:0", process=True) as server, station(server.address) as one:
        assert one.upload(some_items(20), sysid=3) == 0


def test_a_fast_clock_asks_again_early() -> None:
    with SimServer([a_vehicle()], "udpin:127.0.0.1:0", speedup=20.0) as server, station(server.address) as one:
        one.say(wire.encode(Count(3), Address(1, 1)))
        # Eight of its seconds later it gives up; at our pace that would take longer than we wait.
        given_up = one.wait(lambda m: m.get_type() == "MISSION_ACK", within_s=5.0)
        assert given_up.type == 15
    for speedup in (0.0, float("nan"), 1e9):
        with pytest.raises(UsageError, match="times as fast"):
            SimServer([a_vehicle()], "udpin:127.0.0.1:0", speedup=speedup)


def test_a_port_in_use_is_said() -> None:
    with SimServer([a_vehicle()], "udpin:127.0.0.1:0") as server:
        busy = f"udpin:127.0.0.1:{server.address[1]}"
        for process in (False, True):
            with pytest.raises(LinkError, match="another program"), SimServer([a_vehicle()], busy, process=process):
                raise AssertionError("it must not start")


@pytest.mark.parametrize(
    "url", ["", "udpin:127.0.0.1", "serial:/dev/ttyS0:57600", "udpout:127.0.0.1:0", "udpin:[::1]:0"]
)
def test_urls_that_are_none_are_refused(url: str) -> None:
    with pytest.raises(InputError):
        SimServer([a_vehicle()], url)


def test_stopping_twice_and_starting_again() -> None:
    server = SimServer([a_vehicle()], "udpin:127.0.0.1:0")
    for _ in range(2):
        server.start()
        with pytest.raises(RuntimeError, match="already"):
            server.start()
        with station(server.address) as one:
            assert one.upload(some_items(2)) == 0
        server.stop()
        server.stop()
        with pytest.raises(RuntimeError, match="before start"):
            _ = server.address


def test_serving_ends_quietly_when_interrupted() -> None:
    # A test run in the background may have been told to ignore interrupts, which children inherit.
    program = """
        import signal
        from gcsplan.sim.vehicle.server import serve
        from gcsplan.sim.vehicle.loopback import LoopbackVehicle
        from gcsplan.vehicle import Autopilot
        signal.signal(signal.SIGINT, signal.default_int_handler)
        vehicle = LoopbackVehicle(1, Autopilot.PX4, lat_deg=36.6, lon_deg=-84.38, amsl_m=371.0)
        serve([vehicle], "udpin:127.0.0.1:0", on_ready=lambda server: print(server.url_for_gcs, flush=True))
        print("done", flush=True)
    """
    command = [sys.executable, "-c", textwrap.dedent(program)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        try:
            assert child.stdout is not None
            url = child.stdout.readline().strip()
            assert url.startswith("udpout:127.0.0.1:")
            with station(("127.0.0.1", int(url.rsplit(":", 1)[1]))) as one:
                assert one.upload(some_items(2)) == 0
            child.send_signal(signal.SIGINT)
            rest, _ = child.communicate(timeout=20)
            assert (rest.strip(), child.returncode) == ("done", 0)
        finally:
            child.kill()
