"""ArduPilot's terrain grid: the places of its posts, their blocks, and the height that it reads between them.

Each degree tile has posts of its own, ``spacing_m`` apart, counted north and east from its south-west corner by the
autopilot's flat-earth formula (AP_Terrain, `calculate_grid_info`). A block holds 28 × 32 posts, and begins 24 posts
north and 28 east of its neighbour, so that every point has its four posts in one block. A block is sent and
marked as known in parts of 4 × 4 posts. Heights are whole metres; between posts they are bilinear.

The autopilot computes some of this in float32, which moves a point by up to 1 cm; here it is float64.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gcsplan.arrays import Floats
from gcsplan.world.terrain.cell import Cell

SPACING_M = 100
"""TERRAIN_SPACING, default."""

PART_POSTS = 4
POSTS_OF_BLOCK = (28, 32)
"""Posts of a block, north and east."""
STRIDE = (24, 28)
"""Posts from a block's first post to the next block's first one, north and east."""
PARTS_OF_BLOCK = (POSTS_OF_BLOCK[0] // PART_POSTS, POSTS_OF_BLOCK[1] // PART_POSTS)
ALL_PARTS = (1 << (PARTS_OF_BLOCK[0] * PARTS_OF_BLOCK[1])) - 1

DEGREE_E7 = 10_000_000
METRES_OF_E7 = float(np.float32(0.011131884502145034))
E7_OF_METRE = float(np.float32(89.83204953368922))
LEAST_SCALE = 0.01
SAME_CORNER_E7 = 10
"""Corners that two computations of one block may differ by, 1e-7°: about 11 cm; ArduPilot itself takes 5."""

RAISED_LESS_M = 1e-6
"""A height this little above a whole metre counts as that metre: it is rounding, not ground."""

NEAR_ENOUGH_M = 0.5
"""A vehicle that holds the grid that was sent reads it within this; more is other terrain."""

MOST_BLOCKS_KEPT = 4096
"""Blocks that are kept; 30 MB."""

GroundHeights = Callable[[Floats, Floats], Floats]
"""Ground, m AMSL, at latitudes and longitudes in degrees; NaN where unknown."""


class Block(NamedTuple):
    """A block by its place in its degree tile, counted from the south-west corner."""

    cell: Cell
    north: int
    east: int


def longitude_scale(lat_e7: ArrayLike) -> Floats:
    """Length of a degree of longitude as a part of one of latitude, as the autopilot has it."""
    return np.maximum(np.cos(np.radians(np.asarray(lat_e7, float) * 1e-7)), LEAST_SCALE)


@dataclass(frozen=True, slots=True)
class TerrainGrid:
    """The posts and blocks for one spacing, m (TERRAIN_SPACING)."""

    spacing_m: int = SPACING_M

    def offset_m(self, cell: Cell, lat_e7: ArrayLike, lon_e7: ArrayLike) -> tuple[Floats, Floats]:
        """Metres north and east of a tile's corner, as the autopilot counts them; points may lie outside the tile."""
        lat, lon = np.asarray(lat_e7, float), np.asarray(lon_e7, float)
        corner_lat, corner_lon = cell.lat_deg * DEGREE_E7, cell.lon_deg * DEGREE_E7
        east = (lon - corner_lon + 180.0 * DEGREE_E7) % (360.0 * DEGREE_E7) - 180.0 * DEGREE_E7
        north_m = (lat - corner_lat) * METRES_OF_E7
        return north_m, east * METRES_OF_E7 * longitude_scale(0.5 * (lat + corner_lat))

    def post_e7(self, cell: Cell, north: ArrayLike, east: ArrayLike) -> tuple[Floats, Floats]:
        """Latitude and longitude, 1e-7°, of posts by their number: where `offset_m` is that number of spacings."""
        lat = cell.lat_deg * DEGREE_E7 + np.asarray(north, float) * (self.spacing_m / METRES_OF_E7)
        scale = longitude_scale(0.5 * (lat + cell.lat_deg * DEGREE_E7))
        lon = cell.lon_deg * DEGREE_E7 + np.asarray(east, float) * (self.spacing_m / METRES_OF_E7) / scale
        return lat, (lon + 180.0 * DEGREE_E7) % (360.0 * DEGREE_E7) - 180.0 * DEGREE_E7

    def corner_e7(self, block: Block) -> tuple[int, int]:
        """South-west corner of a block in the autopilot's own integers (Location, `offset_latlng`)."""
        lat, lon = block.cell.lat_deg * DEGREE_E7, block.cell.lon_deg * DEGREE_E7
        north = math.trunc(block.north * STRIDE[0] * self.spacing_m * E7_OF_METRE)
        scale = float(longitude_scale(lat + north // 2))
        east = math.trunc(block.east * STRIDE[1] * self.spacing_m * E7_OF_METRE / scale)
        return lat + north, (lon + east + 180 * DEGREE_E7) % (360 * DEGREE_E7) - 180 * DEGREE_E7

    def block_at(self, lat_e7: int, lon_e7: int) -> Block | None:
        """The block whose corner lies there, as in a TERRAIN_REQUEST; None if there is none."""
        cell = cell_at(lat_e7, lon_e7)
        north_m, east_m = self.offset_m(cell, lat_e7, lon_e7)
        block = Block(
            cell,
            round(float(north_m) / (self.spacing_m * STRIDE[0])),
            round(float(east_m) / (self.spacing_m * STRIDE[1])),
        )
        lat, lon = self.corner_e7(block)
        return block if max(abs(lat - lat_e7), abs(lon - lon_e7)) <= SAME_CORNER_E7 else None

    def blocks_a_row(self, cell: Cell) -> int:
        """Blocks in a row of a tile's file, which has some to spare in the east (AP_Terrain, `east_blocks`)."""
        lat, lon = cell.lat_deg * DEGREE_E7, (cell.lon_deg + 1) * DEGREE_E7
        more = math.trunc(2 * self.spacing_m * POSTS_OF_BLOCK[1] * E7_OF_METRE / float(longitude_scale(lat)))
        width_m = (lon + more - cell.lon_deg * DEGREE_E7) * METRES_OF_E7 * float(longitude_scale(lat))
        return int(width_m / (self.spacing_m * STRIDE[1]))

    def blocks_over(self, lat_e7: ArrayLike, lon_e7: ArrayLike) -> list[Block]:
        """The blocks that the autopilot looks up for these points, in the order of tile, row and column."""
        lat, lon = np.broadcast_arrays(np.asarray(lat_e7, float).ravel(), np.asarray(lon_e7, float).ravel())
        found: set[Block] = set()
        for cell in cells_of(lat, lon):
            mine = _in_cell(cell, lat, lon)
            north, east = (np.floor(m / self.spacing_m).astype(int) for m in self.offset_m(cell, lat[mine], lon[mine]))
            pairs = np.unique(np.column_stack([north // STRIDE[0], east // STRIDE[1]]), axis=0)
            found.update(Block(cell, int(n), int(e)) for n, e in pairs)
        return sorted(found)

    def blocks_within(self, south_e7: float, west_e7: float, north_e7: float, east_e7: float) -> Iterator[Block]:
        """The blocks that the autopilot may look up anywhere in a box of degrees, which may cross the antimeridian.

        They come tile by tile and row by row, each found when it is needed. A block on the border of the box or of its
        tile may be one too many, never one too few.
        """
        width = (east_e7 - west_e7) % (360.0 * DEGREE_E7) if east_e7 != west_e7 else 0.0
        first = math.floor(west_e7 / DEGREE_E7)
        for lat in range(math.floor(south_e7 / DEGREE_E7), math.floor(north_e7 / DEGREE_E7) + 1):
            for lon in range(first, math.floor((west_e7 + width) / DEGREE_E7) + 1):
                cell = Cell(lat, (lon + 180) % 360 - 180)
                low, high = max(0.0, south_e7 - lat * DEGREE_E7), min(1.0 * DEGREE_E7, north_e7 - lat * DEGREE_E7)
                left, right = (
                    max(0.0, west_e7 - lon * DEGREE_E7),
                    min(1.0 * DEGREE_E7, west_e7 + width - lon * DEGREE_E7),
                )
                yield from self._blocks_of(cell, (low, high), (left, right))

    def _blocks_of(self, cell: Cell, lat: tuple[float, float], lon: tuple[float, float]) -> Iterator[Block]:
        """Blocks of one tile that meet a box, given in 1e-7° from the tile's corner."""
        a_row_m, a_column_m = self.spacing_m * STRIDE[0], self.spacing_m * STRIDE[1]
        for row in range(int(lat[0] * METRES_OF_E7 / a_row_m), int(lat[1] * METRES_OF_E7 / a_row_m) + 1):
            ends = np.clip([row * a_row_m / METRES_OF_E7, (row + 1) * a_row_m / METRES_OF_E7], *lat)
            scale = longitude_scale(cell.lat_deg * DEGREE_E7 + 0.5 * ends) * METRES_OF_E7
            first, last = int(lon[0] * scale.min() / a_column_m), int(lon[1] * scale.max() / a_column_m)
            yield from (Block(cell, row, column) for column in range(first, last + 1))


def cell_at(lat_e7: float, lon_e7: float) -> Cell:
    """The tile of a place."""
    lon = math.floor(lon_e7 / DEGREE_E7)
    return Cell(math.floor(lat_e7 / DEGREE_E7), (lon + 180) % 360 - 180)


def cells_of(lat_e7: Floats, lon_e7: Floats) -> list[Cell]:
    """The tiles of places, in order."""
    lon = (np.floor(lon_e7 / DEGREE_E7) + 180.0) % 360.0 - 180.0
    pairs = np.unique(np.column_stack([np.floor(lat_e7 / DEGREE_E7), lon]), axis=0)
    return [Cell(int(a), int(o)) for a, o in pairs if math.isfinite(a) and math.isfinite(o)]


def _in_cell(cell: Cell, lat_e7: Floats, lon_e7: Floats) -> NDArray[np.bool_]:
    lon = (np.floor(lon_e7 / DEGREE_E7) + 180.0) % 360.0 - 180.0
    return np.asarray((np.floor(lat_e7 / DEGREE_E7) == cell.lat_deg) & (lon == cell.lon_deg))


class PostHeights:
    """Heights of a grid's posts over some ground: whole metres, upwards, so that no post lies below it."""

    def __init__(self, grid: TerrainGrid, ground: GroundHeights) -> None:
        self.grid = grid
        self._ground = ground
        self._blocks: OrderedDict[Block, Floats] = OrderedDict()

    def block(self, block: Block) -> Floats:
        """(28, 32) heights of a block, m AMSL, rows going north; NaN for all of a part with an unknown post."""
        known = self._blocks.get(block)
        if known is not None:
            self._blocks.move_to_end(block)
            return known
        north = block.north * STRIDE[0] + np.arange(POSTS_OF_BLOCK[0])[:, None]
        east = block.east * STRIDE[1] + np.arange(POSTS_OF_BLOCK[1])
        lat, lon = self.grid.post_e7(block.cell, *np.broadcast_arrays(north, east))
        ground = np.asarray(self._ground(lat * 1e-7, lon * 1e-7), float)
        heights = whole_parts(np.ceil(ground - RAISED_LESS_M))
        heights.setflags(write=False)
        while len(self._blocks) >= MOST_BLOCKS_KEPT:
            self._blocks.popitem(last=False)
        self._blocks[block] = heights
        return heights

    def window(self, cell: Cell, north: tuple[int, int], east: tuple[int, int]) -> Floats:
        """Heights of the posts from a first to a last number, both included, north and east of a tile's corner."""
        out = np.full((north[1] - north[0] + 1, east[1] - east[0] + 1), np.nan)
        for i in range(north[0] // STRIDE[0], north[1] // STRIDE[0] + 1):
            for j in range(east[0] // STRIDE[1], east[1] // STRIDE[1] + 1):
                r0, c0 = i * STRIDE[0] - north[0], j * STRIDE[1] - east[0]
                rows = slice(max(r0, 0), max(min(r0 + STRIDE[0], len(out)), 0))
                cols = slice(max(c0, 0), max(min(c0 + STRIDE[1], out.shape[1]), 0))
                part = self.block(Block(cell, i, j))
                out[rows, cols] = part[rows.start - r0 : rows.stop - r0, cols.start - c0 : cols.stop - c0]
        return out

    def amsl(self, lat_e7: ArrayLike, lon_e7: ArrayLike) -> Floats:
        """The height that the autopilot reads at places, m AMSL; NaN where it does not know all four posts."""
        lat, lon = np.broadcast_arrays(np.asarray(lat_e7, float), np.asarray(lon_e7, float))
        out = np.full(lat.shape, np.nan)
        for cell in cells_of(lat.ravel(), lon.ravel()):
            mine = _in_cell(cell, lat, lon)
            n, e = (m / self.grid.spacing_m for m in self.grid.offset_m(cell, lat[mine], lon[mine]))
            i, j = np.floor(n).astype(int), np.floor(e).astype(int)
            heights = np.empty((4, len(i)))
            block_of = np.column_stack([i // STRIDE[0], j // STRIDE[1]])
            for row, column in np.unique(block_of, axis=0):
                here = np.flatnonzero((block_of == (row, column)).all(axis=1))
                posts = self.block(Block(cell, int(row), int(column)))
                a, b = i[here] - row * STRIDE[0], j[here] - column * STRIDE[1]
                heights[:, here] = posts[a, b], posts[a, b + 1], posts[a + 1, b], posts[a + 1, b + 1]
            u, v = n - i, e - j
            west = (1.0 - u) * heights[0] + u * heights[2]
            out[mine] = (1.0 - v) * west + v * ((1.0 - u) * heights[1] + u * heights[3])
        return out


def whole_parts(heights: Floats) -> Floats:
    """A copy of a block's heights in which a part with an unknown post is unknown as a whole."""
    parts = heights.reshape(PARTS_OF_BLOCK[0], PART_POSTS, PARTS_OF_BLOCK[1], PART_POSTS)
    unknown = np.isnan(parts).any(axis=(1, 3), keepdims=True)
    return np.where(unknown, np.nan, parts).reshape(POSTS_OF_BLOCK)


def known_parts(heights: Floats) -> int:
    """The bitmap of a block's known parts: bit ``8 · north + east``."""
    known = ~np.isnan(heights.reshape(PARTS_OF_BLOCK[0], PART_POSTS, PARTS_OF_BLOCK[1], PART_POSTS)).any(axis=(1, 3))
    return sum(1 << bit for bit, there in enumerate(known.ravel()) if there)


def part_of(heights: Floats, bit: int) -> Floats:
    """(16,) heights of one part, the first four going east, as they are sent."""
    north, east = divmod(bit, PARTS_OF_BLOCK[1])
    return heights[north * PART_POSTS : (north + 1) * PART_POSTS, east * PART_POSTS : (east + 1) * PART_POSTS].ravel()
