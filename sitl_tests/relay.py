"""A bad radio as a UDP relay: datagrams in both directions are lost, duplicated and held up, by a seed."""

from __future__ import annotations

import heapq
import random
import select
import socket
import threading
import time
from types import TracebackType

_MOST_WAITING = 10_000
_MOST_CLIENTS = 16


class LossyRelay:
    """Relays between ground stations, which send to `address`, and the vehicle at ``target``; both on 127.0.0.1.

    ``loss``, ``duplicate``, ``held_up``: probabilities for each datagram and direction; a held-up datagram waits up to
    ``hold_s``, and others overtake it. The seed and the order of arrival decide which datagrams are affected.
    """

    def __init__(
        self,
        target: tuple[str, int],
        *,
        loss: float = 0.0,
        duplicate: float = 0.0,
        held_up: float = 0.0,
        hold_s: float = 0.1,
        seed: int = 0,
    ) -> None:
        self._target = target
        self._loss, self._duplicate, self._held_up, self._hold_s = loss, duplicate, held_up, hold_s
        self._rng = random.Random(seed)
        self._front = self._bound()
        self.address: tuple[str, int] = self._front.getsockname()
        self._backs: dict[tuple[str, int], socket.socket] = {}  # one per ground station, to return answers to it
        self._waiting: list[tuple[float, int, socket.socket, tuple[str, int], bytes]] = []
        self._wake, self._woken = socket.socketpair()
        self._thread = threading.Thread(target=self._run, name="lossy-relay", daemon=True)
        self.passed = self.lost = self.doubled = 0

    @staticmethod
    def _bound() -> socket.socket:
        one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        one.bind(("127.0.0.1", 0))
        one.setblocking(False)
        return one

    @property
    def url(self) -> str:
        """The URL that a ground station connects to."""
        return f"udpout:127.0.0.1:{self.address[1]}"

    def __enter__(self) -> LossyRelay:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._wake.send(b"x")
        self._thread.join(5.0)
        for one in (self._front, *self._backs.values(), self._wake, self._woken):
            one.close()

    def _run(self) -> None:
        while True:
            now = time.monotonic()
            while self._waiting and self._waiting[0][0] <= now:
                _, _, out, to, data = heapq.heappop(self._waiting)
                self._send(out, to, data)
            wait_s = max(0.0, self._waiting[0][0] - now) if self._waiting else 1.0
            stations = {back: station for station, back in self._backs.items()}
            ready, _, _ = select.select([self._front, self._woken, *stations], [], [], wait_s)
            if self._woken in ready:
                return
            for one in ready:
                self._read(one, stations.get(one))

    def _read(self, one: socket.socket, station: tuple[str, int] | None) -> None:
        for _ in range(64):
            try:
                data, sender = one.recvfrom(65536)
            except OSError:
                return
            if station is not None:
                self._pass_on(self._front, station, data)
            elif (back := self._back(sender)) is not None:
                self._pass_on(back, self._target, data)

    def _back(self, station: tuple[str, int]) -> socket.socket | None:
        if station not in self._backs and len(self._backs) < _MOST_CLIENTS:
            self._backs[station] = self._bound()
        return self._backs.get(station)

    def _pass_on(self, out: socket.socket, to: tuple[str, int], data: bytes) -> None:
        if self._rng.random() < self._loss:
            self.lost += 1
            return
        copies = 2 if self._rng.random() < self._duplicate else 1
        self.passed += 1
        self.doubled += copies - 1
        for _ in range(copies):
            if self._rng.random() < self._held_up and len(self._waiting) < _MOST_WAITING:
                due = time.monotonic() + self._rng.uniform(0.0, self._hold_s)
                heapq.heappush(self._waiting, (due, self.passed, out, to, data))
            else:
                self._send(out, to, data)

    @staticmethod
    def _send(out: socket.socket, to: tuple[str, int], data: bytes) -> None:
        try:
            out.sendto(data, to)
        except OSError:
            return  # counts as a lost datagram
