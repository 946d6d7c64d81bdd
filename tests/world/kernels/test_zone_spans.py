"""Spans of a track near zones, and depths inside them, against samples."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Polygon, Zone
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.zone_spans import deepest_in_circle, deepest_inside, spans
from gcsplan.world.zone_table import ZoneTable

GRID = GridMap.affine(0.0, 200.0, 10.0, 10.0)
SQUARE = np.array([[80.0, 80.0], [120.0, 80.0], [120.0, 120.0], [80.0, 120.0]])


def test_spans_of_a_track_are_where_samples_are_near() -> None:
    zones = [Zone("square", Polygon(SQUARE)), Zone("disc", Circle(150.0, 60.0, 12.0))]
    low = np.zeros((21, 21))
    arrays = ZoneTable.of(zones, Surface(low, low, GRID), Field.of(GRID), 1.0).arrays
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
