"""How much earlier or later than planned a flight is, in each wind of a set at once: its drift.

One wind of the set blows for a whole fleet, so the drifts of two vehicles belong together. A *witness* is a corner of a
cell of winds. Any wind of a cell is a mean of the cell's corners; a drift in it is no less than the same mean of
``early``, and no more than that of ``late``. So two vehicles' drifts differ by no more than they do at one witness:
`between`. In a set whose wind varies there is one witness for all, and the two ends belong to no wind together. Each
vehicle departs late by itself, so its departure window is part of ``late`` at all witnesses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices

__all__ = ["Drift", "Drifts", "between"]

CORNERS = 4
"""Witnesses of a cell."""
UNMOVED_S = 1e-6
"""Drifts up to this, s, are rounding."""
LEAST_CUT_S, MOST_CUTS = 1.0, 64
"""A piece of a motion is cut where its drift changes by more than this, s, into as many parts at most."""


@dataclass(frozen=True, eq=False, slots=True)
class Drifts:
    """Bounds of N drifts, s, at Q witnesses: ``early`` and ``late`` (Q, N); with Q = 1 they are the same at all."""

    early: Floats
    late: Floats

    def take(self, rows: Indices) -> Drifts:
        """The drifts of ``rows``, which may repeat."""
        return Drifts(self.early[:, rows], self.late[:, rows])

    def joined(self, other: Drifts) -> Drifts:
        """These drifts, followed by others."""
        count = max(len(self.early), len(other.early))
        a, b = self.wide(count), other.wide(count)
        return Drifts(np.concatenate([a.early, b.early], axis=1), np.concatenate([a.late, b.late], axis=1))

    def wide(self, count: int) -> Drifts:
        """The same at ``count`` witnesses, if it is known at one."""
        if len(self.early) in (0, count):
            return self
        shape = (count, self.early.shape[1])
        return Drifts(np.broadcast_to(self.early, shape), np.broadcast_to(self.late, shape))

    @property
    def most_s(self) -> float:
        """The largest drift, early or late."""
        return float(max(-self.early.min(initial=0.0), self.late.max(initial=0.0)))

    @classmethod
    def none(cls, count: int) -> Drifts:
        """No drift at any of ``count`` places."""
        return cls(np.zeros((1, count)), np.zeros((1, count)))


def between(first: Drifts, second: Drifts) -> tuple[Floats, Floats]:
    """The least and the most (N,) by which the second's drift exceeds the first's in the same wind, row by row, s."""
    return (second.early - first.late).min(axis=0), (second.late - first.early).max(axis=0)


@dataclass(frozen=True, eq=False, slots=True)
class Drift:
    """The drift of one flight at the ends of its N stretches, holds included.

    ``seq`` (N,) are the items' numbers, which never fall. ``early``, ``late`` (Q, N) in seconds. Along a stretch the
    drift rises by at most ``rises`` (Q, N), and falls by at most ``falls``, for each second in still air; ``loose_s``
    (N,) come on top of that between the two ends. ``departs_s`` (N,): the part of ``late`` that is its departure's,
    which is as late as the first of them.
    """

    seq: Indices
    early: Floats
    late: Floats
    rises: Floats
    falls: Floats
    loose_s: Floats
    departs_s: Floats

    @property
    def moves(self) -> bool:
        """Whether a declared wind, or a late departure, changes a time at all."""
        return self.blown or bool((self.departs_s > UNMOVED_S).any())

    @property
    def blown(self) -> bool:
        """Whether a declared wind changes a time at all."""
        late = self.late - self.departs_s
        return bool((np.abs(self.early) > UNMOVED_S).any() or (np.abs(late) > UNMOVED_S).any())

    @property
    def departure(self) -> Drifts:
        """The drift with which it leaves the ground (1)."""
        return Drifts(np.zeros((1, 1)), self.departs_s[None, :1])

    def at_end_of(self, stretch: int) -> Drifts:
        """The drift at the end of one stretch."""
        return Drifts(self.early[:, stretch : stretch + 1], self.late[:, stretch : stretch + 1])

    def cut(self, times_s: Floats, items: Indices) -> Floats:
        """Times (M,) of a motion and more between them, so that the drift hardly changes from one to the next.

        ``items`` (M - 1,) are the item numbers of the pieces between ``times_s``.
        """
        first, last, _ = self._groups(items)
        of = np.cumsum(np.append(0, np.diff(items) != 0))
        rates = (self.rises + self.falls).max(axis=0)
        most = np.array([rates[a : b + 1].max(initial=0.0) for a, b in zip(first, last, strict=True)])[of]
        lasts = np.diff(times_s)
        step_s = max(LEAST_CUT_S, float((most * lasts).sum()) / MOST_CUTS)
        parts = np.maximum(np.ceil(most * lasts / step_s), 1.0).astype(np.intp)
        begins = np.repeat(np.cumsum(parts) - parts, parts)
        share = (np.arange(len(begins)) - begins) / np.repeat(parts, parts)
        return np.append(np.repeat(times_s[:-1], parts) + share * np.repeat(lasts, parts), times_s[-1])

    def along(self, times_s: Floats, items: Indices) -> Drifts:
        """The drifts of the pieces of a motion between ``times_s`` (M,), each over the whole of its piece."""
        first, last, heads = self._groups(items)
        of = np.cumsum(np.append(0, np.diff(items) != 0))
        # A place that is past: the drift there, and what it may have changed by since. A place ahead: likewise.
        since = times_s[1:] - times_s[heads][of]
        until = times_s[np.append(heads[1:], len(items))][of] - times_s[:-1]
        begin = self.departure.wide(len(self.late))
        early, late = np.hstack([begin.early, self.early]), np.hstack([begin.late, self.late])
        rises, falls = (_most(rate, first, last)[:, of] for rate in (self.rises, self.falls))
        loose = np.array([self.loose_s[a : b + 1].sum() for a, b in zip(first, last, strict=True)])[of]
        behind, ahead = first[of], last[of] + 1
        lows = early[:, behind] - falls * since, early[:, ahead] - rises * until
        highs = late[:, behind] + rises * since, late[:, ahead] + falls * until
        low, high = np.where(_higher(*lows), *lows), np.where(_higher(*highs), highs[1], highs[0])
        return Drifts(low - loose, high + loose)

    def _groups(self, items: Indices) -> tuple[Indices, Indices, Indices]:
        """The first and the last stretch of each run of pieces with one item, and the first piece of each."""
        heads = np.flatnonzero(np.append(True, np.diff(items) != 0))
        ends = np.append(np.searchsorted(self.seq, items[heads][1:], side="left"), len(self.seq)) - 1
        return np.append(0, ends[:-1] + 1), ends, heads


def _most(rate: Floats, first: Indices, last: Indices) -> Floats:
    """(Q, G) the largest rate of each group of stretches."""
    return np.column_stack([rate[:, a : b + 1].max(axis=1, initial=0.0) for a, b in zip(first, last, strict=True)])


def _higher(a: Floats, b: Floats) -> Bools:
    """Where ``a`` is above ``b`` (Q, N), cell by cell: a mean of bounds needs the same one at all corners of a cell."""
    if len(a) < CORNERS:
        return np.asarray(a > b)
    count = a.shape[1]
    above = (a - b).reshape(-1, CORNERS, count).mean(axis=1) > 0.0
    return np.repeat(above, CORNERS, axis=0)
