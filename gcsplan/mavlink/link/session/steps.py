"""The exchanges of a session, as tasks for `link.pump`: find a vehicle, read its parameters, run a protocol machine.

`drive` runs the machine on a channel, subject to `Recheck` and `TransferPatience`; the others lie outside the mission
protocol.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from typing import Protocol

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.errors import LinkError
from gcsplan.mavlink.link.link import Channel, Heard, Link, LinkSteps
from gcsplan.mavlink.link.options import TransferPatience
from gcsplan.mavlink.link.prepared_answers import Prepared
from gcsplan.mavlink.link.session.parameters import decode_value, parameter_name
from gcsplan.mavlink.link.session.recheck import ASK_AGAIN_S, Recheck, request_message
from gcsplan.mavlink.link.watch import STANDBY, UNINIT, VehicleState, Watch
from gcsplan.mavlink.mission.autopilots import PX4, is_generic, version_of
from gcsplan.mavlink.mission.parameter_names import OnBoard
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.machine import CANCELLED_BY_US, TransferProgress
from gcsplan.mavlink.protocol.messages import Address, Item, Packet, Request
from gcsplan.mavlink.protocol.outcome import Outcome, Unknown

_AUTOPILOT_VERSION, _GLOBAL_POSITION_INT, _HOME_POSITION = 148, 33, 242
_WIND, _WIND_COV = 168, 231
_DOES_NOT_EXIST = 1  # MAV_PARAM_ERROR
_MOST_REQUESTS, _MOST_REQUESTS_OF_GENERIC = 4, 2  # a vehicle with a generic autopilot may never report a position
_ASK_AGAIN_MOST_S, _SLOWER = 4.0, 1.5
PARAMETER_S = 2.0
NO_PARAMETERS_S = 1.0
SLOW_ANSWER_S = 6.0
"""Patience with parameters that are reported but decide nothing: several round trips of a slow link."""

CAPABILITIES_S = 4.5
"""Patience with a vehicle's first answer: two round trips of a slow link."""


def discover_steps(
    channel: Channel, watch: Watch, *, timeout_s: float, listen_s: float, standby_s: float = 0.0
) -> LinkSteps[VehicleState]:
    """Wait for an autopilot's heartbeat, request its capabilities and position, and listen for rivals.

    ``listen_s``: seconds to listen after the first heartbeat (heartbeats come once a second). ``standby_s``: seconds to
    wait for a vehicle that is still booting. Raises LinkError after ``timeout_s`` without a heartbeat.
    """
    clock = channel.link.clock
    started = clock()
    while (state := watch.state(clock())) is None:
        if clock() >= started + timeout_s:
            raise dead_link(channel.link, channel.sysid, timeout_s)
        yield started + timeout_s
        _note(channel, watch)
    found, requested, ask_at = clock(), 0, clock()
    first_at = answered_at = math.inf
    while True:
        now = clock()
        state = watch.state(now) or state
        if state.capabilities is not None and answered_at == math.inf:
            answered_at = now
            ask_at = now + ASK_AGAIN_S if requested else ask_at  # the other answers are on their way
        times = _MOST_REQUESTS_OF_GENERIC if is_generic(state.mav_autopilot) else _MOST_REQUESTS
        complete = state.capabilities is not None and state.located
        if _is_booting(state) and now < found + standby_s:
            yield now + ASK_AGAIN_S
        elif not complete and now >= ask_at and requested < times:
            _ask(channel, state)
            first_at = min(first_at, now)
            requested, ask_at = requested + 1, now + ASK_AGAIN_S
            if requested == times and state.capabilities is None and not is_generic(state.mav_autopilot):
                ask_at = max(ask_at, first_at + CAPABILITIES_S)
        elif not complete and now < ask_at:
            yield ask_at
        elif now < found + listen_s:
            yield found + listen_s
        else:
            known = requested and answered_at < math.inf
            return replace(state, round_trip_s=answered_at - first_at if known else 0.0)
        _note(channel, watch)


def parameter_steps(
    channel: Channel,
    state: VehicleState,
    groups: tuple[tuple[str, ...], ...],
    watch: Watch,
    recheck: Recheck | None = None,
    *,
    needed: Collection[tuple[str, ...]] = (),
    most_s: float = 0.0,
) -> LinkSteps[OnBoard]:
    """Return the values of the parameters that the vehicle has, and the names that it says it does not have.

    A value that is not a number is NaN. A vehicle has one name of each of ``groups``. The step takes at most 2 s and a
    round trip after the last answer, or 1 s and a round trip if none arrives; but it requests the groups that are
    ``needed`` until ``most_s``, unless the vehicle does not say what it is. A name without an answer is in neither
    result: `parameter_names.unanswered`.
    """
    clock = channel.link.clock
    generic = is_generic(state.mav_autopilot)
    values = OnBoard(generic=generic, version=version_of(state.flight_sw_version))
    unknown: set[str] = set()  # names that the vehicle reported as missing
    started = ask_at = answered_at = clock()
    again_s = ASK_AGAIN_S

    def missing(of: Iterable[tuple[str, ...]]) -> list[str]:
        left = [
            name
            for group in of
            if not any(n in values for n in group) and not values.too_old_for(group)
            for name in group
        ]
        return [name for name in left if name not in unknown]

    def waited_for() -> list[str]:
        return missing(group for group in needed if not values.lacks(group))

    def until() -> float:
        patience_s = state.round_trip_s + (PARAMETER_S if values or unknown else NO_PARAMETERS_S)
        return max(answered_at + patience_s, started + most_s if waited_for() and not generic else started)

    for name in (name for group in groups if values.too_old_for(group) for name in group):
        _ask_parameter(channel, state.address, name)  # once: an early version may have it
    while missing(groups):
        now = clock()
        if now >= until():
            break
        if now >= ask_at:
            late = now >= answered_at + PARAMETER_S
            for name in (late and waited_for()) or missing(groups):
                _ask_parameter(channel, state.address, name)
            ask_at, again_s = now + again_s, min(_ASK_AGAIN_MOST_S, (_SLOWER if late else 1.0) * again_s)
        yield min(ask_at, until())
        for heard in channel.take():
            (recheck or watch).note(heard, clock())
            ours = not heard.late and heard.source == state.address and channel.peer in (None, heard.peer)
            kind = heard.message.get_type() if ours else ""
            if kind == "PARAM_VALUE":
                name = parameter_name(heard.message)
                if any(name in group for group in groups):
                    answered_at = answered_at if name in values else clock()
                    values[name] = decode_value(heard.message, state.mav_autopilot)
            elif kind == "PARAM_ERROR" and heard.message.error == _DOES_NOT_EXIST:
                name = parameter_name(heard.message)
                answered_at = answered_at if name in unknown else clock()
                unknown.add(name)
                values.absent = frozenset(unknown)
    return values


def ask_wind(channel: Channel, state: VehicleState) -> None:
    """Request the vehicle's estimate of the wind, in the message that its autopilot has for it."""
    channel.send(request_message(state.address, _WIND_COV if state.mav_autopilot == PX4 else _WIND), state.address)


def wind_steps(channel: Channel, state: VehicleState, recheck: Recheck, until: float) -> LinkSteps[VehicleState]:
    """Return what the vehicle reports, with its estimate of the wind if that arrives before ``until``."""
    clock = channel.link.clock
    ask_at = clock() + ASK_AGAIN_S
    while (now := clock()) < until and (recheck.watch.state(now) or state).wind is None:
        if now >= ask_at:
            ask_wind(channel, state)
            ask_at = now + ASK_AGAIN_S
        yield min(ask_at, until)
        for heard in channel.take():
            recheck.note(heard, clock())
    return recheck.watch.state(clock()) or state


def dead_link(link: Link, sysid: int, timeout_s: float) -> LinkError:
    """Return the error for a link without the vehicle's heartbeat, with likely causes and what to try."""
    others = sorted(s for s in link.heard_systems if s != sysid)
    hints = []
    if others:
        hints.append(f"systems heard there: {', '.join(map(str, others))}")
    if link.unsigned:
        hints.append(f"{link.unsigned} frames had no valid signature: is the signing key the right one?")
    elif link.garbage:
        hints.append(f"{link.garbage} frames did not check: is it MAVLink, is the baud rate right?")
    if not others:
        hints.append(f"is the vehicle on, and is {link.endpoint.other_direction()} meant?")
    sends = link.endpoint.kind == "udp" and not link.endpoint.listens
    if sends and not others:
        hints.append(
            "PX4 answers only the address and port that it heard first after it booted: if that was another program, "
            "restart the vehicle, or send from that program's port (udpout:HOST:PORT,LOCAL)"
        )
    if link.note:
        hints.append(str(link.note))
    how = link.endpoint.understood() + (f" from port {link.place.rsplit(':', 1)[-1]}" if sends else "")
    return LinkError(
        f"no heartbeat of system {sysid} within {timeout_s:g} s ({how}); {'; '.join(hints)}",
        where=link.url,
        reason="no_heartbeat",
    )


def _note(channel: Channel, watch: Watch) -> None:
    now = channel.link.clock()
    for heard in channel.take():
        watch.note(heard, now)


def _is_booting(state: VehicleState) -> bool:
    if state.system_status == UNINIT and is_generic(state.mav_autopilot):
        return False  # it does not report its state
    return state.system_status < STANDBY


def _ask(channel: Channel, state: VehicleState) -> None:
    to = state.address
    needed = {
        _AUTOPILOT_VERSION: state.capabilities is None,
        _GLOBAL_POSITION_INT: not state.located,
        _HOME_POSITION: state.home is None,
    }
    for kind in (kind for kind, lacking in needed.items() if lacking):
        channel.send(request_message(to, kind), to)


def _ask_parameter(channel: Channel, to: Address, name: str) -> None:
    channel.send(dialect.MAVLink_param_request_read_message(*to, name.encode(), -1), to)


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
    patience: TransferPatience | None = None,
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
            if prepared.requested:
                machine.answered(prepared.requested, clock())
                prepared.requested.clear()
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


def _next(machine: Driven, recheck: Recheck | None, patience: TransferPatience | None) -> float:
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


def _ended_early(machine: Driven, channel: Channel, recheck: Recheck | None, patience: TransferPatience | None) -> bool:
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
