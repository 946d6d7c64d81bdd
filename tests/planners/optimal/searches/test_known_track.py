"""A path that was legal before: drawn through other ends and vias, and taken only if the exact check passes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.planners.optimal.searches.known_track import KnownTrack, through_places
from gcsplan.planners.problem import Via, passes_vias
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support.planner_worlds import faults
from tests.support.searches import over_flat, work_of

DISC = Zone("disc", Circle(1000.0, 1000.0, 100.0))


def test_a_known_path_is_taken_if_it_is_legal_between_the_new_ends() -> None:
    problem = over_flat(DISC)
    beside = np.array([[800.0, 1300.0, problem.start[2]], [1000.0, 1300.0, problem.start[2]]])
    search = KnownTrack(work_of(replace(problem, known=beside)))
    assert search.applies()
    search.run()
    assert search.incumbent.best is not None
    assert faults(problem, Path(search.incumbent.best)) == []
    assert tuple(search.incumbent.best[0]) == problem.start
    assert tuple(search.incumbent.best[-1]) == problem.goal


def test_a_known_path_through_a_zone_is_not_taken() -> None:
    problem = over_flat(DISC)
    search = KnownTrack(work_of(replace(problem, known=np.array([[1000.0, 1000.0, problem.start[2]]]))))
    search.run()
    assert search.incumbent.best is None
    assert not search.incumbent.proved_infeasible


def test_without_a_known_path_there_is_nothing_to_try() -> None:
    assert not KnownTrack(work_of(over_flat(DISC))).applies()


@pytest.mark.parametrize("amsl_m", [None, 180.0])
def test_vias_stand_in_their_order_where_the_path_is_nearest(amsl_m: float | None) -> None:
    problem = over_flat(DISC)
    x, y, z = problem.start
    vias = Via(x + 10.0, y + 120.0, amsl_m), Via(x + 60.0, y + 265.0, None)
    known = np.array([[x, y + 100.0, z], [x, y + 200.0, z + 5.0], [x + 100.0, y + 300.0, z + 9.0]])
    points, stay = through_places(replace(problem, via=vias), known)
    assert passes_vias(replace(problem, via=vias), points)
    assert np.flatnonzero(stay).tolist() == [0, 2, 4, 6]
    assert len(points) == len(known) + 4
    if amsl_m is not None:
        assert amsl_m in points[:, 2]
