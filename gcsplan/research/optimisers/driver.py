"""The driver of all optimisers: seed, bounds, exact budget, best so far, history, stopping."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gcsplan.arrays import Floats, Int64s
from gcsplan.errors import GcsplanError, InputError
from gcsplan.research.optimisers.box import WORST_COST, Run
from gcsplan.research.optimisers.registry import OptimiserEntry, get

BatchCost = Callable[[Floats], NDArray[np.floating]]
"""A batch objective: from points (n, dim) in [0, 1] to costs (n,). It must not change its argument."""

StoppedBy = Literal["iterations", "evaluations", "target", "told"]


@dataclass(frozen=True, slots=True)
class State:
    """A run after one batch, as `minimise` reports it. ``x`` (dim,) is the best point so far, ``cost`` its cost."""

    iteration: int
    evaluations: int
    elapsed: float
    cost: float
    x: Floats


@dataclass(frozen=True, slots=True)
class History:
    """For each batch in order (m,): cost evaluations so far, its iteration (0: first population), best cost so far."""

    evaluations: Int64s
    iterations: Int64s
    cost: Floats

    def by_iteration(self) -> Floats:
        """Best cost at the end of each iteration, (iterations begun + 1,); [0] is after the first population."""
        last = np.searchsorted(self.iterations, np.arange(self.iterations[-1] + 1), side="right") - 1
        return self.cost[last]


@dataclass(frozen=True, slots=True)
class OptimiserResult:
    """The best point ``x`` (dim,) that was evaluated, its cost (inf if no cost was finite), and a record of the run."""

    x: Floats
    cost: float
    evaluations: int
    iterations: int
    history: History
    stopped_by: StoppedBy
    optimiser: str


FIRST_BATCHES = 10
"""Batches that a rule may yield before its first iteration. One that counts no iterations at all (`Run.cycles`) ends
after as many batches as it has iterations."""


def minimise(  # noqa: PLR0913 - options by name, each with a default
    optimiser: str | OptimiserEntry,
    cost: BatchCost,
    dim: int,
    *,
    population: int | None = None,
    iterations: int | None = None,
    evaluations: int | None = None,
    seed: int | np.random.Generator = 1,
    parameters: Mapping[str, object] | None = None,
    target: float | None = None,
    start: ArrayLike | None = None,
    tell: Callable[[State], bool | None] | None = None,
) -> OptimiserResult:
    """Minimise ``cost`` over the unit box [0, 1]^dim; the same arguments give the same bytes.

    Args:
        optimiser: a name of `gcsplan.research.optimisers.registry`, or a row of your own.
        cost: batch objective, (n, dim) to (n,). A value that is not finite counts as the worst.
        dim: number of variables, 1 or more.
        population: size of the swarm; default: the row's.
        iterations: rounds of the update rule after the first population; default: the row's, unless ``evaluations``
            is set.
        evaluations: most cost evaluations (rows passed to ``cost``), used exactly: the last batch is cut. If both are
            set, the run ends at whichever is reached first.
        seed: a whole number, or a generator to draw from.
        parameters: the rule's parameters; they replace the row's defaults.
        target: stop after the batch that finds this cost or less.
        start: (m, dim) points that take the first places of the first population.
        tell: called after each batch; return True to stop.

    Raises:
        InputError: an unknown name or parameter, or a size or budget that cannot be used.
        GcsplanError: a rule left the box, or ``cost`` did not return one number for each row: a bug in either.
    """
    entry = get(optimiser) if isinstance(optimiser, str) else optimiser
    if iterations is None and evaluations is None:
        iterations = entry.iterations
    size = entry.population if population is None else population
    for what, given, least in (
        ("dim", dim, 1),
        ("population", size, entry.least_population),
        ("iterations", iterations, 1),
        ("evaluations", evaluations, 1),
    ):
        if given is not None and given < least:
            raise InputError(f"{entry.name}: {what} must be {least} or more, given {given}")
    rng = seed if isinstance(seed, np.random.Generator) else np.random.default_rng(seed)
    run = Run(rng, dim, size, iterations, evaluations, _start(start, dim))
    book = _Book(run, cost, target, tell)
    steps = entry.rule()(run, **entry.with_defaults(parameters))
    stopped_by: StoppedBy | None = None
    try:
        batch = next(steps)
        while True:
            costs, stopped_by = book.evaluate(batch)
            if stopped_by is not None:
                break
            batch = steps.send(costs)
    except StopIteration:
        pass
    finally:
        steps.close()
    return book.result(entry.name, stopped_by or "iterations")


def _start(start: ArrayLike | None, dim: int) -> Floats:
    if start is None:
        return np.empty((0, dim))
    points = np.array(start, dtype=np.float64, ndmin=2)
    if points.ndim != 2 or points.shape[1] != dim or not ((points >= 0.0) & (points <= 1.0)).all():
        raise InputError(f"start must be (m, {dim}) points in [0, 1], given shape {points.shape}")
    return points


class _Book:
    """Evaluates batches and records a run."""

    def __init__(
        self, run: Run, cost: BatchCost, target: float | None, tell: Callable[[State], bool | None] | None
    ) -> None:
        self.run = run
        self.cost = cost
        self.target = -np.inf if target is None else target
        self.tell = tell
        self.best_x: Floats | None = None
        self.best = np.inf
        self.trace: list[tuple[int, int, float]] = []

    def evaluate(self, batch: Floats) -> tuple[Floats, StoppedBy | None]:
        """Costs of ``batch``, cut to the rest of the budget, and the reason to stop, or None."""
        run = self.run
        limit = run.evaluations_limit
        if limit is not None:
            batch = batch[: limit - run.evaluations]
        if not (batch.min() >= 0.0 and batch.max() <= 1.0):  # also false for NaN
            raise GcsplanError(f"an update rule left the unit box in iteration {run.iteration + 1}")
        raw = np.asarray(self.cost(batch), dtype=np.float64)
        if raw.shape != (len(batch),):
            raise GcsplanError(f"the cost must have shape ({len(batch)},), one number a row; given {raw.shape}")
        run.evaluations += len(batch)
        costs = np.where(np.isfinite(raw), raw.clip(-WORST_COST, WORST_COST), WORST_COST)
        lead = int(costs.argmin())
        if self.best_x is None or costs[lead] < min(self.best, WORST_COST):
            self.best_x = batch[lead].copy()
            self.best = float(raw[lead]) if np.isfinite(raw[lead]) else np.inf
        at = run.iteration + 1 if run.in_cycles else 0
        self.trace.append((run.evaluations, at, self.best))
        return costs, self._stop(at)

    def _stop(self, at: int) -> StoppedBy | None:
        run = self.run
        assert self.best_x is not None
        ended = self.tell is not None and self.tell(
            State(at, run.evaluations, run.elapsed, self.best, self.best_x.copy())
        )
        if self.best <= self.target:
            return "target"
        if ended:
            return "told"
        if not run.in_cycles and run.iterations is not None and len(self.trace) > max(run.iterations, FIRST_BATCHES):
            return "iterations"
        return "evaluations" if run.evaluations == run.evaluations_limit else None

    def result(self, name: str, stopped_by: StoppedBy) -> OptimiserResult:
        assert self.best_x is not None
        evaluations, iterations, cost = (np.array(column) for column in zip(*self.trace, strict=True))
        history = History(evaluations, iterations, cost)
        return OptimiserResult(
            self.best_x, self.best, self.run.evaluations, int(iterations[-1]), history, stopped_by, name
        )
