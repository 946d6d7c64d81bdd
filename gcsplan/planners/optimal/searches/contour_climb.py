"""The best track of a lattice of reachable altitudes, with laps where it is too steep.

Under a zone whose floor is a few metres over the lowest legal altitude, a slope that is steeper than the climb limit
must be climbed aslant. The shortest track in the plane ignores this, because whether a slope can be climbed depends on
the direction. So where a gap remains between path and bound, the lattice of reachable altitudes (`lattice/routes.py`)
is searched for one track.
"""

from __future__ import annotations

from gcsplan.planners.lattice.routes import LatticeSize, Router, climbing_weight
from gcsplan.planners.optimal.loop.search import FAR, Search, Size
from gcsplan.planners.optimal.plane.corridor import PinnedTrack
from gcsplan.planners.problem import Problem, straight_way_m

NODES = 60_000
"""Nodes of the lattice, about."""


class ContourClimb(Search):
    """Once, with climb limits, beyond a gap of `FAR`. Remembers nothing."""

    NAME, IMPROVES, SHARE = "contour_climb", "paths", 0.075

    def applies(self) -> bool:
        """Whether there are climb limits, and a path that is far from the bound."""
        i = self.incumbent
        return i.best is not None and i.gap > FAR and i.climbs and self.problem.limits.max_agl_m is None

    def size(self) -> Size:
        """Eight passes over the lattices."""
        return self.work.plane.size(8.0)

    def run(self) -> None:
        """Look for a path over the best track."""
        plane = self.work.plane
        if plane.reach_longest() and (found := traverse(self.problem, plane.longest())) is not None:
            self.incumbent.take_longer(found, fine=True)


def traverse(problem: Problem, longest_m: float) -> PinnedTrack | None:
    """The best track that climbs a slope aslant. The lattice covers only tracks of up to about ``longest_m`` metres,
    which may still be shorter than the best path's, so its nodes are dense. None if there is no track."""
    router = Router.at(problem, LatticeSize(max(longest_m / straight_way_m(problem), 1.0), NODES))
    way = router.way(weight=climbing_weight(problem), briefly=True)
    if way is None:
        return None
    track = router.track_of(way)
    return track.points, track.pinned, track.pin_m
