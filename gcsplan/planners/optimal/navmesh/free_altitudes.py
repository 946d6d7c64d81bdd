"""The altitudes at which each cell of a mesh can be flown through, by the ground below and the zones."""

from __future__ import annotations

import numpy as np

from gcsplan.arrays import Floats, Int32s, Int64s
from gcsplan.planners.optimal.navmesh.interval_kernels import cut_intervals
from gcsplan.planners.optimal.navmesh.mesh import Mesh

MOST = 4
"""Most intervals over one cell; zones that would make more are ignored."""


def ranges(mesh: Mesh, top_m: float, cells: Int64s) -> tuple[Floats, Floats]:
    """(K,) the lowest and the highest altitude, at most ``top_m``, that can be flown at in each of ``cells`` (K,);
    lowest above highest where there is none. ``mesh`` must be for bounds and as fine as its plane."""
    plane, (rows, cols) = mesh.plane, mesh.excess.shape
    low, high = mesh.lowest(cells), np.full(len(cells), top_m)
    limits = plane.problem.bound_limits
    if limits.max_agl_m is not None:
        ground = plane.grounds[1][mesh.row : mesh.row + rows, mesh.col : mesh.col + cols]
        pairs = np.maximum(ground[:-1], ground[1:])
        most = np.maximum(pairs[:, :-1], pairs[:, 1:]).ravel()[cells]
        high = np.fmin(high, most + (limits.max_agl_m - limits.altitude_error_m + plane.fit.spare_m))
    count, lows, highs = intervals(mesh, cells, low, high, 0.0)
    there = np.arange(MOST) < count[:, None]
    return np.where(there, lows, np.inf).min(axis=1), np.where(there, highs, -np.inf).max(axis=1)


def intervals(
    mesh: Mesh, cells: Int64s, low_m: Floats, high_m: Floats, spare_m: float
) -> tuple[Int32s, Floats, Floats]:
    """Cut the range of each of ``cells``, ``low_m`` to ``high_m`` from `ranges`, into the altitude intervals that zones
    leave.

    Returns the number of intervals (K,), at most `MOST`, and their lower and upper ends (K, `MOST`), each ``spare_m``
    further out. ``mesh``: as for `ranges`.
    """
    low, high = np.empty((len(cells), MOST)), np.empty((len(cells), MOST))
    low[:, 0], high[:, 0] = low_m - spare_m, high_m + spare_m
    count = (low_m <= high_m).astype(np.int32)
    number = np.full(len(mesh.piece), -1, np.int32)
    number[cells] = np.arange(len(cells))
    cut_intervals(*_laid(mesh), spare_m, number, count, low, high)
    return count, low, high


def _laid(mesh: Mesh) -> tuple[Floats, Floats, Floats, Floats, Floats, Int32s, bool, float, float]:
    """What the zone kernels take: ground, x and y of the mesh's nodes, numbers and forms of the shapes that are
    certainly shut, their boxes on the mesh, whether the ground is the terrain model's own, and `Plane.reach_m`."""
    plane, (rows, cols) = mesh.plane, mesh.excess.shape
    ground = np.ascontiguousarray(plane.grounds[0][mesh.row : mesh.row + rows, mesh.col : mesh.col + cols])
    boxes = plane.boxes(mesh.row, mesh.col, 1, rows, cols)
    return ground, *mesh.places(), *plane.shapes.low, boxes, plane.stride == 1, *plane.reach_m(True)
