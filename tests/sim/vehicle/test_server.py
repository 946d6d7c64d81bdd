"""The simulator on real sockets: uploads, listeners, processes, and what cannot stop it."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from pymavlink import mavutil

from gcsplan.errors import InputError, LinkError, UsageError
from gcsplan.mavlink.link.frames import FrameParser, FrameWriter
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.messages import Address, Count, Item, Request
from gcsplan.sim.vehicle.server import SimServer
from tests.support.hub import GCS, a_vehicle, command, frame


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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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
