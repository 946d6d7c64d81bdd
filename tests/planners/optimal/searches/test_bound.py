"""Bounds of the cost: over several legs, of which each that is better leaves the others fewer metres, and of energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.bench.terrain.problems import problems
from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch
from gcsplan.planners.optimal.planner import search
from gcsplan.planners.optimal.searches.bound import (
    BY_INTERVALS,
    PLAIN,
    REFINED,
    SHARES,
    Bound,
    bound_cheaper,
    longest_track,
)
from gcsplan.planners.problem import Problem, Via
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from tests.support.planner_worlds import Floats, ground
from tests.support.searches import work_of


@pytest.mark.nightly
def test_bound_over_several_legs_goes_on_while_legs_get_better() -> None:
    """Before each ridge the climb takes more metres than there are. With one cut after a prediction, and without what
    the legs' own bounds prove, the gap was 31 %."""

    def ridges(east: Floats, north: Floats) -> Floats:
        away = np.minimum(np.abs(east - 600.0), np.abs(east - 1350.0))
        return np.maximum(0.0, 80.0 - 0.5 * away) * (np.abs(north - 1100.0) < 400.0)

    limits = Limits(min_agl_m=10.0, max_climb_deg=10.0, max_descent_deg=10.0)
    problem = Problem(
        Airspace(ground(ridges), ()), limits, (400.0, 1000.0, 20.0), (1550.0, 1000.0, 20.0),
        via=(Via(975.0, 1000.0, 15.0),), budget=Budget(4.0, 500.0),
    )  # fmt: skip
    found = search(problem).incumbent
    assert found.best is not None
    assert found.gap < 0.2


@pytest.mark.nightly
def test_a_cost_that_the_climb_alone_exceeds_leaves_no_track() -> None:
    """Few metres of track and a climb that costs most: the length left for the track was negative."""
    axis = np.arange(0.0, 2001.0, 50.0)
    east, _ = np.meshgrid(axis, axis)
    hills = np.where(np.abs(east - 1000.0) < 60.0, 150.0, 0.0)
    problem = Problem(
        Airspace(Surface(hills, hills, GridMap.affine(0.0, 2000.0, 50.0, 50.0)), ()), Limits(10.0),
        (800.0, 1000.0, 30.0), (1200.0, 1000.0, 25.0), objective="energy", vertical_j_per_m=6000.0,
        horizontal_j_per_m=1.0, budget=Budget(1.0, 200.0),
    )  # fmt: skip
    found = search(problem).incumbent
    assert found.best is not None
    assert found.bound <= found.cost * (1.0 + 1e-9)
    plane = PlaneSearch(found)
    assert plane.reach_longest()
    for part in (0.01, 0.5, 0.9):
        assert longest_track(plane, part * found.cost) >= sum(leg.lower_m for leg in plane.legs)
        assert 0.0 < bound_cheaper(plane, part * found.cost) <= found.cost * (1.0 + 1e-9)


@pytest.mark.slow
@pytest.mark.nightly_but("0 zones-0.5")
@pytest.mark.parametrize(("zones", "gap_percent"), [("0 zones", 0.5), ("40 zones", 1.0)])
def test_a_wall_that_only_finer_cells_close_is_closed_for_energy_too(zones: str, gap_percent: float) -> None:
    """A detour of 17 km for 7.6 km. Larger cells leave the wall open, and the bound was a third below the path; with 40
    zones no line that climbs little was legal, and no path was found."""
    (problem,) = (
        one.problem for one in problems("energy", 4, errors=True) if one.name == f"energy 4/02, {zones}"
    )  # fmt: skip
    found = search(replace(problem, budget=Budget(20.0, 1024.0, clocked=False))).incumbent
    assert found.best is not None
    assert not problem.airspace.examine(Legs.of_path(found.best, problem.limits), problem.limits).violations
    assert 100.0 * found.gap < gap_percent


def with_a_path(cost: float, bound: float, limits: Limits) -> Bound:
    """The search of bounds where the best path costs ``cost``."""
    problem = Problem(Airspace(ground(0.0), ()), limits, (400.0, 1000.0, 20.0), (1500.0, 1000.0, 20.0))
    work = work_of(problem)
    work.incumbent.best = np.array([problem.start, problem.goal])
    work.incumbent.cost, work.incumbent.bound = cost, bound
    return Bound(work)


def efforts(search: Bound) -> list[float]:
    """The shares with which a search is open, one after another."""
    out = []
    while search.is_open() and len(out) < 10:
        out.append(search.share)
        assert search.nearer == (search.share == SHARES[PLAIN])
        search.choose()
    return out


def test_its_effort_rises_and_begins_again_after_a_better_path() -> None:
    search = with_a_path(1500.0, 1100.0, Limits(10.0, max_climb_deg=10.0))
    assert efforts(search) == [SHARES[PLAIN], SHARES[BY_INTERVALS], SHARES[REFINED]]
    search.incumbent.cost = 1490.0
    assert efforts(search) == [SHARES[PLAIN]]


def test_efforts_that_cannot_help_are_left_out() -> None:
    assert efforts(with_a_path(1500.0, 1100.0, Limits(10.0))) == [SHARES[PLAIN], SHARES[REFINED]]
    assert efforts(with_a_path(1100.1, 1100.0, Limits(10.0))) == [SHARES[PLAIN]]  # the gap is as small as wanted
    band = Limits(10.0, max_agl_m=100.0, max_climb_deg=10.0)
    assert efforts(with_a_path(1500.0, 1100.0, band)) == []
