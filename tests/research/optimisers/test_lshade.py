"""L-SHADE evaluates, point by point, what a second implementation of the paper does, and beats plain DE."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.research.optimisers.classics import SPREAD, learnt, positive_cauchy
from gcsplan.research.optimisers.driver import minimise
from gcsplan.research.optimisers.functions import FUNCTIONS
from tests.oracles import swarms


@pytest.mark.parametrize("function", ["f1", "f7", "f9"])
@pytest.mark.parametrize(("n", "memory"), [(5, 2), (24, 6)])
def test_lshade_evaluates_the_points_of_the_paper(function: str, n: int, memory: int) -> None:
    cost, dim, rounds = FUNCTIONS[function].on_unit_box(5, shifted=True), 5, 40
    seen: list[Floats] = []

    def noted(x: Floats) -> Floats:
        seen.append(x.copy())
        return np.asarray(cost(x))

    minimise("lshade", noted, dim, population=n, iterations=rounds, seed=7, parameters={"memory": memory})
    rng = np.random.default_rng(7)
    wanted = swarms.lshade(lambda p: float(cost(np.array([p]))[0]), n, dim, rounds, rng, memory, 4)
    got = np.concatenate(seen)
    assert got.shape == np.shape(wanted)
    np.testing.assert_allclose(got, wanted, atol=1e-9)


def test_a_crossover_rate_that_only_ever_was_0_stays_0() -> None:
    one, some = np.ones(3), np.array([0.0, 0.5, 1.0])
    assert math.isnan(learnt(0.5, 0.0 * one, one, one / 3.0)[0])  # the paper's terminal value
    assert math.isnan(learnt(math.nan, some, one, one / 3.0)[0])
    rate, scale = learnt(0.5, some, np.array([0.2, 0.4, 0.9]), np.array([0.5, 0.25, 0.25]))
    assert rate == pytest.approx((0.25 * 0.25 + 0.25) / (0.25 * 0.5 + 0.25))
    assert scale == pytest.approx((0.5 * 0.04 + 0.25 * 0.16 + 0.25 * 0.81) / (0.5 * 0.2 + 0.25 * 0.4 + 0.25 * 0.9))


def test_scale_factors_are_a_cauchy_distribution_drawn_again_below_0() -> None:
    middle = np.full(40_000, 0.2)
    got = np.sort(positive_cauchy(np.random.default_rng(1), middle))
    drawn = 0.2 + SPREAD * np.random.default_rng(2).standard_cauchy(100_000)
    wanted = np.sort(np.minimum(drawn[drawn > 0.0], 1.0))
    at = np.linspace(0.01, 0.99, 50)
    np.testing.assert_allclose(np.quantile(got, at), np.quantile(wanted, at), rtol=0.04, atol=0.004)


@pytest.mark.slow
@pytest.mark.parametrize("function", ["f1", "f9"])
def test_lshade_beats_de_at_equal_evaluations(function: str) -> None:
    cost = FUNCTIONS[function].on_unit_box(20, shifted=True)
    ours, plain = (
        np.median([minimise(name, cost, 20, population=60, evaluations=12_000, seed=s).cost for s in range(5)])
        for name in ("lshade", "de")
    )
    assert ours < plain
