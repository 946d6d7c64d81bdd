"""Kernels that pull a ground track tight over samples of floor and ceiling.

A track is a few vertices; floor and ceiling along its legs are sampled from two rasters. The best profile through the
samples is a taut string (see `taut_string`), and its cost is the cost of the track. Where no profile keeps the limits,
the metres that are missing are added to the cost, so the same moves that shorten a track also repair an illegal one.
The result is a guide and is checked exactly elsewhere.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Int64s
from gcsplan.planners.compiled import device, kernel
from gcsplan.planners.profile.taut_kernels import draw

MOST_PULLED = 400
MOST_DOORS = 6000

# Indices of the kernels' parameters in `spec`.
WEST, SOUTH, PER_STEP, SPACING, MARGIN, UP, DOWN, VERTICAL, HORIZONTAL, ENERGY, PENALTY, REACH = range(12)


@device
def walled(ax, ay, bx, by, circles, edges, reach):  # type: ignore[no-untyped-def]
    """True if a leg meets a circle, or comes within ``reach`` of a polygon's edge."""
    dx, dy = bx - ax, by - ay
    square = max(dx * dx + dy * dy, 1e-12)
    for k in range(len(circles)):
        px, py = circles[k, 0] - ax, circles[k, 1] - ay
        t = min(max((px * dx + py * dy) / square, 0.0), 1.0)
        if (px - t * dx) ** 2 + (py - t * dy) ** 2 < circles[k, 2] ** 2:
            return True
    for k in range(len(edges)):
        px, py, qx, qy = edges[k, 0] - ax, edges[k, 1] - ay, edges[k, 2] - ax, edges[k, 3] - ay
        if min(px, qx) - reach > max(dx, 0.0) or max(px, qx) + reach < min(dx, 0.0):
            continue
        c, d = dx * py - dy * px, dx * qy - dy * qx
        ex, ey = qx - px, qy - py
        e, f = ey * px - ex * py, ex * (dy - py) - ey * (dx - px)
        if c * d < 0.0 and e * f < 0.0:
            return True
        near = math.inf
        for w in range(4):
            # Distance of each end of either segment from the other segment.
            if w < 2:
                cx, cy = (px, py) if w == 0 else (qx, qy)
                gx, gy, sq = dx, dy, square
            else:
                cx, cy = (-px, -py) if w == 2 else (dx - px, dy - py)
                gx, gy, sq = ex, ey, max(ex * ex + ey * ey, 1e-12)
            t = min(max((cx * gx + cy * gy) / sq, 0.0), 1.0)
            near = min(near, (cx - t * gx) ** 2 + (cy - t * gy) ** 2)
        if near < reach * reach:
            return True
    return False


@device
def evaluate(p, n, za, zb, floor, ceiling, circles, edges, spec, doors, at, chains, out_z):  # type: ignore[no-untyped-def]
    """Cost of a track p[:n] flown from altitude ``za`` to ``zb``, and the metres that it lacks to be legal.

    A row of ``p`` is east, north, pinned, and the altitude at which to pass (NaN: free). ``out_z`` receives the
    altitudes of the vertices; ``doors``, ``at`` and ``chains`` are working arrays.
    """
    s, low, high, vertex = doors[0], doors[1], doors[2], doors[3]
    rows, cols = floor.shape
    s[0], low[0], high[0], vertex[0] = 0.0, za, za, 0.0
    count, way, missing = 1, 0.0, 0.0
    for k in range(n - 1):
        ax, ay, bx, by = p[k, 0], p[k, 1], p[k + 1, 0], p[k + 1, 1]
        length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
        if length < 1e-3:
            length = 1e-3
        if walled(ax, ay, bx, by, circles, edges, spec[REACH]):
            missing += 1e6 + length
        m = int(length / spec[SPACING]) + 1
        if count + m > len(s):
            return math.inf, math.inf
        x0, y0 = (ax - spec[WEST]) * spec[PER_STEP], (ay - spec[SOUTH]) * spec[PER_STEP]
        dx, dy = (bx - ax) * spec[PER_STEP] / m, (by - ay) * spec[PER_STEP] / m
        for q in range(1, m + 1):
            x, y = x0 + q * dx, y0 + q * dy
            x, y = min(max(x, 0.0), cols - 1.001), min(max(y, 0.0), rows - 1.001)
            i, j = int(x), int(y)
            u, v = x - i, y - j
            lo = (1.0 - v) * ((1.0 - u) * floor[j, i] + u * floor[j, i + 1])
            lo += v * ((1.0 - u) * floor[j + 1, i] + u * floor[j + 1, i + 1]) + spec[MARGIN]
            hi = (1.0 - v) * ((1.0 - u) * ceiling[j, i] + u * ceiling[j, i + 1])
            hi += v * ((1.0 - u) * ceiling[j + 1, i] + u * ceiling[j + 1, i + 1]) - spec[MARGIN]
            if q == m and p[k + 1, 3] == p[k + 1, 3]:
                lo, hi = max(lo, p[k + 1, 3]), min(hi, p[k + 1, 3])
            if lo > hi:
                missing += lo - hi
                lo = hi = 0.5 * (lo + hi)
            s[count], low[count], high[count] = way + q * (length / m), lo, hi
            vertex[count] = k + 1 if q == m else 0.0
            count += 1
        way += length
    low[count - 1] = high[count - 1] = zb
    corners = draw(s[:count], low[:count], high[:count], za, zb, at, chains)
    z = chains[0]
    cost = spec[HORIZONTAL] * way if spec[ENERGY] > 0.0 else 0.0
    out_z[0] = za
    for k in range(corners - 1):
        a, b = at[0, k], at[0, k + 1]
        run, rise = s[b] - s[a], z[k + 1] - z[k]
        missing += max(rise - spec[UP] * run, -rise - spec[DOWN] * run, 0.0)
        cost += spec[VERTICAL] * abs(rise) if spec[ENERGY] > 0.0 else math.sqrt(run * run + rise * rise)
        for d in range(a + 1, b + 1):
            if vertex[d] > 0.0:
                out_z[int(vertex[d])] = z[k] + rise * (s[d] - s[a]) / run
    return cost, missing


@device
def aim(move, turn, a, v, b, step, bend):  # type: ignore[no-untyped-def]
    """The points with which a move replaces a vertex ``v`` between ``a`` and ``b``, or the leg from ``a`` to ``v``.

    Return the number of points (-1: no such move), x and y of two points, and 1 if they replace the leg alone.
    """
    d1 = math.sqrt((v[0] - a[0]) ** 2 + (v[1] - a[1]) ** 2) + 1e-9
    ux, uy = (v[0] - a[0]) / d1, (v[1] - a[1]) / d1
    if move >= 7:
        if d1 < 3.0 * step or d1 < 30.0:
            return -1, 0.0, 0.0, 0.0, 0.0, 1
        side = step if move == 7 else -step
        x, y = a[0] + bend * d1 * ux - side * uy, a[1] + bend * d1 * uy + side * ux
        return 1, x, y, 0.0, 0.0, 1
    d2 = math.sqrt((b[0] - v[0]) ** 2 + (b[1] - v[1]) ** 2) + 1e-9
    wx, wy = (b[0] - v[0]) / d2, (b[1] - v[1]) / d2
    if move == 0:
        return 0, 0.0, 0.0, 0.0, 0.0, 0
    if move == 1 or move == 2:
        r = min(step, 0.5 * d1, 0.5 * d2)
        if move == 1:
            return 2, v[0] - r * ux, v[1] - r * uy, v[0] + r * wx, v[1] + r * wy, 0
        nx, ny = -(uy + wy), ux + wx
        length = math.sqrt(nx * nx + ny * ny) + 1e-9
        side = step / length * (1.0 if ux * wy - uy * wx >= 0.0 else -1.0)
        return 1, v[0] + side * nx, v[1] + side * ny, 0.0, 0.0, 0
    if move == 3:
        nx, ny = -(uy + wy), ux + wx
        length = math.sqrt(nx * nx + ny * ny) + 1e-9
        side = step / length * (-1.0 if ux * wy - uy * wx >= 0.0 else 1.0)
        return 1, v[0] + side * nx, v[1] + side * ny, 0.0, 0.0, 0
    if move == 4:
        return 1, v[0] - min(step, d1) * ux, v[1] - min(step, d1) * uy, 0.0, 0.0, 0
    if move == 5:
        return 1, v[0] + min(step, d2) * wx, v[1] + min(step, d2) * wy, 0.0, 0.0, 0
    if turn > 0:
        return -1, 0.0, 0.0, 0.0, 0.0, 0
    return 1, 0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.0, 0.0, 0


@kernel("f8[,] f8[] f8[] f8[] i8 f8 f8 f8[,] f8[,] f8[,] f8[,] f8[] f8[] f8 i8 f8 f8[,] i8[,] f8[,] f8[,] f8[] f8[]")
def pull(  # type: ignore[no-untyped-def]
    p, pinned, pz, zs, count, za, zb, floor, ceiling, circles, edges, spec, steps, gain, rounds, around_m,
    doors, at, chains, cand, cand_z, total,
):  # fmt: skip
    """Make the track p[:count] cheaper, in place, by moves of ``steps`` metres in turn; return the new count.

    ``pinned``, ``pz`` (MOST_POINTS,): vertices that stay, and altitudes at which to pass them (NaN: free). ``zs``
    receives the altitudes of the vertices. A move is evaluated over a part of the track, ``around_m`` or three vertices
    to each side, whose ends keep their altitudes, and is kept if it saves ``gain``. ``doors`` and what follows: see
    `workspace`; ``total`` receives the cost and the missing metres.
    """
    for phase in range(len(steps) + 1):
        last = phase == len(steps)
        step = 0.0 if last else steps[phase]
        for turn in range(1 if last else rounds):
            saved = 0.0
            bend = 0.5 if turn % 3 == 0 else (0.3 if turn % 3 == 1 else 0.7)
            i = 0
            while i < count:
                # i = 0: the whole track, for its profile; i > 0: the leg before vertex i, and the vertex.
                if i == 0:
                    w0, w1 = 0, count - 1
                elif last:
                    break
                else:
                    w0, w1 = max(i - 1, 0), min(i + 1, count - 1)
                    way = 0.0
                    while w0 > max(i - 4, 0) and way < around_m:
                        way += math.sqrt((p[w0, 0] - p[w0 - 1, 0]) ** 2 + (p[w0, 1] - p[w0 - 1, 1]) ** 2)
                        w0 -= 1
                    way = 0.0
                    while w1 < min(i + 4, count - 1) and way < around_m:
                        way += math.sqrt((p[w1, 0] - p[w1 + 1, 0]) ** 2 + (p[w1, 1] - p[w1 + 1, 1]) ** 2)
                        w1 += 1
                base = math.inf
                for move in range(-1, 9 if i > 0 else 0):
                    points, x0, y0, x1, y1, leg = 0, 0.0, 0.0, 0.0, 0.0, 0
                    i0, i1 = i - 1, i + 1
                    if move >= 0:
                        if move < 7 and (i >= count - 1 or pinned[i]):
                            continue
                        points, x0, y0, x1, y1, leg = aim(
                            move, turn, p[i - 1], p[i], p[min(i + 1, count - 1)], step, bend
                        )
                        if points < 0 or count + 1 >= len(p):
                            continue
                        i1 = i if leg else i + 1
                    # Write the part of the track after the move to `cand`.
                    n = 0
                    for k in range(w0, w1 + 1):
                        if move >= 0 and i0 < k < i1:
                            continue
                        if move >= 0 and k == i1:
                            for q in range(points):
                                cand[n, 0], cand[n, 1] = (x0, y0) if q == 0 else (x1, y1)
                                cand[n, 2], cand[n, 3] = 0.0, math.nan
                                n += 1
                        cand[n, 0], cand[n, 1], cand[n, 2], cand[n, 3] = p[k, 0], p[k, 1], pinned[k], pz[k]
                        n += 1
                    start_z = za if w0 == 0 else zs[w0]
                    end_z = zb if w1 == count - 1 else zs[w1]
                    cost, missing = evaluate(
                        cand, n, start_z, end_z, floor, ceiling, circles, edges, spec, doors, at, chains, cand_z
                    )
                    value = cost + spec[PENALTY] * missing
                    if move < 0:
                        base = value
                        if i == 0:
                            total[0], total[1] = cost, missing
                            for k in range(n):
                                zs[k] = cand_z[k]
                        continue
                    worth = gain if move > 0 else -0.05 * gain
                    if not value < base - worth:
                        continue
                    saved += base - value
                    base = value
                    # Insert it, and shift all vertices after it.
                    more = n - (w1 - w0 + 1)
                    for q in range(count - 1 - w1):
                        k = count - 1 - q if more > 0 else w1 + 1 + q
                        p[k + more, 0], p[k + more, 1] = p[k, 0], p[k, 1]
                        pinned[k + more], pz[k + more], zs[k + more] = pinned[k], pz[k], zs[k]
                    for k in range(n):
                        p[w0 + k, 0], p[w0 + k, 1] = cand[k, 0], cand[k, 1]
                        pinned[w0 + k], pz[w0 + k], zs[w0 + k] = cand[k, 2], cand[k, 3], cand_z[k]
                    count += more
                    w1 += more
                    if move == 0:
                        i -= 1
                        break
                i += 1
            if saved < 2.0 * gain:
                break
    return count


def workspace() -> tuple[Floats | Int64s, ...]:
    """Working arrays of `pull`: its arguments from ``doors`` to ``total``."""
    return (
        np.empty((4, MOST_DOORS)),
        np.empty((3, MOST_DOORS + 1), np.int64),
        np.empty((3, MOST_DOORS + 1)),
        np.empty((MOST_PULLED + 2, 4)),
        np.empty(MOST_PULLED + 2),
        np.zeros(2),
    )
