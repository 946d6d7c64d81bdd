"""Polishing and simplifying paths: the result is legal, costs no more than allowed, and keeps its terminals."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.problem import Objective, Problem
from gcsplan.planners.simplify import WAY_POINT_PRICE, fewer, polished, thinned
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.effort import draws, seeds
from tests.support.planner_worlds import faults, ground

LIMITS = Limits(
    min_agl_m=50.0,
    max_amsl_m=900.0,
    horizontal_clearance_m=20.0,
    track_error_m=3.0,
    altitude_error_m=4.0,
    max_climb_deg=35.0,
    max_descent_deg=35.0,
)


def clear(problem: Problem, points: Floats) -> bool:
    return bool(problem.airspace.clear(Legs.of_path(points, problem.limits), problem.limits).all())


def zigzag(seed: int, objective: Objective = "length") -> tuple[Problem, Floats, Bools]:
    """A world of hills and zones, a crooked legal path through it, and which of its points must stay."""
    rng = np.random.default_rng(seed)
    bumps = np.column_stack(
        [rng.uniform(200.0, 1800.0, (8, 2)), rng.uniform(80.0, 250.0, 8), rng.uniform(40.0, 200.0, 8)]
    )

    def height(e: Floats, n: Floats) -> Floats:
        z = np.full_like(e, 200.0)
        for x, y, wide, tall in bumps:
            z = z + tall * np.exp(-((e - x) ** 2 + (n - y) ** 2) / (2.0 * wide**2))
        return z

    zones = [
        Zone(
            f"zone {k}",
            Circle(*map(float, rng.uniform([400.0, 700.0], [1600.0, 1300.0])), float(rng.uniform(40.0, 130.0))),
            Level(float(rng.uniform(90.0, 130.0)), "agl") if k % 3 == 2 else None,
            None if k % 3 == 0 else Level(float(rng.uniform(450.0, 600.0)), "amsl"),
        )
        for k in range(5)
    ]
    air = Airspace(ground(height, step_m=25.0), zones)
    problem = Problem(air, LIMITS, (100.0, 1000.0, 850.0), (1900.0, 1000.0, 800.0), objective=objective)
    points = [np.array(problem.start)]
    while points[-1][0] < 1780.0:
        # Draw a next point until the exact check passes the leg to it.
        for _ in range(400):
            step = float(rng.uniform(40.0, 160.0))
            new = points[-1] + np.array([step, float(rng.normal(0.0, 1.2 * step)), float(rng.normal(0.0, 0.4 * step))])
            new[:2] = new[:2].clip(60.0, 1940.0)
            if clear(problem, np.stack([points[-1], new])):
                points.append(new)
                break
        else:
            points = [np.array(problem.start)]
    path = np.vstack(points)
    for k in range(len(path) - 1, 0, -1):
        if clear(problem, np.vstack([path[k], problem.goal])):
            path = np.vstack([path[: k + 1], problem.goal])
            break
    else:
        return zigzag(seed + 1000, objective)
    pinned = rng.random(len(path)) < 0.15
    pinned[0] = pinned[-1] = True
    return problem, path, pinned


def has_all(points: Floats, pinned: Bools, before: Floats, pinned_before: Bools) -> bool:
    """Whether the points that must stay are still there, in order, and still marked so."""
    return np.array_equal(points[pinned], before[pinned_before])


@pytest.mark.nightly_but("1-energy", "3-length")
@pytest.mark.slow
@pytest.mark.parametrize("objective", ["length", "energy"])
@pytest.mark.parametrize("seed", range(6))
def test_polished_paths_are_legal_no_dearer_and_keep_their_stops(seed: int, objective: Objective) -> None:
    problem, before, pinned = zigzag(seed, objective)
    assert clear(problem, before)
    kept = before.copy()
    points, still = polished(problem, before, pinned)
    assert np.array_equal(before, kept), "the path that was given was written to"
    assert clear(problem, points)
    apart = np.concatenate([[True], np.hypot(*np.diff(points, axis=0)[:, :2].T) > 0.0])
    assert not faults(problem, Path(points[apart]))  # a point may be moved onto its neighbour
    assert problem.cost(Path(points)) <= problem.cost(Path(before)) * (1.0 + 1e-12)
    assert len(points) == len(before)
    assert has_all(points, still, before, pinned)


@pytest.mark.slow
def test_polishing_makes_crooked_paths_a_good_deal_shorter() -> None:
    gained = []
    for problem, before, pinned in map(zigzag, range(6)):
        points, _ = polished(problem, before, pinned)
        gained.append(1.0 - problem.cost(Path(points)) / problem.cost(Path(before)))
    assert min(gained) > 0.0
    assert np.median(gained) > 0.1


@pytest.mark.parametrize("objective", ["length", "energy"])
@pytest.mark.parametrize("part", [0.0, 1e-3, 0.05])
@pytest.mark.parametrize("seed", seeds(1, 1, 4))
def test_fewer_points_cost_no_more_than_was_allowed(seed: int, part: float, objective: Objective) -> None:
    problem, before, pinned = zigzag(seed + 50, objective)
    kept = before.copy()
    cost = problem.cost(Path(before))
    points, still = fewer(problem, before, pinned, part * cost)
    assert np.array_equal(before, kept), "the path that was given was written to"
    assert clear(problem, points)
    assert not faults(problem, Path(points))
    assert problem.cost(Path(points)) <= cost * (1.0 + part + 1e-12)
    assert 2 <= len(points) <= len(before)
    assert len(still) == len(points)
    assert has_all(points, still, before, pinned)


@pytest.mark.parametrize("objective", ["length", "energy"])
@pytest.mark.parametrize("seed", seeds(1, 1, 4))
def test_a_saved_way_point_costs_no_more_than_its_stated_price(seed: int, objective: Objective) -> None:
    assert 0.0 < WAY_POINT_PRICE <= 5e-4
    problem, crooked, pinned = zigzag(seed + 70, objective)
    t = np.linspace(0.0, 1.0, 4, endpoint=False)[:, None]
    legs = itertools.pairwise(crooked)
    before = np.vstack([*(a + t * (b - a) for a, b in legs), crooked[-1]])
    stay = np.zeros(len(before), np.bool_)
    stay[::4] = pinned
    points, still = fewer(problem, before, stay)
    cost, saved = problem.cost(Path(before)), len(before) - len(points)
    assert saved >= 3 * (len(crooked) - 1), "points on straight legs cost nothing"
    assert clear(problem, points)
    assert problem.cost(Path(points)) <= cost * (1.0 + WAY_POINT_PRICE * saved + 1e-12)
    assert has_all(points, still, before, stay)


def test_no_single_point_is_left_that_could_go_for_nothing() -> None:
    for seed in range(6):
        problem, before, pinned = zigzag(seed + 80)
        points, still = fewer(problem, before, pinned, 0.0)
        for k in np.flatnonzero(~still).tolist():
            without = np.delete(points, k, axis=0)
            dearer = problem.cost(Path(without)) > problem.cost(Path(points)) * (1.0 + 1e-12)
            assert dearer or not clear(problem, without), (seed, k)


def test_points_on_a_straight_line_all_go_but_stops() -> None:
    problem, *_ = zigzag(0)
    open_air = replace(problem, airspace=Airspace(ground(200.0)))
    t = np.linspace(0.0, 1.0, 12)[:, None]
    points = np.array(problem.start) + t * (np.array(problem.goal) - np.array(problem.start))
    pinned = np.zeros(12, np.bool_)
    pinned[[0, 5, 11]] = True
    few, still = fewer(open_air, points, pinned, 1e-6)
    assert np.array_equal(few, points[pinned])
    assert still.all()


@pytest.mark.slow
def test_a_polished_path_past_one_wall_is_nearly_the_shortest() -> None:
    wall = Zone("wall", Circle(1000.0, 1000.0, 200.0))
    limits = Limits(min_agl_m=10.0)
    problem = Problem(Airspace(ground(0.0), [wall]), limits, (400.0, 1000.0, 50.0), (1600.0, 1000.0, 50.0))
    turn = np.linspace(math.pi, 0.0, 33)
    round_it = np.column_stack([1000.0 + 500.0 * np.cos(turn), 1000.0 + 420.0 * np.sin(turn), np.full(33, 90.0)])
    before = np.vstack([problem.start, round_it, problem.goal])
    pinned = np.zeros(len(before), np.bool_)
    pinned[0] = pinned[-1] = True
    assert clear(problem, before)
    points, _ = polished(problem, before, pinned)
    angle = math.acos(200.0 / 600.0)
    shortest = 2.0 * 600.0 * math.sin(angle) + 200.0 * (math.pi - 2.0 * angle)
    assert shortest * (1.0 - 1e-9) <= problem.cost(Path(points)) < problem.cost(Path(before))
    assert problem.cost(Path(points)) < 1.15 * shortest
    # Fewer points, polished again, cost no more.
    few, still = fewer(problem, points, pinned, 1e-3 * shortest)
    again, _ = polished(problem, few, still)
    assert problem.cost(Path(again)) <= problem.cost(Path(few)) * (1.0 + 1e-12)
    assert len(few) < len(points)
    assert all(math.dist(a, b) > 0.0 for a, b in itertools.pairwise(again))


@given(seed=st.integers(0, 2**31), part=st.floats(1e-4, 0.3))
@settings(max_examples=draws(40))
def test_a_thinned_line_keeps_every_point_within_the_corridor(seed: int, part: float) -> None:
    points = np.random.default_rng(seed).normal(0.0, 0.1, (71, 3)).cumsum(axis=0)
    kept = np.array([0, 40, 70])
    chosen = thinned(points, kept, part)
    assert set(kept) <= set(chosen)
    assert (np.diff(chosen) > 0).all()
    for i, j in itertools.pairwise(chosen):
        a, d = points[i], points[j] - points[i]
        for q in points[i : j + 1]:
            t = min(max(float((q - a) @ d / max(d @ d, 1e-300)), 0.0), 1.0)
            assert np.linalg.norm(q - a - t * d) <= part + 1e-9
