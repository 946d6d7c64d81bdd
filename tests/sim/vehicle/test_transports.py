"""The simulator's transports: datagrams and connections, neither of which blocks."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Iterator

import pytest

from gcsplan.sim.vehicle.hub import Client
from gcsplan.sim.vehicle.server import ServerTransport, TcpTransport, UdpTransport

HERE = ("127.0.0.1", 0)
MOST_CONNECTIONS = 16


@contextlib.contextmanager
def closing(transport: ServerTransport) -> Iterator[ServerTransport]:
    try:
        yield transport
    finally:
        transport.close()


@pytest.fixture
def waker() -> Iterator[socket.socket]:
    one, other = socket.socketpair()
    with one, other:
        yield other


def heard(transport: ServerTransport, waker: socket.socket, count: int = 1) -> list[tuple[Client, bytes]]:
    """What comes within a second, until it is ``count`` pieces."""
    came: list[tuple[Client, bytes]] = []
    end = time.monotonic() + 1.0
    while len(came) < count and time.monotonic() < end:
        came += transport.wait(waker, 0.05)
    return came


def test_a_datagram_comes_with_its_sender_and_the_answer_goes_there(waker: socket.socket) -> None:
    with closing(UdpTransport(HERE)) as server, closing(UdpTransport(HERE)) as station:
        station.send(server.address, b"hello")
        assert heard(server, waker) == [(station.address, b"hello")]
        server.send(station.address, b"here")
        assert heard(station, waker) == [(server.address, b"here")]
        assert server.datagrams
        assert (server.newcomers(), server.gone()) == ([], [])


def test_a_datagram_to_nobody_is_lost_and_the_next_one_is_read(waker: socket.socket) -> None:
    with closing(UdpTransport(HERE)) as server, closing(UdpTransport(HERE)) as station:
        with closing(UdpTransport(HERE)) as closed:
            nobody = closed.address
        server.send(nobody, b"lost")  # the answer is an ICMP error at the next read
        server.send(3, b"a number is the client of a connection")
        station.send(server.address, b"still there?")
        assert heard(server, waker)[-1:] == [(station.address, b"still there?")]


def test_a_connection_is_a_client_until_it_closes(waker: socket.socket) -> None:
    with closing(TcpTransport(HERE)) as server:
        with socket.create_connection(server.address) as station:
            station.sendall(b"hello")
            assert heard(server, waker) == [(1, b"hello")]
            assert server.newcomers() == [1]
            assert server.newcomers() == []
            server.send(1, b"here")
            assert station.recv(9) == b"here"
        assert heard(server, waker) == []
        assert server.gone() == [1]
        server.send(1, b"nobody is there")
        assert not server.datagrams


def test_a_client_that_reads_nothing_is_dropped(waker: socket.socket) -> None:
    with closing(TcpTransport(HERE)) as server, socket.create_connection(server.address) as station:
        station.sendall(b"hello")
        assert heard(server, waker) == [(1, b"hello")]
        sent = 0
        while not (gone := server.gone()) and sent < 64 << 20:
            server.send(1, bytes(1 << 18))
            sent += 1 << 18
        assert gone == [1]
        assert 1 << 20 < sent < 64 << 20


def test_connections_beyond_the_most_are_closed_at_once(waker: socket.socket) -> None:
    with closing(TcpTransport(HERE)) as server, contextlib.ExitStack() as stack:
        stations = []
        for _ in range(MOST_CONNECTIONS + 1):
            stations.append(stack.enter_context(socket.create_connection(server.address)))
            heard(server, waker, 0)
            server.wait(waker, 1.0)
        assert len(server.newcomers()) == MOST_CONNECTIONS
        stations[-1].settimeout(1.0)
        assert stations[-1].recv(1) == b""
