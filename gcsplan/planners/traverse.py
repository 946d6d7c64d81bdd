"""Tracks that climb a slope aslant, where what is flown follows the ground closer than the climb limit is steep.

Under a zone whose floor is a few metres over the lowest legal altitude there is no other way. The shortest track of the
plane knows nothing of it: what can be climbed depends on the direction. So where path and bound stay apart, the lattice
of reachable altitudes (`routes`) is searched among all tracks that may still be shorter, which leaves it fine nodes.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.band import pulled
from gcsplan.planners.climb import pins_of
from gcsplan.planners.detours import Stops
from gcsplan.planners.lattice import terminals
from gcsplan.planners.problem import Problem
from gcsplan.planners.routes import LEVELS, Level, Router

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

NODES = 60_000
"""Of the lattice, about."""
LARGEST = 1e9
"""Nodes of the terrain model, at most: the floor over all of it is worked out, so that it can be read anywhere."""


def affordable(problem: Problem) -> bool:
    """Whether the terrain model is not so large that its floor would take longer than what it may be good for."""
    return problem.airspace.surface.ground_m.size <= LARGEST


def traverse(problem: Problem, longest_m: float) -> Stops | None:
    """The best track on a lattice of reachable altitudes among those about as long as ``longest_m`` at most."""
    if not affordable(problem):
        return None
    straight_m = sum(math.dist(a, b) for a, b in pairwise(terminals(problem)))
    energy = problem.objective == "energy"
    router = Router.at(problem, Level(max(longest_m / straight_m, 1.0), NODES))
    way = router.way(weight=problem.vertical_j_per_m / max(problem.horizontal_j_per_m, 1e-9) if energy else 0.0)
    if way is None:
        return None
    track = router.track_of(way)
    return track.points, track.pinned, track.pin_m


def pulled_tight(problem: Problem, points: Floats, level: int, deadline_s: float) -> tuple[Floats, Bools] | None:
    """Way points of a better line than a path's, and which are stops, if one is found before ``deadline_s``; the lines
    around it are those of a ``level`` of lattices."""
    if not affordable(problem):
        return None
    found = pulled(problem, points, LEVELS[level], deadline_s)
    return None if found is None else (found, pins_of(problem, found)[0])
