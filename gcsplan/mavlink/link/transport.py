"""Sockets and serial ports behind one small interface: received bytes with their peer, and bytes sent to a peer.

No read or write blocks longer than opening a connection does. An open transport is read when one of its ``handles`` is
readable; one without handles (serial ports on Windows) is polled.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import socket
import struct
import time
from collections.abc import Callable, Hashable, Sequence
from typing import Any, Protocol, cast

from gcsplan.errors import LinkError
from gcsplan.mavlink.link.url import Endpoint
from gcsplan.notes.note import Note

Peer = Hashable
HeardBytes = tuple[Peer, bytes]
LinkClock = Callable[[], float]

_DATAGRAM = 65535
_BURST = 256  # most datagrams per read, so that a flood cannot starve the timers
_SILENCE_S = 0.02
_CONNECT_S = 5.0
_RECONNECT_S = 1.0
_MOST_UNSENT = 1 << 18
_MOST_CLIENTS = 32


class Transport(Protocol):
    """A socket or port. ``datagrams``: it reads whole datagrams. ``default``: peer for ids not heard yet, or None."""

    datagrams: bool
    default: Peer | None

    @property
    def handles(self) -> Sequence[int]:
        """File descriptors to wait for; empty if the transport must be polled."""
        ...

    @property
    def place(self) -> str:
        """The address that is actually used."""
        ...

    def read(self) -> list[HeardBytes]:
        """Return what was received, without waiting."""
        ...

    def write(self, data: bytes, peer: Peer) -> None:
        """Send to ``peer`` without waiting; data that cannot be sent is lost, as on a radio link."""
        ...

    def close(self) -> None:
        """Close the transport for good."""
        ...


def open_transport(endpoint: Endpoint) -> Transport:
    """Open ``endpoint``. Raises LinkError that states the cause and suggests the other direction."""
    try:
        if endpoint.kind == "udp":
            return Udp(endpoint)
        if endpoint.kind == "tcp":
            return TcpServer(endpoint) if endpoint.listens else TcpClient(endpoint)
        return Serial(endpoint)
    except OSError as error:  # serial.SerialException is one
        why = error.strerror or str(error)
        raise LinkError(
            f"cannot open the link ({endpoint.understood()}): {why}; is {endpoint.other_direction()} meant?",
            where=endpoint.url,
            reason="link",
        ) from None


def wait_readable(transports: Sequence[Transport], timeout_s: float) -> None:
    """Sleep until one of ``transports`` is readable or ``timeout_s`` has passed."""
    timeout_s = max(0.0, timeout_s)
    handles = [handle for transport in transports for handle in transport.handles]
    if any(not transport.handles for transport in transports):
        timeout_s = min(timeout_s, 0.005)  # one of them must be polled
    if not handles:
        time.sleep(timeout_s)
        return
    with contextlib.suppress(OSError, ValueError):  # closed meanwhile: the next read handles it
        select.select(handles, [], [], timeout_s)


def _resolve(endpoint: Endpoint, kind: socket.SocketKind) -> tuple[socket.AddressFamily, Any]:
    flags = socket.AI_PASSIVE if endpoint.listens else 0
    family, *_, address = socket.getaddrinfo(endpoint.host, endpoint.port, type=kind, flags=flags)[0]
    return family, address


def _patience_s(sock: socket.socket) -> float | None:
    """Return the timeout that ends a wait on ``sock`` after `_SILENCE_S`; None (blocking) if the kernel enforces it."""
    try:
        silence = struct.pack("@ll", 0, round(_SILENCE_S * 1e6))  # struct timeval
        for option in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):
            sock.setsockopt(socket.SOL_SOCKET, option, silence)
        is_set = any(sock.getsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, len(silence)))
    except (OSError, AttributeError):
        is_set = False
    return None if is_set and os.name == "posix" else _SILENCE_S


class Udp:
    """One UDP socket. ICMP errors about unreachable peers are ignored, because the timers detect silence anyway.

    ``note``: says that another port than the endpoint's is sent from, and why; mostly empty.
    """

    datagrams = True
    note: Note | None = None

    def __init__(self, endpoint: Endpoint) -> None:
        family, address = _resolve(endpoint, socket.SOCK_DGRAM)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self.default: Peer | None = None
        self._patience_s = _patience_s(self._socket)
        try:
            self._socket.setblocking(False)
            with contextlib.suppress(OSError):
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
            if endpoint.listens:
                self._socket.bind(address)
            else:
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
                self.default = address
                self._leave_from(endpoint, "::" if family == socket.AF_INET6 else "")
        except OSError:
            self._socket.close()
            raise

    def _leave_from(self, endpoint: Endpoint, everywhere: str) -> None:
        """Send from the endpoint's port, or from any free one if a program uses it already."""
        try:
            self._socket.bind((everywhere, endpoint.sends_from))
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise
            self._socket.bind((everywhere, 0))
            own = self._socket.getsockname()[1]
            self.note = Note(
                "sends_from_another_port", port=own, wanted_port=endpoint.sends_from, endpoint=endpoint.place
            )

    @property
    def handles(self) -> Sequence[int]:
        return (self._socket.fileno(),)

    @property
    def place(self) -> str:
        """Our own address."""
        return _host_and_port(self._socket.getsockname())

    def read(self) -> list[HeardBytes]:
        heard: list[HeardBytes] = []
        for _ in range(_BURST):
            try:
                data, peer = self._socket.recvfrom(_DATAGRAM)
            except (BlockingIOError, InterruptedError):
                break
            except OSError:  # ICMP: a port is closed
                continue
            heard.append((peer, data))
        return heard

    def exchange(
        self, answer: Callable[[Peer, bytes], bytes | None], until: float, clock: LinkClock
    ) -> list[HeardBytes]:
        """Answer datagrams until one has no answer (it is returned), or until a short silence, or until ``until``.

        The socket itself waits, which saves two system calls per datagram compared with `wait_readable` and `read`.
        """
        receive, send = self._socket.recvfrom, self._socket.sendto
        try:
            self._socket.settimeout(self._patience_s)
            while clock() < until:
                data, peer = receive(_DATAGRAM)
                reply = answer(peer, data)
                if reply is None:
                    return [(peer, data)]
                send(reply, peer)
        except OSError:  # timeout, ICMP error, or closed meanwhile
            return []
        finally:
            with contextlib.suppress(OSError):
                self._socket.setblocking(False)
        return []

    def write(self, data: bytes, peer: Peer) -> None:
        with contextlib.suppress(OSError):
            self._socket.sendto(data, cast(tuple[Any, ...], peer))

    def close(self) -> None:
        self._socket.close()


class _Stream:
    """One TCP connection, with a buffer for bytes that could not be sent at once."""

    def __init__(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket = sock
        self.open = True
        self._unsent = bytearray()

    def read(self) -> bytes:
        self.flush()
        if not self.open:
            return b""
        try:
            data = self.socket.recv(_DATAGRAM)
        except (BlockingIOError, InterruptedError):
            return b""
        except OSError:
            data = b""
        if not data:
            self.close()
        return data

    def write(self, data: bytes) -> None:
        if len(self._unsent) + len(data) <= _MOST_UNSENT:  # beyond that the peer does not read: drop, as radio would
            self._unsent += data
        self.flush()

    def flush(self) -> None:
        if not self.open or not self._unsent:
            return
        try:
            sent = self.socket.send(self._unsent)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            self.close()
            return
        del self._unsent[:sent]

    def close(self) -> None:
        self.open = False
        self.socket.close()


class TcpClient:
    """A connection that we open, and open again when it breaks (for example when the vehicle reboots)."""

    datagrams = False
    default: Peer | None = "tcp"

    def __init__(self, endpoint: Endpoint) -> None:
        self._family, self._address = _resolve(endpoint, socket.SOCK_STREAM)
        self._stream = _Stream(self._connect(_CONNECT_S))
        self._again_at = 0.0

    def _connect(self, timeout_s: float) -> socket.socket:
        sock = socket.socket(self._family, socket.SOCK_STREAM)
        try:
            sock.settimeout(timeout_s)
            sock.connect(self._address)
        except OSError:
            sock.close()
            raise
        return sock

    @property
    def handles(self) -> Sequence[int]:
        return (self._stream.socket.fileno(),) if self._stream.open else ()

    @property
    def place(self) -> str:
        """The peer's address."""
        return _host_and_port(self._address)

    def read(self) -> list[HeardBytes]:
        if not self._stream.open and time.monotonic() >= self._again_at:
            try:
                self._stream = _Stream(self._connect(0.2))
            except OSError:
                self._again_at = time.monotonic() + _RECONNECT_S
        data = self._stream.read() if self._stream.open else b""
        return [("tcp", data)] if data else []

    def write(self, data: bytes, peer: Peer) -> None:
        self._stream.write(data)

    def close(self) -> None:
        self._stream.close()


def _host_and_port(address: tuple[Any, ...]) -> str:
    """A socket's address as text; the rest of an IPv6 address is left out."""
    host, port = address[:2]
    return f"{host}:{port}"


class TcpServer:
    """Connections that peers open to us."""

    datagrams = False
    default: Peer | None = None

    def __init__(self, endpoint: Endpoint) -> None:
        family, address = _resolve(endpoint, socket.SOCK_STREAM)
        self._socket = socket.socket(family, socket.SOCK_STREAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._socket.bind(address)
            self._socket.listen(8)
            self._socket.setblocking(False)
        except OSError:
            self._socket.close()
            raise
        self.clients: dict[Peer, _Stream] = {}

    @property
    def handles(self) -> Sequence[int]:
        return (self._socket.fileno(), *(s.socket.fileno() for s in self.clients.values() if s.open))

    @property
    def place(self) -> str:
        """Our own address."""
        return _host_and_port(self._socket.getsockname())

    def read(self) -> list[HeardBytes]:
        while len(self.clients) < _MOST_CLIENTS:
            try:
                sock, peer = self._socket.accept()
            except OSError:
                break
            self.clients[peer] = _Stream(sock)
        heard = [(peer, stream.read()) for peer, stream in self.clients.items()]
        self.clients = {peer: stream for peer, stream in self.clients.items() if stream.open}
        return [(peer, data) for peer, data in heard if data]

    def write(self, data: bytes, peer: Peer) -> None:
        stream = self.clients.get(peer)
        if stream:
            stream.write(data)

    def close(self) -> None:
        for stream in self.clients.values():
            stream.close()
        self._socket.close()


class Serial:
    """A serial port, through pyserial."""

    datagrams = False
    default: Peer | None = "serial"

    def __init__(self, endpoint: Endpoint) -> None:
        import serial  # no other link needs pyserial

        self._port = serial.Serial(endpoint.device, endpoint.baud, timeout=0, write_timeout=1.0)
        self.place = endpoint.place

    @property
    def handles(self) -> Sequence[int]:
        try:
            return (self._port.fileno(),)
        except (AttributeError, OSError):  # Windows, or unplugged
            return ()

    def read(self) -> list[HeardBytes]:
        try:
            data = self._port.read(4096)
        except OSError:
            time.sleep(0.05)  # unplugged: select reports it readable for ever
            return []
        return [("serial", bytes(data))] if data else []

    def write(self, data: bytes, peer: Peer) -> None:
        with contextlib.suppress(OSError):
            self._port.write(data)

    def close(self) -> None:
        self._port.close()
