"""Each optimiser finds costs of the same distribution as a second implementation of the papers' text."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.bench.measure import compare, holm
from gcsplan.research.optimisers.driver import minimise
from gcsplan.research.optimisers.functions import FUNCTIONS
from gcsplan.research.optimisers.registry import OPTIMISERS
from tests.oracles.swarm_families import FAMILIES, Rule

SEEDS, N, DIM, ROUNDS = 40, 15, 6, 20
SCENARIOS = {
    "krill": "krill-mound", "abc": "krill-mound", "b-abc": "ib-abc-together", "ib-abc": "ib-abc-together",
    "gwo": "ssgwo-table3", "mgwo": "ssgwo-table3", "igwo": "ssgwo-table3", "sogwo": "ssgwo-table3",
    "ssgwo": "ssgwo-table3", "foa": "msfoa-1", "iffo": "msfoa-1", "mfoa": "msfoa-1",
    "msfoa": "msfoa-1", "pso": "abo", "de": "msfoa-1", "abo": "abo",
}  # fmt: skip

Cost = Callable[[Floats], Floats]


def test_every_optimiser_has_a_second_implementation() -> None:
    """The others: PO is ABO with α = β = 1, SSGWO as printed is a reading, L-SHADE is compared point by point."""
    assert set(OPTIMISERS) - set(FAMILIES) == {"po", "ssgwo-printed", "lshade"}
    assert (OPTIMISERS["po"].update, OPTIMISERS["po"].defaults) == (
        OPTIMISERS["abo"].update,
        OPTIMISERS["abo"].defaults,
    )


def ours(name: str, cost: Cost, dim: int) -> Floats:
    """The least cost of each of `SEEDS` runs."""
    return np.array(
        [minimise(name, cost, dim, population=N, iterations=ROUNDS, seed=seed).cost for seed in range(SEEDS)]
    )


def theirs(rule: Rule, cost: Cost, dim: int) -> Floats:
    """The same by a second implementation, of other seeds."""
    out = np.full(SEEDS, np.inf)
    for k in range(SEEDS):

        def noted(x: Floats, k: int = k) -> Floats:
            costs = cost(x)
            out[k] = min(out[k], costs.min())
            return costs

        rule(noted, N, dim, ROUNDS, np.random.default_rng([7, k]))
    return out


def problems(name: str) -> dict[str, tuple[Cost, int]]:
    from gcsplan.research.bench.papers.speed import cost_of

    cost, _, _ = cost_of(SCENARIOS[name], None)
    functions = {f: (FUNCTIONS[f].on_unit_box(DIM, shifted=True), DIM) for f in ("f1", "f3", "f7")}
    return functions | {SCENARIOS[name]: (cost, cost.dim)}


@pytest.mark.slow
def test_costs_have_the_distribution_of_the_text() -> None:
    p = {
        (name, where): compare(ours(name, cost, dim), theirs(rule, cost, dim))[0]
        for name, rule in FAMILIES.items()
        for where, (cost, dim) in problems(name).items()
    }
    assert len(p) == 4 * len(FAMILIES)
    differ = [(*key, value) for key, value in zip(p, holm(list(p.values())), strict=True) if value <= 0.01]
    assert differ == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "other"), [("foa", "iffo"), ("pso", "de")])
def test_so_many_seeds_tell_one_family_from_another(name: str, other: str) -> None:
    """Nearer ones, such as GWO and MGWO or IB-ABC and B-ABC, differ too little after so few rounds."""
    p = [compare(ours(name, cost, dim), theirs(FAMILIES[other], cost, dim))[0] for cost, dim in problems(name).values()]
    assert min(holm(p)) <= 0.01
