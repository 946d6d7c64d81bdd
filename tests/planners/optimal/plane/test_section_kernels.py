"""Values on sections against a dense look at the ground, and the cheapest chain against all chains."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from gcsplan.planners.optimal.plane.section_kernels import cheapest_chain, lay_sections

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
def test_lines_between_values_are_nowhere_above_the_floor(seed: int, sign: float) -> None:
    rng = np.random.default_rng(seed)
    z = rng.normal(0.0, 20.0, (12, 14))
    first = np.array([0, 1, 18, 31], np.int64)
    row, col = np.empty(31), np.empty(31)
    for begin, end in itertools.pairwise(first.tolist()):
        a, b = rng.uniform(-1.0, 12.0, (2, 2))
        t = np.linspace(0.0, 1.0, max(end - begin, 2))[: end - begin]
        row[begin:end], col[begin:end] = a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])
    beside = np.array([(0.0, 0.0), (0.3, 0.1), (-0.2, 0.25)])
    least = -30.0 if seed % 2 else -math.inf
    out = np.empty(31)
    assert lay_sections(z, sign, 7.0, least, first, row, col, beside, out)
    nearest = math.inf
    for begin, end in itertools.pairwise(first.tolist()):
        for n in range(begin, end - 1):
            t = np.linspace(0.0, 1.0, 400)
            r, c = row[n] + t * (row[n + 1] - row[n]), col[n] + t * (col[n + 1] - col[n])
            floor = np.max([sign * height_at(z, r + dr, c + dc) for dr, dc in beside], axis=0)
            floor = np.maximum(floor, least) + 7.0
            room = floor - (out[n] + t * (out[n + 1] - out[n]))
            assert room.min() >= -1e-9
            nearest = min(nearest, float(room.min()))
    assert nearest < 1e-2  # no lower than is needed


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


def sweep(rng: np.random.Generator, *, back: bool) -> tuple[float, float]:
    """The least sum over random nodes by the kernel, and over all chains one by one."""
    first = np.array([0, 1, 5, 9, 12, 13], np.int64)
    n = 13
    section = np.repeat(np.arange(5), np.diff(first))
    x, y = 100.0 * section.astype(float), np.zeros(n)
    for a, b in itertools.pairwise(first.tolist()):
        y[a:b] = np.sort(rng.uniform(-60.0, 60.0, b - a))
    low = rng.uniform(0.0, 50.0, n)
    high = low + rng.uniform(-2.0, 40.0, n)
    shut = rng.random(n) < 0.15
    shut[[0, -1]] = False
    price, loose = rng.uniform(-0.4, 0.4, n), rng.uniform(0.0, 3.0, n)
    price[-1] = 0.0
    slant, vary = np.sqrt(1.0 - price**2), rng.uniform(0.0, 0.05, n)
    away, left = np.hypot(x - x[0], y - y[0]), np.hypot(x - x[-1], y - y[-1])
    spec = np.array([2.0, 430.0, 0.2, 1.0, 1.0, float(back)])
    value, near = np.empty(n), np.empty(n, np.int32)
    end = -1 if back else 0
    value[end], near[end] = (0.0 if back else -price[0] * low[0]), -1
    cheapest_chain(first, x, y, low, high, shut, loose, price, slant, vary, away, left, spec, np.empty(n), value, near)

    def leg(i: int, j: int, nearest_m: float) -> float:
        run = math.hypot(x[j] - x[i], y[j] - y[i])
        if away[i] + run + left[j] > 430.0:
            return math.inf
        c, off, each = price[i] - price[j], loose[i] + loose[j], 0.125 / (nearest_m - 2.0)
        less = 4.0 * each + 0.25 * vary[i] * (off + 2.0)
        if abs(price[i]) + vary[i] <= 0.2:
            less = min(less, (4.0 + off * off) * each)
        return slant[i] * run + min(c * low[j], c * high[j]) - less

    def nearest(i: int, j: int) -> float:
        fixed, k = (i, section[j]) if back else (j, section[i])
        return min(math.hypot(x[fixed] - x[m], y[fixed] - y[m]) for m in range(first[k], first[k + 1]))

    best = math.inf
    for chain in itertools.product(*(range(a, b) for a, b in itertools.pairwise(first.tolist()))):
        if not shut[list(chain)].any():
            sums = sum(leg(i, j, nearest(i, j)) for i, j in itertools.pairwise(chain))
            best = min(best, sums - (0.0 if back else price[0] * low[0]))
    return float(value[0 if back else -1]), best


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_cheapest_chain_is_that_of_all_chains(seed: int, back: bool) -> None:
    found, best = sweep(np.random.default_rng(seed), back=back)
    assert found == pytest.approx(best, rel=1e-12)
