"""Paths for the least time: costs by slope, bounds, and missions whose fastest path is not the shortest."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.fleet.motion.speeds import bounds
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Level, Polygon, Zone
from tests.oracles.optima_campaign import in_time, judge
from tests.oracles.optima_polish import Effort
from tests.oracles.optima_worlds import FAMILIES
from tests.support.planner_worlds import ground

SPEED_M_S, CLIMB_M_S, DESCENT_M_S = 15.0, 2.5, 1.5
BRIEF = Effort(150, 3, 1, 2, 1, 0.1)


def block(ceiling_m: float) -> Problem:
    """A kilometre over level ground, past a block 200 m long and 600 m wide that can be passed over."""
    ring = np.array([[900.0, 700.0], [1100.0, 700.0], [1100.0, 1300.0], [900.0, 1300.0]])
    air = Airspace(ground(0.0), [Zone("block", Polygon(ring), None, Level(ceiling_m, "amsl"))])
    return Problem(
        air, Limits(10.0), (500.0, 1000.0, 10.1), (1500.0, 1000.0, 10.1), objective="time", speed_m_s=SPEED_M_S,
        climb_m_s=CLIMB_M_S, descent_m_s=DESCENT_M_S, gap_percent=1.0,
    )  # fmt: skip


def test_a_leg_takes_as_long_as_the_model_of_motion_says() -> None:
    rng = np.random.default_rng(1)
    problem = block(200.0)
    run, rise = rng.uniform(0.0, 500.0, 300), rng.uniform(-200.0, 200.0, 300)
    length = np.hypot(run, rise)
    most, per_cruise = bounds(length, run, rise, np.array([[CLIMB_M_S, DESCENT_M_S]]))
    assert problem.slope_costs(run, rise) == pytest.approx(length / np.minimum(most, SPEED_M_S * per_cruise))


def test_no_path_takes_less_than_its_track_and_its_climbs_do() -> None:
    rng = np.random.default_rng(2)
    problem = block(200.0)
    for _ in range(200):
        inner = rng.uniform([0.0, 0.0, 10.0], [2000.0, 2000.0, 400.0], (int(rng.integers(0, 6)), 3))
        points = np.vstack([problem.start, inner, problem.goal])
        d = np.diff(points, axis=0)
        track_m, vertical_m = float(np.hypot(d[:, 0], d[:, 1]).sum()), float(np.abs(d[:, 2]).sum())
        cost = problem.cost_through(points)
        assert problem.least_cost(track_m, vertical_m) <= cost * (1.0 + 1e-12)
        assert vertical_m <= problem.most_climbed_m(cost, track_m) * (1.0 + 1e-12)


@pytest.mark.slow
def test_the_fastest_path_leads_around_what_the_shortest_climbs_over() -> None:
    problem = block(200.0)
    fastest, shortest = plan(problem), plan(replace(problem, objective="length"))
    around_m = 2.0 * math.hypot(400.0, 300.0) + 200.0
    assert shortest.path.length_m < around_m - 30.0
    assert problem.cost(shortest.path) > 189.0 / CLIMB_M_S + 189.0 / DESCENT_M_S
    assert problem.cost(fastest.path) == pytest.approx(around_m / SPEED_M_S, rel=2e-3)
    assert fastest.lower_bound is not None
    assert around_m / SPEED_M_S * 0.98 < fastest.lower_bound <= around_m / SPEED_M_S


def test_the_fastest_path_leads_over_what_it_climbs_at_full_speed() -> None:
    problem = block(40.0)
    fastest = plan(problem)
    assert problem.cost(fastest.path) == pytest.approx(1000.0 / SPEED_M_S, rel=1e-3)
    assert fastest.path.points[:, 2].max() > 40.0


def test_a_steep_climb_takes_the_time_of_its_rise() -> None:
    problem = replace(block(40.0), goal=(520.0, 1000.0, 160.1))
    fastest = plan(problem)
    assert problem.cost(fastest.path) == pytest.approx(150.0 / CLIMB_M_S, rel=1e-6)
    assert fastest.lower_bound == pytest.approx(150.0 / CLIMB_M_S, rel=1e-6)


@pytest.mark.nightly
@pytest.mark.parametrize("family", [name for name in FAMILIES if name != "pockets"])
def test_no_known_path_is_faster_than_the_bound(family: str) -> None:
    verdicts = [judge(family, seed, BRIEF, budget_s=2.0, **in_time(seed)) for seed in range(5, 9)]
    assert [str(v) for v in verdicts if v.wrong] == []
