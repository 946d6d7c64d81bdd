"""Search for short feasible paths by other means than the planners'.

Any path from start to goal that passes `Airspace.clear` bounds the optimum from above, so no planner's lower bound may
exceed its cost. Paths come from a lattice in space whose edges all pass the exact check (`routes`), and are made
cheaper by `tests.oracles.optima_polish`. No code is shared with the planners.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from gcsplan.arrays import Floats
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Circle
from tests.oracles.optima_polish import QUICK, Effort, cost_of, is_feasible, leg_costs, polish, pull

NEAR = 1e-3
"""Distance (m) that lattice points keep from zones, beyond the required clearance."""
MOST_LEVELS = 16
"""Altitudes added to a lattice at most where climb or descent is limited."""
EVERY_NODE = 1500
"""Points of the plane in the second lattice, tried if a smaller one contains no path."""


def best_path(problem: Problem, seed: int, effort: Effort = QUICK) -> Floats | None:
    """The cheapest feasible path found, (N, 3), or None."""
    rng = np.random.default_rng(seed)
    found = routes(problem, rng, effort)
    if not found and effort.points < EVERY_NODE:
        found = routes(problem, rng, replace(effort, points=EVERY_NODE, levels=3))
    ways = sorted((cost_of(problem, way), k, way) for k, way in enumerate(found))
    best: tuple[float, Floats] | None = None
    for _, _, way in ways[: effort.best]:
        points = polish(problem, way, rng, effort)
        if is_feasible(problem, points) and (best is None or cost_of(problem, points) < best[0]):
            best = cost_of(problem, points), points
    return None if best is None else best[1]


def routes(problem: Problem, rng: np.random.Generator, effort: Effort) -> list[Floats]:
    """Feasible paths, pulled taut: the first from the lattice's true costs, the others from disturbed costs."""
    lattice = Lattice.of(problem, rng, effort)
    out = []
    for k in range(effort.tries):
        way = lattice.way(rng, 0.0 if k == 0 else float(rng.choice([0.1, 0.3, 0.8])))
        if way is None:
            break
        out.append(pull(problem, way))
    return out


@dataclass(eq=False)
class Lattice:
    """Points in space and clear legs between them. ``stops``: indices of the points of start, each via and goal."""

    problem: Problem
    points: Floats
    start: NDArray[np.intp]
    end: NDArray[np.intp]
    costs: Floats
    stops: list[NDArray[np.intp]] = field(default_factory=list)

    @classmethod
    def of(cls, problem: Problem, rng: np.random.Generator, effort: Effort) -> Lattice:
        """Build the lattice from nodes of the DEM (all, or as many as the effort allows), saddles and zone borders."""
        air, limits = problem.airspace, problem.limits
        reach = (limits.track_error_m + limits.horizontal_clearance_m) * air.scale
        stops = [problem.start[:2], *((v.east_m, v.north_m) for v in problem.via), problem.goal[:2]]
        plane = np.vstack([stops, _nodes(air.surface, effort.points), _saddles(air.surface, effort.points // 4)])
        plane = np.vstack([plane, *_borders(problem, reach, 12)])
        low, high = (of(plane[:, 0], plane[:, 1], limits) for of in (air.floor_amsl, air.ceiling_amsl))
        known = np.isfinite(low) & (low <= high + 1e-6)
        known[: len(stops)] = True
        number = np.flatnonzero(known)
        plane, low, high = plane[known], np.minimum(low[known], high[known]), high[known]
        low, high = np.where(np.isfinite(low), low, 0.0), np.where(np.isfinite(high), high, np.inf)
        levels = _levels(problem, low, high, rng, effort.levels, float(np.median(_spacing(plane))))
        z = np.clip(levels[None, :], low[:, None], high[:, None])
        fixed = [problem.start[2], *(v.amsl_m for v in problem.via), problem.goal[2]]
        for row in range(len(stops)):
            if fixed[row] is not None:
                z[number == row] = fixed[row]
        n, count = len(plane), len(levels)
        points = np.concatenate([np.repeat(plane, count, axis=0), z.reshape(-1, 1)], axis=1)
        near = np.asarray(KDTree(plane).query(plane, k=min(21, n))[1])[:, 1:]
        a, b = np.repeat(np.arange(n), near.shape[1]), near.ravel()
        pairs = np.unique(np.sort(np.stack([a, b], axis=-1), axis=1), axis=0)
        steps = [(k, m) for k in range(count) for m in (k - 1, k, k + 1) if 0 <= m < count]
        starts = [pairs[:, 0] * count + k for k, _ in steps]
        ends = [pairs[:, 1] * count + m for _, m in steps]
        for k in range(count - 1):
            starts.append(np.arange(n) * count + k)
            ends.append(np.arange(n) * count + k + 1)
        out = cls(problem, points, np.concatenate(starts), np.concatenate(ends), np.zeros(0))
        out.keep_clear()
        out.stops = [
            np.flatnonzero(number == k)[:1].repeat(count) * count + np.arange(count) for k in range(len(stops))
        ]
        return out

    def keep_clear(self) -> None:
        """Keep each leg, in each direction, that the exact check and the climb limits pass; set the costs."""
        limits = self.problem.limits
        p, q = self.points[self.start], self.points[self.end]
        rise, run = q[:, 2] - p[:, 2], np.hypot(*(q - p)[:, :2].T)
        free = Limits(
            limits.min_agl_m, limits.max_agl_m, limits.max_amsl_m, limits.horizontal_clearance_m,
            limits.track_error_m, limits.altitude_error_m,
        )  # fmt: skip
        n = len(p)
        errors = np.full(n, limits.track_error_m), np.full(n, limits.altitude_error_m)
        ok = self.problem.airspace.clear(Legs(p, q, np.zeros(n, np.bool_), *errors), free)
        up, down = limits.max_climb_slope, limits.max_descent_slope

        def gentle(rise: Floats) -> NDArray[np.bool_]:
            climbs = np.full(n, True) if math.isinf(up) else rise <= up * run
            return climbs if math.isinf(down) else climbs & (-rise <= down * run)

        one, other = ok & gentle(rise), ok & gentle(-rise)
        cost = leg_costs(self.problem, p, q)
        a, b = self.start, self.end
        self.start, self.end = np.concatenate([a[one], b[other]]), np.concatenate([b[one], a[other]])
        self.costs = np.concatenate([cost[one], cost[other]])

    def way(self, rng: np.random.Generator, noise: float) -> Floats | None:
        """The cheapest path through all terminals, with costs disturbed smoothly over the plane by about ``noise``."""
        cost = self.costs
        if noise > 0.0:
            cost = cost * np.exp(noise * self._weather(rng)[self.start])
        count = len(self.points)
        ends = self.start.astype(np.int32), self.end.astype(np.int32)
        graph = csr_array((np.maximum(cost, 1e-9), ends), shape=(count, count))
        tail = {int(k): (0.0, self.points[k][None]) for k in self.stops[0][:1]}
        for stop in self.stops[1:]:
            sources = list(tail)
            if not sources:
                return None
            far, before = dijkstra(graph, indices=sources, return_predecessors=True)
            onward: dict[int, tuple[float, Floats]] = {}
            for node in np.unique(stop).tolist():
                totals = [tail[s][0] + far[r, node] for r, s in enumerate(sources)]
                row = int(np.argmin(totals))
                if math.isfinite(totals[row]):
                    chain = [node]
                    while chain[-1] != sources[row]:
                        chain.append(int(before[row, chain[-1]]))
                    onward[node] = totals[row], np.vstack([tail[sources[row]][1], self.points[chain[::-1]][1:]])
            tail = onward
        return min(tail.values(), key=lambda x: x[0])[1] if tail else None

    def _weather(self, rng: np.random.Generator) -> Floats:
        size = np.ptp(self.points[:, :2], axis=0).max()
        waves = rng.normal(0.0, 2.0 * math.pi * 2.0 / size, (6, 2))
        value = np.sin(self.points[:, :2] @ waves.T + rng.uniform(0.0, 2.0 * math.pi, 6)).sum(axis=1)
        # Some draws also make high points dearer or cheaper.
        high = (self.points[:, 2] - self.points[:, 2].min()) / max(float(np.ptp(self.points[:, 2])), 1e-9)
        return np.asarray(value + rng.choice([0.0, 2.0, -2.0]) * high)


def _nodes(surface: Surface, most: int) -> Floats:
    rows, cols = surface.ground_m.shape
    part = min(1.0, math.sqrt(most / (rows * cols)))
    c = np.linspace(0.0, cols - 1.0, max(2, round(cols * part)))
    r = np.linspace(0.0, rows - 1.0, max(2, round(rows * part)))
    if part < 1.0:
        c, r = np.round(c), np.round(r)
    c, r = np.concatenate([c, [0.3, cols - 1.3]]), np.concatenate([r, [0.3, rows - 1.3]])
    grid = np.meshgrid(np.unique(c), np.unique(r))
    return surface.grid.to_plane(grid[0].ravel(), grid[1].ravel())


def _saddles(surface: Surface, most: int) -> Floats:
    """Saddles of the bilinear surface inside its cells: passes that the nodes alone miss."""
    z = surface.top_m
    a, b, c, d = z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]
    twist = a + d - b - c
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = (a - c) / twist, (a - b) / twist
    row, col = np.nonzero((u > 0.0) & (u < 1.0) & (v > 0.0) & (v < 1.0))
    order = np.argsort(-np.abs(twist[row, col]))[:most]
    row, col = row[order], col[order]
    return surface.grid.to_plane(col + u[row, col], row + v[row, col]).reshape(-1, 2)


def _borders(problem: Problem, reach: float, spokes: int) -> list[Floats]:
    out = []
    for zone in problem.airspace.zones:
        s = zone.shape
        if isinstance(s, Circle):
            turn = np.arange(spokes) * (2.0 * math.pi / spokes)
            radius = (s.radius_m * problem.airspace.scale + reach + NEAR) / math.cos(math.pi / spokes)
            out.append(np.array([s.east_m, s.north_m]) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1))
        else:
            p = s.vertices
            before, after = np.roll(p, 1, axis=0) - p, np.roll(p, -1, axis=0) - p
            outward = -(before / np.hypot(*before.T)[:, None] + after / np.hypot(*after.T)[:, None])
            outward /= np.maximum(np.hypot(*outward.T), 1e-9)[:, None]
            out.extend([p + (1.2 * reach + NEAR) * outward, p - (1.2 * reach + NEAR) * outward])
    return out


def _spacing(plane: Floats) -> Floats:
    """Distance (m) of each point of the plane to its fifth neighbour."""
    return np.asarray(KDTree(plane).query(plane, k=min(6, len(plane)))[0])[:, -1]


def _levels(problem: Problem, low: Floats, high: Floats, rng: np.random.Generator, count: int, step_m: float) -> Floats:
    """Altitudes of the lattice: ceiling, ends, tops and bottoms of zones, and others in between.

    If the climb is limited, levels are close enough to climb from one to the next within about ``step_m``.
    """
    limits, error = problem.limits, problem.limits.altitude_error_m
    bottom = float(low.min())
    top = max(float(low.max()), problem.start[2], problem.goal[2])
    marks = [problem.start[2], problem.goal[2], bottom]
    for zone in problem.airspace.zones:
        for level, side in ((zone.ceiling, 1.0), (zone.floor, -1.0)):
            if level is not None and level.datum == "amsl":
                marks.append(level.value_m + side * (error + NEAR))
                top = max(top, marks[-1] if side > 0.0 else top)
            elif level is not None and side > 0.0:
                top = max(top, float(low.max()) - limits.min_agl_m + level.value_m + 2.0 * error + 1.0)
    top = min(top, float(high.max()))
    marks = [m for m in marks if bottom <= m <= top]
    marks = [top, *(marks[k] for k in rng.permutation(len(marks))[: max(count - 2, 0)])]
    slope = min(limits.max_climb_slope, limits.max_descent_slope)
    if math.isfinite(slope) and top > bottom:
        marks += list(
            np.linspace(bottom, top, min(math.ceil((top - bottom) / (1.3 * slope * step_m)) + 1, MOST_LEVELS))
        )
    marks += list(np.linspace(bottom, top, count + 1)[:-1][: max(count - len(marks), 1)])
    return np.unique(np.array(marks))
