"""A* over a lattice whose labels carry the altitudes that can be reached.

A label at a node is a way to it with its cost and the interval of altitudes that the climb limits, floors,
ceilings and zones passed so far leave open. A zone that splits the altitudes over an edge makes one label for
each gap: over it, under it. A label dies only to one that costs no more and reaches as much.

For a price on climbing each label also keeps the altitudes that can be reached at its lowest cost; away from
them a metre costs ``weight`` metres of track. That is the exact value of the cheapest profile over the way so far
as long as climb limits do not bind.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcsplan.planners.heap import pop, push
from gcsplan.planners.lattice import LINK_DOORS, STEPS, Lattice, Links

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LABELS_A_NODE = 8
"""Most labels that a node keeps; beyond it a search is no longer complete, and says so."""


@dataclass(frozen=True, eq=False, slots=True)
class Label:
    """How a terminal is reached: ``cost``, reachable altitudes, those of lowest cost, and the places on the way."""

    cost: float
    low_m: float
    high_m: float
    cheap_low_m: float
    cheap_high_m: float
    places: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Found:
    """``labels`` at the goal, cheapest first (none: no way on this lattice); ``complete`` False where labels were
    dropped, so that "none" proves nothing; ``opened`` counts labels taken up."""

    labels: tuple[Label, ...]
    complete: bool
    opened: int


def search(
    lattice: Lattice,
    starts: list[Label],
    start: tuple[float, float],
    goal: tuple[float, float],
    start_links: Links,
    goal_links: Links,
    goal_m: tuple[float, float],
    *,
    cap_m: float = np.inf,
    climb_slope: float = np.inf,
    descent_slope: float = np.inf,
    weight: float = 0.0,
    spare_m: float = 0.5,
    want: int = 1,
    most_opened: int = 600_000,
) -> Found:
    """The cheapest ways from ``start``, reached as in ``starts``, to an altitude within ``goal_m`` at ``goal``.

    ``cap_m`` AMSL is flown under; ``weight`` metres of track for a metre of height; a label that reaches less than
    ``spare_m`` more than another that costs no more is dropped; ``want`` labels at the goal at most.
    """
    nodes = lattice.nx * lattice.ny
    here, there = nodes, nodes + 1
    links = (start_links, goal_links)
    node = np.concatenate([x.node for x in links])
    from_start = np.arange(len(node)) < len(start_links.node)
    # Links run from the terminal to the node; towards the goal they are flown backwards.
    low = np.vstack([start_links.low_m, goal_links.low_m[:, ::-1]])
    high = np.vstack([start_links.high_m, goal_links.high_m[:, ::-1]])
    source = np.where(from_start, here, node)
    order = np.argsort(source, kind="stable")
    link_at = np.zeros(nodes + 3, np.int64)
    np.cumsum(np.bincount(source, minlength=nodes + 2), out=link_at[1:])
    labels = np.array([(x.cost, x.low_m, x.high_m, x.cheap_low_m, x.cheap_high_m) for x in starts])
    scale = 1.0 / lattice.step_m
    ends = np.array(
        [[(p[0] - lattice.west_m) * scale, (p[1] - lattice.south_m) * scale] for p in (start, goal)], np.float64
    )
    at, parent, value, goals, complete, opened = _search(
        lattice.floor_m,
        lattice.ceiling_m,
        lattice.step_m,
        lattice.nx,
        lattice.ny,
        lattice.band_at,
        lattice.band_low,
        lattice.band_high,
        link_at,
        np.where(from_start, node, there)[order],
        np.concatenate([x.length_m for x in links])[order],
        np.ascontiguousarray(low[order]),
        np.ascontiguousarray(high[order]),
        labels,
        ends,
        np.asarray(goal_m, np.float64),
        cap_m,
        climb_slope,
        descent_slope,
        weight,
        spare_m,
        want,
        most_opened,
    )
    out = []
    for g in goals:
        way = []
        k = parent[g]
        while k >= len(starts):
            way.append(at[k])
            k = parent[k]
        inner = lattice.node_places(np.array(way[::-1], np.int64))
        places = np.vstack([starts[k].places, inner, np.asarray(goal)[None]])
        cost, *altitudes = (float(x) for x in value[g])
        out.append(Label(cost, altitudes[0], altitudes[1], altitudes[2], altitudes[3], places))
    return Found(tuple(out), bool(complete), int(opened))


@njit(cache=True)
def _apart(x: float, low: float, high: float) -> float:
    return max(low - x, x - high, 0.0)


@njit(cache=True)
def _farther(x: float, y: float, low: float, high: float) -> float:
    """How far the farther of two altitudes is out of an interval."""
    return max(_apart(x, low, high), _apart(y, low, high))


@njit(cache=True)
def _grown(a: NDArray[Any], room: int) -> NDArray[Any]:
    out = np.empty(room, a.dtype)
    for k in range(len(a)):
        out[k] = a[k]
    return out


@njit(cache=True)
def _door(v: Floats, run: float, up: float, down: float, low: float, high: float, weight: float) -> bool:
    """Carry a label's values (cost, low, high, cheap low, cheap high) over ``run`` metres through a door, in place."""
    lo, hi = v[1], v[2]
    if run > 0.0:
        lo -= down * run
        hi += up * run
    lo, hi = max(lo, low), min(hi, high)
    if not lo <= hi:
        return False
    v[1], v[2] = lo, hi
    a, b = max(v[3], lo), min(v[4], hi)
    if weight == 0.0:
        a, b = lo, hi
    elif a > b:
        # All cheap altitudes are shut: the nearest open one costs the way to it.
        a = b = lo if v[4] < lo else hi
        v[0] += weight * _apart(a, v[3], v[4])
    v[3], v[4] = a, b
    return True


@njit(cache=True)
def _search(
    floor: Floats,
    ceiling: Floats,
    step: float,
    nx: int,
    ny: int,
    band_at: Ints,
    band_low: Floats,
    band_high: Floats,
    link_at: Ints,
    link_to: Ints,
    link_length: Floats,
    link_low: Floats,
    link_high: Floats,
    starts: Floats,
    ends: Floats,
    goal_m: Floats,
    cap: float,
    up: float,
    down: float,
    weight: float,
    spare: float,
    want: int,
    most_opened: int,
) -> tuple[Ints, Ints, Floats, Ints, bool, int]:
    nodes = nx * ny
    room = 4096
    at = np.empty(room, np.int64)
    parent = np.empty(room, np.int64)
    following = np.empty(room, np.int64)  # next label of the same node
    alive = np.empty(room, np.bool_)
    value = np.empty(5 * room)  # five for each label: see `_door`
    heap = np.empty(room)
    ids = np.empty(room, np.int64)
    first = np.full(nodes + 2, -1, np.int64)
    held = np.zeros(nodes + 2, np.int16)
    count = size = opened = 0
    complete = True
    goals = np.empty(want, np.int64)
    reached = 0
    v = np.empty(5)
    door_low = np.empty(LINK_DOORS)
    door_high = np.empty(LINK_DOORS)
    door_run = np.empty(LINK_DOORS)

    for k in range(len(starts)):
        at[k], parent[k], following[k], alive[k] = nodes, -1, -1, True
        for q in range(5):
            value[5 * k + q] = starts[k, q]
        count += 1
        size = push(heap, ids, size, starts[k, 0], k)

    while size > 0:
        item = ids[0]
        size = pop(heap, ids, size)
        if not alive[item]:
            continue
        node = at[item]
        if node == nodes + 1:
            goals[reached] = item
            reached += 1
            if reached >= want:
                break
            continue
        opened += 1
        if opened > most_opened:
            complete = False
            break
        if node < nodes:
            x, y = node % nx, node // nx
        else:
            x, y = 0, 0
        moves = 16 if node < nodes else 0
        links = link_at[node + 1] - link_at[node]
        for m in range(moves + links):
            # The doors of this edge.
            if m < moves:
                k = m >> 1
                sign = 1 - 2 * (m & 1)
                dx, dy = sign * STEPS[k, 0], sign * STEPS[k, 1]
                i, j = x + dx, y + dy
                if i < 0 or i >= nx or j < 0 or j >= ny:
                    continue
                to = j * nx + i
                edge = (node if sign > 0 else to) * 8 + k
                doors = 0
                hx, hy = 2 * x, 2 * y
                door_low[0], door_high[0], door_run[0] = floor[hy, hx], ceiling[hy, hx], 0.0
                if k < 4:
                    length = step * (1.0 if k < 2 else np.sqrt(2.0))
                    door_low[1], door_high[1] = floor[hy + dy, hx + dx], ceiling[hy + dy, hx + dx]
                    door_run[1] = 0.5 * length
                    doors = 3
                else:
                    length = step * np.sqrt(5.0)
                    # A quarter of the way lies between two half-lattice points, side by side across the short step.
                    for q in range(2):
                        px, py = hx + (q * dx), hy + (q * dy)
                        if dx == 2 or dx == -2:
                            ax, ay, bx, by = px + dx // 2, py, px + dx // 2, py + dy
                        else:
                            ax, ay, bx, by = px, py + dy // 2, px + dx, py + dy // 2
                        door_low[1 + 2 * q] = 0.5 * (floor[ay, ax] + floor[by, bx])
                        door_high[1 + 2 * q] = 0.5 * (ceiling[ay, ax] + ceiling[by, bx])
                    door_low[2], door_high[2] = floor[hy + dy, hx + dx], ceiling[hy + dy, hx + dx]
                    door_run[1] = door_run[2] = door_run[3] = 0.25 * length
                    doors = 5
                last = doors - 1
                door_low[last], door_high[last] = floor[2 * j, 2 * i], ceiling[2 * j, 2 * i]
                door_run[last] = door_run[1]
                b0, b1 = band_at[edge], band_at[edge + 1]
            else:
                link = link_at[node] + m - moves
                to = link_to[link]
                length = link_length[link]
                doors = LINK_DOORS
                for q in range(doors):
                    door_low[q], door_high[q] = link_low[link, q], link_high[link, q]
                    door_run[q] = length / (doors - 1) if q > 0 else 0.0
                b0 = b1 = 0
                i, j = to % nx, to // nx
            # Way to the goal from the other end.
            if to == nodes + 1:
                rest = 0.0
            elif to < nodes:
                rest = step * np.sqrt((ends[1, 0] - i) ** 2 + (ends[1, 1] - j) ** 2)
            else:
                continue
            # Each gap between the edge's bands is a way of its own.
            gap_low = -np.inf
            b = b0
            while True:
                gap_high = band_low[b] if b < b1 else np.inf
                is_open = gap_high >= gap_low and gap_low < np.inf and gap_high > -np.inf
                if is_open:
                    for q in range(5):
                        v[q] = value[5 * item + q]
                    v[0] += length
                    for q in range(doors):
                        low, high = max(door_low[q], gap_low), min(door_high[q], gap_high, cap)
                        if not _door(v, door_run[q], up, down, low, high, weight):
                            is_open = False
                            break
                if is_open and to == nodes + 1:
                    is_open = _door(v, 0.0, up, down, goal_m[0], goal_m[1], weight)
                if is_open:
                    kept = True
                    before = np.int64(-1)
                    other = first[to]
                    while other >= 0:
                        # `other` rules if it reaches as much and costs no more at any altitude, and the reverse.
                        o = 5 * other
                        if (
                            value[o + 1] <= v[1] + spare
                            and value[o + 2] >= v[2] - spare
                            and value[o] + weight * _farther(v[3], v[4], value[o + 3], value[o + 4]) <= v[0]
                        ):
                            kept = False
                            break
                        ruled = v[1] <= value[o + 1] and v[2] >= value[o + 2]
                        if ruled:
                            ruled = v[0] + weight * _farther(value[o + 3], value[o + 4], v[3], v[4]) <= value[o]
                        if ruled:
                            alive[other] = False
                            held[to] -= 1
                            if before < 0:
                                first[to] = following[other]
                            else:
                                following[before] = following[other]
                        else:
                            before = other
                        other = following[other]
                    if kept and held[to] >= LABELS_A_NODE:
                        complete = False
                        kept = False
                    if kept:
                        if count >= room:
                            room *= 2
                            at, parent, following = _grown(at, room), _grown(parent, room), _grown(following, room)
                            alive, ids, heap = _grown(alive, room), _grown(ids, room), _grown(heap, room)
                            value = _grown(value, 5 * room)
                        at[count], parent[count], alive[count] = to, item, True
                        for q in range(5):
                            value[5 * count + q] = v[q]
                        following[count] = first[to]
                        first[to] = count
                        held[to] += 1
                        # What is left is no shorter than the straight way, nor than the climb (descent) takes.
                        ahead = max(rest, (goal_m[0] - v[2]) / up, (v[1] - goal_m[1]) / down)
                        vertical = max(v[3] - goal_m[1], goal_m[0] - v[4], 0.0)
                        size = push(heap, ids, size, v[0] + ahead + weight * vertical, count)
                        count += 1
                if b >= b1:
                    break
                gap_low = max(gap_low, band_high[b])
                b += 1
    return at[:count], parent[:count], value[: 5 * count].reshape(-1, 5), goals[:reached], complete, opened
