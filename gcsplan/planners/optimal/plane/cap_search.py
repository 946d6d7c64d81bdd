"""A lower bound of energy from pairs of altitude caps, for paths whose highest point lies between the two.

Such a path flies a track that is legal below the upper cap, and climbs at least to the lower cap. So the shortest track
below the upper cap plus the climb to the lower one is a bound for all such paths. Intervals between caps are halved
until none of them can hold a better path than the best one found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gcsplan.planners.problem import Problem

MOST_CAPS = 40
NARROW_M = 0.25
"""Metres; an interval between two caps that is narrower is not halved."""


@dataclass(slots=True)
class Layer:
    """Paths whose highest point lies between ``low_m`` and ``high_m``. Their tracks are at least ``track_m`` long, a
    bound that was computed with ``care`` (0 or 1)."""

    low_m: float
    high_m: float
    track_m: float
    care: int = 0

    def cost(self, rise: Callable[[float], float], vertical: float, horizontal: float) -> float:
        """A lower bound of the energy of such paths. ``rise(amsl_m)``: least metres climbed and descended in all by a
        path that reaches an altitude; ``vertical``, ``horizontal``: joules per metre."""
        return vertical * rise(self.low_m) + horizontal * self.track_m


def search_caps(
    layers: list[Layer],
    cost_of: Callable[[Layer], float],
    track_m: Callable[[float, int], float],
    best: Callable[[], float],
    try_at: Callable[[float], None],
    gap: float,
    in_time: Callable[[], bool],
) -> float:
    """Split the cheapest layer until its cost is within ``gap`` (a part) of the best path's. Returns the lower bound.

    ``track_m(cap, care)``: a lower bound of tracks below a cap; care 1 costs more and bounds better than care 0.
    ``try_at(cap)`` looks for a path below a cap; ``best()``: cost of the best path; ``in_time()``: whether to go on.
    """
    for _ in range(MOST_CAPS):
        layers.sort(key=cost_of)
        layer = layers[0]
        bound = min(cost_of(layer), best())
        if bound >= best() * (1.0 - gap) or not in_time():
            return bound
        if layer.care == 0:
            layer.track_m = max(layer.track_m, track_m(layer.high_m, 1))
            layer.care = 1
            continue
        if layer.high_m - layer.low_m < NARROW_M:
            return bound
        middle = 0.5 * (layer.low_m + layer.high_m)
        try_at(middle)
        lower = Layer(layer.low_m, middle, max(track_m(middle, 0), layer.track_m))
        layer.low_m = middle
        layers.append(lower)
    return min(min(map(cost_of, layers)), best())


def above_all(problem: Problem) -> float:
    """An altitude AMSL, metres, above all ground, zone ceilings and terminals, with at least 100 m to spare."""
    surface, limits = problem.airspace.surface, problem.limits
    high = float(np.nanmax(surface.top_m))
    tops = [0.0]
    for zone in problem.airspace.zones:
        if zone.ceiling is not None:
            tops.append(zone.ceiling.value_m + (high if zone.ceiling.datum == "agl" else 0.0))
    ends = [problem.start[2], problem.goal[2], *(v.amsl_m for v in problem.via if v.amsl_m is not None)]
    return max(high + limits.min_agl_m, *tops, *ends) + limits.altitude_error_m + 2.0 * limits.track_error_m + 100.0
