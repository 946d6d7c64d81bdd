"""Kernels of the sections across a leg: floors and ceilings along them, and the cheapest chains of their nodes.

A section's nodes lie in one row of the arrays, from ``first[k]`` to ``first[k + 1]``.
"""

from __future__ import annotations

import math

from gcsplan.arrays import Bools, Floats, Int32s, Int64s
from gcsplan.planners.compiled import device, kernel

STEP, MOST, BENT, SLANT, SWAY, BACK = range(6)
"""Indices of the numbers in `cheapest_chain`'s ``spec``: metres between nodes; most metres of track; the greatest price
at which costs are lengths in space; the greatest ``slant``; by how much that changes with the price, at most; whether
the sums are of the legs to each node (0) or from it."""


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
def _sag(z: Floats, sign: float, r0: float, c0: float, r1: float, c1: float, z0: float, z1: float) -> float:
    """The most by which the straight line from ``z0`` to ``z1`` exceeds ``sign`` times the heights between two places:
    exact, for between two grid lines heights are quadratic. NaN if one of them is not known."""
    most, t = -math.inf, 0.0
    begin = sign * _height(z, r0, c0)
    while t < 1.0:
        to = min(max(min(_next_line(r0, r1, t), _next_line(c0, c1, t)), t + 1e-9), 1.0)
        half = 0.5 * (t + to)
        middle = sign * _height(z, r0 + half * (r1 - r0), c0 + half * (c1 - c0))
        end = sign * _height(z, r0 + to * (r1 - r0), c0 + to * (c1 - c0))
        if math.isnan(middle) or math.isnan(end):
            return math.nan
        bend = 2.0 * (begin + end) - 4.0 * middle  # heights are begin + rise u + bend u², for u from 0 to 1
        rise = end - begin - bend
        line, its_rise = z0 + t * (z1 - z0), (to - t) * (z1 - z0)
        most = max(most, line - begin, line + its_rise - end)
        if bend > 0.0:
            u = (its_rise - rise) / (2.0 * bend)
            if 0.0 < u < 1.0:
                most = max(most, line + u * its_rise - begin - rise * u - bend * u * u)
        begin, t = end, to
    return most


@kernel("f8[,] f8 f8 f8 i8[] f8[] f8[] f8[,] f8[]")
def lay_sections(
    z: Floats, sign: float, more: float, least: float, first: Int64s, row: Floats, col: Floats, beside: Floats,
    out: Floats,
) -> bool:  # fmt: skip
    """Values at the nodes, such that the straight line from node to node is nowhere above the floor.

    The floor at a place is ``more`` above ``least``, and above ``sign`` times the heights at the places ``beside``
    (J, 2: rows and columns from it). With ``sign`` -1 it is a ceiling, upside down. Returns False if a height that
    counts is not known.
    """
    for k in range(len(first) - 1):
        begin, end = first[k], first[k + 1]
        for n in range(begin, end):
            value = least
            for j in range(len(beside)):
                height = sign * _height(z, row[n] + beside[j, 0], col[n] + beside[j, 1])
                if math.isnan(height):
                    return False
                value = max(value, height)
            out[n] = value
        before = 0.0
        for n in range(begin, end):
            sag = 0.0
            if n + 1 < end:
                sag = max(out[n], out[n + 1]) - least
                for j in range(len(beside)):
                    r, c = beside[j, 0], beside[j, 1]
                    here = _sag(z, sign, row[n] + r, col[n] + c, row[n + 1] + r, col[n + 1] + c, out[n], out[n + 1])
                    if math.isnan(here):
                        return False
                    sag = min(sag, max(here, 0.0))
            out[n] += more - max(sag, before)
            before = sag
    return True


@device
def _run(x: Floats, y: Floats, i: int, j: int) -> float:
    dx, dy = x[j] - x[i], y[j] - y[i]
    return math.sqrt(dx * dx + dy * dy)


@kernel("i8[] f8[] f8[] f8[] f8[] b1[] f8[] f8[] f8[] f8[] f8[] f8[] f8[] f8[] f8[] i4[]")
def cheapest_chain(
    first: Int64s, x: Floats, y: Floats, low: Floats, high: Floats, shut: Bools, loose: Floats, price: Floats,
    slant: Floats, vary: Floats, away: Floats, left: Floats, spec: Floats, room: Floats, value: Floats, near: Int32s,
) -> None:  # fmt: skip
    """The least sum of the legs' costs up to each node (``value``), and the node before it (``near``; -1: none).

    A leg from node i costs ``slant[i]`` times its metres of track and ``price[i]`` times the metres that it rises. So
    a node's altitude counts with the difference of the prices before and after it: at its floor or its ceiling.
    ``value`` leaves out the price after the node. Each leg costs less by what rounding to nodes may add
    (docs/planner.md, "Sections"): altitudes change by up to ``loose``, and prices by ``vary``, from node to node.
    With ``spec[BACK]``, the sums are of the legs from each node to the last one. ``room``: a number for each node of a
    section.
    """
    back = spec[BACK] > 0.0
    sections = len(first) - 1
    square, sway = spec[STEP] * spec[STEP], spec[SWAY] * spec[STEP]
    for step in range(sections - 1):
        k = sections - 2 - step if back else step
        to0, to1 = (first[k], first[k + 1]) if back else (first[k + 1], first[k + 2])
        of0, of1 = (first[k + 1], first[k + 2]) if back else (first[k], first[k + 1])
        nearest = begin = end = of0
        for n in range(to0, to1):
            value[n], near[n] = math.inf, -1
            if shut[n]:
                continue
            # The other section's nodes are in order: from the nearest one, go both ways until it is too far. The nodes
            # near enough to one node are mostly near enough to the next one.
            while nearest + 1 < of1 and _run(x, y, nearest + 1, n) <= _run(x, y, nearest, n):
                nearest += 1
            while nearest > of0 and _run(x, y, nearest - 1, n) < _run(x, y, nearest, n):
                nearest -= 1
            rest = away[n] if back else left[n]
            most = spec[MOST] - rest
            begin, end = min(begin, nearest), max(end, nearest)
            while begin > of0 and _run(x, y, begin - 1, n) <= most:
                begin -= 1
            while begin < nearest and _run(x, y, begin, n) > most:
                begin += 1
            while end < of1 and _run(x, y, end, n) <= most:
                end += 1
            while end > nearest and _run(x, y, end - 1, n) > most:
                end -= 1
            # Rounding adds the more, the shorter the leg.
            each = 0.125 / max(_run(x, y, nearest, n) - spec[STEP], spec[STEP])
            flat = spec[SLANT] * square * each
            px, py, own, off, up, down = x[n], y[n], price[n], loose[n], low[n], high[n]
            u, v, its, sums = x[begin:end], y[begin:end], price[begin:end], value[begin:end]
            far, its_off = (left[begin:end], loose[begin:end]) if back else (away[begin:end], loose[begin:end])
            # Branches in this loop would take as long as all else.
            if back:
                lows, highs, a, swing = low[begin:end], high[begin:end], slant[n], 0.25 * vary[n]
                bends = abs(own) + vary[n] <= spec[BENT]
                for m in range(end - begin):
                    run = math.sqrt((u[m] - px) * (u[m] - px) + (v[m] - py) * (v[m] - py))
                    both, c = off + its_off[m], own - its[m]
                    less = flat + swing * (both + sway)
                    bent = (square + both * both) * each
                    less = min(less, bent) if bends else less
                    cost = sums[m] + a * run + min(c * lows[m], c * highs[m]) - less
                    room[m] = cost if run + far[m] <= most else math.inf
            else:
                its_slant, its_vary = slant[begin:end], vary[begin:end]
                for m in range(end - begin):
                    run = math.sqrt((u[m] - px) * (u[m] - px) + (v[m] - py) * (v[m] - py))
                    both, c = off + its_off[m], its[m] - own
                    less = flat + 0.25 * its_vary[m] * (both + sway)
                    bent = (square + both * both) * each
                    less = min(less, bent) if abs(its[m]) + its_vary[m] <= spec[BENT] else less
                    cost = sums[m] + its_slant[m] * run + min(c * up, c * down) - less
                    room[m] = cost if run + far[m] <= most else math.inf
            best, at = math.inf, -1
            for m in range(end - begin):
                if room[m] < best:
                    best, at = room[m], m
            if at >= 0:
                value[n], near[n] = best, begin + at
