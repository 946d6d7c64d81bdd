"""The one loop of a plan: the searches for paths and bounds, and the governor that chooses between them.

Before it starts, each search states whether it applies and how much work and memory it takes. The governor runs the
search that promises most for its cost, refuses a search that does not fit into the rest of the budget, and keeps a
record.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.problem import Step

Size = tuple[float, float]
"""Counted seconds and megabytes."""
LEAST_S = 1e-3
"""Least counted seconds that a search is assumed to cost."""
MOST_SEARCHES = 200
"""Most searches of one plan, refused ones included."""
AGAIN = 0.02
"""Part of the gap that a better path must have closed before a search runs once more."""


@dataclass(eq=False, slots=True)
class Search:
    """One source of paths or bounds.

    ``share``: the part of the gap that it closes on average, measured by ``gcsplan bench``, or a function that tells it
    from the gap; a first path counts as all of it. ``applies``: whether it may help now; ``size``: what it takes;
    ``again``: whether it may run once more after a better path was found.
    """

    name: str
    share: float | Callable[[float], float]
    applies: Callable[[], bool]
    size: Callable[[], Size]
    run: Callable[[], object]
    again: bool = False
    nearer: bool = False
    """Whether it is worth its cost even if the gap is already as small as wanted; see `incumbent.NEARER`."""
    seen: float | None = field(default=None)
    """Cost of the best path when the search ran last; None: it has not run yet."""

    def is_open(self, incumbent: Incumbent) -> bool:
        """Whether the search may run now."""
        if self.seen is not None:
            better = self.seen - incumbent.cost > AGAIN * (incumbent.cost - incumbent.bound)
            if not (self.again and better):
                return False
        return self.applies()


def govern(incumbent: Incumbent, searches: list[Search], without: Collection[str] = ()) -> None:
    """Run searches until the gap is as small as wanted, no search is left, or the budget is spent.

    ``without``: names of searches to leave out.
    """
    left = [s for s in searches if s.name not in without]
    budget = incumbent.budget
    for _ in range(MOST_SEARCHES):
        ended = incumbent.proved_infeasible or incumbent.gap <= incumbent.nearer or incumbent.needs_terrain
        if ended or not budget.goes_on():
            return
        chosen: Search | None = None
        best, size = -math.inf, (0.0, 0.0)
        for search in left:
            if (search.nearer or not incumbent.done()) and search.is_open(incumbent):
                asked = search.size()
                share = search.share(incumbent.gap) if callable(search.share) else search.share
                worth = share / max(asked[0], LEAST_S)
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
