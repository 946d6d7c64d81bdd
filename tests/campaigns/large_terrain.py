"""Terrain of a given size: ArduPilot's files, and unknown ground at a given distance.

Each function writes the files of one input into the current folder and returns the arguments of ``gcsplan``. The
mission begins on the border of two tiles, so that both are read and joined.
"""

from __future__ import annotations

import binascii
import math
import random
from pathlib import Path

import numpy as np
import rasterio
from rasterio.transform import Affine

from gcsplan.dem.dat_file import CRC_BYTES, RECORD, RECORD_BYTES, VERSION, file_name
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.grid import ALL_PARTS, Block, TerrainGrid
from tests.campaigns.large_inputs import EAST_M, LAT, LON, NORTH_M, degrees, mission, waypoints

NORTH, SOUTH = Cell(46, 14), Cell(45, 14)
BLOCK_M = 24, 28
"""Metres from one block to the next, north and east, times the spacing."""


def _write_dat(cell: Cell, spacing_m: int, first: int, count: int, rng: random.Random) -> None:
    """Write the file of a tile whose records from ``first`` on, ``count`` of them, hold ground of about 100 m.

    The part before them is a hole in the file, and holds no block.
    """
    grid = TerrainGrid(spacing_m)
    row = grid.blocks_a_row(cell)
    records = np.zeros(count, RECORD)
    for k in range(count):
        records["north"][k], records["east"][k] = north, east = divmod(first + k, row)
        records["lat"][k], records["lon"][k] = grid.corner_e7(Block(cell, north, east))
    records["bitmap"], records["version"], records["spacing"] = ALL_PARTS, VERSION, spacing_m
    records["height"] = 100 + rng.randrange(3)
    records["lat_degrees"], records["lon_degrees"] = cell.lat_deg, cell.lon_deg
    data = records.tobytes()
    for k in range(count):  # the field of the sum is zero still
        records["crc"][k] = binascii.crc_hqx(data[k * RECORD_BYTES : k * RECORD_BYTES + CRC_BYTES], 0)
    with Path(file_name(cell)).open("wb") as file:
        file.seek(first * RECORD_BYTES)
        file.write(records.tobytes())


def _last_row(cell: Cell, spacing_m: int) -> int:
    """The number of the record with which the northernmost row of a tile begins."""
    return int(NORTH_M / (BLOCK_M[0] * spacing_m)) * TerrainGrid(spacing_m).blocks_a_row(cell)


def dat_megabytes(count: int, rng: random.Random) -> list[str]:
    """A mission over a file of ``count`` megabytes, with posts every 10 m."""
    _write_dat(NORTH, 10, 0, 1_000_000 * count // RECORD_BYTES, rng)
    (start,) = degrees([(0.0, 5000.0)])
    terrain = {"dem": file_name(NORTH), "vertical_datum": "EGM96", "nodata": "none"}
    return ["plan", *mission(terrain=terrain, start=start, goal=(2000.0, 5100.0)), "-o", "out", "--json"]


def dat_files(count: int, rng: random.Random) -> list[str]:
    """A mission over one file of a folder that has one for each of ``count`` tiles, 64,800 for the whole Earth."""
    folder = Path("terrain")
    folder.mkdir()
    for k in range(count - 1):
        (folder / file_name(Cell(89 - k // 360, k % 360 - 180))).write_bytes(bytes(RECORD_BYTES))
    _write_dat(NORTH, 100, 0, 1500, rng)
    Path(file_name(NORTH)).replace(folder / file_name(NORTH))
    (start,) = degrees([(0.0, 40_000.0)])
    terrain = {"dem": "terrain", "vertical_datum": "EGM96", "nodata": "none"}
    return ["plan", *mission(terrain=terrain, start=start, goal=(500.0, 40_100.0)), "-o", "out", "--json"]


def dat_posts(count: int, rng: random.Random) -> list[str]:
    """A mission of some ``count`` kilometres over posts every 20 m, which begins on the border of two tiles.

    22 km have 11 million posts around them.
    """
    length_m = 1000.0 * count
    row = TerrainGrid(20).blocks_a_row(NORTH)
    _write_dat(NORTH, 20, 0, row * math.ceil(min(2.0 * length_m + 30_000.0, NORTH_M) / (BLOCK_M[0] * 20)), rng)
    row = TerrainGrid(20).blocks_a_row(SOUTH)
    deep = row * math.ceil((0.5 * length_m + 20_000.0) / (BLOCK_M[0] * 20))
    _write_dat(SOUTH, 20, _last_row(SOUTH, 20) + row - deep, deep, rng)
    terrain = {"dem": [file_name(NORTH), file_name(SOUTH)], "vertical_datum": "EGM96", "nodata": "none"}
    return ["plan", *mission(terrain=terrain, goal=(0.5 * length_m, length_m)), "-o", "out", "--json"]


def reach_to_unknown(count: int, rng: random.Random) -> list[str]:
    """A check with a clearance of ``count`` cells of 10 m, on legs that have unknown ground within it on all sides."""
    side = 4000
    lat, lon = 10.0 / NORTH_M, 10.0 / EAST_M
    heights = np.full((side, side), 100.0 + rng.randrange(3), np.float32)
    away = min(int(0.95 * count), side // 2 - 20)
    for band in (slice(side // 2 - away - 1, side // 2 - away), slice(side // 2 + away, side // 2 + away + 1)):
        heights[band, :] = heights[:, band] = math.nan
    corner = Affine(lon, 0, LON - 0.5 * side * lon, 0, -lat, LAT + 0.5 * side * lat)
    with rasterio.open(
        "dem.tif", "w", driver="GTiff", width=side, height=side, count=1, dtype="float32", crs="EPSG:4326",
        transform=corner, nodata=math.nan,
    ) as file:  # fmt: skip
        file.write(heights, 1)
    waypoints([(rng.uniform(-900.0, 900.0), rng.uniform(-900.0, 900.0)) for _ in range(20)])
    terrain = ["--dem", "dem.tif", "--vertical-datum", "EGM96"]
    return ["check", "u.waypoints", *terrain, "--min-agl", "20", "--clearance", str(10 * count), "--json"]
