"""Paths along the tracks of bounds: a missed notch is found, a blocked notch is not, and vias are still passed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.bench.terrain.problems import problems
from gcsplan.planners.lattice.planner import plan_band
from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.optimal.searches import bound_corridor
from gcsplan.planners.optimal.searches.bound_corridor import over_pass
from gcsplan.planners.problem import Problem, Via
from gcsplan.world.geometry.path import Path
from tests.planners.optimal.navmesh.test_necks import ridge as pass_over_a_ridge
from tests.planners.optimal.searches.test_notches import MIDDLE_M, ROUND_M, STRAIGHT_M, ridge
from tests.support.planner_worlds import faults
from tests.support.searches import improve, looked


def through(over_m: float, **more: object) -> Workspace:
    """A workspace with a path around the ridge and the track of a bound through its notch."""
    problem = replace(ridge(over_m, 0.2, 80.0, True), **more)  # type: ignore[arg-type]
    work = looked(problem)
    below, plane = work.incumbent, work.plane
    assert below.best is None
    below.take(plan_band(problem, below.tell))
    assert below.cost > ROUND_M
    for leg in plane.legs:
        limit_m = 1.05 * leg.straight_m
        leg.bound(plane.top_m, leg.corridor(limit_m), limit_m)
    return work


@pytest.mark.slow
def test_a_path_leads_through_a_notch_that_was_passed_by() -> None:
    work = through(0.1)
    below = work.incumbent
    assert bound_corridor.follow(work.plane)
    assert below.best is not None
    assert below.cost < STRAIGHT_M
    assert faults(below.problem, Path(below.best)) == []
    assert not bound_corridor.follow(work.plane)  # there is no other notch


def test_slits_are_not_looked_for_before_a_stretch_was_flooded() -> None:
    """The flood may be refused, for it may be more work than is left."""
    problem = ridge(-0.3, 0.2, 80.0, True)
    work = Workspace(Incumbent(problem, piece=True))
    track = np.array([problem.start[:2], problem.goal[:2]])
    slits = bound_corridor.searches_of_stretch(work, track, work.plane.path_top_m, shut=True)[-1]
    assert not slits.is_open()
    work.plane.flood(0.008)
    assert slits.is_open()


@pytest.mark.slow
def test_a_notch_that_is_shut_is_left_alone() -> None:
    work = through(-0.3)
    before = work.incumbent.cost
    assert not bound_corridor.follow(work.plane)
    assert work.incumbent.cost == before


@pytest.mark.nightly
def test_stops_are_passed_as_before() -> None:
    work = through(0.1, via=(Via(500.0, MIDDLE_M + 30.0, 82.0),))
    below = work.incumbent
    assert below.best is not None
    stop = np.array([500.0, MIDDLE_M + 30.0, 82.0])
    stays = (np.abs(below.best - stop) < 1e-6).all(axis=1)
    stays[[0, -1]] = True
    assert (below.pinned == stays).all()
    assert bound_corridor.follow(work.plane)
    assert below.best is not None
    assert below.cost < STRAIGHT_M + 10.0
    assert below.pinned.sum() == 3
    assert np.abs(below.best[below.pinned][1] - stop).max() < 1e-6
    assert faults(below.problem, Path(below.best)) == []


@pytest.mark.nightly
def test_the_planner_asks_for_it() -> None:
    work = through(0.1)
    improve(work)
    assert work.incumbent.cost < STRAIGHT_M
    assert work.incumbent.gap < 0.003


@pytest.mark.parametrize("across", [False, True])
@pytest.mark.parametrize("aside_m", [0.0, 1.37, -2.9])
def test_a_track_is_moved_aside_to_the_line_on_which_a_pass_is_open(aside_m: float, across: bool) -> None:
    """The pass is open by 1.2 cm in height, and by centimetres in width."""
    problem, cap_m = pass_over_a_ridge(0.012, across)
    north = 585.0 if across else 600.0
    track = np.array([[600.0 + aside_m + 2.0, north - 60.0], [600.0 + aside_m, north], [604.0 + aside_m, north + 60.0]])
    assert (_dense(track, problem) > cap_m).any()
    moved = over_pass(problem, cap_m, track)
    assert (moved[[0, -1]] == track[[0, -1]]).all()
    assert (_dense(moved, problem) <= cap_m).all()
    assert len(moved) < 40


def _dense(track: Floats, problem: Problem) -> Floats:
    """The exact check's floors at places a centimetre apart."""
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track, axis=0).T))])
    t = np.linspace(0.0, s[-1], 12_001)
    return problem.floors(*(np.interp(t, s, track[:, k]) for k in range(2)))


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("seed", "name", "most_m"),
    [
        (301, "main 301/02, 40 zones", 11_690.0),
        (302, "main 302/05, 40 zones", 15_260.0),
        (502, "main 502/12, 0 zones", 20_580.0),
        (603, "main 603/02, 10 zones", 10_020.0),
        (603, "main 603/02, 40 zones", 10_590.0),
        (711, "main 711/01, 40 zones", 6_600.0),
    ],
)
def test_slits_and_passes_that_are_open_by_little_are_found(seed: int, name: str, most_m: float) -> None:
    """Without them the paths are 13,330, 15,639, 23,617 and 11,495 m long, and the last mission has none."""
    (problem,) = (found.problem for found in problems("main", seed, errors=True) if found.name == name)
    solution = plan(problem)
    assert faults(problem, solution.path) == []
    assert solution.lower_bound is not None
    assert solution.lower_bound < solution.path.length_m < most_m
