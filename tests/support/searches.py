"""Run the default planner's searches one by one: lattices of the legs, first paths, and all later searches."""

from __future__ import annotations

from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal.governor import govern
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch
from gcsplan.planners.optimal.table import Searches
from gcsplan.planners.problem import Problem


def spent_budget() -> Budget:
    """A budget of which nothing is left."""
    budget = Budget(0.0, 100.0)
    budget.found_first()
    return budget


def plane_of(problem: Problem) -> PlaneSearch:
    """Lattices over a problem's legs, with an incumbent that has no path and no bound yet."""
    return PlaneSearch(Incumbent(problem))


def looked(problem: Problem) -> PlaneSearch:
    """`plane_of` a problem, after the search for a first path below the ceiling."""
    plane = plane_of(problem)
    for _ in plane.first_looks():
        pass
    return plane


def improve(plane: PlaneSearch, without: tuple[str, ...] = ()) -> None:
    """Run all searches, except those named in ``without``, over these lattices."""
    searches = Searches(plane.incumbent)
    searches.plane = plane
    govern(plane.incumbent, searches.table(), without)
