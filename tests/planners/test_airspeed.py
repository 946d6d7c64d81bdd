"""Fixed wings' least times: legs as the model of motion has them, bounds beside profiles found by brute force."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.fleet.motion.timing import legs
from gcsplan.planners.airspeed import Airspeed
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from tests.oracles.optima_campaign import at_airspeed, judge
from tests.oracles.optima_polish import Effort, thinner
from tests.oracles.optima_worlds import FAMILIES
from tests.support.planner_worlds import ground
from tests.support.wings import wing

FAST_M_S = 20.0
BRIEF = Effort(150, 3, 1, 2, 1, 0.1)


def least_by_brute_force(length_m: float, ends_m: tuple[float, float], slopes: tuple[int, int], top_m: float) -> float:
    """Seconds of the fastest of all profiles over a level track of 60 pieces on a raster of altitudes, whose steps a
    piece may climb and descend by numbers of ``slopes``: dynamic programming, no code of the planner."""
    heights = np.linspace(min(ends_m), top_m, 81)
    run_m, step_m = length_m / 60, heights[1] - heights[0]
    first, last = (round((end - heights[0]) / step_m) for end in ends_m)
    cost: Floats = np.where(np.arange(81) == first, 0.0, math.inf)
    for _ in range(60):
        after = np.full(81, math.inf)
        for rise in range(-slopes[1], slopes[0] + 1):
            begin, end = slice(max(0, -rise), 81 - max(0, rise)), slice(max(0, rise), 81 + min(0, rise))
            leg_s = math.hypot(run_m, rise * step_m) / FAST_M_S / thinner(0.5 * (heights[begin] + heights[end]))
            after[end] = np.minimum(after[end], cost[begin] + leg_s)
        cost = after
    return float(cost[last])


@pytest.mark.parametrize("seed", range(6))
def test_no_profile_found_by_brute_force_is_faster_and_the_best_is_near(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low_m, high_m = float(rng.uniform(0.0, 1000.0)), float(rng.choice([300.0, 1000.0, 2500.0]))
    step_m, top_m, length_m = high_m / 80, low_m + high_m, high_m * float(rng.uniform(8.0, 40.0))
    ends_m, run_m = (low_m, low_m + int(rng.integers(0, 60)) * step_m), length_m / 60
    up, down = (int(n) for n in np.maximum(np.floor(rng.uniform(0.05, 0.2, 2) * run_m / step_m), 1.0))
    best_s = least_by_brute_force(length_m, ends_m, (up, down), top_m)
    degrees = [math.degrees(math.atan(n * step_m / run_m)) for n in (up, down)]
    limits = Limits(0.0, max_climb_deg=degrees[0], max_descent_deg=degrees[1])
    straight_m = math.hypot(length_m, ends_m[1] - ends_m[0])
    bound_s = Airspeed(FAST_M_S).least_s(straight_m, ends_m, limits, top_m)
    if math.isfinite(best_s):
        assert 0.98 * best_s < bound_s <= best_s


def test_ends_that_are_a_little_higher_take_no_less_than_the_bound() -> None:
    limits, fast = Limits(0.0, max_climb_deg=5.0, max_descent_deg=5.0), Airspeed(FAST_M_S)
    near = fast.least_s(3000.0, (100.0, 200.0), limits, 400.0, 0.01)
    for off in ((0.01, 0.01), (-0.01, 0.01), (0.01, -0.01)):
        there = fast.least_s(3000.0, (100.0 + off[0], 200.0 + off[1]), limits, 400.0)
        assert near <= there <= near * 1.0001


def test_a_rate_that_is_slower_than_the_slope_takes_its_time() -> None:
    limits = Limits(0.0, max_climb_deg=20.0)
    bound_s = Airspeed(FAST_M_S, climb_m_s=1.0).least_s(2000.0, (0.0, 500.0), limits, 600.0)
    assert 500.0 / thinner(500.0) <= bound_s <= 500.0


def test_a_wings_leg_takes_as_long_as_the_model_of_motion_says() -> None:
    rng = np.random.default_rng(1)
    vehicle = replace(wing(), speed_max_m_s=FAST_M_S, climb_m_s=2.0, descent_m_s=3.0, accel_m_s2=math.inf)
    fast = Airspeed(FAST_M_S, 2.0, 3.0)
    for _ in range(50):
        points = rng.uniform([0.0, 0.0, 0.0], [2000.0, 2000.0, 1500.0], (2, 3))
        way = legs(points, vehicle, np.zeros(1, dtype=np.intp))
        assert way is not None
        assert fast.path_s(points) == pytest.approx(way.time_s(FAST_M_S), rel=2e-4)


def test_a_leg_takes_as_long_as_its_parts() -> None:
    fast, points = Airspeed(FAST_M_S, 2.0), np.array([[0.0, 0.0, 100.0], [9000.0, 0.0, 2600.0]])
    parts = points[0] + np.linspace(0.0, 1.0, 500)[:, None] * (points[1] - points[0])
    assert fast.path_s(points) == pytest.approx(fast.path_s(parts), rel=1e-8)


@pytest.mark.slow
def test_a_wing_with_room_above_climbs_to_where_the_air_is_thin() -> None:
    limits = Limits(50.0, max_climb_deg=8.0, max_descent_deg=8.0, max_amsl_m=900.0)
    problem = Problem(
        Airspace(ground(0.0, size_m=2e4), ()), limits, (1000.0, 1000.0, 60.0), (19000.0, 19000.0, 60.0),
        objective="time", speed_m_s=FAST_M_S * float(thinner(900.0)), airspeed=Airspeed(FAST_M_S), turn_radius_m=80.0,
    )  # fmt: skip
    found = plan(problem)
    assert found.flown is not None
    assert found.lower_bound is not None
    straight_s = math.hypot(18000.0, 18000.0) / FAST_M_S / thinner(60.0)
    took_s = problem.cost(found.flown)
    assert found.path.points[:, 2].max() == pytest.approx(900.0, abs=0.2)
    assert found.lower_bound <= took_s < 0.98 * straight_s
    assert took_s < 1.005 * found.lower_bound


@pytest.mark.nightly
@pytest.mark.parametrize("family", [name for name in FAMILIES if name != "pockets"])
def test_no_known_path_of_a_wing_is_faster_than_the_bound(family: str) -> None:
    verdicts = [judge(family, seed, BRIEF, budget_s=2.0, **at_airspeed(seed)) for seed in range(5, 8)]
    assert [str(v) for v in verdicts if v.wrong] == []
