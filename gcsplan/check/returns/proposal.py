"""`ReturnProposal`: one change that was tried for the way home, and what it leaves unsafe."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from gcsplan.notes.note import IN_FILES, Note, Wording

ALIKE_M = 1.0
"""Proposals that leave lengths within this of each other, m, are alike in that."""


@dataclass(frozen=True, slots=True)
class ReturnProposal:
    """A change in words, and the length ``leaves_m`` of the mission from which the return then is not safe.

    ``keys``: the keys of the vehicle in the mission file that make the change, beside the ``rally`` points that have to
    be on board with them. ``above_max_agl``: the return is higher above home than the mission may fly above ground.
    ``shortens``: the mission ends at another place. ``first_m``: where on the mission the first return that is left
    unsafe begins, inf without one; None: not known.
    """

    change: Note
    leaves_m: float
    keys: tuple[tuple[str, Any], ...]
    above_max_agl: bool = False
    shortens: bool = False
    rally: int = 0
    first_m: float | None = None

    @property
    def note(self) -> Note:
        """The change, and what it leaves unsafe."""
        left = Note("proposal_leaves", left_m=self.leaves_m) if self.leaves_m else Note("proposal_leaves_nothing")
        return Note("return_proposal", change=self.change, leaves=left)

    def as_dict(self, wording: Wording = IN_FILES) -> dict[str, Any]:
        """The proposal for programs."""
        return {
            "proposal": self.note.text(wording),
            "proposal_data": self.note.as_dict(),
            "leaves_m": self.leaves_m,
            "keys": {key: list(value) if isinstance(value, tuple) else value for key, value in self.keys},
            "above_max_agl": self.above_max_agl,
            "rally_points": self.rally,
        }


def best_first(proposals: Iterable[ReturnProposal]) -> tuple[ReturnProposal, ...]:
    """The proposals in order: without one that ends elsewhere first, then by what they leave, then within the limits.

    Of equal ones the first stays the first.
    """
    return tuple(sorted(proposals, key=lambda p: (p.shortens, round(p.leaves_m / ALIKE_M), p.above_max_agl)))
