"""Gaining or losing height near a place: straight there and back, or round and round, under the exact check.

Where the ground around start or goal rises faster than the climb limit allows, no straight way out exists, and the
height is won first: by legs out and back again (turn radius 0) or by laps of a circle's polygon. Laps add length to a
ground track, and length is all that a taut string lacks that is too steep; so `extend` puts them into a track where its
profile fails, as long as it takes, and leaves the rest to the string.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.errors import NoMission
from gcsplan.planners.problem import ENDS_M, Problem
from gcsplan.planners.profile.exact import Judge, Unsettled, sampled_track, settle
from gcsplan.planners.profile.track import Closed, Flown, Lacking, Track, distances, fly, lacking
from gcsplan.planners.simplify import fewer
from gcsplan.world.path import Path

DIRECTIONS = 12
SHORTEST_M = 20.0
"""No leg out and back is shorter, and no circle smaller: an autopilot flies it as a blur."""
MOST_LAPS = 64
HIGHEST_M = 1000.0
"""Nobody climbs over one place by more."""
SIDES = 12
"""Of a circle's polygon; an arc of the turn radius fits into each of its corners."""
ROUNDS = 6
"""Laps are added to one track so often."""
TRIED, LOOKED_AT, FORGIVEN = 12, 9, 0.1
"""Laps that a profile is drawn over, for one place that is too steep; points of each at which the ground is looked at
before; and how much the ground may be too high there, as a part of what is to be climbed."""
GENTLER = (1.0, 0.98, 0.94)
"""What part of the climb limit laps make use of: a profile that just holds may not hold over every metre of ground."""
FAR_M = 1e6
"""Higher than everything."""
SPARE = 1.02
"""Length beyond what the height takes."""


def climb_tracks(problem: Problem, place: tuple[float, float], from_amsl: float, to_amsl: float) -> Floats | None:
    """(N, 3) way points from one altitude over ``place`` to another, up or down, that the exact check passes.

    The fewest laps that fit between floor, ceilings and zones; None where none were found.
    """
    if from_amsl == to_amsl:
        return None
    up = to_amsl > from_amsl
    slope = problem.limits.max_climb_slope if up else problem.limits.max_descent_slope
    # Without a limit anything but straight up will do.
    length = SPARE * abs(to_amsl - from_amsl) / min(slope, 1.0)
    part = replace(problem, start=(*place, from_amsl), goal=(*place, to_amsl), via=())
    judge = Judge(problem)
    for one, count in laps(problem, length, None):
        if not _fits(problem, np.vstack([place, np.asarray(place) + one, place])):
            continue
        points = np.vstack([place, np.asarray(place) + wound(one, count), place])
        pinned = np.zeros(len(points), bool)
        pinned[[0, -1]] = True
        found = settle(part, judge, points, pinned, np.full(len(points), np.nan))
        if not isinstance(found, Unsettled):
            return fewer(part, *found, 0.0)[0]
    return None


def highest(problem: Problem, place: tuple[float, float], amsl_m: float, *, down: bool = False) -> float:
    """About how high one can climb over ``place`` from ``amsl_m`` (``down``: descend to it), `HIGHEST_M` at most."""

    def can(other_m: float) -> bool:
        return climb_tracks(problem, place, *((other_m, amsl_m) if down else (amsl_m, other_m))) is not None

    top = min(float(problem.airspace.ceiling_amsl(*place, problem.limits)), amsl_m + HIGHEST_M)
    if top <= amsl_m + 1.0:
        return amsl_m
    if can(top):
        return top
    low, high = amsl_m, top
    while high - low > max(2.0, 0.03 * (top - amsl_m)):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if can(middle) else (low, middle)
    return low


def with_climbs(problem: Problem, ends: tuple[bool, bool], plan: Callable[[Problem], Floats]) -> Floats | None:
    """(N, 3) way points that climb near the start, or come down near the goal, as high as need be; None if none do.

    ``ends``: whether to climb over the start, and to come down over the goal. ``plan`` gives the way points of a
    problem whose ends are higher, or raises NoMission.
    """
    start, goal = problem.start, problem.goal
    z0 = highest(problem, start[:2], start[2]) if ends[0] else start[2]
    z1 = highest(problem, goal[:2], goal[2], down=True) if ends[1] else goal[2]
    if z0 <= start[2] and z1 <= goal[2]:
        return None
    try:
        points = plan(replace(problem, start=(*start[:2], z0), goal=(*goal[:2], z1)))
    except NoMission:
        return None
    return _lowered(problem, points)


def _lowered(problem: Problem, points: Floats) -> Floats | None:
    """A path between raised ends, led down to the true ones: with as few laps as its track needs, or else all."""
    found: list[Floats] = []
    pinned, pin_m = pins_of(problem, points)
    judge = Judge(problem)
    extended = extend(problem, np.ascontiguousarray(points[:, :2]), pinned, pin_m)
    if extended is not None:
        track = extended[0]
        settled = settle(problem, judge, track.points, track.pinned, track.pin_m)
        if not isinstance(settled, Unsettled):
            found.append(fewer(problem, *settled, 0.0)[0])
    whole: list[Floats | None] = [points]
    if points[0, 2] > problem.start[2]:
        whole.insert(0, climb_tracks(problem, problem.start[:2], problem.start[2], float(points[0, 2])))
    if points[-1, 2] > problem.goal[2]:
        whole.append(climb_tracks(problem, problem.goal[:2], float(points[-1, 2]), problem.goal[2]))
    parts = [p for p in whole if p is not None]
    if len(parts) == len(whole):
        joined = np.vstack([parts[0], *(p[1:] for p in parts[1:])])
        if not judge.violations(joined):
            found.append(joined)
    return min(found, key=lambda p: problem.cost(Path(p)), default=None)


def pins_of(problem: Problem, points: Floats) -> tuple[Bools, Floats]:
    """Which of the points (N, 2 or more) are start, vias and goal, and the altitudes of the vias (NaN free)."""
    pinned, pin_m = np.zeros(len(points), bool), np.full(len(points), np.nan)
    pinned[[0, -1]] = True
    last = 0
    for via in problem.via:
        off = np.hypot(points[last + 1 : -1, 0] - via.east_m, points[last + 1 : -1, 1] - via.north_m)
        if len(off) and off.min() < 1e-3:
            last += 1 + int(np.argmin(off))
            pinned[last] = True
            pin_m[last] = math.nan if via.amsl_m is None else via.amsl_m
    return pinned, pin_m


def extend(problem: Problem, points: Floats, pinned: Bools, pin_m: Floats) -> tuple[Track, Flown] | None:
    """The track (N, 2) with laps put in where its profile would be too steep, and that profile; None where none help.

    ``pinned`` (N,) vertices that stay, ``pin_m`` (N,) their altitudes (NaN free), as in `Track`. A track that needs no
    laps comes back as it is.
    """
    track = sampled_track(problem, points, pinned, pin_m)
    lack = lacking(problem, track)
    for _ in range(ROUNDS):
        if isinstance(lack, Closed):
            return None
        if not lack.steep:
            flown = fly(problem, track)
            return (track, flown) if isinstance(flown, Flown) else None
        better = _lengthened(problem, track, lack)
        if better is None:
            return None
        track, lack = better
    return None


def with_laps(
    problem: Problem,
    points: Floats,
    pinned: Bools,
    pin_m: Floats,
    exact: Callable[[Track, Flown], tuple[Floats, Bools] | None],
) -> tuple[Floats, Bools] | None:
    """(M, 3) way points over a track (N, 2) with laps where it is too steep, and (M,) which of them must stay.

    Some more laps where the ``exact`` check, which makes way points of a track and its profile, asks for it.
    """
    limits = problem.limits
    for part in GENTLER:
        gentler = replace(
            limits, max_climb_deg=part * limits.max_climb_deg, max_descent_deg=part * limits.max_descent_deg
        )
        longer = extend(replace(problem, limits=gentler), points, pinned, pin_m)
        if longer is None:
            return None
        found = exact(*longer)
        if found is not None:
            return found
    return None


def climb_needed_deg(problem: Problem, track: Track) -> float | None:
    """The climb (or descent) angle with which a track would hold, to a tenth of a degree; None where no angle helps."""
    low = min(problem.limits.max_climb_deg, problem.limits.max_descent_deg)

    def holds(angle: float) -> bool:
        limits = replace(
            problem.limits,
            max_climb_deg=max(problem.limits.max_climb_deg, angle),
            max_descent_deg=max(problem.limits.max_descent_deg, angle),
        )
        return isinstance(fly(replace(problem, limits=limits), track), Flown)

    high = 89.9
    if not holds(high):
        return None
    while high - low > 0.1:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return math.ceil(10.0 * high - 1e-9) / 10.0


def _lengthened(problem: Problem, track: Track, lack: Lacking) -> tuple[Track, Lacking] | None:
    """The track with laps somewhere along its steepest piece: all that it takes, or else those that help most."""
    why, limits = lack.steep[0], problem.limits
    needed = why.by / (limits.max_climb_slope if why.kind == "climb" else limits.max_descent_slope)
    best: tuple[Track, Lacking] | None = None
    for detour in _promising(problem, track, lack, SPARE * needed + 1.0):
        tried = _with_detour(problem, track, detour)
        left = lacking(problem, tried)
        if isinstance(left, Closed):
            continue
        if left.laps_m <= lack.laps_m - 0.8 * needed:
            return tried, left
        if left.laps_m < (lack.laps_m - 0.1 * needed if best is None else best[1].laps_m):
            best = tried, left
    return best


@dataclass(frozen=True, eq=False, slots=True)
class _Detour:
    """``inner`` (K, 2) points to be flown instead of a track's from ``s0_m`` to ``s1_m``; ``shape`` (M, 2) what they
    look like, with both ends, if all of it is flown once."""

    s0_m: float
    s1_m: float
    inner: Floats
    shape: Floats


def _promising(problem: Problem, track: Track, lack: Lacking, length_m: float) -> list[_Detour]:
    """Ways to lengthen a track along its steepest piece: at most `TRIED`, that rise least, of those that zones leave
    room for."""
    why, up = lack.steep[0], lack.steep[0].kind == "climb"
    slope = problem.limits.max_climb_slope if up else problem.limits.max_descent_slope
    low_s, high_s = (why.s0_m, why.s1_m) if up else (why.s1_m, why.s0_m)
    low = float(lack.profile.at(np.array([low_s]))[0])
    found = list(_detours(problem, track, low_s, high_s, length_m))
    shapes = [d.shape if up else d.shape[::-1] for d in found]
    part = np.linspace(0.0, 1.0, LOOKED_AT)
    along = np.array([part * distances(shape)[-1] for shape in shapes])
    east, north = (
        np.array([np.interp(at, distances(way), way[:, k]) for at, way in zip(along, shapes, strict=True)])
        for k in range(2)
    )
    floor = problem.airspace.floor_amsl(east.ravel(), north.ravel(), problem.limits).reshape(along.shape)
    # As high as one has climbed to there, or must come down from.
    amsl = np.array([low + slope * min(abs(d.s0_m - low_s), abs(d.s1_m - low_s)) for d in found])
    above = (floor - amsl[:, None] - slope * along).max(axis=1) - FORGIVEN * why.by
    out: list[_Detour] = []
    for k in np.argsort(above.clip(0.0), kind="stable")[: 4 * TRIED]:
        high = float(amsl[k]) + why.by
        if np.isfinite(above[k]) and _fits(problem, found[k].shape, float(amsl[k]), high):
            out.append(found[k])
            if len(out) == TRIED:
                break
    return out


def _detours(problem: Problem, track: Track, low_s: float, high_s: float, length_m: float) -> Iterator[_Detour]:
    """Ways to make a piece of a track, that climbs (or comes down) to ``high_s``, longer: bends, then laps."""
    middle = 0.5 * (low_s + high_s)
    if problem.turn_radius_m <= 0.0:
        for s0, s1 in ((low_s, high_s), (low_s, middle), (middle, high_s)):
            s0, s1 = min(s0, s1), max(s0, s1)
            if track.pinned[(track.s_m > s0 + 1e-3) & (track.s_m < s1 - 1e-3)].any():
                continue
            ends = np.stack([track.place(s0), track.place(s1)])
            chord = ends[1] - ends[0]
            straight = float(np.hypot(*chord))
            if straight < SHORTEST_M:
                continue
            aside = 0.5 * math.sqrt((s1 - s0 + length_m) ** 2 - straight**2) / straight
            for side in (1.0, -1.0):
                tip = ends.mean(axis=0) + side * aside * np.array([-chord[1], chord[0]])
                shape = np.stack([ends[0], tip, ends[1]])
                yield _Detour(s0, s1, shape, shape)
    for s in (low_s, high_s, middle):
        place = track.place(s)
        for one, count in laps(problem, length_m, _heading(track, s)):
            inner = np.vstack([place, place + wound(one, count), place])
            yield _Detour(s, s, inner, np.vstack([place, place + one, place]))


def laps(problem: Problem, length_m: float, heading: float | None) -> Iterator[tuple[Floats, int]]:
    """Ways out of a place and back to it, fewest legs first: (K, 2) points of one from the place, and how many of them.

    Together they are ``length_m`` long. The last point, the place itself, is left out. ``heading`` (radians from east,
    anticlockwise) is how the track goes on; laps to its sides come first.
    """
    radius = problem.turn_radius_m
    turns = [2.0 * math.pi * k / DIRECTIONS for k in range(DIRECTIONS)]
    if heading is not None:
        # Out to the sides first: a track that comes back on itself would have to turn on the spot.
        turns = [heading + 0.5 * math.pi + t for t in turns]
    least = max(1.02 * radius / math.cos(math.pi / SIDES), SHORTEST_M)
    count = 1
    while count <= MOST_LAPS:
        one = length_m / count
        side = one / (2.0 * SIDES * math.sin(math.pi / SIDES))
        if radius <= 0.0 and (one >= 2.0 * SHORTEST_M or count == 1):
            for turn in turns:
                yield max(0.5 * one, SHORTEST_M) * np.array([[math.cos(turn), math.sin(turn)]]), count
        elif radius > 0.0 and (side >= least or count == 1):
            for turn in turns:
                for sense in (1.0, -1.0):
                    yield _circle(max(side, least), turn, sense), count
        if one < 2.0 * SHORTEST_M or (radius > 0.0 and side < least):
            break
        count = count + 1 if count < 4 else 2 * count


def wound(one: Floats, count: int) -> Floats:
    """One lap ``count`` times, through the place in between, which is the origin."""
    return np.vstack([one, *([np.zeros((1, 2)), one] * (count - 1))])


def _circle(radius_m: float, turn: float, sense: float) -> Floats:
    """A polygon through the place, its middle in direction ``turn``, anticlockwise or the other way."""
    angles = turn + math.pi + sense * 2.0 * math.pi / SIDES * np.arange(1, SIDES)
    middle = np.array([math.cos(turn), math.sin(turn)])
    return np.asarray(radius_m * (middle + np.stack([np.cos(angles), np.sin(angles)], axis=-1)))


def _fits(problem: Problem, shape: Floats, low_m: float = -FAR_M, high_m: float = FAR_M) -> bool:
    """False where a way (N, 2) meets a zone, or ground, past which there is none, at any altitude or between two."""
    tube = problem.airspace.tube(shape, problem.limits)
    if not (tube.floor_m <= tube.ceiling_m + 2.0 * ENDS_M).all():
        return False
    return not any(((b.bottom_m < low_m) & (b.top_m > high_m)).any() for b in tube.bands)


def _heading(track: Track, s_m: float) -> float:
    """How the track goes on from a place, or how it came where it ends."""
    i = min(max(int(np.searchsorted(track.s_m, s_m + 1e-6, "right")) - 1, 0), len(track.points) - 2)
    d = track.points[i + 1] - track.points[i]
    return math.atan2(d[1], d[0])


def _with_detour(problem: Problem, track: Track, detour: _Detour) -> Track:
    """The track with a detour put in."""
    before, after = track.s_m < detour.s0_m - 1e-3, track.s_m > detour.s1_m + 1e-3
    at = np.flatnonzero(~before & ~after)
    inner = detour.inner
    pins, heights = np.zeros(len(inner), bool), np.full(len(inner), np.nan)
    for k in at[track.pinned[at]]:  # a place that stays is one end or the other; the goal comes last
        last = track.s_m[k] - detour.s0_m > detour.s1_m - track.s_m[k] or not after.any()
        pins[-int(last)], heights[-int(last)] = True, track.pin_m[k]
    return sampled_track(
        problem,
        np.vstack([track.points[before], inner, track.points[after]]),
        np.concatenate([track.pinned[before], pins, track.pinned[after]]),
        np.concatenate([track.pin_m[before], heights, track.pin_m[after]]),
    )
