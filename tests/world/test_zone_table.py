"""The table of zones: what finds them, ceilings over two grounds, own ground, what is near them and how deep inside."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from gcsplan.world.geodesy.degree_shapes import counter_clockwise
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.kernels.field import Field
from gcsplan.world.zone_table import (
    RING_POINTS,
    ZoneTable,
    deepest_in_circle,
    deepest_inside,
    lattice_over,
    over_both_grounds,
)

GRID = GridMap.affine(0.0, 200.0, 10.0, 10.0)
FIELD = Field.of(GRID)
LOW = np.zeros((21, 21))
SQUARE = np.array([[80.0, 80.0], [120.0, 80.0], [120.0, 120.0], [80.0, 120.0]])


@pytest.mark.parametrize("count", [1, 30, 400])
def test_the_lattice_finds_every_zone_that_a_place_lies_in(count: int) -> None:
    rng = np.random.default_rng(count)
    corner, size = rng.uniform(0.0, 1000.0, (count, 2)), rng.uniform(1.0, 80.0, (count, 2))
    boxes = np.hstack([corner, corner + size])
    (west, south, per_m, cols, rows), bucket, near = lattice_over(boxes)
    for e, n in (corner + 0.5 * size).tolist():
        i, j = int((e - west) * per_m), int((n - south) * per_m)
        assert 0 <= i < cols
        assert 0 <= j < rows
        square = j * int(cols) + i
        listed = set(near[bucket[square] : bucket[square + 1]].tolist())
        inside = (boxes[:, :2] <= (e, n)).all(axis=1) & (boxes[:, 2:] >= (e, n)).all(axis=1)
        assert set(np.flatnonzero(inside).tolist()) <= listed


def test_a_ceiling_over_two_grounds_is_raised_by_what_they_differ_there() -> None:
    high = LOW.copy()
    high[8:12, 8:12] = 9.0  # 80 to 110 m
    surface = Surface(LOW, high, GRID, high_m=high)
    inside, outside = (
        Zone(name, Circle(east, east, 5.0), None, Level(50.0, "agl")) for name, east in (("in", 100.0), ("out", 30.0))
    )
    raised, same = over_both_grounds([inside, outside], surface, FIELD, 1.0)
    assert raised.ceiling == Level(59.0, "agl")
    assert same.ceiling == Level(50.0, "agl")
    assert math.isinf(ZoneTable.of([Zone("free", Circle(0.0, 0.0, 5.0))], surface, FIELD, 1.0).arrays.table.max())


def surface(void: bool = False) -> Surface:
    axis = np.arange(101) * 10.0
    east, north = np.meshgrid(axis, axis[::-1])
    z = 0.05 * east + 20.0 * np.sin(north / 150.0)
    if void:
        z[:, 40:] = np.nan
    return Surface(z, z, GridMap.affine(0.0, 1000.0, 10.0, 10.0))


def table_of(ground: Surface, shape: Circle | Polygon) -> ZoneTable:
    return ZoneTable.of([Zone("z", shape)], ground, Field.of(ground.grid), 1.0)


OBLONG = np.array([[300.0, 300.0], [600.0, 300.0], [600.0, 700.0], [300.0, 700.0]])


@pytest.mark.parametrize("shape", [Circle(450.0, 500.0, 180.0), Polygon(OBLONG)], ids=["circle", "polygon"])
def test_own_ground_is_the_range_of_the_ground_that_is_under_both(shape: Circle | Polygon) -> None:
    rng = np.random.default_rng(1)
    places, reach_m = rng.uniform(200.0, 800.0, (30, 2)), 80.0
    low, high = table_of(surface(), shape).own_ground_m(0, places, reach_m)
    turn, away = rng.uniform(0.0, 2.0 * np.pi, 4000), reach_m * np.sqrt(rng.random(4000))
    for place, least, most in zip(places, low, high, strict=True):
        dense = place + np.stack([away * np.cos(turn), away * np.sin(turn)], axis=-1)
        if isinstance(shape, Circle):
            under = np.hypot(*(dense - (shape.east_m, shape.north_m)).T) <= shape.radius_m
        else:
            under = shapely.contains_xy(shapely.Polygon(shape.vertices), dense)
        if under.mean() < 0.02:
            continue  # too little of the zone is near to compare
        ground = surface().ground_at(*dense[under].T)
        assert ground.min() - 1.0 <= least <= ground.min() + 3.0
        assert ground.max() - 3.0 <= most <= ground.max() + 1.0


def test_where_the_zone_is_far_or_ground_unknown_no_own_ground_is() -> None:
    shape = Circle(450.0, 500.0, 40.0)
    far, middle = np.array([[900.0, 900.0]]), np.array([[450.0, 500.0]])
    for ground, place, reach_m in ((surface(), far, 50.0), (surface(True), middle, 30.0)):
        found = table_of(ground, shape).own_ground_m(0, place, reach_m)
        assert [x.tolist() for x in found] == [[np.inf], [-np.inf]]


def test_so_many_points_are_read_as_it_says() -> None:
    asked: list[int] = []

    class Counting(Surface):
        def ground_at(self, east_m: object, north_m: object) -> np.ndarray:
            asked.append(np.size(east_m))
            return np.zeros(np.size(east_m))

    plain = surface()
    counting = Counting(plain.ground_m, plain.top_m, plain.grid)
    table_of(counting, Circle(0.0, 0.0, 9e9)).own_ground_m(0, np.zeros((7, 2)), 10.0)
    assert asked == [7 * RING_POINTS]


@pytest.mark.draws
def test_segments_near_a_polygon_are_found_wherever_they_lie() -> None:
    rng = np.random.default_rng(5)
    for _ in range(60):
        corners = rng.uniform(-100, 100, (3, 2))
        table = table_of(surface(), counter_clockwise(corners))
        reach = rng.uniform(0, 80)
        a = rng.uniform(-1, 1, (rng.integers(0, 8), 2)) * rng.choice([150, 400, 4000]) + rng.uniform(-300, 300, 2)
        b = a + rng.uniform(-1, 1, a.shape) * rng.choice([0.0, 50.0, 900.0])
        exact = [
            shapely.Polygon(corners).distance(shapely.LineString([p, q]) if (p != q).any() else shapely.Point(p))
            for p, q in zip(a, b, strict=True)
        ]
        found = table.near(0, a, b, reach)
        assert found.shape == (len(a),)
        assert found.tolist() == [d <= reach for d in exact]


def test_columns_say_what_the_zones_are() -> None:
    square = Polygon(SQUARE)
    zones = [
        Zone("disc", Circle(50.0, 60.0, 10.0), Level(30.0, "agl"), Level(90.0, "amsl")),
        Zone("square", square, None, Level(70.0, "agl")),
    ]
    table = ZoneTable.of(zones, Surface(LOW, LOW, GRID), FIELD, 1.5)
    low_m, high_m = table.levels_m(5.0)
    assert (low_m.tolist(), high_m.tolist()) == ([25.0, -math.inf], [95.0, 75.0])
    assert [side.tolist() for side in table.levels_m(ground_m=10.0)] == [[40.0, -math.inf], [90.0, 80.0]]
    assert table.over_ground.tolist() == [[True, False], [False, True]]
    assert table.discs_m[0].tolist() == [50.0, 60.0, 15.0]
    assert table.box_m.tolist() == [[35.0, 45.0, 65.0, 75.0], [80.0, 80.0, 120.0, 120.0]]
    assert len(table.corners_m(0)) == 0
    assert table.corners_m(1).tolist() == square.vertices.tolist()
    assert table.within((66.0, 0.0, 79.0, 200.0), 0.5) == []
    assert table.within((66.0, 0.0, 79.0, 200.0), 1.0) == [0, 1]
    # Its own shape is the disc of 10 m; in the plane, up to 1.5 times as many metres count.
    places = np.array([[60.0, 60.0], [61.0, 60.0]])
    assert table.holds(0, places).tolist() == [True, False]
    assert table.near(0, places, places, 0.0).tolist() == [True, True]


def test_spans_of_a_track_are_where_samples_are_near() -> None:
    zones = [Zone("square", Polygon(SQUARE)), Zone("disc", Circle(150.0, 60.0, 12.0))]
    table = ZoneTable.of(zones, Surface(LOW, LOW, GRID), FIELD, 1.0)
    track = np.array([[10.0, 95.0], [130.0, 100.0], [160.0, 20.0]])
    found = table.spans(track, 7.0, 7.0)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track, axis=0).T))])
    at = np.linspace(0.0, s[-1], 20_001)
    places = shapely.points(*(np.interp(at, s, track[:, k]) for k in range(2)))
    for k, (shape, more) in enumerate([(shapely.Polygon(SQUARE), 0.0), (shapely.Point(150.0, 60.0), 12.0)]):
        near = at[shapely.distance(shape, places) <= 7.0 + more]
        mine = [(s0, s1) for zone, s0, s1 in found if zone == k]
        assert (mine[0][0], mine[-1][1]) == pytest.approx((near[0], near[-1]), abs=0.05)


def test_the_deepest_place_inside_is_that_of_samples() -> None:
    start, end = np.array([70.0, 90.0]), np.array([125.0, 110.0])
    depth_m, at = deepest_inside(np.stack([SQUARE, np.roll(SQUARE, -1, axis=0)], axis=1), start, end)
    t = np.linspace(0.0, 1.0, 20_001)[:, None]
    places = start + t * (end - start)
    depth = np.minimum(places - 80.0, 120.0 - places).min(axis=1)
    assert depth_m == pytest.approx(depth.max(), abs=1e-2)
    assert depth[round(at * 20_000)] == pytest.approx(depth.max(), abs=1e-2)
    assert deepest_in_circle(Circle(100.0, 100.0, 20.0), 20.0, np.array([70.0, 100.0]), np.array([130.0, 100.0])) == (
        pytest.approx((20.0, 0.5))
    )
