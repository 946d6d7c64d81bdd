"""Contour climbs: a steep slope is climbed aslant, because a zone a few metres above it prevents anything else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.planners.optimal import planner as optimal
from gcsplan.planners.optimal.searches.contour_climb import traverse
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.planner_worlds import Floats, faults, ground
from tests.support.searches import looked

SLOPE, ROOM_M = 0.35, 15.0
LIMIT = Limits(10.0, max_climb_deg=math.degrees(math.atan(0.2)), max_descent_deg=math.degrees(math.atan(0.2)))
LID = Zone("lid", Circle(1000.0, 1000.0, 3000.0), Level(10.0 + ROOM_M, "agl"))


def hill(east_m: Floats, _north_m: Floats) -> Floats:
    """Ground that is level, steeper than the climb limit from 700 to 1100 m east, then level again."""
    return SLOPE * np.clip(east_m - 700.0, 0.0, 400.0)


def under_a_lid() -> Problem:
    """A mission from west to east with a zone whose floor is 15 m above the lowest legal altitude."""
    return Problem(
        Airspace(ground(hill), [LID]),
        LIMIT,
        (200.0, 1000.0, 15.0),
        (1800.0, 1000.0, SLOPE * 400.0 + 15.0),
        gap_percent=15.0,
        budget_s=600.0,
    )


@pytest.mark.slow
@pytest.mark.first_quick
@pytest.mark.parametrize("objective", ["length", pytest.param("energy", marks=pytest.mark.slow)])
def test_a_slope_under_a_low_zone_is_climbed_aslant(objective: str) -> None:
    p = replace(under_a_lid(), objective="energy" if objective == "energy" else "length")
    solution = optimal.plan(p)
    points = solution.path.points
    assert faults(p, solution.path) == []
    # The climb from the slope's foot to its top needs a track of five times its height.
    rise_m = SLOPE * 400.0 - ROOM_M
    track_m = float(np.hypot(*np.diff(points[:, :2], axis=0).T).sum())
    least_m = 1200.0 + 5.0 * rise_m
    assert least_m <= track_m <= 1.05 * least_m
    assert solution.lower_bound is not None
    assert solution.lower_bound <= p.cost(solution.path)


@pytest.mark.nightly_but("length")
@pytest.mark.slow
@pytest.mark.parametrize("objective", ["length", "energy"])
def test_the_track_over_the_lattice_has_way_enough_to_climb(objective: str) -> None:
    found = traverse(replace(under_a_lid(), objective="energy" if objective == "energy" else "length"), 2200.0)
    assert found is not None
    track_m = float(np.hypot(*np.diff(found[0], axis=0).T).sum())
    assert 1200.0 + 5.0 * (SLOPE * 400.0 - ROOM_M) - 1.0 <= track_m <= 2200.0


@pytest.mark.nightly
def test_a_path_over_such_a_track_is_better_than_one_with_laps() -> None:
    p = under_a_lid()
    below = looked(p).incumbent
    found = traverse(p, 2200.0)
    assert found is not None
    assert below.take_longer(found, fine=True)
    assert below.best is not None
    assert faults(p, Path(below.best)) == []
