"""Krill: foraging, enemy avoidance and cruising (Xu, Zhu, Sun 2024, Biomimetics 9, 353), eq. 5-8 and fig. 5-9.

Distances are ‖·‖/√dim, so that range and step have the same meaning for every number of dimensions.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.optimisers.box import Run, Steps, clipped, rms_distances


def krill(run: Run, *, sight: float, step: float, crowding: float, attempts: int) -> Steps:
    """Each krill avoids enemies and cruises, and keeps the better result; where one of the two fails, it forages.

    ``sight`` is U, ``crowding`` δ, ``attempts`` T of foraging. The better result replaces the krill even if it is worse
    than the krill was.
    """
    x = run.first()
    f = yield x
    n = len(x)
    everyone = np.arange(n)
    for _ in run.cycles():
        seen = rms_distances(x) < sight
        seen[everyone, everyone] = False
        around = seen.sum(axis=1)
        # E crowding Y_c/n_f < δ·Y_i compares food as a cost, and any ratio depends on the cost's offset. Here a krill
        # goes if the target is better and fewer than δ·N krill are there.
        roomy = (around > 0) & (around < crowding * n)

        # Enemy avoidance. E eq. 8 prints the centre of two krill; here the mean of all neighbours in sight.
        centre = seen @ x / np.maximum(around, 1)[:, None]
        f_centre = np.full(n, np.inf)
        if roomy.any():
            f_centre[roomy] = yield clipped(centre[roomy])

        # Cruising. E prints Y_c where Y_j is meant; the crowd is counted around X_j.
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
    """Move each of ``x`` (n, dim) by a random part of one step towards its target (eq. 6)."""
    way = target - x
    length = np.sqrt((way * way).mean(axis=1, keepdims=True))
    return x + rng.random((len(x), 1)) * step * way / np.where(length > 0.0, length, 1.0)


def forage(
    rng: np.random.Generator, x: Floats, f: Floats, sight: float, step: float, attempts: int
) -> Generator[Floats, Floats, Floats]:
    """Forage (fig. 5): try random places in sight, step towards the first better one; after T tries, step at random."""
    moved = np.empty_like(x)
    hungry: Indices = np.arange(len(x))
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
