"""A* over a lattice whose labels carry the altitudes that can be reached.

A label at a node is a track to it, with its cost and the interval of altitudes that can be reached there under the
climb limits, floors, ceilings and zones passed so far. A zone that splits the altitudes over an edge makes one label
for each gap: over it, under it. A label is dropped only for another that costs no more and reaches as much.

If climbing has a price, each label also keeps the altitudes that can be reached at its lowest cost; each metre away
from them costs ``weight`` metres of track. This is the exact cost of the cheapest profile over the track so far, as
long as climb limits do not bind.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats, Int64s
from gcsplan.planners.lattice import search_kernels
from gcsplan.planners.lattice.lattice import LINK_DOORS, STEPS, Lattice, Links

LABELS_A_NODE = 8
"""Most labels that a node keeps; more are dropped."""

FIRST_CAPACITY = 32_768
"""Labels for which arrays are allocated at first."""


@dataclass(frozen=True, eq=False, slots=True)
class Label:
    """A track to a terminal: its ``cost``, reachable altitudes from ``low_m`` to ``high_m``, those of lowest cost from
    ``cheap_low_m`` to ``cheap_high_m``, and its ``places`` (N, 2)."""

    cost: float
    low_m: float
    high_m: float
    cheap_low_m: float
    cheap_high_m: float
    places: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Found:
    """``labels`` at the goal, cheapest first (none: no track was found); ``opened``: number of labels expanded."""

    labels: tuple[Label, ...]
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
    """The cheapest tracks from ``start`` to an altitude within ``goal_m`` (lowest, highest) at ``goal``.

    ``starts``: labels at the start. ``cap_m``: highest altitude AMSL; ``weight``: price of a metre of height, in metres
    of track; a label that reaches less than ``spare_m`` beyond another that costs no more is dropped; ``want``: most
    labels at the goal; ``most_opened``: most labels expanded.
    """
    nodes = lattice.nx * lattice.ny
    here, there = nodes, nodes + 1
    links = (start_links, goal_links)
    node = np.concatenate([x.node for x in links])
    from_start = np.arange(len(node)) < len(start_links.node)
    # Links run from the terminal to the node; those of the goal are flown from the node to the terminal.
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
    terms = np.array(
        [lattice.step_m, *ends[1], *goal_m, cap_m, climb_slope, descent_slope, weight, spare_m], np.float64
    )
    name, value, state, goals = _run(
        lattice,
        labels,
        (
            link_at,
            np.where(from_start, node, there)[order],
            np.concatenate([x.length_m for x in links])[order],
            np.ascontiguousarray(low[order]),
            np.ascontiguousarray(high[order]),
        ),
        terms,
        want,
        most_opened,
    )
    out = []
    for g in goals:
        way = []
        k = name[g, search_kernels.PARENT]
        while k >= len(starts):
            way.append(name[k, search_kernels.AT])
            k = name[k, search_kernels.PARENT]
        inner = lattice.node_places(np.array(way[::-1], np.int64))
        places = np.vstack([starts[k].places, inner, np.asarray(goal)[None]])
        cost, *altitudes = (float(x) for x in value[g])
        out.append(Label(cost, altitudes[0], altitudes[1], altitudes[2], altitudes[3], places))
    return Found(tuple(out), int(state[search_kernels.OPENED]))


def _run(
    lattice: Lattice, starts: Floats, links: tuple[Int64s, Int64s, Floats, Floats, Floats], terms: Floats, want: int,
    most_opened: int,
) -> tuple[Int64s, Floats, Int64s, Int64s]:  # fmt: skip
    """Run the kernel, with larger arrays as often as needed; return the labels (integers and numbers), the state, and
    the indices of the labels at the goal."""
    nodes = lattice.nx * lattice.ny
    capacity = FIRST_CAPACITY
    name, value = np.zeros((capacity, 4), np.int64), np.empty((capacity, 5))
    keys, ids = np.empty(capacity), np.empty(capacity, np.int64)
    n = len(starts)
    name[:n] = (nodes, -1, -1, 1)
    value[:n] = starts
    order = np.argsort(starts[:, 0], kind="stable")
    keys[:n], ids[:n] = starts[order, 0], order  # a sorted array is a heap
    state = np.array([n, n, 0, 0], np.int64)
    first, held = np.full(nodes + 2, -1), np.zeros(nodes + 2, np.int64)
    goals = np.zeros(want, np.int64)
    v, door = np.empty(5), np.empty((LINK_DOORS + 1, 4))
    while True:
        status = search_kernels.reach(
            lattice.floor_m, lattice.ceiling_m, lattice.ground_m, STEPS, lattice.band_at, lattice.band_low,
            lattice.band_high, lattice.band_agl, *links, terms, want, most_opened, LABELS_A_NODE, state, name, value,
            keys, ids, first, held, goals, v, door,
        )  # fmt: skip
        if status == search_kernels.DONE:
            break
        capacity *= 4
        name, value = np.resize(name, (capacity, 4)), np.resize(value, (capacity, 5))
        keys, ids = np.resize(keys, capacity), np.resize(ids, capacity)
    return name, value, state, goals[: state[search_kernels.REACHED]]
