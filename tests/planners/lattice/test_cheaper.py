"""Paths that are cheaper than a known one: a steep slope is climbed aslant, because a zone a few metres above it
prevents anything else; and a line is pulled on the sides of zones that its path passes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.planners.lattice.corridor_raster import make_guide
from gcsplan.planners.lattice.planner import cheaper, pulled, sides_to_pass
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.exact import LegJudge
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.planners.optimal.searches.test_contour_climb import under_a_lid
from tests.support.planner_worlds import faults, ground
from tests.support.searches import looked


def past_a_zone() -> tuple[Problem, tuple[Floats, Floats]]:
    """From west to east past a zone with more altitudes above it than below it, and paths under it and over it."""
    gentle = Limits(10.0, max_amsl_m=400.0, max_climb_deg=45.0, max_descent_deg=45.0)
    zone = Zone("interval", Circle(1000.0, 1000.0, 250.0), Level(40.0, "amsl"), Level(100.0, "amsl"))
    p = Problem(Airspace(ground(0.0), [zone]), gentle, (200.0, 1000.0, 80.0), (1800.0, 1000.0, 80.0))
    under = np.array([[200.0, 1000.0, 80.0], [600.0, 1100.0, 30.0], [1400.0, 1100.0, 30.0], [1800.0, 1000.0, 80.0]])
    over = under.copy()
    over[1:3, 2] = 120.0
    return p, (under, over)


@pytest.mark.slow
def test_a_line_is_pulled_on_the_side_of_a_zone_that_its_path_passes_it_on() -> None:
    p, (under, over) = past_a_zone()
    ends, free = np.array([True, False, False, True]), np.full(4, np.nan)
    for path, side in ((under, False), (over, True)):
        assert faults(p, Path(path)) == []
        assert sides_to_pass(p, path, ends, free) == {0: side}
        better = cheaper(p, lambda *_: None, path, 1700.0)
        assert better is not None
        assert faults(p, Path(better)) == []
        assert p.cost(Path(better)) < p.cost(Path(path))
        guide = make_guide(p, [path[:, :2]], 300.0, {0: side})
        row, col = round((1000.0 - guide.south_m) / guide.step_m), round((1000.0 - guide.west_m) / guide.step_m)
        room = guide.floor_m[row, col], guide.ceiling_m[row, col]
        assert room == pytest.approx((100.0, 400.0) if side else (10.0, 40.0))


@pytest.mark.slow
def test_a_chain_past_a_zone_is_pulled_to_a_shorter_path() -> None:
    p, chains = past_a_zone()
    for chain in chains:
        found = pulled(p, LegJudge(p), chain, np.array([True, False, False, True]), np.full(4, np.nan))
        assert found is not None
        points, stay = found
        assert faults(p, Path(points)) == []
        assert stay[[0, -1]].all()
        assert p.cost(Path(points)) < 0.99 * p.cost(Path(chain))


@pytest.mark.slow
def test_a_chain_through_a_wall_is_pulled_to_no_path() -> None:
    bare, (chain, _) = past_a_zone()
    wall = Zone("wall", Polygon(np.array([(900.0, -100.0), (1100.0, -100.0), (1100.0, 2100.0), (900.0, 2100.0)])))
    p = replace(bare, airspace=Airspace(bare.airspace.surface, [wall]))
    assert pulled(p, LegJudge(p), chain, np.array([True, False, False, True]), np.full(4, np.nan)) is None


@pytest.mark.nightly
def test_a_path_that_climbs_aslant_is_better_than_one_with_laps() -> None:
    p = under_a_lid()
    below = looked(p).incumbent
    assert below.best is not None
    found = cheaper(p, below.tell, below.best, 2200.0)
    assert found is not None
    assert p.cost(Path(found)) < below.cost
    assert faults(p, Path(found)) == []
