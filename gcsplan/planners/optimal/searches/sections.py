"""Chains of places on sections across the legs: a bound, and paths along the cheapest chains.

At each node, the least cost of a path to it is bounded at every altitude by planes of some slopes. docs/planner.md,
"Sections", has the proof. The places that no cheaper path can pass are left out, and the others looked at more closely.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Int64s
from gcsplan.planners.lattice.planner import pulled
from gcsplan.planners.optimal.loop.search import BAND_FAR, Search, Size
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
LOOKS = ((1.5e6, 0), (1.2e7, 1), (4e7, 2))
"""Legs between nodes that are looked at, at most, and how often the spacing was halved."""
LOOK_SHARES = (0.8, 0.3, 0.15)
"""The part of the gap that each of them closes, on average."""
WORTH_MORE = 0.03
"""Part of the gap that a look must close for the next one to follow."""
NEARER_PATH = 0.7
"""Part of the gap it left, to which a better path must have closed it for another run."""
AIM = 0.7
"""Part of the gap that a later look closes at most: it keeps to the places of paths that are cheaper than that."""
LEAST_STEP, MOST_STEP = 1.0 / 40.0, 1.0
"""Least and most metres between nodes, as parts of the spacing."""
LEG_S = 1e-8
"""Counted seconds of a leg between nodes."""
LEVEL_SLOPES, STEEPEST = (0.03, 0.07, 0.12, 0.18, 0.26, 0.36, 0.5), 1.0
"""Prices of a metre of climb in metres of track, and the slope from which on a climb limit does not count."""
BEYOND = (0.1, 0.4, 1.0)
"""Prices of a metre of climb beyond the limit: parts of the way from its price to the price of laps."""
LATER, EARLIER = 1.0 / 9.0, 4.0 / 9.0
"""The parts of what rounding may take from a leg at its climb limit: for planes up to the limit, of the longer of two
legs, and for planes beyond it, of the shorter one. The square roots of both add up to one."""
LAID_OUT = 35.0
"""Most nodes of a look, for the square root of its legs."""


@dataclass(frozen=True, eq=False, slots=True)
class Planes:
    """The planes (Q,) below the cost of a leg: ``slope`` for each metre that it rises, in rising order, and ``slant``
    for each metre of its track. ``level``: the cost of a level metre. ``loss`` (5, Q): what rounding may take from
    each, as docs/planner.md, "Sections", has it: for a metre of the turn with the next longer leg; and for climbs,
    then for descents, for a metre of that with the next shorter one, less for a metre of track."""

    slope: Floats
    slant: Floats
    loss: Floats
    level: float

    @classmethod
    def of(cls, problem: Problem) -> Planes:
        """The planes of a problem's objective and climb limits."""
        limits = problem.bound_limits
        up, down = sides = [_side(problem, k) for k in (limits.max_climb_slope, limits.max_descent_slope)]
        slope, slant, beyond = (
            np.concatenate([b[:0:-1], a]) for a, b in zip(up[:3], (-down[0], *down[1:3]), strict=True)
        )
        # Where climbs have a price of their own, planes up to the limit are dearer for every climb.
        loss = np.zeros((5, len(slope)))
        loss[0] = beyond * (EARLIER if problem.rates is None else 1.0)
        for row, (_, _, over, (k, limit, flat)), price in zip((1, 3), sides, (slope, -slope), strict=True):
            if over.any() and problem.rates is None:
                loss[row] = LATER * flat + np.maximum(limit - price, 0.0) * k
                loss[row + 1] = np.maximum(flat + limit * k - slant - price * k, 0.0)
        return cls(slope, slant, loss, float(slant.max()))


def _side(problem: Problem, limit: float) -> tuple[Floats, Floats, Floats, tuple[float, float, float]]:
    """The planes of one climb limit (a slope), from level flight on, and what each beyond it costs less for each metre
    of track that is missing for the climb. At the limit: its slope, and what a metre of climb and of track cost."""
    # The slope is raised by the rounding of its angle, so that a path exactly at the limit counts.
    k = min(limit, STEEPEST) + 2e-8
    beyond = np.array(BEYOND if limit < STEEPEST else ())
    if problem.rates is not None:
        level, climb = problem.rates
        slope = np.concatenate([[0.0, 0.5 * climb, climb], climb + beyond * level / k])
        over = k * np.maximum(slope - climb, 0.0)
        return slope, level - over, over, (k, climb, level)
    flat, sine = 1.0 / math.hypot(1.0, k), k / math.hypot(1.0, k)
    legal = [0.0, *(price for price in LEVEL_SLOPES if price < 0.9 * sine), sine]
    slope = np.concatenate([legal, sine + beyond * (1.0 / sine - sine)])
    over = k * np.maximum(slope - sine, 0.0)
    slant = np.where(over > 0.0, flat - over, np.sqrt(1.0 - np.minimum(slope, sine) ** 2))
    return slope, slant, over, (k, sine, flat)


class SectionChains(Search):
    """Under a maximum AGL, when a path is known: one look after another, while they close the gap; and one look more
    after a much better path. Remembers the last look, unless no path was left of it: the next one begins there."""

    NAME, IMPROVES, SHARE = "sections", "paths, bounds", 0.8

    def __init__(self, work: Workspace) -> None:
        super().__init__(work)
        self._next, self._goes_on = 0, True
        """The number of the next look, and whether the last one gained enough for it."""
        self._left = math.inf
        """The gap that the last look left, or met if there was none."""
        self._looked: _Look | None = None

    @property
    def share(self) -> float:
        """By the number of the look."""
        return LOOK_SHARES[self._next]

    def applies(self) -> bool:
        """Under a maximum AGL, when a path is known."""
        return self.problem.limits.max_agl_m is not None and self.incumbent.best is not None

    def is_open(self) -> bool:
        """Whether another look is worth it, or a path much better than at the last one is known."""
        return self.applies() and (self._goes_on or self.incumbent.gap < NEARER_PATH * self._left)

    def choose(self) -> None:
        """Note the gap: after a look that is refused, or cannot be laid out, a much better path must be known."""
        super().choose()
        self._goes_on, self._left = False, self.incumbent.gap

    def size(self) -> Size:
        """The legs between nodes of the next look."""
        pairs = LOOKS[self._next][0]
        return pairs * LEG_S, self.work.plane.size(1.0)[1] + LAID_OUT * math.sqrt(pairs) * NODE_MB

    def run(self) -> None:
        """Raise the bound, and try the cheapest chain as a track; and after later looks, if path and bound are far
        apart, what it is pulled to."""
        plane, incumbent, gap = self.work.plane, self.incumbent, self.incumbent.cost - self.incumbent.bound
        planes, (pairs, halvings) = Planes.of(self.problem), LOOKS[self._next]
        if not plane.legs or not plane.reach_longest():
            return
        before = self._looked
        aim = incumbent.cost if before is None else min(incumbent.bound + AIM * gap, before.cost)
        sections = self._laid_out(planes, before, pairs, halvings, aim)
        if sections is None:
            return
        looked = _Look(planes, sections, aim)
        incumbent.budget.spend("section", looked.pairs)
        chain = looked.chain() if math.isfinite(looked.bound) else None
        self._looked = None if chain is None else looked
        if chain is not None:
            # Drawing chains tight took a third of the time here, and gained 0.006 % at most.
            incumbent.take_along(sections.track_of(chain), fine=False)
        incumbent.raise_bound(min(looked.bound, aim))
        halved = before is not None and len(sections.lines) > len(before.sections.lines)
        little = gap - (incumbent.cost - incumbent.bound) < WORTH_MORE * gap
        after = self._next + 1
        self._goes_on = after < len(LOOKS) and chain is not None and not (halved and little)
        self._next, self._left = min(after, len(LOOKS) - 1), incumbent.gap
        if chain is not None and (halvings > 0 or not self._goes_on) and incumbent.gap > BAND_FAR:
            _, pinned, pin_m = sections.track_of(chain)
            found = pulled(self.problem, incumbent.judge, sections.middles_of(chain), pinned, pin_m)
            if found is not None:
                incumbent.take_simpler(*found, fine=False, longer=False)

    def _laid_out(
        self, planes: Planes, looked: _Look | None, pairs: float, halvings: int, aim: float
    ) -> Sections | None:
        """The nodes of the next look, over what the last one left to paths cheaper than ``aim``; None if that is
        nothing, or if they are too far apart or lie over unknown ground."""
        plane, incumbent = self.work.plane, self.incumbent
        straight_m, most_m = sum(leg.straight_m for leg in plane.legs), plane.longest()
        first_m = min(SPACING_M, straight_m / LEAST_SECTIONS)
        spacing_m = first_m / (1 << halvings)
        lines = lines_of(plane, first_m, halvings)
        spans = widest = widest_spans(plane, lines, most_m)
        if looked is not None:
            incumbent.budget.spend("section", looked.pairs)
            nodes = looked.nodes_left(aim)
            if len(lines) > len(looked.sections.lines):
                limits, spare_m = self.problem.bound_limits, max(aim - looked.bound, 0.0) / planes.level
                least = min(limits.max_climb_slope, limits.max_descent_slope)
                spans = halved_spans(looked.sections, nodes, spare_m, least)
            else:
                spans = looked.sections.spans_of(nodes)
            spans = spans_within(spans, widest)
            if not all(spans):
                self._looked = None
                incumbent.raise_bound(aim)
                return None
        # Between two sections, a track gets aside by no more than what its metres to spare allow.
        window_m = 2.0 * math.sqrt((spacing_m + most_m - straight_m) ** 2 - spacing_m**2)
        wide_m = np.array([sum(b - a for a, b in parts) for parts in spans])
        step_m = math.sqrt(float((wide_m * np.minimum(wide_m, window_m)).sum()) / pairs)
        if step_m > MOST_STEP * spacing_m:
            return None
        return lay_out(plane, lines, spans, max(step_m, LEAST_STEP * spacing_m))


class _Look:
    """The cheapest chains over one set of nodes. ``bound``: of all paths that are cheaper than ``cost``."""

    def __init__(self, planes: Planes, sections: Sections, cost: float) -> None:
        self.planes, self.sections, self.cost = planes, sections, cost
        # What rounding adds to the track, in expectation.
        self.less = planes.level * sections.step_m**2 / 8.0 * float((1.0 / sections.gap).sum())
        self.most = cost + self.less
        self.value, self.near, self.pairs = self._swept()
        low, high = sections.low[-1], sections.high[-1]
        ends = self.value[-1] + np.minimum(planes.slope * low, planes.slope * high)
        self.bound = float(ends.max()) - self.less if self.value[-1, 0] < NONE else math.inf

    def _swept(self, back: Floats | None = None) -> tuple[Floats, Floats, int]:
        """`cheapest_chains` to each node: values, nodes before, and legs. Or from it to the last one, where ``back``
        (N,) is the least cost to it: chains that cost too much with that are left out."""
        s, planes = self.sections, self.planes
        turn = slice(None, None, 1 if back is None else -1)
        first = s.first if back is None else (len(s.x) - s.first[turn])
        place = np.rint(s.aside[turn] / s.step_m).astype(np.int64)
        slope = planes.slope if back is None else -planes.slope
        left = planes.level * s.left if back is None else np.maximum(planes.level * s.away, back)
        low, high, left, gap, slope, slant = (
            np.ascontiguousarray(v[turn]) for v in (s.low, s.high, left, s.gap, slope, planes.slant)
        )
        loss = np.ascontiguousarray(planes.loss[:, turn])
        value, near = np.full((len(place), len(slope)), NONE), np.full((len(place), len(slope)), -1.0)
        value[0] = -slope * low[0]
        spec = np.array([s.step_m, planes.level, self.most])
        work = np.empty((int(np.ptp(place)) + 1, len(slope) + 1)), np.empty((4, len(slope)))
        pairs = cheapest_chains(
            np.ascontiguousarray(first), gap, place, low, high, left, slope, slant, loss, spec, np.empty(len(place)),
            value, near, *work,
        )  # fmt: skip
        return value[turn, turn], near, pairs

    def chain(self) -> Int64s:
        """The nodes of the chain that decides the bound."""
        s, planes = self.sections, self.planes
        nodes = [len(s.x) - 1]
        q = int((self.value[-1] + planes.slope * s.low[-1]).argmax())
        while (m := int(self.near[nodes[-1], q])) >= 0:
            n = nodes[-1]
            run = math.hypot(s.x[n] - s.x[m], s.y[n] - s.y[m])
            plane = self.value[m] + planes.slant * run
            q = int(np.clip(q, *((plane + planes.slope * at).argmax() for at in (s.low[n], s.high[n]))))
            nodes.append(m)
        return np.array(nodes[::-1], np.int64)

    def nodes_left(self, cost: float) -> Bools:
        """(N,) the nodes that a rounded chain of a path cheaper than ``cost`` may pass."""
        s, slope = self.sections, self.planes.slope
        ends = np.minimum(slope * s.low[:, None], slope * s.high[:, None])
        back = self._swept((self.value + ends).max(axis=1))[0]
        through = (self.value + back).max(axis=1)
        every = np.arange(len(s.x))
        for at, rising in ((s.low[:, None], 1.0), (s.high[:, None], -1.0)):
            to, of = self.value + slope * at, back - slope * at
            i, j = to.argmax(axis=1), of.argmax(axis=1)
            ends = rising * (slope[i] - slope[j]) >= 0.0
            through = np.where(ends, to[every, i] + of[every, j], through)
        return np.asarray(through <= cost + self.less)
