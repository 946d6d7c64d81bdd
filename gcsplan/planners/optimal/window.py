"""Planning over a window of the terrain, and over more of it where the window's border is what binds.

A bound, or a proof that there is no path, is found for paths within the window. It holds for all paths over the terrain
that the mission knows if those that leave the window cost no less, which the way to its border and back tells. Where it
does not, more terrain is looked at, until memory, time or the terrain ends; then the bound is that of the paths that
leave, and a refusal says how far was looked.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gcsplan.planners.border import enclosed, exit_cost, goes_on, margin_for, within_m
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution
from gcsplan.planners.refusal import NoPath, check_ends
from gcsplan.world.airspace import Legs

Window = Callable[[Problem], Solution]

MOST_WINDOWS = 12
"""Each is twice as wide as the one before at least: the last is wider than a frame can be."""


def plan_over(problem: Problem, plan_window: Window) -> Solution:
    """What ``plan_window`` finds over the problem's surface, with a bound for all terrain; over more of it where paths
    beyond the border could be better by more than the wanted gap, or where there are none within.

    ``plan_window`` raises what `refusal.explain` gives where there is no path. The solution's ``problem`` is that of
    the window its path was found in. Raises Refusal.
    """
    begun = time.perf_counter()
    best: Solution | None = None
    refused: NoPath | None = None
    now = problem
    for _ in range(MOST_WINDOWS):
        leaving = exit_cost(now)
        asked = replace(now, progress=_reported(now, begun, leaving))
        try:
            found = plan_window(asked)
        except NoPath as no_path:
            refused = no_path
            if best is not None or not goes_on(now) or (no_path.reason == "infeasible" and enclosed(now)):
                break
        except Refusal:
            if best is None:
                raise
            break
        else:
            refused = None
            found = held_to_border(now, found, leaving)
            best = better(now, best, found if now is problem else replace(found, problem=now))
            if best.problem is not (None if now is problem else now) or not binds(now, best, leaving):
                break
        if not problem.budget.goes_on():
            best = best if best is None or not problem.budget.clocked_out else replace(best, stopped_by="time")
            break
        wider = widened(now, math.inf if best is None else now.cost(best.path))
        if wider is None:
            break
        now = wider
    if best is None:
        assert refused is not None
        raise refused
    return replace(best, planning_s=time.perf_counter() - begun)


def _reported(now: Problem, begun: float, leaving: float) -> Callable[[Progress], None] | None:
    """Where progress is reported, if anywhere: seconds since ``begun``, and bounds that hold beyond the border too."""
    report = now.progress
    if report is None:
        return None

    def held(said: Progress) -> None:
        bound = None if said.lower_bound is None else min(said.lower_bound, leaving)
        report(replace(said, elapsed_s=time.perf_counter() - begun, lower_bound=bound))

    return held


def widened(now: Problem, cost: float) -> Problem | None:
    """The same problem over terrain that paths of up to ``cost`` lie within; None where there is none to be had."""
    if now.widen is None or not goes_on(now):
        return None
    wide = now.widen(margin_for(now, cost), now.budget_mb)
    if wide is None:
        return None
    ends = [_end(old, new) for old, new in ((now.start, wide.start), (now.goal, wide.goal))]
    wide = replace(now, airspace=wide.airspace, limits=wide.limits, start=ends[0], goal=ends[1], widen=wide.widen)
    try:
        check_ends(wide)
    except Refusal:  # an end that is legal by a hair here is not there
        return None
    return wide


def _end(old: tuple[float, float, float], new: tuple[float, float, float]) -> tuple[float, float, float]:
    """An end in a wider window, where the ground may lie elsewhere by as much as its map to the plane is off."""
    same = math.dist(old[:2], new[:2]) < 1e-3 and new[2] - old[2] < 0.1
    return (*old[:2], max(old[2], new[2])) if same else old


def held_to_border(problem: Problem, found: Solution, leaving: float) -> Solution:
    """``found`` with the bound that holds for paths which leave the surface, too, and cost ``leaving`` at least."""
    if found.lower_bound is None or found.lower_bound <= leaving:
        return found
    cost = problem.cost(found.path)
    near = cost - leaving <= problem.gap_percent / 100.0 * leaving
    if near:
        return replace(found, lower_bound=leaving)
    note = (
        f"the terrain was looked at within {within_m(problem) / 1000.0:.1f} km of the straight way: the lower bound is "
        "that of paths which go farther"
    )
    stopped = "exhausted" if found.stopped_by == "gap" else found.stopped_by
    return replace(found, lower_bound=leaving, stopped_by=stopped, notes=(*found.notes, note))


def binds(problem: Problem, found: Solution, leaving: float) -> bool:
    """Whether the bound is that of paths which leave the surface, and too low."""
    if found.lower_bound is None:
        return False
    return found.lower_bound >= leaving and problem.cost(found.path) - leaving > problem.gap_percent / 100.0 * leaving


def better(now: Problem, best: Solution | None, found: Solution) -> Solution:
    """The better of two paths, the other one found over less terrain; in the wider world if it is legal there."""
    if best is None or now.cost(found.path) <= now.cost(best.path):
        return found
    points, limits = best.path.points, now.limits
    ends = np.abs(points[[0, -1]] - np.array([now.start, now.goal])).max()
    if best.flown is None and ends < 1e-6 and not now.airspace.examine(Legs.of_path(points, limits), limits).violations:
        cost = now.cost(best.path)
        near = found.lower_bound is not None and cost <= found.lower_bound * (1.0 + now.gap_percent / 100.0)
        return replace(found, path=best.path, stopped_by="gap" if near else found.stopped_by)
    return best
