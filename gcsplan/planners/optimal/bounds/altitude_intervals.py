"""Which intervals a track that is short enough can get to, and on from, by what it can climb and descend.

Flown for s metres of its track, a path that climbs no steeper than c and descends no steeper than d is at z, and
z - c s only falls, z + d s only rises. So does s - r, r metres straight from the start, and s + t, t metres straight
to the goal. In an interval a path is no higher than that is, and has flown no less than the shortest way there. So
the most, or the least, that each of these can be in an interval is that of the way there whose worst interval is best,
and is found as shortest ways are. Where by these no altitude of an interval can be had in time, nor from there the
goal's, it is shut; and what is shut leaves others less. Where nothing is left, no track is so short.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.navmesh.interval_kernels import spread
from gcsplan.world.limits import Limits

Ints = NDArray[np.int64]

MOST = 4
"""Intervals over one cell, at most; zones that would make more are as if they were not."""
SPARE_M = 1e-3
"""By how much intervals are wider, and ends higher and lower, than they are: for rounding, and for what touches."""
KEPT = 4
"""Lengths of which all intervals are kept, at most."""
ROUNDS, WORTHWHILE = 4, 0.01
"""Times that what is shut is taken account of, and what part of the intervals must have been shut to go on."""


@dataclass(frozen=True, eq=False, slots=True)
class Terminal:
    """Where a track begins or ends: the cells that the place may lie in, and how high; None where that is free."""

    cells: Ints
    amsl_m: float | None


@dataclass(frozen=True, eq=False, slots=True)
class AltitudeIntervals:
    """Altitude intervals of a lattice's cells, and what is known of tracks shorter than some length that enter them.

    ``shape`` rows and columns of cells; ``cell`` (N,) rising, whose interval each is. Of the intervals (N,): the lowest
    and the highest altitude there; how long the ways there and on are at least; and how far the cells' middles are
    straight from ``start`` and ``goal``, of which no other place of theirs is nearer or farther by more than
    ``half_m``.
    """

    shape: tuple[int, int]
    cell: Ints
    low_m: Floats
    high_m: Floats
    away_m: Floats
    left_m: Floats
    from_start_m: Floats
    to_goal_m: Floats
    half_m: float
    start: Terminal
    goal: Terminal

    @property
    def cells(self) -> Bools:
        """(rows, cols) those that have one."""
        out = np.zeros(self.shape, np.bool_)
        out.ravel()[self.cell] = True
        return out

    def only(self, which: Bools) -> AltitudeIntervals:
        """Some of them."""
        return replace(
            self,
            cell=self.cell[which],
            low_m=self.low_m[which],
            high_m=self.high_m[which],
            away_m=self.away_m[which],
            left_m=self.left_m[which],
            from_start_m=self.from_start_m[which],
            to_goal_m=self.to_goal_m[which],
        )

    def reached(self, limits: Limits, limit_m: float) -> AltitudeIntervals:
        """Those that tracks shorter than ``limit_m`` may enter, and what of them; none where there is no such track."""
        # An angle that is exceeded by less than its float noise is kept.
        up, down = (k + 1e-8 * (1.0 + k * k) for k in (limits.max_climb_slope, limits.max_descent_slope))
        now = self.only((self.away_m + self.left_m <= limit_m) & (self.low_m <= self.high_m))
        for _ in range(ROUNDS):
            before = len(now.cell)
            now = now._there(up, down, limit_m)._back()._there(down, up, limit_m)._back()
            if len(now.cell) > (1.0 - WORTHWHILE) * before:
                break
        return now

    def _back(self) -> AltitudeIntervals:
        """The same for who comes from the goal."""
        return replace(
            self,
            away_m=self.left_m,
            left_m=self.away_m,
            from_start_m=self.to_goal_m,
            to_goal_m=self.from_start_m,
            start=self.goal,
            goal=self.start,
        )

    def _there(self, up: float, down: float, limit_m: float) -> AltitudeIntervals:
        """What is left of them, and how long the ways there are, by what climbs and descends from the start."""
        if not len(self.cell):
            return self
        first = np.searchsorted(self.cell, np.arange(self.shape[0] * self.shape[1] + 1))
        sources = np.concatenate([np.arange(first[k], first[k + 1]) for k in self.start.cells.tolist()])
        n = len(self.cell) + 1
        room = np.empty(n), np.empty(n, np.int32), np.empty(n, np.int64)
        low, high, away = self.low_m, self.high_m, self.away_m.copy()
        latest, z, shut = limit_m - self.left_m, self.start.amsl_m, np.zeros(n - 1, np.bool_)

        def least(own: Floats, most: Floats, begin: float) -> Floats:
            nonlocal shut
            out = np.full(n - 1, np.inf)
            own, most = np.where(shut, np.inf, own), np.where(shut, -np.inf, most)
            spread(first, self.cell, self.shape[1], low, high, own, most, sources, begin, out, *room)
            shut = out == np.inf
            return np.where(shut, 0.0, out)

        near, far = self.from_start_m - self.half_m, self.from_start_m + self.half_m
        away = np.maximum(away, least(away - far, latest - near, -math.inf) + near)
        near, far = self.to_goal_m - self.half_m, self.to_goal_m + self.half_m
        away = np.maximum(away, least(away + near, latest + far, -math.inf) - far)
        falls = rises = None
        if math.isfinite(up):
            begin = -math.inf if z is None else -z - SPARE_M
            falls = -least(up * away - high, up * latest - low, begin)
            away, high = np.maximum(away, (low - falls) / up), np.minimum(high, falls + up * latest)
        if math.isfinite(down):
            begin = -math.inf if z is None else z - SPARE_M
            rises = least(low + down * away, high + down * latest, begin)
            away, low = np.maximum(away, (rises - high) / down), np.maximum(low, rises - down * latest)
        if falls is not None and rises is not None:
            away = np.maximum(away, (rises - falls) / (up + down))
        left = ~shut & (away <= latest + SPARE_M) & (low <= high)
        return replace(self, low_m=low, high_m=high, away_m=away).only(left)


class Reached:
    """Altitude intervals that tracks shorter than some lengths may enter; what is known of longer ones helps.

    ``every``: what tracks shorter than ``limit_m`` may meet.
    """

    def __init__(self, every: AltitudeIntervals, limits: Limits, limit_m: float) -> None:
        self._limits, self._most_m = limits, limit_m
        self._known: dict[float, AltitudeIntervals] = {limit_m: every}
        self._asked: set[float] = set()

    def known(self, limit_m: float, near: Bools) -> AltitudeIntervals:
        """Those that tracks so long may enter, as far as is known by now, of cells that are ``near`` (cells,)."""
        found = self._known[min(m for m in self._known if m >= limit_m)]
        return found.only(near[found.cell])

    def within(self, limit_m: float, near: Bools) -> AltitudeIntervals:
        """The same of one length, looked at."""
        if limit_m in self._asked and limit_m in self._known:
            return self._known[limit_m]
        self._asked.add(limit_m)
        found = self._known[limit_m] = self.known(limit_m, near).reached(self._limits, limit_m)
        if len(self._known) > KEPT:
            del self._known[next(m for m in self._known if m not in (self._most_m, limit_m))]
        return found
