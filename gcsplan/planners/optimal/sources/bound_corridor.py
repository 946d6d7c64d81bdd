"""Paths along the ways of bounds, past what is shut there by little.

The way of a bound is as short as a way can be. Where the exact check shuts it, it does so for a few hundred metres at
most, for metres or centimetres: beside it, between cells too large to show it, there may be a slit that is open. Each
such stretch is a problem of its own, so small that its cells are a metre or two wide.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.corridor import joined
from gcsplan.planners.optimal.incumbent import Incumbent
from gcsplan.planners.optimal.leg import Leg
from gcsplan.planners.optimal.plane_search import PlaneSearch
from gcsplan.planners.profile.track import distances
from gcsplan.world.path import Path

Point = tuple[float, float, float]

STEP_M = 8.0
"""Between places of a way at which the exact check is asked."""
OPEN_M = 8.0
"""Over the floor at both ends of a stretch: there the slit is over."""
UNDER_M = 0.5
"""How far below the cap stretches begin and end."""
REACHED = 0.95
"""What part of the way from or to a terminal is climbed on."""
APART_M = 1e-3
"""Places nearer to each other are one."""
SLACKS = (0.008, 0.15)
"""How much longer than the shortest tracks of a stretch are, as a part; longer ones are no slits."""
FARTHEST = 1.5
"""How many times as long as the straight way tracks may be that are looked for between two places."""
BESIDE_M, WORTH = 10.0, 0.03
"""How far from a path a way has left it; and what part of what both differ in must be gained there for a look."""
MOST = 24
"""Stretches of a way, of which more are not looked at."""
AT_ONCE = 512
"""Places whose distance from a track is worked out at once."""


def follow(plane: PlaneSearch) -> bool:
    """Where the ways of the last bounds leave the best path, or all along them where none is known, look for a path;
    True if one is the best so far."""
    incumbent = plane.incumbent
    if incumbent.best is None:
        return _first(plane)
    terminals = [0, len(incumbent.best) - 1] if incumbent.pinned is None else np.flatnonzero(incumbent.pinned).tolist()
    if len(terminals) != len(plane.legs) + 1:
        return False
    parts = [incumbent.best[a : b + 1] for a, b in pairwise(terminals)]
    found = [_nearer(plane, leg, part) for leg, part in zip(plane.legs, parts, strict=True)]
    if all(new is None for new in found):
        return False
    paths = [part if new is None else new for part, new in zip(parts, found, strict=True)]
    points, pinned, _ = joined(paths, [None] * (len(paths) - 1))
    return not incumbent.judge.violations(points) and incumbent.take_simpler(points, pinned, fine=True, longer=False)


def _first(plane: PlaneSearch) -> bool:
    """Look for a first path along the ways of all legs."""
    incumbent, parts = plane.incumbent, []
    before: Floats | None = None
    for leg in plane.legs:
        leg.bound(plane.top_m, leg.corridor(leg.reach_m), leg.reach_m)  # whose way is nearer to what is open
        at, s, places = _sampled(leg.last_track)
        start, goal = (_end(plane, leg, end, at[-1]) for end in (0.0, at[-1]))
        part = _along(plane, leg, [start if before is None else before, goal], places, s, at[-1])
        if part is None:
            return False
        parts.append(part)
        before = part[-1]
    points, pinned, _ = joined(parts, [None] * (len(parts) - 1))
    return not incumbent.judge.violations(points) and incumbent.take_simpler(points, pinned, fine=True, longer=False)


def _end(plane: PlaneSearch, leg: Leg, along_m: float, whole_m: float) -> Floats:
    """(3,) an end of a leg; where its height is free, as high as `_height` says."""
    end = leg.start if along_m <= 0.0 else leg.goal
    if end.amsl_m is not None:
        return np.array([*end.place, end.amsl_m])
    over_m = float(plane.problem.floors(*np.array([end.place]).T)[0]) - plane.top_m
    return np.array([*end.place, _height(plane, leg, along_m, whole_m - along_m, over_m)])


def _sampled(way: Floats) -> tuple[Floats, Floats, Floats]:
    """Metres along a way of its vertices, and of places `STEP_M` apart, and those places (N, 2)."""
    at = distances(way)
    s = np.linspace(0.0, at[-1], math.ceil(at[-1] / STEP_M) + 1)
    return at, s, np.stack([np.interp(s, at, way[:, k]) for k in range(2)], axis=-1)


def _nearer(plane: PlaneSearch, leg: Leg, path: Floats) -> Floats | None:
    """(N, 3) a cheaper path of a leg than a known one, which it leaves where the way of the last bound does; None where
    none was found."""
    on_path = distances(path[:, :2])
    at, s, places = _sampled(leg.last_track)
    away, nearest = _nearest(places, path[:, :2])
    better: list[tuple[float, float, Floats]] = []
    for first, last in _runs(away > BESIDE_M):
        low, high = max(first - 1, 0), min(last + 1, len(s) - 1)
        a, b = nearest[low], nearest[high]
        begun = better[-1][1] if better else 0.0
        if a < begun or (b - a) - (s[high] - s[low]) < WORTH * (plane.longest() - at[-1]):
            continue
        ends = [np.array([np.interp(x, on_path, path[:, k]) for k in range(3)]) for x in (a, b)]
        part = _along(plane, leg, ends, places[low : high + 1], s[low : high + 1], at[-1])
        known = np.vstack([ends[0], path[(on_path > a) & (on_path < b)], ends[1]])
        if part is not None and plane.problem.cost(Path(part)) < plane.problem.cost(Path(known)):
            better.append((a, b, part))
    out, begin = [], -math.inf
    for a, b, part in better:
        out += [path[(on_path > begin + APART_M) & (on_path < a - APART_M)], part]
        begin = b
    return np.vstack([*out, path[on_path > begin + APART_M]]) if out else None


def _along(
    plane: PlaneSearch, leg: Leg, ends: list[Floats], places: Floats, s: Floats, whole_m: float
) -> Floats | None:
    """(N, 3) way points from one end to the other along a way, led past what is shut on it; None where that fails.

    ``places`` (N, 2) of the way, ``s`` (N,) how far along it they are; ``whole_m`` how long all of it is.
    """
    over = plane.problem.floors(places[:, 0], places[:, 1]) - plane.top_m
    stretches = _stretches(over)
    if len(stretches) > MOST:
        return None
    cuts = sorted({0, len(s) - 1, *(k for stretch in stretches for k in stretch)})
    out: list[Floats] = []
    start = ends[0]
    for first, last in pairwise(cuts):
        goal = ends[1]
        if last < len(s) - 1:
            height = _height(plane, leg, *map(float, (s[last], whole_m - s[last], over[last])))
            goal = np.array([*places[last], height])
        part = replace(plane.problem, start=_point(start), goal=_point(goal), via=(), progress=None, objective="length")
        sub = Incumbent(part)
        sub.first_s = 0.0  # a path for a piece is not the mission's first, with which the budget begins
        found = PlaneSearch(sub)
        for piece in found.legs:
            piece.farthest = FARTHEST
        if (first, last) not in stretches:
            sub.take_along(joined([np.vstack([start[:2], places[first + 1 : last], goal[:2]])], []))
        if sub.best is None:
            for _ in found.first_looks(SLACKS):
                pass
        if sub.best is None and not sub.proved_infeasible and found.legs:
            found.narrow_passage()
        if sub.best is None or not plane.incumbent.budget.goes_on():
            return None
        out.append(sub.best if not out else sub.best[1:])
        start = goal
    return np.vstack(out)


def _nearest(places: Floats, track: Floats) -> tuple[Floats, Floats]:
    """(N,) how far places are from a track, and where on it that is, in metres along it."""
    a, d, s = track[:-1], np.diff(track, axis=0), distances(track)
    away, where = np.empty(len(places)), np.empty(len(places))
    for first in range(0, len(places), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        t = ((places[part, None] - a) * d).sum(axis=-1) / np.maximum((d * d).sum(axis=-1), 1e-12)
        t = t.clip(0.0, 1.0)
        off = np.hypot(*(places[part, None] - a - t[..., None] * d).transpose(2, 0, 1))
        k = off.argmin(axis=1)
        rows = np.arange(len(k))
        away[part], where[part] = off[rows, k], s[k] + t[rows, k] * (s[k + 1] - s[k])
    return away, where


def _runs(some: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last of what is true, run by run."""
    change = np.flatnonzero(np.diff(np.concatenate([[False], some, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(change[::2], change[1::2], strict=True)]


def _point(place: Floats) -> Point:
    east, north, z = place.tolist()
    return east, north, z


def _stretches(over: Floats) -> list[tuple[int, int]]:
    """First and last of places, between which there is less room than `ROOM_M`, and somewhere none."""
    out: list[tuple[int, int]] = []
    tight = over > -OPEN_M
    for k in np.flatnonzero(over > 0.0).tolist():
        if out and k <= out[-1][1]:
            continue
        before, after = np.flatnonzero(~tight[:k]), np.flatnonzero(~tight[k:])
        out.append((int(before[-1]) if len(before) else 0, k + int(after[0]) if len(after) else len(over) - 1))
    return out


def _height(plane: PlaneSearch, leg: Leg, from_start_m: float, to_goal_m: float, over_m: float) -> float:
    """How high a path goes on at a place: below the cap by half of what there is to spare, or less; that of the goal
    there; and what can be reached from start and goal."""
    limits = plane.problem.limits
    z = plane.top_m - min(UNDER_M, max(-0.5 * over_m, 0.0))
    for terminal, way_m, slope in (
        (leg.start, from_start_m, limits.max_climb_slope),
        (leg.goal, to_goal_m, limits.max_descent_slope),
    ):
        if terminal.amsl_m is not None:
            z = terminal.amsl_m if way_m < APART_M else min(z, terminal.amsl_m + REACHED * slope * way_m)
    return z
