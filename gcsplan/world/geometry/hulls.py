"""Distances of convex regions of the plane from points and polygons, for many regions at once.

A region is the convex hull of a few points. Its border lies on segments between pairs of them, and all such segments
lie in it, so no hull is ever built: the distance is the least over all pairs, the inside the union of all triangles.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import combinations

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices

POINTS_AT_ONCE = 1_000_000
MEETS = -1.0
"""Overlap; not 0, which is touching: touching is legal if no clearance is required."""


def to_point(regions: Floats, point: Floats) -> Floats:
    """(M,) distance of each region (M, K, 2) from a point (2,); 0 inside."""
    return to_points(regions, np.broadcast_to(point, (len(regions), 2)))


def to_points(regions: Floats, points: Floats) -> Floats:
    """(M,) distance of each region (M, K, 2) from its own point (M, 2); 0 inside."""
    first, second = _choices(regions.shape[1], 2)
    a, b = regions[:, first], regions[:, second]
    best = np.asarray(_to_segment(points[:, None] - a, b - a).min(axis=1, initial=np.inf))
    best[_holds(regions, points[:, None])[:, 0]] = 0.0
    return best


def to_polygon(regions: Floats, corners: Floats, within: Floats | float = math.inf) -> Floats:
    """(M,) distance of each region (M, K, 2) from a polygon (V, 2) with its inside; `MEETS` where they overlap.

    A region that is farther away than ``within`` (each its own, or one for all) may count as still farther.
    """
    at_once = max(POINTS_AT_ONCE // (len(corners) * max(math.comb(regions.shape[1], 3), 1)), 1)
    within = np.broadcast_to(within, len(regions))
    parts = [
        _to_polygon(regions[i : i + at_once], corners, float(within[i : i + at_once].max()))
        for i in range(0, len(regions), at_once)
    ]
    return np.concatenate(parts) if parts else np.zeros(0)


def _to_polygon(regions: Floats, corners: Floats, within: float) -> Floats:
    after = np.roll(corners, -1, axis=0)
    meets = _inside(regions, corners).any(axis=1)
    near = _near(regions.reshape(-1, 2), corners, after, within)
    corners, after = corners[near], after[near]
    # Distances of the region's points from the polygon's edges, and of the polygon's corners from the region's pairs.
    away = regions[:, :, None] - corners
    best = _to_segment(away, after - corners).min(axis=(1, 2), initial=np.inf)
    meets |= _holds(regions, np.broadcast_to(corners, (len(regions), *corners.shape))).any(axis=1)
    for a, b in _pairs(regions):
        a, b = a[:, None], b[:, None]
        best = np.minimum(best, _to_segment(corners - a, b - a).min(axis=1, initial=np.inf))
        sides = _cross(b - a, corners - a), _cross(b - a, after - a)
        ends = _cross(after - corners, a - corners), _cross(after - corners, b - corners)
        meets |= ((sides[0] * sides[1] < 0.0) & (ends[0] * ends[1] < 0.0)).any(axis=1)
    return np.where(meets, MEETS, best)


def _near(points: Floats, first: Floats, last: Floats, within: float) -> Bools:
    """(V,) which segments are not certainly farther than ``within`` from the hull of ``points``."""
    away = points - points[0]
    length = np.hypot(*away.T)
    along = away[length.argmax()] / max(float(length.max()), 1e-30)
    near = np.ones(len(first), np.bool_)
    # Where the shadows of both on a line are that far apart, so are they: of long regions, the line across.
    for axis in ((1.0, 0.0), (0.0, 1.0), along, along[::-1] * (-1.0, 1.0)):
        shadow, a, b = points @ axis, first @ axis, last @ axis
        spare = within + 1e-6 * (1.0 + np.abs(shadow).max())
        near &= (np.minimum(a, b) <= shadow.max() + spare) & (np.maximum(a, b) >= shadow.min() - spare)
    return near


def _pairs(regions: Floats) -> list[tuple[Floats, Floats]]:
    return [(regions[:, i], regions[:, j]) for i, j in combinations(range(regions.shape[1]), 2)]


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _to_segment(away: Floats, step: Floats) -> Floats:
    """Distance from a segment of a point; ``away``: the point from the segment's start; ``step``: the segment."""
    square = np.maximum((step * step).sum(axis=-1), 1e-30)
    part = np.clip((away * step).sum(axis=-1) / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(away - part[..., None] * step, axis=-1))


def _holds(regions: Floats, points: Floats) -> Bools:
    """(M, P) whether each region contains its own points (M, P, 2)."""
    a, b, c = (regions[:, some, None] for some in _choices(regions.shape[1], 3))
    at = points[:, None]
    sides = _cross(b - a, at - a), _cross(c - b, at - b), _cross(a - c, at - c)
    left = (sides[0] > 0.0) & (sides[1] > 0.0) & (sides[2] > 0.0)
    right = (sides[0] < 0.0) & (sides[1] < 0.0) & (sides[2] < 0.0)
    return np.asarray(((left | right) & (_cross(b - a, c - a) != 0.0)).any(axis=1))


@cache
def _choices(count: int, size: int) -> tuple[Indices, ...]:
    """The numbers of all choices of ``size`` of ``count`` points: numbers of the first points, of the second, …"""
    return tuple(np.array(list(combinations(range(count), size)), dtype=np.intp).reshape(-1, size).T)


def _inside(points: Floats, corners: Floats) -> Bools:
    """(M, K) whether points (M, K, 2) lie inside a polygon (V, 2)."""
    after = np.roll(corners, -1, axis=0)
    e, n = points[..., :1], points[..., 1:]
    spans = (corners[:, 1] > n) != (after[:, 1] > n)
    with np.errstate(divide="ignore", invalid="ignore"):
        east = corners[:, 0] + (n - corners[:, 1]) / (after[:, 1] - corners[:, 1]) * (after[:, 0] - corners[:, 0]) > e
    return np.asarray((spans & east).sum(axis=-1) % 2 == 1)
