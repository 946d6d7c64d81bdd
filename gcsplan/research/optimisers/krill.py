"""Krill: foraging, enemy avoidance and cruising (Xu, Zhu, Sun 2024, Biomimetics 9, 353), eq. 5-8 and fig. 5-9.

Distances are ‖·‖/√dim, so that range and step have the same meaning for every number of dimensions.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.research.optimisers.box import Run, Steps, clipped, require, rms_distances


def krill(run: Run, *, sight: float, step: float, crowding: float, attempts: int, moves: str, crowd: str) -> Steps:
    """Each krill avoids enemies and cruises, and keeps the better result; where one of the two fails, it forages.

    ``sight`` is U, ``crowding`` δ, ``attempts`` T of foraging. The better result replaces the krill even if it is worse
    than the krill was. ``moves`` is "together", or "one": each krill sees where the ones before it have gone (fig. 9).
    ``crowd`` is "ranks", or "printed": it goes where food over n_f is less than δ times its own.
    """
    require("krill", "moves", moves, ("together", "one"))
    require("krill", "crowd", crowd, ("ranks", "printed"))
    x = run.first()
    f = yield x
    everyone = np.arange(len(x))
    rule = _KrillMove(run.rng, sight, step, crowding, attempts, crowd == "printed")
    seen = rule.sees(x, everyone)
    for _ in run.cycles():
        for who in (everyone,) if moves == "together" else everyone[:, None]:
            x[who], f[who] = yield from rule.moved(x, f, seen, who)
            seen[who] = rule.sees(x, who)
            seen[:, who] = seen[who].T


@dataclass(frozen=True, slots=True)
class _KrillMove:
    """One move of some krill; for the parameters see `krill`."""

    rng: np.random.Generator
    sight: float
    step: float
    crowding: float
    attempts: int
    printed: bool

    def sees(self, x: Floats, who: Indices) -> Bools:
        """(m, n) which of all krill at ``x`` (n, dim) each krill of ``who`` (m,) has in sight; none sees itself."""
        seen = np.asarray(rms_distances(x[who], x) < self.sight)
        seen[np.arange(len(who)), who] = False
        return seen

    def moved(
        self, x: Floats, f: Floats, seen: Bools, who: Indices
    ) -> Generator[Floats, Floats, tuple[Floats, Floats]]:
        """New places and costs of the krill ``who`` (m,) among all at ``x`` (n, dim) of costs ``f``.

        ``seen`` (n, n): which krill each of them has in sight.
        """
        n, m = len(x), len(who)
        around = seen.sum(axis=1)
        met = (around > 0)[who]

        # Enemy avoidance. E eq. 8 prints the centre of two krill; here the mean of all neighbours in sight.
        centre = seen[who] @ x / np.maximum(around[who], 1)[:, None]
        tries = met & (self.printed | self._roomy(around[who], n))
        f_centre = np.full(m, np.inf)
        if tries.any():
            f_centre[tries] = yield clipped(centre[tries])
        avoids = self._goes(f_centre, around[who], f[who], n) & tries

        # Cruising. E prints Y_c where Y_j is meant; the crowd is counted around X_j.
        lead = np.where(seen[who], f, np.inf).argmin(axis=1)
        cruises = met & self._goes(f[lead], around[lead], f[who], n)

        target = np.concatenate([centre, x[lead]])
        goes = np.concatenate([avoids, cruises])
        moved = np.concatenate([x[who], x[who]])
        moved[goes] = towards(self.rng, moved[goes], target[goes], self.step)
        stays = np.flatnonzero(~goes)
        if stays.size:
            moved[stays] = yield from forage(
                self.rng, moved[stays], f[who[stays % m]], self.sight, self.step, self.attempts
            )
        f_moved = yield clipped(moved)
        cruised = f_moved[m:] < f_moved[:m]
        return np.where(cruised[:, None], moved[m:], moved[:m]), np.where(cruised, f_moved[m:], f_moved[:m])

    def _roomy(self, crowd: Indices, n: int) -> Bools:
        return np.asarray(crowd < self.crowding * n)

    def _goes(self, food: Floats, crowd: Indices, own: Floats, n: int) -> Bools:
        """(m,) whether krill of food ``own`` go where there is ``food`` and a ``crowd``."""
        # E crowding Y_c/n_f < δ·Y_i compares food as a cost, and any ratio depends on the cost's offset. Here a krill
        # goes if the target is better and fewer than δ·N krill are there.
        if self.printed:
            return np.asarray(food / np.maximum(crowd, 1) < self.crowding * own)
        return np.asarray((food < own) & self._roomy(crowd, n))


def towards(rng: np.random.Generator, x: Floats, target: Floats, step: float) -> Floats:
    """Move each of ``x`` (n, dim) by a random part of one step towards its target (eq. 6)."""
    way = target - x
    length = np.sqrt(np.add.reduce(way * way, axis=1, keepdims=True) / x.shape[1])
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
