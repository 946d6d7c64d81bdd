"""Shortest tracks and altitudes by a second implementation: ground, grown zones, a visibility graph, taut profiles.

No code comes from gcsplan. A zone is grown by the check's distance; corners of the grown zone are followed by a mitre
of many small turns outside it, so that every track found is one that the check can pass.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from gcsplan.arrays import Bools, Floats
from tests.campaigns.bound_worlds import Barrier, Case, Terrain

TOUCH_M = 1e-7
STRAIGHT_M = 1e-4
FINER = 64
"""Parts of a step along a track where it enters or leaves the reach of a zone."""


class Ground:
    """Bilinear ground of a case, NaN where a node of the cell is unknown or beyond the edge."""

    def __init__(self, case: Case) -> None:
        self.t: Terrain | None = case.terrain
        self.flat_m = case.flat_m

    def at(self, east: Floats, north: Floats) -> Floats:
        """Heights AMSL at places."""
        east, north = np.broadcast_arrays(np.asarray(east, float), np.asarray(north, float))
        if self.t is None:
            return np.full(east.shape, self.flat_m)
        t, z = self.t, self.t.heights
        x, y = (east - t.west_m) / t.cell_m, (t.north_m - north) / t.cell_m
        rows, cols = z.shape
        inside = (x >= 0) & (y >= 0) & (x <= cols - 1) & (y <= rows - 1)
        i = np.clip(np.floor(y), 0, rows - 2).astype(int)
        j = np.clip(np.floor(x), 0, cols - 2).astype(int)
        u, v = x - j, y - i
        h = (1 - v) * ((1 - u) * z[i, j] + u * z[i, j + 1]) + v * ((1 - u) * z[i + 1, j] + u * z[i + 1, j + 1])
        return np.asarray(np.where(inside, h, np.nan))

    def around(self, points: Floats, reach_m: float, most: bool) -> Floats:
        """The highest (or lowest) ground within ``reach_m`` of points (N, 2); NaN where some of it is unknown."""
        if self.t is None or reach_m <= 0.0:
            return self.at(points[:, 0], points[:, 1])
        rings = max(1, math.ceil(reach_m / (0.25 * self.t.cell_m)))
        turn = np.arange(16) * np.pi / 8.0
        r = np.concatenate([[0.0], np.repeat(np.arange(1, rings + 1) / rings * reach_m, 16)])
        a = np.concatenate([[0.0], np.tile(turn, rings)])
        h = self.at(points[:, 0, None] + r * np.cos(a), points[:, 1, None] + r * np.sin(a))
        return np.asarray(h.max(axis=1) if most else h.min(axis=1))


class Air:
    """The limits of a case in numbers: lowest and highest altitudes along a track, and which zones stand in its way."""

    def __init__(self, case: Case) -> None:
        limits = case.limits
        self.ground, self.barriers = Ground(case), case.barriers
        self.track, self.error = limits["track_error_m"], limits["altitude_error_m"]
        if case.altitude_frame == "terrain":
            self.error += 30.0
        self.beside = limits["horizontal_clearance_m"]
        self.low, self.limits = limits["min_agl_m"], limits
        self.slopes = tuple(
            math.tan(math.radians(limits[k])) if k in limits else math.inf for k in ("max_climb_deg", "max_descent_deg")
        )
        if case.vehicles[0].get("return_route") == "mission":
            self.slopes = (min(self.slopes),) * 2

    @property
    def reach_m(self) -> float:
        """The metres by which a zone is grown."""
        return self.beside + self.track

    def floors(self, points: Floats) -> Floats:
        """Lowest altitudes over points (N, 2); NaN over unknown ground."""
        low = self.ground.around(points, self.track, True) + self.low
        if self.beside > 0.0:
            low = np.maximum(low, self.ground.around(points, self.reach_m, True))
        return np.asarray(low + self.error)

    def tops(self, points: Floats) -> Floats:
        """Highest altitudes over points (N, 2)."""
        high = np.full(len(points), self.limits.get("max_amsl_m", math.inf))
        if "max_agl_m" in self.limits:
            high = np.minimum(high, self.ground.around(points, self.track, False) + self.limits["max_agl_m"])
        return np.asarray(high - self.error)

    def band(self, track: Floats, ways: Sequence[str], grow_m: float) -> tuple[Floats, Floats]:
        """Lowest and highest altitudes at points (N, 2) of a track; ``ways``: for each zone around, over or under."""
        low, high = self.floors(track), self.tops(track)
        for barrier, way in zip(self.barriers, ways, strict=True):
            if way == "around":
                continue
            near = from_barrier(track, track, barrier) < self.reach_m + grow_m
            level = barrier.ceiling if way == "over" else barrier.floor
            assert level is not None
            most = way == "over"
            base = self.ground.around(track, self.track, most) if level[1] == "agl" else 0.0
            at = level[0] + base + (self.error if most else -self.error)
            if most:
                low = np.where(near, np.maximum(low, at), low)
            else:
                high = np.where(near, np.minimum(high, at), high)
        return low, high


# -- zones -----------------------------------------------------------------------------------------------------------


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _from_segment(p: Floats, a: Floats, b: Floats) -> Floats:
    along = b - a
    t = np.clip(((p - a) * along).sum(-1) / np.maximum((along * along).sum(-1), 1e-300), 0.0, 1.0)
    return np.asarray(np.hypot(*np.moveaxis(p - a - t[..., None] * along, -1, 0)))


def from_barrier(start: Floats, end: Floats, barrier: Barrier) -> Floats:
    """(N,) distances of segments (N, 2) from a zone; 0 where they meet it, negative for a circle."""
    if barrier.radius_m > 0.0:
        return _from_segment(barrier.ring[0], start, end) - barrier.radius_m
    a, b = barrier.ring, np.roll(barrier.ring, -1, axis=0)
    p, q = start[:, None], end[:, None]
    gap = np.minimum(
        np.minimum(_from_segment(p, a, b), _from_segment(q, a, b)),
        np.minimum(_from_segment(a[None], p, q), _from_segment(b[None], p, q)),
    )
    one, two = _cross(b - a, p - a), _cross(b - a, q - a)
    three, four = _cross(q - p, a - p), _cross(q - p, b - p)
    crossed = (one * two < 0.0) & (three * four < 0.0)
    x, y = p[..., 0], p[..., 1]
    ahead = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    inside = (ahead & (x < at)).sum(axis=1) % 2 == 1
    return np.asarray(np.where(crossed.any(axis=1) | inside, 0.0, gap.min(axis=1)))


def _corners(barrier: Barrier, reach_m: float, fine: int) -> Floats:
    """Points outside the grown zone around which tracks turn: the mitred corners of a polygon around it."""
    if barrier.radius_m > 0.0:
        parts = 8 * fine
        turn = (np.arange(parts) + 0.5) * 2.0 * np.pi / parts
        r = (barrier.radius_m + reach_m) / math.cos(math.pi / parts)
        return np.asarray(barrier.ring[0] + r * np.column_stack([np.cos(turn), np.sin(turn)]))
    ring = barrier.ring
    if _cross(np.roll(ring, -1, axis=0) - ring, np.roll(ring, -2, axis=0) - ring).sum() < 0.0:
        ring = ring[::-1]
    out = []
    for k, p in enumerate(ring):
        way = [p - ring[k - 1], ring[(k + 1) % len(ring)] - p]
        begin, end = (math.atan2(-w[0], w[1]) for w in way)  # outward normals
        span = (end - begin) % (2.0 * math.pi)
        if span >= math.pi:
            continue  # a reflex corner
        parts = max(1, math.ceil(fine * span / (0.5 * math.pi)))
        turn = begin + span * (np.arange(parts) + 0.5) / parts
        r = reach_m / math.cos(0.5 * span / parts)
        ends = [] if fine == 1 else [begin, begin + span]  # for a slit with centimetres of room
        out += [p + r * np.array([math.cos(t), math.sin(t)]) for t in turn]
        out += [p + reach_m * np.array([math.cos(t), math.sin(t)]) for t in ends]
    return np.array(out).reshape(-1, 2)


def shortest_track(
    stops: Sequence[Floats], barriers: Sequence[Barrier], reach_m: float, fence: Sequence[tuple[Floats, Floats]] = (),
    fine: int = 16,
) -> Floats | None:  # fmt: skip
    """The shortest track (N, 2) through ``stops`` around zones grown by ``reach_m``; None if there is none.

    It may not cross a segment of ``fence``.
    """
    out = [np.asarray(stops[0], float)]
    for a, b in itertools.pairwise(stops):
        rough = _leg(np.array(a), np.array(b), barriers, reach_m, fence, _all(barriers, reach_m, 1))
        nodes = _all(barriers, reach_m, 3) if rough is None else None
        rough = _leg(np.array(a), np.array(b), barriers, reach_m, fence, nodes) if nodes is not None else rough
        if rough is None:
            return None
        every = _all(barriers, reach_m, fine)
        inner = rough[1:-1]
        if len(inner) and len(every):
            apart = np.hypot(*np.moveaxis(every[:, None] - inner[None], -1, 0)).min(axis=1)
            near = every[apart < max(2.0 * reach_m, 1.0) + 0.3 * max([z.radius_m for z in barriers], default=0.0)]
            finer = _leg(np.array(a), np.array(b), barriers, reach_m, fence, np.vstack([near[:400], inner]))
            rough = rough if finer is None else finer
        out += list(rough[1:])
    return np.array(out)


def _all(barriers: Sequence[Barrier], reach_m: float, fine: int) -> Floats:
    return np.vstack([np.zeros((0, 2)), *(_corners(z, reach_m, fine) for z in barriers)])


def _leg(
    a: Floats, b: Floats, barriers: Sequence[Barrier], reach_m: float, fence: Sequence[tuple[Floats, Floats]],
    nodes: Floats,
) -> Floats | None:  # fmt: skip
    free = np.ones(len(nodes), bool)
    for z in barriers:
        free &= from_barrier(nodes, nodes, z) >= reach_m - TOUCH_M
    at = np.vstack([a[None], b[None], nodes[free]])
    i, j = np.triu_indices(len(at), 1)
    open_ = np.ones(len(i), bool)
    for z in barriers:
        live = np.flatnonzero(open_)
        open_[live] = from_barrier(at[i[live]], at[j[live]], z) >= reach_m - TOUCH_M
    for p, q in fence:
        s, e = at[i], at[j]
        open_ &= ~(
            (_cross(q - p, s - p) * _cross(q - p, e - p) < 0) & (_cross(e - s, p - s) * _cross(e - s, q - s) < 0)
        )
    i, j = i[open_], j[open_]
    graph = csr_array((np.hypot(*(at[j] - at[i]).T), (i, j)), shape=(len(at),) * 2)
    far, before = dijkstra(graph, directed=False, indices=0, return_predecessors=True)
    if not math.isfinite(far[1]):
        return None
    way = [1]
    while way[-1] != 0:
        way.append(int(before[way[-1]]))
    return np.asarray(at[way[::-1]])


# -- tracks over ground ----------------------------------------------------------------------------------------------


def ground_track(
    air: Air, a: Floats, b: Floats, barriers: Sequence[Barrier], fine: int, floors_too: bool = True
) -> Floats | None:
    """A track over known ground that no ceiling shuts, outside ``barriers``, by steps between nodes, pulled taut."""
    t = air.ground.t
    if t is None:
        return None
    n = (len(t.heights) - 1) * fine + 1
    step = t.cell_m / fine
    east, north = np.meshgrid(t.west_m + step * np.arange(n), t.north_m - step * np.arange(n))
    at = np.column_stack([east.ravel(), north.ravel()])
    free = _open(air, at, barriers, floors_too).reshape(n, n)
    ends = [(round((t.north_m - p[1]) / step), round((p[0] - t.west_m) / step)) for p in (a, b)]
    way = _by_steps(free, ends[0], ends[1])
    if way is None:
        return None
    points = np.array([a, *([t.west_m + step * c, t.north_m - step * r] for r, c in way), b])
    kept = [0]
    while kept[-1] < len(points) - 1:
        k = len(points) - 1
        while k > kept[-1] + 1 and not _sees(air, points[kept[-1]], points[k], barriers, step, floors_too):
            k -= max(1, (k - kept[-1]) // 8)
        kept.append(max(k, kept[-1] + 1))
    return np.asarray(points[kept])


def _open(air: Air, at: Floats, barriers: Sequence[Barrier], floors_too: bool) -> Bools:
    low = air.floors(at)
    free = np.isfinite(low)
    if floors_too:
        free &= low <= air.tops(at)
    for z in barriers:
        free &= from_barrier(at, at, z) >= air.reach_m
    return np.asarray(free)


def _sees(air: Air, a: Floats, b: Floats, barriers: Sequence[Barrier], step: float, floors_too: bool) -> bool:
    t = np.linspace(0.0, 1.0, max(3, math.ceil(4.0 * math.dist(a, b) / step)))[:, None]
    return bool(_open(air, a + t * (b - a), barriers, floors_too).all())


def _by_steps(free: Bools, start: tuple[int, int], goal: tuple[int, int]) -> list[tuple[int, int]] | None:
    cost = np.full(free.shape, math.inf)
    cost[start] = 0.0
    before: dict[tuple[int, int], tuple[int, int]] = {}
    queue = [(0.0, start)]
    steps = [(i, j, math.hypot(i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    while queue:
        so_far, (r, c) = heapq.heappop(queue)
        if (r, c) == goal:
            way = [goal]
            while way[-1] != start:
                way.append(before[way[-1]])
            return way[::-1]
        if so_far > cost[r, c]:
            continue
        for i, j, length in steps:
            k = r + i, c + j
            inside = 0 <= k[0] < free.shape[0] and 0 <= k[1] < free.shape[1]
            if inside and (free[k] or k == goal) and so_far + length < cost[k] - 1e-12:
                cost[k], before[k] = so_far + length, (r, c)
                heapq.heappush(queue, (so_far + length, k))
    return None


# -- altitudes -------------------------------------------------------------------------------------------------------


def sampled(
    track: Floats, step_m: float, passed: Sequence[Barrier] = (), reach_m: float = 0.0
) -> tuple[Floats, Floats, Floats]:
    """Points (N, 2) along a track at ``step_m`` or less, metres along it, and whether each is a corner of it.

    Where the border of a zone of ``passed``, grown by ``reach_m``, is crossed, steps are `FINER` times shorter.
    """
    points, corner = [track[:1]], [np.ones(1, bool)]
    for a, b in itertools.pairwise(track):
        parts = max(1, math.ceil(math.dist(a, b) / step_m))
        t = np.arange(parts + 1.0) / parts
        rough = a + t[:, None] * (b - a)
        fine = np.zeros(parts, bool)
        for z in passed:
            near = from_barrier(rough, rough, z) <= reach_m + TOUCH_M
            fine |= (from_barrier(rough[:-1], rough[1:], z) <= reach_m + TOUCH_M) & ~(near[:-1] & near[1:])
        between = [
            t[k] + np.arange(1, FINER + 1) / FINER / parts if fine[k] else t[k + 1 : k + 2] for k in range(parts)
        ]
        t = np.concatenate(between)
        t[-1] = 1.0
        points.append(a + t[:, None] * (b - a))
        corner.append(t == 1.0)
    at = np.vstack(points)
    return at, np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(at, axis=0).T))]), np.concatenate(corner)


def taut(s: Floats, low: Floats, high: Floats, slopes: tuple[float, float]) -> Floats | None:
    """The shortest profile (K, 2) of metres along and altitude between ``low`` and ``high`` (N,), which meet at the
    ends, no steeper than ``slopes`` (climb, descent); None if there is none."""
    if not np.isfinite(low).all():
        return None
    up, down = slopes
    if math.isfinite(up) and math.isfinite(down):
        low = np.maximum(_back(s, low, up), _on(s, low, down))
        high = np.minimum(_on(s, high, -up), _back(s, high, -down))
    if (low > high + 1e-9).any():
        return None
    apex, z, out = 0, float(low[0]), [(float(s[0]), float(low[0]))]
    last = len(s) - 1
    while apex < last:
        least, most, at_least, at_most = -math.inf, math.inf, apex, apex
        turn = (last, float(low[last]))
        for j in range(apex + 1, last + 1):
            run = max(s[j] - s[apex], 1e-12)
            a, b = (low[j] - z) / run, (high[j] - z) / run
            if a > most:
                turn = (at_most, float(high[at_most]))
                break
            if b < least:
                turn = (at_least, float(low[at_least]))
                break
            if a > least:
                least, at_least = a, j
            if b < most:
                most, at_most = b, j
        apex, z = turn
        out.append((float(s[apex]), z))
    kept = [out[0]]
    for here, after in itertools.pairwise(out):
        part = (here[0] - kept[-1][0]) / max(after[0] - kept[-1][0], 1e-12)
        if abs(kept[-1][1] + part * (after[1] - kept[-1][1]) - here[1]) > STRAIGHT_M:
            kept.append(here)
    return np.array([*kept, out[-1]])


def _on(s: Floats, z: Floats, slope: float) -> Floats:
    """The bound further on along the track that follows from a bound ``z`` at a place: falling by ``slope`` (positive
    for lower bounds), or rising by it (negative, for upper bounds)."""
    if slope >= 0.0:
        return np.asarray(np.maximum.accumulate(z + slope * s) - slope * s)
    return np.asarray(np.minimum.accumulate(z + slope * s) - slope * s)


def _back(s: Floats, z: Floats, slope: float) -> Floats:
    """As `_on`, further back along the track."""
    return _on(s[-1] - s[::-1], z[::-1], slope)[::-1]
