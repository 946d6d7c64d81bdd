"""The sentence of a verdict, the labels of the rows on a way home, and lengths of overlapping parts."""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from typing import NamedTuple, Protocol

from gcsplan.notes.note import Note

PATH = {True: Note("path_safe"), False: Note("path_unsafe"), None: Note("path_not_judged")}

LABELS = {
    "judged_at": "judged at", "judged_as": "judged as", "set": "on the vehicle", "path_back": "instead",
    "proposal": "tried, the best first",
    "no_return": "no safe return", "irregular": "outside a limit", "clear": "clear of ground and zones",
    "legal": "within all limits too", "lowest": "lowest on a return", "battery": "battery for the return",
    "rally": "rally point", "still_no_return": "still no safe return", "not_judged": "not judged",
}  # fmt: skip
"""The labels of the rows on a way home, by subject."""


class ReturnRow(NamedTuple):
    """One row on a way home: its subject, a key of `LABELS`, and its words; ``number``: which of several rows."""

    about: str
    note: Note
    number: int = 0

    @property
    def label(self) -> str:
        """The label before the row."""
        return LABELS[self.about] + (f" {self.number}" if self.number else "")


class Return(Protocol):
    """The part of a verdict on the way home."""

    @property
    def safe(self) -> bool | None:
        """Whether the return is safe from every point; None: not all of it was judged."""

    @property
    def no_return_m(self) -> float:
        """Metres of the mission without a safe return."""


def verdict_words(path_safe: bool | None, home: Return | None) -> Note:
    """The one sentence of a verdict in every output, which names what was judged: the path, and the return.

    ``home``: the way home, None if it was not judged.
    """
    path = PATH[path_safe]
    if home is None or home.safe is None:
        return Note("return_not_judged", path=path)
    if home.safe:
        return Note("return_safe", path=path)
    if home.no_return_m < 0.5:
        return Note("no_return_from_point", path=path)
    return Note("no_return_from_part", path=path, no_return_m=home.no_return_m)


def both(notes: Iterable[Note]) -> Note:
    """Notes joined by "and"; at least one."""
    return reduce(lambda one, other: Note("and_also", one=one, other=other), notes)


def listed(notes: Iterable[Note]) -> Note:
    """Notes joined by semicolons; at least one."""
    return reduce(lambda one, other: Note("and_then", one=one, other=other), notes)


def together_m(parts: Iterable[tuple[float, float]]) -> float:
    """The length of intervals that may overlap."""
    total, until = 0.0, float("-inf")
    for a, b in sorted(parts):
        total += max(b - max(a, until), 0.0)
        until = max(until, b)
    return total
