"""Paths through worlds as high as they are wide: ways in space, on a lattice of places and altitudes.

Under a constant cap a track goes around what reaches above it, on the way up and at the top alike. That is no loss on
terrain, where heights are small against distances; between needles, what a path passes low it may have to go around,
and what it passes high it need not. Here the ways are searched in space itself: on a lattice over all places that a
better path could touch, edges put to the exact check, the shortest way and others well apart from it; each is drawn
together (`section_dp`) on cross-sections along it. There is no bound in it: it is one more source of paths.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.sources.section_dp import FIXED, FREE, UPRIGHT, cheapest, cost_of, drawn
from gcsplan.planners.problem import Problem

Ints = NDArray[np.intp]

RATIO = 0.15
"""A world is steep where the best path known rises by that part of its track, and may climb and descend so steeply."""
NODES, BOX_NODES = 6000, 400_000
"""Nodes of a lattice that are wanted, about, and those of the box around them that are looked at, at most."""
WINDING = 1.06
"""A way along the lattice may be longer than the best path by so much: it goes in a few directions only."""
WIDEST = 0.5
"""Widest margin of the box around two terminals, as a part of their distance."""
NEAR = 2.3
"""PinnedTrack are linked to nodes within so many steps."""
WAYS, APART = 10, 3.0
"""Most ways between two terminals, and how many steps from all ways before one must somewhere be."""
DRAWN = 8
"""Of those, the cheapest are drawn together."""
HOPE = 1.004
"""A path drawn together coarsely that costs so much times the best known is not worth more."""
LEVELS = 24
"""Most heights looked at over a via whose height is free."""
REACH = np.array([d for d in np.ndindex(5, 5, 5) if d > (2, 2, 2) and math.gcd(*(abs(k - 2) for k in d)) == 1]) - 2
STEPS = REACH[(REACH**2).sum(axis=1) <= 6]
"""(K, 3) half of the directions of the lattice's edges."""


def is_steep(problem: Problem, points: Floats) -> bool:
    """Whether a search in space is worth it, as far as the best path known tells."""
    limits = problem.limits
    track_m = float(np.hypot(*np.diff(points[:, :2], axis=0).T).sum())
    may = min(limits.max_climb_slope, limits.max_descent_slope)
    terminals = terminals_by_leg(problem, points)
    apart = all(math.dist(a[:2], b[:2]) > 1e-3 for a, b in pairwise(terminals))
    return apart and may >= RATIO and float(np.ptp(points[:, 2])) >= RATIO * track_m


def steep_path(problem: Problem, known: Floats, in_time: Callable[[], bool]) -> tuple[Floats, Bools] | None:
    """(N, 3) a path that the exact check passes leg by leg, and (N,) its terminals; None where none was found that
    is cheaper.

    ``known`` (M, 3): the best path so far. Deterministic but for ``in_time``,
    which ends it early.
    """
    terminals = terminals_by_leg(problem, known)
    return path_of(problem, terminals, cost_of(problem, known), None, in_time, _lattice)


def path_of(
    problem: Problem,
    terminals: Floats,
    best: float,
    known: Floats | None,
    in_time: Callable[[], bool],
    lattice: Callable[[Problem, Floats, Floats, float], Lattice],
    hope: float = HOPE,
) -> tuple[Floats, Bools] | None:
    """The same over lattices of any kind: ``lattice(problem, starts, goals, limit)`` makes that between two terminals.

    ``terminals`` (K, 3) as of `terminals_by_leg`; ``best``: the cost to beat, inf where there is no path. ``known``
    (M, 3) is drawn together, too, where it is given. A path drawn together coarsely that costs ``hope`` times ``best``
    is not worth more.
    """
    straight = problem.leg_costs(terminals[:-1], terminals[1:])
    spare = WINDING * best - float(straight.sum())
    columns = [terminals[:1], *(_heights(problem, k, terminals) for k in range(1, len(terminals) - 1)), terminals[-1:]]
    lattices, reached = [], [np.zeros(1)]
    for k, limit in enumerate((straight + spare).tolist()):
        if not in_time():
            return None
        lattices.append(lattice(problem, columns[k], columns[k + 1], limit))
        reached.append(lattices[k].beyond(reached[k]))
    tried = [] if known is None else [(known, _kinds_of(problem, known))]
    if np.isfinite(reached[-1]).any():
        # The heights over the vias, from the last terminal back, then the ways between those.
        at, parts = 0, []
        for k in range(len(lattices) - 1, -1, -1):
            before, ways = lattices[k].ways(reached[k], at)
            parts.append(_best(problem, ways, lattices[k].step_m, in_time))
            at = before
        parts.reverse()
        points = np.vstack([parts[0], *(part[1:] for part in parts[1:])])
        kinds = np.full(len(points), FREE)
        ends = np.cumsum([0, *(len(part) - 1 for part in parts)])
        kinds[ends] = [FIXED, *(UPRIGHT if v.amsl_m is None else FIXED for v in problem.via), FIXED]
        if cost_of(problem, points) <= hope * best:
            tried.append((points, kinds))
    size_m = min(x.step_m for x in lattices)
    out: tuple[Floats, Bools] | None = None
    for points, kinds in tried:
        points, kinds = drawn(problem, points, kinds, size_m, in_time)
        cost = cost_of(problem, points)
        if cost < best:
            best, out = cost, (points, kinds != FREE)
    return out


def _kinds_of(problem: Problem, points: Floats) -> Ints:
    """(N,) kinds of the points of a path that passes start, vias and goal."""
    kinds = np.full(len(points), FREE)
    at = 0
    for via in problem.via:
        off = np.hypot(points[at:, 0] - via.east_m, points[at:, 1] - via.north_m)
        off += 0.0 if via.amsl_m is None else np.abs(points[at:, 2] - via.amsl_m)
        at += int(np.argmax(off <= off.min() + 1e-6))
        kinds[at] = UPRIGHT if via.amsl_m is None else FIXED
    kinds[[0, -1]] = FIXED
    return kinds


def terminals_by_leg(problem: Problem, points: Floats) -> Floats:
    """(K, 3) start, vias, goal; a via of free height as high as the path ``points`` (N, 3) is there."""
    terminals = [np.array(problem.start)]
    for via in problem.via:
        off = np.hypot(points[:, 0] - via.east_m, points[:, 1] - via.north_m)
        amsl_m = float(points[off.argmin(), 2]) if via.amsl_m is None else via.amsl_m
        terminals.append(np.array([via.east_m, via.north_m, amsl_m]))
    return np.array([*terminals, np.array(problem.goal)])


def _heights(problem: Problem, k: int, terminals: Floats) -> Floats:
    """(K, 3) where the terminal ``k`` may be passed."""
    if problem.via[k - 1].amsl_m is not None:
        return terminals[k : k + 1]
    low = float(problem.airspace.floor_amsl(terminals[k, 0], terminals[k, 1], problem.limits))
    low = low if math.isfinite(low) else float(terminals[k, 2])
    high = max(float(terminals[:, 2].max()), low)
    levels = np.unique([terminals[k, 2], *np.linspace(low + 0.01, high, LEVELS)])
    return np.column_stack([np.broadcast_to(terminals[k, :2], (len(levels), 2)), levels])


def _best(problem: Problem, ways: list[Floats], step_m: float, in_time: Callable[[], bool]) -> Floats:
    """The cheapest of some ways between two terminals, each drawn together."""
    pulled = []
    for way in ways:
        kinds = np.full(len(way), FREE)
        kinds[[0, -1]] = FIXED
        pulled.append(cheapest(problem, way, kinds))
    pulled.sort(key=lambda way: cost_of(problem, way[0]))
    tight: list[Floats] = []
    for points, kinds in pulled[:DRAWN]:
        if tight and not in_time():
            break
        tight.append(drawn(problem, points, kinds, step_m, in_time, halvings=2)[0])
    return min(tight, key=lambda way: cost_of(problem, way))


@dataclass(frozen=True, eq=False, slots=True)
class Lattice:
    """Nodes (N, 3), the places of the one terminal first and then those of the other; legal edges with their costs."""

    problem: Problem
    nodes: Floats
    starts: int
    goals: int
    step_m: float
    graph: csr_array

    @classmethod
    def of(cls, problem: Problem, nodes: Floats, pairs: Ints, starts: int, goals: int, step_m: float) -> Lattice:
        """The lattice of what is legal of ``pairs`` (2, E) of ``nodes``, there and back."""
        a, b = pairs
        limits = problem.limits
        there = problem.legal(nodes[a], nodes[b])
        back = there if limits.max_climb_deg == limits.max_descent_deg else problem.legal(nodes[b], nodes[a])
        cost = problem.leg_costs(nodes[a], nodes[b])
        rows, columns = np.concatenate([a[there], b[back]]), np.concatenate([b[there], a[back]])
        graph = csr_array((np.concatenate([cost[there], cost[back]]), (rows, columns)), shape=(len(nodes), len(nodes)))
        return cls(problem, nodes, starts, goals, step_m, graph)

    def beyond(self, cost: Floats) -> Floats:
        """The least cost of being at each place of the second terminal, given that at those of the first."""
        out = np.full(self.goals, np.inf)
        for k in np.flatnonzero(np.isfinite(cost)).tolist():
            away, _ = _reached(self.graph, k)
            out = np.minimum(out, cost[k] + away[self.starts : self.starts + self.goals])
        return out

    def ways(self, cost: Floats, goal: int) -> tuple[int, list[Floats]]:
        """The place of the first terminal from which one of the second is reached best, and ways from it, far apart."""
        left, after = _reached(self.graph.T.tocsr(), self.starts + goal)
        start = int(np.argmin(cost + left[: self.starts]))
        away, before = _reached(self.graph, start)
        total = away + left
        limit = WINDING * total[start]
        out: list[Floats] = []
        while len(out) < WAYS and total.min() <= limit:
            via = start if not out else int(total.argmin())
            way = self.nodes[[*_trace(before, via)[::-1], *_trace(after, via)[1:]]]
            out.append(way)
            off = self.nodes[:, None] - way[None]
            total = np.where((off**2).sum(axis=2).min(axis=1) < (APART * self.step_m) ** 2, np.inf, total)
        return start, out


def _reached(graph: csr_array, source: int) -> tuple[Floats, Ints]:
    """(N,) the least cost of reaching each node, and the node before it; negative where there is none."""
    cost, before = dijkstra(graph, indices=[source], return_predecessors=True)
    return cost[0], before[0].astype(np.intp)


def _trace(before: Ints, node: int) -> list[int]:
    """A node, the one before it, and so on to the end."""
    out = [node]
    while before[out[-1]] >= 0:
        out.append(int(before[out[-1]]))
    return out


def _lattice(problem: Problem, starts: Floats, goals: Floats, limit: float) -> Lattice:
    """The lattice of places on ways from one of ``starts`` (K, 3) to one of ``goals`` that cost ``limit`` at most."""
    limits = problem.limits
    upright = min(1.0, limits.max_climb_slope, limits.max_descent_slope)
    ends = np.vstack([starts, goals])
    low, high = ends.min(axis=0), ends.max(axis=0)
    width_m = math.dist(starts[0, :2], goals[0, :2])
    metres = (
        limit / problem.horizontal_j_per_m if problem.objective == "energy" and problem.horizontal_j_per_m else limit
    )
    margin_m = min(0.5 * math.sqrt(max(metres**2 - width_m**2, 0.0)), WIDEST * width_m) + 0.05 * width_m
    low, high = low - margin_m, high + margin_m
    if limits.max_amsl_m is not None:
        high[2] = min(high[2], limits.max_amsl_m - limits.altitude_error_m)
    scale = np.array([1.0, 1.0, upright])
    finest_m = (float(np.prod(high - low)) / (upright * BOX_NODES)) ** (1.0 / 3.0)
    step_m, coarser = finest_m, 4.0
    for _ in range(3):
        step_m = max(step_m * coarser, finest_m)
        axes = [np.arange(low[i], high[i], step_m * scale[i]) for i in range(3)]
        east, north = (a.ravel() for a in np.meshgrid(axes[0], axes[1], indexing="ij"))
        floor = problem.floors(east, north)
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        shape = nodes.shape[:3]
        cost = np.min([problem.leg_costs(a, nodes) for a in starts], axis=0)
        cost += np.min([problem.leg_costs(nodes, b) for b in goals], axis=0)
        inside = (cost <= limit) & (nodes[..., 2] >= floor.reshape(shape[:2])[..., None])
        coarser = (max(int(inside.sum()), 1) / NODES) ** (1.0 / 3.0)
        if 0.8 < coarser < 1.2:
            break
    number = np.full(shape, -1)
    number[inside] = len(ends) + np.arange(int(inside.sum()))
    nodes = np.vstack([ends, nodes[inside]])
    pairs = [_neighbours(number, step) for step in STEPS]
    for k, end in enumerate(ends):
        near = np.flatnonzero((((nodes - end) / scale) ** 2).sum(axis=1) < (NEAR * step_m) ** 2)
        near = near[near >= len(ends)]
        pairs.append(np.stack([np.full(len(near), k), near]))
    pairs.append(np.indices((len(starts), len(goals))).reshape(2, -1) + np.array([[0], [len(starts)]]))
    return Lattice.of(problem, nodes, np.concatenate(pairs, axis=1), len(starts), len(goals), step_m)


def _neighbours(number: Ints, step: Ints) -> Ints:
    """(2, E) numbers of nodes that lie a step of the lattice apart; ``number`` -1 where there is none."""
    here, there = (
        number[tuple(slice(max(0, -k), n - max(0, k)) for k, n in zip(sign * step, number.shape, strict=True))].ravel()
        for sign in (1, -1)
    )
    both = (here >= 0) & (there >= 0)
    return np.stack([here[both], there[both]])
