"""Run a swarm's update rule batch by batch and record every random number that it draws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.research.optimisers.box import Run
from gcsplan.research.optimisers.registry import get

DRAWS = ("random", "uniform", "integers", "normal", "permutation")


class Recorded:
    """A random generator that records, in order, the numbers it has returned."""

    def __init__(self, seed: int) -> None:
        self.generator = np.random.default_rng(seed)
        self.drawn: list[Any] = []

    def __getattr__(self, name: str) -> Any:
        method = getattr(self.generator, name)
        if name not in DRAWS:
            return method

        def draw(*args: Any, **kwargs: Any) -> Any:
            value = method(*args, **kwargs)
            self.drawn.append(np.copy(value))
            return value

        return draw


class Play:
    """One run of a rule of the registry. ``batches``: the points yielded so far; ``costs``: the costs sent to it."""

    def __init__(
        self, name: str, cost: Callable[[Floats], Floats], first: Floats, *, T: int, seed: int = 0, **changes: Any
    ) -> None:
        self.rng = Recorded(seed)
        self.cost = cost
        n, dim = first.shape
        population = changes.pop("population", n)
        run = Run(self.rng, dim, population, T, start=first)  # type: ignore[arg-type]
        self._steps = get(name).rule()(run, **get(name).with_defaults(changes))
        self._next = next(self._steps)
        self.batches: list[Floats] = []
        self.costs: list[Floats] = []
        self.rng.drawn.clear()  # the first population is given, not drawn
        self._answer()

    def step(self) -> Floats:
        """Let the rule yield once more; return a copy of its population."""
        self._answer_to_rule()
        return self.batches[-1]

    def draws(self) -> list[Any]:
        """The numbers drawn since the last call."""
        out = list(self.rng.drawn)
        self.rng.drawn.clear()
        return out

    def _answer(self) -> None:
        self.batches.append(self._next.copy())
        self.costs.append(np.asarray(self.cost(self._next), dtype=float))

    def _answer_to_rule(self) -> None:
        self._next = self._steps.send(self.costs[-1].copy())
        self._answer()


def clip(value: float) -> float:
    return min(1.0, max(0.0, value))


def bowl(x: Floats) -> Floats:
    """The cost of an uneven bowl, whose minimum is off the middle, at 0.37 in every coordinate."""
    weights = 1.0 + np.arange(x.shape[1])
    return np.asarray((weights * (x - 0.37) ** 2).sum(axis=1))


def crowd(n: int, dim: int, seed: int = 11) -> Floats:
    return np.random.default_rng(seed).random((n, dim))
