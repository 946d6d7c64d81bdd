"""Bounds of a leg's tracks, held against paths that are known."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal.incumbent import Incumbent
from gcsplan.planners.optimal.plane_search import PlaneSearch
from gcsplan.planners.optimal.planner import search
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.limits import Limits
from tests.support.planner_worlds import Floats, ground


def track_of(path: Floats) -> float:
    """Metres of a path's ground track."""
    return float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum())


@pytest.mark.parametrize(("start_east_m", "climb_deg"), [(600.0, 8.0), (700.0, 8.0), (700.0, 12.0), (830.0, 12.0)])
def test_bound_of_a_climb_in_front_of_a_ridge_holds_whatever_bounds_came_before(
    start_east_m: float, climb_deg: float
) -> None:
    """The climb takes laps in front of the ridge, so a path has flown far more than the shortest track when it comes
    there. What an earlier bound counted of that is not counted once more as metres that cannot be spent on climbing."""
    across = ground(lambda east, _: np.maximum(0.0, 80.0 - 0.5 * np.abs(east - 1000.0)))
    limits = Limits(min_agl_m=10.0, max_climb_deg=climb_deg, max_descent_deg=climb_deg)
    problem = Problem(
        Airspace(across, ()), limits, (start_east_m, 1000.0, 20.0), (1800.0, 1000.0, 30.0), budget=Budget(2.0, 500.0)
    )
    best = search(problem).incumbent.best
    assert best is not None
    known_m = track_of(best)
    plane = PlaneSearch(Incumbent(problem))
    assert plane.flood(1.0)
    (leg,) = plane.legs
    assert known_m > 1.02 * leg.length_m
    for part in (0.5, 0.8, 0.95, 0.999, 1.001, 1.02, 1.1):
        limit_m = leg.length_m + part * (known_m - leg.length_m)
        found_m = leg.bound(plane.top_m, leg.corridor(limit_m), limit_m, True)
        assert found_m <= known_m * (1.0 + 1e-9), (part, found_m, known_m)
        assert found_m <= limit_m
