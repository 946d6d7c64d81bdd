"""Obstacles in height in the way of returns, and the levels at which returns pass them.

A return at the level ``h`` flies between a lowest and a highest altitude: *highest* is the greater of the level and the
altitude at which it begins, *lowest* depends on how the autopilot gets to its level. Ground is an obstacle without a
bottom, a ceiling one without a top; a zone may have both, one or neither. An obstacle is hit if the highest altitude is
above its bottom and the lowest below its top. Raising the level never brings a return below an obstacle again, so going
up from top to top finds the lowest level that passes all obstacles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices

TOUCH_M = 1e-6
GROUND, MAX_AMSL, MAX_AGL, AHEAD, UNKNOWN = -1, -2, -3, -4, -5
"""Values of `Obstacles.what` for obstacles that are no zones; `AHEAD`: ground where the vehicle brakes before it
returns; `UNKNOWN`: ground that is not known (`Obstacles.kind` alone)."""


@dataclass(frozen=True, eq=False)
class Obstacles:
    """R obstacles in the way of N returns, altitudes AMSL.

    ``high`` (N,): the highest altitude at which each return begins. For each obstacle (R,): ``back``, the index of its
    return; its bottom and top; ``base`` and ``limit``: the lowest altitude of the return there
    is ``max(base, min(h, limit))``; ``what``: `GROUND`, `AHEAD`, `MAX_AMSL`, `MAX_AGL` or a zone's index.
    """

    high: Floats
    back: Indices
    bottom: Floats
    top: Floats
    base: Floats
    limit: Floats
    what: Indices

    def __len__(self) -> int:
        return len(self.high)

    def hit(self, level: Floats | float) -> Bools:
        """(R,) whether each obstacle is hit at a level, or at one level per return (N,)."""
        h = np.broadcast_to(np.asarray(level, float), self.high.shape)[self.back]
        lowest = np.maximum(self.base, np.minimum(h, self.limit))
        return np.asarray((np.maximum(self.high[self.back], h) > self.bottom + TOUCH_M) & (lowest < self.top - TOUCH_M))

    def passes(self, level: Floats | float) -> Bools:
        """(N,) whether each return hits nothing."""
        ok = np.ones(len(self), np.bool_)
        ok[self.back[self.hit(level)]] = False
        return ok

    def lowest(self, start: float) -> Floats:
        """(N,) the lowest level at or above ``start`` that passes; inf if none does."""
        level = np.full(len(self), start)
        for _ in range(len(self.back) + 1):
            hit = np.flatnonzero(self.hit(level))
            if not len(hit):
                break
            np.maximum.at(level, self.back[hit], self._over(hit))
            done = np.isinf(level)
            if done[self.back[hit]].all():
                break
        return level

    def together(self, start: float, returns: Bools | None = None) -> float:
        """The lowest level at or above ``start`` that all of ``returns`` pass (default: all returns); inf if none."""
        mine = np.ones(len(self), np.bool_) if returns is None else returns
        level = start
        for _ in range(len(self.back) + 1):
            hit = np.flatnonzero(self.hit(level) & mine[self.back])
            if not len(hit):
                break
            level = max(level, float(self._over(hit).max()))
            if level == np.inf:
                break
        return level

    def highest(self, level: float) -> float:
        """The highest level to which ``level``, which passes all returns, may be raised; inf if nothing bounds it."""
        h = np.minimum(level, self.limit)
        under = np.maximum(self.base, h) < self.top - TOUCH_M
        return float(self.bottom[under].min(initial=np.inf))

    def kind(self) -> Indices:
        """(R,) `what` of each obstacle, with `UNKNOWN` for ground that is not known."""
        unknown = np.isinf(self.top) & ((self.what == GROUND) | (self.what == AHEAD))
        return np.where(unknown, UNKNOWN, self.what)

    def over(self) -> Floats:
        """(R,) the level that passes over each obstacle; inf if none does."""
        return self._over(np.arange(len(self.back)))

    def last_hit(self, start: float) -> Bools:
        """(R,) the obstacles that no level passes over, hit by returns that rise from ``start`` until nothing helps."""
        level, over = np.full(len(self), start), self.over()
        for _ in range(len(self.back) + 1):
            hit = self.hit(level)
            more = hit & np.isfinite(over) & (over > level[self.back])
            if not more.any():
                return hit & np.isinf(over)
            np.maximum.at(level, self.back[more], over[more])
        return np.zeros(len(self.back), np.bool_)

    def _over(self, rows: Indices) -> Floats:
        """The level that passes over each obstacle of ``rows``; inf if none does."""
        return np.where(self.top[rows] <= self.limit[rows], self.top[rows], np.inf)

    def take(self, returns: Bools) -> Obstacles:
        """The obstacles of the returns that are True in ``returns``."""
        number = np.cumsum(returns) - 1
        rows = returns[self.back]
        return Obstacles(
            self.high[returns], number[self.back[rows]], self.bottom[rows], self.top[rows], self.base[rows],
            self.limit[rows], self.what[rows],
        )  # fmt: skip

    @classmethod
    def join(cls, parts: Sequence[Obstacles]) -> Obstacles:
        """The obstacles of all parts, with their returns numbered one part after the other."""
        offset = np.cumsum([0, *(len(p) for p in parts)])
        back = np.concatenate([p.back + o for p, o in zip(parts, offset[:-1], strict=True)])
        names = ("bottom", "top", "base", "limit", "what")
        return cls(
            np.concatenate([p.high for p in parts]),
            back,
            *(np.concatenate([getattr(p, name) for p in parts]) for name in names),
        )

    def ordered(self, order: Indices) -> Obstacles:
        """The same obstacles with the returns in another order."""
        place = np.empty(len(order), np.intp)
        place[order] = np.arange(len(order))
        return Obstacles(self.high[order], place[self.back], self.bottom, self.top, self.base, self.limit, self.what)
