"""The search over reachable altitudes, compared with every simple path of small lattices; tubes cut and joined."""

from __future__ import annotations

import math
from itertools import pairwise, product

import numpy as np
import pytest

from gcsplan.planners.lattice.lattice import LINK_DOORS, STEPS, Lattice, Links, gaps, make_lattice, make_links
from gcsplan.planners.lattice.routes import Label, search
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.taut_string import Profile, taut_string
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from tests.support.planner_worlds import Floats, ground

STEP_M = 10.0
SIDE = 3
NODES = SIDE * SIDE
Doors = list[tuple[float, float, float]]  # distance from the last door, lowest and highest altitude


def small_lattice(seed: int) -> Lattice:
    """A lattice of 3 × 3 nodes with rough ground, a varying ceiling, and forbidden bands on some edges."""
    rng = np.random.default_rng(seed)
    n = 2 * SIDE - 1
    floor = rng.uniform(0.0, 12.0, (n, n))
    ceiling = floor + rng.uniform(1.0, 12.0, (n, n))
    floor[rng.random((n, n)) < 0.05] = np.inf
    ground_m = rng.uniform(-4.0, 4.0, (n, n))
    edges, low, agl = rng.integers(0, NODES * 8, 24), rng.uniform(0.0, 15.0, 24), rng.random((24, 2)) < 0.3
    j, i = np.divmod(edges // 8, SIDE)
    order = np.lexsort((low + agl[:, 0] * ground_m[2 * j, 2 * i], edges))
    edges, low, agl = edges[order], low[order], agl[order]
    at = np.zeros(NODES * 8 + 1, np.int64)
    np.cumsum(np.bincount(edges, minlength=NODES * 8), out=at[1:])
    return Lattice(
        west_m=0.0,
        south_m=0.0,
        step_m=STEP_M,
        nx=SIDE,
        ny=SIDE,
        floor_m=floor,
        ceiling_m=ceiling,
        ground_m=ground_m,
        band_at=at,
        band_low=low,
        band_high=low + rng.uniform(0.5, 10.0, 24),
        band_agl=agl,
        reach_m=0.0,
    )


def link(node: int) -> Links:
    """The link from a terminal to a node 1 m away, without limits in between."""
    shape = (1, LINK_DOORS)
    return Links(np.array([node]), np.array([1.0]), np.full(shape, -np.inf), np.full(shape, np.inf))


Gap = tuple[Floats, Floats]  # lowest and highest altitude at each door


def edges_from(lattice: Lattice, node: int) -> list[tuple[int, float, Doors, list[Gap]]]:
    """(to, length, doors, gaps) of every edge from a node, derived from the lattice's own description."""
    x, y = node % SIDE, node // SIDE
    out = []
    for k, sign in product(range(8), (1, -1)):
        dx, dy = int(sign * STEPS[k, 0]), int(sign * STEPS[k, 1])
        if not (0 <= x + dx < SIDE and 0 <= y + dy < SIDE):
            continue
        to = (y + dy) * SIDE + x + dx
        length = STEP_M * math.hypot(dx, dy)
        fractions = (0.0, 0.5, 1.0) if k < 4 else (0.0, 0.25, 0.5, 0.75, 1.0)
        doors, grounds = [], []
        for f, g in zip(fractions, (0.0, *fractions), strict=False):
            # Places on the half lattice have whole coordinates, or lie midway between two such neighbours.
            px, py = 2 * x + 2 * dx * f, 2 * y + 2 * dy * f
            corners = [(i, j) for i in {math.floor(px), math.ceil(px)} for j in {math.floor(py), math.ceil(py)}]
            low = sum(lattice.floor_m[j, i] for i, j in corners) / len(corners)
            high = sum(lattice.ceiling_m[j, i] for i, j in corners) / len(corners)
            doors.append(((f - g) * length, low, high))
            grounds.append(sum(lattice.ground_m[j, i] for i, j in corners) / len(corners))
        edge = (node if sign > 0 else to) * 8 + k
        span = slice(lattice.band_at[edge], lattice.band_at[edge + 1])
        under = np.array(grounds[::sign])  # bands are ordered from the edge's beginning
        bands = [
            (low + agl[0] * under, high + agl[1] * under)
            for low, high, agl in zip(
                lattice.band_low[span], lattice.band_high[span], lattice.band_agl[span], strict=True
            )
        ]
        ways = (
            [(low[::sign], high[::sign]) for low, high in gaps(bands)] if bands else [(under - np.inf, under + np.inf)]
        )
        out.append((to, length, doors, ways))
    return out


def legal(parts: list[tuple[Doors, Gap]], z0: float, z1: float, slope: float) -> bool:
    """Whether a profile exists through all doors, edge after edge, within the gap of each."""
    s, low, high = [0.0], [z0], [z0]
    at = 1.0
    for doors, (under, over) in parts:
        for (run, lo, hi), least, most in zip(doors, under.tolist(), over.tolist(), strict=True):
            at += run
            lo, hi = max(lo, least), min(hi, most)
            if at == s[-1]:
                low[-1], high[-1] = max(low[-1], lo), min(high[-1], hi)
            else:
                s.append(at)
                low.append(lo)
                high.append(hi)
    s.append(at + 1.0)
    return isinstance(
        taut_string(np.array(s), np.array([*low, z1]), np.array([*high, z1]), z0, z1, slope, slope), Profile
    )


def cheapest(lattice: Lattice, z0: float, z1: float, slope: float) -> float:
    """Length of the shortest legal simple path from node 0 to the last, found by trying all, shortest first."""
    around = [edges_from(lattice, k) for k in range(NODES)]
    paths: list[tuple[float, list[tuple[Doors, list[Gap]]]]] = []

    def walk(node: int, seen: frozenset[int], length: float, parts: list[tuple[Doors, list[Gap]]]) -> None:
        if node == NODES - 1:
            paths.append((length, parts))
            return
        for to, step, doors, ways in around[node]:
            if to not in seen and all(lo <= hi for _, lo, hi in doors) and length + step < 75.0:
                walk(to, seen | {to}, length + step, [*parts, (doors, ways)])

    walk(0, frozenset({0}), 2.0, [])
    for length, parts in sorted(paths, key=lambda p: p[0]):
        for choice in product(*(ways for _, ways in parts)):
            if legal([(d, c) for (d, _), c in zip(parts, choice, strict=True)], z0, z1, slope):
                return length
    return math.inf


def is_legal_way(lattice: Lattice, places: Floats, z0: float, z1: float, slope: float) -> bool:
    nodes = [round(y / STEP_M) * SIDE + round(x / STEP_M) for x, y in places[1:-1]]
    parts = []
    for a, b in pairwise(nodes):
        _, _, doors, ways = next(e for e in edges_from(lattice, a) if e[0] == b)
        parts.append((doors, ways))
    return any(
        legal([(d, c) for (d, _), c in zip(parts, choice, strict=True)], z0, z1, slope)
        for choice in product(*(w for _, w in parts))
    )


@pytest.mark.first_quick
@pytest.mark.parametrize("block", range(5))
def test_finds_the_cheapest_way_that_a_profile_exists_for(block: int) -> None:
    solved = 0
    for seed in range(block * 8, block * 8 + 8):
        lattice = small_lattice(seed)
        z0, z1 = float(lattice.floor_m[0, 0] + 0.5), float(lattice.floor_m[-1, -1] + 0.5)
        if not math.isfinite(z0 + z1):
            continue
        slope = float(np.random.default_rng(seed).choice([0.2, 0.5, 1.0, 50.0]))
        last = (SIDE - 1) * STEP_M
        found = search(
            lattice,
            [Label(0.0, z0, z0, z0, z0, np.array([[-1.0, 0.0]]))],
            (-1.0, 0.0),
            (last + 1.0, last),
            link(0),
            link(NODES - 1),
            (z1, z1),
            climb_slope=slope,
            descent_slope=slope,
            spare_m=0.0,
        )
        best = cheapest(lattice, z0, z1, slope)
        if not found.labels:
            assert best > 75.0, seed
            continue
        solved += 1
        label = found.labels[0]
        # The search may pass a node twice to gain height, a simple path cannot: the search is never dearer.
        assert label.cost <= best + 1e-9, seed
        assert is_legal_way(lattice, label.places, z0, z1, slope), seed
        nodes = label.places[1:-1]
        if len(np.unique(nodes, axis=0)) == len(nodes) and label.cost < 75.0:
            assert label.cost == pytest.approx(best), seed
    assert solved >= 3


def test_price_on_climbing_turns_the_way_to_lower_ground() -> None:
    def ridge(east: Floats, north: Floats) -> Floats:
        return np.where(np.abs(east - 1000.0) < 60.0, np.clip(200.0 - 0.2 * north, 20.0, None), 0.0)

    p = Problem(Airspace(ground(ridge)), Limits(10.0), (200.0, 200.0, 10.0), (1800.0, 200.0, 10.0))
    lattice = make_lattice(p, (0.0, 0.0, 2000.0, 2000.0), 25.0, math.inf)
    links = [make_links(p, lattice, x[:2], x[2]) for x in (p.start, p.goal)]
    start = Label(0.0, 10.0, 10.0, 10.0, 10.0, np.array([p.start[:2]]))

    def northmost(weight: float) -> float:
        found = search(lattice, [start], p.start[:2], p.goal[:2], *links, (10.0, 10.0), weight=weight)
        return float(found.labels[0].places[:, 1].max())

    assert northmost(0.0) < 250.0
    assert northmost(20.0) > 800.0


def test_cap_keeps_the_way_under_it() -> None:
    def ridge(east: Floats, north: Floats) -> Floats:
        return np.where(np.abs(east - 1000.0) < 60.0, 200.0 - 0.1 * north, 0.0)

    p = Problem(Airspace(ground(ridge)), Limits(10.0), (200.0, 200.0, 10.0), (1800.0, 200.0, 10.0))
    lattice = make_lattice(p, (0.0, 0.0, 2000.0, 2000.0), 25.0, math.inf)
    links = [make_links(p, lattice, x[:2], x[2]) for x in (p.start, p.goal)]
    start = Label(0.0, 10.0, 10.0, 10.0, 10.0, np.array([p.start[:2]]))
    found = search(lattice, [start], p.start[:2], p.goal[:2], *links, (10.0, 10.0), cap_m=110.0)
    assert found.labels[0].places[:, 1].max() >= 975.0
    assert search(lattice, [start], p.start[:2], p.goal[:2], *links, (10.0, 10.0), cap_m=5.0).labels == ()


def test_gaps_between_bands() -> None:
    def left(*bands: tuple[float, float]) -> list[tuple[float, float]]:
        found = gaps([(np.full(2, low), np.full(2, high)) for low, high in bands])
        return [(float(low[0]), float(high[0])) for low, high in found]

    assert left() == [(-math.inf, math.inf)]
    assert left((5.0, 9.0), (2.0, 6.0)) == [(-math.inf, 2.0), (9.0, math.inf)]
    assert left((-math.inf, 9.0)) == [(9.0, math.inf)]
    assert left((-math.inf, math.inf)) == []
    assert left((1.0, 4.0), (4.0, 6.0)) == [(-math.inf, 1.0), (4.0, 4.0), (6.0, math.inf)]


def test_a_gap_must_be_open_at_every_door() -> None:
    level, falling = (np.array([5.0, 5.0]), np.array([8.0, 8.0])), (np.array([9.0, 2.0]), np.array([12.0, 7.0]))
    (under, low), (above, over) = gaps([falling, level])
    assert (under.tolist(), low.tolist()) == ([-math.inf, -math.inf], [5.0, 2.0])
    assert (above.tolist(), over.tolist()) == ([12.0, 8.0], [math.inf, math.inf])
