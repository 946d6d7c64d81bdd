"""Layers of terrain that differ in resolution, grid or datum, as one surface: the finer counts where it is known.

The ground at a place is the finest layer's that knows the place, bilinear between that layer's own nodes; of layers
that are equally fine each may be right. On the grid of the finest layer this ground has a jump where a layer ends, and
a bend in a cell that a coarser layer's line crosses. So it is held between two heights: in every cell the surface of
the greatest heights is nowhere below it, the surface of the least heights nowhere above it. A cell that knows four
nodes of the finest layer has their heights, unless it touches a cell of another layer.

In a cell, the ground of a coarser layer differs from the bilinear surface through the cell's corners by no more than a
quarter of the bends of the lines that cross it, and of the twist of the patch where the grids are turned. Where the
layer is not known all over the cell, or bends more than it rises, its greatest and least height there count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.errors import InputError
from gcsplan.notes.note import Note
from gcsplan.world.geometry.surface import GridMap
from gcsplan.world.terrain.mosaic import FIT_ERROR_M, Window

AS_FINE = 1.5
"""Layers whose cells differ by less than this factor are equally fine."""

STRIP_CELLS = 1_000_000
MOST_PATCHES = 16
"""Most patches of another layer beside each other in one cell of the finest one."""

SEA_M = 0.0
_CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))


@dataclass(frozen=True, slots=True)
class TerrainLayer:
    """A layer's window, the length of its cell, m, and the names of its files."""

    window: Window
    cell_m: float
    name: str


def cell_m(window: Window) -> float:
    """The longer side of a window's cell, m."""
    box = window.plane_box
    return float(window.grid.metres_per_cell(0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])).max())


def mixed(layers: Sequence[TerrainLayer], *, sea: bool = False) -> Window:
    """The window of the first layer, the finest, with the ground of all; ``sea``: where none knows it, it is at 0 m.

    ``layers`` are in the order of `finest_first`. Notes on the layers are taken over.
    """
    target = layers[0].window
    high, low, own = _own(target)
    open_ = np.ones(own.shape, np.bool_)
    ranks = _ranks(layers)
    for number, rank in enumerate(ranks):
        closed = own.copy() if number == 0 else np.zeros_like(own)
        for layer in rank:
            if layer is not layers[0]:
                _Other(layer, target, layers[0].cell_m).put(high, low, open_, closed)
        open_ &= ~closed
    if sea:
        _put_all(high, low, (slice(None), slice(None)), open_, np.full(open_.shape, SEA_M), np.full(open_.shape, SEA_M))
    else:
        unknown = _touched(open_) & ~_touched(own)
        high[unknown] = low[unknown] = np.nan
    return _window(layers, target, high, low, sea=sea)


def finest_first(layers: Sequence[TerrainLayer]) -> list[TerrainLayer]:
    """The layers by the length of their cells; equal ones stay in their order."""
    return sorted(layers, key=lambda layer: layer.cell_m)


def _ranks(layers: Sequence[TerrainLayer]) -> list[list[TerrainLayer]]:
    """Layers that are equally fine, from the finest on."""
    ranks: list[list[TerrainLayer]] = []
    for layer in layers:
        if ranks and layer.cell_m < AS_FINE * ranks[-1][0].cell_m:
            ranks[-1].append(layer)
        else:
            ranks.append([layer])
    return ranks


def _own(target: Window) -> tuple[Floats, Floats, Bools]:
    """Greatest and least heights of the finest layer's own cells, NaN elsewhere, and which cells these are."""
    z = target.heights_m
    known = ~np.isnan(z)
    own = known[:-1, :-1] & known[:-1, 1:] & known[1:, :-1] & known[1:, 1:]
    at = _touched(own)
    high = np.where(at, z, np.nan)
    low = high.copy() if target.low_m is None else np.where(at, target.low_m, np.nan)
    return high, low, own


def _touched(cells: Bools) -> Bools:
    """The nodes (rows + 1, cols + 1) of some cells (rows, cols)."""
    nodes = np.zeros((cells.shape[0] + 1, cells.shape[1] + 1), np.bool_)
    for down, right in _CORNERS:
        nodes[down : down + cells.shape[0], right : right + cells.shape[1]] |= cells
    return nodes


def _put_all(high: Floats, low: Floats, part: tuple[slice, slice], cells: Bools, high_m: Floats, low_m: Floats) -> None:
    """Widen the heights of all corners of some ``cells`` of a part to ``low_m`` … ``high_m``, (rows, cols)."""
    for corner in _CORNERS:
        _put(high, low, part, corner, cells, high_m, low_m)


def _put(
    high: Floats,
    low: Floats,
    part: tuple[slice, slice],
    corner: tuple[int, int],
    cells: Bools,
    high_m: Floats,
    low_m: Floats,
) -> None:
    first = part[0].start or 0
    rows = slice(first + corner[0], first + corner[0] + cells.shape[0])
    cols = slice(corner[1], corner[1] + cells.shape[1])
    for into, heights, widen in ((high, high_m, np.fmax), (low, low_m, np.fmin)):
        widen(into[rows, cols], np.where(cells, heights, np.nan), out=into[rows, cols])


class _Other:
    """Another layer, as the cells of the target see it."""

    def __init__(self, layer: TerrainLayer, target: Window, target_cell_m: float) -> None:
        self.name = layer.name
        self.high = _Patches(layer.window.heights_m)
        self.low = self.high if layer.window.low_m is None else _Patches(layer.window.low_m)
        rows, cols = target.heights_m.shape

        def there(col: Floats, row: Floats) -> tuple[Floats, Floats]:
            plane = target.grid.to_plane(col, row)
            at = layer.window.grid(plane[..., 0], plane[..., 1])
            return at[..., 0], at[..., 1]

        self.onto = GridMap.fit(there, (0.0, 0.0, float(cols), float(rows)))
        # Two grids are placed, and one is fitted onto the other.
        self.error = (2.0 * FIT_ERROR_M + self.onto.error_m * target_cell_m) / layer.cell_m

    def put(self, high: Floats, low: Floats, open_: Bools, closed: Bools) -> None:
        """Widen the heights by this layer in the ``open_`` cells; cells that it knows whole become ``closed``."""
        rows, cols = open_.shape
        step = max(1, STRIP_CELLS // cols)
        for first in range(0, rows, step):
            part = slice(first, min(first + step, rows))
            cells = open_[part]
            if not cells.any():
                continue
            at = self.onto(np.arange(cols + 1.0)[None, :], np.arange(part.start, part.stop + 1.0)[:, None])
            seen = _Cells(at, self.error, self.name)
            knows = self.high.known_of(seen)
            whole, some = cells & knows[0], cells & knows[1] & ~knows[0]
            closed[part] |= whole
            bounds = self.high.bounds(seen, 1.0), self.low.bounds(seen, -1.0)
            for k, corner in enumerate(_CORNERS):
                _put(high, low, (part, slice(None)), corner, whole, bounds[0][0][k], bounds[1][0][k])
            _put_all(high, low, (part, slice(None)), some, bounds[0][1], bounds[1][1])


class _Cells:
    """Cells of the target in the columns and rows of another layer.

    ``corners``: column and row of each corner; ``first``, ``last``: column and row of the patches that a cell touches;
    ``steps``: how far column and row go along the cell's sides. Raises InputError beyond `MOST_PATCHES`.
    """

    def __init__(self, at: Floats, error: float, name: str) -> None:
        rows, cols = at.shape[0] - 1, at.shape[1] - 1
        ends = [at[down : down + rows, right : right + cols] for down, right in _CORNERS]
        self.corners, self.error = ends, error
        c, r = ([end[..., axis] for end in ends] for axis in (0, 1))
        self.first = [np.floor(np.minimum.reduce(x) + error).astype(np.intp) for x in (c, r)]
        self.last = [
            np.maximum(np.floor(np.maximum.reduce(x) - error).astype(np.intp), first)
            for x, first in zip((c, r), self.first, strict=True)
        ]
        if any(int((b - a).max()) >= MOST_PATCHES for a, b in zip(self.first, self.last, strict=True)):
            raise InputError(
                f"{name} has cells that are much longer than wide, too unlike the finest terrain's: gdalwarp it to "
                "square cells (-tr)"
            )
        self.steps = [
            [np.maximum(np.abs(x[1] - x[0]), np.abs(x[3] - x[2])), np.maximum(np.abs(x[2] - x[0]), np.abs(x[3] - x[1]))]
            for x in (c, r)
        ]

    def patches(self) -> list[tuple[Indices, Indices, Bools, int, int]]:
        """Column and row of each patch of a cell, whether the cell has so many, and the numbers within the cell."""
        spans = [int((last - first).max()) + 1 for first, last in zip(self.first, self.last, strict=True)]
        found = []
        for j, i in product(range(spans[1]), range(spans[0])):
            col, row = self.first[0] + i, self.first[1] + j
            found.append((col, row, (col <= self.last[0]) & (row <= self.last[1]), i, j))
        return found


class _Patches:
    """The patches of a layer between its nodes, with what bounds the ground in them."""

    def __init__(self, z: Floats) -> None:
        self.z = z
        four = np.stack([z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]])
        self.known: Bools = np.asarray(~np.isnan(four).any(axis=0))
        self.top, self.bottom = four.max(axis=0), four.min(axis=0)
        self.twist = np.nan_to_num(np.abs(four[0] - four[1] - four[2] + four[3]))
        self.rise = np.nan_to_num(self.top - self.bottom)
        bend_c, bend_r = np.zeros_like(z), np.zeros_like(z)
        bend_c[:, 1:-1] = np.abs(z[:, :-2] - 2.0 * z[:, 1:-1] + z[:, 2:])
        bend_r[1:-1] = np.abs(z[:-2] - 2.0 * z[1:-1] + z[2:])
        # Along a patch a line's bend is linear between the patch's two nodes on it.
        self.bend_c = np.nan_to_num(np.fmax(bend_c[:-1], bend_c[1:]))
        self.bend_r = np.nan_to_num(np.fmax(bend_r[:, :-1], bend_r[:, 1:]))

    def _known(self, col: Indices, row: Indices) -> Bools:
        """Whether patches exist and are known."""
        there = (col >= 0) & (row >= 0) & (col < self.known.shape[1]) & (row < self.known.shape[0])
        return np.asarray(there & self.known[np.where(there, row, 0), np.where(there, col, 0)])

    def known_of(self, cells: _Cells) -> tuple[Bools, Bools]:
        """Whether the layer is known all over each cell, and in some of it."""
        whole, some = np.ones(cells.first[0].shape, np.bool_), np.zeros(cells.first[0].shape, np.bool_)
        for col, row, mine, _, _ in cells.patches():
            good = self._known(col, row)
            whole &= good | ~mine
            some |= good & mine
        return whole, some

    def bounds(self, cells: _Cells, sign: float) -> tuple[list[Floats], Floats]:
        """Upper (``sign`` 1) or lower (-1) bounds: at each corner for cells known all over, and one for any cell."""
        shape = cells.first[0].shape
        extreme = np.full(shape, np.nan)
        rise, twist = np.zeros(shape), np.zeros(shape)
        bends: list[dict[int, Floats]] = [{}, {}]
        pick, values = (np.fmax, self.top) if sign > 0.0 else (np.fmin, self.bottom)
        for col, row, mine, i, j in cells.patches():
            good = self._known(col, row) & mine
            at = np.where(good, row, 0), np.where(good, col, 0)
            pick(extreme, np.where(good, values[at], np.nan), out=extreme)
            for into, of in ((rise, self.rise), (twist, self.twist)):
                np.maximum(into, np.where(good, of[at], 0.0), out=into)
            for axis, number, bend in ((0, i, self.bend_c), (1, j, self.bend_r)):
                if number:
                    line = bends[axis].setdefault(number, np.zeros(shape))
                    np.maximum(line, np.where(good, bend[at], 0.0), out=line)
        (cu, cv), (ru, rv) = cells.steps
        crossed = [sum(lines.values(), np.zeros(shape)) for lines in bends]
        off = 0.25 * (crossed[0] * (cu + cv) + crossed[1] * (ru + rv) + twist * (cu * ru + cv * rv))
        placed = 3.0 * cells.error * rise
        extreme = extreme + sign * placed
        corners = [self._bilinear(cells, k) for k in range(4)]
        bounds = [v + sign * (off + placed) for v in corners]
        # Where the bends allow more than the layer's own range over the cell does, the range counts.
        mean = 0.25 * (corners[0] + corners[1] + corners[2] + corners[3])
        wide = sign * (extreme - mean) < off + placed
        return [np.where(wide, extreme, b) for b in bounds], extreme

    def _bilinear(self, cells: _Cells, corner: int) -> Floats:
        """The layer's height at a corner of each cell, by a patch that the cell touches."""
        c, r = cells.corners[corner][..., 0], cells.corners[corner][..., 1]
        rows, cols = self.known.shape
        i = np.clip(np.clip(np.floor(c).astype(np.intp), cells.first[0], cells.last[0]), 0, cols - 1)
        j = np.clip(np.clip(np.floor(r).astype(np.intp), cells.first[1], cells.last[1]), 0, rows - 1)
        u, v = c - i, r - j
        z = self.z
        upper = (1.0 - u) * z[j, i] + u * z[j, i + 1]
        return np.asarray((1.0 - v) * upper + v * ((1.0 - u) * z[j + 1, i] + u * z[j + 1, i + 1]))


def _window(layers: Sequence[TerrainLayer], target: Window, high: Floats, low: Floats, *, sea: bool) -> Window:
    notes = [n for layer in layers for n in layer.window.notes if n.code != "nodes_unknown"]
    apart = high - low
    seams = int(np.count_nonzero(apart > 0.0))
    if len(layers) > 1:
        names = tuple(f"{layer.name} ({layer.cell_m:.3g} m)" for layer in layers)
        worst_m = float(np.nanmax(apart, initial=0.0))
        notes.append(Note("terrain_of_layers", layers=names, nodes=seams, worst_m=worst_m))
    if sea:
        filled = int(np.count_nonzero(np.isnan(target.heights_m) & (low <= SEA_M) & (high >= SEA_M)))
        notes += [Note("unknown_is_sea", nodes=filled)] if filled else []
    unknown = int(np.count_nonzero(np.isnan(high)))
    if unknown:
        notes.append(Note("nodes_unknown", unknown=unknown, nodes=high.size))
    sides = [any(side) for side in zip(*(layer.window.goes_on for layer in layers), strict=True)]
    goes_on = (sides[0], sides[1], sides[2], sides[3])
    return replace(target, heights_m=high, low_m=low if seams else None, notes=tuple(notes), goes_on=goes_on)
