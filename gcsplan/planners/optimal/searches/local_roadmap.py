"""Paths through small worlds of a few dozen cells of the terrain model, over a roadmap of places that matter.

There the lattices of the plane miss openings narrower than their cells: a pass exactly as high as the ceiling, a slit
between two cylinders, a climb that must wind along a wall. The roadmap has few places: the terrain model's own nodes
and its saddles, the rims of zones, slits between them, and a regular lattice in between. Each has a column of altitudes
from its floor up; legs between neighbours pass the exact check.

The cheapest path over the roadmap and others well apart from it are each drawn together (`cross_sections`) on
cross-sections along them; the best one is the result. A roadmap is a source of paths and gives no lower bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.planners.optimal.loop.search import FAR, MUCH, OF_REST, Search, Size
from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.navmesh.grid import NodeExtent, extent
from gcsplan.planners.problem import Problem, terminals_of
from gcsplan.planners.profile.cross_sections import FIXED, FREE, UPRIGHT, cheapest, drawn, kinds_of
from gcsplan.world.geometry.path import distances_m

if TYPE_CHECKING:
    from scipy.sparse import csr_array

NODES, PLACES, LEVELS = 8000, (200, 1000), (7, 30)
"""About how many nodes a roadmap has; fewest and most places; fewest and most altitudes at each place."""
NEIGHBOURS = 16
"""Each place is linked to that many nearest places."""
CIRCLE_PLACES = 12
"""Places around a circle."""
MOST_RIMS, MOST_SLITS = 600, 60
"""Most places on rims of zones, and most slits."""
WIDEST, WIDEST_CELLS = 2.0, 30.0
"""Widest margin around two terminals: times their distance, or cells of the terrain model if that is more."""
HAIR_M = 1e-3
"""How far outside a zone places lie, beyond the clearance and the track error."""
SLIT = 0.5
"""Slits between circles matter up to that part of the roadmap's spacing in width."""
SECOND_WORTH = 0.03
"""Part of the cost that a first search must gain for a second one, nearer to the path that it found."""


WINDING = 1.06
"""Paths over a roadmap may cost that many times the best known path, for they turn at its nodes alone."""
PATHS, APART = 10, 3.0
"""Most paths between two terminals, and how many spacings each must lie from all before it at some node."""
DRAWN = 8
"""Number of the cheapest paths, which are drawn together."""
DRAWN_HOPE = 1.06
"""A path drawn together coarsely that costs more than this times the best known one is dropped."""
VIA_LEVELS = 24
"""Most altitudes of a via whose altitude is free."""
LEGS_AT_ONCE = 20_000
"""Legs under the exact check between two looks at the budget."""

FIRST, NEAR, LAST = (0.6, 1.0), (0.5, 0.5), (0.01, 0.5)
"""Shares and counted seconds: while no path is known, beyond a gap of `MUCH`, and beyond one of `FAR`."""


class LocalRoadmap(Search):
    """In worlds of a few dozen cells and for steep paths: if no path is known, if the gap exceeds 5 %, and last.

    Remembers which of these it was chosen for.
    """

    NAME, IMPROVES, SHARE = "local_roadmap", "paths", LAST[0]

    def __init__(self, work: Workspace) -> None:
        super().__init__(work)
        self._chosen: set[tuple[float, float]] = set()

    @property
    def _turn(self) -> tuple[float, float] | None:
        """Which of its turns it is; None if it is none, or that one was taken."""
        i = self.incumbent
        if self.problem.limits.max_agl_m is not None:
            return None
        if i.best is None:
            return FIRST if FIRST not in self._chosen and self.work.plane.is_small else None
        if i.gap <= FAR or not (i.is_steep or self.work.plane.is_small):
            return None
        turns = (NEAR, LAST) if i.gap > MUCH else (LAST,)
        return next((turn for turn in turns if turn not in self._chosen), None)

    @property
    def share(self) -> float:
        """By the turn."""
        return (self._turn or LAST)[0]

    def applies(self) -> bool:
        """Whether the world is small or the path steep."""
        return self._turn is not None

    def is_open(self) -> bool:
        """Each turn once."""
        return self.applies()

    def choose(self) -> None:
        """Note the turn."""
        self._chosen.add(self._turn or LAST)

    def size(self) -> Size:
        """Its work is not known before; it gets a part of the rest."""
        return self.takes((self._turn or LAST)[1])

    def run(self) -> None:
        """Look for a path."""
        incumbent = self.incumbent
        with incumbent.budget.allow(1.0 if incumbent.best is None else OF_REST):
            found = small_path(self.problem, incumbent.best)
        incumbent.offer(found)


def small_path(problem: Problem, known: Floats | None) -> tuple[Floats, Bools] | None:
    """(N, 3) a path whose legs the exact check passes, and (N,) its terminals; None if no cheaper one was found.

    ``known`` (M, 3): the best path so far, None without one.
    """

    def between(starts: Floats, goals: Floats, limit: float) -> Roadmap:
        return _roadmap(problem, starts, goals, limit)

    found: tuple[Floats, Bools] | None = None
    best = math.inf if known is None else problem.cost_through(known)
    for _ in range(2):
        terminals = terminals_by_leg(problem, _straight(problem) if known is None else known)
        better = path_over(problem, terminals, best, known, between)
        if better is None:
            break
        before, found, known = best, better, better[0]
        best = problem.cost_through(known)
        if best > before * (1.0 - SECOND_WORTH):
            break
    return found


def _straight(problem: Problem) -> Floats:
    """(K, 3) the terminals; a free height lies in between the fixed ones, but not below the floor."""
    flat = np.array(terminals_of(problem))
    s = distances_m(flat)
    heights = np.array([problem.start[2], *(math.nan if v.amsl_m is None else v.amsl_m for v in problem.via),
                        problem.goal[2]])  # fmt: skip
    known = np.isfinite(heights)
    floor = problem.airspace.floor_amsl(flat[:, 0], flat[:, 1], problem.limits)
    free = np.fmax(np.interp(s, s[known], heights[known]), np.where(np.isfinite(floor), floor, -math.inf))
    return np.column_stack([flat, np.where(known, heights, free)])


def _roadmap(problem: Problem, starts: Floats, goals: Floats, limit: float) -> Roadmap:
    """The roadmap for paths from one of ``starts`` (K, 3) to one of ``goals`` that cost ``limit`` at most."""
    air, limits = problem.airspace, problem.limits
    ends = np.vstack([starts, goals])
    low, high = _box(problem, ends, limit)
    area = float(np.prod(np.maximum(high - low, 1.0)))
    bottom_m, top_m, marks = _heights(problem, ends, low, high)
    slope = min(limits.max_climb_slope, limits.max_descent_slope)
    count = PLACES[1]
    if math.isfinite(slope) and top_m > bottom_m:
        # As many altitudes as a leg between neighbours needs to climb by one of them.
        count = round((NODES * slope * math.sqrt(area) / (top_m - bottom_m)) ** (2.0 / 3.0))
    count = min(max(count, PLACES[0]), PLACES[1])
    spacing_m = math.sqrt(area / count)
    places, links = _places(problem, low, high, count, spacing_m)
    floor, ceiling = (f(places[:, 0], places[:, 1], limits) for f in (air.floor_amsl, air.ceiling_amsl))
    there = np.isfinite(floor) & (floor <= ceiling + 1e-6)
    number = np.full(len(places), -1)
    number[there] = np.arange(int(there.sum()))
    links = number[links[:, there[links].all(axis=0)]]
    places, floor, ceiling = places[there], floor[there], ceiling[there]
    levels = np.unique(
        [*marks, *np.linspace(bottom_m, top_m, _levels(slope, spacing_m, top_m - bottom_m, len(places)))]
    )
    z = np.clip(levels, floor[:, None], np.maximum(ceiling, floor)[:, None])
    nodes = np.dstack([*(np.broadcast_to(places[:, k, None], z.shape) for k in range(2)), z])
    cost = np.min([problem.leg_costs(a, nodes) for a in starts], axis=0)
    cost += np.min([problem.leg_costs(nodes, b) for b in goals], axis=0)
    # Altitudes below the floor are the floor, once.
    new = np.diff(z, axis=1, prepend=-math.inf) > 0.0
    inside = (cost <= limit) & new
    index = np.full(z.shape, -1)
    index[inside] = len(ends) + np.arange(int(inside.sum()))
    index = np.take_along_axis(index, np.maximum.accumulate(np.where(new, np.arange(z.shape[1]), 0), axis=1), axis=1)
    flat = nodes[inside]
    pairs = [np.stack([index[:, :-1].ravel(), index[:, 1:].ravel()])]
    links = np.hstack([links, _near(places)])
    for up in (-1, 0, 1):
        k = np.arange(max(0, -up), z.shape[1] - max(0, up))
        pairs.append(np.stack([index[links[0]][:, k].ravel(), index[links[1]][:, k + up].ravel()]))
    pairs += [_links_of_end(problem, k, end, flat, spacing_m, len(ends)) for k, end in enumerate(ends)]
    pairs.append(np.indices((len(starts), len(goals))).reshape(2, -1) + np.array([[0], [len(starts)]]))
    both = np.sort(np.concatenate(pairs, axis=1), axis=0)
    both = both[:, (both[0] >= 0) & (both[0] < both[1])]
    count = len(ends) + len(flat)
    once = np.stack(np.divmod(np.unique(both[0] * count + both[1]), count))
    return Roadmap.of(problem, np.vstack([ends, flat]), once, (len(starts), len(goals)), spacing_m)


def _near(places: Floats) -> Indices:
    """(2, E) each place and its nearest others."""
    n = len(places)
    apart = ((places[:, None] - places[None]) ** 2).sum(axis=2)
    apart[np.arange(n), np.arange(n)] = math.inf
    count = min(NEIGHBOURS, n - 1)
    nearest = np.argpartition(apart, count - 1, axis=1)[:, :count] if count > 0 else np.zeros((n, 0), np.intp)
    return np.stack([np.repeat(np.arange(n), max(count, 0)), nearest.ravel()])


def _links_of_end(problem: Problem, k: int, end: Floats, nodes: Floats, spacing_m: float, first: int) -> Indices:
    """(2, E) an end and the nodes about it, as far as they can be climbed to."""
    apart = np.hypot(*(nodes[:, :2] - end[:2]).T)
    near = np.flatnonzero(apart < max(2.5 * spacing_m, float(np.sort(apart)[: 4 * NEIGHBOURS].max(initial=0.0))))
    rise = nodes[near, 2] - end[2]
    slope = max(problem.limits.max_climb_slope, problem.limits.max_descent_slope)
    near = near[np.abs(rise) <= slope * apart[near] + 1e-9] if math.isfinite(slope) else near
    return np.stack([np.full(len(near), k), near + first])


def _levels(slope: float, spacing_m: float, range_m: float, places: int) -> int:
    """How many altitudes there are over each of so many places."""
    needed = math.ceil(range_m / (slope * spacing_m)) + 1 if math.isfinite(slope) else LEVELS[0]
    return max(min(needed, LEVELS[1], 2 * NODES // max(places, 1)), 2)


def _box(problem: Problem, ends: Floats, limit: float) -> tuple[Floats, Floats]:
    """South-western and north-eastern corner of where ways may lead, within the terrain model."""
    grid = problem.airspace.surface.grid
    rows, cols = problem.airspace.surface.ground_m.shape
    c, r = np.meshgrid(np.linspace(0.0, cols - 1.0, 5), np.linspace(0.0, rows - 1.0, 5))
    corners = grid.to_plane(c.ravel(), r.ravel())
    low, high = corners.min(axis=0), corners.max(axis=0)
    metres = limit
    if problem.rates is not None:
        level, _ = problem.rates
        metres = limit / level if level > 0.0 else math.inf
    width_m = math.dist(ends[0, :2], ends[-1, :2])
    cell_m = float(grid.metres_per_cell(*ends[0, :2].tolist()).max())
    # The minor axis of the ellipse of such ways, or its major axis beyond the ends.
    margin_m = max(0.5 * math.sqrt(max(metres**2 - width_m**2, 0.0)), 0.5 * (metres - width_m)) + 0.02 * width_m
    margin_m = min(margin_m, max(WIDEST * width_m, WIDEST_CELLS * cell_m))
    low = np.maximum(low, ends[:, :2].min(axis=0) - margin_m)
    high = np.minimum(high, ends[:, :2].max(axis=0) + margin_m)
    return low, high


def _heights(problem: Problem, ends: Floats, low: Floats, high: Floats) -> tuple[float, float, list[float]]:
    """The lowest and the highest altitude worth a look, and the altitudes at which zones and ends begin and end."""
    limits, surface = problem.limits, problem.airspace.surface
    error = limits.over_zone_m + HAIR_M
    east, north = (a.ravel() for a in np.meshgrid(*(np.linspace(low[k], high[k], 40) for k in range(2))))
    floor = problem.floors(east, north)
    floor = floor[np.isfinite(floor)]
    bottom_m = min(float(floor.min(initial=math.inf)), float(ends[:, 2].min()))
    top_m = max(float(floor.max(initial=-math.inf)), float(ends[:, 2].max()))
    table = problem.airspace.zone_table
    _, tops = table.levels_m(ground_m=float(np.nanmax(surface.top_m)))
    top_m = max(top_m, float(tops[np.isfinite(tops)].max(initial=-math.inf)) + error)
    fixed = [level[~agl] for level, agl in zip(table.levels_m(error), table.over_ground.T, strict=True)]
    if limits.max_amsl_m is not None:
        top_m = min(top_m, limits.max_amsl_m - limits.altitude_error_m)
    marks = sorted({round(m, 3) for m in np.concatenate(fixed).tolist() if bottom_m <= m <= top_m})
    most = LEVELS[0]
    if len(marks) > most:
        marks = [marks[k] for k in np.linspace(0, len(marks) - 1, most).round().astype(int).tolist()]
    return bottom_m, top_m, [*marks, *ends[:1, 2].tolist(), float(ends[-1, 2])]


def _places(problem: Problem, low: Floats, high: Floats, count: int, spacing_m: float) -> tuple[Floats, Indices]:
    """(N, 2) places in a box, about ``count``, and (2, E) pairs of them to be linked however far apart."""
    part = extent(problem, (low[0], low[1], high[0], high[1]))
    c0, r0, c1, r1 = part
    c, r = (a.ravel() for a in np.meshgrid(np.arange(c0, c1 + 1.0), np.arange(r0, r1 + 1.0)))
    model = _within(problem.airspace.surface.grid.to_plane(c, r), low, high)
    parts = [_within(_saddles(problem, part), low, high)[: count // 4]]
    if len(model) <= 1.3 * count:
        parts.append(model)
    if len(model) < 0.6 * count or len(model) > 1.3 * count:
        axes = [np.arange(low[k] + 0.5 * spacing_m, high[k], spacing_m) for k in range(2)]
        parts.append(np.stack([a.ravel() for a in np.meshgrid(*axes)], axis=-1))
    rims = _within(np.vstack([np.zeros((0, 2)), *_rims(problem)]), low, high)
    parts.append(rims[np.linspace(0, len(rims) - 1, MOST_RIMS).astype(np.intp)] if len(rims) > MOST_RIMS else rims)
    before = sum(map(len, parts))
    slits = _slits(problem, SLIT * spacing_m)
    slits = slits[((slits >= low) & (slits <= high)).all(axis=(1, 2))][:MOST_SLITS]
    first = before + 5 * np.arange(len(slits))
    links = np.concatenate([np.stack([first + k, first + k + 1]) for k in range(4)], axis=1)
    return np.vstack([*parts, slits.reshape(-1, 2)]), links.astype(np.intp)


def _within(places: Floats, low: Floats, high: Floats) -> Floats:
    return places[((places >= low) & (places <= high)).all(axis=1)]


def _saddles(problem: Problem, part: NodeExtent) -> Floats:
    """(N, 2) saddles of the surface inside cells, the sharpest first: passes that nodes alone do not show."""
    c0, r0, c1, r1 = part
    z = problem.airspace.surface.top_m[r0 : r1 + 1, c0 : c1 + 1]
    a, b, c, d = z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]
    twist = a + d - b - c
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = (a - c) / twist, (a - b) / twist
    row, col = np.nonzero((u > 0.0) & (u < 1.0) & (v > 0.0) & (v < 1.0))
    row, col = (k[np.argsort(-np.abs(twist[row, col]), kind="stable")] for k in (row, col))
    grid = problem.airspace.surface.grid
    return grid.to_plane(c0 + col + u[row, col], r0 + row + v[row, col]).reshape(-1, 2)


def _rims(problem: Problem) -> list[Floats]:
    """(N, 2) places just outside of each zone: around circles, at the corners of polygons."""
    more, out = problem.airspace.beside_m(problem.limits) + HAIR_M, []
    turn = np.arange(CIRCLE_PLACES) * (2.0 * math.pi / CIRCLE_PLACES)
    around = np.stack([np.cos(turn), np.sin(turn)], axis=-1) / math.cos(math.pi / CIRCLE_PLACES)
    table = problem.airspace.zone_table
    for zone, (east_m, north_m, radius_m) in enumerate(table.discs_m.tolist()):
        if radius_m >= 0.0:
            out.append(np.array([east_m, north_m]) + (radius_m + more) * around)
        else:
            p = table.corners_m(zone)
            back, on = np.roll(p, 1, axis=0) - p, np.roll(p, -1, axis=0) - p
            outward = -(back / np.hypot(*back.T)[:, None] + on / np.hypot(*on.T)[:, None])
            outward /= np.maximum(np.hypot(*outward.T), 1e-9)[:, None]
            out += [p + side * 1.5 * more * outward for side in (1.0, -1.0)]
    return out


def _slits(problem: Problem, widest_m: float) -> Floats:
    """(N, 5, 2) five places on the line through each slit between two circles, the third in its middle; the narrowest
    come first, for they are what nothing else finds."""
    discs = problem.airspace.zone_table.discs_m
    circles = discs[discs[:, 2] >= 0.0]
    middles, radii = circles[:, :2], circles[:, 2] + problem.airspace.beside_m(problem.limits)
    i, j = np.triu_indices(len(circles), 1)
    apart = np.hypot(*(middles[j] - middles[i]).T)
    gap = apart - radii[i] - radii[j]
    order = np.argsort(gap, kind="stable")
    order = order[(gap[order] > 0.0) & (gap[order] <= widest_m)]
    i, j, apart, gap = i[order], j[order], apart[order], gap[order]
    along = (middles[j] - middles[i]) / apart[:, None]
    inside = middles[i] + (radii[i] + 0.5 * gap)[:, None] * along
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    steps = np.minimum(radii[i], radii[j])[:, None] * np.array([-1.2, -0.5, 0.0, 0.5, 1.2])
    return np.asarray(inside[:, None] + steps[:, :, None] * across[:, None])


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
        if problem.cost_through(points) <= DRAWN_HOPE * best:
            tried.append((points, kinds))
    size_m = min(x.spacing_m for x in roadmaps)
    out: tuple[Floats, Bools] | None = None
    for points, kinds in tried:
        points, kinds = drawn(problem, points, kinds, size_m)
        cost = problem.cost_through(points)
        if cost < best:
            best, out = cost, (points, kinds != FREE)
    return out


def terminals_by_leg(problem: Problem, points: Floats) -> Floats:
    """(K, 3) start, vias and goal; a via of free altitude takes the altitude of the path ``points`` (N, 3) near it."""
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
    levels = np.unique([terminals[k, 2], *np.linspace(low + 0.01, high, VIA_LEVELS)])
    return np.column_stack([np.broadcast_to(terminals[k, :2], (len(levels), 2)), levels])


def _best(problem: Problem, paths: list[Floats], spacing_m: float) -> Floats:
    """The cheapest of some paths between two terminals, each drawn together."""
    simpler = []
    for path in paths:
        kinds = np.full(len(path), FREE)
        kinds[[0, -1]] = FIXED
        simpler.append(cheapest(problem, path, kinds))
    simpler.sort(key=lambda path: problem.cost_through(path[0]))
    tight: list[Floats] = []
    for points, kinds in simpler[:DRAWN]:
        if tight and not problem.budget.goes_on():
            break
        tight.append(drawn(problem, points, kinds, spacing_m, halvings=2)[0])
    return min(tight, key=lambda path: problem.cost_through(path))


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
        from scipy.sparse import csr_array  # most missions need none

        graph = csr_array((np.concatenate([cost[there], cost[back]]), (rows, columns)), shape=(len(nodes), len(nodes)))
        return cls(nodes, *ends, spacing_m, graph)

    def beyond(self, cost: Floats) -> Floats:
        """(goals,) the least cost to each place of the second terminal, from the least cost (starts,) to each place of
        the first."""
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
    for k in range(0, len(a), LEGS_AT_ONCE):
        if not problem.budget.goes_on():
            break
        some = slice(k, k + LEGS_AT_ONCE)
        out[some] = problem.legal(nodes[a[some]], nodes[b[some]])
    return out


def _reached(graph: csr_array, source: int) -> tuple[Floats, Indices]:
    """(N,) the least cost from a source to each node, and the node before it; negative without one."""
    from scipy.sparse.csgraph import dijkstra  # most missions need none

    cost, before = dijkstra(graph, indices=[source], return_predecessors=True)
    return cost[0], before[0].astype(np.intp)


def _trace(before: Indices, node: int) -> list[int]:
    """A node, the one before it, and so on to the end."""
    out = [node]
    while before[out[-1]] >= 0:
        out.append(int(before[out[-1]]))
    return out
