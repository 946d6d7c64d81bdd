"""Frames, sockets and routing: what goes over a link, whoever else shouts on it."""

from __future__ import annotations

import contextlib
import os
import random
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.errors import Cancelled, InputError, LinkError, cancelled_by
from gcsplan.mavlink.link.frames import FrameParser, FrameWriter, Signing, SigningKey, signing_key
from gcsplan.mavlink.link.link import GCS, Channel, Heard, Link, LinkSteps, PumpJob, pump, run
from gcsplan.mavlink.link.session.steps import drive
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.messages import (
    Ack,
    Address,
    ClearAll,
    Count,
    Item,
    LegacyItem,
    MissionMessage,
    Packet,
    Request,
    RequestList,
)
from gcsplan.mavlink.protocol.transfer import Timers, Upload
from tests.support.effort import draws

VEHICLE = Address(1, 1)
WAYPOINT = MissionItem(16, 3, (0.0, 0.0, 0.0, 0.0), 366_000_000, -843_800_000, 60.005)
BOUND_S = 10.0


def heartbeat(kind: int = 2, autopilot: int = 3) -> Any:
    return dialect.MAVLink_heartbeat_message(kind, autopilot, 0, 0, dialect.MAV_STATE_STANDBY, 3)


# -- wire ---------------------------------------------------------------------------------------------------------

FLOATS = st.floats(width=32, allow_nan=True)
WIRE_ITEMS = st.builds(
    MissionItem,
    st.integers(0, 65535),
    st.integers(0, 255),
    st.tuples(FLOATS, FLOATS, FLOATS, FLOATS),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**31), 2**31 - 1),
    FLOATS,
    st.booleans(),
)
TYPES = st.sampled_from([0, 1, 2, 255])
MESSAGES = st.one_of(
    st.builds(Count, st.integers(0, 65535), TYPES, st.integers(0, 2**32 - 1)),
    st.builds(RequestList, TYPES),
    st.builds(Request, st.integers(0, 65535), TYPES, st.booleans()),
    st.builds(Item, st.integers(0, 65535), WIRE_ITEMS, TYPES, st.integers(0, 1)),
    st.builds(Ack, st.integers(0, 255), TYPES, st.integers(0, 2**32 - 1)),
    st.builds(ClearAll, TYPES),
)


def packed(message: MissionMessage, source: Address = VEHICLE, target: Address = GCS) -> bytes:
    return FrameWriter(source).pack(wire.encode(message, target))


@pytest.mark.slow
@settings(max_examples=draws(200))
@given(MESSAGES)
def test_a_message_survives_the_wire_to_the_bit(message: MissionMessage) -> None:
    (received,) = FrameParser().feed(packed(message))
    packet = wire.decode(received)
    assert packet is not None
    assert (packet.source, packet.target) == (VEHICLE, GCS)
    if isinstance(message, Item):
        assert isinstance(packet.message, Item)
        assert packet.message.item.wire == message.item.wire
        assert (packet.message.seq, packet.message.mission_type) == (message.seq, message.mission_type)
    else:
        assert packet.message == message


def test_an_item_in_the_old_form_is_told_apart() -> None:
    (received,) = FrameParser().feed(packed(LegacyItem(3, WAYPOINT)))
    packet = wire.decode(received)
    assert packet is not None
    assert type(packet.message) is LegacyItem
    assert abs(packet.message.item.x - WAYPOINT.x) < 40


def test_old_items_with_nonsense_for_degrees_are_read_all_the_same() -> None:
    for x in (float("nan"), float("inf"), 1e30):
        message = dialect.MAVLink_mission_item_message(255, 190, 0, 3, 16, 0, 1, 0, 0, 0, 0, x, x, 1.0, 0)
        (received,) = FrameParser().feed(FrameWriter(VEHICLE).pack(message))
        packet = wire.decode(received)
        assert packet is not None
        assert type(packet.message) is LegacyItem
        assert (packet.message.seq, packet.message.item.command, packet.message.item.z) == (0, 16, 1.0)


def test_other_messages_are_no_packets() -> None:
    (received,) = FrameParser().feed(FrameWriter(VEHICLE).pack(heartbeat()))
    assert wire.decode(received) is None


def test_mavlink_1_frames_are_read() -> None:
    mav = dialect.MAVLink(None, 1, 1)
    frame = wire.encode(Request(7), GCS).pack(mav, force_mavlink1=True)
    assert frame[0] == 0xFE
    (received,) = FrameParser().feed(frame)
    assert wire.decode(received) == Packet(VEHICLE, GCS, Request(7))


# -- frames -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@settings(max_examples=draws(150))
@given(st.lists(st.one_of(st.binary(max_size=40), MESSAGES), max_size=12), st.lists(st.integers(1, 50), max_size=30))
def test_a_stream_cut_anywhere_gives_the_same_messages(parts: list[bytes | MissionMessage], cuts: list[int]) -> None:
    stream = b"".join(part if isinstance(part, bytes) else packed(part) for part in parts) + bytes(300)
    whole = [m.get_msgbuf() for m in FrameParser().feed(stream)]
    parser, pieces, at = FrameParser(), [], 0
    for cut in cuts:
        pieces += parser.feed(stream[at : at + cut])
        at += cut
    pieces += parser.feed(stream[at:])
    assert [m.get_msgbuf() for m in pieces] == whole


NOISE = st.binary(max_size=60).map(lambda junk: junk.replace(b"\xfd", b"").replace(b"\xfe", b""))


@given(st.lists(NOISE, min_size=1, max_size=6), st.booleans())
def test_every_good_frame_is_found_between_noise(noise: list[bytes], datagram: bool) -> None:
    sent = [packed(Request(n)) for n in range(len(noise))]
    stream = b"".join(junk + frame for junk, frame in zip(noise, sent, strict=True))
    assert [bytes(m.get_msgbuf()) for m in FrameParser().feed(stream, datagram=datagram)] == sent


def test_a_damaged_length_does_not_hide_the_frames_behind_it() -> None:
    frames = [packed(Item(n, WAYPOINT)) for n in range(5)]
    damaged = bytes([0xFD, 250]) + frames[0][2:]
    parser = FrameParser()
    found = parser.feed(damaged + b"".join(frames[1:]) + bytes(300))
    assert [wire.decode(m).message.seq for m in found] == [1, 2, 3, 4]  # type: ignore[union-attr]
    assert parser.bad > 0
    in_one = FrameParser().feed(damaged + b"".join(frames[1:3]), datagram=True)
    assert [wire.decode(m).message.seq for m in in_one] == [1, 2]  # type: ignore[union-attr]


def test_no_flipped_bit_gets_through() -> None:
    frame = packed(Item(3, WAYPOINT))
    for bit in range(8 * len(frame)):
        damaged = bytearray(frame)
        damaged[bit // 8] ^= 1 << bit % 8
        for message in FrameParser().feed(bytes(damaged) + bytes(300)):
            assert wire.decode(message) is None


@pytest.mark.nightly
def test_a_parser_never_holds_more_than_a_frame() -> None:
    rng = random.Random(1)
    parser = FrameParser()
    for _ in range(300):
        junk = bytes(rng.choice([0xFD, 0xFE, 0, 255, rng.randrange(256)]) for _ in range(rng.randrange(600)))
        parser.feed(junk, datagram=rng.random() < 0.5)
        assert len(parser.rest) <= 300


@settings(max_examples=draws(150))
@given(st.lists(st.one_of(st.binary(max_size=400), st.binary(max_size=50).map(lambda b: b"\xfd" + b)), max_size=8))
def test_raw_bytes_never_break_the_parser(chunks: list[bytes]) -> None:
    parser, datagrams = FrameParser(), FrameParser()
    for chunk in chunks:
        heard = [*parser.feed(chunk), *datagrams.feed(chunk, datagram=True)]
        assert sum(len(message.get_msgbuf()) for message in heard) <= 2 * sum(map(len, chunks))
        assert all(packet is None or packet.message is not None for packet in map(wire.decode, heard))
    # What came before neither is part of the next frame nor swallows it.
    datagrams.rest = b""
    assert [m.get_type() for m in datagrams.feed(packed(RequestList()), datagram=True)] == ["MISSION_REQUEST_LIST"]


def test_frames_of_an_unknown_kind_are_passed_over_whole() -> None:
    unknown = bytes([0xFD, 3, 0, 0, 9, 1, 1, 0xFF, 0xFF, 0x0F, 1, 2, 3, 0, 0])
    known = packed(Request(1))
    parser = FrameParser()
    assert len(parser.feed(unknown + known + unknown + known)) == 2
    assert parser.bad == 0


# -- signing ------------------------------------------------------------------------------------------------------

KEY = SigningKey(bytes(range(32)))


def test_signed_frames_are_taken_with_the_right_key_alone() -> None:
    ours = Signing(KEY)
    frame = FrameWriter(VEHICLE, Signing(KEY)).pack(heartbeat())
    assert len(FrameParser(ours).feed(frame)) == 1
    wrong = FrameParser(Signing(SigningKey(bytes(32))))
    assert wrong.feed(frame) == []
    assert wrong.unsigned == 1
    unsigned = FrameParser(Signing(KEY))
    assert unsigned.feed(FrameWriter(VEHICLE).pack(heartbeat())) == []
    assert unsigned.unsigned == 1


def test_a_signed_frame_is_not_taken_twice() -> None:
    parser = FrameParser(Signing(KEY))
    frame = FrameWriter(VEHICLE, Signing(KEY)).pack(heartbeat())
    (first,), (again,) = parser.feed(frame), parser.feed(frame)
    assert (first.late, again.late) == (False, True)
    assert parser.unsigned == 1


def test_a_recording_from_before_the_link_was_opened_does_not_count() -> None:
    """Not even of seconds ago, from a stream that was never heard; who hears us signs with our time from then on."""
    vehicle = Signing(KEY, clock=lambda: 1_700_000_000.0)
    recording = FrameWriter(VEHICLE, vehicle).pack(heartbeat())
    ours = Signing(KEY, clock=lambda: 1_700_000_005.0)
    parser = FrameParser(ours)
    assert parser.feed(recording) == []
    assert parser.unsigned == 1
    assert len(FrameParser(vehicle).feed(FrameWriter(Address(255, 190), ours).pack(heartbeat()))) == 1
    assert len(parser.feed(FrameWriter(VEHICLE, vehicle).pack(heartbeat()))) == 1


def test_a_forged_time_does_not_shut_the_true_stream_out() -> None:
    parser, vehicle = FrameParser(Signing(KEY)), FrameWriter(VEHICLE, Signing(KEY))
    for ending in (b"\xff" * 6, b"\xfe" * 6, b"\xfd\xff\x00\xfe\xff\xff"):  # some begin like a long frame
        forged = bytearray(vehicle.pack(heartbeat()))
        forged[-12:] = b"\xff" * 6 + ending
        assert parser.feed(bytes(forged)) == []
        assert len(parser.feed(vehicle.pack(heartbeat()))) == 1


def test_a_key_is_read_from_a_file_or_the_environment_and_never_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    secret = bytes(range(1, 33))
    raw, digits = tmp_path / "raw.key", tmp_path / "hex.key"
    raw.write_bytes(secret)
    digits.write_text(secret.hex() + "\n")
    assert signing_key(raw) == signing_key(str(digits)) == SigningKey(secret)
    monkeypatch.setenv("GCSPLAN_SIGNING_KEY", secret.hex())
    key = signing_key()
    assert key == SigningKey(secret)
    assert secret.hex() not in repr(key) + str(key) + f"{key}"
    assert str(secret) not in repr(key)
    monkeypatch.delenv("GCSPLAN_SIGNING_KEY")
    assert signing_key() is None


@pytest.mark.parametrize("content", [b"", b"short", b"zz" * 32, b"1" * 63, bytes(33)])
def test_a_key_that_is_none_is_refused_without_being_repeated(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "bad.key"
    file.write_bytes(content)
    with pytest.raises(InputError, match="32 bytes") as refused:
        signing_key(file)
    assert not content or content.decode(errors="replace") not in str(refused.value).replace(str(file), "")


def test_a_key_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read the signing key"):
        signing_key(tmp_path / "none.key")


# -- links --------------------------------------------------------------------------------------------------------


class Peer:
    """A vehicle's end of a UDP link, by hand."""

    def __init__(self, ids: Address = VEHICLE) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(BOUND_S)
        self.writer = FrameWriter(ids)
        self.parser = FrameParser()

    @property
    def port(self) -> int:
        return int(self.socket.getsockname()[1])

    def send(self, message: Any, port: int) -> None:
        self.socket.sendto(self.writer.pack(message), ("127.0.0.1", port))

    def hear(self, kind: str) -> tuple[Any, int]:
        """The next message of that kind, and the port it came from."""
        until = time.monotonic() + BOUND_S
        while time.monotonic() < until:
            data, (_, port) = self.socket.recvfrom(4096)
            for message in self.parser.feed(data, datagram=True):
                if message.get_type() == kind:
                    return message, port
        raise AssertionError(f"no {kind} came")

    def hears_nothing_but_heartbeats(self) -> bool:
        self.socket.settimeout(0.1)
        with contextlib.suppress(TimeoutError):
            while True:
                data, _ = self.socket.recvfrom(4096)
                if any(m.get_type() != "HEARTBEAT" for m in self.parser.feed(data, datagram=True)):
                    return False
        return True


@pytest.fixture
def peers() -> Iterator[list[Peer]]:
    made = [Peer(Address(n, 1)) for n in (1, 2, 3)]
    yield made
    for peer in made:
        peer.socket.close()


def listening_link(**more: Any) -> tuple[Link, int]:
    link = Link("udpin:127.0.0.1:0", **more)
    return link, int(link.place.rsplit(":", 1)[1])


def await_messages(link: Link, channel: Channel, count: int = 1) -> list[Heard]:
    heard: list[Heard] = []
    until = time.monotonic() + BOUND_S
    while len(heard) < count and time.monotonic() < until:
        link.poll()
        heard += channel.take()
        time.sleep(0.001)
    assert len(heard) >= count
    return heard


def test_each_system_on_one_port_is_answered_where_it_was_heard(peers: list[Peer]) -> None:
    link, port = listening_link(heartbeat_s=None)
    with link:
        channels = [link.channel(n) for n in (1, 2, 3)]
        for peer in peers:
            peer.send(heartbeat(), port)
        for n, channel in enumerate(channels, 1):
            (heard,) = await_messages(link, channel)
            assert heard.source == Address(n, 1)
            channel.send_packets([Packet(GCS, Address(n, 1), Count(n))])
        for n, peer in enumerate(peers, 1):
            assert peer.hear("MISSION_COUNT")[0].count == n
        assert all(peer.hears_nothing_but_heartbeats() for peer in peers)


def test_a_listening_link_does_not_send_to_whom_it_never_heard(peers: list[Peer]) -> None:
    link, port = listening_link(heartbeat_s=None)
    with link:
        assert not link.send(heartbeat(), Address(1, 1))
        peers[0].send(heartbeat(), port)
        await_messages(link, link.channel(1))
        assert link.send(heartbeat(), Address(1, 1))
        assert not link.send(heartbeat(), Address(2, 1))


def test_a_vehicle_that_moves_to_another_port_is_answered_there(peers: list[Peer]) -> None:
    link, port = listening_link(heartbeat_s=None)
    moved = Peer(VEHICLE)
    with link, contextlib.closing(moved.socket):
        channel = link.channel(1)
        for peer in (peers[0], moved):
            peer.send(heartbeat(), port)
            await_messages(link, channel)
        channel.send_packets([Packet(GCS, VEHICLE, RequestList())])
        request, _ = moved.hear("MISSION_REQUEST_LIST")
        assert (request.target_system, request.get_srcSystem()) == (VEHICLE.sysid, GCS.sysid)
        assert peers[0].hears_nothing_but_heartbeats()


def test_our_heartbeat_goes_out_as_a_ground_stations(peers: list[Peer]) -> None:
    with Link(f"udpout:127.0.0.1:{peers[0].port}", us=Address(200, 190), heartbeat_s=0.05) as link:
        for _ in range(3):
            time.sleep(0.05)
            link.poll()
        message, _ = peers[0].hear("HEARTBEAT")
        assert (message.get_srcSystem(), message.get_srcComponent()) == (200, 190)
        assert message.type == dialect.MAV_TYPE_GCS


def test_a_closed_port_is_no_error_but_silence() -> None:
    gone = Peer()
    port = gone.port
    gone.socket.close()
    with Link(f"udpout:127.0.0.1:{port}", heartbeat_s=0.01) as link:
        upload = Upload([WAYPOINT], us=GCS, vehicle=VEHICLE, timers=Timers(response_s=0.03, retries=2))
        channel = link.channel(1)
        run(channel, drive(upload, channel))
        assert upload.outcome is not None
        assert "no answer" in str(upload.outcome)


def test_our_own_voice_and_garbage_do_not_count(peers: list[Peer]) -> None:
    link, port = listening_link(heartbeat_s=None)
    with link:
        channel, echo = link.channel(1), link.channel(255)
        mirror = Peer(GCS)
        with contextlib.closing(mirror.socket):
            mirror.send(heartbeat(), port)
            rng = random.Random(2)
            for size in (0, 1, 10, 300, 1400):
                mirror.socket.sendto(bytes(rng.randrange(256) for _ in range(size)), ("127.0.0.1", port))
            peers[0].send(heartbeat(), port)
            await_messages(link, channel)
        assert not list(echo.take())
        assert 255 not in link.heard_systems


def test_a_flood_of_strangers_is_forgotten_in_turn() -> None:
    link, port = listening_link(heartbeat_s=None)
    writer = FrameWriter(Address(9, 1))
    with link:
        for n in range(300):
            if n % 50 == 0:
                link.poll()  # a socket's buffer is no bigger than it is
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
                stranger.sendto(writer.pack(heartbeat()), ("127.0.0.1", port))
        await_messages(link, link.channel(9))
        for _ in range(20):
            link.poll()
        assert len(link.parsers) <= 260
        assert len(link.heard_at) <= 260


def test_an_inbox_is_bounded() -> None:
    link, _ = listening_link(heartbeat_s=None)
    with link:
        channel = link.channel(1)
        for _ in range(10_000):
            channel.inbox.append(Heard(VEHICLE, "x", None))
        assert len(channel.inbox) < 10_000
        link.drop(channel)
        link.drop(channel)


def test_a_port_that_is_taken_is_told_with_the_other_direction() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with pytest.raises(LinkError, match=f"listens on 127.0.0.1:{port}.*udpout:127.0.0.1:{port}"):
            Link(f"udpin:127.0.0.1:{port}")


def test_a_vehicle_that_keeps_its_first_partner_hears_every_link_from_the_same_port(peers: list[Peer]) -> None:
    ports = set()
    for _ in range(3):  # three commands, one after the other
        with Link(f"udpout:127.0.0.1:{peers[0].port}", heartbeat_s=0.01) as link:
            time.sleep(0.02)
            link.poll()
            ports.add(peers[0].hear("HEARTBEAT")[1])
            assert link.place.endswith(f":{link.endpoint.sends_from}")
            assert link.note is None
    assert len(ports) == 1


def test_a_link_sends_from_the_given_port_or_from_a_free_one_if_that_is_taken(peers: list[Peer]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        own = free.getsockname()[1]
        url = f"udpout:127.0.0.1:{peers[0].port},{own}"
        with Link(url) as link:
            assert not link.place.endswith(f":{own}")
            assert link.note is not None
            assert (link.note.code, link.note.data["wanted_port"]) == ("sends_from_another_port", own)
    with Link(url) as link:
        assert link.place.endswith(f":{own}")
        assert link.note is None


def test_a_connection_that_is_refused_is_told_with_the_other_direction() -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]  # bound, so that no other test gets it, and not listening
        with pytest.raises(LinkError, match=f"connects to 127.0.0.1:{port}.*tcpin:127.0.0.1:{port}"):
            Link(f"tcp:127.0.0.1:{port}")


def test_a_serial_port_that_is_not_there_is_told() -> None:
    with pytest.raises(LinkError, match="serial: opens /dev/gcsplan-none at 57600 baud"):
        Link("/dev/gcsplan-none")


def test_a_link_over_tcp_carries_frames_both_ways_and_connects_again() -> None:
    with Link("tcpin:127.0.0.1:0", heartbeat_s=None, us=VEHICLE) as vehicle:
        port = vehicle.place.rsplit(":", 1)[1]
        with Link(f"tcp:127.0.0.1:{port}", heartbeat_s=None) as gcs:
            mine, theirs = gcs.channel(1), vehicle.channel(255)
            for round_ in range(2):
                gcs.send(heartbeat(6, 8), Address(1, 1))
                heard = _await_both(vehicle, gcs, theirs)
                vehicle.send(wire.encode(Count(3 + round_), GCS), heard.source)
                assert _await_both(gcs, vehicle, mine).message.count == 3 + round_
                for stream in list(vehicle.transport.clients.values()):  # type: ignore[attr-defined]
                    stream.close()
                until = time.monotonic() + BOUND_S
                while gcs.transport.handles and time.monotonic() < until:
                    gcs.poll()
                until = time.monotonic() + BOUND_S
                while not gcs.transport.handles and time.monotonic() < until:
                    gcs.poll()
                    time.sleep(0.01)


def _await_both(link: Link, other: Link, channel: Channel) -> Heard:
    until = time.monotonic() + BOUND_S
    while time.monotonic() < until:
        other.poll()
        link.poll()
        for heard in channel.take():
            return heard
        time.sleep(0.001)
    raise AssertionError("nothing came")


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs pseudo-terminals")
def test_a_link_over_a_serial_line_carries_frames_both_ways() -> None:
    master, slave = os.openpty()
    try:
        with Link(f"serial:{os.ttyname(slave)}:57600", heartbeat_s=None) as link:
            channel = link.channel(1)
            os.write(master, b"\x00noise\xfd" + FrameWriter(VEHICLE).pack(heartbeat()) + bytes(300))
            (heard,) = await_messages(link, channel)
            assert heard.source == VEHICLE
            channel.send_packets([Packet(GCS, VEHICLE, Count(12))])
            (message,) = FrameParser().feed(os.read(master, 4096))
            assert message.count == 12
    finally:
        os.close(master)
        os.close(slave)


# -- pump ---------------------------------------------------------------------------------------------------------


def test_tasks_run_together_and_errors_stay_with_their_own() -> None:
    link, _ = listening_link(heartbeat_s=None)
    naps_taken: list[tuple[int, int]] = []

    def sleeper(naps: int, fails: bool) -> LinkSteps[int]:
        for nap in range(naps):
            naps_taken.append((nap, naps))
            yield time.monotonic() + 0.02
        if fails:
            raise LinkError("gone")
        return naps

    with link:
        jobs = [PumpJob(link.channel(n), sleeper(n, n == 3)) for n in range(1, 11)]
        pump(jobs)
        assert [job.result for job in jobs] == [1, 2, None, *range(4, 11)]
        assert isinstance(jobs[2].error, LinkError)
        assert naps_taken[:10] == [(0, n) for n in range(1, 11)]  # every task naps before one naps again
        assert len(naps_taken) == sum(range(1, 11))
        pump([])


@pytest.mark.parametrize(("most", "most_on_link"), [(7, 3), (2, 50), (200, 4), (1, 1)])
def test_no_more_tasks_run_at_a_time_than_may(most: int, most_on_link: int) -> None:
    running: set[tuple[int, int]] = set()
    begun: list[tuple[int, int]] = []
    peaks: list[tuple[int, int]] = []

    def task(which: int, number: int, channel: Channel) -> LinkSteps[int]:
        begun.append((which, number))
        running.add((which, number))
        # What was heard while it waited says nothing of its vehicle now.
        assert most_on_link >= 20 or not channel.inbox
        for _ in range(1 + number % 3):
            peaks.append((len(running), max(sum(w == k for w, _ in running) for k in range(3))))
            yield time.monotonic() + 0.002
        running.discard((which, number))
        if number == 5:
            raise LinkError("gone")
        return number

    with contextlib.ExitStack() as stack:
        links = [stack.enter_context(Link("udpin:127.0.0.1:0", heartbeat_s=None)) for _ in range(3)]
        jobs = []
        for number in range(20):
            for which, link in enumerate(links):
                channel = link.channel(number + 1)
                jobs.append(PumpJob(channel, task(which, number, channel)))
                if number >= most_on_link:
                    channel.inbox.append(Heard(VEHICLE, ("127.0.0.1", 1), None))
        pump(jobs, most=most, most_on_link=most_on_link)
    assert [job.result for job in jobs] == [None if k == 5 else k for k in range(20) for _ in range(3)]
    assert sum(isinstance(job.error, LinkError) for job in jobs) == 3
    assert max(peak for peak, _ in peaks) <= most
    assert max(peak for _, peak in peaks) <= most_on_link
    for which in range(3):  # in their order on each link
        assert [n for w, n in begun if w == which] == list(range(20))


def test_a_channel_whose_task_waits_for_its_turn_hears_nothing_and_then_hears_again(peers: list[Peer]) -> None:
    heard: list[tuple[int, int]] = []
    with Link("udpin:127.0.0.1:0", heartbeat_s=None) as link:
        port = int(link.place.rsplit(":", 1)[1])

        def task(number: int, channel: Channel) -> LinkSteps[None]:
            heard.append((number, len(channel.inbox)))
            for peer in peers:
                peer.send(heartbeat(), port)
            end = time.monotonic() + 0.2
            while time.monotonic() < end:
                yield time.monotonic() + 0.02
            heard.append((number, len(channel.inbox)))

        channels = [link.channel(n) for n in (1, 2, 3)]
        pump([PumpJob(c, task(n, c)) for n, c in enumerate(channels, start=1)], most=1)
        left = [len(c.inbox) for c in channels]
    assert heard == [(1, 0), (1, 1), (2, 0), (2, 1), (3, 0), (3, 1)]  # nothing of what was said to those who waited
    assert left == [0, 0, 1]


def test_an_interrupt_cancels_what_runs() -> None:
    peer = Peer()
    with contextlib.closing(peer.socket), Link(f"udpout:127.0.0.1:{peer.port}", heartbeat_s=None) as link:
        upload = Upload([WAYPOINT], us=GCS, vehicle=VEHICLE)
        channel = link.channel(1)

        def interrupted() -> LinkSteps[None]:
            yield time.monotonic() + 0.05
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            pump([PumpJob(channel, drive(upload, channel)), PumpJob(link.channel(2), interrupted())])
        assert str(upload.outcome) == "unknown: cancelled by us"
        assert peer.hear("MISSION_ACK")[0].type == dialect.MAV_MISSION_OPERATION_CANCELLED


def test_a_cancel_ends_all_jobs_of_a_pump_each_by_its_own_end() -> None:
    closed: list[int] = []

    def endless(number: int, link: Link) -> LinkSteps[None]:
        try:
            while True:
                yield link.clock() + 60.0
        finally:
            closed.append(number)

    calls = iter([False, False, True])
    with Link("udpin:127.0.0.1:0", heartbeat_s=None) as link:
        jobs = [PumpJob(link.channel(n), endless(n, link)) for n in (1, 2)]
        with cancelled_by(lambda: next(calls)), pytest.raises(Cancelled):
            pump(jobs)
    assert closed == [1, 2]
