"""`drive`: the task that runs a protocol machine on a channel, subject to `Recheck` and `Patience`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

from gcsplan.mavlink.link.link import Channel, Heard, LinkSteps
from gcsplan.mavlink.link.prepared_answers import Prepared
from gcsplan.mavlink.link.session.recheck import Recheck
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.machine import CANCELLED_BY_US, TransferProgress
from gcsplan.mavlink.protocol.messages import Address, Item, Packet, Request
from gcsplan.mavlink.protocol.outcome import Outcome, Unknown
from gcsplan.mavlink.protocol.patience import Patience


class Driven(Protocol):
    """The interface of a protocol machine that `drive` needs."""

    vehicle: Address

    @property
    def answers(self) -> Sequence[Item]:
        """The item that answers a request, by seq, at any time between `start` and `cancel`."""
        ...

    def answered(self, seqs: Iterable[int], now: float) -> None:
        """Record requests for ``seqs`` that were already answered."""
        ...

    @property
    def deadline(self) -> float | None:
        """The next time to call `on_timer`; None once it has ended."""
        ...

    def start(self, now: float) -> list[Packet]:
        """Start and return the first packets."""
        ...

    def receive(self, packet: Packet, now: float) -> list[Packet]:
        """Process a packet and return the answers."""
        ...

    def on_timer(self, now: float) -> list[Packet]:
        """Return the packets that are due at ``now``."""
        ...

    @property
    def mark(self) -> tuple[int, ...]:
        """A measure of progress, which grows with every step."""
        ...

    @property
    def progress(self) -> TransferProgress:
        """Items transferred so far."""
        ...

    def cancel(self, now: float, why: str = ...) -> list[Packet]:
        """End early and notify the vehicle."""
        ...

    def stop(self, outcome: Outcome) -> None:
        """End early without notifying the vehicle."""
        ...


def drive(
    machine: Driven,
    channel: Channel,
    *,
    recheck: Recheck | None = None,
    patience: Patience | None = None,
    progress: Callable[[], None] | None = None,
) -> LinkSteps[None]:
    """Run ``machine`` to its end, as a task; if the task is closed before (Ctrl-C), cancel the machine.

    ``recheck`` decides which messages count and whether the vehicle is still the right one; ``patience`` decides when
    the transfer has taken too long.
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
    """End ``machine`` and notify the vehicle, unless it has fallen silent: the link may lead to another one now."""
    if recheck and recheck.shut:
        machine.stop(Unknown(why))
    else:
        channel.send_packets(machine.cancel(channel.link.clock(), why))
