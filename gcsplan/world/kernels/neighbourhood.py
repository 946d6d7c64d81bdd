"""Bounds around each cell of a surface: the steepest slope, the highest and the lowest node within a reach.

A large surface is examined only where the bounds are needed: a mission uses a few streets of a county's lidar model.
"""

from __future__ import annotations

import math
import mmap
import threading
from collections.abc import Callable
from contextlib import suppress
from itertools import product

import numpy as np

from gcsplan.arrays import Bools, Floats, Int8s, Singles
from gcsplan.errors import InputError
from gcsplan.native.signature import Held
from gcsplan.world.geometry.surface import GridMap
from gcsplan.world.kernels.compiled import EXTREMA
from gcsplan.world.kernels.extrema import local_extrema
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.shared import STRIP, LocalExtrema

LARGE_WINDOW = 200_000
"""Surfaces with more cells than this are examined tile by tile, where a plan looks at them."""
TILE, SPACING = STRIP, 32
"""Columns and rows of a tile, and the largest spacing, in cells, of the places on a line whose tiles are examined."""
BOW = 2
"""Upper bound, in cells, of how far a line of the plane leaves the straight grid line between two such places."""
CELL_BYTES = 12
"""Bytes of an examined cell: a slope and two heights."""
MOST_EXAMINED_BYTES = 150_000_000
"""Most bytes of examined cells in all neighbourhoods of an airspace; the least recently used neighbourhoods forget
theirs."""
AT_ONCE = 3
"""Neighbourhoods that one call of a kernel takes."""
MOST_ROOM_BYTES = 530_000_000
"""Most bytes of the work array of one neighbourhood and the heights: a reach of some 2400 cells in 16 million, 1400 in
49."""
FEW_CELLS = 32
"""Up to so many cells of a reach unknown ones within it are looked for one by one, without `unknown_gaps`."""
MOST_GAP = 127
TALL, WIDE, WIDER = 64, 1024, 4
"""Fewest rows and columns worked on at once, so that they stay in the processor's cache; and the fewest as a multiple
of the reach around them, in cells."""


class LineBatch:
    """Lines of the plane from ``start`` to ``end`` (N, 2 or more), and the tiles of a surface that they meet: found
    once, whatever the number of reaches for which these are examined."""

    def __init__(self, start: Floats, end: Floats) -> None:
        self._start, self._end = start, end
        self._tiles: Bools | None = None

    def tiles(self, grid: GridMap, field: Field, shape: tuple[int, ...]) -> Bools:
        """Which of a surface's tiles, in rows and columns by ``shape``, the lines meet; perhaps a few more."""
        if self._tiles is None:
            self._tiles = self._met(grid, field, shape)
        return self._tiles

    def _met(self, grid: GridMap, field: Field, shape: tuple[int, ...]) -> Bools:
        start, end, spacing_m = self._start[:, :2], self._end[:, :2], SPACING * min(field.step_x, field.step_y)
        length = np.hypot(*(end - start).T)
        if length.any():
            parts = np.ceil(length / spacing_m).astype(np.intp) + 1
            line = np.repeat(np.arange(len(parts)), parts)
            nth = np.arange(len(line)) - np.repeat(np.cumsum(parts) - parts, parts)
            t = nth / np.maximum(parts[line] - 1, 1)
            places = start[line] + t[:, None] * (end - start)[line]
        else:  # a raster: places in a row in one small square are as near to the first as on a line
            places = start[np.diff(np.floor(start / (spacing_m / 3.0)), axis=0, prepend=np.inf).any(axis=1)]
        cells = grid(*places.T)[:, ::-1] / TILE
        beside, most = (0.5 * SPACING + BOW) / TILE, np.array(shape) - 1.0
        low, high = (np.floor(cells + d).clip(0.0, most).astype(np.intp) for d in (-beside, beside))
        found = np.zeros(shape, np.bool_)
        found[low[:, 0], low[:, 1]] = True
        wide = (low != high).any(axis=1)  # most places are far from the border of their tile
        low, high = low[wide], high[wide]
        for rows, cols in product((low, high), repeat=2):
            found[rows[:, 0], cols[:, 1]] = True
        return found


class Neighbourhood:
    """The local extrema of a surface (rows, cols) for a reach. Tiles that have not been examined count as unknown."""

    def __init__(
        self, grid: GridMap, field: Field, heights: Floats, reach_m: float, gaps: Callable[[], Int8s] | None = None
    ) -> None:
        self._grid, self._field, self._heights, self._reach_m = grid, field, heights, reach_m
        self._lock = threading.Lock()
        self.seen = np.ones((0, 0), np.bool_)
        rows, cols = heights.shape[0] - 1, heights.shape[1] - 1
        if rows * cols > LARGE_WINDOW:
            self.extrema = _empty(field, heights, reach_m)
            self.seen = np.zeros((-(-rows // TILE), -(-cols // TILE)), np.bool_)
        else:
            self.extrema = extrema_around(field, heights, reach_m)
        if max(self.extrema.cols, self.extrema.rows) > FEW_CELLS:
            self.extrema = self.extrema._replace(gaps=gaps() if gaps else unknown_gaps(heights))
        self._held = Held(EXTREMA, *self.extrema)
        self.examined_bytes = 0 if self.seen.size else self.extrema.slope.size * CELL_BYTES
        """Bytes of its arrays; over a large surface, only the examined cells take memory."""

    def __reduce__(self) -> tuple[type[Neighbourhood], tuple[GridMap, Field, Floats, float]]:
        """Pickle the inputs only: a copy in another process examines its tiles anew."""
        return Neighbourhood, (self._grid, self._field, self._heights, self._reach_m)

    def along(self, lines: LineBatch) -> Held:
        """The extrema in the kernels' form, examined along lines."""
        if self.seen.size and not self.seen.all():
            tiles = lines.tiles(self._grid, self._field, self.seen.shape)
            with self._lock:  # a caller who waits here finds the tiles done
                for i, j in np.argwhere(tiles & ~self.seen).tolist():
                    rows, cols = (slice(k * TILE, (k + 1) * TILE) for k in (i, j))
                    _look_at(self._field, self._heights, self.extrema, rows, cols)
                    self.seen[i, j] = True
                    self.examined_bytes += TILE * TILE * CELL_BYTES
        return self._held


class Neighbourhoods:
    """The local extrema of an airspace for each requested reach, in little more than `MOST_EXAMINED_BYTES`.

    A way home needs a dozen reaches along lines that cover all of the terrain: 40 million cells took 4 GB.
    """

    def __init__(self, grid: GridMap, field: Field) -> None:
        self._grid, self._field = grid, field
        self.kept: dict[tuple[bool, int, int], Neighbourhood] = {}
        """The least recently used come first."""
        self._gaps: dict[bool, Int8s] = {}
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type[Neighbourhoods], tuple[GridMap, Field]]:
        """Pickle none of the extrema: a copy in another process examines its own."""
        return Neighbourhoods, (self._grid, self._field)

    def along(self, of_top: bool, heights: Floats, reach_m: float, lines: LineBatch) -> Held:
        """The extrema of ``heights`` along lines, in the kernels' form; one for each size of the reach in cells."""
        key = of_top, math.ceil(reach_m / self._field.step_x), math.ceil(reach_m / self._field.step_y)
        with self._lock:
            own = self.kept.pop(key, None)
            if own is None or own.examined_bytes > MOST_EXAMINED_BYTES // AT_ONCE:
                own = Neighbourhood(self._grid, self._field, heights, reach_m, lambda: self._gaps_of(of_top, heights))
            self.kept[key] = own
        held = own.along(lines)  # the arrays live as long as somebody uses them, forgotten or not
        with self._lock:
            held_bytes = sum(one.examined_bytes for one in self.kept.values())
            for old in list(self.kept)[:-AT_ONCE]:
                if held_bytes <= MOST_EXAMINED_BYTES:
                    break
                held_bytes -= self.kept.pop(old).examined_bytes
        return held

    def _gaps_of(self, of_top: bool, heights: Floats) -> Int8s:
        """The `unknown_gaps` of ground or top, found once for all reaches."""
        if of_top not in self._gaps:
            self._gaps[of_top] = unknown_gaps(heights)
        return self._gaps[of_top]


def unknown_gaps(heights: Floats) -> Int8s:
    """How many rows from each cell the nearest unknown cell of its column is, or the border, up or down, at most
    `MOST_GAP`: (rows - 1, columns - 1) of nodes ``heights``."""
    gaps = np.zeros((heights.shape[0] - 1, heights.shape[1] - 1), np.int8)
    gap = np.zeros(gaps.shape[1], np.int8)
    for j, own in enumerate(gaps):
        gap = np.minimum(gap, MOST_GAP - 1) + np.int8(1)
        gap[np.isnan(heights[j, :-1] + heights[j, 1:] + heights[j + 1, :-1] + heights[j + 1, 1:])] = 0
        own[:] = gap
    gap = np.zeros_like(gap)
    for own in gaps[::-1]:
        gap = np.minimum(np.minimum(gap, MOST_GAP - 1) + np.int8(1), own)
        own[:] = gap
    return gaps


def extrema_around(field: Field, heights: Floats, reach_m: float) -> LocalExtrema:
    """The local extrema of a surface, examined everywhere; without `unknown_gaps`."""
    extrema = _empty(field, heights, reach_m)
    _look_at(field, heights, extrema, slice(0, heights.shape[0] - 1), slice(0, heights.shape[1] - 1))
    return extrema


def _empty(field: Field, heights: Floats, reach_m: float) -> LocalExtrema:
    """Local extrema that are unknown everywhere."""
    shape = -(-(heights.shape[1] - 1) // STRIP), heights.shape[0] - 1, STRIP
    cols, rows = _cells(field, heights, reach_m)
    slope, high, low = (_zeros(shape) for _ in range(3))
    return LocalExtrema(slope, high, low, np.zeros((0, 0), np.int8), cols, rows)


def _cells(field: Field, heights: Floats, reach_m: float) -> tuple[int, int]:
    """Columns and rows of a reach. A window of a reach as large as the surface holds all of it and the cells beyond.

    Raises InputError for a reach whose work array and heights are larger than `MOST_ROOM_BYTES`.
    """
    rows, cols = heights.shape
    cols, rows = (min(math.ceil(reach_m / s), most) for s, most in ((field.step_x, cols), (field.step_y, rows)))
    box = [n - 1 if (heights.shape[0] - 1) * (heights.shape[1] - 1) <= LARGE_WINDOW else TILE for n in heights.shape]
    room_bytes = 4 * math.prod(_room(rows, cols, *box))
    if heights.nbytes + room_bytes > MOST_ROOM_BYTES:
        raise InputError(
            f"a reach of {reach_m:.0f} m, of clearances and errors together, is {max(cols, rows)} cells of this "
            "terrain, which is more than is examined around a leg: give smaller ones, or a coarser terrain model"
        )
    return cols, rows


def _room(reach_rows: int, reach_cols: int, rows: int, cols: int) -> tuple[int, int, int]:
    """The shape of the work array for blocks of a box of so many rows and columns, with the reach around them."""
    tall, wide = min(max(TALL, WIDER * reach_rows), rows), min(max(WIDE, WIDER * reach_cols), cols)
    return tall + 2 * reach_rows, 4, wide + 2 * reach_cols


def _zeros(shape: tuple[int, ...]) -> Singles:
    """Zeros (float32) that take no memory until they are written over, and then in pages of 4 kB.

    ``np.zeros`` requests pages of 2 MB from Linux, and the tiles of one long line are in most of them.
    """
    size = 4 * math.prod(shape)
    if not hasattr(mmap, "MADV_NOHUGEPAGE") or size < mmap.PAGESIZE:
        return np.zeros(shape, np.float32)
    room = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    with suppress(OSError):  # a kernel without huge pages
        room.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(room, np.float32).reshape(shape)


def _look_at(field: Field, heights: Floats, extrema: LocalExtrema, rows: slice, cols: slice) -> None:
    """Fill these rows and columns of local extrema."""
    room = np.empty(_room(extrema.rows, extrema.cols, rows.stop - rows.start, cols.stop - cols.start), np.float32)
    box = np.array([rows.start, rows.stop, cols.start, cols.stop], np.int64)
    local_extrema(
        heights,
        field.step_x,
        field.step_y,
        extrema.cols,
        extrema.rows,
        box,
        room,
        extrema.slope,
        extrema.high,
        extrema.low,
    )
