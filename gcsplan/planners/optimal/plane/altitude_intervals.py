"""Which altitude intervals a short enough track can reach, and continue from to the goal, within the climb limits.

Over each cell of a mesh, the ground below and the zones leave intervals of altitudes that can be flown at.

After s metres of its track a path is at altitude z. If it climbs no steeper than c and descends no steeper than d, then
z - c s never rises and z + d s never falls. Nor do s - r and s + t ever fall, where r and t are the lengths of the
shortest tracks from the start and to the goal past certain obstacles. In an interval, z lies within it
and s is at least the shortest track to it; so each interval limits these four quantities. The extreme value of each on
arrival belongs to the chain of intervals whose worst member is best, found like a shortest path. An interval is shut if
by these values no altitude in it can be reached in time, or the goal cannot be reached from it; shut intervals restrict
the others. If none is left, no track is that short.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Bools, Floats, Int32s, Int64s
from gcsplan.planners.optimal.navmesh.interval_kernels import cut_intervals, spread
from gcsplan.planners.optimal.navmesh.mesh import Mesh
from gcsplan.world.geometry.limits import Limits

MOST_INTERVALS = 4
"""Most intervals over one cell; zones that would make more are ignored."""


INTERVAL_SPARE_M = 1e-3
"""Metres by which intervals and the altitudes of the ends are widened, for rounding and for intervals that touch."""
KEPT = 4
"""Most track lengths for which all intervals are cached."""
ROUNDS, WORTHWHILE = 4, 0.01
"""Most rounds of shutting intervals, and the part of the intervals that a round must shut for another to follow."""


def ranges(mesh: Mesh, top_m: float, cells: Int64s) -> tuple[Floats, Floats]:
    """(K,) the lowest and the highest altitude, at most ``top_m``, that can be flown at in each of ``cells`` (K,);
    lowest above highest where there is none. ``mesh`` must be for bounds and as fine as its plane."""
    low, high = mesh.lowest(cells), np.full(len(cells), top_m)
    count, lows, highs = intervals(mesh, cells, low, high, 0.0)
    there = np.arange(MOST_INTERVALS) < count[:, None]
    return np.where(there, lows, np.inf).min(axis=1), np.where(there, highs, -np.inf).max(axis=1)


def intervals(
    mesh: Mesh, cells: Int64s, low_m: Floats, high_m: Floats, spare_m: float
) -> tuple[Int32s, Floats, Floats]:
    """Cut the range of each of ``cells``, ``low_m`` to ``high_m`` from `ranges`, into the altitude intervals that zones
    leave.

    Returns the number of intervals (K,), at most `MOST_INTERVALS`, and their lower and upper ends (K,
    `MOST_INTERVALS`), each ``spare_m`` further out. ``mesh``: as for `ranges`.
    """
    low, high = np.empty((len(cells), MOST_INTERVALS)), np.empty((len(cells), MOST_INTERVALS))
    low[:, 0], high[:, 0] = low_m - spare_m, high_m + spare_m
    count = (low_m <= high_m).astype(np.int32)
    number = np.full(len(mesh.piece), -1, np.int32)
    number[cells] = np.arange(len(cells))
    cut_intervals(*_laid(mesh), spare_m, number, count, low, high)
    return count, low, high


def _laid(mesh: Mesh) -> tuple[Floats, Floats, Floats, Floats, Floats, Int32s, bool, float, float]:
    """The input of the zone kernels: ground, x and y of the mesh's nodes, numbers and forms of the shapes that are
    certainly shut, their boxes on the mesh, whether the ground is the terrain model's own, and `Plane.reach_m`."""
    plane, (rows, cols) = mesh.plane, mesh.excess.shape
    ground = np.ascontiguousarray(plane.grounds[0][mesh.row : mesh.row + rows, mesh.col : mesh.col + cols])
    boxes = plane.boxes(mesh.row, mesh.col, 1, rows, cols)
    return ground, *mesh.places(), *plane.shapes.low, boxes, plane.stride == 1, *plane.reach_m(True)


@dataclass(frozen=True, eq=False, slots=True)
class Terminal:
    """Where a track begins or ends: the cells that the place may lie in, and its altitude, known to ``off_m`` metres;
    None if that is free."""

    cells: Int64s
    amsl_m: float | None
    off_m: float = 0.0


@dataclass(frozen=True, eq=False, slots=True)
class AltitudeIntervals:
    """Altitude intervals of a lattice's cells, and bounds for the tracks up to some length that enter them.

    ``shape``: rows and columns of cells; ``cell`` (N,), rising: the cell of each interval. For each interval (N,):
    ``low_m`` and ``high_m``, the lowest and the highest altitude; ``away_m`` and ``left_m``, least metres of track from
    the start to it and from it to the goal. ``from_start_m`` and ``to_goal_m`` (N, 2): least and greatest length of the
    shortest tracks in the plane between ``start`` or ``goal`` and the places in the cell that such tracks meet.
    """

    shape: tuple[int, int]
    cell: Int64s
    low_m: Floats
    high_m: Floats
    away_m: Floats
    left_m: Floats
    from_start_m: Floats
    to_goal_m: Floats
    start: Terminal
    goal: Terminal

    @property
    def cells(self) -> Bools:
        """(rows, cols) which cells have an interval."""
        out = np.zeros(self.shape, np.bool_)
        out.ravel()[self.cell] = True
        return out

    def only(self, which: Bools) -> AltitudeIntervals:
        """The intervals ``which`` (N,) selects."""
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
        """The intervals, or the parts of them, that tracks shorter than ``limit_m`` may enter; none if it is proved
        that there is no such track."""
        # The slopes are raised by the rounding of the angle, so that a path exactly at the limit counts.
        up, down = (k + 1e-8 * (1.0 + k * k) for k in (limits.max_climb_slope, limits.max_descent_slope))
        now = self.only((self.away_m + self.left_m <= limit_m) & (self.low_m <= self.high_m))
        for _ in range(ROUNDS):
            before = len(now.cell)
            now = now._there(up, down, limit_m)._back()._there(down, up, limit_m)._back()
            if len(now.cell) > (1.0 - WORTHWHILE) * before:
                break
        return now

    def _back(self) -> AltitudeIntervals:
        """The same intervals with start and goal exchanged."""
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
        """The intervals that can be reached from the start with slopes of at most ``up`` and ``down``; ``low_m``,
        ``high_m`` and ``away_m`` are narrowed accordingly."""
        if not len(self.cell):
            return self
        count = np.bincount(self.cell, minlength=self.shape[0] * self.shape[1])
        first = np.concatenate([np.zeros(1, np.int64), np.cumsum(count)])
        sources = np.concatenate([np.arange(first[k], first[k + 1]) for k in self.start.cells.tolist()])
        n = len(self.cell) + 1
        room = np.empty(n), np.empty(n, np.int32), np.empty(n, np.int64)
        low, high, away = self.low_m, self.high_m, self.away_m.copy()
        latest, z, shut = limit_m - self.left_m, self.start.amsl_m, np.zeros(n - 1, np.bool_)
        off_m = self.start.off_m + INTERVAL_SPARE_M

        def least(own: Floats, most: Floats, begin: float) -> Floats:
            nonlocal shut
            out = np.full(n - 1, np.inf)
            own, most = np.where(shut, np.inf, own), np.where(shut, -np.inf, most)
            spread(first, self.cell, self.shape[1], low, high, own, most, sources, begin, out, *room)
            shut = out == np.inf
            return np.where(shut, 0.0, out)

        near, far = self.from_start_m.T
        away = np.maximum(away, least(away - far, latest - near, -math.inf) + near)
        near, far = self.to_goal_m.T
        away = np.maximum(away, least(away + near, latest + far, -math.inf) - far)
        falls = rises = None
        if math.isfinite(up):
            begin = -math.inf if z is None else -z - off_m
            falls = -least(up * away - high, up * latest - low, begin)
            away, high = np.maximum(away, (low - falls) / up), np.minimum(high, falls + up * latest)
        if math.isfinite(down):
            begin = -math.inf if z is None else z - off_m
            rises = least(low + down * away, high + down * latest, begin)
            away, low = np.maximum(away, (rises - high) / down), np.maximum(low, rises - down * latest)
        if falls is not None and rises is not None:
            away = np.maximum(away, (rises - falls) / (up + down))
        left = ~shut & (away <= latest + INTERVAL_SPARE_M) & (low <= high)
        return replace(self, low_m=low, high_m=high, away_m=away).only(left)


class Reached:
    """Cache of the altitude intervals that tracks up to several lengths may enter; each length starts from the
    intervals of a longer one.

    ``every``: the intervals that tracks shorter than ``limit_m`` may meet.
    """

    def __init__(self, every: AltitudeIntervals, limits: Limits, limit_m: float) -> None:
        self._limits, self._most_m = limits, limit_m
        self._known: dict[float, AltitudeIntervals] = {limit_m: every}
        self._computed: set[float] = set()
        self.looked_at = 0
        """Intervals that the last call of `within` began with."""

    def known(self, limit_m: float) -> AltitudeIntervals:
        """The intervals that tracks shorter than ``limit_m`` may enter by the results so far."""
        return self._known[min(m for m in self._known if m >= limit_m)]

    def within(self, limit_m: float, near: Bools) -> AltitudeIntervals:
        """`known`, computed for this very length, of the cells that are ``near`` (cells,)."""
        self.looked_at = 0
        if limit_m in self._computed and limit_m in self._known:
            return self._known[limit_m]
        self._computed.add(limit_m)
        found = self.known(limit_m)
        found = found.only(near[found.cell])
        self.looked_at = len(found.cell)
        found = self._known[limit_m] = found.reached(self._limits, limit_m)
        if len(self._known) > KEPT:
            del self._known[next(m for m in self._known if m not in (self._most_m, limit_m))]
        return found
