"""The simulator's transports, both non-blocking: one for UDP datagrams, one for TCP connections."""

from __future__ import annotations

import contextlib
import select
import socket
from typing import Protocol

from gcsplan.sim.vehicle.hub import Client

_BUFFER = 65536
_MOST_AT_ONCE = 64  # datagrams read before timers are checked again
_MOST_CONNECTIONS = 16
_UNSENT_LIMIT = 1 << 20  # bytes that a slow TCP client may leave unread before it is dropped


class ServerTransport(Protocol):
    """The interface of a socket that a server needs."""

    address: tuple[str, int]
    datagrams: bool  # whether it reads whole datagrams

    def wait(self, waker: socket.socket, timeout_s: float) -> list[tuple[Client, bytes]]:
        """Return what was received; waits at most ``timeout_s``, or until ``waker`` is readable."""
        ...

    def send(self, client: Client, data: bytes) -> None:
        """Send ``data``, or drop what cannot be sent."""
        ...

    def newcomers(self) -> list[Client]:
        """Return the clients that have connected since the last call."""
        ...

    def gone(self) -> list[Client]:
        """Return the clients that have disconnected since the last call."""
        ...

    def close(self) -> None:
        """Close every socket."""
        ...


class UdpTransport:
    """One UDP socket; a client is identified by its source address."""

    datagrams = True

    def __init__(self, place: tuple[str, int]) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
            self._socket.bind(place)
            self._socket.setblocking(False)
        except OSError:
            self._socket.close()
            raise
        self.address: tuple[str, int] = self._socket.getsockname()

    def wait(self, waker: socket.socket, timeout_s: float) -> list[tuple[Client, bytes]]:
        """Return the received datagrams with their senders."""
        ready, _, _ = select.select([self._socket, waker], [], [], timeout_s)
        came: list[tuple[Client, bytes]] = []
        if self._socket in ready:
            with contextlib.suppress(OSError):  # nothing more to read, or an ICMP error of an earlier send
                while len(came) < _MOST_AT_ONCE:
                    data, sender = self._socket.recvfrom(_BUFFER)
                    came.append((sender, data))
        return came

    def send(self, client: Client, data: bytes) -> None:
        """Send a datagram; one that cannot be sent is lost."""
        if isinstance(client, tuple):
            with contextlib.suppress(OSError):
                self._socket.sendto(data, client)

    def newcomers(self) -> list[Client]:
        """Return none: a UDP client is unknown before its first datagram."""
        return []

    def gone(self) -> list[Client]:
        """Return none: UDP clients do not disconnect."""
        return []

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class TcpTransport:
    """One listening TCP socket; a client is identified by its connection's number."""

    datagrams = False

    def __init__(self, place: tuple[str, int]) -> None:
        self._listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listening.bind(place)
            self._listening.listen(_MOST_CONNECTIONS)
            self._listening.setblocking(False)
        except OSError:
            self._listening.close()
            raise
        self.address: tuple[str, int] = self._listening.getsockname()
        self._connections: dict[int, socket.socket] = {}
        self._unsent: dict[int, bytearray] = {}
        self._came: list[Client] = []
        self._left: list[Client] = []
        self._accepted = 0

    def wait(self, waker: socket.socket, timeout_s: float) -> list[tuple[Client, bytes]]:
        """Return the bytes received from each connection; accept new connections, drop closed ones."""
        by_socket = {connection: number for number, connection in self._connections.items()}
        blocked = [self._connections[number] for number, unsent in self._unsent.items() if unsent]
        ready, writable, _ = select.select([self._listening, waker, *by_socket], blocked, [], timeout_s)
        for connection in writable:
            self._flush(by_socket[connection])
        came: list[tuple[Client, bytes]] = []
        for readable in ready:
            if readable is self._listening:
                self._accept()
            elif (number := by_socket.get(readable)) is not None and number in self._connections:
                try:
                    data = readable.recv(_BUFFER)
                except BlockingIOError:
                    continue
                except OSError:
                    data = b""
                if data:
                    came.append((number, data))
                else:
                    self._drop(number)
        return came

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            connection, _ = self._listening.accept()
            if len(self._connections) >= _MOST_CONNECTIONS:
                connection.close()
                return
            connection.setblocking(False)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._accepted += 1
            self._connections[self._accepted] = connection
            self._unsent[self._accepted] = bytearray()
            self._came.append(self._accepted)

    def send(self, client: Client, data: bytes) -> None:
        """Append ``data`` to the client's send buffer; drop a client that reads too slowly."""
        if not isinstance(client, int) or client not in self._connections:
            return
        self._unsent[client] += data
        self._flush(client)
        if len(self._unsent.get(client, b"")) > _UNSENT_LIMIT:
            self._drop(client)

    def _flush(self, number: int) -> None:
        unsent = self._unsent[number]
        try:
            del unsent[: self._connections[number].send(unsent)]
        except BlockingIOError:
            return
        except OSError:
            self._drop(number)

    def _drop(self, number: int) -> None:
        self._connections.pop(number).close()
        del self._unsent[number]
        self._left.append(number)

    def newcomers(self) -> list[Client]:
        """Return the connections that were opened since the last call."""
        came, self._came = self._came, []
        return came

    def gone(self) -> list[Client]:
        """Return the connections that were closed since the last call."""
        left, self._left = self._left, []
        return left

    def close(self) -> None:
        """Close every connection and the listening socket."""
        for connection in self._connections.values():
            connection.close()
        self._listening.close()
