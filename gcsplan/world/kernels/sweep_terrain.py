"""Kernels: a leg against a bilinear surface, exactly.

A demand is ``sign·(altitude − height(q)) >= need`` for every point q within ``reach`` of the leg's point, along the
whole leg: sign 1 for heights from below (min AGL, terrain clearance), −1 for the ground from above (max AGL).

Along a leg that is straight in the grid the height under it is a quadratic in each cell, so its extremes there have
closed forms. Points beside the line are judged in two tiers. The first is a bound: these points are higher than the
line's own ground by at most reach times the steepest slope within reach, and no higher than the highest node there. If
that bound breaks the demand, the second tier decides: branch and bound over pieces of cells, because a bilinear patch
has its extremes over an upright box at the box's corners.
"""

from __future__ import annotations

import math

from gcsplan.arrays import Floats, Int8s, Singles
from gcsplan.world.kernels.compiled import device
from gcsplan.world.kernels.shared import BEND, BOW_M, CUT, ERROR_M, MASK, SHIFT, TOUCH_M
from gcsplan.world.kernels.sweep import parts_of, slab, to_grid
from gcsplan.world.kernels.sweep_beside import bar_above, beside_point, deepest, unknown_near

BORDER_SPARE = 1e-9  # columns or rows by which a leg along the border may seem to lie beyond it
INSIDE = 1e-6  # columns or rows from the border within which `glance` leaves the leg to `sweep`
GROUP_M, GROUP_BOW_M = 500.0, 0.003  # longest stretch, m, and its bow, that the second tier judges at once

# Indices of `sweep`'s results in ``out``.
LOW, LOW_AT, DEPTH, DEPTH_AT, UNKNOWN, UNKNOWN_AT, STEEPEST, REACH = range(8)


@device
def least_in_cell(
    sign: float, kd: float, turn: float, before: float, after: float, t: float, tb: float
) -> tuple[float, float]:
    """Least of ``sign·(altitude − height)`` over the line in a cell, and where; ``turn`` is Δcol·Δrow over it.

    In the cell it is before + (after − before)·s + bulge·s·(1 − s), s from 0 to 1.
    """
    least, where = (before, t) if before <= after else (after, tb)
    bulge = sign * kd * turn
    if bulge < 0.0:
        s = 0.5 * (1.0 + (after - before) / bulge)
        if 0.0 < s < 1.0:
            value = before + (after - before) * s + bulge * s * (1.0 - s)
            if value < least:
                return value, t + s * (tb - t)
    return least, where


@device
def glance(
    m: Floats, z: Floats, slopes: Singles, sign: float, e0: float, n0: float, h0: float, e1: float, n1: float,
    h1: float, need: float, reach: float, full: bool, out: Floats,
) -> int:  # fmt: skip
    """The first tier alone, fast: 1 if the demand is surely kept, -1 if the line itself breaks it, 0 if unsure.

    With ``full`` the whole leg is examined; if the result is 1, ``out`` is then as `sweep` leaves it. Without ``full``
    the lowest in ``out`` is a lower bound. Near unknown ground and at the border the result is never 1.
    """
    rows, cols = z.shape
    parts, bow = parts_of(m, math.sqrt((e1 - e0) ** 2 + (n1 - n0) ** 2), BOW_M)
    r = reach + bow + m[ERROR_M]
    share = 1.0 / parts
    low, low_at, steepest = math.inf, 0.0, 0.0
    sure = 1
    cb, rb = to_grid(m, e0, n0)
    for part in range(parts):
        first = part * share
        c0, r0 = cb, rb
        if part == parts - 1:
            cb, rb = to_grid(m, e1, n1)
        else:
            cb, rb = to_grid(m, e0 + (e1 - e0) * (first + share), n0 + (n1 - n0) * (first + share))
        # Also false for NaN, where the map is not valid.
        far_c, far_r = cols - 1 - INSIDE, rows - 1 - INSIDE
        if not (INSIDE < c0 < far_c and INSIDE < cb < far_c and INSIDE < r0 < far_r and INSIDE < rb < far_r):
            return 0
        dc, dr = cb - c0, rb - r0
        i, j = int(c0), int(r0)
        side_c, side_r = (1 if dc > 0.0 else 0), (1 if dr > 0.0 else 0)
        per_c, per_r = 1.0 / dc, 1.0 / dr
        tx = (i + side_c - c0) * per_c if dc != 0.0 else math.inf
        ty = (j + side_r - r0) * per_r if dr != 0.0 else math.inf
        h = sign * (h0 + (h1 - h0) * first)
        rise = sign * (h1 - h0) * share
        u, v = c0 - i, r0 - j
        za = z[j, i]
        kb, kc = z[j, i + 1] - za, z[j + 1, i] - za
        agl = h - sign * (za + kb * u + kc * v + (z[j + 1, i + 1] - za - kb - kc) * u * v)
        t = 0.0
        while True:
            tb = min(min(tx, ty), 1.0)
            za = z[j, i]
            kb, kc = z[j, i + 1] - za, z[j + 1, i] - za
            kd = z[j + 1, i + 1] - za - kb - kc
            u, v = c0 + tb * dc - i, r0 + tb * dr - j
            after = h + tb * rise - sign * (za + kb * u + kc * v + kd * u * v)
            slope = slopes[i >> SHIFT, j, i & MASK]
            turn = dc * dr * (tb - t) * (tb - t)
            # The line dips below its lower end by at most a quarter of the bulge.
            least = min(agl, after) + min(0.25 * sign * kd * turn, 0.0)
            if not (0.0 < slope < math.inf and least - r * slope >= need):
                if not full:
                    return -1 if need - min(agl, after) > TOUCH_M else 0
                sure = 0
            steepest = max(steepest, slope)
            if full and least < low:
                least, where = least_in_cell(sign, kd, turn, agl, after, t, tb)
                low_at = first + where * share if least < low else low_at
            low = min(low, least)
            agl = after
            if tb >= 1.0:
                break
            t = tb
            if tx <= ty:
                i += 2 * side_c - 1
                tx = (i + side_c - c0) * per_c
            else:
                j += 2 * side_r - 1
                ty = (j + side_r - r0) * per_r
    out[LOW], out[LOW_AT], out[DEPTH], out[DEPTH_AT] = low, low_at, need - low, low_at
    out[UNKNOWN], out[UNKNOWN_AT], out[STEEPEST], out[REACH] = math.inf, 0.0, steepest, r
    return sure


@device
def sweep(
    m: Floats, z: Floats, slopes: Singles, extremes: Singles, gaps: Int8s, extrema_c: int, extrema_r: int, sign: float,
    e0: float, n0: float, h0: float, e1: float, n1: float, h1: float, need: float, reach: float, stack: Floats,
    full: bool, out: Floats,
) -> bool:  # fmt: skip
    """Judge one leg against one demand; return False at the first break found, unless ``full``.

    ``slopes``, ``extremes``, ``gaps``: local extrema, over ``extrema_c`` columns and ``extrema_r`` rows. ``out``:
    lowest ``sign·(altitude − height)`` on the line and where; depth of the worst break (more than `TOUCH_M` is one) and
    where; distance to the nearest unknown patch, searched within reach, and where; steepest slope within reach of the
    cells under the leg, ``inf`` if unknown patches are among them; the reach with the line's bow.
    """
    rows, cols = z.shape
    length = math.hypot(e1 - e0, n1 - n0)
    parts, bow = parts_of(m, length, BOW_M)
    r = reach + bow + m[ERROR_M]
    share = 1.0 / parts
    metres = length * share
    rise = (h1 - h0) * share
    longest = GROUP_M
    if m[BEND] * GROUP_M * GROUP_M > 8.0 * GROUP_BOW_M:
        longest = math.sqrt(8.0 * GROUP_BOW_M / m[BEND])
    out[LOW], out[LOW_AT], out[DEPTH], out[DEPTH_AT] = math.inf, 0.0, -math.inf, 0.0
    out[UNKNOWN], out[UNKNOWN_AT], out[STEEPEST], out[REACH] = math.inf, 0.0, 0.0, r
    cb, rb = to_grid(m, e0, n0)
    # The worst break on the line itself is found first, so that most of the search beside it can be skipped.
    pending = False
    for round_ in range(2 if full else 1):
        beside = r > 0.0 and (round_ == 1 or not full)
        if round_ == 1:
            if not pending:
                break
            if out[DEPTH] > TOUCH_M:
                t = out[DEPTH_AT]
                d = beside_point(m, z, sign, e0 + (e1 - e0) * t, n0 + (n1 - n0) * t, h0 + (h1 - h0) * t, need, r)
                out[DEPTH] = max(out[DEPTH], d)
            cb, rb = to_grid(m, e0, n0)
        for part in range(parts):
            first = part * share
            c0, r0 = cb, rb
            if part == parts - 1:
                cb, rb = to_grid(m, e1, n1)
            else:
                cb, rb = to_grid(m, e0 + (e1 - e0) * (first + share), n0 + (n1 - n0) * (first + share))
            dc, dr = cb - c0, rb - r0
            t, end = slab(c0, dc, -BORDER_SPARE, cols - 1.0 + BORDER_SPARE, 0.0, 1.0)
            t, end = slab(r0, dr, -BORDER_SPARE, rows - 1.0 + BORDER_SPARE, t, end)
            if not (t == 0.0 and end == 1.0 and math.isfinite(dc) and math.isfinite(dr)):
                out[UNKNOWN], out[UNKNOWN_AT] = 0.0, first if t > 0.0 else first + share
                out[STEEPEST] = math.inf
                if not full:
                    return False
                if not (t <= end and math.isfinite(dc) and math.isfinite(dr)):
                    continue
            h = h0 + (h1 - h0) * first
            at_c, at_r = c0 + t * dc, r0 + t * dr
            i = int(math.floor(at_c)) if dc >= 0.0 else int(math.ceil(at_c)) - 1
            j = int(math.floor(at_r)) if dr >= 0.0 else int(math.ceil(at_r)) - 1
            i, j = min(max(i, 0), cols - 2), min(max(j, 0), rows - 2)
            side_c, side_r = (1 if dc > 0.0 else 0), (1 if dr > 0.0 else 0)
            per_c, per_r = 1.0 / dc, 1.0 / dr
            agl = math.nan
            group, group_end = -1.0, -1.0
            last = False
            while not last:
                next_i, next_j = i + 2 * side_c - 1, j + 2 * side_r - 1
                tx = (i + side_c - c0) * per_c if dc != 0.0 and 0 <= next_i <= cols - 2 else math.inf
                ty = (j + side_r - r0) * per_r if dr != 0.0 and 0 <= next_j <= rows - 2 else math.inf
                tb = max(min(min(tx, ty), end), t)
                last = tb >= end
                za = z[j, i]
                kb, kc = z[j, i + 1] - za, z[j + 1, i] - za
                kd = z[j + 1, i + 1] - za - kb - kc
                slope = slopes[i >> SHIFT, j, i & MASK]
                failing = False
                if slope == math.inf or slope == 0.0:
                    agl = math.nan
                    if tb > t or end == t:
                        out[UNKNOWN], out[UNKNOWN_AT], out[STEEPEST] = 0.0, first + 0.5 * (t + tb) * share, math.inf
                        if not full:
                            return False
                else:
                    if math.isnan(agl):
                        u, v = min(max(c0 + t * dc - i, 0.0), 1.0), min(max(r0 + t * dr - j, 0.0), 1.0)
                        agl = sign * (h + t * rise - (za + kb * u + kc * v + kd * u * v))
                    u, v = min(max(c0 + tb * dc - i, 0.0), 1.0), min(max(r0 + tb * dr - j, 0.0), 1.0)
                    after = sign * (h + tb * rise - (za + kb * u + kc * v + kd * u * v))
                    least, where = least_in_cell(sign, kd, dc * dr * (tb - t) * (tb - t), agl, after, t, tb)
                    agl = after
                    if least < out[LOW]:
                        out[LOW], out[LOW_AT] = least, first + where * share
                        if need - least > out[DEPTH]:
                            out[DEPTH], out[DEPTH_AT] = need - least, first + where * share
                            if not full and need - least > TOUCH_M:
                                return False
                    if slope < 0.0:
                        slope = -slope
                        out[STEEPEST] = math.inf
                        if r > 0.0 and round_ == 0 and out[UNKNOWN] > 0.0:
                            ta, te = first + t * share, first + tb * share
                            d, s = unknown_near(
                                m, z, gaps, extrema_c, extrema_r, e0 + (e1 - e0) * ta, n0 + (n1 - n0) * ta,
                                e0 + (e1 - e0) * te, n0 + (n1 - n0) * te, r, i, j, out[UNKNOWN],
                            )  # fmt: skip
                            if d < out[UNKNOWN]:
                                out[UNKNOWN], out[UNKNOWN_AT] = d, ta + s * (te - ta)
                                if d < r - TOUCH_M and not full:
                                    return False
                    if slope > out[STEEPEST]:
                        out[STEEPEST] = slope
                    if r > 0.0 and need + r * slope - least > TOUCH_M:
                        pending = True
                        bar = bar_above(out[DEPTH])
                        if beside and need + r * slope - least > bar:
                            ends = min(sign * (h + t * rise), sign * (h + tb * rise))
                            failing = need + sign * extremes[i >> SHIFT, j, i & MASK] - ends > bar
                if tx <= ty:
                    i = next_i
                if ty <= tx:
                    j = next_j
                if failing:
                    if group < 0.0:
                        group = t
                    group_end = tb
                if group >= 0.0 and (not failing or last or (group_end - group) * metres > longest):
                    pieces = max(int(math.ceil((group_end - group) * metres / longest)), 1)
                    for k in range(pieces):
                        ta = first + (group + (group_end - group) * k / pieces) * share
                        te = first + (group + (group_end - group) * (k + 1) / pieces) * share
                        d, s, cut = deepest(
                            m, z, sign,
                            e0 + (e1 - e0) * ta, n0 + (n1 - n0) * ta, h0 + (h1 - h0) * ta,
                            e0 + (e1 - e0) * te, n0 + (n1 - n0) * te, h0 + (h1 - h0) * te,
                            need, reach, out[DEPTH], stack, full,
                        )  # fmt: skip
                        out[CUT] += cut
                        if s >= 0.0:
                            out[DEPTH], out[DEPTH_AT] = d, ta + s * (te - ta)
                            if not full:
                                return False
                    group = -1.0
                t = tb
    return not (out[DEPTH] > TOUCH_M or out[UNKNOWN] <= 0.0 or out[UNKNOWN] < r - TOUCH_M)
