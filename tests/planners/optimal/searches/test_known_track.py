"""A path that was legal before: drawn through other ends and vias, and taken only if the exact check passes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.searches.known_track import KnownTrack, through_places
from gcsplan.planners.problem import Problem, Via, passes_vias
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Zone
from tests.support.planner_worlds import faults, ground
from tests.support.searches import over_flat, work_of

DISC = Zone("disc", Circle(1000.0, 1000.0, 100.0))


def taken(problem: Problem, *known: tuple[float, float, float]) -> Floats | None:
    """What the search makes of a known path."""
    search = KnownTrack(work_of(replace(problem, known=np.array(known))))
    assert search.applies()
    search.run()
    best = search.incumbent.best
    if best is not None:
        assert faults(problem, Path(best)) == []
        assert (tuple(best[0]), tuple(best[-1])) == (problem.start, problem.goal)
    assert not search.incumbent.proved_infeasible
    return best


def test_a_known_path_is_taken_if_it_is_legal_between_the_new_ends() -> None:
    problem = over_flat(DISC)
    beside = [(800.0, 1300.0, 50.0), (1000.0, 1300.0, 50.0)]
    assert taken(problem, (280.0, 1000.0, 50.0), *beside, (1720.0, 1000.0, 50.0)) is not None


def test_a_known_path_through_a_zone_is_not_taken() -> None:
    problem = over_flat(DISC)
    assert taken(problem, problem.start, (1000.0, 1000.0, 50.0), problem.goal) is None


def test_past_a_zone_a_known_path_leads_by_way_of_its_old_end() -> None:
    problem = over_flat(DISC)
    best = taken(problem, problem.start, (1000.0, 1300.0, 50.0), (1300.0, 1000.0, 50.0))
    assert best is not None
    assert len(best) == 3  # straight from the way point to the goal
    best = taken(problem, problem.start, (1000.0, 1150.0, 50.0))
    assert best is not None
    assert (1000.0, 1150.0, 50.0) in list(map(tuple, best.tolist()))


def test_over_a_hill_before_the_new_end_a_known_path_gets_another_profile() -> None:
    flat = over_flat()
    hill = ground(lambda east_m, north_m: 60.0 * np.exp(-(((east_m - 1500.0) / 120.0) ** 2)))
    problem = replace(flat, airspace=Airspace(hill, ()))
    best = taken(problem, flat.start, (1200.0, 1000.0, 50.0), (1300.0, 1000.0, 50.0))
    assert best is not None
    assert best[:, 2].max() > 50.0


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
