"""What an aircraft can do in a wind: its speed over ground along a track, and the metres that it flies through the air.

The wind triangle in space: an aircraft with an airspeed ``V`` along its way, on a track that rises by ``k`` metres per
metre over ground, in a wind with the parts ``t`` along and ``n`` across the track, flies over ground at the larger
``g`` with ``(g - t)² + n² + (k·g)² = V²``. A multicopter's largest airspeed is horizontal, so its ``k`` is 0, and it
flies no faster than commanded. ``g`` is concave in the wind (`docs/concepts/wind.md`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.wind.declared import DeclaredWind

__all__ = ["ADVANCES_M_S", "Ability", "SpeedBounds", "WindsAlong", "circle_ratio", "winds_within"]

ADVANCES_M_S = 0.1
"""An aircraft that is slower than this over ground does not advance."""
_CIRCLE_STEPS = 256


@dataclass(frozen=True, eq=False, slots=True)
class Ability:
    """An aircraft on P parts of its way.

    ``course`` (P, 2) are unit vectors over ground, 0 where it goes straight up or down; ``slope`` (P,) metres of rise
    per metre over ground, 0 for a multicopter. ``least_air_m_s``, ``most_air_m_s`` (P,): its largest airspeed is
    between these; of a fixed wing, which keeps its airspeed, they are the same. ``most_m_s`` (P,): its largest speed
    over ground, inf for a fixed wing.
    """

    course: Floats
    slope: Floats
    least_air_m_s: Floats
    most_air_m_s: Floats
    most_m_s: Floats

    def slowest_m_s(self, along_m_s: Floats, across_m_s: Floats) -> Floats:
        """(..., P) the least speed over ground in winds with parts (..., P) along and across; NaN or below 0: none."""
        return np.minimum(self._triangle(along_m_s, across_m_s, self.least_air_m_s), self.most_m_s)

    def fastest_m_s(self, along_m_s: Floats, across_m_s: Floats) -> Floats:
        """(..., P) the highest speed over ground, likewise."""
        return np.minimum(self._triangle(along_m_s, across_m_s, self.most_air_m_s), self.most_m_s)

    def tangent(self, along_m_s: Floats, across_m_s: Floats) -> tuple[Floats, Floats, Floats]:
        """The highest speed over ground without regard to ``most_m_s``, and its derivatives along and across."""
        rise = 1.0 + self.slope**2
        root = self._root(along_m_s, across_m_s, self.most_air_m_s)
        return (along_m_s + root) / rise, (1.0 - self.slope**2 * along_m_s / root) / rise, -across_m_s / root

    def air_m(self, along_m_s: Floats, across_m_s: Floats) -> tuple[Floats, Floats]:
        """Metres through the air, horizontally, and seconds (..., P) for each metre over ground, at the least speed."""
        g = self.slowest_m_s(along_m_s, across_m_s)
        return np.hypot(g - along_m_s, across_m_s) / g, 1.0 / g

    def _root(self, along_m_s: Floats, across_m_s: Floats, air_m_s: Floats) -> Floats:
        rise = 1.0 + self.slope**2
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt(rise * (air_m_s**2 - across_m_s**2) - (self.slope * along_m_s) ** 2))

    def _triangle(self, along_m_s: Floats, across_m_s: Floats, air_m_s: Floats) -> Floats:
        return np.asarray((along_m_s + self._root(along_m_s, across_m_s, air_m_s)) / (1.0 + self.slope**2))


@dataclass(frozen=True, eq=False, slots=True)
class SpeedBounds:
    """Bounds of speeds over ground in K cells of winds, on P parts.

    The speed is concave in the wind. ``corner_m_s`` (K, 4, P): where a wind is a mean of those at the corners, its
    speed is no less than the same mean of these. ``top_m_s`` (K, P), ``beyond_m_s`` (K, 4, P): no more than the first
    plus the same mean of the second, its tangent in the middle.
    """

    corner_m_s: Floats
    top_m_s: Floats
    beyond_m_s: Floats


@dataclass(frozen=True, eq=False)
class WindsAlong:
    """The winds of a set along P parts of a way.

    ``part`` (Q,), rising from 0, is the part of each of Q probes, every part having one or more; ``amsl_m``, ``agl_m``,
    ``at_s`` (Q,) are heights and times of the probes. Between the probes of a part the wind of a share is between its
    winds at these.
    """

    wind: DeclaredWind
    ability: Ability
    part: Indices
    amsl_m: Floats
    agl_m: Floats
    at_s: Floats
    circumscribed: bool = False

    @cached_property
    def _first(self) -> Indices:
        return np.flatnonzero(np.append(True, np.diff(self.part) > 0)[: len(self.part)])

    def speeds_m_s(self, cells: Floats, gust_m_s: float = 0.0) -> tuple[Floats, Floats]:
        """(K, P) no speed over ground is lower, and none is higher, with any wind of each of ``cells`` (K, 2, 2).

        Lower and upper share of speed, and of direction. ``gust_m_s``: every wind may differ by this. NaN, or 0 and
        less, is no speed: the aircraft cannot keep its track, or does not advance.
        """
        found = self.bounds(cells, gust_m_s)
        fast = np.minimum(found.top_m_s + found.beyond_m_s.max(axis=1), self.ability.most_m_s)
        return found.corner_m_s.min(axis=1), fast

    def bounds(self, cells: Floats, gust_m_s: float = 0.0) -> SpeedBounds:
        """The bounds of the speeds over ground in each cell that `speeds_m_s` are made of."""
        along, across, bow = self._corners(cells)
        # In any gust of u m/s it can fly what it could without one at an airspeed of u less.
        at = replace(self._expanded, least_air_m_s=np.maximum(self._expanded.least_air_m_s - gust_m_s, 0.0))
        # What the arc of directions lies beyond its chord counts outward.
        low = np.minimum(
            at.slowest_m_s(along - bow[:, None], np.abs(across) + bow[:, None]),
            at.slowest_m_s(along + bow[:, None], np.abs(across) + bow[:, None]),
        )
        slow = np.minimum.reduceat(low, self._first, axis=2)
        middle = [np.add.reduceat(x.mean(axis=1), self._first, axis=1) / self._count for x in (along, across)]
        top, per_along, per_across = self.ability.tangent(*middle)
        of = self.part
        off = per_along[:, None, of] * (along - middle[0][:, None, of])
        off = off + per_across[:, None, of] * (across - middle[1][:, None, of])
        off = off + (np.hypot(per_along, per_across)[:, of] * (bow + gust_m_s))[:, None]
        return SpeedBounds(slow, top, np.maximum.reduceat(off, self._first, axis=2))

    def costs(self, cells: Floats) -> tuple[Floats, Floats]:
        """(K, P) most metres through the air, and seconds, for a metre over ground with any wind of each cell."""
        along, across, bow = self._corners(cells)
        found = [
            self._expanded.air_m(along + side * bow[:, None], np.abs(across) + bow[:, None]) for side in (-1.0, 1.0)
        ]
        air_m, seconds = (np.maximum(a, b).max(axis=1) for a, b in zip(*found, strict=True))
        return np.maximum.reduceat(air_m, self._first, axis=1), np.maximum.reduceat(seconds, self._first, axis=1)

    def advance_per_air(self, cells: Floats, gust_m_s: float = 0.0) -> Floats:
        """(P, 2) the least and the most metres over ground for a metre through the air, at the largest airspeed and
        without regard to ``most_m_s``, with any wind of ``cells``; every wind may differ by ``gust_m_s``."""
        along, across, bow = self._corners(cells)
        beyond, at = bow + gust_m_s, self._expanded
        least_air, most_air = at.least_air_m_s, at.most_air_m_s
        t_low, t_high = along.min(axis=1) - beyond, along.max(axis=1) + beyond
        n_low, n_high = across.min(axis=1) - beyond, across.max(axis=1) + beyond
        n_most = np.maximum(np.abs(n_low), np.abs(n_high))
        n_least = np.maximum(np.maximum(n_low, -n_high), 0.0)
        straight_low, straight_high = (
            np.sqrt(np.maximum(1.0 - (n / air) ** 2, 0.0)) for n, air in ((n_most, least_air), (n_least, most_air))
        )
        low = np.minimum(t_low / least_air, t_low / most_air) + straight_low
        high = np.maximum(t_high / least_air, t_high / most_air) + straight_high
        low, high = np.maximum(low.min(axis=0), 0.0), np.maximum(high.max(axis=0), 0.0)
        return np.column_stack([np.minimum.reduceat(low, self._first), np.maximum.reduceat(high, self._first)])

    def strongest_m_s(self, cells: Floats) -> Floats:
        """(P,) the highest speed of all winds of ``cells``."""
        along, across, bow = self._corners(cells)
        blows = (np.hypot(along, across).max(axis=1) + bow).max(axis=0)
        return np.maximum.reduceat(blows, self._first)

    def wind_of(self, part: int, cell: Floats) -> Floats:
        """(2,) the velocity of a cell's fastest wind, in the middle of its directions, on a part."""
        probe = np.searchsorted(self.part, [part])
        share = np.array([[cell[0, 1], cell[1].mean()]])
        return np.asarray(self.wind.vectors_m_s(share, self.amsl_m[probe], self.agl_m[probe], self.at_s[probe])[0, 0])

    @cached_property
    def _count(self) -> Floats:
        return np.diff(np.append(self._first, len(self.part))).astype(np.float64)

    @cached_property
    def _expanded(self) -> Ability:
        """The ability at each probe."""
        a, of = self.ability, self.part
        return Ability(a.course[of], a.slope[of], a.least_air_m_s[of], a.most_air_m_s[of], a.most_m_s[of])

    def _corners(self, cells: Floats) -> tuple[Floats, Floats, Floats]:
        """(K, 4, Q) the wind along and across at the corners of cells; (K, Q) by how much an arc exceeds its chord."""
        shares = np.stack([cells[:, 0, [0, 0, 1, 1]], cells[:, 1, [0, 1, 0, 1]]], axis=-1).reshape(-1, 2)
        winds = self.wind.vectors_m_s(shares, self.amsl_m, self.agl_m, self.at_s)
        winds = winds.reshape(len(cells), 4, len(self.part), 2)
        east, north = self._expanded.course.T
        along = winds[..., 0] * east + winds[..., 1] * north
        across = winds[..., 1] * east - winds[..., 0] * north
        if self.circumscribed:  # tangents to the arc of the fastest winds, which its own ends lie within
            half = 0.5 * np.radians(np.diff(self.wind.from_deg)[0, 0, 0]) * (cells[:, 1, 1] - cells[:, 1, 0])
            out = np.where([False, False, True, True], 1.0 / np.cos(half)[:, None], 1.0)[..., None]
            return along * out, across * out, np.zeros((len(cells), len(self.part)))
        return along, across, self.wind.bow_m_s(cells, self.amsl_m, self.agl_m, self.at_s)


def circle_ratio(wind_m_s: float, air_m_s: float, most_m_s: float) -> float:
    """The seconds of a whole circle over ground in a constant wind, per those in still air at ``most_m_s``.

    Its largest airspeed is ``air_m_s``, its speed over ground at most ``most_m_s``; a fixed wing's, whose seconds in
    still air are at its airspeed, is not bounded: inf. The sum over even steps of a smooth periodic function is its
    integral; inf if it cannot keep the circle.
    """
    if wind_m_s >= air_m_s:
        return np.inf
    angle = 2.0 * np.pi * np.arange(_CIRCLE_STEPS) / _CIRCLE_STEPS
    g = wind_m_s * np.cos(angle) + np.sqrt(air_m_s**2 - (wind_m_s * np.sin(angle)) ** 2)
    still_m_s = min(most_m_s, air_m_s)
    return float(np.mean(still_m_s / np.minimum(g, most_m_s)))


def winds_within(wind: DeclaredWind, ability: Ability, amsl_m: Floats, agl_m: Floats, hours_s: Floats) -> WindsAlong:
    """The winds of a set, within heights and hours (P, 2): probes at the ends of these and at the set's own between."""
    if len(wind.heights_m) == 1 and len(wind.times_s) == 1:
        zero = np.zeros(len(amsl_m))
        return WindsAlong(wind, ability, np.arange(len(amsl_m)), zero, zero, zero)
    spans_m, rows = amsl_m if wind.heights == "amsl" else agl_m, []
    for i, (span_m, span_s) in enumerate(zip(spans_m.tolist(), hours_s.tolist(), strict=True)):
        heights, times = _between(span_m, wind.heights_m), _between(span_s, wind.times_s)
        rows += [(i, h, t) for h in heights for t in times]
    part, height, at = np.array(rows).reshape(-1, 3).T
    return WindsAlong(wind, ability, part.astype(np.intp), height, height, at)


def _between(span: Sequence[float], nodes: Floats) -> list[float]:
    """The ends of a span, within ``nodes``, and the nodes inside."""
    low, high = (min(max(x, float(nodes[0])), float(nodes[-1])) for x in span)
    inside = nodes[(nodes > low) & (nodes < high)].tolist()
    return [low, *inside, *([high] if high > low else [])]
