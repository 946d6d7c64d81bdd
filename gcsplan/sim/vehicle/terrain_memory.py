"""A loopback vehicle's terrain, kept as ArduPilot keeps it: blocks in a small cache, filled by the ground station.

It asks for what it lacks around itself and around its way points, one block every 2 s, and reads heights only where it
has all four posts (AP_Terrain). It has no SD card: a block that falls out of the cache is forgotten.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Sequence
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mav

from gcsplan.arrays import Floats
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Home, MissionItem
from gcsplan.world.terrain.grid import (
    ALL_PARTS,
    E7_OF_METRE,
    PART_POSTS,
    PARTS_OF_BLOCK,
    POSTS_OF_BLOCK,
    STRIDE,
    Block,
    TerrainGrid,
    longitude_scale,
)

CACHE_BLOCKS = 12  # TERRAIN_CACHE_SZ, default
REQUEST_EVERY_S = 2.0
AROUND_BLOCKS = 0.7  # of a block's size: where the blocks around the vehicle are looked up (update_surrounding_tiles)
AROUND_WAY_POINT = 10.0  # spacings, at 45°, 135° …


class TerrainMemory:
    """The blocks of one vehicle. ``now``: seconds."""

    def __init__(self, spacing_m: int) -> None:
        self.grid = TerrainGrid(spacing_m)
        self._cache: OrderedDict[Block, tuple[int, Floats]] = OrderedDict()
        self._next_request = -math.inf

    def read(self, lat_e7: int, lon_e7: int) -> float | None:
        """The height at a place, m AMSL; None if a post is missing, which then counts as needed."""
        [block] = self.grid.blocks_over(lat_e7, lon_e7)
        bits, heights = self._kept(block)
        north, east = (float(m) / self.grid.spacing_m for m in self.grid.offset_m(block.cell, lat_e7, lon_e7))
        i, j = math.floor(north), math.floor(east)
        u, v = north - i, east - j
        a, b = i - block.north * STRIDE[0], j - block.east * STRIDE[1]
        for row, column in ((a, b), (a, b + 1), (a + 1, b), (a + 1, b + 1)):
            if not bits >> (row // PART_POSTS * PARTS_OF_BLOCK[1] + column // PART_POSTS) & 1:
                return None
        west = (1.0 - u) * heights[a, b] + u * heights[a + 1, b]
        return float((1.0 - v) * west + v * ((1.0 - u) * heights[a, b + 1] + u * heights[a + 1, b + 1]))

    def look_around(self, home: Home, items: Sequence[MissionItem]) -> None:
        """Want the blocks around the vehicle; and those around its way points, one after another, as there is room."""
        for north in (-1, 0, 1):
            for east in (-1, 0, 1):
                away = (
                    m * AROUND_BLOCKS * self.grid.spacing_m
                    for m in (north * POSTS_OF_BLOCK[0], east * POSTS_OF_BLOCK[1])
                )
                self.read(*_moved(home.lat_e7, home.lon_e7, *away))
        if self.pending:
            return
        reach_m = AROUND_WAY_POINT * self.grid.spacing_m * math.sqrt(0.5)
        for item in items:
            if item.command in (cmd.WAYPOINT, cmd.SPLINE_WAYPOINT) and (item.x or item.y):
                for north, east in ((1, 1), (-1, 1), (-1, -1), (1, -1), (0, 0)):
                    if self.read(*_moved(item.x, item.y, north * reach_m, east * reach_m)) is None:
                        return

    def request(self, now: float) -> Any | None:
        """The next TERRAIN_REQUEST, if one is due."""
        if now < self._next_request:
            return None
        for block, (bits, _) in self._cache.items():
            if bits != ALL_PARTS:
                self._next_request = now + REQUEST_EVERY_S
                lat, lon = self.grid.corner_e7(block)
                return mav.MAVLink_terrain_request_message(lat, lon, self.grid.spacing_m, ALL_PARTS & ~bits)
        return None

    def take(self, message: Any) -> None:
        """Store a TERRAIN_DATA, if it is for a block that is kept."""
        block = self.grid.block_at(message.lat, message.lon)
        if block not in self._cache or message.grid_spacing != self.grid.spacing_m or message.gridbit >= 56:
            return
        assert block is not None
        bits, heights = self._cache[block]
        row, column = divmod(message.gridbit, PARTS_OF_BLOCK[1])
        part = np.array(message.data, float).reshape(PART_POSTS, PART_POSTS)
        heights[row * PART_POSTS : (row + 1) * PART_POSTS, column * PART_POSTS : (column + 1) * PART_POSTS] = part
        self._cache[block] = bits | 1 << message.gridbit, heights

    @property
    def pending(self) -> int:
        """The number of parts that are needed and missing."""
        return sum((ALL_PARTS & ~bits).bit_count() for bits, _ in self._cache.values())

    @property
    def loaded(self) -> int:
        """Parts that are there."""
        return sum(bits.bit_count() for bits, _ in self._cache.values())

    def report(self, lat_e7: int, lon_e7: int, amsl_m: float) -> Any:
        """TERRAIN_REPORT for a place; ``amsl_m`` is the vehicle's altitude."""
        height = self.read(lat_e7, lon_e7)
        return mav.MAVLink_terrain_report_message(
            lat_e7, lon_e7, 0 if height is None else self.grid.spacing_m, height or 0.0,
            0.0 if height is None else amsl_m - height, self.pending, self.loaded,
        )  # fmt: skip

    def _kept(self, block: Block) -> tuple[int, Floats]:
        if block not in self._cache:
            while len(self._cache) >= CACHE_BLOCKS:
                self._cache.popitem(last=False)
            self._cache[block] = 0, np.zeros(POSTS_OF_BLOCK)
        self._cache.move_to_end(block)
        return self._cache[block]


def _moved(lat_e7: int, lon_e7: int, north_m: float, east_m: float) -> tuple[int, int]:
    lat = lat_e7 + int(north_m * E7_OF_METRE)
    lon = lon_e7 + int(east_m * E7_OF_METRE / float(longitude_scale(lat)))
    return lat, (lon + 1_800_000_000) % 3_600_000_000 - 1_800_000_000
