"""The terrain that needs no file: a real tile that comes with matplotlib."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.world.geodesy.datum import VerticalDatum, take_apart
from gcsplan.world.geodesy.height_unit import METRE
from gcsplan.world.terrain.input_files import sha256_of, tell_file
from gcsplan.world.terrain.raster import Raster

SAMPLE = "sample:jacksboro"


def sample_jacksboro() -> Raster:
    """The real 3 arc-second SRTM tile around Jacksboro, Tennessee, that comes with matplotlib (EGM96).

    Its xmin … ymax are the edges of the cells and row 0 is the north (the file's "ymin" is the northern edge).
    """
    # Only the file's location is needed: importing matplotlib would take longer than the rest.
    found = importlib.util.find_spec("matplotlib")
    if found is None or found.origin is None:
        raise InputError(f"{SAMPLE} comes with matplotlib, which is not installed: pip install matplotlib")
    path = Path(found.origin).parent / "mpl-data" / "sample_data" / "jacksboro_fault_dem.npz"
    tell_file(path)
    with np.load(path) as file:
        heights = np.asarray(file["elevation"], float)
        west, north, dx, dy = (float(file[k]) for k in ("xmin", "ymin", "dx", "dy"))
    rows, cols = heights.shape

    def read(col: int, row: int, width: int, height: int) -> Iterator[tuple[int, Floats]]:
        yield 0, heights[row : row + height, col : col + width]

    return Raster(
        SAMPLE, take_apart("EPSG:4326", where=SAMPLE), west, north, dx, dy, cols, rows, VerticalDatum("EGM96"), read,
        path.stat().st_size, lambda: sha256_of(path), unit=replace(METRE, by="from the sample"),
    )  # fmt: skip
