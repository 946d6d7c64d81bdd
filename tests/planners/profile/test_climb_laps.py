"""Laps in a track that is too steep: what they replace never takes a via along."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.incumbent import Incumbent
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem, Via, passes_vias
from gcsplan.world.airspace import Airspace
from gcsplan.world.limits import Limits
from gcsplan.world.surface import GridMap, Surface


def problem_of(start: tuple[float, float, float], goal: tuple[float, float, float], *via: Via) -> Problem:
    ground = np.zeros((41, 41))
    surface = Surface(ground, ground, GridMap.affine(-1000.0, 1000.0, 50.0, 50.0))
    limits = Limits(15.0, max_climb_deg=25.0, max_descent_deg=25.0)
    return Problem(Airspace(surface, ()), limits, start, goal, via)


@pytest.mark.parametrize("via_m", [60.0, None])
@pytest.mark.parametrize("apart_m", [20.0, 45.0, 120.0])
@pytest.mark.parametrize("at_start", [False, True])
def test_a_via_right_before_a_steep_end_is_passed(via_m: float | None, apart_m: float, at_start: bool) -> None:
    """A bend from the via to the goal moved the via's pin to the goal: the path left the via out, cheaper than its
    bound. On open ground such a bend is as long as the climb needs, and no longer."""
    ends = (-400.0, -100.0, 30.0), (apart_m, 0.0, 20.0)
    via = Via(0.0, 0.0, via_m), Via(-200.0, 0.0, None)
    problem = problem_of(ends[1], ends[0], *via) if at_start else problem_of(*ends, *via[::-1])
    found = plan(problem)
    assert passes_vias(problem, found.path.points)
    assert found.lower_bound is not None
    assert 1.0 - 1e-9 <= problem.cost(found.path) / found.lower_bound <= 1.0 + 1e-5


def test_a_path_that_leaves_a_via_out_is_not_taken() -> None:
    problem = problem_of((0.0, 0.0, 30.0), (400.0, 0.0, 30.0), Via(100.0, 50.0, 40.0), Via(300.0, 50.0))
    first, second = (100.0, 50.0, 40.0), (300.0, 50.0, 35.0)

    def taken(*inner: tuple[float, float, float]) -> bool:
        points: Floats = np.array([problem.start, *inner, problem.goal])
        return Incumbent(problem).take(points)

    assert taken(first, second)
    assert not taken(first)
    assert not taken(second, first)
    assert not taken((100.0, 50.0, 41.0), second)
