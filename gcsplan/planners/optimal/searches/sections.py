"""Chains of places on sections across the legs: a bound, and paths along the cheapest chains.

At each node, the least cost of a path to it is bounded at every altitude by planes of some slopes. docs/planner.md,
"Sections", has the proof. The places that no cheaper path can pass are left out, and the others looked at more closely.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Int64s
from gcsplan.planners.optimal.loop.search import Search, Size
from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.plane.section_kernels import NONE, cheapest_chains
from gcsplan.planners.optimal.plane.sections import (
    NODE_MB,
    Sections,
    halved_spans,
    lay_out,
    lines_of,
    spans_within,
    widest_spans,
)
from gcsplan.planners.problem import Problem

SPACING_M, LEAST_SECTIONS = 240.0, 8
"""Metres between the first sections, but at least so many of them on the straight way."""
LOOKS = ((1e6, 0), (4e6, 0), (6e6, 1), (1.2e7, 2))
"""Legs between nodes that are looked at, at most, and how often the spacing was halved."""
WORTH_MORE = 0.03
"""Part of the gap that a look must close for the next one to follow."""
NEARER_PATH = 0.7
"""Part of the gap it left, to which a better path must have closed it for another run."""
LEAST_STEP, MOST_STEP = 1.0 / 40.0, 1.0
"""Least and most metres between nodes, as parts of the spacing."""
LEG_S = 3e-8
"""Counted seconds of a leg between nodes."""
LEVEL_SLOPES, STEEPEST = (0.03, 0.07, 0.12, 0.18, 0.26, 0.36, 0.5), 1.0
"""Prices of a metre of climb in metres of track, and the slope from which on a climb limit does not count."""
BEYOND = (0.1, 0.4, 1.0)
"""Prices of a metre of climb beyond the limit: parts of the way from its price to the price of laps."""


@dataclass(frozen=True, eq=False, slots=True)
class Planes:
    """The planes (Q,) below the cost of a leg: ``slope`` for each metre that it rises, in rising order, and ``slant``
    for each metre of its track; ``beyond``: what a plane beyond the climb limit loses for each metre of track that
    rounding may take. ``level``: the cost of a level metre."""

    slope: Floats
    slant: Floats
    beyond: Floats
    level: float

    @classmethod
    def of(cls, problem: Problem) -> Planes:
        """The planes of a problem's objective and climb limits."""
        limits = problem.bound_limits
        up, down = (_side(problem, k) for k in (limits.max_climb_slope, limits.max_descent_slope))
        slope, slant, beyond = (
            np.concatenate([b[:0:-1] * sign, a]) for a, b, sign in zip(up, down, (-1, 1, 1), strict=True)
        )
        return cls(slope, slant, beyond, float(slant.max()))


def _side(problem: Problem, limit: float) -> tuple[Floats, Floats, Floats]:
    """The planes of one climb limit (a slope), from level flight on."""
    # The slope is raised by the rounding of its angle, so that a path exactly at the limit counts.
    k = min(limit, STEEPEST) + 2e-8
    beyond = np.array(BEYOND if limit < STEEPEST else ())
    if problem.objective == "energy":
        level, climb = problem.horizontal_j_per_m, problem.vertical_j_per_m
        slope = np.concatenate([[0.0, 0.5 * climb, climb], climb + beyond * level / k])
        over = np.maximum(slope - climb, 0.0)
        return slope, level - k * over, k * over
    flat, sine = 1.0 / math.hypot(1.0, k), k / math.hypot(1.0, k)
    legal = [0.0, *(price for price in LEVEL_SLOPES if price < 0.9 * sine), sine]
    slope = np.concatenate([legal, sine + beyond * (1.0 / sine - sine)])
    over = np.maximum(slope - sine, 0.0)
    return slope, np.where(over > 0.0, flat - k * over, np.sqrt(1.0 - np.minimum(slope, sine) ** 2)), k * over


class SectionChains(Search):
    """Under a maximum AGL, when a path is known; after a much better one again."""

    NAME, IMPROVES, SHARE, AGAIN = "sections", "paths, bounds", 0.8, True

    def __init__(self, work: Workspace) -> None:
        super().__init__(work)
        self._left = math.inf
        """The gap that the last run left."""

    def applies(self) -> bool:
        """Under a maximum AGL, when a path is known."""
        if self.problem.limits.max_agl_m is None or self.incumbent.best is None:
            return False
        return self.incumbent.gap < NEARER_PATH * self._left

    def size(self) -> Size:
        """The first look; the next ones follow only while they close the gap."""
        return LOOKS[0][0] * LEG_S, self.work.plane.size(1.0)[1] + LOOKS[-1][0] / 100.0 * NODE_MB

    def run(self) -> None:
        """Raise the bound, and try the cheapest chains as tracks, with more nodes each time."""
        plane, incumbent = self.work.plane, self.incumbent
        if incumbent.best is None or not plane.legs or not plane.reach_longest():
            return
        planes, looked = Planes.of(self.problem), None
        for pairs, halvings in LOOKS:
            gap = incumbent.cost - incumbent.bound
            sections = self._laid_out(planes, looked, pairs, halvings)
            if sections is None:
                break
            halved = looked is not None and len(sections.lines) > len(looked.sections.lines)
            looked = _Look(planes, sections, incumbent.cost)
            incumbent.budget.spend("section", looked.pairs)
            if math.isfinite(looked.bound):
                self._try(sections, looked.chain())
            incumbent.raise_bound(looked.bound)
            little = gap - (incumbent.cost - incumbent.bound) < WORTH_MORE * gap
            if not incumbent.goes_on() or (halved and little):
                break
        self._left = incumbent.gap

    def _laid_out(self, planes: Planes, looked: _Look | None, pairs: float, halvings: int) -> Sections | None:
        """The nodes of the next look, over what the last one left; None if they are too far apart, or lie over unknown
        ground."""
        plane, incumbent = self.work.plane, self.incumbent
        straight_m, most_m = sum(leg.straight_m for leg in plane.legs), plane.longest()
        first_m = min(SPACING_M, straight_m / LEAST_SECTIONS)
        spacing_m = first_m / (1 << halvings)
        lines = lines_of(plane, first_m, halvings)
        spans = widest = widest_spans(plane, lines, most_m)
        if looked is not None:
            incumbent.budget.spend("section", looked.pairs)
            nodes = looked.nodes_left(incumbent.cost)
            if len(lines) > len(looked.sections.lines):
                limits = self.problem.bound_limits
                least = min(limits.max_climb_slope, limits.max_descent_slope)
                spare_m = (incumbent.cost - looked.bound) / planes.level
                spans = halved_spans(looked.sections, nodes, spare_m, least)
            else:
                spans = looked.sections.spans_of(nodes)
            spans = spans_within(spans, widest)
            if not all(spans):
                return None
        # Between two sections, a track gets aside by no more than what its metres to spare allow.
        window_m = 2.0 * math.sqrt((spacing_m + most_m - straight_m) ** 2 - spacing_m**2)
        wide_m = np.array([sum(b - a for a, b in parts) for parts in spans])
        step_m = math.sqrt(float((wide_m * np.minimum(wide_m, window_m)).sum()) / pairs)
        if step_m > MOST_STEP * spacing_m:
            return None
        return lay_out(plane, lines, spans, max(step_m, LEAST_STEP * spacing_m))

    def _try(self, sections: Sections, nodes: Int64s) -> None:
        """Try a chain as a track."""
        terminal = np.repeat([line.leg is None for line in sections.lines], np.diff(sections.first))[nodes]
        fixed = terminal & (sections.low[nodes] == sections.high[nodes])
        fixed[[0, -1]] = False
        track = np.stack([sections.x[nodes], sections.y[nodes]], axis=-1)
        self.incumbent.take_along((track, terminal, np.where(fixed, sections.low[nodes], math.nan)))


class _Look:
    """The cheapest chains over one set of nodes. ``bound``: of all paths that are cheaper than ``cost``."""

    def __init__(self, planes: Planes, sections: Sections, cost: float) -> None:
        self.planes, self.sections = planes, sections
        # What rounding adds to the track, in expectation.
        step_m = sections.step_m
        self.less = planes.level * step_m**2 / 8.0 * float((1.0 / sections.gap).sum())
        self.most = cost + self.less
        self.value, self.near, self.pairs = self._swept(back=False)
        low, high = sections.low[-1], sections.high[-1]
        ends = self.value[:, -1] + np.minimum(planes.slope * low, planes.slope * high)
        self.bound = float(ends.max()) - self.less if self.value[0, -1] < NONE else math.inf

    def _swept(self, *, back: bool) -> tuple[Floats, Floats, int]:
        """`cheapest_chains` to each node, or from it to the last one: values, nodes before, and legs."""
        s, planes = self.sections, self.planes
        turn = slice(None, None, -1 if back else 1)
        first = (len(s.x) - s.first[turn]) if back else s.first
        nodes = (s.aside, s.low, s.high, s.away if back else s.left)
        slope = -planes.slope if back else planes.slope
        value, near = np.full((len(slope), len(s.x)), NONE), np.full((len(slope), len(s.x)), -1.0)
        aside, low, high, left, gap, slope, slant, beyond = (
            np.ascontiguousarray(v[turn]) for v in (*nodes, s.gap, slope, planes.slant, planes.beyond)
        )
        value[:, 0] = -slope * low[0]
        spec, least = np.array([s.step_m, planes.level, self.most]), np.empty(len(s.x))
        pairs = cheapest_chains(
            np.ascontiguousarray(first), gap, aside, low, high, left, slope, slant, beyond, spec, least, value, near
        )
        return value[turn, turn], near, pairs

    def chain(self) -> Int64s:
        """The nodes of the chain that decides the bound."""
        s, planes = self.sections, self.planes
        nodes = [len(s.x) - 1]
        q = int((self.value[:, -1] + planes.slope * s.low[-1]).argmax())
        while (m := int(self.near[q, nodes[-1]])) >= 0:
            n = nodes[-1]
            run = math.hypot(s.x[n] - s.x[m], s.y[n] - s.y[m])
            plane = self.value[:, m] + planes.slant * run
            q = int(np.clip(q, *((plane + planes.slope * at).argmax() for at in (s.low[n], s.high[n]))))
            nodes.append(m)
        return np.array(nodes[::-1], np.int64)

    def nodes_left(self, cost: float) -> Bools:
        """(N,) the nodes that a rounded chain of a path cheaper than ``cost`` may pass."""
        s, slope = self.sections, self.planes.slope[:, None]
        back = self._swept(back=True)[0]
        through = (self.value + back).max(axis=0)
        every = np.arange(len(s.x))
        for at, rising in ((s.low, 1.0), (s.high, -1.0)):
            to, of = self.value + slope * at, back - slope * at
            i, j = to.argmax(axis=0), of.argmax(axis=0)
            ends = rising * (slope[i, 0] - slope[j, 0]) >= 0.0
            through = np.where(ends, to[i, every] + of[j, every], through)
        return np.asarray(through <= cost + self.less)
