"""Paths along the tracks of the lower bounds, past the stretches where the exact check shuts these.

The track of a bound is as short as a track can be. Where the exact check shuts it, the stretch is a few hundred metres
long at most, and metres or centimetres are missing. Beside it there may be an open slit that the cells are too large to
show: the line is searched on which the track crosses a pass that is open by centimetres, and each such stretch is
planned as a problem of its own, so small that its cells are a metre or two wide. If that finds nothing and the gap is
large, the piece between the places where the track leaves and meets the path is searched as a leg of its own, whose
cells are finer than the cells of the whole leg.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.planners.optimal.loop.governor import govern
from gcsplan.planners.optimal.loop.search import FAR, MUCH, OF_REST, Search, Size
from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.plane.corridor import joined
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.plane.leg import Leg
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch
from gcsplan.planners.optimal.searches.cap_search import CapSearch
from gcsplan.planners.optimal.searches.fine_tracks import FineTracks, narrow_passage
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.track import denser
from gcsplan.planners.profile.zone_levels import free_below
from gcsplan.world.geometry.path import Path, distances_m, nearest_on

Point = tuple[float, float, float]

STEP_M = 8.0
"""Metres between the places of a track at which the exact check's floor is read."""
OPEN_M = 8.0
"""Metres that are free below the cap at both ends of a stretch: where there are as many, the slit has ended."""
UNDER_M = 0.5
"""Metres below the highest free altitude at which stretches begin and end, if there is room."""
REACHED = 0.95
"""Part of the climb limit at which the track from or to a terminal is taken to climb."""
ASIDE_M = 0.3
"""Metres by which places are moved away from zones."""
SAME_WAY_M = 1e-3
"""Metres; places nearer to each other count as one."""
STRETCH_SLACKS = (0.008, 0.15)
"""Parts by which tracks of a stretch may be longer than its shortest; tracks that are longer pass through no slit."""
FARTHEST = 1.5
"""Most times as long as the straight track that tracks of a stretch may be."""
BESIDE_M, WORTH = 10.0, 0.03
"""Metres from the path beyond which a track has left it; and the least that a stretch must gain to be planned, as a
part of what the longest useful track is longer than the bound's."""
CLOSE_BY = 3e-3, 3e-2, math.inf
"""Beyond a gap of `FAR`, cells are looked at through which the bound's track is shut: parts by which tracks may be
longer than the bound, in turn."""
NEARLY_ALL = 0.9
"""Part of the counted work left that it may take beyond a gap of `MUCH`."""
SHORTER = 0.7
"""Most of a leg's straight track for a piece to be searched on finer cells."""
MOST_STRETCHES = 24
"""Most stretches of a track; a track with more is not tried."""


DENSE_M, BEFORE_M, MOST_PLACES = 0.5, 15.0, 600
"""Step of a track through a pass, m; how far before and behind the pass it may be moved; and its most places."""
SIDE_M, TRIED, MOST_ASIDE, WITHIN_M = 6.0, 49, 3, 1e-3
"""How far it may be moved aside, m; the places tried for that; how many of them from step to step; and how closely the
lowest floor is found, m."""
STRAIGHT_M = 2e-3
"""Metres by which its places may be left aside where it is straight."""
SPARE_M, DEAR, LITTLE = 0.1, 100.0, 1e-6
"""Metres below the cap at which a floor is low enough; metres aside that a metre lower is worth; and what decides
between floors that are alike."""


class BoundCorridor(Search):
    """If no path is known, and once more when one is. Remembers nothing: a bound's track is the leg's."""

    NAME, IMPROVES, SHARE, ANEW = "bound_corridor", "paths, bounds", 0.2, True
    FIRST_SHARE, FIRST_PASSES, PASSES = 0.5, 4.0, 3.0
    """The share if no path is known; passes over the lattices that it takes then, and else."""

    @property
    def share(self) -> float:
        """By whether a path is known."""
        return self.FIRST_SHARE if self.incumbent.best is None else self.SHARE

    def applies(self) -> bool:
        """Whether there is no maximum AGL."""
        return self.problem.limits.max_agl_m is None

    def size(self) -> Size:
        """Its work is not known before; it gets a part of the rest."""
        return self.work.plane.size(self.FIRST_PASSES if self.incumbent.best is None else self.PASSES)

    def run(self) -> None:
        """Look for a path."""
        incumbent, plane = self.incumbent, self.work.plane
        if not plane.reach_longest():
            return
        if incumbent.best is None:
            follow(plane)
            return
        # Where path and bound are that far apart, a slit is open that nothing else finds.
        with incumbent.budget.allow(NEARLY_ALL if incumbent.gap > MUCH else OF_REST):
            follow(plane)


def follow(plane: PlaneSearch) -> bool:
    """Look for a path along the tracks of the last bounds, where they leave the best path; all along them if no path is
    known. Returns whether one is the best so far."""
    incumbent = plane.incumbent
    if incumbent.best is None:
        return _first(plane)
    terminals = np.flatnonzero(incumbent.pinned).tolist()
    if len(terminals) != len(plane.legs) + 1:
        return False
    if incumbent.gap > FAR and plane.problem.objective == "length":
        for leg in plane.legs:
            _look_closely(plane, leg)
    parts = [incumbent.best[a : b + 1] for a, b in pairwise(terminals)]
    found = [_nearer(plane, leg, part) for leg, part in zip(plane.legs, parts, strict=True)]
    if all(new is None for new in found):
        return False
    paths = [part if new is None else new for part, new in zip(parts, found, strict=True)]
    points, pinned, _ = joined(paths, [None] * (len(paths) - 1))
    return not incumbent.judge.violations(points) and incumbent.take_simpler(points, pinned, fine=True, longer=False)


def _first(plane: PlaneSearch) -> bool:
    """Look for a first path along the bounds' tracks of all legs; return whether one was found and is the best."""
    incumbent, parts = plane.incumbent, []
    before: Floats | None = None
    for leg in plane.legs:
        _look_closely(plane, leg)
        at, s, places = _sampled(leg.last_track)
        start, goal = (_end(plane, leg, end, at[-1]) for end in (0.0, at[-1]))
        part = _along(plane, leg, [start if before is None else before, goal], places, s, at[-1], math.inf)
        if part is None:
            return False
        parts.append(part)
        before = part[-1]
    points, pinned, _ = joined(parts, [None] * (len(parts) - 1))
    return not incumbent.judge.violations(points) and incumbent.take_simpler(points, pinned, fine=True, longer=False)


def _look_closely(plane: PlaneSearch, leg: Leg) -> None:
    """Compute a leg's bound once more, with the cells split through which its track is shut (`necks`): the track that
    is left is nearer to open slits."""
    most_m = min(plane.limit(leg), leg.reach_m)
    for more in CLOSE_BY:
        limit = min(most_m, leg.lower_m * (1.0 + more))
        found = leg.bound(plane.top_m, leg.corridor(limit), limit, True, closely=True)
        plane.raise_tracks()
        if found < limit or limit == most_m or not plane.incumbent.budget.goes_on():
            break


def _end(plane: PlaneSearch, leg: Leg, along_m: float, whole_m: float) -> Floats:
    """(3,) an end of a leg, its start if ``along_m`` is 0; a free altitude comes from `_height`."""
    end = leg.start if along_m <= 0.0 else leg.goal
    if end.amsl_m is not None:
        return np.array([*end.place, end.amsl_m])
    low_m = float(plane.problem.floors(*np.array([end.place]).T)[0])
    return np.array([*end.place, _height(plane, leg, along_m, whole_m - along_m, low_m, plane.path_top_m)])


def _sampled(way: Floats) -> tuple[Floats, Floats, Floats]:
    """Metres along a track to each of its vertices; metres along it (N,) to places at most `STEP_M` apart; the places
    (N, 2)."""
    at = distances_m(way)
    s = np.linspace(0.0, at[-1], math.ceil(at[-1] / STEP_M) + 1)
    return at, s, np.stack([np.interp(s, at, way[:, k]) for k in range(2)], axis=-1)


def _nearer(plane: PlaneSearch, leg: Leg, path: Floats) -> Floats | None:
    """(N, 3) a path of a leg that is cheaper than the known ``path``, which it leaves where the track of the last bound
    does; None if none was found."""
    on_path = distances_m(path)
    at, s, places = _sampled(leg.last_track)
    away, nearest = nearest_on(places, path[:, :2])
    better: list[tuple[float, float, Floats]] = []
    for first, last in _runs(away > BESIDE_M):
        low, high = max(first - 1, 0), min(last + 1, len(s) - 1)
        a, b = nearest[low], nearest[high]
        begun = better[-1][1] if better else 0.0
        if a < begun or (b - a) - (s[high] - s[low]) < WORTH * (plane.longest() - at[-1]):
            continue
        ends = [np.array([np.interp(x, on_path, path[:, k]) for k in range(3)]) for x in (a, b)]
        known = np.vstack([ends[0], path[(on_path > a) & (on_path < b)], ends[1]])
        cost = plane.problem.cost(Path(known))
        part = _along(plane, leg, ends, places[low : high + 1], s[low : high + 1], at[-1], cost)
        if part is None and plane.incumbent.gap > FAR:
            part = _finer(plane, leg, ends, known)
        if part is not None:
            better.append((a, b, part))
    out, begin = [], -math.inf
    for a, b, part in better:
        out += [path[(on_path > begin + SAME_WAY_M) & (on_path < a - SAME_WAY_M)], part]
        begin = b
    return np.vstack([*out, path[on_path > begin + SAME_WAY_M]]) if out else None


def _part(plane: PlaneSearch, problem: Problem, start: Floats, goal: Floats, farthest: float = math.inf) -> Workspace:
    """A workspace of a problem like the plane's, but between two points (3,) on a path; ``farthest``: see `Leg`."""
    part = replace(problem, start=_point(start), goal=_point(goal), via=(), progress=None)
    return Workspace(Incumbent(part, plane.incumbent.sharp, piece=True), farthest)


def _finer(plane: PlaneSearch, leg: Leg, ends: list[Floats], known: Floats) -> Floats | None:
    """(N, 3) way points from one of ``ends`` to the other that cost less than the ``known`` ones, found on the finer
    cells of a shorter leg; None if there are none or the leg is hardly shorter."""
    if math.dist(ends[0][:2], ends[1][:2]) > SHORTER * leg.straight_m:
        return None
    work = _part(plane, plane.problem, ends[0], ends[1])
    work.incumbent.take(known, np.isin(np.arange(len(known)), (0, len(known) - 1)))
    before = work.incumbent.cost
    govern(work.incumbent, [FineTracks(work)])
    return work.incumbent.best if work.incumbent.cost < before else None


def _along(
    plane: PlaneSearch, leg: Leg, ends: list[Floats], places: Floats, s: Floats, whole_m: float, cost: float
) -> Floats | None:
    """(N, 3) way points from one of ``ends`` to the other along a track, past the stretches that are shut; None if that
    fails or does not cost less than ``cost``.

    ``places`` (N, 2) of the track, ``s`` (N,) metres along it; ``whole_m``: its whole length. If zones shut a stretch,
    the stretches that terrain and zones shut are tried before the stretches that terrain alone shuts.
    """
    floor = plane.problem.floors(*places.T)
    free = [(places, floor, np.full_like(floor, plane.path_top_m))]
    moved, low, high = _freer(plane, places)
    if (moved != places).any() or ((low > high) & (floor <= plane.path_top_m)).any():
        free.insert(0, (moved, low, high))
    for at, lowest, highest in free:
        found = _past(plane, leg, ends, at, s, whole_m, lowest, highest)
        if found is not None and plane.problem.cost(Path(found)) < cost:
            return found
        if not plane.incumbent.budget.goes_on():
            break
    return None


def _past(
    plane: PlaneSearch, leg: Leg, ends: list[Floats], places: Floats, s: Floats, whole_m: float, low: Floats,
    high: Floats,
) -> Floats | None:  # fmt: skip
    """`_along` past the stretches that are shut; ``low``, ``high`` (N,): the free altitudes at the places."""
    # An infinite floor is shut (unknown ground), or given (an end), whatever is free below the cap.
    stretches = shut_stretches(np.subtract(low, high, out=low.copy(), where=np.isfinite(low)))
    if len(stretches) > MOST_STRETCHES:
        return None
    cuts = sorted({0, len(s) - 1, *(k for stretch in stretches for k in stretch)})
    out: list[Floats] = []
    start = ends[0]
    for first, last in pairwise(cuts):
        goal = ends[1]
        if last < len(s) - 1:
            height = _height(plane, leg, *map(float, (s[last], whole_m - s[last], low[last], high[last])))
            goal = np.array([*places[last], height])
        work = _part(plane, replace(plane.problem, objective="length"), start, goal, FARTHEST)
        sub, track = work.incumbent, np.vstack([start[:2], places[first + 1 : last], goal[:2]])
        govern(sub, searches_of_stretch(work, track, plane.path_top_m, shut=(first, last) in stretches))
        if sub.best is None or not plane.incumbent.budget.goes_on():
            return None
        out.append(sub.best if not out else sub.best[1:])
        start = goal
    return np.vstack(out)


def searches_of_stretch(work: Workspace, track: Floats, cap_m: float, *, shut: bool) -> list[Search]:
    """The searches of a stretch along a ``track`` (N, 2), which may be ``shut``, below a cap; each while no path of it
    is known."""
    along = [] if shut else [_AlongTrack(work, track)]
    return [*along, CapSearch(work, STRETCH_SLACKS), _OverPass(work, track, cap_m), _Slit(work)]


class _PieceSearch(Search):
    """A search of one stretch, while no path of it is known; in the order of their shares."""

    IMPROVES = "paths"

    def applies(self) -> bool:
        return self.incumbent.best is None

    def size(self) -> Size:
        return 0.0, 0.0


class _AlongTrack(_PieceSearch):
    """The track itself, where it is not shut."""

    NAME, SHARE = "along", 1.0

    def __init__(self, work: Workspace, track: Floats) -> None:
        super().__init__(work)
        self.track = track

    def run(self) -> None:
        self.incumbent.take_along(joined([self.track], []))


class _OverPass(_PieceSearch):
    """The track moved aside to where a pass is lowest."""

    NAME, SHARE = "over_pass", 1e-4

    def __init__(self, work: Workspace, track: Floats, cap_m: float) -> None:
        super().__init__(work)
        self.track, self.cap_m = track, cap_m

    def run(self) -> None:
        self.incumbent.take_along(joined([over_pass(self.problem, self.cap_m, self.track)], []))


class _Slit(_PieceSearch):
    """Tracks over nodes that are only as high as in the exact check."""

    NAME, SHARE = "slit", 1e-5

    def applies(self) -> bool:
        legs = self.work.plane.legs  # none are seen if there was no room for `cap_search`
        return super().applies() and bool(legs) and all(leg.seen for leg in legs)

    def run(self) -> None:
        narrow_passage(self.work.plane)


def _runs(some: Bools) -> list[tuple[int, int]]:
    """First and last index of each run of true values."""
    change = np.flatnonzero(np.diff(np.concatenate([[False], some, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(change[::2], change[1::2], strict=True)]


def _point(place: Floats) -> Point:
    east, north, z = place.tolist()
    return east, north, z


def shut_stretches(over: Floats) -> list[tuple[int, int]]:
    """First and last index of each stretch with less than `OPEN_M` of free altitudes, and somewhere none; ``over``: the
    lowest minus the highest free altitude (N,), inf over unknown ground."""
    runs = [run for run in _runs(over > -OPEN_M) if (over[run[0] : run[1] + 1] > 0.0).any()]
    return [(max(first - 1, 0), min(last + 1, len(over) - 1)) for first, last in runs]


def _freer(plane: PlaneSearch, places: Floats) -> tuple[Floats, Floats, Floats]:
    """The places (N, 2) of a track, moved by `ASIDE_M` where one side of it is shut and the other is free, and the
    result of `free_below` for all but its ends: a bound's track touches zones, and where it does no stretch can begin
    or end."""
    ahead = np.gradient(places, axis=0)
    aside = np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1) / np.maximum(np.hypot(*ahead.T), 1e-9)[:, None]
    tried = [places + off * aside for off in (0.0, ASIDE_M, -ASIDE_M)]
    free = [free_below(plane.problem, at, plane.path_top_m, OPEN_M) for at in tried]
    shut = [low > high for low, high in free]
    side = np.where(shut[1] & ~shut[2], 2, np.where(shut[2] & ~shut[1], 1, 0))
    side[[0, -1]] = 0
    rows = np.arange(len(places))
    low, high = (np.stack([of[k] for of in free])[side, rows] for k in range(2))
    low[[0, -1]] = -math.inf  # the ends of the track give way to the path's ends
    return np.stack(tried)[side, rows], low, high


def _height(plane: PlaneSearch, leg: Leg, from_start_m: float, to_goal_m: float, low_m: float, high_m: float) -> float:
    """The altitude AMSL at which a path passes a place between two stretches: below the highest free altitude by
    `UNDER_M`, or by half the height from the lowest if that is less; no higher than can be reached from start and goal;
    at a terminal, the terminal's."""
    limits = plane.problem.limits
    z = high_m - min(UNDER_M, max(0.5 * (high_m - low_m), 0.0))
    for terminal, way_m, slope in (
        (leg.start, from_start_m, limits.max_climb_slope),
        (leg.goal, to_goal_m, limits.max_descent_slope),
    ):
        if terminal.amsl_m is not None:
            z = terminal.amsl_m if way_m < SAME_WAY_M else min(z, terminal.amsl_m + REACHED * slope * way_m)
    return z


@dataclass(frozen=True, eq=False, slots=True)
class _Strip:
    """The ``places`` (N, 2) of a track over a pass, and the direction ``aside`` (2,) in which they may be moved.

    All of them in one direction: across a bend of the track, they would come apart.
    """

    problem: Problem
    cap_m: float
    places: Floats
    aside: Floats

    def moved(self, by_m: Floats) -> Floats:
        """(N, ..., 2) the places, moved aside by metres (N, ...)."""
        places = self.places.reshape(len(self.places), *(1,) * (by_m.ndim - 1), 2)
        return np.asarray(places + by_m[..., None] * self.aside)

    def over(self, at: Floats) -> Floats:
        """(...) by how many metres the exact check's floor over places (..., 2) exceeds the cap, at least -`SPARE_M`:
        a floor that is low enough need not be lower."""
        floor = self.problem.floors(*at.reshape(-1, 2).T).reshape(at.shape[:-1])
        return np.asarray(np.maximum(floor - self.cap_m, -SPARE_M))


def over_pass(problem: Problem, cap_m: float, track: Floats) -> Floats:
    """A track (N, 2) moved aside where terrain shuts it below ``cap_m``, to where the exact check's floor is low, and
    without jumps. Its ends stay; all of it does where nothing is shut, or too much."""
    import shapely  # most missions need none here

    places = denser(track, DENSE_M)
    shut = np.flatnonzero(problem.floors(*places.T) > cap_m)
    if not len(shut):
        return track
    near = round(BEFORE_M / DENSE_M)
    first, last = max(int(shut[0]) - near, 0), min(int(shut[-1]) + near, len(places) - 1)
    if last - first > MOST_PLACES:
        return track
    aside = (places[last] - places[first])[::-1] * [-1.0, 1.0]
    aside /= max(float(np.hypot(*aside)), 1e-9)
    strip = _Strip(problem, cap_m, places[first : last + 1], aside)
    off = _settled(strip, _chain(strip))
    line = np.vstack([places[:first], strip.moved(off), places[last + 1 :]])
    return np.asarray(shapely.LineString(line).simplify(STRAIGHT_M).coords)


def _chain(strip: _Strip) -> Floats:
    """(N,) metres aside, of `TRIED` places each, with which the sum of floors above the cap is least; by dynamic
    programming."""
    steps = np.linspace(-1.0, 1.0, TRIED)
    at = strip.moved(np.tile(SIDE_M * steps, (len(strip.places), 1)))
    # From each place of a row to the places of the next row that are a few places aside, by way of the middle.
    beside = np.arange(TRIED)[:, None] + np.arange(-MOST_ASIDE, MOST_ASIDE + 1)
    there = beside.clip(0, TRIED - 1)
    ways = strip.over(0.5 * (at[:-1, :, None] + at[1:, there])) + strip.over(at)[1:, there]
    ways = DEAR * ways + 2.0 * SIDE_M / (TRIED - 1) * np.abs(beside - np.arange(TRIED)[:, None])
    ways[:, beside != there] = np.inf
    left, back = np.where(steps == 0.0, 0.0, np.inf), list[Indices]()
    for row in ways[::-1]:  # from the end
        whole = row + left[there]
        back.append(there[np.arange(TRIED), whole.argmin(axis=1)])
        left = whole.min(axis=1)
    chosen = [TRIED // 2]
    for to in reversed(back):
        chosen.append(int(to[chosen[-1]]))
    return np.asarray(SIDE_M * steps[chosen])


def _settled(strip: _Strip, off: Floats) -> Floats:
    """Metres aside (N,) near ``off`` with the lowest floors; 0 at both ends."""
    steps, rows = np.linspace(-1.0, 1.0, TRIED), np.arange(len(off))
    width = 2.0 * SIDE_M / (TRIED - 1)
    while width > WITHIN_M:
        tried = off[:, None] + width * steps
        best = (strip.over(strip.moved(tried)) + LITTLE * np.abs(steps)).argmin(axis=1)
        off = tried[rows, best]
        width *= 4.0 / (TRIED - 1)
    # The line goes on before and behind the pass, so that no leg cuts its corner.
    tight = strip.over(strip.moved(off)) > -SPARE_M
    for step in (1, -1):
        further = np.where(np.roll(tight, step) & ~tight, np.roll(off, step), off)
        off = np.where(strip.over(strip.moved(further)) <= 0.0, further, off)
    off[[0, -1]] = 0.0
    return off
