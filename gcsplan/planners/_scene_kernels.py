"""What the cost kernels share: a scene's numbers by name, heights and distances; and the kernels of ants and repair.

numba notices a change of the file that a kernel stands in, but not of those that it calls into: each cached kernel
takes `SOURCES` as the default of its last parameter, which numba keeps as a part of the key.
"""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SOURCES = hashlib.sha256(
    b"".join((Path(__file__).parent / f"_{name}_kernels.py").read_bytes() for name in ("scene", "cost"))
).hexdigest()

# No fast math: how sums are reordered changes from one compilation to the next, and a swarm makes another path of it.
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
kernel = njit(cache=True, **_OPTIONS)
"""What Python calls."""
device = njit(**_OPTIONS)
"""What only kernels call."""

# What the numbers of a scene are.
(
    MAX_AGL, MAX_AMSL, UP, DOWN, WEST, SOUTH, BOTTOM, EAST, NORTH, TOP, CENTRE_E, CENTRE_N, PER_UNIT,
    H_MIN, H_MAX,
) = range(15)  # fmt: skip
NUMBERS = 15

# What the columns of a zone are: shape 0 a circle, else a polygon with so many corners from ``first``.
ZE, ZN, ZR, REACH, Z_LOW, Z_HIGH, LOW_AGL, HIGH_AGL, CORNERS, FIRST, Z_MIDDLE = range(11)
ZONE_COLUMNS = 11

EDGE = 1e-6  # of a cell: float noise at the raster's edge


@device
def bilinear(raster, j, i, a, b):  # type: ignore[no-untyped-def]
    """Between the nodes of the cell of row ``j`` and column ``i``, by its parts ``a`` along and ``b`` down."""
    north = raster[j, i] + a * (raster[j, i + 1] - raster[j, i])
    south = raster[j + 1, i] + a * (raster[j + 1, i + 1] - raster[j + 1, i])
    return north + b * (south - north)


@device
def height_at(heights, quadratic, numbers, e, n):  # type: ignore[no-untyped-def]
    """Bilinear height at a point of the plane; NaN off the raster and on unknown ground."""
    u, v = (e - numbers[CENTRE_E]) * numbers[PER_UNIT], (n - numbers[CENTRE_N]) * numbers[PER_UNIT]
    q = quadratic
    col = q[0, 0] + u * (q[0, 1] + q[0, 3] * u + q[0, 4] * v) + v * (q[0, 2] + q[0, 5] * v)
    row = q[1, 0] + u * (q[1, 1] + q[1, 3] * u + q[1, 4] * v) + v * (q[1, 2] + q[1, 5] * v)
    rows, cols = heights.shape
    if not (-EDGE <= col <= cols - 1 + EDGE and -EDGE <= row <= rows - 1 + EDGE):
        return math.nan
    i, j = min(max(int(col), 0), cols - 2), min(max(int(row), 0), rows - 2)
    return bilinear(heights, j, i, col - i, row - j)


@kernel
def heights_at(heights, quadratic, numbers, points, out, sources=SOURCES):  # type: ignore[no-untyped-def]
    """Bilinear heights under points (N, 2 or more) into ``out`` (N,)."""
    for k in range(len(points)):
        out[k] = height_at(heights, quadratic, numbers, points[k, 0], points[k, 1])


@device
def place(raster, quadratic, numbers, x, y, column, row):  # type: ignore[no-untyped-def]
    """Columns and rows of all samples in a raster, and how many are off it. Straight arithmetic, on its own."""
    q, right, low = quadratic, raster.shape[1] - 1.0, raster.shape[0] - 1.0
    c0, c1, c2, c3, c4, c5 = q[0, 0], q[0, 1], q[0, 2], q[0, 3], q[0, 4], q[0, 5]
    r0, r1, r2, r3, r4, r5 = q[1, 0], q[1, 1], q[1, 2], q[1, 3], q[1, 4], q[1, 5]
    ce, cn, k = numbers[CENTRE_E], numbers[CENTRE_N], numbers[PER_UNIT]
    off = 0.0
    for i in range(len(x)):
        u, v = (x[i] - ce) * k, (y[i] - cn) * k
        at = c0 + u * (c1 + c3 * u + c4 * v) + v * (c2 + c5 * v)
        down = r0 + u * (r1 + r3 * u + r4 * v) + v * (r2 + r5 * v)
        off += 1.0 if (at < -EDGE) | (at > right + EDGE) | (down < -EDGE) | (down > low + EDGE) else 0.0
        column[i] = at
        row[i] = down
    return off


@device
def darken(raster, column, row, out):  # type: ignore[no-untyped-def]
    """NaN where a sample is off the raster."""
    right, low = raster.shape[1] - 1.0, raster.shape[0] - 1.0
    for t in range(len(column)):
        if column[t] < -EDGE or column[t] > right + EDGE or row[t] < -EDGE or row[t] > low + EDGE:
            out[t] = math.nan


@device
def lookup(raster, quadratic, numbers, x, y, out, column, row):  # type: ignore[no-untyped-def]
    """Bilinear heights at all samples; NaN where unknown."""
    off = place(raster, quadratic, numbers, x, y, column, row)
    rows, cols = raster.shape
    right, low = cols - 1.0, rows - 1.0
    for t in range(len(x)):
        at, down = min(max(column[t], 0.0), right), min(max(row[t], 0.0), low)
        i, j = min(np.int64(at), cols - 2), min(np.int64(down), rows - 2)
        out[t] = bilinear(raster, j, i, at - i, down - j)
    if off > 0.0:
        darken(raster, column, row, out)


@device
def lookup_both(raster, other, quadratic, numbers, x, y, out, other_out, column, row):  # type: ignore[no-untyped-def]
    """`lookup` in two rasters of one grid."""
    off = place(raster, quadratic, numbers, x, y, column, row)
    rows, cols = raster.shape
    right, low = cols - 1.0, rows - 1.0
    for t in range(len(x)):
        at, down = min(max(column[t], 0.0), right), min(max(row[t], 0.0), low)
        i, j = min(np.int64(at), cols - 2), min(np.int64(down), rows - 2)
        a, b = at - i, down - j
        out[t] = bilinear(raster, j, i, a, b)
        other_out[t] = bilinear(other, j, i, a, b)
    if off > 0.0:
        darken(raster, column, row, out)
        darken(raster, column, row, other_out)


@device
def one_grid(raster, to_raster, other, to_other):  # type: ignore[no-untyped-def]
    """Whether two rasters have the same nodes."""
    same = raster.shape == other.shape
    for k in range(6):
        same = same and to_raster[0, k] == to_other[0, k] and to_raster[1, k] == to_other[1, k]
    return same


@device
def gap_to(zone, corners, x, y):  # type: ignore[no-untyped-def]
    """Signed horizontal distance from a zone's shape, negative inside."""
    count = int(zone[CORNERS])
    if count == 0:
        dx, dy = x - zone[ZE], y - zone[ZN]
        return math.sqrt(dx * dx + dy * dy) - zone[ZR]
    first = int(zone[FIRST])
    nearest, inside = 1e300, False
    for k in range(count):
        ax, ay = corners[first + k, 0], corners[first + k, 1]
        b = first + (k + 1 if k + 1 < count else 0)
        dx, dy = corners[b, 0] - ax, corners[b, 1] - ay
        px, py = x - ax, y - ay
        if (ay > y) != (ay + dy > y) and px < dx * py / dy:
            inside = not inside
        t = min(max((px * dx + py * dy) / max(dx * dx + dy * dy, 1e-300), 0.0), 1.0)
        ex, ey = px - t * dx, py - t * dy
        nearest = min(nearest, ex * ex + ey * ey)
    return -math.sqrt(nearest) if inside else math.sqrt(nearest)


@kernel
def clocks_of(paths, speed_m_s, out, sources=SOURCES):  # type: ignore[no-untyped-def]
    """Seconds from the start of ``paths`` (P, S, 3) at one speed into ``out`` (P, S)."""
    for p in range(len(paths)):
        total = 0.0
        out[p, 0] = 0.0
        for i in range(1, paths.shape[1]):
            dx, dy = paths[p, i, 0] - paths[p, i - 1, 0], paths[p, i, 1] - paths[p, i - 1, 1]
            dz = paths[p, i, 2] - paths[p, i - 1, 2]
            total += math.sqrt(dx * dx + dy * dy + dz * dz) / speed_m_s
            out[p, i] = total


@kernel
def nearness(paths, clocks, others, other_clocks, apart_m, soon_s, out, sources=SOURCES):  # type: ignore[no-untyped-def]
    """MSFOA eq. 28–30 into ``out`` (P,): Σ (soon_s - gap)³ over pairs of points nearer than ``apart_m``.

    ``paths`` (P, S, 3) with ``clocks`` (P, S) against ``others`` (Q, 3) with ``other_clocks`` (Q,), seconds.
    No clock may fall along its path.
    """
    square = apart_m * apart_m
    for p in range(len(paths)):
        total, first = 0.0, 0
        for i in range(paths.shape[1]):
            x, y, z, now = paths[p, i, 0], paths[p, i, 1], paths[p, i, 2], clocks[p, i]
            # Both clocks rise: what is too long ago for this sample is so for all that follow.
            while first < len(others) and now - other_clocks[first] >= soon_s:
                first += 1
            for q in range(first, len(others)):
                if other_clocks[q] - now >= soon_s:
                    break
                dx, dy, dz = others[q, 0] - x, others[q, 1] - y, others[q, 2] - z
                if dx * dx + dy * dy + dz * dz < square:
                    gap = max(soon_s - abs(now - other_clocks[q]), 0.0)
                    total += gap * gap * gap
        out[p] = total


@kernel
def shut_by_zones(points, ground, low, high, zones, corners, out, sources=SOURCES):  # type: ignore[no-untyped-def]
    """True in ``out`` (N,) where a zone leaves no room, over or under it, between ``low`` and ``high`` (N,)."""
    for i in range(len(points)):
        out[i] = False
        for k in range(len(zones)):
            zone = zones[k]
            dx, dy = points[i, 0] - zone[ZE], points[i, 1] - zone[ZN]
            reach = zone[ZR] + zone[REACH]
            if dx * dx + dy * dy >= reach * reach:
                continue
            bottom = zone[Z_LOW] + (ground[i] if zone[LOW_AGL] != 0.0 else 0.0)
            top = zone[Z_HIGH] + (ground[i] if zone[HIGH_AGL] != 0.0 else 0.0)
            if bottom < low[i] and top > high[i] and gap_to(zone, corners, points[i, 0], points[i, 1]) < zone[REACH]:
                out[i] = True
                break


@kernel
def open_edges(  # type: ignore[no-untyped-def]
    starts, ends, step_m, grounded, heights, quadratic, floors, floor_map, numbers, zones, corners, out,
    sources=SOURCES,
):  # fmt: skip
    """Lengths of straight edges from ``starts`` (A, 3) to ``ends`` (B, 3) into ``out`` (A, B); inf where a point of
    one, no further than ``step_m`` from the next, is not allowed, or where it is too steep."""
    for a in range(len(starts)):
        for b in range(len(ends)):
            x, y, z = starts[a, 0], starts[a, 1], starts[a, 2]
            dx, dy, dz = ends[b, 0] - x, ends[b, 1] - y, ends[b, 2] - z
            run = math.sqrt(dx * dx + dy * dy)
            length = math.sqrt(run * run + dz * dz)
            out[a, b] = math.inf
            if dz > numbers[UP] * run + 1e-9 or -dz > numbers[DOWN] * run + 1e-9:
                continue
            parts = math.ceil(run / step_m) + 1
            allowed = True
            for i in range(1, parts):
                t = i / parts
                px, py, pz = x + t * dx, y + t * dy, z + t * dz
                floor, ceiling, ground = height_at(floors, floor_map, numbers, px, py), numbers[MAX_AMSL], 0.0
                if grounded:
                    ground = height_at(heights, quadratic, numbers, px, py)
                    ceiling = min(ground + numbers[MAX_AGL], ceiling)
                if not floor <= pz <= ceiling:
                    allowed = False
                    break
                for k in range(len(zones)):
                    zone = zones[k]
                    ex, ey = px - zone[ZE], py - zone[ZN]
                    reach = zone[ZR] + zone[REACH]
                    if ex * ex + ey * ey >= reach * reach:
                        continue
                    low, high = zone[Z_LOW] + zone[LOW_AGL] * ground, zone[Z_HIGH] + zone[HIGH_AGL] * ground
                    if low < pz < high and gap_to(zone, corners, px, py) < zone[REACH]:
                        allowed = False
                        break
                if not allowed:
                    break
            if allowed:
                out[a, b] = length
