"""A protocol machine on a channel: `drive` is the task that runs it, under the eyes of `Recheck` and `Patience`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

from gcsplan.mavlink.link.link import Channel, Heard, Steps
from gcsplan.mavlink.link.prompt import Prepared
from gcsplan.mavlink.link.recheck import Recheck
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.machine import CANCELLED_BY_US, Progress
from gcsplan.mavlink.protocol.messages import Address, Item, Packet, Request
from gcsplan.mavlink.protocol.outcome import Outcome, Unknown
from gcsplan.mavlink.protocol.patience import Patience


class Driven(Protocol):
    """A sans-IO machine as `drive` needs it."""

    vehicle: Address

    @property
    def answers(self) -> Sequence[Item]:
        """What a request gets, by seq, at any time between `start` and `cancel`."""
        ...

    def answered(self, seqs: Iterable[int], now: float) -> None:
        """Take note of requests that got their answer already."""
        ...

    @property
    def deadline(self) -> float | None:
        """When `on_timer` is due; None once it has ended."""
        ...

    def start(self, now: float) -> list[Packet]:
        """Begin."""
        ...

    def receive(self, packet: Packet, now: float) -> list[Packet]:
        """Take a packet in."""
        ...

    def on_timer(self, now: float) -> list[Packet]:
        """Do what is due."""
        ...

    @property
    def mark(self) -> tuple[int, ...]:
        """How far it has come; it grows with every step forward."""
        ...

    @property
    def progress(self) -> Progress:
        """Items done so far."""
        ...

    def cancel(self, now: float, why: str = ...) -> list[Packet]:
        """End early, with a word to the vehicle."""
        ...

    def stop(self, outcome: Outcome) -> None:
        """End early, without one."""
        ...


def drive(
    machine: Driven,
    channel: Channel,
    *,
    recheck: Recheck | None = None,
    patience: Patience | None = None,
    progress: Callable[[], None] | None = None,
) -> Steps[None]:
    """The task that runs ``machine`` to its end; it is cancelled if the task is closed before (Ctrl-C).

    ``recheck`` says which messages count and when the vehicle is no longer the one to write to, ``patience`` when it
    has taken too long.
    """
    clock, prompt = channel.link.clock, channel.link.prompt
    channel.prepared = prepared = prompt.prepare(machine.answers, machine.vehicle)
    channel.send_packets(machine.start(clock()))
    try:
        while machine.deadline is not None:
            yield _next(machine, recheck, patience)
            if prepared.asked:
                machine.answered(prepared.asked, clock())
                prepared.asked.clear()
                if recheck:
                    recheck.contact(clock())
            for heard in channel.take():
                _take(machine, channel, prepared, heard, recheck)
            if _ended_early(machine, channel, recheck, patience):
                return
            if recheck and recheck.wary:
                prompt.drop(prepared)
            channel.send_packets(machine.on_timer(clock()))
            if progress:
                progress()
    finally:
        prompt.drop(prepared)
        channel.prepared = None
        if machine.deadline is not None:
            _give_up(machine, channel, recheck, CANCELLED_BY_US)


def _next(machine: Driven, recheck: Recheck | None, patience: Patience | None) -> float:
    due = [one.deadline for one in (machine, recheck, patience) if one is not None]
    return min(at for at in due if at is not None)


def _take(machine: Driven, channel: Channel, prepared: Prepared, heard: Heard, recheck: Recheck | None) -> None:
    now = channel.link.clock()
    if recheck:
        recheck.note(heard, now)
    packet = None if heard.late else wire.decode(heard.message)
    if packet is None or (recheck and not recheck.admits(heard, packet.message, now)):
        return
    answers = machine.receive(packet, now)
    channel.send_packets(answers)
    if answers and isinstance(packet.message, Request) and not (recheck and recheck.wary):
        channel.link.prompt.learn(prepared, heard.peer, heard.message)


def _ended_early(machine: Driven, channel: Channel, recheck: Recheck | None, patience: Patience | None) -> bool:
    if machine.deadline is None:
        return False
    now = channel.link.clock()
    outcome = recheck.stops(now) if recheck else None
    if outcome is not None:
        machine.stop(outcome)
        return True
    why = patience.over(machine.mark, machine.progress.total, now) if patience else None
    if why is not None:
        _give_up(machine, channel, recheck, why)
        return True
    return False


def _give_up(machine: Driven, channel: Channel, recheck: Recheck | None, why: str) -> None:
    """End ``machine``, with a word to the vehicle unless it has fallen silent: another one may stand there now."""
    if recheck and recheck.shut:
        machine.stop(Unknown(why))
    else:
        channel.send_packets(machine.cancel(channel.link.clock(), why))
