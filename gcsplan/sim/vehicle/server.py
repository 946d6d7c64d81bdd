"""Loopback vehicles on a real socket: `SimServer` for tests and uploads, `serve` for the command line.

    with SimServer([vehicle], "udpin:127.0.0.1:0") as server:
        connect(server.url_for_gcs)

The vehicles run in the server's thread, or with ``process=True`` in a separate process. There they are copies: changes
to them do not show in the objects that were passed in.

Its transports do not block: one for UDP datagrams, one for TCP connections.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Protocol

from gcsplan.errors import LinkError, UsageError
from gcsplan.mavlink.link.url import parse_url
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.sim.vehicle.hub import Client, Hub
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.parameters import lean_parameters

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


_START_WAIT_S = 30.0  # for a process, which must import everything first


class SimServer:
    """One or many vehicles behind one URL.

    ``url``: ``udpin:HOST:PORT`` listens (port 0: any free one), ``udpout:HOST:PORT`` sends first, ``tcpin:HOST:PORT``
    (or ``tcp:``) listens for connections. ``speedup``: factor by which the vehicles' clock and timers run faster than
    real time. Raises UsageError for another URL, LinkError if the port is not available.
    """

    def __init__(
        self, vehicles: Sequence[LoopbackVehicle], url: str, *, speedup: float = 1.0, process: bool = False
    ) -> None:
        if not 0.1 <= speedup <= 1000.0:
            raise UsageError(f"a simulator's clock may run 0.1 … 1000 times as fast as ours, given {speedup}")
        self.vehicles = tuple(vehicles)
        self._speedup = speedup
        self._kind, self._place = _parsed(url)
        self.hub = Hub(self.vehicles, always=self._place if self._kind == "udpout" else None)
        self._in_process = process
        self._child: multiprocessing.process.BaseProcess | None = None
        self._pipe: Connection | None = None
        self._thread: threading.Thread | None = None
        self._loop: _Loop | None = None
        self._address: tuple[str, int] | None = None

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of the server's socket, once started."""
        if self._address is None:
            raise RuntimeError("the simulator has no address before start()")
        return self._address

    @property
    def url_for_gcs(self) -> str:
        """The URL for a ground station on this machine."""
        host, port = self._place if self._kind == "udpout" else self.address
        host = "127.0.0.1" if host in ("0.0.0.0", "::") else host
        return f"{ {'udpin': 'udpout', 'udpout': 'udpin', 'tcpin': 'tcp'}[self._kind] }:{host}:{port}"

    @property
    def mishandled(self) -> int:
        """Number of messages that raised an error because of a bug in the simulator."""
        return self.hub.mishandled

    def start(self) -> SimServer:
        """Open the socket and serve until `stop`; return this server."""
        if self._address is not None:
            raise RuntimeError("the simulator is already running")
        if self._in_process:
            self._start_process()
            return self
        self._loop = _Loop(self.hub, _opened(self._kind, self._place), self._speedup)
        self._address = self._loop.transport.address
        self._thread = threading.Thread(target=self._loop.run, name="gcsplan-sim", daemon=True)
        self._thread.start()
        return self

    def _start_process(self) -> None:
        context = multiprocessing.get_context("spawn")
        pipe, theirs = context.Pipe()
        self._pipe = pipe
        url = f"{self._kind}:{self._place[0]}:{self._place[1]}"
        arguments = (self.vehicles, url, self._speedup, theirs)
        self._child = context.Process(target=_serve_in_child, args=arguments, daemon=True)
        self._child.start()
        theirs.close()
        answer: str | tuple[str, int] = "the simulator's process did not start"
        with contextlib.suppress(EOFError):
            if pipe.poll(_START_WAIT_S):
                answer = pipe.recv()
        if isinstance(answer, str):
            self.stop()
            raise LinkError(answer, where=url)
        self._address = answer

    def stop(self) -> None:
        """Close the socket; takes at most some seconds. May be called twice."""
        if self._loop is not None:
            self._loop.stop()
        if self._thread is not None:
            self._thread.join(5.0)
        if self._pipe is not None:
            self._pipe.close()  # the child stops when its end closes
        if self._child is not None:
            self._child.join(5.0)
            if self._child.is_alive():
                self._child.kill()
                self._child.join(5.0)
            self._child.close()
        self._loop = self._thread = self._pipe = self._child = self._address = None

    def __enter__(self) -> SimServer:
        return self.start()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.stop()


def serve(
    vehicles: Sequence[LoopbackVehicle], listen_url: str, *, on_ready: Callable[[SimServer], None] | None = None
) -> None:
    """Serve until interrupted (Ctrl-C); ``on_ready`` is called when the socket is open. Blocks."""
    with SimServer(vehicles, listen_url) as server, contextlib.suppress(KeyboardInterrupt):
        if on_ready is not None:
            on_ready(server)
        while True:
            time.sleep(3600)


@contextlib.contextmanager
def loopback_fleet(missions: Sequence[Mission]) -> Iterator[str]:
    """Serve a vehicle for each mission on one free port of this machine; yield the URL at which all of them answer."""
    vehicles = [LoopbackVehicle.for_mission(mission, lean_parameters(mission)) for mission in missions]
    with SimServer(vehicles, "udpin:127.0.0.1:0") as server:
        yield server.url_for_gcs


def _serve_in_child(vehicles: Sequence[LoopbackVehicle], url: str, speedup: float, pipe: Connection) -> None:
    try:
        server = SimServer(vehicles, url, speedup=speedup).start()
    except LinkError as error:
        pipe.send(error.message)
        return
    pipe.send(server.address)
    with contextlib.suppress(EOFError, OSError, KeyboardInterrupt):
        pipe.recv()  # nothing is ever sent: wait until the other end closes
    server.stop()


def _parsed(url: str) -> tuple[str, tuple[str, int]]:
    """Return ``udpin``, ``udpout`` or ``tcpin``, and the address; with TCP a vehicle always listens."""
    endpoint = parse_url(url)
    if endpoint.kind == "serial" or ":" in endpoint.host:
        raise UsageError(
            f"a simulator listens on udpin:HOST:PORT or tcpin:HOST:PORT, or speaks to udpout:HOST:PORT; given {url!r}"
        )
    kind = "tcpin" if endpoint.kind == "tcp" else "udpin" if endpoint.listens else "udpout"
    try:
        return kind, (socket.gethostbyname(endpoint.host), endpoint.port)  # numeric, as in a datagram's source address
    except OSError as error:
        raise LinkError(f"there is no host {endpoint.host!r}: {error.strerror or error}", where=url) from error


def _opened(kind: str, place: tuple[str, int]) -> ServerTransport:
    host = place[0]
    try:
        if kind == "tcpin":
            return TcpTransport(place)
        if kind == "udpin":
            return UdpTransport(place)
        return UdpTransport(("127.0.0.1" if host.startswith("127.") else "0.0.0.0", 0))
    except OSError as error:
        raise LinkError(
            f"cannot listen on {host} port {place[1]}: {error.strerror or error}; is another program using it?",
            where=f"{kind}:{host}:{place[1]}",
        ) from error


class _Loop:
    """Waits for bytes and timers, and passes both to the hub."""

    def __init__(self, hub: Hub, transport: ServerTransport, speedup: float) -> None:
        self.hub, self.transport, self._speedup = hub, transport, speedup
        self._wake, self._woken = socket.socketpair()
        self._stopping = False

    def stop(self) -> None:
        self._stopping = True
        with contextlib.suppress(OSError):
            self._wake.send(b"x")

    def _now(self) -> float:
        return time.monotonic() * self._speedup

    def run(self) -> None:
        hub, transport = self.hub, self.transport
        try:
            while not self._stopping:
                for client, data in hub.on_timer(self._now()):
                    transport.send(client, data)
                due = hub.deadline
                wait_s = 1.0 if due is None else max(0.0, due - self._now()) / self._speedup
                for source, data in transport.wait(self._woken, wait_s):
                    for client, answer in hub.take(source, data, self._now(), datagram=transport.datagrams):
                        transport.send(client, answer)
                for client in transport.gone():
                    hub.forget(client)
                for client in transport.newcomers():
                    hub.welcome(client, self._now())
        finally:
            transport.close()
            self._wake.close()
            self._woken.close()
