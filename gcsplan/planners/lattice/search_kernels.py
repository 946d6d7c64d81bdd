"""Kernel of `search`: A* over a lattice whose labels carry the altitudes that can be reached.

Nothing is allocated here. A label is a row of numbers and a row of integers. The numbers: cost, lowest and highest
reachable altitude, lowest and highest altitude that is reachable at the lowest cost. The integers: its node, the label
that it came from, the next label of its node, and 1 until it is dropped.
"""

from __future__ import annotations

import math

from gcsplan.planners.compiled import device, kernel

COST, LOW, HIGH, CHEAP_LOW, CHEAP_HIGH = range(5)
AT, PARENT, NEXT, ALIVE = range(4)
COUNT, SIZE, OPENED, REACHED = range(4)
"""Indices in the state, which is kept between calls."""
STEP, GOAL_X, GOAL_Y, GOAL_LOW, GOAL_HIGH, CAP, UP, DOWN, WEIGHT, SPARE = range(10)
"""Indices in the parameters of the search (``terms``)."""

DONE, SHORT = 0, 1
MOST_NEW_LABELS = 1024
"""Most labels that the expansion of one label can add; the arrays must have space for them before it begins."""


@device
def push(keys, ids, size, key, item):  # type: ignore[no-untyped-def]
    """Put ``item`` into a heap in two arrays; items of equal keys leave in the order of their numbers."""
    k = size
    while k > 0:
        up = (k - 1) >> 1
        if keys[up] < key or (keys[up] == key and ids[up] <= item):
            break
        keys[k], ids[k] = keys[up], ids[up]
        k = up
    keys[k], ids[k] = key, item


@device
def pop(keys, ids, size):  # type: ignore[no-untyped-def]
    """Remove the root, which the caller has read already, from a heap; ``size`` is the number of items left."""
    key, item = keys[size], ids[size]
    k = 0
    while 2 * k + 1 < size:
        c = 2 * k + 1
        if c + 1 < size and (keys[c + 1] < keys[c] or (keys[c + 1] == keys[c] and ids[c + 1] < ids[c])):
            c += 1
        if keys[c] > key or (keys[c] == key and ids[c] >= item):
            break
        keys[k], ids[k] = keys[c], ids[c]
        k = c
    keys[k], ids[k] = key, item


@device
def through(v, run, low, high, terms):  # type: ignore[no-untyped-def]
    """Update a label's numbers over ``run`` metres and through a door, in place; False if the door is out of reach."""
    lo, hi = v[LOW], v[HIGH]
    if run > 0.0:
        lo -= terms[DOWN] * run
        hi += terms[UP] * run
    lo = low if low > lo else lo
    hi = high if high < hi else hi
    if not lo <= hi:
        return False
    v[LOW], v[HIGH] = lo, hi
    a, b = v[CHEAP_LOW], v[CHEAP_HIGH]
    if terms[WEIGHT] == 0.0:
        a, b = lo, hi
    elif a > hi:
        v[COST] += terms[WEIGHT] * (a - hi)  # no cheap altitude is open: pay for the height to the nearest open one
        a = b = hi
    elif b < lo:
        v[COST] += terms[WEIGHT] * (lo - b)
        a = b = lo
    else:
        a = lo if lo > a else a
        b = hi if hi < b else b
    v[CHEAP_LOW], v[CHEAP_HIGH] = a, b
    return True


@device
def farther(a, b, low, high):  # type: ignore[no-untyped-def]
    """How far the altitudes from ``a`` to ``b`` reach out of an interval, in metres; 0 if not at all."""
    x, y = low - a, b - high
    x = y if y > x else x
    return x if x > 0.0 else 0.0


@device
def doors_of(x, y, dx, dy, k, floor, ceiling, ground, step, door):  # type: ignore[no-untyped-def]
    """Write the doors (run, low, high, ground) of the edge from node (x, y) by (dx, dy), ``STEPS[k]`` or its reverse;
    return their number."""
    hx, hy = 2 * x, 2 * y
    flat = math.sqrt(float(dx * dx + dy * dy)) * step
    count = 3 if k < 4 else 5
    for q in range(count):
        door[q, 0] = flat / (count - 1) if q > 0 else 0.0
        if count == 3 or q % 2 == 0:
            part = q if count == 3 else q // 2
            j, i = hy + part * dy, hx + part * dx
            door[q, 1], door[q, 2], door[q, 3] = floor[j, i], ceiling[j, i], ground[j, i]
        else:
            # A quarter of the edge lies midway between two half-lattice points: take their mean.
            px, py = hx + (q // 2) * dx, hy + (q // 2) * dy
            if dx == 2 or dx == -2:
                ax, ay, bx, by = px + dx // 2, py, px + dx // 2, py + dy
            else:
                ax, ay, bx, by = px, py + dy // 2, px + dx, py + dy // 2
            door[q, 1] = 0.5 * (floor[ay, ax] + floor[by, bx])
            door[q, 2] = 0.5 * (ceiling[ay, ax] + ceiling[by, bx])
            door[q, 3] = 0.5 * (ground[ay, ax] + ground[by, bx])
    return count


@device
def admit(to, v, value, name, first, held, most, terms):  # type: ignore[no-untyped-def]
    """Whether a label with numbers ``v`` may stay at a node: no other dominates it, and the node has not too many.

    A label dominates another if it reaches as much and costs no more at any altitude. Labels that ``v`` dominates are
    dropped.
    """
    weight, before, other = terms[WEIGHT], -1, first[to]
    while other >= 0:
        o = value[other]
        following = name[other, NEXT]
        if (
            o[LOW] <= v[LOW] + terms[SPARE]
            and o[HIGH] >= v[HIGH] - terms[SPARE]
            and o[COST] + weight * farther(v[CHEAP_LOW], v[CHEAP_HIGH], o[CHEAP_LOW], o[CHEAP_HIGH]) <= v[COST]
        ):
            return False
        if (
            v[LOW] <= o[LOW]
            and v[HIGH] >= o[HIGH]
            and (v[COST] + weight * farther(o[CHEAP_LOW], o[CHEAP_HIGH], v[CHEAP_LOW], v[CHEAP_HIGH]) <= o[COST])
        ):
            name[other, ALIVE] = 0
            held[to] -= 1
            if before < 0:
                first[to] = following
            else:
                name[before, NEXT] = following
        else:
            before = other
        other = following
    return held[to] < most


@kernel(
    "f8[,] f8[,] f8[,] i8[,] i8[] f8[] f8[] b1[,] i8[] i8[] f8[] f8[,] f8[,] f8[] i8 i8 i8 i8[] i8[,] f8[,] f8[] i8[]"
    " i8[] i8[] i8[] f8[] f8[,]"
)
def reach(  # type: ignore[no-untyped-def]
    floor, ceiling, ground, steps, band_at, band_low, band_high, band_agl, link_at, link_to, link_length, link_low,
    link_high, terms, want, most_opened, most_held, state, name, value, keys, ids, first, held, goals, v, door,
):  # fmt: skip
    """Search until ``want`` labels have reached the goal; return `DONE`, or `SHORT` if it needs larger arrays to go on.

    ``floor``, ``ceiling``, ``ground`` (2·ny - 1, 2·nx - 1) on the half lattice; ``steps`` (8, 2); ``band_*``: see
    `Lattice`; ``link_*``: links of the terminals, by source (nodes, start, goal). ``terms``, ``state``: see the indices
    above. ``name`` (capacity, 4) and ``value`` (capacity, 5): the labels; ``keys``, ``ids`` (capacity,): the heap;
    ``first``, ``held`` (nodes + 2,): first label and number of labels of each node; ``goals`` (want,) receives labels.
    ``v`` (5,) and ``door`` (LINK_DOORS + 1, 4) are working arrays.
    """
    nx, ny = (floor.shape[1] + 1) // 2, (floor.shape[0] + 1) // 2
    nodes = nx * ny
    count, size = state[COUNT], state[SIZE]
    status = DONE
    while size > 0:
        if count + MOST_NEW_LABELS > len(keys):
            status = SHORT
            break
        item = ids[0]
        size -= 1
        pop(keys, ids, size)
        if name[item, ALIVE] == 0:
            continue
        node = name[item, AT]
        if node == nodes + 1:
            goals[state[REACHED]] = item
            state[REACHED] += 1
            if state[REACHED] >= want:
                break
            continue
        state[OPENED] += 1
        if state[OPENED] > most_opened:
            break
        x, y = node % nx, node // nx
        moves = 16 if node < nodes else 0
        for m in range(moves + link_at[node + 1] - link_at[node]):
            b0, b1, to, length, doors = 0, 0, 0, 0.0, 0
            if m < moves:
                k = m >> 1
                sign = 1 - 2 * (m & 1)
                dx, dy = sign * steps[k, 0], sign * steps[k, 1]
                i, j = x + dx, y + dy
                if i < 0 or i >= nx or j < 0 or j >= ny:
                    continue
                to = j * nx + i
                edge = (node if sign > 0 else to) * 8 + k
                b0, b1 = band_at[edge], band_at[edge + 1]
                doors = doors_of(x, y, dx, dy, k, floor, ceiling, ground, terms[STEP], door)
                length = math.sqrt(float(dx * dx + dy * dy)) * terms[STEP]
            else:
                link = link_at[node] + m - moves
                to, length = link_to[link], link_length[link]
                doors = link_low.shape[1]
                for q in range(doors):
                    door[q, 0] = length / (doors - 1) if q > 0 else 0.0
                    door[q, 1], door[q, 2] = link_low[link, q], link_high[link, q]
            if to == nodes:
                continue
            rest = 0.0
            if to < nodes:
                rest = terms[STEP] * math.sqrt((terms[GOAL_X] - to % nx) ** 2 + (terms[GOAL_Y] - to // nx) ** 2)
            else:
                door[doors, 0], door[doors, 1], door[doors, 2] = 0.0, terms[GOAL_LOW], terms[GOAL_HIGH]
                doors += 1
            # Each gap, over some of the edge's bands and under the others, makes a label of its own.
            for b in range(b0, b1 + 1):
                for q in range(5):
                    v[q] = value[item, q]
                v[COST] += length
                is_open = True
                for q in range(doors):
                    low, high = door[q, 1], terms[CAP] if terms[CAP] < door[q, 2] else door[q, 2]
                    for c in range(b0, b):
                        top = band_high[c] + (door[q, 3] if band_agl[c, 1] else 0.0)
                        low = top if top > low else low
                    for c in range(b, b1):
                        bottom = band_low[c] + (door[q, 3] if band_agl[c, 0] else 0.0)
                        high = bottom if bottom < high else high
                    is_open = is_open and through(v, door[q, 0], low, high, terms)
                if not is_open:
                    continue
                if count >= len(keys) or not admit(to, v, value, name, first, held, most_held, terms):
                    continue
                name[count, AT], name[count, PARENT], name[count, NEXT], name[count, ALIVE] = to, item, first[to], 1
                for q in range(5):
                    value[count, q] = v[q]
                first[to] = count
                held[to] += 1
                # The rest of the track is at least the straight line, and at least the climb's (descent's) length.
                ahead, vertical = rest, 0.0
                if terms[GOAL_LOW] > v[HIGH] and (terms[GOAL_LOW] - v[HIGH]) / terms[UP] > ahead:
                    ahead = (terms[GOAL_LOW] - v[HIGH]) / terms[UP]
                if v[LOW] > terms[GOAL_HIGH] and (v[LOW] - terms[GOAL_HIGH]) / terms[DOWN] > ahead:
                    ahead = (v[LOW] - terms[GOAL_HIGH]) / terms[DOWN]
                if v[CHEAP_LOW] > terms[GOAL_HIGH]:
                    vertical = v[CHEAP_LOW] - terms[GOAL_HIGH]
                elif v[CHEAP_HIGH] < terms[GOAL_LOW]:
                    vertical = terms[GOAL_LOW] - v[CHEAP_HIGH]
                push(keys, ids, size, v[COST] + ahead + terms[WEIGHT] * vertical, count)
                size += 1
                count += 1
    state[COUNT], state[SIZE] = count, size
    return status
