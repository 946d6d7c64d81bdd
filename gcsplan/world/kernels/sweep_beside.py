"""Kernels: the surface beside a short segment, within reach: branch and bound over pieces of cells; unknown ground."""

from __future__ import annotations

import math

from gcsplan.arrays import Floats, Int8s
from gcsplan.world.kernels.compiled import device
from gcsplan.world.kernels.shared import BEND, ERROR_M, RESOLUTION_M, TOUCH_M
from gcsplan.world.kernels.sweep import local_steps, segment_box, to_grid, within

MOST_WORKED = 1_000_000
"""Most pieces of one search; beyond it the demand counts as broken. Only hostile input reaches it."""

RESOLUTION = 0.1  # part of itself to which the depth of a break is resolved, if more than RESOLUTION_M
SPOKES = 16
FINEST_M = 1e-3
SPARE_CELLS = 1e-3  # how far from its cell a segment may end, by rounding


@device
def bar_above(depth: float) -> float:
    """The depth that a new break must exceed to count if one of ``depth`` is known: 5 mm or a tenth more."""
    return depth + max(RESOLUTION_M, RESOLUTION * depth) if depth > TOUCH_M else TOUCH_M


@device
def next_unknown(gaps: Int8s, i: int, j: int, most: int) -> int:
    """How many rows from row j the nearest unknown cell of column i is, up or down; more than ``most``: none is."""
    rows, cols = gaps.shape
    k = 0
    while 0 <= i < cols and k <= most:
        step = min(int(gaps[j - k, i]) if k <= j else 0, int(gaps[j + k, i]) if j + k < rows else 0)
        if step == 0:
            break
        k += step
    return k


@device
def unknown_near(
    m: Floats, z: Floats, gaps: Int8s, extrema_c: int, extrema_r: int, e0: float, n0: float, e1: float, n1: float,
    reach: float, i: int, j: int, known: float,
) -> tuple[float, float]:  # fmt: skip
    """Distance from a short segment in cell (i, j) to the nearest unknown patch, and where on the segment.

    Only patches up to ``extrema_c`` columns and ``extrema_r`` rows away are examined; ``known`` if none is nearer. With
    ``gaps`` only the nearest of each column is, above and below: the work grows with the reach, not with its square.
    """
    rows, cols = z.shape
    c0, r0 = to_grid(m, e0, n0)
    c1, r1 = to_grid(m, e1, n1)
    sx, sy = local_steps(m, e0, n0, e1, n1, reach)
    best, at = known, 0.0
    if len(gaps):
        for beside in range(2 * extrema_c + 1):
            away = (beside + 1) // 2
            if (away - 1 - SPARE_CELLS) * sx > best:
                break
            ii = i + away if beside & 1 else i - away
            k = next_unknown(gaps, ii, j, min(extrema_r, int(min(best / sy, extrema_r + 0.0)) + 2))
            if k > extrema_r:
                continue
            for jj in (j - k, j + k):
                if 0 <= ii < cols - 1 and 0 <= jj < rows - 1 and gaps[jj, ii] != 0:
                    continue
                dist, t = segment_box(
                    c0 * sx, r0 * sy, c1 * sx, r1 * sy, ii * sx, jj * sy, (ii + 1) * sx, (jj + 1) * sy
                )
                if dist < best:
                    best, at = dist, t
        return best, at
    for jj in range(j - extrema_r, j + extrema_r + 1):
        for ii in range(i - extrema_c, i + extrema_c + 1):
            if 0 <= ii < cols - 1 and 0 <= jj < rows - 1:
                total = z[jj, ii] + z[jj, ii + 1] + z[jj + 1, ii] + z[jj + 1, ii + 1]
                if not math.isnan(total):
                    continue
            dist, t = segment_box(c0 * sx, r0 * sy, c1 * sx, r1 * sy, ii * sx, jj * sy, (ii + 1) * sx, (jj + 1) * sy)
            if dist < best:
                best, at = dist, t
    return best, at


@device
def break_of_piece(
    u0: float, v0: float, u1: float, v1: float, za: float, kb: float, kc: float, kd: float, ax: float, ay: float,
    dx: float, dy: float, sx: float, sy: float, r: float, w0: float, dw: float, need: float, bar: float,
) -> tuple[float, float, float]:  # fmt: skip
    """An upper bound of the break of a demand by a piece of a cell, where on the segment, and how far the heights of
    the piece's corners differ; -inf first if the bound does not exceed ``bar`` or the piece is not within reach.

    The piece is ``u0`` to ``u1`` and ``v0`` to ``v1`` of a cell with sides ``sx``, ``sy`` and height
    ``za + kb·u + kc·v + kd·u·v``; the segment leads from (``ax``, ``ay``), m from the cell's first corner, by (``dx``,
    ``dy``), with heights ``w0`` to ``w0 + dw``. The bound is the lower of two. One comes from the highest corner; the
    other from the plane that is tangent at the piece's middle, raised by the piece's bulge above it, which within ``r``
    of a place is higher by at most ``r`` times its slope. The second is nearly exact for small pieces.
    """
    p, q = za + kb * u0 + kc * v0 + kd * u0 * v0, za + kb * u1 + kc * v0 + kd * u1 * v0
    s, t = za + kb * u0 + kc * v1 + kd * u0 * v1, za + kb * u1 + kc * v1 + kd * u1 * v1
    high = max(max(p, q), max(s, t))
    if not high + need - min(w0, w0 + dw) > bar:
        return -math.inf, 0.0, 0.0
    first, last = within(ax, ay, dx, dy, u0 * sx, v0 * sy, u1 * sx, v1 * sy, r)
    if first > last:
        return -math.inf, 0.0, 0.0
    at = first if dw > 0.0 else last
    bound = high + need - (w0 + at * dw)
    u, v = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
    gx, gy = (kb + kd * v) / sx, (kc + kd * u) / sy
    plane = za + kb * u + kc * v + kd * u * v + 0.25 * abs(kd) * (u1 - u0) * (v1 - v0)
    plane += r * math.sqrt(gx * gx + gy * gy) + gx * (ax - u * sx) + gy * (ay - v * sy) + need - w0
    per_t = gx * dx + gy * dy - dw
    worst = last if per_t > 0.0 else first
    if plane + worst * per_t < bound:
        bound, at = plane + worst * per_t, worst
    if not bound > bar:
        return -math.inf, 0.0, 0.0
    return bound, at, high - min(min(p, q), min(s, t))


@device
def deepest(
    m: Floats, z: Floats, sign: float, e0: float, n0: float, h0: float, e1: float, n1: float, h1: float, need: float,
    reach: float, best: float, stack: Floats, full: bool,
) -> tuple[float, float, int]:  # fmt: skip
    """Worst break of the demand along a short segment: its depth and where on the segment (< 0: none worse).

    ``best`` is the depth already known. With ``full`` the worst is resolved to 5 mm or a tenth, else the first break
    ends the search. Unknown cells are skipped: they are judged elsewhere. The third value is the number of pieces cut.
    """
    rows, cols = z.shape
    length = math.hypot(e1 - e0, n1 - n0)
    r = reach + m[BEND] * length * length / 8.0 + m[ERROR_M]
    c0, r0 = to_grid(m, e0, n0)
    c1, r1 = to_grid(m, e1, n1)
    sx, sy = local_steps(m, e0, n0, e1, n1, r)
    x0, y0 = c0 * sx, r0 * sy
    dx, dy = c1 * sx - x0, r1 * sy - y0
    w0, dw = sign * h0, sign * (h1 - h0)
    flat = math.hypot(dx, dy)
    rise = abs(dw) / flat if flat > 0.0 else 0.0
    lowest = min(w0, w0 + dw)
    i0 = max(int(math.floor(min(c0, c1) - r / sx)), 0)
    i1 = min(int(math.floor(max(c0, c1) + r / sx)), cols - 2)
    j0 = max(int(math.floor(min(r0, r1) - r / sy)), 0)
    j1 = min(int(math.floor(max(r0, r1) + r / sy)), rows - 2)
    found, at = best, -1.0
    worked = 0
    for j in range(j0, j1 + 1):
        for i in range(i0, i1 + 1):
            za, zb, zc, zd = sign * z[j, i], sign * z[j, i + 1], sign * z[j + 1, i], sign * z[j + 1, i + 1]
            high = max(max(za, zb), max(zc, zd))
            bar = bar_above(found)
            if not (high + need - lowest > bar) or math.isnan(za + zb + zc + zd):
                continue
            kb, kc, kd = zb - za, zc - za, za - zb - zc + zd
            # The whole cell is processed like its pieces, as the only child without a parent.
            u0, v0, um, vm, u1, v1, ul, vl = 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0
            children, size = 1, 0
            while children:
                before = size
                for _ in range(children):
                    bound, tl, spread = break_of_piece(
                        u0, v0, um, vm, za, kb, kc, kd, x0 - i * sx, y0 - j * sy, dx, dy, sx, sy, r, w0, dw, need, bar
                    )
                    if bound > bar:
                        stack[size, 0], stack[size, 1], stack[size, 2], stack[size, 3] = u0, v0, um, vm
                        stack[size, 4], stack[size, 5], stack[size, 6] = bound, tl, spread
                        size += 1
                    u0, v0, um, vm = ul, vl, u1, v1
                # The deeper half is searched first.
                if size == before + 2 and stack[before, 4] > stack[before + 1, 4]:
                    for k in range(7):
                        stack[before, k], stack[before + 1, k] = stack[before + 1, k], stack[before, k]
                children = 0
                while size and not children:
                    size -= 1
                    bound = stack[size, 4]
                    bar = bar_above(found)
                    if not bound > bar:
                        continue
                    worked += 1
                    u0, v0, u1, v1 = stack[size, 0], stack[size, 1], stack[size, 2], stack[size, 3]
                    wide, tall = (u1 - u0) * sx, (v1 - v0) * sy
                    across = math.hypot(wide, tall)
                    fine = max(RESOLUTION_M, RESOLUTION * found)
                    if stack[size, 6] + rise * across <= fine or across <= FINEST_M or worked > MOST_WORKED:
                        found, at = bound, stack[size, 5]
                        if not full or worked > MOST_WORKED:
                            return found, at, worked
                        continue
                    um = 0.5 * (u0 + u1) if wide >= tall else u1
                    vm = v1 if wide >= tall else 0.5 * (v0 + v1)
                    ul, vl = (um, v0) if wide >= tall else (u0, vm)
                    children = 2
    return found, at, worked


@device
def beside_point(m: Floats, z: Floats, sign: float, e: float, n: float, h: float, need: float, reach: float) -> float:
    """Deepest break at `SPOKES` places around a point, ``reach`` away from it; -inf if all of them are unknown."""
    rows, cols = z.shape
    c, r = to_grid(m, e, n)
    sx, sy = local_steps(m, e, n, e, n, reach)
    deepest_here = -math.inf
    for k in range(SPOKES):
        turn = 2.0 * math.pi * k / SPOKES
        qc, qr = c + reach * math.cos(turn) / sx, r + reach * math.sin(turn) / sy
        if 0.0 <= qc < cols - 1 and 0.0 <= qr < rows - 1:
            i, j = int(qc), int(qr)
            za = z[j, i]
            kb, kc = z[j, i + 1] - za, z[j + 1, i] - za
            u, v = qc - i, qr - j
            depth = need - sign * (h - (za + kb * u + kc * v + (z[j + 1, i + 1] - za - kb - kc) * u * v))
            if depth > deepest_here:
                deepest_here = depth
    return deepest_here
