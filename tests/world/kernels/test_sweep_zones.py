"""Distances of points and segments from zones' shapes: those of shapely, with a sign for the inside."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from gcsplan.arrays import Floats
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Polygon, Zone
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.shared import Zones
from gcsplan.world.kernels.sweep_zones import approach, at_heights, signed_distance
from gcsplan.world.zone_table import ZoneTable

GRID = GridMap.affine(-100.0, 100.0, 10.0, 10.0)
LEVEL = np.zeros((21, 21))


def arrays_of(*zones: Zone) -> Zones:
    return ZoneTable.of(zones, Surface(LEVEL, LEVEL, GRID), Field.of(GRID), 1.0).arrays


def ring(seed: int) -> Floats:
    """A star-shaped polygon around (10, -5)."""
    rng = np.random.default_rng(seed)
    turn = np.sort(rng.uniform(0.0, 2.0 * np.pi, 9))
    away = rng.uniform(10.0, 40.0, 9)[:, None]
    return np.array([10.0, -5.0]) + away * np.stack([np.cos(turn), np.sin(turn)], axis=-1)


@pytest.mark.parametrize("seed", range(5))
def test_points_are_as_far_from_shapes_as_for_shapely_negative_inside(seed: int) -> None:
    corners = ring(seed)
    zones = arrays_of(Zone("polygon", Polygon(corners)), Zone("circle", Circle(-20.0, 30.0, 25.0)))
    shape, border = shapely.Polygon(corners), shapely.LinearRing(corners)
    for e, n in np.random.default_rng([seed, 1]).uniform(-80.0, 80.0, (60, 2)).tolist():
        point = shapely.Point(e, n)
        expected = border.distance(point) * (-1.0 if shape.contains(point) else 1.0)
        assert signed_distance(zones.table, zones.vertex, 0, e, n) == pytest.approx(expected)
        assert signed_distance(zones.table, zones.vertex, 1, e, n) == pytest.approx(np.hypot(e + 20.0, n - 30.0) - 25.0)


@pytest.mark.parametrize("seed", range(5))
def test_segments_come_as_near_to_shapes_as_for_shapely(seed: int) -> None:
    corners = ring(seed)
    zones = arrays_of(Zone("polygon", Polygon(corners)), Zone("circle", Circle(-20.0, 30.0, 25.0)))
    for ax, ay, bx, by in np.random.default_rng([seed, 2]).uniform(-80.0, 80.0, (40, 4)).tolist():
        line = shapely.LineString([(ax, ay), (bx, by)])
        far_m, t = approach(zones.table, zones.vertex, 0, ax, ay, bx, by)
        assert far_m == pytest.approx(shapely.Polygon(corners).distance(line), abs=1e-9)
        there = shapely.Point(ax + t * (bx - ax), ay + t * (by - ay))
        assert shapely.Polygon(corners).distance(there) == pytest.approx(far_m, abs=1e-9)
        round_m, _ = approach(zones.table, zones.vertex, 1, ax, ay, bx, by)
        assert round_m == pytest.approx(shapely.Point(-20.0, 30.0).distance(line) - 25.0)


def test_the_part_of_a_leg_between_two_levels_is_widened_by_the_altitude_error() -> None:
    assert at_heights(0.0, 100.0, 40.0, 60.0, 10.0) == pytest.approx((0.3, 0.7))
    first, last = at_heights(0.0, 100.0, 140.0, 160.0, 10.0)
    assert first > last
