"""Several plans for one vehicle, each with larger margins than the one before: their budgets, and what is reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcsplan.notes.note import Note
from gcsplan.planners.budget import FIRST, FIRST_S, Budget
from gcsplan.planners.problem import Problem, Solution

SAME_M = 1e-6
"""Metres within which two paths end at the same place."""

__all__ = ["of_all", "same_ends", "with_bound", "within_budget"]


def within_budget(problem: Problem, tried: Sequence[Solution], begun_s: float) -> Problem:
    """The problem of the next attempt: with half the counted work of the last one, so that all together take less than
    twice the first one's. A path whose mission breaks a limit is none: the clock stops them all when it stops a plan
    without a path that began at ``begun_s``."""
    if not tried:
        return problem
    until_s = begun_s + FIRST * problem.budget_s + FIRST_S
    budget = Budget.endless(clocked=problem.budget.clocked, until_s=until_s, clock=problem.budget.clock)
    return replace(problem, budget_s=problem.budget_s * 0.5 ** len(tried), budget=budget)


def of_all(tried: Sequence[Solution], problem: Problem) -> Solution:
    """The last of some solutions, with the best lower bound of those that have its ends: all of them hold under the
    limits of the check, whatever margins the paths keep.

    ``problem``: that of the last one. Times and searches are those of all.
    """
    first, last = tried[0], tried[-1]
    if first is last:
        return last
    alike = [s.lower_bound for s in tried if s.lower_bound is not None and same_ends(s, last)]
    last = with_bound(last, max(alike, default=None), problem)
    stopped_by = "time" if "time" in (s.stopped_by for s in tried) else last.stopped_by
    return replace(
        last,
        stopped_by=stopped_by,
        planning_s=sum(s.planning_s for s in tried),
        first_path_s=first.first_path_s,
        search=tuple(step for s in tried for step in s.search),
        notes=(*last.notes, Note("planned_again", times=len(tried))),
    )


def with_bound(solution: Solution, bound: float | None, problem: Problem) -> Solution:
    """A solution of ``problem`` with another lower bound; where it is not within the wanted gap, ``gap`` did not end
    the search."""
    near = bound is not None and problem.cost(solution.path) <= bound * (1.0 + problem.gap_percent / 100.0)
    stopped_by = "exhausted" if solution.stopped_by == "gap" and not near else solution.stopped_by
    return replace(solution, lower_bound=bound, stopped_by=stopped_by)


def same_ends(one: Solution, other: Solution) -> bool:
    """Whether the paths of two solutions for the same vias begin and end at the same places and altitudes: then the
    lower bound of either is one of both."""
    a, b = (s.path.points[[0, -1]] for s in (one, other))
    return bool(np.abs(a - b).max() < SAME_M)
