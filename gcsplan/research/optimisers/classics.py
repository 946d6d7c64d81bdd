"""Particle swarm and differential evolution: the baselines of every paper."""

from __future__ import annotations

import numpy as np

from gcsplan.research.optimisers.box import Run, Steps, clipped, keep_better, partners


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
