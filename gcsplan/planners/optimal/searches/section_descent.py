"""The best path drawn together: all its points move at once on cross-sections (`profile/cross_sections.py`)."""

from __future__ import annotations

from gcsplan.planners.optimal.loop.search import Search, Size
from gcsplan.planners.profile.cross_sections import tightened

DESCENT_S = 0.1


class SectionDescent(Search):
    """When a path is known, and again after a better one. Remembers nothing."""

    NAME, IMPROVES, SHARE, AGAIN = "section_descent", "paths", 0.1, True

    @property
    def share(self) -> float:
        """Under a maximum AGL, paths of a lattice have much to gain."""
        return self.SHARE if self.problem.limits.max_agl_m is None else 0.9

    def applies(self) -> bool:
        """Whether a path is known."""
        return self.incumbent.best is not None

    def size(self) -> Size:
        """Some seconds of legs under the exact check."""
        return self.takes(DESCENT_S)

    def run(self) -> None:
        """Draw the best path together."""
        incumbent = self.incumbent
        assert incumbent.best is not None
        points, pinned = tightened(self.problem, incumbent.best)
        incumbent.take_simpler(points, pinned, fine=True, longer=False)
