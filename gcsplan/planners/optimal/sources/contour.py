"""Tracks that climb a slope aslant, where what is flown follows the ground closer than the climb limit is steep.

Under a zone whose floor is a few metres over the lowest legal altitude there is no other way. The shortest track of the
plane knows nothing of it: what can be climbed depends on the direction. So where path and bound stay apart, the lattice
of reachable altitudes (`routes`) is searched among all tracks that may still be shorter, which leaves it fine nodes.
"""

from __future__ import annotations

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.lattice.planner import pulled
from gcsplan.planners.lattice.routes import LEVELS, Level, Router, climbing_weight
from gcsplan.planners.optimal.corridor import PinnedTrack
from gcsplan.planners.problem import Problem, straight_way_m
from gcsplan.planners.profile.climb_laps import pins_of

NODES = 60_000
"""Of the lattice, about."""


def traverse(problem: Problem, longest_m: float) -> PinnedTrack | None:
    """The best track on a lattice of reachable altitudes among those about as long as ``longest_m`` at most."""
    router = Router.at(problem, Level(max(longest_m / straight_way_m(problem), 1.0), NODES))
    way = router.way(weight=climbing_weight(problem) if problem.objective == "energy" else 0.0)
    if way is None:
        return None
    track = router.track_of(way)
    return track.points, track.pinned, track.pin_m


def pulled_tight(problem: Problem, points: Floats, level: int, deadline_s: float) -> tuple[Floats, Bools] | None:
    """Way points of a better line than a path's, and which are terminals, if one is found before ``deadline_s``; the
    lines around it are those of a ``level`` of lattices."""
    found = pulled(problem, points, LEVELS[level], deadline_s)
    return None if found is None else (found, pins_of(problem, found)[0])
