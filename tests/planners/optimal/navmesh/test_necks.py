"""Meshes with necks: whatever the exact check passes has its way in them, and narrow ridges shut."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.navmesh.clearance import ClearanceGrid, PlaneSpec
from gcsplan.planners.optimal.navmesh.grid import Plane, make_plane
from gcsplan.planners.optimal.navmesh.mesh import Mesh
from gcsplan.planners.optimal.navmesh.necks import Necks
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from tests.planners.optimal.navmesh.test_mesh import EVERYWHERE, WORLDS, inner, world_of
from tests.support import effort
from tests.support.effort import worlds

Place = tuple[float, float]

ENOUGH = 8
"""Lines that pass, of which the quick suite takes no more in a world."""


def grid_of(plane: Plane, cap_m: float, fineness: int) -> ClearanceGrid:
    return ClearanceGrid(plane, PlaneSpec(cap_m, True), fineness, whole=True)


def with_necks(plane: Plane, cap_m: float, fineness: int, ends: Floats, looks: list[Floats]) -> Mesh:
    """The mesh for bounds with necks at places along tracks."""
    necks = Necks(plane, fineness, cap_m, ends)
    for places in looks:
        necks.look(plane, places)
    return necks.mesh(grid_of(plane, cap_m, fineness))


def passed(problem: Problem, points: Floats, z: Floats) -> bool:
    """Whether the exact check passes a polyline (N, 2) at altitudes (N,)."""
    path = np.column_stack([points, z])
    return bool(problem.airspace.clear(Legs.between(path[:-1], path[1:], problem.limits), problem.limits).all())


@pytest.mark.first_quick
@pytest.mark.nightly_but("tall-clearance", "turned-clearance")
@pytest.mark.draws
@pytest.mark.parametrize(
    "limits", ["clearance", *(pytest.param(k, marks=pytest.mark.nightly) for k in ("bare", "errors"))]
)
@pytest.mark.parametrize("world", WORLDS)
def test_lines_that_the_exact_check_passes_lead_through_necks(world: str, limits: str) -> None:
    rng = np.random.default_rng([31, *world.encode(), *limits.encode()])
    held = split = 0
    for k in range(worlds(2)):
        problem, plane, cap = world_of(rng, world, limits, 1 + k % 2)
        for a in inner(rng, 60, plane):
            if held >= ENOUGH and not effort.full:
                break
            points = a + np.vstack([np.zeros(2), np.cumsum(rng.normal(0.0, 50.0, (2, 2)), axis=0)])
            floor = problem.airspace.floor_amsl(points[:, 0], points[:, 1], problem.limits)
            if not any(
                passed(problem, points, np.minimum(z, cap))
                for z in (np.full(3, cap), floor, floor + 20.0)
                if (z < 1e4).all()
            ):
                continue
            along = np.vstack([p + np.linspace(0.2, 0.8, 4)[:, None] * (q - p) for p, q in pairwise(points)])
            mesh = with_necks(plane, cap, 1 + k % 3, points[[0, 2]], [along, along + rng.normal(0.0, 30.0, 2)])
            split += len(mesh.parts_of)
            start, goal = ((float(x), float(y)) for x, y in points[[0, 2]])
            way = mesh.track(start, goal)
            length = float(np.hypot(*np.diff(points, axis=0).T).sum())
            assert way is not None, points
            assert way.length_m <= length * (1.0 + 1e-9), points
            held += 1
    assert held > 5
    assert split > held


def ridge(gap_m: float, across: bool) -> tuple[Problem, float]:
    """A pass over a ridge along a line of the terrain model's nodes, or between two of them, that lies ``gap_m`` under
    the cap where the exact check's floor is lowest."""
    z = np.zeros((41, 41))
    rows = slice(20, 21) if not across else slice(20, 22)
    z[rows] = np.abs(np.arange(41) - 20.0) * 9.0 + 60.0
    grid = GridMap.affine(0.0, 1200.0, 30.0, 30.0)
    surface = Surface(z, z, grid)
    limits = Limits(min_agl_m=20.0, track_error_m=3.0, altitude_error_m=2.0)
    problem = Problem(Airspace(surface), limits, (600.0, 300.0, 60.0), (600.0, 900.0, 60.0))
    east = np.linspace(590.0, 610.0, 2001)
    lowest = float(problem.floors(east, np.full(2001, 600.0 if not across else 585.0)).min())
    return problem, lowest + gap_m


@pytest.mark.nightly_but("-0.03-False-True", "0.02-True-True", "-0.03-True-True", "0.02-True-False", "0.02-False-True")
@pytest.mark.first_quick
@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize("across", [False, True])
@pytest.mark.parametrize("gap_m", [0.02, -0.03])
def test_a_pass_is_open_or_shut_by_centimetres(gap_m: float, across: bool, at_once: bool) -> None:
    problem, cap_m = ridge(gap_m, across)
    plane = make_plane(problem, EVERYWHERE, 2)
    ends = np.array([problem.start[:2], problem.goal[:2]])
    start, goal = problem.start[:2], problem.goal[:2]
    places = np.array([[600.0, north] for north in np.arange(560.0, 640.0, 4.0)])
    # Looked at place by place, the pass leads from neck to neck.
    looks = [places] if at_once else [*places[:, None], *(places + np.array([90.0, 0.0]))[:, None]]
    mesh = with_necks(plane, cap_m, 1, ends, looks)
    assert grid_of(plane, cap_m, 1).mesh().track(start, goal) is not None  # cells of 15 m do not show the ridge
    way = mesh.track(start, goal)
    assert (way is not None) == (gap_m > 0.0)
    if way is not None:
        assert way.length_m == pytest.approx(math.dist(start, goal), abs=0.05)
