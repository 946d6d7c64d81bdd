"""Choose the pieces of motion that need an exact look: time slices, with a lower bound for each pair in each slice.

In a slice a vehicle is never farther than its ``stray`` from the even motion between its places at the slice's two
ends. The least distance of two even motions, less both strays, is a lower bound that costs one quadratic. The exact
look is the least distance of two straight pieces of motion, in closed form, one row per pair of pieces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.fleet.motion.timing import TimedPath
from gcsplan.wind.drift import Drifts, between

PARALLEL = 1e-13
"""Part of |v|²|u|² below which two velocities count as parallel: the minimum then also lies on an edge."""


FOREVER_S = 1e9
"""End time of the last piece of a vehicle that ends in the air, s."""

PIECES_A_SLICE = 4
SLICES = (16, 512)

ROWS_AT_ONCE = 400_000
"""Rows that are handled together, about: some tens of megabytes."""

DRIFTS_AT_ONCE = 4_000_000
"""Drifts of pairs that are compared together, at all witnesses."""

Apart = tuple[float | Floats, float | Floats]
"""The least and the most of a difference of two times, s, for each row or for all."""

REACH_ROUNDS = 2
"""Times that the pieces about each slice are found: by a vehicle's whole reach, then by the reach of what was found."""

SLACK_M = 1e-7
"""Metres by which rounding may falsify a bound, and so the largest distance error of the search."""


@dataclass(frozen=True, slots=True)
class Pieces:
    """Straight motions: at ``places`` (n, 3) at ``from_s`` (n,), then with ``velocity`` (n, 3) until ``to_s`` (n,).

    ``drifts`` (n of them): how much earlier or later each may be in a declared wind; None if no wind changes a time.
    """

    from_s: Floats
    to_s: Floats
    places: Floats
    velocity: Floats
    drifts: Drifts | None = None

    def take(self, rows: Indices) -> Pieces:
        """The pieces of ``rows``, which may repeat, without their drifts."""
        return Pieces(self.from_s[rows], self.to_s[rows], self.places[rows], self.velocity[rows])

    def joined(self, other: Pieces) -> Pieces:
        """These pieces, followed by others, without their drifts."""
        return Pieces(
            np.concatenate([self.from_s, other.from_s]),
            np.concatenate([self.to_s, other.to_s]),
            np.concatenate([self.places, other.places]),
            np.concatenate([self.velocity, other.velocity]),
        )

    def _drifts(self) -> Drifts:
        return Drifts.none(len(self.from_s)) if self.drifts is None else self.drifts

    def off_s(self, window_s: float) -> tuple[float | Floats, float | Floats]:
        """The earliest and the latest (n,) that each may be of its time table, in any wind or ``window_s``."""
        if self.drifts is None:
            return -window_s, window_s
        early, late = self.drifts.early.min(axis=0), self.drifts.late.max(axis=0)
        return np.minimum(early, -window_s), np.maximum(late, window_s)

    def apart_s(self, a: Indices, other: Pieces, b: Indices, window_s: float) -> Apart:
        """The least and the most by which the time table's times of two places may differ if two are there at once:
        pieces ``a`` (n,), less pieces ``b`` (n,) of others. Each may be ``window_s`` off besides, whatever the wind."""
        wide = 2.0 * window_s
        if self.drifts is other.drifts is None:
            return -wide, wide
        low, high = np.empty(len(a)), np.empty(len(a))
        mine, theirs = self._drifts(), other._drifts()
        step = max(1, DRIFTS_AT_ONCE // max(len(mine.early), len(theirs.early), 1))
        for k in range(0, len(a), step):
            some = slice(k, k + step)
            low[some], high[some] = between(mine.take(a[some]), theirs.take(b[some]))
        return (np.minimum(low, -wide), np.maximum(high, wide)) if wide else (low, high)

    def at(self, times_s: Floats) -> Floats:
        """(n, 3) places at ``times_s`` (n,), each on its own piece."""
        return np.asarray(self.places + self.velocity * (times_s - self.from_s)[:, None])


def nearest(a: Pieces, b: Pieces, apart_s: Apart = (0.0, 0.0)) -> tuple[Floats, Floats, Floats]:
    """Least distance (n,) between a at t1 and b at t2, and both times, over all t1 - t2 within ``apart_s``.

    All rows must overlap in time, or be within ``apart_s`` of it. The squared distance is a convex quadratic in (t1,
    t2) over a box cut by a strip. Its minimum is inside, or on one of six edges, where it is a quadratic of one
    variable. The result is never below the true minimum, and above it only by rounding.
    """
    least, most = apart_s
    if np.ndim(least) == 0 and least == most == 0.0:
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
    inside = crossing & (x >= 0.0) & (x <= long_a) & (y >= 0.0) & (y <= long_b) & _within(x - y + ahead, least, most)
    gap = d + v * x[:, None] - u * y[:, None]
    offer(x, y, _dot(gap, gap), inside)
    zero = np.zeros(len(d))
    for x in (zero, long_a):
        low, high = np.maximum(0.0, x + ahead - most), np.minimum(long_b, x + ahead - least)
        y, square = _on_edge(d + v * x[:, None], -u, low, high)
        offer(x, y, square, low <= high)
    for y in (zero, long_b):
        low, high = np.maximum(0.0, y - ahead + least), np.minimum(long_a, y - ahead + most)
        x, square = _on_edge(d - u * y[:, None], v, low, high)
        offer(x, y, square, low <= high)
    for side in (most, least):  # y = x + ahead - side
        low, high = np.maximum(0.0, side - ahead), np.minimum(long_a, long_b - ahead + side)
        x, square = _on_edge(d - u * (ahead - side)[:, None], v - u, low, high)
        offer(x, x + ahead - side, square, low <= high)
    return np.sqrt(best), a.from_s + best_x, b.from_s + best_y


def _within(x: Floats, least: float | Floats, most: float | Floats) -> Bools:
    return np.asarray((least <= x) & (x <= most))


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


@dataclass(frozen=True, eq=False, slots=True)
class Fleet:
    """Motions of V vehicles cut into K slices between ``edges_s`` (K + 1,), narrow where much moves.

    ``pieces`` holds the pieces of all vehicles in turn, ``offset`` (V,) the first of each. ``nodes`` (V, K + 1, 3) are
    the places at the slices' ends (on the ground before take-off and after landing). ``stray`` is (V, K), in metres.
    A vehicle is within ``reach_s`` (V,) of its time table, and in a slice within ``near_s`` (V, K): its drift in the
    declared winds, or ``window_s``. ``fastest`` (V, K) is the top speed, m/s, in a slice and this about it. ``begins``
    and ``ends`` (V,) are the times in the air. ``first`` and ``last`` (V, K) are the pieces in a slice and ``near_s``
    about it, numbered over all vehicles. ``off_s``: the earliest and the latest that each piece may be of its time
    table.
    """

    paths: tuple[TimedPath, ...]
    window_s: float
    reach_s: Floats
    near_s: Floats
    edges_s: Floats
    pieces: Pieces
    off_s: tuple[float | Floats, float | Floats]
    offset: Indices
    nodes: Floats
    stray: Floats
    fastest: Floats
    begins: Floats
    ends: Floats
    first: Indices
    last: Indices

    @property
    def horizon_s(self) -> float:
        """The end of the last slice; nobody moves after it."""
        return float(self.edges_s[-1])

    @classmethod
    def of(cls, paths: Sequence[TimedPath], window_s: float = 0.0) -> Fleet:
        """Slice the motions of ``paths`` (at least one), each up to ``window_s`` early or late."""
        reach_s = np.array([reach_of(path, window_s) for path in paths])
        edges = _edges(paths, float(reach_s.max()))
        count = len(edges) - 1
        shape = (len(paths), count)
        nodes, stray, fastest, near = np.empty((len(paths), count + 1, 3)), *(np.empty(shape) for _ in range(3))
        first, last = np.empty(shape, dtype=np.intp), np.empty(shape, dtype=np.intp)
        parts, offset, total = [], np.empty(len(paths), dtype=np.intp), 0
        for v, path in enumerate(paths):
            piece = pieces_of(path)
            nodes[v], stray[v] = _strays(path, edges)
            speed, early, late = np.sqrt((piece.velocity**2).sum(axis=1)), *piece.off_s(window_s)
            off = np.maximum(np.abs(early), np.abs(late)) + np.zeros(len(speed))
            near[v] = reach_s[v]
            for _ in range(REACH_ROUNDS):  # a place of the time table within the reach has a reach of its own
                low = np.searchsorted(piece.from_s, edges[:-1] - near[v], side="right") - 1
                high = np.searchsorted(piece.from_s, edges[1:] + near[v], side="left") - 1
                high[-1] = np.searchsorted(piece.from_s, edges[-1] + near[v, -1], side="right") - 1  # with the stay
                low, high = np.maximum(low, 0), np.maximum(high, 0)
                near[v] = _largest(off, low, high)
            fastest[v] = _largest(speed, low, high)
            first[v], last[v], offset[v] = low + total, high + total, total
            total += len(speed)
            parts.append(piece)
        pieces = _all(parts)
        begins = np.array([p.begin_s for p in paths])
        ends = np.array([FOREVER_S if p.ends_in_air else p.end_s for p in paths])
        return cls(
            tuple(paths), window_s, reach_s, near, edges, pieces, pieces.off_s(window_s), offset, nodes, stray, fastest,
            begins, ends, first, last,
        )  # fmt: skip

    def bounds(self, i: Indices, j: Indices) -> tuple[Floats, Floats]:
        """For pairs (M,): a lower bound in each slice (M, K), and the least distance at the slices' ends (M,), metres.

        Both are inf where the two are not in the air together.
        """
        edges, reach = self.edges_s, self.reach_s
        begin, end = np.maximum(self.begins[i], self.begins[j]), np.minimum(self.ends[i], self.ends[j])
        count, slices = len(i), self.stray.shape[1]
        square, cross, speed2 = np.zeros((count, slices + 1)), np.zeros((count, slices)), np.zeros((count, slices))
        for axis in range(3):
            gap = self.nodes[i, :, axis] - self.nodes[j, :, axis]
            change = np.diff(gap, axis=1)
            square += gap * gap
            cross += gap[:, :-1] * change
            speed2 += change * change
        part = np.clip(-cross / np.where(speed2 > 0.0, speed2, 1.0), 0.0, 1.0)
        # The sum cancels where two pass closely, so the possible rounding error is taken off the bound.
        rounding = 4e-15 * np.maximum(square[:, :-1], square[:, 1:])
        least2 = np.maximum(square[:, :-1] + part * (2.0 * cross + part * speed2) - rounding, 0.0)
        bound = np.sqrt(least2) - self.stray[i] - self.stray[j]
        if (reach > 0.0).any():
            bound -= self.near_s[i] * self.fastest[i] + self.near_s[j] * self.fastest[j]
        first = np.maximum(self.begins[i] - reach[i], self.begins[j] - reach[j])
        last = np.minimum(self.ends[i] + reach[i], self.ends[j] + reach[j])
        shared = (edges[None, :-1] <= last[:, None]) & (edges[None, 1:] >= first[:, None])
        known = (edges >= begin[:, None]) & (edges <= end[:, None])
        seen = np.where(known, square, np.inf).min(axis=1)
        if self.pieces.drifts is not None:  # two that drift need not be at two places of the time table at once
            seen[:] = np.inf
        return np.where(shared & (first <= last)[:, None], bound, np.inf), np.sqrt(seen)

    def rows(
        self, i: Indices, j: Indices, k: Indices, below_m: Floats
    ) -> Iterator[tuple[Indices, Indices, Indices, Apart]]:
        """All pairs of pieces of vehicles ``i`` and ``j`` in slices ``k`` (n,) that may overlap in time, in blocks; of
        vehicles that drift, the pairs alone that may be nearer than ``below_m`` (n,).

        Each block has the row numbers among the n, the numbers of the two pieces, and how far their times may differ.
        """
        many_i = self.last[i, k] - self.first[i, k] + 1
        many_j = self.last[j, k] - self.first[j, k] + 1
        total = np.cumsum(many_i * many_j)
        start = 0
        while start < len(i):
            done = total[start - 1] if start else 0
            stop = max(start + 1, int(np.searchsorted(total, done + ROWS_AT_ONCE, side="right")))
            of = np.repeat(np.arange(start, stop), (many_i * many_j)[start:stop])
            local = np.arange(len(of)) - (np.concatenate([[0], total])[of] - done)
            a = self.first[i[of], k[of]] + local // many_j[of]
            b = self.first[j[of], k[of]] + local % many_j[of]
            early, late = self.off_s
            if isinstance(early, np.ndarray) and isinstance(late, np.ndarray):
                # Looking at each wind takes long, so first each of the two may be in a wind of its own.
                keep = overlap_of(self.pieces, a, b, (early[b] - late[a], late[b] - early[a]))
                of, a, b = of[keep], a[keep], b[keep]
                once = np.sort(np.unique(a * len(self.pieces.from_s) + b, return_index=True)[1])  # in several slices
                of, a, b = of[once], a[once], b[once]
                any_wind = early[b] - late[a], late[b] - early[a]
                keep = nearest(self.pieces.take(a), self.pieces.take(b), any_wind)[0] < below_m[of]
                of, a, b = of[keep], a[keep], b[keep]
            apart = self.pieces.apart_s(a, self.pieces, b, self.window_s)
            keep = overlap_of(self.pieces, a, b, apart)
            low, high = (x if np.ndim(x) == 0 else np.asarray(x)[keep] for x in apart)
            yield of[keep], a[keep], b[keep], (low, high)
            start = stop

    def least(self, i: Indices, j: Indices, cut_m: float = np.inf) -> Least:
        """The least distance of pairs (M,), exact wherever it is below ``cut_m``."""
        out = Least.none(len(i))
        w = self.reach_s[i] + self.reach_s[j]
        meet = np.flatnonzero((self.begins[i] <= self.ends[j] + w) & (self.begins[j] <= self.ends[i] + w))
        block = max(1, ROWS_AT_ONCE // self.stray.shape[1])
        for start in range(0, len(meet), block):
            some = meet[start : start + block]
            a, b = i[some], j[some]
            bound, seen = self.bounds(a, b)
            ceiling = np.minimum(seen + 2.0 * SLACK_M, cut_m)
            best = bound.argmin(axis=1)
            rows = np.arange(len(a))
            go = bound[rows, best] < ceiling - SLACK_M
            self._look(a, b, rows[go], best[go], ceiling, some, out)
            bound[rows, best] = np.inf
            ceiling = np.minimum(ceiling, out.distance_m[some])
            more, where = np.nonzero(bound < (ceiling - SLACK_M)[:, None])
            self._look(a, b, more.astype(np.intp), where.astype(np.intp), ceiling, some, out)
        return out

    def _look(
        self, i: Indices, j: Indices, pair: Indices, k: Indices, below_m: Floats, numbers: Indices, out: Least
    ) -> None:
        for of, a, b, apart in self.rows(i[pair], j[pair], k, below_m[pair]):
            if not len(of):
                continue
            distance, t1, t2 = nearest(self.pieces.take(a), self.pieces.take(b), apart)
            owner = numbers[pair[of]]  # sorted
            heads = np.flatnonzero(np.concatenate([[True], np.diff(owner) > 0]))
            least = np.repeat(np.minimum.reduceat(distance, heads), np.diff(np.append(heads, len(owner))))
            ties = np.flatnonzero(distance <= least)
            head = ties[np.unique(owner[ties], return_index=True)[1]]
            to = owner[head]
            better = distance[head] < out.distance_m[to]
            head, to = head[better], to[better]
            out.distance_m[to], out.first_s[to], out.second_s[to] = distance[head], t1[head], t2[head]
            out.pieces[to, 0], out.pieces[to, 1] = a[head], b[head]


@dataclass(frozen=True, eq=False, slots=True)
class Least:
    """Least distances of pairs (M,), in metres, when each vehicle is there, and on which pieces.

    A distance is inf if the two are never both in the air, or not below the cut. ``pieces`` (M, 2) are numbered over
    all vehicles (-1: none).
    """

    distance_m: Floats
    first_s: Floats
    second_s: Floats
    pieces: Indices

    @classmethod
    def none(cls, count: int) -> Least:
        """The state before the search: no distance is known for any of ``count`` pairs."""
        return cls(
            np.full(count, np.inf), np.full(count, np.nan), np.full(count, np.nan), np.full((count, 2), -1, np.intp)
        )


def pieces_of(path: TimedPath) -> Pieces:
    """The pieces of a motion. If it ends in the air, a last piece that does not move is added."""
    times, points, drifts = path.times_s, path.points, path.drifts
    if drifts is not None and path.ends_in_air:
        drifts = drifts.take(np.append(np.arange(len(times) - 1), len(times) - 2))
    if path.ends_in_air:
        times, points = np.append(times, FOREVER_S), np.vstack([points, points[-1:]])
    velocity = np.diff(points, axis=0) / np.diff(times)[:, None]
    return Pieces(times[:-1], times[1:], points[:-1], velocity, drifts)


def reach_of(path: TimedPath, window_s: float) -> float:
    """How far a motion may be from its time table, s."""
    return window_s if path.drifts is None else max(window_s, path.drifts.most_s)


def overlap_of(pieces: Pieces, a: Indices, b: Indices, apart_s: Apart) -> Bools:
    """Whether two pieces each overlap in time, by their times alone."""
    least, most = apart_s
    return np.asarray((pieces.from_s[a] <= pieces.to_s[b] + most) & (pieces.from_s[b] <= pieces.to_s[a] - least))


def _all(parts: Sequence[Pieces]) -> Pieces:
    """The pieces of all vehicles in turn."""
    drifts = None
    if any(p.drifts is not None for p in parts):
        each = [Drifts.none(len(p.from_s)) if p.drifts is None else p.drifts for p in parts]
        count = max(len(d.early) for d in each)
        each = [d.wide(count) for d in each]
        drifts = Drifts(*(np.concatenate([getattr(d, name) for d in each], axis=1) for name in ("early", "late")))
    return Pieces(
        np.concatenate([p.from_s for p in parts]), np.concatenate([p.to_s for p in parts]),
        np.concatenate([p.places for p in parts]), np.concatenate([p.velocity for p in parts]), drifts,
    )  # fmt: skip


def _edges(paths: Sequence[TimedPath], window_s: float) -> Floats:
    """The ends of slices: quantiles of the times of all break points, so that a vehicle has few pieces in a slice."""
    begin, end = min(p.begin_s for p in paths) - window_s, max(p.end_s for p in paths) + window_s
    times = np.concatenate([p.times_s for p in paths])
    at_a_time = max(1.0, sum(p.end_s - p.begin_s for p in paths) / (end - begin))
    count = int(np.clip(len(times) / at_a_time / PIECES_A_SLICE, *SLICES))
    inner = np.quantile(times, np.linspace(0.0, 1.0, count + 1)[1:-1])
    even = np.linspace(begin, end, SLICES[0] + 1)
    edges = np.unique(np.concatenate([even, inner]))
    # Very thin slices would only cost time.
    keep = np.append(True, np.diff(edges) > 1e-6 * (end - begin))
    keep[-1] = True
    if edges[-1] - edges[keep][-2] <= 1e-6 * (end - begin):
        keep[np.flatnonzero(keep)[-2]] = False
    return np.asarray(edges[keep])


def _strays(path: TimedPath, edges: Floats) -> tuple[Floats, Floats]:
    """Places at the slices' ends (K + 1, 3), and how far the motion strays from the even motion in each slice (K,)."""
    nodes = path.at(edges)
    k = np.clip(np.searchsorted(edges, path.times_s, side="right") - 1, 0, len(edges) - 2)
    part = (path.times_s - edges[k]) / (edges[k + 1] - edges[k])
    off = path.points - (nodes[k] + part[:, None] * (nodes[k + 1] - nodes[k]))
    stray = np.zeros(len(edges) - 1)
    np.maximum.at(stray, k, np.sqrt((off**2).sum(axis=1)))
    return nodes, stray


def _largest(values: Floats, low: Indices, high: Indices) -> Floats:
    """The largest of ``values[low : high + 1]`` for each pair of ``low`` and ``high`` (K,)."""
    ends = np.empty(2 * len(low), dtype=np.intp)
    ends[0::2], ends[1::2] = low, high + 1
    return np.maximum.reduceat(np.append(values, 0.0), ends)[0::2]
