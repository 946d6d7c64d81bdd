"""Laps in a track that is too steep: what they replace never takes a via along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem, Via, passes_vias
from gcsplan.planners.profile.climb_laps import MOST_LAPS, laps, wound
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface


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


@pytest.mark.parametrize("heading", [None, 0.7])
@pytest.mark.parametrize(("length_m", "radius_m"), [(300.0, 0.0), (5000.0, 0.0), (900.0, 30.0), (9000.0, 30.0)])
def test_laps_come_back_to_their_place_and_are_as_long_as_asked(
    length_m: float, radius_m: float, heading: float | None
) -> None:
    problem = replace(problem_of((0.0, 0.0, 20.0), (500.0, 0.0, 20.0)), turn_radius_m=radius_m)
    counts = []
    for one, count in laps(problem, length_m, heading):
        whole = np.vstack([np.zeros((1, 2)), wound(one, count), np.zeros((1, 2))])
        assert float(np.hypot(*np.diff(whole, axis=0).T).sum()) == pytest.approx(length_m)
        counts.append(count)
    assert counts == sorted(counts)
    assert (counts[0], max(counts) <= MOST_LAPS) == (1, True)


def test_the_first_lap_beside_a_track_leads_sideways() -> None:
    problem = problem_of((0.0, 0.0, 20.0), (500.0, 0.0, 20.0))
    one, _ = next(laps(problem, 200.0, 0.7))
    along = np.array([np.cos(0.7), np.sin(0.7)])
    assert float(abs(one @ along).max()) == pytest.approx(0.0, abs=1e-9)
