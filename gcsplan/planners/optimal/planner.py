"""The default planner: the shortest tracks in the plane below an altitude cap, and a bound that holds for every path.

**The idea.** Where nothing but ground, zones and a ceiling is in the way, flying is a question of the plane. Fix an
altitude cap: what ground and zones leave below it are walls in the plane, and the best ground track is the shortest
one between them, which can be found exactly (`polyanya`): around the zones' own outlines (`outline_tracks`), and on a
lattice of the terrain model's cells (`plane_search`). Over a given track, floor and ceiling are a tube, and the best
altitude profile is a taut string through it, one pass (`taut_string`). The exact check has the last word.

**The bound.** The same search between walls that *certainly* stand (outlines inside the zones; a linear surface that
lies nowhere above the ground) gives a length that no track below the cap can beat. A path is longer than its track, by
what it must climb: between which heights every track that is short enough must be after so many metres is known too
(`climb_bound`). For energy the cap itself is what costs: caps are searched from both sides until no height between two
of them can hold anything better (`cap_search`). Close to the ends a path can be no higher than it has had track to
climb, which moves the walls (`clearance`); and all along only those altitudes between zones can be flown at which can
be climbed to, and back from, on a track that is short enough (`altitude_intervals`).

**Where that does not hold**, under a maximum AGL, or where the climb limit binds far from the ends, paths are searched
on a lattice of reachable altitudes (`lattice`); the bound of the plane is true there as well.

All of these are searches that the governor chooses among (`governor`); `searches` is the table of them.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.errors import NoMission
from gcsplan.planners.budget import Budget
from gcsplan.planners.lattice.planner import plan_band
from gcsplan.planners.optimal.governor import govern
from gcsplan.planners.optimal.incumbent import Incumbent
from gcsplan.planners.optimal.searches import Searches, left_out
from gcsplan.planners.optimal.window import plan_over
from gcsplan.planners.problem import Problem, Refusal, Solution, terminals_of
from gcsplan.planners.refusal import check_ends, explain
from gcsplan.world.path import Path

TURNS_NOTE = "the lower bound is that of paths with sharp corners: it ignores turn_radius_m"
BAND_NOTE = "the lower bound knows ground, zones and ceilings, but not the room between min and max AGL"


def plan(problem: Problem) -> Solution:
    """A path from start to goal that `Airspace.examine` passes, and a cost that no such path can beat.

    The first path is found at once, then path and bound are improved until they are ``gap_percent`` apart, the budget
    is spent, or nothing more is known to do. Deterministic: stops on counted work; the clock is a last stop. With
    ``turn_radius_m`` the path's points are way points to be flown by, on arcs of that radius, and it is the flown track
    that is legal. ``options``: ``without``, names of searches to do without. Raises Refusal (a NoMission) that names
    the binding constraint where no path is found, and says whether that is proved.
    """
    problem = replace(problem, budget=Budget(problem.budget_s, problem.budget_mb))
    return plan_over(problem, _within)


def _within(problem: Problem) -> Solution:
    """The same over the problem's surface alone."""
    if problem.turn_radius_m > 0.0:
        return _turning(problem)
    return _sharp(problem)


def search(problem: Problem, laps: bool = True) -> Searches:
    """Everything that is known about the best path of a problem, and where it was looked for."""
    incumbent = Incumbent(problem, laps)
    incumbent.tell("search")
    searches = Searches(incumbent)
    govern(incumbent, searches.table(), left_out(problem))
    return searches


def _sharp(problem: Problem, laps: bool = True) -> Solution:
    check_ends(problem)
    if all(math.dist(terminals_of(problem)[0], x) < 1e-3 for x in terminals_of(problem)):
        return plan_band(problem, Incumbent(problem).tell, problem.budget.begun_s)  # a climb on the spot
    searches = search(problem, laps)
    incumbent = searches.incumbent
    if incumbent.best is None:
        raise explain(problem, proved=True if incumbent.proved_infeasible else None)
    found = incumbent.solution()
    if problem.limits.max_agl_m is not None and found.stopped_by != "gap":
        found = replace(found, notes=(BAND_NOTE,))
    return found


def _turning(problem: Problem) -> Solution:
    """A path with sharp corners, laid on arcs; with more room around it where that is needed."""
    from gcsplan.planners.turns.planner import rounded, with_more_clearance  # few missions have wings

    # Laps are short and have sharp corners: what they gain is lost again on the arcs.
    sharp = _sharp(replace(problem, turn_radius_m=0.0), laps=False)
    points = sharp.path.points

    def replan(extra_m: float) -> tuple[Floats, NDArray[np.bool_]] | None:
        try:
            again = _sharp(with_more_clearance(problem, extra_m), laps=False).path.points
        except NoMission:
            return None
        return again, _terminals(problem, again)

    found = rounded(problem, points, _terminals(problem, points), replan)
    if found is None:
        raise Refusal(
            f"a path with sharp corners was found, but none was whose arcs of turn_radius_m {problem.turn_radius_m:g} "
            f"keep the limits: allow tighter turns, or move what is in the way",
            reason="not_found",
        )
    near = sharp.lower_bound is not None and found.cost <= sharp.lower_bound * (1.0 + problem.gap_percent / 100.0)
    return replace(
        sharp,
        path=Path(found.way_points),
        flown=Path(found.flown),
        stopped_by=sharp.stopped_by if near or sharp.stopped_by == "time" else "exhausted",
        planning_s=time.perf_counter() - problem.budget.begun_s,
        notes=(*sharp.notes, TURNS_NOTE),
    )


def _terminals(problem: Problem, points: Floats) -> NDArray[np.bool_]:
    """Which points of a path are its ends and vias."""
    terminals = np.array(terminals_of(problem))
    away = np.hypot(*(points[:, None, :2] - terminals[None]).transpose(2, 0, 1)).min(axis=1)
    return np.asarray(away < 1e-3)
