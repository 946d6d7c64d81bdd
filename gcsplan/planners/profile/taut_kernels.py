"""Kernels of the taut string and of the doors through which it is pulled."""

from __future__ import annotations

import numpy as np

from gcsplan.arrays import Floats, Int64s
from gcsplan.planners.compiled import kernel


@kernel("f8[] f8[] f8[] f8 f8 i8[,] f8[,]")
def draw(
    s: Floats,
    low: Floats,
    high: Floats,
    z0: float,
    z1: float,
    at: Int64s,
    chains: Floats,
) -> int:
    """Pull the string by the funnel algorithm; return its number of vertices.

    The funnel is the shortest paths to the high and the low edge of the latest door, from the apex where they part.
    ``at``, ``chains`` (3, n + 1): row 0 receives the door indices and altitudes of the string; row 1 holds the chain to
    the high edge (convex, hangs under ceilings), row 2 the chain to the low edge (concave, lies over floors).
    """
    n = len(s)
    # The string never leaves the range of altitudes that it must touch. Edges are clipped to it: no infinities below.
    top, bottom = max(z0, z1), min(z0, z1)
    for i in range(1, n - 1):
        top = max(top, low[i])
        bottom = min(bottom, high[i])
    out, over, under = at[0], at[1], at[2]
    out_z, over_z, under_z = chains[0], chains[1], chains[2]
    over[0] = under[0] = 0
    over_z[0] = under_z[0] = z0
    out[0], out_z[0], count = 0, z0, 1
    over_head = over_tail = under_head = under_tail = 0  # the head of both chains is the apex
    for i in range(1, n):
        if i == n - 1:
            up = down = z1
        else:
            up, down = min(high[i], top), max(low[i], bottom)
        # High edge: slopes must increase along its chain.
        t = over_tail
        while t > over_head and (over_z[t] - over_z[t - 1]) * (s[i] - s[over[t]]) >= (up - over_z[t]) * (
            s[over[t]] - s[over[t - 1]]
        ):
            t -= 1
        if t == over_head:
            # The straight line from the apex may pass below the low chain: the apex then moves along that chain.
            h = under_head
            while h < under_tail and (under_z[h + 1] - under_z[h]) * (s[i] - s[under[h]]) > (up - under_z[h]) * (
                s[under[h + 1]] - s[under[h]]
            ):
                h += 1
                out[count], out_z[count] = under[h], under_z[h]
                count += 1
            under_head = h
            t = over_head = 0
            over[0], over_z[0] = under[h], under_z[h]
        over_tail = t + 1
        over[over_tail], over_z[over_tail] = i, up
        # Low edge: slopes must decrease along its chain.
        t = under_tail
        while t > under_head and (under_z[t] - under_z[t - 1]) * (s[i] - s[under[t]]) <= (down - under_z[t]) * (
            s[under[t]] - s[under[t - 1]]
        ):
            t -= 1
        if t == under_head:
            h = over_head
            while h < over_tail and (over_z[h + 1] - over_z[h]) * (s[i] - s[over[h]]) < (down - over_z[h]) * (
                s[over[h + 1]] - s[over[h]]
            ):
                h += 1
                out[count], out_z[count] = over[h], over_z[h]
                count += 1
            over_head = h
            t = under_head = 0
            under[0], under_z[0] = over[h], over_z[h]
        under_tail = t + 1
        under[under_tail], under_z[under_tail] = i, down
    # Both chains now end at (s[-1], z1) and coincide beyond the apex.
    for k in range(over_head + 1, over_tail + 1):
        if over[k] != out[count - 1]:
            out[count], out_z[count] = over[k], over_z[k]
            count += 1
    return count


@kernel("f8[] f8[] f8[,] b1 f8[]")
def edge(
    s: Floats,
    at: Floats,
    value: Floats,
    highest: bool,
    out: Floats,
) -> None:
    """Write a piecewise-linear function at rising ``s`` to ``out``; at a jump its higher limit, or lower if not
    ``highest``. Piece k runs from ``at[k]`` to ``at[k + 1]``, with values ``value[k]`` at its two ends."""
    pieces = len(value)
    k = 0
    for i in range(len(s)):
        while k < pieces - 1 and at[k + 1] < s[i] - 1e-9:
            k += 1
        a, b = value[k, 0], value[k, 1]
        width = at[k + 1] - at[k]
        if s[i] >= at[k + 1] - 1e-9 or width <= 0.0:
            v = b
            if k < pieces - 1 and s[i] >= at[k + 1] - 1e-9:
                v = max(b, value[k + 1, 0]) if highest else min(b, value[k + 1, 0])
        elif s[i] <= at[k] + 1e-9 or a == b:
            v = a
        elif np.isinf(a) or np.isinf(b):
            v = max(a, b) if highest else min(a, b)
        else:
            v = a + (b - a) * (s[i] - at[k]) / width
        out[i] = v
