"""Readings of the papers' rules evaluate, point by point, what a second implementation of the text does."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.research.optimisers.driver import minimise
from gcsplan.research.optimisers.functions import FUNCTIONS
from gcsplan.research.optimisers.registry import OPTIMISERS
from tests.oracles import swarms

N, DIM, ROUNDS = 9, 4, 8

Oracle = Callable[[swarms.Cost, int, int, int, np.random.Generator], list[swarms.Point]]

READINGS: dict[str, tuple[str, dict[str, object], Oracle]] = {
    "ssgwo, all": ("ssgwo", {"leaders": "all"}, lambda *a: swarms.ssgwo_all(*a, trial="every")),
    "ssgwo, α": ("ssgwo", {"leaders": "all", "trial": "alpha"}, lambda *a: swarms.ssgwo_all(*a, trial="alpha")),
    "sogwo": ("sogwo", {"alike": "distances", "span": 8.0}, lambda *a: swarms.sogwo_published(*a, span=8.0)),
    "abc": ("abc", {"bees": "one", "limit": 3}, lambda *a: swarms.one_bee(*a, limit=3)),
    "abc, pairs": ("abc", {"bees": "one", "limit": 3, "group": 2}, lambda *a: swarms.one_bee(*a, limit=3, group=2)),
    "ib-abc": ("ib-abc", {"counts_from": "zero"}, lambda *a: swarms.ib_abc_from_zero(*a)),
    "krill, one": (
        "krill", {"moves": "one", "attempts": 3, "sight": 0.4},
        lambda *a: swarms.krill(*a, one=True, printed=False, sight=0.4),
    ),
    "krill, printed crowd": (
        "krill", {"crowd": "printed", "attempts": 3, "sight": 0.4},
        lambda *a: swarms.krill(*a, one=False, printed=True, sight=0.4),
    ),
    "krill, both": (
        "krill", {"moves": "one", "crowd": "printed", "attempts": 3, "sight": 0.4},
        lambda *a: swarms.krill(*a, one=True, printed=True, sight=0.4),
    ),
    "po": ("po", {"rule": "authors", "span": 100.0}, lambda *a: swarms.parrots(*a, span=100.0)),
    "msfoa": (
        "msfoa", {"beyond": "redrawn", "global_step": 1.0, "swarms": 3},
        lambda *a: swarms.msfoa(*a, step=1.0, origin=0.0),
    ),
    "msfoa, signed": (
        "msfoa", {"beyond": "redrawn", "global_step": 0.5, "swarms": 3, "origin": 0.5},
        lambda *a: swarms.msfoa(*a, step=0.5, origin=0.5),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", READINGS)
@pytest.mark.parametrize("function", ["f1", "f7", "f9"])
def test_a_reading_evaluates_the_points_of_the_text(name: str, function: str) -> None:
    got, wanted = evaluated(name, FUNCTIONS[function].on_unit_box(DIM, shifted=True), DIM)
    np.testing.assert_allclose(got, wanted, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in READINGS if name != "abc, pairs"])  # a path may have no pairs
@pytest.mark.parametrize("scenario", ["krill-mound", "ssgwo-table3", "ib-abc-together"])
def test_a_reading_evaluates_the_points_of_the_text_on_paths_too(name: str, scenario: str) -> None:
    from gcsplan.research.bench.papers.speed import cost_of  # the quick tests need no map

    cost, _, _ = cost_of(scenario, None)
    got, wanted = evaluated(name, cost, cost.dim)
    np.testing.assert_allclose(got, wanted, atol=1e-9)


def evaluated(name: str, cost: Callable[[Floats], Floats], dim: int) -> tuple[Floats, Floats]:
    """The points that a reading evaluates, and those of the text, in order."""
    optimiser, parameters, oracle = READINGS[name]
    seen: list[Floats] = []

    def noted(x: Floats) -> Floats:
        seen.append(x.copy())
        return np.asarray(cost(x))

    minimise(optimiser, noted, dim, population=N, iterations=ROUNDS, seed=12, parameters=parameters)
    wanted = oracle(lambda p: float(cost(np.array([p]))[0]), N, dim, ROUNDS, np.random.default_rng(12))
    got = np.concatenate(seen)
    assert got.shape == np.shape(wanted)
    return got, np.asarray(wanted)


@pytest.mark.slow
def test_each_reading_differs_from_what_is_decided() -> None:
    cost = FUNCTIONS["f7"].on_unit_box(DIM, shifted=True)
    for name, (optimiser, parameters, _) in READINGS.items():
        asked = {
            k: v for k, v in parameters.items() if k in ("swarms", "sight", "attempts", "limit", "group", "global_step")
        }
        if parameters.items() <= {**OPTIMISERS[optimiser].defaults, **asked}.items():  # it is what is decided
            continue
        plain, other = (
            minimise(optimiser, cost, DIM, population=N, iterations=ROUNDS, seed=12, parameters=p).history.cost
            for p in (asked, parameters)
        )
        assert plain.tolist() != other.tolist(), name
