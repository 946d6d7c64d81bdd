"""The wolves' update rules against their equations, worked out number by number from the same random stream.

Equation numbers are those of Feng et al. 2024.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.research.optimisers.wolves import FACTORS
from tests.support.swarm_play import Play, bowl, clip, crowd

N, D, T = 7, 4, 8


def by_cost(f: Floats) -> list[int]:
    return sorted(range(len(f)), key=lambda i: f[i])


def told(r1: float, r2: float, a: float, leader: float, x: float, origin: float = 0.0) -> float:
    """Eq. 3, 4 and 6-11 for one wolf, leader and dimension, in coordinates from ``origin``."""
    big_a = 2.0 * a * r1 - a
    big_c = 2.0 * r2
    distance = abs(big_c * (leader - origin) - (x - origin))
    return (leader - origin) - big_a * distance + origin


@pytest.mark.parametrize("origin", [0.0, 0.5])
def test_gwo_moves_every_wolf_to_the_mean_of_what_three_leaders_tell_it(origin: float) -> None:
    x0 = crowd(N, D)
    play = Play("gwo", bowl, x0, T=T, origin=origin)
    best = [(float(f), x) for f, x in sorted(zip(bowl(x0), x0, strict=True), key=lambda p: p[0])][:3]
    x = x0
    for t in range(5):
        moved = play.step()
        ((r1, r2),) = play.draws()
        a = 2.0 - 2.0 * t / T  # eq. 5
        for i in range(N):
            for d in range(D):
                parts = [told(r1[k, i, d], r2[k, i, d], a, best[k][1][d], x[i, d], origin) for k in range(3)]
                assert moved[i, d] == pytest.approx(clip(sum(parts) / 3.0), abs=1e-12)  # eq. 12
        x = moved
        # The three best ever lead.
        best = sorted(best + [(float(f), p) for f, p in zip(bowl(x), x, strict=True)], key=lambda p: p[0])[:3]


def test_mgwo_weighs_leaders_falls_exponentially_and_moves_only_to_improve() -> None:
    x = crowd(N, D)
    play = Play("mgwo", bowl, x, T=T)
    for t in range(4):
        f = bowl(x)
        moved = play.step()
        ((r1, r2),) = play.draws()
        a = 2.0 * (1.0 - (math.exp(t / T) - 1.0) / (math.e - 1.0))
        first = by_cost(f)[:3]
        spread = abs(f[first[2]] - f[first[0]]) + 1e-12
        weights = [1.0 / (f[k] - f[first[0]] + spread) for k in first]
        for i in range(N):
            for d in range(D):
                parts = [told(r1[k, i, d], r2[k, i, d], a, x[first[k], d], x[i, d]) for k in range(3)]
                mean = sum(w * p for w, p in zip(weights, parts, strict=True)) / sum(weights)
                assert moved[i, d] == pytest.approx(clip(mean), abs=1e-12)
        f_moved = bowl(moved)
        x = np.array([moved[i] if f_moved[i] < f[i] else x[i] for i in range(N)])


def test_igwo_takes_the_better_of_gwos_and_a_learnt_move_if_it_improves() -> None:
    x = crowd(N, D)
    play = Play("igwo", bowl, x, T=T)
    beyond = 0
    for t in range(4):
        f = bowl(x)
        moved = play.step()
        (r1, r2), pick, other, rand = play.draws()
        a = 2.0 - 2.0 * t / T
        first = by_cost(f)[:3]
        expected = np.empty((2 * N, D))
        for i in range(N):
            for d in range(D):
                parts = [told(r1[k, i, d], r2[k, i, d], a, x[first[k], d], x[i, d]) for k in range(3)]
                value = sum(parts) / 3.0
                beyond += not 0.0 <= value <= 1.0
                # At a bound: halfway between the old value and the bound.
                expected[i, d] = value if 0.0 <= value <= 1.0 else (x[i, d] + float(value > 1.0)) / 2.0
        for i in range(N):
            radius = math.dist(x[i], expected[i])
            within = [j for j in range(N) if math.dist(x[i], x[j]) <= radius]
            for d in range(D):
                neighbour = within[int(pick[i, d] * len(within))]
                value = x[i, d] + rand[i, d] * (x[neighbour, d] - x[other[i], d])
                expected[N + i, d] = value if 0.0 <= value <= 1.0 else (x[i, d] + float(value > 1.0)) / 2.0
        assert moved == pytest.approx(expected, abs=1e-12)
        costs = bowl(moved)
        x = x.copy()
        for i in range(N):
            better = i if costs[i] <= costs[N + i] else N + i
            if costs[better] < f[i]:
                x[i] = moved[better]
    assert beyond > 0


def test_sogwo_turns_close_elements_of_wolves_unlike_alpha_before_gwos_move() -> None:
    dim = 4
    x = crowd(14, dim, seed=3)
    play = Play("sogwo", bowl, x, T=T)
    best = [(float(f), p) for f, p in sorted(zip(bowl(x), x, strict=True), key=lambda p: p[0])][:3]
    turned = level = 0
    for t in range(5):
        f = bowl(x)
        moved = play.step()
        ((r1, r2),) = play.draws()
        a = 2.0 - 2.0 * t / T
        alpha = best[0][1]
        for i in by_cost(f)[3:]:
            rank = [sum(v < w for v in x[i]) - sum(v < u for v in alpha) for w, u in zip(x[i], alpha, strict=True)]
            spearman = 1.0 - 6.0 * sum(g * g for g in rank) / (dim * (dim * dim - 1))
            close = [abs(x[i, d] - alpha[d]) < a / 4.0 for d in range(dim)]
            if spearman <= 0.0 and sum(close) >= dim - sum(close):
                turned += 1
                level += 2 * sum(close) == dim
                x[i] = [1.0 - x[i, d] if close[d] else x[i, d] for d in range(dim)]
        for i in range(14):
            for d in range(dim):
                parts = [told(r1[k, i, d], r2[k, i, d], a, best[k][1][d], x[i, d]) for k in range(3)]
                assert moved[i, d] == pytest.approx(clip(sum(parts) / 3.0), abs=1e-12)
        x = moved.copy()
        best = sorted(best + [(float(v), p) for v, p in zip(bowl(x), x, strict=True)], key=lambda p: p[0])[:3]
    assert turned > 3
    assert level > 0


def shares(x: Floats, i: int, first: list[int]) -> list[float]:
    """Eq. 14-16 and 20-22 for one wolf."""
    near = []
    for leader in first:
        d = [math.dist(p, x[leader]) for p in x]
        mean = sum(d) / len(d)
        near.append(mean / max(d[i], 1e-9 * mean))
    return [value / sum(near) for value in near]


def taken(f: float, f_new: float, temperature: float, rand: float) -> bool:
    """Eq. 24, one trial."""
    return f_new < f or rand < math.exp(-(f_new - f) / temperature)


@pytest.mark.slow
def test_ssgwo_with_leaders_apart_moves_them_by_eq_17_to_19_and_wolves_by_eq_23() -> None:
    n, long = 12, 60
    x = crowd(n, D, seed=5)
    f = bowl(x)
    play = Play("ssgwo", bowl, x, T=long, leaders="apart")
    temperature = float(np.std(f))
    uphill = 0
    for t in range(40):
        moved = play.step()
        (r1, r2), w1, w2, b = play.draws()[-4:]
        a = 1.0 + math.cos(math.pi * t / long)
        order = by_cost(f)
        first, others = order[:3], order[3:]
        for place, i in enumerate(others):
            weights = shares(x, i, first)
            for d in range(D):
                parts = [told(r1[k, place, d], r2[k, place, d], a, x[first[k], d], x[i, d]) for k in range(3)]
                value = sum(w * p for w, p in zip(weights, parts, strict=True))
                assert moved[i, d] == pytest.approx(clip(value), abs=1e-12)
        # r1 ≠ r2: the second is drawn from one fewer, and skips the first.
        one, two = others[w1[0]], others[w2[0] + (w2[0] >= w1[0])]
        assert one != two
        alpha, beta, delta = (x[k] for k in first)
        for d in range(D):
            steps = (x[one, d] - x[two, d], alpha[d] - beta[d], alpha[d] - delta[d])
            for k in range(3):
                value = x[first[k], d] - a * b[k, 0, d] * steps[k]  # eq. 17-19
                assert moved[first[k], d] == pytest.approx(clip(value), abs=1e-12)
        f_moved = bowl(moved)
        # The trial's random numbers are the next that the generator gives.
        state = play.rng.generator.bit_generator.state
        rand = np.random.default_rng(0)
        rand.bit_generator.state = state
        trial = rand.random(n)
        x, f = x.copy(), f.copy()
        for i in range(n):
            if i in first:
                take = f_moved[i] < f[i]
            else:
                take = taken(f[i], f_moved[i], temperature, trial[i])
                uphill += take and f_moved[i] > f[i]
            if take:
                x[i], f[i] = moved[i], f_moved[i]
        temperature *= 0.95  # eq. 25
    assert uphill > 0


def test_ssgwo_as_printed_moves_all_wolves_by_eq_17_to_23() -> None:
    n = 6
    x = crowd(n, D, seed=6)
    play = Play("ssgwo-printed", bowl, x, T=T)
    first, others = by_cost(bowl(x))[:3], by_cost(bowl(x))[3:]
    moved = play.step()
    w1, w2, b = play.draws()
    a = 2.0  # eq. 13 at t = 0
    alpha, beta, delta = (x[k] for k in first)
    for i in range(n):
        weights = shares(x, i, first)
        one, two = others[w1[i]], others[w2[i] + (w2[i] >= w1[i])]
        for d in range(D):
            x1 = alpha[d] - a * b[0, i, d] * (x[one, d] - x[two, d])
            x2 = beta[d] - a * b[1, i, d] * (alpha[d] - beta[d])
            x3 = delta[d] - a * b[2, i, d] * (alpha[d] - delta[d])
            value = weights[0] * x1 + weights[1] * x2 + weights[2] * x3
            assert moved[i, d] == pytest.approx(clip(value), abs=1e-12)


def test_convergence_factors_share_ends_and_middle_and_the_cosine_stays_high() -> None:
    for factor in FACTORS.values():
        assert [factor(0.0), factor(0.5), factor(1.0)] == pytest.approx([2.0, 1.0, 0.0], abs=1e-12)
    assert FACTORS["printed"](0.25) == pytest.approx(1.292893, abs=1e-6)
    assert FACTORS["cosine"](0.25) == pytest.approx(1.707107, abs=1e-6)


def test_wolves_that_all_stand_on_one_spot_weigh_their_leaders_alike() -> None:
    play = Play("ssgwo", bowl, np.full((6, 3), 0.25), T=T)
    assert np.isfinite(play.step()).all()
    assert np.isfinite(play.step()).all()
