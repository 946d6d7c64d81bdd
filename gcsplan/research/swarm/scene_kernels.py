"""A scene's numbers by name, kernels for heights and distances, and the kernels of ants and repair."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Bools, Floats, Singles
from gcsplan.research.swarm.compiled import device, kernel

GROUND = "f4[,] f8[,] f4[,] f8[,] f8[]"
"""Forms of a scene's heights, quadratic, floors, floor_map and numbers."""

SCENE = f"{GROUND} f8[,] f8[,]"
"""The same, and the types of its zones and corners."""

# Indices of a scene's numbers.
(
    MAX_AGL, MAX_AMSL, UP, DOWN, WEST, SOUTH, BOTTOM, EAST, NORTH, TOP, CENTRE_E, CENTRE_N, PER_UNIT,
    H_MIN, H_MAX, SPACING,
) = range(16)  # fmt: skip
NUMBERS = 16

# Columns of a zone. CORNERS: 0 for a circle, otherwise the number of corners of a polygon, which begin at row FIRST.
ZE, ZN, ZR, REACH, Z_LOW, Z_HIGH, LOW_AGL, HIGH_AGL, CORNERS, FIRST, Z_MIDDLE = range(11)
ZONE_COLUMNS = 11

EDGE = 1e-6  # tolerance at the raster's edge, in cells, for float noise


@device
def bilinear(raster: Singles, j: int | np.uint32, i: int | np.uint32, a: float, b: float) -> float:
    """Bilinear value in the cell of row ``j`` and column ``i``, at its parts ``a`` along the row and ``b`` down."""
    north = raster[j, i] + a * (raster[j, i + 1] - raster[j, i])
    south = raster[j + 1, i] + a * (raster[j + 1, i + 1] - raster[j + 1, i])
    return float(north + b * (south - north))


@device
def height_at(heights: Singles, quadratic: Floats, numbers: Floats, e: float, n: float) -> float:
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


@kernel("f4[,] f8[,] f8[] f8[,] f8[]")
def heights_at(heights: Singles, quadratic: Floats, numbers: Floats, points: Floats, out: Floats) -> None:
    """Write bilinear heights under points (N, 2 or more) to ``out`` (N,)."""
    for k in range(len(points)):
        out[k] = height_at(heights, quadratic, numbers, points[k, 0], points[k, 1])


@kernel(f"{GROUND} f8[,] b1 f8[] f8[]")
def rooms(
    heights: Singles, quadratic: Floats, floors: Singles, floor_map: Floats, numbers: Floats, points: Floats,
    follows: bool, low: Floats, high: Floats,
) -> None:  # fmt: skip
    """Write the lowest and highest legal altitudes (N,) at points (N, 2 or more), as `Scene.room` has them.

    ``follows``: the ceiling follows the ground.
    """
    bottom, top = numbers[BOTTOM], numbers[TOP]
    for k in range(len(points)):
        e, n = points[k, 0], points[k, 1]
        floor, ceiling = height_at(floors, floor_map, numbers, e, n), numbers[MAX_AMSL]
        if follows:
            ground = height_at(heights, quadratic, numbers, e, n)
            if ground == ground:
                ceiling = min(ceiling, ground + numbers[MAX_AGL])
        high[k] = min(max(ceiling, bottom), top)
        low[k] = min(max(floor, bottom), high[k]) if floor == floor else high[k]


@device
def place(
    raster: Singles, quadratic: Floats, numbers: Floats, x: Floats, y: Floats, column: Floats, row: Floats
) -> float:
    """Write columns and rows of all samples in a raster; return how many are off it.

    A loop of its own without branches, so that the compiler vectorises it.
    """
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
def darken(raster: Singles, column: Floats, row: Floats, out: Floats) -> None:
    """Set ``out`` to NaN where a sample is off the raster."""
    right, low = raster.shape[1] - 1.0, raster.shape[0] - 1.0
    for t in range(len(out)):
        if column[t] < -EDGE or column[t] > right + EDGE or row[t] < -EDGE or row[t] > low + EDGE:
            out[t] = math.nan


@device
def lookup(raster: Singles, column: Floats, row: Floats, off: float, out: Floats) -> None:
    """Write bilinear heights at places in a raster to ``out``, NaN where unknown; ``off`` places are off the raster."""
    rows, cols = raster.shape
    right, low = cols - 1.0, rows - 1.0
    last_i, last_j = np.int32(cols - 2), np.int32(rows - 2)
    for t in range(len(out)):
        at, down = min(max(column[t], 0.0), right), min(max(row[t], 0.0), low)
        i, j = min(np.int32(at), last_i), min(np.int32(down), last_j)
        out[t] = bilinear(raster, np.uint32(j), np.uint32(i), at - i, down - j)
    if off > 0.0:
        darken(raster, column, row, out)


@device
def lookup_both(
    raster: Singles, other: Singles, column: Floats, row: Floats, off: float, out: Floats, other_out: Floats
) -> None:
    """`lookup` in two rasters of the same grid."""
    rows, cols = raster.shape
    right, low = cols - 1.0, rows - 1.0
    last_i, last_j = np.int32(cols - 2), np.int32(rows - 2)
    for t in range(len(out)):
        at, down = min(max(column[t], 0.0), right), min(max(row[t], 0.0), low)
        i, j = min(np.int32(at), last_i), min(np.int32(down), last_j)
        a, b = at - i, down - j
        out[t] = bilinear(raster, np.uint32(j), np.uint32(i), a, b)
        other_out[t] = bilinear(other, np.uint32(j), np.uint32(i), a, b)
    if off > 0.0:
        darken(raster, column, row, out)
        darken(other, column, row, other_out)


@device
def one_grid(raster: Singles, to_raster: Floats, other: Singles, to_other: Floats) -> bool:
    """Whether two rasters have the same nodes."""
    same = raster.shape == other.shape
    for k in range(6):
        same = same and to_raster[0, k] == to_other[0, k] and to_raster[1, k] == to_other[1, k]
    return same


@device
def gap_to(zone: Floats, corners: Floats, x: float, y: float) -> float:
    """Signed horizontal distance from a zone's shape, negative inside."""
    count = int(zone[CORNERS])
    if count == 0:
        dx, dy = x - zone[ZE], y - zone[ZN]
        return math.sqrt(dx * dx + dy * dy) - float(zone[ZR])
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


@kernel("f8[,,] f8 f8[,]")
def clocks_of(paths: Floats, speed_m_s: float, out: Floats) -> None:
    """Write the seconds from the start of ``paths`` (P, S, 3), at constant speed, to ``out`` (P, S)."""
    for p in range(len(paths)):
        total = 0.0
        out[p, 0] = 0.0
        for i in range(1, paths.shape[1]):
            dx, dy = paths[p, i, 0] - paths[p, i - 1, 0], paths[p, i, 1] - paths[p, i - 1, 1]
            dz = paths[p, i, 2] - paths[p, i - 1, 2]
            total += math.sqrt(dx * dx + dy * dy + dz * dz) / speed_m_s
            out[p, i] = total


@kernel("f8[,,] f8[,] f8[,] f8[] f8 f8 f8[]")
def nearness(
    paths: Floats, clocks: Floats, others: Floats, other_clocks: Floats, apart_m: float, soon_s: float, out: Floats
) -> None:
    """Write MSFOA eq. 28–30 to ``out`` (P,): Σ (soon_s - gap)³ over pairs of points closer than ``apart_m``.

    Compares ``paths`` (P, S, 3) with times ``clocks`` (P, S) to ``others`` (Q, 3) with times ``other_clocks`` (Q,), in
    seconds. Times must not decrease along a path. ``gap`` is the time between two points, counted up to ``soon_s``.
    """
    square = apart_m * apart_m
    for p in range(len(paths)):
        total, first = 0.0, 0
        for i in range(paths.shape[1]):
            x, y, z, now = paths[p, i, 0], paths[p, i, 1], paths[p, i, 2], clocks[p, i]
            # Times rise along both paths: a point that is too long ago for this sample is so for all later ones.
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


@kernel("f8[,] f8[] f8[] f8[] f8[,] f8[,] b1[]")
def shut_by_zones(
    points: Floats, ground: Floats, low: Floats, high: Floats, zones: Floats, corners: Floats, out: Bools
) -> None:
    """Write to ``out`` (N,) whether a zone closes all altitudes between ``low`` and ``high`` (N,) at a point."""
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


@kernel(f"f8[,] f8[,] f8 b1 {SCENE} f8[,]")
def open_edges(
    starts: Floats, ends: Floats, step_m: float, grounded: bool, heights: Singles, quadratic: Floats, floors: Singles,
    floor_map: Floats, numbers: Floats, zones: Floats, corners: Floats, out: Floats,
) -> None:  # fmt: skip
    """Write the lengths of straight edges from ``starts`` (A, 3) to ``ends`` (B, 3) to ``out`` (A, B).

    They are inf if an edge is too steep, or if one of its points, at most ``step_m`` apart, is not allowed.
    ``grounded``: the ceiling or a zone follows the ground.
    """
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
