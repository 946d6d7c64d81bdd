"""The earliest and the latest time at each point of a flight, over all winds of a set.

One wind of the set blows during the whole flight, so the shares are searched (branch and bound): the times of a cell of
shares are bounded by the speeds that its winds allow each part (`_within`). Cells that may hold an extreme are halved
until both ends of all times are known within `PART` of the time, `OF_WIDTH` of the window, or `WITHIN_S`, or until
`MOST_WIND_CELLS` are looked at; what is not known then counts outward.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.wind.ability import ADVANCES_M_S, SpeedBounds, WindsAlong
from gcsplan.wind.declared import DeclaredWind

__all__ = ["FlightClock", "TimeWindow", "Witnessed", "cover", "slowest_m_s", "window", "witnessed"]

PART, OF_WIDTH, WITHIN_S = 1e-3, 0.03, 0.05
MOST_WIND_CELLS = 128
_TURNS = 8
_FINE = 128
WITNESS_M_S, MOST_SPEEDS, MOST_TURNS = 1.0, 5, 24
"""A cell of `witnesses` spans at most about this, with no more cells of speeds and of directions than these."""
CELL_GROUPS = 16
"""Groups of neighbouring cells of `witnesses` for which the motion is computed."""

_ONE = np.zeros((1, 2, 2))


@dataclass(frozen=True, eq=False, slots=True)
class TimeWindow:
    """(..., N) the earliest and the latest time at each of N points, seconds after the departure."""

    earliest_s: Floats
    latest_s: Floats


class FlightClock(Protocol):
    """The times of a flight at N points, for speeds over ground (..., P) of its parts.

    Where the wind depends on the height, several parts are pieces of one leg, which is flown at one largest speed.
    """

    @property
    def run_m(self) -> Floats:
        """(P,) the parts' lengths over ground."""

    def even_m_s(self, slow_m_s: Floats, fast_m_s: Floats) -> tuple[Floats, Floats]:
        """(..., P) the lowest and the highest speed of all pieces of each part's leg."""

    def between(self, slow_m_s: Floats, fast_m_s: Floats) -> TimeWindow:
        """The window where each part is flown at most at a speed between two; these are even."""

    def summed(self, seconds: Floats) -> Floats:
        """(..., N) the sums of seconds of parts (..., P) up to each point, with all rounds."""

    def loose_s(self, slow_m_s: Floats, fast_m_s: Floats) -> Floats:
        """(..., N) by how much the seconds beyond the parts' lengths over speeds may at most fall, where speeds rise
        from the first to the second."""


def cover(wind: DeclaredWind) -> Floats:
    """(K, 2, 2) cells of all shares of a set: all speeds together, the directions in parts."""
    if wind.single:
        return _ONE
    ends = np.linspace(0.0, 1.0, _FINE + 1)
    direction = np.column_stack([ends[:-1], ends[1:]])
    return np.stack([np.broadcast_to([0.0, 1.0], direction.shape), direction], axis=1)


def window(winds: WindsAlong, clock: FlightClock) -> TimeWindow:
    """The window at each point that ``clock`` tells of, by the speeds that ``winds`` allow."""
    if not (winds.wind.single or winds.wind.varying):
        return _searched(winds, clock)
    slow, fast = winds.speeds_m_s(cover(winds.wind))
    slow, fast = np.fmax(slow, ADVANCES_M_S).min(axis=0), fast.max(axis=0)
    return _nearer(clock, slow, fast, clock.summed(clock.run_m / fast), clock.summed(clock.run_m / slow))


def _nearer(clock: FlightClock, slow: Floats, fast: Floats, early: Floats, late: Floats) -> TimeWindow:
    """The bounds of the times with the parts' speeds (..., P) between two, and with the sums of their lengths over
    speeds (..., N) between two.

    They lie between the times at the legs' highest and lowest speeds. Nearer: what a flight takes beyond that sum
    hardly falls where speeds rise.
    """
    low, high = clock.even_m_s(slow, fast)
    rough, loose_s = clock.between(low, high), clock.loose_s(low, high)
    earliest_s = rough.latest_s - clock.summed(clock.run_m / low) + early - loose_s
    latest_s = rough.earliest_s - clock.summed(clock.run_m / high) + late + loose_s
    return TimeWindow(
        np.maximum(rough.earliest_s, np.minimum(earliest_s, rough.latest_s)),
        np.minimum(rough.latest_s, np.maximum(latest_s, rough.earliest_s)),
    )  # fmt: skip


def _within(winds: WindsAlong, clock: FlightClock, cells: Floats) -> list[TimeWindow]:
    """The bounds of the times with one wind of each cell during the whole flight.

    The sum of lengths over speeds is convex in the wind, so no more than at a corner, and no less than its tangent.
    """
    corner, fast, early, late = _sums(winds.bounds(cells), winds, clock)
    found = _nearer(clock, corner.min(axis=1), fast, early.min(axis=1), late.max(axis=1))
    return [TimeWindow(*row) for row in zip(found.earliest_s, found.latest_s, strict=True)]


def _sums(found: SpeedBounds, winds: WindsAlong, clock: FlightClock) -> tuple[Floats, Floats, Floats, Floats]:
    """Speeds (K, 4, P) at the corners of K cells, (K, P) the highest, and bounds (K, 4, N) of the sums of lengths
    over speeds: with a mean of the corners' winds, a sum is between the same means of the two bounds."""
    most = winds.ability.most_m_s
    corner = np.fmax(found.corner_m_s, ADVANCES_M_S)  # whoever flies at all is so fast
    fast = np.minimum(found.top_m_s + found.beyond_m_s.max(axis=1), most)
    top = np.minimum(found.top_m_s, most)
    falls = np.where(found.top_m_s < most, clock.run_m / top**2, 0.0)[:, None] * found.beyond_m_s
    early = clock.summed(clock.run_m / top)[:, None] - clock.summed(falls)
    return corner, fast, early, clock.summed(clock.run_m / corner)


@dataclass(frozen=True, eq=False, slots=True)
class Witnessed:
    """Bounds at Q witnesses, whose means bound any wind of the set, as `gcsplan.wind.drift` counts them.

    ``earliest_s``, ``latest_s`` (Q, N) are times. ``slower``, ``faster`` (Q, P): by which part of the seconds at
    ``still_m_s`` a part may take longer, and shorter.
    """

    earliest_s: Floats
    latest_s: Floats
    slower: Floats
    faster: Floats


def witnessed(winds: WindsAlong, clock: FlightClock, still_m_s: Floats) -> Witnessed:
    """The bounds at the corners of all cells of `witnesses`, or of the whole set where it is not cut."""
    if winds.wind.single or winds.wind.varying:
        slow, fast = winds.speeds_m_s(cover(winds.wind))
        slow, fast = np.fmax(slow, ADVANCES_M_S).min(axis=0), fast.max(axis=0)
        return _alike(clock.between(*clock.even_m_s(slow, fast)), slow, fast, still_m_s)
    found = winds.bounds(witnesses(winds.wind))
    corner, fast, early, late = _sums(found, winds, clock)
    slow = corner.min(axis=1)
    if (slow == fast[0]).all() and (fast == fast[0]).all():
        at = clock.between(*clock.even_m_s(slow[0], fast[0]))
        return _alike(at, slow.min(axis=0), fast.max(axis=0), still_m_s)
    # The motion is computed for neighbouring cells together: it is what takes the time.
    groups = np.array_split(np.arange(len(fast)), min(CELL_GROUPS, len(fast)))
    low, high = clock.even_m_s(*(np.array(each) for each in (
        [slow[some].min(axis=0) for some in groups], [fast[some].max(axis=0) for some in groups],
    )))  # fmt: skip
    rough, loose_s = clock.between(low, high), clock.loose_s(low, high)
    of = np.repeat(np.arange(len(groups)), [len(some) for some in groups])
    early += (rough.latest_s - clock.summed(clock.run_m / low) - loose_s)[of, None]
    late += (rough.earliest_s - clock.summed(clock.run_m / high) + loose_s)[of, None]
    # A cell's bounds are means of its corners', or the same for all of it: whichever are nearer.
    flat = ((late - early).max(axis=1) >= (rough.latest_s - rough.earliest_s)[of])[:, None]
    early = np.where(flat, rough.earliest_s[of, None], early)
    late = np.where(flat, rough.latest_s[of, None], late)
    top = np.minimum(found.top_m_s, winds.ability.most_m_s)[:, None]
    beyond = np.where(found.top_m_s < winds.ability.most_m_s, 1.0, 0.0)[:, None] * found.beyond_m_s
    slower, faster = still_m_s / corner - 1.0, 1.0 - still_m_s / top + still_m_s * beyond / top**2
    return Witnessed(*(x.reshape(-1, x.shape[-1]) for x in (early, late, slower, faster)))


def _alike(at: TimeWindow, slow: Floats, fast: Floats, still_m_s: Floats) -> Witnessed:
    """The bounds of a set whose winds all count together."""
    return Witnessed(*(x[None] for x in (at.earliest_s, at.latest_s, still_m_s / slow - 1.0, 1.0 - still_m_s / fast)))


def slowest_m_s(winds: WindsAlong, gust_m_s: float = 0.0) -> Floats:
    """(P,) no speed over ground is lower at any witness, nor in any wind; ``gust_m_s`` as in `WindsAlong`."""
    slow: Floats = winds.speeds_m_s(cover(winds.wind), gust_m_s)[0].min(axis=0)
    if not (winds.wind.single or winds.wind.varying):
        at_corners: Floats = winds.bounds(witnesses(winds.wind), gust_m_s).corner_m_s.min(axis=(0, 1))
        slow = np.minimum(slow, at_corners)
    return slow


def witnesses(wind: DeclaredWind) -> Floats:
    """(K, 2, 2) cells of shares that depend on the set alone, so that they are the same for all vehicles."""
    turn_m_s = np.radians(np.diff(wind.from_deg)[..., 0]) * wind.speed_m_s[..., 1]
    speeds = int(np.clip(np.ceil(np.diff(wind.speed_m_s).max() / WITNESS_M_S), 1, MOST_SPEEDS))
    turns = int(np.clip(np.ceil(turn_m_s.max() / WITNESS_M_S), 1, MOST_TURNS))
    turns = max(turns, int(np.ceil(np.diff(wind.from_deg).max() / 90.0)))
    edges = [list(pairwise(np.linspace(0.0, 1.0, n + 1).tolist())) for n in (speeds, turns)]
    return np.array([[speed, turn] for turn in edges[1] for speed in edges[0]])


def _searched(winds: WindsAlong, clock: FlightClock) -> TimeWindow:
    """The window of one unknown wind."""
    ends, looked = np.linspace(0.0, 1.0, _TURNS + 1), 0
    cells = np.array([[[0.0, 1.0], [a, b]] for a, b in pairwise(ends.tolist())])
    kept: list[tuple[Floats, TimeWindow]] = []
    earliest_s, latest_s = np.array(np.inf), np.array(-np.inf)
    while True:
        kept += list(zip(cells, _within(winds, clock, cells), strict=True))
        for at in _within(winds, clock, np.repeat(_likely(cells)[:, :, None], 2, axis=2)):
            earliest_s, latest_s = np.fmin(earliest_s, at.earliest_s), np.fmax(latest_s, at.latest_s)
        looked += len(cells)
        excess = np.array([_excess(bound, earliest_s, latest_s) for _, bound in kept])
        open_ = np.flatnonzero(excess > 0.0)
        if not len(open_) or looked >= MOST_WIND_CELLS:
            break
        halved = open_[np.argsort(-excess[open_], kind="stable")][: max(_TURNS, len(open_) // 4)].tolist()
        cells = np.concatenate([_halves(kept[i][0], winds) for i in halved])
        kept = [one for i, one in enumerate(kept) if i not in halved]
    bounds = [bound for _, bound in kept]
    return TimeWindow(np.min([b.earliest_s for b in bounds], axis=0), np.max([b.latest_s for b in bounds], axis=0))


def _likely(cells: Floats) -> Floats:
    """(K, 2) a share of each cell to try: its fastest wind, for extremes are mostly there, in its middle direction."""
    return np.column_stack([cells[:, 0, 1], cells[:, 1].mean(axis=1)])


def _excess(bound: TimeWindow, earliest_s: Floats, latest_s: Floats) -> float:
    """By how much more than is allowed a cell's bounds exceed times that some winds give."""
    allowed = np.maximum(np.maximum(PART * latest_s, OF_WIDTH * (latest_s - earliest_s)), WITHIN_S)
    return float(np.maximum(bound.latest_s - latest_s - allowed, earliest_s - bound.earliest_s - allowed).max())


def _halves(cell: Floats, winds: WindsAlong) -> Floats:
    """A cell cut in two, across the range in which its winds differ more."""
    wind = winds.wind
    turn_m_s = np.radians(np.diff(wind.from_deg)[..., 0]) * wind.speed_m_s[..., 1]
    spans_m_s = np.array([np.diff(wind.speed_m_s).max(), turn_m_s.max()])
    axis = int(np.argmax(spans_m_s * (cell[:, 1] - cell[:, 0])))
    halves = np.stack([cell, cell])
    halves[0, axis, 1] = halves[1, axis, 0] = cell[axis].mean()
    return halves
