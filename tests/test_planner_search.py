"""Search over reachable altitudes, held against every simple path of small lattices; tubes cut and joined."""

from __future__ import annotations

import math
from itertools import pairwise, product

import numpy as np
import pytest

from gcsplan.planners.lattice import LINK_DOORS, STEPS, Lattice, Links, gaps, make_lattice, make_links
from gcsplan.planners.problem import Problem
from gcsplan.planners.search import Label, search
from gcsplan.planners.taut_string import Profile, taut_string
from gcsplan.planners.tubes import cut, join
from gcsplan.world.airspace import Airspace
from gcsplan.world.limits import Limits
from gcsplan.world.zones import Circle, Level, Zone
from tests.planner_worlds import FIELD, Floats, ground, jacksboro

STEP_M = 10.0
SIDE = 3
NODES = SIDE * SIDE
Doors = list[tuple[float, float, float]]  # run since the last door, low, high


def small_lattice(seed: int) -> Lattice:
    """Three by three nodes, rough ground, a wandering ceiling, some edges with a forbidden band."""
    rng = np.random.default_rng(seed)
    n = 2 * SIDE - 1
    floor = rng.uniform(0.0, 12.0, (n, n))
    ceiling = floor + rng.uniform(1.0, 12.0, (n, n))
    floor[rng.random((n, n)) < 0.05] = np.inf
    edges = np.sort(rng.choice(NODES * 8, 20, replace=False))
    low = rng.uniform(0.0, 15.0, 20)
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
        band_at=at,
        band_low=low,
        band_high=low + rng.uniform(0.5, 10.0, 20),
        band_zone=np.zeros(20, np.int64),
        reach_m=0.0,
    )


def link(node: int) -> Links:
    """A terminal 1 m from a node, with nothing in between."""
    shape = (1, LINK_DOORS)
    return Links(np.array([node]), np.array([1.0]), np.full(shape, -np.inf), np.full(shape, np.inf))


def edges_from(lattice: Lattice, node: int) -> list[tuple[int, float, Doors, list[tuple[float, float]]]]:
    """(to, length, doors, gaps) of every edge, written out from the lattice's own description."""
    x, y = node % SIDE, node // SIDE
    out = []
    for k, sign in product(range(8), (1, -1)):
        dx, dy = int(sign * STEPS[k, 0]), int(sign * STEPS[k, 1])
        if not (0 <= x + dx < SIDE and 0 <= y + dy < SIDE):
            continue
        to = (y + dy) * SIDE + x + dx
        length = STEP_M * math.hypot(dx, dy)
        fractions = (0.0, 0.5, 1.0) if k < 4 else (0.0, 0.25, 0.5, 0.75, 1.0)
        doors = []
        for f, g in zip(fractions, (0.0, *fractions), strict=False):
            # Half-lattice places are whole numbers, or lie in the middle of two side by side.
            px, py = 2 * x + 2 * dx * f, 2 * y + 2 * dy * f
            corners = [(i, j) for i in {math.floor(px), math.ceil(px)} for j in {math.floor(py), math.ceil(py)}]
            low = sum(lattice.floor_m[j, i] for i, j in corners) / len(corners)
            high = sum(lattice.ceiling_m[j, i] for i, j in corners) / len(corners)
            doors.append(((f - g) * length, low, high))
        edge = (node if sign > 0 else to) * 8 + k
        span = slice(lattice.band_at[edge], lattice.band_at[edge + 1])
        bands = list(zip(lattice.band_low[span].tolist(), lattice.band_high[span].tolist(), strict=True))
        out.append((to, length, doors, gaps(bands)))
    return out


def legal(parts: list[tuple[Doors, tuple[float, float]]], z0: float, z1: float, slope: float) -> bool:
    """Is there a profile through all doors, edge after edge, each within its gap?"""
    s, low, high = [0.0], [z0], [z0]
    at = 1.0
    for doors, (under, over) in parts:
        for run, lo, hi in doors:
            at += run
            lo, hi = max(lo, under), min(hi, over)
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
    """Length of the shortest legal simple path from node 0 to the last, by trying all of them, shortest first."""
    around = [edges_from(lattice, k) for k in range(NODES)]
    paths: list[tuple[float, list[tuple[Doors, list[tuple[float, float]]]]]] = []

    def walk(
        node: int, seen: frozenset[int], length: float, parts: list[tuple[Doors, list[tuple[float, float]]]]
    ) -> None:
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
        # A way may pass a node twice to gain height, which a simple path cannot: it is never dearer.
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
    assert gaps([]) == [(-math.inf, math.inf)]
    assert gaps([(5.0, 9.0), (2.0, 6.0)]) == [(-math.inf, 2.0), (9.0, math.inf)]
    assert gaps([(-math.inf, 9.0)]) == [(9.0, math.inf)]
    assert gaps([(-math.inf, math.inf)]) == []
    assert gaps([(1.0, 4.0), (4.0, 6.0)]) == [(-math.inf, 1.0), (4.0, 4.0), (6.0, math.inf)]


def test_cut_and_joined_tube_is_the_tube() -> None:
    zones = (
        Zone("over", Circle(500.0, 0.0, 400.0), None, Level(100.0, "agl")),
        Zone("under", Circle(1200.0, 0.0, 500.0), Level(90.0, "amsl"), None),
    )
    air = Airspace(jacksboro(), zones)
    whole = air.tube(np.array([[-800.0, 100.0], [700.0, -50.0], [2500.0, 300.0]]), FIELD)
    length = float(whole.s_m[-1])
    rng = np.random.default_rng(3)
    for _ in range(50):
        places = np.concatenate([[0.0], np.sort(rng.uniform(0.0, length, 3)), [length]])
        parts = [cut(whole, a, b) for a, b in pairwise(places)]
        again = join([p for p in parts if p is not None])
        assert again.s_m[-1] == pytest.approx(length)
        for s in rng.uniform(0.0, length, 20):
            for name in ("floor_m", "ceiling_m"):
                assert _at(again.s_m, getattr(again, name), s) == pytest.approx(_at(whole.s_m, getattr(whole, name), s))
        assert [b.zone for b in again.bands] == [b.zone for b in whole.bands]
        for a, b in zip(again.bands, whole.bands, strict=True):
            assert (a.s0_m, a.s1_m) == pytest.approx((b.s0_m, b.s1_m))
            s = rng.uniform(b.s0_m, b.s1_m)
            assert _at(a.s_m, a.top_m, s) == pytest.approx(_at(b.s_m, b.top_m, s))
            assert _at(a.s_m, a.bottom_m, s) == pytest.approx(_at(b.s_m, b.bottom_m, s))


def _at(s_m: Floats, value: Floats, s: float) -> float:
    k = int(np.clip(np.searchsorted(s_m, s, "right") - 1, 0, len(value) - 1))
    a, b = value[k]
    return float(a) if a == b else float(a + (b - a) * (s - s_m[k]) / (s_m[k + 1] - s_m[k]))
