"""Ant colony: only allowed edges, eq. 1 and 2 by hand, exact budgets, and paths that pass the check."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.errors import InputError, NoMission
from gcsplan.planners.problem import Problem, Via
from gcsplan.planners.registry import get
from gcsplan.research.swarm import SWARM_PLANNERS
from gcsplan.research.swarm.aco import make_layers, open_between, search, walk
from gcsplan.research.swarm.repair import violations
from gcsplan.research.swarm.scene import Scene
from gcsplan.research.swarm.settings import Settings
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support.planner_worlds import ground


def mission(**options: object) -> Problem:
    air = Airspace(ground(100.0), (Zone("wall", Circle(1000.0, 1000.0, 300.0)),))
    limits = Limits(20.0, max_agl_m=120.0, max_climb_deg=30.0, max_descent_deg=30.0)
    return Problem(air, limits, (300.0, 1000.0, 150.0), (1700.0, 1000.0, 160.0), options=options)


def settings(**options: object) -> Settings:
    return Settings.of(SWARM_PLANNERS["aco"], options)


def test_layers_are_stops_and_sections_of_21_by_21() -> None:
    problem = replace(mission(), via=(Via(1000.0, 1500.0),))
    scene = Scene.of(problem)
    layers = make_layers(scene, (2, 1))
    assert [len(layer) for layer in layers] == [1, 441, 441, 1, 441, 1]
    for layer in layers:
        assert (layer >= scene.low - 1e-9).all()
        assert (layer <= scene.high + 1e-9).all()
    across = layers[1] - layers[1].mean(axis=0)
    ahead = scene.terminals[1] - scene.terminals[0]
    assert np.abs(across[:, :2] @ ahead[:2]).max() < 1e-6 * np.linalg.norm(ahead) ** 2


def test_an_edge_is_open_exactly_where_dense_points_are_allowed_and_not_too_steep() -> None:
    problem = mission()
    scene = Scene.of(problem)
    a, b = make_layers(scene, (2,))[1:3]
    rng = np.random.default_rng(2)
    a, b = a[rng.choice(len(a), 30, False)], b[rng.choice(len(b), 30, False)]
    lengths = open_between(scene, [a, b])[0]
    t = np.linspace(0.0, 1.0, 400)[:, None]
    closed = 0
    for i, p in enumerate(a):
        for j, q in enumerate(b):
            line = p + t * (q - p)
            apart = np.hypot(line[:, 0] - 1000.0, line[:, 1] - 1000.0).min() - 300.0
            slope = abs(q[2] - p[2]) / np.hypot(*(q - p)[:2]) / np.tan(np.radians(30.0))
            if abs(apart) < 5.0 or abs(slope - 1.0) < 1e-6:
                continue
            wanted = apart > 0.0 and slope < 1.0
            assert np.isfinite(lengths[i, j]) == wanted
            closed += not wanted
            if wanted:
                assert lengths[i, j] == pytest.approx(np.linalg.norm(q - p))
    assert 100 < closed < 800


def test_steps_are_drawn_by_scent_and_nearness() -> None:
    """Eq. 1: two edges, the second with 4 times the scent and twice the length, are drawn by their weights."""
    lengths = np.array([[1.0, 2.0, np.inf]])
    scent = np.array([[1.0, 4.0, 50.0]])
    eager = lengths**-5.0
    ways = walk(np.random.default_rng(0), 20_000, [eager], [scent], 1.0)
    share = (ways[:, 1] == 0).mean()
    assert share == pytest.approx(1.0 / (1.0 + 4.0 / 32.0), abs=0.01)
    assert (ways[:, 1] < 2).all()  # never along a forbidden edge


def test_an_ant_in_a_dead_end_is_dropped() -> None:
    first, second = np.array([[1.0, 1.0]]), np.array([[0.0], [1.0]])
    ways = walk(np.random.default_rng(0), 1000, [first, second], [np.ones((1, 2)), np.ones((2, 1))], 1.0)
    assert 400 < len(ways) < 600
    assert (ways[:, 1] == 1).all()


@pytest.mark.slow
def test_ants_find_a_legal_way_round_a_wall() -> None:
    problem = mission(points=4, iterations=30)
    solution = get("aco").plan(problem)
    assert violations(problem, solution.path.points) == ()
    assert 1400.0 < solution.path.length_m < 1800.0


@pytest.mark.slow
def test_the_best_cost_never_rises_and_the_budget_is_exact() -> None:
    problem = mission()
    found = search(problem, settings(evaluations=333, population=50, points=3))
    assert found.result.evaluations == 333
    assert found.result.stopped_by == "evaluations"
    history = found.result.history
    assert (history.cost[0], history.evaluations[0]) == (np.inf, 0)  # before the first colony
    assert (history.cost[1:] <= history.cost[:-1]).all()
    assert len(history.by_iteration()) == found.result.iterations + 1 == 8
    np.testing.assert_array_equal(history.by_iteration(), history.cost)
    assert list(found.result.history.evaluations[-2:]) == [300, 333]
    again = search(problem, settings(evaluations=333, population=50, points=3))
    assert again.curve.tobytes() == found.curve.tobytes()


@pytest.mark.slow
def test_no_ant_through_a_closed_wall_is_a_refusal() -> None:
    wall = tuple(Zone(f"w{i}", Circle(1000.0, float(n), 80.0)) for i, n in enumerate(range(-900, 3000, 100)))
    problem = mission(iterations=3, points=3)
    with pytest.raises(NoMission, match="no ant of 150 came through") as refusal:
        get("aco").plan(replace(problem, airspace=Airspace(problem.airspace.surface, wall)))
    assert refusal.value.reason == "not_found"


def test_unknown_parameters_are_refused() -> None:
    with pytest.raises(InputError, match=r"aco has no parameter 'gamma'.* Known: alpha, beta"):
        get("aco").plan(mission(parameters={"gamma": 1}))
