"""Kernels for altitude intervals: altitudes that a zone shuts over a whole cell, for bounds, and those left free.

A zone whose levels follow the ground shuts, at a place within reach of it, what lies between its levels over *its own*
ground within reach (`zone_kernels`). Over a steep slope that is far more than what the ground below the place tells:
under a zone whose floor is a few metres above the lowest legal altitude nothing is left.

These altitudes are cut out of the altitudes over a cell. From an interval that is left, a path can enter the intervals
over neighbouring cells that share an altitude with it; values are carried from one to another. It never enters another
one over the same cell, because a zone that covers the whole cell lies between them. Further kernels give the altitudes
that the cells leave to a track, place by place.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Int32s, Int64s
from gcsplan.planners.compiled import device, kernel
from gcsplan.planners.optimal.navmesh.mesh_kernels import NEXT
from gcsplan.planners.optimal.navmesh.polyanya import pop, push
from gcsplan.planners.optimal.navmesh.zone_kernels import (
    BOTTOM,
    LOOKS,
    ONE,
    OTHER,
    OWN_BOTTOM,
    OWN_TOP,
    PAIR,
    THIN,
    TOP,
    UNDER,
    bulge,
    depth,
    level,
    lowest_and_highest,
    node,
    over_ground,
    own_ground,
    own_level,
    put,
)

ROUNDING = 1e-9
"""Part of a step between places by which a cell's range is widened at both ends."""


@kernel("f8[,] f8[,] f8[,] f8[,] f8[,] i4[,] b1 f8 f8 f8 i4[] i4[] f8[,] f8[,]")
def cut_intervals(
    ground: Floats, x: Floats, y: Floats, zones: Floats, edges: Floats, boxes: Int32s, exact: bool, reach: float,
    near: float, spare: float, number: Int32s, count: Int32s, low: Floats, high: Floats,
) -> None:  # fmt: skip
    """Cut away, from the ``count`` (K,) intervals of each of some cells, ``low`` to ``high`` (K, most), the altitudes
    that a zone certainly shuts over the whole cell, except for ``spare`` metres at its top and bottom.

    ``number`` (cells,): from 0 to K - 1 for those cells, -1 for others. An interval that would become two is left whole
    if ``low`` has no column left. ``exact``: whether the lattice's cells are the terrain model's own, or parts of them.
    Over other lattices, levels over ground are not known.
    """
    for z in range(len(zones)):
        if zones[z, PAIR] > 0.0 or (over_ground(zones, z) and not exact):
            continue
        for j in range(boxes[z, 2], boxes[z, 3] + 1):
            for i in range(boxes[z, 0], boxes[z, 1] + 1):
                k = number[j * (x.shape[1] - 1) + i]
                if k < 0 or count[k] == 0:
                    continue
                bottom, top = shut_over(ground, x, y, zones, edges, z, reach, near, j, i)
                if top - spare > bottom + spare:
                    count[k] = _cut(low, high, k, count[k], bottom + spare, top - spare)


@device
def _cut(low: Floats, high: Floats, cell: int, count: int, bottom: float, top: float) -> int:
    """Cut the altitudes from ``bottom`` to ``top`` out of a cell's intervals; return how many intervals there are."""
    most, n = low.shape[1], 0
    while n < count:
        if low[cell, n] > bottom and high[cell, n] < top:  # nothing of it remains: the last one takes its place
            count -= 1
            low[cell, n], high[cell, n] = low[cell, count], high[cell, count]
            continue
        if low[cell, n] > bottom:
            low[cell, n] = max(low[cell, n], top)
        elif high[cell, n] < top:
            high[cell, n] = min(high[cell, n], bottom)
        elif count < most:
            low[cell, count], high[cell, count] = top, high[cell, n]
            high[cell, n] = bottom
            count += 1
        n += 1
    return count


@kernel("i8[] i8[] i8 f8[] f8[] f8[] f8[] i8[] f8 f8[] f8[] i4[] i8[]")
def spread(
    first: Int64s, cell: Int64s, cols: int, low: Floats, high: Floats, own: Floats, most: Floats,
    sources: Int64s, begin: float, out: Floats, keys: Floats, ids: Int32s, stack: Int64s,
) -> None:  # fmt: skip
    """Compute the least value in each interval (``out``) of a quantity that never falls along a path.

    It begins as ``begin`` in the intervals ``sources``, is at least ``own`` (N,) in an interval, and must be at most
    ``most`` (N,) to enter one. ``first`` (cells + 1,): each cell's first interval; ``cell`` (N,): each interval's cell;
    ``cols``: cells in a row; ``low``, ``high`` (N,): altitudes. ``out`` (N,), infinite before, stays so where no path
    leads. ``keys``, ``ids``, ``stack`` (N + 1,): work arrays.
    """
    rows = (len(first) - 1) // cols
    size = waiting = 0
    for k in range(len(sources)):
        s = sources[k]
        value = max(begin, own[s])
        if out[s] == np.inf and value <= most[s]:
            out[s] = value
            size = push(keys, ids, size, value, s)
    # Values are taken in rising order, so the first that reaches an interval is its least.
    while size > 0 or waiting > 0:
        if waiting > 0:
            waiting -= 1
            s = stack[waiting]
        else:
            s = ids[0]
            size = pop(keys, ids, size)
        value = out[s]
        j, i = cell[s] // cols, cell[s] % cols
        for q in range(max(j - 1, 0), min(j + 1, rows - 1) + 1):
            for t in range(first[q * cols + max(i - 1, 0)], first[q * cols + min(i + 1, cols - 1) + 1]):
                if out[t] < np.inf or low[t] > high[s] or high[t] < low[s] or cell[t] == cell[s]:
                    continue
                if own[t] <= value:
                    if value <= most[t]:
                        out[t] = value
                        stack[waiting] = t
                        waiting += 1
                elif own[t] <= most[t]:
                    out[t] = own[t]
                    size = push(keys, ids, size, own[t], t)


@kernel("f8[] f8[] f8[] f8[] f8 f8 f8 f8[,] f8[,]")
def range_along(
    low: Floats, high: Floats, away: Floats, left: Floats, limit: float, slack: float, step: float, lows: Floats,
    highs: Floats,
) -> None:  # fmt: skip
    """Compute the least of ``low`` (K,) and the greatest of ``high`` (K,) of the cells that a track may be in, at each
    of several places, 1 to ``size`` times ``step`` from its start: rows 0 of ``lows`` and ``highs`` (levels, size),
    which are inf and -inf before, and stay so at a place that no cell has.

    A track is in a cell no sooner than ``away`` - ``slack``, and no later than ``limit`` - ``left``. The first two to
    the power of ``levels`` must be more than ``size``.
    """
    levels, size = lows.shape
    # Each range of places is two overlapping blocks whose size is a power of two; then larger blocks pass their values
    # to smaller ones.
    for k in range(len(low)):
        if not (away[k] + left[k] < math.inf and low[k] <= high[k]):
            continue
        first = math.ceil(max((away[k] - slack) / step - ROUNDING, 1.0)) - 1
        last = math.floor(min((limit - left[k]) / step + ROUNDING, float(size)))
        if last <= first:
            continue
        level = 0
        while 2 << level <= last - first:
            level += 1
        second = last - (1 << level)
        lows[level, first], lows[level, second] = min(lows[level, first], low[k]), min(lows[level, second], low[k])
        highs[level, first] = max(highs[level, first], high[k])
        highs[level, second] = max(highs[level, second], high[k])
    for level in range(levels - 1, 0, -1):
        half = 1 << (level - 1)
        for k in range(size - 2 * half + 1):
            for i in (k, k + half):
                lows[level - 1, i] = min(lows[level - 1, i], lows[level, k])
                highs[level - 1, i] = max(highs[level - 1, i], highs[level, k])


@device
def _levels(
    ground: Floats, x: Floats, y: Floats, fineness: int, zones: Floats, edges: Floats, boxes: Int32s, z: int,
    reach: float, near: float, j: int, i: int, of: Floats, first: int, own: Int32s, own_at: Int64s, read: Int64s,
) -> bool:  # fmt: skip
    """Fill rows ``first`` to ``first`` + 2 of ``of`` with functions, given at the corners of a cell and linear between,
    of a zone: at a place where the third, how deep it lies in the zone, is above 0, the zone shuts all altitudes from
    the first to the second. Returns whether they are known. Other arguments: as in `own_ground`."""
    low_j, low_i, high_j, high_i = -1, -1, -1, -1
    looks = zones[z, LOOKS] > 0.0
    if looks:
        if not (boxes[z, 0] <= i <= boxes[z, 1] and boxes[z, 2] <= j <= boxes[z, 3]):
            return False
        low_j, low_i, high_j, high_i = own_ground(
            ground, x, y, fineness, zones, edges, boxes, z, reach, near, j, i, own, own_at, read
        )
    if low_j < 0 if looks else over_ground(zones, z):
        return False
    low_off = bulge(ground, fineness, low_j, low_i) if looks else 0.0
    high_off = bulge(ground, fineness, high_j, high_i) if looks else 0.0
    for k in range(4):
        v, u = k >> 1, (k ^ (k >> 1)) & 1
        low = node(ground, fineness, low_j + v, low_i + u) + low_off if looks else 0.0
        high = node(ground, fineness, high_j + v, high_i + u) - high_off if looks else 0.0
        of[first, k] = own_level(zones, z, OWN_BOTTOM, low) if zones[z, UNDER] > 0.0 else -np.inf
        of[first + 1, k] = own_level(zones, z, OWN_TOP, high)
        of[first + 2, k] = np.inf
        if not looks:
            of[first + 2, k] = depth(zones, edges, z, node(x, fineness, j + v, i + u), node(y, fineness, j + v, i + u))
        elif zones[z, UNDER] > 0.0:
            of[first + 2, k] = of[first + 1, k] - of[first, k] - zones[z, THIN]
    return True


@device
def _is_shut(of: Int32s, values: Floats, cell: int) -> bool:
    """Whether one of a cell's walls shuts all of it."""
    n = of[cell]
    while n > 0:
        if min(min(values[n - 1, 0], values[n - 1, 1]), min(values[n - 1, 2], values[n - 1, 3])) > 0.0:
            return True
        n = int(values[n - 1, NEXT])
    return False


@device
def _wall_of_two(of: Floats, one: int, other: int, floor: float, allowed: float, k: int) -> float:
    """How far a place is from having a free altitude, m, where a zone (its functions begin at row ``one`` of ``of``)
    lies below another and they shut all altitudes together: the least of what each must exceed."""
    wall = min(min(floor - of[one, k], of[one + 1, k] - of[other, k]), of[other + 1, k] - allowed)
    return float(min(wall, min(of[one + 2, k], of[other + 2, k])))


@kernel("i4[,] f8[,] f8[,] f8[,] f8[,] f8[,] i8 f8[,] f8[,] i4[,] f8 f8 f8[,] i4[,] i8[] i8[] i4[] f8[,] i8")
def stamp_beside(
    span: Int32s, excess: Floats, floor: Floats, ground: Floats, x: Floats, y: Floats, fineness: int, zones: Floats,
    edges: Floats, boxes: Int32s, reach: float, near: float, room: Floats, own: Int32s, own_at: Int64s, read: Int64s,
    of: Int32s, values: Floats, count: int,
) -> int:  # fmt: skip
    """Give walls to the cells that a zone's own ground shuts in part or whole, by itself or together with another zone,
    after the ``count`` walls of `zone_kernels.stamp_zones`; return how many there are then. ``ground``, ``x``, ``y``:
    as in `lowest_and_highest`; ``room`` (8, 4): a work array; ``own``, ``own_at``, ``read``: as in `own_ground`."""
    wall = values[len(values) - 1]
    for z in range(len(zones)):
        if zones[z, LOOKS] == 0.0:
            continue
        pair = zones[z, PAIR] > 0.0
        one, other = int(zones[z, ONE]) if pair else z, int(zones[z, OTHER]) if pair else z
        if zones[one, LOOKS] > zones[other, LOOKS]:
            one, other = other, one  # where the one that is read fast does not come, the other is not read
        for j in range(boxes[z, 2], boxes[z, 3] + 1):
            for i in range(max(boxes[z, 0], span[j, 0]), min(boxes[z, 1] + 1, span[j, 1])):
                cell = j * (excess.shape[1] - 1) + i
                shut = min(min(excess[j, i], excess[j, i + 1]), min(excess[j + 1, i], excess[j + 1, i + 1])) > 0.0
                if shut or _is_shut(of, values, cell):
                    continue
                if not _levels(
                    ground, x, y, fineness, zones, edges, boxes, one, reach, near, j, i, room, 0, own, own_at, read
                ):
                    continue
                if max(max(room[2, 0], room[2, 1]), max(room[2, 2], room[2, 3])) <= 0.0:
                    continue
                if pair and not _levels(
                    ground, x, y, fineness, zones, edges, boxes, other, reach, near, j, i, room, 3, own, own_at, read
                ):
                    continue
                most_upper = most_lower = -np.inf
                for k in range(4):
                    jj, ii = j + (k >> 1), i + ((k ^ (k >> 1)) & 1)
                    high = floor[jj, ii] - excess[jj, ii]
                    if pair:
                        room[6, k] = _wall_of_two(room, 0, 3, floor[jj, ii], high, k)
                        room[7, k] = _wall_of_two(room, 3, 0, floor[jj, ii], high, k)
                        most_upper, most_lower = max(most_upper, room[6, k]), max(most_lower, room[7, k])
                    else:
                        room[6, k] = min(min(room[1, k] - high, floor[jj, ii] - room[0, k]), room[2, k])
                for k in range(4):
                    wall[k] = room[7 if most_lower > most_upper else 6, k]
                count = put(of, values, cell, wall, count)
    return count


@device
def _shut_beside(
    ground: Floats, x: Floats, y: Floats, zones: Floats, edges: Floats, z: int, reach: float, near: float, j: int,
    i: int,
) -> tuple[float, float]:  # fmt: skip
    """The altitudes (bottom, top) that a zone's own ground within reach shuts everywhere over a cell; (inf, -inf) if
    none are known."""
    low_j, low_i, high_j, high_i, _ = lowest_and_highest(ground, x, y, 1, zones, edges, z, reach, near, j, i)
    if low_j < 0:
        return np.inf, -np.inf
    low, high = -np.inf, np.inf
    for k in range(4):
        v, u = k >> 1, k & 1
        low, high = max(low, ground[low_j + v, low_i + u]), min(high, ground[high_j + v, high_i + u])
    bottom, top = -np.inf, own_level(zones, z, OWN_TOP, high)
    if zones[z, UNDER] > 0.0:
        bottom = own_level(zones, z, OWN_BOTTOM, low)
    return (bottom, top) if top - bottom > zones[z, THIN] else (np.inf, -np.inf)


@device
def shut_over(
    ground: Floats, x: Floats, y: Floats, zones: Floats, edges: Floats, z: int, reach: float, near: float, j: int,
    i: int,
) -> tuple[float, float]:  # fmt: skip
    """The altitudes (bottom, top) that a zone shuts everywhere over a cell which lies wholly in it: below and above
    them, some place of the cell may be free. (inf, -inf), so nothing is shut, if it does not lie wholly in the zone, or
    that is not known."""
    if zones[z, LOOKS] > 0.0:
        bottom, top = _shut_beside(ground, x, y, zones, edges, z, reach, near, j, i)
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
