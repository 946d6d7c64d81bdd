"""Tracks that climb a slope aslant, where a path must follow ground that is steeper than the climb limit.

Under a zone whose floor is a few metres over the lowest legal altitude, nothing else is possible. The shortest track in
the plane ignores this, because whether a slope can be climbed depends on the direction. So where a gap remains between
path and bound, the lattice of reachable altitudes (`routes`) is searched. It covers only tracks that may still be
shorter than the best path's, so its nodes are dense.
"""

from __future__ import annotations

from gcsplan.planners.lattice.routes import Level, Router, climbing_weight
from gcsplan.planners.optimal.plane.corridor import PinnedTrack
from gcsplan.planners.problem import Problem, straight_way_m

NODES = 60_000
"""Nodes of the lattice, about."""


def traverse(problem: Problem, longest_m: float) -> PinnedTrack | None:
    """The best track on a lattice of reachable altitudes that holds tracks of up to about ``longest_m`` metres; None if
    there is none."""
    router = Router.at(problem, Level(max(longest_m / straight_way_m(problem), 1.0), NODES))
    way = router.way(weight=climbing_weight(problem), briefly=True)
    if way is None:
        return None
    track = router.track_of(way)
    return track.points, track.pinned, track.pin_m
