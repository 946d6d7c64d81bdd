"""Floors of nodes against a dense look at the ground, and bounds of chains against a search over altitudes."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from gcsplan.planners.optimal.plane.section_kernels import NONE, cheapest_chains, lay_sections
from tests.support.effort import seeds

SEEDS = range(6)


def height_at(z: np.ndarray, row: np.ndarray, col: np.ndarray) -> np.ndarray:
    """Bilinear heights, as on the border beyond it."""
    r, c = np.clip(row, 0.0, len(z) - 1.0), np.clip(col, 0.0, z.shape[1] - 1.0)
    j, i = np.minimum(r.astype(int), len(z) - 2), np.minimum(c.astype(int), z.shape[1] - 2)
    v, u = r - j, c - i
    south, north = ((1 - u) * z[k, i] + u * z[k, i + 1] for k in (j, j + 1))
    return (1 - v) * south + v * north


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_nodes_floor_is_below_all_floors_up_to_its_neighbours(seed: int, sign: float) -> None:
    rng = np.random.default_rng(seed)
    z = rng.normal(0.0, 20.0, (12, 14))
    first = np.array([0, 1, 18, 31], np.int64)
    row, col = np.empty(31), np.empty(31)
    for begin, end in itertools.pairwise(first.tolist()):
        a, b = rng.uniform(-1.0, 12.0, (2, 2))
        t = np.linspace(0.0, 1.0, max(end - begin, 2))[: end - begin]
        row[begin:end], col[begin:end] = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])
    beside = np.array([(0.0, 0.0), (0.3, 0.1), (-0.2, 0.25)])[: 3 if seed % 3 else 1]
    least = -30.0 if seed % 2 else -math.inf
    out = np.empty(31)
    assert lay_sections(z, sign, 7.0, least, first, row, col, beside, out)
    for begin, end in itertools.pairwise(first.tolist()):
        for n in range(begin, end):
            floors = []
            for m in {max(n - 1, begin), min(n + 1, end - 1)} - ({n} if end - begin > 1 else set()):
                t = np.linspace(0.0, 1.0, 400)
                r, c = row[n] + t * (row[m] - row[n]), col[n] + t * (col[m] - col[n])
                heights = [sign * height_at(z, r + dr, c + dc) for dr, dc in beside]
                floors.append(np.maximum(np.max(heights, axis=0), least) + 7.0)
            room = float(np.min(floors)) - out[n]
            assert room >= -1e-9
            if len(beside) == 1:
                assert room < 0.05  # exact, but for the samples


def test_unknown_ground_is_reported() -> None:
    z = np.zeros((4, 4))
    z[1, 2] = math.nan
    out = np.empty(3)
    at = np.array([0.5, 1.0, 1.5])
    assert not lay_sections(z, 1.0, 0.0, -math.inf, np.array([0, 3], np.int64), at, at + 1.0, np.zeros((1, 2)), out)


def test_unknown_ground_between_two_known_nodes_is_reported() -> None:
    z = np.zeros((4, 9))
    z[1, 4] = math.nan
    out = np.empty(2)
    row, col = np.array([1.5, 1.5]), np.array([1.5, 6.5])
    ends = np.array([0, 2], np.int64)
    assert not lay_sections(z, 1.0, 0.0, -math.inf, ends, row, col, np.zeros((1, 2)), out)
    assert lay_sections(z, 1.0, 0.0, -math.inf, ends, row + 1.0, col, np.zeros((1, 2)), out)


def chains(seed: int, *, beyond: float) -> tuple[float, float, bool]:
    """The bound of random chains by the kernel, and the least of all chains over a fine choice of altitudes; whether
    some node was shut."""
    rng = np.random.default_rng(seed)
    first = np.array([0, 1, 5, 9, 12, 13], np.int64)
    n, gap = 13, np.full(4, 100.0)
    section = np.repeat(np.arange(5), np.diff(first))
    place, step = np.zeros(n, np.int64), 2.0
    for a, b in itertools.pairwise(first.tolist()):
        place[a:b] = np.sort(rng.integers(-30, 31, b - a)) if b - a > 1 else 0
    aside = step * place
    low = np.round(rng.uniform(0.0, 30.0, n))
    high = low + np.round(rng.uniform(0.0, 20.0, n))
    high[[0, -1]] = low[[0, -1]]
    left = np.hypot(100.0 * (4 - section), aside)
    most = 425.0 if seed % 2 else 1e9
    k, sine = 0.25, 0.25 / math.hypot(1.0, 0.25)
    over = np.array([0.0] * 4 + [0.3, 1.0 / sine - sine])
    half = np.append(np.linspace(0.0, sine, 4), sine + over[4:])
    flat = np.where(over > 0.0, math.sqrt(1.0 - sine**2) - k * over, np.sqrt(1.0 - np.minimum(half, sine) ** 2))
    slope, slant, more = (np.append(-v[:0:-1] if v is half else v[:0:-1], v) for v in (half, flat, beyond * k * over))
    loss = np.zeros((5, len(slope)))
    loss[0] = more
    value, near = np.full((n, len(slope)), NONE), np.full((n, len(slope)), -1.0)
    value[0] = -slope * low[0]
    spec, work = np.array([step, 1.0, most]), (np.empty((61, len(slope) + 1)), np.empty((4, len(slope))))
    cheapest_chains(first, gap, place, low, high, left, slope, slant, loss, spec, np.empty(n), value, near, *work)
    bound = float((value[-1] + slope * low[-1]).max())

    altitudes = np.arange(0.0, 51.0, 0.5)
    costs = np.where(np.abs(altitudes - low[0]) < 0.3, 0.0, math.inf)
    of = {0: costs}
    for j in range(1, n):
        best = np.full(len(altitudes), math.inf)
        for i in np.flatnonzero(section == section[j] - 1).tolist():
            run = math.hypot(100.0, aside[i] - aside[j])
            rise = np.abs(altitudes[None, :] - altitudes[:, None])
            leg = np.hypot(np.maximum(run, rise / k), rise)
            best = np.minimum(best, (of[i][:, None] + leg).min(axis=0))
        of[j] = np.where((altitudes >= low[j] - 0.25) & (altitudes <= high[j] + 0.25), best, math.inf)
    return bound, float(of[n - 1].min()), bool((value[:, 0] >= NONE).any())


@pytest.mark.parametrize("seed", seeds(6, 6, 30))
def test_chains_cost_no_less_than_their_bound_and_little_more(seed: int) -> None:
    bound, least, _ = chains(seed, beyond=0.0)
    if bound < NONE:
        assert bound <= least
        assert bound > least - 3.0 - 0.01 * least
    else:
        assert least > 425.0 - 4.0
    assert chains(seed, beyond=1.0)[0] <= bound


@pytest.mark.slow
def test_nodes_are_shut_that_no_cheap_chain_passes() -> None:
    found = [chains(seed, beyond=0.0) for seed in range(30)]
    assert any(shut for _, _, shut in found)
    assert any(bound < NONE for bound, _, _ in found)
