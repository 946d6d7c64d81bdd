"""The search nodes of `polyanya`, intervals on portals and the roots that see them, and the heap that orders them."""

from __future__ import annotations

import math

from gcsplan.arrays import Floats, Int32s, Int64s
from gcsplan.planners.compiled import device

ROOT_X, ROOT_Y, COST, LEFT_X, LEFT_Y, RIGHT_X, RIGHT_Y, AHEAD = range(8)
PIECE, CAME, PARENT, TURNS, PORTAL, NEXT = range(6)
LEFT, RIGHT, ROOT = range(3)
"""Columns of the arrays ``node``, ``link`` and ``name``, a row of which is one search node."""

SAME_M = 1e-6
"""Metres: places nearer to each other than this are one."""
GONE = -2
"""Value in column `PIECE` of a node that need not be opened any more."""


@device
def push(heap: Floats, ids: Int32s, size: int, key: float, item: int) -> int:
    """Add an item to a binary heap with the least key first; return the new size."""
    k = size
    while k > 0:
        up = (k - 1) >> 1
        if heap[up] <= key:
            break
        heap[k], ids[k] = heap[up], ids[up]
        k = up
    heap[k], ids[k] = key, item
    return size + 1


@device
def pop(heap: Floats, ids: Int32s, size: int) -> int:
    """Remove the first item, (heap[0], ids[0]), of a binary heap; return the new size."""
    size -= 1
    key, item = heap[size], ids[size]
    k = 0
    while True:
        down = 2 * k + 1
        if down >= size:
            break
        if down + 1 < size and heap[down + 1] < heap[down]:
            down += 1
        if key <= heap[down]:
            break
        heap[k], ids[k] = heap[down], ids[down]
        k = down
    heap[k], ids[k] = key, item
    return size


@device
def ahead_of(rx: float, ry: float, lx: float, ly: float, qx: float, qy: float, gx: float, gy: float) -> float:
    """The shortest distance from a root r through an interval (left end l, right end q) to the goal g, if nothing else
    is in the way."""
    ex, ey = qx - lx, qy - ly
    side_r = ex * (ry - ly) - ey * (rx - lx)
    side_g = ex * (gy - ly) - ey * (gx - lx)
    if abs(side_r) <= SAME_M * math.sqrt(ex * ex + ey * ey):
        # The interval is seen edge-on, so its left and right ends may be swapped.
        to_l = math.sqrt((lx - rx) ** 2 + (ly - ry) ** 2)
        to_q = math.sqrt((qx - rx) ** 2 + (qy - ry) ** 2)
        if max(to_l, to_q) < math.sqrt(ex * ex + ey * ey):
            return math.sqrt((gx - rx) ** 2 + (gy - ry) ** 2)
        by_l = to_l + math.sqrt((gx - lx) ** 2 + (gy - ly) ** 2)
        return min(by_l, to_q + math.sqrt((gx - qx) ** 2 + (gy - qy) ** 2))
    if side_r * side_g > 0.0:  # root and goal on the same side: mirror the goal
        square = ex * ex + ey * ey
        if square > 0.0:
            gx, gy = gx + 2.0 * side_g * ey / square, gy - 2.0 * side_g * ex / square
    dx, dy = gx - rx, gy - ry
    if dx * (ly - ry) - dy * (lx - rx) < 0.0:  # the left end lies right of the straight line
        return math.sqrt((lx - rx) ** 2 + (ly - ry) ** 2) + math.sqrt((gx - lx) ** 2 + (gy - ly) ** 2)
    if dx * (qy - ry) - dy * (qx - rx) > 0.0:
        return math.sqrt((qx - rx) ** 2 + (qy - ry) ** 2) + math.sqrt((gx - qx) ** 2 + (gy - qy) ** 2)
    return math.sqrt(dx * dx + dy * dy)


@device
def off_of(px: float, py: float, ax: float, ay: float, bx: float, by: float) -> float:
    """The distance from a point p to the segment from a to b."""
    ex, ey = bx - ax, by - ay
    square = ex * ex + ey * ey
    t = 0.0
    if square > 0.0:
        t = min(max(((px - ax) * ex + (py - ay) * ey) / square, 0.0), 1.0)
    return math.sqrt((ax + t * ex - px) ** 2 + (ay + t * ey - py) ** 2)


@device
def place_on(ends: Floats, p: int, x: float, y: float) -> float:
    """Where along portal p a place is, from 0 to 1."""
    ex, ey = ends[p, 2] - ends[p, 0], ends[p, 3] - ends[p, 1]
    square = ex * ex + ey * ey
    if square <= SAME_M * SAME_M:
        return 0.0
    t = ((x - ends[p, 0]) * ex + (y - ends[p, 1]) * ey) / square
    return 0.0 if t < 1e-9 else 1.0 if t > 1.0 - 1e-9 else t


@device
def join(node: Floats, link: Int32s, name: Int64s, first: Int32s, list_of: int, current: int) -> bool:
    """Merge into a node's interval those on its portal that touch it and have the same root; return whether any do.

    Merged nodes become `GONE`. All nodes that are `GONE`, and the node itself, leave the portal's list, which begins at
    ``first[list_of]`` (index + 1; 0: empty).
    """
    joined, again = False, True
    while again:
        again = False
        before, k = -1, first[list_of] - 1
        while k >= 0:
            after = link[k, NEXT]
            drop = link[k, PIECE] == GONE
            if not drop and k != current and name[k, ROOT] == name[current, ROOT]:
                same = abs(node[k, COST] - node[current, COST]) < SAME_M
                for side in range(2):
                    # Its right end is this one's left end, or the other way round.
                    mine, its = (LEFT_X, RIGHT_X) if side == 0 else (RIGHT_X, LEFT_X)
                    dx, dy = node[k, its] - node[current, mine], node[k, its + 1] - node[current, mine + 1]
                    if same and not drop and dx * dx + dy * dy < SAME_M * SAME_M:
                        node[current, mine], node[current, mine + 1] = node[k, mine], node[k, mine + 1]
                        name[current, side] = name[k, side]
                        link[k, PIECE] = GONE
                        drop = joined = again = True
            if drop or k == current:
                if before < 0:
                    first[list_of] = after + 1
                else:
                    link[before, NEXT] = after
            else:
                before = k
            k = after
    return joined


@device
def beaten(
    node: Floats, other: int, rx: float, ry: float, cost: float, off: float, ax: float, ay: float, bx: float, by: float
) -> bool:
    """Whether another node, ``other``, reaches every place of an interval from a to b at less cost than its own root.

    The other's interval contains this one. ``rx``, ``ry``, ``cost``: this one's root and the cost there; ``off``: least
    distance from that root to the interval.
    """
    ox, oy, known = node[other, ROOT_X], node[other, ROOT_Y], node[other, COST]
    to_a = known + math.sqrt((ax - ox) ** 2 + (ay - oy) ** 2)
    to_b = known + math.sqrt((bx - ox) ** 2 + (by - oy) ** 2)
    if max(to_a, to_b) < cost + off - SAME_M:
        return True
    if known < cost:
        return bool(known + math.sqrt((rx - ox) ** 2 + (ry - oy) ** 2) < cost - SAME_M)
    # Places that are nearer to one of two points by some length form a convex set: both ends in it prove all between.
    own_a, own_b = math.sqrt((ax - rx) ** 2 + (ay - ry) ** 2), math.sqrt((bx - rx) ** 2 + (by - ry) ** 2)
    return bool(to_a < cost + own_a - SAME_M and to_b < cost + own_b - SAME_M)
