"""A bound for worlds whose zones can be passed over: around each, or over it with the whole climb, case by case; and a
path along the way of that bound (`plane/overflight.py`)."""

from __future__ import annotations

import contextlib

import numpy as np

from gcsplan.planners.optimal.loop.search import Search, Size
from gcsplan.planners.optimal.navmesh.portals import Exhausted

CASE_S, MEGABYTES = 5e-3, 60.0
"""Counted seconds of a case, and megabytes of all."""


class OutlineBound(Search):
    """After `outlines`, and again after a better path. Remembers nothing."""

    NAME, IMPROVES, SHARE, AGAIN = "outline_bound", "paths, bounds", 0.9, True

    def applies(self) -> bool:
        """Whether there are zones that can be passed over, and not under; under a maximum AGL `sections` has higher
        bounds."""
        known = self.incumbent.best is not None and self.problem.limits.max_agl_m is None
        return known and self._zones() > 0

    def size(self) -> Size:
        """By the number of such zones."""
        from gcsplan.planners.optimal.plane.overflight import MOST_CASES  # shapely: many missions need none

        return CASE_S * (1 + min(self._zones(), MOST_CASES)), MEGABYTES

    def run(self) -> None:
        """Look at all cases."""
        from gcsplan.planners.optimal.plane.overflight import Overflight  # shapely: many missions need none

        with contextlib.suppress(Exhausted):
            Overflight(self.incumbent, self.work.outlines()).look()

    def _zones(self) -> int:
        """How many zones can be passed over, and not under, once `outlines` has looked at them."""
        outlines = self.work.known_outlines
        return 0 if outlines is None else int(np.count_nonzero(outlines.over & ~outlines.under))
