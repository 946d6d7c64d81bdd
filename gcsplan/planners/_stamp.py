"""Zones laid on a lattice: cells that they shut get corner values of their own."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.compiled import device, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

EAST, NORTH, RADIUS, BOTTOM, TOP, BOTTOM_AGL, TOP_AGL, FIRST, LAST, UNDER = range(10)
PAIR, BOTTOM_2, TOP_2, BOTTOM_2_AGL, TOP_2_AGL, UNDER_2, NUMBERS = range(10, 17)


@device
def depth(zones: Floats, edges: Floats, z: int, x: float, y: float) -> float:
    """How far a point is inside a zone's convex shape: concave, above 0 inside."""
    if zones[z, RADIUS] >= 0.0:
        return zones[z, RADIUS] - math.sqrt((x - zones[z, EAST]) ** 2 + (y - zones[z, NORTH]) ** 2)
    depth = np.inf
    for k in range(int(zones[z, FIRST]), int(zones[z, LAST])):
        depth = min(depth, _within(edges, k, x, y))
    return depth


@device
def _within(edges: Floats, k: int, x: float, y: float) -> float:
    """How far a point is inside a disc or a half-plane."""
    if edges[k, 3] > 0.0:
        return edges[k, 0] - math.sqrt((x - edges[k, 1]) ** 2 + (y - edges[k, 2]) ** 2)
    return edges[k, 0] - edges[k, 1] * x - edges[k, 2] * y


@device
def level(zones: Floats, z: int, level: int, ground: float) -> float:
    """A level of a zone where the ground is so high; its datum is told two numbers further on."""
    return zones[z, level] + (ground if zones[z, level + 2] > 0.0 else 0.0)


@device
def _open(zones: Floats, z: int, floor: float, allowed: float, ground: float) -> bool:
    """Whether there is an altitude to fly at, over a zone, under it, or between the two of a pair."""
    bottom, top = level(zones, z, BOTTOM, ground), level(zones, z, TOP, ground)
    if zones[z, PAIR] == 0.0:
        return top <= allowed or (zones[z, UNDER] > 0.0 and floor <= bottom)
    bottom_2, top_2 = level(zones, z, BOTTOM_2, ground), level(zones, z, TOP_2, ground)
    under, under_2 = zones[z, UNDER] > 0.0, zones[z, UNDER_2] > 0.0
    if max(top, top_2) <= allowed or (under and under_2 and floor <= min(bottom, bottom_2)):
        return True
    if under_2 and top <= min(bottom_2, allowed) and floor <= bottom_2:
        return True
    return under and top_2 <= min(bottom, allowed) and floor <= bottom


@kernel("f8[,] f8[,] f8[,] f8[,] f8[,] f8[,] f8[,] i4[,] b1 i4[] f8[,]")
def stamp_zones(
    excess: Floats, floor: Floats, ground: Floats, x: Floats, y: Floats, zones: Floats, edges: Floats, boxes: Ints,
    low: bool, of: Ints, values: Floats,
) -> int:  # fmt: skip
    """Give cells that zones shut corner values of their own: how deep in the shape they lie. Returns how many.

    ``zones`` (Z, NUMBERS), ``boxes`` (Z, 4) first and last column and row of the cells each may touch. ``low``: only
    what is shut for certain (of several zones, and ground, the one that shuts most); else all that may be shut.
    """
    nx = excess.shape[1]
    count = 0
    for z in range(len(zones)):
        for j in range(boxes[z, 2], boxes[z, 3] + 1):
            for i in range(boxes[z, 0], boxes[z, 1] + 1):
                deepest, shallowest = -np.inf, np.inf
                ways = 0
                for k in range(4):
                    jj, ii = j + (k >> 1), i + ((k ^ (k >> 1)) & 1)
                    g = depth(zones, edges, z, x[jj, ii], y[jj, ii])
                    deepest, shallowest = max(deepest, g), min(shallowest, g)
                    if _open(zones, z, floor[jj, ii], floor[jj, ii] - excess[jj, ii], ground[jj, ii]):
                        ways += 1
                if ways == 4:
                    continue
                if shallowest > 0.0 and zones[z, PAIR] == 0.0 and zones[z, UNDER] == 0.0 and zones[z, TOP] < np.inf:
                    # The whole cell is under a lid, which is what must be flown over: bilinear, as ground is.
                    count = _lid(excess, floor, ground, zones, z, low, of, values, j, i, count)
                    continue
                if low and ways > 0:
                    if deepest > 0.0 and zones[z, PAIR] == 0.0:
                        count = _in_part(excess, floor, ground, x, y, zones, edges, z, of, values, j, i, count)
                    continue
                dx, dy = x[j + 1, i + 1] - x[j, i], y[j + 1, i + 1] - y[j, i]
                square = dx * dx + dy * dy
                more = 0.0
                if not low:
                    # A linear function under a concave one: by so much it may be too low between the corners.
                    more = 0.02
                    if zones[z, RADIUS] >= 0.0:
                        more += square / (8.0 * max(zones[z, RADIUS] - math.sqrt(square), 0.5 * math.sqrt(square)))
                    elif zones[z, LAST] - zones[z, FIRST] > 1.0 and shallowest < 0.0:
                        more += _kink(zones, edges, z, x, y, j, i)
                    if zones[z, RADIUS] >= 0.0 and deepest + more <= 0.0 and _meets(zones, z, x, y, j, i):
                        more = 0.02 - deepest  # a disc that no corner lies near
                if deepest + more <= 0.0:
                    continue
                k = j * (nx - 1) + i
                n = of[k]
                if n == 0:
                    count += 1
                    n = of[k] = count
                    for q in range(4):
                        values[n - 1, q] = excess[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)]
                was = now = 0.0
                for q in range(4):
                    g = more + depth(zones, edges, z, x[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)],
                                      y[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)])  # fmt: skip
                    if not low:
                        values[n - 1, q] = max(values[n - 1, q], g)
                    was += 1e6 if values[n - 1, q] > 0.0 else 0.0
                    was += min(max(values[n - 1, q], -1e3), 1e3)
                    now += (1e6 if g > 0.0 else 0.0) + min(max(g, -1e3), 1e3)
                if low and now > was:
                    for q in range(4):
                        values[n - 1, q] = depth(zones, edges, z, x[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)],
                                                  y[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)])  # fmt: skip
    return count


@device
def _shut(excess: Floats, floor: Floats, ground: Floats, zones: Floats, z: int, inside: float, j: int, i: int) -> float:
    """Above 0 where a node is ``inside`` a zone, above its underside and below what must be flown over."""
    g = ground[j, i]
    out = min(inside, level(zones, z, TOP, g) - floor[j, i] + excess[j, i])
    if zones[z, UNDER] > 0.0:
        out = min(out, floor[j, i] - level(zones, z, BOTTOM, g))
    return out


@device
def _in_part(
    excess: Floats, floor: Floats, ground: Floats, x: Floats, y: Floats, zones: Floats, edges: Floats, z: int,
    of: Ints, values: Floats, j: int, i: int, count: int,
) -> int:  # fmt: skip
    """Shut the part of a cell that certainly lies in a zone and can be passed neither over nor under it there.

    What tells that is the least of functions that are concave, or linear and not above the bilinear ones, in either
    triangle; a linear function between its corners lies nowhere above it. Where the ground is not what floors are
    measured from, its patch may be cut the wrong way, by no more than a quarter of its twist, and nothing is said of
    what is below a level over it. Returns how many cells have values of their own.
    """
    same, even, spare = floor[j, i] - ground[j, i], True, 0.0
    for q in range(1, 4):
        jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
        even = even and abs(floor[jj, ii] - ground[jj, ii] - same) <= 1e-9 * (1.0 + abs(floor[jj, ii]))
    if not even and zones[z, UNDER] > 0.0 and zones[z, BOTTOM_AGL] > 0.0:
        return count
    if not even and zones[z, TOP_AGL] > 0.0:
        spare = 0.25 * abs(ground[j, i] + ground[j + 1, i + 1] - ground[j, i + 1] - ground[j + 1, i])
    least, most = np.inf, -np.inf
    for q in range(4):
        jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
        least = min(least, depth(zones, edges, z, x[jj, ii], y[jj, ii]))
    inside = np.inf  # all of the cell is, if its corners are
    was = now = 0.0
    k = j * (excess.shape[1] - 1) + i
    n = of[k]
    for q in range(4):
        jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
        if least <= 0.0:
            inside = depth(zones, edges, z, x[jj, ii], y[jj, ii])
        g = _shut(excess, floor, ground, zones, z, inside, jj, ii) - spare
        h = excess[jj, ii] if n == 0 else values[n - 1, q]
        most = max(most, g)
        was += (1e6 if h > 0.0 else 0.0) + min(max(h, -1e3), 1e3)
        now += (1e6 if g > 0.0 else 0.0) + min(max(g, -1e3), 1e3)
    if most <= 0.0 or now <= was:
        return count
    if n == 0:
        count += 1
        n = of[k] = count
    for q in range(4):
        jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
        if least <= 0.0:
            inside = depth(zones, edges, z, x[jj, ii], y[jj, ii])
        values[n - 1, q] = _shut(excess, floor, ground, zones, z, inside, jj, ii) - spare
    return count


@device
def _lid(
    excess: Floats, floor: Floats, ground: Floats, zones: Floats, z: int, low: bool, of: Ints, values: Floats,
    j: int, i: int, count: int,
) -> int:  # fmt: skip
    """Give a cell the excess of a zone's ceiling where that is above the floor; returns how many have their own."""
    k = j * (excess.shape[1] - 1) + i
    more = 0
    for q in range(4):
        jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
        if level(zones, z, TOP, ground[jj, ii]) > floor[jj, ii]:
            more += 1
    n = of[k]
    if more == 0 or (low and (more < 4 or n > 0)):
        return count
    if n == 0:
        count += 1
        n = of[k] = count
        for q in range(4):
            values[n - 1, q] = excess[j + (q >> 1), i + ((q ^ (q >> 1)) & 1)]
    for q in range(4):
        jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
        values[n - 1, q] = max(values[n - 1, q], level(zones, z, TOP, ground[jj, ii]) - floor[jj, ii] + excess[jj, ii])
    return count


@device
def _meets(zones: Floats, z: int, x: Floats, y: Floats, j: int, i: int) -> bool:
    """Whether a disc reaches into the box around a cell."""
    west, east = min(x[j, i], x[j + 1, i]), max(x[j, i + 1], x[j + 1, i + 1])
    south, north = min(y[j, i], y[j, i + 1]), max(y[j + 1, i], y[j + 1, i + 1])
    dx = zones[z, EAST] - min(max(zones[z, EAST], west), east)
    dy = zones[z, NORTH] - min(max(zones[z, NORTH], south), north)
    return dx * dx + dy * dy < zones[z, RADIUS] ** 2


@device
def _kink(zones: Floats, edges: Floats, z: int, x: Floats, y: Floats, j: int, i: int) -> float:
    """How much the least of several linear functions may rise between a cell's corners above its interpolation."""
    most = 0.0
    for k in range(int(zones[z, FIRST]), int(zones[z, LAST])):
        # Where one edge alone binds at all four corners, the function is linear: nothing to add.
        alone = True
        for q in range(4):
            jj, ii = j + (q >> 1), i + ((q ^ (q >> 1)) & 1)
            own = _within(edges, k, x[jj, ii], y[jj, ii])
            if own > depth(zones, edges, z, x[jj, ii], y[jj, ii]) + 1e-9:
                alone = False
        if alone:
            return 0.0
        most = 1.0
    dx, dy = x[j + 1, i + 1] - x[j, i], y[j + 1, i + 1] - y[j, i]
    return 0.5 * math.sqrt(dx * dx + dy * dy) * most
