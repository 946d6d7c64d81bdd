"""The altitudes that zones over ground shut within reach, compared with the exact check at many places."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.navmesh.clearance import mesh_of
from gcsplan.planners.optimal.navmesh.grid import make_plane
from gcsplan.planners.optimal.navmesh.interval_kernels import range_along
from gcsplan.planners.optimal.navmesh.mesh import Mesh
from gcsplan.planners.optimal.plane.altitude_intervals import MOST_INTERVALS, intervals, ranges
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.planners.optimal.navmesh.test_mesh import EVERYWHERE, SIZE_M, STEP_M, free, polygon, terrain, turned_grid
from tests.support.effort import draws, worlds

LIMITS = Limits(min_agl_m=20.0, horizontal_clearance_m=30.0, track_error_m=3.0, altitude_error_m=5.0)
TOP_M = 480.0


def legal(problem: Problem, places: Floats, amsl_m: Floats) -> Bools:
    """(N,) whether the exact check passes a place at an altitude."""
    start = np.column_stack([places, amsl_m])
    return problem.airspace.clear(
        Legs.between(start, start + np.array([1e-4, 0.0, 0.0]), problem.limits), problem.limits
    )


def over_ground(rng: np.random.Generator, count: int) -> list[Zone]:
    """Zones whose levels follow the ground; of some, one level is above sea level or missing, of every fifth both."""
    out = []
    for k in range(count):
        floor, ceiling = np.sort(rng.uniform(25.0, 200.0, 2)).tolist()
        if k % 5 == 4:
            lid = bool(rng.integers(2))
            level = Level(float(rng.uniform(250.0, 450.0)), "amsl")
            shape = Circle(*rng.uniform(0.3 * SIZE_M, 0.7 * SIZE_M, 2).tolist(), float(rng.uniform(100.0, 250.0)))
            out.append(Zone(f"z{k}", shape, None if lid else level, level if lid else None))
            continue
        datum: Literal["agl", "amsl"] = "amsl" if k % 4 == 3 else "agl"
        top = Level(ceiling + (200.0 if datum == "amsl" else 0.0), datum)
        at = rng.uniform(0.2 * SIZE_M, 0.8 * SIZE_M, 2).tolist()
        shape = polygon(rng, False) if k % 2 else Circle(*at, float(rng.uniform(15.0, 140.0)))
        kind = rng.integers(3)
        out.append(Zone(f"z{k}", shape, None if kind == 0 else Level(floor, "agl"), None if kind == 1 else top))
    return out


def intervals_of(mesh: Mesh) -> tuple[Floats, Floats, Floats]:
    every = np.arange(len(mesh.piece))
    return intervals(mesh, every, *ranges(mesh, TOP_M, every), 1e-3)


@pytest.mark.nightly_but("2-None-False")
@pytest.mark.first_quick
@pytest.mark.draws
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("parts", "max_agl_m"), [(2, None), (5, None), (2, 90.0)])
def test_no_altitude_that_the_exact_check_passes_is_shut(turned: bool, parts: int, max_agl_m: float | None) -> None:
    rng = np.random.default_rng([parts, turned])
    passed = near = 0
    for _ in range(worlds(4)):
        grid = turned_grid(float(rng.uniform(-30.0, 30.0)), float(rng.uniform(-0.4, 0.4))) if turned else None
        surface = terrain(rng, 25.0, grid)
        zones = over_ground(rng, 5)
        limits = replace(LIMITS, max_agl_m=max_agl_m)
        problem = Problem(Airspace(surface, zones), limits, (10.0, 10.0, 400.0), (590.0, 590.0, 400.0))
        plane = make_plane(problem, EVERYWHERE, parts)
        single = mesh_of(plane, TOP_M, True, single=True)
        count, low, high = intervals_of(single)
        c, r = rng.uniform(2 * parts, plane.x.shape[1] - 1 - 2 * parts, (2, 1500))
        places = surface.grid.to_plane(c / parts + plane.col0, plane.row1 - r / parts)
        ground = surface.ground_at(places[:, 0], places[:, 1])
        cell = r.astype(int) * (plane.x.shape[1] - 1) + c.astype(int)
        open_below = np.zeros(len(places), np.bool_)
        for _ in range(8):
            z = np.minimum(ground + rng.uniform(25.0, 230.0, len(places)), TOP_M)
            ok = legal(problem, places, z)
            held = (
                (z[:, None] >= low[cell]) & (z[:, None] <= high[cell]) & (np.arange(MOST_INTERVALS) < count[cell, None])
            )
            assert held.any(axis=1)[ok].all(), places[ok & ~held.any(axis=1)]
            passed += int(ok.sum())
            near += int((~held.any(axis=1)).sum())
            open_below |= ok
        for fineness in (1, 3):
            some = np.flatnonzero(open_below)[:200]
            assert free(mesh_of(plane, TOP_M, True, fineness), places[some]).all()
    assert passed > (5000 if max_agl_m is None else 1500)
    assert near > 1000


@pytest.mark.slow
@pytest.mark.first_quick
@pytest.mark.parametrize(("slope", "open_"), [(0.05, True), (0.5, False)])
@pytest.mark.parametrize("under", [True, False])
def test_a_steep_slope_shuts_what_is_left_below_a_zone_and_above_it(slope: float, open_: bool, under: bool) -> None:
    """8 m are left below a floor, or over a ceiling: on a slope, ground 33 m aside takes more than that."""
    n = round(SIZE_M / STEP_M) + 1
    z = 200.0 + slope * STEP_M * np.arange(n) * np.ones((n, 1))
    surface = Surface(z, z, GridMap.affine(0.0, SIZE_M, STEP_M, STEP_M))
    zone = Circle(300.0, 300.0, 200.0)
    zones = [Zone("low", zone, Level(38.0, "agl"), None) if under else Zone("lid", zone, None, Level(100.0, "agl"))]
    problem = Problem(Airspace(surface, zones), LIMITS, (10.0, 10.0, 400.0), (590.0, 590.0, 400.0))
    plane = make_plane(problem, EVERYWHERE, 5)
    at = np.array([303.0, 303.0])
    ground = float(surface.ground_at(*at))
    cap = TOP_M if under else ground + 113.0
    mesh = mesh_of(plane, cap, True, single=True)
    c, r = plane.at((float(at[0]), float(at[1])))
    cell = np.array([math.floor(r) * (mesh.excess.shape[1] - 1) + math.floor(c)])
    (count,), (low,), (high,) = intervals(mesh, cell, *ranges(mesh, cap, cell), 1e-3)
    left = [(a, b) for a, b in zip(low[:count], high[:count], strict=True) if b - a > 0.01]
    tries = np.arange(ground, cap, 0.25)
    assert legal(problem, np.tile(at, (len(tries), 1)), tries).any() == open_
    assert bool(left) == open_
    for fineness in (1, 3):
        assert free(mesh_of(plane, cap, True, fineness), at[None]).all() == open_


@pytest.mark.parametrize(("slope", "open_"), [(0.05, True), (0.5, False)])
def test_a_steep_slope_shuts_what_is_left_between_two_zones(slope: float, open_: bool) -> None:
    """3 m are left over a lid above sea level and under the floor above ground of another zone."""
    n = round(SIZE_M / STEP_M) + 1
    z = 200.0 + slope * STEP_M * np.arange(n) * np.ones((n, 1))
    surface = Surface(z, z, GridMap.affine(0.0, SIZE_M, STEP_M, STEP_M))
    at = np.array([303.0, 303.0])
    ground = float(surface.ground_at(*at))
    lid = Zone("lid", Circle(300.0, 300.0, 200.0), None, Level(ground + 90.0, "amsl"))
    high = Zone("high", Circle(300.0, 300.0, 200.0), Level(90.0 + 10.0 + 3.0 + 33.0 * 0.05, "agl"), None)
    problem = Problem(Airspace(surface, [lid, high]), LIMITS, (10.0, 10.0, 400.0), (590.0, 590.0, 400.0))
    plane = make_plane(problem, EVERYWHERE, 5)
    tries = np.arange(ground, TOP_M, 0.1)
    assert legal(problem, np.tile(at, (len(tries), 1)), tries).any() == open_
    for fineness in (1, 3):
        assert free(mesh_of(plane, TOP_M, True, fineness), at[None]).all() == open_


@given(st.integers(0, 2**31))
@settings(max_examples=draws(80))
def test_the_altitudes_along_a_track_are_those_of_each_place_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size, count, step = int(rng.integers(1, 70)), int(rng.integers(0, 30)), float(rng.uniform(0.1, 50.0))
    low, away = rng.normal(0.0, 1.0, count), step * rng.uniform(-0.2, 1.2 * size, count)
    high = low + rng.uniform(-0.3, 2.0, count)
    limit, slack = step * rng.uniform(0.5, 1.5) * size, step * float(rng.choice([0.0, rng.uniform(0.0, 10.0)]))
    left = limit - away - step * rng.uniform(-2.0, size, count)
    away[rng.random(count) < 0.1] = left[rng.random(count) < 0.1] = np.inf
    lows, highs = (np.full((size.bit_length(), size), fill) for fill in (np.inf, -np.inf))
    range_along(low, high, away, left, limit, slack, step, lows, highs)
    for k in range(size):
        s = (k + 1) * step
        there = (away - slack <= s) & (s <= limit - left) & (low <= high) & np.isfinite(away) & np.isfinite(left)
        assert lows[0, k] == min(low[there], default=np.inf)
        assert highs[0, k] == max(high[there], default=-np.inf)
