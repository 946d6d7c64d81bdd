"""Kernels: bounds of a surface over and beside a track, and around points.

The height under a straight line is a quadratic in each cell. It is cut until a chord lies within `HEIGHT_CHORD_M`,
after the chord is raised by the quadratic's rise above it (or lowered by its dip below it). The surface beside the
line, within reach, is bounded by reach times the steepest slope there, or by the highest and lowest node, whichever is
tighter.
"""

from __future__ import annotations

import math

from gcsplan.arrays import Floats, Singles
from gcsplan.world.kernels.compiled import device
from gcsplan.world.kernels.shared import BOW_M, ERROR_M, MASK, SHIFT, STEP_X, STEP_Y, LocalExtrema
from gcsplan.world.kernels.sweep import parts_of, slab, to_grid
from gcsplan.world.kernels.sweep_beside import unknown_near
from gcsplan.world.kernels.sweep_terrain import BORDER_SPARE

HEIGHT_CHORD_M = 0.05
MOST_CUTS = 64  # most parts of the line in one cell
NEAR_UNKNOWN_M = 10.0  # pieces are cut to this beside unknown ground, so that little of the track is lost
MOST_EXAMINED = 16  # examined one by one for the slope beside a piece; if there are more, the local extrema bound them


@device
def steepest_in(
    m: Floats, z: Floats, slopes: Singles, i: int, j: int, c0: float, r0: float, c1: float, r1: float
) -> float:
    """Steepest slope of the known cells that meet a box of the grid around a place in cell (i, j)."""
    rows, cols = z.shape
    i0, i1, j0, j1 = math.floor(c0), math.floor(c1), math.floor(r0), math.floor(r1)
    if (i1 - i0 + 1) * (j1 - j0 + 1) > MOST_EXAMINED:
        return float(abs(slopes[i >> SHIFT, j, i & MASK]))
    square = 0.0
    for jj in range(max(j0, 0), min(j1, rows - 2) + 1):
        for ii in range(max(i0, 0), min(i1, cols - 2) + 1):
            za = z[jj, ii]
            kb, kc = z[jj, ii + 1] - za, z[jj + 1, ii] - za
            kd = za - z[jj, ii + 1] - z[jj + 1, ii] + z[jj + 1, ii + 1]
            if math.isnan(kb + kc + kd):
                continue
            u0, u1, v0, v1 = max(c0 - ii, 0.0), min(c1 - ii, 1.0), max(r0 - jj, 0.0), min(r1 - jj, 1.0)
            gx = max(abs(kb + kd * v0), abs(kb + kd * v1)) / m[STEP_X]
            gy = max(abs(kc + kd * u0), abs(kc + kd * u1)) / m[STEP_Y]
            square = max(square, gx * gx + gy * gy)
    return math.sqrt(square)


@device
def lift_beside(
    m: Floats, z: Floats, extrema: LocalExtrema, ea: float, na: float, eb: float, nb: float, c0: float, r0: float,
    c1: float, r1: float, i: int, j: int, reach: float,
) -> float:  # fmt: skip
    """How much higher than a short segment in cell (i, j) the surface may lie within ``reach``, m; NaN where unknown.

    The segment's ends are given in the plane, then in the grid.
    """
    slope = extrema.slope[i >> SHIFT, j, i & MASK]
    if slope == math.inf or slope == 0.0:
        return math.nan
    if slope < 0.0:
        d, _ = unknown_near(m, z, extrema.gaps, extrema.cols, extrema.rows, ea, na, eb, nb, reach, i, j, reach)
        if d < reach:
            return math.nan
    x, y = reach / m[STEP_X], reach / m[STEP_Y]
    return reach * steepest_in(
        m, z, extrema.slope, i, j, min(c0, c1) - x, min(r0, r1) - y, max(c0, c1) + x, max(r0, r1) + y
    )


@device
def put(
    rows: Floats, count: int, s: float, low0: float, low1: float, near0: float, near1: float, far0: float, far1: float
) -> int:
    """Add a piece that ends at ``s`` if it fits into ``rows``; return the new number of pieces."""
    if count < len(rows):
        rows[count, 0] = s
        rows[count, 1], rows[count, 2] = low0, low1
        rows[count, 3], rows[count, 4] = near0, near1
        rows[count, 5], rows[count, 6] = far0, far1
    return count + 1


@device
def put_unknown(rows: Floats, count: int, s: float) -> int:
    """Add a piece over unknown ground; return the new number of pieces."""
    return put(rows, count, s, math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)


@device
def pieces(
    m: Floats, ground: Floats, top: Floats, under: LocalExtrema, beside: LocalExtrema, beyond: LocalExtrema,
    track: Floats, low_m: float, near_m: float, far_m: float, rows: Floats,
) -> int:  # fmt: skip
    """Cut a track (N, 2) into pieces and bound the surface over each; return the number of pieces.

    Fill ``rows``, as many as fit: s at the end of the piece in metres along the track; lower bound of the ground within
    ``low_m`` at both ends; upper bound of the top within ``near_m``; the same within ``far_m``. Bounds are linear
    between; NaN where the ground within reach is unknown. ``under``, ``beside``, ``beyond``: local extrema of the
    ground and of the top for the three reaches, each made for its reach plus the bow.
    """
    count = 0
    s_start = 0.0
    high_r, high_c = ground.shape
    for leg in range(len(track) - 1):
        e0, n0, e1, n1 = track[leg, 0], track[leg, 1], track[leg + 1, 0], track[leg + 1, 1]
        length = math.hypot(e1 - e0, n1 - n0)
        if length == 0.0:
            continue
        parts, bow = parts_of(m, length, BOW_M)
        widen = bow + 2.0 * m[ERROR_M]
        cb, rb = to_grid(m, e0, n0)
        for part in range(parts):
            fa, fb = part / parts, (part + 1) / parts
            c0, r0 = cb, rb
            cb, rb = to_grid(m, e0 + (e1 - e0) * fb, n0 + (n1 - n0) * fb)
            dc, dr = cb - c0, rb - r0
            s0, run = s_start + fa * length, (fb - fa) * length
            t, end = slab(c0, dc, -BORDER_SPARE, high_c - 1.0 + BORDER_SPARE, 0.0, 1.0)
            t, end = slab(r0, dr, -BORDER_SPARE, high_r - 1.0 + BORDER_SPARE, t, end)
            if not (t <= end and math.isfinite(dc) and math.isfinite(dr)):
                count = put_unknown(rows, count, s0 + run)
                continue
            if t > 0.0:
                count = put_unknown(rows, count, s0 + t * run)
            at_c, at_r = c0 + t * dc, r0 + t * dr
            i = int(math.floor(at_c)) if dc >= 0.0 else int(math.ceil(at_c)) - 1
            j = int(math.floor(at_r)) if dr >= 0.0 else int(math.ceil(at_r)) - 1
            i, j = min(max(i, 0), high_c - 2), min(max(j, 0), high_r - 2)
            side_c, side_r = (1 if dc > 0.0 else 0), (1 if dr > 0.0 else 0)
            last = False
            while not last:
                ii, jj = i, j
                next_i, next_j = i + 2 * side_c - 1, j + 2 * side_r - 1
                tx = (i + side_c - c0) / dc if dc != 0.0 and 0 <= next_i <= high_c - 2 else math.inf
                ty = (j + side_r - r0) / dr if dr != 0.0 and 0 <= next_j <= high_r - 2 else math.inf
                tb = max(min(min(tx, ty), end), t)
                last = tb >= end
                if tx <= ty:
                    i = next_i
                if ty <= tx:
                    j = next_j
                if tb <= t:
                    continue
                ga, gb, gc = ground[jj, ii], ground[jj, ii + 1] - ground[jj, ii], ground[jj + 1, ii] - ground[jj, ii]
                gd = ground[jj + 1, ii + 1] - ground[jj, ii + 1] - gc
                ta, tu, tv = top[jj, ii], top[jj, ii + 1] - top[jj, ii], top[jj + 1, ii] - top[jj, ii]
                td = top[jj + 1, ii + 1] - top[jj, ii + 1] - tv
                if math.isnan(gb + gc + gd + tu + tv + td):
                    count = put_unknown(rows, count, s0 + tb * run)
                    t = tb
                    continue
                turn = dc * dr * (tb - t) * (tb - t)
                cuts = math.ceil(math.sqrt(0.25 * max(abs(gd * turn), abs(td * turn)) / HEIGHT_CHORD_M))
                strip, own = ii >> SHIFT, ii & MASK
                edge = under.slope[strip, jj, own] < 0.0 or beside.slope[strip, jj, own] < 0.0
                if edge or beyond.slope[strip, jj, own] < 0.0:
                    fa_, fb_ = fa + (fb - fa) * t, fa + (fb - fa) * tb
                    widest = widen + max(low_m, max(near_m, far_m))
                    d, _ = unknown_near(
                        m, top, beyond.gaps, beyond.cols, beyond.rows, e0 + (e1 - e0) * fa_, n0 + (n1 - n0) * fa_,
                        e0 + (e1 - e0) * fb_, n0 + (n1 - n0) * fb_, widest, ii, jj, widest,
                    )  # fmt: skip
                    if d < widest:
                        cuts = max(cuts, math.ceil((tb - t) * run / NEAR_UNKNOWN_M))
                cuts = min(max(cuts, 1), MOST_CUTS)
                g_bulge, t_bulge = 0.25 * gd * turn / (cuts * cuts), 0.25 * td * turn / (cuts * cuts)
                u, v = min(max(c0 + t * dc - ii, 0.0), 1.0), min(max(r0 + t * dr - jj, 0.0), 1.0)
                g0, t0 = ga + gb * u + gc * v + gd * u * v, ta + tu * u + tv * v + td * u * v
                for k in range(cuts):
                    pa, pb = t + (tb - t) * k / cuts, t + (tb - t) * (k + 1) / cuts
                    wa, wb = c0 + pb * dc, r0 + pb * dr
                    va, vb = c0 + pa * dc, r0 + pa * dr
                    u, v = min(max(wa - ii, 0.0), 1.0), min(max(wb - jj, 0.0), 1.0)
                    g1, t1 = ga + gb * u + gc * v + gd * u * v, ta + tu * u + tv * v + td * u * v
                    # A positive bulge of the quadratic lies below the chord, a negative one above it.
                    low0, low1 = g0 - max(g_bulge, 0.0), g1 - max(g_bulge, 0.0)
                    up0, up1 = t0 - min(t_bulge, 0.0), t1 - min(t_bulge, 0.0)
                    near0, near1, far0, far1 = up0, up1, up0, up1
                    g0, t0 = g1, t1
                    fa_, fb_ = fa + (fb - fa) * pa, fa + (fb - fa) * pb
                    ea, na, eb, nb = (
                        e0 + (e1 - e0) * fa_,
                        n0 + (n1 - n0) * fa_,
                        e0 + (e1 - e0) * fb_,
                        n0 + (n1 - n0) * fb_,
                    )
                    for which in range(3):
                        reach = widen + (low_m if which == 0 else (near_m if which == 1 else far_m))
                        if reach <= 0.0:
                            continue
                        z = ground if which == 0 else top
                        extrema = under if which == 0 else (beside if which == 1 else beyond)
                        lift = lift_beside(m, z, extrema, ea, na, eb, nb, va, vb, wa, wb, ii, jj, reach)
                        if which == 0:
                            bound = extrema.low[ii >> SHIFT, jj, ii & MASK]
                            whole = min(low0, low1) - lift < bound
                            low0, low1 = (bound, bound) if whole else (low0 - lift, low1 - lift)
                            continue
                        bound = extrema.high[ii >> SHIFT, jj, ii & MASK]
                        whole = max(up0, up1) + lift > bound
                        if which == 1:
                            near0, near1 = (bound, bound) if whole else (up0 + lift, up1 + lift)
                        else:
                            far0, far1 = (bound, bound) if whole else (up0 + lift, up1 + lift)
                    count = put(rows, count, s0 + pb * run, low0, low1, near0, near1, far0, far1)
                t = tb
            if end < 1.0:
                count = put_unknown(rows, count, s0 + run)
        s_start += length
    return count


@device
def around(
    m: Floats, z: Floats, extrema: LocalExtrema, sign: float, points: Floats, reach_m: float, out: Floats
) -> None:
    """Upper bound of ``sign·height`` within ``reach_m`` of each point (N, 2) of the plane; NaN where unknown.

    The tightest of three bounds: by the gradient at the point, if the disc lies in one cell; by the highest corner of
    the cells' parts in the disc's box; by the local extrema. ``out`` (N,).
    """
    rows, cols = z.shape
    for p in range(len(points)):
        out[p] = math.nan
        c, r = to_grid(m, points[p, 0], points[p, 1])
        if not (-BORDER_SPARE <= c <= cols - 1.0 + BORDER_SPARE and -BORDER_SPARE <= r <= rows - 1.0 + BORDER_SPARE):
            continue
        i, j = min(max(int(math.floor(c)), 0), cols - 2), min(max(int(math.floor(r)), 0), rows - 2)
        strip, own = i >> SHIFT, i & MASK
        slope = extrema.slope[strip, j, own]
        if slope == math.inf or slope == 0.0:
            continue
        u, v = min(max(c - i, 0.0), 1.0), min(max(r - j, 0.0), 1.0)
        za = sign * z[j, i]
        kb, kc = sign * z[j, i + 1] - za, sign * z[j + 1, i] - za
        kd = za - sign * z[j, i + 1] - sign * z[j + 1, i] + sign * z[j + 1, i + 1]
        h = za + kb * u + kc * v + kd * u * v
        if reach_m <= 0.0:
            out[p] = h
            continue
        if slope < 0.0:
            d, _ = unknown_near(
                m, z, extrema.gaps, extrema.cols, extrema.rows, points[p, 0], points[p, 1], points[p, 0], points[p, 1],
                reach_m, i, j, reach_m,
            )  # fmt: skip
            if d < reach_m:
                continue
            slope = -slope
        x, y = reach_m / m[STEP_X], reach_m / m[STEP_Y]
        best = min(h + reach_m * slope, extrema.high[strip, j, own] if sign > 0.0 else -extrema.low[strip, j, own])
        if x <= u <= 1.0 - x and y <= v <= 1.0 - y:
            gx, gy = (kb + kd * v) / m[STEP_X], (kc + kd * u) / m[STEP_Y]
            best = min(best, h + reach_m * math.sqrt(gx * gx + gy * gy) + 0.5 * abs(kd) * x * y)
        i0, i1 = max(int(math.floor(c - x)), 0), min(int(math.floor(c + x)), cols - 2)
        j0, j1 = max(int(math.floor(r - y)), 0), min(int(math.floor(r + y)), rows - 2)
        if (i1 - i0 + 1) * (j1 - j0 + 1) <= MOST_EXAMINED:
            most = -math.inf
            for jj in range(j0, j1 + 1):
                for ii in range(i0, i1 + 1):
                    za = sign * z[jj, ii]
                    kb, kc = sign * z[jj, ii + 1] - za, sign * z[jj + 1, ii] - za
                    kd = za - sign * z[jj, ii + 1] - sign * z[jj + 1, ii] + sign * z[jj + 1, ii + 1]
                    if math.isnan(kb + kc + kd):
                        continue
                    for k in range(4):
                        u = min(max(c - x - ii, 0.0), 1.0) if k & 1 else max(min(c + x - ii, 1.0), 0.0)
                        v = min(max(r - y - jj, 0.0), 1.0) if k & 2 else max(min(r + y - jj, 1.0), 0.0)
                        most = max(most, za + kb * u + kc * v + kd * u * v)
            best = min(best, most)
        out[p] = best
