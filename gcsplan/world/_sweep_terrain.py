"""Kernels: a leg against a bilinear surface, exactly.

A demand is ``sign·(altitude − height(q)) >= need`` for every point q within ``reach`` of the leg's point, for the whole
of the leg: sign 1 for heights from below (min AGL, terrain clearance), −1 for the ground from above (max AGL).

Along a leg that is straight in the grid the height under it is a quadratic in each cell, so its extremes there are
closed forms. For the points beside the line there are two tiers. The first is a bound: they lie no higher than the
line's own ground by reach times the steepest slope within reach, nor than the highest node there. Where that bound
breaks the demand, the second decides: branch and bound over pieces of cells, since a bilinear patch has its extremes
over an upright box at the box's corners.
"""

from __future__ import annotations

import math



from gcsplan.world._sweep import (
    BOW_M,
    RESOLUTION_M,
    TOUCH_M,
    device,
    plane_per_cell,
    segment_box,
    slab,
    steps_of,
    to_grid,
    within,
)

MOST_PIECES = 1_000_000
"""Of one search; beyond it the demand counts as broken. Never met but by hostile input."""

SMALLEST_M = 1e-3
EDGE = 1e-9  # columns or rows by which a leg along the border may seem to lie beyond it
GROUP_BOW_M = 0.003


@device
def parts_of(f, e0, n0, e1, n1, bow_m):  # type: ignore[no-untyped-def]
    """Number of parts of a leg whose bow is at most ``bow_m``, and the bow of each."""
    square = (e1 - e0) ** 2 + (n1 - n0) ** 2
    bow = f.bend * square / 8.0
    parts = max(int(math.ceil(math.sqrt(bow / bow_m))), 1)
    return parts, bow / (parts * parts)


@device
def unknown_near(f, z, halo, e0, n0, e1, n1, reach, i, j):  # type: ignore[no-untyped-def]
    """Distance from a short segment in cell (i, j) to the nearest unknown patch, and where on the segment.

    Only patches within the halo's reach of the cell are looked at; ``inf`` if there is none.
    """
    rows, cols = z.shape
    c0, r0 = to_grid(f, e0, n0)
    c1, r1 = to_grid(f, e1, n1)
    a, b, c, d = plane_per_cell(f, 0.5 * (e0 + e1), 0.5 * (n0 + n1))
    sx, sy = steps_of(a, b, c, d)
    keep = 1.0 - 1.1 * f.bend * (math.hypot(e1 - e0, n1 - n0) + reach) - 1e-9
    sx *= keep
    sy *= keep
    best, at = math.inf, 0.0
    for jj in range(j - halo.rows, j + halo.rows + 1):
        for ii in range(i - halo.cols, i + halo.cols + 1):
            if 0 <= ii < cols - 1 and 0 <= jj < rows - 1:
                total = z[jj, ii] + z[jj, ii + 1] + z[jj + 1, ii] + z[jj + 1, ii + 1]
                if not math.isnan(total):
                    continue
            dist, t = segment_box(
                c0 * sx, r0 * sy, c1 * sx, r1 * sy, ii * sx, jj * sy, (ii + 1) * sx, (jj + 1) * sy
            )
            if dist < best:
                best, at = dist, t
    return best, at


@device
def deepest(f, z, sign, e0, n0, h0, e1, n1, h1, need, reach, best, stack, full):  # type: ignore[no-untyped-def]
    """Worst break of the demand along a short segment: its depth and where on the segment.

    ``best`` is the depth already known. With ``full`` the worst is resolved to 5 mm or a hundredth, else the first
    break ends the search. Unknown cells are passed over: they are judged elsewhere.
    """
    rows, cols = z.shape
    length = math.hypot(e1 - e0, n1 - n0)
    slack = f.bend * length * length / 8.0 + f.error_m
    r = reach + slack
    c0, r0 = to_grid(f, e0, n0)
    c1, r1 = to_grid(f, e1, n1)
    a, b, c, d = plane_per_cell(f, 0.5 * (e0 + e1), 0.5 * (n0 + n1))
    sx, sy = steps_of(a, b, c, d)
    keep = 1.0 - 1.1 * f.bend * (0.5 * length + r) - 1e-9
    sx *= keep
    sy *= keep
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
            bar = found + max(RESOLUTION_M, 0.01 * found) if found > TOUCH_M else TOUCH_M
            if not (high + need - lowest > bar) or math.isnan(za + zb + zc + zd):
                continue
            ta, tb = within(x0, y0, dx, dy, i * sx, j * sy, (i + 1) * sx, (j + 1) * sy, r)
            if ta > tb:
                continue
            tl = ta if dw > 0.0 else tb
            stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0.0, 0.0, 1.0, 1.0
            stack[0, 4], stack[0, 5] = high + need - (w0 + tl * dw), tl
            kb, kc, kd = zb - za, zc - za, za - zb - zc + zd
            size = 1
            while size:
                size -= 1
                bound, tl = stack[size, 4], stack[size, 5]
                fine = max(RESOLUTION_M, 0.01 * found)
                bar = found + fine if found > TOUCH_M else TOUCH_M
                if not bound > bar:
                    continue
                worked += 1
                u0, v0, u1, v1 = stack[size, 0], stack[size, 1], stack[size, 2], stack[size, 3]
                p, q = za + kb * u0 + kc * v0 + kd * u0 * v0, za + kb * u1 + kc * v0 + kd * u1 * v0
                s, t = za + kb * u0 + kc * v1 + kd * u0 * v1, za + kb * u1 + kc * v1 + kd * u1 * v1
                spread = max(max(p, q), max(s, t)) - min(min(p, q), min(s, t))
                wide, tall = (u1 - u0) * sx, (v1 - v0) * sy
                across = math.hypot(wide, tall)
                if spread + rise * across <= fine or across <= SMALLEST_M or worked > MOST_PIECES:
                    if bound > found:
                        found, at = bound, tl
                    if not full or worked > MOST_PIECES:
                        return found, at
                    continue
                um = 0.5 * (u0 + u1) if wide >= tall else u1
                vm = v1 if wide >= tall else 0.5 * (v0 + v1)
                ul, vl = (um, v0) if wide >= tall else (u0, vm)
                before = size
                for _ in range(2):
                    p, q = za + kb * u0 + kc * v0 + kd * u0 * v0, za + kb * um + kc * v0 + kd * um * v0
                    s, t = za + kb * u0 + kc * vm + kd * u0 * vm, za + kb * um + kc * vm + kd * um * vm
                    high = max(max(p, q), max(s, t))
                    if high + need - lowest > bar:
                        ta, tb = within(
                            x0, y0, dx, dy, (i + u0) * sx, (j + v0) * sy, (i + um) * sx, (j + vm) * sy, r
                        )
                        if ta <= tb:
                            tl = ta if dw > 0.0 else tb
                            stack[size, 0], stack[size, 1], stack[size, 2], stack[size, 3] = u0, v0, um, vm
                            stack[size, 4], stack[size, 5] = high + need - (w0 + tl * dw), tl
                            size += 1
                    u0, v0, um, vm = ul, vl, u1, v1
                # The deeper half is looked into first.
                if size == before + 2 and stack[before, 4] > stack[before + 1, 4]:
                    for k in range(6):
                        stack[before, k], stack[before + 1, k] = stack[before + 1, k], stack[before, k]
    return found, at


@device
def sweep(f, z, halo, sign, e0, n0, h0, e1, n1, h1, need, reach, stack, full, out):  # type: ignore[no-untyped-def]
    """Hold one leg to one demand; False at the first break found, unless ``full``.

    ``out``: 0 lowest ``sign·(altitude − height)`` on the line and 1 where; 2 depth of the worst break (> `TOUCH_M` is a
    break) and 3 where; 4 distance to the nearest unknown patch, looked for within reach, and 5 where; 6 steepest slope
    within the halo of the cells on the way, ``inf`` with unknown patches among them; 7 the reach with the line's bow.
    """
    rows, cols = z.shape
    parts, bow = parts_of(f, e0, n0, e1, n1, BOW_M)
    r = reach + bow + f.error_m
    low, t_low, depth, t_depth, near, t_near, steepest = math.inf, 0.0, -math.inf, 0.0, math.inf, 0.0, 0.0
    share = 1.0 / parts
    metres = math.hypot(e1 - e0, n1 - n0) * share
    longest = min(500.0, math.sqrt(8.0 * GROUP_BOW_M / f.bend)) if f.bend > 0.0 else 500.0
    rise = (h1 - h0) * share
    cb, rb = to_grid(f, e0, n0)
    for part in range(parts):
        first = part * share
        c0, r0 = cb, rb
        if part == parts - 1:
            cb, rb = to_grid(f, e1, n1)
        else:
            cb, rb = to_grid(f, e0 + (e1 - e0) * (first + share), n0 + (n1 - n0) * (first + share))
        dc, dr = cb - c0, rb - r0
        # A map that gives no number (NaN) fails these comparisons and is unknown.
        t, end = slab(c0, dc, -EDGE, cols - 1.0 + EDGE, 0.0, 1.0)
        t, end = slab(r0, dr, -EDGE, rows - 1.0 + EDGE, t, end)
        if not (t == 0.0 and end == 1.0 and math.isfinite(dc) and math.isfinite(dr)):
            if near > 0.0:
                near, t_near, steepest = 0.0, first if t > 0.0 else first + share, math.inf
            if not full:
                out[2], out[4] = depth, near
                return False
            if not (t <= end and math.isfinite(dc) and math.isfinite(dr)):
                continue
        h = h0 + (h1 - h0) * first
        at_c, at_r = c0 + t * dc, r0 + t * dr
        i = int(math.floor(at_c)) if dc >= 0.0 else int(math.ceil(at_c)) - 1
        j = int(math.floor(at_r)) if dr >= 0.0 else int(math.ceil(at_r)) - 1
        i, j = min(max(i, 0), cols - 2), min(max(j, 0), rows - 2)
        side_c, side_r = (1 if dc > 0.0 else 0), (1 if dr > 0.0 else 0)
        agl = math.nan
        group, group_end = -1.0, -1.0
        while True:
            next_i, next_j = i + 2 * side_c - 1, j + 2 * side_r - 1
            tx = (i + side_c - c0) / dc if dc != 0.0 and 0 <= next_i <= cols - 2 else math.inf
            ty = (j + side_r - r0) / dr if dr != 0.0 and 0 <= next_j <= rows - 2 else math.inf
            tb = max(min(min(tx, ty), end), t)
            last = tb >= end
            za, zb, zc, zd = z[j, i], z[j, i + 1], z[j + 1, i], z[j + 1, i + 1]
            kb, kc, kd = zb - za, zc - za, za - zb - zc + zd
            slope = halo.slope[j, i]
            failing = False
            if slope == math.inf:
                agl = math.nan
                steepest = math.inf
                if tb > t or end == t:
                    near, t_near = 0.0, first + 0.5 * (t + tb) * share
                    if not full:
                        out[2], out[4] = depth, near
                        return False
            else:
                if math.isnan(agl):
                    u, v = min(max(c0 + t * dc - i, 0.0), 1.0), min(max(r0 + t * dr - j, 0.0), 1.0)
                    agl = sign * (h + t * rise - (za + kb * u + kc * v + kd * u * v))
                u, v = min(max(c0 + tb * dc - i, 0.0), 1.0), min(max(r0 + tb * dr - j, 0.0), 1.0)
                after = sign * (h + tb * rise - (za + kb * u + kc * v + kd * u * v))
                # In the cell: agl + (after − agl)·s + bulge·s·(1 − s), s from 0 to 1.
                least, where = (agl, t) if agl <= after else (after, tb)
                bulge = sign * kd * dc * dr * (tb - t) * (tb - t)
                if bulge < 0.0:
                    s = 0.5 * (1.0 + (after - agl) / bulge)
                    if 0.0 < s < 1.0:
                        value = agl + (after - agl) * s + bulge * s * (1.0 - s)
                        if value < least:
                            least, where = value, t + s * (tb - t)
                agl = after
                if least < low:
                    low, t_low = least, first + where * share
                if need - least > depth:
                    depth, t_depth = need - least, first + where * share
                    if depth > TOUCH_M and not full:
                        out[2], out[4] = depth, near
                        return False
                if slope < 0.0:
                    slope = -slope
                    steepest = math.inf
                    if r > 0.0:
                        ta = first + t * share
                        te = first + tb * share
                        d, s = unknown_near(
                            f, z, halo, e0 + (e1 - e0) * ta, n0 + (n1 - n0) * ta,
                            e0 + (e1 - e0) * te, n0 + (n1 - n0) * te, r, i, j,
                        )  # fmt: skip
                        if d < near:
                            near, t_near = d, ta + s * (te - ta)
                            if near < r - TOUCH_M and not full:
                                out[2], out[4] = depth, near
                                return False
                steepest = max(steepest, slope)
                if r > 0.0:
                    bar = depth + max(RESOLUTION_M, 0.01 * depth) if depth > TOUCH_M else TOUCH_M
                    if need + r * slope - least > bar:
                        ends = min(sign * (h + t * rise), sign * (h + tb * rise))
                        extreme = halo.high[j, i] if sign > 0.0 else -halo.low[j, i]
                        failing = need + extreme - ends > bar
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
                    d, s = deepest(
                        f, z, sign,
                        e0 + (e1 - e0) * ta, n0 + (n1 - n0) * ta, h0 + (h1 - h0) * ta,
                        e0 + (e1 - e0) * te, n0 + (n1 - n0) * te, h0 + (h1 - h0) * te,
                        need, reach, depth, stack, full,
                    )  # fmt: skip
                    if d > depth and s >= 0.0:
                        depth, t_depth = d, ta + s * (te - ta)
                        if depth > TOUCH_M and not full:
                            out[2], out[4] = depth, near
                            return False
                group = -1.0
            if last:
                break
            t = tb
    out[0], out[1], out[2], out[3] = low, t_low, depth, t_depth
    out[4], out[5], out[6], out[7] = near, t_near, steepest, r
    return not (depth > TOUCH_M or near <= 0.0 or near < r - TOUCH_M)
