"""Looking closer at a mission's returns until it is known from where they are safe, and at which level.

Each part of the trail is judged twice: with the return from its middle alone, which can only be too kind, and with the
returns from all of it, which can only be too strict. Where the two differ in what matters, and where good and bad
parts meet, parts are cut into smaller ones. What stays open in the smallest counts as unsafe.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gcsplan.arrays import Bools
from gcsplan.check.rtl.rules import Returns
from gcsplan.check.rtl.trail import Cuts, Trail
from gcsplan.check.rtl.walls import Walls

Judge = Callable[[Cuts, bool], Returns]
"""``judge(cuts, whole)``: see `rules.returns`."""

CLEAR, LEGAL = 0, 1
FIRST_PIECES = 120_000  # of ground, on which the size of the first parts is laid out
MOST_PIECES = 1_500_000  # after which nothing is cut further
COARSE_M, COARSEST_M = 64.0, 400.0
SMALLEST_M = 4.0
"""Parts are not cut below this."""

COARSER = 4.0
"""By how much coarser the softer grade is looked at: a mission that hugs its least height is open all along."""

LEAST_PARTS, SMALLER = 30, 16.0
"""Into so many a short mission is cut at first, and so much smaller than its first parts are the smallest."""

PIECES = 4
LEVEL_M = 0.5
"""How near to the truth the lowest level is brought."""


class Study:
    """``cuts``, ``strict`` and ``kind`` belong together, in the order of the trail; ``start`` is the lowest level."""

    def __init__(
        self, trail: Trail, judge: Judge, start: float, levels: tuple[float, ...], size_m: float, smallest_m: float
    ) -> None:
        self.judge, self.start, self.levels = judge, start, levels
        self.first_m, self.smallest_m = size_m, smallest_m
        self.cuts = trail.cut(size_m)
        self.strict, self.kind = judge(self.cuts, True), judge(self.cuts, False)
        self.cost = self.strict.cost + self.kind.cost
        self.given_up = False
        while (open_ := self._open()).any():
            if self.cost > MOST_PIECES:
                self.given_up = True
                break
            self._split(open_)

    def never(self, grade: int) -> Bools:
        """(N,) parts from which no level passes."""
        return np.isinf(self.strict[grade].lowest(self.start))

    def bad(self, grade: int, level: float) -> Bools:
        """(N,) parts from which the return at ``level`` does not pass."""
        return ~self.strict[grade].passes(level)

    def _open(self) -> Bools:
        found = np.zeros(len(self.cuts), np.bool_)
        for grade, least_m in ((LEGAL, COARSER * self.smallest_m), (CLEAR, self.smallest_m)):
            strict, kind = self.strict[grade], self.kind[grade]
            never, never_kind = self.never(grade), np.isinf(kind.lowest(self.start))
            found |= self._between(never, never_kind)
            for level in self.levels:
                found |= self._between(~strict.passes(level), ~kind.passes(level))
            least = kind.together(self.start, ~never_kind)
            if np.isfinite(least) and strict.together(self.start, ~never) > least + LEVEL_M:
                found |= ~strict.passes(least + LEVEL_M) & ~never
            found &= self.cuts.size > least_m
        return found

    @staticmethod
    def _between(bad: Bools, bad_kind: Bools) -> Bools:
        """Bad parts that may be good in part: good in the middle, or beside a good one."""
        beside = np.zeros(len(bad), np.bool_)
        beside[1:] |= ~bad[:-1]
        beside[:-1] |= ~bad[1:]
        return bad & (~bad_kind | beside)

    def _split(self, parts: Bools) -> None:
        new = self.cuts.take(parts).split(PIECES)
        strict, kind = self.judge(new, True), self.judge(new, False)
        self.cost += strict.cost + kind.cost
        start = np.concatenate([self.cuts.start[~parts], new.start])
        order = np.argsort(start, kind="stable")
        ends = np.concatenate([self.cuts.end[~parts], new.end])
        stretches = np.concatenate([self.cuts.stretch[~parts], new.stretch])
        self.cuts = Cuts(start[order], ends[order], stretches[order])

        def joined(old: Returns, more: Returns) -> Returns:
            kept = old.take(~parts)
            clear, legal = (Walls.join([kept[g], more[g]]).ordered(order) for g in (CLEAR, LEGAL))
            return Returns(clear, legal, 0)

        self.strict, self.kind = joined(self.strict, strict), joined(self.kind, kind)


def sizes_m(trail: Trail, away_m: float, cell_m: float) -> tuple[float, float]:
    """How long the first parts are, and the smallest: of returns ``away_m`` long over cells of ``cell_m``."""
    length = float((trail.last - trail.first).sum())
    first = np.clip(length * 2.5 * (away_m / cell_m + 1.0) / FIRST_PIECES, COARSE_M, COARSEST_M)
    first = min(float(first), max(length, 1e-3) / LEAST_PARTS)
    return first, min(SMALLEST_M, first / SMALLER)
