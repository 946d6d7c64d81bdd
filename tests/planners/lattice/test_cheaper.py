"""Paths that are cheaper than a known one: a steep slope is climbed aslant, because a zone a few metres above it
prevents anything else; and a line is pulled on the sides of zones that its path passes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.planners.lattice.corridor_raster import make_guide
from gcsplan.planners.lattice.planner import _sides, _weight, cheaper
from gcsplan.planners.lattice.routes import LEVELS, Router
from gcsplan.planners.optimal import planner as optimal
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.limits import Limits
from gcsplan.world.path import Path
from gcsplan.world.zones import Circle, Level, Zone
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


@pytest.mark.first_quick
@pytest.mark.parametrize("objective", ["length", "energy"])
def test_the_track_over_the_lattice_has_way_enough_to_climb(objective: str) -> None:
    p = replace(under_a_lid(), objective="energy" if objective == "energy" else "length")
    found = Router.at(p, LEVELS[0]).way(weight=_weight(p))
    assert found is not None
    track_m = float(np.hypot(*np.diff(found, axis=0).T).sum())
    assert 1200.0 + 5.0 * (SLOPE * 400.0 - ROOM_M) - 1.0 <= track_m <= 2200.0


def test_a_line_is_pulled_on_the_side_of_a_zone_that_its_path_passes_it_on() -> None:
    # There are more altitudes above the zone than below it, but the path goes below it.
    gentle = Limits(10.0, max_amsl_m=400.0, max_climb_deg=45.0, max_descent_deg=45.0)
    zone = Zone("interval", Circle(1000.0, 1000.0, 250.0), Level(40.0, "amsl"), Level(100.0, "amsl"))
    p = Problem(Airspace(ground(0.0), [zone]), gentle, (200.0, 1000.0, 80.0), (1800.0, 1000.0, 80.0))
    under = np.array([[200.0, 1000.0, 80.0], [600.0, 1100.0, 30.0], [1400.0, 1100.0, 30.0], [1800.0, 1000.0, 80.0]])
    over = under.copy()
    over[1:3, 2] = 120.0
    ends, free = np.array([True, False, False, True]), np.full(4, np.nan)
    for path, side in ((under, False), (over, True)):
        assert faults(p, Path(path)) == []
        assert _sides(p, path, ends, free) == {0: side}
        better = cheaper(p, lambda *_: None, path, 1700.0, p.budget.goes_on)
        assert better is not None
        assert faults(p, Path(better)) == []
        assert p.cost(Path(better)) < p.cost(Path(path))
        guide = make_guide(p, [path[:, :2]], 300.0, {0: side})
        row, col = round((1000.0 - guide.south_m) / guide.step_m), round((1000.0 - guide.west_m) / guide.step_m)
        room = guide.floor_m[row, col], guide.ceiling_m[row, col]
        assert room == pytest.approx((100.0, 400.0) if side else (10.0, 40.0))


def test_a_path_that_climbs_aslant_is_better_than_one_with_laps() -> None:
    p = under_a_lid()
    below = looked(p).incumbent
    assert below.best is not None
    found = cheaper(p, below.tell, below.best, 2200.0, p.budget.goes_on)
    assert found is not None
    assert p.cost(Path(found)) < below.cost
    assert faults(p, Path(found)) == []
