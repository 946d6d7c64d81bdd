"""The two meshes of the plane, compared with the exact check: places that it passes are free in the mesh for bounds,
and it passes all places that are free in the mesh for paths."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.navmesh.clearance import AROUND, ClearanceGrid, PlaneSpec, columns_around, mesh_of
from gcsplan.planners.optimal.navmesh.grid import Plane, make_plane
from gcsplan.planners.optimal.navmesh.mesh import Mesh
from gcsplan.planners.optimal.navmesh.zone_shapes import convex_parts
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import POWERS, GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.effort import draws, worlds

SIZE_M, STEP_M = 600.0, 30.0
EVERYWHERE = (-math.inf, -math.inf, math.inf, math.inf)
LEG_M = 1e-4
"""Length of the legs by which places are put to the exact check."""


def turned_grid(degrees: float, shear: float) -> GridMap:
    """A rotated and sheared grid in the plane, with node (0, 0) in the north-west."""
    a = math.radians(degrees)
    step = STEP_M * np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]]) @ np.array([[1, shear], [0, 1]])
    inverse = np.linalg.inv(step)
    coefficients = np.zeros((len(POWERS), 2))
    coefficients[POWERS.index((1, 0))] = inverse[:, 0]
    coefficients[POWERS.index((0, 1))] = -inverse[:, 1]
    return GridMap(coefficients, (0.0, SIZE_M), 1.0, 0.0)


def terrain(rng: np.random.Generator, relief_m: float, grid: GridMap | None = None, unknown: int = 0) -> Surface:
    n = round(SIZE_M / STEP_M) + 1
    z = rng.normal(0.0, 1.0, (n, n))
    for _ in range(int(rng.integers(0, 3))):
        z[1:-1, 1:-1] = 0.4 * z[1:-1, 1:-1] + 0.15 * (z[2:, 1:-1] + z[:-2, 1:-1] + z[1:-1, 2:] + z[1:-1, :-2])
    z = 200.0 + relief_m * z / z.std()
    for _ in range(unknown):
        z[tuple(rng.integers(0, n, 2))] = np.nan
    return Surface(z, z, grid or GridMap.affine(0.0, SIZE_M, STEP_M, STEP_M))


def level(rng: np.random.Generator, low: float, high: float, datum: str) -> Level:
    value = float(rng.uniform(low, high))
    return Level(value, "agl") if datum == "agl" else Level(200.0 + value, "amsl")


def polygon(rng: np.random.Generator, convex: bool) -> Polygon:
    """A star-shaped polygon around a random place, or a regular one if ``convex``."""
    corners = int(rng.integers(3, 9))
    turn = 2.0 * math.pi * np.arange(corners) / corners + rng.uniform(0.0, 6.0)
    radius = rng.uniform(40.0, 130.0) * (np.ones(corners) if convex else rng.uniform(0.35, 1.0, corners))
    at = rng.uniform(0.15 * SIZE_M, 0.85 * SIZE_M, 2)
    return Polygon(at + radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1))


def zones(rng: np.random.Generator, count: int, datum: str, kinds: str = "lfb") -> list[Zone]:
    """Zones with a ceiling (l), a floor (f), both (b), or neither (n)."""
    out = []
    for k in range(count):
        kind = kinds[int(rng.integers(len(kinds)))]
        at = rng.uniform(0.1 * SIZE_M, 0.9 * SIZE_M, 2)
        shape: Circle | Polygon = Circle(float(at[0]), float(at[1]), float(rng.uniform(20.0, 120.0)))
        if k % 3:
            shape = polygon(rng, k % 3 == 1)
        floor = level(rng, 30.0, 80.0, datum) if kind in "fb" else None
        ceiling = level(rng, 60.0, 160.0, datum) if kind in "lb" else None
        if kind == "b" and floor is not None and ceiling is not None and floor.value_m >= ceiling.value_m:
            floor, ceiling = ceiling, floor
        out.append(Zone(f"zone {k}", shape, floor, ceiling))
    return out


def problem_of(surface: Surface, zones: list[Zone], limits: Limits, scale: float = 1.0) -> Problem:
    return Problem(
        Airspace(surface, zones, scale=scale), limits, (10.0, 10.0, 400.0), (SIZE_M - 10.0, SIZE_M - 10.0, 400.0)
    )


def legal(problem: Problem, places: Floats, cap_m: float, heights: int = 40) -> Bools:
    """Whether the exact check passes each place at any of many altitudes up to a cap, (N,)."""
    air, limits = problem.airspace, problem.limits
    n = len(places)
    floor = air.floor_amsl(places[:, 0], places[:, 1], limits)
    ground = air.surface.ground_at(places[:, 0], places[:, 1])
    floor = np.where(np.isfinite(floor), np.minimum(floor, cap_m), cap_m)
    tries = [np.full(n, cap_m)]
    # Start 3 m below the floor, because the conservative floor may be too high.
    tries += [floor - 3.0 + t * (cap_m - floor + 3.0) for t in np.linspace(0.0, 1.0, heights)]
    for zone in air.zones:
        for at, sign in ((zone.floor, -1.0), (zone.ceiling, 1.0)):
            if at is not None:
                z = at.value_m + sign * (limits.altitude_error_m + 1e-3) + (ground if at.datum == "agl" else 0.0)
                tries.append(np.minimum(z, cap_m) + np.zeros(n))
    z = np.nan_to_num(np.stack(tries), nan=cap_m)
    start = np.concatenate([np.broadcast_to(places, (len(tries), n, 2)), z[..., None]], axis=-1).reshape(-1, 3)
    end = start + np.array([LEG_M, 0.0, 0.0])
    k = len(start)
    legs = Legs(
        start, end, np.zeros(k, np.bool_), np.full(k, limits.track_error_m), np.full(k, limits.altitude_error_m)
    )
    return np.asarray(air.clear(legs, limits).reshape(len(tries), n).any(axis=0))


def free(mesh: Mesh, places: Floats) -> Bools:
    """Whether places lie in a mesh's free area, (N,): the excess of their triangle is free there and has a piece."""
    out = np.zeros(len(places), np.bool_)
    rows, cols = mesh.excess.shape
    start, ends, joins = mesh.start, mesh.ends, mesh.joins
    assert len(start) == mesh.piece.max() + 2
    assert len(ends) == len(joins)
    for k, place in enumerate(places):
        c, r = mesh.plane.at((float(place[0]), float(place[1])))
        c, r = mesh.fineness * (c - mesh.col), mesh.fineness * (r - mesh.row)
        i, j = math.floor(c), math.floor(r)
        if not (0 <= i < cols - 1 and 0 <= j < rows - 1):
            continue
        n = j * (cols - 1) + i
        u, v = c - i, r - j
        lower = u >= v if mesh.diagonal[n] == 0 else u + v <= 1.0
        out[k] = mesh.piece[n, 0 if lower else 1] >= 0
    return out


def inner(rng: np.random.Generator, count: int, plane: Plane) -> Floats:
    """Random places over the lattice, not at its rim."""
    rows, cols = plane.x.shape
    c, r = rng.uniform(0.6, cols - 1.6, count), rng.uniform(0.6, rows - 1.6, count)
    return np.asarray(
        plane.problem.airspace.surface.grid.to_plane(c / plane.parts + plane.col0, plane.row1 - r / plane.parts)
    )


def away_from_rim(plane: Plane, at: Floats) -> Bools:
    """Which places (N,) have only known ground within reach, which a mesh resolves by cells, not metres."""
    surface = plane.problem.airspace.surface
    cell = surface.grid(at[:, 0], at[:, 1])
    holes = np.argwhere(np.isnan(surface.ground_m))[:, ::-1]
    away = np.abs(cell[:, None] - holes).max(axis=2).min(axis=1, initial=np.inf)
    rim = np.abs(cell / (np.array(surface.ground_m.shape[::-1]) - 1.0) - 0.5).max(axis=1)
    return np.asarray((rim < 0.44) & (away > 1.6))


LIMITS = {
    "bare": Limits(min_agl_m=40.0),
    "errors": Limits(min_agl_m=40.0, track_error_m=3.0, altitude_error_m=5.0),
    "clearance": Limits(min_agl_m=40.0, horizontal_clearance_m=25.0, track_error_m=2.0, altitude_error_m=3.0),
}
OF_BOUNDS = LIMITS | {"ceiling": Limits(min_agl_m=40.0, max_agl_m=110.0, track_error_m=3.0, altitude_error_m=5.0)}
"""A maximum AGL is known to meshes for bounds alone."""
WORLDS = {
    "hills": ("", 0, "lfb", "amsl", 20.0),
    "amsl": ("", 8, "lfb", "amsl", 12.0),
    "agl": ("", 8, "lfb", "agl", 12.0),
    "lids": ("", 8, "l", "agl", 25.0),
    "tall": ("", 8, "n", "amsl", 12.0),
    "turned": ("turned", 8, "lfbn", "amsl", 12.0),
}


def world_of(rng: np.random.Generator, world: str, limits: str, parts: int) -> tuple[Problem, Plane, float]:
    form, count, kinds, datum, relief = WORLDS[world]
    grid = turned_grid(float(rng.uniform(-30.0, 30.0)), float(rng.uniform(-0.4, 0.4))) if form else None
    surface = terrain(rng, relief, grid, unknown=2 if world == "hills" else 0)
    scale = float(rng.choice([1.0, 1.0004]))
    problem = problem_of(surface, zones(rng, count, datum, kinds), OF_BOUNDS[limits], scale)
    return problem, make_plane(problem, EVERYWHERE, parts), float(rng.uniform(250.0, 330.0))


@pytest.mark.nightly_but("hills-bare", "hills-clearance")
@pytest.mark.first_quick
@pytest.mark.draws
@pytest.mark.parametrize("limits", OF_BOUNDS)
@pytest.mark.parametrize("world", WORLDS)
def test_what_the_exact_check_passes_below_the_cap_is_free_in_the_mesh_for_bounds(world: str, limits: str) -> None:
    rng = np.random.default_rng([1, *world.encode(), *limits.encode()])
    passed = 0
    for k in range(worlds(3)):
        problem, plane, cap = world_of(rng, world, limits, 1 + k % 2)
        places = inner(rng, 200, plane)
        ok = legal(problem, places, cap)
        passed += int(ok.sum())
        for fineness in (1, 3):
            seen = free(mesh_of(plane, cap, True, fineness), places)
            assert seen[ok].all(), places[ok & ~seen]
    assert passed > 30


@pytest.mark.nightly_but("amsl-bare", "amsl-errors")
@pytest.mark.slow
@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("world", ["hills", "amsl", "tall", "lids"])
def test_ways_in_the_mesh_for_paths_pass_the_exact_check(world: str, limits: str) -> None:
    rng = np.random.default_rng([2, *world.encode(), *limits.encode()])
    held = 0
    for k in range(4):
        problem, plane, cap = world_of(rng, world, limits, 1 + k % 2)
        places = inner(rng, 250, plane)
        for fineness in (1, 4):
            mesh = mesh_of(plane, cap, False, fineness)
            found = [np.zeros((0, 2))]
            for a, b in zip(places[:32:2], places[1:32:2], strict=True):
                way = mesh.track((float(a[0]), float(a[1])), (float(b[0]), float(b[1])))
                if way is not None:
                    # The ends may lie in the blocked part of a triangle that is partly free.
                    found += [way.points[1:-1], 0.5 * (way.points[1:-2] + way.points[2:-1])]
            at = np.vstack(found)
            at = at[away_from_rim(plane, at)]
            ok = legal(problem, at, cap)
            assert ok.all(), at[~ok]
            held += len(at)
    assert held > 20


@pytest.mark.nightly_but("agl-bare", "hills-errors", "hills-bare")
@pytest.mark.first_quick
@pytest.mark.draws
@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("world", WORLDS)
def test_the_mesh_for_bounds_has_the_straight_way_wherever_the_exact_check_passes_it(world: str, limits: str) -> None:
    rng = np.random.default_rng([3, *world.encode(), *limits.encode()])
    held = 0
    for k in range(worlds(3)):
        problem, plane, cap = world_of(rng, world, limits, 1 + k % 2)
        air = problem.airspace
        a = inner(rng, 150, plane)
        b = a + rng.normal(0.0, 40.0, a.shape)
        floor = np.maximum(*(air.floor_amsl(p[:, 0], p[:, 1], problem.limits) for p in (a, b)))
        ok = np.zeros(len(a), np.bool_)
        for z in (np.full(len(a), cap), np.minimum(floor, cap), np.minimum(floor + 20.0, cap)):
            legs = Legs(
                np.column_stack([a, z]), np.column_stack([b, z]), np.zeros(len(a), np.bool_),
                np.full(len(a), problem.limits.track_error_m), np.full(len(a), problem.limits.altitude_error_m),
            )  # fmt: skip
            ok |= air.clear(legs, problem.limits)
        mesh = mesh_of(plane, cap, True, 1 + k % 3)
        for p, q in zip(a[ok], b[ok], strict=True):
            way = mesh.track((float(p[0]), float(p[1])), (float(q[0]), float(q[1])))
            assert way is not None, (p, q)
            assert way.length_m <= math.dist(p, q) * (1.0 + 1e-9), (p, q)
            held += 1
    assert held > 25


@pytest.mark.nightly_but("hills-3")
@pytest.mark.slow
@pytest.mark.parametrize("fineness", [3, 6])
@pytest.mark.parametrize("world", ["hills", "turned"])
def test_the_floor_for_bounds_knows_of_what_rises_beside_and_no_more(world: str, fineness: int) -> None:
    rng = np.random.default_rng([fineness, *world.encode()])
    raised = held = 0
    turn = np.linspace(0.0, 2.0 * math.pi, 181)
    for k in range(4):
        problem, plane, cap = world_of(rng, world, "errors", 1 + k % 2)
        limits, surface = problem.limits, problem.airspace.surface
        mesh = mesh_of(plane, cap, True, fineness)
        places = inner(rng, 1500, plane)
        cell = (plane.all_at(places) - [mesh.col, mesh.row]) * fineness
        i, j = np.floor(cell).astype(np.intp).T
        u, v = (cell - np.floor(cell)).T
        f, (rows, cols) = np.where(np.isfinite(mesh.excess), mesh.floor, np.nan), (n - 1 for n in mesh.excess.shape)
        a, b, c, d = f[j, i], f[j, i + 1], f[j + 1, i + 1], f[j + 1, i]
        straight = mesh.diagonal.reshape(rows, cols)[j, i] == 0
        own = np.where(
            straight,
            np.where(u >= v, a + u * (b - a) + v * (c - b), a + v * (d - a) + u * (c - d)),
            np.where(u + v <= 1.0, a + u * (b - a) + v * (d - a), c + (1.0 - u) * (d - c) + (1.0 - v) * (b - c)),
        )
        around = places[:, None] + limits.track_error_m * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        high = surface.ground_at(around[..., 0], around[..., 1]).max(axis=1)
        here = surface.ground_at(places[:, 0], places[:, 1])
        known = np.isfinite(high) & np.isfinite(own)
        more = limits.min_agl_m + limits.altitude_error_m
        assert (own <= np.maximum(high, here) + more + 1e-3)[known].all()
        raised += int((own > here + more + 0.1)[known].sum())
        held += int(known.sum())
    assert raised > 0.2 * held, raised / held


@pytest.mark.nightly_but("amsl-2-errors", "amsl-3-errors", "turned-2-errors", "turned-3-errors")
@pytest.mark.slow
@pytest.mark.parametrize("limits", ["errors", "ceiling"])
@pytest.mark.parametrize("stride", [2, 3])
@pytest.mark.parametrize("world", ["amsl", "turned"])
def test_cells_made_one_shut_out_nothing_that_passes_the_exact_check(world: str, stride: int, limits: str) -> None:
    rng = np.random.default_rng([stride, *world.encode()])
    passed = shut = 0
    for _ in range(4):
        problem, fine, cap = world_of(rng, world, limits, 1)
        plane = make_plane(problem, EVERYWHERE, 1, stride, 6)
        places = inner(rng, 200, plane)
        ok = legal(problem, places, cap)
        seen = free(mesh_of(plane, cap, True), places)
        assert seen[ok].all(), places[ok & ~seen]
        passed, shut = passed + int(ok.sum()), shut + int((~seen).sum())
        tight = free(mesh_of(plane, cap, False), places)
        assert limits == "ceiling" or (seen | ~tight).all(), "a path's mesh has room where the bound's has none"
        assert fine.stride == 1
    assert passed > 30
    assert shut > 0 or stride == 3


@pytest.mark.slow
@pytest.mark.parametrize("stride", [2, 3])
def test_cells_made_one_leave_the_room_below_a_floor_above_ground(stride: int) -> None:
    surface, limits = terrain(np.random.default_rng(stride), 6.0), LIMITS["errors"]
    disc = Circle(300.0, 300.0, 2000.0)
    room_m = 2.0 * limits.altitude_error_m
    zones = [Zone("below", disc, None, Level(300.0, "amsl")), Zone("above", disc, Level(100.0 + room_m, "agl"), None)]
    plane = make_plane(problem_of(surface, zones, limits), EVERYWHERE, 1, stride, 6)
    places = inner(np.random.default_rng(1), 200, plane)
    ok = legal(plane.problem, places, 400.0)
    assert free(mesh_of(plane, 400.0, True), places)[ok].all()
    assert ok.sum() > 20


@pytest.mark.slow
@pytest.mark.parametrize("datum", ["amsl", "agl"])
@pytest.mark.parametrize(("parts", "stride"), [(1, 1), (2, 1), (1, 2)])
def test_a_zone_is_a_wall_where_the_maximum_agl_lies_below_its_top(parts: int, stride: int, datum: str) -> None:
    rng = np.random.default_rng([parts, stride])
    surface = terrain(rng, 20.0)
    limits = OF_BOUNDS["ceiling"]
    assert limits.max_agl_m is not None
    room_m = limits.max_agl_m - 2.0 * limits.altitude_error_m
    amsl_m = float(np.median(surface.ground_m)) + room_m
    ceiling = Level(amsl_m, "amsl") if datum == "amsl" else Level(room_m - 1.0, "agl")
    zone = Zone("all", Circle(300.0, 300.0, 2000.0), None, ceiling)
    plane = make_plane(problem_of(surface, [zone], limits), EVERYWHERE, parts, stride, stride)
    places = inner(rng, 200, plane)
    spare_m = surface.ground_at(*places.T) + room_m - amsl_m if datum == "amsl" else np.ones(200)
    for fineness in (1, 3):
        seen = free(mesh_of(plane, 600.0, True, fineness), places)
        assert seen[spare_m > 0.0].all()
        assert stride > 1 or datum == "agl" or (~seen).sum() > 10  # ground is too rough here for cells of two by two
    assert (spare_m > 0.0).sum() > 50


@pytest.mark.slow
@pytest.mark.parametrize("low", [True, False])
@pytest.mark.parametrize(
    "world", ["hills", *(pytest.param(w, marks=pytest.mark.slow) for w in ("amsl", "turned")), "agl"]
)
def test_a_cropped_mesh_is_the_same_where_it_is_looked_at(world: str, low: bool) -> None:
    rng = np.random.default_rng([low, *world.encode()])
    compared = 0
    for _ in range(4):
        problem, plane, cap = world_of(rng, world, "errors", 1)
        wanted = np.zeros(plane.inside.shape, np.bool_)
        j, i = rng.integers(1, 8, 2)
        wanted[j : j + 9, i : i + 7] = rng.random((9, 7)) < 0.85
        places = inner(rng, 160, plane)
        c, r = np.array([plane.at((float(p[0]), float(p[1]))) for p in places]).T
        here = wanted[np.floor(r).astype(int), np.floor(c).astype(int)]
        for fineness in (1, 2, 5):
            whole, part = (free(mesh_of(plane, cap, low, fineness, w), places) for w in (None, wanted))
            assert np.array_equal(part[here], whole[here])
            compared += int(here.sum())
        assert problem is plane.problem
    assert compared > 100


@pytest.mark.parametrize("world", ["amsl", "tall"])
def test_ways_are_no_longer_in_the_mesh_for_bounds_than_in_that_for_paths(world: str) -> None:
    rng = np.random.default_rng([7, *world.encode()])
    compared = 0
    for _ in range(6):
        _, plane, cap = world_of(rng, world, "errors", 1)
        low, high = mesh_of(plane, cap, True, 2), mesh_of(plane, cap, False, 2)
        places = inner(rng, 80, plane)
        places = places[legal(plane.problem, places, cap)][:20]
        for a, b in zip(places[::2], places[1::2], strict=False):
            ends = (float(a[0]), float(a[1])), (float(b[0]), float(b[1]))
            way = high.track(*ends)
            if way is not None:
                least = low.track(*ends)
                assert least is not None
                assert math.dist(*ends) * (1.0 - 1e-9) <= least.length_m <= way.length_m * (1.0 + 1e-9)
                compared += 1
    assert compared > 8


@pytest.mark.parametrize("top", [260.0, 340.0])
def test_between_two_crossing_zones_there_is_room_only_where_their_levels_leave_some(top: float) -> None:
    """The middle is free only above the ceiling of one zone and below the floor of the other."""
    z = np.full((21, 21), 100.0)
    surface = Surface(z, z, GridMap.affine(0.0, SIZE_M, STEP_M, STEP_M))
    lid = Zone("lid", Circle(250.0, 300.0, 150.0), None, Level(top, "amsl"))
    floor = Zone("floor", Circle(350.0, 300.0, 150.0), Level(300.0, "amsl"), None)
    problem = problem_of(surface, [lid, floor], LIMITS["bare"])
    plane = make_plane(problem, EVERYWHERE)
    middle = np.array([[300.0 + 1.0, 300.0 + 2.0]])
    assert free(mesh_of(plane, 500.0, True, 2), middle)[0] == (top < 300.0) == legal(problem, middle, 500.0)[0]
    assert free(mesh_of(plane, 500.0, False, 2), middle)[0] == (top < 300.0)
    assert not free(mesh_of(plane, top - 5.0, True, 2), middle)[0]
    assert not legal(problem, middle, top - 5.0)[0]


@given(st.integers(0, 2**31), st.integers(3, 12))
@settings(max_examples=draws(60))
def test_convex_parts_make_up_the_polygon_and_are_convex(seed: int, corners: int) -> None:
    rng = np.random.default_rng(seed)
    turn = 2.0 * math.pi * (np.arange(corners) + rng.uniform(0.0, 0.6, corners)) / corners
    vertices = rng.uniform(0.2, 1.0, corners)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    whole = shapely.Polygon(vertices)
    if not whole.is_valid or not whole.exterior.is_ccw:
        return
    parts = [shapely.Polygon(p) for p in convex_parts(vertices)]
    assert sum(p.area for p in parts) == pytest.approx(whole.area, rel=1e-9)
    assert shapely.union_all(parts).symmetric_difference(whole).area < 1e-9
    for p in parts:
        assert p.exterior.is_ccw
        assert p.convex_hull.area == pytest.approx(p.area, rel=1e-9)


@pytest.mark.parametrize("rows", [1, 2, 5, 30])
def test_nodes_that_are_looked_at_lie_around_the_cells_that_are_wanted(rows: int) -> None:
    rng = np.random.default_rng(rows)
    for _ in range(20):
        cols = int(rng.integers(2, 60))
        span = np.sort(rng.integers(0, cols, (rows, 2)), axis=1).astype(np.int32)
        found = columns_around(span, cols)
        near = np.zeros((rows + 1, cols), bool)
        for j, (first, last) in enumerate(span.tolist()):
            if first < last:
                near[max(j - AROUND, 0) : j + AROUND + 2, max(first - AROUND, 0) : last + AROUND + 1] = True
        for j in range(rows + 1):
            some = np.flatnonzero(near[j])
            if len(some):
                assert found[j].tolist() == [some[0], some[-1] + 1]
            else:
                assert found[j, 0] >= found[j, 1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("goes_on", "shear"),
    [((False,) * 4, 0.0), ((True, False, True, False), 0.4), ((True,) * 4, 0.0),
     pytest.param((False,) * 4, 0.4, marks=pytest.mark.nightly),
     pytest.param((True,) * 4, 0.4, marks=pytest.mark.nightly),
     pytest.param((True, False, True, False), 0.0, marks=pytest.mark.nightly)],
)  # fmt: skip
def test_no_track_runs_nearer_to_the_terrains_border_than_ground_must_be_known(
    goes_on: tuple[bool, bool, bool, bool], shear: float
) -> None:
    limits = Limits(min_agl_m=20.0, horizontal_clearance_m=60.0, track_error_m=5.0, altitude_error_m=2.0)
    surface = replace(terrain(np.random.default_rng(3), 0.0, turned_grid(11.0, shear)), goes_on=goes_on)
    problem = Problem(Airspace(surface), limits, (0.0, 0.0, 300.0), (1.0, 0.0, 300.0))
    plane = make_plane(problem, EVERYWHERE)
    side = np.linspace(0.02, 19.98, 120)
    at = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    places = surface.grid.to_plane(at[:, 0], at[:, 1])
    high = np.column_stack([places, np.full(len(places), 300.0)])
    legal = problem.airspace.clear(Legs.between(high, high + np.array([LEG_M, 0.0, 0.0]), limits), limits)
    corners = surface.grid.to_plane(np.array([0.0, 20.0, 20.0, 0.0]), np.array([0.0, 0.0, 20.0, 20.0]))
    sides = [shapely.LineString([corners[k], corners[k - 1]]) for k in range(4)]  # west, north, east, south
    for fineness, low in product((1, 3, 4), (True, False)):
        mesh = mesh_of(plane, 300.0, low, fineness)
        ends = shapely.points(mesh.ends.reshape(-1, 2))  # of the portals: tracks meet nothing nearer to a border
        nearest_m = [shapely.distance(side, ends).min() for side in sides]
        if not low:
            assert shear or min(nearest_m) >= 65.0
            continue
        free = np.array([bool(mesh.pieces_at((float(e), float(n)))) for e, n in places])
        assert not (legal & ~free).any()
        for least_m, more in zip(nearest_m, goes_on, strict=True):
            assert more or shear or 63.0 <= least_m <= 65.0
        if all(goes_on):
            assert free.all()


@pytest.mark.first_quick
@pytest.mark.parametrize("turn", [0.0, 0.2, -0.3])
def test_the_rim_of_a_zone_over_a_slope_is_no_wall_where_the_zone_can_be_passed_over(turn: float) -> None:
    n = round(SIZE_M / STEP_M) + 1
    z = np.tile(0.5 * STEP_M * np.arange(n), (n, 1))
    surface = Surface(z, z, GridMap.affine(0.0, SIZE_M, STEP_M, STEP_M))
    zone = Zone("lid", Circle(300.0, 300.0, 150.0), None, Level(60.0, "agl"))
    limits = LIMITS["clearance"]
    problem = problem_of(surface, [zone], limits)
    reach_m = problem.airspace.beside_m(limits)
    ways = np.stack([np.cos(turn), np.sin(turn)]) * np.array([[150.0 + reach_m - 8.0], [150.0 + reach_m + 8.0]])
    inside, outside = np.array([300.0, 300.0]) + ways
    # Over the zone's own ground, which lies lower than the ground outside.
    cap_m = 0.5 * 450.0 + 60.0 + limits.altitude_error_m + 1.5
    line = np.linspace(inside, outside, 60)
    assert legal(problem, line, cap_m).all()
    plane = make_plane(problem, EVERYWHERE, 20)
    mesh = ClearanceGrid(plane, PlaneSpec(cap_m, False, exact_m=0.0), whole=True).mesh()
    way = mesh.track((float(inside[0]), float(inside[1])), (float(outside[0]), float(outside[1])))
    assert way is not None
    assert way.length_m == pytest.approx(16.0, abs=1e-6)
