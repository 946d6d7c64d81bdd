"""Chains of places on sections across the legs: a bound, and paths along the cheapest chains.

Each node of a section has a price: metres or joules for each metre that a path rises after it. With prices, altitudes
count at single nodes, each at its floor or its ceiling; so the cheapest chain is found in the plane. Any prices give a
bound. The best are those of the taut string over the cheapest chain: so chain and prices are found in turn, first with
few nodes, then with many. docs/planner.md, "Sections", has the proof.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Int32s, Int64s
from gcsplan.planners.optimal.loop.search import Search, Size
from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch
from gcsplan.planners.optimal.plane.section_kernels import cheapest_chain
from gcsplan.planners.optimal.plane.section_prices import Prices, chain_prices, numbers, slants
from gcsplan.planners.optimal.plane.sections import (
    NODE_MB,
    Line,
    Sections,
    SectionSpans,
    crossings,
    lay_out,
    lines_of,
    widest_spans,
)

SPACING_M, LEAST_SECTIONS = 120.0, 8
"""Metres between sections, but at least so many of them on the straight way."""
EFFORTS = ((5e5, 20), (2e6, 12), (8e6, 2))
"""Legs between nodes that are looked at for one chain, at most, and how many chains: few nodes to find prices, then
more to bound."""
WORTH_MORE = 0.05
"""Part of the gap that an effort must close for the next one to follow."""
FINE = 0.05
"""Metres between nodes, as a part of the spacing, from which on more nodes and a better path change little."""
NEARER_PATH = 0.7
"""Part of the gap it left, to which a better path must have closed it for another run."""
LEAST_STEP, MOST_STEP = 1.0 / 80.0, 0.4
"""Least and most metres between nodes, as parts of the spacing."""
WORTH, IDLE = 0.02, 4
"""Part of the gap that a chain must close to count as a gain; and chains without a gain after which no more follow."""
LEG_S = 1e-8
"""Counted seconds of a leg between nodes."""
CHEAPER = 1e-4
"""Part of the cost by which a chain must be cheaper than the best path to be tried as a track."""


class SectionChains(Search):
    """Under a maximum AGL, when a path is known; after a much better one again, unless nodes were near each other
    already. Remembers prices, the last effort, whether nodes were, and the gap that it left."""

    NAME, IMPROVES, SHARE, AGAIN = "sections", "paths, bounds", 0.8, True

    def __init__(self, work: Workspace) -> None:
        super().__init__(work)
        self._prices, self._effort, self._fine, self._left = Prices(), 0, False, math.inf

    def applies(self) -> bool:
        """Under a maximum AGL, when a path is known."""
        if self.problem.limits.max_agl_m is None or self.incumbent.best is None or self._fine:
            return False
        return self.incumbent.gap < NEARER_PATH * self._left

    def size(self) -> Size:
        """Chains over few nodes; those over many are only looked for while they close the gap."""
        legs, chains = EFFORTS[self._effort]
        return legs * chains * LEG_S, self.work.plane.size(1.0)[1] + legs / 50.0 * NODE_MB

    def run(self) -> None:
        """Raise the bound, and try cheaper chains as tracks, with more nodes each time."""
        plane, incumbent = self.work.plane, self.incumbent
        if incumbent.best is None or not plane.legs or not plane.reach_longest() or math.isinf(plane.longest()):
            return
        spacing_m = min(SPACING_M, sum(leg.straight_m for leg in plane.legs) / LEAST_SECTIONS)
        lines, spans = lines_of(plane, spacing_m), None
        for effort in range(self._effort, len(EFFORTS)):
            gap = incumbent.cost - incumbent.bound
            chains = _Chains(plane, self._prices, lines, spacing_m, effort, spans)
            if chains.sections is not None:
                self._effort = effort
                chains.run()
                if not math.isfinite(chains.bound):
                    incumbent.raise_bound(math.inf)
                    return
                self._fine = chains.sections.step_m <= FINE * spacing_m
                self._left = incumbent.gap
                gained = gap - (incumbent.cost - incumbent.bound)
                ends = effort + 1 == len(EFFORTS) or (effort > 0 and (self._fine or gained < WORTH_MORE * gap))
                if ends or not incumbent.goes_on():
                    return
                spans = chains.spans_left()


class _Chains:
    """Chains over one set of nodes. ``bound``: the highest bound so far."""

    def __init__(
        self, plane: PlaneSearch, prices: Prices, lines: list[Line], spacing_m: float, effort: int,
        spans: SectionSpans | None,
    ) -> None:  # fmt: skip
        self.plane, self.incumbent, self.problem = plane, plane.incumbent, plane.problem
        self.prices, self.bound = prices, 0.0
        self.legs, self.most_chains = EFFORTS[effort]
        straight_m, most_m = sum(leg.straight_m for leg in plane.legs), plane.longest()
        within = widest_spans(plane, lines, most_m)
        if spans is not None:
            within = [(max(a, c), min(b, d)) for (a, b), (c, d) in zip(within, spans, strict=True)]
        # Between two sections, a track gets aside by no more than what its metres to spare allow.
        window_m = 2.0 * math.sqrt((spacing_m + most_m - straight_m) ** 2 - spacing_m**2)
        wide_m = np.array([b - a for a, b in within])
        step_m = math.sqrt(float((wide_m * np.minimum(wide_m, window_m)).sum()) / self.legs)
        self.sections: Sections | None = None
        if step_m <= MOST_STEP * spacing_m:
            self.sections = lay_out(plane, lines, within, max(step_m, LEAST_STEP * spacing_m), most_m)

    def run(self) -> None:
        """Find chain and prices in turn until the bound gains no more; then try the cheapest chain as a track."""
        sections, incumbent = self.sections, self.incumbent
        assert sections is not None
        assert incumbent.best is not None
        if not self.prices.price:
            self._learn(sections.nearest(crossings(self.plane, sections.lines, incumbent.best)))
        idle, last, cheapest, least = 0, 0.0, None, incumbent.cost * (1.0 - CHEAPER)
        for _ in range(self.most_chains):
            price = self.prices.at(sections)
            value, before = self._swept(price, back=False)
            incumbent.budget.spend("section", self.legs)
            found, gap = float(value[-1]), incumbent.cost - incumbent.bound
            idle = 0 if found - last > WORTH * gap else idle + 1
            self.bound, last = max(self.bound, found), found
            if not math.isfinite(found):
                return
            incumbent.raise_bound(found)
            nodes = _chain(before)
            cost = self._learn(nodes)
            if cost < least:
                cheapest, least = nodes, cost
            if idle >= IDLE or not incumbent.goes_on():
                break
        if cheapest is not None:
            self._try(cheapest)

    def spans_left(self) -> SectionSpans:
        """What is left of each section without the places that no cheaper path can pass."""
        sections = self.sections
        assert sections is not None
        price = self.prices.at(sections)
        through = self._swept(price, back=False)[0] + self._swept(price, back=True)[0]
        near = sections.touched(through <= self.incumbent.cost)
        spans: SectionSpans = []
        for begin, end in zip(sections.first[:-1], sections.first[1:], strict=True):
            aside = sections.aside[begin:end][near[begin:end]]
            spans.append((float(aside.min()), float(aside.max())) if len(aside) else (0.0, 0.0))
        return spans

    def _swept(self, price: Floats, *, back: bool) -> tuple[Floats, Int32s]:
        """`cheapest_chain` at these prices."""
        s, problem = self.sections, self.problem
        assert s is not None
        price = price.copy()
        price[-1] = 0.0
        slant = slants(problem, price)
        spec = np.array([s.step_m, s.most_m, *numbers(problem), back])
        value, near = np.empty(len(price)), np.empty(len(price), np.int32)
        end = -1 if back else 0
        value[end], near[end] = (0.0 if back else -price[0] * s.low[0]), -1
        cheapest_chain(
            s.first, s.x, s.y, s.low, s.high, s.shut, s.loose, price, slant, s.widest(price), s.away, s.left, spec,
            np.empty(int(np.diff(s.first).max())), value, near,
        )  # fmt: skip
        return value, near

    def _learn(self, nodes: Int64s) -> float:
        """Add the prices of a chain; return its cost."""
        assert self.sections is not None
        price, cost = chain_prices(self.problem, self.sections, nodes)
        self.prices.add(self.sections.aside[nodes], price)
        return cost

    def _try(self, nodes: Int64s) -> None:
        """Try a chain as a track."""
        sections = self.sections
        assert sections is not None
        terminal = np.array([line.leg is None for line in sections.lines])
        fixed = terminal & (sections.low[nodes] == sections.high[nodes])
        fixed[[0, -1]] = False
        track = np.stack([sections.x[nodes], sections.y[nodes]], axis=-1)
        self.incumbent.take_along((track, terminal, np.where(fixed, sections.low[nodes], math.nan)))


def _chain(before: Int32s) -> Int64s:
    """The chain that ends with the last node, from the node before each."""
    nodes = [len(before) - 1]
    while before[nodes[-1]] >= 0:
        nodes.append(int(before[nodes[-1]]))
    return np.array(nodes[::-1], np.int64)
