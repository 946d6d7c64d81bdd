"""The terrain model's nodes as a lattice of the plane has them: heights for bounds and for paths, slopes, places."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners._fill import pool
from gcsplan.world.surface import GridMap

Floats = NDArray[np.float64]


def slopes(z: Floats, x: Floats, y: Floats) -> Floats:
    """(rows, cols) steepest slope of the cells around each node."""
    z = np.where(np.isfinite(z), z, np.nan)
    across = math.dist((x[0, 0], y[0, 0]), (x[0, 1], y[0, 1]))
    along = math.dist((x[0, 0], y[0, 0]), (x[1, 0], y[1, 0]))
    east, north = np.abs(np.diff(z, axis=1)) / across, np.abs(np.diff(z, axis=0)) / along
    a, b = np.zeros_like(z), np.zeros_like(z)
    a[:, 1:] = east
    np.maximum(a[:, :-1], east, out=a[:, :-1])
    b[1:] = north
    np.maximum(b[:-1], north, out=b[:-1])
    return np.hypot(a, b)


def nodes(z: Floats, parts: int, stride: int, whole: int) -> tuple[Floats, Floats]:
    """Heights at a lattice's nodes for bounds and for paths, from the terrain model's, rows going north."""
    if stride == 1 and whole == 1:
        finer = _finer(z, parts)
        return finer, finer
    # Beyond the border bounds may do as they like, and paths may not go.
    more = [(0, -(n - 1) % whole) for n in z.shape]
    wide = np.pad(np.ascontiguousarray(z), more, mode="edge")
    low, high = (np.empty(tuple((n - 1) // stride + 1 for n in wide.shape)) for _ in range(2))
    pool(wide, stride, low, high)
    for axis, (_, extra) in enumerate(more):
        if extra:
            edge = [slice(None), slice(None)]
            edge[axis] = slice((z.shape[axis] - 1) // stride + 1, None)
            high[tuple(edge)] = np.inf
    return low, high


def _finer(z: Floats, parts: int) -> Floats:
    """Bilinear values ``parts`` times as close."""
    if parts == 1:
        return np.ascontiguousarray(z)
    u = np.arange(parts) / parts
    for _ in range(2):  # along the rows, then, turned, along the columns
        wide = np.empty((z.shape[0], (z.shape[1] - 1) * parts + 1))
        wide[:, :-1] = (z[:, :-1, None] * (1.0 - u) + z[:, 1:, None] * u).reshape(len(z), -1)
        wide[:, ::parts] = z  # a weight of 0 must not carry an unknown neighbour's NaN over
        z = wide.T
    return np.ascontiguousarray(z)


def places(
    grid: GridMap, col0: int, row1: int, shape: tuple[int, int], parts: float, span: int
) -> tuple[Floats, Floats]:
    """(rows, cols) x and y of a lattice's nodes, bilinear between the corners of blocks of ``span`` cells."""
    rows, cols = shape
    step = min(span, max(rows, cols))
    c = np.arange(0, cols - 1 + step, step)
    r = np.arange(0, rows - 1 + step, step)
    corner = grid.to_plane(col0 + c[None, :] / parts, row1 - r[:, None] / parts)
    j, i = np.arange(rows), np.arange(cols)
    v, u = (j % step) / step, (i % step) / step
    out = []
    for k in range(2):
        z = np.pad(corner[..., k], ((0, 1), (0, 1)), mode="edge")
        side = z[:, i // step] * (1.0 - u) + z[:, i // step + 1] * u
        out.append(np.ascontiguousarray(side[j // step] * (1.0 - v)[:, None] + side[j // step + 1] * v[:, None]))
    return out[0], out[1]
