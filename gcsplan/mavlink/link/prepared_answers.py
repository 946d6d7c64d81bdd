"""Prompt answers: the items of an upload, encoded before they are requested.

An upload runs in lock-step, so the time from a request to its item counts once for every item. The machine answers any
request in range, in any order, any number of times. So only the first request of an upload passes through parser,
routing and machine. A request that differs from it only in its seq is answered immediately, and the machine is
notified a moment later.

This second encoder of MISSION_ITEM_INT, beside pymavlink's, exists for speed: on two busy cores over loopback, 700
items to one vehicle take 1.1 s with it and 1.9 s without (medians of 5 in turn; processor time here 0.04 s and 0.17 s).
With 100 items to each of 20 vehicles at once it halves the processor time, 0.11 s and 0.23 s; the wall time, 3.4 s and
3.8 s (medians of 3), differs by less than its scatter. A test compares its bytes with pymavlink's.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import Any

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.mavlink.link.frames import FrameWriter, checksum
from gcsplan.mavlink.link.transport import Peer
from gcsplan.mavlink.protocol.messages import Address, Item

# MAVLink 2, unsigned: marker, payload length, two bytes of flags, sequence number | system, component, message id
# (3 bytes), payload | checksum over everything but the marker, and over one more byte that depends on the message id.
_HEAD_BYTES = Struct("<BBBBB")
_BEFORE_PAYLOAD = Struct("<BBHB")
_CHECKSUM = Struct("<H")
_MARKER, _NO_FLAGS = 0xFD, 0
_AROUND = _HEAD_BYTES.size + _BEFORE_PAYLOAD.size + _CHECKSUM.size
_SEQ_AND_TARGET = 3  # least payload of a request, bytes: in a shorter one, trimmed zeros may belong to the seq

_ITEM = dialect.MAVLink_mission_item_int_message
_PAYLOAD = _ITEM.unpacker
_KIND = (_ITEM.id & 0xFFFF, _ITEM.id >> 16)
_EXTRA = bytes([_ITEM.crc_extra])


class Prepared:
    """The items of one upload. ``requested``: the seqs that were answered since the machine was last notified."""

    def __init__(self, frames: Sequence[bytes]) -> None:
        self.frames = frames
        self.requested: list[int] = []
        self.peer: Peer | None = None
        self.extra = b""


class PromptAnswers:
    """The prompt answers of one link: `prepare` items, `learn` which requests they answer, `drop` them.

    It answers nothing with signing, or if not ``possible`` (on a link other than UDP).
    """

    def __init__(self, writer: FrameWriter, *, possible: bool = True) -> None:
        self._writer = writer
        self._possible = possible and not writer.signs
        self._by_shape: dict[bytes, Prepared] = {}

    def __bool__(self) -> bool:
        return bool(self._by_shape)

    def prepare(self, items: Sequence[Item], target: Address) -> Prepared:
        """Encode ``items``, in the order of their seqs from 0, for ``target``."""
        us = self._writer.us
        return Prepared([_tail(item, target, us) for item in items] if self._possible else [])

    def learn(self, prepared: Prepared, peer: Peer, message: Any) -> None:
        """From now on, answer requests like ``message``, a pymavlink request that the machine has answered."""
        frame = bytes(message.get_msgbuf())
        plain = frame[0] == _MARKER and frame[2] == _NO_FLAGS and len(frame) == frame[1] + _AROUND
        if prepared.frames and plain and frame[1] >= _SEQ_AND_TARGET:
            prepared.peer, prepared.extra = peer, bytes([message.crc_extra])
            self._by_shape[_shape(frame)] = prepared

    def drop(self, prepared: Prepared) -> None:
        """Stop answering with ``prepared``."""
        self._by_shape = {shape: one for shape, one in self._by_shape.items() if one is not prepared}

    def answered(self) -> set[Peer | None]:
        """Return the peers with answers of which the machines were not yet notified."""
        return {one.peer for one in self._by_shape.values() if one.requested}

    def __call__(self, peer: Peer, data: bytes) -> bytes | None:
        """Return the frame that answers the datagram ``data`` from ``peer``; None if the normal path must handle it."""
        prepared = self._by_shape.get(_shape(data))
        if prepared is None or prepared.peer != peer:
            return None
        seq = data[10] | data[11] << 8
        if seq >= len(prepared.frames) or checksum(data[1:-2] + prepared.extra) != data[-2] | data[-1] << 8:
            return None
        prepared.requested.append(seq)
        tail = prepared.frames[seq]
        head = _HEAD_BYTES.pack(_MARKER, len(tail) - _BEFORE_PAYLOAD.size - 1, _NO_FLAGS, 0, self._writer.number())
        return head + tail[:-1] + _CHECKSUM.pack(checksum(head[1:] + tail))


def _shape(request: bytes) -> bytes:
    """Return a request's bytes, but for the varying ones: sequence number (4), seq (10 and 11), checksum (last two)."""
    return request[:4] + request[5:10] + request[12:-2]


def _tail(message: Item, target: Address, us: Address) -> bytes:
    """Return a MISSION_ITEM_INT frame from after its sequence number, with the CRC extra byte instead of a checksum."""
    item = message.item
    payload = _PAYLOAD.pack(
        *item.params, item.x, item.y, item.z, message.seq, item.command, *target, item.frame, message.current,
        item.autocontinue, message.mission_type,
    )  # fmt: skip
    return _BEFORE_PAYLOAD.pack(*us, *_KIND) + (payload.rstrip(b"\0") or b"\0") + _EXTRA
