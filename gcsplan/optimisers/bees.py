"""Artificial bees: ABC (Karaboga 2005), and IB-ABC with B-ABC (Tan et al. 2023).

The bees of one kind fly at once, from the places that the kind before left; the papers let them fly one by one.
``group`` is the number of adjacent variables that make one element (a way point's coordinates; 1 on functions):
elements are changed as a whole.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.optimisers.box import Indices, Run, Steps, clipped, keep_better, partners


def abc(run: Run, *, limit: int, group: int) -> Steps:
    """ABC: employed bees, onlookers by roulette on fitness, at most one scout a cycle; the best source is not exempt.

    Each tries one element of its source: vⱼ = xⱼ + φ·(xⱼ − x_kj), k another source. A source's failures are counted,
    one a bee that did not improve it.
    """
    x = run.first()
    f = yield x
    n = len(x)
    failures = np.zeros(n, dtype=np.int64)
    everyone = np.arange(n)
    for _ in run.cycles():
        for onlooking in (False, True):
            chosen = roulette(run.rng, f, n) if onlooking else everyone
            tried = _one_element(run, x, chosen, group)
            f_tried = yield tried
            _take_best_of_each(x, f, failures, chosen, tried, f_tried)
        spent = int(failures.argmax())
        if failures[spent] > limit:
            # E Xu et al. eq. 4 adds rand·map(j) to the old place: a uniform redraw.
            x[spent] = run.rng.random(x.shape[1])
            f[spent] = (yield x[spent : spent + 1])[0]
            failures[spent] = 0


def ib_abc(run: Run, *, feedback: bool, scale: float, spent_share: float, group: int) -> Steps:
    """IB-ABC, eq. 7-10: feedback μ from the counts of failure, two-element followers, scouts only when all are stuck.

    ``scale`` bounds φ; ``spent_share`` is γ. Without ``feedback`` μ is 1: B-ABC, in our reading.
    """
    if not 0.0 < spent_share < 1.0:
        raise InputError(f"ib-abc: spent_share must lie between 0 and 1, given {spent_share}")
    x = run.first()
    f = yield x
    n, dim = x.shape
    elements = -(-dim // group)  # D
    # E eq. 7: μ is 0/0 at the start; the counts Tr lie in [1, D], capped there (Th = L = D).
    count = np.ones(n)
    for _ in run.cycles():
        # Where D is 1 no count can exceed γD without meaning "just improved".
        if count.mean() > max(spent_share * elements, 1.0):  # eq. 10
            old = np.delete(np.arange(n), f.argmin())
            scouts = run.rng.permutation(old)[: max(1, round(spent_share * n))]
            x[scouts] = run.rng.random((len(scouts), dim))
            f[scouts] = yield x[scouts]
            count[scouts] = 1.0
        improved = np.zeros(n, dtype=np.bool_)
        for following in (False, True):
            k, m = partners(run.rng, n, n, 2)
            phi = scale * run.rng.uniform(-1.0, 1.0, size=(n, 1))
            mu = (count / (count + count[k]))[:, None] if feedback else 1.0
            # Eq. 7 starts from the source itself, eq. 9 from another; followers are given to the sources by descending
            # fitness, one each, so that flying at once every source has its own.
            base = x[m] if following else x
            tried = clipped(np.where(_elements(run, n, dim, group), base + phi * (x[k] - x) * mu, x))
            improved |= keep_better(x, f, tried, (yield tried))
        count = np.where(improved, 1.0, np.minimum(count + 1.0, elements))


def roulette(rng: np.random.Generator, f: Floats, count: int) -> Indices:
    """``count`` sources drawn in proportion to 1/(1 + f), or 1 + |f| where f < 0."""
    # E IB-ABC eq. 8 prints the same condition twice; the second case is f < 0.
    fitness = np.where(f >= 0.0, 1.0 / (1.0 + np.maximum(f, 0.0)), 1.0 + np.abs(f))
    edges = np.cumsum(fitness)
    drawn: Indices = np.searchsorted(edges, rng.random(count) * edges[-1], side="right")
    drawn[drawn == len(f)] = len(f) - 1  # rounding, at the very end
    return drawn


def _one_element(run: Run, x: Floats, chosen: Indices, group: int) -> Floats:
    """One bee for each of ``chosen``: one element moved along the line from another source."""
    n = len(x)
    other = run.rng.integers(0, n - 1, size=len(chosen))
    other += other >= chosen
    # E Xu et al. eq. 3 prints rand for φ: uniform in [−1, 1].
    phi = run.rng.uniform(-1.0, 1.0, size=(len(chosen), 1))
    mine = x[chosen]
    return clipped(np.where(_elements(run, len(chosen), run.dim, group), mine + phi * (mine - x[other]), mine))


def _elements(run: Run, count: int, dim: int, group: int) -> NDArray[np.bool_]:
    """(count, dim) mask of one element in each row."""
    chosen = run.rng.integers(0, -(-dim // group), size=(count, 1))
    mask: NDArray[np.bool_] = np.arange(dim) // group == chosen
    return mask


def _take_best_of_each(
    x: Floats, f: Floats, failures: Indices, chosen: Indices, tried: Floats, f_tried: Floats
) -> None:
    """Several bees may have tried one source: the best of them, if it improves, takes the source."""
    best_first = np.argsort(f_tried, kind="stable")
    sources, where = np.unique(chosen[best_first], return_index=True)
    best = best_first[where]
    better = f_tried[best] < f[sources]
    failures += np.bincount(chosen, minlength=len(x))
    taken, lucky = sources[better], best[better]
    x[taken], f[taken], failures[taken] = tried[lucky], f_tried[lucky], 0
