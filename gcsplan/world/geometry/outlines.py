"""Outlines of polygons: whether they can be examined in time, and outlines with fewer corners around or inside them.

Work is counted before it is done. The time to find out whether an outline crosses itself grows with the pairs of edges
whose boxes overlap, which are estimated from some of the edges.

An outline is drawn wider (or narrower) by two kinds of steps, each of which only adds to the polygon (or only takes
from it): a corner that points inward is left out, and an edge whose both ends point outward is replaced by the corner
in which its neighbours meet. For each edge an upper bound of the distance of the added area from the first polygon is
known, and stays within the tolerance. Whether the result crosses itself is examined at the end.
"""

from __future__ import annotations

import numpy as np

from gcsplan.arrays import Bools, Floats

MOST_EDGE_PAIRS = 12e6
"""Most pairs of edges with overlapping boxes in an outline that is examined: GEOS takes half a second for them."""

MOST_CROSSINGS = 30_000
"""Most crossings of an outline with itself whose enclosed area is found: GEOS takes two seconds for them."""

FEW_CORNERS = 2000
"""Outlines with so many corners are examined without an estimate."""

SAMPLED, AT_ONCE = 64, 32
"""Edges from which pairs are estimated, and most edges whose crossings are counted at once."""

WIDER_M = (0.05, 0.2, 1.0, 5.0, 20.0, 100.0)
"""Tolerances that `few_corners` tries, m."""

MOST_OUTLINE_ROUNDS = 200
"""Rounds of steps at most; each takes a fifth of the removable corners, or more."""


def overlapping_pairs(ring: Floats) -> float:
    """About how many pairs of an outline's (N, 2) edges have boxes that overlap; 0 for `FEW_CORNERS` corners."""
    if len(ring) <= FEW_CORNERS:
        return 0.0
    import shapely

    after = np.roll(ring, -1, axis=0)
    boxes = shapely.box(*np.minimum(ring, after).T, *np.maximum(ring, after).T)
    some = boxes[np.linspace(0, len(boxes) - 1, SAMPLED).astype(int)]
    return float(shapely.STRtree(boxes).query(some).shape[1]) / SAMPLED * len(boxes)


def crossings(ring: Floats, most: int = MOST_CROSSINGS, *, closed: bool = True) -> int:
    """How often the edges of an outline (N, 2), or of a line if not ``closed``, cross or touch edges that are not their
    neighbours; counts to ``most``.

    Each crossing counts twice, once for each edge.
    """
    import shapely

    edges = shapely.linestrings(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)[: None if closed else -1])
    tree, count = shapely.STRtree(edges), 0
    at_once = max(8, min(AT_ONCE, 1_000_000 // len(edges)))  # the box of one edge may overlap all others
    for k in range(0, len(edges), at_once):
        some = edges[k : k + at_once]
        count += int(tree.query(some, predicate="intersects").shape[1]) - 3 * len(some)  # itself and its two neighbours
        if count > most:
            return count
    return count


def fewer_corners(
    vertices: Floats, tolerance_m: float, *, outward: bool = True, most: int | None = None
) -> Floats | None:
    """An outline (N, 2), counter-clockwise and simple, with fewer corners; None if that crosses itself, or has more
    than ``most``.

    ``outward``: it holds the polygon, and every point of it lies within ``tolerance_m`` of the polygon; else the
    polygon holds it, and every point that it lacks lies within ``tolerance_m`` of the outside.
    """
    import shapely

    ring = np.asarray(vertices, float)
    error = np.zeros(len(ring))  # for the edge from each corner to the next
    for _ in range(MOST_OUTLINE_ROUNDS):
        if len(ring) <= 4:
            break
        ring, error, done = _round(ring, error, tolerance_m, 1.0 if outward else -1.0)
        if not done:
            break
    if most is not None and len(ring) > most:
        return None
    shape = shapely.Polygon(ring)
    fine = len(ring) >= 3 and overlapping_pairs(ring) <= MOST_EDGE_PAIRS and bool(shapely.is_valid(shape))
    return ring if fine and shape.area > 0.0 else None


def few_corners(vertices: Floats, most: int, *, outward: bool) -> Floats | None:
    """An outline (N, 2) with at most ``most`` corners around a polygon (``outward``) or inside it; or None.

    It is the polygon's own if that has so few, else with the least of the tolerances `WIDER_M` that is enough.
    """
    if len(vertices) <= most:
        return vertices
    for tolerance_m in WIDER_M:
        ring = fewer_corners(vertices, tolerance_m, outward=outward, most=most)
        if ring is not None:
            return ring
    return None


def _round(ring: Floats, error: Floats, tolerance_m: float, side: float) -> tuple[Floats, Floats, bool]:
    """The outline after some steps that do not touch each other; whether there were any. ``side``: 1 outward, -1 in."""
    n = len(ring)
    back, after, last = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0), np.roll(ring, -2, axis=0)
    left, mine, next_ = np.roll(error, 1), error, np.roll(error, -1)
    turn = side * _cross(ring - back, after - ring)  # positive: the corner points outward
    # Leave out corner i, which points inward: this adds the triangle of it and its neighbours.
    chord = np.linalg.norm(after - back, axis=1)
    height = np.abs(_cross(ring - back, after - back)) / np.maximum(chord, 1e-30)
    lost = np.where(turn <= 0.0, np.minimum(height, 0.5 * chord) + np.maximum(left, mine), np.inf)
    # Replace edge i by the corner in which its neighbours meet: this adds the triangle of that corner and the edge.
    meet, meets = _meeting(back, ring, after, last)
    step = after - ring
    part = ((meet - ring) * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), 1e-30)
    rise = np.linalg.norm(meet - ring - part.clip(0.0, 1.0)[:, None] * step, axis=1)
    turns = (turn > 0.0) & (np.roll(turn, -1) > 0.0) & meets
    drawn = np.where(turns, np.maximum(np.maximum(left, next_), mine + rise), np.inf)
    cost = np.minimum(lost, drawn)
    cost[~(cost <= tolerance_m)] = np.inf
    # Where all costs are alike, an order that looks random keeps steps apart.
    key = (cost + 1e-9) * (1.0 + 0.2 * ((np.arange(n) * 0.6180339887498949) % 1.0))
    chosen = np.isfinite(cost) & _least_nearby(key)
    if not chosen.any():
        return ring, error, False
    leave = chosen & (lost <= drawn)
    join = chosen & ~leave
    new, new_error, keep = ring.copy(), error.copy(), ~leave
    i = np.flatnonzero(leave)
    new_error[(i - 1) % n] = lost[i]
    j = np.flatnonzero(join)
    new[j] = meet[j]
    new_error[(j - 1) % n] = drawn[j]
    new_error[j] = drawn[j]
    keep[(j + 1) % n] = False
    return new[keep], new_error[keep], True


def _meeting(p: Floats, a: Floats, b: Floats, q: Floats) -> tuple[Floats, Bools]:
    """Where the lines from ``p`` past ``a`` and from ``q`` past ``b`` (N, 2) meet, and whether they do, beyond both."""
    u, v = a - p, b - q
    down = _cross(u, v)
    apart = _cross(b - a, v)
    far = _cross(b - a, u)
    scale = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1)
    sound = np.abs(down) > 1e-6 * scale
    down = np.where(sound, down, 1.0)
    s, t = apart / down, far / down
    return a + s[:, None] * u, sound & (s >= 0.0) & (t >= 0.0)


def _least_nearby(key: Floats) -> Bools:
    """Which of the keys around a ring are less than the three before and behind them."""
    least = np.ones(len(key), np.bool_)
    for step in (1, 2, 3):
        for way in (-step, step):
            other = np.roll(key, way)
            least &= (key < other) | (np.isinf(other) & np.isfinite(key))
    return least


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
