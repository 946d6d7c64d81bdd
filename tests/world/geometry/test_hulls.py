"""Distances of hulls of few points: those of shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from gcsplan.world.geometry import hulls
from gcsplan.world.geometry.hulls import MEETS, to_point, to_points, to_polygon

STAR = np.array([[0.0, 0.0], [6.0, 1.0], [4.0, 3.0], [5.0, 8.0], [2.0, 4.0], [-3.0, 6.0]])


def regions(seed: int, corners: int) -> np.ndarray:
    rng = np.random.default_rng([seed, corners])
    return rng.uniform(-12.0, 12.0, (60, 1, 2)) + rng.uniform(-3.0, 3.0, (60, corners, 2))


@pytest.mark.parametrize("corners", [2, 3, 4, 5])
def test_distances_from_points_are_those_of_shapely(corners: int) -> None:
    some = regions(1, corners)
    points = np.random.default_rng(corners).uniform(-10.0, 10.0, (60, 2))
    hull = [shapely.MultiPoint(r).convex_hull for r in some]
    expected = [h.distance(shapely.Point(p)) for h, p in zip(hull, points, strict=True)]
    np.testing.assert_allclose(to_points(some, points), expected, atol=1e-9)
    expected = [h.distance(shapely.Point(1.0, 2.0)) for h in hull]
    np.testing.assert_allclose(to_point(some, np.array([1.0, 2.0])), expected, atol=1e-9)


@pytest.mark.parametrize("corners", [1, 2, 3, 4])
@pytest.mark.parametrize("seed", range(3))
def test_distances_from_a_polygon_are_those_of_shapely_and_overlaps_are_told(seed: int, corners: int) -> None:
    some, polygon = regions(seed, corners), shapely.Polygon(STAR)
    found = to_polygon(some, STAR)
    for region, distance in zip(some, found, strict=True):
        hull = shapely.MultiPoint(region).convex_hull
        if polygon.intersects(hull):
            assert distance == MEETS
        else:
            assert distance == pytest.approx(polygon.distance(hull))
    assert (found == MEETS).any()
    assert (found > 0.0).any()


def test_what_is_farther_than_asked_for_may_only_seem_still_farther() -> None:
    some = regions(5, 3)
    exact, near = to_polygon(some, STAR), to_polygon(some, STAR, 2.0)
    assert np.array_equal(near[exact <= 2.0], exact[exact <= 2.0])
    assert (near[exact > 2.0] >= exact[exact > 2.0]).all()


def test_blocks_give_what_all_at_once_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    some = regions(7, 3)
    whole = to_polygon(some, STAR)
    monkeypatch.setattr(hulls, "POINTS_AT_ONCE", 7 * len(STAR) * math.comb(3, 3))
    assert np.array_equal(to_polygon(some, STAR), whole)
    assert to_polygon(some[:0], STAR).shape == (0,)
