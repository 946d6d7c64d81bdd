"""Terrain tiles for the map: the ground that a mission is planned over, as PNG in the terrarium encoding; contours."""

from __future__ import annotations

import io
import json
import math
import threading
from collections import OrderedDict
from pathlib import Path
from typing import Any

import contourpy
import numpy as np
from PIL import Image

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.mission_file.scene import make_spec
from gcsplan.mission_file.values.errors import read_section
from gcsplan.mission_file.values.schema import TerrainKeys
from gcsplan.mission_file.window import opened
from gcsplan.units import METRE, Unit
from gcsplan.world.geodesy.frame import FARTHEST_M, Frame
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Box
from gcsplan.world.terrain.terrain import OpenTerrain

TILE_PIXELS = 256
MOST_TILES_BYTES = 32 * 2**20
"""Most bytes of all tiles that are kept."""

MOST_BLOCKS, BLOCK_CELLS, MOST_CELLS = 3, 3_000_000, 16_000_000
"""Blocks of ground that are kept; cells of one, if there is a choice; and cells of the ground under one tile."""

BLOCK_ZOOMS = 2
"""A block is the ground under a tile of this many zooms less, if that has no more cells than it may have."""

LEAST_ZOOM, MOST_ZOOM = 6, 15
"""Zooms of tiles; beyond, the map draws those of the last one larger."""

CONTOUR_PARTS = 64
"""Cells along a tile's edge from which its contours are drawn: some 40 m each where the map shows single posts."""

CONTOURS_M = {6: 1000.0, 8: 500.0, 10: 200.0, 11: 100.0, 12: 50.0, 13: 20.0, 14: 10.0}
CONTOURS_FT = {6: 3000.0, 8: 1500.0, 10: 500.0, 11: 250.0, 12: 100.0, 13: 50.0, 14: 25.0}
"""Height between contours by the zoom from which it holds: lines on a slope of 1 in 4 stay some pixels apart."""

MOST_CONTOURS = 200
"""Contours of one tile: on steeper ground every second one is left out, or more."""

MIDDLE_BOX_M = 1000.0
SEA_OFFSET_M = 32768.0
"""Terrarium: metres above this far below the sea, as 256ths in red, green and blue."""


TileNumber = tuple[int, int, int]


def bounds_of(terrain: OpenTerrain) -> list[float] | None:
    """West, south, east, north of a terrain in degrees; None for one without an edge."""
    middle = terrain.middle_deg
    if middle is None:
        return None
    frame, box = Frame(*middle), (-MIDDLE_BOX_M, -MIDDLE_BOX_M, MIDDLE_BOX_M, MIDDLE_BOX_M)
    west, south, east, north = terrain.around(frame, box).extent(frame, box)
    corners = np.clip([[west, south], [west, north], [east, south], [east, north]], -FARTHEST_M, FARTHEST_M)
    degrees = frame.to_degrees(corners[:, 0], corners[:, 1])
    return [float(degrees[:, 1].min()), float(degrees[:, 0].min()), float(degrees[:, 1].max()),
            float(degrees[:, 0].max())]  # fmt: skip


class GroundTiles:
    """The tiles of the terrain that ``section`` names (``terrain:`` of a mission in ``folder``).

    ``frame`` is that of a mission in local metres, whose hills stand in it; None otherwise. Raises InputError for
    terrain that cannot be opened. May be called from any thread: tiles are made one at a time.
    """

    def __init__(self, section: Any, folder: Path, frame: Frame | None) -> None:
        problems: list[Any] = []
        keys = read_section(TerrainKeys, section, "terrain", problems)
        if keys is None or problems:
            raise InputError.of(problems)
        self.terrain: OpenTerrain = opened(make_spec(keys, folder), where="terrain")
        self.flat = keys.flat_m is not None and not keys.peaks
        self._frame = frame
        self._lock = threading.Lock()
        self._tiles: OrderedDict[TileNumber, bytes | None] = OrderedDict()
        self._blocks: OrderedDict[TileNumber, tuple[Frame, Surface, float]] = OrderedDict()
        self.bounds = bounds_of(self.terrain)

    def png(self, z: int, x: int, y: int) -> bytes | None:
        """The tile as PNG; None where there is no ground, or more than one tile may take."""
        if not (LEAST_ZOOM <= z <= MOST_ZOOM and 0 <= x < 2**z and 0 <= y < 2**z):
            return None
        tile = z, x, y
        with self._lock:
            if tile in self._tiles:
                self._tiles.move_to_end(tile)
                return self._tiles[tile]
            made = self._made(tile)
            self._tiles[tile] = made
            while sum(len(t or b"") for t in self._tiles.values()) > MOST_TILES_BYTES or len(self._tiles) > 4096:
                self._tiles.popitem(last=False)
            return made

    def contours(self, z: int, x: int, y: int, unit: Unit) -> bytes | None:
        """The contours of a tile as GeoJSON, at round numbers of ``unit``: none where there is no ground, or too much.

        None for a tile that the page does not request.
        Each line has its ``height_m``, and ``fifth`` for every fifth one.
        """
        if not (LEAST_ZOOM <= z <= MOST_ZOOM and 0 <= x < 2**z and 0 <= y < 2**z):
            return None
        lat, lon = _lattice_deg((z, x, y))
        with self._lock:
            block = self._block((z, x, y))
            if block is None:
                return _geojson([])
            frame, surface, _ = block
            plane = frame.to_plane(*np.broadcast_arrays(lat[:, None], lon[None, :]))
            ground = np.ma.masked_invalid(surface.ground_at(plane[..., 0], plane[..., 1]))
        if ground.count() == 0:
            return _geojson([])
        made = contourpy.contour_generator(lon, lat, ground, name="serial")
        step_m = contour_interval_m(z, unit)
        low, high = math.ceil(float(ground.min()) / step_m), math.floor(float(ground.max()) / step_m)
        every = max(1, math.ceil((high - low + 1) / MOST_CONTOURS))
        lines = [
            {
                "type": "Feature", "properties": {"height_m": k * step_m, "fifth": k % 5 == 0},
                "geometry": {"type": "MultiLineString", "coordinates": parts},
            }
            for k in range(low + -low % every, high + 1, every)
            if (parts := [np.round(np.asarray(line), 6).tolist() for line in made.lines(k * step_m)])
        ]  # fmt: skip
        return _geojson(lines)

    def _made(self, tile: TileNumber) -> bytes | None:
        block = self._block(tile)
        if block is None:  # too much ground for one tile is drawn flat
            return _terrarium(np.zeros((TILE_PIXELS, TILE_PIXELS))) if self._touched(tile) else None
        frame, surface, lowest_m = block
        lat, lon = _pixels_deg(tile)
        plane = frame.to_plane(*np.broadcast_arrays(lat[:, None], lon[None, :]))
        ground = surface.ground_at(plane[..., 0], plane[..., 1])
        known = np.isfinite(ground)
        return _terrarium(np.where(known, ground, lowest_m)) if known.any() or self._touched(tile) else None

    def _touched(self, tile: TileNumber) -> bool:
        """Whether a tile meets `bounds`: the page requests it then, also where the ground ends on the slant."""
        if self.bounds is None:
            return False
        (south, north), (west, east) = _edges_deg(tile)
        return self.bounds[0] <= east and west <= self.bounds[2] and self.bounds[1] <= north and south <= self.bounds[3]

    def _block(self, tile: TileNumber) -> tuple[Frame, Surface, float] | None:
        """The ground under a tile, with much around it if that is not too large."""
        z, x, y = tile
        for up in range(min(BLOCK_ZOOMS, z), -1, -1):
            block = z - up, x >> up, y >> up
            if block in self._blocks:
                self._blocks.move_to_end(block)
                return self._blocks[block]
        for up in range(min(BLOCK_ZOOMS, z), -1, -1):
            block = z - up, x >> up, y >> up
            found = self._loaded(block, BLOCK_CELLS if up else MOST_CELLS)
            if found is not None:
                self._blocks[block] = found
                while len(self._blocks) > MOST_BLOCKS:
                    self._blocks.popitem(last=False)
                return found
        return None

    def _loaded(self, block: TileNumber, most_cells: int) -> tuple[Frame, Surface, float] | None:
        lat, lon = _edges_deg(block)
        try:
            frame = self._frame or Frame(0.5 * (lat[0] + lat[1]), 0.5 * (lon[0] + lon[1]))
            corners = frame.to_plane([lat[0], lat[0], lat[1], lat[1]], [lon[0], lon[1], lon[0], lon[1]])
            if not np.isfinite(corners).all() or np.abs(corners).max() > FARTHEST_M:
                return None
            box: Box = (*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist())
            surface = self.terrain.around(frame, box).load(frame, box, most_cells=most_cells)
        except InputError:
            return None  # no ground there, or too much
        return frame, surface, float(np.nanmin(surface.ground_m))


def contour_interval_m(zoom: int, unit: Unit) -> float:
    """Height between contours at a zoom, a round number of ``unit``."""
    steps = CONTOURS_M if unit == METRE else CONTOURS_FT
    return unit.size * steps[max(z for z in steps if z <= max(zoom, LEAST_ZOOM))]


def _edges_deg(tile: TileNumber) -> tuple[tuple[float, float], tuple[float, float]]:
    """South and north, west and east of a tile."""
    z, x, y = tile
    return (_lat_deg(y + 1.0, z), _lat_deg(y, z)), (x / 2**z * 360.0 - 180.0, (x + 1) / 2**z * 360.0 - 180.0)


def _lat_deg(y: float, z: int) -> float:
    return math.degrees(math.atan(math.sinh(math.pi * (1.0 - 2.0 * y / 2**z))))


def _pixels_deg(tile: TileNumber) -> tuple[Floats, Floats]:
    """Latitudes from the north and longitudes from the west of a tile's pixels, at their middles."""
    z, x, y = tile
    part = (np.arange(TILE_PIXELS) + 0.5) / TILE_PIXELS
    lat = np.degrees(np.arctan(np.sinh(np.pi * (1.0 - 2.0 * (y + part) / 2**z))))
    return lat, (x + part) / 2**z * 360.0 - 180.0


def _lattice_deg(tile: TileNumber) -> tuple[Floats, Floats]:
    """Latitudes from the north and longitudes from the west of the corners of a tile's cells, its edges among them."""
    z, x, y = tile
    part = np.arange(CONTOUR_PARTS + 1) / CONTOUR_PARTS
    lat = np.array([_lat_deg(float(v), z) for v in y + part])
    return lat, (x + part) / 2**z * 360.0 - 180.0


def _geojson(lines: list[dict[str, Any]]) -> bytes:
    return json.dumps({"type": "FeatureCollection", "features": lines}, separators=(",", ":")).encode()


def _terrarium(heights_m: Floats) -> bytes:
    whole = np.rint((np.clip(heights_m, -11_000.0, 9_000.0) + SEA_OFFSET_M) * 256.0).astype(np.uint32)
    colour = np.stack([whole >> 16, whole >> 8 & 255, whole & 255], axis=-1).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(colour).save(buffer, "PNG", compress_level=1)
    return buffer.getvalue()
