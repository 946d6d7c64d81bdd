"""Conversion between mission messages as plain values and pymavlink's (ardupilotmega dialect, includes common).

The field ``opaque_id`` of COUNT and ACK is newer than pymavlink's dialects. Where the dialect lacks it, this module
reads it from the payload and appends it to the payload itself.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.mavlink.mission.mission import MissionItem
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

# A corrupted frame must never be accepted, even if the environment sets MAV_IGNORE_CRC.
dialect.MAVLINK_IGNORE_CRC = 0

_COUNT_ID_AT, _ACK_ID_AT = 5, 4  # byte offset of opaque_id in the payloads
_UNPLACED = 1e7  # MISSION_ITEM holds degrees, a `MissionItem` degrees times this


class _CountWithId(dialect.MAVLink_mission_count_message):  # type: ignore[misc]
    opaque = 0

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        payload = self.unpacker.pack(self.count, self.target_system, self.target_component, self.mission_type)
        packed: bytes = self._pack(mav, self.crc_extra, payload + struct.pack("<I", self.opaque), force_mavlink1)
        return packed


class _AckWithId(dialect.MAVLink_mission_ack_message):  # type: ignore[misc]
    opaque = 0

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        payload = self.unpacker.pack(self.target_system, self.target_component, self.type, self.mission_type)
        packed: bytes = self._pack(mav, self.crc_extra, payload + struct.pack("<I", self.opaque), force_mavlink1)
        return packed


def encode(message: MissionMessage, target: Address) -> Any:
    """Return the pymavlink message for ``message`` to ``target``."""
    return _ENCODERS[type(message)](message, target)


def _encode_count(m: Count, to: Address) -> Any:
    if not m.opaque_id:
        return dialect.MAVLink_mission_count_message(*to, m.count, m.mission_type)
    message = _CountWithId(*to, m.count, m.mission_type)
    message.opaque = m.opaque_id
    return message


def _encode_ack(m: Ack, to: Address) -> Any:
    if not m.opaque_id:
        return dialect.MAVLink_mission_ack_message(*to, m.code, m.mission_type)
    message = _AckWithId(*to, m.code, m.mission_type)
    message.opaque = m.opaque_id
    return message


def _encode_request(m: Request, to: Address) -> Any:
    kind = dialect.MAVLink_mission_request_message if m.legacy else dialect.MAVLink_mission_request_int_message
    return kind(*to, m.seq, m.mission_type)


def _encode_item(m: Item, to: Address) -> Any:
    i = m.item
    return dialect.MAVLink_mission_item_int_message(
        *to, m.seq, i.frame, i.command, m.current, int(i.autocontinue), *i.params, i.x, i.y, i.z, m.mission_type
    )


def _encode_legacy_item(m: LegacyItem, to: Address) -> Any:
    i = m.item
    return dialect.MAVLink_mission_item_message(
        *to, m.seq, i.frame, i.command, m.current, int(i.autocontinue), *i.params,
        i.x / _UNPLACED, i.y / _UNPLACED, i.z, m.mission_type,
    )  # fmt: skip


_ENCODERS: dict[type, Callable[[Any, Address], Any]] = {
    Count: _encode_count,
    RequestList: lambda m, to: dialect.MAVLink_mission_request_list_message(*to, m.mission_type),
    Request: _encode_request,
    Item: _encode_item,
    LegacyItem: _encode_legacy_item,
    Ack: _encode_ack,
    ClearAll: lambda m, to: dialect.MAVLink_mission_clear_all_message(*to, m.mission_type),
}


def decode(message: Any) -> Packet | None:
    """Return the packet in a received pymavlink message; None if it does not belong to the mission protocol."""
    decoder = _DECODERS.get(message.get_type())
    if decoder is None:
        return None
    return Packet(
        Address(message.get_srcSystem(), message.get_srcComponent()),
        Address(message.target_system, message.target_component),
        decoder(message),
    )


def _decode_item(m: Any) -> Item:
    item = MissionItem(
        m.command, m.frame, (m.param1, m.param2, m.param3, m.param4), m.x, m.y, m.z, bool(m.autocontinue)
    )
    return Item(m.seq, item, m.mission_type, m.current)


def _decode_legacy_item(m: Any) -> LegacyItem:
    item = MissionItem(
        m.command, m.frame, (m.param1, m.param2, m.param3, m.param4), _e7(m.x), _e7(m.y), m.z, bool(m.autocontinue)
    )
    return LegacyItem(m.seq, item, m.mission_type, m.current)


def _e7(degrees: float) -> int:
    return round(degrees * _UNPLACED) if math.isfinite(degrees) and abs(degrees) < 200 else 0


def _opaque_id(m: Any, at: int) -> int:
    known = getattr(m, "opaque_id", None)
    if known is not None:
        return int(known)
    frame = m.get_msgbuf()
    if not frame or frame[0] != dialect.PROTOCOL_MARKER_V2:
        return 0
    payload = bytes(frame[dialect.HEADER_LEN_V2 : dialect.HEADER_LEN_V2 + frame[1]])
    return int.from_bytes(payload[at : at + 4], "little")  # trailing zeros are cut off on the wire


_DECODERS: dict[str, Callable[[Any], MissionMessage]] = {
    "MISSION_COUNT": lambda m: Count(m.count, m.mission_type, _opaque_id(m, _COUNT_ID_AT)),
    "MISSION_REQUEST_LIST": lambda m: RequestList(m.mission_type),
    "MISSION_REQUEST": lambda m: Request(m.seq, m.mission_type, legacy=True),
    "MISSION_REQUEST_INT": lambda m: Request(m.seq, m.mission_type),
    "MISSION_ITEM_INT": _decode_item,
    "MISSION_ITEM": _decode_legacy_item,
    "MISSION_ACK": lambda m: Ack(m.type, m.mission_type, _opaque_id(m, _ACK_ID_AT)),
    "MISSION_CLEAR_ALL": lambda m: ClearAll(m.mission_type),
}
