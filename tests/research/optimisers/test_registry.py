"""Every optimiser of the table is held to the same: a row that is added is tested by being there."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.research.optimisers.driver import OptimiserResult, minimise
from gcsplan.research.optimisers.functions import FUNCTIONS
from gcsplan.research.optimisers.registry import OPTIMISERS, get, names
from tests.support.effort import alike

every = pytest.mark.parametrize("name", names())
DIM, BUDGET, RUNS = 30, 6000, 3


def corner(x: Floats) -> Floats:
    """Best where every rule is pushed past the bounds."""
    return np.asarray((2.0 - x).sum(axis=1))


def flat(x: Floats) -> Floats:
    return np.ones(len(x))


def broken(x: Floats) -> Floats:
    """No number, or an endless one, on most of the box; elsewhere negative."""
    f = -np.cos(7.0 * x).sum(axis=1)
    f[x[:, 0] > 0.5] = np.nan
    f[x[:, -1] > 0.5] = np.inf
    f[x[:, 0] > 0.9] = -np.inf
    return np.asarray(f)


@every
@pytest.mark.parametrize("cost", [corner, flat, broken])
@pytest.mark.parametrize(
    "budget", [{"iterations": 400, "evaluations": 777}, *alike({"iterations": 6}, {"evaluations": 1003})]
)
def test_it_keeps_its_bounds_and_uses_exactly_its_budget(
    name: str, cost: Callable[[Floats], Floats], budget: dict[str, int]
) -> None:
    asked = 0

    def counted(x: Floats) -> Floats:
        nonlocal asked
        assert x.ndim == 2
        assert x.shape[1] == 7
        assert ((x >= 0.0) & (x <= 1.0)).all()
        asked += len(x)
        return cost(x)

    result = minimise(name, counted, 7, population=12, **budget)
    assert result.evaluations == asked == result.history.evaluations[-1]
    if result.stopped_by == "evaluations":
        assert asked == budget["evaluations"]
        assert result.iterations <= budget.get("iterations", 1003)
    else:
        assert result.stopped_by == "iterations"
        assert result.iterations == budget["iterations"]


@every
def test_the_best_so_far_never_rises_and_is_the_best_point_ever_asked_for(name: str) -> None:
    costs: list[float] = []
    points: list[Floats] = []

    def cost(x: Floats) -> Floats:
        f = np.sin(9.0 * x).sum(axis=1) + ((x - 0.3) ** 2).sum(axis=1)
        costs.extend(f)
        points.extend(x.copy())
        return np.asarray(f)

    result = minimise(name, cost, 5, population=10, iterations=30, seed=4)
    best = int(np.argmin(costs))
    assert result.cost == costs[best]
    assert np.array_equal(result.x, points[best])
    assert (np.diff(result.history.cost) <= 0.0).all()
    assert (np.diff(result.history.evaluations) > 0).all()
    so_far = np.minimum.accumulate(costs)
    assert np.array_equal(result.history.cost, so_far[result.history.evaluations - 1])
    per_iteration = result.history.by_iteration()
    assert len(per_iteration) == 31
    assert per_iteration[-1] == result.cost


@every
def test_the_same_seed_gives_the_same_bytes_and_another_seed_other_ones(name: str) -> None:
    def once(seed: int) -> OptimiserResult:
        return minimise(name, FUNCTIONS["f7"].on_unit_box(6, shifted=True), 6, population=10, iterations=15, seed=seed)

    first, again, other = once(5), once(5), once(6)
    assert first.x.tobytes() == again.x.tobytes()
    assert first.history.cost.tobytes() == again.history.cost.tobytes()
    assert first.x.tobytes() != other.x.tobytes()


@pytest.mark.slow
@every
@pytest.mark.parametrize("function", [pytest.param("f1", marks=pytest.mark.slow), "f7"])
def test_it_beats_random_search_of_equal_evaluations_or_its_row_says_why_not(name: str, function: str) -> None:
    cost = FUNCTIONS[function].on_unit_box(DIM, shifted=True)
    found = [minimise(name, cost, DIM, evaluations=BUDGET, seed=seed).cost for seed in range(RUNS)]
    if not OPTIMISERS[name].loses_to_random:
        assert np.median(found) < np.median(at_random(function))


@cache
def at_random(function: str) -> tuple[float, ...]:
    cost = FUNCTIONS[function].on_unit_box(DIM, shifted=True)
    rngs = [np.random.default_rng(100 + seed) for seed in range(RUNS)]
    return tuple(float(cost(rng.random((BUDGET, DIM))).min()) for rng in rngs)


@every
def test_it_runs_with_one_variable_and_with_its_least_population(name: str) -> None:
    least = max(get(name).least_population, int(str(get(name).defaults.get("swarms", 1))))
    result = minimise(name, corner, 1, population=least, iterations=5)
    assert 1.0 <= result.cost <= 2.0


@every
def test_a_cost_that_is_never_finite_is_survived_and_reported_as_endless(name: str) -> None:
    seen: list[float] = []
    result = minimise(
        name, lambda x: np.full(len(x), np.nan), 3, population=10, iterations=4, tell=lambda s: seen.append(s.cost)
    )
    assert result.cost == np.inf
    assert set(seen) == {np.inf}
    assert result.x.shape == (3,)


@every
def test_an_iteration_evaluates_as_many_as_its_row_says(name: str) -> None:
    n = 20
    result = minimise(name, corner, 4, population=n, iterations=6)
    each = {"P": n, "2P": 2 * n, "P + 1": n + 1}.get(get(name).evaluations_per_iteration)
    per_iteration = np.diff(
        result.history.evaluations[np.searchsorted(result.history.iterations, range(7), "right") - 1]
    )
    if each is not None:
        assert set(per_iteration) == {each}
    elif name == "lshade":
        assert per_iteration[0] == n
        assert per_iteration[-1] < n / 2
        assert (np.diff(per_iteration) < 0).all()
    else:
        assert name in ("krill", "abc", "b-abc", "ib-abc")
        assert (per_iteration >= 2 * n).all()
        assert (per_iteration <= 23 * n).all()


def test_the_table_names_what_each_paper_needs() -> None:
    for entry in OPTIMISERS.values():
        assert entry.summary
        assert entry.paper
        assert entry.equations
        assert callable(entry.rule())
    wolves = {"gwo", "mgwo", "igwo", "sogwo", "ssgwo"}
    others = {"krill", "abc", "b-abc", "ib-abc", "foa", "mfoa", "iffo", "msfoa", "pso", "de", "po", "abo"}
    assert wolves | others <= set(names())
