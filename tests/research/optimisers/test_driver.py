"""The driver alone, with update rules made for the purpose."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.arrays import Floats
from gcsplan.errors import GcsplanError, InputError
from gcsplan.research.optimisers.box import WORST_COST, Run, Steps, clipped, partners
from gcsplan.research.optimisers.driver import State, minimise
from gcsplan.research.optimisers.registry import OptimiserEntry, get
from tests.support.effort import draws


def row(update: object, **rest: object) -> OptimiserEntry:
    return OptimiserEntry("test", "", update, "", "", population=4, iterations=3, **rest)  # type: ignore[arg-type]


def first_value(x: Floats) -> Floats:
    return x[:, 0].copy()


def two_batches(run: Run) -> Steps:
    yield run.first()
    for _ in run.cycles():
        yield run.rng.random((3, run.dim))
        yield run.rng.random((2, run.dim))


def test_iterations_count_rounds_and_history_knows_every_batch() -> None:
    result = minimise(row(two_batches), first_value, 2)
    assert result.stopped_by == "iterations"
    assert result.evaluations == 4 + 3 * 5
    assert result.history.evaluations.tolist() == [4, 7, 9, 12, 14, 17, 19]
    assert result.history.iterations.tolist() == [0, 1, 1, 2, 2, 3, 3]
    assert np.array_equal(result.history.by_iteration(), result.history.cost[[0, 2, 4, 6]])


@pytest.mark.parametrize("budget", [1, 3, 4, 5, 7, 8, 9, 23])
def test_the_last_batch_is_cut_to_the_budget(budget: int) -> None:
    sizes: list[int] = []

    def cost(x: Floats) -> Floats:
        sizes.append(len(x))
        return first_value(x)

    result = minimise(row(two_batches), cost, 2, evaluations=budget)
    assert result.evaluations == sum(sizes) == budget
    assert result.stopped_by == "evaluations"


def elapsed_of(**budget: int) -> list[float]:
    seen: list[float] = []

    def watch(run: Run) -> Steps:
        yield run.first()
        for _ in run.cycles():
            seen.append(run.elapsed)
            yield run.rng.random((4, run.dim))

    minimise(row(watch), first_value, 2, **budget)
    return seen


def test_elapsed_rises_from_nothing_by_the_share_of_the_budget_spent() -> None:
    assert elapsed_of(iterations=4) == [0.0, 0.25, 0.5, 0.75]
    assert elapsed_of(evaluations=4 + 16) == [0.0, 0.25, 0.5, 0.75]
    assert elapsed_of(iterations=8, evaluations=4 + 16) == [0.0, 0.25, 0.5, 0.75]
    assert elapsed_of(iterations=2, evaluations=4 + 16) == [0.0, 0.5]


def test_the_target_ends_a_run_after_the_batch_that_meets_it() -> None:
    result = minimise("pso", first_value, 2, population=5, iterations=1000, target=1e-3)
    assert result.stopped_by == "target"
    assert result.cost <= 1e-3
    assert (result.history.cost[:-1] > 1e-3).all()


def test_the_caller_is_told_every_batch_and_may_stop() -> None:
    told: list[State] = []

    def tell(state: State) -> bool:
        told.append(state)
        state.x[:] = -1.0  # a copy: nothing breaks
        return len(told) == 3

    result = minimise("de", first_value, 2, population=5, iterations=9, tell=tell)
    assert result.stopped_by == "told"
    assert [s.evaluations for s in told] == [5, 10, 15]
    assert [s.iteration for s in told] == [0, 1, 2]
    assert (result.x >= 0.0).all()


def test_costs_that_are_not_finite_reach_a_rule_as_the_worst_and_never_win() -> None:
    sent: list[Floats] = []

    def watch(run: Run) -> Steps:
        sent.append((yield run.first()))

    values = np.array([np.nan, 3.0, -np.inf, 1e300])
    result = minimise(row(watch), lambda x: values, 2)
    assert sent[0].tolist() == [WORST_COST, 3.0, WORST_COST, WORST_COST]
    assert result.cost == 3.0


def test_given_points_take_the_first_places_of_the_first_population() -> None:
    first: list[Floats] = []
    points = np.array([[0.25, 0.75], [1.0, 0.0]])
    minimise("gwo", lambda x: first.append(x.copy()) or first_value(x), 2, population=5, iterations=1, start=points)
    assert np.array_equal(first[0][:2], points)
    assert len(first[0]) == 5
    # A swarm with a single place starts at the first of them.
    first.clear()
    minimise("foa", lambda x: first.append(x.copy()) or first_value(x), 2, population=5, iterations=1, start=points)
    assert np.array_equal(first[0], points[:1])


def test_a_generator_as_seed_is_drawn_from() -> None:
    rng = np.random.default_rng(3)
    by_number = minimise("de", first_value, 2, population=5, iterations=3, seed=3)
    by_generator = minimise("de", first_value, 2, population=5, iterations=3, seed=rng)
    assert np.array_equal(by_number.x, by_generator.x)
    next_run = minimise("de", first_value, 2, population=5, iterations=3, seed=rng)
    assert not np.array_equal(by_number.x, next_run.x)


@pytest.mark.parametrize("bad", [1.0 + 1e-9, -1e-9, np.nan])
def test_a_rule_that_leaves_the_box_is_a_bug_and_says_so(bad: float) -> None:
    def leaves(run: Run) -> Steps:
        yield run.first()
        for _ in run.cycles():
            yield np.full((1, run.dim), bad)

    with pytest.raises(GcsplanError, match="left the unit box in iteration 1"):
        minimise(row(leaves), first_value, 2)


def test_a_cost_of_the_wrong_shape_is_named() -> None:
    with pytest.raises(GcsplanError, match=r"\(4,\).*\(4, 2\)"):
        minimise(row(two_batches), lambda x: x, 2)


def test_an_error_of_the_cost_closes_the_rule_and_comes_through() -> None:
    closed: list[bool] = []

    def watch(run: Run) -> Steps:
        try:
            yield run.first()
        finally:
            closed.append(True)

    def cost(x: Floats) -> Floats:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        minimise(row(watch), cost, 2)
    assert closed == [True]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"optimiser": "gow"}, "Did you mean 'gwo'"),
        ({"dim": 0}, "dim must be 1 or more, given 0"),
        ({"population": 2}, "population must be 3 or more, given 2"),
        ({"iterations": 0}, "iterations must be 1 or more"),
        ({"evaluations": 0}, "evaluations must be 1 or more"),
        ({"parameters": {"orgin": 0.5}}, "Did you mean 'origin'"),
        ({"parameters": {"origin": "far"}}, "origin must be a number, given 'far'"),
        ({"parameters": {"origin": float("nan")}}, "origin must be a number"),
        ({"parameters": {"origin": True}}, "origin must be a number"),
        ({"start": [[0.1, 0.2, 0.3]]}, r"\(m, 2\) points"),
        ({"start": [[0.1, 1.2]]}, r"points in \[0, 1\]"),
        ({"optimiser": "abc", "parameters": {"limit": 2.5}}, "limit must be a whole number"),
        ({"optimiser": "abc", "parameters": {"group": 0}}, "group must be a whole number"),
        ({"optimiser": "ib-abc", "parameters": {"feedback": 1}}, "feedback must be true or false"),
        ({"optimiser": "ib-abc", "parameters": {"spent_share": 1.0}}, "spent_share must lie between"),
        ({"optimiser": "abo", "parameters": {"alpha": 0.9}}, "alpha must be 1 or more"),
        ({"optimiser": "abo", "parameters": {"talk": "sung"}}, "one of added, printed"),
        ({"optimiser": "po", "parameters": {"rule": "none"}}, "one of equations, authors"),
        ({"optimiser": "ssgwo", "parameters": {"leaders": "none"}}, "one of apart, all, printed"),
        ({"optimiser": "ssgwo", "parameters": {"trial": "beta"}}, "one of every, alpha"),
        ({"optimiser": "sogwo", "parameters": {"alike": "looks"}}, "one of ranks, distances"),
        ({"optimiser": "krill", "parameters": {"moves": "two"}}, "one of together, one"),
        ({"optimiser": "krill", "parameters": {"crowd": "big"}}, "one of ranks, printed"),
        ({"optimiser": "abc", "parameters": {"bees": "two"}}, "one of together, one"),
        ({"optimiser": "ib-abc", "parameters": {"counts_from": "two"}}, "one of one, zero"),
        ({"optimiser": "msfoa", "parameters": {"beyond": "kept"}}, "one of clipped, redrawn"),
        ({"optimiser": "ssgwo", "parameters": {"factor": "linear"}}, "one of cosine, printed"),
        ({"optimiser": "msfoa", "population": 4}, "5 swarms need a population of 5"),
    ],
)
def test_what_cannot_be_run_is_refused_with_its_cure(change: dict[str, object], message: str) -> None:
    asked: dict[str, object] = {"optimiser": "gwo", "cost": first_value, "dim": 2, **change}
    with pytest.raises(InputError, match=message):
        minimise(**asked)  # type: ignore[arg-type]


def test_a_threshold_may_be_a_number_where_its_default_is_none() -> None:
    assert get("msfoa").with_defaults({"threshold": 2})["threshold"] == 2
    assert get("msfoa").with_defaults()["threshold"] is None


@settings(max_examples=draws(30))
@given(st.integers(4, 12), st.integers(1, 3), st.integers(0, 2**32))
def test_partners_differ_from_each_other_and_from_oneself(n: int, k: int, seed: int) -> None:
    drawn = np.stack([np.arange(n), *partners(np.random.default_rng(seed), n, n, k)])
    assert all(len(set(column)) == k + 1 for column in drawn.T.tolist())
    assert drawn.min() >= 0
    assert drawn.max() < n


@pytest.mark.slow
def test_partners_are_uniform() -> None:
    rng = np.random.default_rng(2)
    counts = np.zeros((4, 4), dtype=int)
    for _ in range(3000):
        a, b = partners(rng, 4, 4, 2)
        counts[a[1], b[1]] += 1
    possible = [(a, b) for a in (0, 2, 3) for b in (0, 2, 3) if a != b]
    assert counts.sum() == sum(counts[pair] for pair in possible)
    assert all(abs(counts[pair] - 500) < 5 * np.sqrt(500) for pair in possible)


def test_clipping_is_in_place() -> None:
    x = np.array([[-0.5, 0.5, 1.5]])
    assert clipped(x) is x
    assert x.tolist() == [[0.0, 0.5, 1.0]]


def test_a_rule_that_counts_no_iterations_ends_after_as_many_batches() -> None:
    def endless(run: Run) -> Steps:
        while True:
            yield run.first()

    row = OptimiserEntry("endless", "", endless, "", "", population=5, iterations=20)
    ended = minimise(row, lambda x: x.sum(axis=1), 2)
    assert (ended.stopped_by, ended.evaluations) == ("iterations", 21 * 5)
