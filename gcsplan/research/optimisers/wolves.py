"""Grey wolves: GWO and its variants MGWO, IGWO, SOGWO, SSGWO.

Equation numbers follow Feng et al. 2024 (Electronics 13, 68), which restates GWO as its (1)-(12).

``origin`` is the point, in unit coordinates, from which |C·leader − x| and multiples of positions are measured; the
rule pulls towards it. At 0.5, the middle of the box, it has an advantage on functions with their optimum there.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.research.optimisers.box import WORST_COST, Run, Steps, clipped, keep_better, require

PACK = 3  # α, β, δ
ANNEALING_SHARE = 0.95  # η of eq. 25


def gwo(run: Run, *, origin: float) -> Steps:
    """Grey wolf optimizer (Mirjalili et al. 2014), eq. 1-12: each wolf moves to the mean of three leaders' targets."""
    x = run.first()
    f = yield x
    pack = Pack(x, f)
    for _ in run.cycles():
        targets = targets_of(run.rng, x, pack.x, 2.0 - 2.0 * run.elapsed, origin)  # eq. 5
        x = clipped(targets.sum(axis=0) / PACK)  # eq. 12
        f = yield x
        pack.meet(x, f)


def mgwo(run: Run, *, origin: float) -> Steps:
    """Our reading of MGWO (Zhang 2021), of which the SSGWO paper names only three parts.

    An exponential convergence factor a = 2·(1 − (e^(t/T) − 1)/(e − 1)); weights wₖ ∝ 1/(fₖ − f_α + ε) of the leaders
    with ε = |f_δ − f_α| + 1e−12; and moves that are kept only if they improve.
    """
    x = run.first()
    f = yield x
    pack = Pack(x, f)
    for _ in run.cycles():
        a = 2.0 * (1.0 - math.expm1(run.elapsed) / (math.e - 1.0))
        weight = 1.0 / (pack.f - pack.f[0] + abs(pack.f[2] - pack.f[0]) + 1e-12)
        targets = targets_of(run.rng, x, pack.x, a, origin)
        tried = clipped(np.tensordot(weight / weight.sum(), targets, axes=1))
        f_tried = yield tried
        keep_better(x, f, tried, f_tried)
        pack = Pack(x, f)  # moves are greedy, so the best three ever are in the population


def igwo(run: Run, *, origin: float) -> Steps:
    """Improved GWO (Nadimi-Shahraki et al. 2021): the better of GWO's move and one learnt from neighbours, if it
    improves."""
    x = run.first()
    f = yield x
    n = len(x)
    pack = Pack(x, f)
    for _ in run.cycles():
        led = targets_of(run.rng, x, pack.x, 2.0 - 2.0 * run.elapsed, origin).sum(axis=0) / PACK
        led = _halfway(led, x)
        learnt = _halfway(_learnt(run.rng, x, led), x)
        costs = yield np.concatenate([led, learnt])
        by_learning = costs[n:] < costs[:n]
        tried = np.where(by_learning[:, None], learnt, led)
        keep_better(x, f, tried, np.where(by_learning, costs[n:], costs[:n]))
        pack = Pack(x, f)


def sogwo(run: Run, *, origin: float, alike: str, span: float) -> Steps:
    """Selective opposition GWO (Dhargupta et al. 2020): wolves unlike α are mirrored in the box before GWO's move.

    ``alike`` is "ranks" (`opposed`), or "distances", the rule in its authors' published code (`opposed_by_distance`);
    ``span``: side of the box in the cost's own unit, which that rule depends on.
    """
    require("sogwo", "alike", alike, ("ranks", "distances"))
    x = run.first()
    f = yield x
    pack = Pack(x, f)
    for _ in run.cycles():
        a = 2.0 - 2.0 * run.elapsed
        x = opposed(x, f, pack.x[0], a) if alike == "ranks" else opposed_by_distance(x, a, span)
        x = clipped(targets_of(run.rng, x, pack.x, a, origin).sum(axis=0) / PACK)
        f = yield x
        pack.meet(x, f)


def ssgwo(run: Run, *, origin: float, factor: str, leaders: str, trial: str) -> Steps:
    """Hybrid of GWO and simulated annealing (Feng et al. 2024), eq. 13-25.

    ``factor`` is "cosine" or "printed" (eq. 13). ``leaders`` is "all": every wolf moves by eq. 23 over eq. 9-11, whose
    A and C are what Algorithm 1 updates; "apart": the leaders move by eq. 17-19, and only to improve; or "printed":
    every wolf moves by eq. 23 over eq. 17-19. ``trial`` is "every": eq. 24 decides for each wolf; or "alpha": for α
    alone, as its letters state, while all others move anyway.
    """
    require("ssgwo", "factor", factor, tuple(FACTORS))
    require("ssgwo", "leaders", leaders, ("apart", "all", "printed"))
    require("ssgwo", "trial", trial, ("every", "alpha"))
    x = run.first()
    f = yield x
    finite = f[f < WORST_COST]
    temperature = float(finite.std()) if finite.size else 0.0
    for _ in run.cycles():
        a = FACTORS[factor](run.elapsed)
        order = np.argsort(f, kind="stable")
        first, others = order[:PACK], order[PACK:]
        tried = np.empty_like(x)
        # E eq. 17-19: as printed they do not contain X_i, and with b ≥ 0 they move β and δ away from α; Algorithm 1
        # updates A and C, which only eq. 6-11 use.
        if leaders == "apart":
            targets = targets_of(run.rng, x[others], x[first], a, origin)
            tried[others] = _weighed(targets, nearness(x, x[first])[:, others])  # eq. 23
            tried[first] = scattered(run.rng, x, first, others, a, 1)[:, 0]
        else:
            if leaders == "all":
                targets = targets_of(run.rng, x, x[first], a, origin)
            else:
                targets = scattered(run.rng, x, first, others, a, len(x))
            tried[:] = _weighed(targets, nearness(x, x[first]))
        f_tried = yield clipped(tried)
        # E eq. 24: the inner "while (P > rand)" may never end; here one trial for each wolf and iteration.
        worse = np.maximum(f_tried - f, 0.0) / max(temperature, 1e-200)
        taken = (f_tried < f) | (run.rng.random(len(f)) < np.exp(-np.minimum(worse, 700.0)))
        if trial == "alpha":
            taken[order[1:]] = True
        if leaders == "apart":
            taken[first] = f_tried[first] < f[first]
        x[taken], f[taken] = tried[taken], f_tried[taken]
        temperature *= ANNEALING_SHARE  # eq. 25


def targets_of(rng: np.random.Generator, x: Floats, leaders: Floats, a: float, origin: float) -> Floats:
    """Targets (3, n, dim) that each leader (3, dim) sets for each wolf (n, dim), eq. 3, 4 and 6-11, unclipped."""
    r1, r2 = rng.random((2, PACK, *x.shape))
    r1 *= 2.0 * a
    r1 -= a  # A, eq. 3
    r2 *= 2.0  # C, eq. 4
    # E in all: |C·X_leader − X| is measured from the origin of the coordinates and pulls there; hence ``origin``.
    r2 *= (leaders - origin)[:, None, :]
    r2 -= x - origin
    np.abs(r2, out=r2)
    r2 *= r1
    targets: Floats = np.subtract(leaders[:, None, :], r2, out=r2)
    return targets


def scattered(rng: np.random.Generator, x: Floats, first: Indices, others: Indices, a: float, count: int) -> Floats:
    """Positions (3, count, dim), eq. 17-19 drawn ``count`` times; b uniform in [0, 2] in each dimension; unclipped."""
    alpha, beta, delta = x[first]
    r1 = rng.integers(0, len(others), size=count)
    r2 = rng.integers(0, len(others) - 1, size=count)
    r2 += r2 >= r1
    b = rng.uniform(0.0, 2.0, size=(PACK, count, x.shape[1]))
    step = a * b
    step[0] *= x[others[r1]] - x[others[r2]]
    step[1] *= alpha - beta
    step[2] *= alpha - delta
    return x[first][:, None, :] - step


def nearness(x: Floats, leaders: Floats) -> Floats:
    """Eq. 14-16 (3, n): mean distance of all wolves from a leader, divided by the distance of this wolf."""
    # E eq. 14-16 divide vectors; here norms, at least 1e−9 of the mean.
    gap = leaders[:, None, :] - x[None, :, :]
    d = np.sqrt(np.einsum("kij,kij->ki", gap, gap))
    mean = d.mean(axis=1, keepdims=True)
    met = mean == 0.0
    return np.where(met, 1.0, mean / np.where(met, 1.0, np.maximum(d, 1e-9 * mean)))


def opposed(x: Floats, f: Floats, alpha: Floats, a: float) -> Floats:
    """SOGWO's selective opposition: positions (n, dim) with close dimensions of chosen ω wolves mirrored to 1 − u.

    A wolf is chosen if its Spearman correlation with α over the dimensions is 0 or less (ties ranked in order), and if
    it is close to α (|Δ| < a/4) in at least half of the dimensions.
    """
    dim = x.shape[1]
    omega = np.argsort(f, kind="stable")[PACK:]
    if dim < 2 or not omega.size:
        return x
    gap = _ranks(x[omega]) - _ranks(alpha[None, :])
    unlike = 6.0 * (gap * gap).sum(axis=1) >= dim * (dim * dim - 1.0)  # 1 − 6·Σd²/(D·(D² − 1)) ≤ 0
    close = np.abs(x[omega] - alpha) < a / 4.0
    turned = close & (unlike & (2 * close.sum(axis=1) >= dim))[:, None]
    out = x.copy()
    out[omega] = np.where(turned, 1.0 - x[omega], x[omega])
    return out


def opposed_by_distance(x: Floats, a: float, span: float) -> Floats:
    """Selective opposition as in the published code of SOGWO's authors: positions (n, dim).

    All wolves but the first three in memory, whatever their costs, are compared with the first: d = |Δ|, in the cost's
    unit. Where 1 − 6·Σd²/(n·(n² − 1)), with n the number of wolves, is 0 or less, the first dimension with d < a is
    mirrored. Their loop over all such dimensions ends after one, because it runs to the number of rows of a list.
    """
    n = len(x)
    d = span * np.abs(x[PACK:] - x[0])
    unlike = 6.0 * (d * d).sum(axis=1) >= n * (n * n - 1.0)
    close = d < a
    rows = np.flatnonzero(unlike & close.any(axis=1))
    dims = close[rows].argmax(axis=1)
    out = x.copy()
    out[PACK + rows, dims] = 1.0 - out[PACK + rows, dims]
    return out


class Pack:
    """The three best positions so far, α, β, δ: ``x`` (3, dim) and ``f`` (3,), best first."""

    def __init__(self, x: Floats, f: Floats) -> None:
        best = np.argsort(f, kind="stable")[:PACK]
        self.x, self.f = x[best], f[best]

    def meet(self, x: Floats, f: Floats) -> None:
        """Update the three with better wolves of ``x``; of equals the older stays."""
        better = np.flatnonzero(f < self.f[-1])
        if better.size:
            all_f = np.concatenate([self.f, f[better]])
            best = np.argsort(all_f, kind="stable")[:PACK]
            self.x, self.f = np.concatenate([self.x, x[better]])[best], all_f[best]


# E eq. 13 falls fastest at first (1.293 at T/4, linear 1.5), but its text states "remains high": the cosine has the
# same values at 0, T/2 and T and the shape of the text.
FACTORS = {
    "cosine": lambda share: 1.0 + math.cos(math.pi * share),
    "printed": lambda share: (
        math.sin(math.pi * (share + 0.5) + math.pi / 2.0) + 2.0
        if share < 0.5
        else math.sin(math.pi * (share - 0.5) + math.pi / 2.0)
    ),
}


def _weighed(targets: Floats, near: Floats) -> Floats:
    """Eq. 20-23: the mean (n, dim) of targets (3, n, dim), weighted by ``near`` (3, n)."""
    mixed: Floats = np.einsum("kn,knd->nd", near / near.sum(axis=0), targets)
    return mixed


def _learnt(rng: np.random.Generator, x: Floats, led: Floats) -> Floats:
    """IGWO's dimension learning-based hunting, unclipped: x + rand·(neighbour − another wolf) in each dimension."""
    n, dim = x.shape
    radius = np.sqrt(((x - led) ** 2).sum(axis=1))
    gap = x[:, None, :] - x[None, :, :]
    within = np.sqrt(np.einsum("ijk,ijk->ij", gap, gap)) <= radius[:, None]  # a wolf is always within its own radius
    by_nearness = np.argsort(~within, axis=1, kind="stable")
    pick = (rng.random((n, dim)) * within.sum(axis=1)[:, None]).astype(np.intp)
    neighbour = np.take_along_axis(by_nearness, pick, axis=1)
    other = rng.permutation(n)
    return x + rng.random((n, dim)) * (x[neighbour, np.arange(dim)] - x[other])


def _halfway(tried: Floats, old: Floats) -> Floats:
    """Move values beyond a bound to the middle between the old value and the bound."""
    tried = np.where(tried < 0.0, old / 2.0, tried)
    return np.where(tried > 1.0, (old + 1.0) / 2.0, tried)


def _ranks(x: Floats) -> Floats:
    return np.argsort(np.argsort(x, axis=1, kind="stable"), axis=1).astype(np.float64)
