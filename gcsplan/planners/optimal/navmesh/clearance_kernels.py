"""Kernels for the nodes of a lattice: their places, their terrain heights, and their excess over a cap."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Bools, Floats, Int8s, Int32s, Int64s
from gcsplan.planners.compiled import device, kernel

SPARE = 0.999
"""Share of a distance that is counted, because neighbouring cells differ slightly in size."""


@kernel("f8[,] f8[,] f8[,] f8[,] f8[,] b1[,] i8 f8 f8 f8 f8[,] b1 i4[,] f8[,] f8[,] f8[,] f8[,] f8[,] i1[]")
def fill(
    top: Floats, ground: Floats, steep: Floats, x: Floats, y: Floats, chosen: Bools, fineness: int,
    more: float, beside: float, cap: float, cones: Floats, low: bool, around: Int32s, excess: Floats, floor: Floats,
    under: Floats, fine_x: Floats, fine_y: Floats, diagonal: Int8s,
) -> None:  # fmt: skip
    """Cut each ``chosen`` (rows - 1, cols - 1) cell into ``fineness`` parts a side and compute the values of the nodes.

    ``floor`` is ``top`` + ``more`` + ``beside`` times a slope: for paths ``steep`` (rows, cols); for bounds (``steep``
    is empty) the least slope that holds within ``beside``, which is shortened, of all places next to the node.
    ``excess`` is the floor minus the lower of ``cap`` and the ``cones`` (K, 4: x, y, height, slope), which are lowered
    so that, between nodes, they are too low rather than too high; it is inf at the other nodes of ``around`` (see
    `blank`). ``under`` is the ground. ``diagonal``: which diagonal to cut a cell along so that its triangles never lie
    above (``low``), or never below, the bilinear patch.
    """
    rows, cols = chosen.shape
    fine_cols = cols * fineness
    blank(excess, around, math.inf)
    for j in range(rows):
        for i in range(cols):
            if not chosen[j, i]:
                continue
            twist = top[j, i] + top[j + 1, i + 1] - top[j, i + 1] - top[j + 1, i]
            way = np.int8(1 if (twist > 0.0) == low else 0)
            dx, dy = x[j + 1, i + 1] - x[j, i], y[j + 1, i + 1] - y[j, i]
            square = (dx * dx + dy * dy) / (fineness * fineness)
            side = math.sqrt(square)
            ex, ey, nx, ny = x[j, i + 1] - x[j, i], y[j, i + 1] - y[j, i], x[j + 1, i] - x[j, i], y[j + 1, i] - y[j, i]
            across, along = math.sqrt(ex * ex + ey * ey), math.sqrt(nx * nx + ny * ny)
            # Steps along the two axes whose squares add up to near² lead no farther than `beside`, even if askew.
            near = SPARE * beside / (1.0 + abs(ex * nx + ey * ny) / (across * along))
            for q in range(fineness + 1):
                v = q / fineness
                for p in range(fineness + 1):
                    u = p / fineness
                    a, b, c, d = (1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v
                    jj, ii = j * fineness + q, i * fineness + p
                    if q < fineness and p < fineness:
                        diagonal[jj * fine_cols + ii] = way
                    if excess[jj, ii] < math.inf:
                        continue  # done for a neighbouring cell
                    height = _mix(top, j, i, a, b, c, d)
                    if math.isnan(height):
                        continue
                    height += more
                    if len(steep):
                        height += beside * _mix(steep, j, i, a, b, c, d)
                    elif near > 0.0:
                        wide_u, wide_v = 1.0 / fineness + near / across, 1.0 / fineness + near / along
                        height += near * _rises(top, j + v, i + u, wide_v, wide_u, along, across)
                    px, py = _mix(x, j, i, a, b, c, d), _mix(y, j, i, a, b, c, d)
                    e = height - cap
                    for k in range(len(cones)):
                        off = math.sqrt((px - cones[k, 0]) ** 2 + (py - cones[k, 1]) ** 2)
                        bow = square / (8.0 * max(off, 0.5 * side))
                        e = max(e, height - cones[k, 2] - cones[k, 3] * (off - bow))
                    excess[jj, ii], floor[jj, ii] = e, height
                    under[jj, ii] = _mix(ground, j, i, a, b, c, d)
                    fine_x[jj, ii], fine_y[jj, ii] = px, py


@device
def _rises(top: Floats, row: float, col: float, rows: float, cols: float, along: float, across: float) -> float:
    """A lower bound of a surface's slope in one and the same direction, everywhere within ``rows`` and ``cols`` of a
    place; 0 where a cell is unknown or missing. ``along``, ``across``: metres of a row and of a column."""
    least_e = least_n = math.inf
    most_e = most_n = -math.inf
    for j in range(math.floor(row - rows), math.floor(row + rows) + 1):
        for i in range(math.floor(col - cols), math.floor(col + cols) + 1):
            if not (0 <= j < top.shape[0] - 1 and 0 <= i < top.shape[1] - 1):
                return 0.0
            a, b, c, d = top[j, i], top[j, i + 1], top[j + 1, i + 1], top[j + 1, i]
            if not abs(a + b + c + d) < math.inf:
                return 0.0
            for k in range(2):
                v = max(row - rows - j, 0.0) if k == 0 else min(row + rows - j, 1.0)
                u = max(col - cols - i, 0.0) if k == 0 else min(col + cols - i, 1.0)
                e, n = (b - a) * (1.0 - v) + (c - d) * v, (d - a) * (1.0 - u) + (c - b) * u
                least_e, most_e, least_n, most_n = min(least_e, e), max(most_e, e), min(least_n, n), max(most_n, n)
    # The least slope is the one nearest to 0 in each component's range.
    e, n = max(least_e, -most_e, 0.0) / across, max(least_n, -most_n, 0.0) / along
    return math.sqrt(e * e + n * n)


@kernel("f8[,] f8[,] i8 f8 f8 f8 f8 f8 f8[,] f8[,] b1[,]")
def lay(
    corner_x: Floats, corner_y: Floats, step: int, ax: float, ay: float, bx: float, by: float, most: float, x: Floats,
    y: Floats, inside: Bools,
) -> None:  # fmt: skip
    """Compute the places of a lattice's nodes, bilinear between every ``step``-th; clear ``inside`` (rows - 1,
    cols - 1) at cells with a corner whose distances to (ax, ay) and (bx, by) add up to more than ``most``."""
    rows, cols = x.shape
    for j in range(rows):
        v, b = (j % step) / step, j // step
        for i in range(cols):
            u, a = (i % step) / step, i // step
            x[j, i] = _mix(corner_x, b, a, (1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v)
            y[j, i] = _mix(corner_y, b, a, (1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v)
            away = math.sqrt((x[j, i] - ax) ** 2 + (y[j, i] - ay) ** 2)
            away += math.sqrt((x[j, i] - bx) ** 2 + (y[j, i] - by) ** 2)
            if away > most:
                for k in range(4):
                    jj, ii = j - (k >> 1), i - (k & 1)
                    if 0 <= jj < rows - 1 and 0 <= ii < cols - 1:
                        inside[jj, ii] = False


@device
def blank(value: Floats, around: Int32s, at_first: float) -> None:
    """Set ``value`` (rows, cols) to ``at_first`` at the nodes that are looked at. ``around`` (rows, 2): first column of
    each row, and that after the last. Others are never read, and memory that is never touched costs nothing."""
    for j in range(len(around)):
        for i in range(around[j, 0], around[j, 1]):
            value[j, i] = at_first


@device
def _on_border(z: Floats, over: Int64s, j: int, i: int) -> float:
    """The height of the node j rows north and i columns east of the south-west corner; beyond the border, the border's
    height."""
    return float(z[over[3] - min(j, over[3] - over[1]), over[0] + min(i, over[2] - over[0])])


@device
def _or_lowest(height: float) -> float:
    """A height; if it is unknown, one below all ground."""
    return -1e9 if math.isnan(height) else height


@kernel("f8[,] i8[] i8 f8[,] f8[,]")
def pool(z: Floats, over: Int64s, stride: int, low: Floats, high: Floats) -> None:
    """Heights of every ``stride``-th node of a terrain model, rows going north, lowered (``low``) and raised (``high``)
    until the bilinear patches between them lie nowhere above, and nowhere below, the terrain model's own patches.

    ``over``: first and last column and row to use (col0, row0, col1, row1); beyond them, the border's heights count.
    The difference of large and small patches is bilinear in each small cell, so it is greatest at a node. An unknown
    node (NaN) shuts every patch that it lies in for ``high`` (inf), and is ignored for ``low``.
    """
    rows, cols = low.shape
    for j in range(rows):
        for i in range(cols):
            h = _on_border(z, over, j * stride, i * stride)
            low[j, i] = _or_lowest(h)
            high[j, i] = math.inf if math.isnan(h) else h
    for j in range(rows - 1):
        for i in range(cols - 1):
            a, b = _on_border(z, over, j * stride, i * stride), _on_border(z, over, j * stride, (i + 1) * stride)
            c = _on_border(z, over, (j + 1) * stride, (i + 1) * stride)
            d = _on_border(z, over, (j + 1) * stride, i * stride)
            most = 0.0
            least = -math.inf if math.isnan(a + b + c + d) else 0.0
            # The patch is as low as can be at an unknown corner, but on the side between two known ones it is not.
            a, b, c, d = _or_lowest(a), _or_lowest(b), _or_lowest(c), _or_lowest(d)
            for q in range(stride + 1):
                v = q / stride
                for p in range(stride + 1):
                    u = p / stride
                    off = a * (1.0 - u) * (1.0 - v) + b * u * (1.0 - v) + c * u * v + d * (1.0 - u) * v
                    off -= _on_border(z, over, j * stride + q, i * stride + p)
                    if math.isnan(off):
                        least = -math.inf
                    else:
                        most, least = max(most, off), min(least, off)
            for k in range(4):
                jj, ii = j + (k >> 1), i + ((k ^ (k >> 1)) & 1)
                h = _on_border(z, over, jj * stride, ii * stride)
                if not math.isnan(h):
                    low[jj, ii] = min(low[jj, ii], h - most)
                    high[jj, ii] = max(high[jj, ii], h - least)


@device
def _mix(z: Floats, j: int, i: int, a: float, b: float, c: float, d: float) -> float:
    """Interpolate in cell (j, i) with the bilinear weights a to d; a weight of 0 keeps an unknown node's NaN out."""
    out = 0.0
    if a != 0.0:
        out += a * z[j, i]
    if b != 0.0:
        out += b * z[j, i + 1]
    if c != 0.0:
        out += c * z[j + 1, i + 1]
    if d != 0.0:
        out += d * z[j + 1, i]
    return out
