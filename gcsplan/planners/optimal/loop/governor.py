"""The one loop of a plan: the governor chooses between the searches for paths and bounds.

Before it starts, each search states whether it applies and how much work and memory it takes. The governor runs the
search that promises most for its cost, refuses a search that does not fit into the rest of the budget, and keeps a
record.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Sequence

from gcsplan.planners.optimal.loop.search import Search
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.problem import Step

_log = logging.getLogger(__name__)

LEAST_S = 1e-3
"""Least counted seconds that a search is assumed to cost."""
MOST_SEARCHES = 200
"""Most searches of one plan, refused ones included."""


def govern(incumbent: Incumbent, searches: Sequence[Search]) -> None:
    """Run searches until the gap is as small as requested, no search is left, or the budget is spent."""
    budget = incumbent.budget
    for _ in range(MOST_SEARCHES):
        ended = incumbent.proved_infeasible or incumbent.gap <= incumbent.nearer or incumbent.needs_terrain
        if ended or not budget.goes_on():
            return
        chosen: Search | None = None
        best, size = -math.inf, (0.0, 0.0)
        for search in searches:
            if (search.nearer or not incumbent.done()) and search.is_open():
                needs = search.size()
                worth = search.share / max(needs[0], LEAST_S)
                if worth > best:
                    chosen, best, size = search, worth, needs
        if chosen is None:
            return
        chosen.choose()
        if not budget.fits(*size):
            incumbent.steps.append(Step(chosen.NAME, 0.0, size[1], refused=True))
            _log.debug("%s does not fit into the rest of the budget", chosen.NAME)
            budget.ran_out = True
            continue
        begun, cost, bound = time.perf_counter(), incumbent.cost, incumbent.bound
        chosen.run()
        gained = 0.0 if math.isinf(cost) else 100.0 * (cost - incumbent.cost) / max(cost, 1e-9)
        raised = 100.0 * (incumbent.bound - bound) / max(bound, 1e-9)
        took_s = time.perf_counter() - begun
        incumbent.steps.append(Step(chosen.NAME, took_s, size[1], gained, raised))
        _log.debug("%s took %.3f s: cost %.6g, bound %.6g", chosen.NAME, took_s, incumbent.cost, incumbent.bound)
