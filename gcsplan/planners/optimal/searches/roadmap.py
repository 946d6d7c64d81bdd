"""Paths over a roadmap in space: nodes, legal legs between them, and the cheapest ways over those.

The cheapest path over the roadmap and others well apart from it are each drawn together (`section_dp`) on
cross-sections along them; the best of those is the result. A roadmap is a source of paths and gives no lower bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.planners.optimal.searches.section_dp import FIXED, FREE, UPRIGHT, cheapest, cost_of, drawn, kinds_of
from gcsplan.planners.problem import Problem

WINDING = 1.06
"""Paths over a roadmap may cost that many times the best known path, for they turn at its nodes alone."""
PATHS, APART = 10, 3.0
"""Most paths between two terminals, and how many spacings each must lie from all before it at some node."""
DRAWN = 8
"""The cheapest of those paths, which are drawn together."""
HOPE = 1.06
"""A path drawn together coarsely that costs more than this times the best known one is dropped."""
LEVELS = 24
"""Most altitudes of a via whose altitude is free."""
AT_ONCE = 20_000
"""Legs under the exact check between two looks at the budget."""


def path_over(
    problem: Problem,
    terminals: Floats,
    best: float,
    known: Floats | None,
    roadmap: Callable[[Floats, Floats, float], Roadmap],
) -> tuple[Floats, Bools] | None:
    """(N, 3) a path cheaper than ``best`` over roadmaps from terminal to terminal, and (N,) which of its points are
    terminals; None if none was found.

    ``terminals`` (K, 3) from `terminals_by_leg`; ``best``: the cost to beat, inf without a path; ``known`` (M, 3): the
    best path so far, which is drawn together as well. ``roadmap(starts, goals, limit)`` makes the roadmap between two
    terminals.
    """
    straight = problem.leg_costs(terminals[:-1], terminals[1:])
    spare = WINDING * best - float(straight.sum())
    vias = range(1, len(terminals) - 1)
    columns = [terminals[:1], *(_altitudes(problem, k, terminals) for k in vias), terminals[-1:]]
    roadmaps, reached = [], [np.zeros(1)]
    for k, limit in enumerate((straight + spare).tolist()):
        if not problem.budget.goes_on():
            return None
        roadmaps.append(roadmap(columns[k], columns[k + 1], limit))
        reached.append(roadmaps[k].beyond(reached[k]))
    tried = [] if known is None else [(known, kinds_of(problem, known))]
    if np.isfinite(reached[-1]).any():
        # The altitudes at the vias, from the last terminal back, and the paths between them.
        at, parts = 0, []
        for k in range(len(roadmaps) - 1, -1, -1):
            before, paths = roadmaps[k].paths(reached[k], at)
            parts.append(_best(problem, paths, roadmaps[k].spacing_m))
            at = before
        parts.reverse()
        points = np.vstack([parts[0], *(part[1:] for part in parts[1:])])
        kinds = np.full(len(points), FREE)
        ends = np.cumsum([0, *(len(part) - 1 for part in parts)])
        kinds[ends] = [FIXED, *(UPRIGHT if v.amsl_m is None else FIXED for v in problem.via), FIXED]
        if cost_of(problem, points) <= HOPE * best:
            tried.append((points, kinds))
    size_m = min(x.spacing_m for x in roadmaps)
    out: tuple[Floats, Bools] | None = None
    for points, kinds in tried:
        points, kinds = drawn(problem, points, kinds, size_m)
        cost = cost_of(problem, points)
        if cost < best:
            best, out = cost, (points, kinds != FREE)
    return out


def terminals_by_leg(problem: Problem, points: Floats) -> Floats:
    """(K, 3) start, vias and goal; a via of free altitude at that of the path ``points`` (N, 3) beside it."""
    terminals = [np.array(problem.start)]
    for via in problem.via:
        off = np.hypot(points[:, 0] - via.east_m, points[:, 1] - via.north_m)
        amsl_m = float(points[off.argmin(), 2]) if via.amsl_m is None else via.amsl_m
        terminals.append(np.array([via.east_m, via.north_m, amsl_m]))
    return np.array([*terminals, np.array(problem.goal)])


def _altitudes(problem: Problem, k: int, terminals: Floats) -> Floats:
    """(K, 3) the places where the path may pass terminal ``k``."""
    if problem.via[k - 1].amsl_m is not None:
        return terminals[k : k + 1]
    low = float(problem.airspace.floor_amsl(terminals[k, 0], terminals[k, 1], problem.limits))
    low = low if math.isfinite(low) else float(terminals[k, 2])
    high = max(float(terminals[:, 2].max()), low)
    levels = np.unique([terminals[k, 2], *np.linspace(low + 0.01, high, LEVELS)])
    return np.column_stack([np.broadcast_to(terminals[k, :2], (len(levels), 2)), levels])


def _best(problem: Problem, paths: list[Floats], spacing_m: float) -> Floats:
    """The cheapest of some paths between two terminals, each drawn together."""
    simpler = []
    for path in paths:
        kinds = np.full(len(path), FREE)
        kinds[[0, -1]] = FIXED
        simpler.append(cheapest(problem, path, kinds))
    simpler.sort(key=lambda path: cost_of(problem, path[0]))
    tight: list[Floats] = []
    for points, kinds in simpler[:DRAWN]:
        if tight and not problem.budget.goes_on():
            break
        tight.append(drawn(problem, points, kinds, spacing_m, halvings=2)[0])
    return min(tight, key=lambda path: cost_of(problem, path))


@dataclass(frozen=True, eq=False, slots=True)
class Roadmap:
    """Nodes (N, 3), ``starts`` places of one terminal first, then ``goals`` of the other; and the costs of legal legs
    between them."""

    nodes: Floats
    starts: int
    goals: int
    spacing_m: float
    graph: csr_array

    @classmethod
    def of(cls, problem: Problem, nodes: Floats, pairs: Indices, ends: tuple[int, int], spacing_m: float) -> Roadmap:
        """The roadmap of the legal legs among ``pairs`` (2, E) of ``nodes``, in both directions; ``ends``: how many
        places the two terminals have. Legs that the budget leaves unchecked are left out."""
        a, b = pairs
        limits = problem.limits
        there = _legal(problem, nodes, a, b)
        back = there if limits.max_climb_deg == limits.max_descent_deg else _legal(problem, nodes, b, a)
        cost = problem.leg_costs(nodes[a], nodes[b])
        rows, columns = np.concatenate([a[there], b[back]]), np.concatenate([b[there], a[back]])
        graph = csr_array((np.concatenate([cost[there], cost[back]]), (rows, columns)), shape=(len(nodes), len(nodes)))
        return cls(nodes, *ends, spacing_m, graph)

    def beyond(self, cost: Floats) -> Floats:
        """(goals,) the least cost to each place of the second terminal, given that (starts,) to those of the first."""
        out = np.full(self.goals, np.inf)
        for k in np.flatnonzero(np.isfinite(cost)).tolist():
            away, _ = _reached(self.graph, k)
            out = np.minimum(out, cost[k] + away[self.starts : self.starts + self.goals])
        return out

    def paths(self, cost: Floats, goal: int) -> tuple[int, list[Floats]]:
        """The place of the first terminal from which place ``goal`` of the second is cheapest to reach, and paths from
        there that lie well apart, the cheapest first."""
        left, after = _reached(self.graph.T.tocsr(), self.starts + goal)
        start = int(np.argmin(cost + left[: self.starts]))
        away, before = _reached(self.graph, start)
        total = away + left
        limit = WINDING * total[start]
        out: list[Floats] = []
        while len(out) < PATHS and total.min() <= limit:
            via = start if not out else int(total.argmin())
            path = self.nodes[[*_trace(before, via)[::-1], *_trace(after, via)[1:]]]
            out.append(path)
            off = self.nodes[:, None] - path[None]
            total = np.where((off**2).sum(axis=2).min(axis=1) < (APART * self.spacing_m) ** 2, np.inf, total)
        return start, out


def _legal(problem: Problem, nodes: Floats, a: Indices, b: Indices) -> Bools:
    """(E,) which legs from nodes ``a`` to nodes ``b`` pass the exact check; False once the budget is spent."""
    out = np.zeros(len(a), np.bool_)
    for k in range(0, len(a), AT_ONCE):
        if not problem.budget.goes_on():
            break
        some = slice(k, k + AT_ONCE)
        out[some] = problem.legal(nodes[a[some]], nodes[b[some]])
    return out


def _reached(graph: csr_array, source: int) -> tuple[Floats, Indices]:
    """(N,) the least cost from a source to each node, and the node before it; negative without one."""
    cost, before = dijkstra(graph, indices=[source], return_predecessors=True)
    return cost[0], before[0].astype(np.intp)


def _trace(before: Indices, node: int) -> list[int]:
    """A node, the one before it, and so on to the end."""
    out = [node]
    while before[out[-1]] >= 0:
        out.append(int(before[out[-1]]))
    return out
