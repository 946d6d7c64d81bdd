"""The table of published terrain: each source's address, the meaning of its heights, and the tiles that an area needs.

Addresses, names and spacings follow the publishers' own descriptions (docs/how-to/terrain.md names them). A
source belongs here only if its datum and its kind of model are stated by its publisher for every tile. Tiles have one
degree.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from gcsplan.errors import InputError
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Box
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.input_files import tell_file
from gcsplan.world.terrain.terrain import RASTER_SPARE_M

ModelKind = Literal["surface", "bare"]


MOST_LIST_BYTES = 64 * 2**20

CELL_SPARE_M = RASTER_SPARE_M + 200.0
"""Margin around a box, m: the terrain that is read around it, and three cells of the coarsest source."""

MOST_TILES_OF_AREA = 100
"""Most tiles that one mission or one command may need: a mission is much smaller, and so many take gigabytes."""


@dataclass(frozen=True, slots=True)
class DemSource:
    """One source.

    ``kind``: a surface model holds trees and buildings, a bare one only the earth. ``address`` is the public bucket's
    address, and ``bucket`` its name, the folder that a mirror has for it. ``object_of`` names the object of a tile,
    ``listing`` the one that lists all tiles; each match of ``listed`` in it is a tile (groups: N36, W085), and a list
    is whole if it holds ``least_tiles`` and ends with ``last``. ``columns_of`` counts a tile's columns for 3,600 rows.
    ``notice`` is the text that the licence requires beside everything that is made of the data.
    """

    name: str
    title: str
    kind: ModelKind
    vertical_datum: str
    bucket: str
    address: str
    listing: str
    listed: re.Pattern[str]
    last: str
    least_tiles: int
    object_of: Callable[[Cell], str]
    columns_of: Callable[[Cell], int]
    shares_edges: bool
    most_tile_bytes: int
    notice: str

    def tiles_in(self, text: str) -> frozenset[str] | None:
        """The names of the tiles in a list; None if it is not the whole list."""
        names = frozenset(north_south + east_west for north_south, east_west in self.listed.findall(text))
        return names if len(names) >= self.least_tiles and text.rstrip().endswith(self.last) else None


def _copernicus(arc_seconds: int) -> Callable[[Cell], str]:
    def object_of(cell: Cell) -> str:
        name = f"Copernicus_DSM_COG_{arc_seconds}_{cell.north_south}_00_{cell.east_west}_00_DEM"
        return f"{name}/{name}.tif"

    return object_of


def _copernicus_columns(cell: Cell) -> int:
    """Columns widen in steps towards the poles; a tile counts by its side that is nearer to the equator."""
    nearer = cell.lat_deg if cell.lat_deg >= 0 else -cell.lat_deg - 1
    steps = ((50, 3600), (60, 2400), (70, 1800), (80, 1200), (85, 720))
    return next((columns for below, columns in steps if nearer < below), 360)


GLO30 = DemSource(
    name="copernicus-glo30",
    title="Copernicus DEM GLO-30",
    kind="surface",
    vertical_datum="EGM2008",
    bucket="copernicus-dem-30m",
    address="https://copernicus-dem-30m.s3.amazonaws.com",
    listing="tileList.txt",
    listed=re.compile(r"^Copernicus_DSM_COG_10_([NS]\d{2})_00_([EW]\d{3})_00_DEM\s*$", re.MULTILINE),
    last="_DEM",
    least_tiles=20_000,
    object_of=_copernicus(10),
    columns_of=_copernicus_columns,
    shares_edges=False,
    most_tile_bytes=128 * 2**20,
    notice="produced using Copernicus WorldDEM-30 © DLR e.V. 2010-2014 and © Airbus Defence and Space GmbH 2014-2018 "
    "provided under COPERNICUS by the European Union and ESA; all rights reserved",
)

GLO90 = replace(
    GLO30,
    name="copernicus-glo90",
    title="Copernicus DEM GLO-90",
    bucket="copernicus-dem-90m",
    address="https://copernicus-dem-90m.s3.amazonaws.com",
    listed=re.compile(r"^Copernicus_DSM_COG_30_([NS]\d{2})_00_([EW]\d{3})_00_DEM\s*$", re.MULTILINE),
    object_of=_copernicus(30),
    notice=GLO30.notice.replace("-30", "-90"),
)
"""It holds every tile of land, so its list separates the sea from tiles that another source merely lacks."""

SRTM = DemSource(
    name="srtm",
    title="SRTM GL1 (NASA SRTMGL1 v3)",
    kind="surface",
    vertical_datum="EGM96",
    bucket="raster",
    address="https://opentopography.s3.sdsc.edu/raster",
    listing="SRTM_GL1/SRTM_GL1_srtm.vrt",
    listed=re.compile(r"SRTM_GL1_srtm/(?:[A-Za-z0-9_]+/)*([NS]\d{2})([EW]\d{3})\.tif"),
    last="</VRTDataset>",
    least_tiles=14_000,
    object_of=lambda cell: f"SRTM_GL1/SRTM_GL1_srtm/{cell.name}.tif",
    columns_of=lambda _: 3600,
    shares_edges=True,
    most_tile_bytes=128 * 2**20,
    notice="NASA Shuttle Radar Topography Mission Global 1 arc second, distributed by OpenTopography, "
    "https://doi.org/10.5069/G9445JDF",
)

SOURCES: dict[str, DemSource] = {source.name: source for source in (GLO30, SRTM)}
"""The sources that a mission may name."""

WITNESS = GLO90
"""The fuller source, whose list must agree before a missing tile counts as sea."""


def source_or_path(name: str, folder: Path) -> str:
    """The name of a source, or the path of a file in ``folder``; a file that has a source's name is that file."""
    path = folder / name
    if name in SOURCES:
        tell_file(path)
        return str(path.absolute()) if path.exists() else name
    return str(path)


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
