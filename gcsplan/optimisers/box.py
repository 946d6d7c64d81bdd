"""What the update rules share: the state of a run as a rule sees it, bounds, partners, the best of a population."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats

Indices = NDArray[np.intp]
Steps = Generator[Floats, Floats, None]
"""An optimiser at work: yields populations (n, dim) in [0, 1]; is sent their costs (n,), finite, its own to change."""

WORST = 1e100
"""What a rule is told of a cost that is not finite, or is beyond it: squares and sums of it stay finite."""


@dataclass(slots=True)
class Run:
    """What an update rule may know of its run; the driver makes it and counts ``evaluations``.

    ``iterations`` and ``evaluations_limit`` are the budget, at least one of them given; ``start`` (m, dim) are points
    that take the first places of the first population. ``elapsed`` is the share of the budget that was spent when the
    present iteration began: t / T with t from 0 where iterations are what is limited.
    """

    rng: np.random.Generator
    dim: int
    population: int
    iterations: int | None = None
    evaluations_limit: int | None = None
    start: Floats = field(default_factory=lambda: np.empty((0, 0)))
    evaluations: int = 0
    iteration: int = 0
    elapsed: float = 0.0
    in_cycles: bool = False
    _first_cost: int = 0

    @property
    def horizon(self) -> float:
        """T, the number of iterations planned; where evaluations alone are limited, as many as whole populations."""
        if self.iterations is not None:
            return float(self.iterations)
        assert self.evaluations_limit is not None
        return max(1.0, self.evaluations_limit / self.population)

    def first(self, count: int | None = None) -> Floats:
        """The first population (count, dim), uniform in the box; ``count`` is the population unless given."""
        x = self.rng.random((self.population if count is None else count, self.dim))
        given = self.start[: len(x)]
        if given.size:
            x[: len(given)] = given
        return x

    def cycles(self) -> Iterator[int]:
        """Count the iterations from 0 until the budget's number; keeps ``iteration`` and ``elapsed``."""
        self._first_cost, self.in_cycles = self.evaluations, True
        while self.iterations is None or self.iteration < self.iterations:
            self.elapsed = self._spent()
            yield self.iteration
            self.iteration += 1

    def _spent(self) -> float:
        by_iterations = 0.0 if self.iterations is None else self.iteration / self.iterations
        left = 0 if self.evaluations_limit is None else self.evaluations_limit - self._first_cost
        by_evaluations = (self.evaluations - self._first_cost) / left if left > 0 else 0.0
        return min(1.0, max(by_iterations, by_evaluations))


def clipped(x: Floats) -> Floats:
    """``x`` itself, every value moved to the nearest in [0, 1]."""
    return np.clip(x, 0.0, 1.0, out=x)


def partners(rng: np.random.Generator, count: int, among: int, how_many: int) -> list[Indices]:
    """For each row i of ``count``: ``how_many`` different indices below ``among``, none of them i; uniform, no retries.

    Returned as ``how_many`` arrays (count,). ``among`` must exceed ``how_many``.
    """
    taken = [np.arange(count)]
    for k in range(1, how_many + 1):
        drawn = rng.integers(0, among - k, size=count)
        for other in np.sort(np.stack(taken), axis=0):
            drawn += drawn >= other  # skip what is taken, lowest first
        taken.append(drawn)
    return taken[1:]


def rms_distances(x: Floats) -> Floats:
    """(n, n) distances ‖xᵢ − xⱼ‖ / √dim; exact differences, since rules compare them when all have nearly met."""
    gap = x[:, None, :] - x[None, :, :]
    squares: Floats = np.einsum("ijk,ijk->ij", gap, gap) / x.shape[1]
    return np.sqrt(squares)


def keep_better(x: Floats, f: Floats, tried: Floats, f_tried: Floats) -> NDArray[np.bool_]:
    """Greedy replacement in place: rows of ``tried`` that cost less. Returns which."""
    better = f_tried < f
    x[better] = tried[better]
    f[better] = f_tried[better]
    return better
