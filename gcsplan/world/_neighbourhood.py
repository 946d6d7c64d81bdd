"""Bounds around each cell of a surface: the steepest slope, the highest and the lowest node within a reach.

A large surface is examined only where the bounds are needed: a mission uses a few streets of a county's lidar model.
"""

from __future__ import annotations

import math
import threading
from itertools import product

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.native.signature import Held
from gcsplan.world._compiled import EXTREMA
from gcsplan.world._extrema import local_extrema
from gcsplan.world._field import Field
from gcsplan.world._shared import LocalExtrema
from gcsplan.world.surface import GridMap

LARGE_WINDOW = 2_000_000
"""Surfaces with more cells than this are examined tile by tile."""
TILE, SPACING = 128, 32
"""Columns and rows of a tile, and the largest spacing, in cells, of the places on a line whose tiles are examined."""
BOW = 2
"""Upper bound, in cells, of how far a line of the plane leaves the straight grid line between two such places."""
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
        start, end = self._start[:, :2], self._end[:, :2]
        length = np.hypot(*(end - start).T)
        parts = np.ceil(length / (SPACING * min(field.step_x, field.step_y))).astype(np.intp) + 1
        line = np.repeat(np.arange(len(parts)), parts)
        nth = np.arange(len(line)) - np.repeat(np.cumsum(parts) - parts, parts)
        t = nth / np.maximum(parts[line] - 1, 1)
        places = start[line] + t[:, None] * (end - start)[line]
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

    def __init__(self, grid: GridMap, field: Field, heights: Floats, reach_m: float) -> None:
        self._grid, self._field, self._heights, self._reach_m = grid, field, heights, reach_m
        self._lock = threading.Lock()
        self._seen = np.ones((0, 0), np.bool_)
        rows, cols = heights.shape[0] - 1, heights.shape[1] - 1
        if rows * cols > LARGE_WINDOW:
            self.extrema = _empty(field, heights, reach_m)
            self._seen = np.zeros((-(-rows // TILE), -(-cols // TILE)), np.bool_)
        else:
            self.extrema = extrema_around(field, heights, reach_m)
        self._held = Held(EXTREMA, *self.extrema)

    def __reduce__(self) -> tuple[type[Neighbourhood], tuple[GridMap, Field, Floats, float]]:
        """Pickle the inputs only: a copy in another process examines its tiles anew."""
        return Neighbourhood, (self._grid, self._field, self._heights, self._reach_m)

    def along(self, lines: LineBatch) -> Held:
        """The extrema in the kernels' form, examined along lines."""
        if self._seen.size and not self._seen.all():
            tiles = lines.tiles(self._grid, self._field, self._seen.shape)
            with self._lock:  # a caller who waits here finds the tiles done
                for i, j in np.argwhere(tiles & ~self._seen).tolist():
                    rows, cols = (slice(k * TILE, (k + 1) * TILE) for k in (i, j))
                    _look_at(self._field, self._heights, self.extrema, rows, cols)
                    self._seen[i, j] = True
        return self._held


def extrema_around(field: Field, heights: Floats, reach_m: float) -> LocalExtrema:
    """The local extrema of a surface, examined everywhere."""
    extrema = _empty(field, heights, reach_m)
    _look_at(field, heights, extrema, slice(0, extrema.slope.shape[0]), slice(0, extrema.slope.shape[1]))
    return extrema


def _empty(field: Field, heights: Floats, reach_m: float) -> LocalExtrema:
    """Local extrema that are unknown everywhere; zeros take no memory until they are written over."""
    shape = heights.shape[0] - 1, heights.shape[1] - 1
    cols, rows = (math.ceil(reach_m / step) for step in (field.step_x, field.step_y))
    slope, high, low = (np.zeros(shape, np.float32) for _ in range(3))
    return LocalExtrema(slope, high, low, cols, rows)


def _look_at(field: Field, heights: Floats, extrema: LocalExtrema, rows: slice, cols: slice) -> None:
    """Fill these rows and columns of local extrema."""
    tall = min(max(TALL, WIDER * extrema.rows), rows.stop - rows.start)
    wide = min(max(WIDE, WIDER * extrema.cols), cols.stop - cols.start)
    room = np.empty((tall + 2 * extrema.rows, 4, wide + 2 * extrema.cols), np.float32)
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
