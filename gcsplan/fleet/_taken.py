"""The space and time that vehicles with priority occupy, and the shifts that keep a motion clear of them.

A motion that leaves ``d`` seconds later meets another if its place at t1 is near the other's at t2 = t1 + d. For two
straight pieces these delays are one interval in closed form (`_sweep.shifts`), so the least change of departure is
computed directly, without trials.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.fleet._sweep import Pieces, pieces_of, shifts
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.fleet.separation import TOLERANCE_M, Rules
from gcsplan.wind.drift import Drifts, between

GROUP, LEVELS = 6, 3
"""Boxes per group, and levels of groups: groups that do not touch are skipped as a whole."""

WHOLE = GROUP**LEVELS

BLOCK = 4000
"""Pairs of groups that are opened together."""

EDGE_S = 1e-6
"""Seconds by which every forbidden span is widened on both sides, for rounding."""


@dataclass(frozen=True, eq=False, slots=True)
class Boxes:
    """Boxes of n pieces or groups: ``low``, ``high`` (n, 4) in east_m, north_m, amsl_m and seconds.

    An empty box has its low above its high.
    """

    low: Floats
    high: Floats

    @classmethod
    def of(cls, pieces: Pieces, window_s: float) -> Boxes:
        """One box per piece, padded with empty boxes to a multiple of the largest group; its seconds are those at
        which the piece may be flown, in any wind or up to ``window_s`` early or late."""
        early_s, late_s = pieces.off_s(window_s)
        ends = pieces.places + pieces.velocity * (pieces.to_s - pieces.from_s)[:, None]
        size = -(-len(ends) // WHOLE) * WHOLE
        low, high = np.full((size, 4), np.inf), np.full((size, 4), -np.inf)
        low[: len(ends)] = np.column_stack([np.minimum(pieces.places, ends), pieces.from_s + early_s])
        high[: len(ends)] = np.column_stack([np.maximum(pieces.places, ends), pieces.to_s + late_s])
        return cls(low, high)

    def grouped(self) -> Boxes:
        """One box for each group of `GROUP` boxes."""
        return Boxes(
            self.low.reshape(-1, GROUP, 4).min(axis=1), self.high.reshape(-1, GROUP, 4).max(axis=1)
        )  # fmt: skip

    def levels(self) -> tuple[Boxes, ...]:
        """All levels: the largest groups first, the boxes themselves last."""
        out = [self]
        for _ in range(LEVELS):
            out.insert(0, out[0].grouped())
        return tuple(out)

    def joined(self, other: Boxes) -> Boxes:
        """These boxes, followed by others."""
        return Boxes(np.concatenate([self.low, other.low]), np.concatenate([self.high, other.high]))

    def grown(self, less: Floats, more: Floats) -> Boxes:
        """The boxes widened by ``less`` downwards and ``more`` upwards, (4,) each."""
        return Boxes(self.low - less, self.high + more)


def _touching(a: Boxes, i: Indices, b: Boxes, j: Indices) -> tuple[Indices, Indices]:
    """The pairs whose boxes touch, out of the pairs ``i`` of ``a`` with ``j`` of ``b`` (n,)."""
    for axis in (3, 0, 1, 2):
        touch = np.flatnonzero((b.high[j, axis] >= a.low[i, axis]) & (b.low[j, axis] <= a.high[i, axis]))
        i, j = i[touch], j[touch]
    return i, j


@dataclass(frozen=True, eq=False, slots=True)
class Spans:
    """Forbidden shifts, s: from ``low`` to ``high`` (n,), and the number ``who`` (n,) of the vehicle that is met."""

    low: Floats
    high: Floats
    who: Indices

    @classmethod
    def none(cls) -> Spans:
        """No forbidden shift."""
        return cls(np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.intp))

    def joined(self, other: Spans) -> Spans:
        """The spans of both."""
        return Spans(
            np.concatenate([self.low, other.low]),
            np.concatenate([self.high, other.high]),
            np.concatenate([self.who, other.who]),
        )

    def holds(self, shift_s: float) -> Bools:
        """(n,) whether each span forbids a shift."""
        return np.asarray((self.low < shift_s) & (shift_s < self.high))

    def free(self, shift_s: float) -> bool:
        """Whether a shift is allowed by all spans."""
        return not self.holds(shift_s).any()

    def least(self, low_s: float, high_s: float) -> float | None:
        """The allowed shift in [``low_s``, ``high_s``] with the least absolute value; None if all are forbidden."""
        # A little beyond each span: at the very end of a span, rounding would decide the next test.
        ends = np.concatenate([[0.0, low_s, high_s], self.low - EDGE_S, self.high + EDGE_S])
        ends = np.unique(ends[(ends >= low_s) & (ends <= high_s)])
        # An end is inside some open span exactly if more spans have begun before it than have ended at or before it.
        begun = np.searchsorted(np.sort(self.low), ends, side="left")
        ended = np.searchsorted(np.sort(self.high), ends, side="right")
        free = ends[begun <= ended]
        if not len(free):
            return None
        return float(free[np.lexsort((-free, np.abs(free)))[0]])


class Taken:
    """Motions that have priority, added one after the other."""

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self.paths: list[TimedPath] = []
        empty = np.zeros(0)
        self._pieces = Pieces(empty, empty, np.zeros((0, 3)), np.zeros((0, 3)))  # without drifts
        self._each: list[Pieces] = []  # of each vehicle, with drifts
        self._pads = np.zeros((0, 7))  # east and north of start and goal, begin, end, and whether it stands there after
        self._first: list[int] = []  # first piece of each vehicle; below, its first box
        self._first_box: list[int] = []
        self._levels = Boxes(np.zeros((0, 4)), np.zeros((0, 4))).levels()
        self._begun, self._ended = Drifts.none(0), Drifts.none(0)  # of each motion, where it begins and ends

    def add(self, path: TimedPath) -> None:
        """Give ``path`` priority over all that come later."""
        pieces = pieces_of(path)
        self._first.append(len(self._pieces.from_s))
        self._first_box.append(len(self._levels[-1].low))
        self._pieces = self._pieces.joined(pieces)
        self._each.append(pieces)
        levels = Boxes.of(pieces, self.rules.window_s).levels()
        self._levels = tuple(all_.joined(new) for all_, new in zip(self._levels, levels, strict=True))
        row = [*path.points[0, :2], *path.points[-1, :2], path.begin_s, path.end_s, float(self._lands(path))]
        self._pads = np.vstack([self._pads, row])
        self._begun, self._ended = self._begun.joined(path.begin_drifts), self._ended.joined(path.end_drifts)
        self.paths.append(path)

    def forbidden(self, path: TimedPath, low_s: float = 0.0, high_s: float = 0.0, spare_m: float = 0.0) -> Spans:
        """The shifts of ``path`` in [``low_s``, ``high_s``] that bring it too near to a vehicle with priority.

        Too near is less than the needed distance plus ``spare_m``, in the air or on a pad. A span may reach beyond the
        two ends.
        """
        needed_m = self.rules.needed_m - TOLERANCE_M + spare_m
        parts = [*self._in_the_air(path, low_s, high_s, needed_m), self._on_the_pads(path, needed_m)]
        low, high = (np.concatenate([p[k] for p in parts]).astype(np.float64) for k in (0, 1))
        who = np.concatenate([p[2] for p in parts]).astype(np.intp)
        low, high = low - EDGE_S, high + EDGE_S
        keep = (low <= high_s) & (high >= low_s)
        return Spans(low[keep], high[keep], who[keep])

    def _in_the_air(
        self, path: TimedPath, low_s: float, high_s: float, needed_m: float
    ) -> list[tuple[Floats, Floats, Indices]]:
        if not self.paths:
            return []
        near, own = needed_m, pieces_of(path)
        # Own boxes at any allowed shift, widened by the separation: whatever they do not touch is clear.
        less, more = np.array([near, near, near, -low_s]), np.array([near, near, near, high_s])
        levels = [boxes.grown(less, more) for boxes in Boxes.of(own, self.rules.window_s).levels()]
        mine, theirs = np.meshgrid(np.arange(len(levels[0].low)), np.arange(len(self._levels[0].low)), indexing="ij")
        a, b = _touching(levels[0], mine.ravel(), self._levels[0], theirs.ravel())
        return [self._met(own, i, j, needed_m) for i, j in self._descend(levels, a, b, 1)]

    def _descend(
        self, levels: Sequence[Boxes], a: Indices, b: Indices, level: int
    ) -> Iterator[tuple[Indices, Indices]]:
        """Pairs of pieces whose boxes touch, in blocks, within the pairs of groups (n,) of the level above."""
        step = np.arange(GROUP)
        for start in range(0, len(a), BLOCK):
            some = slice(start, start + BLOCK)
            zero = np.zeros((len(a[some]), GROUP, GROUP), dtype=np.intp)
            i = (zero + a[some, None, None] * GROUP + step[None, :, None]).ravel()
            j = (zero + b[some, None, None] * GROUP + step[None, None, :]).ravel()
            i, j = _touching(levels[level], i, self._levels[level], j)
            if level == LEVELS:
                yield i, j
            else:
                yield from self._descend(levels, i, j, level + 1)

    def _met(self, own: Pieces, a: Indices, box: Indices, needed_m: float) -> tuple[Floats, Floats, Indices]:
        who = np.searchsorted(self._first_box, box, side="right") - 1
        theirs = box - np.asarray(self._first_box, dtype=np.intp)[who]
        b = theirs + np.asarray(self._first, dtype=np.intp)[who]
        low, high = shifts(own.take(a), self._pieces.take(b), needed_m)
        met = low <= high
        low, high, a, theirs, who = low[met], high[met], a[met], theirs[met], who[met]
        for one in np.unique(who):
            rows = np.flatnonzero(who == one)
            sooner, later = own.apart_s(a[rows], self._each[one], theirs[rows], self.rules.window_s)
            low[rows] += sooner
            high[rows] += later
        return low, high, who

    def _on_the_pads(self, path: TimedPath, needed_m: float) -> tuple[Floats, Floats, Indices]:
        """Spans of shifts in which one vehicle takes off or lands beside another that stands on the ground."""
        if not self.paths:
            return np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.intp)
        starts, goals = self._pads[:, 0:2], self._pads[:, 2:4]
        begins, ends, lands = self._pads[:, 4], self._pads[:, 5], self._pads[:, 6] > 0.0
        mine = self._lands(path)
        clear = self.rules.pad_clear_s
        rows: list[tuple[Bools, Floats, Floats]] = []
        wide = 2.0 * self.rules.window_s

        def near(place: Floats, others: Floats) -> Bools:
            return np.asarray(np.hypot(others[:, 0] - place[0], others[:, 1] - place[1]) < needed_m)

        def drifts(mine: Drifts, theirs: Drifts) -> tuple[Floats, Floats]:
            low, high = between(mine, theirs)
            return (np.minimum(low, -wide), np.maximum(high, wide)) if wide else (low, high)

        never = np.full(len(begins), math.inf)
        start, goal, begin, end = path.points[0], path.points[-1], path.begin_s, path.end_s
        # In turn: another lands where this one waits and takes off; this one lands where another waits; both land.
        rows.append((lands & near(start, goals), ends - begin + drifts(path.begin_drifts, self._ended)[0], never))
        if mine:
            rows.append((near(goal, starts), -never, begins - end + drifts(path.end_drifts, self._begun)[1]))
            sooner, later = drifts(path.end_drifts, self._ended)
            rows.append((lands & near(goal, goals), ends - end - clear + sooner, ends - end + clear + later))
        who = np.concatenate([np.flatnonzero(hit) for hit, _, _ in rows])
        low = np.concatenate([a[hit] for hit, a, _ in rows])
        high = np.concatenate([b[hit] for hit, _, b in rows])
        return low, high, who.astype(np.intp)

    def _lands(self, path: TimedPath) -> bool:
        return not path.ends_in_air and path.name not in self.rules.leaving
