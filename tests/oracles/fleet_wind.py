"""A fleet in one wind, by numerical integration from the definitions of `docs/concepts/wind.md` alone.

It shares no code with the package but its words for a motion: times and places in still air. Each piece is cut into
short steps. A wing keeps on each the true airspeed that it has in still air; a copter is as fast over ground as in
still air, unless its largest airspeed forbids that. Vehicles share the wind of a set, unless it varies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

from tests.oracles.wind import Share, Winds

STEP_M, SAMPLE_S = 40.0, 0.25
OPENS_S, DAY_S = 1e-3, 86400.0
Place = tuple[float, float, float]


@dataclass(frozen=True)
class Flyer:
    """A motion in still air: ``times_s`` at ``places``. ``air_m_s``: a copter's largest airspeed; None for a wing.

    ``opens_s``: when its gates open. It stands at each, in still air until then.
    """

    name: str
    times_s: Sequence[float]
    places: Sequence[Place]
    arrive_s: float
    air_m_s: float | None = None
    opens_s: Sequence[float] = ()


@dataclass(frozen=True)
class Track:
    """What is flown: times at places, and the arrival; on the ground before and behind."""

    name: str
    times_s: Sequence[float]
    places: Sequence[Place]
    arrive_s: float

    def at(self, time_s: float) -> Place | None:
        """Where it flies at a time; None on the ground."""
        if not self.times_s[0] <= time_s <= self.times_s[-1]:
            return None
        low, high = 0, len(self.times_s) - 1
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if self.times_s[middle] <= time_s else (low, middle)
        part = (time_s - self.times_s[low]) / max(self.times_s[high] - self.times_s[low], 1e-12)
        a, b = self.places[low], self.places[high]
        return a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * (b[2] - a[2])


def flown(flyer: Flyer, winds: Winds, share_of: Callable[[int], Share], ground_m: float = 0.0) -> Track:
    """A flight in the wind whose share on piece k of its motion is ``share_of(k)``."""
    clock, arrive_s = flyer.times_s[0], math.inf
    times, places = [clock], [flyer.places[0]]
    for k in range(1, len(flyer.times_s)):
        a, b = flyer.places[k - 1], flyer.places[k]
        still_s = flyer.times_s[k] - flyer.times_s[k - 1]
        opens = [at for at in flyer.opens_s if abs(at - flyer.times_s[k]) < OPENS_S and a == b]
        if opens:  # the gate holds no date: one that comes too late goes on the next day
            times.append(clock := opens[0] + (DAY_S if clock > opens[0] else 0.0))
            places.append(b)
            continue
        level_m, whole_m = math.dist(a[:2], b[:2]), math.dist(a, b)
        parts = max(1, math.ceil(level_m / STEP_M))
        for i in range(parts):
            middle = a[2] + (i + 0.5) / parts * (b[2] - a[2])
            seconds = still_s / parts
            if level_m > 1e-6:
                wind = winds.at(share_of(k), middle, middle - ground_m, clock)
                unit = (b[0] - a[0]) / level_m, (b[1] - a[1]) / level_m
                along, across = wind[0] * unit[0] + wind[1] * unit[1], wind[1] * unit[0] - wind[0] * unit[1]
                seconds = level_m / parts / _ground_m_s(flyer.air_m_s, level_m, whole_m, still_s, along, across)
            clock += seconds
            times.append(clock)
            places.append(tuple(x + (i + 1) / parts * (y - x) for x, y in zip(a, b, strict=True)))  # type: ignore[arg-type]
        if abs(flyer.times_s[k] - flyer.arrive_s) < 1e-6:
            arrive_s = clock
    return Track(flyer.name, times, places, arrive_s)


def _ground_m_s(
    air_m_s: float | None, level_m: float, whole_m: float, still_s: float, along: float, across: float
) -> float:
    if air_m_s is not None:
        return min(level_m / still_s, along + math.sqrt(max(air_m_s**2 - across**2, 0.0)))
    # (g - along)² + across² + (k·g)² = V², with the rise k of the way and the airspeed V along it in still air
    k2, air2 = (whole_m / level_m) ** 2 - 1.0, (whole_m / still_s) ** 2
    return (along + math.sqrt(along**2 - (1.0 + k2) * (along**2 + across**2 - air2))) / (1.0 + k2)


def least_m(tracks: Sequence[Track]) -> float:
    """The least distance of any two that fly, sampled every `SAMPLE_S`."""
    least = math.inf
    for a, b in combinations(tracks, 2):
        time_s = max(a.times_s[0], b.times_s[0])
        while time_s <= min(a.times_s[-1], b.times_s[-1]):
            here, there = a.at(time_s), b.at(time_s)
            if here is not None and there is not None:
                apart = math.dist(here, there)
                least = min(least, apart)
                time_s += max(SAMPLE_S, (apart - least) / 100.0)  # nobody closes in faster than that
                continue
            time_s += SAMPLE_S
    return least
