"""Parrots and budgerigars: PO (Lian et al. 2024) and ABO (Li et al. 2024), eq. 8-13 of the latter.

``origin`` is the point, in unit coordinates, from which the rule's bare positions (P_mean, P_best, P_i) are measured;
the rule pulls towards it. At 0.5, the middle of the box, it has an advantage on functions with their optimum there.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.optimisers.box import Run, Steps, clipped

LEVY_POWER = 1.5  # γ of eq. 10
BEHAVIOURS = 4


def abo(run: Run, *, alpha: float, beta: float, origin: float, stay_step: float, talk: str) -> Steps:
    """ABO: one of four equally probable behaviours for each individual; the result replaces it even if it is worse.

    ``alpha`` and ``beta`` are the dependency coefficients, 1 or more; with both 1 this is the Parrot Optimizer.
    ``stay_step``: most by which staying moves along the diagonal (eq. 11). ``talk``: "added" or "printed" (eq. 12).
    Raises InputError for other values.
    """
    for what, given in (("alpha", alpha), ("beta", beta)):
        if given < 1.0:  # otherwise (α − t/T) becomes negative, and its fractional power is not real
            raise InputError(f"abo: {what} must be 1 or more, given {given}")
    if talk not in ("added", "printed"):
        raise InputError(f"abo: talk must be added or printed, given {talk!r}")
    x = run.first()
    f = yield x
    n, dim = x.shape
    best, f_best = x[f.argmin()].copy(), f.min()
    for _ in run.cycles():
        share = min(1.0, run.elapsed + 1.0 / run.horizon)  # t/T, t from 1
        behaviour = run.rng.integers(0, BEHAVIOURS, size=n)
        r1, r2, coin = run.rng.random((3, n, 1))
        flight = levy(run.rng, (n, dim))
        mean = x.mean(axis=0)
        moved = np.empty_like(x)
        # E in all: eq. 8, 11 and 12 use bare positions and so pull to the origin of the coordinates; hence ``origin``.

        i = behaviour == 0  # searching, eq. 8
        pull = (alpha - share) ** ((alpha + 1.0) * share)
        moved[i] = origin + (x[i] - best) * flight[i] + r1[i] * pull * (mean - origin)

        i = behaviour == 1  # staying; E eq. 11: rand·1 is at most 1 m in 100 m, hence ``stay_step``
        moved[i] = x[i] + (best - origin) * flight[i] + r1[i] * stay_step

        i = behaviour == 2  # communicating, eq. 12
        flown = 0.2 * r1[i] * (beta - share) * (x[i] - mean)
        alone = 0.2 * r1[i] * np.exp(-share / np.maximum(r2[i], np.finfo(float).tiny)) * (x[i] - origin)
        # E eq. 12 replaces P_i by a small term near the origin; the Parrot Optimizer's code adds the term to P_i.
        moved[i] = (x[i] if talk == "added" else origin) + np.where(coin[i] <= 0.5, flown, alone)

        i = behaviour == 3  # escaping, eq. 13
        home = r1[i] * math.cos(0.5 * math.pi * share) * (best - x[i])
        moved[i] = x[i] + home - np.cos(r2[i] * math.pi) * share ** (2.0 / run.horizon) * (x[i] - best)

        x = clipped(moved)
        f = yield x
        if f.min() < f_best:
            best, f_best = x[f.argmin()].copy(), f.min()


def levy(rng: np.random.Generator, shape: tuple[int, int]) -> Floats:
    """Levy flights of ``shape`` by Mantegna's method, eq. 10."""
    # E eq. 10: the exponent of σ is 1/γ and the power of 2 in its denominator (γ − 1)/2; u contains σ already.
    u = rng.normal(0.0, LEVY_SPREAD, size=shape)
    v = rng.normal(0.0, 1.0, size=shape)
    return u / np.maximum(np.abs(v), np.finfo(float).tiny) ** (1.0 / LEVY_POWER)


LEVY_SPREAD = (
    math.gamma(1.0 + LEVY_POWER)
    * math.sin(math.pi * LEVY_POWER / 2.0)
    / (math.gamma((1.0 + LEVY_POWER) / 2.0) * LEVY_POWER * 2.0 ** ((LEVY_POWER - 1.0) / 2.0))
) ** (1.0 / LEVY_POWER)
