"""The tiles of one degree that a box of the plane needs."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from gcsplan.errors import InputError
from gcsplan.world.geodesy.frame import Box, Frame
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.terrain import RASTER_SPARE_M

CELL_SPARE_M = RASTER_SPARE_M + 200.0
"""Around a box, m: what is read around it, and three cells of the coarsest source."""

MOST_TILES_OF_AREA = 100
"""Most tiles that one mission or one command may need: a mission is much smaller, and so many take gigabytes."""


def names_of(cells: Iterable[Cell]) -> str:
    """The names, with commas."""
    return ",".join(cell.name for cell in cells)


def cells_in(frame: Frame, box: Box, *, where: str) -> tuple[Cell, ...]:
    """The tiles that terrain for ``box`` (west, south, east, north, plane metres) is read from, north-west first.

    Raises InputError if they are more than `MOST_TILES_OF_AREA`.
    """
    f = np.linspace(0.0, 1.0, 65)
    west, south, east, north = (
        box[0] - CELL_SPARE_M,
        box[1] - CELL_SPARE_M,
        box[2] + CELL_SPARE_M,
        box[3] + CELL_SPARE_M,
    )
    e, n = np.meshgrid(west + f * (east - west), south + f * (north - south))
    degrees = np.asarray(frame.to_degrees(e, n), float)
    lat, lon = degrees[..., 0], degrees[..., 1]
    middle = float(frame.to_degrees(0.5 * (west + east), 0.5 * (south + north))[1])
    lon = middle + (lon - middle + 180.0) % 360.0 - 180.0  # the antimeridian is no edge
    lats = range(max(-90, math.floor(np.min(lat))), min(89, math.floor(np.max(lat))) + 1)
    lons = range(math.floor(lon.min()), math.floor(lon.max()) + 1)
    if len(lats) * len(lons) > MOST_TILES_OF_AREA:
        raise InputError(
            f"this area needs {len(lats) * len(lons)} tiles of one degree, more than {MOST_TILES_OF_AREA}; choose a "
            "smaller one",
            where=where,
        )
    return tuple(Cell(a, (o + 180) % 360 - 180) for a in reversed(lats) for o in lons)
