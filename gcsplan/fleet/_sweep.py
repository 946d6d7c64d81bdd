"""Choose the pieces of motion that need an exact look: time slices, with a lower bound for each pair in each slice.

In a slice a vehicle is never farther than its ``stray`` from the even motion between its places at the slice's two
ends. The least distance of two even motions, less both strays, is a lower bound that costs one quadratic.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.fleet._nearest import Pieces, nearest
from gcsplan.fleet.motion.timed_path import TimedPath

FOREVER_S = 1e9
"""End time of the last piece of a vehicle that ends in the air, s."""

PIECES_A_SLICE = 4
SLICES = (16, 512)

BLOCK = 400_000
"""Rows that are handled together, about: some tens of megabytes."""

SLACK_M = 1e-7
"""Metres by which rounding may falsify a bound, and so the largest distance error of the search."""


@dataclass(frozen=True, eq=False, slots=True)
class Fleet:
    """Motions of V vehicles cut into K slices between ``edges_s`` (K + 1,), narrow where much moves.

    ``pieces`` holds those of all vehicles in turn, ``offset`` (V,) the first of each. ``nodes`` (V, K + 1, 3) are the
    places at the slices' ends (on the ground before take-off and after landing). ``stray`` is (V, K), in metres.
    ``fastest`` (V, K) is the top speed, m/s, in a slice and a window about it. ``begins`` and ``ends`` (V,) are the
    times in the air. ``first`` and ``last`` (V, K) are the pieces in a slice and a window about it, numbered over all
    vehicles.
    """

    paths: tuple[TimedPath, ...]
    window_s: float
    edges_s: Floats
    pieces: Pieces
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
        edges = _edges(paths, window_s)
        count = len(edges) - 1
        shape = (len(paths), count)
        nodes, stray, fastest = np.empty((len(paths), count + 1, 3)), np.empty(shape), np.empty(shape)
        first, last = np.empty(shape, dtype=np.intp), np.empty(shape, dtype=np.intp)
        parts, offset, total = [], np.empty(len(paths), dtype=np.intp), 0
        for v, path in enumerate(paths):
            piece = pieces_of(path)
            nodes[v], stray[v] = _strays(path, edges)
            low = np.searchsorted(piece.from_s, edges[:-1] - window_s, side="right") - 1
            high = np.searchsorted(piece.from_s, edges[1:] + window_s, side="left") - 1
            high[-1] = np.searchsorted(piece.from_s, edges[-1] + window_s, side="right") - 1  # with the stay at the end
            low, high = np.maximum(low, 0), np.maximum(high, 0)
            speed = np.sqrt((piece.velocity**2).sum(axis=1))
            fastest[v] = _largest(speed, low, high)
            first[v], last[v], offset[v] = low + total, high + total, total
            total += len(speed)
            parts.append(piece)
        pieces = Pieces(
            np.concatenate([p.from_s for p in parts]),
            np.concatenate([p.to_s for p in parts]),
            np.concatenate([p.places for p in parts]),
            np.concatenate([p.velocity for p in parts]),
        )
        begins = np.array([p.begin_s for p in paths])
        ends = np.array([FOREVER_S if p.ends_in_air else p.end_s for p in paths])
        return cls(tuple(paths), window_s, edges, pieces, offset, nodes, stray, fastest, begins, ends, first, last)

    def bounds(self, i: Indices, j: Indices) -> tuple[Floats, Floats]:
        """For pairs (M,): a lower bound in each slice (M, K), and the least distance at the slices' ends (M,), metres.

        Both are inf where the two are not in the air together.
        """
        edges = self.edges_s
        w = self.window_s
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
        if w > 0.0:
            bound -= w * (self.fastest[i] + self.fastest[j])
        shared = (edges[None, :-1] <= (end + w)[:, None]) & (edges[None, 1:] >= (begin - w)[:, None])
        known = (edges >= begin[:, None]) & (edges <= end[:, None])
        seen = np.where(known, square, np.inf).min(axis=1)
        return np.where(shared & (begin <= end + 2.0 * w)[:, None], bound, np.inf), np.sqrt(seen)

    def rows(self, i: Indices, j: Indices, k: Indices) -> Iterator[tuple[Indices, Indices, Indices]]:
        """All pairs of overlapping pieces of vehicles ``i`` and ``j`` in slices ``k`` (n,), in blocks.

        Each block has the row numbers among the n, and the numbers of the two pieces.
        """
        many_i = self.last[i, k] - self.first[i, k] + 1
        many_j = self.last[j, k] - self.first[j, k] + 1
        total = np.cumsum(many_i * many_j)
        start = 0
        while start < len(i):
            done = total[start - 1] if start else 0
            stop = max(start + 1, int(np.searchsorted(total, done + BLOCK, side="right")))
            of = np.repeat(np.arange(start, stop), (many_i * many_j)[start:stop])
            local = np.arange(len(of)) - (np.concatenate([[0], total])[of] - done)
            a = self.first[i[of], k[of]] + local // many_j[of]
            b = self.first[j[of], k[of]] + local % many_j[of]
            keep = overlap_of(self.pieces, a, b, 2.0 * self.window_s)
            yield of[keep], a[keep], b[keep]
            start = stop

    def least(self, i: Indices, j: Indices, cut_m: float = np.inf) -> Least:
        """The least distance of pairs (M,), exact wherever it is below ``cut_m``."""
        out = Least.none(len(i))
        w = 2.0 * self.window_s
        meet = np.flatnonzero((self.begins[i] <= self.ends[j] + w) & (self.begins[j] <= self.ends[i] + w))
        block = max(1, BLOCK // self.stray.shape[1])
        for start in range(0, len(meet), block):
            some = meet[start : start + block]
            a, b = i[some], j[some]
            bound, seen = self.bounds(a, b)
            ceiling = np.minimum(seen + 2.0 * SLACK_M, cut_m)
            best = bound.argmin(axis=1)
            rows = np.arange(len(a))
            go = bound[rows, best] < ceiling - SLACK_M
            self._look(a, b, rows[go], best[go], some, out)
            bound[rows, best] = np.inf
            ceiling = np.minimum(ceiling, out.distance_m[some])
            more, where = np.nonzero(bound < (ceiling - SLACK_M)[:, None])
            self._look(a, b, more.astype(np.intp), where.astype(np.intp), some, out)
        return out

    def _look(self, i: Indices, j: Indices, pair: Indices, k: Indices, numbers: Indices, out: Least) -> None:
        for of, a, b in self.rows(i[pair], j[pair], k):
            if not len(of):
                continue
            distance, t1, t2 = nearest(self.pieces.take(a), self.pieces.take(b), 2.0 * self.window_s)
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
    times, points = path.times_s, path.points
    if path.ends_in_air:
        times, points = np.append(times, FOREVER_S), np.vstack([points, points[-1:]])
    velocity = np.diff(points, axis=0) / np.diff(times)[:, None]
    return Pieces(times[:-1], times[1:], points[:-1], velocity)


def overlap_of(pieces: Pieces, a: Indices, b: Indices, apart_s: float) -> Bools:
    """Whether two pieces each overlap in time, by their times alone."""
    return np.asarray((pieces.from_s[a] <= pieces.to_s[b] + apart_s) & (pieces.from_s[b] <= pieces.to_s[a] + apart_s))


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
