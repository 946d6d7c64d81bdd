"""Canopy over a terrain grid: never lower than a pixel that a cell meets, unknown where the raster is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.terrain.mosaic import Window
from gcsplan.world.terrain.obstacles import TALLEST_M, canopy_on


def window(heights: Floats, west: float, north: float, cell_m: float) -> Window:
    rows, cols = heights.shape
    x, y = west + cell_m * np.arange(cols), north - cell_m * np.arange(rows)
    return Window(heights, GridMap.affine(west, north, cell_m, cell_m), x, y, ())


GROUND = window(np.zeros((11, 11)), 0.0, 100.0, 10.0)


@pytest.mark.parametrize("pixel_m", [3.0, 7.0, 26.0])
def test_the_canopy_is_nowhere_lower_than_its_pixels(pixel_m: float) -> None:
    count = math.ceil(160.0 / pixel_m)
    trees = np.random.default_rng(3).uniform(0.0, 30.0, (count, count))
    nodes = canopy_on(GROUND, window(trees.copy(), -30.0, 130.0, pixel_m))
    rng = np.random.default_rng(4)
    east, north = rng.uniform(0.0, 100.0, (2, 4000))
    tree = trees[np.rint((130.0 - north) / pixel_m).astype(int), np.rint((east + 30.0) / pixel_m).astype(int)]
    here = Surface(nodes, nodes, GROUND.grid).ground_at(east, north)
    assert (here >= tree - 1e-9).all()
    assert nodes.max() <= trees.max()


def test_what_is_no_height_or_beyond_the_raster_is_unknown_or_what_the_caller_says() -> None:
    trees = np.full((40, 40), 12.0)
    trees[20, 20] = TALLEST_M + 1.0  # 70 m east, 30 m north
    beside = window(trees.copy(), -30.0, 130.0, 5.0)
    nodes = canopy_on(GROUND, beside)
    assert np.isnan(nodes[7, 7])
    assert nodes[8, 2] == 12.0
    assert canopy_on(GROUND, window(trees.copy(), -30.0, 130.0, 5.0), unknown_m=33.0)[7, 7] == 33.0
    short = canopy_on(GROUND, window(np.full((6, 40), 12.0), -30.0, 130.0, 5.0))
    assert np.isnan(short[-1]).all()
