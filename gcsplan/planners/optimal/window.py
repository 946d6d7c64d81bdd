"""Planning over a window of the terrain, and over a larger one where the window's border limits the result.

A bound, or a proof that there is no path, is found for paths within the window. It holds for all paths over the
mission's terrain if paths that leave the window cost at least as much; the track to the border and on to the goal gives
their least cost. Otherwise more terrain is loaded, until memory, time or the terrain ends. Then the bound is the least
cost of the paths that leave, and a refusal gives the distance from the straight track to which terrain was searched.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gcsplan.notes.note import Note
from gcsplan.planners.border import enclosed, exit_cost, goes_on, margin_for, within_m
from gcsplan.planners.problem import PlanFunction, Problem, Progress, Refusal, Solution
from gcsplan.planners.refusal.explain import NoPath, check_ends
from gcsplan.world.airspace import Legs

MOST_WINDOWS = 12
"""Most windows of one plan. Each is at least twice as wide as the one before, so the last is wider than any frame."""


def plan_over(problem: Problem, plan_window: PlanFunction) -> Solution:
    """The solution of ``plan_window`` over the problem's surface, with a bound for all terrain. Plans over more terrain
    if paths beyond the border could be better by more than the requested gap, or if there are none within it.

    ``plan_window`` raises the refusal of `refusal.explain` if it finds no path. The solution's ``problem`` is the
    window's problem; None for the first window. Raises Refusal.
    """
    begun = time.perf_counter()
    best: Solution | None = None
    refused: NoPath | None = None
    now, widest = problem, problem.widen is None
    for _ in range(MOST_WINDOWS):
        leaving = exit_cost(now)
        window = replace(now, progress=_reported(now, begun, leaving), leaving=math.inf if widest else leaving)
        try:
            found = plan_window(window)
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
        if wider is None and (widest or best is None):
            break
        now, widest = wider or now, wider is None  # without more terrain, this window is searched to the end
    if best is None:
        assert refused is not None
        raise refused
    return replace(best, planning_s=time.perf_counter() - begun)


def _reported(now: Problem, begun: float, leaving: float) -> Callable[[Progress], None] | None:
    """The problem's ``progress``, if any, with seconds since ``begun`` and bounds that hold beyond the border, too,
    and for ends that are rounded."""
    report = now.progress
    if report is None:
        return None

    rounding = now.rounding()

    def held(state: Progress) -> None:
        bound = None if state.lower_bound is None else rounding.bound(min(state.lower_bound, leaving))
        report(replace(state, elapsed_s=time.perf_counter() - begun, lower_bound=bound))

    return held


def widened(now: Problem, cost: float) -> Problem | None:
    """The same problem over terrain that contains all paths of up to ``cost``; None if no more can be loaded, or if an
    end is not legal there."""
    if now.widen is None or not goes_on(now):
        return None
    wide = now.widen(margin_for(now, cost), now.budget_mb)
    if wide is None:
        return None
    ends = [_end(old, new) for old, new in ((now.start, wide.start), (now.goal, wide.goal))]
    wide = replace(
        now, airspace=wide.airspace, limits=wide.limits, checked=wide.checked, start=ends[0], goal=ends[1],
        widen=wide.widen,
    )  # fmt: skip
    try:
        check_ends(wide)
    except Refusal:  # an end that is barely legal here may not be legal there
        return None
    return wide


def _end(old: tuple[float, float, float], new: tuple[float, float, float]) -> tuple[float, float, float]:
    """An end in a wider window: the old place, at the higher of both altitudes, if it moved by less than 1 mm and rises
    by less than 0.1 m; else the new one. The windows' maps to the plane differ, so the ground under an end may, too."""
    same = math.dist(old[:2], new[:2]) < 1e-3 and new[2] - old[2] < 0.1
    return (*old[:2], max(old[2], new[2])) if same else old


def held_to_border(problem: Problem, found: Solution, leaving: float) -> Solution:
    """``found`` with a bound that also holds for paths that leave the surface, which cost at least ``leaving``."""
    if found.lower_bound is None or found.lower_bound <= leaving:
        return found
    cost = problem.cost(found.path)
    near = cost - leaving <= problem.gap_percent / 100.0 * leaving
    if near:
        return replace(found, lower_bound=leaving)
    note = Note("bound_of_farther_paths", within_m=within_m(problem))
    stopped = "exhausted" if found.stopped_by == "gap" else found.stopped_by
    return replace(found, lower_bound=leaving, stopped_by=stopped, notes=(*found.notes, note))


def binds(problem: Problem, found: Solution, leaving: float) -> bool:
    """Whether paths that leave the surface set the bound, and the gap is larger than requested because of them."""
    if found.lower_bound is None:
        return False
    return found.lower_bound >= leaving and problem.cost(found.path) - leaving > problem.gap_percent / 100.0 * leaving


def better(now: Problem, best: Solution | None, found: Solution) -> Solution:
    """The better of two solutions: ``found`` over the present terrain, or ``best`` over less terrain. If the path of
    ``best`` is cheaper, it is returned with the bound of ``found`` if it is legal here; else with its own if it is
    cheaper by more than the requested gap."""
    if best is None or now.cost(found.path) <= now.cost(best.path):
        return found
    points, limits = best.path.points, now.limits
    ends = np.abs(points[[0, -1]] - np.array([now.start, now.goal])).max()
    if best.flown is None and ends < 1e-6 and not now.airspace.examine(Legs.of_path(points, limits), limits).violations:
        cost = now.cost(best.path)
        near = found.lower_bound is not None and cost <= found.lower_bound * (1.0 + now.gap_percent / 100.0)
        return replace(found, path=best.path, stopped_by="gap" if near else found.stopped_by)
    little = now.gap_percent / 100.0
    return found if now.cost(found.path) <= now.cost(best.path) * (1.0 + little) else best
