"""Tracks below the ceiling on a lattice of cells: a first path, and under a maximum AGL a bound alone."""

from __future__ import annotations

import pytest

from gcsplan.planners.optimal.searches.cap_search import CapSearch
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.planner_worlds import faults
from tests.support.searches import over_flat, work_of

DISC = Zone("disc", Circle(1000.0, 1000.0, 100.0))


def test_it_finds_a_first_legal_path_around_a_zone() -> None:
    problem = over_flat(DISC)
    search = CapSearch(work_of(problem))
    assert search.applies()
    search.run()
    assert search.incumbent.best is not None
    assert faults(problem, Path(search.incumbent.best)) == []
    assert 1400.0 < search.incumbent.cost < 1500.0
    assert not search.applies()  # a path is known


def test_under_a_maximum_agl_the_length_of_the_track_is_a_bound_and_no_path_is_tried() -> None:
    search = CapSearch(work_of(over_flat(DISC, max_agl_m=120.0)))
    before = search.incumbent.bound
    search.run()
    assert search.incumbent.best is None
    assert search.incumbent.bound >= before
    assert search.incumbent.bound <= 1430.0


@pytest.mark.parametrize("ceiling", [Level(130.0, "agl"), Level(130.0, "amsl")])
def test_under_a_maximum_agl_the_bound_leads_around_a_zone_with_a_higher_ceiling(ceiling: Level) -> None:
    zone = Zone("disc", DISC.shape, None, ceiling)
    below, above = (CapSearch(work_of(over_flat(zone, max_agl_m=most))) for most in (120.0, 140.0))
    below.run()
    above.run()
    around_m = below.incumbent.bound - above.incumbent.bound
    assert 5.0 < around_m < 50.0


def test_with_larger_slacks_a_path_is_found_that_is_longer_than_the_shortest_track() -> None:
    problem = over_flat(DISC)
    narrow, wide = CapSearch(work_of(problem), (0.0,)), CapSearch(work_of(problem), (0.0, 0.3))
    narrow.run()
    wide.run()
    assert narrow.incumbent.best is None  # the shortest track of cells is not flown as it is
    assert wide.incumbent.cost < 1500.0
