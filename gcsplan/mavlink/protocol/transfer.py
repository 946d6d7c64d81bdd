"""The mission protocol without sockets and without a clock: `Upload`, `Download`, `Clear`, and `VerifiedUpload`.

A session runs `VerifiedUpload`: it uploads, reads back, compares, and starts over while that can help. Reading back
also decides an unknown outcome. Only a list that was read back whole and equal is called verified::

    upload ── accepted, unknown, error ──► read back ── equal ──► verified
       ▲  └── refused, no request ──► refused      │
       └──────────── differs, upload not accepted ─┴── differs, upload accepted: another station wrote, or corrupted

Before each COUNT, a gate decides whether the vehicle is still the one that was checked and still in that state.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum, auto

from gcsplan.errors import InputError
from gcsplan.figures import counted
from gcsplan.mavlink.mission.autopilots import profile_of
from gcsplan.mavlink.mission.compare import Difference, compare, faults
from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, MissionItem
from gcsplan.mavlink.protocol.download import Download
from gcsplan.mavlink.protocol.machine import (
    CANCELLED_BY_US,
    Gate,
    ImpossibleTransition,
    Machine,
    Timers,
    TransferProgress,
    always,
)
from gcsplan.mavlink.protocol.messages import Address, Item, Packet
from gcsplan.mavlink.protocol.outcome import ERROR, Accepted, Changed, Outcome, Refused, Unknown
from gcsplan.mavlink.protocol.upload import Clear, Upload
from gcsplan.vehicle import Autopilot

__all__ = [
    "Accepted",
    "Changed",
    "Clear",
    "Download",
    "ImpossibleTransition",
    "Machine",
    "Outcome",
    "Refused",
    "Settled",
    "Timers",
    "TransferProgress",
    "Unknown",
    "Upload",
    "VerifiedUpload",
]

_READS = 2  # tries to read back after one upload
_LIST = {MISSION: "mission", FENCE: "fence", RALLY: "list of rally points"}


@dataclass(frozen=True, slots=True)
class Settled:
    """The result of a verified upload.

    ``verified``: the list was read back and equals the sent list as the autopilot stores it. ``read_back``: the list on
    board in wire order, None if it could not be read. ``differences``: includes excused ones (home). ``on_board``: what
    the vehicle holds now, in words; empty if ``verified``.
    """

    outcome: Outcome
    verified: bool
    differences: tuple[Difference, ...] = ()
    read_back: tuple[MissionItem, ...] | None = None
    on_board: str = ""
    attempts: int = 1
    retries: int = 0


class _Phase(Enum):
    IDLE = auto()
    UPLOAD = auto()
    READ = auto()
    PAUSE = auto()
    ENDED = auto()


class VerifiedUpload:
    """Upload ``items`` (wire order) to ``vehicle``, read them back and compare, at most ``attempts`` times.

    It has the interface of the machines that it runs. ``result`` is None until the end. ``gate``: see `machine`.
    ``most``: the number of items that the vehicle can hold; a longer list that it announces is not read.
    """

    def __init__(
        self,
        items: Sequence[MissionItem],
        autopilot: Autopilot,
        *,
        us: Address,
        vehicle: Address,
        mission_type: int = MISSION,
        timers: Timers | None = None,
        attempts: int = 4,
        gate: Gate = always,
        most: int = 65535,
    ) -> None:
        if attempts < 1:
            raise InputError(f"an upload needs at least one attempt, given {attempts}")
        self.us, self.vehicle, self.mission_type = us, vehicle, mission_type
        self.autopilot = autopilot
        self.timers = timers or Timers()
        self.result: Settled | None = None
        self._gate = gate
        self._hold_most = max(most, len(items))
        self._last_read: tuple[MissionItem, ...] | None = None
        self._read_of: Upload | None = None  # the upload after which `_last_read` was read
        self._began_before = False
        self._items = tuple(items)
        self._most = attempts
        self._attempt = 1
        self._reads = 0
        self._retries = 0
        self._upload = self._new_upload()
        self._download: Download | None = None
        self._phase = _Phase.IDLE
        self._resume: _Phase = _Phase.UPLOAD
        self._pause_until = 0.0
        self._refused_before: Outcome | None = None

    @property
    def deadline(self) -> float | None:
        """The next time to call `on_timer`; None before the start and after the end."""
        if self._phase is _Phase.PAUSE:
            return self._pause_until
        child = self._child
        return child.deadline if child else None

    @property
    def progress(self) -> TransferProgress:
        """Progress of the machine that runs now."""
        child = self._child or self._download or self._upload
        return child.progress

    @property
    def retries(self) -> int:
        """Number of repeated messages so far, plus repeated uploads."""
        child = self._child
        return self._retries + (child.retries if child and child.outcome is None else 0) + self._attempt - 1

    @property
    def mark(self) -> tuple[int, ...]:
        """A measure of progress: grows with every item that is requested or read for the first time."""
        return (self._attempt, self._reads, self.progress.done)

    @property
    def _began(self) -> bool:
        return self._began_before or self._upload.began

    @property
    def _child(self) -> Upload | Download | None:
        return {_Phase.UPLOAD: self._upload, _Phase.READ: self._download}.get(self._phase)

    def start(self, now: float) -> list[Packet]:
        """Announce the list with COUNT."""
        if self._phase is not _Phase.IDLE:
            raise ImpossibleTransition("verified upload: START is impossible twice", where=f"vehicle {self.vehicle}")
        self._phase = _Phase.UPLOAD
        return self._upload.start(now) + self._advance(now)

    def receive(self, packet: Packet, now: float) -> list[Packet]:
        """Process ``packet`` and return the answers.

        Requests for items are answered in every phase, because the vehicle may still be receiving.
        """
        if self._phase is _Phase.IDLE:
            return []
        out = self._upload.receive(packet, now)
        if self._phase is _Phase.READ and self._download:
            out += self._download.receive(packet, now)
        return out + self._advance(now)

    @property
    def answers(self) -> Sequence[Item]:
        """The item that answers a request, by seq, in every phase."""
        return self._upload.answers

    def answered(self, seqs: Iterable[int], now: float) -> None:
        """Record requests for ``seqs`` that were already answered."""
        self._upload.answered(seqs, now)

    def on_timer(self, now: float) -> list[Packet]:
        """Return the packets that are due at ``now``."""
        if self._phase is _Phase.PAUSE:
            return self._wake(now) if now >= self._pause_until else []
        child = self._child
        return child.on_timer(now) + self._advance(now) if child else []

    def cancel(self, now: float, why: str = CANCELLED_BY_US) -> list[Packet]:
        """End with an unknown outcome and notify the vehicle."""
        if self.result is not None:
            return []
        child = self._child
        out = child.cancel(now, why) if child and child.outcome is None else []
        self._retries += child.retries if child else 0
        self._end(Unknown(why))
        return out

    def _new_upload(self) -> Upload:
        return Upload(
            self._items, us=self.us, vehicle=self.vehicle, mission_type=self.mission_type, timers=self.timers,
            gate=self._gate,
        )  # fmt: skip

    def stop(self, outcome: Outcome) -> None:
        """End with ``outcome`` and answer no more: the link may lead to another vehicle by now."""
        if self.result is not None:
            return
        child = self._child
        self._retries += child.retries if child and child.outcome is None else 0
        self._upload.stop(outcome)
        self._end_changed(outcome)

    def _end_changed(self, outcome: Outcome) -> list[Packet]:
        """End without further reading: the last list read counts as on board unless items were requested since."""
        untouched = self._read_of is self._upload or not self._upload.began
        return self._end(outcome, self._last_read if untouched else None)

    def _wake(self, now: float) -> list[Packet]:
        self._phase = self._resume
        if self._phase is _Phase.UPLOAD:
            self._refused_before = self._upload.outcome
            self._began_before = self._began
            self._upload, self._reads = self._new_upload(), 0
            return self._upload.start(now) + self._advance(now)
        return self._read(now)

    def _read(self, now: float) -> list[Packet]:
        self._phase = _Phase.READ
        self._reads += 1
        self._download = Download(
            us=self.us, vehicle=self.vehicle, mission_type=self.mission_type, timers=self.timers, most=self._hold_most
        )
        return self._download.start(now)

    def _pause(self, now: float, resume: _Phase) -> list[Packet]:
        self._phase, self._resume = _Phase.PAUSE, resume
        self._pause_until = now + self.timers.response_s
        return []

    def _advance(self, now: float) -> list[Packet]:
        child = self._child
        if child is None or child.outcome is None:
            return []
        self._retries += child.retries
        if child is self._download:
            return self._after_reading(now, child.outcome)
        if self._upload.barred:
            return self._end_changed(child.outcome)
        refused = isinstance(child.outcome, Refused)
        if refused and not self._upload.began:
            if self._may_help() and self._attempt < self._most:
                self._attempt += 1
                return self._pause(now, _Phase.UPLOAD)
            return self._end(child.outcome)
        return self._read(now)

    def _may_help(self) -> bool:
        """Whether another attempt can change the outcome: a busy vehicle answers ERROR, so ERROR may pass."""
        outcome = self._upload.outcome
        if isinstance(outcome, Refused):
            same_item_again = outcome.seq is not None and outcome == self._refused_before
            return outcome.code == ERROR and not same_item_again
        return isinstance(outcome, Unknown)

    def _after_reading(self, now: float, reading: Outcome) -> list[Packet]:
        uploaded = self._upload.outcome
        assert uploaded is not None
        assert self._download is not None
        if not isinstance(reading, Accepted):
            return self._unreadable(now, uploaded, reading)
        read = self._download.items
        self._last_read, self._read_of = read, self._upload
        differences = tuple(compare(self._items, read, self.autopilot, self.mission_type))
        if not faults(differences):
            return self._end(Accepted(self._download.opaque_id), read, differences, verified=True)
        if self._may_help() and self._attempt < self._most:
            self._attempt += 1
            return self._pause(now, _Phase.UPLOAD)
        return self._end(uploaded, read, differences)

    def _unreadable(self, now: float, uploaded: Outcome, reading: Outcome) -> list[Packet]:
        dead = isinstance(uploaded, Unknown) and uploaded.silent and isinstance(reading, Unknown) and reading.silent
        if self._reads < _READS and not dead and not isinstance(reading, Refused):
            return self._pause(now, _Phase.READ)
        if isinstance(uploaded, Refused):
            return self._end(uploaded)
        outcome = uploaded.why if isinstance(uploaded, Unknown) else "the vehicle answered accepted"
        why = reading.why if isinstance(reading, Unknown) else str(reading)
        return self._end(Unknown(f"{outcome}; reading back failed: {why}", silent=dead))

    def _end(
        self,
        outcome: Outcome,
        read: tuple[MissionItem, ...] | None = None,
        differences: tuple[Difference, ...] = (),
        *,
        verified: bool = False,
    ) -> list[Packet]:
        self._phase = _Phase.ENDED
        words = "" if verified else on_board(self._items, read, self.autopilot, self.mission_type, self._began)
        self.result = Settled(outcome, verified, differences, read, words, self._attempt, self.retries)
        return []


def on_board(
    sent: Sequence[MissionItem],
    read: Sequence[MissionItem] | None,
    autopilot: Autopilot,
    mission_type: int = MISSION,
    began: bool = True,
) -> str:
    """Describe what the vehicle holds after an upload of ``sent`` that was not verified, and what the user should do.

    ``read``: the list that was read back, None if it could not be read. ``began``: the vehicle had requested items.
    """
    name = _LIST[mission_type]
    if read is None:
        if not began:
            cut = "" if profile_of(autopilot).atomic else ", or cut short if the announcement reached it"
            return f"the vehicle requested nothing: its former {name} should be untouched{cut}"
        return f"what the vehicle holds is not known: do not fly it; upload again or clear its {name}"
    if not read:
        return f"the vehicle holds no {name} now"
    common = min(len(sent), len(read))
    start = 1 if autopilot.is_ardupilot and mission_type == MISSION else 0
    wrong = [d.seq for d in faults(compare(sent[:common], read[:common], autopilot, mission_type))]
    same = min(wrong, default=common) - start
    if same <= 0 and common > start:
        whose = "still holds another" if profile_of(autopilot).atomic or not began else "holds another"
        return f"the vehicle {whose} {name} of {counted(len(read), 'item')}: do not take it for the one that was sent"
    if len(read) == len(sent) and len(set(wrong)) < common - start and not profile_of(autopilot).atomic:
        unlike = ", ".join(map(str, sorted(set(wrong))[:8]))
        return (
            f"the vehicle now holds {counted(len(read), 'item')}, of which {len(set(wrong))} are not as sent "
            f"(item {unlike}); do not fly; upload again or clear"
        )
    return (
        f"the vehicle now holds {counted(len(read), 'item')} of an unfinished upload, the first {same + start} as "
        f"sent; do not fly; upload again or clear"
    )
