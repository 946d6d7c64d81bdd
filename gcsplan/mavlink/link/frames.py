"""Bytes to MAVLink messages and back: framing, checksums, signatures. Garbage costs nothing but itself.

pymavlink's own stream parser throws away as many bytes as a corrupted header claims, the good frames among them, and
keeps its buffer for ever while it is never empty. Here a frame that does not check is one byte of garbage, and the
buffer never holds more than one frame.
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
_SIGNING_EPOCH_S = 1_420_070_400  # 2015-01-01, in units of 10 µs from there
GOOD: Final = "good"
LATE: Final = "late"
BAD: Final = "bad"
_MOST_STREAMS = 4096
KEY_VARIABLE = "GCSPLAN_SIGNING_KEY"


def _checksum(data: bytes) -> int:
    return int(dialect.x25crc(data).crc)


checksum: Callable[[bytes], int] = getattr(dialect, "mcrf4xx", None) or _checksum
"""MAVLink's checksum, CRC-16/MCRF4XX: in C where pymavlink has it so, a tenth of the time."""


@dataclass(frozen=True, slots=True, repr=False)
class SigningKey:
    """32 secret bytes. Never shown."""

    secret: bytes

    def __post_init__(self) -> None:
        if len(self.secret) != 32:
            raise InputError(f"a signing key has 32 bytes, given {len(self.secret)}")

    def __repr__(self) -> str:
        return "SigningKey(…)"


def signing_key(file: Path | str | None = None, variable: str = KEY_VARIABLE) -> SigningKey | None:
    """The key from ``file`` (32 raw bytes, or 64 hexadecimal digits), else from the environment (digits), else None.

    Raises InputError for one that cannot be read or has another size; the message does not hold the key.
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
    """The signing state that all parsers and the writer of one link share; without a key it signs nothing.

    A signed frame counts once, and only if it was signed after this link was opened: a vehicle takes over the time of
    those whom it hears, so whoever still signs with an older one has not heard us, and may be a recording. What the
    signature does not fit changes nothing: a forged time must not shut the true stream out. What was rightly signed
    and comes late is `LATE`: it proves nothing, but it may speak against the one who is heard (a second vehicle).
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
        """Whether there is a key."""
        return bool(self._secret)

    def judge(self, frame: bytes) -> Literal["good", "late", "bad"]:
        """Whether a frame whose checksum fits may count; everything may without a key."""
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
    """Messages out of bytes. ``bad`` counts frames that did not check, ``unsigned`` those without a valid signature.

    A message has the attribute ``late`` beside pymavlink's own, of `Signing`.
    """

    def __init__(self, signing: Signing | None = None) -> None:
        self._mav = dialect.MAVLink(None)  # it has no key: signatures are our affair
        self._signing = signing or Signing()
        self._rest = b""
        self.bad = 0
        self.unsigned = 0

    def feed(self, data: bytes, *, datagram: bool = False) -> list[Any]:
        """Every message that ``data`` completes. A ``datagram`` ends with its last frame, a stream goes on."""
        buffer, carried = self._rest + data, len(self._rest)
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
                position = start + 1  # a damaged length must not hide the frames behind it
                continue
            end = start + length
            if _is_unknown_kind(buffer, start):
                if datagram and start < carried:
                    position = start + 1  # of two datagrams, and nobody can tell: the next one may be whole
                    continue
                if end == len(buffer) and not datagram:
                    rest = buffer[start:]  # what follows tells whether it is a frame
                    break
                position = end if end == len(buffer) or buffer[end] in _MARKER_BYTES else start + 1
                continue
            message = self._decode(buffer[start:end])
            if message is None:
                position = start + 1
                continue
            if self._is_taken(message, buffer[start:end]):
                messages.append(message)
            position, rest = end, b""  # a bad signature is no frame's beginning: what follows must not wait for it
        self._rest = rest
        return messages

    def _decode(self, frame: bytes) -> Any:
        """The message in a whole frame; None if its checksum does not fit."""
        try:
            return self._mav.decode(bytearray(frame))
        except dialect.MAVError:
            self.bad += 1
            return None

    def _is_taken(self, message: Any, frame: bytes) -> bool:
        """Whether the signature lets a message count, which learns whether it came late."""
        verdict = self._signing.judge(frame)
        if verdict != GOOD:
            self.bad += 1
            self.unsigned += 1
        message.late = verdict == LATE
        return verdict != BAD


def _is_unknown_kind(buffer: bytes, start: int) -> bool:
    """Whether the message id is none that we know: then nobody here can check its checksum."""
    if buffer[start] != _V2:
        return buffer[start + 5] not in dialect.mavlink_map
    return int.from_bytes(buffer[start + 7 : start + 10], "little") not in dialect.mavlink_map


def _frame_length(buffer: bytes, start: int) -> int:
    """Bytes of the frame that begins at ``start``; -1: not yet known; 0: none begins here."""
    if len(buffer) - start < 3:
        return -1
    if buffer[start] != _V2:
        return int(buffer[start + 1]) + 8
    flags = buffer[start + 2]
    if flags & ~_SIGNED:
        return 0  # flags that we do not know: by the standard, not ours to read
    return int(buffer[start + 1]) + 12 + (13 if flags & _SIGNED else 0)


class FrameWriter:
    """Messages to bytes, with sequence numbers and signatures."""

    def __init__(self, us: Address, signing: Signing | None = None) -> None:
        self._mav = dialect.MAVLink(None, us.sysid, us.compid)
        self._mav.signing = (signing or Signing()).state
        self.us = us
        self._next = 0

    @property
    def signs(self) -> bool:
        """Whether what it packs is signed."""
        return bool(self._mav.signing.sign_outgoing)

    def pack(self, message: Any) -> bytes:
        """The frame of ``message``."""
        self._mav.seq = self.number()
        frame: bytes = message.pack(self._mav)
        return frame

    def number(self) -> int:
        """The number of the next frame, 0 … 255 and round again, for one that is packed elsewhere."""
        number = self._next
        self._next = number + 1 & 255
        return number
