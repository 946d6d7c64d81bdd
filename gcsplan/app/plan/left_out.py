"""Vehicles of a fleet that have no mission: the first one refuses the whole file, or all are left out by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gcsplan.errors import CheckFailed, NoMission
from gcsplan.figures import counted

if TYPE_CHECKING:
    from gcsplan.fleet.separation import Conflict

MOST_SHOWN = 5
"""Vehicles whose reasons a message gives; it names all of them."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A vehicle without a mission that may fly: its name, the error's word for scripts, and why."""

    name: str
    reason: str
    message: str

    def as_dict(self) -> dict[str, str]:
        """The vehicle's entry in ``summary.json``."""
        return {"name": self.name, "reason": self.reason, "message": self.message}


class LeavingOut:
    """The vehicles that are left out of a plan, if that is allowed; ``found``: the ones left out so far."""

    def __init__(self, *, allowed: bool, found: Sequence[LeftOut] = ()) -> None:
        self.allowed = allowed
        self.found = list(found)

    def leave(self, name: str, why: NoMission | CheckFailed) -> None:
        """Leave a vehicle out; raises ``why`` if that is not allowed."""
        if not self.allowed:
            raise why
        self.found.append(LeftOut(name, why.reason, str(why)))

    def require_some(self, vehicles: Sequence[object]) -> None:
        """Raise NoMission if all vehicles are left out."""
        if not vehicles:
            raise refusal_of(self.found)


def refusal_of(left_out: Sequence[LeftOut]) -> NoMission:
    """The error that a plan ends with which leaves vehicles out: all names, and why, of the first of them."""
    names = ", ".join(v.name for v in left_out)
    lines = [f"  {v.name}: {v.message}".replace("\n", "\n    ") for v in left_out[:MOST_SHOWN]]
    if len(left_out) > MOST_SHOWN:
        lines.append(f"  and {len(left_out) - MOST_SHOWN} more: summary.json says why (left_out)")
    head = f"{counted(len(left_out), 'vehicle')} without a mission, left out: {names}"
    return NoMission("\n".join([head, *lines]), reason=left_out[0].reason)  # type: ignore[arg-type]


def least_to_leave(conflicts: Sequence[Conflict]) -> dict[str, Conflict]:
    """Vehicles without which no conflict is left, each with one of its conflicts: always the one with the most."""
    found: dict[str, Conflict] = {}
    rest = list(conflicts)
    while rest:
        names = [name for c in rest for name in c.worst.vehicles]
        worst = max(dict.fromkeys(names), key=names.count)
        found[worst] = next(c for c in rest if worst in c.worst.vehicles)
        rest = [c for c in rest if worst not in c.worst.vehicles]
    return found
