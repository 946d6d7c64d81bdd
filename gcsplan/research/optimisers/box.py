"""Parts shared by the update rules: the state of a run, bounds, partners, distances, greedy replacement."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.errors import InputError

Steps = Generator[Floats, Floats, None]
"""A running optimiser: yields populations (n, dim) in [0, 1]; is sent their finite costs (n,), which it may change."""

WORST_COST = 1e100
"""Cost that a rule receives for one that is larger or not finite; its squares and sums stay finite."""


@dataclass(slots=True)
class Run:
    """The state of a run for its update rule; the driver makes it and counts ``evaluations``.

    ``iterations`` and ``evaluations_limit`` are the budget; at least one of them is set. ``start`` (m, dim): points
    that take the first places of the first population. ``elapsed``: share of the budget that was spent when the current
    iteration began; with a limit of iterations alone t / T, with t from 0.
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
        """T, the number of planned iterations; if only evaluations are limited, their number over the population."""
        if self.iterations is not None:
            return float(self.iterations)
        assert self.evaluations_limit is not None
        return max(1.0, self.evaluations_limit / self.population)

    def first(self, count: int | None = None) -> Floats:
        """The first population (count, dim): ``start``, then uniform in the box. Default ``count``: the population."""
        x = self.rng.random((self.population if count is None else count, self.dim))
        given = self.start[: len(x)]
        if given.size:
            x[: len(given)] = given
        return x

    def cycles(self) -> Iterator[int]:
        """Yield the iterations from 0 to the budget's number, and update ``iteration`` and ``elapsed``."""
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


def require(optimiser: str, what: str, given: str, known: Sequence[str]) -> None:
    """Raise InputError unless ``given`` is one of the ``known`` words of the parameter ``what``."""
    if given not in known:
        raise InputError(f"{optimiser}: {what} must be one of {', '.join(known)}, given {given!r}")


def clipped(x: Floats) -> Floats:
    """Clip ``x`` to [0, 1] in place and return it."""
    return x.clip(0.0, 1.0, out=x)  # the method: the function adds as much again to the time of one point


def partners(rng: np.random.Generator, count: int, among: int, how_many: int) -> list[Indices]:
    """Draw for each row i of ``count`` ``how_many`` different indices below ``among``, none of them i; uniform.

    Returns ``how_many`` arrays (count,). ``among`` must exceed ``how_many``. Draws without retries.
    """
    taken = [np.arange(count)]
    for k in range(1, how_many + 1):
        drawn = rng.integers(0, among - k, size=count)
        for other in np.sort(np.stack(taken), axis=0):
            drawn += drawn >= other  # skip taken indices, lowest first
        taken.append(drawn)
    return taken[1:]


def rms_distances(a: Floats, b: Floats) -> Floats:
    """Distances (n, m) ‖aᵢ − bⱼ‖ / √dim, from differences: they stay exact when the population has nearly converged."""
    gap = a[:, None, :] - b[None, :, :]
    squares: Floats = np.einsum("ijk,ijk->ij", gap, gap) / a.shape[1]
    return np.sqrt(squares)


def keep_better(x: Floats, f: Floats, tried: Floats, f_tried: Floats) -> Bools:
    """Replace rows of ``x`` and ``f`` by the rows of ``tried`` that cost less, in place; return which (n,)."""
    better = f_tried < f
    x[better] = tried[better]
    f[better] = f_tried[better]
    return better
