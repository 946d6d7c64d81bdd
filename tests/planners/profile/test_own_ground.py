"""The ground under a zone near a place: within what dense samples show, and near to it."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from gcsplan.planners.profile.zone_levels import RING_POINTS, own_ground
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Polygon, Zone


def surface(void: bool = False) -> Surface:
    axis = np.arange(101) * 10.0
    east, north = np.meshgrid(axis, axis[::-1])
    z = 0.05 * east + 20.0 * np.sin(north / 150.0)
    if void:
        z[:, 40:] = np.nan
    return Surface(z, z, GridMap.affine(0.0, 1000.0, 10.0, 10.0))


SQUARE = np.array([[300.0, 300.0], [600.0, 300.0], [600.0, 700.0], [300.0, 700.0]])


@pytest.mark.parametrize("shape", [Circle(450.0, 500.0, 180.0), Polygon(SQUARE)], ids=["circle", "polygon"])
def test_it_is_the_range_of_the_ground_that_is_under_both(shape: Circle | Polygon) -> None:
    rng = np.random.default_rng(1)
    places, reach_m = rng.uniform(200.0, 800.0, (30, 2)), 80.0
    low, high = own_ground(surface(), Zone("z", shape, None, None), places, reach_m)
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


def test_where_the_zone_is_far_or_the_ground_unknown_there_is_none() -> None:
    zone = Zone("z", Circle(450.0, 500.0, 40.0), None, None)
    far, middle = np.array([[900.0, 900.0]]), np.array([[450.0, 500.0]])
    for found in (own_ground(surface(), zone, far, 50.0), own_ground(surface(True), zone, middle, 30.0)):
        assert [x.tolist() for x in found] == [[np.inf], [-np.inf]]


def test_so_many_points_are_read_as_it_says() -> None:
    asked: list[int] = []

    class Counting(Surface):
        def ground_at(self, east_m: object, north_m: object) -> np.ndarray:
            asked.append(np.size(east_m))
            return np.zeros(np.size(east_m))

    plain = surface()
    counting = Counting(plain.ground_m, plain.top_m, plain.grid)
    own_ground(counting, Zone("z", Circle(0.0, 0.0, 9e9), None, None), np.zeros((7, 2)), 10.0)
    assert asked == [7 * RING_POINTS]
