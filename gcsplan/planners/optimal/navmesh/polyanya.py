"""Exact shortest tracks over a mesh of convex pieces: Polyanya (Cui, Harabor, Grastien, IJCAI 2017).

A search node is an interval on a portal and the last corner of the track, its *root*, from which the whole interval is
seen. To open a node is to project its interval through the piece behind the portal, onto the piece's other portals:
each of them that the root sees yields a new interval. If an end of the interval is a corner of a wall, the track may
turn there, and that corner is the root of the intervals on the portals that the old root does not see. A binary heap
orders the nodes.

Two measures keep the number of nodes down and lose no shortest track. Intervals of one root that meet on a portal are
merged before they are opened; so that they do meet, nodes are opened in bands of about equal estimated length, and
nearest first within a band. And an interval is dropped if another root reaches all of it at less cost.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Int32s, Int64s
from gcsplan.planners.compiled import device, kernel

ROOT_X, ROOT_Y, COST, LEFT_X, LEFT_Y, RIGHT_X, RIGHT_Y, AHEAD = range(8)
PIECE, CAME, PARENT, TURNS, PORTAL, NEXT = range(6)
LEFT, RIGHT, ROOT = range(3)
"""Columns of the arrays ``node``, ``link`` and ``name``, a row of which is one search node."""

SAME_M = 1e-6
"""Metres: places nearer to each other than this are one."""
GONE = -2
"""Value in column `PIECE` of a node that need not be opened any more."""


BAND = 0.005
"""Width of a band of estimated lengths, as a share of the straight distance to the goal."""
BANDS = 1e8
"""Weight of the band's number in a heap key: metres, more than any track. The digits below it order a band's nodes."""


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
    """Merge into a node's interval all that touch it on its portal and have the same root; return whether any do.

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


@kernel(
    "i4[] f8[,] i8[,] i4[,] i4[] i8 f8[] i8[] i4[] i4[] f8[,] f8[,] i4[] f8[] i4[] f8 f8 i8 f8[] f8[]"
    " f8[,] i4[,] i8[,] f8[] i4[] f8[,]"
)
def search(
    start: Int32s, ends: Floats, names: Int64s, joins: Int32s, order: Int32s, fan: int, best: Floats, origin: Int64s,
    first: Int32s, widest: Int32s, span: Floats, sources_at: Floats, sources_piece: Int32s, goal: Floats,
    goal_piece: Int32s, limit: float, slack: float, most: int, remaining: Floats, met: Floats,
    node: Floats, link: Int32s, name: Int64s, heap: Floats, ids: Int32s, out: Floats,
) -> int:  # fmt: skip
    """Find the shortest track from any source to the goal; its corners, from the goal back, are in ``out``.

    Returns the number of corners, ends included, with the source's number in ``out[0, 2]`` and the length in
    ``out[1, 2]``; 0: no track is shorter than ``limit``; -1: too little room in the arrays; -2: stopped after ``most``
    nodes, when all tracks shorter than ``out[0, 0]`` had been looked at and none led to the goal. ``out[2, 2]``: number
    of nodes opened.

    ``start`` to ``fan``: see `Portals`. ``sources_at`` (K, 3): x, y, cost so far, each in piece ``sources_piece`` (K,);
    the goal is in any of ``goal_piece``. ``remaining`` (pieces,): lower bound of the distance from a piece's entrance
    to the goal. ``slack`` >= 0: go on when the goal is reached, up to 1 + ``slack`` times the length. ``met``
    (portals,), inf before, receives the least cost at which each portal is met. ``remaining`` and ``met`` may be empty.
    Work arrays: ``best``, ``origin`` (names,), ``first`` (2 * portals,), ``widest`` (portals,), all zeros; ``span``
    (portals, 2), ``node`` (room, 8), ``link`` (room, 6), ``name`` (room, 3), ``heap``, ``ids`` (room,); ``out``
    (any, 3).
    """
    room = len(heap)
    gx, gy = goal[0], goal[1]
    count = size = opened = 0
    reached = -1
    flood, guided = len(met) > 0, len(remaining) > 0
    far, shortest = limit, np.inf
    band = max(BAND * math.sqrt((gx - sources_at[0, 0]) ** 2 + (gy - sources_at[0, 1]) ** 2), 1e-3)
    # Each round opens one node, or one source: a source sees all portals of its piece.
    current, key = -1, 0.0
    source = 0
    while True:
        if source < len(sources_piece):
            rx, ry, cost = sources_at[source, 0], sources_at[source, 1], sources_at[source, 2]
            piece, came, all_round = sources_piece[source], -1, True
            lx = ly = qx = qy = 0.0
            left = right = np.int64(-1)
            root = np.int64(-2 - source)
            parent, turns = np.int64(-1), 0
            source += 1
        else:
            if size == 0 or math.floor(heap[0] / BANDS) * band >= limit:
                break
            current, key = ids[0], heap[0]
            size = pop(heap, ids, size)
            piece, came = link[current, PIECE], link[current, CAME]
            if piece == GONE:
                continue
            link[current, PIECE] = GONE
            if node[current, COST] + node[current, AHEAD] >= limit:
                continue
            rx, ry, cost = node[current, ROOT_X], node[current, ROOT_Y], node[current, COST]
            root = name[current, ROOT]
            if root >= 0 and cost + 1.0 > best[root] + SAME_M:
                continue
            p = link[current, PORTAL]
            if join(node, link, name, first, 2 * p + (1 if joins[p, 1] == piece else 0), current):
                s0 = place_on(ends, p, node[current, RIGHT_X], node[current, RIGHT_Y])
                s1 = place_on(ends, p, node[current, LEFT_X], node[current, LEFT_Y])
                s0, s1 = min(s0, s1), max(s0, s1)
                if s1 - s0 > span[p, 1] - span[p, 0]:
                    widest[p], span[p, 0], span[p, 1] = current + 1, s0, s1
            other = widest[p] - 1
            if other != current and span[p, 0] == 0.0 and span[p, 1] == 1.0:
                ax, ay = node[current, RIGHT_X], node[current, RIGHT_Y]
                bx, by = node[current, LEFT_X], node[current, LEFT_Y]
                if beaten(node, other, rx, ry, cost, off_of(rx, ry, ax, ay, bx, by), ax, ay, bx, by):
                    continue
            lx, ly, qx, qy = (
                node[current, LEFT_X],
                node[current, LEFT_Y],
                node[current, RIGHT_X],
                node[current, RIGHT_Y],
            )
            left, right = name[current, LEFT], name[current, RIGHT]
            parent, turns = np.int64(current), link[current, TURNS]
            all_round = False
            opened += 1
            if opened > most:
                # With ``slack``, a track that is known already may be shorter.
                out[0, 0], out[2, 2] = min(math.floor(key / BANDS) * band, shortest), opened
                return -2
        width_l = math.sqrt((lx - rx) ** 2 + (ly - ry) ** 2)
        width_r = math.sqrt((qx - rx) ** 2 + (qy - ry) ** 2)
        if width_l < SAME_M or width_r < SAME_M:
            all_round = True  # the root is a corner of this convex piece and sees all of it
            if turns >= fan:
                continue  # it turns in a circle around the root
            turns += 1
        else:
            turns = 0
        is_goal = False
        for k in range(len(goal_piece)):
            if goal_piece[k] == piece:
                is_goal = True
        for at in range(start[piece] - (1 if is_goal else 0), start[piece + 1]):
            to_goal = at < start[piece]
            behind = p = -1
            forward = True
            if to_goal:
                ax, ay, bx, by = gx, gy, gx, gy
                va = vb = np.int64(-1)
            else:
                p = order[at]
                # The portal goes from its right end a to its left end b, as seen from inside the piece.
                forward = joins[p, 0] == piece
                if forward:
                    behind = joins[p, 1]
                    ax, ay, bx, by = ends[p, 0], ends[p, 1], ends[p, 2], ends[p, 3]
                    va, vb = names[p, 0], names[p, 1]
                else:
                    behind = joins[p, 0]
                    ax, ay, bx, by = ends[p, 2], ends[p, 3], ends[p, 0], ends[p, 1]
                    va, vb = names[p, 1], names[p, 0]
                if behind == came:
                    continue
            t0, t1, off = 0.0, 1.0, 0.0
            at_a = at_b = 0.0
            along = -1  # nearer end (0: a, 1: b) of a portal that the root sees edge-on; -1: it does not
            if not to_goal:
                ex, ey = bx - ax, by - ay
                long = math.sqrt(ex * ex + ey * ey)
                if abs(ex * (ry - ay) - ey * (rx - ax)) <= SAME_M * long:
                    at_a = math.sqrt((rx - ax) ** 2 + (ry - ay) ** 2)
                    at_b = math.sqrt((rx - bx) ** 2 + (ry - by) ** 2)
                    if min(at_a, at_b) <= SAME_M and not all_round:
                        continue  # leads back to the root along an edge, in a circle
                    if min(at_a, at_b) > SAME_M and max(at_a, at_b) >= long:
                        # Nothing behind the portal is seen from here. A track that goes on behind it turns at its
                        # nearer end, or at the end of another portal that is nearer to the root.
                        along = 0 if at_a < at_b else 1
                        if not all_round:
                            # The nearer end itself is not seen if it lies beside the view through the interval.
                            ux, uy = (ax - rx, ay - ry) if along == 0 else (bx - rx, by - ry)
                            if (qx - rx) * uy - (qy - ry) * ux < -SAME_M * width_r or (lx - rx) * uy - (
                                ly - ry
                            ) * ux > SAME_M * width_l:
                                along = -1
            if along >= 0:
                t0, t1 = 1.0, 0.0
            elif not all_round:
                # Signed distances from the rays through the interval's two ends: between them the root sees.
                ra = ((qx - rx) * (ay - ry) - (qy - ry) * (ax - rx)) / width_r
                rb = ((qx - rx) * (by - ry) - (qy - ry) * (bx - rx)) / width_r
                la = ((lx - rx) * (ay - ry) - (ly - ry) * (ax - rx)) / width_l
                lb = ((lx - rx) * (by - ry) - (ly - ry) * (bx - rx)) / width_l
                if rb < -SAME_M:
                    t0 = 2.0
                elif ra < -SAME_M:
                    t0 = min(max(ra / (ra - rb), 0.0), 1.0)
                if la > SAME_M:
                    t1 = -1.0
                elif lb > SAME_M:
                    t1 = min(max(la / (la - lb), 0.0), 1.0)
            for part in range(3):
                # 0: the part seen; 1: right of that, by a turn at the right end; 2: left of it, by a turn at the left.
                x0, y0, x1, y1, n0, n1 = ax, ay, bx, by, va, vb
                nx, ny, ncost, nroot = rx, ry, cost, root
                s0, s1 = 0.0, 1.0
                if along >= 0:
                    if part > 0:
                        continue
                    nx, ny, nroot = (ax, ay, va) if along == 0 else (bx, by, vb)
                    if nroot < 0:
                        continue
                    ncost = cost + min(at_a, at_b)
                elif part == 0:
                    if t0 > t1:
                        continue
                    s0, s1 = t0, t1
                    if t0 > 0.0:
                        x0, y0, n0 = ax + t0 * (bx - ax), ay + t0 * (by - ay), np.int64(-1)
                    if t1 < 1.0:
                        x1, y1, n1 = ax + t1 * (bx - ax), ay + t1 * (by - ay), np.int64(-1)
                elif part == 1:
                    if all_round or t0 == 0.0 or right < 0:
                        continue
                    nx, ny, ncost, nroot = qx, qy, cost + width_r, right
                    s1 = min(t0, 1.0)
                    if t0 < 1.0:
                        x1, y1, n1 = ax + t0 * (bx - ax), ay + t0 * (by - ay), np.int64(-1)
                else:
                    if all_round or t1 == 1.0 or left < 0:
                        continue
                    nx, ny, ncost, nroot = lx, ly, cost + width_l, left
                    s0 = max(t1, 0.0)
                    if t1 > 0.0:
                        x0, y0, n0 = ax + t1 * (bx - ax), ay + t1 * (by - ay), np.int64(-1)
                if nroot >= 0 and nroot == root:
                    if ncost + 1.0 > best[nroot] + SAME_M:
                        continue
                elif nroot >= 0:
                    # The same corner at the same cost from another root adds nothing; along a straight wall with many
                    # corners, it would double the number of tracks at each.
                    if best[nroot] == 0.0 or ncost + 1.0 < best[nroot] - SAME_M:
                        best[nroot], origin[nroot] = ncost + 1.0, root
                    elif ncost + 1.0 > best[nroot] + SAME_M or origin[nroot] != root:
                        continue
                if to_goal:
                    ahead = math.sqrt((gx - nx) ** 2 + (gy - ny) ** 2)
                else:
                    off = off_of(nx, ny, x0, y0, x1, y1)
                    ahead = off + remaining[behind] if guided else 0.0
                    if ncost + ahead >= limit:
                        continue
                    ahead = max(ahead, ahead_of(nx, ny, x1, y1, x0, y0, gx, gy))
                if ncost + ahead >= limit:
                    continue
                if not to_goal:
                    if not forward:
                        s0, s1 = 1.0 - s1, 1.0 - s0
                    if widest[p] > 0 and span[p, 0] <= s0 and s1 <= span[p, 1]:
                        other = widest[p] - 1
                        if beaten(node, other, nx, ny, ncost, off, x0, y0, x1, y1):
                            continue
                        # Equally wide, and it costs less than the other's root: compare later ones with this one.
                        wider = s0 == span[p, 0] and s1 == span[p, 1] and ncost + off < node[other, COST]
                    else:
                        wider = widest[p] == 0 or s1 - s0 > span[p, 1] - span[p, 0]
                    if wider and count < room:
                        widest[p], span[p, 0], span[p, 1] = count + 1, s0, s1
                if flood and not to_goal:
                    met[p] = min(met[p], ncost + off)
                if count >= room:
                    return -1
                node[count, ROOT_X], node[count, ROOT_Y], node[count, COST] = nx, ny, ncost
                node[count, LEFT_X], node[count, LEFT_Y] = x1, y1
                node[count, RIGHT_X], node[count, RIGHT_Y] = x0, y0
                node[count, AHEAD] = ahead
                link[count, PIECE], link[count, CAME] = -1 if to_goal else behind, piece
                link[count, PARENT], link[count, TURNS] = parent, turns if nroot == root else 0
                name[count, LEFT], name[count, RIGHT], name[count, ROOT] = n1, n0, nroot
                if to_goal:
                    if ncost + ahead < shortest:
                        reached, shortest = count, ncost + ahead
                        limit = min(far, shortest * (1.0 + max(slack, 0.0)))
                else:
                    list_of = 2 * p + (1 if joins[p, 1] == behind else 0)
                    link[count, PORTAL], link[count, NEXT] = p, first[list_of] - 1
                    first[list_of] = count + 1
                    near = min(ncost + off, 0.99 * BANDS)
                    size = push(heap, ids, size, math.floor((ncost + ahead) / band) * BANDS + near, count)
                count += 1
    if reached < 0:
        out[2, 2] = opened
        return 0
    # List the corners from the goal back.
    current = reached
    length = node[current, COST] + node[current, AHEAD]
    out[0, 0], out[0, 1] = gx, gy
    n = 1
    at = current
    number = 0
    last = np.int64(-1 - 2**40)
    while at >= 0:
        if name[at, ROOT] != last:
            last = name[at, ROOT]
            if n >= len(out):
                return -1
            out[n, 0], out[n, 1] = node[at, ROOT_X], node[at, ROOT_Y]
            n += 1
            number = -2 - last
        at = link[at, PARENT]
    out[0, 2], out[1, 2], out[2, 2] = number, length, opened
    return n
