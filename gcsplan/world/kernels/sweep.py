"""Functions shared by all kernels of the exact check: the map to the grid, and plane geometry.

In kernels a division by zero gives inf or NaN, as in numpy; NaN means unknown, so there is no fast math.
"""

from __future__ import annotations

import math

from gcsplan.arrays import Floats
from gcsplan.world.geometry.surface import DEGREE
from gcsplan.world.kernels.compiled import device
from gcsplan.world.kernels.shared import (
    AFFINE,
    BEND,
    CENTRE_E,
    CENTRE_N,
    HALF,
    HORNER,
    LINEAR,
    PER_UNIT,
    steps_of,
)


@device
def to_grid(m: Floats, e: float, n: float) -> tuple[float, float]:
    """Column and row of a point of the plane; NaN beyond the fitted square."""
    u = (e - m[CENTRE_E]) * m[PER_UNIT]
    v = (n - m[CENTRE_N]) * m[PER_UNIT]
    if m[AFFINE] != 0.0:
        col = m[LINEAR] + m[LINEAR + 2] * u + m[LINEAR + 4] * v
        return col, m[LINEAR + 1] + m[LINEAR + 3] * u + m[LINEAR + 5] * v
    if not (abs(u) <= m[HALF] and abs(v) <= m[HALF]):
        return math.nan, math.nan
    col, row = 0.0, 0.0
    at = HORNER
    for power in range(DEGREE + 1):
        a, b = m[at], m[at + 1]
        at += 2
        for _ in range(power):
            a = a * v + m[at]
            b = b * v + m[at + 1]
            at += 2
        col = col * u + a
        row = row * u + b
    return col, row


@device
def plane_per_cell(m: Floats, e: float, n: float) -> tuple[float, float, float, float]:
    """d(east, north)/d(col, row) at a point: a, b, c, d of [[a, b], [c, d]]."""
    u = (e - m[CENTRE_E]) * m[PER_UNIT]
    v = (n - m[CENTRE_N]) * m[PER_UNIT]
    cu, ru, cv, rv = 0.0, 0.0, 0.0, 0.0
    if m[AFFINE] != 0.0:
        cu, ru, cv, rv = m[LINEAR + 2], m[LINEAR + 3], m[LINEAR + 4], m[LINEAR + 5]
    else:
        col, row = 0.0, 0.0
        at = HORNER
        for power in range(DEGREE + 1):
            a, b, av, bv = m[at], m[at + 1], 0.0, 0.0
            at += 2
            for _ in range(power):
                av, bv = av * v + a, bv * v + b
                a, b = a * v + m[at], b * v + m[at + 1]
                at += 2
            cu, ru = cu * u + col, ru * u + row
            cv, rv = cv * u + av, rv * u + bv
            col, row = col * u + a, row * u + b
    k = 1.0 / ((cu * rv - cv * ru) * m[PER_UNIT])
    return rv * k, -cv * k, -ru * k, cu * k


@device
def parts_of(m: Floats, length: float, bow_m: float) -> tuple[int, float]:
    """Number of parts of a leg so that each part's bow is at most ``bow_m``, and that bow."""
    bow = m[BEND] * length * length / 8.0
    parts = 1
    if bow > bow_m:
        parts = int(math.ceil(math.sqrt(bow / bow_m)))
    return parts, bow / (parts * parts)


@device
def local_steps(m: Floats, e0: float, n0: float, e1: float, n1: float, around_m: float) -> tuple[float, float]:
    """Metres of a column and of a row, a lower bound within ``around_m`` of a segment."""
    a, b, c, d = plane_per_cell(m, 0.5 * (e0 + e1), 0.5 * (n0 + n1))
    sx, sy = steps_of(a, b, c, d)
    keep = 1.0 - 1.1 * m[BEND] * (0.5 * math.hypot(e1 - e0, n1 - n0) + around_m) - 1e-9
    return sx * keep, sy * keep


@device
def box_distance(px: float, py: float, x0: float, y0: float, x1: float, y1: float) -> float:
    """Distance of a point from an upright box; 0 inside."""
    dx = max(x0 - px, 0.0, px - x1)
    dy = max(y0 - py, 0.0, py - y1)
    return math.sqrt(dx * dx + dy * dy)


@device
def point_segment(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    """Distance of a point from a segment, and where on it (0 … 1)."""
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    t = 0.0
    if square > 0.0:
        t = min(max(((px - ax) * dx + (py - ay) * dy) / square, 0.0), 1.0)
    ex, ey = ax + t * dx - px, ay + t * dy - py
    return math.sqrt(ex * ex + ey * ey), t


@device
def slab(start: float, step: float, low: float, high: float, t0: float, t1: float) -> tuple[float, float]:
    """The part of [t0, t1] where start + t·step lies within [low, high]; empty if the first exceeds the second."""
    if step == 0.0:
        return (t0, t1) if low <= start <= high else (1.0, 0.0)
    a, b = (low - start) / step, (high - start) / step
    if a > b:
        a, b = b, a
    return max(t0, a), min(t1, b)


@device
def segment_box(
    ax: float, ay: float, bx: float, by: float, x0: float, y0: float, x1: float, y1: float
) -> tuple[float, float]:
    """Distance of a segment from an upright box, and where on the segment (0 … 1)."""
    t0, t1 = slab(ax, bx - ax, x0, x1, 0.0, 1.0)
    if t0 <= t1:
        t0, t1 = slab(ay, by - ay, y0, y1, t0, t1)
        if t0 <= t1:
            return 0.0, 0.5 * (t0 + t1)
    best, at = box_distance(ax, ay, x0, y0, x1, y1), 0.0
    d = box_distance(bx, by, x0, y0, x1, y1)
    if d < best:
        best, at = d, 1.0
    for k in range(4):
        d, t = point_segment(x0 if k & 1 else x1, y0 if k & 2 else y1, ax, ay, bx, by)
        if d < best:
            best, at = d, t
    return best, at


@device
def within(
    ax: float, ay: float, dx: float, dy: float, x0: float, y0: float, x1: float, y1: float, reach: float
) -> tuple[float, float]:
    """The part [t0, t1] of a segment that lies within ``reach`` of an upright box; t0 > t1 if none does.

    The box grown by a disc is the union of two boxes and four discs, and convex: the hull of the parts is exact.
    """
    t0, t1 = slab(ax, dx, x0 - reach, x1 + reach, 0.0, 1.0)
    if t0 <= t1:
        t0, t1 = slab(ay, dy, y0 - reach, y1 + reach, t0, t1)
    if t0 > t1:
        return 1.0, 0.0
    sx, sy, ex, ey = ax + t0 * dx, ay + t0 * dy, ax + t1 * dx, ay + t1 * dy
    if (x0 <= sx <= x1 or y0 <= sy <= y1) and (x0 <= ex <= x1 or y0 <= ey <= y1):
        return t0, t1
    low, high = 1.0, 0.0
    a, b = slab(ax, dx, x0, x1, t0, t1)
    if a <= b:
        low, high = min(low, a), max(high, b)
    a, b = slab(ay, dy, y0, y1, t0, t1)
    if a <= b:
        low, high = min(low, a), max(high, b)
    square = dx * dx + dy * dy
    for k in range(4):
        px, py = (x0 if k & 1 else x1) - ax, (y0 if k & 2 else y1) - ay
        if square <= 0.0:
            if px * px + py * py <= reach * reach:
                low, high = 0.0, 1.0
            continue
        middle = (px * dx + py * dy) / square
        gx, gy = middle * dx - px, middle * dy - py
        rest = reach * reach - gx * gx - gy * gy
        if rest >= 0.0:
            half = math.sqrt(rest / square)
            a, b = max(middle - half, t0), min(middle + half, t1)
            if a <= b:
                low, high = min(low, a), max(high, b)
    return low, high
