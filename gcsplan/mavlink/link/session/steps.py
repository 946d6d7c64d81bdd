"""Exchanges outside the mission protocol, as tasks for `link.pump`: find a vehicle, read its parameters."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.errors import LinkError
from gcsplan.mavlink.link.link import Channel, Link, LinkSteps
from gcsplan.mavlink.link.session.parameters import decode_value, parameter_name
from gcsplan.mavlink.link.session.recheck import Recheck, request_message
from gcsplan.mavlink.link.watch import STANDBY, UNINIT, VehicleState, Watch
from gcsplan.mavlink.mission.autopilots import is_generic
from gcsplan.mavlink.mission.firmware import version_of
from gcsplan.mavlink.mission.parameter_names import OnBoard
from gcsplan.mavlink.protocol.messages import Address

_AUTOPILOT_VERSION, _GLOBAL_POSITION_INT, _HOME_POSITION = 148, 33, 242
_DOES_NOT_EXIST = 1  # MAV_PARAM_ERROR
_ASK_AGAIN_S = 0.5
_ASKED_TIMES, _GENERIC_ASKED_TIMES = 4, 2  # a vehicle that reports a generic autopilot may never report a position
_ASK_AGAIN_MOST_S, _SLOWER = 4.0, 1.5
_PARAMETER_S = 2.0
_NO_PARAMETERS_S = 1.0
SLOW_ANSWER_S = 6.0
"""Patience with parameters that are told and do not decide: several round trips of a slow link."""


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
    found, asked, ask_at = clock(), 0, clock()
    while True:
        now = clock()
        state = watch.state(now) or state
        times = _GENERIC_ASKED_TIMES if is_generic(state.mav_autopilot) else _ASKED_TIMES
        complete = state.capabilities is not None and state.located
        if _is_booting(state) and now < found + standby_s:
            yield now + _ASK_AGAIN_S
        elif not complete and now >= ask_at and asked < times:
            _ask(channel, state)
            asked, ask_at = asked + 1, now + _ASK_AGAIN_S
        elif not complete and now < ask_at:
            yield ask_at
        elif now < found + listen_s:
            yield found + listen_s
        else:
            return state
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
    """Return the values of those parameters that the vehicle has, and the names that it says it does not have.

    A value that is not a number is NaN. Of each of ``groups`` it has one name. It takes at most 2 s after the last
    answer, or 1 s if none arrives; but the groups that are ``needed`` are asked for until ``most_s``, unless the
    vehicle does not say what it is. What is then still without an answer is in neither: `parameter_names.unanswered`.
    """
    clock = channel.link.clock
    generic = is_generic(state.mav_autopilot)
    values = OnBoard(generic=generic, version=version_of(state.flight_sw_version))
    unknown: set[str] = set()  # names that the vehicle reported as missing
    started = ask_at = answered_at = clock()
    again_s = _ASK_AGAIN_S

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
        patience_s = _PARAMETER_S if values or unknown else _NO_PARAMETERS_S
        return max(answered_at + patience_s, started + most_s if waited_for() and not generic else started)

    for name in (name for group in groups if values.too_old_for(group) for name in group):
        _ask_parameter(channel, state.address, name)  # once: an early version may have it
    while missing(groups):
        now = clock()
        if now >= until():
            break
        if now >= ask_at:
            late = now >= answered_at + _PARAMETER_S
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
    wanted = {
        _AUTOPILOT_VERSION: state.capabilities is None,
        _GLOBAL_POSITION_INT: not state.located,
        _HOME_POSITION: state.home is None,
    }
    for kind in (kind for kind, lacking in wanted.items() if lacking):
        channel.send(request_message(to, kind), to)


def _ask_parameter(channel: Channel, to: Address, name: str) -> None:
    channel.send(dialect.MAVLink_param_request_read_message(*to, name.encode(), -1), to)
