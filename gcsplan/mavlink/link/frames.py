"""Conversion between bytes and MAVLink messages: framing, checksums, signatures.

After a corrupted header, pymavlink's own stream parser discards as many bytes as that header claims, including good
frames, and its buffer grows as long as it is never empty. Here, a frame with a wrong checksum costs only its first
byte, so the good frames behind it are kept, and the buffer never holds more than one frame.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.errors import InputError
from gcsplan.mavlink.protocol.messages import Address

_MARKERS = re.compile(b"[\xfd\xfe]")
_MARKER_BYTES = (0xFD, 0xFE)
_V2, _SIGNED = 0xFD, 0x01
_SIGNING_EPOCH_S = 1_420_070_400  # Unix time of 2015-01-01, from which signatures count units of 10 µs
GOOD: Final = "good"
LATE: Final = "late"
BAD: Final = "bad"
_MOST_STREAMS = 4096
KEY_VARIABLE = "GCSPLAN_SIGNING_KEY"


def _checksum(data: bytes) -> int:
    return int(dialect.x25crc(data).crc)


checksum: Callable[[bytes], int] = getattr(dialect, "mcrf4xx", None) or _checksum
"""MAVLink's checksum, CRC-16/MCRF4XX; pymavlink's C version, if present, takes a tenth of the time."""


@dataclass(frozen=True, slots=True, repr=False)
class SigningKey:
    """32 secret bytes, never printed."""

    secret: bytes

    def __post_init__(self) -> None:
        if len(self.secret) != 32:
            raise InputError(f"a signing key has 32 bytes, given {len(self.secret)}")

    def __repr__(self) -> str:
        return "SigningKey(…)"


def signing_key(file: Path | str | None = None, variable: str = KEY_VARIABLE) -> SigningKey | None:
    """Return the key from ``file`` (32 raw bytes or 64 hexadecimal digits), else from the environment (digits).

    None if there is neither. Raises InputError for a key that cannot be read or has another size; the message does not
    contain the key.
    """
    if file is not None:
        try:
            with open(file, "rb") as handle:
                raw = handle.read(200)
        except OSError as error:
            raise InputError(f"cannot read the signing key: {error.strerror}", where=str(file)) from None
        return SigningKey(raw) if len(raw) == 32 else _from_hex(raw, str(file))
    text = os.environ.get(variable)
    return _from_hex(text.encode(errors="replace"), f"environment variable {variable}") if text else None


def _from_hex(raw: bytes, where: str) -> SigningKey:
    if not re.fullmatch(rb"\s*[0-9A-Fa-f]{64}\s*", raw):
        raise InputError("a signing key is 32 bytes, raw in a file or as 64 hexadecimal digits", where=where)
    return SigningKey(bytes.fromhex(raw.decode().strip()))


class Signing:
    """The signing state that all parsers and the writer of one link share; without a key nothing is signed.

    A signed frame counts once, and only if it was signed after this link was opened. A vehicle adopts the newest time
    that it hears, so a frame with an older time comes from somebody who has not heard us, or from a recording. A frame
    with a wrong signature does not change the state: a forged time must not lock the true stream out. A correctly
    signed frame that arrives late is `LATE`: it confirms nothing, but may show that there is a second vehicle.
    """

    def __init__(
        self, key: SigningKey | None = None, link_id: int = 0, *, clock: Callable[[], float] = time.time
    ) -> None:
        self.state = dialect.MAVLinkSigning()
        self._secret = key.secret if key else b""
        self._streams: dict[tuple[int, int, int], int] = {}
        self._opened = 0
        if key is not None:
            self.state.secret_key = key.secret
            self.state.sign_outgoing = True
            self.state.link_id = link_id
            self._opened = self.state.timestamp = int((clock() - _SIGNING_EPOCH_S) * 1e5)

    @property
    def active(self) -> bool:
        """Whether a key is set."""
        return bool(self._secret)

    def judge(self, frame: bytes) -> Literal["good", "late", "bad"]:
        """Judge the signature of a frame with a correct checksum; without a key every frame is `GOOD`."""
        if not self._secret:
            return GOOD
        if frame[0] != _V2 or not frame[2] & _SIGNED:
            return BAD
        stream = (frame[-13], frame[5], frame[6])  # link, system, component
        signed_at = int.from_bytes(frame[-12:-6], "little")
        signature = hashlib.sha256(self._secret + frame[:-6]).digest()[:6]
        if not hmac.compare_digest(signature, frame[-6:]) or signed_at < self._opened:
            return BAD
        if signed_at <= self._streams.get(stream, -1):
            return LATE
        if stream not in self._streams and len(self._streams) >= _MOST_STREAMS:
            return BAD
        self._streams[stream] = signed_at
        self.state.timestamp = max(self.state.timestamp, signed_at)
        return GOOD


class FrameParser:
    """Parses bytes into messages.

    ``bad`` counts frames with a wrong checksum or signature, ``unsigned`` those with a missing, wrong or late
    signature. A message has the attribute ``late`` (see `Signing`) in addition to pymavlink's own.
    """

    def __init__(self, signing: Signing | None = None) -> None:
        self._mav = dialect.MAVLink(None)  # without a key, because `Signing` checks signatures
        self._signing = signing or Signing()
        self.rest = b""
        self.bad = 0
        self.unsigned = 0

    def feed(self, data: bytes, *, datagram: bool = False) -> list[Any]:
        """Return every message that ``data`` completes. A ``datagram`` ends with its last frame, a stream goes on."""
        buffer, carried = self.rest + data, len(self.rest)
        messages: list[Any] = []
        position, rest = 0, b""
        while found := _MARKERS.search(buffer, position):
            start = found.start()
            length = _frame_length(buffer, start)
            if length == 0:
                position = start + 1
                continue
            if length < 0 or start + length > len(buffer):
                rest = rest or buffer[start:]
                if not datagram:
                    break
                position = start + 1  # a corrupted length must not hide the frames behind it
                continue
            end = start + length
            if _is_unknown_kind(buffer, start):
                if datagram and start < carried:
                    position = start + 1  # spans two datagrams and cannot be verified: the next frame may be whole
                    continue
                if end == len(buffer) and not datagram:
                    rest = buffer[start:]  # only the next byte shows whether this is a frame
                    break
                position = end if end == len(buffer) or buffer[end] in _MARKER_BYTES else start + 1
                continue
            message = self._decode(buffer[start:end])
            if message is None:
                position = start + 1
                continue
            if self._is_taken(message, buffer[start:end]):
                messages.append(message)
            position, rest = end, b""  # a whole frame, even if badly signed: an incomplete one before it was garbage
        self.rest = rest
        return messages

    def _decode(self, frame: bytes) -> Any:
        """Return the message in a whole frame; None if its checksum is wrong."""
        try:
            return self._mav.decode(bytearray(frame))
        except dialect.MAVError:
            self.bad += 1
            return None

    def _is_taken(self, message: Any, frame: bytes) -> bool:
        """Whether the signature is acceptable; also set the message's attribute ``late``."""
        verdict = self._signing.judge(frame)
        if verdict != GOOD:
            self.bad += 1
            self.unsigned += 1
        message.late = verdict == LATE
        return verdict != BAD


def _is_unknown_kind(buffer: bytes, start: int) -> bool:
    """Whether the message id is unknown, in which case the checksum cannot be verified."""
    if buffer[start] != _V2:
        return buffer[start + 5] not in dialect.mavlink_map
    return int.from_bytes(buffer[start + 7 : start + 10], "little") not in dialect.mavlink_map


def _frame_length(buffer: bytes, start: int) -> int:
    """Return the length in bytes of the frame at ``start``; -1: not yet known; 0: no frame begins here."""
    if len(buffer) - start < 3:
        return -1
    if buffer[start] != _V2:
        return int(buffer[start + 1]) + 8
    flags = buffer[start + 2]
    if flags & ~_SIGNED:
        return 0  # the standard says to discard frames with unknown incompatibility flags
    return int(buffer[start + 1]) + 12 + (13 if flags & _SIGNED else 0)


class FrameWriter:
    """Packs messages into bytes, with sequence numbers and signatures."""

    def __init__(self, us: Address, signing: Signing | None = None) -> None:
        self._mav = dialect.MAVLink(None, us.sysid, us.compid)
        self._mav.signing = (signing or Signing()).state
        self.us = us
        self._next = 0

    @property
    def signs(self) -> bool:
        """Whether it signs the frames."""
        return bool(self._mav.signing.sign_outgoing)

    def pack(self, message: Any) -> bytes:
        """Return the frame of ``message``."""
        self._mav.seq = self.number()
        frame: bytes = message.pack(self._mav)
        return frame

    def number(self) -> int:
        """Take the next sequence number, 0 … 255 cyclically; also used for frames that are packed elsewhere."""
        number = self._next
        self._next = number + 1 & 255
        return number
