"""Warm starts: encodings turn back, the member nearest to a path draws it, and searches begin there."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.errors import InputError
from gcsplan.planners.problem import Problem, Via
from gcsplan.planners.registry import get
from gcsplan.research.swarm import SWARM_PLANNERS, warm_start
from gcsplan.research.swarm.encodings import ENCODINGS
from gcsplan.research.swarm.planner import cost_of, search
from gcsplan.research.swarm.repair import violations
from gcsplan.research.swarm.settings import Settings
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from tests.support.planner_worlds import ground

FLAT = Limits(min_agl_m=30.0, max_amsl_m=400.0)


def flat(**options: object) -> Problem:
    """Two places 1.6 km apart over flat ground at 100 m, a via between them."""
    air = Airspace(ground(lambda e, n: 100.0 + 0.0 * e))
    return Problem(
        air, FLAT, (200.0, 600.0, 140.0), (1800.0, 1000.0, 160.0), via=(Via(1000.0, 900.0, 220.0),),
        options={"cost": "krill", **options},
    )  # fmt: skip


@pytest.mark.parametrize("name", ENCODINGS)
def test_an_encoding_turns_back(name: str) -> None:
    cost = cost_of(replace(flat(), via=()), Settings(encoding=name, points=6))
    scene, encoding = cost.code.scene, cost.code.encoding
    u = np.random.default_rng(1).uniform(0.3, 0.7, (20, cost.dim))
    for controls in cost.code.controls(u):
        back = encoding.encode(scene, controls[0], controls[-1], controls[1:-1]).ravel()
        assert ((back >= 0.0) & (back <= 1.0)).all()
        again = cost.code.controls(back[None])[0]
        np.testing.assert_allclose(again, controls, atol=1.0 if name == "sections-whole" else 1e-6)


@pytest.mark.parametrize("name", ENCODINGS)
def test_the_nearest_member_draws_the_path(name: str) -> None:
    problem = flat()
    cost = cost_of(problem, Settings(encoding=name, points=12))
    t = np.linspace(0.0, 1.0, 60)
    bend = np.column_stack([200.0 + 1600.0 * t, 600.0 + 400.0 * t, 150.0 + 0.0 * t])
    bend[:, 1] += 100.0 * np.sin(np.pi * t)
    bend[:, 2] += 70.0 * np.sin(np.pi * t) ** 2
    curve = cost.curve.samples(cost.code.controls(warm_start.encoded(cost, bend)[None]))[0]
    off = np.linalg.norm(curve[:, None] - bend[None], axis=-1).min(axis=1)
    assert off.max() < 20.0  # vertices are 28 m apart


def test_a_path_that_turns_back_along_the_track_is_drawn_as_far_as_it_goes() -> None:
    cost = cost_of(replace(flat(), via=()), Settings(encoding="offsets", points=8))
    back = np.array([(200, 600, 150), (1200, 850, 150), (900, 1000, 150), (1800, 1000, 160)], float)
    u = warm_start.encoded(cost, back)
    assert ((u >= 0.0) & (u <= 1.0)).all()
    curve = cost.curve.samples(cost.code.controls(u[None]))[0]
    assert curve[:, 0].min() >= 199.0
    assert curve[:, 0].max() <= 1801.0


def test_a_quarter_of_the_population_is_around_the_path_and_the_rest_is_random() -> None:
    problem = replace(flat(), via=())
    path = np.array([problem.start, problem.goal])
    cost = cost_of(problem, Settings(encoding="offsets"))
    near = warm_start.members(cost, path, 1, 40)
    assert near.shape == (10, cost.dim)
    assert np.abs(near - near[0]).max() < 0.1
    np.testing.assert_array_equal(near, warm_start.members(cost, path, 1, 40))
    with pytest.raises(InputError, match="no length"):
        warm_start.encoded(cost, path[[0, 0]])


def test_a_search_around_the_optimal_path_begins_better_than_a_blind_one() -> None:
    problem = flat(encoding="bspline", points=12, population=40, iterations=1)
    blind, warm = (
        search(
            problem, "de", warm_start.resolved(problem, Settings.of(SWARM_PLANNERS["de"], {**problem.options, **more}))
        )
        for more in ({}, {"warm_start": "optimal"})
    )
    straight = warm.scene.straight_m
    assert warm.result.cost == pytest.approx(straight, rel=1e-6)
    assert blind.result.cost > 1.2 * straight
    solution = get("de").plan(replace(problem, options={**problem.options, "warm_start": "optimal"}))
    assert violations(problem, solution.path.points) == ()


def test_ants_take_no_warm_start() -> None:
    with pytest.raises(InputError, match="aco takes no warm_start"):
        get("aco").plan(flat(warm_start="optimal"))


def fleet(warm: str) -> dict[str, Any]:
    vehicles = [
        {
            "name": f"uav{k}", "sysid": k, "autopilot": "arducopter", "speed_m_s": [3, 15],
            "start": {"east_m": 0, "north_m": 100 * k}, "goal": {"east_m": 2000, "north_m": 100 * k},
        }
        for k in (1, 2, 3)
    ]  # fmt: skip
    wall = {"name": "wall", "center": {"east_m": 1000, "north_m": 200}, "radius_m": 300}
    return {
        "version": 1, "terrain": {"flat_m": 100}, "frame": {"origin": [36.6, -84.3], "amsl_m": 0},
        "limits": {"min_agl_m": 30, "max_amsl_m": 250}, "vehicles": vehicles, "no_fly": [wall],
        "planner": {"name": "de", "cost": "krill", "population": 60, "iterations": 3, "warm_start": warm},
    }  # fmt: skip


@pytest.mark.slow
def test_the_vehicles_of_a_fleet_begin_around_the_path_of_one() -> None:
    planned = plan(fleet("uav2"), jobs=1).vehicles
    assert [v.name for v in planned] == ["uav1", "uav2", "uav3"]
    assert [v.problem.options.get("around") is None for v in planned] == [False, True, False]
    for v in planned[::2]:
        np.testing.assert_array_equal(v.problem.options["around"], planned[1].solution.path.points)
    alone = plan(fleet("uav2") | {"planner": fleet("x")["planner"] | {"warm_start": None}}, jobs=1).vehicles
    same = [np.array_equal(a.solution.path.points, b.solution.path.points) for a, b in zip(planned, alone, strict=True)]
    assert same == [False, True, False]


def test_a_warm_start_that_is_not_there_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"warm_start is `optimal` or the name of a vehicle.*'uav9'"):
        plan(fleet("uav9"))
