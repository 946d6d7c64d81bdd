"""The default planner: the shortest tracks in the plane below an altitude cap, and a bound that holds for every path.

**The idea.** Where nothing but ground, zones and a ceiling is in the way, flying is a question of the plane. Fix an
altitude cap: what ground and zones leave below it are walls in the plane, and the best ground track is the shortest
one between them, which can be found exactly (`polyanya`). Over a given track, floor and ceiling are a tube, and the
best altitude profile is a taut string through it, one pass (`taut_string`). The exact check has the last word.

**The bound.** The same search between walls that *certainly* stand (`grid`: a linear surface that lies nowhere above
the ground) gives a length that no track below the cap can beat. A path is longer than its track, by what it must
climb: between which heights every track that is short enough must be after so many metres is known too, from the
ground and from zones that leave one way past them alone (`climb_bound`). For energy the cap itself is what costs: caps
are searched from both sides until no height between two of them can hold anything better (`cap_search`). Close to the
ends a path can be no higher than it has had way to climb, which moves the walls (`clearance`); and all along its way
only those altitudes between zones can be flown at which can be climbed to, and back from, on a track that is short
enough (`altitude_intervals`). A zone that can be passed over in one place and under in another lies on two sheets of
the plane (`mesh_kernels`).

**What is in the way all the same.** A shortest track may have no profile: from under one zone there may be no time to
climb over the next. Then sides of zones are shut, or laps put in, best first (`detours`). Under a zone a few metres
over the lowest that may be flown one has to follow the ground, and a slope steeper than the climb limit is climbed
aslant: tracks for that are found on a lattice of reachable altitudes (`contour`). A track that has to keep clear of
what is beside it may fit through a notch that the lattice for paths, which knows slopes by their cells, has shut: there
the exact check's own floors are asked, and what they shut is learnt (`Below.dare`, `Relief.learn`). And where the way
of a bound leaves the best path, one along it is looked for, past each stretch that is shut there in a problem of its
own, whose cells are a metre or two wide (`bound_corridor`).

**Where that does not hold**, under a maximum AGL, or where the climb limit binds far from the ends, the ways are
searched on a lattice of reachable altitudes (`lattice.planner`); the bound of the plane is true there as well. In
worlds as high as they are wide, where paths below one cap are not the shortest, ways are searched in space
(`roadmap_3d`); in worlds of a few dozen cells, where a slit or a pass may be narrower than every lattice, between few
places that matter (`local_roadmap`).
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcsplan.errors import NoMission
from gcsplan.planners.lattice.lattice import terminals
from gcsplan.planners.lattice.planner import plan_band
from gcsplan.planners.optimal.bounds.refine import tighten
from gcsplan.planners.optimal.incumbent import FAR, Below
from gcsplan.planners.optimal.window import plan_over
from gcsplan.planners.problem import Problem, Solution
from gcsplan.planners.refusal import Refusal, check_ends, explain
from gcsplan.world.path import Path

Floats = NDArray[np.float64]

MUCH = 0.05
"""Gap, as a part, beyond which small worlds are searched for a better path before time is spent on a closer bound."""

TURNS_NOTE = "the lower bound is that of paths with sharp corners: it ignores turn_radius_m"
BAND_NOTE = "the lower bound knows ground, zones and ceilings, but not the room between min and max AGL"


def plan(problem: Problem) -> Solution:
    """A path from start to goal that `Airspace.examine` passes, and a cost that no such path can beat.

    The first path is found at once, then path and bound are improved until they are ``gap_percent`` apart, or nothing
    more is known to do. Deterministic: stops on counted work; ``budget_s`` is a backstop. With ``turn_radius_m`` the
    path's points are way points to be flown by, on arcs of that radius, and it is the flown track that is legal.
    Raises Refusal (a NoMission) that names the binding constraint where no path is found, and says whether that is
    proved.
    """
    return plan_over(problem, _within)


def _within(problem: Problem) -> Solution:
    """The same over the problem's surface alone."""
    begun = time.perf_counter()
    if problem.turn_radius_m > 0.0:
        return _turning(problem, begun)
    return _sharp(problem, begun)


def _sharp(problem: Problem, begun: float, laps: bool = True) -> Solution:
    check_ends(problem)
    below = Below(problem, begun, laps)
    tell = below.tell
    tell("search")
    if not below.legs:
        return plan_band(problem, tell, begun)
    if problem.limits.max_agl_m is not None:
        if math.isinf(below.bound_of_tracks()):
            raise explain(problem, proved=True)
        found = plan_band(problem, tell, begun)
        bound = max(below.bound, found.lower_bound or 0.0)
        near = problem.cost(found.path) - bound <= problem.gap_percent / 100.0 * bound
        return replace(
            found,
            lower_bound=min(bound, problem.cost(found.path)),
            stopped_by="gap" if near else found.stopped_by,
            notes=() if near else (BAND_NOTE,),
        )
    below.look()
    if below.proved_shut:
        raise explain(problem, proved=True)
    asked = below.best is None
    if asked:
        try:
            below.take(plan_band(problem, tell, begun).path.points)
        except Refusal as refusal:
            if refusal.reason == "infeasible" or not below.search_small():
                raise
    below.search_space()
    below.search_small(MUCH)
    tighten(below)
    apart = not asked and below.gap > FAR
    if apart and below.in_time() and (problem.objective == "energy" or below.in_space):
        # Where climbing is dear, or the world is as high as wide, the best track may not be the shortest below any cap.
        try:
            better = below.take(plan_band(problem, tell, begun, known=True).path.points)
        except Refusal:
            better = False
        if better:
            tighten(below)
    if below.search_small():
        tighten(below)
    return below.solution()


def _turning(problem: Problem, begun: float) -> Solution:
    """A path with sharp corners, laid on arcs; with more room around it where that is needed."""
    from gcsplan.planners.turns.planner import roomier, rounded  # few missions have wings

    # Laps are short and have sharp corners: what they gain is lost again on the arcs.
    sharp = _sharp(replace(problem, turn_radius_m=0.0), begun, laps=False)
    points = sharp.path.points

    def replan(extra_m: float) -> tuple[Floats, NDArray[np.bool_]] | None:
        try:
            again = _sharp(roomier(problem, extra_m), begun, laps=False).path.points
        except NoMission:
            return None
        return again, _stops(problem, again)

    found = rounded(problem, points, _stops(problem, points), replan)
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
        planning_s=time.perf_counter() - begun,
        notes=(*sharp.notes, TURNS_NOTE),
    )


def _stops(problem: Problem, points: Floats) -> NDArray[np.bool_]:
    """Which points of a path are its ends and vias."""
    stops = np.array(terminals(problem))
    away = np.hypot(*(points[:, None, :2] - stops[None]).transpose(2, 0, 1)).min(axis=1)
    return np.asarray(away < 1e-3)
