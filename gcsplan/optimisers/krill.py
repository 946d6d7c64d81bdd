"""Krill: foraging, enemy avoidance and cruising (Xu, Zhu, Sun 2024, Biomimetics 9, 353), eq. 5-8 and fig. 5-9.

Distances are ‖·‖/√dim, so that the range and the step mean the same in every dimension.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.optimisers.box import Run, Steps, clipped, rms_distances


def krill(run: Run, *, sight: float, step: float, crowding: float, attempts: int) -> Steps:
    """Every krill avoids enemies and cruises, and keeps the better of the two; either becomes foraging if it fails.

    ``sight`` is U, ``crowding`` δ, ``attempts`` T of foraging. The better result replaces the krill, be it worse.
    """
    x = run.first()
    f = yield x
    n = len(x)
    everyone = np.arange(n)
    for _ in run.cycles():
        seen = rms_distances(x) < sight
        seen[everyone, everyone] = False
        around = seen.sum(axis=1)
        # E crowding Y_c/n_f < δ·Y_i compares food as a cost, and any ratio depends on the cost's offset; by rank: go if
        # the target is better and fewer than δ·N crowd there.
        roomy = (around > 0) & (around < crowding * n)

        # Enemy avoidance. E eq. 8 writes the centre of two: the mean of the neighbours in sight.
        centre = seen @ x / np.maximum(around, 1)[:, None]
        f_centre = np.full(n, np.inf)
        if roomy.any():
            f_centre[roomy] = yield clipped(centre[roomy])

        # Cruising. E prints Y_c where Y_j is meant; the crowd counted is the one around X_j.
        lead = np.where(seen, f, np.inf).argmin(axis=1)
        cruises = (around > 0) & (f[lead] < f) & (around[lead] < crowding * n)

        target = np.concatenate([centre, x[lead]])
        goes = np.concatenate([f_centre < f, cruises])
        moved = np.concatenate([x, x])
        moved[goes] = towards(run.rng, moved[goes], target[goes], step)
        stays = np.flatnonzero(~goes)
        if stays.size:
            moved[stays] = yield from forage(run.rng, moved[stays], f[stays % n], sight, step, attempts)
        f_moved = yield clipped(moved)
        cruised = f_moved[n:] < f_moved[:n]
        x = np.where(cruised[:, None], moved[n:], moved[:n])
        f = np.where(cruised, f_moved[n:], f_moved[:n])


def towards(rng: np.random.Generator, x: Floats, target: Floats, step: float) -> Floats:
    """Eq. 6: a random part of one step from each of ``x`` (n, dim) in the direction of its target."""
    way = target - x
    length = np.sqrt((way * way).mean(axis=1, keepdims=True))
    return x + rng.random((len(x), 1)) * step * way / np.where(length > 0.0, length, 1.0)


def forage(
    rng: np.random.Generator, x: Floats, f: Floats, sight: float, step: float, attempts: int
) -> Generator[Floats, Floats, Floats]:
    """Fig. 5: look at random places in sight, step towards the first that is better; after T looks, step at random."""
    moved = np.empty_like(x)
    hungry: NDArray[np.intp] = np.arange(len(x))
    for _ in range(attempts):
        # E eq. 5, 7: rand() in [0, 1] drifts to one corner; uniform in [−1, 1] in each dimension.
        look = clipped(x[hungry] + sight * rng.uniform(-1.0, 1.0, size=(len(hungry), x.shape[1])))
        found = (yield look) < f[hungry]
        happy = hungry[found]
        moved[happy] = towards(rng, x[happy], look[found], step)
        hungry = hungry[~found]
        if not hungry.size:
            break
    moved[hungry] = x[hungry] + step * rng.uniform(-1.0, 1.0, size=(len(hungry), x.shape[1]))  # eq. 7
    return moved
