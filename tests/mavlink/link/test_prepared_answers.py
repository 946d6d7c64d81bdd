"""Prompt answers: the same bytes as the slow way, for the same requests, and the machine gets all of them."""

from __future__ import annotations

import contextlib
import random
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.mavlink.link.frames import FrameParser, FrameWriter, Signing, SigningKey, checksum
from gcsplan.mavlink.link.link import GCS, Link, PumpJob, pump, run
from gcsplan.mavlink.link.prepared_answers import Prepared, PromptAnswers
from gcsplan.mavlink.link.session.steps import drive
from gcsplan.mavlink.link.transport import Udp
from gcsplan.mavlink.link.url import parse_url
from gcsplan.mavlink.mission.mission import FENCE, MissionItem
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.messages import Ack, Address, Count, Item, Request
from gcsplan.mavlink.protocol.outcome import Accepted
from gcsplan.mavlink.protocol.transfer import Timers, Upload, VerifiedUpload
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.support.effort import draws

VEHICLE = Address(1, 1)
PEER = ("127.0.0.1", 14550)
KEY = SigningKey(bytes(range(32)))
BOUND_S = 20.0

FLOATS = st.floats(width=32, allow_nan=True)
WORDS = st.integers(-(2**31), 2**31 - 1)
WIRE_ITEMS = st.builds(
    MissionItem, st.integers(0, 65535), st.integers(0, 255), st.tuples(FLOATS, FLOATS, FLOATS, FLOATS), WORDS, WORDS,
    FLOATS, st.booleans(),
)  # fmt: skip


def items_of(count: int) -> list[MissionItem]:
    return [MissionItem(16, 3, x=366_000_000 + i, y=-843_000_000 - i, z=float(i)) for i in range(count)]


def frame(request: Request, source: Address = VEHICLE, target: Address = GCS, number: int = 0) -> bytes:
    writer = FrameWriter(source)
    for _ in range(number):
        writer.number()
    return writer.pack(wire.encode(request, target))


def parsed(data: bytes) -> Any:
    (message,) = FrameParser().feed(data, datagram=True)
    return message


def taught(
    count: int = 600, request: Request | None = None, target: Address = GCS, **writer: Any
) -> tuple[PromptAnswers, Prepared]:
    """Answers for a mission of ``count`` items, after the first request."""
    answers = PromptAnswers(FrameWriter(GCS, **writer))
    prepared = answers.prepare([Item(i, item) for i, item in enumerate(items_of(count))], VEHICLE)
    answers.learn(prepared, PEER, parsed(frame(request or Request(0), target=target)))
    return answers, prepared


# -- the bytes ----------------------------------------------------------------------------------------------------


@settings(max_examples=draws(150))
@given(
    st.lists(WIRE_ITEMS, min_size=1, max_size=4), st.sampled_from([0, 1, 2]), st.integers(0, 1), st.integers(0, 255),
    st.tuples(st.integers(1, 255), st.integers(0, 255)), st.tuples(st.integers(1, 255), st.integers(0, 255)),
)  # fmt: skip
def test_a_prompt_answer_is_the_same_bytes_as_pymavlinks(
    items: list[MissionItem], kind: int, current: int, number: int, us: tuple[int, int], vehicle: tuple[int, int]
) -> None:
    ours, theirs = Address(*us), Address(*vehicle)
    quick, slow = FrameWriter(ours), FrameWriter(ours)
    for _ in range(number):
        assert quick.number() == slow.number()
    answers = PromptAnswers(quick)
    messages = [Item(seq, item, kind, current) for seq, item in enumerate(items)]
    prepared = answers.prepare(messages, theirs)
    answers.learn(prepared, PEER, parsed(frame(Request(0, kind), theirs, ours)))
    for message in messages:
        expected = slow.pack(wire.encode(message, theirs))
        assert answers(PEER, frame(Request(message.seq, kind), theirs, ours, number=message.seq)) == expected
    assert prepared.requested == list(range(len(items)))


def test_frames_are_numbered_through_whoever_packs_them() -> None:
    writer = FrameWriter(GCS)
    answers = PromptAnswers(writer)
    prepared = answers.prepare([Item(0, item) for item in items_of(1)], VEHICLE)
    answers.learn(prepared, PEER, parsed(frame(Request(0))))
    numbers = []
    for _ in range(200):
        prompt = answers(PEER, frame(Request(0)))
        assert prompt is not None
        numbers += [prompt[4], writer.pack(wire.encode(Count(1), VEHICLE))[4]]
    assert numbers == [n % 256 for n in range(400)]


def test_the_checksum_is_mavlinks() -> None:
    assert checksum(b"123456789") == 0x6F91  # the check value of CRC-16/MCRF4XX
    assert checksum(b"") == 0xFFFF


# -- what is answered ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("legacy", [False, True])
def test_what_differs_in_seq_alone_is_answered_in_any_order_and_again(legacy: bool) -> None:
    answers, prepared = taught(700, Request(0, legacy=legacy))
    requested = [599, 0, 256, 256, 1, 511, 699]
    for number, seq in enumerate(requested):
        data = answers(PEER, frame(Request(seq, legacy=legacy), number=number))
        assert data is not None
        packet = wire.decode(parsed(data))
        assert packet is not None
        assert (packet.source, packet.target) == (GCS, VEHICLE)
        assert packet.message == Item(seq, items_of(700)[seq])
    assert prepared.requested == requested


def test_what_differs_in_anything_else_is_left_to_the_machine() -> None:
    answers, prepared = taught()
    strangers = {
        "another system": frame(Request(1), Address(2, 1)),
        "another component": frame(Request(1), Address(1, 2)),
        "to another station": frame(Request(1), target=Address(254, 190)),
        "to a component of ours": frame(Request(1), target=Address(255, 1)),
        "to everybody": frame(Request(1), target=Address(0, 0)),
        "another list": frame(Request(1, FENCE)),
        "the other kind": frame(Request(1, legacy=True)),
        "an acknowledgement": FrameWriter(VEHICLE).pack(wire.encode(Ack(0), GCS)),
        "beyond the end": frame(Request(600)),
        "the last there can be": frame(Request(65535)),
        "signed": FrameWriter(VEHICLE, Signing(KEY)).pack(wire.encode(Request(1), GCS)),
        "MAVLink 1": wire.encode(Request(1), GCS).pack(dialect.MAVLink(None, 1, 1), force_mavlink1=True),
        "two in one": frame(Request(1)) + frame(Request(2)),
        "noise behind it": frame(Request(1)) + b"\x00",
        "half of one": frame(Request(1))[:9],
        "nothing": b"",
    }
    assert {name: answers(PEER, data) for name, data in strangers.items()} == dict.fromkeys(strangers)
    assert answers(("127.0.0.1", 14551), frame(Request(1))) is None
    assert prepared.requested == []
    assert answers(PEER, frame(Request(1))) is not None


def test_no_flipped_bit_is_answered() -> None:
    answers, prepared = taught()
    sound = frame(Request(5))
    for bit in range(8 * len(sound)):
        damaged = bytearray(sound)
        damaged[bit // 8] ^= 1 << bit % 8
        assert answers(PEER, bytes(damaged)) is None
    assert prepared.requested == []


@settings(max_examples=draws(300))
@given(st.binary(max_size=60), st.integers(0, 15))
def test_bytes_that_are_no_frame_are_never_answered(junk: bytes, cut: int) -> None:
    answers, _ = taught(3)
    for data in (junk, frame(Request(1))[:cut], frame(Request(1))[:cut] + junk):
        if answers(PEER, data) is not None:
            packet = wire.decode(parsed(data))
            assert packet is not None
            assert packet.message == Request(1)


def test_a_request_to_everybody_is_answered_once_the_machine_has_done_so() -> None:
    everybody = Address(0, 0)
    answers, _ = taught(600, Request(0, FENCE), everybody)
    assert answers(PEER, frame(Request(300, FENCE), target=everybody)) is not None
    # A mission's has nothing behind its seq, and zeros at the end are not sent: no two of them need look alike.
    answers, _ = taught(600, Request(1), everybody)
    assert not answers


def test_a_signed_link_answers_nothing_on_the_spot() -> None:
    answers, prepared = taught(signing=Signing(KEY))
    assert not answers
    assert not prepared.frames
    assert answers(PEER, frame(Request(1))) is None


def test_what_was_dropped_is_not_answered_any_more() -> None:
    answers, prepared = taught()
    other = answers.prepare([Item(0, item) for item in items_of(1)], Address(2, 1))
    answers.learn(other, PEER, parsed(frame(Request(0), Address(2, 1))))
    answers.drop(prepared)
    assert answers(PEER, frame(Request(1))) is None
    assert answers(PEER, frame(Request(0), Address(2, 1))) is not None
    answers.drop(other)
    assert not answers


# -- on a link ----------------------------------------------------------------------------------------------------


class Asker:
    """A vehicle's end of a UDP link in a thread: ``script`` sends and receives as it likes."""

    def __init__(self, script: Callable[[Asker], None]) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(BOUND_S)
        self.writer, self.parser = FrameWriter(VEHICLE), FrameParser()
        self.station: Any = None
        self.error: BaseException | None = None
        self._script = script
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.url = f"udpout:127.0.0.1:{self.socket.getsockname()[1]}"
        self._thread.start()

    def _run(self) -> None:
        try:
            self._script(self)
        except BaseException as error:
            self.error = error

    def close(self) -> None:
        self._thread.join(BOUND_S)
        self.socket.close()
        assert not self._thread.is_alive()
        if self.error:
            raise self.error

    def move(self) -> None:
        """Speak from another port from now on."""
        self.socket.close()
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(BOUND_S)

    def say(self, message: Any) -> None:
        self.socket.sendto(self.writer.pack(message), self.station)

    def hear(self, kind: str) -> Any:
        until = time.monotonic() + BOUND_S
        while time.monotonic() < until:
            data, self.station = self.socket.recvfrom(4096)
            for message in self.parser.feed(data, datagram=True):
                if message.get_type() == kind:
                    return message
        raise AssertionError(f"no {kind} came")

    def ask(self, seq: int) -> Item:
        self.say(wire.encode(Request(seq), GCS))
        packet = wire.decode(self.hear("MISSION_ITEM_INT"))
        assert packet is not None
        assert isinstance(packet.message, Item)
        assert packet.message.seq == seq
        return packet.message


def heartbeat() -> Any:
    return dialect.MAVLink_heartbeat_message(2, 12, 0, 0, dialect.MAV_STATE_STANDBY, 3)


@contextlib.contextmanager
def asker(script: Callable[[Asker], None]) -> Iterator[Asker]:
    peer = Asker(script)
    try:
        yield peer
    finally:
        peer.close()


def upload_to(peer: Asker, items: list[MissionItem], timers: Timers | None = None) -> tuple[Upload, list[int]]:
    """The upload when it has ended, and its progress on the way."""
    done: list[int] = []
    with Link(peer.url, heartbeat_s=0.05) as link:
        channel = link.channel(1)
        upload = Upload(items, us=GCS, vehicle=VEHICLE, timers=timers)
        run(channel, drive(upload, channel, progress=lambda: done.append(upload.progress.done)))
        assert not link.prompt
    return upload, done


@pytest.mark.nightly
def test_any_order_repeats_and_other_talk_between_come_to_the_same() -> None:
    items = items_of(300)
    order = [*range(300), *range(300)]
    random.Random(4).shuffle(order)
    heard: list[Item] = []

    def script(vehicle: Asker) -> None:
        vehicle.hear("MISSION_COUNT")
        for step, seq in enumerate(order):
            heard.append(vehicle.ask(seq))
            if step % 37 == 0:
                vehicle.say(heartbeat())
            if step % 53 == 0:
                vehicle.socket.sendto(b"\xfd\x00noise", vehicle.station)
            if step == 400:
                vehicle.move()
        vehicle.say(wire.encode(Ack(0), GCS))

    with asker(script) as peer:
        upload, done = upload_to(peer, items)
    assert isinstance(upload.outcome, Accepted)
    assert upload.progress.done == 300
    assert done == sorted(done)
    assert [h.seq for h in heard] == order
    assert all(h.item == items[h.seq] and h.current == int(h.seq == 0) for h in heard)


def test_the_machine_hears_of_prompt_answers_before_it_hears_of_what_came_after_them() -> None:
    def script(vehicle: Asker) -> None:
        vehicle.hear("MISSION_COUNT")
        for seq in range(200):
            vehicle.ask(seq)
        vehicle.say(wire.encode(Ack(0), GCS))  # accepted counts only after every item was asked for

    with asker(script) as peer:
        upload, _ = upload_to(peer, items_of(200), Timers(silence_s=2.0))
    assert isinstance(upload.outcome, Accepted)
    assert upload.retries == 0


@pytest.mark.nightly
def test_timers_run_while_a_vehicle_asks_without_an_end() -> None:
    stop = threading.Event()

    def script(vehicle: Asker) -> None:
        vehicle.hear("MISSION_COUNT")
        until = time.monotonic() + BOUND_S
        with contextlib.suppress(TimeoutError, ConnectionError):
            while not stop.is_set() and time.monotonic() < until:
                vehicle.socket.settimeout(0.2)
                vehicle.ask(1)

    with asker(script) as peer:
        upload, done = upload_to(peer, items_of(3), Timers(stall_s=0.5))
        stop.set()
    assert "gets no further than item 1 of 3" in str(upload.outcome)
    assert len(done) > 1


def test_a_vehicle_that_falls_silent_in_the_middle_is_noticed() -> None:
    def script(vehicle: Asker) -> None:
        vehicle.hear("MISSION_COUNT")
        for seq in range(50):
            vehicle.ask(seq)

    with asker(script) as peer:
        upload, _ = upload_to(peer, items_of(100), Timers(silence_s=0.3))
    assert str(upload.outcome) == "unknown: the vehicle fell silent after asking for 50 of 100 items"


@pytest.mark.nightly
def test_vehicles_on_one_port_and_on_several_are_uploaded_to_together() -> None:
    def vehicle(n: int, autopilot: Autopilot) -> LoopbackVehicle:
        return LoopbackVehicle(n, autopilot, lat_deg=36.6, lon_deg=-84.3, amsl_m=300.0)

    port = [vehicle(1, Autopilot.PX4), vehicle(2, Autopilot.ARDUCOPTER)]
    with (
        SimServer(port, "udpin:127.0.0.1:0") as one,
        SimServer([vehicle(3, Autopilot.PX4)], "udpin:127.0.0.1:0") as two,
    ):
        for urls in ([one.url_for_gcs] * 2, [one.url_for_gcs, one.url_for_gcs, two.url_for_gcs]):
            with contextlib.ExitStack() as stack:
                links = {url: stack.enter_context(Link(url)) for url in set(urls)}
                machines, jobs = [], []
                for sysid, url in enumerate(urls, 1):
                    autopilot = Autopilot.ARDUCOPTER if sysid == 2 else Autopilot.PX4
                    items = items_of(100)
                    machine = VerifiedUpload(items, autopilot, us=GCS, vehicle=Address(sysid, 1))
                    channel = links[url].channel(sysid)
                    machines.append(machine)
                    jobs.append(PumpJob(channel, drive(machine, channel)))
                pump(jobs)
                assert [job.error for job in jobs] == [None] * len(jobs)
                for machine in machines:
                    assert machine.result is not None
                    assert machine.result.verified


def test_a_socket_that_exchanged_does_not_wait_afterwards() -> None:
    transport = Udp(parse_url("udpin:127.0.0.1:0"))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        other.settimeout(BOUND_S)
        place = ("127.0.0.1", int(transport.place.rsplit(":", 1)[1]))
        for word in (b"one", b"two", b"enough", b"left"):
            other.sendto(word, place)
        until = time.monotonic() + BOUND_S
        rest = transport.exchange(lambda _, data: data if len(data) == 3 else None, until, time.monotonic)
        assert [data for _, data in rest] == [b"enough"]
        assert {other.recv(9), other.recv(9)} == {b"one", b"two"}
        assert [data for _, data in transport.read()] == [b"left"]
        assert transport.exchange(lambda *_: b"", until, time.monotonic) == []  # silence
        assert transport.exchange(lambda *_: b"", 0.0, time.monotonic) == []  # too late
        assert transport.read() == []
        transport.close()
        assert transport.exchange(lambda *_: b"", until, time.monotonic) == []
