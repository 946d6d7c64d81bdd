"""A bound where zones can be passed over: around each, or over it with the whole climb."""

from __future__ import annotations

from gcsplan.planners.optimal.searches.outline_bound import CASE_S, OutlineBound
from gcsplan.planners.optimal.searches.outlines import Outlines
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.searches import over_flat, work_of

TOWER = Zone("tower", Circle(1000.0, 1000.0, 100.0), None, Level(400.0, "amsl"))


def test_it_waits_for_outlines_that_can_be_passed_over() -> None:
    work = work_of(over_flat(TOWER))
    search = OutlineBound(work)
    assert not search.applies()
    Outlines(work).run()
    assert search.applies()
    assert search.size()[0] == CASE_S * 2
    shut = work_of(over_flat(Zone("wall", TOWER.shape)))
    Outlines(shut).run()
    assert not OutlineBound(shut).applies()


def test_a_high_tower_is_flown_around_and_the_bound_knows_it() -> None:
    work = work_of(over_flat(TOWER))
    Outlines(work).run()
    before = work.incumbent.bound
    OutlineBound(work).run()
    assert before <= work.incumbent.bound <= work.incumbent.cost
    assert work.incumbent.bound > 1410.0  # around it are 1414 m; over it it climbs 360 m
