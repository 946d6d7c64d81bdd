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
def lay_leg(legs: Floats, at: int, flat: float, slope_count: int, slant: Floats, loss: Floats, spec: Floats) -> None:
    """Set row ``at`` of ``legs``: the planes of a leg between sections ``flat`` metres apart that gets aside by so many
    steps, and the cost of its level metres."""
    step = spec[STEP]
    off = at * step
    run = math.sqrt(flat * flat + off * off)
    longer = step * (off + step) / math.sqrt(flat * flat + (off + step) * (off + step))
    shorter = step * off / run
    for q in range(slope_count):
        up, down = loss[1, q] * shorter - loss[2, q] * run, loss[3, q] * shorter - loss[4, q] * run
        legs[at, q] = slant[q] * run - max(loss[0, q] * longer, up, down)
    legs[at, slope_count] = spec[LEVEL] * run


@device
def _highest(before: Floats, leg: Floats, slope: Floats, z: float, q: int, least: int) -> int:
    """The plane that is highest at altitude z, of those from ``least`` on: found uphill from q, for their heights there
    are concave in q. If they were not, another plane would be as true a bound."""
    at, begin = before[q] + leg[q] + slope[q] * z, q
    while q + 1 < len(slope):
        to = before[q + 1] + leg[q + 1] + slope[q + 1] * z
        if to <= at:
            break
        q, at = q + 1, to
    while least < q <= begin:
        to = before[q - 1] + leg[q - 1] + slope[q - 1] * z
        if to <= at:
            break
        q, at = q - 1, to
    return q


@device
def _raise_rest(value: Floats, near: Floats, slope: Floats, low: float, high: float, ends: Floats) -> None:
    """Lower the values (Q,) of a node to what all legs to it allow, and set the nodes before it.

    Of each leg only the planes from the highest at the floor to the highest at the ceiling counted. A plane that rises
    less may be raised to meet the first at the floor; one that rises more, to meet the last at the ceiling. ``ends``
    (4, Q): the least height of each plane as the first at the floor, and as the last at the ceiling; and whose.
    """
    for side in range(2):
        z, at, of = (low, NONE, -1.0) if side == 0 else (high, NONE, -1.0)
        for i in range(len(slope)):
            q = len(slope) - 1 - i if side == 0 else i
            if at < NONE and at - slope[q] * z < value[q]:
                value[q], near[q] = at - slope[q] * z, of
            if ends[side, q] < at:
                at, of = ends[side, q], ends[2 + side, q]


@kernel("i8[] f8[] i8[] f8[] f8[] f8[] f8[] f8[] f8[,] f8[] f8[] f8[,] f8[,] f8[,] f8[,]")
def cheapest_chains(
    first: Int64s, gap: Floats, place: Int64s, low: Floats, high: Floats, left: Floats, slope: Floats, slant: Floats,
    loss: Floats, spec: Floats, least: Floats, value: Floats, near: Floats, legs: Floats, ends: Floats,
) -> int:  # fmt: skip
    """Lower bounds of the cost of chains from the first node to each node, at every altitude; returns the legs counted.

    At node n and altitude z, a chain costs at least ``value[n, q] + slope[q] * z``, for each q; ``near[n, q]`` is the
    node before it of the chain that decides. A leg costs no less than each plane (docs/planner.md, "Sections"):
    ``slant[q]`` for a metre of track, ``slope[q]``, rising from q to q, for a metre of climb, less what rounding may
    make it dearer (``loss`` (5, Q): `Planes`). Sections k and k + 1 are ``gap[k]`` apart, node n is ``place[n]`` steps
    aside, and ``left[n]`` is the least cost from it on. The caller sets ``value`` at the first node. To work in:
    ``least`` (N,), ``ends`` (4, Q), and ``legs`` (D, Q + 1) for all that may get aside between two sections, in steps.
    """
    pairs = 0
    least[0] = fewest = 0.0
    for k in range(len(first) - 2):
        of0, of1, laid = first[k], first[k + 1], 0
        nearest, next_fewest = of0, math.inf
        a = b = 0
        for n in range(of1, first[k + 2]):
            value[n, :], near[n, :] = NONE, -1.0
            ends[:2, :] = NONE
            most = spec[MOST] - left[n]
            while nearest + 1 < of1 and abs(place[nearest + 1] - place[n]) <= abs(place[nearest] - place[n]):
                nearest += 1
            for side in range(2):
                m = nearest - side
                while of0 <= m < of1:
                    off = abs(place[m] - place[n])
                    while laid <= off:
                        lay_leg(legs, laid, gap[k], len(slope), slant, loss, spec)
                        laid += 1
                    level = legs[off, len(slope)]
                    if fewest + level > most:
                        break
                    if least[m] + level <= most:
                        pairs += 1
                        a = _highest(value[m], legs[off], slope, low[n], a, 0)
                        b = _highest(value[m], legs[off], slope, high[n], max(a, b), a)
                        for q in range(a, b + 1):
                            if value[m, q] + legs[off, q] < value[n, q]:
                                value[n, q], near[n, q] = value[m, q] + legs[off, q], m
                        at_low = value[m, a] + legs[off, a] + slope[a] * low[n]
                        at_high = value[m, b] + legs[off, b] + slope[b] * high[n]
                        if at_low < ends[0, a]:
                            ends[0, a], ends[2, a] = at_low, m
                        if at_high < ends[1, b]:
                            ends[1, b], ends[3, b] = at_high, m
                    m += 1 - 2 * side
            _raise_rest(value[n], near[n], slope, low[n], high[n], ends)
            least[n] = -math.inf
            for q in range(len(slope)):
                least[n] = max(least[n], value[n, q] + min(slope[q] * low[n], slope[q] * high[n]))
            if least[n] > most:
                value[n, :], least[n] = NONE, math.inf
            next_fewest = min(next_fewest, least[n])
        fewest = next_fewest
    return pairs
