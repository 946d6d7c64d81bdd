"""A* over reachable altitudes, for a maximum AGL and where climb limits bind far from the ends (`planners/lattice`)."""

from __future__ import annotations

from dataclasses import replace

from gcsplan.planners.lattice.planner import cheaper, plan_band
from gcsplan.planners.optimal.loop.search import BAND_FAR, FAR, OF_REST, WIDE, Search, Size
from gcsplan.planners.problem import Refusal

EARLY_OF_REST = 0.25
"""Part of the counted work left that it may take before others have tried to close a large gap."""


class LatticeSearch(Search):
    """If no path is known, and once more beyond a gap of `FAR`, under a maximum AGL of `BAND_FAR`. Where path and bound
    are far apart it finds other valleys; else it gains little, and takes long. Remembers nothing."""

    NAME, IMPROVES, SHARE, ANEW = "lattice", "paths", 0.02, True
    FIRST, FAR_APART, BAND = (0.5, 1.0), (0.25, 0.3), (0.9, 0.5)
    """Shares and counted seconds: without a path, beyond a gap of `WIDE`, under a maximum AGL."""

    @property
    def share(self) -> float:
        """By the limits, and by whether a path is known."""
        return self._worth[0]

    @property
    def _worth(self) -> tuple[float, float]:
        if self.problem.limits.max_agl_m is not None:
            return self.BAND
        if self.incumbent.best is None:
            return self.FIRST
        return self.FAR_APART if self.incumbent.gap > WIDE else (self.SHARE, self.FAR_APART[1])

    def applies(self) -> bool:
        """Whether no path is known, or the gap is large."""
        i, far = self.incumbent, FAR if self.problem.limits.max_agl_m is None else BAND_FAR
        return i.best is None or i.gap > far

    def size(self) -> Size:
        """Its work is not known before; it gets a part of the rest."""
        return self.takes(self._worth[1])

    def run(self) -> None:
        """Look for a path, or for a better one."""
        incumbent = self.incumbent
        if incumbent.best is not None:
            with incumbent.budget.allow(OF_REST if incumbent.gap <= WIDE else EARLY_OF_REST):
                found = cheaper(self.problem, incumbent.tell, incumbent.best, self.work.plane.longest())
            if found is not None:
                incumbent.take(found)
            return
        # A line that is pulled to climb less may become illegal where a shorter one is not.
        shorter = [] if self.problem.rates is None else [replace(self.problem, objective="length")]
        for problem in [self.problem, *shorter]:
            try:
                found = plan_band(problem, incumbent.tell)
            except Refusal:
                continue
            incumbent.take(found)
            return
