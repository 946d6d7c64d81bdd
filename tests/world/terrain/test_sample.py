"""The sample terrain against matplotlib's own reading of its file."""

from __future__ import annotations

import hashlib

import numpy as np
from matplotlib.cbook import get_sample_data

from gcsplan.world.terrain.sample import SAMPLE, sample_jacksboro


def test_the_sample_is_the_tile_that_comes_with_matplotlib() -> None:
    raster, data = sample_jacksboro(), get_sample_data("jacksboro_fault_dem.npz")
    heights = data["elevation"]
    assert (raster.rows, raster.cols) == heights.shape
    assert (raster.name, str(raster.vertical.name if raster.vertical else "")) == (SAMPLE, "EGM96")
    [(first, part)] = list(raster.read(10, 20, 30, 40))
    assert first == 0
    assert np.array_equal(part, heights[20:60, 10:40])


def test_its_hash_is_that_of_the_file() -> None:
    with get_sample_data("jacksboro_fault_dem.npz", asfileobj=True) as _:
        path = get_sample_data("jacksboro_fault_dem.npz", asfileobj=False)
    with open(str(path), "rb") as file:
        assert sample_jacksboro().sha256() == hashlib.sha256(file.read()).hexdigest()
