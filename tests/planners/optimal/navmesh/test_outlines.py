"""Shortest tracks around outlines, compared with the benchmark's visibility graph, which shares no code with them."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from gcsplan.bench.everyday.oracle import EnclosedPlace, VisibilityGraph
from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal.navmesh import outlines
from gcsplan.planners.optimal.navmesh.outlines import Solids
from gcsplan.planners.optimal.navmesh.portals import Exhausted
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem, Refusal, Via
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.terrain.peaks import flat_grid
from tests.support.effort import seeds

FLAT = Surface(*flat_grid(0.0, (-6000.0, -6000.0, 6000.0, 6000.0))[:1] * 2, flat_grid(0.0, (-6e3, -6e3, 6e3, 6e3))[1])


def random_zones(rng: np.random.Generator, count: int) -> list[Zone]:
    zones = []
    for k in range(count):
        east, north = rng.uniform(-1000.0, 1000.0, 2)
        size = float(rng.uniform(20.0, 250.0))
        if rng.random() < 0.5:
            zones.append(Zone(f"disc {k}", Circle(float(east), float(north), size)))
            continue
        angle = np.sort(rng.uniform(0.0, 2.0 * math.pi, int(rng.integers(3, 9))))
        reach = size * rng.uniform(0.3, 1.0, len(angle))[:, None]
        ring = np.array([east, north]) + reach * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        if shapely.Polygon(ring).is_valid and shapely.LinearRing(ring).is_ccw:
            zones.append(Zone(f"block {k}", Polygon(ring)))
    return zones


def mission(zones: list[Zone], reach_m: float, via: tuple[Via, ...] = ()) -> Problem:
    limits = Limits(30.0, horizontal_clearance_m=0.9 * reach_m, track_error_m=0.1 * reach_m)
    return Problem(Airspace(FLAT, zones), limits, (-1500.0, 0.0, 40.0), (1500.0, 0.0, 40.0), via)


@pytest.mark.nightly_but("18", "9")
@pytest.mark.slow
@pytest.mark.parametrize("seed", seeds(10, 35, 60))
def test_bound_and_path_enclose_the_visibility_graphs_track(seed: int) -> None:
    rng = np.random.default_rng(seed)
    reach_m = float(rng.choice([0.0, 33.0]))
    zones = random_zones(rng, int(rng.integers(1, 40)))
    places = [(-1500.0, 0.0), (1500.0, 0.0)]
    every = np.ones(len(zones), np.bool_)
    try:
        oracle = VisibilityGraph.of(zones, reach_m).shortest(places)
    except EnclosedPlace:
        pytest.skip("the zones enclose a place")
    found = [
        Solids(
            Airspace(FLAT, zones).zone_table, reach_m, np.full(len(zones), 2e-3), Budget.endless(), outer=o
        ).shortest(*places, every)
        for o in (False, True)
    ]
    assert found[0] is not None
    assert found[1] is not None
    low, high = (track.length_m for track in found)
    # The oracle replaces arcs by chords, which are shorter.
    assert low <= oracle * (1.0 + 1e-4) + 0.05
    assert oracle <= high + 0.05
    assert high <= low * (1.0 + 3e-4) + 0.05
    shapes = [
        shapely.Point(z.shape.east_m, z.shape.north_m).buffer(z.shape.radius_m, quad_segs=256)
        if isinstance(z.shape, Circle)
        else shapely.Polygon(z.shape.vertices)
        for z in zones
    ]
    line = shapely.LineString(found[1].points)
    assert all(shapely.distance(s, line) >= reach_m - 0.03 for s in shapes)


@pytest.mark.parametrize("seed", [*range(12), 321, 322, 345, 349, 376])
def test_any_number_of_triangles_may_meet_at_a_corner(seed: int) -> None:
    """A slit between a wall's end and a disc: the triangles between them fan out from the wall's corners, one for each
    chord. A track that turned at a corner was given up after eight of them, and the bound was too high."""
    rng = np.random.default_rng([8, seed])
    half_m, radius_m, slit_m = rng.uniform(30.0, 100.0), rng.uniform(100.0, 250.0), rng.uniform(3.0, 15.0)
    wall = np.array([(-half_m, -600.0), (half_m, -600.0), (half_m, 0.0), (-half_m, 0.0)])
    zones = [Zone("wall", Polygon(wall)), Zone("disc", Circle(0.0, float(radius_m + slit_m), float(radius_m)))]
    east, west = rng.uniform(150.0, 300.0, 2) + half_m
    places = [(float(east), float(rng.uniform(-500.0, -200.0))), (float(-west), float(rng.uniform(50.0, 180.0)))]
    if math.dist(places[1], (0.0, radius_m + slit_m)) < radius_m + 5.0:
        pytest.skip("the goal lies in the disc")
    oracle = VisibilityGraph.of(zones, 0.0).shortest(places)
    for outer in (False, True):
        solids = Solids(Airspace(FLAT, zones).zone_table, 0.0, np.full(2, 2e-3), Budget.endless(), outer=outer)
        track = solids.shortest(*places, np.ones(2, bool))
        assert track is not None
        assert track.length_m == pytest.approx(oracle, rel=3e-4, abs=0.05)


def test_a_track_turns_where_rounding_has_made_two_corners_of_one() -> None:
    # Two zones' outlines that meet: their union has corners 1e-14 m apart, and the way south turns at them.
    corners = [(73.5, -61.25), (43.11033185386742, -26.057106177671713), (43.11033185386742, -26.05710617767171),
               (124.5, 106.75)]  # fmt: skip
    a, b, south = (0.0, 0.0), (183.7, 14.35), [(0.0, 0.0), (73.5, -61.25), (183.7, 14.35)]
    found = outlines.shortest_past(a, b, [shapely.Polygon(corners)])
    assert found is not None
    assert found.length_m == pytest.approx(sum(math.dist(*leg) for leg in itertools.pairwise(south)), abs=1e-3)


@pytest.mark.first_quick
@pytest.mark.parametrize("seed", [2, 3, *(pytest.param(k, marks=pytest.mark.nightly) for k in range(4, 30))])
def test_plans_on_flat_ground_are_certified_to_a_hair(seed: int) -> None:
    rng = np.random.default_rng([7, seed])
    p = mission(random_zones(rng, int(rng.integers(1, 60))), float(rng.choice([0.0, 33.0])))
    try:
        VisibilityGraph.of(p.airspace.zones, p.airspace.beside_m(p.limits)).shortest([p.start[:2], p.goal[:2]])
    except EnclosedPlace:
        with pytest.raises(Refusal, match="proved"):
            plan(p)
        return
    found = plan(p)
    assert found.lower_bound is not None
    assert found.lower_bound <= p.cost(found.path) <= found.lower_bound * 1.0002
    assert not p.airspace.examine(Legs.of_path(found.path.points, p.limits), p.limits).violations


def test_a_goal_inside_a_closed_ring_is_proved_infeasible() -> None:
    around = [Zone(f"wall {k}", Polygon(np.array(ring))) for k, ring in enumerate((
        [(1300.0, -300.0), (1700.0, -300.0), (1700.0, -250.0), (1300.0, -250.0)],
        [(1300.0, 250.0), (1700.0, 250.0), (1700.0, 300.0), (1300.0, 300.0)],
        [(1250.0, -300.0), (1310.0, -300.0), (1310.0, 300.0), (1250.0, 300.0)],
        [(1690.0, -300.0), (1750.0, -300.0), (1750.0, 300.0), (1690.0, 300.0)],
    ))]  # fmt: skip
    with pytest.raises(Refusal, match="proved") as caught:
        plan(mission(around, 33.0))
    assert caught.value.reason == "infeasible"


@pytest.mark.nightly
def test_a_c_around_the_goal_leaves_no_gap() -> None:
    angle = np.linspace(0.3, 2.0 * math.pi - 0.3, 40)
    ring = shapely.LineString(np.array([1500.0, 0.0]) + 500.0 * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
    shape = np.asarray(ring.buffer(20.0, cap_style="flat").exterior.coords)[:-1]
    shape = shape if shapely.LinearRing(shape).is_ccw else shape[::-1]
    p = mission([Zone("c", Polygon(shape))], 33.0)
    found = plan(p)
    oracle = VisibilityGraph.of(p.airspace.zones, 33.0).shortest([p.start[:2], p.goal[:2]])
    assert found.stopped_by == "gap"
    assert p.cost(found.path) == pytest.approx(oracle, rel=1e-3)


def test_vias_are_passed_in_order_and_at_their_heights() -> None:
    p = mission([Zone("disc", Circle(0.0, 0.0, 300.0))], 33.0, (Via(0.0, 800.0, 90.0), Via(0.0, -800.0)))
    points = plan(p).path.points
    first = int(np.abs(points[:, :2] - [0.0, 800.0]).sum(axis=1).argmin())
    second = int(np.abs(points[:, :2] - [0.0, -800.0]).sum(axis=1).argmin())
    assert first < second
    assert points[first] == pytest.approx([0.0, 800.0, 90.0], abs=1e-6)


def test_a_low_zone_is_flown_over_where_that_is_shorter() -> None:
    wall = Zone("wall", Polygon(np.array([[-50.0, -2000.0], [50.0, -2000.0], [50.0, 2000.0], [-50.0, 2000.0]])),
                None, Level(60.0, "agl"))  # fmt: skip
    p = mission([wall], 33.0)
    p = replace(p, limits=replace(p.limits, max_climb_deg=15.0, max_descent_deg=15.0))
    found = plan(p)
    assert p.cost(found.path) < 3010.0
    assert found.path.points[:, 2].max() >= 60.0


def test_what_would_be_too_large_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(outlines, "MOST_OUTLINE_CORNERS", 10)
    zones = [Zone("disc", Circle(0.0, 0.0, 300.0))]
    with pytest.raises(Exhausted):
        Solids(Airspace(FLAT, zones).zone_table, 0.0, np.full(1, 2e-3), Budget.endless(), outer=True).shortest(
            (-1e3, 0.0), (1e3, 0.0), np.ones(1, np.bool_)
        )
    assert plan(mission(zones, 33.0)).lower_bound is not None  # the lattice finds a bound where the outlines do not
