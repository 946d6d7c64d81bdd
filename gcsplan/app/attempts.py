"""Several plans for one vehicle, each with larger margins than the one before: their budgets, and what is reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gcsplan.planners.budget import FIRST, FIRST_S, Budget
from gcsplan.planners.problem import Problem, Solution

__all__ = ["of_all", "within_budget"]


def within_budget(problem: Problem, tried: Sequence[Solution], begun_s: float) -> Problem:
    """The problem of the next attempt: with half the counted work of the last one, so that all together take less than
    twice the first one's. A path whose mission breaks a limit is none: the clock stops them all when it stops a plan
    without a path that began at ``begun_s``."""
    if not tried:
        return problem
    until_s = begun_s + FIRST * problem.budget_s + FIRST_S
    budget = Budget.endless(clocked=problem.budget.clocked, until_s=until_s)
    return replace(problem, budget_s=problem.budget_s * 0.5 ** len(tried), budget=budget)


def of_all(tried: Sequence[Solution], problem: Problem, bound: float | None) -> Solution:
    """The last of some solutions, with a lower ``bound`` under the limits of the first: those of the later ones are
    tighter than the mission's own, and so are their bounds.

    ``problem``: that of the last one. Times and searches are those of all.
    """
    first, last = tried[0], tried[-1]
    if first is last:
        return last
    stopped_by = last.stopped_by
    if "time" in (s.stopped_by for s in tried):
        stopped_by = "time"
    elif stopped_by == "gap" and (
        bound is None or problem.cost(last.path) > bound * (1.0 + problem.gap_percent / 100.0)
    ):
        stopped_by = "exhausted"
    note = f"planned {len(tried)} times, each time with larger margins: the first mission breaks a limit as it is flown"
    if bound is not None:
        note += "; the lower bound is one under the limits of the first plan"
    return replace(
        last,
        lower_bound=bound,
        stopped_by=stopped_by,
        planning_s=sum(s.planning_s for s in tried),
        first_path_s=first.first_path_s,
        search=tuple(step for s in tried for step in s.search),
        notes=(*last.notes, note),
    )
