"""Artificial bees: ABC (Karaboga 2005), and IB-ABC with B-ABC (Tan et al. 2023).

ABC's bees fly one by one, as in the papers; with ``bees`` "together", and in IB-ABC, all bees of one kind fly at once,
from the sources that the kind before left. ``group`` is the number of adjacent variables that form one element (the
coordinates of a way point; 1 on functions). An element is changed as a whole.
"""

from __future__ import annotations

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.errors import InputError
from gcsplan.research.optimisers.box import Run, Steps, clipped, keep_better, partners, require


def abc(run: Run, *, limit: int, group: int, bees: str) -> Steps:
    """ABC: employed bees, onlookers by roulette on fitness, at most one scout a cycle; it may replace the best source.

    Each bee tries to change one element of its source: vⱼ = xⱼ + φ·(xⱼ − x_kj), k another source. Each bee that does
    not improve its source adds one to the source's failures; a scout replaces a source of more than ``limit`` failures.
    ``bees`` is "one": each bee starts from the result of the bee before it; or "together", in a fraction of the time.
    """
    require("abc", "bees", bees, ("together", "one"))
    x = run.first()
    f = yield x
    n = len(x)
    failures = np.zeros(n, dtype=np.int64)
    everyone = np.arange(n)
    for _ in run.cycles():
        for onlooking in (False, True):
            chosen = roulette(run.rng, f, n) if onlooking else everyone
            if bees == "one":
                yield from _one_by_one(run, x, f, failures, chosen, group)
                continue
            tried = _one_element(run, x, chosen, group)
            f_tried = yield tried
            _take_best_of_each(x, f, failures, chosen, tried, f_tried)
        spent = int(failures.argmax())
        if failures[spent] > limit:
            # E Xu et al. eq. 4 adds rand·map(j) to the old place; here the place is drawn anew, uniformly.
            x[spent] = run.rng.random(x.shape[1])
            f[spent] = (yield x[spent : spent + 1])[0]
            failures[spent] = 0


def ib_abc(run: Run, *, feedback: bool, scale: float, spent_share: float, group: int, counts_from: str) -> Steps:
    """IB-ABC, eq. 7-10: feedback μ from counts of failures, followers that combine two other sources, and scouts only
    when the mean count is high.

    ``scale`` bounds φ; ``spent_share`` is γ. Without ``feedback`` μ is 1: B-ABC, in our reading. ``counts_from`` is the
    first count of each source, "one" or "zero"; with zero, as in the text, μ = 0/0 of the first cycle is taken as 0.
    """
    require("ib-abc", "counts_from", counts_from, ("one", "zero"))
    if not 0.0 < spent_share < 1.0:
        raise InputError(f"ib-abc: spent_share must lie between 0 and 1, given {spent_share}")
    x = run.first()
    f = yield x
    n, dim = x.shape
    elements = -(-dim // group)  # D
    # E eq. 7: μ is 0/0 at the start; here the counts Tr are kept within [1, D] (Th = L = D).
    count = np.full(n, 1.0 if counts_from == "one" else 0.0)
    for _ in run.cycles():
        # At least 1, because with D = 1 even sources that just improved have a count above γD.
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
            mu = (count / np.maximum(count + count[k], 1.0))[:, None] if feedback else 1.0
            # Eq. 7 starts from the source itself, eq. 9 from another. The paper assigns followers to sources by
            # descending fitness, one each; when all fly at once this means one follower for every source.
            base = x[m] if following else x
            tried = clipped(np.where(_elements(run, n, dim, group), base + phi * (x[k] - x) * mu, x))
            improved |= keep_better(x, f, tried, (yield tried))
        count = np.where(improved, 1.0, np.minimum(count + 1.0, elements))


def roulette(rng: np.random.Generator, f: Floats, count: int) -> Indices:
    """Draw ``count`` sources with probabilities in proportion to 1/(1 + f), or 1 + |f| where f < 0."""
    # E IB-ABC eq. 8 prints the same condition twice; the second case is f < 0.
    fitness = np.where(f >= 0.0, 1.0 / (1.0 + np.maximum(f, 0.0)), 1.0 + np.abs(f))
    edges = np.cumsum(fitness)
    drawn: Indices = np.searchsorted(edges, rng.random(count) * edges[-1], side="right")
    drawn[drawn == len(f)] = len(f) - 1  # a draw at the very end may be rounded up
    return drawn


def _others(run: Run, chosen: Indices, n: int) -> tuple[Indices, Floats]:
    """For each bee another source than its own, and φ (bees, 1)."""
    other: Indices = run.rng.integers(0, n - 1, size=len(chosen))
    other += other >= chosen
    # E Xu et al. eq. 3 prints rand for φ; here uniform in [−1, 1].
    return other, run.rng.uniform(-1.0, 1.0, size=(len(chosen), 1))


def _one_element(run: Run, x: Floats, chosen: Indices, group: int) -> Floats:
    """Positions (n, dim) of bees, one for each of ``chosen``: one element moved along the line from another source."""
    other, phi = _others(run, chosen, len(x))
    mine = x[chosen]
    return clipped(np.where(_elements(run, len(chosen), run.dim, group), mine + phi * (mine - x[other]), mine))


def _one_by_one(run: Run, x: Floats, f: Floats, failures: Indices, chosen: Indices, group: int) -> Steps:
    """The flights of bees, one after the other, to the sources ``chosen``; updates all in place."""
    other, phi = _others(run, chosen, len(x))
    elements = run.rng.integers(0, -(-run.dim // group), size=len(chosen))
    for i, k, step, element in zip(chosen, other, phi[:, 0], elements, strict=True):
        part = slice(element * group, (element + 1) * group)
        tried = x[i : i + 1].copy()
        tried[0, part] += step * (x[i, part] - x[k, part])
        f_tried = (yield clipped(tried))[0]
        if f_tried < f[i]:
            x[i], f[i], failures[i] = tried[0], f_tried, 0
        else:
            failures[i] += 1


def _elements(run: Run, count: int, dim: int, group: int) -> Bools:
    """Mask (count, dim) of one random element in each row."""
    chosen = run.rng.integers(0, -(-dim // group), size=(count, 1))
    mask: Bools = np.arange(dim) // group == chosen
    return mask


def _take_best_of_each(
    x: Floats, f: Floats, failures: Indices, chosen: Indices, tried: Floats, f_tried: Floats
) -> None:
    """Replace each source by the best bee that tried it, if it improves, and update the failures, in place."""
    best_first = np.argsort(f_tried, kind="stable")
    sources, where = np.unique(chosen[best_first], return_index=True)
    best = best_first[where]
    better = f_tried[best] < f[sources]
    failures += np.bincount(chosen, minlength=len(x))
    taken, lucky = sources[better], best[better]
    x[taken], f[taken], failures[taken] = tried[lucky], f_tried[lucky], 0
