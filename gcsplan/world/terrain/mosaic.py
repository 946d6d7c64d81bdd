"""Several tiles as one grid, and the window of it that a mission needs, with a polynomial map from plane to grid.

The window has one surface, and a second one where tiles overlap and differ. Nobody knows which of two tiles is right.
Where they differ the ground lies between a least and a greatest height, and each limit counts the unfavourable one.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Bools, Floats
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.datum import RasterWay, VerticalDatum, plane_to_raster, to_wgs84
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geodesy.height_unit import BY_NOBODY, METRE, OF_KEY, HeightUnit
from gcsplan.world.geometry.surface import NO_SIDES, GridMap, Sides
from gcsplan.world.geometry.zones import Box
from gcsplan.world.terrain.input_files import tell_folder
from gcsplan.world.terrain.raster import MAX_CELLS, Raster

FIT_ERROR_M = 0.01
"""The polynomial may misplace a node by this much at most, m."""

FEW_CELLS, CELLS_IN_BYTE = 5_000_000, 100
"""Most cells of a window, or cells per byte of its files if that is more: no terrain is packed more closely."""

ALIGNED_CELLS = 1e-3
"""Tiles whose nodes are off a common grid by more than this part of a cell are refused."""

WIDEST_COLUMNS = 10
"""Columns of tiles may differ by a ratio of numbers up to this."""

_SPARE_CELLS = 3


SharedNodes = tuple[int, int, int, int]
"""Column, row, columns, rows of the common grid that a tile and a window share."""

HASHED_BYTES = 256 * 2**20
"""Tiles of more bytes together are not hashed whole."""

RASTERS = (".tif", ".tiff", ".hgt", ".hgt.zip", ".hgt.gz", ".dt0", ".dt1", ".dt2", ".asc")
"""The names of tiles in a folder end with these."""

MOST_TILES = 20_000
"""Most tiles of a mosaic."""


@dataclass(frozen=True, eq=False)
class Window:
    """A rectangle of nodes: ``heights_m`` (rows, cols), NaN unknown; ``grid`` maps the plane to them.

    ``x``, ``y``: coordinates of the columns and rows in the raster's own units. ``goes_on``: beyond which sides (first
    column, first row, last column, last row) the tiles hold more. ``low_m``: where files differ ``heights_m`` are the
    greatest heights and these the least; None if no files differ here.
    """

    heights_m: Floats
    grid: GridMap
    x: Floats
    y: Floats
    notes: tuple[Note, ...]
    goes_on: Sides = NO_SIDES
    low_m: Floats | None = None

    @cached_property
    def plane_box(self) -> Box:
        """West, south, east, north of all nodes in the plane, m."""
        rows, cols = self.heights_m.shape
        c, r = np.linspace(0, cols - 1, 33), np.linspace(0, rows - 1, 33)
        first, last_col, last_row = np.zeros(33), np.full(33, cols - 1), np.full(33, rows - 1)
        border = self.grid.to_plane([c, c, first, last_col], [first, last_row, r, r]).reshape(-1, 2)
        low, high = border.min(axis=0), border.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])


@dataclass(frozen=True, slots=True)
class _Layout:
    """The common grid and the tiles on it; its node (0, 0) is the first node of the first tile, at (x0, y0)."""

    x0: float
    y0: float
    dx: float
    dy: float
    tiles: tuple[PlacedTile, ...]

    def grid_of(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Column and row of points in the raster's units."""
        return np.asarray((x - self.x0) / self.dx), np.asarray((self.y0 - y) / self.dy)


class NotCovered(InputError):
    """No tile meets a mission's box."""


class Mosaic:
    """Tiles with one coordinate system and one grid. Raises InputError if they differ.

    Columns of tiles may differ in width by a simple ratio, as published models widen them towards the poles: then the
    common grid is the finest that holds the nodes of all, and nodes between two of a tile are linear between them.
    """

    def __init__(self, rasters: Sequence[Raster], *, where: str) -> None:
        self.rasters = tuple(rasters)
        self.where = where
        first = self.rasters[0]
        self.crs = first.crs
        other = next((r for r in self.rasters if not _on_one_grid(r, first)), None)
        if other is not None:
            raise InputError(
                f"the tiles must share one coordinate system, vertical datum and grid: {other.name} has another than "
                f"{first.name}",
                where=where,
            )
        require_known_units(self.rasters, where)
        self._degrees = to_wgs84(first.crs.horizontal, where=where)
        self._layout(0.0)  # finds tiles off the common grid before anything is read

    @property
    def middle_deg(self) -> tuple[float, float]:
        """Latitude and longitude of the first tile's middle, to a few metres."""
        first = self.rasters[0]
        x, y = first.west + 0.5 * first.cols * first.dx, first.north - 0.5 * first.rows * first.dy
        lon, lat = self._degrees.transform(x, y)
        return float(lat), float(lon)

    def covers(self, lat_deg: ArrayLike, lon_deg: ArrayLike) -> Bools:
        """True where a place lies on some tile (which may still be void there); accurate to a few metres."""
        lat, lon = np.broadcast_arrays(np.asarray(lat_deg, float), np.asarray(lon_deg, float))
        if not lon.size:
            return np.zeros(lon.shape, np.bool_)
        west, east = float(lon.min()), float(lon.max())
        if any(self._turn(r, west) != self._turn(r, east) for r in self.rasters):  # not one layout for all of them
            each = [self.covers(*place) for place in zip(lat.ravel().tolist(), lon.ravel().tolist(), strict=True)]
            return np.array(each, np.bool_).reshape(lon.shape)
        x, y = (np.asarray(a, float) for a in self._degrees.transform(lon, lat, direction="INVERSE"))
        known = np.isfinite(x) & np.isfinite(y)
        layout = self._layout(west)
        col, row = layout.grid_of(self._near(np.where(known, x, 0.0), lon), np.where(known, y, 0.0))
        on = np.zeros(lon.shape, np.bool_)
        for p in layout.tiles:
            on |= (
                (p.col - 0.5 * p.step <= col) & (col <= p.col + p.cols - 1 + 0.5 * p.step)
                & (p.row - 0.5 <= row) & (row <= p.row + p.raster.rows - 0.5)
            )  # fmt: skip
        return np.asarray(known & on)

    def node_degrees(self, window: Window, cols: ArrayLike, rows: ArrayLike) -> tuple[Floats, Floats]:
        """Latitude and longitude of the nodes ``rows`` × ``cols`` of a window, (len(rows), len(cols)) each.

        Accurate to a few metres (whatever datum shift PROJ has available): enough to look up a geoid, not to place a
        node.
        """
        x, y = np.meshgrid(window.x[np.asarray(cols)], window.y[np.asarray(rows)])
        lon, lat = self._degrees.transform(x, y)
        return np.asarray(lat, float), np.asarray(lon, float)

    def window(
        self, frame: Frame, box: Box, *, spare_m: float = 0.0, most_cells: int | None = None, whole: bool = False
    ) -> Window:
        """The nodes that cover ``box`` (west, south, east, north, plane metres) and ``spare_m`` around it.

        The window is clipped to the tiles, unless it is the ``whole`` of the box; gaps between them are NaN, and where
        two tiles hold the same node with two heights both are kept (`Window.low_m`). Raises NotCovered if no tile meets
        the box, InputError beyond ``most_cells`` (`MAX_CELLS`), and if the plane cannot be fitted to `FIT_ERROR_M`.
        """
        middle = (0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]))
        there = plane_to_raster(frame, self.crs.horizontal, box, where=self.where)
        reference = float(frame.to_degrees(*middle)[1])

        layout = self._layout(reference)
        tiles = layout.tiles

        def exact(east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
            x, y = there.to_raster(east_m, north_m)
            if not (np.isfinite(x).all() and np.isfinite(y).all()):
                raise InputError(
                    "the mission reaches beyond the limits of the DEM's coordinate system; gdalwarp the DEM to a "
                    "system made for this place",
                    where=self.where,
                )
            return layout.grid_of(self._near(x, reference), y)

        wide = (box[0] - spare_m, box[1] - spare_m, box[2] + spare_m, box[3] + spare_m)
        col, row = exact(*box_lattice(wide))
        first_col, last_col = min(p.col for p in tiles), max(p.col + p.cols for p in tiles)
        first_row, last_row = min(p.row for p in tiles), max(p.row + p.raster.rows for p in tiles)
        c0, c1 = math.floor(col.min()) - _SPARE_CELLS, math.ceil(col.max()) + _SPARE_CELLS + 1
        r0, r1 = math.floor(row.min()) - _SPARE_CELLS, math.ceil(row.max()) + _SPARE_CELLS + 1
        if not whole:
            c0, r0, c1, r1 = max(c0, first_col), max(r0, first_row), min(c1, last_col), min(r1, last_row)
        parts = [(p, o) for p in tiles if c1 - c0 > 1 and r1 - r0 > 1 and (o := p.overlap(c0, r0, c1 - c0, r1 - r0))]
        if not parts or max(o[2] for _, o in parts) < 2 or max(o[3] for _, o in parts) < 2:
            raise NotCovered(
                f"the DEM ({', '.join(r.name for r in self.rasters[:4])}{', …' if len(self.rasters) > 4 else ''}) does "
                f"not cover the mission, which lies around {frame.to_degrees(*middle)[0]:.4f}, {reference:.4f}; give "
                "the tiles of this place",
                where=self.where,
            )
        most_cells = min(MAX_CELLS, MAX_CELLS if most_cells is None else most_cells)
        if (c1 - c0) * (r1 - r0) > most_cells:
            raise InputError(
                f"the mission needs {c1 - c0} × {r1 - r0} cells of the DEM, more than {most_cells / 1e6:.3g} million; "
                "use a coarser DEM (gdalwarp -tr) or a smaller mission",
                where=self.where,
            )
        held = sum(p.raster.stored_bytes for p, _ in parts)
        if (c1 - c0) * (r1 - r0) > max(FEW_CELLS, CELLS_IN_BYTE * held):
            raise InputError(
                f"the DEM claims {c1 - c0} × {r1 - r0} cells around the mission in a file of {held} bytes, more than "
                "any terrain can be packed: it is damaged or empty; if it is not, use a coarser one (gdalwarp -tr)",
                where=self.where,
            )
        x = layout.x0 + np.arange(c0, c1) * layout.dx
        y = layout.y0 - np.arange(r0, r1) * layout.dy

        def in_window(east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
            c, r = exact(east_m, north_m)
            return c - c0, r - r0

        grid = GridMap.fit(in_window, _union(wide, _plane_box(there, x, y)))
        if not grid.error_m <= FIT_ERROR_M:
            raise InputError(
                f"the mission is too wide for the DEM's coordinate system: its grid can be placed to "
                f"{grid.error_m:.3g} m only, needed {FIT_ERROR_M:g} m; gdalwarp the DEM to UTM, or plan a smaller "
                "mission",
                where=self.where,
            )
        heights, notes = read_tiles(parts, c0, r0, c1 - c0, r1 - r0, self.where)
        if there.accuracy_m < 0.0:
            notes.append(Note("datum_shift_of_unknown_accuracy", crs=self.crs.horizontal.name))
        elif there.accuracy_m > 1.0:
            notes.append(Note("datum_shift_inaccurate", crs=self.crs.horizontal.name, accuracy_m=there.accuracy_m))
        goes_on = (c0 > first_col, r0 > first_row, c1 < last_col, r1 < last_row)
        return Window(heights.high_m, grid, x, y, tuple(notes), goes_on, heights.low_m)

    def extent(self, frame: Frame, box: Box) -> Box:
        """West, south, east, north of all tiles in the plane, as far as the plane reaches; ``box`` is the mission's."""
        there = plane_to_raster(frame, self.crs.horizontal, box, where=self.where)
        layout = self._layout(float(frame.to_degrees(0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3]))[1]))
        cols = [c for p in layout.tiles for c in (p.col, p.col + p.cols - 1)]
        rows = [r for p in layout.tiles for r in (p.row, p.row + p.raster.rows - 1)]
        x = layout.x0 + layout.dx * np.linspace(min(cols), max(cols), 33)
        y = layout.y0 - layout.dy * np.linspace(min(rows), max(rows), 33)
        return _plane_box(there, x, y)

    def _near(self, x: Floats, lon_deg: Floats | float) -> Floats:
        """Longitudes within half a turn of ``lon_deg``, so that the antimeridian is no edge; projected x unchanged."""
        return np.asarray(lon_deg + (x - lon_deg + 180.0) % 360.0 - 180.0) if self.crs.geographic else x

    def _turn(self, raster: Raster, lon_deg: float) -> float:
        """Degrees of the whole turns that bring a tile's middle nearest to ``lon_deg``."""
        middle = raster.west + 0.5 * raster.cols * raster.dx
        return 360.0 * round((lon_deg - middle) / 360.0) if self.crs.geographic else 0.0

    def _layout(self, lon_deg: float) -> _Layout:
        """Every tile on the grid of the first one, all turned to the longitude ``lon_deg``."""
        first = self.rasters[0]
        x0 = first.west + 0.5 * first.dx + self._turn(first, lon_deg)
        y0 = first.north - 0.5 * first.dy
        ratios = [_ratio(raster, first) for raster in self.rasters]
        parts = math.lcm(*(ratio.denominator for ratio in ratios))
        dx = first.dx / parts
        tiles = []
        for raster, ratio in zip(self.rasters, ratios, strict=True):
            nearest = self._turn(raster, lon_deg)
            # A tile wider than half the globe may meet the mission on both of its sides.
            wide = self.crs.geographic and raster.cols * raster.dx > 180.0
            for turn in (nearest, nearest - 360.0, nearest + 360.0) if wide else (nearest,):
                col = (raster.west + 0.5 * raster.dx + turn - x0) / dx
                row = (y0 - (raster.north - 0.5 * raster.dy)) / first.dy
                if max(abs(col - round(col)), abs(row - round(row))) <= ALIGNED_CELLS:
                    tiles.append(PlacedTile(raster, round(col), round(row), round(ratio * parts)))
                elif turn == nearest:
                    raise InputError(
                        f"the tiles must lie on one grid: {raster.name} is off the grid of {first.name} by "
                        f"{col - round(col):.3f} columns and {row - round(row):.3f} rows; gdalwarp them together",
                        where=self.where,
                    )
        return _Layout(x0, y0, dx, first.dy, tuple(tiles))


def layers_of(rasters: Sequence[Raster]) -> list[list[Raster]]:
    """The rasters in groups, each with one coordinate system, one vertical datum and one grid."""
    layers: list[list[Raster]] = []
    for raster in rasters:
        mine = next((layer for layer in layers if _on_one_grid(raster, layer[0])), None)
        if mine is None:
            layers.append([raster])
        else:
            mine.append(raster)
    return layers


def _on_one_grid(raster: Raster, first: Raster) -> bool:
    if raster.crs.horizontal != first.crs.horizontal or raster.vertical != first.vertical:
        return False
    span = max(first.cols, first.rows, raster.cols, raster.rows)
    ratio = _ratio(raster, first)
    if max(abs(raster.dx / first.dx / ratio - 1.0), abs(raster.dy / first.dy - 1.0)) * span > ALIGNED_CELLS:
        return False
    dx = first.dx / ratio.denominator
    west = raster.west - first.west + 0.5 * (raster.dx - first.dx)
    north = first.north - raster.north + 0.5 * (raster.dy - first.dy)
    return all(abs(x - round(x)) <= ALIGNED_CELLS for x in (_turned(west, first) / dx, north / first.dy))


def _turned(west: float, first: Raster) -> float:
    """A distance of longitudes less the whole turns in it."""
    return west - 360.0 * round(west / 360.0) if first.crs.geographic else west


def require_known_units(rasters: Sequence[Raster], where: str) -> None:
    """Raise InputError if a tile's heights are in another unit than metres, and another's in one that nobody states."""
    silent = next((r for r in rasters if r.unit.by == BY_NOBODY), None)
    other = next((r for r in rasters if not r.unit.is_same(METRE)), None)
    if silent is not None and other is not None:
        likely = next((key for key, unit in OF_KEY.items() if unit.is_same(other.unit)), "m")
        raise InputError(
            f"the heights of {other.name} are {other.unit.stated()}, and nothing states the unit of {silent.name} "
            f"beside it; if all tiles have one, state it with `height_unit: {likely}`, else write it into the file "
            "(gdal_edit.py -units metre)",
            where=where,
        )


def box_lattice(box: Box) -> tuple[Floats, Floats]:
    """East and north of 33 by 33 places all over a box of the plane, one row after the other."""
    f = np.linspace(0.0, 1.0, 33)
    e, n = np.meshgrid(box[0] + f * (box[2] - box[0]), box[1] + f * (box[3] - box[1]))
    return e.ravel(), n.ravel()


def _plane_box(there: RasterWay, x: Floats, y: Floats) -> Box:
    """The plane's box around a window with these coordinates of columns and rows."""
    xs, ys = np.meshgrid(x[np.linspace(0, len(x) - 1, 33).astype(int)], y[np.linspace(0, len(y) - 1, 33).astype(int)])
    e, n = there.to_plane(xs.ravel(), ys.ravel()).T
    good = np.isfinite(e) & np.isfinite(n)
    return float(e[good].min()), float(n[good].min()), float(e[good].max()), float(n[good].max())


def _union(a: Box, b: Box) -> Box:
    return min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])


def _ratio(raster: Raster, first: Raster) -> Fraction:
    """The width of a raster's columns in columns of the first one, as a ratio of small numbers; 1 if it is none."""
    ratio = Fraction(raster.dx / first.dx).limit_denominator(WIDEST_COLUMNS)
    return ratio if 0 < ratio <= WIDEST_COLUMNS else Fraction(1)


@dataclass(frozen=True, slots=True)
class PlacedTile:
    """A tile with its first node in the common grid; each of its columns is ``step`` common ones wide."""

    raster: Raster
    col: int
    row: int
    step: int = 1

    @property
    def cols(self) -> int:
        """Columns of the common grid from its first node to its last."""
        return (self.raster.cols - 1) * self.step + 1

    def overlap(self, col: int, row: int, cols: int, rows: int) -> tuple[int, int, int, int] | None:
        """Column, row, columns, rows shared with a window of the common grid; None if they do not overlap.

        A tile with wider columns is taken one of them farther to each side: nodes between two of them need both.
        """
        c0, c1 = max(col - self.step + 1, self.col), min(col + cols + self.step - 1, self.col + self.cols)
        r0, r1 = max(row, self.row), min(row + rows, self.row + self.raster.rows)
        return (c0, r0, c1 - c0, r1 - r0) if c0 < c1 and r0 < r1 else None


class Heights:
    """Greatest heights (rows, cols), NaN where unknown, and the least ones as soon as two differ.

    ``nodes`` counts the heights that differ, ``worst_m`` is the largest difference. ``where`` names the files.
    """

    def __init__(self, rows: int, cols: int, where: str = "") -> None:
        self._where = where
        self.high_m = np.full((rows, cols), np.nan)
        self.low_m: Floats | None = None
        self.nodes = 0
        self.worst_m = 0.0

    def put(self, part: tuple[slice, slice], high_m: Floats, low_m: Floats | None = None) -> None:
        """Put heights into a part: unknown ones change nothing, and of two that are known both count.

        Raises InputError if two heights of each node do not fit into memory.
        """
        into = self.high_m[part]
        off = np.abs(into - high_m)
        both = off > 0.0
        if both.any():
            self.nodes += int(np.count_nonzero(both))
            self.worst_m = max(self.worst_m, float(off[both].max()))
        if self.low_m is None and (low_m is not None or both.any()):
            if self.high_m.size > MAX_CELLS // 2:
                raise InputError(
                    f"tiles differ where they overlap, and two heights of {self.high_m.size / 1e6:.3g} million cells "
                    f"are more than {MAX_CELLS // 2 / 1e6:.3g} million: make one file of them (gdal_merge.py), or use "
                    f"a coarser DEM (gdalwarp -tr) or a smaller mission",
                    where=self._where,
                )
            self.low_m = self.high_m.copy()
        if self.low_m is not None:
            low = self.low_m[part]
            np.fmin(low, high_m if low_m is None else low_m, out=low)
        np.fmax(into, high_m, out=into)

    def count(self, other: Heights) -> None:
        """Count what differs in other heights, too."""
        self.nodes, self.worst_m = self.nodes + other.nodes, max(self.worst_m, other.worst_m)


def read_tiles(
    parts: Sequence[tuple[PlacedTile, SharedNodes]], c0: int, r0: int, cols: int, rows: int, where: str = ""
) -> tuple[Heights, list[Note]]:
    """The heights of a window that begins at column ``c0`` and row ``r0``, and notes on differing or unknown parts.

    ``where`` names the files in messages. Raises InputError.
    """
    heights = Heights(rows, cols, where)
    for tile, (col, row, width, height) in parts:
        if tile.step == 1:
            for first, new in tile.raster.read(col - tile.col, row - tile.row, width, height):
                top = row - r0 + first
                heights.put((slice(top, top + len(new)), slice(col - c0, col - c0 + width)), new)
    # Tiles whose columns are the same nodes: between neighbours there is no gap.
    wide = [(tile, shared) for tile, shared in parts if tile.step > 1]
    for step, phase in sorted({(tile.step, tile.col % tile.step) for tile, _ in wide}):
        some = [(tile, shared) for tile, shared in wide if (tile.step, tile.col % tile.step) == (step, phase)]
        _put_wide(heights, some, c0, r0, phase)
    notes = []
    if heights.nodes:
        worst_m = max(heights.worst_m, 0.001)  # what single precision makes of one height in two units is less
        notes.append(Note("tiles_differ", nodes=heights.nodes, worst_m=worst_m))
    unknown = int(np.count_nonzero(np.isnan(heights.high_m)))
    if unknown:
        notes.append(Note("nodes_unknown", unknown=unknown, nodes=rows * cols))
    return heights, notes


def _put_wide(heights: Heights, parts: Sequence[tuple[PlacedTile, SharedNodes]], c0: int, r0: int, phase: int) -> None:
    """Put tiles whose columns are wider than the common ones into ``heights``, linear between their own nodes."""
    cols = heights.high_m.shape[1]
    step = parts[0][0].step
    first, last = (c0 - phase) // step, -((phase - c0 - cols + 1) // step)  # own columns around the window
    top, bottom = min(s[1] for _, s in parts) - r0, max(s[1] + s[3] for _, s in parts) - r0
    own = Heights(bottom - top, last - first + 1)
    for tile, (col, row, width, height) in parts:
        own_first = -((tile.col - col) // step)  # the tile's own first column in the window
        count = (col + width - 1 - tile.col) // step - own_first + 1
        at = (tile.col - phase) // step + own_first - first
        if count < 1:
            continue
        for line, new in tile.raster.read(own_first, row - tile.row, count, height):
            above = row - r0 - top + line
            own.put((slice(above, above + len(new)), slice(at, at + count)), new)
    common = np.arange(c0, c0 + cols) - phase - first * step
    k, part = common // step, (common % step) / step
    on = part == 0.0  # a node of its own needs no neighbour
    after = np.minimum(k + 1, last - first)

    def between(z: Floats) -> Floats:
        return np.where(on, z[:, k], (1.0 - part) * z[:, k] + part * z[:, after])

    heights.count(own)
    heights.put(
        (slice(top, bottom), slice(0, cols)), between(own.high_m), None if own.low_m is None else between(own.low_m)
    )


class Tile(Protocol):
    """The report's entry for one file, and the datum that it states."""

    @property
    def stored_bytes(self) -> int:
        """Its size."""

    @property
    def name(self) -> str:
        """The file's name."""

    @property
    def vertical(self) -> VerticalDatum | None:
        """The zero of its heights; None if it states none."""

    @property
    def notes(self) -> tuple[Note, ...]:
        """Notes on it for the user."""

    @property
    def unit(self) -> HeightUnit:
        """The unit in which it counts heights."""

    def sha256(self) -> str:
        """Its hash."""


def hash_of(tiles: Sequence[Tile], window: Window) -> str:
    """The hash of a single file; for several files the hash of their hashes, in the order given.

    Beyond `HASHED_BYTES` nobody waits until all is read: then it is of every tile's name and size, and of the heights
    that the mission has read, with their places.
    """
    if sum(tile.stored_bytes for tile in tiles) <= HASHED_BYTES:
        hashes = [tile.sha256() for tile in tiles]
        return hashes[0] if len(hashes) == 1 else hashlib.sha256("\n".join(hashes).encode()).hexdigest()
    digest = hashlib.sha256("\n".join(f"{tile.name} {tile.stored_bytes}" for tile in tiles).encode())
    for numbers in (window.x, window.y, window.heights_m):
        digest.update(np.ascontiguousarray(numbers).tobytes())
    return digest.hexdigest()


def tiles_of(paths: Sequence[str], *, where: str) -> list[str]:
    """The rasters that ``paths`` name, as files or in folders. Raises InputError."""
    found = [tile for path in paths for tile in _in_folder(path, where)]
    if len(found) > MOST_TILES:
        raise InputError(f"{len(found)} tiles are named; {MOST_TILES} are the most: give the tiles around", where=where)
    return found


def _in_folder(path: str, where: str) -> list[str]:
    """The rasters in a folder, or the file itself."""
    tell_folder(path, RASTERS)
    if not os.path.isdir(path):  # not pathlib's, which raises for a name that no disk can hold
        return [path]
    try:
        found = sorted(str(p) for p in Path(path).iterdir() if p.name.lower().endswith(RASTERS) and p.is_file())
    except OSError as why:
        raise InputError(f"{path} cannot be read: {why.strerror or why}", where=where) from why
    if not found:
        raise InputError(f"{path} is a folder without tiles ({', '.join(RASTERS)}, .DAT); give a file", where=where)
    return found
