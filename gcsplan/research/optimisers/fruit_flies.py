"""Fruit flies: FOA (Pan 2012), IFFO (Pan et al. 2014), MFOA (Yuan et al. 2014), MSFOA (Shi et al. 2020).

Equation numbers follow Shi et al. FOA's smell judgement S = 1/D (eq. 3) stays in [0, 1] only for D ≥ 1, which
does not hold in the unit square. MSFOA uses the distance itself (eq. 31), an encoding with two hidden variables for
each coordinate. This module holds the search alone: places of swarms, and flies around them.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.errors import InputError
from gcsplan.research.optimisers.box import Run, Steps, clipped, keep_better, require

REDRAWS = 50
"""Most redraws of the step of a pair of variables with S > 1; the encoding scales a step that remains too large."""


def foa(run: Run, *, step: float) -> Steps:
    """FOA: flies uniform around the place of one swarm, which moves to the best fly if that is better (eq. 1-6)."""
    centre = run.first(1)
    f = yield centre
    for _ in run.cycles():
        flies = clipped(centre + step * run.rng.uniform(-1.0, 1.0, size=(run.population, run.dim)))
        _move(centre, f, flies, (yield flies))


def iffo(run: Run, *, radius_most: float, radius_least: float) -> Steps:
    """IFFO (Pan et al. 2014): each fly changes one dimension of the place, within a radius that falls exponentially."""
    centre = run.first(1)
    f = yield centre
    n = run.population
    for _ in run.cycles():
        radius = radius_most * math.exp(math.log(radius_least / radius_most) * run.elapsed)
        flies = np.repeat(centre, n, axis=0)
        which = run.rng.integers(0, run.dim, size=n)
        flies[np.arange(n), which] += radius * run.rng.uniform(-1.0, 1.0, size=n)
        flies = clipped(flies)
        _move(centre, f, flies, (yield flies))


def mfoa(run: Run, *, swarms: int, power: float, radius: float) -> Steps:
    """MFOA (Yuan et al. 2014): several swarms, radius R·((T − t)/T)^power, and the mean of their places as a candidate.

    If the mean is better than the best place, it replaces that place (our reading).
    """
    _check_swarms("mfoa", run, swarms)
    centres = run.first(swarms)
    f = yield centres
    home = np.arange(run.population) % swarms
    for _ in run.cycles():
        reach = radius * (1.0 - run.elapsed) ** power
        flies = centres[home] + reach * run.rng.uniform(-1.0, 1.0, size=(run.population, run.dim))
        mean = centres.mean(axis=0, keepdims=True)
        flies = clipped(np.concatenate([flies, mean]))
        _move(centres, f, flies, (yield flies), np.append(home, f.argmin()))


def msfoa(
    run: Run,
    *,
    swarms: int,
    own_share: float,
    global_step: float,
    local_step: float,
    threshold: float | None,
    beyond: str,
    origin: float,
) -> Steps:
    """MSFOA, eq. 7-19: global or local search for each swarm, then a competition with offspring.

    A swarm searches globally while its cost is above ``threshold``, locally otherwise; None: the best first cost minus
    half its size. ``own_share`` is coe₂, the share of the fly in its child; the rest, coe₁, is the share of the best
    fly of a swarm drawn for each child. ``beyond`` is "clipped", or "redrawn": the step of each pair of variables whose
    S is above 1 is drawn again (step 8), `REDRAWS` times at most. ``origin`` is the unit coordinate from which S is
    measured: 0, or 0.5 where the hidden variables may be negative.
    """
    require("msfoa", "beyond", beyond, ("clipped", "redrawn"))
    _check_swarms("msfoa", run, swarms)
    centres = run.first(swarms)
    f = yield centres
    level = f.min() - abs(f.min()) / 2.0 if threshold is None else threshold
    home = np.arange(run.population) % swarms
    for _ in run.cycles():
        # E steps 14 and 19 jump to 8 and 5, that is back to the parents and to a new start. Steps 13 and 6 are meant:
        # the offspring are used, and the next iteration continues from the places of the swarms.
        far = (f > level)[home, None]
        # D: both steps are shares of the unit box (eq. 7-10 print 1 and R).
        flies = centres[home] + _steps(run, far, global_step, local_step)
        for _ in range(REDRAWS if beyond == "redrawn" else 0):
            outside = _outside(flies, origin)
            if not outside.any():
                break
            again = centres[home] + _steps(run, far, global_step, local_step)
            flies = np.where(outside, again, flies)
        f_flies = yield clipped(flies)
        best = _best_of_each(f_flies, home, swarms)
        # E Algorithm 2 omits the random(1, G) of eq. 14, and nests the loop over the offspring wrongly.
        parent = best[run.rng.integers(0, swarms, size=run.population)]
        children = clipped((1.0 - own_share) * flies[parent] + own_share * flies)
        f_children = yield children
        # E eq. 18-19 compare old, new and current place in a chain; here the best of the three stays.
        _move(centres, f, flies, f_flies, home)
        _move(centres, f, children, f_children, home)


def _steps(run: Run, far: Bools, global_step: float, local_step: float) -> Floats:
    """Steps (population, dim) of eq. 7-10; ``far`` (population, 1): whether a fly searches globally."""
    u = run.rng.uniform(-1.0, 1.0, size=(run.population, run.dim))
    return np.where(far, global_step * np.sin(math.pi / 2.0 * u), local_step * u)


def _outside(flies: Floats, origin: float) -> Bools:
    """(n, dim) variables of pairs with S > 1; a last variable without a partner is a pair of its own."""
    hidden = (flies - origin) / (1.0 - origin)
    padded = np.concatenate([hidden, np.zeros((len(flies), flies.shape[1] % 2))], axis=1)
    s = np.hypot(padded[:, 0::2], padded[:, 1::2])
    return np.asarray(np.repeat(s > 1.0, 2, axis=1)[:, : flies.shape[1]])


def _check_swarms(name: str, run: Run, swarms: int) -> None:
    if swarms > run.population:
        raise InputError(f"{name}: {swarms} swarms need a population of {swarms} or more, given {run.population}")


def _best_of_each(f_flies: Floats, home: Indices, swarms: int) -> Indices:
    """Index of the best fly of each swarm, (swarms,)."""
    order = np.lexsort((f_flies, home))
    return order[np.searchsorted(home[order], np.arange(swarms))]


def _move(centres: Floats, f: Floats, flies: Floats, f_flies: Floats, home: Indices | None = None) -> None:
    """Move each swarm's place to its best fly if that is better, in place; without ``home`` there is one swarm."""
    best = np.array([f_flies.argmin()]) if home is None else _best_of_each(f_flies, home, len(centres))
    keep_better(centres, f, flies[best], f_flies[best])
