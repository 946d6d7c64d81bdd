"""Lower bounds of length, energy and time from the plane: is any path cheaper than a value between bound and best path?

Few tracks are that short, can climb only little near their ends, and must climb over the ground on their way.
If no path is cheaper, the value is the new bound. Otherwise the value replaces the upper end of the interval that is
left, and the bound of the cheaper paths its lower end.

A path is longer than its ground track by the altitudes that no short track avoids. After s metres, every track shorter
than some length is in one of the cells that are no farther than s from its start and no farther than the remaining
length from its goal. The lowest floor of those cells is a floor for the altitude after s metres, whatever the track. A
taut string over these floors is no longer than any path.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.loop.search import FAR, Search, Size
from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.navmesh.interval_kernels import range_along
from gcsplan.planners.optimal.plane.leg import Leg
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch
from gcsplan.planners.profile.taut_string import Blocked, Profile, taut_string

FLOOR_STEPS = 400
"""Steps along a leg between the places at which the floor is read."""

CLOSER, LEFT, FLAT = 8, 0.05, 0.2
"""Most cuts of the interval between bound and best path; the part of the gap below which neither an interval is cut nor
a gain is worth the work; and the part of the interval at which it is first cut if path and bound are far apart."""
FALLS = -0.25
"""Change of the bound of cheaper paths with their greatest cost, assumed until two such bounds are known."""
CLIMBED = (0.98, 0.9, 0.75, 0.5)
"""Parts of the extra length that climbing costs the longest tracks, tried in turn for shorter tracks."""
LENGTH_PIECES = 4
"""Pieces into which the range of track lengths is cut; each piece has its own bound of the climb."""


PLAIN, BY_INTERVALS, REFINED = 0, 1, 2
"""Efforts: floors of the ground alone; with the altitudes that a short enough track can climb to, and descend from in
time; and with the cells that short enough tracks may meet cut finer."""
SHARES = {PLAIN: 0.9, BY_INTERVALS: 0.08, REFINED: 0.04}
ENERGY_SHARE = 0.5
"""`PLAIN` for energy and time."""
INTERVAL_S, REFINED_S = 0.7e-6, 4e-6
"""Counted seconds for each cell of the finer lattice near short tracks: what altitude intervals take on average, and
the least that refinement takes in nine of ten missions. Refinement raises bounds even if it ends with the budget."""
REFINED_GAP = 1.75
"""Multiple of the requested gap from which cells are cut finer, which takes as long as all other searches together."""
MOST_CORRIDOR_CELLS = 50_000
"""Most cells of all corridors for which altitude intervals are computed."""
FINER = 2
"""Parts a side into which cells are cut once more, for walls and zones that the first lattice rounds off."""


class Bound(Search):
    """When a path is known, unless there is a maximum AGL: with rising effort, and after a better path again with the
    effort so far.

    Remembers which efforts were chosen, and whether altitude intervals are used.
    """

    NAME, IMPROVES, SHARE, AGAIN = "bound", "bounds", SHARES[PLAIN], True

    def __init__(self, work: Workspace) -> None:
        super().__init__(work)
        self.by_intervals = False
        self._chosen: set[int] = set()
        self._now: int | None = None

    @property
    def share(self) -> float:
        """By the effort."""
        linear = self._effort == PLAIN and self.problem.rates is not None
        return ENERGY_SHARE if linear else SHARES[self._effort or PLAIN]

    @property
    def nearer(self) -> bool:
        """The least effort is cheap and mostly helps, but for energy and time."""
        return self._effort == PLAIN and self.problem.rates is None

    @property
    def _effort(self) -> int | None:
        """The least effort that is left; None if there is none."""
        incumbent = self.incumbent
        if super().is_open():
            return PLAIN
        if BY_INTERVALS not in self._chosen and incumbent.climbs:
            return BY_INTERVALS
        far = incumbent.gap > REFINED_GAP * incumbent.most_gap
        return REFINED if REFINED not in self._chosen and far else None

    def applies(self) -> bool:
        """Whether a path is known, and no maximum AGL, under which `sections` has higher bounds."""
        return self.incumbent.best is not None and self.problem.limits.max_agl_m is None

    def is_open(self) -> bool:
        """Whether an effort is left."""
        return self.applies() and self._effort is not None

    def choose(self) -> None:
        """Note the effort."""
        self._now = self._effort
        if self._now == PLAIN:
            super().choose()
        elif self._now is not None:
            self._chosen.add(self._now)

    def size(self) -> Size:
        """By the effort: a pass over the lattices, or cells near short tracks."""
        plane = self.work.plane
        if self._effort == PLAIN:
            return plane.size(1.0)
        return plane.size_nearby(REFINED_S if self._effort == REFINED else INTERVAL_S)

    def run(self) -> None:
        """Raise the bound with the chosen effort."""
        plane = self.work.plane
        if not plane.reach_longest():
            return
        if self._now == BY_INTERVALS:
            cells = sum(int(leg.corridor(plane.limit(leg)).cells.sum()) for leg in plane.legs)
            self.by_intervals = cells <= MOST_CORRIDOR_CELLS
            if not self.by_intervals:
                return
        if self._now == REFINED:
            cut = 2 if self.incumbent.gap > FAR else 1
            if not sum(leg.refine(plane.limit(leg), FINER, cut) for leg in plane.legs):
                return
        halve(plane, far=self._now == REFINED, by_intervals=self.by_intervals)


def altitude_ranges(leg: Leg, track_m: float, limit_m: float) -> tuple[Floats, Floats, Floats]:
    """Metres along a leg (M,), and floor and ceiling there (M,), for all tracks of ``track_m`` to ``limit_m`` metres.

    A longer track is mapped to ``track_m`` by moving its points towards its start by at most its extra length. So the
    floor at a place is the lowest, and the ceiling the highest, within that distance; inf and -inf where no cell is.
    """
    at = np.linspace(0.0, track_m, FLOOR_STEPS + 1)[1:-1]
    low, high = (np.full((FLOOR_STEPS.bit_length(), len(at)), fill) for fill in (np.inf, -np.inf))
    range_along(*leg.cells(limit_m), limit_m, max(limit_m - track_m, 0.0), track_m / FLOOR_STEPS, low, high)
    return at, low[0], high[0]


def rise_bound(legs: list[Leg], tracks_m: list[float], limits_m: list[float]) -> float:
    """A lower bound of the length in space of paths over tracks of ``tracks_m`` to ``limits_m`` metres, leg by leg.

    It ignores climb limits, which only make paths longer.
    """
    found = _string(legs, tracks_m, limits_m)
    return found.length_m if isinstance(found, Profile) else sum(tracks_m)


def climb_bound(legs: list[Leg], tracks_m: list[float], limits_m: list[float]) -> float:
    """A lower bound of the metres climbed and descended in all by paths over such tracks."""
    found = _string(legs, tracks_m, limits_m)
    return found.vertical_m if isinstance(found, Profile) else 0.0


def _string(legs: list[Leg], tracks_m: list[float], limits_m: list[float]) -> Profile | Blocked:
    """The taut string between the floors and ceilings of such tracks (`altitude_ranges`)."""
    places, lows, highs = [np.zeros(1)], [np.full(1, -np.inf)], [np.full(1, np.inf)]
    begin = 0.0
    for k, (leg, track_m, limit_m) in enumerate(zip(legs, tracks_m, limits_m, strict=True)):
        at, low, high = altitude_ranges(leg, track_m, limit_m)
        end = leg.goal.amsl_m if k < len(legs) - 1 else None
        places += [begin + at, np.array([begin + track_m])]
        lows += [np.where(np.isfinite(low), low, -np.inf), np.array([-np.inf if end is None else end])]
        highs += [np.where(np.isfinite(high), high, np.inf), np.array([np.inf if end is None else end])]
        begin += track_m
    s = np.concatenate(places)
    keep = np.concatenate([[True], np.diff(s) > 1e-9])
    low, high = np.concatenate(lows)[keep], np.concatenate(highs)[keep]
    z0, z1 = legs[0].start.amsl_m, legs[-1].goal.amsl_m
    assert z0 is not None
    assert z1 is not None
    low[0] = low[-1] = -math.inf
    high[0] = high[-1] = math.inf
    return taut_string(s[keep], np.minimum(low, high), high, z0, z1)


def halve(plane: PlaneSearch, *, far: bool = False, by_intervals: bool = False) -> None:
    """Raise the lower bound of the cost until the gap is as small as requested, if possible. Unless ``far``, the bound
    that gives this gap is tried first. The interval between bound and path is halved until bounds predict the best
    cut."""
    incumbent = plane.incumbent
    if by_intervals:
        _raise_by_intervals(plane)
    low, high = incumbent.bound, incumbent.cost
    cheaper: list[tuple[float, float]] = []  # costs that were tried, and the bounds of all paths cheaper than them
    part = FLAT if far else 0.5
    for k in range(CLOSER):
        nearer = incumbent.cost / (1.0 + incumbent.nearer)
        at_once = k == 0 and not far
        enough = low >= nearer if at_once else incumbent.done()
        least = _least_step(plane)
        where = _meeting(cheaper)
        if where - low < least and len(plane.legs) > 1:
            where = math.inf  # a better bound of one leg leaves the others less to spare: a prediction is soon too low
        if enough or high - low < least or where - low < least or not incumbent.budget.goes_on():
            break
        # No path is cheaper than `low`; is any cheaper than `middle`?
        middle = where if where < high else low + part * (high - low)
        middle = max(middle, nearer if at_once else 0.0)
        found = bound_cheaper(plane, middle, by_intervals=by_intervals)
        if found < middle:
            high = middle
        part = 0.5 if found < middle else min(2.0 * part, 0.5)
        if found != middle:
            cheaper = [*cheaper[-1:], (middle, found)]
        plane.raise_tracks()
        incumbent.raise_bound(min(found, middle))
        low = incumbent.bound


def _least_step(plane: PlaneSearch) -> float:
    """By how much a bound must rise for that to be worth the work."""
    return max(2e-5 * plane.incumbent.bound, LEFT * (plane.incumbent.cost - plane.incumbent.bound))


def _meeting(cheaper: list[tuple[float, float]]) -> float:
    """The cost that should equal the bound of all cheaper paths, extrapolated from the last two costs tried, or from
    one with the slope `FALLS`; inf if they allow no extrapolation."""
    if not cheaper:
        return math.inf
    (a, of_a), (b, of_b) = cheaper[0], cheaper[-1]
    slope = (of_b - of_a) / (b - a) if b != a else FALLS
    return (of_b - slope * b) / (1.0 - slope) if slope <= 0.0 else math.inf


def _raise_by_intervals(plane: PlaneSearch) -> None:
    """Raise the lower bound to the greatest cost for which no altitude interval is left, by bisection."""
    incumbent = plane.incumbent
    high = incumbent.cost
    middle = incumbent.bound + _least_step(plane)
    while high - incumbent.bound >= _least_step(plane) and not incumbent.done() and incumbent.budget.goes_on():
        if all(len(leg.intervals(limit).cell) for leg, limit in _limits(plane, longest_track(plane, middle))):
            high = middle
        else:
            incumbent.raise_bound(middle)
        middle = 0.5 * (incumbent.bound + high)


def _limits(plane: PlaneSearch, most_m: float) -> list[tuple[Leg, float]]:
    """The legs, and the greatest length of each one's track if the tracks of all legs together are at most ``most_m``
    long."""
    spare = most_m - sum(leg.lower_m for leg in plane.legs)
    return [(leg, leg.lower_m + spare) for leg in plane.legs]


def bound_cheaper(plane: PlaneSearch, cost: float, *, by_intervals: bool = False) -> float:
    """A lower bound of all paths cheaper than ``cost``: from their tracks on the fine lattice, then their climb;
    ``cost`` or more if there are none. ``by_intervals``: only over cells with altitude intervals that they can enter.
    """
    most_m = longest_track(plane, cost)

    def least(tracks: list[float]) -> float:
        if sum(tracks) >= most_m * (1.0 - 1e-12):
            return cost
        # The legs' bounds leave the length to spare, which is less now that they are better.
        return _least_of_pieces(plane, tracks, max(most_m - sum(tracks), 0.0))

    one = len(plane.legs) == 1
    tracks = []
    for leg, limit in _limits(plane, most_m):
        corridor = leg.corridor(limit)
        if by_intervals:
            intervals = leg.intervals(limit)
            if not len(intervals.cell):
                tracks.append(min(limit, leg.reach_m))
                continue
            corridor = corridor.within(intervals.cells)
        tracks.append(leg.bound(plane.top_m, corridor, limit, True, lambda track: one and least([track]) >= cost))
    return least(tracks)


def longest_track(plane: PlaneSearch, cost: float) -> float:
    """An upper bound of the track length of paths cheaper than ``cost``: climbing leaves less than that for it."""
    legs, incumbent = plane.legs, plane.incumbent
    longest_m = incumbent.longest(sum(leg.reach_m for leg in legs), cost)
    if plane.problem.rates is not None:
        limits = [limit for _, limit in _limits(plane, longest_m)]
        climbed_m = climb_bound(legs, [leg.lower_m for leg in legs], limits)
        # Where the climb alone costs more, no length is left: take the shortest tracks, which nothing undercuts.
        return max(min(longest_m, incumbent.longest(longest_m, cost, climbed_m)), sum(leg.lower_m for leg in legs))
    if len(legs) > 1:
        return longest_m
    climbing = rise_bound(legs, [longest_m], [longest_m]) - longest_m
    for part in CLIMBED:
        shorter = max(longest_m - part * climbing, legs[0].lower_m)
        if rise_bound(legs, [shorter], [longest_m]) >= longest_m:
            return shorter
    return longest_m


def _least_of_pieces(plane: PlaneSearch, tracks_m: list[float], spare_m: float) -> float:
    """A lower bound of the cost of paths whose tracks are longer than ``tracks_m`` by at most ``spare_m`` in all."""
    p, legs = plane.problem, plane.legs
    found = math.inf
    for least, most in _pieces(tracks_m, spare_m):
        if plane.incumbent.least(sum(least)) >= found:
            break  # longer tracks cost no less
        if p.rates is not None:
            piece = p.least_cost(sum(least), climb_bound(legs, least, most))
        else:
            piece = rise_bound(legs, least, most)
        found = min(found, piece)
    return found


def _pieces(tracks_m: list[float], spare_m: float) -> Iterator[tuple[list[float], list[float]]]:
    """Least and greatest track lengths, leg by leg, of `LENGTH_PIECES` pieces of the range from ``tracks_m`` to
    ``spare_m`` more. The less lengths differ, the better it is known where a track is after so many metres. Several
    legs make a single piece, because it is not known how they share ``spare_m``."""
    if len(tracks_m) > 1:
        yield tracks_m, [track + spare_m for track in tracks_m]
        return
    for k in range(LENGTH_PIECES):
        yield [tracks_m[0] + spare_m * k / LENGTH_PIECES], [tracks_m[0] + spare_m * (k + 1) / LENGTH_PIECES]
