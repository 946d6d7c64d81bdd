"""A bad link in simulated time: packets between a machine and a vehicle are lost, duplicated, delayed and reordered.

All randomness comes from one seed; nothing sleeps. Both ends need ``receive(packet, now)``, ``deadline`` and
``on_timer(now)``; the machine also needs ``start(now)``.
"""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from gcsplan.mavlink.protocol.messages import Packet


@dataclass(frozen=True)
class Weather:
    """Probabilities for each packet in either direction; delays in seconds. Later packets overtake held-up ones."""

    loss: float = 0.0
    duplicate: float = 0.0
    held_up: float = 0.0
    delay_s: float = 0.02
    jitter_s: float = 0.02
    hold_s: float = 0.4


class End(Protocol):
    """One end of the link."""

    @property
    def deadline(self) -> float | None: ...

    def receive(self, packet: Packet, now: float) -> list[Packet]: ...

    def on_timer(self, now: float) -> list[Packet]: ...


class Machine(End, Protocol):
    """The end that starts the exchange."""

    def start(self, now: float) -> list[Packet]: ...


class Hang(AssertionError):
    """Simulated time ran out."""


def run(
    machine: Machine,
    vehicle: End,
    weather: Weather,
    seed: int,
    ended: Callable[[], bool],
    *,
    limit_s: float = 3600.0,
    start_s: float = 100.0,
    watch: Callable[[Packet, float], None] | None = None,
) -> float:
    """Run ``machine`` against ``vehicle`` until ``ended()``; return the simulated seconds. Raises Hang."""
    rng = random.Random(seed)
    queue: list[tuple[float, int, End, Packet]] = []
    number = 0

    def send(packets: list[Packet], to: End, now: float) -> None:
        nonlocal number
        for packet in packets:
            if watch:
                watch(packet, now)
            copies = 1 + (rng.random() < weather.duplicate)
            for _ in range(copies):
                if rng.random() < weather.loss:
                    continue
                late = weather.delay_s + rng.random() * weather.jitter_s
                if rng.random() < weather.held_up:
                    late += rng.random() * weather.hold_s
                number += 1
                heapq.heappush(queue, (now + late, number, to, packet))

    now = start_s
    send(machine.start(now), vehicle, now)
    while not ended():
        due = [at for at in (machine.deadline, vehicle.deadline, queue[0][0] if queue else None) if at is not None]
        if not due or min(due) > start_s + limit_s:
            raise Hang(f"seed {seed}, {weather}: nothing ended within {limit_s} s")
        now = max(now, min(due))
        if queue and queue[0][0] <= now:
            _, _, to, packet = heapq.heappop(queue)
            send(to.receive(packet, now), machine if to is vehicle else vehicle, now)
        if machine.deadline is not None and machine.deadline <= now:
            send(machine.on_timer(now), vehicle, now)
        if vehicle.deadline is not None and vehicle.deadline <= now:
            send(vehicle.on_timer(now), machine, now)
    return now - start_s
