"""The least length of a leg that passes over one zone: up to the zone's top, across, and down again.

A path over a zone enters its outline at some place p and leaves it for the last time at some place q, both at the
zone's top or higher. So it is at least as long as the way around the outline to p together with the climb, the straight
line from p to q, and the way from q together with the descent. While p and q stay on one edge each, and the ways turn
last at the same corners, that sum is convex, and its tangents bound it from below. Pieces of the edges are halved until
the least tangent is near the least sum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse.csgraph import dijkstra

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal.navmesh.portals import Exhausted, GroundPlace

SHRUNK_M = 0.02
"""Metres by which outlines are made smaller where they block a view: lines along their edges must not count as blocked,
and a smaller outline keeps the bound a bound."""
TOUCHING_M = 1e-6
"""Metres within which two shapes count as touching; much less than `SHRUNK_M`."""
MOST_WAY_CORNERS = 256
"""Most corners of all outlines around which the ways lead: the work grows with their square."""
PART, OFF_PARTS = 1e-5, (5e-5, 2e-4)
"""Parts of the length by which the bound may be too low, and by which arcs may be drawn too small: a way that turns
along an arc gets shorter by a third of that for each radian. The second is for outlines with many corners."""
MANY_CORNERS = 200
"""Corners of all outlines, from which on they are drawn with fewer."""
HALVINGS, MOST_PAIRS = 40, 200_000
"""Most times that pieces of edges are halved, and most pairs of pieces at once."""


@dataclass(frozen=True, slots=True)
class Climb:
    """The height ``rise_m`` from an end of a leg to a zone's top, which takes at least ``slant_m`` metres of flight.
    ``more_m``: the track beyond the end, on which the climb may begin. ``dearer``: the price of each metre by which a
    track is too short for the climb."""

    rise_m: float
    slant_m: float
    more_m: float = 0.0
    dearer: float = 0.0

    def least_m(self, track_m: Floats) -> Floats:
        """The least length with this climb over tracks that are at least ``track_m`` (N,) long from the end of the
        leg."""
        return np.maximum(np.hypot(track_m + self.more_m, self.rise_m), self.slant_m)

    def length_m(self, track_m: Floats) -> Floats:
        """The same cost over tracks of just that length, with the price ``dearer``."""
        lacks_m = math.sqrt(max(self.slant_m**2 - self.rise_m**2, 0.0)) - (track_m + self.more_m)
        return self.least_m(track_m) + self.dearer * np.maximum(lacks_m, 0.0)

    def growth(self, track_m: Floats) -> Floats:
        """By how much that length grows with each metre of the track."""
        track_m = track_m + self.more_m
        length = np.hypot(track_m, self.rise_m)
        return np.where(length < self.slant_m, -self.dearer, track_m / np.maximum(length, 1e-12))


@dataclass(frozen=True, slots=True)
class Crossing:
    """``length_m``: no path that passes over the zone is shorter; ``before`` (N, 2), ``after`` (M, 2): the ways to the
    zone and from it of the shortest one found, empty if none was found."""

    length_m: float
    before: Floats
    after: Floats


def crossing(
    a: GroundPlace, b: GroundPlace, zone: shapely.Geometry, others: Sequence[shapely.Geometry], up: Climb, down: Climb,
    limit_m: float, budget: Budget,
) -> Crossing:  # fmt: skip
    """The least length, at most ``limit_m``, from ``a`` to ``b`` past the polygons ``others`` and over ``zone``, with
    the tracks beyond both ends.

    Neither place may lie within a polygon. Raises Exhausted if the polygons have too many corners.
    """
    for part in OFF_PARTS:
        shapes = [_coarser(shape, part * limit_m) for shape in (zone, *others)]
        if sum(map(shapely.get_num_coordinates, shapes)) <= MANY_CORNERS:
            break
    zone = shapes[0]
    views = _Views(a, b, shapes, budget)
    edges = _edges(zone)
    before = _Pieces(views, views.onto(edges, 0, (up, down), limit_m))
    after = _Pieces(views, views.onto(edges, 1, (down, up), limit_m))
    first, last = np.flatnonzero(~before.hidden), np.flatnonzero(~after.hidden)
    if len(first) * len(last) > MOST_PAIRS:
        raise Exhausted(0.0)
    i, j = (at.ravel() for at in np.meshgrid(first, last))
    least, best, nearest = math.inf, math.inf, (0, 0)
    for _ in range(HALVINGS):
        low, value = _tangents(before.numbers[i], after.numbers[j], up, down)
        value[before.blocked[i] | after.blocked[j]] = math.inf
        if len(value) and value.min() < best:
            k = int(np.argmin(value))
            best, nearest = float(value[k]), (int(i[k]), int(j[k]))
        left = (low < min(limit_m, best - PART * limit_m)) & ~before.hidden[i] & ~after.hidden[j]
        i, j, least = i[left], j[left], float(low[left].min(initial=math.inf))
        if not 0 < 2 * len(i) <= MOST_PAIRS:
            break
        i, j = _halved(before, after, i, j)
    length_m = min(least, best - PART * limit_m, limit_m)
    if math.isinf(best):
        return Crossing(length_m, np.empty((0, 2)), np.empty((0, 2)))
    return Crossing(length_m, views.way(before, nearest[0], 0), views.way(after, nearest[1], 1)[::-1])


def _coarser(shape: shapely.Geometry, off_m: float) -> shapely.Geometry:
    """A polygon within ``shape`` whose arcs have fewer corners, each at most about ``off_m`` from the new edges: a
    shape's own arcs are drawn for lines that touch them, and here all corners are connected with each other."""
    rings = []
    for part in shapely.get_parts(shapely.normalize(shape)):  # exterior rings run clockwise
        ring = shapely.get_coordinates(part.exterior)[:-1]
        kept = [0]
        for k in range(1, len(ring)):
            between, base = ring[kept[-1] + 1 : k + 1], ring[(k + 1) % len(ring)] - ring[kept[-1]]
            off = ((between - ring[kept[-1]]) * (-base[1], base[0])).sum(axis=1) / max(math.hypot(*base), 1e-12)
            if off.max() > off_m or off.min() < 0.0:
                kept.append(k)
        rings.append(shapely.Polygon(ring[kept], part.interiors) if len(kept) > 2 else part)
    fewer = shapely.union_all(rings)
    return fewer if fewer.is_valid and shape.covers(fewer) else shape


def _edges(zone: shapely.Geometry) -> Floats:
    """(E, 4) the edges of a polygon, or of several."""
    rings = [shapely.get_coordinates(r) for p in shapely.get_parts(zone) for r in shapely.get_rings(p)]
    return np.concatenate([np.concatenate([r[:-1], r[1:]], axis=1) for r in rings])


def _tangents(before: Floats, after: Floats, up: Climb, down: Climb) -> tuple[Floats, Floats]:
    """Lower bounds of the sum over pairs of pieces, (N, 7) each, and the sums at the pieces' middles."""
    (p, along_p, half_p), (q, along_q, half_q) = _middles(before), _middles(after)
    first, to_p = _away(p, before[:, 1:3])
    last, to_q = _away(q, after[:, 1:3])
    across, from_p = _away(q, p)
    to_zone, from_zone = before[:, 0] + first, after[:, 0] + last
    value = up.length_m(to_zone) + across + down.length_m(from_zone)
    tilt_p = ((up.growth(to_zone)[:, None] * to_p - from_p) * along_p).sum(axis=1)
    tilt_q = ((down.growth(from_zone)[:, None] * to_q + from_p) * along_q).sum(axis=1)
    return value - np.abs(tilt_p) * half_p - np.abs(tilt_q) * half_q, value


def _middles(pieces: Floats) -> tuple[Floats, Floats, Floats]:
    """Middle (N, 2), direction (N, 2) and half the length (N,) of pieces (N, 7): metres to their corner, corner, two
    ends."""
    d = 0.5 * (pieces[:, 5:7] - pieces[:, 3:5])
    half = np.hypot(*d.T)
    return pieces[:, 3:5] + d, d / np.maximum(half, 1e-12)[:, None], half


def _away(p: Floats, q: Floats) -> tuple[Floats, Floats]:
    """Metres from ``q`` to ``p`` (N, 2), and the direction; no direction for equal places."""
    d = p - q
    metres = np.hypot(*d.T)
    return metres, d / np.maximum(metres, 1e-12)[:, None]


class _Pieces:
    """Pieces of a zone's edges, each with the corner by which an end of the leg reaches it: ``numbers`` (N, 7), metres
    to the corner, the corner, and both ends of the piece; ``blocked`` (N,), whether the corner does not see the middle;
    ``hidden`` (N,), whether it sees nothing of the piece."""

    def __init__(self, views: _Views, numbers: Floats) -> None:
        self._views, self.numbers = views, numbers
        self.blocked, self.hidden = views.of(numbers)
        self._first = np.full(len(numbers), -1)
        """(N,) the first half of each piece, whose other half is the next; -1 if it is whole."""

    def halves(self, at: Indices) -> Indices:
        """(N,) the first halves of pieces."""
        whole = np.unique(at[self._first[at] < 0])
        if len(whole):
            self._first[whole] = len(self.numbers) + 2 * np.arange(len(whole))
            one = self.numbers[whole]
            middle = 0.5 * (one[:, 3:5] + one[:, 5:7])
            other = one.copy()
            one[:, 5:7] = other[:, 3:5] = middle
            new = np.stack([one, other], axis=1).reshape(-1, 7)
            blocked, hidden = self._views.of(new)
            self.numbers = np.concatenate([self.numbers, new])
            self.blocked = np.concatenate([self.blocked, blocked])
            self.hidden = np.concatenate([self.hidden, hidden])
            self._first = np.concatenate([self._first, np.full(len(new), -1)])
        return self._first[at]


def _halved(before: _Pieces, after: _Pieces, i: Indices, j: Indices) -> tuple[Indices, Indices]:
    """The pairs with both halves of the longer piece of each pair."""
    longer = _middles(before.numbers[i])[2] >= _middles(after.numbers[j])[2]
    p, q = before.halves(i[longer]), after.halves(j[~longer])
    return np.concatenate([p, p + 1, i[~longer], i[~longer]]), np.concatenate([j[longer], j[longer], q, q + 1])


class _Views:
    """The corners of some polygons, the shortest ways to them from two places, and what each of them sees."""

    def __init__(self, a: GroundPlace, b: GroundPlace, shapes: Sequence[shapely.Geometry], budget: Budget) -> None:
        corners = np.unique(np.concatenate([shapely.get_coordinates(s) for s in shapes]), axis=0)
        if len(corners) > MOST_WAY_CORNERS:
            raise Exhausted(0.0)
        small = [s.buffer(-SHRUNK_M, join_style="mitre", mitre_limit=10.0) for s in shapes]
        self.solid = shapely.union_all(small)
        shapely.prepare(self.solid)
        self.corners = np.concatenate([[a, b], corners])
        i, j = np.triu_indices(len(self.corners), 1)
        self._budget = budget
        budget.spend("corner", 0.2 * len(i))
        seen = ~shapely.intersects(self.solid, shapely.linestrings(self.corners[np.stack([i, j], axis=1)]))
        metres = np.zeros((len(self.corners),) * 2)  # zero: no edge
        metres[i[seen], j[seen]] = np.maximum(np.hypot(*(self.corners[i] - self.corners[j])[seen].T), 1e-9)
        self.away_m, self.via = dijkstra(metres, directed=False, indices=[0, 1], return_predecessors=True)

    def onto(self, edges: Floats, end: int, climbs: tuple[Climb, Climb], limit_m: float) -> Floats:
        """(N, 7) each edge with each corner at which the shortest way from an ``end`` (0 or 1) to a part of it may turn
        last, and the metres to that corner. ``climbs``: from this end, and from the other; edges that no path shorter
        than ``limit_m`` passes are left out."""
        a, b, away_m = edges[:, :2], edges[:, 2:], self.away_m[end]
        long_m = np.hypot(*(b - a).T)
        # No place of an edge is farther than its ends and the way along it allow.
        most_m = 0.5 * (away_m[self._at(a)] + away_m[self._at(b)] + long_m)
        to = self.corners[:, None] - a
        share = ((to * (b - a)).sum(axis=2) / np.maximum(long_m**2, 1e-12)).clip(0.0, 1.0)
        straight_m = np.hypot(*np.moveaxis(to - share[..., None] * (b - a), 2, 0))
        least_m = away_m[:, None] + straight_m
        whole_m = climbs[0].least_m(least_m) + climbs[1].least_m(straight_m[1 - end])
        c, e = np.nonzero(np.isfinite(least_m) & (least_m <= most_m + TOUCHING_M) & (whole_m < limit_m))
        return np.concatenate([away_m[c, None], self.corners[c], edges[e]], axis=1)

    def _at(self, places: Floats) -> Indices:
        """The indices of corners (N, 2)."""
        return np.asarray(np.argmin(np.hypot(*np.moveaxis(places[:, None] - self.corners, 2, 0)), axis=1))

    def of(self, pieces: Floats) -> tuple[Bools, Bools]:
        """(N,) which pieces' middles are blocked, and which pieces are hidden as a whole: by one connected part of the
        polygons that reaches from one side of the triangle of corner and piece to the other."""
        hidden = np.zeros(len(pieces), np.bool_)
        middles = _middles(pieces)[0]
        blocked = shapely.intersects(self.solid, shapely.linestrings(np.stack([pieces[:, 1:3], middles], axis=1)))
        some: Indices = np.flatnonzero(blocked)
        if not len(some):
            return blocked, hidden
        self._budget.spend("corner", 4 * len(some))
        c, p, q = pieces[some, 1:3], pieces[some, 3:5], pieces[some, 5:7]
        inside = shapely.intersection(shapely.polygons(np.stack([c, p, q], axis=1)), self.solid)
        parts, of = shapely.get_parts(inside, return_index=True)
        one, other = (shapely.linestrings(np.stack([c, end], axis=1))[of] for end in (p, q))
        across = shapely.dwithin(parts, one, TOUCHING_M) & shapely.dwithin(parts, other, TOUCHING_M)
        hidden[some[of[across]]] = True
        return blocked, hidden

    def way(self, pieces: _Pieces, nth: int, end: int) -> Floats:
        """(N, 2) the way from an ``end`` to the middle of a piece by its corner."""
        piece = pieces.numbers[nth]
        at = int(self._at(piece[None, 1:3])[0])
        found = [0.5 * (piece[3:5] + piece[5:7])]
        while at >= 0:
            found.append(self.corners[at])
            at = int(self.via[end, at])
        return np.array(found[::-1])
