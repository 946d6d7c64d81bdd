"""Climb cones: how high a path can be near the ends of a leg, so that a bound may exclude higher altitudes.

At a node, a path is at most as high as the end's altitude plus the slope times a length: the length of a free track to
the node, and the length that the path has to spare. `look_around` finds the nodes that are higher and measures straight
lines to them, `walk_around` measures tracks to nodes out of sight, and `hold_down` raises the excess of the nodes.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Int8s, Int32s
from gcsplan.planners.compiled import device, kernel
from gcsplan.planners.optimal.navmesh.clearance_kernels import blank
from gcsplan.planners.optimal.navmesh.mesh_kernels import stands
from gcsplan.planners.optimal.navmesh.polyanya import pop, push
from gcsplan.planners.optimal.navmesh.zone_kernels import BOTTOM, PAIR, THIN, TOP, UNDER, depth, level

NODES_BESIDE = 5
"""Nodes on each side of the nodes that a cone could shut whose distance must be known, too."""
FROM_END = -1
"""Value of ``root`` where the straight line to a node begins at the end of the leg, not at a node."""
LONG = 40.0
"""Cells after which a straight line is ended at the node it has reached: checking long lines is most of the work."""
SHUT = 3
"""Value of ``seen`` at a node that lies in a wall."""


@kernel("i4[,] f8[,] f8[,] f8[,] f8[,] f8[,] f8[,] i4[,] f8 f8 f8[,] i1[,]")
def lift_lids(
    around: Int32s, floor: Floats, ground: Floats, x: Floats, y: Floats, zones: Floats, edges: Floats, boxes: Int32s,
    cap: float, rim: float, lift: Floats, either: Int8s,
) -> None:  # fmt: skip
    """Set ``lift`` at each node of ``around`` to how far, m, zones there that can be flown over below ``cap`` are
    higher than the floor; 0 where there is none. Only nodes at most ``rim`` deep in a zone count: a path that does not
    get past them gets no farther in. Set ``either`` (zeros before) to 1 where a zone can be flown under, too."""
    blank(lift, around, 0.0)
    for z in range(len(zones)):
        if zones[z, PAIR] > 0.0 or zones[z, TOP] == np.inf:
            continue
        for j in range(boxes[z, 2], boxes[z, 3] + 2):
            for i in range(max(boxes[z, 0], around[j, 0]), min(boxes[z, 1] + 2, around[j, 1])):
                top = level(zones, z, TOP, ground[j, i])
                more = top - floor[j, i]
                if zones[z, UNDER] > 0.0 and top - level(zones, z, BOTTOM, ground[j, i]) <= zones[z, THIN]:
                    continue
                if not 0.0 < more <= cap - floor[j, i] or not 0.0 < depth(zones, edges, z, x[j, i], y[j, i]) <= rim:
                    continue
                lift[j, i] = max(lift[j, i], more)
                if zones[z, UNDER] > 0.0 and floor[j, i] <= level(zones, z, BOTTOM, ground[j, i]):
                    either[j, i] = 1


@kernel("i4[,] f8[,] f8[,] f8[,] i4[] f8[,] f8[,] f8[,] f8[] i1[,] f8[,]")
def look_around(
    around: Int32s, excess: Floats, floor: Floats, lift: Floats, of: Int32s, values: Floats, x: Floats, y: Floats,
    cone: Floats, seen: Int8s, away: Floats,
) -> int:  # fmt: skip
    """Find the nodes near an end that are higher than a path can climb to from there, and the nodes around them.

    ``cone``: x, y, column, row, height, slope, cap. Sets ``seen`` (rows, cols, zeros before) to 1 at nodes that the end
    sees across wholly free cells, with their distance in ``away`` (else inf), and to -1 or -2 at others whose distance
    is needed. Returns how many of those are free and in no wall. ``around``: see `clearance_kernels.blank`; ``lift``:
    by how much zones that may have to be flown over are higher than the floor.
    """
    left, right, low, high = _box(x, y, cone)
    missing = 0
    blank(away, around, math.inf)
    # Distances are needed only at nodes that the cone could shut, and at some nodes around them.
    if right < left or not _mark(around, excess, floor, lift, x, y, cone, left, right, low, high, seen):
        return 0
    for j in range(low, high + 1):
        for i in range(max(left, around[j, 0]), min(right + 1, around[j, 1])):
            if seen[j, i] < 0 and _open(excess, lift, j, i):
                if _sees(excess, lift, of, cone[2], cone[3], i, j, True):
                    seen[j, i] = 1
                    away[j, i] = math.sqrt((x[j, i] - cone[0]) ** 2 + (y[j, i] - cone[1]) ** 2)
                elif not _walled(of, values, excess.shape, j, i):
                    missing += 1
    return missing


@kernel("i4[,] f8[,] f8[,] i4[] f8[,] f8[,] f8[] i1[,] f8[,] i8 f8[,] i4[,] i1[,] f8[] i4[]")
def walk_around(
    around: Int32s, excess: Floats, lift: Floats, of: Int32s, x: Floats, y: Floats, cone: Floats, seen: Int8s,
    away: Floats, missing: int, way: Floats, root: Int32s, done: Int8s, heap: Floats, ids: Int32s,
) -> None:  # fmt: skip
    """Measure tracks to the ``missing`` nodes that `look_around` left: from node to node, or straight from a node
    farther back where that line is free (lazy Theta*: Nash, Koenig and Tovey, AAAI 2010).

    They are somewhat longer than the shortest. Sets ``away``, and ``seen`` to 2. Work arrays: ``way``, ``root``,
    ``done`` (rows, cols; the last zeros before), ``heap``, ``ids`` (8 rows cols,).
    """
    left, right, low, high = _box(x, y, cone)
    nx = excess.shape[1]
    farthest = (cone[6] - cone[4]) / cone[5]
    blank(way, around, math.inf)
    size = 0
    i0, j0 = int(math.floor(cone[2])), int(math.floor(cone[3]))
    for j in range(max(j0 - 1, low), min(j0 + 2, high) + 1):
        for i in range(max(i0 - 1, left), min(i0 + 2, right) + 1):
            if _open(excess, lift, j, i) and _sees(excess, lift, of, cone[2], cone[3], i, j, True):
                way[j, i], root[j, i] = math.sqrt((x[j, i] - cone[0]) ** 2 + (y[j, i] - cone[1]) ** 2), FROM_END
                size = push(heap, ids, size, way[j, i], j * nx + i)
    while size > 0 and missing > 0 and heap[0] <= farthest:
        key, j, i = heap[0], ids[0] // nx, ids[0] % nx
        size = pop(heap, ids, size)
        if key > way[j, i] or done[j, i] > 0:
            continue
        at = root[j, i]
        from_end = at == FROM_END
        col, row = (cone[2], cone[3]) if from_end else (float(at % nx), float(at // nx))
        if not _sees(excess, lift, of, col, row, i, j, from_end):
            # The line from its root is not free: reach it from the best of its neighbours instead.
            way[j, i] = np.inf
            for q in range(max(j - 1, low), min(j + 1, high) + 1):
                for p in range(max(i - 1, left), min(i + 1, right) + 1):
                    step = math.sqrt((x[q, p] - x[j, i]) ** 2 + (y[q, p] - y[j, i]) ** 2)
                    new = way[q, p] + step
                    if done[q, p] > 0 and new < way[j, i] and _steps(excess, lift, of, i, j, p, q):
                        way[j, i], root[j, i] = new, q * nx + p
            if way[j, i] > key:
                if way[j, i] < np.inf:
                    size = push(heap, ids, size, way[j, i], j * nx + i)
                continue
        done[j, i] = 1
        if seen[j, i] < 0 and away[j, i] == np.inf:
            away[j, i] = way[j, i]
            seen[j, i] = 2
            missing -= 1
        back, from_x, from_y, known = root[j, i], cone[0], cone[1], 0.0
        col, row = (cone[2], cone[3]) if back == FROM_END else (float(back % nx), float(back // nx))
        if max(abs(i - col), abs(j - row)) > LONG:
            back = j * nx + i
        if back != FROM_END:
            from_x, from_y = x[back // nx, back % nx], y[back // nx, back % nx]
            known = way[back // nx, back % nx]
        for q in range(max(j - 1, low), min(j + 1, high) + 1):
            for p in range(max(i - 1, left), min(i + 1, right) + 1):
                if done[q, p] > 0:
                    continue
                new = known + math.sqrt((x[q, p] - from_x) ** 2 + (y[q, p] - from_y) ** 2)
                if new < way[q, p] - 1e-9 and size < len(heap) and _steps(excess, lift, of, i, j, p, q):
                    way[q, p], root[q, p] = new, back
                    size = push(heap, ids, size, new, q * nx + p)


@kernel("i4[,] f8[,] f8[,] f8[,] i1[,] i4[] f8[,] f8[,] f8[,] f8[] b1 i1[,] f8[,]")
def hold_down(
    around: Int32s, excess: Floats, floor: Floats, lift: Floats, either: Int8s, of: Int32s, values: Floats,
    x: Floats, y: Floats, cone: Floats, lone: bool, seen: Int8s, away: Floats,
) -> None:  # fmt: skip
    """Raise the excess of nodes near an end to the floor minus the altitude that a path can climb to; for bounds only.

    No path short enough to matter is higher at a node than the cone's height plus its slope times the length of a free
    track to the node. A node is changed only if such lengths to it and to all nodes around it are known. ``lone``: no
    other end's cone comes near this one's; ``lift``, ``either``: see `lift_lids`.
    """
    left, right, low, high = _box(x, y, cone)
    height, slope, cap = cone[4], cone[5], cone[6]
    ny, nx = excess.shape
    # Nodes in a wall count as far away as by way of their farthest free neighbour.
    for j in range(low, high + 1):
        for i in range(max(left, around[j, 0]), min(right + 1, around[j, 1])):
            unknown = seen[j, i] < 0 and away[j, i] == math.inf and excess[j, i] < math.inf
            # A zone that is now too high to fly over may still be flown under; the length of that track is unknown.
            over = not _open(excess, lift, j, i) and (either[j, i] == 0 or excess[j, i] > 0.0)
            if unknown and (over or _walled(of, values, excess.shape, j, i)):
                seen[j, i] = SHUT
    for j in range(low, high + 1):
        for i in range(max(left, around[j, 0]), min(right + 1, around[j, 1])):
            if seen[j, i] == SHUT:
                away[j, i] = _behind(excess, lift, of, values, x, y, seen, away, i, j)
    i0, j0 = min(max(int(cone[2]), 0), nx - 2), min(max(int(cone[3]), 0), ny - 2)
    diagonal = math.sqrt((x[j0 + 1, i0 + 1] - x[j0, i0]) ** 2 + (y[j0 + 1, i0 + 1] - y[j0, i0]) ** 2)
    other = math.sqrt((x[j0, i0 + 1] - x[j0 + 1, i0]) ** 2 + (y[j0, i0 + 1] - y[j0 + 1, i0]) ** 2)
    diagonal = max(diagonal, other)
    spare = 0.25 * slope * diagonal
    for j in range(max(low, 1), min(high, ny - 2) + 1):
        for i in range(max(left, around[j, 0], 1), min(right + 1, around[j, 1], nx - 1)):
            known, straight = seen[j, i] > 0, True
            for q in range(-1, 2):
                for p in range(-1, 2):
                    known = known and away[j + q, i + p] < math.inf
                    straight = straight and seen[j + q, i + p] == 1
            if not known:
                continue
            # Between nodes that are not seen, lengths may exceed the interpolated ones by half a cell's diagonal.
            top = height + slope * (away[j, i] + (0.0 if straight else 0.5 * diagonal))
            # A cone is convex, so interpolated excess is never too high over a cell, except where the cone meets the
            # cap or another cone: there a margin is subtracted.
            if lone and top < cap - 8.0 * spare:
                excess[j, i] = max(excess[j, i], floor[j, i] - top)
            elif top < cap + 4.0 * spare:
                excess[j, i] = max(excess[j, i], floor[j, i] - top) - spare


@device
def _box(x: Floats, y: Floats, cone: Floats) -> tuple[int, int, int, int]:
    """First and last column, first and last row that a cone reaches below its cap; (0, -1, 0, -1) if there is none."""
    ny, nx = x.shape
    i0, j0 = min(max(int(cone[2]), 0), nx - 2), min(max(int(cone[3]), 0), ny - 2)
    step_x = math.sqrt((x[j0, i0 + 1] - x[j0, i0]) ** 2 + (y[j0, i0 + 1] - y[j0, i0]) ** 2)
    step_y = math.sqrt((x[j0 + 1, i0] - x[j0, i0]) ** 2 + (y[j0 + 1, i0] - y[j0, i0]) ** 2)
    if not (cone[4] < cone[6] and step_x > 0.0 and step_y > 0.0):
        return 0, -1, 0, -1
    farthest = (cone[6] - cone[4]) / cone[5]
    wide, tall = int(1.05 * farthest / step_x) + 2, int(1.05 * farthest / step_y) + 2
    return max(i0 - wide, 0), min(i0 + wide + 1, nx - 1), max(j0 - tall, 0), min(j0 + tall + 1, ny - 1)


@device
def _open(excess: Floats, lift: Floats, j: int, i: int) -> bool:
    """Whether a node can be flown over, together with the zones there that may have to be flown over."""
    return bool(excess[j, i] + lift[j, i] <= 0.0)


@device
def _mark(
    around: Int32s, excess: Floats, floor: Floats, lift: Floats, x: Floats, y: Floats, cone: Floats, left: int,
    right: int, low: int, high: int, seen: Int8s,
) -> bool:  # fmt: skip
    """Set ``seen`` to -1 at nodes above a cone, to -1 or -2 at `NODES_BESIDE` nodes around; return whether any are."""
    wide, found = NODES_BESIDE, False
    for j in range(low, high + 1):
        last = -wide - 1
        for i in range(max(left, around[j, 0]), min(right + 1, around[j, 1])):
            top = cone[4] + cone[5] * math.sqrt((x[j, i] - cone[0]) ** 2 + (y[j, i] - cone[1]) ** 2)
            if excess[j, i] < math.inf and floor[j, i] + lift[j, i] > top:
                for k in range(max(i - wide, left, last + 1), min(i + wide, right) + 1):
                    seen[j, k] = -1
                last, found = min(i + wide, right), True
    if not found:
        return False
    for j in range(low, high + 1):
        for i in range(max(left, around[j, 0]), min(right + 1, around[j, 1])):
            if seen[j, i] == -1:
                for k in range(max(j - wide, low), min(j + wide, high) + 1):
                    if seen[k, i] == 0:
                        seen[k, i] = -2
    return True


@device
def _steps(excess: Floats, lift: Floats, of: Int32s, i: int, j: int, p: int, q: int) -> bool:
    """Whether a track may lead from a free node (j, i) straight to its neighbour (q, p)."""
    ny, nx = excess.shape
    if not _open(excess, lift, q, p):
        return False
    for cj in range(max(max(j, q) - 1, 0), min(min(j, q), ny - 2) + 1):
        for ci in range(max(max(i, p) - 1, 0), min(min(i, p), nx - 2) + 1):
            whole = p == i or q == j or (
                _open(excess, lift, cj, ci) and _open(excess, lift, cj, ci + 1)
                and _open(excess, lift, cj + 1, ci) and _open(excess, lift, cj + 1, ci + 1)
            )  # fmt: skip
            if whole and of[cj * (nx - 1) + ci] == 0:
                return True
    return False


@device
def _walled(of: Int32s, values: Floats, shape: tuple[int, int], j: int, i: int) -> bool:
    """Whether a node lies in a wall in every cell around it."""
    ny, nx = shape
    for k in range(4):
        jj, ii = j - (k >> 1), i - ((k ^ (k >> 1)) & 1)
        if 0 <= jj < ny - 1 and 0 <= ii < nx - 1 and not stands(of, values, jj * (nx - 1) + ii, k, 0.0):
            return False
    return True


@device
def _behind(
    excess: Floats, lift: Floats, of: Int32s, values: Floats, x: Floats, y: Floats, seen: Int8s, away: Floats,
    i: int, j: int,
) -> float:  # fmt: skip
    """The length of a track to a node in a wall by way of its farthest free neighbour; inf if that is not known, 0 if
    no neighbour is free: nothing there can be flown anyway."""
    most = 0.0
    for b in range(max(j - 1, 0), min(j + 1, excess.shape[0] - 1) + 1):
        for a in range(max(i - 1, 0), min(i + 1, excess.shape[1] - 1) + 1):
            if _open(excess, lift, b, a) and seen[b, a] != SHUT:
                if away[b, a] == math.inf and _walled(of, values, excess.shape, b, a):
                    continue
                most = max(most, away[b, a] + math.sqrt((x[b, a] - x[j, i]) ** 2 + (y[b, a] - y[j, i]) ** 2))
    return most


@device
def _sees(excess: Floats, lift: Floats, of: Int32s, col: float, row: float, i: int, j: int, ends: bool) -> bool:
    """Whether the straight line from a place (``col``, ``row``) to node (j, i) meets only wholly free cells. ``ends``:
    the place is the end of a leg."""
    nx = excess.shape[1]
    du, dv = i - col, j - row
    u, v = col, row
    ci, cj = int(math.floor(u)), int(math.floor(v))
    # The last cell of the line before it reaches the node.
    end_i = i - 1 if du > 0.0 else i
    end_j = j - 1 if dv > 0.0 else j
    for _ in range(abs(end_i - ci) + abs(end_j - cj) + 3):
        if not (0 <= ci < nx - 1 and 0 <= cj < excess.shape[0] - 1):
            return False
        if of[cj * (nx - 1) + ci] > 0:
            return False
        # The end's own cell may be free only in part: more often than not, the end lies on the floor.
        if not (ends and ci == int(math.floor(col)) and cj == int(math.floor(row))) and not (
            _open(excess, lift, cj, ci) and _open(excess, lift, cj, ci + 1)
            and _open(excess, lift, cj + 1, ci) and _open(excess, lift, cj + 1, ci + 1)
        ):  # fmt: skip
            return False
        if ci == end_i and cj == end_j:
            return True
        # Go to the next cell across the nearer of the two edges ahead.
        tu = (ci + (1 if du > 0.0 else 0) - col) / du if du != 0.0 else math.inf
        tv = (cj + (1 if dv > 0.0 else 0) - row) / dv if dv != 0.0 else math.inf
        if tu < tv:
            if tu >= 1.0:
                return True
            ci += 1 if du > 0.0 else -1
        else:
            if tv >= 1.0:
                return True
            cj += 1 if dv > 0.0 else -1
    return False
