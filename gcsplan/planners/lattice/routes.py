"""Tracks over a lattice, from terminal to terminal: A* with labels that carry the altitudes that can be reached.

A label at a node is a track to it, with its cost and the interval of altitudes that can be reached there under the
climb limits, floors, ceilings and zones passed so far. A zone that splits the altitudes over an edge makes one label
for each gap: over it, under it. A label is dropped only for another that costs no more and reaches as much.

If climbing has a price, each label also keeps the altitudes that can be reached at its lowest cost; each metre away
from them costs ``weight`` metres of track. This is the exact cost of the cheapest profile over the track so far, as
long as climb limits do not bind.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from gcsplan.arrays import Floats, Int64s
from gcsplan.planners.lattice import search_kernels
from gcsplan.planners.lattice.lattice import LINK_DOORS, STEPS, Lattice, Links, make_lattice, make_links
from gcsplan.planners.problem import Problem, straight_way_m, terminals_of
from gcsplan.planners.profile.track import Obstruction, Track, make_track

LABELS_A_NODE = 8
"""Most labels that a node keeps; more are dropped."""

FIRST_CAPACITY = 32_768
"""Labels for which arrays are allocated at first."""


SHUT_IN = 200
"""An end is shut in if a search from it expands no more labels than this."""
FORWARD, BACKWARD, MOST = 40_000, 60_000, 400_000
"""Most labels expanded by the first search from the start; by the next, backwards from a goal that is hard to reach;
and by the last, from the start again."""


@dataclass(frozen=True, eq=False, slots=True)
class Label:
    """A track to a terminal: its ``cost``, reachable altitudes from ``low_m`` to ``high_m``, the cheapest of these
    altitudes from ``cheap_low_m`` to ``cheap_high_m``, and its ``places`` (N, 2)."""

    cost: float
    low_m: float
    high_m: float
    cheap_low_m: float
    cheap_high_m: float
    places: Floats


@dataclass(frozen=True, eq=False, slots=True)
class FoundLabels:
    """``labels`` at the goal, cheapest first (none: no track was found); ``opened``: number of labels expanded."""

    labels: tuple[Label, ...]
    opened: int


def search(  # noqa: PLR0913 - options by name, each with a default
    lattice: Lattice,
    starts: list[Label],
    start: tuple[float, float],
    goal: tuple[float, float],
    start_links: Links,
    goal_links: Links,
    goal_m: tuple[float, float],
    *,
    cap_m: float = np.inf,
    climb_slope: float = np.inf,
    descent_slope: float = np.inf,
    weight: float = 0.0,
    spare_m: float = 0.5,
    want: int = 1,
    most_opened: int = 600_000,
) -> FoundLabels:
    """The cheapest tracks from ``start`` to an altitude within ``goal_m`` (lowest, highest) at ``goal``.

    ``starts``: labels at the start. ``cap_m``: highest altitude AMSL; ``weight``: price of a metre of height, in metres
    of track; a label that reaches less than ``spare_m`` beyond another that costs no more is dropped; ``want``: most
    labels at the goal; ``most_opened``: most labels expanded.
    """
    nodes = lattice.nx * lattice.ny
    here, there = nodes, nodes + 1
    links = (start_links, goal_links)
    node = np.concatenate([x.node for x in links])
    from_start = np.arange(len(node)) < len(start_links.node)
    # Links run from the terminal to the node; the goal's links are flown from the node to the terminal.
    low = np.vstack([start_links.low_m, goal_links.low_m[:, ::-1]])
    high = np.vstack([start_links.high_m, goal_links.high_m[:, ::-1]])
    source = np.where(from_start, here, node)
    order = np.argsort(source, kind="stable")
    link_at = np.zeros(nodes + 3, np.int64)
    np.cumsum(np.bincount(source, minlength=nodes + 2), out=link_at[1:])
    labels = np.array([(x.cost, x.low_m, x.high_m, x.cheap_low_m, x.cheap_high_m) for x in starts])
    scale = 1.0 / lattice.step_m
    ends = np.array(
        [[(p[0] - lattice.west_m) * scale, (p[1] - lattice.south_m) * scale] for p in (start, goal)], np.float64
    )
    terms = np.array(
        [lattice.step_m, *ends[1], *goal_m, cap_m, climb_slope, descent_slope, weight, spare_m], np.float64
    )
    name, value, state, goals = _run(
        lattice,
        labels,
        (
            link_at,
            np.where(from_start, node, there)[order],
            np.concatenate([x.length_m for x in links])[order],
            np.ascontiguousarray(low[order]),
            np.ascontiguousarray(high[order]),
        ),
        terms,
        want,
        most_opened,
    )
    out = []
    for g in goals:
        way = []
        k = name[g, search_kernels.PARENT]
        while k >= len(starts):
            way.append(name[k, search_kernels.AT])
            k = name[k, search_kernels.PARENT]
        inner = lattice.node_places(np.array(way[::-1], np.int64))
        places = np.vstack([starts[k].places, inner, np.asarray(goal)[None]])
        cost, *altitudes = (float(x) for x in value[g])
        out.append(Label(cost, altitudes[0], altitudes[1], altitudes[2], altitudes[3], places))
    return FoundLabels(tuple(out), int(state[search_kernels.OPENED]))


def _run(
    lattice: Lattice, starts: Floats, links: tuple[Int64s, Int64s, Floats, Floats, Floats], terms: Floats, want: int,
    most_opened: int,
) -> tuple[Int64s, Floats, Int64s, Int64s]:  # fmt: skip
    """Run the kernel, with larger arrays as often as needed; return the labels (integers and numbers), the state, and
    the indices of the labels at the goal."""
    nodes = lattice.nx * lattice.ny
    capacity = FIRST_CAPACITY
    name, value = np.zeros((capacity, 4), np.int64), np.empty((capacity, 5))
    keys, ids = np.empty(capacity), np.empty(capacity, np.int64)
    n = len(starts)
    name[:n] = (nodes, -1, -1, 1)
    value[:n] = starts
    order = np.argsort(starts[:, 0], kind="stable")
    keys[:n], ids[:n] = starts[order, 0], order  # a sorted array is a heap
    state = np.array([n, n, 0, 0], np.int64)
    first, held = np.full(nodes + 2, -1), np.zeros(nodes + 2, np.int64)
    goals = np.zeros(want, np.int64)
    v, door = np.empty(5), np.empty((LINK_DOORS + 1, 4))
    while True:
        status = search_kernels.reach(
            lattice.floor_m, lattice.ceiling_m, lattice.ground_m, STEPS, lattice.band_at, lattice.band_low,
            lattice.band_high, lattice.band_agl, *links, terms, want, most_opened, LABELS_A_NODE, state, name, value,
            keys, ids, first, held, goals, v, door,
        )  # fmt: skip
        if status == search_kernels.DONE:
            break
        capacity *= 4
        name, value = np.resize(name, (capacity, 4)), np.resize(value, (capacity, 5))
        keys, ids = np.resize(keys, capacity), np.resize(ids, capacity)
    return name, value, state, goals[: state[search_kernels.REACHED]]


@dataclass(frozen=True, slots=True)
class LatticeSize:
    """Extent and fineness of a lattice: ``detour`` in multiples of the straight track, about ``nodes`` nodes."""

    detour: float
    nodes: int


LATTICE_SIZES = (
    LatticeSize(1.35, 25_000),
    LatticeSize(2.0, 60_000),
    LatticeSize(math.inf, 120_000),
    LatticeSize(math.inf, 300_000),
)


def coverage(problem: Problem) -> tuple[float, float, float, float]:
    """West, south, east and north edge of the loaded terrain, in metres."""
    rows, cols = problem.airspace.surface.ground_m.shape
    # The edges of a raster in degrees are curved in the plane, so their middles count too.
    c, r = np.meshgrid((0.0, 0.5 * (cols - 1), cols - 1.0), (0.0, 0.5 * (rows - 1), rows - 1.0))
    corners = problem.airspace.surface.grid.to_plane(c.ravel(), r.ravel())
    west, south = corners.min(axis=0)
    east, north = corners.max(axis=0)
    return float(west), float(south), float(east), float(north)


def frame_of(problem: Problem, level: LatticeSize) -> tuple[tuple[float, float, float, float], float]:
    """Box (west, south, east, north) and spacing of a lattice for ``level``."""
    west, south, east, north = coverage(problem)
    terminals = np.array(terminals_of(problem))
    way = straight_way_m(problem)
    # No ellipse of a finite detour reaches farther from its ends than this; without one: four times the straight track.
    out = (0.5 * (level.detour - 1.0) if math.isfinite(level.detour) else 4.0) * way + 1.0
    if math.isfinite(level.detour):
        out = max(out, 0.5 * way * math.sqrt(level.detour**2 - 1.0))
    low, high = terminals.min(axis=0) - out, terminals.max(axis=0) + out
    box = (max(west, low[0]), max(south, low[1]), min(east, high[0]), min(north, high[1]))
    area = max(box[2] - box[0], 1e-3) * max(box[3] - box[1], 1e-3)
    cell = float(problem.airspace.surface.grid.metres_per_cell(*terminals[0]).min())
    step = max(math.sqrt(area / level.nodes), min(cell, way) / 8.0)
    return box, step


def climbing_weight(problem: Problem) -> float:
    """Metres of track that cost as much as one metre of height; 0 if that has no price."""
    if problem.rates is None:
        return 0.0
    level, climbing = problem.rates
    return climbing / max(level, 1e-9)


@dataclass(eq=False, slots=True)
class Router:
    """A lattice with its terminals, their altitudes (None: free) and links; ``last``, ``last_place``: what the exact
    check found last, and where."""

    problem: Problem
    lattice: Lattice
    terminals: list[tuple[float, float]]
    heights: list[float | None]
    links: list[Links]
    climb_factor: float = 1.0
    last: Obstruction | None = None
    last_place: Floats | None = field(default=None)
    opened: int = 0
    """Labels expanded by all searches on this lattice."""
    opened_last: int = 0

    @classmethod
    def at(cls, problem: Problem, level: LatticeSize) -> Router:
        """Build the lattice of ``level``."""
        box, step = frame_of(problem, level)
        lattice = make_lattice(problem, box, step, level.detour)
        terminals = terminals_of(problem)
        heights = [problem.start[2], *(v.amsl_m for v in problem.via), problem.goal[2]]
        links = [make_links(problem, lattice, s, z) for s, z in zip(terminals, heights, strict=True)]
        return cls(problem, lattice, terminals, heights, links)

    def way(self, cap_m: float = math.inf, weight: float = 0.0, *, briefly: bool = False) -> Floats | None:
        """Places (N, 2) of the best track over the lattice under ``cap_m``, through every terminal; None if none is
        found. ``briefly``: the last search of `MOST` labels is left out, because a path is known already."""
        direct = not self.problem.via
        found = self._labels(cap_m, weight, FORWARD if direct else MOST)
        if not found and direct and self.opened_last > FORWARD:
            back = self._leg(self._at(-1), -1, 0, cap_m, weight, BACKWARD)
            if back:
                return np.ascontiguousarray(back[0].places[::-1])
            if self.opened_last > BACKWARD and not briefly:
                found = self._labels(cap_m, weight, MOST)
        return found[0].places if found else None

    def _at(self, end: int) -> tuple[Label, ...]:
        """The label at the start (``end`` 0) or at the goal (-1), from which a search begins."""
        z = self.problem.goal[2] if end else self.problem.start[2]
        return (Label(0.0, z, z, z, z, np.array([self.terminals[end]])),)

    def _labels(self, cap_m: float, weight: float, most_opened: int) -> tuple[Label, ...]:
        """Labels at the goal, through all vias, cheapest first."""
        labels = self._at(0)
        for there in range(1, len(self.terminals)):
            labels = self._leg(labels, there - 1, there, cap_m, weight, most_opened)
            if not labels:
                break
        return labels

    def _leg(
        self, labels: tuple[Label, ...], here: int, there: int, cap_m: float, weight: float, most_opened: int
    ) -> tuple[Label, ...]:
        """Labels at the terminal ``there``, searched from ``labels`` at the terminal ``here``; from the goal (-1) to
        the start (0) backwards."""
        p = self.problem
        slopes = p.limits.max_climb_slope * self.climb_factor, p.limits.max_descent_slope * self.climb_factor
        climb, descent = slopes[::-1] if here < 0 else slopes
        amsl_m = self.heights[there]
        found = search(
            self.lattice,
            list(labels),
            self.terminals[here],
            self.terminals[there],
            self.links[here],
            self.links[there],
            (-math.inf, math.inf) if amsl_m is None else (amsl_m, amsl_m),
            cap_m=cap_m,
            climb_slope=climb,
            descent_slope=descent,
            weight=weight,
            want=4 if amsl_m is None else 1,
            most_opened=most_opened,
        )
        self.opened += found.opened
        p.budget.spend("label", found.opened)
        self.opened_last = found.opened
        return found.labels

    def cut_off(self) -> tuple[bool, bool]:
        """Whether the start, and the goal, is shut in on this lattice: a search from it ends after `SHUT_IN` labels."""
        p = self.problem
        up, down = p.limits.max_climb_slope * self.climb_factor, p.limits.max_descent_slope * self.climb_factor
        out = []
        for here, there, amsl, climb, descent in ((0, -1, p.start[2], up, down), (-1, 0, p.goal[2], down, up)):
            found = search(
                self.lattice,
                [Label(0.0, amsl, amsl, amsl, amsl, np.array([self.terminals[here]]))],
                self.terminals[here],
                self.terminals[there],
                self.links[here],
                self.links[there],
                (-math.inf, math.inf),
                climb_slope=climb,
                descent_slope=descent,
                most_opened=SHUT_IN,
            )
            out.append(not found.labels and found.opened <= SHUT_IN)
        return out[0], out[1]

    def track_of(self, way: Floats) -> Track:
        """The track along the places ``way`` (N, 2), with its terminals pinned and points on straight lines dropped."""
        pinned = np.zeros(len(way), bool)
        pin_m = np.full(len(way), np.nan)
        pinned[0] = pinned[-1] = True
        for (east, north), via in zip(self.terminals[1:-1], self.problem.via, strict=True):
            at = np.flatnonzero((way[:, 0] == east) & (way[:, 1] == north) & ~pinned)
            if len(at):
                pinned[at[0]] = True
                pin_m[at[0]] = math.nan if via.amsl_m is None else via.amsl_m
        d = np.diff(way, axis=0)
        bent = np.abs(d[:-1, 0] * d[1:, 1] - d[:-1, 1] * d[1:, 0]) > 1e-9 * (d[:-1] ** 2).sum(-1)
        keep = pinned.copy()
        keep[1:-1] |= bent
        return make_track(self.problem, way[keep], pinned[keep], pin_m[keep])
