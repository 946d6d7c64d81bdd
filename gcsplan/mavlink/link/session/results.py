"""The result of a session: the outcome of an upload, a comparison or a clearing, as data and as an error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from gcsplan.errors import CheckFailed, GcsplanError, LinkError, ReadBackDiffers, VehicleRefused
from gcsplan.mavlink.link.watch import VehicleState
from gcsplan.mavlink.mission.compare import Difference, faults
from gcsplan.mavlink.mission.mission import FENCE, MISSION, RALLY, Mission, MissionItem
from gcsplan.mavlink.protocol.outcome import Accepted, Changed, Outcome, Refused
from gcsplan.notes.note import Note

OutcomeWord = Literal["accepted", "refused", "unknown"]
_DIFFERENCES_SHOWN = 8
_LISTS = {MISSION: "mission", FENCE: "fence", RALLY: "list of rally points"}


def outcome_word(outcome: Outcome) -> OutcomeWord:
    """Return the outcome as one word for summaries; a `Changed` vehicle counts as refused."""
    if isinstance(outcome, Accepted):
        return "accepted"
    return "refused" if isinstance(outcome, (Refused, Changed)) else "unknown"


def failed_in_json(note: Note | None) -> dict[str, Any]:
    """Why a mission fails the caller's check, as a sentence and as data; empty if it does not."""
    return {} if note is None else {"failed_check": str(note), "failed_check_data": note.as_dict()}


class FailsCheck(VehicleRefused):
    """Nothing was sent: with the vehicle's parameters the mission fails the caller's check, and ``note`` says why."""

    def __init__(self, note: Note, sysid: int) -> None:
        super().__init__(
            f"with this vehicle's parameters the mission cannot be flown as it was judged, and it was not sent; plan "
            f"it for them (more track_error_m, another lean_angle_deg or rtl_rel_home_m), or set them:\n{note}",
            where=f"vehicle {sysid}",
            reason="parameters",
        )
        self.note = note


@dataclass(frozen=True, slots=True)
class UploadResult:
    """The result for one list and one vehicle.

    ``verified`` is True only if the list was read back whole, equals the sent list as the autopilot stores it, but for
    differences that are excused, and passed the caller's check again. ``reason``: the outcome in words. ``on_board``:
    what the vehicle holds, if that is not the sent list. ``read_back``: in wire order; ``mission``: the same as a
    Mission (missions only).
    ``failed_check``: why the read-back fails the check. ``simulated``: the caller says that the vehicle is simulated.
    ``changed``: one word for how the vehicle changed since it was checked (armed, moved, ambiguous, …), ``change``: the
    same as a sentence; nothing was sent after the change was seen. ``state``: the vehicle's state when it was found.
    """

    vehicle: str
    sysid: int
    url: str
    outcome: OutcomeWord
    verified: bool
    items: int
    seconds: float
    retries: int = 0
    attempts: int = 1
    simulated: bool = False
    mission_type: int = MISSION
    reason: str = ""
    on_board: str = ""
    failed_check: Note | None = None
    differences: tuple[Difference, ...] = ()
    warnings: tuple[Note, ...] = ()
    texts: tuple[str, ...] = ()
    read_back: tuple[MissionItem, ...] | None = None
    mission: Mission | None = None
    changed: str = ""
    change: str = ""
    state: VehicleState | None = None

    @property
    def faults(self) -> tuple[Difference, ...]:
        """The differences that are not excused."""
        return faults(self.differences)

    def as_dict(self) -> dict[str, Any]:
        """Return a dict for JSON: the fixed keys, and the others that are not empty."""
        fixed: dict[str, Any] = {
            "url": self.url,
            "outcome": self.outcome,
            "verified": self.verified,
            "simulated": self.simulated,
            "items": self.items,
            "seconds": round(self.seconds, 3),
            "retries": self.retries,
        }
        more: dict[str, Any] = {
            "attempts": self.attempts if self.attempts > 1 else None,
            "reason": self.reason if not self.verified else None,
            "changed": self.changed,
            "on_board": self.on_board,
            **failed_in_json(self.failed_check),
            "differences": [str(d) for d in self.differences],
            "warnings": [str(note) for note in self.warnings],
            "texts": list(self.texts) if not self.verified else None,
        }
        return fixed | {key: value for key, value in more.items() if value}

    def error(self) -> GcsplanError | None:
        """Return the error for this result; None if it is verified and the vehicle has not changed."""
        where = f"{self.vehicle or 'vehicle'} (system {self.sysid})"
        if self.verified and self.changed:
            words = f"the new {_LISTS[self.mission_type]} IS on board, read back and equal to what was sent, but "
            return VehicleRefused(f"{words}{self.change}. Nothing further was sent", where=where, reason=self.changed)
        if self.verified:
            return None
        tail = f"; {self.on_board}" if self.on_board else ""
        if self.texts:
            tail += f"; the vehicle says: {' / '.join(self.texts[-3:])}"
        if self.changed and not self.faults and self.failed_check is None:
            return VehicleRefused(f"the upload was stopped: {self.change}{tail}", where=where, reason=self.changed)
        if self.outcome == "refused":
            return VehicleRefused(f"the vehicle {self.reason}{tail}", where=where)
        if self.faults:
            shown = "; ".join(str(d) for d in self.faults[:_DIFFERENCES_SHOWN])
            rest = len(self.faults) - _DIFFERENCES_SHOWN
            more = f"; and {rest} more" if rest > 0 else ""
            source = "the file has" if self.faults[0].unsent else "was sent"
            return ReadBackDiffers(f"the list on board is not what {source}: {shown}{more}{tail}", where=where)
        if self.failed_check is not None:
            return CheckFailed(f"the mission as read back fails the check: {self.failed_check}{tail}", where=where)
        return LinkError(f"the outcome is {self.reason}{tail}", where=where)

    def raise_for_outcome(self) -> None:
        """Raise the error of `error` if there is one."""
        error = self.error()
        if error is not None:
            raise error
