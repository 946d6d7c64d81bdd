"""Kernels for altitude intervals: cut them out of the altitudes over a cell, and carry values from one to another; and
for the altitudes that the cells leave to a track, place by place.

From an interval a path can enter those intervals over the neighbouring cells that share an altitude with it. It never
enters another one over the same cell, because a zone that covers the whole cell lies between them.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Int32s, Int64s
from gcsplan.planners.compiled import device, kernel
from gcsplan.planners.optimal.navmesh.polyanya_nodes import pop, push
from gcsplan.planners.optimal.navmesh.shut_kernels import over_ground, shut_over
from gcsplan.planners.optimal.navmesh.zone_kernels import PAIR

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
