"""The nine benchmark functions of Feng et al. 2024 (Electronics 13, 68), table 1, plain and with a moved optimum."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np

from gcsplan.arrays import Floats

SHIFT_SEED = 2024
SHIFT_SHARE = 0.6  # an optimum moves by at most this share of the half range, differently in each dimension


@dataclass(frozen=True, slots=True)
class Function:
    """One function to minimise; its minimum is 0.

    ``value`` maps points (n, D) in the paper's coordinates, within ±``reach``, to (n,). ``optimum``: coordinate of the
    optimum, the same in every dimension. ``noisy``: a uniform number in [0, 1) is added at each evaluation.
    """

    name: str
    title: str
    reach: float
    value: Callable[[Floats], Floats]
    optimum: float = 0.0
    noisy: bool = False

    def shift(self, dim: int) -> Floats:
        """Vector (dim,) from the plain optimum to the moved one; fixed, and never out of the box."""
        share: Floats = np.random.default_rng(SHIFT_SEED).uniform(-SHIFT_SHARE, SHIFT_SHARE, dim)
        return self.reach * share

    def optimum_unit(self, dim: int, *, shifted: bool = False) -> Floats:
        """The optimum (dim,) in the unit box."""
        place = np.full(dim, self.optimum)
        if shifted:
            place += self.shift(dim)
        unit: Floats = 0.5 + 0.5 * place / self.reach
        return unit

    def resolution(self, dim: int, *, shifted: bool = False) -> float:
        """Value one step of double precision away from the optimum; smaller values cannot be distinguished from 0."""
        place = self.optimum_unit(dim, shifted=shifted)
        beside = np.stack([np.nextafter(place, end) for end in (0.0, 1.0)])
        return float(self.on_unit_box(dim, shifted=shifted)(beside).max())

    def on_unit_box(
        self, dim: int, *, shifted: bool = False, noise: np.random.Generator | None = None
    ) -> Callable[[Floats], Floats]:
        """The function over points (n, dim) in [0, 1]; a noisy one has no noise if ``noise`` is None."""
        shift = self.shift(dim) if shifted else np.zeros(dim)

        def cost(u: Floats) -> Floats:
            found = self.value(self.reach * (2.0 * u - 1.0) - shift)
            return found if noise is None or not self.noisy else found + noise.random(len(u))

        return cost


def sphere(x: Floats) -> Floats:
    """Sphere, f1."""
    return _sum(x * x)


def schwefel_2_22(x: Floats) -> Floats:
    """Schwefel 2.22, f2."""
    size = np.abs(x)
    return _sum(size) + cast("Floats", size.prod(axis=1))


def rosenbrock(x: Floats) -> Floats:
    """Rosenbrock, f3; its optimum is at 1."""
    return _sum(100.0 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (x[:, :-1] - 1.0) ** 2)


def schwefel_2_21(x: Floats) -> Floats:
    """Schwefel 2.21, f4."""
    return cast("Floats", np.abs(x).max(axis=1))


def schwefel_1_2(x: Floats) -> Floats:
    """Schwefel 1.2, f5."""
    return _sum(np.cumsum(x, axis=1) ** 2)


def quartic(x: Floats) -> Floats:
    """Quartic, f6, without its noise."""
    return _sum(np.arange(1, x.shape[1] + 1) * x**4)


def rastrigin(x: Floats) -> Floats:
    """Rastrigin, f7."""
    return _sum(x * x - 10.0 * np.cos(2.0 * math.pi * x) + 10.0)


def ackley(x: Floats) -> Floats:
    """Ackley, f8."""
    # E table 1, f8: the bracket of the second exp closes too late; 20 + e belongs outside, and 1/30 is 1/n.
    n = x.shape[1]
    far: Floats = np.exp(-0.2 * np.sqrt(_sum(x * x) / n))
    waves: Floats = np.exp(_sum(np.cos(2.0 * math.pi * x)) / n)
    return -20.0 * far - waves + 20.0 + math.e


def griewank(x: Floats) -> Floats:
    """Griewank, f9."""
    waves = np.cos(x / np.sqrt(np.arange(1, x.shape[1] + 1))).prod(axis=1)
    return _sum(x * x) / 4000.0 - cast("Floats", waves) + 1.0


def _sum(terms: Floats) -> Floats:
    return cast("Floats", terms.sum(axis=1))


_ALL = (
    Function("f1", "Sphere", 100.0, sphere),
    Function("f2", "Schwefel 2.22", 10.0, schwefel_2_22),
    Function("f3", "Rosenbrock", 30.0, rosenbrock, optimum=1.0),
    Function("f4", "Schwefel 2.21", 100.0, schwefel_2_21),
    Function("f5", "Schwefel 1.2", 100.0, schwefel_1_2),
    Function("f6", "Quartic with noise", 1.28, quartic, noisy=True),
    Function("f7", "Rastrigin", 5.12, rastrigin),
    Function("f8", "Ackley", 32.0, ackley),
    Function("f9", "Griewank", 600.0, griewank),
)

FUNCTIONS: dict[str, Function] = {function.name: function for function in _ALL}
