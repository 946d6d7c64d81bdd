"""Kernels for the altitudes that a zone shuts over a whole cell of a lattice, for bounds.

A zone whose levels follow the ground shuts, at a place within reach of it, what lies between its levels over *its own*
ground within reach. Over a steep slope that is far more than what the ground below the place tells: under a zone whose
floor is a few metres above the lowest legal altitude nothing is left. Ground that is within reach of all corners of a
cell is within reach of every place in it.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Int32s
from gcsplan.planners.compiled import device, kernel
from gcsplan.planners.optimal.navmesh.zone_kernels import (
    BOTTOM,
    BOTTOM_AGL,
    LOOKS,
    OWN_BOTTOM,
    OWN_TOP,
    PAIR,
    THIN,
    TOP,
    TOP_AGL,
    UNDER,
    depth,
    level,
    put,
)

BESIDE_STEPS = 4
"""Places on each side of a cell's middle at which ground within reach is read."""


@device
def _at(a: Floats, row: float, col: float) -> float:
    """A value at a place between the nodes of a lattice, bilinear."""
    jj, ii = min(int(row), len(a) - 2), min(int(col), a.shape[1] - 2)
    v, u = row - jj, col - ii
    south = a[jj, ii] + u * (a[jj, ii + 1] - a[jj, ii])
    return float(south + v * (a[jj + 1, ii] + u * (a[jj + 1, ii + 1] - a[jj + 1, ii]) - south))


@device
def _shut_beside(
    ground: Floats, x: Floats, y: Floats, fineness: int, zones: Floats, edges: Floats, z: int, reach: float,
    near: float, j: int, i: int,
) -> tuple[float, float]:  # fmt: skip
    """The altitudes (bottom, top) that a zone's own ground shuts everywhere over a cell; (inf, -inf) if none are known.

    ``ground``, ``x``, ``y``: at the nodes of a lattice of which cell (j, i) is a part, ``fineness`` times finer.
    ``reach``: metres by which the zone is grown; ``near``: a little less, from all places of the cell to that ground.
    Places of the zone within ``near`` of all four corners count, and all ground between two such places does, too.
    """
    row, col, side = j / fineness, i / fineness, 1.0 / fineness
    cx, cy = _at(x, row + 0.5 * side, col + 0.5 * side), _at(y, row + 0.5 * side, col + 0.5 * side)
    half = 0.0
    for k in range(4):
        v, u = row + (k >> 1) * side, col + (k & 1) * side
        half = max(half, math.sqrt((_at(x, v, u) - cx) ** 2 + (_at(y, v, u) - cy) ** 2))
    room = near - half
    if room < half or depth(zones, edges, z, cx, cy) <= reach - room:
        return np.inf, -np.inf
    ex, ey = _at(x, row, col + side) - _at(x, row, col), _at(y, row, col + side) - _at(y, row, col)
    nx, ny = _at(x, row + side, col) - _at(x, row, col), _at(y, row + side, col) - _at(y, row, col)
    across = room / BESIDE_STEPS * side / math.sqrt(ex * ex + ey * ey)
    along = room / BESIDE_STEPS * side / math.sqrt(nx * nx + ny * ny)
    least, most = np.inf, -np.inf
    for q in range(-BESIDE_STEPS, BESIDE_STEPS + 1):
        v = row + 0.5 * side + q * along
        if not 0.0 <= v <= len(x) - 1:
            continue
        for p in range(-BESIDE_STEPS, BESIDE_STEPS + 1):
            u = col + 0.5 * side + p * across
            if not 0.0 <= u <= x.shape[1] - 1:
                continue
            height = _at(ground, v, u)
            if not (height < least or height > most):  # also if it is unknown
                continue
            at_x, at_y = _at(x, v, u), _at(y, v, u)
            off = (at_x - cx) ** 2 + (at_y - cy) ** 2
            if off <= room * room and depth(zones, edges, z, at_x, at_y) > reach:
                least, most = min(least, height), max(most, height)
    if most == -np.inf:
        return np.inf, -np.inf
    bottom = -np.inf
    if zones[z, UNDER] > 0.0:
        bottom = zones[z, OWN_BOTTOM] + (least if zones[z, BOTTOM_AGL] > 0.0 else 0.0)
    top = zones[z, OWN_TOP] + (most if zones[z, TOP_AGL] > 0.0 else 0.0)
    return (bottom, top) if top - bottom > zones[z, THIN] else (np.inf, -np.inf)


@kernel("i4[,] f8[,] f8[,] f8[,] f8[,] f8[,] i8 f8[,] f8[,] i4[,] f8 f8 i4[] f8[,] i8")
def stamp_beside(
    span: Int32s, excess: Floats, floor: Floats, ground: Floats, x: Floats, y: Floats, fineness: int, zones: Floats,
    edges: Floats, boxes: Int32s, reach: float, near: float, of: Int32s, values: Floats, count: int,
) -> int:  # fmt: skip
    """Give walls to the cells that a zone's own ground shuts in part or whole, after the ``count`` walls of
    `zone_kernels.stamp_zones`; return how many there are then. ``ground``, ``x``, ``y``: as in `_shut_beside`."""
    wall = values[len(values) - 1]
    for z in range(len(zones)):
        if zones[z, LOOKS] == 0.0:
            continue
        for j in range(boxes[z, 2], boxes[z, 3] + 1):
            for i in range(max(boxes[z, 0], span[j, 0]), min(boxes[z, 1] + 1, span[j, 1])):
                if min(min(excess[j, i], excess[j, i + 1]), min(excess[j + 1, i], excess[j + 1, i + 1])) > 0.0:
                    continue  # nothing there is free anyway
                bottom, top = _shut_beside(ground, x, y, fineness, zones, edges, z, reach, near, j, i)
                if top == -np.inf:
                    continue
                for k in range(4):
                    jj, ii = j + (k >> 1), i + ((k ^ (k >> 1)) & 1)
                    wall[k] = min(top - floor[jj, ii] + excess[jj, ii], floor[jj, ii] - bottom)
                count = put(of, values, j * (excess.shape[1] - 1) + i, wall, count)
    return count


@device
def over_ground(zones: Floats, z: int) -> bool:
    """Whether a zone has a level over ground (AGL) past which a path may fly."""
    under_agl = zones[z, UNDER] > 0.0 and zones[z, BOTTOM_AGL] > 0.0
    return bool(under_agl or (zones[z, TOP] < np.inf and zones[z, TOP_AGL] > 0.0))


@device
def shut_over(
    ground: Floats, x: Floats, y: Floats, zones: Floats, edges: Floats, z: int, reach: float, near: float, j: int,
    i: int,
) -> tuple[float, float]:  # fmt: skip
    """The altitudes (bottom, top) that a zone shuts everywhere over a cell which lies wholly in it: below and above
    them, some place of the cell may be free. (inf, -inf), so nothing is shut, if it does not lie wholly in the zone, or
    that is not known."""
    if zones[z, LOOKS] > 0.0:
        bottom, top = _shut_beside(ground, x, y, 1, zones, edges, z, reach, near, j, i)
        if top > -np.inf:
            return bottom, top
    bottom, top = -np.inf, np.inf
    for k in range(4):
        jj, ii = j + (k >> 1), i + (k & 1)
        unknown = over_ground(zones, z) and math.isnan(ground[jj, ii])
        if unknown or depth(zones, edges, z, x[jj, ii], y[jj, ii]) <= 0.0:
            return np.inf, -np.inf
        top = min(top, level(zones, z, TOP, ground[jj, ii]))
        if zones[z, UNDER] > 0.0:
            bottom = max(bottom, level(zones, z, BOTTOM, ground[jj, ii]))
    return (bottom, top) if top - bottom > zones[z, THIN] else (np.inf, -np.inf)


@kernel("f8[,] f8[,] f8[,] f8[,] f8[,] i4[,] b1 f8 f8 f8[,] f8[,]")
def narrow_ranges(
    ground: Floats, x: Floats, y: Floats, zones: Floats, edges: Floats, boxes: Int32s, exact: bool, reach: float,
    near: float, low: Floats, high: Floats,
) -> None:  # fmt: skip
    """Raise the lowest, and lower the highest, altitude that can be flown at somewhere in each cell (``low``, ``high``:
    (rows - 1, cols - 1)) where a zone can be passed on one side only; inf and -inf where it can be passed on neither.

    ``exact``: whether the lattice's cells are the terrain model's own, or parts of them. Over other lattices, levels
    over ground are not known.
    """
    for _ in range(2):  # what one zone shuts may leave one side of another only
        for z in range(len(zones)):
            if zones[z, PAIR] > 0.0 or (over_ground(zones, z) and not exact):
                continue
            for j in range(boxes[z, 2], boxes[z, 3] + 1):
                for i in range(boxes[z, 0], boxes[z, 1] + 1):
                    if low[j, i] > high[j, i]:
                        continue
                    bottom, top = shut_over(ground, x, y, zones, edges, z, reach, near, j, i)
                    under, over = bottom >= low[j, i], top <= high[j, i]
                    if not under:
                        low[j, i] = top if over else np.inf
                    if not over:
                        high[j, i] = bottom if under else -np.inf
