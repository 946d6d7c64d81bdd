"""Run the default planner's searches one by one: lattices of the legs, first paths, and all later searches."""

from __future__ import annotations

from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal.loop.governor import govern
from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch
from gcsplan.planners.optimal.searches.cap_search import CapSearch
from gcsplan.planners.optimal.table import all_searches
from gcsplan.planners.problem import Objective, Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Zone
from tests.support.planner_worlds import ground


def over_flat(*zones: Zone, max_agl_m: float | None = None, objective: Objective = "length") -> Problem:
    """From west to east over level ground, 1400 m; the shortest way leads through (1000, 1000)."""
    limits = Limits(10.0, max_agl_m=max_agl_m)
    return Problem(
        Airspace(ground(0.0), zones), limits, (300.0, 1000.0, 50.0), (1700.0, 1000.0, 50.0), objective=objective
    )


def spent_budget() -> Budget:
    """A budget of which nothing is left."""
    budget = Budget(0.0, 100.0)
    budget.found_first()
    return budget


def work_of(problem: Problem) -> Workspace:
    """A workspace over the problem's own cells, with an incumbent that has no path and no bound yet."""
    return Workspace(Incumbent(problem))


def plane_of(problem: Problem) -> PlaneSearch:
    """Lattices over a problem's legs, with an incumbent that has no path and no bound yet."""
    return work_of(problem).plane


def looked(problem: Problem) -> Workspace:
    """`work_of` a problem, after the search for a first path below the ceiling."""
    work = work_of(problem)
    CapSearch(work).run()
    return work


def improve(work: Workspace, without: tuple[str, ...] = ()) -> None:
    """Run all searches, except the ones named in ``without``."""
    govern(work.incumbent, [search for search in all_searches(work) if search.NAME not in without])
