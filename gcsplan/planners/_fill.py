"""The excess of a lattice's nodes over what may be flown, cell by cell where it is wanted."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.compiled import device, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@kernel("f8[,] f8[,] f8[,] f8[,] f8[,] b1[,] i8 f8 f8 f8 f8[,] b1 i4[,] f8[,] f8[,] f8[,] f8[,] f8[,] i1[]")
def fill(
    top: Floats, ground: Floats, steep: Floats, x: Floats, y: Floats, wanted: NDArray[np.bool_], fineness: int,
    more: float, beside: float, cap: float, cones: Floats, low: bool, around: Ints, excess: Floats, floor: Floats,
    under: Floats, fine_x: Floats, fine_y: Floats, diagonal: NDArray[np.int8],
) -> None:  # fmt: skip
    """Cut each ``wanted`` (rows - 1, cols - 1) cell into ``fineness`` parts a side and give their nodes values.

    ``floor`` is ``top`` + ``more`` + ``beside`` times ``steep`` (empty: 0); ``excess`` what it is over ``cap`` and over
    ``cones`` (K, 4: x, y, height, slope), which are too low rather than too high between nodes, inf at the other nodes
    of ``around`` (see `blank`); ``under`` the ground. ``diagonal``: the way to cut a cell so that triangles never lie
    above (``low``), or never below, the bilinear patch.
    """
    rows, cols = wanted.shape
    fine_cols = cols * fineness
    blank(excess, around, math.inf)
    for j in range(rows):
        for i in range(cols):
            if not wanted[j, i]:
                continue
            twist = top[j, i] + top[j + 1, i + 1] - top[j, i + 1] - top[j + 1, i]
            way = np.int8(1 if (twist > 0.0) == low else 0)
            dx, dy = x[j + 1, i + 1] - x[j, i], y[j + 1, i + 1] - y[j, i]
            square = (dx * dx + dy * dy) / (fineness * fineness)
            side = math.sqrt(square)
            for q in range(fineness + 1):
                v = q / fineness
                for p in range(fineness + 1):
                    u = p / fineness
                    a, b, c, d = (1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v
                    jj, ii = j * fineness + q, i * fineness + p
                    if q < fineness and p < fineness:
                        diagonal[jj * fine_cols + ii] = way
                    if excess[jj, ii] < math.inf:
                        continue  # a cell beside this one knew as much
                    height = _mix(top, j, i, a, b, c, d)
                    if math.isnan(height):
                        continue
                    height += more
                    if len(steep):
                        height += beside * _mix(steep, j, i, a, b, c, d)
                    px, py = _mix(x, j, i, a, b, c, d), _mix(y, j, i, a, b, c, d)
                    e = height - cap
                    for k in range(len(cones)):
                        off = math.sqrt((px - cones[k, 0]) ** 2 + (py - cones[k, 1]) ** 2)
                        bow = square / (8.0 * max(off, 0.5 * side))
                        e = max(e, height - cones[k, 2] - cones[k, 3] * (off - bow))
                    excess[jj, ii], floor[jj, ii] = e, height
                    under[jj, ii] = _mix(ground, j, i, a, b, c, d)
                    fine_x[jj, ii], fine_y[jj, ii] = px, py


@kernel("f8[,] f8[,] i8 f8 f8 f8 f8 f8 f8[,] f8[,] b1[,]")
def lay(
    corner_x: Floats, corner_y: Floats, step: int, ax: float, ay: float, bx: float, by: float, most: float, x: Floats,
    y: Floats, inside: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Places of a lattice's nodes, bilinear between every ``step``-th; ``inside`` (rows - 1, cols - 1) the cells of
    whose corners none is farther than ``most`` from (ax, ay) and (bx, by) together."""
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
def blank(value: Floats, around: Ints, at_first: float) -> None:
    """Set ``value`` (rows, cols) at the nodes that are looked at: ``around`` (rows, 2) of each row the first, and that
    after the last. Others are never read, and memory that is never touched costs nothing."""
    for j in range(len(around)):
        for i in range(around[j, 0], around[j, 1]):
            value[j, i] = at_first


@device
def _on_border(z: Floats, over: NDArray[np.int64], j: int, i: int) -> float:
    """The height of the node that is j rows north of and i columns east of a corner; beyond the end, the end's."""
    return float(z[over[3] - min(j, over[3] - over[1]), over[0] + min(i, over[2] - over[0])])


@kernel("f8[,] i8[] i8 f8[,] f8[,]")
def pool(z: Floats, over: NDArray[np.int64], stride: int, low: Floats, high: Floats) -> None:
    """Every ``stride``-th node of a terrain model, rows going north, lowered (``low``) and raised (``high``) until
    bilinear patches between those left lie nowhere above, and nowhere below, the bilinear patches between all.

    ``over``: its first and last column and row (col0, row0, col1, row1). Beyond those all is as high as there. The
    difference of the two is bilinear in each small cell, so it is greatest at a node. Unknown nodes (NaN) shut every
    patch that they lie in for ``high`` (inf), and are passed over for ``low``.
    """
    rows, cols = low.shape
    for j in range(rows):
        for i in range(cols):
            h = _on_border(z, over, j * stride, i * stride)
            low[j, i] = -1e9 if math.isnan(h) else h
            high[j, i] = math.inf if math.isnan(h) else h
    for j in range(rows - 1):
        for i in range(cols - 1):
            a, b = _on_border(z, over, j * stride, i * stride), _on_border(z, over, j * stride, (i + 1) * stride)
            c = _on_border(z, over, (j + 1) * stride, (i + 1) * stride)
            d = _on_border(z, over, (j + 1) * stride, i * stride)
            most = least = 0.0
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
    """Bilinear; a weight of 0 does not carry an unknown neighbour's NaN over."""
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
