"""What vehicles report while the page is connected: listened to, and nothing is written to them.

A link that listens sends no heartbeat, so that no failsafe of a vehicle begins to count on this page; one that must
speak first sends those of another ground station than uploads do. Only reports that do not come by themselves are
requested.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial

from gcsplan.mavlink.link.frames import signing_key
from gcsplan.mavlink.link.link import Channel, Link, LinkSteps, PumpJob, pump
from gcsplan.mavlink.link.session.recheck import request_message
from gcsplan.mavlink.link.session.steps import ask_wind
from gcsplan.mavlink.link.url import parse_url
from gcsplan.mavlink.link.watch import FRESH_S, VehicleState, Watch
from gcsplan.mavlink.protocol.messages import Address

WATCHER = Address(254, 190)
"""Our ids while we listen: ArduPilot's failsafe for a lost ground station counts the heartbeats of its own one, 255."""

REPORT_S, REQUEST_S, WIND_REQUEST_S = 0.5, 2.0, 10.0
ANYONE = 0
"""The system id of a seat for all vehicles that are heard there."""

MOST_STRANGERS = 32
"""Most vehicles that are followed at such a seat: the first that are heard."""

_POSITION = 33

Reported = Callable[[str, VehicleState | None, float], None]
"""Called with a vehicle's name, what it reports, None before its first heartbeat, and the seconds since that one."""


def listen_to(seats: Mapping[str, tuple[str, int]], reported: Reported) -> None:
    """Listen to vehicles by name, each at a URL with a system id, until this is cancelled. Raises LinkError.

    At a seat of `ANYONE` all are reported that have sent a heartbeat, each by its `name_of_stranger`.
    """
    with ExitStack() as stack:
        links: dict[str, Link] = {}
        for url in dict.fromkeys(url for url, _ in seats.values()):
            end = parse_url(url)
            speaks_first = end.kind == "udp" and not end.listens
            links[url] = stack.enter_context(
                Link(end, us=WATCHER, key=signing_key(), heartbeat_s=1.0 if speaks_first else None)
            )
        jobs = []
        for name, (url, sysid) in seats.items():
            channel = links[url].channel(sysid)
            steps = _all_heard(channel.link, reported) if sysid == ANYONE else _followed(channel, name, reported)
            jobs.append(PumpJob(channel, steps))
        pump(jobs)
        for job in jobs:
            if job.error is not None:
                raise job.error


def name_of_stranger(sysid: int) -> str:
    """What a vehicle is called that the mission does not name."""
    return f"vehicle {sysid}"


def _all_heard(link: Link, reported: Reported) -> LinkSteps[None]:
    """Follow every system that is heard on a link; ground stations and cameras among them report no state."""

    def known(name: str, state: VehicleState | None, age_s: float) -> None:
        if state is not None:
            reported(name, state, age_s)

    followed: set[int] = set()
    while True:
        for sysid in sorted(link.heard_systems.keys() - followed)[: MOST_STRANGERS - len(followed)]:
            followed.add(sysid)
            link.serve(sysid, partial(_followed, name=name_of_stranger(sysid), reported=known))
        yield link.clock() + REPORT_S


def _followed(channel: Channel, name: str, reported: Reported) -> LinkSteps[None]:
    clock, watch = channel.link.clock, Watch(channel.sysid)
    report_at = ask_at = wind_at = clock()
    while True:
        now = clock()
        for heard in channel.take():
            watch.note(heard, now)
        state = watch.state(now)
        if state is not None and now >= ask_at and now - state.placed_at > REQUEST_S:
            channel.send(request_message(state.address, _POSITION), state.address)
            ask_at = now + REQUEST_S
        if state is not None and now >= wind_at:
            ask_wind(channel, state)
            wind_at = now + WIND_REQUEST_S
        if now >= report_at:
            reported(name, state, 0.0 if state is None else max(now - max(state.beat_at, state.placed_at), 0.0))
            report_at = now + REPORT_S
        yield report_at


def is_silent(age_s: float) -> bool:
    """Whether a vehicle that was heard so long ago counts as silent."""
    return age_s > FRESH_S
