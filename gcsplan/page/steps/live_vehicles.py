"""What vehicles report while the page is connected: listened to, and nothing is written to them.

A link that listens sends no heartbeat, so that no failsafe of a vehicle begins to count on this page; one that must
speak first sends those of another ground station than uploads do. Only reports that do not come by themselves are
requested.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack

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
_POSITION = 33

Reported = Callable[[str, VehicleState | None, float], None]
"""Called with a vehicle's name, what it reports, None before its first heartbeat, and the seconds since that one."""


def listen_to(seats: Mapping[str, tuple[str, int]], reported: Reported) -> None:
    """Listen to vehicles by name, each at a URL with a system id, until this is cancelled. Raises LinkError."""
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
            jobs.append(PumpJob(channel, _followed(channel, name, reported)))
        pump(jobs)
        for job in jobs:
            if job.error is not None:
                raise job.error


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
