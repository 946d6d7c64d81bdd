"""Cross-section descent: the cheapest chain of points, compared with brute force, and paths drawn together."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.arrays import Floats, Indices
from gcsplan.planners.problem import Problem, Via
from gcsplan.planners.profile.cross_sections import FAR_AHEAD, FIXED, FREE, cheapest, tightened
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support.searches import spent_budget

HILL_M = 120.0


def problem_of(zones: list[Zone]) -> Problem:
    axis = np.arange(0.0, 2001.0, 50.0)
    east, north = np.meshgrid(axis, axis[::-1])
    ground = HILL_M * np.exp(-((east - 1000.0) ** 2 + (north - 900.0) ** 2) / (2.0 * 250.0**2))
    surface = Surface(ground, ground, GridMap.affine(0.0, 2000.0, 50.0, 50.0))
    limits = Limits(30.0, max_climb_deg=20.0, max_descent_deg=20.0)
    return Problem(Airspace(surface, zones), limits, (100.0, 1000.0, 40.0), (1900.0, 1000.0, 40.0))


def brute_force(problem: Problem, points: Floats, kinds: Indices) -> float:
    """Cost of the cheapest chain by all pairs of points, one at a time."""
    n = len(points)
    cost = [0.0] + [math.inf] * (n - 1)
    for b in range(1, n):
        for a in range(max(b - FAR_AHEAD, 0), b):
            if (kinds[a + 1 : b] != FREE).any():
                continue
            if b == a + 1 or problem.legal(points[a : a + 1], points[b : b + 1])[0]:
                cost[b] = min(cost[b], cost[a] + math.dist(points[a], points[b]))
    return cost[-1]


@pytest.mark.parametrize("count", [2, 3, 12, 60])
def test_the_cheapest_chain_is_that_of_brute_force(count: int) -> None:
    rng = np.random.default_rng(count)
    problem = problem_of([Zone("disc", Circle(700.0, 1000.0, 90.0))])
    for _ in range(3):
        east = np.sort(rng.uniform(100.0, 1900.0, count))
        points = np.column_stack([east, rng.uniform(900.0, 1100.0, count), rng.uniform(100.0, 170.0, count)])
        points[[0, -1]] = problem.start, problem.goal
        kinds = np.where(rng.random(count) < 0.1, FIXED, FREE)
        kinds[[0, -1]] = FIXED
        found, kept = cheapest(problem, points, kinds)
        assert problem.cost_through(found) == pytest.approx(brute_force(problem, points, kinds), rel=1e-12)
        assert (kept != FREE).sum() == (kinds != FREE).sum()


def test_a_path_is_drawn_together_and_stays_legal() -> None:
    problem = problem_of([Zone("disc", Circle(700.0, 1000.0, 90.0))])
    wide = np.array(
        [problem.start, (600.0, 1300.0, 150.0), (1000.0, 1250.0, 150.0), (1400.0, 1200.0, 150.0), problem.goal]
    )
    assert problem.legal(wide[:-1], wide[1:]).all()
    found, pinned = tightened(problem, wide)
    assert problem.legal(found[:-1], found[1:]).all()
    assert pinned.sum() == 2
    assert problem.cost(Path(found)) < 0.98 * problem.cost(Path(wide))
    np.testing.assert_array_equal(found[[0, -1]], wide[[0, -1]])
    same, _ = tightened(replace(problem, budget=spent_budget()), wide)
    np.testing.assert_array_equal(same, wide)


def test_a_free_via_keeps_its_place() -> None:
    problem = replace(problem_of([]), via=(Via(1000.0, 1200.0, None),))
    path = np.array(
        [problem.start, (500.0, 1300.0, 120.0), (1000.0, 1200.0, 150.0), (1500.0, 1200.0, 120.0), problem.goal]
    )
    found, pinned = tightened(problem, path)
    assert problem.legal(found[:-1], found[1:]).all()
    (at,) = np.flatnonzero(pinned)[1:-1]
    assert tuple(found[at, :2]) == (1000.0, 1200.0)
