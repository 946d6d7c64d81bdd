"""The values of a lattice's nodes from the terrain model: heights for bounds and for paths, slopes, and places."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.navmesh.clearance_kernels import lay, pool
from gcsplan.world.geometry.surface import GridMap

Extent = tuple[int, int, int, int]
"""First and last columns and rows (col0, row0, col1, row1) of a terrain model's nodes."""


def slopes(z: Floats, x: Floats, y: Floats) -> Floats:
    """(rows, cols) the steepest slope (m per m) of the cells around each node."""
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


def nodes(z: Floats, over: Extent, parts: int, stride: int, whole: int) -> tuple[Floats, Floats]:
    """Heights at a lattice's nodes for bounds and for paths, rows going north, from the terrain model's heights ``z``;
    the lattice covers the extent ``over``. ``parts``, ``stride``, ``whole``: see `grid.make_plane`."""
    col0, row0, col1, row1 = over
    if stride == 1 and whole == 1:
        finer = _finer(z[row0 : row1 + 1, col0 : col1 + 1][::-1], parts)
        return finer, finer
    cells = [-(-n // whole) * whole // stride for n in (row1 - row0, col1 - col0)]
    low, high = (np.empty((cells[0] + 1, cells[1] + 1)) for _ in range(2))
    pool(np.ascontiguousarray(z), np.array(over), stride, low, high)
    # Beyond the border, paths may not go; for bounds, its heights go on.
    high[(row1 - row0) // stride + 1 :] = np.inf
    high[:, (col1 - col0) // stride + 1 :] = np.inf
    return low, high


def _finer(z: Floats, parts: int) -> Floats:
    """Interpolate heights bilinearly at nodes ``parts`` times as close."""
    if parts == 1:
        return np.ascontiguousarray(z)
    u = np.arange(parts) / parts
    for _ in range(2):  # along the rows; then, transposed, along the columns
        wide = np.empty((z.shape[0], (z.shape[1] - 1) * parts + 1))
        wide[:, :-1] = (z[:, :-1, None] * (1.0 - u) + z[:, 1:, None] * u).reshape(len(z), -1)
        wide[:, ::parts] = z  # a weight of 0 must not carry an unknown neighbour's NaN over
        z = wide.T
    return np.ascontiguousarray(z)


def places(
    grid: GridMap, col0: int, row1: int, shape: tuple[int, int], parts: float, span: int,
    reach: tuple[tuple[float, float], tuple[float, float], float] | None = None,
) -> tuple[Floats, Floats, Bools]:  # fmt: skip
    """(rows, cols) x and y of a lattice's nodes, bilinear between the corners of blocks of ``span`` cells, and
    (rows - 1, cols - 1) which cells lie within ``reach``: two places, and the largest sum of distances to both, m."""
    rows, cols = shape
    step = min(span, max(rows, cols))
    c = np.arange(0, cols + step, step)
    r = np.arange(0, rows + step, step)
    corner = grid.to_plane(col0 + c[None, :] / parts, row1 - r[:, None] / parts)
    x, y, inside = np.empty(shape), np.empty(shape), np.ones((rows - 1, cols - 1), np.bool_)
    a, b, most = reach if reach is not None else ((0.0, 0.0), (0.0, 0.0), math.inf)
    corner_x, corner_y = (np.ascontiguousarray(corner[..., k]) for k in range(2))
    lay(corner_x, corner_y, step, *a, *b, most, x, y, inside)
    return x, y, inside
