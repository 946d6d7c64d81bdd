"""Fixed wings' least times: legs as the model of motion has them, bounds beside profiles found by brute force."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.fleet.motion.timing import legs
from gcsplan.planners.airspeed import Airspeed, Shortest
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
    bound_s = Airspeed(FAST_M_S).least_s(Shortest(straight_m), ends_m, limits, top_m)
    if math.isfinite(best_s):
        assert 0.98 * best_s < bound_s <= best_s


def test_ends_that_are_a_little_higher_take_no_less_than_the_bound() -> None:
    limits, fast = Limits(0.0, max_climb_deg=5.0, max_descent_deg=5.0), Airspeed(FAST_M_S)
    near = fast.least_s(Shortest(3000.0), (100.0, 200.0), limits, 400.0, 0.01)
    for off in ((0.01, 0.01), (-0.01, 0.01), (0.01, -0.01)):
        there = fast.least_s(Shortest(3000.0), (100.0 + off[0], 200.0 + off[1]), limits, 400.0)
        assert near <= there <= near * 1.0001


def test_a_rate_that_is_slower_than_the_slope_takes_its_time() -> None:
    limits = Limits(0.0, max_climb_deg=20.0)
    bound_s = Airspeed(FAST_M_S, climb_m_s=1.0).least_s(Shortest(2000.0), (0.0, 500.0), limits, 600.0)
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


def flown_s(points: Floats, wind_m_s: tuple[float, float], rates_m_s: tuple[float, float]) -> float:
    """Seconds of a path in a wind by steps of 1/400 of a leg: each by the angle at which the nose is off the track."""
    total_s = 0.0
    for a, b in pairwise(points):
        way = (b - a) / 400
        step_m, rise_m = float(np.linalg.norm(way)), float(way[2])
        tail = float(np.dot(way[:2], wind_m_s)) / step_m
        aside = math.sqrt(max(math.hypot(*wind_m_s) ** 2 - tail**2, 0.0))
        for k in range(400):
            thin = float(thinner(a[2] + (k + 0.5) * rise_m))
            over_m_s = tail + FAST_M_S * thin * math.cos(math.asin(aside / (FAST_M_S * thin)))
            total_s += max(step_m / over_m_s, rise_m / rates_m_s[0] / thin, -rise_m / rates_m_s[1] / thin)
    return total_s


@pytest.mark.parametrize("rates_m_s", [(math.inf, math.inf), (2.0, 1.5)])
def test_no_random_path_in_a_wind_is_faster_than_the_bound(rates_m_s: tuple[float, float]) -> None:
    rng, near = np.random.default_rng(7), []
    for k in range(12):
        blows, angle = float(rng.uniform(0.0, 0.9 * FAST_M_S)), float(rng.uniform(0.0, 2.0 * math.pi))
        fast = Airspeed(FAST_M_S, *rates_m_s, (blows * math.cos(angle), blows * math.sin(angle)))
        points = rng.uniform([0.0, 0.0, 0.0], [9000.0, 9000.0, 600.0], (2 + k % 3, 3))
        d = np.diff(points, axis=0)
        slopes = np.degrees(np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1])))
        steep = {"max_climb_deg": max(slopes.max(), 0.1), "max_descent_deg": max(-slopes.min(), 0.1)}
        ends_m, way_m = (points[0, 2], points[-1, 2]), (d[:, 0].sum(), d[:, 1].sum())
        length_m, top_m = float(np.linalg.norm(d, axis=1).sum()), float(points[:, 2].max())
        took_s = flown_s(points, fast.wind_m_s, rates_m_s)
        limits, at_m = Limits(0.0, **steep), float(rng.uniform(0.0, 900.0))
        bound_s = fast.least_s(Shortest(length_m), ends_m, limits, top_m, 0.0, way_m)
        # In the stretched plane, at the airspeed of any altitude, by the definition of its metric.
        true_m_s = FAST_M_S * float(thinner(at_m))
        along = d[:, :2] @ np.array(fast.wind_m_s)
        stretched_m = float(np.sqrt((d * d).sum(axis=1) + along**2 / (true_m_s**2 - blows**2)).sum())
        least = Shortest(length_m, stretched_m, true_m_s)
        closer_s = fast.least_s(least, ends_m, limits, top_m, 0.0, way_m)
        assert bound_s <= closer_s <= took_s
        assert fast.path_s(points) == pytest.approx(took_s, rel=1e-4)
        near.append(took_s / closer_s)
    assert min(near) < 1.02


def test_a_level_way_in_a_wind_is_bounded_by_its_own_time() -> None:
    for wind_m_s in ((0.0, 0.0), (12.0, 5.0), (-15.0, 2.0)):
        fast, points = Airspeed(FAST_M_S, wind_m_s=wind_m_s), np.array([[0.0, 0.0, 50.0], [3000.0, -4000.0, 50.0]])
        bound_s = fast.least_s(
            Shortest(5000.0), (50.0, 50.0), Limits(0.0, max_climb_deg=8.0), 50.0, 0.0, (3000.0, -4000.0)
        )
        assert bound_s == pytest.approx(fast.path_s(points), rel=1e-6)
        assert bound_s == pytest.approx(flown_s(points, wind_m_s, (math.inf, math.inf)), rel=1e-6)


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
