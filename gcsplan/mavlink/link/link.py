"""A link: one socket or serial port, the vehicles behind it, and the clock that all tasks use.

Frames are routed by (system id, component id). A system is answered at the address where it was last heard, or at the
address that its channel has pinned. `pump` runs any number of tasks on any number of links in one thread, so a fleet
takes as long as its slowest vehicle. A task is a generator that yields the time until which it may sleep; a message
from its vehicle wakes it earlier. An error in one task ends only that task.
"""

from __future__ import annotations

import logging
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import pymavlink.dialects.v20.ardupilotmega as dialect

from gcsplan.errors import GcsplanError, heed_cancel
from gcsplan.mavlink.link.frames import FrameParser, FrameWriter, Signing, SigningKey
from gcsplan.mavlink.link.prepared_answers import Prepared, PromptAnswers
from gcsplan.mavlink.link.transport import LinkClock, Peer, Transport, Udp, open_transport, wait_readable
from gcsplan.mavlink.link.url import Endpoint, parse_url
from gcsplan.mavlink.protocol import wire
from gcsplan.mavlink.protocol.messages import Address, Packet
from gcsplan.notes.note import Note

_log = logging.getLogger(__name__)
T = TypeVar("T")
LinkSteps = Generator[float, None, T]

GCS = Address(255, 190)
"""System and component id that ground stations use (MAV_COMP_ID_MISSIONPLANNER)."""

_MOST_PEERS = 260  # one per system id, and some strangers
_MOST_WAITING = 4096
_FORGET_S = 10.0
_IDLE_S = 0.1  # longest time between updates of machines (about prompt answers) and of progress


@dataclass(frozen=True, slots=True)
class Heard:
    """One received message: the sender's ids and address, and the pymavlink message itself.

    ``late``: correctly signed but not newer than earlier messages. It cannot confirm anything, but it may show that
    there is a second vehicle.
    """

    source: Address
    peer: Peer
    message: Any
    late: bool = False


class Channel:
    """The messages of one system on a link: a bounded inbox, and methods to answer.

    Requests that were answered promptly are not in the inbox; their seqs are in ``prepared.requested``.
    """

    def __init__(self, link: Link, sysid: int) -> None:
        self.link = link
        self.sysid = sysid
        self.inbox: deque[Heard] = deque(maxlen=_MOST_WAITING)
        self.prepared: Prepared | None = None
        self.peer: Peer | None = None

    def pin(self, peer: Peer | None) -> None:
        """Send only to ``peer`` from now on, even if others use the same system id."""
        self.peer = peer

    @property
    def waits(self) -> bool:
        """Whether there are messages in the inbox, or promptly answered requests to record."""
        return bool(self.inbox or (self.prepared and self.prepared.requested))

    def take(self) -> Iterable[Heard]:
        """Yield and remove the messages in the inbox."""
        while self.inbox:
            yield self.inbox.popleft()

    def send(self, message: Any, to: Address) -> bool:
        """Send a pymavlink message; False if the address of ``to`` is unknown."""
        return self.link.send(message, to) if self.peer is None else self.link.send(message, to, self.peer)

    def send_packets(self, packets: Iterable[Packet]) -> None:
        """Send mission messages."""
        for packet in packets:
            self.send(wire.encode(packet.message, packet.target), packet.target)


class Link:
    """An open link. Use it as a context manager, or `close` it.

    ``us``: our own ids. ``key``: sign every frame and drop unsigned ones. ``heartbeat_s``: interval of our
    ground-station heartbeat, None for no heartbeat. ``clock``, ``transport``, ``wait`` and ``signing`` can be replaced,
    for example for simulated time. Raises InputError for a bad URL, LinkError if it does not open.
    """

    def __init__(
        self,
        endpoint: Endpoint | str,
        *,
        us: Address = GCS,
        key: SigningKey | None = None,
        heartbeat_s: float | None = 1.0,
        clock: LinkClock = time.monotonic,
        transport: Transport | None = None,
        wait: Callable[[Sequence[Transport], float], None] = wait_readable,
        signing: Signing | None = None,
    ) -> None:
        self.endpoint = parse_url(endpoint) if isinstance(endpoint, str) else endpoint
        self.us = us
        self.clock = clock
        self._signing = signing or Signing(key)
        self._writer = FrameWriter(us, self._signing)
        self.parsers: dict[Peer, FrameParser] = {}
        self.heard_at: dict[Peer, float] = {}
        self._routes: dict[Address | int, Peer] = {}
        self._channels: dict[int, list[Channel]] = {}
        self._heartbeat_s = heartbeat_s
        self._next_heartbeat = clock()
        self._bad = self._unsigned = 0
        self.heard_systems: dict[int, float] = {}
        self.background: list[PumpJob[None]] = []
        self.transport: Transport = transport or open_transport(self.endpoint)
        self.wait = wait
        self.prompt = PromptAnswers(self._writer, possible=isinstance(self.transport, Udp))

    def __enter__(self) -> Link:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the socket or port."""
        for job in self.background:
            job.close()
        self.background.clear()
        self.transport.close()

    @property
    def url(self) -> str:
        """The link's URL in pymavlink's notation."""
        return self.endpoint.url

    @property
    def place(self) -> str:
        """The address actually used, with the real port if port 0 (any free one) was requested."""
        return self.transport.place

    @property
    def note(self) -> Note | None:
        """A note for the user on how the link was opened; None if there is nothing to note."""
        return self.transport.note if isinstance(self.transport, Udp) else None

    @property
    def garbage(self) -> int:
        """Number of frames with a wrong checksum, or with a missing, wrong or late signature."""
        return self._bad + sum(parser.bad for parser in self.parsers.values())

    @property
    def unsigned(self) -> int:
        """Number of frames whose signature is missing, wrong or late."""
        return self._unsigned + sum(parser.unsigned for parser in self.parsers.values())

    def channel(self, sysid: int) -> Channel:
        """Return a new channel for one system id; `drop` it when done."""
        channel = Channel(self, sysid)
        self.hear(channel)
        return channel

    def hear(self, channel: Channel) -> None:
        """Put the messages of its system into ``channel`` again, after `drop`."""
        self._channels.setdefault(channel.sysid, []).append(channel)

    def drop(self, channel: Channel) -> None:
        """Put no more messages into ``channel``."""
        mine = self._channels.get(channel.sysid, [])
        if channel in mine:
            mine.remove(channel)

    def serve(self, sysid: int, steps: Callable[[Channel], LinkSteps[None]]) -> None:
        """Run a task for a system beside all others of this link, whenever `pump` runs, until the link is closed."""
        channel = self.channel(sysid)
        self.background.append(PumpJob(channel, steps(channel)))

    def send(self, message: Any, to: Address, peer: Peer | None = None) -> bool:
        """Send a pymavlink message to ``peer``, by default where ``to`` was heard; False if no address is known.

        System id 0 means every known peer.
        """
        if to.sysid == 0:
            peers = [p for p in dict.fromkeys((*self.heard_at, self.transport.default)) if p is not None]
            frame = self._writer.pack(message)
            for each in peers:
                self.transport.write(frame, each)
            return bool(peers)
        peer = self._peer(to) if peer is None else peer
        if peer is None:
            return False
        self.transport.write(self._writer.pack(message), peer)
        return True

    def poll(self) -> None:
        """Move received messages into the inboxes, and send our heartbeat if it is due."""
        now = self.clock()
        for peer, data in self.transport.read():
            self.take_in(peer, data, now)
        self._beat(now)

    def answer(self, until: float) -> bool:
        """Replace `poll`: answer requests promptly until ``until``, a short silence, or any other message.

        Return whether anything was received; False at once if no answers are prepared.
        """
        if not self.prompt or not isinstance(self.transport, Udp):
            return False
        rest = self.transport.exchange(self.prompt, until, self.clock)
        now, answered = self.clock(), self.prompt.answered()
        self.heard_at.update((peer, now) for peer in answered & self.heard_at.keys())
        for peer, data in rest:
            self.take_in(peer, data, now)
        self._beat(now)
        return bool(rest or answered)

    def take_in(self, peer: Peer, data: bytes, now: float) -> None:
        """Route the messages in what a peer has sent."""
        for message in self._parser(peer, now).feed(data, datagram=self.transport.datagrams):
            self.route(peer, message, now)

    @property
    def next_heartbeat(self) -> float:
        """When our next heartbeat is due; infinity without one."""
        return self._next_heartbeat if self._heartbeat_s else float("inf")

    def _peer(self, to: Address) -> Peer | None:
        return self._routes.get(to) or self._routes.get(to.sysid) or self.transport.default

    def _parser(self, peer: Peer, now: float) -> FrameParser:
        parser = self.parsers.get(peer)
        if parser is None:
            if len(self.parsers) >= _MOST_PEERS:
                self._forget(min(self.heard_at, key=lambda p: self.heard_at[p]))
            parser = self.parsers[peer] = FrameParser(self._signing)
        self.heard_at[peer] = now
        return parser

    def _forget(self, peer: Peer) -> None:
        parser = self.parsers.pop(peer)
        self._bad, self._unsigned = self._bad + parser.bad, self._unsigned + parser.unsigned
        self.heard_at.pop(peer, None)
        self._routes = {to: where for to, where in self._routes.items() if where != peer}

    def route(self, peer: Peer, message: Any, now: float) -> None:
        """Give a message to the channels of its system, and remember where that system is heard from."""
        source = Address(message.get_srcSystem(), message.get_srcComponent())
        if source == self.us:
            return  # our own message, sent back by a hub
        if not message.late:
            self._routes[source] = peer
            self._routes[source.sysid] = peer
            self.heard_systems[source.sysid] = now
        for channel in self._channels.get(source.sysid, ()):
            channel.inbox.append(Heard(source, peer, message, message.late))

    def _beat(self, now: float) -> None:
        if not self._heartbeat_s or now < self._next_heartbeat:
            return
        self._next_heartbeat = now + self._heartbeat_s
        for peer in [p for p, at in self.heard_at.items() if now - at > _FORGET_S]:
            self._forget(peer)
        gcs = dialect.MAV_TYPE_GCS
        self.send(
            dialect.MAVLink_heartbeat_message(gcs, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3),
            Address(0, 0),
        )


class PumpJob(Generic[T]):
    """One task for `pump`, with its result or error."""

    def __init__(self, channel: Channel, steps: LinkSteps[T]) -> None:
        self.channel = channel
        self.result: T | None = None
        self.error: GcsplanError | None = None
        self.ended = False
        self.wake_at = float("-inf")
        self._steps = steps

    def advance(self) -> None:
        """Run the task to its next pause."""
        try:
            self.wake_at = next(self._steps)
        except StopIteration as stop:
            self.result, self.ended = stop.value, True
        except GcsplanError as error:
            self.error, self.ended = error, True
        except Exception as error:  # a bug, which must not end the other vehicles' tasks
            _log.exception("a task for system %d failed", self.channel.sysid)
            words = f"internal error, a bug in gcsplan: {type(error).__name__}: {error}; the list on board is not known"
            self.error, self.ended = GcsplanError(words, where=f"vehicle {self.channel.sysid}"), True

    def close(self) -> None:
        """End the task early; its machine then notifies the vehicle."""
        self._steps.close()


def pump(jobs: Sequence[PumpJob[T]], *, most: int | None = None, most_on_link: int | None = None) -> None:
    """Run all ``jobs`` concurrently to their ends, and what their links serve. Each job stores its own error.

    At most ``most`` run at a time, and ``most_on_link`` of each link (None: all). The others wait for their turn in
    their order, and their channels hear nothing until then, so that a job sees its vehicle as it is when its turn
    comes, and nothing piles up. Whoever cancels (`errors.cancelled_by`) ends all of them, as Ctrl-C does.
    """
    if not jobs:
        return
    links = list({id(job.channel.link): job.channel.link for job in jobs}.values())
    clock = links[0].clock
    turns = _LinkTurns(jobs, most or len(jobs), most_on_link or len(jobs))
    try:
        while True:
            heed_cancel()
            now = clock()
            turns.begin()
            every: list[PumpJob[Any]] = [*turns.active, *(job for link in links for job in link.background)]
            for job in every:
                if not job.ended and (job.channel.waits or now >= job.wake_at):
                    job.advance()
            if turns.end():
                if turns.over:
                    return
                continue
            due = min(
                *(job.wake_at for job in every if not job.ended),
                *(link.next_heartbeat for link in links),
                clock() + _IDLE_S,
            )
            if len(links) == 1 and links[0].answer(due):
                continue
            links[0].wait([link.transport for link in links], due - clock())
            for link in links:
                link.poll()
    finally:
        for job in jobs:
            job.close()


class _LinkTurns:
    """The jobs that run, and those that wait for their turn."""

    def __init__(self, jobs: Sequence[PumpJob[Any]], most: int, most_on_link: int) -> None:
        self._waiting, self._most, self._most_on_link = deque(jobs), most, most_on_link
        self.active: list[PumpJob[Any]] = []
        self._deaf: set[int] = set()  # ids of the jobs whose channels hear nothing

    @property
    def over(self) -> bool:
        """Whether every job has ended."""
        return not self.active and not self._waiting

    def begin(self) -> None:
        """Begin the jobs for which there is room."""
        if not self._waiting or (self._deaf and len(self.active) >= self._most):
            return
        on_link = Counter(id(job.channel.link) for job in self.active)
        for _ in range(len(self._waiting)):
            job = self._waiting.popleft()
            if len(self.active) < self._most and on_link[id(job.channel.link)] < self._most_on_link:
                on_link[id(job.channel.link)] += 1
                if id(job) in self._deaf:
                    job.channel.link.hear(job.channel)
                self.active.append(job)
            else:
                self._waiting.append(job)  # all are looked at once, so that their order stays
                if id(job) not in self._deaf:
                    self._deaf.add(id(job))
                    job.channel.link.drop(job.channel)
                    job.channel.inbox.clear()

    def end(self) -> bool:
        """Forget the jobs that have ended; returns whether there were any."""
        over = [job for job in self.active if job.ended]
        self.active = [job for job in self.active if not job.ended]
        if self._waiting:  # what their vehicles say until the others are done is nobody's
            for job in over:
                job.channel.link.drop(job.channel)
                job.channel.inbox.clear()
        return bool(over)


def run(channel: Channel, steps: LinkSteps[T]) -> T:
    """Run one task to its end and return its result; raise its error if it fails."""
    job = PumpJob(channel, steps)
    pump([job])
    if job.error is not None:
        raise job.error
    result: T = job.result  # type: ignore[assignment]
    return result
