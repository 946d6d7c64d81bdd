"""Several plans for one vehicle, each with larger margins than the one before, until its mission passes as it is flown.

It is one loop for every aircraft. What differs is an `Attempts`: how often, with which margins, and how a problem
becomes a mission with its verdict.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.app.plan.model import VehiclePlan
from gcsplan.app.plan.problem import unsafe
from gcsplan.check.verdict import Verdict
from gcsplan.errors import NoMission
from gcsplan.mavlink.build.order import Margins
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.notes.note import Finding, Note
from gcsplan.planners.budget import FIRST, FIRST_S, Budget
from gcsplan.planners.problem import Problem, Solution

_log = logging.getLogger(__name__)

SAME_ENDS_M = 1e-6
"""Metres within which two paths end at the same place."""
HEIGHTS = ("min_agl", "max_agl", "max_amsl", "terrain_clearance")

MOST_SLOPE = 0.9
"""The most that is taken from the climb limit, as a part of it; a leg over the ground may be steeper than any path."""

__all__ = ["Attempts", "larger", "on_path", "replanned", "same_ends", "with_bound"]


@dataclass(frozen=True, eq=False, slots=True)
class Attempts:
    """The attempts to plan one kind of aircraft until its mission passes.

    ``most``: plans in all. ``margins``: of the first plan. ``corner_m``: see `larger`. ``fly`` makes a path of a
    problem, and the mission with its verdict, which may break limits. It raises NoMission where there is no path.
    """

    most: int
    margins: Margins
    fly: Callable[[Problem], VehiclePlan]
    corner_m: float = math.inf


def replanned(attempts: Attempts, problem_of: Callable[[Margins], tuple[Problem, tuple[Note, ...]]]) -> VehiclePlan:
    """The first plan whose mission breaks no limit, with the notes on its problem and the best bound of all attempts.

    ``problem_of`` makes the problem that keeps some margins, with notes. Raises InputError, and NoMission: if the first
    attempt finds no path, or with what the last mission breaks.
    """
    margins = attempts.margins
    tried: list[VehiclePlan] = []
    begun_s = time.perf_counter()
    for _ in range(attempts.most):
        try:
            problem, notes = problem_of(margins)
            plan = attempts.fly(_within_budget(problem, tried, begun_s))
        except NoMission:
            if not tried:
                raise
            break  # there is no path with margins this large: report what the last mission broke
        tried.append(plan)
        if not plan.verdict.findings:
            return replace(plan, solution=_of_all(tried), notes=(*notes, *plan.notes))
        findings = on_path(plan.mission, plan.verdict)
        name, broken = plan.request.vehicle.name, ", ".join(sorted({f.kind for f in plan.verdict.findings}))
        _log.info("%s: plan %d of %d breaks %s as it is flown", name, len(tried), attempts.most, broken)
        if not findings:
            break  # larger margins cannot cure a battery, a take-off, a landing or a return
        margins = larger(margins, findings, attempts.corner_m)
    raise unsafe(tried[-1].verdict, tried[-1].request.vehicle)


def on_path(mission: Mission, verdict: Verdict) -> list[Finding]:
    """The findings that another path may cure: not those of wind, battery, take-off, landing and return."""
    items, first = mission.items, mission.first_seq
    flown = {i + first for i, item in enumerate(items) if item.command in (cmd.WAYPOINT, cmd.LOITER_UNLIM)}
    return [f for f in verdict.findings if f.seq in flown and f.kind not in ("battery", "wind")]


def larger(margins: Margins, findings: Sequence[Finding], corner_m: float = math.inf) -> Margins:
    """``margins`` plus what the last mission lacked in height, distance and slope.

    ``corner_m``: metres before a way point at which the vehicle may turn onto the next leg; it cuts the corner by less,
    to the side and up or down. A finding tells only how far inside a zone the vehicle is to the side, so above and
    below zones, too, that much is added; inf for arcs, which are judged as they are flown.
    """
    low_m = max((f.by for f in findings if f.kind in HEIGHTS), default=0.0)
    near_m = max((min(f.by, corner_m) for f in findings if f.kind == "zone"), default=0.0)
    steep = max((f.by / f.limit for f in findings if f.kind in ("climb", "descent")), default=0.0)
    if math.isfinite(corner_m):
        low_m = max(low_m, near_m)
    return replace(
        margins,
        altitude_m=margins.altitude_m + 0.02 + 1.05 * low_m,
        track_m=margins.track_m + 0.03 + 1.05 * near_m,
        bow_m=3.0 * margins.bow_m,
        slope=min(margins.slope + (0.001 + 1.5 * steep if steep else 0.0), MOST_SLOPE),
    )


def _within_budget(problem: Problem, tried: Sequence[VehiclePlan], begun_s: float) -> Problem:
    """The problem of the next attempt: with half the counted work of the last one, so that all together take less than
    twice the first one's. A path whose mission breaks a limit is none: the clock stops them all when it stops a plan
    without a path that began at ``begun_s``."""
    if not tried:
        return problem
    until_s = begun_s + FIRST * problem.budget_s + FIRST_S
    budget = Budget.endless(clocked=problem.budget.clocked, until_s=until_s, clock=problem.budget.clock)
    return replace(problem, budget_s=problem.budget_s * 0.5 ** len(tried), budget=budget)


def _of_all(tried: Sequence[VehiclePlan]) -> Solution:
    """The solution of the last plan, with the best lower bound of the plans that have its ends: all bounds hold under
    the limits of the check, whatever margins the paths keep. Times and searches count all plans."""
    found = [plan.solution for plan in tried]
    first, last = found[0], found[-1]
    if len(found) == 1:
        return last
    alike = [s.lower_bound for s in found if s.lower_bound is not None and same_ends(s, last)]
    last = with_bound(last, max(alike, default=None), tried[-1].problem)
    stopped_by = "time" if "time" in (s.stopped_by for s in found) else last.stopped_by
    return replace(
        last,
        stopped_by=stopped_by,
        planning_s=sum(s.planning_s for s in found),
        first_path_s=first.first_path_s,
        search=tuple(step for s in found for step in s.search),
        notes=(*last.notes, Note("planned_again", times=len(found))),
    )


def with_bound(solution: Solution, bound: float | None, problem: Problem) -> Solution:
    """A solution of ``problem`` with another lower bound; if it is not within the problem's gap, ``gap`` did not end
    the search."""
    near = bound is not None and problem.cost(solution.path) <= bound * (1.0 + problem.gap_percent / 100.0)
    stopped_by = "exhausted" if solution.stopped_by == "gap" and not near else solution.stopped_by
    return replace(solution, lower_bound=bound, stopped_by=stopped_by)


def same_ends(one: Solution, other: Solution) -> bool:
    """Whether the paths of two solutions for the same vias begin and end at the same places and altitudes: then the
    lower bound of either is one of both."""
    a, b = (s.path.points[[0, -1]] for s in (one, other))
    return bool(np.abs(a - b).max() < SAME_ENDS_M)
