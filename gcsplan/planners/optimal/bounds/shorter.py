"""Bounds of length and energy from the plane: is any path cheaper than something between bound and best path?

The tracks that short are few, near their ends they can have climbed only so far, and on their way they must climb so
much. What is answered with no is a bound; else the bound of those that are shorter halves what is left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

from gcsplan.planners.optimal.bounds.climb_bound import climb_bound, rise_bound
from gcsplan.planners.optimal.cap_search import Layer, search_caps
from gcsplan.planners.optimal.plane_search import PlaneSearch

CLOSER, LEFT, SURE, FLAT = 8, 0.05, 0.4, 0.12
"""Times that what lies between path and bound is cut, at most, and what part of the gap is not worth it, or what part
of that where it is known how bounds rise; where it is cut first where path and bound are far apart."""
FALLS = -0.25
"""By how much a bound of shorter paths falls with each metre that they may be longer, where that is not known."""
CLIMBED = (0.98, 0.9, 0.75, 0.5)
"""What part of what the longest tracks must climb shorter ones may have to, tried one after the other."""
PIECES = 4
"""Into how many pieces the lengths of tracks that matter are cut, each of which must climb no less than a bound."""
NEARER = 0.45
"""What part of the wanted gap is tried first, and worth a look even where the gap is small enough; a first path that is
as near is good enough."""


def halve(plane: PlaneSearch, *, far: bool = False) -> None:
    """Raise the bound, up to the wanted gap if it can be, which is tried first if it is not ``far``: what lies between
    is halved until it can be told how bounds rise with shorter paths."""
    incumbent = plane.incumbent
    low, high = incumbent.bound, incumbent.cost
    shorter: list[tuple[float, float]] = []  # what was asked, and the bound of that, where it is known
    part = FLAT if far else 0.5
    for k in range(CLOSER):
        nearer = incumbent.cost / (1.0 + NEARER * incumbent.wanted)
        at_once = k == 0 and not far
        enough = low >= nearer if at_once else incumbent.done()
        least = max(2e-5 * low, LEFT * (incumbent.cost - low))
        where = _meeting(shorter, low, high)
        if enough or high - low < least or where - low < SURE * least or not incumbent.budget.goes_on():
            break
        # No path is shorter than `low`; is any shorter than `middle`?
        middle = where if math.isfinite(where) else low + part * (high - low)
        middle = max(middle, nearer if at_once else 0.0)
        found = _bound_shorter(plane, middle)
        if found < middle:
            high = middle
        part = 0.5 if found < middle else min(2.0 * part, 0.5)
        if found != middle:
            shorter = [*shorter[-1:], (middle, found)]
        low = max(low, min(found, middle))
        incumbent.raise_bound(low)


def _meeting(shorter: list[tuple[float, float]], low: float, high: float) -> float:
    """Where a length is the bound of all that is shorter, by the last two that were asked, or one, if that tells; else
    inf."""
    if not shorter or (len(shorter) == 1 and shorter[0][1] < shorter[0][0]):
        return math.inf
    (a, of_a), (b, of_b) = shorter[0], shorter[-1]
    slope = (of_b - of_a) / (b - a) if b != a else FALLS
    at = (of_b - slope * b) / (1.0 - slope)
    return at if slope <= 0.0 and low <= at < high else math.inf


def _bound_shorter(plane: PlaneSearch, longest_m: float) -> float:
    """A bound of all paths shorter than ``longest_m``: their tracks on the fine lattice, then what they climb."""
    most_m = _longest_track(plane, longest_m)
    spare = most_m - sum(leg.length_m for leg in plane.legs)
    tracks = []
    for leg in plane.legs:
        limit = leg.length_m + spare
        wanted = leg.corridor(limit)
        if plane.by_intervals:
            intervals = leg.intervals(limit)
            if not len(intervals.cell):
                tracks.append(min(limit, leg.reach_m))
                continue
            wanted = wanted.within(intervals.cells)
        tracks.append(leg.bound(plane.top_m, wanted, limit, True))
    if sum(tracks) >= most_m * (1.0 - 1e-12):
        return longest_m
    # Each leg's limit is what the others leave, which is less now that they are known better.
    spare = max(most_m - sum(tracks), 0.0)
    return _least_of_pieces(plane, tracks, spare, partial(rise_bound, plane.legs))


def _longest_track(plane: PlaneSearch, longest_m: float) -> float:
    """No track of a path shorter than ``longest_m`` is longer than this, for it must climb as well."""
    legs = plane.legs
    if len(legs) > 1:
        return longest_m
    climbing = rise_bound(legs, [longest_m], [longest_m]) - longest_m
    for part in CLIMBED:
        shorter = max(longest_m - part * climbing, legs[0].length_m)
        if rise_bound(legs, [shorter], [longest_m]) >= longest_m:
            return shorter
    return longest_m


def _least_of_pieces(
    plane: PlaneSearch, tracks_m: list[float], spare_m: float, cost: Callable[[list[float], list[float]], float]
) -> float:
    """The least ``cost`` of paths whose tracks are longer than ``tracks_m`` by no more than ``spare_m`` in all, given
    that of those between least and greatest lengths."""
    found = math.inf
    for least, most in _pieces(tracks_m, spare_m):
        if plane.incumbent.least(sum(least)) >= found:
            break  # longer tracks cost no less
        found = min(found, cost(least, most))
    return found


def _pieces(tracks_m: list[float], spare_m: float) -> Iterator[tuple[list[float], list[float]]]:
    """The least and the greatest lengths of tracks that are longer by no more than ``spare_m``, cut into pieces: the
    less lengths differ, the better it is known where on its way a track is. Of several legs that is not known."""
    if len(tracks_m) > 1:
        yield tracks_m, [track + spare_m for track in tracks_m]
        return
    for k in range(PIECES):
        yield [tracks_m[0] + spare_m * k / PIECES], [tracks_m[0] + spare_m * (k + 1) / PIECES]


def raise_climb(plane: PlaneSearch) -> None:
    """Raise a bound of energy by what tracks that are short enough must climb and descend, a few lengths at a time."""
    p, legs = plane.problem, plane.legs
    if plane.incumbent.gap <= NEARER * plane.incumbent.wanted or not plane.incumbent.budget.goes_on():
        return
    limits = [plane.limit(leg) for leg in legs]
    known = [leg.bound(plane.top_m, leg.corridor(m), m, True) for leg, m in zip(legs, limits, strict=True)]
    spare = max(plane.longest() - sum(known), 0.0)

    def least_j(least: list[float], most: list[float]) -> float:
        return p.horizontal_j_per_m * sum(least) + p.vertical_j_per_m * climb_bound(legs, least, most)

    plane.incumbent.raise_bound(_least_of_pieces(plane, known, spare, least_j))


def bound_by_caps(plane: PlaneSearch) -> None:
    """Look for paths below lower caps, which climb less, and raise the bound of energy to the least of all caps."""
    p, incumbent = plane.problem, plane.incumbent
    tried: set[float] = set()

    def cost_of(layer: Layer) -> float:
        return layer.cost(incumbent.rise, p.vertical_j_per_m, p.horizontal_j_per_m)

    def track_m(cap: float, care: int) -> float:
        limits = [plane.limit(leg) for leg in plane.legs]
        wanted = [leg.corridor(limit) if care else None for leg, limit in zip(plane.legs, limits, strict=True)]
        looked_at = zip(plane.legs, wanted, limits, strict=True)
        return sum(leg.bound(cap, cells, limit, care > 0) for leg, cells, limit in looked_at)

    def try_at(cap: float) -> None:
        if round(cap, 1) not in tried:
            tried.add(round(cap, 1))
            if plane.try_below(cap, fine=False):
                plane.try_below(cap, fine=True)

    near = NEARER * incumbent.wanted
    layers = [Layer(max(incumbent.known_m), plane.top_m, sum(leg.length_m for leg in plane.legs))]
    found = search_caps(layers, cost_of, track_m, lambda: incumbent.cost, try_at, near, incumbent.budget.goes_on)
    incumbent.raise_bound(found)
