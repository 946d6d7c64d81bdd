"""Altitude intervals: what zones leave of the altitudes over a cell; and what is carried from one to another.

From an interval a path gets to those over the cells around that hold an altitude of its own; never to another over the
same cell, for a zone that covers all of it is between them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.planners.compiled import device, kernel
from gcsplan.planners.optimal.navmesh.polyanya_nodes import pop, push
from gcsplan.planners.optimal.navmesh.zone_kernels import PAIR, over_ground, shut_over

Ints = NDArray[np.int32]


@kernel("f8[,] f8[,] f8[,] f8[,] f8[,] i4[,] b1 f8 i4[] f8[,] f8[,]")
def cut_intervals(
    ground: Floats, x: Floats, y: Floats, zones: Floats, edges: Floats, boxes: Ints, exact: bool, spare: float,
    count: Ints, low: Floats, high: Floats,
) -> None:  # fmt: skip
    """Cut the intervals of each cell, ``count`` (cells,) of them from ``low`` to ``high`` (cells, most), by what is
    shut for certain over all of it, but for ``spare`` at either side of a zone.

    One that would be cut in two where there is room for no more is left as it is. ``exact``: as in `narrow_ranges`.
    """
    for z in range(len(zones)):
        if zones[z, PAIR] > 0.0 or (over_ground(zones, z) and not exact):
            continue
        for j in range(boxes[z, 2], boxes[z, 3] + 1):
            for i in range(boxes[z, 0], boxes[z, 1] + 1):
                cell = j * (x.shape[1] - 1) + i
                if count[cell] == 0:
                    continue
                bottom, top = shut_over(ground, x, y, zones, edges, z, j, i)
                if top - spare > bottom + spare:
                    count[cell] = _cut(low, high, cell, count[cell], bottom + spare, top - spare)


@device
def _cut(low: Floats, high: Floats, cell: int, count: int, bottom: float, top: float) -> int:
    """Take what is between two altitudes out of a cell's intervals; returns how many are left."""
    most, n = low.shape[1], 0
    while n < count:
        if low[cell, n] > bottom and high[cell, n] < top:  # nothing is left of it: the last one takes its place
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
    first: NDArray[np.int64], cell: NDArray[np.int64], cols: int, low: Floats, high: Floats, own: Floats, most: Floats,
    sources: NDArray[np.int64], begin: float, out: Floats, keys: Floats, ids: Ints, stack: NDArray[np.int64],
) -> None:  # fmt: skip
    """The least that something can be in each interval which begins as ``begin``, and on its way only grows.

    ``first`` (cells + 1,) of each cell's intervals, ``cell`` (N,) theirs, ``cols`` cells in a row. ``own`` (N,): it is
    that at least in an interval; ``most`` (N,): no interval is entered with more. ``out`` (N,), infinite before, stays
    so where nothing gets to. ``keys``, ``ids``, ``stack`` (N + 1,): room to work in.
    """
    rows = (len(first) - 1) // cols
    size = waiting = 0
    for k in range(len(sources)):
        s = sources[k]
        value = max(begin, own[s])
        if out[s] == np.inf and value <= most[s]:
            out[s] = value
            size = push(keys, ids, size, value, s)
    # Values leave in order, so the first that gets to an interval is the least.
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
