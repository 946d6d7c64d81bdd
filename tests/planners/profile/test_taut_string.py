"""The taut string, compared with linear programmes and a shortest path through the visibility graph."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from gcsplan.arrays import Floats
from gcsplan.planners.profile.taut_string import Blocked, Profile, taut_string
from tests.support.effort import seeds

Doors = tuple[Floats, Floats, Floats, float, float]


def random_doors(seed: int) -> Doors:
    """A random tube; some doors are unlimited, some are single points; a third of the tubes have whole metres."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 26))
    s = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 3.0, n - 1))])
    middle = np.cumsum(rng.normal(0.0, 3.0, n))
    half = rng.uniform(0.0, 6.0, n) * (rng.random(n) < 0.9)
    low, high = middle - half, middle + half
    if seed % 3 == 0:
        low = np.round(low)
        high = np.maximum(np.round(high), low)
    low[rng.random(n) < 0.15] = -np.inf
    high[rng.random(n) < 0.15] = np.inf
    ends = rng.normal(0.0, 3.0, 2)
    return s, low, high, float(np.clip(ends[0], low[0], high[0])), float(np.clip(ends[1], low[-1], high[-1]))


def least_by_linear_programme(s: Floats, low: Floats, high: Floats, z0: float, z1: float) -> tuple[float, float]:
    """The least total variation and the least maximum slope of any profile through the doors."""
    n = len(s)
    bounds = [(a if np.isfinite(a) else None, b if np.isfinite(b) else None) for a, b in zip(low, high, strict=True)]
    bounds[0], bounds[-1] = (z0, z0), (z1, z1)
    rise = np.eye(n)[1:] - np.eye(n)[:-1]
    both = np.vstack([rise, -rise])
    variation = linprog(
        np.concatenate([np.zeros(n), np.ones(n - 1)]),
        A_ub=np.hstack([both, -np.vstack([np.eye(n - 1)] * 2)]),
        b_ub=np.zeros(2 * (n - 1)),
        bounds=bounds + [(0, None)] * (n - 1),
    )
    slope = linprog(
        np.concatenate([np.zeros(n), [1.0]]),
        A_ub=np.hstack([both, -np.tile(np.diff(s), 2)[:, None]]),
        b_ub=np.zeros(2 * (n - 1)),
        bounds=[*bounds, (0, None)],
    )
    return float(variation.fun), float(slope.fun)


def shortest_by_visibility(s: Floats, low: Floats, high: Floats, z0: float, z1: float) -> float:
    """Length of the shortest profile through the visibility graph of all door edges."""
    points = [(0, z0)]
    for i in range(1, len(s) - 1):
        points += [(i, z) for z in {low[i], high[i]} if np.isfinite(z)]
    points.append((len(s) - 1, z1))
    rows, cols, lengths = [], [], []
    for a, (i, z) in enumerate(points):
        for b, (j, w) in enumerate(points):
            if j > i:
                line = z + (w - z) * (s[i : j + 1] - s[i]) / (s[j] - s[i])
                if (line >= low[i : j + 1] - 1e-9).all() and (line <= high[i : j + 1] + 1e-9).all():
                    rows.append(a)
                    cols.append(b)
                    lengths.append(np.hypot(s[j] - s[i], w - z))
    graph = csr_array((lengths, (rows, cols)), shape=(len(points), len(points)))
    return float(dijkstra(graph, indices=0)[-1])


@pytest.mark.slow
@pytest.mark.parametrize("block", [*range(4), *(pytest.param(n, marks=pytest.mark.nightly) for n in range(4, 8))])
def test_is_shortest_climbs_least_and_is_least_steep_all_at_once(block: int) -> None:
    for seed in range(block * 30, block * 30 + 30):
        s, low, high, z0, z1 = random_doors(seed)
        found = taut_string(s, low, high, z0, z1)
        assert isinstance(found, Profile), seed
        z = found.at(s)
        assert (z >= low - 1e-9).all(), seed
        assert (z <= high + 1e-9).all(), seed
        assert (found.s_m[0], found.amsl_m[0], found.s_m[-1], found.amsl_m[-1]) == (s[0], z0, s[-1], z1), seed
        variation, slope = least_by_linear_programme(s, low, high, z0, z1)
        assert found.vertical_m == pytest.approx(variation, abs=1e-6), seed
        steepest = np.abs(np.diff(found.amsl_m) / np.diff(found.s_m)).max()
        assert steepest == pytest.approx(slope, abs=1e-6), seed
        assert found.length_m == pytest.approx(shortest_by_visibility(s, low, high, z0, z1), rel=1e-9), seed


@pytest.mark.parametrize("seed", seeds(8, 8, 40))
def test_climb_limit_is_refused_exactly_where_every_profile_breaks_it(seed: int) -> None:
    s, low, high, z0, z1 = random_doors(seed)
    _, slope = least_by_linear_programme(s, low, high, z0, z1)
    if slope < 1e-6:
        return
    assert isinstance(taut_string(s, low, high, z0, z1, slope * 1.0001, slope * 1.0001), Profile)
    found = taut_string(s, low, high, z0, z1, slope * 0.9999, slope * 0.9999)
    assert isinstance(found, Blocked)
    assert found.kind in ("climb", "descent")
    assert found.s1_m > found.s0_m
    assert found.by > 0


def test_climb_and_descent_limits_are_apart() -> None:
    s, low, high = np.array([0.0, 10.0, 30.0]), np.array([0.0, 10.0, 0.0]), np.array([50.0, 50.0, 50.0])
    assert isinstance(taut_string(s, low, high, 0.0, 0.0, 1.0, 0.5), Profile)
    up = taut_string(s, low, high, 0.0, 0.0, 0.9, 0.5)
    assert isinstance(up, Blocked)
    assert (up.kind, up.s0_m, up.s1_m, up.by) == ("climb", 0.0, 10.0, pytest.approx(1.0))
    down = taut_string(s, low, high, 0.0, 0.0, 1.0, 0.4)
    assert isinstance(down, Blocked)
    assert (down.kind, down.s0_m, down.s1_m, down.by) == ("descent", 10.0, 30.0, pytest.approx(2.0))


def test_names_the_tightest_door_where_floor_is_over_ceiling() -> None:
    s = np.arange(4.0)
    found = taut_string(s, np.array([0.0, 3.0, 7.0, 0.0]), np.array([9.0, 2.0, 2.0, 9.0]), 1.0, 1.0)
    assert found == Blocked("pinched", 2.0, 2.0, 5.0)


def test_start_outside_its_door_is_pinched() -> None:
    s, low, high = np.arange(3.0), np.zeros(3), np.full(3, 9.0)
    assert taut_string(s, low, high, -1.0, 1.0) == Blocked("pinched", 0.0, 0.0, 1.0)
    assert taut_string(s, low, high, 1.0, 11.0) == Blocked("pinched", 2.0, 2.0, 2.0)


@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_unknown_ground_is_never_room(value: float) -> None:
    found = taut_string(np.arange(3.0), np.array([0.0, value, 0.0]), np.full(3, np.inf), 1.0, 1.0)
    assert isinstance(found, Blocked)
    assert found.s0_m == 1.0


def test_floor_that_touches_the_ceiling_is_passed_at_that_very_height() -> None:
    found = taut_string(np.arange(3.0), np.array([0.0, 5.0, 0.0]), np.array([9.0, 5.0, 9.0]), 1.0, 1.0)
    assert isinstance(found, Profile)
    assert found.at(np.array([1.0]))[0] == 5.0


def test_open_doors_leave_a_straight_line() -> None:
    n = 50
    found = taut_string(np.arange(float(n)), np.full(n, -np.inf), np.full(n, np.inf), 3.0, 8.0)
    assert isinstance(found, Profile)
    assert len(found.s_m) == 2
