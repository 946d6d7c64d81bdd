"""Kernels: a leg against no-fly zones.

A zone whose levels are both above mean sea level is compared exactly, by closed forms: the part of the leg at the
zone's heights, and that part's distance from the zone's shape. If a level follows the ground, branch and bound over
pieces of cells finds the nearest point of the shape at which the leg meets the heights that the zone has there.
"""

from __future__ import annotations

import math

from gcsplan.arrays import Floats
from gcsplan.world.kernels.compiled import device, inlined
from gcsplan.world.kernels.shared import (
    BAND_HIGH,
    BAND_LOW,
    BEND,
    CEILING,
    CEILING_AGL,
    COL0,
    COL1,
    CUT,
    EAST,
    EAST_E,
    ERROR_M,
    FIRST,
    FLOOR,
    FLOOR_AGL,
    LAST,
    NORTH,
    NORTH_N,
    RADIUS,
    RESOLUTION_M,
    ROW0,
    ROW1,
    SOUTH_N,
    TOUCH_M,
    WEST_E,
)
from gcsplan.world.kernels.sweep import (
    local_steps,
    parts_of,
    plane_per_cell,
    point_segment,
    segment_box,
    slab,
    to_grid,
)
from gcsplan.world.kernels.sweep_beside import FINEST_M, MOST_WORKED

ACROSS_M = 0.02
"""Size, m, to which pieces are cut beside a zone whose levels follow the ground."""

ZONE_BOW_M = 0.003

GLIMPSES = 8
"""Places on a leg that are examined before all of it, if only a yes or no is needed."""


@device
def signed_distance(zone: Floats, vertex: Floats, k: int, e: float, n: float) -> float:
    """Distance of a point from a zone's border, negative inside."""
    radius = zone[k, RADIUS]
    if radius >= 0.0:
        return float(math.hypot(e - zone[k, EAST], n - zone[k, NORTH]) - radius)
    best = math.inf
    inside = False
    a, b = int(zone[k, FIRST]), int(zone[k, LAST])
    x0, y0 = vertex[b - 1, 0], vertex[b - 1, 1]
    for v in range(a, b):
        x1, y1 = vertex[v, 0], vertex[v, 1]
        d, _ = point_segment(e, n, x0, y0, x1, y1)
        best = min(best, d)
        if (y0 > n) != (y1 > n) and e < x0 + (n - y0) / (y1 - y0) * (x1 - x0):
            inside = not inside
        x0, y0 = x1, y1
    return -best if inside else best


@device
def approach(zone: Floats, vertex: Floats, k: int, ax: float, ay: float, bx: float, by: float) -> tuple[float, float]:
    """Least distance of a segment from a zone's shape, and where on the segment; from a circle it is signed."""
    radius = zone[k, RADIUS]
    if radius >= 0.0:
        d, t = point_segment(zone[k, EAST], zone[k, NORTH], ax, ay, bx, by)
        return d - radius, t
    best, at = signed_distance(zone, vertex, k, ax, ay), 0.0
    if best <= 0.0:
        return 0.0, 0.0
    dx, dy = bx - ax, by - ay
    first, last = int(zone[k, FIRST]), int(zone[k, LAST])
    x0, y0 = vertex[last - 1, 0], vertex[last - 1, 1]
    for v in range(first, last):
        x1, y1 = vertex[v, 0], vertex[v, 1]
        # Two segments that do not cross are nearest at an end of one of them.
        d, _ = point_segment(bx, by, x0, y0, x1, y1)
        if d < best:
            best, at = d, 1.0
        d, t = point_segment(x1, y1, ax, ay, bx, by)
        if d < best:
            best, at = d, t
        cross = dx * (y1 - y0) - dy * (x1 - x0)
        if cross != 0.0:
            t = ((x0 - ax) * (y1 - y0) - (y0 - ay) * (x1 - x0)) / cross
            s = ((x0 - ax) * dy - (y0 - ay) * dx) / cross
            if 0.0 <= t <= 1.0 and 0.0 <= s <= 1.0:
                return 0.0, t
        x0, y0 = x1, y1
    return best, at


@device
def enters(zone: Floats, vertex: Floats, k: int, ax: float, ay: float, bx: float, by: float, events: Floats) -> bool:
    """Whether a segment passes through the open inside of a polygon, by more than touching it.

    The segment is split at its crossings with the edges' lines and at the feet of the vertices on it. Between
    neighbouring splits the distance from each edge only grows or only shrinks, so in the middle of a part the segment
    is about half as far from the border as it gets.
    """
    first, last = int(zone[k, FIRST]), int(zone[k, LAST])
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    if square == 0.0:
        return signed_distance(zone, vertex, k, ax, ay) < -TOUCH_M
    count = 0
    x0, y0 = vertex[last - 1, 0], vertex[last - 1, 1]
    for v in range(first, last):
        x1, y1 = vertex[v, 0], vertex[v, 1]
        t = ((x1 - ax) * dx + (y1 - ay) * dy) / square
        if 0.0 < t < 1.0:
            events[count] = t
            count += 1
        cross = dx * (y1 - y0) - dy * (x1 - x0)
        if cross != 0.0:
            t = ((x0 - ax) * (y1 - y0) - (y0 - ay) * (x1 - x0)) / cross
            if 0.0 < t < 1.0:
                events[count] = t
                count += 1
        x0, y0 = x1, y1
    t = 0.0
    while t < 1.0:
        following = 1.0
        for q in range(count):
            if t < events[q] < following:
                following = events[q]
        middle = 0.5 * (t + following)
        if signed_distance(zone, vertex, k, ax + middle * dx, ay + middle * dy) < -TOUCH_M:
            return True
        t = following
    return False


@device
def at_heights(h0: float, dh: float, floor_m: float, ceiling_m: float, altitude_m: float) -> tuple[float, float]:
    """The part of [0, 1] where h0 + t·dh, plus or minus ``altitude_m``, meets the open interval (floor, ceiling)."""
    if not floor_m < ceiling_m:
        return 1.0, 0.0
    return slab(h0, dh, floor_m - altitude_m + TOUCH_M, ceiling_m + altitude_m - TOUCH_M, 0.0, 1.0)


@device
def nearest_conflict(
    m: Floats, z: Floats, zone: Floats, vertex: Floats, k: int, e0: float, n0: float, h0: float, e1: float, n1: float,
    h1: float, altitude_m: float, cutoff: float, stack: Floats, full: bool, out: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Least distance from a short segment to a point of a zone's shape where it meets the zone's heights, and where.

    Only distances below ``cutoff`` are found, else inf. Over unknown ground the zone is met at any height. Without
    ``full`` the first one found ends the search; with it the least is resolved to 1 cm or a hundredth. ``out[CUT]``
    counts the pieces of ground that are cut.
    """
    rows, cols = z.shape
    dh = h1 - h0
    length = math.hypot(e1 - e0, n1 - n0)
    me, mn = 0.5 * (e0 + e1), 0.5 * (n0 + n1)
    c0, r0 = to_grid(m, e0, n0)
    c1, r1 = to_grid(m, e1, n1)
    cm, rm = to_grid(m, me, mn)
    if not math.isfinite(c0 + r0 + c1 + r1):
        return 0.0, 0.5
    slack = m[BEND] * length * length / 8.0 + m[ERROR_M]
    a, b, c, d = plane_per_cell(m, me, mn)
    sx, sy = local_steps(m, e0, n0, e1, n1, cutoff)
    wide_r, tall_r = (cutoff + slack) / sx, (cutoff + slack) / sy
    i0 = max(int(math.floor(min(c0, c1) - wide_r)), int(zone[k, COL0]))
    i1 = min(int(math.floor(max(c0, c1) + wide_r)), int(zone[k, COL1]))
    j0 = max(int(math.floor(min(r0, r1) - tall_r)), int(zone[k, ROW0]))
    j1 = min(int(math.floor(max(r0, r1) + tall_r)), int(zone[k, ROW1]))
    floor_m, floor_agl = zone[k, FLOOR], zone[k, FLOOR_AGL] != 0.0
    ceiling_m, ceiling_agl = zone[k, CEILING], zone[k, CEILING_AGL] != 0.0
    x0, y0, x1, y1 = c0 * sx, r0 * sy, c1 * sx, r1 * sy
    rise = abs(dh) / length if length > 0.0 else 0.0
    best, at = math.inf, 0.5
    worked = 0
    for j in range(j0, j1 + 1):
        for i in range(i0, i1 + 1):
            known = 0 <= i < cols - 1 and 0 <= j < rows - 1
            za, kb, kc, kd = 0.0, 0.0, 0.0, 0.0
            if known:
                za = z[j, i]
                kb, kc = z[j, i + 1] - za, z[j + 1, i] - za
                kd = za - z[j, i + 1] - z[j + 1, i] + z[j + 1, i + 1]
                known = not math.isnan(kb + kc + kd)
            # The whole cell is processed like its pieces, as the only child without a parent.
            size = 0
            u0, v0, um, vm, u1, v1, ul, vl = 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0
            children = 1
            while True:
                bar = min(cutoff, best - max(0.01, 0.01 * best)) if best < math.inf else cutoff
                before = size
                for _ in range(children):
                    p, q = za + kb * u0 + kc * v0 + kd * u0 * v0, za + kb * um + kc * v0 + kd * um * v0
                    s, t = za + kb * u0 + kc * vm + kd * u0 * vm, za + kb * um + kc * vm + kd * um * vm
                    least, most = min(min(p, q), min(s, t)), max(max(p, q), max(s, t))
                    t0, t1 = 0.0, 1.0
                    if known:
                        low, high = floor_m + (least if floor_agl else 0.0), ceiling_m + (most if ceiling_agl else 0.0)
                        t0, t1 = at_heights(h0, dh, low, high, altitude_m)
                    if t0 <= t1:
                        dist, where = segment_box(
                            x0 + t0 * (x1 - x0), y0 + t0 * (y1 - y0), x0 + t1 * (x1 - x0), y0 + t1 * (y1 - y0),
                            (i + u0) * sx, (j + v0) * sy, (i + um) * sx, (j + vm) * sy,
                        )  # fmt: skip
                        dist -= slack
                        if dist < bar:
                            gc, gr = i + 0.5 * (u0 + um) - cm, j + 0.5 * (v0 + vm) - rm
                            pe, pn = a * gc + b * gr, c * gc + d * gr
                            hu, hv = 0.5 * (um - u0), 0.5 * (vm - v0)
                            half = max(
                                math.hypot(a * hu + b * hv, c * hu + d * hv),
                                math.hypot(a * hu - b * hv, c * hu - d * hv),
                            )
                            off = 0.6 * m[BEND] * (pe * pe + pn * pn) + m[ERROR_M] + 1e-9
                            if signed_distance(zone, vertex, k, me + pe, mn + pn) <= 1.001 * half + off:
                                stack[size, 0], stack[size, 1], stack[size, 2], stack[size, 3] = u0, v0, um, vm
                                stack[size, 4], stack[size, 5] = max(dist, 0.0), t0 + where * (t1 - t0)
                                stack[size, 6] = most - least
                                size += 1
                    u0, v0, um, vm = ul, vl, u1, v1
                if size == before + 2 and stack[before, 4] < stack[before + 1, 4]:
                    for w in range(7):
                        stack[before, w], stack[before + 1, w] = stack[before + 1, w], stack[before, w]
                children = 0
                while size:
                    size -= 1
                    if best < math.inf and not stack[size, 4] < best - max(0.01, 0.01 * best):
                        continue
                    u0, v0, u1, v1 = stack[size, 0], stack[size, 1], stack[size, 2], stack[size, 3]
                    wide, tall = (u1 - u0) * sx, (v1 - v0) * sy
                    across = math.hypot(wide, tall)
                    worked += 1
                    out[CUT] += 1.0
                    if (
                        (across <= ACROSS_M and stack[size, 6] + rise * across <= RESOLUTION_M)
                        or across <= FINEST_M
                        or worked > MOST_WORKED
                    ):
                        best, at = stack[size, 4], stack[size, 5]
                        if not full or best <= 0.01 or worked > MOST_WORKED:
                            return best, at
                        continue
                    um = 0.5 * (u0 + u1) if wide >= tall else u1
                    vm = v1 if wide >= tall else 0.5 * (v0 + v1)
                    ul, vl = (um, v0) if wide >= tall else (u0, vm)
                    children = 2
                    break
                if children == 0:
                    break
    return best, at


@device
def glimpsed(
    m: Floats, z: Floats, zone: Floats, vertex: Floats, k: int, e0: float, n0: float, h0: float, e1: float, n1: float,
    h1: float, t0: float, t1: float, altitude_m: float,
) -> bool:  # fmt: skip
    """Whether one of a few places on the leg itself, from ``t0`` to ``t1``, lies in a zone and at its heights.

    If so, the zone is broken; the search for the nearest such place would find it too, but takes long near the zone's
    levels. If not, nothing is known.
    """
    rows, cols = z.shape
    floor_agl, ceiling_agl = zone[k, FLOOR_AGL] != 0.0, zone[k, CEILING_AGL] != 0.0
    for q in range(GLIMPSES):
        t = t0 + (t1 - t0) * (q + 0.5) / GLIMPSES
        e, n = e0 + t * (e1 - e0), n0 + t * (n1 - n0)
        if signed_distance(zone, vertex, k, e, n) > -2.0 * TOUCH_M:
            continue
        c, r = to_grid(m, e, n)
        if not (0.0 <= c < cols - 1.0 and 0.0 <= r < rows - 1.0):
            continue
        i, j = int(c), int(r)
        za = z[j, i]
        kb, kc = z[j, i + 1] - za, z[j + 1, i] - za
        u, v = c - i, r - j
        ground = za + kb * u + kc * v + (z[j + 1, i + 1] - za - kb - kc) * u * v
        h = h0 + t * (h1 - h0)
        low = zone[k, FLOOR] + (ground if floor_agl else 0.0)
        high = zone[k, CEILING] + (ground if ceiling_agl else 0.0)
        # False for NaN, where the ground is unknown.
        if h + altitude_m - low > 2.0 * TOUCH_M and high - h + altitude_m > 2.0 * TOUCH_M:
            return True
    return False


@inlined
def meets(
    m: Floats, z: Floats, zone: Floats, vertex: Floats, k: int, e0: float, n0: float, h0: float, e1: float, n1: float,
    h1: float, altitude_m: float, reach: float, stack: Floats, events: Floats, full: bool, out: Floats,
) -> tuple[bool, float, float]:  # fmt: skip
    """Whether a leg breaks a zone; its signed distance from the shape at the worst point, and where on the leg.

    Without a break the distance is the least at which the leg meets the zone's heights (for a zone over ground a lower
    bound, never below ``reach``), inf if it does not meet them.
    """
    t0, t1 = at_heights(h0, h1 - h0, zone[k, BAND_LOW], zone[k, BAND_HIGH], altitude_m)
    if t0 > t1:
        return False, math.inf, 0.0
    de, dn = e1 - e0, n1 - n0
    ax, ay, bx, by = e0 + t0 * de, n0 + t0 * dn, e0 + t1 * de, n0 + t1 * dn
    dist, where = approach(zone, vertex, k, ax, ay, bx, by)
    where = t0 + where * (t1 - t0)
    polygon = zone[k, RADIUS] < 0.0
    bound = reach - TOUCH_M
    if polygon and bound <= 0.0 and dist <= TOUCH_M:  # both ends may lie on the border, outside by a rounding
        if not enters(zone, vertex, k, ax, ay, bx, by, events):
            return False, 0.0, where
    elif not dist < bound:
        return False, dist, where
    if zone[k, FLOOR_AGL] == 0.0 and zone[k, CEILING_AGL] == 0.0:
        return True, dist, where
    # The levels follow the ground: search along the part that is near the zone's box.
    cutoff = max(bound, FINEST_M)
    t0, t1 = slab(e0, de, zone[k, WEST_E] - reach - 1.0, zone[k, EAST_E] + reach + 1.0, t0, t1)
    if t0 <= t1:
        t0, t1 = slab(n0, dn, zone[k, SOUTH_N] - reach - 1.0, zone[k, NORTH_N] + reach + 1.0, t0, t1)
    best, at = math.inf, 0.0
    if t0 <= t1:
        if not full and glimpsed(m, z, zone, vertex, k, e0, n0, h0, e1, n1, h1, t0, t1, altitude_m):
            return True, 0.0, 0.5 * (t0 + t1)
        parts, _ = parts_of(m, (t1 - t0) * math.hypot(de, dn), ZONE_BOW_M)
        for p in range(parts):
            ta, tb = t0 + (t1 - t0) * p / parts, t0 + (t1 - t0) * (p + 1) / parts
            d, w = nearest_conflict(
                m, z, zone, vertex, k, e0 + ta * de, n0 + ta * dn, h0 + ta * (h1 - h0),
                e0 + tb * de, n0 + tb * dn, h0 + tb * (h1 - h0), altitude_m, min(cutoff, best), stack, full, out,
            )  # fmt: skip
            if d < best:
                best, at = d, ta + w * (tb - ta)
                if not full:
                    return True, best, at
    if best < math.inf:
        return True, min(best, signed_distance(zone, vertex, k, e0 + at * de, n0 + at * dn)), at
    return False, max(dist, reach), where
