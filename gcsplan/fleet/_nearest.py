"""The least distance of two straight pieces of motion: closed forms, one row per pair of pieces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices

PARALLEL = 1e-13
"""Part of |v|²|u|² below which two velocities count as parallel: the minimum then also lies on an edge."""


@dataclass(frozen=True, slots=True)
class Pieces:
    """Straight motions: at ``places`` (n, 3) at ``from_s`` (n,), then with ``velocity`` (n, 3) until ``to_s`` (n,)."""

    from_s: Floats
    to_s: Floats
    places: Floats
    velocity: Floats

    def take(self, rows: Indices) -> Pieces:
        """The pieces of ``rows``, which may repeat."""
        return Pieces(self.from_s[rows], self.to_s[rows], self.places[rows], self.velocity[rows])

    def joined(self, other: Pieces) -> Pieces:
        """These pieces, followed by others."""
        return Pieces(
            np.concatenate([self.from_s, other.from_s]),
            np.concatenate([self.to_s, other.to_s]),
            np.concatenate([self.places, other.places]),
            np.concatenate([self.velocity, other.velocity]),
        )

    def at(self, times_s: Floats) -> Floats:
        """(n, 3) places at ``times_s`` (n,), each on its own piece."""
        return np.asarray(self.places + self.velocity * (times_s - self.from_s)[:, None])


def nearest(a: Pieces, b: Pieces, apart_s: float = 0.0) -> tuple[Floats, Floats, Floats]:
    """Least distance (n,) between a at t1 and b at t2, and both times, over all |t1 - t2| <= ``apart_s``.

    All rows must overlap in time, or be within ``apart_s`` of it. The squared distance is a convex quadratic in (t1,
    t2) over a box cut by a strip. Its minimum is inside, or on one of six edges, where it is a quadratic of one
    variable. The result is never below the true minimum, and above it only by rounding.
    """
    if apart_s <= 0.0:
        lo, hi = np.maximum(a.from_s, b.from_s), np.minimum(a.to_s, b.to_s)
        gap, closing = a.at(lo) - b.at(lo), a.velocity - b.velocity
        after, square = _on_edge(gap, closing, np.zeros(len(lo)), hi - lo)
        return np.sqrt(square), lo + after, lo + after
    d = a.places - b.places
    v, u = a.velocity, b.velocity
    long_a, long_b = a.to_s - a.from_s, b.to_s - b.from_s
    ahead = a.from_s - b.from_s  # x = t1 - a.from_s, y = t2 - b.from_s: t1 - t2 = x - y + ahead
    best = np.full(len(d), np.inf)
    best_x, best_y = np.zeros(len(d)), np.zeros(len(d))

    def offer(x: Floats, y: Floats, square: Floats, legal: Bools) -> None:
        better = legal & (square < best)
        best[better], best_x[better], best_y[better] = square[better], x[better], y[better]

    vv, vu, uu = _dot(v, v), _dot(v, u), _dot(u, u)
    det = vv * uu - vu * vu
    crossing = det > PARALLEL * vv * uu
    safe = np.where(crossing, det, 1.0)
    vd, ud = _dot(v, d), _dot(u, d)
    x, y = (vu * ud - uu * vd) / safe, (vv * ud - vu * vd) / safe
    inside = crossing & (x >= 0.0) & (x <= long_a) & (y >= 0.0) & (y <= long_b) & (np.abs(x - y + ahead) <= apart_s)
    gap = d + v * x[:, None] - u * y[:, None]
    offer(x, y, _dot(gap, gap), inside)
    zero = np.zeros(len(d))
    for x in (zero, long_a):
        low, high = np.maximum(0.0, x + ahead - apart_s), np.minimum(long_b, x + ahead + apart_s)
        y, square = _on_edge(d + v * x[:, None], -u, low, high)
        offer(x, y, square, low <= high)
    for y in (zero, long_b):
        low, high = np.maximum(0.0, y - ahead - apart_s), np.minimum(long_a, y - ahead + apart_s)
        x, square = _on_edge(d - u * y[:, None], v, low, high)
        offer(x, y, square, low <= high)
    for side in (-apart_s, apart_s):  # y = x + ahead + side
        low, high = np.maximum(0.0, -ahead - side), np.minimum(long_a, long_b - ahead - side)
        x, square = _on_edge(d - u * (ahead + side)[:, None], v - u, low, high)
        offer(x, x + ahead + side, square, low <= high)
    return np.sqrt(best), a.from_s + best_x, b.from_s + best_y


def below(a: Pieces, b: Pieces, needed_m: float) -> tuple[Floats, Floats]:
    """The time span (n,), (n,) in which two motions, both at the same time, are nearer than ``needed_m``.

    Rows that never are get an empty span: the first time is later than the second.
    """
    lo, hi = np.maximum(a.from_s, b.from_s), np.minimum(a.to_s, b.to_s)
    gap, closing = a.at(lo) - b.at(lo), a.velocity - b.velocity
    first, last = _inside(gap, closing, hi - lo, needed_m)
    return lo + first, lo + last


def _on_edge(gap: Floats, rate: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """The s in [low, high] at which |gap + s·rate| is least, and its square there."""
    square = _dot(rate, rate)
    s = -_dot(gap, rate) / np.where(square > 0.0, square, 1.0)
    s = np.minimum(np.maximum(s, low), high)
    at = gap + rate * s[:, None]
    return s, _dot(at, at)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def shifts(a: Pieces, b: Pieces, needed_m: float) -> tuple[Floats, Floats]:
    """The range of delays (n,), (n,) of ``a`` with which it comes nearer than ``needed_m`` to ``b``.

    That is the range of t2 - t1 over all t1 on a and t2 on b whose places are that near. Rows that never come so near
    get an empty span: the first delay is later than the second. Those (t1, t2) are an ellipse cut by a box, so the ends
    of the range lie on one of four edges, or at the extremes of the ellipse.
    """
    d = a.places - b.places
    v, u = a.velocity, b.velocity
    long_a, long_b = a.to_s - a.from_s, b.to_s - b.from_s
    behind = b.from_s - a.from_s  # t2 - t1 = y - x + behind
    low, high = np.full(len(d), np.inf), np.full(len(d), -np.inf)

    def offer(x: Floats, y: Floats, legal: Bools) -> None:
        shift = y - x + behind
        np.minimum(low, shift, out=low, where=legal)
        np.maximum(high, shift, out=high, where=legal)

    for x in (np.zeros(len(d)), long_a):
        first, last = _inside(d + v * x[:, None], -u, long_b, needed_m)
        for y in (first, last):
            offer(x, y, first <= last)
    for y in (np.zeros(len(d)), long_b):
        first, last = _inside(d - u * y[:, None], v, long_a, needed_m)
        for x in (first, last):
            offer(x, y, first <= last)
    vv, vu, uu = _dot(v, v), _dot(v, u), _dot(u, u)
    det, apart = vv * uu - vu * vu, vv + uu - 2.0 * vu
    crossing = det > PARALLEL * vv * uu
    safe = np.where(crossing, det, 1.0)
    vd, ud = _dot(v, d), _dot(u, d)
    x0, y0 = (vu * ud - uu * vd) / safe, (vv * ud - vu * vd) / safe
    gap = d + v * x0[:, None] - u * y0[:, None]
    room = needed_m * needed_m - _dot(gap, gap)
    reach = np.sqrt(np.maximum(room, 0.0) / np.where(crossing, safe * apart, 1.0))
    for side in (-reach, reach):
        x, y = x0 + side * (vu - uu), y0 + side * (vv - vu)
        offer(x, y, crossing & (room > 0.0) & (x >= 0.0) & (x <= long_a) & (y >= 0.0) & (y <= long_b))
    return low, high


def _inside(gap: Floats, rate: Floats, long: Floats, needed_m: float) -> tuple[Floats, Floats]:
    """The range of s in [0, long] where |gap + s·rate| is less than ``needed_m``; (inf, -inf) if nowhere."""
    speed2, half, excess = _dot(rate, rate), _dot(gap, rate), _dot(gap, gap) - needed_m * needed_m
    root2 = half * half - speed2 * excess
    moving = speed2 > 1e-12
    root = np.sqrt(np.maximum(root2, 0.0))
    safe = np.where(moving, speed2, 1.0)
    first = np.maximum(np.where(moving, (-half - root) / safe, 0.0), 0.0)
    last = np.minimum(np.where(moving, (-half + root) / safe, long), long)
    nowhere = np.where(moving, root2 <= 0.0, excess >= 0.0) | (first > last)
    return np.where(nowhere, np.inf, first), np.where(nowhere, -np.inf, last)
