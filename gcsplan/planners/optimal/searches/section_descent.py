"""The best path drawn together: all its points move at once on cross-sections (`profile/cross_sections.py`)."""

from __future__ import annotations

from gcsplan.planners.optimal.loop.search import BAND_FAR, Search, Size
from gcsplan.planners.profile.cross_sections import tightened
from gcsplan.planners.simplify import LAST_GAIN

DESCENT_S = 0.1
LAST_OF_GAP = 0.005
"""Part of the gap that a round of small moves must close, or it is the last."""


class SectionDescent(Search):
    """When a path is known, and again after a better one; under a maximum AGL once, beyond a gap of `BAND_FAR`.
    Remembers nothing."""

    NAME, IMPROVES, SHARE, AGAIN = "section_descent", "paths", 0.1, True

    def is_open(self) -> bool:
        """Under a maximum AGL once; else also after a better path."""
        return (self.seen is None or self.problem.limits.max_agl_m is None) and super().is_open()

    def applies(self) -> bool:
        """Whether a path is known, and under a maximum AGL whether it may be weak."""
        i = self.incumbent
        return i.best is not None and (self.problem.limits.max_agl_m is None or i.gap > BAND_FAR)

    def size(self) -> Size:
        """Some seconds of legs under the exact check."""
        return self.takes(DESCENT_S)

    def run(self) -> None:
        """Draw the best path together."""
        incumbent = self.incumbent
        assert incumbent.best is not None
        points, pinned = tightened(self.problem, incumbent.best)
        incumbent.take_simpler(
            points, pinned, fine=True, longer=False, last_gain=max(LAST_GAIN, LAST_OF_GAP * incumbent.gap)
        )
