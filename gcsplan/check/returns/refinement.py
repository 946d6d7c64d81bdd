"""Refinement: split parts of a mission until it is known from where the return is safe, and at which level.

Each part of the trace is judged twice: with the return from its middle alone, which can only be too lenient, and with
the returns from all of it, which can only be too strict. Parts are split where the two results differ in a way that
matters, and where safe and unsafe parts meet. A smallest part on which the two still differ counts as unsafe.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gcsplan.arrays import Bools
from gcsplan.check.returns.obstacles import GradedObstacles, Obstacles
from gcsplan.check.returns.trace import MissionTrace, TraceParts

JudgeParts = Callable[[TraceParts, bool], GradedObstacles]
"""``judge(parts, whole)``: see `obstacles.obstacles_of_returns`."""

CLEAR, LEGAL = 0, 1
FIRST_PIECES = 120_000  # pieces of ground for the first parts, about; sets their size
MOST_PIECES_OF_GROUND = 1_500_000  # of ground; beyond this nothing is split further
COARSE_M, COARSEST_M = 64.0, 400.0
SMALLEST_PART_M = 4.0
"""Parts shorter than this, m, are not split."""

COARSER = 4.0
"""The smallest parts are this many times longer for the grade `LEGAL`: else a mission at its lowest legal height would
be split along its whole length."""

LEAST_PARTS, SMALLER = 30, 16.0
"""Least number of parts of a short mission at first, and how many times smaller its smallest parts are."""

SPLIT_PIECES = 4
LEVEL_M = 0.5
"""The lowest level is found to within this, m."""


class Refinement:
    """``parts``, ``strict`` and ``lenient`` correspond, in the order of the trace; ``start``: the lowest level."""

    def __init__(
        self,
        trace: MissionTrace,
        judge: JudgeParts,
        start: float,
        levels: tuple[float, ...],
        size_m: float,
        smallest_m: float,
    ) -> None:
        self.judge, self.start, self.levels = judge, start, levels
        self.first_m, self.smallest_m = size_m, smallest_m
        self.parts = trace.cut(size_m)
        self.strict, self.lenient = judge(self.parts, True), judge(self.parts, False)
        self.cost = self.strict.cost + self.lenient.cost
        self.stopped_early = False
        while (open_ := self._open()).any():
            if self.cost > MOST_PIECES_OF_GROUND:
                self.stopped_early = True
                break
            self._split(open_)

    def never(self, grade: int) -> Bools:
        """(N,) whether no level passes from each part."""
        return np.isinf(self.strict[grade].lowest(self.start))

    def bad(self, grade: int, level: float) -> Bools:
        """(N,) whether the return at ``level`` from each part does not pass."""
        return ~self.strict[grade].passes(level)

    def _open(self) -> Bools:
        found = np.zeros(len(self.parts), np.bool_)
        for grade, least_m in ((LEGAL, COARSER * self.smallest_m), (CLEAR, self.smallest_m)):
            strict, lenient = self.strict[grade], self.lenient[grade]
            never, never_lenient = self.never(grade), np.isinf(lenient.lowest(self.start))
            found |= self._between(never, never_lenient)
            for level in self.levels:
                found |= self._between(~strict.passes(level), ~lenient.passes(level))
            least = lenient.together(self.start, ~never_lenient)
            if np.isfinite(least) and strict.together(self.start, ~never) > least + LEVEL_M:
                found |= ~strict.passes(least + LEVEL_M) & ~never
            found &= self.parts.size > least_m
        return found

    @staticmethod
    def _between(bad: Bools, bad_lenient: Bools) -> Bools:
        """Unsafe parts that may be partly safe: safe in the middle, or next to a safe part."""
        beside = np.zeros(len(bad), np.bool_)
        beside[1:] |= ~bad[:-1]
        beside[:-1] |= ~bad[1:]
        return bad & (~bad_lenient | beside)

    def _split(self, chosen: Bools) -> None:
        new = self.parts.take(chosen).split(SPLIT_PIECES)
        strict, lenient = self.judge(new, True), self.judge(new, False)
        self.cost += strict.cost + lenient.cost
        start = np.concatenate([self.parts.start[~chosen], new.start])
        order = np.argsort(start, kind="stable")
        ends = np.concatenate([self.parts.end[~chosen], new.end])
        stretches = np.concatenate([self.parts.stretch[~chosen], new.stretch])
        self.parts = TraceParts(start[order], ends[order], stretches[order])

        def joined(old: GradedObstacles, more: GradedObstacles) -> GradedObstacles:
            kept = old.take(~chosen)
            clear, legal = (Obstacles.join([kept[g], more[g]]).ordered(order) for g in (CLEAR, LEGAL))
            return GradedObstacles(clear, legal, 0)

        self.strict, self.lenient = joined(self.strict, strict), joined(self.lenient, lenient)


def pieces_of(away_m: float, cell_m: float) -> float:
    """About how many pieces of ground a return of ``away_m`` has over cells of ``cell_m``."""
    return 2.5 * (away_m / cell_m + 1.0)


def sizes_m(trace: MissionTrace, away_m: float, cell_m: float) -> tuple[float, float]:
    """Length of the first parts and of the smallest, m, for returns ``away_m`` long over cells of ``cell_m``."""
    length = float((trace.last - trace.first).sum())
    first = np.clip(length * pieces_of(away_m, cell_m) / FIRST_PIECES, COARSE_M, COARSEST_M)
    first = min(float(first), max(length, 1e-3) / LEAST_PARTS)
    return first, min(SMALLEST_PART_M, first / SMALLER)
