"""The hub: who hears what, and what it survives."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mav

from gcsplan.errors import UsageError
from gcsplan.mavlink.link.frames import FrameWriter
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.messages import Address, Count
from gcsplan.sim.vehicle.hub import FORGOTTEN_AFTER_S, MOST_CLIENTS, Hub
from gcsplan.vehicle import Autopilot
from tests.support.effort import draws
from tests.support.hub import GCS, PX4, a_vehicle, ask, command, frame, messages


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
