"""Path and bound of a problem brought together: closer looks at what is between them, the cheap ones first.

The bound is raised by asking whether any path is shorter than some length between the two: the tracks that short are
few, near their ends they can have climbed only so far, and on their way they must climb so much. What is answered with
no is a bound; else the bound of those that are shorter halves what is left.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

from gcsplan.planners.optimal.bounds.climb_bound import climb_bound, rise_bound
from gcsplan.planners.optimal.cap_search import Layer, search_caps
from gcsplan.planners.optimal.incumbent import FAR, PAST, Below
from gcsplan.planners.optimal.leg import LARGE
from gcsplan.planners.optimal.sources.bound_corridor import follow
from gcsplan.planners.optimal.sources.contour import pulled_tight, traverse

PAST_FINE, ROUNDS = 9, 2
"""Tracks past what is in the way that are looked at on the finer lattice; and how often."""
TWICE, NEAR, FINER = 2.0, 5e-2, 4
"""From so many times the wanted gap on, and up to which gap, as a part, cells are cut once more, and into how many
parts a side: for walls and zones that the first lattice rounds off."""
CLOSER, LEFT, SURE, FLAT = 8, 0.05, 0.4, 0.12
"""Times that what lies between path and bound is cut, at most, and what part of the gap is not worth it, or what part
of that where it is known how bounds rise; where it is cut first where path and bound are far apart."""
MOST_CELLS = 50_000
"""Cells of all corridors whose storeys are looked at, at most."""
FALLS = -0.25
"""By how much a bound of shorter paths falls with each metre that they may be longer, where that is not known."""
ASLANT = 1e-2
"""Gap, as a part, from which on paths for length that climb aslant are looked for over large terrain models, where that
takes seconds; over others, and for energy, from `FAR` on."""
WIDE = 2e-2
"""Gap, as a part, from which on it is worth to look for slits in cells as small as can be."""
CLIMBED = (0.98, 0.9, 0.75, 0.5)
"""What part of what the longest tracks must climb shorter ones may have to, tried one after the other."""
PIECES = 4
"""Into how many pieces the lengths of tracks that matter are cut, each of which must climb no less than a bound."""
NEARLY = 0.9
"""What part of what lay between path and bound is left, at most, where a better path makes another bound worth it."""
KEPT = 0.6
"""What part of the time is spent, at most, before slopes are looked at."""
NEARER = 0.45
"""What part of the wanted gap is tried first, and worth a look even where the gap is small enough; a first path that is
as near is good enough."""


def tighten(below: Below) -> None:
    """Improve path and bound until they are as near as wanted."""
    if below.gap <= NEARER * below.wanted or not below.in_time():
        return
    # Whatever is not longer than the best path must have been looked at.
    for leg in below.legs:
        limit = below.limit(leg)
        if limit > leg.reach_m:
            leg.flood((limit / leg.length_m - 1.0) * (1.0 + 1e-9))
    if below.problem.objective == "energy":
        _tighten_energy(below)
    else:
        _tighten_length(below)


def _tighten_length(below: Below) -> None:
    below.may_spend = KEPT
    below.try_below(below.top_m, fine=True)
    if below.gap > FAR:
        below.past(PAST, fine=False)
    _halve(below)
    if not below.done() and below.in_space:
        below.raise_bound(_search_caps(below, lambda layer: math.hypot(layer.track_m, below.rise(layer.low_m))))
    for _ in range(ROUNDS):
        before = below.cost - below.bound
        if below.done() or not below.past(PAST_FINE, fine=True):
            break
        if below.cost - below.bound < NEARLY * before:
            _halve(below)
    for _ in _dared(below):
        _halve(below)
    below.may_spend = 1.0
    if _traverse(below):
        _halve(below)
    far = below.gap > TWICE * below.wanted and below.in_time()
    if far and sum(leg.part_sheets(below.limit(leg)) for leg in below.legs):
        _halve(below)
    if below.gap > TWICE * below.wanted and below.climbs() and below.in_time():
        cells = sum(int(leg.corridor(below.limit(leg)).cells.sum()) for leg in below.legs)
        below.by_storeys = cells <= MOST_CELLS
    if below.by_storeys:
        _halve(below)
    far = not below.in_space and TWICE * below.wanted < below.gap <= NEAR and below.in_time()
    cut = 2 if below.gap > FAR else 1
    if far and sum(leg.look_closer(below.limit(leg), FINER, cut) for leg in below.legs):
        below.try_below(below.top_m, fine=True)
        _halve(below, far=True)
        if below.gap > TWICE * below.wanted and below.in_time() and follow(below):
            _halve(below, far=True)


def _tighten_energy(below: Below) -> None:
    p = below.problem

    def least(layer: Layer) -> float:
        return layer.cost(below.rise, p.vertical_j_per_m, p.horizontal_j_per_m)

    below.try_below(below.top_m, fine=True)
    below.raise_bound(_search_caps(below, least))
    _raise_climb(below)
    if below.gap > FAR and below.past(PAST_FINE, fine=True):
        below.raise_bound(_search_caps(below, least))
    for _ in _dared(below):
        below.raise_bound(_search_caps(below, least))
        _raise_climb(below)
    if _traverse(below):
        below.raise_bound(_search_caps(below, least))
        _raise_climb(below)


def _dared(below: Below) -> Iterator[None]:
    """Look for paths through slits, where path and bound are far apart; once for each that is the best so far."""
    if below.gap > TWICE * below.wanted and below.in_time() and follow(below):
        yield
    for closely, beyond in ((False, FAR), (True, WIDE)):
        if below.gap > beyond and below.in_time() and below.dare(closely=closely):
            yield


def _raise_climb(below: Below) -> None:
    """Raise a bound of energy by what tracks that are short enough must climb and descend, a few lengths at a time."""
    p = below.problem
    if below.gap <= NEARER * below.wanted or not below.in_time():
        return
    limits = [below.limit(leg) for leg in below.legs]
    known = [leg.bound(below.top_m, leg.corridor(m), m, True) for leg, m in zip(below.legs, limits, strict=True)]
    spare = max(below.longest() - sum(known), 0.0)

    def least_j(least: list[float], most: list[float]) -> float:
        return p.horizontal_j_per_m * sum(least) + p.vertical_j_per_m * climb_bound(below.legs, least, most)

    below.raise_bound(_least_of_pieces(below, known, spare, least_j))


def _least_of_pieces(
    below: Below, tracks_m: list[float], spare_m: float, cost: Callable[[list[float], list[float]], float]
) -> float:
    """The least ``cost`` of paths whose tracks are longer than ``tracks_m`` by no more than ``spare_m`` in all, given
    that of those between least and greatest lengths."""
    found = math.inf
    for least, most in _pieces(tracks_m, spare_m):
        if below.least(sum(least)) >= found:
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


def _traverse(below: Below) -> bool:
    """Look for a path that climbs slopes aslant, if path and bound are far apart; True if it is the best so far."""
    energy = below.problem.objective == "energy"
    large = below.problem.airspace.surface.ground_m.size >= LARGE
    far = below.gap > (ASLANT if large and not energy else FAR)
    if below.best is None or not far or not below.climbs() or not below.in_time():
        return False
    before, found = below.cost, traverse(below.problem, below.longest())
    if found is not None:
        below.take_longer(found, fine=True)
    # Where finer lines are better, yet finer ones may be, too; for length that is hardly worth the time.
    for level in (0, 1) if energy else (0,):
        if below.gap <= TWICE * below.wanted or not below.in_time():
            break
        tight = pulled_tight(below.problem, below.best, level, below.begun_s + below.problem.budget_s)
        if tight is None or not below.take_simpler(*tight, fine=True, longer=True):
            break
    return below.cost < before


def _halve(below: Below, *, far: bool = False) -> None:
    """Raise the bound, up to the wanted gap if it can be, which is tried first if it is not ``far``: what lies between
    is halved until it can be told how bounds rise with shorter paths."""
    low, high = below.bound, below.cost
    shorter: list[tuple[float, float]] = []  # what was asked, and the bound of that, where it is known
    part = FLAT if far else 0.5
    for k in range(CLOSER):
        nearer = below.cost / (1.0 + NEARER * below.wanted)
        at_once = k == 0 and not far
        enough = low >= nearer if at_once else below.done()
        least = max(2e-5 * low, LEFT * (below.cost - low))
        where = _meeting(shorter, low, high)
        if enough or high - low < least or where - low < SURE * least or not below.in_time():
            break
        # No path is shorter than `low`; is any shorter than `middle`?
        middle = where if math.isfinite(where) else low + part * (high - low)
        middle = max(middle, nearer if at_once else 0.0)
        found = _bound_shorter(below, middle)
        if found < middle:
            high = middle
        part = 0.5 if found < middle else min(2.0 * part, 0.5)
        if found != middle:
            shorter = [*shorter[-1:], (middle, found)]
        low = max(low, min(found, middle))
        below.raise_bound(low)


def _meeting(shorter: list[tuple[float, float]], low: float, high: float) -> float:
    """Where a length is the bound of all that is shorter, by the last two that were asked, or one, if that tells; else
    inf."""
    if not shorter or (len(shorter) == 1 and shorter[0][1] < shorter[0][0]):
        return math.inf
    (a, of_a), (b, of_b) = shorter[0], shorter[-1]
    slope = (of_b - of_a) / (b - a) if b != a else FALLS
    at = (of_b - slope * b) / (1.0 - slope)
    return at if slope <= 0.0 and low <= at < high else math.inf


def _bound_shorter(below: Below, longest_m: float) -> float:
    """A bound of all paths shorter than ``longest_m``: their tracks on the fine lattice, then what they climb."""
    most_m = _longest_track(below, longest_m)
    spare = most_m - sum(leg.length_m for leg in below.legs)
    tracks = []
    for leg in below.legs:
        limit = leg.length_m + spare
        wanted = leg.corridor(limit)
        if below.by_storeys:
            storeys = leg.storeys(limit)
            if not len(storeys.cell):
                tracks.append(min(limit, leg.reach_m))
                continue
            wanted = wanted.within(storeys.cells)
        tracks.append(leg.bound(below.top_m, wanted, limit, True))
    if sum(tracks) >= most_m * (1.0 - 1e-12):
        return longest_m
    # Each leg's limit is what the others leave, which is less now that they are known better.
    spare = max(most_m - sum(tracks), 0.0)
    return _least_of_pieces(below, tracks, spare, partial(rise_bound, below.legs))


def _longest_track(below: Below, longest_m: float) -> float:
    """No track of a path shorter than ``longest_m`` is longer than this, for it must climb as well."""
    if len(below.legs) > 1:
        return longest_m
    climbing = rise_bound(below.legs, [longest_m], [longest_m]) - longest_m
    for part in CLIMBED:
        shorter = max(longest_m - part * climbing, below.legs[0].length_m)
        if rise_bound(below.legs, [shorter], [longest_m]) >= longest_m:
            return shorter
    return longest_m


def _search_caps(below: Below, cost_of: Callable[[Layer], float]) -> float:
    """Look below lower caps for what climbs less; the bound of all caps, given that of a layer."""
    tried: set[float] = set()

    def track_m(cap: float, care: int) -> float:
        limits = [below.limit(leg) for leg in below.legs]
        wanted = [leg.corridor(limit) if care else None for leg, limit in zip(below.legs, limits, strict=True)]
        looked_at = zip(below.legs, wanted, limits, strict=True)
        return sum(leg.bound(cap, cells, limit, care > 0) for leg, cells, limit in looked_at)

    def try_at(cap: float) -> None:
        if round(cap, 1) not in tried:
            tried.add(round(cap, 1))
            if below.try_below(cap, fine=False):
                below.try_below(cap, fine=True)

    near = (NEARER if below.problem.objective == "energy" else 1.0) * below.wanted
    layers = [Layer(max(below.known_m), below.top_m, sum(leg.length_m for leg in below.legs))]
    return search_caps(layers, cost_of, track_m, lambda: below.cost, try_at, near, below.in_time)
