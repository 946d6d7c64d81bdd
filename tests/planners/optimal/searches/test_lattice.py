"""When the lattice of reachable altitudes is searched, and for what share of the gap."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.planners.optimal.searches.lattice import LatticeSearch
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from tests.support.planner_worlds import ground
from tests.support.searches import work_of


def lattice(max_agl_m: float | None = None) -> LatticeSearch:
    problem = Problem(
        Airspace(ground(0.0), ()), Limits(10.0, max_agl_m=max_agl_m), (400.0, 1000.0, 20.0), (1500.0, 1000.0, 20.0)
    )
    return LatticeSearch(work_of(problem))


def know(search: LatticeSearch, gap: float) -> None:
    """Let a path be known that exceeds the bound by the part ``gap``."""
    incumbent = search.incumbent
    incumbent.best = np.array([incumbent.problem.start, incumbent.problem.goal])
    incumbent.cost = (1.0 + gap) * incumbent.bound


def test_it_runs_once_without_a_path_and_once_with_one_that_is_far_from_the_bound() -> None:
    search = lattice()
    assert search.is_open()
    assert search.share == search.FIRST[0]
    search.choose()
    assert search.seen == math.inf
    assert not search.is_open()
    know(search, 0.02)
    assert search.is_open()
    assert search.share == search.FAR_APART[0]
    search.choose()
    know(search, 0.01)
    assert not search.is_open()


@pytest.mark.parametrize(("gap", "share"), [(0.02, LatticeSearch.FAR_APART[0]), (0.007, LatticeSearch.SHARE)])
def test_the_farther_path_and_bound_are_apart_the_sooner_it_runs(gap: float, share: float) -> None:
    search = lattice()
    know(search, gap)
    assert search.is_open()
    assert search.share == share


def test_near_the_bound_it_does_not_run() -> None:
    search = lattice()
    know(search, 0.004)
    assert not search.is_open()


def test_under_a_maximum_agl_it_runs_soon_and_again_near_a_path() -> None:
    search = lattice(100.0)
    assert search.share == search.BAND[0]
    search.choose()
    know(search, 0.002)
    assert not search.is_open()
    know(search, 0.003)
    assert search.is_open()
    search.choose()
    know(search, 0.0029)
    assert not search.is_open()
