"""Kernels of the sections across a leg: floors and ceilings along them, and the cheapest chains of their nodes.

A section's nodes lie in one row of the arrays, from ``first[k]`` to ``first[k + 1]``, in the order of ``aside``.
"""

from __future__ import annotations

import math

from gcsplan.arrays import Floats, Int64s
from gcsplan.planners.compiled import device, kernel

STEP, LEVEL, MOST = range(3)
"""Indices of the numbers in `cheapest_chains`'s ``spec``: metres between nodes; the cost of a level metre; the greatest
sum of a chain that counts."""
NONE = 1e30
"""The value of a node that no chain reaches."""


@device
def _height(z: Floats, row: float, col: float) -> float:
    """Height of a surface at a place of its grid; beyond its border as on it."""
    rows, cols = z.shape
    r, c = min(max(row, 0.0), rows - 1.0), min(max(col, 0.0), cols - 1.0)
    j, i = min(int(r), rows - 2), min(int(c), cols - 2)
    v, u = r - j, c - i
    south = z[j, i] + u * (z[j, i + 1] - z[j, i])
    return float(south + v * (z[j + 1, i] + u * (z[j + 1, i + 1] - z[j + 1, i]) - south))


@device
def _next_line(a: float, b: float, t: float) -> float:
    """The next part of the way from ``a`` to ``b``, after ``t``, at which a grid line is met; 1 if there is none."""
    d = b - a
    if abs(d) < 1e-12:
        return 1.0
    at = a + t * d
    line = math.floor(at + 1e-9) + 1.0 if d > 0.0 else math.ceil(at - 1e-9) - 1.0
    return min((line - a) / d, 1.0)


@device
def _least(z: Floats, sign: float, r0: float, c0: float, r1: float, c1: float) -> float:
    """The least of ``sign`` times the heights between two places: exact, for between two grid lines heights are
    quadratic. NaN if one of them is not known."""
    begin = least = sign * _height(z, r0, c0)
    t = 0.0
    while t < 1.0:
        to = min(max(min(_next_line(r0, r1, t), _next_line(c0, c1, t)), t + 1e-9), 1.0)
        half = 0.5 * (t + to)
        middle = sign * _height(z, r0 + half * (r1 - r0), c0 + half * (c1 - c0))
        end = sign * _height(z, r0 + to * (r1 - r0), c0 + to * (c1 - c0))
        if math.isnan(begin) or math.isnan(middle) or math.isnan(end):
            return math.nan
        bend = 2.0 * (begin + end) - 4.0 * middle  # heights are begin + rise u + bend u², for u from 0 to 1
        rise = end - begin - bend
        least = min(least, end)
        if bend > 0.0 and -2.0 * bend < rise < 0.0:
            least = min(least, begin - 0.25 * rise * rise / bend)
        begin, t = end, to
    return least


@kernel("f8[,] f8 f8 f8 i8[] f8[] f8[] f8[,] f8[]")
def lay_sections(
    z: Floats, sign: float, more: float, least: float, first: Int64s, row: Floats, col: Floats, beside: Floats,
    out: Floats,
) -> bool:  # fmt: skip
    """The least floor at any place between a node's two neighbours, for each node; of a node alone, the floor at it.

    The floor at a place is ``more`` above ``least``, and above ``sign`` times the heights at the places ``beside``
    (J, 2: rows and columns from it). With ``sign`` -1 it is a ceiling, upside down. Returns False if a height that
    counts is not known.
    """
    for k in range(len(first) - 1):
        begin, end = first[k], first[k + 1]
        before = math.inf
        for n in range(begin, end):
            here = math.inf
            if n + 1 < end or end - begin == 1:
                here = least
                to = min(n + 1, end - 1)
                for j in range(len(beside)):
                    r, c = beside[j, 0], beside[j, 1]
                    height = _least(z, sign, row[n] + r, col[n] + c, row[to] + r, col[to] + c)
                    if math.isnan(height):
                        return False
                    here = max(here, height)
            out[n] = more + min(here, before)
            before = here
    return True


@device
def _take_leg(
    value: Floats, near: Floats, m: int, n: int, run: float, turn: float, low: float, high: float, slope: Floats,
    slant: Floats, beyond: Floats,
) -> None:  # fmt: skip
    """Lower the values of node n to what a leg of ``run`` metres from node m allows.

    The highest plane at the floor stays above a plane that rises less, so that one may be raised to meet it there; and
    one that rises more, to meet the highest at the ceiling.
    """
    at_low = at_high = -math.inf
    low_cut = high_cut = 0
    for q in range(len(slope)):
        plane = value[q, m] + slant[q] * run - beyond[q] * turn
        here, there = plane + slope[q] * low, plane + slope[q] * high
        if here >= at_low:
            at_low, low_cut = here, q
        if there > at_high:
            at_high, high_cut = there, q
    for q in range(len(slope)):
        if q < low_cut:
            cost = at_low - slope[q] * low
        elif q > high_cut:
            cost = at_high - slope[q] * high
        else:
            cost = value[q, m] + slant[q] * run - beyond[q] * turn
        if cost < value[q, n]:
            value[q, n], near[q, n] = cost, m


@kernel("i8[] f8[] f8[] f8[] f8[] f8[] f8[] f8[] f8[] f8[] f8[] f8[,] f8[,]")
def cheapest_chains(
    first: Int64s, gap: Floats, aside: Floats, low: Floats, high: Floats, left: Floats, slope: Floats, slant: Floats,
    beyond: Floats, spec: Floats, least: Floats, value: Floats, near: Floats,
) -> int:  # fmt: skip
    """Lower bounds of the cost of chains from the first node to each node, at every altitude; returns the legs counted.

    At node n and altitude z, a chain costs at least ``value[q, n] + slope[q] * z``, for each q; ``near[q, n]`` is the
    node before it of the chain that decides. A leg costs no less than each plane (docs/planner.md, "Sections"):
    ``slant[q]`` for a metre of track, ``slope[q]``, rising from q to q, for a metre of climb, less ``beyond[q]`` for
    each metre of track that rounding may take. Sections k and k + 1 are ``gap[k]`` apart, and the goal is ``left`` (N,)
    metres away. The caller sets ``value`` at the first node. ``least`` (N,): to work in.
    """
    pairs, step, level = 0, spec[STEP], spec[LEVEL]
    least[0] = fewest = 0.0
    for k in range(len(first) - 2):
        of0, of1, flat = first[k], first[k + 1], gap[k]
        nearest, next_fewest = of0, math.inf
        for n in range(of1, first[k + 2]):
            value[:, n], near[:, n] = NONE, -1.0
            most = spec[MOST] - level * left[n]
            while nearest + 1 < of1 and abs(aside[nearest + 1] - aside[n]) <= abs(aside[nearest] - aside[n]):
                nearest += 1
            for side in range(2):
                m = nearest - side
                while of0 <= m < of1:
                    off = abs(aside[m] - aside[n])
                    run = math.sqrt(flat * flat + off * off)
                    if fewest + level * run > most:
                        break
                    if least[m] + level * run <= most:
                        pairs += 1
                        turn = step * (off + step) / math.sqrt(flat * flat + (off + step) * (off + step))
                        q = 0
                        while q < len(slope) and value[q, m] + slant[q] * run - beyond[q] * turn >= value[q, n]:
                            q += 1
                        if q < len(slope):
                            _take_leg(value, near, m, n, run, turn, low[n], high[n], slope, slant, beyond)
                    m += 1 - 2 * side
            least[n] = -math.inf
            for q in range(len(slope)):
                least[n] = max(least[n], value[q, n] + min(slope[q] * low[n], slope[q] * high[n]))
            if least[n] > most:
                value[:, n], least[n] = NONE, math.inf
            next_fewest = min(next_fewest, least[n])
        fewest = next_fewest
    return pairs
