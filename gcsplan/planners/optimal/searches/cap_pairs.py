"""Paths below lower caps, which climb less, and a bound of energy or time from pairs of caps.

A path whose highest point lies between two altitude caps flies a track that is legal below the upper cap, and climbs at
least to the lower cap. So the shortest track below the upper cap plus the climb to the lower one is a bound for all
such paths. Intervals between caps are halved until none of them can hold a better path than the best one found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from gcsplan.planners.optimal.loop.search import Search, Size
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch

MOST_CAPS = 40
NARROW_M = 0.25
"""Metres; an interval between two caps that is narrower is not halved."""


class CapPairs(Search):
    """For energy and time, when a path is known, and again after a better one. Remembers nothing."""

    NAME, IMPROVES, SHARE, AGAIN = "cap_pairs", "paths, bounds", 0.5, True

    def applies(self) -> bool:
        """Whether the objective is energy or time, a path is known, and no maximum AGL."""
        p = self.problem
        return p.rates is not None and self.incumbent.best is not None and p.limits.max_agl_m is None

    def size(self) -> Size:
        """Three passes over the lattices."""
        return self.work.plane.size(3.0)

    def run(self) -> None:
        """Search all caps."""
        if self.work.plane.reach_longest():
            bound_by_caps(self.work.plane)


@dataclass(slots=True)
class Layer:
    """Paths whose highest point lies between ``low_m`` and ``high_m``. Their tracks are at least ``track_m`` long, a
    bound that was computed with ``care`` (0 or 1)."""

    low_m: float
    high_m: float
    track_m: float
    care: int = 0

    def cost(self, rise: Callable[[float], float], least_cost: Callable[[float, float], float]) -> float:
        """A lower bound of the cost of such paths. ``rise(amsl_m)``: least metres climbed and descended in all by a
        path that reaches an altitude; ``least_cost``: of so much track and rise (`Problem.least_cost`)."""
        return least_cost(self.track_m, rise(self.low_m))


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


def bound_by_caps(plane: PlaneSearch) -> None:
    """Look for paths below lower caps, which climb less, and raise the bound to the least of all caps."""
    p, incumbent = plane.problem, plane.incumbent
    tried: set[float] = set()

    def cost_of(layer: Layer) -> float:
        return layer.cost(incumbent.rise, p.least_cost)

    def track_m(cap: float, care: int) -> float:
        limits = [plane.limit(leg) for leg in plane.legs]
        corridors = [leg.corridor(limit) if care else None for leg, limit in zip(plane.legs, limits, strict=True)]
        looked_at = zip(plane.legs, corridors, limits, strict=True)
        return sum(leg.bound(cap, cells, limit, care > 0) for leg, cells, limit in looked_at)

    def try_at(cap: float) -> None:
        cap = min(cap, plane.path_top_m)
        if round(cap, 1) not in tried:
            tried.add(round(cap, 1))
            if plane.try_below(cap, fine=False):
                plane.try_below(cap, fine=True)

    layers = [Layer(max(incumbent.known_m), plane.top_m, sum(leg.length_m for leg in plane.legs))]
    found = search_caps(
        layers, cost_of, track_m, lambda: incumbent.cost, try_at, incumbent.nearer, incumbent.budget.goes_on
    )
    incumbent.raise_bound(found)
