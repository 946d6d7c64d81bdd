"""The default planner's searches, run by hand: lattices of the legs, first paths, and everything that comes after."""

from __future__ import annotations

from gcsplan.planners.optimal.governor import govern
from gcsplan.planners.optimal.incumbent import Incumbent
from gcsplan.planners.optimal.plane_search import PlaneSearch
from gcsplan.planners.optimal.searches import Searches
from gcsplan.planners.problem import Problem


def plane_of(problem: Problem) -> PlaneSearch:
    """Lattices over a problem's legs, and an incumbent that knows nothing yet."""
    return PlaneSearch(Incumbent(problem))


def looked(problem: Problem) -> PlaneSearch:
    """The same after the search for a first path below the ceiling."""
    plane = plane_of(problem)
    for _ in plane.first_looks():
        pass
    return plane


def improve(plane: PlaneSearch, without: tuple[str, ...] = ()) -> None:
    """All searches, over these lattices."""
    searches = Searches(plane.incumbent)
    searches._plane = plane
    govern(plane.incumbent, searches.table(), without)
