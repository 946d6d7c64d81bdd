"""Mission messages on the wire: pymavlink's own parser reads what is encoded, and decoding gives it back."""

from __future__ import annotations

import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, MissionItem
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

FROM, TO = Address(255, 190), Address(7, 1)
ITEM = MissionItem(16, 3, (1.5, 0.0, 0.0, -90.0), 366_123_457, -843_800_001, 61.25)


def sent(message: MissionMessage) -> bytes:
    """The frame of a message, packed by pymavlink."""
    encoder = dialect.MAVLink(None, srcSystem=FROM.sysid, srcComponent=FROM.compid)
    return bytes(wire.encode(message, TO).pack(encoder))


def received(frame: bytes) -> object:
    [message] = dialect.MAVLink(None).parse_buffer(bytearray(frame))
    return message


@pytest.mark.parametrize("mission_type", [MISSION, FENCE, RALLY])
@pytest.mark.parametrize("make", [Count, Request, Ack, RequestList, ClearAll, Item], ids=lambda make: make.__name__)
def test_a_message_that_is_sent_is_decoded_as_it_was(make: type, mission_type: int) -> None:
    given: dict[type, tuple[object, ...]] = {Count: (12,), Request: (3,), Ack: (5,), Item: (4, ITEM)}
    message = make(*given.get(make, ()), mission_type=mission_type)
    assert wire.decode(received(sent(message))) == Packet(FROM, TO, message)


def test_an_item_has_the_fields_of_mission_item_int() -> None:
    read = received(sent(Item(4, ITEM)))
    assert isinstance(read, dialect.MAVLink_mission_item_int_message)
    assert (read.seq, read.command, read.frame, read.x, read.y, read.z) == (4, 16, 3, 366_123_457, -843_800_001, 61.25)
    assert (read.param1, read.param2, read.param3, read.param4) == (1.5, 0.0, 0.0, -90.0)
    assert (read.target_system, read.target_component, read.autocontinue) == (7, 1, 1)


def test_an_item_in_the_old_form_is_rounded_to_float32_degrees() -> None:
    packet = wire.decode(received(sent(LegacyItem(4, ITEM))))
    assert packet is not None
    assert type(packet.message) is LegacyItem
    (lat_deg,) = struct.unpack("<f", struct.pack("<f", ITEM.x * 1e-7))
    assert packet.message.item.x == round(lat_deg * 1e7)
    assert packet.message.item.x != ITEM.x


@pytest.mark.parametrize("message", [Count(12, opaque_id=0xDEADBEEF), Ack(0, opaque_id=7)], ids=["count", "ack"])
def test_an_opaque_id_travels_at_the_end_of_the_payload(message: Count | Ack) -> None:
    frame = sent(message)
    payload = frame[10 : 10 + frame[1]]
    assert payload.endswith(struct.pack("<I", message.opaque_id).rstrip(b"\0"))  # MAVLink 2 leaves zeros at the end out
    assert frame[1] > len(sent(type(message)(*([12] if isinstance(message, Count) else [1])))) - 12
    packet = wire.decode(received(frame))
    assert packet is not None
    assert packet.message == message


def test_a_message_outside_of_the_protocol_is_no_packet() -> None:
    encoder = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    assert wire.decode(received(bytes(dialect.MAVLink_system_time_message(1, 2).pack(encoder)))) is None
