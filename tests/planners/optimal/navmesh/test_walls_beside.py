"""Walls from the terrain beside a track: never higher than what the exact check demands."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.planners.optimal.navmesh.clearance import ClearanceGrid, PlaneSpec
from gcsplan.planners.optimal.navmesh.grid import lattice
from gcsplan.planners.optimal.navmesh.necks import walls_beside
from gcsplan.planners.optimal.navmesh.zone_shapes import CLOSE
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface


def rough(seed: int) -> Problem:
    """Terrain that rises by metres from node to node, with nodes 7 and 9 m apart."""
    rng = np.random.default_rng(seed)
    z = rng.normal(100.0, 4.0, (12, 13)) + np.cumsum(rng.normal(0.0, 3.0, 13))
    grid = GridMap.affine(0.0, 99.0, 7.0, 9.0)
    limits = Limits(min_agl_m=20.0, track_error_m=float(rng.uniform(1.0, 8.0)), altitude_error_m=2.0)
    return Problem(Airspace(Surface(z, z, grid)), limits, (10.0, 10.0, 300.0), (70.0, 80.0, 300.0))


@pytest.mark.nightly_but("0", "8", "9")
@pytest.mark.first_quick
@pytest.mark.parametrize("seed", range(12))
def test_walls_are_no_higher_than_the_exact_floor(seed: int) -> None:
    problem = rough(seed)
    rng = np.random.default_rng([seed, 1])
    parts = int(rng.integers(4, 12))
    plane = lattice(problem, (0, 0, 12, 11), parts, 1, 1, None, CLOSE)
    cap = 22.0 + float(np.median(problem.airspace.surface.ground_m))
    clearance = ClearanceGrid(plane, PlaneSpec(cap, True), whole=True)
    cols = clearance.shape[1]
    found = list(walls_beside(clearance))
    cell, walls = np.concatenate([c for c, _ in found]), np.concatenate([w for _, w in found])
    assert len(cell) > 300
    row, col = cell // (cols - 1), cell % (cols - 1)
    t, u = rng.random((2, len(cell)))
    corners = [(row, col), (row, col + 1), (row + 1, col + 1), (row + 1, col)]
    weights = [(1.0 - t) * (1.0 - u), (1.0 - t) * u, t * u, t * (1.0 - u)]
    east, north = (sum(w * z[at] for w, at in zip(weights, corners, strict=True)) for z in (plane.x, plane.y))
    floor = problem.floors(np.asarray(east), np.asarray(north)) - cap
    a, b, c, d = walls.T
    # Both ways to cut the cell into triangles.
    one = np.where(u >= t, a + u * (b - a) + t * (c - b), a + t * (d - a) + u * (c - d))
    other = np.where(u + t <= 1.0, a + u * (b - a) + t * (d - a), c + (1.0 - u) * (d - c) + (1.0 - t) * (b - c))
    known = np.isfinite(floor)
    assert (np.maximum(one, other)[known] <= floor[known] + 1e-9).all()
