"""Parrots and budgerigars: PO (Lian et al. 2024) and ABO (Li et al. 2024), eq. 8-13 of the latter.

``origin`` is the point, in unit coordinates, from which the rule's bare positions (P_mean, P_best, P_i) are measured;
the rule pulls towards it. At 0.5, the middle of the box, it has an advantage on functions with their optimum there.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.research.optimisers.box import Run, Steps, clipped, require

LEVY_POWER = 1.5  # γ of eq. 10
BEHAVIOURS = 4


def abo(
    run: Run, *, alpha: float, beta: float, origin: float, stay_step: float, talk: str, rule: str, span: float
) -> Steps:
    """ABO: one of four equally probable behaviours for each individual; the result replaces it even if it is worse.

    ``alpha`` and ``beta`` are the dependency coefficients, 1 or more; with both 1 this is the Parrot Optimizer.
    ``stay_step``: most by which staying moves along the diagonal (eq. 11). ``talk``: "added" or "printed" (eq. 12).
    ``rule``: "equations", or "authors", the published code of PO's authors (`parrots`), which ignores all parameters
    but ``span``, the side of the box in the cost's own unit. Raises InputError for other values.
    """
    require("abo", "rule", rule, ("equations", "authors"))
    if rule == "authors":
        yield from parrots(run, span)
        return
    for what, given in (("alpha", alpha), ("beta", beta)):
        if given < 1.0:  # otherwise (α − t/T) becomes negative, and its fractional power is not real
            raise InputError(f"abo: {what} must be 1 or more, given {given}")
    require("abo", "talk", talk, ("added", "printed"))
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


def parrots(run: Run, span: float) -> Steps:
    """The Parrot Optimizer as in its authors' published code, version 2: positions are numbers from 0 to ``span``.

    They fly from the ordered places of the last iteration, one by one, and each knows the best place so far. It differs
    from the equations in four things: staying moves by a normal number, communicating alone by a small term that is the
    same in all dimensions, and two random numbers, of communicating and of escaping, are drawn once for all.
    """
    x = run.first()
    f = yield x
    n, dim = x.shape
    order = np.argsort(f, kind="stable")
    x = span * x[order]
    best, f_best = x[0].copy(), float(f[order[0]])
    for _ in run.cycles():
        share = min(1.0, run.elapsed + 1.0 / run.horizon)  # t/T, t from 1
        talk, angle = run.rng.random() / 5.0, run.rng.random() * math.pi
        mean = x.mean(axis=0)
        flown, f_flown = np.empty_like(x), np.empty(n)
        for j in range(n):
            behaviour = run.rng.integers(0, BEHAVIOURS)
            if behaviour == 0:
                pull = run.rng.random() * (1.0 - share) ** (2.0 * share)
                place = (x[j] - best) * levy(run.rng, (1, dim))[0] + pull * mean
            elif behaviour == 1:
                place = x[j] + best * levy(run.rng, (1, dim))[0] + run.rng.normal() * (1.0 - share)
            elif behaviour == 2:
                if run.rng.random() < 0.5:
                    place = x[j] + talk * (1.0 - share) * (x[j] - mean)
                else:
                    part = max(run.rng.random(), np.finfo(float).tiny)
                    place = x[j] + talk * (1.0 - share) * math.exp(-(j + 1) / (part * run.horizon))
            else:
                home = run.rng.random() * math.cos(0.5 * math.pi * share) * (best - x[j])
                place = x[j] + home - math.cos(angle) * share ** (2.0 / run.horizon) * (x[j] - best)
            flown[j] = np.clip(place, 0.0, span)
            f_flown[j] = (yield clipped(flown[j : j + 1] / span))[0]
            if f_flown[j] < f_best:
                best, f_best = flown[j].copy(), float(f_flown[j])
        x = flown[np.argsort(f_flown, kind="stable")]


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
