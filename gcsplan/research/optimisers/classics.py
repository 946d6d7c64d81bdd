"""Particle swarm and differential evolution, the baselines of every paper; and L-SHADE.

L-SHADE is differential evolution that learns its scale factors and crossover rates, with a shrinking population: Tanabe
and Fukunaga 2014 (CEC), on SHADE (2013) and JADE's mutation and archive (Zhang and Sanderson 2009). The plain second
implementation is in `tests/oracles/swarms.py`.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.research.optimisers.box import Run, Steps, clipped, keep_better, partners

SPREAD = 0.1
"""L-SHADE's deviation of crossover rates, and scale of the Cauchy distribution of scale factors, about their memory."""


def pso(
    run: Run, *, inertia_first: float, inertia_last: float, own_pull: float, swarm_pull: float, top_speed: float
) -> Steps:
    """Particle swarm: all move, then all are evaluated; first velocity 0, limited speed, particles stop at bounds."""
    x = run.first()
    own = x.copy()
    f_own = yield x
    v = np.zeros_like(x)
    for _ in run.cycles():
        inertia = inertia_first + (inertia_last - inertia_first) * run.elapsed
        r1, r2 = run.rng.random((2, *x.shape))
        v = inertia * v + own_pull * r1 * (own - x) + swarm_pull * r2 * (own[f_own.argmin()] - x)
        np.clip(v, -top_speed, top_speed, out=v)
        x = x + v
        v[(x < 0.0) | (x > 1.0)] = 0.0
        f = yield clipped(x)
        keep_better(own, f_own, x, f)


def de(run: Run, *, scale_least: float, scale_most: float, crossover: float) -> Steps:
    """Differential evolution rand/1/bin: mutant a + F·(b − c) of three others, binomial crossover, greedy replacement;
    reflected at a bound."""
    x = run.first()
    f = yield x
    n, dim = x.shape
    for _ in run.cycles():
        a, b, c = partners(run.rng, n, n, 3)
        scale = run.rng.uniform(scale_least, scale_most, size=(n, 1))
        mutant = x[a] + scale * (x[b] - x[c])
        mutant = np.where(mutant < 0.0, -mutant, mutant)
        mutant = np.where(mutant > 1.0, 2.0 - mutant, mutant)
        crossed = run.rng.random((n, dim)) < crossover
        crossed[np.arange(n), run.rng.integers(0, dim, size=n)] = True  # at least one variable is the mutant's
        tried = clipped(np.where(crossed, mutant, x))
        keep_better(x, f, tried, (yield tried))


def lshade(run: Run, *, memory: int, archive_share: float, best_share: float, least: int) -> Steps:
    """Mutation current-to-pbest/1 with an archive of replaced parents, binomial crossover, greedy replacement.

    ``memory``: H, length of the success history; ``archive_share``: size of the archive over the population's;
    ``best_share``: p, part of the population from which pbest is drawn, at least two; ``least``: the final population.
    The population falls linearly with the spent budget.
    """
    x = run.first()
    f = yield x
    most, dim = x.shape
    rates, scales = np.full(memory, 0.5), np.full(memory, 0.5)  # a rate of NaN is the paper's terminal value: always 0
    archive = np.empty((0, dim))
    place = 0
    for _ in run.cycles():
        n = max(min(least, most), round(most + (least - most) * run.elapsed))
        order = np.argsort(f, kind="stable")
        x, f, order = (x[order[:n]], f[order[:n]], np.arange(n)) if n < len(x) else (x, f, order)
        archive = _thinned(run.rng, archive, round(archive_share * n))
        drawn = run.rng.integers(0, memory, size=n)
        rate = np.nan_to_num(np.clip(run.rng.normal(rates[drawn], SPREAD), 0.0, 1.0), nan=0.0)
        scale = positive_cauchy(run.rng, scales[drawn])
        pbest = order[run.rng.integers(0, min(n, max(2, round(best_share * n))), size=n)]
        (r1,) = partners(run.rng, n, n, 1)
        r2 = _third(run.rng, r1, n + len(archive))
        pool = np.concatenate([x, archive])
        mutant = x + scale[:, None] * (x[pbest] - x + x[r1] - pool[r2])
        mutant = np.where(mutant < 0.0, 0.5 * x, np.where(mutant > 1.0, 0.5 * (1.0 + x), mutant))
        crossed = run.rng.random((n, dim)) < rate[:, None]
        crossed[np.arange(n), run.rng.integers(0, dim, size=n)] = True
        tried = np.where(crossed, mutant, x)
        f_tried = yield tried
        better = f_tried < f
        if better.any():
            gain = f[better] - f_tried[better]
            rates[place], scales[place] = learnt(rates[place], rate[better], scale[better], gain / gain.sum())
            place = (place + 1) % memory
            archive = np.concatenate([archive, x[better]])
        kept = f_tried <= f
        x, f = np.where(kept[:, None], tried, x), np.where(kept, f_tried, f)


def positive_cauchy(rng: np.random.Generator, middle: Floats) -> Floats:
    """Scale factors (n,) about ``middle``: Cauchy above 0, which equals drawing again; at most 1."""
    below = 0.5 + np.arctan(-middle / SPREAD) / math.pi
    u = below + (1.0 - below) * rng.random(len(middle))
    return np.clip(middle + SPREAD * np.tan(math.pi * (u - 0.5)), 1e-12, 1.0)


def _third(rng: np.random.Generator, r1: np.ndarray, among: int) -> np.ndarray:
    """For each row i one index below ``among``, neither i nor ``r1[i]``."""
    i = np.arange(len(r1))
    drawn = rng.integers(0, among - 2, size=len(r1))
    for other in (np.minimum(i, r1), np.maximum(i, r1)):
        drawn += drawn >= other
    return drawn


def _thinned(rng: np.random.Generator, archive: Floats, most: int) -> Floats:
    """The archive, without randomly chosen members above ``most``."""
    return archive if len(archive) <= most else archive[rng.permutation(len(archive))[:most]]


def learnt(old_rate: float, rate: Floats, scale: Floats, weight: Floats) -> tuple[float, float]:
    """Weighted Lehmer means of the rates and scale factors that made a better member."""
    gone = math.isnan(old_rate) or rate.max() == 0.0
    new_rate = math.nan if gone else float((weight * rate**2).sum() / (weight * rate).sum())
    return new_rate, float((weight * scale**2).sum() / (weight * scale).sum())
