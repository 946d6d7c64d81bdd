"""The length of the shortest track on flat ground around zones: an independent visibility graph.

Zones are added one by one: the shortest track around the known zones is exact as soon as it meets no other zone. The
module shares nothing with the planners. Arcs are replaced by chords inside the true arc, so the length is never too
long because of them, and too short by less than one part in ten thousand.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from gcsplan.arrays import Bools, Floats
from gcsplan.world.geometry.zones import Circle, Zone

SEGMENTS = 24
"""Chords per quarter circle."""
GRAPH_TOUCH_M = 1e-4
"""A line that enters a shape by less than this, m, only touches it."""
GRAPH_ROUNDS = 400


class EnclosedPlace(Exception):
    """There is no track: zones enclose one of the places."""


@dataclass(eq=False)
class VisibilityGraph:
    """The shapes in the plane that no track may enter, grown by ``reach_m``."""

    shapes: list[shapely.Polygon]

    @classmethod
    def of(cls, zones: Sequence[Zone], reach_m: float, scale: float = 1.0) -> VisibilityGraph:
        """The grown shapes of zones; ``scale`` multiplies the radii of circles, as in the check."""
        shapes = []
        for zone in zones:
            if isinstance(zone.shape, Circle):
                radius = zone.shape.radius_m * scale + reach_m
                shape = shapely.Point(zone.shape.east_m, zone.shape.north_m).buffer(radius, quad_segs=SEGMENTS)
            else:
                shape = shapely.Polygon(zone.shape.vertices).buffer(reach_m, quad_segs=SEGMENTS)
            shapes.append(shape)
        return cls(shapes)

    def shortest(self, places: Sequence[tuple[float, float]]) -> float:
        """Metres of the shortest track through all ``places`` in order. Raises Unreachable."""
        return sum(self._leg(np.array(a), np.array(b)) for a, b in pairwise(places))

    def _leg(self, a: Floats, b: Floats) -> float:
        tree = shapely.STRtree([s.buffer(-GRAPH_TOUCH_M) for s in self.shapes])
        known: set[int] = set()
        for _ in range(GRAPH_ROUNDS):
            track = _past(a, b, [self.shapes[k] for k in sorted(known)])
            met = set(tree.query(shapely.LineString(track), predicate="intersects").tolist()) - known
            if not met:
                return float(np.hypot(*np.diff(track, axis=0).T).sum())
            known |= met
        raise RuntimeError("the visibility graph did not settle")


def _past(a: Floats, b: Floats, shapes: list[shapely.Polygon]) -> Floats:
    """(N, 2) the shortest track from ``a`` to ``b`` around shapes.

    A* over the shapes' convex corners; lines are tested only when they are needed.
    """
    if not shapes:
        return np.stack([a, b])
    union = shapely.unary_union(shapes)
    rings = [np.asarray(r.coords)[:-1] for p in shapely.get_parts(union) for r in (p.exterior, *p.interiors)]
    turns = [_convex(_outward(ring, hole)) for ring, hole in zip(rings, _holes(union), strict=True)]
    corners, before, after = (np.vstack(x) for x in zip(*turns, strict=True))
    inside = shapely.MultiPolygon(list(shapely.get_parts(union.buffer(-GRAPH_TOUCH_M))))
    shapely.prepare(inside)
    nodes = np.vstack([a, b, corners])
    left, right = np.vstack([[a, b], before]), np.vstack([[a, b], after])
    ahead = np.hypot(*(nodes - b).T)
    cost, parent = np.full(len(nodes), math.inf), np.full(len(nodes), -1)
    cost[0] = 0.0
    open_set, done = [(float(ahead[0]), 0)], np.zeros(len(nodes), bool)
    while open_set:
        _, k = heapq.heappop(open_set)
        if done[k]:
            continue
        done[k] = True
        if k == 1:
            break
        way = np.hypot(*(nodes - nodes[k]).T)
        better = ~done & (cost[k] + way < cost - 1e-9) & (way > 1e-9)
        # A shortest track turns only around corners, so the line must touch the shape at both of its ends.
        better &= _touches(nodes[k], nodes, left, right) & _touches_at(nodes, nodes[k], left[k], right[k], k < 2)
        some = np.flatnonzero(better)
        if not len(some):
            continue
        lines = shapely.linestrings(np.stack([np.broadcast_to(nodes[k], (len(some), 2)), nodes[some]], axis=1))
        for j in some[~shapely.intersects(inside, lines)].tolist():
            cost[j], parent[j] = cost[k] + way[j], k
            heapq.heappush(open_set, (float(cost[j] + ahead[j]), j))
    if not math.isfinite(cost[1]):
        raise EnclosedPlace
    track = [1]
    while track[-1] != 0:
        track.append(int(parent[track[-1]]))
    return nodes[track[::-1]]


def _holes(union: shapely.Geometry) -> list[bool]:
    return [hole for p in shapely.get_parts(union) for hole in (False, *([True] * len(p.interiors)))]


def _outward(ring: Floats, hole: bool) -> Floats:
    """The ring with the free side on its right, whether it bounds a shape or a hole in one."""
    return ring[::-1] if shapely.LinearRing(ring).is_ccw == hole else ring


def _convex(ring: Floats) -> tuple[Floats, Floats, Floats]:
    """The corners of a ring around which a track may turn, and the corners before and after each."""
    before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
    u, v = ring - before, after - ring
    convex = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0.0
    return ring[convex], before[convex], after[convex]


def _touches(origin: Floats, nodes: Floats, before: Floats, after: Floats) -> Bools:
    """(N,) whether the line from ``origin`` to each corner has both neighbours of the corner on the same side."""
    d = nodes - origin
    u, v = before - nodes, after - nodes
    one = d[:, 0] * u[:, 1] - d[:, 1] * u[:, 0]
    other = d[:, 0] * v[:, 1] - d[:, 1] * v[:, 0]
    return np.asarray(one * other >= -1e-9 * np.maximum((d**2).sum(axis=1), 1.0))


def _touches_at(nodes: Floats, corner: Floats, before: Floats, after: Floats, free: bool) -> Bools:
    """(N,) as `_touches`, for the corner that the lines leave; ``free``: it is a place, where any line may turn."""
    if free:
        return np.ones(len(nodes), np.bool_)
    d = nodes - corner
    u, v = before - corner, after - corner
    one = d[:, 0] * u[1] - d[:, 1] * u[0]
    other = d[:, 0] * v[1] - d[:, 1] * v[0]
    return np.asarray(one * other >= -1e-9 * np.maximum((d**2).sum(axis=1), 1.0))
