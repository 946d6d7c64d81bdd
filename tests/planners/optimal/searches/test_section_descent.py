"""The best path drawn together: never longer, and legal."""

from __future__ import annotations

import numpy as np

from gcsplan.planners.optimal.searches.section_descent import SectionDescent
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support.planner_worlds import faults
from tests.support.searches import over_flat, work_of

DISC = Zone("disc", Circle(1000.0, 1000.0, 100.0))


def test_a_detour_that_is_too_wide_is_drawn_together() -> None:
    problem = over_flat(DISC)
    search = SectionDescent(work_of(problem))
    assert not search.applies()
    wide = np.array(
        [problem.start, (700.0, 1200.0, 50.0), (1000.0, 1300.0, 50.0), (1300.0, 1200.0, 50.0), problem.goal]
    )
    search.incumbent.take(wide, np.array([True, False, False, False, True]))
    before = search.incumbent.cost
    assert search.applies()
    search.run()
    assert search.incumbent.best is not None
    assert search.incumbent.cost < 0.97 * before
    assert faults(problem, Path(search.incumbent.best)) == []
