"""The gap that ends a plan is the one that it reports."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gcsplan.bench.everyday.missions import draw
from gcsplan.bench.everyday.run import problem_of
from gcsplan.planners import problem as problems
from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal.planner import plan


@pytest.mark.parametrize("number", [92, 5, 31])
def test_a_plan_that_the_gap_ended_is_within_it(number: int) -> None:
    problem = replace(problem_of(draw(11, number)), budget=Budget.endless(clocked=False))
    found = plan(problem)
    assert found.lower_bound is not None
    assert found.stopped_by == "gap"
    assert problem.cost(found.path) <= found.lower_bound * (1.0 + problem.gap_percent / 100.0)


def test_what_rounding_takes_from_bounds_is_computed_once_and_not_for_each_search(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It was computed at each look at the gap, which took a twentieth of a common plan."""
    seen: list[object] = []
    known = problems.least_run_m
    monkeypatch.setattr(problems, "least_run_m", lambda *what: seen.append(what) or known(*what))
    problem = problem_of(draw(12, 16))
    plan(problem)
    assert 1 <= len(seen) <= 3 * (1 + len(problem.via))


@pytest.mark.parametrize(
    ("number", "least"),
    [
        pytest.param(38, 690.0, marks=pytest.mark.nightly, id="a ring of a wall, without errors"),
        pytest.param(75, 635.9, marks=pytest.mark.slow, id="over a zone, and down at the climb limit"),
    ],
)
def test_what_was_far_from_its_bound(number: int, least: float) -> None:
    problem = replace(problem_of(draw(11, number)), budget=Budget.endless(clocked=False))
    found = plan(problem)
    assert found.lower_bound is not None
    assert found.lower_bound > least
    assert problem.cost(found.path) < least * (1.018 if number == 38 else 1.0011)
