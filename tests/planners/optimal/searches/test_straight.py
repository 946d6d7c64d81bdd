"""The straight track: the best path where it is legal, and no path where it is not."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.planners.optimal.searches.straight import Straight
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support.searches import over_flat, work_of


def test_a_legal_straight_track_is_the_path() -> None:
    search = Straight(work_of(over_flat()))
    assert search.applies()
    search.run()
    assert search.incumbent.cost == pytest.approx(1400.0)
    assert search.incumbent.best is not None
    assert np.allclose(search.incumbent.best[[0, -1]], [over_flat().start, over_flat().goal])


def test_through_a_zone_there_is_no_path_by_it() -> None:
    search = Straight(work_of(over_flat(Zone("disc", Circle(1000.0, 1000.0, 100.0)))))
    search.run()
    assert search.incumbent.best is None


def test_it_is_the_cheapest_of_all_searches_so_that_it_comes_first() -> None:
    from gcsplan.planners.optimal.table import all_searches

    work = work_of(over_flat(Zone("disc", Circle(1000.0, 1000.0, 100.0))))
    seconds = {search.NAME: search.size()[0] for search in all_searches(work) if search.applies()}
    assert min(seconds, key=lambda name: seconds[name]) == "straight"
