"""Climb cones: nodes that no path can have climbed to yet are shut, by machine code as by the plain functions."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.planners.optimal.navmesh import clearance
from gcsplan.planners.optimal.navmesh.clearance import ClearanceGrid, PlaneSpec
from gcsplan.planners.optimal.navmesh.climb_cones import hold_down, lift_lids, look_around, walk_around
from gcsplan.planners.optimal.navmesh.grid import lattice
from gcsplan.planners.optimal.navmesh.zone_shapes import CLOSE
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.both_ways import run_both_ways
from tests.support.planner_worlds import Floats, ground

CAP_M, SLOPE = 120.0, 0.2


def ridge(east_m: Floats, _north_m: Floats) -> Floats:
    """A ridge from south to north, 80 m high, 600 m east."""
    return np.asarray(np.clip(80.0 - 0.5 * np.abs(east_m - 600.0), 0.0, None))


def held(zones: tuple[Zone, ...] = ()) -> ClearanceGrid:
    limits = Limits(10.0, max_climb_deg=11.3, max_descent_deg=11.3)
    problem = Problem(Airspace(ground(ridge), zones), limits, (400.0, 1000.0, 20.0), (1600.0, 1000.0, 20.0))
    plane = lattice(problem, (0, 0, 100, 100), 1, 1, 1, None, CLOSE)
    grid = ClearanceGrid(plane, PlaneSpec(CAP_M, True), whole=True)
    grid.hold([(400.0, 1000.0, 20.0, SLOPE)])
    return grid


def test_a_ridge_too_near_to_the_start_is_shut_and_far_from_it_is_open() -> None:
    grid = held()
    open_before = ClearanceGrid(grid.plane, PlaneSpec(CAP_M, True), whole=True)
    row, col = 50 - grid.row, 30 - grid.col  # on the crest, 200 m east of the start: 60 m up at most
    piece = row * (grid.shape[1] - 1) + col
    assert (grid.mesh().piece[piece] < 0).all()
    assert (open_before.mesh().piece[piece] >= 0).any()
    far = (95 - grid.row) * (grid.shape[1] - 1) + col  # on the crest, 900 m north
    assert (grid.mesh().piece[far] >= 0).any()


def test_cones_are_alike_by_machine_code_and_plain_functions(monkeypatch: pytest.MonkeyPatch) -> None:
    kernels = (lift_lids, look_around, walk_around, hold_down)
    ran = [run_both_ways(monkeypatch, clearance, kernel.__name__) for kernel in kernels]
    disc = Zone("disc", Circle(500.0, 1000.0, 60.0), None, Level(100.0, "amsl"))
    with np.errstate(all="ignore"):
        held((disc,))
    assert all(ran[k] for k in (0, 1, 3))
