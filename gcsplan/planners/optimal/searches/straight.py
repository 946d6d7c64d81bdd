"""The straight track with a taut profile, which is the best path if it is legal."""

from __future__ import annotations

from gcsplan.planners.optimal.loop.search import Search, Size
from gcsplan.planners.profile.exact import Unsettled
from gcsplan.planners.profile.track import Flown

STRAIGHT_S = 2e-3
"""Counted seconds of the straight track: less than anything else takes, so that it is the first."""


class Straight(Search):
    """Once, before all others. Remembers nothing."""

    NAME, IMPROVES, SHARE = "straight", "paths", 1.0

    def applies(self) -> bool:
        """Always."""
        return True

    def size(self) -> Size:
        """A few legs."""
        return self.takes(STRAIGHT_S)

    def run(self) -> None:
        """Take the path over the straight track if the exact check passes it."""
        track, flown = self.work.straight
        if isinstance(flown, Flown) and not isinstance(found := self.incumbent.exact(track, flown), Unsettled):
            self.incumbent.take(*found)
