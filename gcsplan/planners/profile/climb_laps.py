"""Laps: gaining or losing height near a place by legs out and back or by circles, under the exact check.

Where the ground around start or goal rises faster than the climb limit allows, no straight track leads out, and the
vehicle must gain height first: on legs out and back (turn radius 0) or on laps of a polygon around a circle. Laps add
length to a ground track, and length is what a profile lacks that is too steep. `extend` therefore inserts laps into a
track where its profile is too steep, and draws the taut string over the longer track.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.errors import NoMission
from gcsplan.planners.problem import ENDS_M, Problem, Refusal
from gcsplan.planners.profile.exact import LegJudge, Unsettled, sampled_track, settle
from gcsplan.planners.profile.track import Closed, Flown, Lacking, Track, fly, lacking
from gcsplan.planners.simplify import fewer
from gcsplan.world.geometry.path import Path, distances_m

LAP_DIRECTIONS = 12
SHORTEST_LAP_M = 20.0
"""Shortest leg out and back, and smallest circle radius: an autopilot does not follow anything smaller."""
MOST_LAPS = 64
MOST_LAP_CLIMB_M = 1000.0
"""Most metres climbed over one place."""
SIDES = 12
"""Sides of a circle's polygon; an arc of the turn radius fits into each of its corners."""
LAP_ROUNDS = 6
"""Most times that laps are added to one track."""
TRIED, LOOKED_AT, FORGIVEN = 12, 9, 0.1
"""For one piece that is too steep: most laps over which a profile is drawn; points of each lap at which the floor is
read first; and by how much the floor may be too high there, as a part of the missing height."""
GENTLER = (1.0, 0.98, 0.94)
"""Parts of the climb limit that laps are planned with, in turn: with the full limit the exact check may still fail."""
TIGHT, SPARE = (1.0 + 1e-5, 0.0), (1.02, 1.0)
"""Length of laps, as a multiple of the length that the height needs, and metres more: as short as open ground allows,
and what rough ground may need, where there is also more to be drawn together."""
ABOVE_ALL_M = 1e6
"""An altitude above everything."""


def climb_tracks(problem: Problem, place: tuple[float, float], from_amsl: float, to_amsl: float) -> Floats | None:
    """Way points (N, 3) from one altitude over ``place`` to another, up or down, that pass the exact check.

    Uses the fewest laps that fit between floor, ceilings and zones. None if none fit, or if the altitudes are equal.
    """
    if from_amsl == to_amsl:
        return None
    up = to_amsl > from_amsl
    slope = problem.limits.max_climb_slope if up else problem.limits.max_descent_slope
    # With a limit steeper than 45 degrees, or none, laps still climb at 45 degrees.
    length = SPARE[0] * abs(to_amsl - from_amsl) / min(slope, 1.0)
    part = replace(problem, start=(*place, from_amsl), goal=(*place, to_amsl), via=())
    judge = LegJudge(problem)
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


def on_the_spot(problem: Problem) -> Floats:
    """Way points (N, 3) from start to goal where all terminals are at one place; raises Refusal if no laps fit."""
    place, low, high = problem.start[:2], problem.start[2], problem.goal[2]
    found = None if problem.via else climb_tracks(problem, place, low, high)
    if found is None:
        kind, angle = (
            ("climb", problem.limits.max_climb_deg) if high > low else ("descent", problem.limits.max_descent_deg)
        )
        raise Refusal(
            f"no mission: start and goal are one place, {abs(high - low):.1f} m apart in height, and no {kind} in legs "
            f"out and back, or in laps, was found there within max_{kind}_deg {angle:g} and turn_radius_m "
            f"{problem.turn_radius_m:g}: move one of them, or allow more",
            reason="not_found",
            place=place,
        )
    return found


def highest(problem: Problem, place: tuple[float, float], amsl_m: float, *, down: bool = False) -> float:
    """Highest altitude, roughly, to which laps over ``place`` can climb from ``amsl_m``.

    With ``down``: from which they can descend to it. At most `MOST_LAP_CLIMB_M` higher; by bisection to 2 m or 3 %.
    """

    def can(other_m: float) -> bool:
        return climb_tracks(problem, place, *((other_m, amsl_m) if down else (amsl_m, other_m))) is not None

    top = min(float(problem.airspace.ceiling_amsl(*place, problem.limits)), amsl_m + MOST_LAP_CLIMB_M)
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
    """Way points (N, 3) of a path that climbs in laps near the start, or descends near the goal; None if none is found.

    ``ends``: whether to climb over the start, and to descend over the goal. ``plan`` returns way points for a problem
    with raised ends, or raises NoMission.
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
    """Connect a path between raised ends to the true ends; None if neither variant passes the exact check.

    The cheaper of: only as many laps as its track needs, or laps all the way between the raised and the true ends.
    """
    found: list[Floats] = []
    pinned, pin_m = pins_of(problem, points)
    judge = LegJudge(problem)
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
    """Which of the points (N, 2 or more) are start, vias and goal, and the altitudes of the vias (NaN: free)."""
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


def extend(
    problem: Problem, points: Floats, pinned: Bools, pin_m: Floats, length: tuple[float, float] = SPARE
) -> tuple[Track, Flown] | None:
    """Insert laps into a track (N, 2) where its profile is too steep; return track and profile, None if no laps help.

    ``pinned`` (N,) vertices that stay, ``pin_m`` (N,) their altitudes (NaN: free), as in `Track`. ``length``: of a lap,
    see `SPARE`. A track that needs no laps is returned without any.
    """
    track = sampled_track(problem, points, pinned, pin_m)
    lack = lacking(problem, track)
    for _ in range(LAP_ROUNDS):
        if isinstance(lack, Closed):
            return None
        if not lack.steep:
            flown = fly(problem, track)
            return (track, flown) if isinstance(flown, Flown) else None
        better = _lengthened(problem, track, lack, length)
        if better is None:
            return None
        track, lack = better
    return None


def with_laps(
    problem: Problem,
    points: Floats,
    pinned: Bools,
    pin_m: Floats,
    exact: Callable[[Track, Flown], tuple[Floats, Bools] | Unsettled],
) -> list[tuple[Floats, Bools]]:
    """Paths over a track (N, 2) with laps where it is too steep: way points (M, 3), and (M,) whether they must stay.

    ``exact`` makes way points of a track and its profile, or returns the reason of a refusal by the exact check; then
    longer laps are tried. At most two paths; none if no laps help.
    """
    limits = problem.limits
    found = []
    for part in GENTLER:
        climb_deg, descent_deg = part * limits.max_climb_deg, part * limits.max_descent_deg
        gentler = replace(problem, limits=replace(limits, max_climb_deg=climb_deg, max_descent_deg=descent_deg))
        for length in (TIGHT, SPARE) if part == GENTLER[0] else (SPARE,):
            longer = extend(gentler, points, pinned, pin_m, length)
            if longer is not None:
                found.append(exact(*longer))
        if not found or any(not isinstance(path, Unsettled) for path in found):
            break
    return [path for path in found if not isinstance(path, Unsettled)]


def _lengthened(
    problem: Problem, track: Track, lack: Lacking, length: tuple[float, float]
) -> tuple[Track, Lacking] | None:
    """Insert laps along the piece that lacks most height: the first laps that are enough, otherwise the most helpful.

    ``length``: see `extend`. Return the longer track and the height that it still lacks; None if no laps help.
    """
    why, limits = lack.steep[0], problem.limits
    needed = why.by / (limits.max_climb_slope if why.kind == "climb" else limits.max_descent_slope)
    best: tuple[Track, Lacking] | None = None
    for detour in _promising(problem, track, lack, length[0] * needed + length[1]):
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
    """``inner`` (K, 2): points that replace a track's from ``s0_m`` to ``s1_m``; ``shape`` (M, 2): the outline of the
    detour, flown once, with both ends."""

    s0_m: float
    s1_m: float
    inner: Floats
    shape: Floats


def _promising(problem: Problem, track: Track, lack: Lacking, length_m: float) -> list[_Detour]:
    """Detours along the piece that lacks most height: at most `TRIED` that clear all zones, in the order in which their
    floor exceeds a steady climb, least first."""
    why, up = lack.steep[0], lack.steep[0].kind == "climb"
    slope = problem.limits.max_climb_slope if up else problem.limits.max_descent_slope
    low_s, high_s = (why.s0_m, why.s1_m) if up else (why.s1_m, why.s0_m)
    low = float(lack.profile.at(np.array([low_s]))[0])
    found = list(_detours(problem, track, low_s, high_s, length_m))
    shapes = [d.shape if up else d.shape[::-1] for d in found]
    so_far = [distances_m(shape) for shape in shapes]
    along = np.linspace(0.0, [s[-1] for s in so_far], LOOKED_AT, axis=1)
    east, north = (
        np.array([np.interp(at, s, shape[:, k]) for at, s, shape in zip(along, so_far, shapes, strict=True)])
        for k in range(2)
    )
    floor = problem.airspace.floor_amsl(east.ravel(), north.ravel(), problem.limits).reshape(along.shape)
    # Altitude reached by climbing to where the detour begins, or from which the descent after it begins.
    amsl = np.array([low + slope * min(abs(d.s0_m - low_s), abs(d.s1_m - low_s)) for d in found])
    above = (floor - amsl[:, None] - slope * along).max(axis=1) - FORGIVEN * why.by
    fitting = (
        found[k]
        for k in np.argsort(above.clip(0.0), kind="stable")[: 4 * TRIED]
        if np.isfinite(above[k]) and _fits(problem, found[k].shape, float(amsl[k]), float(amsl[k]) + why.by)
    )
    return list(islice(fitting, TRIED))


def _detours(problem: Problem, track: Track, low_s: float, high_s: float, length_m: float) -> Iterator[_Detour]:
    """Yield detours that add ``length_m`` to the piece of a track between ``low_s`` and ``high_s``: bends, then laps.

    ``low_s``, ``high_s``: where the piece is lowest and highest, metres along the track, in either order.
    """
    middle = 0.5 * (low_s + high_s)
    if problem.turn_radius_m <= 0.0:
        for s0, s1 in ((low_s, high_s), (low_s, middle), (middle, high_s)):
            s0, s1 = min(s0, s1), max(s0, s1)
            if track.pinned[(track.s_m > s0 + 1e-3) & (track.s_m < s1 - 1e-3)].any():
                continue
            ends = np.stack([track.place(s0), track.place(s1)])
            chord = ends[1] - ends[0]
            straight = float(np.hypot(*chord))
            if straight < SHORTEST_LAP_M:
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
    """Yield laps out of a place and back to it, fewest first: the points (K, 2) of one lap, and the number of laps.

    Points are relative to the place; the last one, the place itself, is left out. All laps together are ``length_m``
    long. ``heading``: direction of the track there (radians from east, anticlockwise); laps to its sides come first.
    """
    radius = problem.turn_radius_m
    turns = [2.0 * math.pi * k / LAP_DIRECTIONS for k in range(LAP_DIRECTIONS)]
    if heading is not None:
        # Sideways first: a lap along the track would make it turn back on itself.
        turns = [heading + 0.5 * math.pi + t for t in turns]
    least = max(1.02 * radius / math.cos(math.pi / SIDES), SHORTEST_LAP_M)
    count = 1
    while count <= MOST_LAPS:
        one = length_m / count
        side = one / (2.0 * SIDES * math.sin(math.pi / SIDES))
        if radius <= 0.0 and (one >= 2.0 * SHORTEST_LAP_M or count == 1):
            for turn in turns:
                yield max(0.5 * one, SHORTEST_LAP_M) * np.array([[math.cos(turn), math.sin(turn)]]), count
        elif radius > 0.0 and (side >= least or count == 1):
            for turn in turns:
                for sense in (1.0, -1.0):
                    yield _circle(max(side, least), turn, sense), count
        if one < 2.0 * SHORTEST_LAP_M or (radius > 0.0 and side < least):
            break
        count = count + 1 if count < 4 else 2 * count


def wound(one: Floats, count: int) -> Floats:
    """Repeat one lap ``count`` times, with the place itself (the origin) between laps."""
    return np.vstack([one, *([np.zeros((1, 2)), one] * (count - 1))])


def _circle(radius_m: float, turn: float, sense: float) -> Floats:
    """A polygon through the origin, its centre in direction ``turn``; ``sense``: 1 anticlockwise, -1 clockwise."""
    angles = turn + math.pi + sense * 2.0 * math.pi / SIDES * np.arange(1, SIDES)
    middle = np.array([math.cos(turn), math.sin(turn)])
    return np.asarray(radius_m * (middle + np.stack([np.cos(angles), np.sin(angles)], axis=-1)))


def _fits(problem: Problem, shape: Floats, low_m: float = -ABOVE_ALL_M, high_m: float = ABOVE_ALL_M) -> bool:
    """False if ground closes a track (N, 2) at all altitudes, or a zone closes it from ``low_m`` to ``high_m``."""
    tube = problem.airspace.tube(shape, problem.limits)
    if not (tube.floor_m <= tube.ceiling_m + 2.0 * ENDS_M).all():
        return False
    return not any(((b.bottom_m < low_m) & (b.top_m > high_m)).any() for b in tube.bands)


def _heading(track: Track, s_m: float) -> float:
    """Direction of the leg that leaves a place (radians from east); at the track's end, of the leg that arrives."""
    i = min(max(int(np.searchsorted(track.s_m, s_m + 1e-6, "right")) - 1, 0), len(track.points) - 2)
    d = track.points[i + 1] - track.points[i]
    return math.atan2(d[1], d[0])


def _with_detour(problem: Problem, track: Track, detour: _Detour) -> Track:
    """Insert a detour into a track."""
    before, after = track.s_m < detour.s0_m - 1e-3, track.s_m > detour.s1_m + 1e-3
    at = np.flatnonzero(~before & ~after)
    inner = detour.inner
    pins, heights = np.zeros(len(inner), bool), np.full(len(inner), np.nan)
    for k in at[track.pinned[at]]:  # a pinned vertex moves to the nearer end of the detour; the goal to its last point
        last = track.s_m[k] - detour.s0_m > detour.s1_m - track.s_m[k] or k == len(track.points) - 1
        pins[-int(last)], heights[-int(last)] = True, track.pin_m[k]
    return sampled_track(
        problem,
        np.vstack([track.points[before], inner, track.points[after]]),
        np.concatenate([track.pinned[before], pins, track.pinned[after]]),
        np.concatenate([track.pin_m[before], heights, track.pin_m[after]]),
    )
