"""Terrain out of ArduPilot's .DAT files: the posts of the tile under the mission, as they are.

The surface lies on the post grid of the tile that holds the middle of the mission, so that inside this tile the
autopilot interpolates the same heights. A neighbouring tile has posts of its own that fit no common grid: there, and in
the cells on the border, the terrain of the files lies between a least and a greatest height (`bounds`). On even ground,
however steep, the two heights are equal.

These bounds hold for terrain that is bilinear between the posts of several grids. In each cell of the one grid a plane
is fitted to the posts within a spacing of it. A surface that is bilinear between these posts lies between the plane
plus the lowest and the plane plus the highest of their (signed) heights above it. A node takes the outermost value of
the four cells around it, so that between nodes the bounds hold too. Over a plane they are the plane. A cell whose posts
lie in one row holds no ground between posts, and counts for no node.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.dem.dat_file import MOST_DAT_BYTES, DatFile, cell_of_file, is_dat, read_dat
from gcsplan.dem.sources import cells_in
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.datum import VerticalDatum
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geodesy.height_unit import BY_FORMAT, HeightUnit
from gcsplan.world.geometry.surface import GridMap
from gcsplan.world.geometry.zones import Box
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.grid import DEGREE_E7, METRES_OF_E7, STRIDE, TerrainGrid, cell_at, longitude_scale
from gcsplan.world.terrain.input_files import sha256_of, tell_folder
from gcsplan.world.terrain.mosaic import FIT_ERROR_M, Window, box_lattice
from gcsplan.world.terrain.raster import MAX_CELLS, require_file
from gcsplan.world.terrain.terrain import NO_MORE_VOIDS, Terrain, TerrainSpec, place, require_metres, terrain_of

WHOLE_METRES = HeightUnit("whole metres", 1.0, BY_FORMAT)

MOST_POSTS = MAX_CELLS // 4
"""Posts around a mission: they have a greatest and a least height, and the files are in memory beside them."""

POSTS_AT_ONCE = 500_000
"""Posts of one tile that are joined with posts of other tiles at once: each takes 250 bytes."""


REACH = 1.1
"""Spacings around a cell within which a post counts: one, and the difference of two tiles' scales."""

FLATTEST = 1e-6
"""Posts whose places spread less than this, in squares of spacings, lie in one row or are one."""


@dataclass(frozen=True, eq=False)
class DatTile:
    """The report's entry for one file."""

    name: str
    path: Path
    notes: tuple[Note, ...]
    vertical: VerticalDatum | None = None
    unit: HeightUnit = WHOLE_METRES

    @property
    def stored_bytes(self) -> int:
        """The size of the file."""
        return self.path.stat().st_size

    def sha256(self) -> str:
        """The file's hash."""
        return sha256_of(self.path)


def dat_files(paths: Sequence[str], *, where: str) -> list[Path]:
    """The .DAT files that ``paths`` name, as files or in folders; empty if they name none. Raises InputError."""
    found: list[Path] = []
    others = []
    for text in paths:
        path = Path(text)
        tell_folder(path, (".dat",))
        inside = sorted(p for p in path.iterdir() if is_dat(p)) if os.path.isdir(path) else []
        if is_dat(path) or inside:
            found += inside or [path]
        else:
            others.append(path.name)
    if found and others:
        raise InputError(f".DAT files stand alone, and {others[0]} is none; give the one or the other", where=where)
    return found


class DatTerrain:
    """Files, each read when a place or a mission first needs it. Raises InputError for any other file."""

    def __init__(self, paths: Sequence[Path], spec: TerrainSpec, *, where: str) -> None:
        self._spec, self._where, self._at = spec, where, place(where, "dem")
        self._paths: dict[Cell, Path] = {}
        self._files: dict[Cell, DatFile] = {}
        self._held_bytes = 0
        for path in paths:
            require_file(path, where=self._at)
            cell = cell_of_file(path, where=self._at)
            if self._paths.setdefault(cell, path) is not path:
                raise InputError(f"{self._paths[cell]} and {path} are of one tile; give one of them", where=self._at)
        for key in ("crs", "height_unit"):
            if getattr(spec, key) is not None:
                raise InputError("a .DAT file states it itself; remove the key", where=place(where, key))
        if spec.nodata not in (None, NO_MORE_VOIDS):
            words = "a .DAT file marks its voids itself: `none` alone may stand here, if zeros are ground or sea"
            raise InputError(words, where=place(where, "nodata"))
        require_metres(spec, "the heights of .DAT files are", where=place(where, "vertical_datum"))

    @property
    def middle_deg(self) -> tuple[float, float] | None:
        """See `OpenTerrain.middle_deg`."""
        return next(((cell.lat_deg + 0.5, cell.lon_deg + 0.5) for cell in self._paths), None)

    def covers(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> Bools:
        """True where a place lies in a block that its file holds (which may still be unknown there)."""

        def known(lat: float, lon: float) -> bool:
            cell = cell_at(lat * 1e7, lon * 1e7)
            return cell in self._paths and _holds(self._file(cell), lat, lon)

        return _each(known, lat_deg, lon_deg)

    def around(self, frame: Frame, box: Box) -> Terrain:
        """The terrain that a mission in ``box`` (west, south, east, north, plane metres) uses. Raises InputError."""
        cells = [cell for cell in cells_in(frame, box, where=self._at) if cell in self._paths]
        if not cells:
            raise InputError(
                f"no .DAT file of this place, {cell_at(frame.lat_deg * 1e7, frame.lon_deg * 1e7).name}, is given",
                where=self._at,
            )
        anchor = cell_at(frame.lat_deg * 1e7, frame.lon_deg * 1e7)
        mosaic = DatMosaic([(self._file(c), self._paths[c]) for c in cells], anchor, where=self._at)
        return terrain_of(mosaic, self._spec, where=self._where, notes=(Note("terrain_in_whole_metres"),))

    def _file(self, cell: Cell) -> DatFile:
        if cell not in self._files:
            self._held_bytes += self._paths[cell].stat().st_size
            if self._held_bytes > MOST_DAT_BYTES:
                raise InputError(
                    f"the .DAT files that this mission uses have more than {MOST_DAT_BYTES >> 20} MB together; take "
                    "files of a larger TERRAIN_SPACING",
                    where=self._at,
                )
            self._files[cell] = read_dat(self._paths[cell], where=self._at)
        return self._files[cell]


class DatMosaic:
    """Files of one spacing, on the posts of the tile ``anchor``. Raises InputError if the spacings differ."""

    def __init__(self, files: Sequence[tuple[DatFile, Path]], anchor: Cell, *, where: str) -> None:
        self.where, self._anchor = where, anchor
        first = files[0][0]
        self.grid = first.grid
        for other, _ in files[1:]:
            if other.grid != self.grid:
                raise InputError(
                    f"{first.name} has posts every {self.grid.spacing_m} m, {other.name} every "
                    f"{other.grid.spacing_m} m: give files of one TERRAIN_SPACING",
                    where=where,
                )
        self._files: Mapping[Cell, DatFile] = {file.cell: file for file, _ in files}
        self.rasters = tuple(DatTile(file.name, path, file.notes) for file, path in files)

    def covers(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> Bools:
        """True where a place lies in a block that some file holds (which may still be unknown there)."""

        def known(lat: float, lon: float) -> bool:
            file = self._files.get(cell_at(lat * 1e7, lon * 1e7))
            return file is not None and _holds(file, lat, lon)

        return _each(known, lat_deg, lon_deg)

    def extent(self, frame: Frame, box: Box) -> Box:
        """West, south, east, north of all blocks in the plane."""
        lat, lon = self._border
        plane = frame.to_plane(lat * 1e-7, lon * 1e-7)
        low, high = plane.min(axis=0), plane.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    @cached_property
    def _border(self) -> tuple[Floats, Floats]:
        """Latitudes and longitudes, 1e-7°, of the corners of all blocks."""
        lat, lon = [], []
        for file in self._files.values():
            at = file.blocks.places
            for north, east in ((0, 0), (0, 1), (1, 0), (1, 1)):
                found = self.grid.post_e7(file.cell, (at[:, 0] + north) * STRIDE[0], (at[:, 1] + east) * STRIDE[1])
                lat.append(found[0])
                lon.append(found[1])
        return np.concatenate(lat), np.concatenate(lon)

    def node_degrees(self, window: Window, cols: ArrayLike, rows: ArrayLike) -> tuple[Floats, Floats]:
        """Latitude and longitude of the nodes ``rows`` × ``cols`` of a window, (len(rows), len(cols)) each."""
        east, north = np.meshgrid(window.x[np.asarray(cols)], window.y[np.asarray(rows)])
        lat, lon = self.grid.post_e7(self._anchor, north, east)
        return lat * 1e-7, lon * 1e-7

    def window(self, frame: Frame, box: Box, *, spare_m: float = 0.0, most_cells: int | None = None) -> Window:
        """The nodes that cover ``box`` (west, south, east, north, plane metres) and ``spare_m`` around it.

        Raises InputError if no block meets the box, beyond ``most_cells``, and if the plane cannot be fitted.
        """
        anchor = self._anchor

        def numbers(lat_e7: Floats, lon_e7: Floats) -> tuple[Floats, Floats]:
            north_m, east_m = self.grid.offset_m(anchor, lat_e7, lon_e7)
            return east_m / self.grid.spacing_m, north_m / self.grid.spacing_m

        def exact(east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
            degrees = frame.to_degrees(east_m, north_m) * 1e7
            return numbers(degrees[..., 0], degrees[..., 1])

        wide = (box[0] - spare_m, box[1] - spare_m, box[2] + spare_m, box[3] + spare_m)
        east, north = exact(*box_lattice(wide))
        held = numbers(*self._border)
        first = (max(math.floor(east.min()), math.floor(held[0].min())),
                 max(math.floor(north.min()), math.floor(held[1].min())))  # fmt: skip
        last = (min(math.ceil(east.max()), math.ceil(held[0].max())),
                min(math.ceil(north.max()), math.ceil(held[1].max())))  # fmt: skip
        cols, rows = last[0] - first[0] + 1, last[1] - first[1] + 1
        if cols < 2 or rows < 2:
            raise InputError(
                f"the .DAT files ({', '.join(f.name for f in self.rasters[:4])}) do not cover the mission, which lies "
                f"around {frame.lat_deg:.4f}, {frame.lon_deg:.4f}; give the files of this place",
                where=self.where,
            )
        most = min(MOST_POSTS, MOST_POSTS if most_cells is None else most_cells)
        if cols * rows > most:
            raise InputError(
                f"the mission needs {cols} × {rows} posts, more than {most / 1e6:.3g} million; plan a smaller mission, "
                "or take files of a larger TERRAIN_SPACING",
                where=self.where,
            )

        def in_window(east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
            east, north = exact(east_m, north_m)
            return east - first[0], last[1] - north

        x, y = np.arange(first[0], last[0] + 1.0), np.arange(last[1], first[1] - 1.0, -1.0)
        grid = GridMap.fit(in_window, _around(frame, self.grid, anchor, wide, x, y))
        if not grid.error_m <= FIT_ERROR_M:
            raise InputError("the mission is too wide for the posts of one tile; plan a smaller one", where=self.where)
        heights, low = self._heights(anchor, x, y)
        unknown = int(np.count_nonzero(np.isnan(heights)))
        notes = (Note("posts_unknown", unknown=unknown, nodes=heights.size),) if unknown else ()
        (left, south), (right, top) = ([float(getattr(h, side)()) for h in held] for side in ("min", "max"))
        goes_on = (first[0] > left, last[1] < top, last[0] < right, first[1] > south)
        one = np.array_equal(low, heights, equal_nan=True)
        return Window(heights, grid, x, y, notes, goes_on, None if one else low)

    def _heights(self, anchor: Cell, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """(rows, cols) greatest and least heights of nodes with these numbers of columns and rows, rows going south."""
        found = np.empty((len(y), len(x))), np.empty((len(y), len(x)))
        at_once = max(POSTS_AT_ONCE // len(x), STRIDE[0])
        for k in range(0, len(y), at_once):
            north, east = y[k : k + at_once][::-1], x
            inside, outside = self._sides(anchor, north, east)
            own = self._posts(anchor, north, east)
            there = self._bounds(anchor, north, east) if outside.any() else own
            for out, sign, mine, others in zip(found, (1.0, -1.0), own, there, strict=True):
                heights = np.where(inside, sign * mine, -np.inf)
                heights = np.maximum(heights, np.where(outside, sign * others, -np.inf))
                out[k : k + at_once] = sign * heights[::-1]
        return found

    def _sides(self, anchor: Cell, north: Floats, east: Floats) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """For each node: whether a cell beside it meets its own tile, and whether one meets another tile."""
        high = DEGREE_E7 * METRES_OF_E7 / self.grid.spacing_m
        corner = anchor.lat_deg * DEGREE_E7
        span = np.stack([north - 1.0, north + 1.0]) * (self.grid.spacing_m / METRES_OF_E7)
        wide = high * longitude_scale(corner + 0.5 * span)[..., None]
        rows_in = ((north > -1.0) & (north < high + 1.0))[:, None]
        rows_out = ((north < 1.0) | (north > high - 1.0))[:, None]
        inside = rows_in & (east > -1.0) & (east < wide.max(axis=0) + 1.0)
        return inside, rows_out | (east < 1.0) | (east > wide.min(axis=0) - 1.0)

    def _posts(self, cell: Cell, north: Floats, east: Floats) -> tuple[Floats, Floats]:
        """Greatest and least heights of a tile's posts, which differ where two blocks hold one; NaN where none does.

        The autopilot reads a point from the one block in whose stride it lies, up to and with the first post of the
        next one.
        """
        high, low = (np.full((len(north), len(east)), end) for end in (-np.inf, np.inf))
        file = self._files.get(cell)
        ends = (float(north[0]), float(north[-1])), (float(east[0]), float(east[-1]))
        for block, heights in () if file is None else file.blocks.within(*ends):
            r0, c0 = block.north * STRIDE[0] - int(north[0]), block.east * STRIDE[1] - int(east[0])
            rows = slice(max(r0, 0), max(0, min(r0 + STRIDE[0] + 1, len(north))))
            cols = slice(max(c0, 0), max(0, min(c0 + STRIDE[1] + 1, len(east))))
            if rows.start < rows.stop and cols.start < cols.stop:
                part = heights[rows.start - r0 : rows.stop - r0, cols.start - c0 : cols.stop - c0]
                high[rows, cols] = np.maximum(high[rows, cols], part)
                low[rows, cols] = np.minimum(low[rows, cols], part)
        return np.where(np.isinf(high), np.nan, high), np.where(np.isinf(low), np.nan, low)

    def _bounds(self, anchor: Cell, north: Floats, east: Floats) -> tuple[Floats, Floats]:
        """Greatest and least heights of nodes between which the ground of all other tiles lies; see `bounds`."""
        f = np.linspace(0.0, 1.0, 33)
        ends = [(a[0] - 3.0) + f * (a[-1] - a[0] + 6.0) for a in (north, east)]
        lat, lon = self.grid.post_e7(anchor, *np.meshgrid(*ends, indexing="ij"))
        found: list[tuple[Floats, ...]] = []
        for cell in _cells_between(lat, lon):
            if cell == anchor:
                continue
            far = DEGREE_E7 * METRES_OF_E7 / self.grid.spacing_m
            around = [m / self.grid.spacing_m for m in self.grid.offset_m(cell, lat, lon)]
            n = np.arange(max(0.0, math.floor(around[0].min())), min(math.ceil(far), math.ceil(around[0].max())) + 1.0)
            wide = far * longitude_scale(cell.lat_deg * DEGREE_E7 + 0.5 * DEGREE_E7 / far * n)[:, None]
            e = np.arange(
                max(0.0, math.floor(around[1].min())), math.ceil(min(wide.max(initial=0.0), around[1].max())) + 1.0
            )
            if not (n.size and e.size):
                continue
            # Beyond the tile's eastern border the autopilot reads only the first post, of its row or the next.
            last = np.pad(np.ceil(wide), ((1, 1), (0, 0)), mode="edge")
            read = e <= np.maximum(np.maximum(last[:-2], last[1:-1]), last[2:])
            posts_at = self.grid.post_e7(cell, *np.meshgrid(n, e, indexing="ij"))
            north_m, east_m = self.grid.offset_m(anchor, *posts_at)
            row, col = north_m / self.grid.spacing_m - north[0], east_m / self.grid.spacing_m - east[0]
            found.append(tuple(a[read] for a in (row, col, *self._posts(cell, n, e))))
        row, col, high, low = (np.concatenate(a) for a in zip(*found, strict=True)) if found else (np.zeros(0),) * 4
        return bounds((len(north), len(east)), row, col, high, low)


def _each(known: Callable[[float, float], bool], lat_deg: ArrayLike, lon_deg: ArrayLike) -> Bools:
    """``known`` of each place."""
    lat, lon = np.broadcast_arrays(np.asarray(lat_deg, float), np.asarray(lon_deg, float))
    found = [known(*at) for at in zip(lat.ravel().tolist(), lon.ravel().tolist(), strict=True)]
    return np.array(found, np.bool_).reshape(lat.shape)


def _holds(file: DatFile, lat_deg: float, lon_deg: float) -> bool:
    return any(block in file.blocks for block in file.grid.blocks_over(lat_deg * 1e7, lon_deg * 1e7))


def _cells_between(lat_e7: Floats, lon_e7: Floats) -> list[Cell]:
    """All tiles of a box in degrees, less than half a turn wide."""
    lats = range(math.floor(lat_e7.min() / DEGREE_E7), math.floor(lat_e7.max() / DEGREE_E7) + 1)
    west = lon_e7.flat[0]
    turned = west + (lon_e7 - west + 180.0 * DEGREE_E7) % (360.0 * DEGREE_E7) - 180.0 * DEGREE_E7
    lons = range(math.floor(turned.min() / DEGREE_E7), math.floor(turned.max() / DEGREE_E7) + 1)
    return [Cell(a, (o + 180) % 360 - 180) for a in lats for o in lons if -90 <= a < 90]


def _around(frame: Frame, grid: TerrainGrid, anchor: Cell, wide: Box, x: Floats, y: Floats) -> Box:
    """The plane's box that holds ``wide`` and the nodes."""
    north, east = np.meshgrid(np.linspace(y[-1], y[0], 33), np.linspace(x[0], x[-1], 33))
    lat, lon = grid.post_e7(anchor, north, east)
    plane = frame.to_plane(lat * 1e-7, lon * 1e-7).reshape(-1, 2)
    low, high = plane.min(axis=0), plane.max(axis=0)
    return (
        min(wide[0], float(low[0])), min(wide[1], float(low[1])),
        max(wide[2], float(high[0])), max(wide[3], float(high[1])),
    )  # fmt: skip


def bounds(shape: tuple[int, int], row: Floats, col: Floats, high: Floats, low: Floats) -> tuple[Floats, Floats]:
    """(rows, cols) greatest and least heights of the nodes of a grid with that ``shape``.

    ``row``, ``col`` (N,): the posts' places, in spacings from the first node; ``high``, ``low`` (N,) their heights.
    NaN where no post is near, or where one that is near is unknown.
    """
    rows, cols = shape[0] + 1, shape[1] + 1  # cell (i, j) lies between the nodes i - 1 and i, j - 1 and j
    count = rows * cols
    near = (row > -3.0) & (row < shape[0] + 2.0) & (col > -3.0) & (col < shape[1] + 2.0)
    row, col, high, low = row[near], col[near], high[near], low[near]
    sums = np.zeros((9, count))
    for at, k, y, x in _posts_of_cells(row, col, rows, cols):
        h = high[k]
        for total, value in zip(sums, (None, x, y, x * x, x * y, y * y, h, x * h, y * h), strict=True):
            total += np.bincount(at, value, count)
    n, x, y, xx, xy, yy, h, xh, yh = sums
    n = np.where(n > 0.0, n, 1.0)
    x, y, h = x / n, y / n, h / n
    xx, xy, yy, xh, yh = xx / n - x * x, xy / n - x * y, yy / n - y * y, xh / n - x * h, yh / n - y * h
    spread = xx * yy - xy * xy
    some = spread > FLATTEST
    spread = np.where(some, spread, 1.0)
    along, across = (np.where(some, a / spread, 0.0) for a in (xh * yy - yh * xy, yh * xx - xh * xy))
    above, below = np.full(count, -np.inf), np.full(count, np.inf)
    for at, k, dy, dx in _posts_of_cells(row, col, rows, cols):
        plane = h[at] + along[at] * (dx - x[at]) + across[at] * (dy - y[at])
        with np.errstate(invalid="ignore"):  # unknown posts
            np.maximum.at(above, at, high[k] - plane)
            np.minimum.at(below, at, low[k] - plane)
    found = []
    for off, sign in ((above, 1.0), (below, -1.0)):
        node = np.full(shape, -np.inf)
        for i in (0, 1):
            for j in (0, 1):  # the node is the cell's corner in that direction from its middle
                value = h + off + along * (0.5 - j - x) + across * (0.5 - i - y)
                value = np.where(some, sign * value, -np.inf).reshape(rows, cols)
                node = np.maximum(node, value[i : i + shape[0], j : j + shape[1]])
        found.append(sign * np.where(np.isinf(node), np.nan, node))
    return found[0], found[1]


def _posts_of_cells(row: Floats, col: Floats, rows: int, cols: int) -> Iterator[tuple[Indices, Bools, Floats, Floats]]:
    """Each post with each cell that it is near to: the cell's number, which posts, their places from its middle."""
    down, left = np.floor(row).astype(int), np.floor(col).astype(int)
    for i in range(-1, 4):
        for j in range(-1, 4):
            r, c = down + i, left + j
            y, x = row - (r - 0.5), col - (c - 0.5)
            k = (np.abs(y) <= 0.5 + REACH) & (np.abs(x) <= 0.5 + REACH) & (r >= 0) & (r < rows) & (c >= 0) & (c < cols)
            if k.any():
                yield r[k] * cols + c[k], k, y[k], x[k]
