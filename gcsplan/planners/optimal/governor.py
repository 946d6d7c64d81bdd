"""The one loop of a plan: searches for paths and bounds, and who chooses between them.

A search says by itself whether it applies, and how much work and memory it takes, before it starts. The governor takes
the one that promises most for its cost, refuses what does not fit into what is left of the budget, and keeps a record.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from gcsplan.planners.optimal.incumbent import Incumbent
from gcsplan.planners.problem import Step

Size = tuple[float, float]
"""Counted seconds and megabytes."""
LEAST_S = 1e-3
"""No search is taken to cost less."""
MOST_STEPS = 200
AGAIN = 0.02
"""What part of the gap a better path must have closed before a search runs once more."""
NEARER = 0.45
"""What part of the wanted gap is near enough for searches that are cheap and mostly help."""


@dataclass(eq=False, slots=True)
class Search:
    """One source of paths or bounds.

    ``share``: the part of the gap that it closes, about, as measured by ``gcsplan bench``; a first path is worth all.
    ``applies``: whether it may help where things stand; ``size``: what it takes; ``again``: whether it may run once
    more after a better path came.
    """

    name: str
    share: float
    applies: Callable[[], bool]
    size: Callable[[], Size]
    run: Callable[[], object]
    again: bool = False
    nearer: bool = False
    """Whether it is worth its cost even where the gap is small enough, see `NEARER`."""
    seen: float | None = field(default=None)
    """What the best path cost when it ran last; None: it has not run yet."""

    def is_open(self, incumbent: Incumbent) -> bool:
        """Whether it may run now."""
        if self.seen is not None:
            better = self.seen - incumbent.cost > AGAIN * (incumbent.cost - incumbent.bound)
            if not (self.again and better):
                return False
        return self.applies()


def govern(incumbent: Incumbent, searches: list[Search], without: Collection[str] = ()) -> None:
    """Run searches until path and bound are as near as wanted, none is left, or the budget is spent.

    ``without``: names of searches that are left out.
    """
    left = [s for s in searches if s.name not in without]
    budget = incumbent.budget
    for _ in range(MOST_STEPS):
        if incumbent.proved_shut or incumbent.gap <= NEARER * incumbent.wanted or not budget.goes_on():
            return
        chosen: Search | None = None
        best, size = -math.inf, (0.0, 0.0)
        for search in left:
            if (search.nearer or not incumbent.done()) and search.is_open(incumbent):
                asked = search.size()
                worth = search.share / max(asked[0], LEAST_S)
                if worth > best:
                    chosen, best, size = search, worth, asked
        if chosen is None:
            return
        chosen.seen = incumbent.cost
        if not budget.fits(*size):
            incumbent.steps.append(Step(chosen.name, 0.0, size[1], refused=True))
            budget.ran_out = True
            continue
        begun, cost, bound = time.perf_counter(), incumbent.cost, incumbent.bound
        chosen.run()
        gained = 0.0 if math.isinf(cost) else 100.0 * (cost - incumbent.cost) / max(cost, 1e-9)
        raised = 100.0 * (incumbent.bound - bound) / max(bound, 1e-9)
        incumbent.steps.append(Step(chosen.name, time.perf_counter() - begun, size[1], gained, raised))
