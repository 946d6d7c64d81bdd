"""Walls for bounds from the terrain beside a track: on a pass, the ground at both sides is higher than that below.

An aircraft may be as far from its track as the track error. So a place is shut if the terrain is too high anywhere
within that distance; for all places of a small cell, the terrain in one direction is that of the cell moved there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.planners.optimal.navmesh.clearance import ClearanceGrid
from gcsplan.planners.optimal.navmesh.clearance_kernels import SPARE

DIRECTIONS = 32
"""Directions in which the terrain is read for a cell."""


def walls_beside(clearance: ClearanceGrid) -> Iterator[tuple[Indices, Floats]]:
    """Cells (K,) of a fine lattice for bounds, and the excess (K, 4) of walls at their corners, from the terrain as far
    away as the track error reaches, in several directions; see `ClearanceGrid.add_walls`."""
    from scipy.ndimage import maximum_filter  # most missions have no necks

    plane, limits = clearance.plane, clearance.plane.problem.bound_limits
    reach_m = SPARE * limits.track_error_m - 2.0 * plane.fit.bent_m
    if reach_m <= 0.0:
        return
    rows, cols = clearance.shape
    part = np.s_[clearance.row : clearance.row + rows, clearance.col : clearance.col + cols]
    more = limits.min_agl_m + limits.altitude_error_m - plane.fit.spare_m - clearance.cap_m
    excess, places = plane.tops[0][part] + more, np.stack([plane.x[part], plane.y[part]])
    step = np.stack([places[:, 0, 1] - places[:, 0, 0], places[:, 1, 0] - places[:, 0, 0]], axis=-1)
    angle = np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False)
    off = SPARE * reach_m * np.linalg.solve(step, np.stack([np.cos(angle), np.sin(angle)]))  # columns, and rows
    most = np.ceil(np.abs(off)).astype(np.intp).max(axis=1) + 1
    least = np.minimum(np.minimum(excess[:-1, :-1], excess[:-1, 1:]), np.minimum(excess[1:, :-1], excess[1:, 1:]))
    highest = maximum_filter(np.nan_to_num(excess, nan=-np.inf), size=(2 * most[1] + 1, 2 * most[0] + 1))[:-1, :-1]
    j, i = np.nonzero((least <= 0.0) & (highest > 0.0))
    for a, b in off.T.tolist():
        inside = (j + math.floor(b) >= 0) & (j + math.floor(b) < rows - 2)
        inside &= (i + math.floor(a) >= 0) & (i + math.floor(a) < cols - 2)
        jj, ii = j[inside], i[inside]
        walls = _moved(excess, jj, ii, b, a)
        apart = np.stack([_at(z, jj, ii, b, a) - z[jj, ii] for z in places])  # alike at the other corners
        stands = (walls.max(axis=1) > 0.0) & (np.hypot(*apart) <= reach_m)  # not where ground is unknown
        yield (jj * (cols - 1) + ii)[stands], walls[stands]


def _moved(z: Floats, j: Indices, i: Indices, b: float, a: float) -> Floats:
    """(K, 4) values at the corners of cells (K,) of a lattice, such that they are nowhere above the surface ``z`` moved
    by ``b`` rows and ``a`` columns, whichever diagonal the cells are cut along. ``z`` is bilinear in each cell."""
    v, u = b - math.floor(b), a - math.floor(a)
    rows, cols = ([math.floor(of) + more for more in (t, 1.0, 1.0 + t)] for of, t in ((b, v), (a, u)))
    # The difference from what is bilinear in the cell is so in each of the four parts that the moved lattice's lines
    # cut the cell into. So it is least at a corner of theirs.
    seen = [[_at(z, j, i, row, col) for col in cols] for row in rows]
    low, high = (seen[0][0], seen[0][2]), (seen[2][0], seen[2][2])
    lower = np.zeros(len(j))
    for row, t in zip(seen, (0.0, 1.0 - v, 1.0), strict=True):
        for value, s in zip(row, (0.0, 1.0 - u, 1.0), strict=True):
            west, east = ((1.0 - t) * of + t * on for of, on in zip(low, high, strict=True))
            np.minimum(lower, value - (1.0 - s) * west - s * east, out=lower)
    corners = np.stack([low[0], low[1], high[1], high[0]], axis=-1)
    twist = 0.25 * np.abs(corners[:, 0] + corners[:, 2] - corners[:, 1] - corners[:, 3])
    return np.asarray(corners + (lower - twist)[:, None])


def _at(z: Floats, j: Indices, i: Indices, b: float, a: float) -> Floats:
    """(K,) the bilinear values ``b`` rows and ``a`` columns from nodes (K,) of a lattice."""
    row, col = math.floor(b), math.floor(a)
    v, u = b - row, a - col
    south, north = (
        (1.0 - u) * z[j + row + k, i + col] + u * z[j + row + k, i + col + 1] if u > 0.0 else z[j + row + k, i + col]
        for k in (0, 1 if v > 0.0 else 0)
    )
    return np.asarray((1.0 - v) * south + v * north)
