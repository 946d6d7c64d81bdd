"""Zones as arrays: spans of a track near them, depths inside them, and the lattice that finds them."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.zone_arrays import (
    deepest_in_circle,
    deepest_inside,
    lattice_over,
    over_both_grounds,
    spans,
    zones_as_arrays,
)

GRID = GridMap.affine(0.0, 200.0, 10.0, 10.0)
FIELD = Field.of(GRID)
LOW = np.zeros((21, 21))
SQUARE = np.array([[80.0, 80.0], [120.0, 80.0], [120.0, 120.0], [80.0, 120.0]])


def test_spans_of_a_track_are_where_samples_are_near() -> None:
    zones = [Zone("square", Polygon(SQUARE)), Zone("disc", Circle(150.0, 60.0, 12.0))]
    arrays = zones_as_arrays(zones, Surface(LOW, LOW, GRID), FIELD, 1.0)
    track = np.array([[10.0, 95.0], [130.0, 100.0], [160.0, 20.0]])
    found = spans(track, arrays, 7.0, 7.0)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(track, axis=0).T))])
    at = np.linspace(0.0, s[-1], 20_001)
    places = shapely.points(*(np.interp(at, s, track[:, k]) for k in range(2)))
    for k, (shape, more) in enumerate([(shapely.Polygon(SQUARE), 0.0), (shapely.Point(150.0, 60.0), 12.0)]):
        near = at[shapely.distance(shape, places) <= 7.0 + more]
        mine = [(s0, s1) for zone, s0, s1 in found if zone == k]
        assert (mine[0][0], mine[-1][1]) == pytest.approx((near[0], near[-1]), abs=0.05)


def test_the_deepest_place_inside_is_that_of_samples() -> None:
    start, end = np.array([70.0, 90.0]), np.array([125.0, 110.0])
    depth_m, at = deepest_inside(SQUARE, start, end)
    t = np.linspace(0.0, 1.0, 20_001)[:, None]
    places = start + t * (end - start)
    depth = np.minimum(places - 80.0, 120.0 - places).min(axis=1)
    assert depth_m == pytest.approx(depth.max(), abs=1e-2)
    assert depth[round(at * 20_000)] == pytest.approx(depth.max(), abs=1e-2)
    assert deepest_in_circle(Circle(100.0, 100.0, 20.0), 20.0, np.array([70.0, 100.0]), np.array([130.0, 100.0])) == (
        pytest.approx((20.0, 0.5))
    )


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
    assert math.isinf(zones_as_arrays([Zone("free", Circle(0.0, 0.0, 5.0))], surface, FIELD, 1.0).table.max())
