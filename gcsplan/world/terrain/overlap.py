"""The heights of tiles on their common grid: one surface, and a second one where tiles overlap and differ.

Nobody knows which of two tiles is right. Where they differ the ground lies between a least and a greatest height, and
each limit counts the unfavourable one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.terrain.raster import MAX_CELLS, Raster

SharedNodes = tuple[int, int, int, int]
"""Column, row, columns, rows of the common grid that a tile and a window share."""


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
    """The heights of a window that begins at column ``c0`` and row ``r0``, and notes on what differs or is unknown.

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
