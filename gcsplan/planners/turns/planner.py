"""Paths for fixed wings: a path with sharp corners becomes legs and arcs of the turn radius, legal as flown.

A fixed wing does not pass its way points: it begins to turn before each and flies an arc that is tangent to both legs.
A shortest path has corners where it touches obstacles, so the arcs must pass there: the track becomes an arc path
around discs (`arc_path`) that touch the corners from the obstacle's side, and the way points move outwards. The track
is checked as flown, with arcs as chords, widened by how far the arc lies outside them. Its altitude profile is drawn
anew (`turns.profile`), and discs are moved where ground or zones are in the way (`turns.repair`).

- A via is passed exactly: it lies on its arc and is a way point there, between the two that make the arc. At a slight
  turn the arc has one way point, just outside of the via, and the via is the middle of the arc.
- Start and goal have no heading of their own.
- No lower bound is computed here; the bound of the path with corners holds for every path with arcs too.

The arc of a pinned disc passes its pin in the middle. Between pins less than some 1.4 radii apart, or between a pin and
an end that lies in its disc, there is no such arc path. With a free disc between them, which is flown around in a loop,
there is: `with_loops` adds such discs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.planners.airspeed import Airspeed
from gcsplan.planners.problem import Problem, Refusal, ceiling_m
from gcsplan.planners.simplify import thinned
from gcsplan.planners.turns.arc_path import ArcPath, inserted, lacking_m, missed_m, through, unlooped
from gcsplan.planners.turns.profile import Risen, rise
from gcsplan.planners.turns.repair import Patience, Tried, cost_of, mended, polished
from gcsplan.world.geometry.path import Path, distances_m

WAYS, RUNS = 12, (0.0, 0.75, 2.0, 4.0)
"""Headings at which a loop leaves its pin or arrives there, and how far from it, in turn radii."""

RUNS_AT_ENDS = (2.0, 4.0)
"""Likewise at start and goal, where a turn from another heading or to another one may have to fit."""

SPARE_M = 1e-6
"""Metres that turns to different sides must leave between them: discs that just touch may overlap by rounding."""


def with_loops(arc_path: ArcPath) -> ArcPath:
    """``arc_path`` with free discs beside pins where legs are too short; the same if there are none, or none helps."""
    for _ in range(len(arc_path.sense) + 1 if arc_path.pinned.any() else 0):
        short = _short_legs(arc_path)
        for leg in short:
            found = min(_loops(arc_path, leg), key=_badness, default=arc_path)
            if _badness(found)[0] < len(short):
                arc_path = found
                break
        else:
            return arc_path
    return arc_path


def _short_legs(arc_path: ArcPath) -> list[int]:
    """Legs that are too short; if there are none, legs at a pinned disc whose arc does not reach its pin; in order."""
    bad = lacking_m(arc_path) > -SPARE_M
    if not bad.any():
        missed = np.concatenate([[0.0], missed_m(arc_path), [0.0]])
        bad = (missed[:-1] > 0.0) | (missed[1:] > 0.0)
    return [int(k) for k in np.flatnonzero(bad)]


def _badness(arc_path: ArcPath) -> tuple[int, float]:
    """The number of legs that are too short, and the length of the path, m."""
    way = np.vstack([arc_path.ends[:1], arc_path.centre, arc_path.ends[1:]])
    side = np.concatenate([[0.0], arc_path.sense, [0.0]])
    apart = np.hypot(*np.diff(way, axis=0).T)
    legs = np.sqrt(np.maximum(apart**2 - (np.diff(side) * arc_path.radius_m) ** 2, 0.0))
    return len(_short_legs(arc_path)), float(legs.sum() + arc_path.radius_m * np.abs(arc_path.turn).sum())


def _loops(arc_path: ArcPath, leg: int) -> Iterator[ArcPath]:
    """Yield ``arc_path`` with one free disc more on a leg, on either side, near the beginning or the end of the leg."""
    places = np.where(arc_path.pinned[:, None], arc_path.pin, arc_path.centre)
    stops = np.vstack([arc_path.ends[:1], places, arc_path.ends[1:]])
    for place, on in ((stops[leg], 1.0), (stops[leg + 1], -1.0)):
        for way in range(WAYS):
            heading = 2.0 * math.pi * way / WAYS
            for run in RUNS if 0 < leg + (on < 0.0) < len(stops) - 1 else RUNS_AT_ENDS:
                away = on * run * arc_path.radius_m * np.array([math.cos(heading), math.sin(heading)])
                for sense in (1.0, -1.0):
                    yield inserted(arc_path, leg, place + away, heading, sense)


Replan = Callable[[float], tuple[Floats, Bools] | None]
"""Plans a path with additional track error, its argument in metres (`with_more_clearance`); returns the points and
which of them are pinned, or None if there is no path."""

LEVELS = (0.15, 0.4, 1.0)
"""Additional track errors, in turn radii, for which paths are planned anew if a path cannot be rounded cheaply."""

OUT_M = 0.3
"""Metres outside of a corner at which its arc begins: bounds over a line lose centimetres, walls are not smooth."""

WORTH, GOOD, DEAR = 3e-3, 1e-2, 3e-2
"""Extra cost over the path with corners, as a part, above which the result is polished; above which the next arc path
is tried; and above which a path with more clearance is planned."""

LIFTS, STEEP, BELOW_M = 12, 0.999, 0.1
"""Altitudes at which a flight is tried to be faster; the part of the slope limits at which it climbs there; and metres
that it stays below the ceiling."""

TRIES = 1000
"""Most tracks tried in each repair and in each polishing of an arc path."""

SLACKS_M = (0.5, 4.0, 20.0)
"""Points of the path within this many metres of the straight line between others are not corners; tried in turn."""


@dataclass(frozen=True, eq=False, slots=True)
class Rounded:
    """A path as a fixed wing flies it.

    ``way_points`` (M, 3): for the autopilot. At each but the first and the last, where the legs turn, it flies the arc
    of the turn radius that is tangent to both legs. Arcs of neighbours may touch but do not overlap. Altitude is linear
    along the track between way points; each way point's altitude is reached in the middle of its arc. ``flown`` (K, 3):
    that path, arcs as chords; ``cost`` in the problem's objective, along the arcs themselves.
    """

    way_points: Floats
    flown: Floats
    cost: float


def rounded(problem: Problem, points: Floats, pinned: Bools, replan: Replan | None = None) -> Rounded | None:
    """Round a legal path with corners, ``points`` (N, 3), by turns of ``problem.turn_radius_m``; None if not found.

    ``pinned`` (N,): points that must be passed, the vias; the ends always are. ``replan`` plans a path with more
    clearance if the given one cannot be rounded cheaply. Raises ValueError for a turn radius of 0 or less.
    """
    if problem.turn_radius_m <= 0.0:
        raise ValueError(f"turn_radius_m must be greater than 0, given {problem.turn_radius_m:g}")
    found = _rounded(problem, points, pinned)
    dear = (1.0 + DEAR) * problem.cost(Path(points))
    for level in LEVELS if replan is not None else ():
        if replan is None or (found is not None and found.cost <= dear):
            break
        again = replan(level * problem.turn_radius_m)
        other = None if again is None else _rounded(problem, *again)
        if other is not None and (found is None or other.cost < found.cost):
            found = other
    return found


def with_more_clearance(problem: Problem, extra_m: float) -> Problem:
    """``problem`` with ``extra_m`` metres more track error, so that its path leaves clearance for arcs; no turn radius.

    Start and goal are raised to where they are legal with that error, and vias have no altitude. So its path begins and
    ends too high, but `rounded` uses only its track and draws the altitudes anew.
    """
    limits = replace(problem.limits, track_error_m=problem.limits.track_error_m + extra_m)

    def lifted(point: tuple[float, float, float]) -> tuple[float, float, float]:
        east, north, amsl = point
        floor_m = float(problem.airspace.floor_amsl(east, north, limits))
        if math.isinf(floor_m):
            raise Refusal("no mission: ground near an end is unknown", reason="not_found", place=(east, north))
        return east, north, max(amsl, floor_m)

    return replace(
        problem, limits=limits, start=lifted(problem.start), goal=lifted(problem.goal), turn_radius_m=0.0,
        via=tuple(replace(v, amsl_m=None) for v in problem.via),
    )  # fmt: skip


def _rounded(problem: Problem, points: Floats, pinned: Bools) -> Rounded | None:
    given = problem.cost(Path(points))
    best: Tried | None = None
    cost = math.inf
    for arc_path in _arc_paths(problem, points, pinned):
        found = mended(problem, arc_path, Patience(TRIES))
        if found is None:
            continue
        found = polished(problem, found, (1.0 + WORTH) * given, Patience(TRIES))
        assert found.risen is not None
        if cost_of(problem, found.risen) < cost:
            best, cost = found, cost_of(problem, found.risen)
        if cost <= (1.0 + GOOD) * given:
            break
    if best is None or best.risen is None:
        return None
    risen = best.risen if problem.airspeed is None else lifted(problem, problem.airspeed, best)
    return Rounded(risen.way_points, risen.flown, cost_of(problem, risen))


def lifted(problem: Problem, airspeed: Airspeed, here: Tried) -> Risen:
    """The fastest of some flights over the track of a legal one, which climb into thinner air, and of that one, which
    stays where nothing limits its altitude."""
    track, line, limits = here.track, here.line, problem.limits
    assert track is not None
    assert line is not None
    assert here.risen is not None
    begin_m, end_m = problem.start[2], problem.goal[2]
    if math.isinf(ceiling_m(problem, limits)):
        return here.risen
    up, down = limits.max_climb_slope * STEEP, limits.max_descent_slope * STEEP
    long_m = float(track.s_m[-1])
    top_m = (long_m + begin_m / up + end_m / down) / (1.0 / up + 1.0 / down)
    top_m = min(top_m, ceiling_m(problem, limits) - limits.altitude_error_m - BELOW_M)
    low_m = max(begin_m, end_m)
    flights = [here.risen]
    for amsl_m in np.linspace(low_m, top_m, LIFTS + 1)[1:].tolist() if top_m > low_m else ():
        places = (amsl_m - begin_m) / up, long_m - (amsl_m - end_m) / down
        found = rise(problem, track, line, [(s_m, amsl_m, math.inf) for s_m in places])
        if isinstance(found, Risen):
            flights.append(found)
    return min(flights, key=lambda risen: airspeed.path_s(risen.flown, np.diff(risen.true_m)))


def _arc_paths(problem: Problem, points: Floats, pinned: Bools) -> Iterator[ArcPath]:
    """Yield arc paths to start from: around all corners, then around fewer; of each first a variant without loops."""
    counts = set()
    for slack in SLACKS_M:
        arc_path = arc_path_of(problem, points, pinned, slack)
        if len(arc_path.sense) in counts:
            continue
        counts.add(len(arc_path.sense))
        arc_path = with_loops(arc_path)
        open_ = unlooped(arc_path)
        if len(open_.sense) not in counts:
            counts.add(len(open_.sense))
            yield open_
        yield arc_path


def arc_path_of(problem: Problem, points: Floats, pinned: Bools, slack_m: float) -> ArcPath:
    """The arc path around the corners of a path that lie more than ``slack_m`` off straight lines; not checked yet."""
    flat = np.ascontiguousarray(points[:, :2], dtype=np.float64)
    must = np.array(pinned, dtype=bool)
    must[[0, -1]] = True
    corners = _corners(flat, must, slack_m)
    flat, must = flat[corners], must[corners]
    a, b = np.diff(flat[:-1], axis=0), np.diff(flat[1:], axis=0)
    turn = np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))
    # A path that goes straight back may turn to either side.
    sense = np.where(turn >= 0.0, 1.0, -1.0)
    inner, pins = flat[1:-1], must[1:-1]
    pin_m = np.full(len(inner), np.nan)
    for k in np.flatnonzero(pins):
        via = min(problem.via, key=lambda v: math.dist((v.east_m, v.north_m), inner[k]), default=None)
        if via is not None and via.amsl_m is not None:
            pin_m[k] = via.amsl_m
    out = inner + OUT_M * (~pins * sense)[:, None] * _right(a, b)
    return through(flat[[0, -1]], problem.turn_radius_m, out, sense, pins, pin_m)


def _right(a: Floats, b: Floats) -> Floats:
    """Unit vectors (N, 2) to the right of the mean direction of ``a`` and ``b``; of ``a`` where they are opposite."""
    way = a / np.hypot(*a.T)[:, None] + b / np.hypot(*b.T)[:, None]
    way = np.where(np.hypot(*way.T)[:, None] > 1e-6, way, a)
    way /= np.hypot(*way.T)[:, None]
    return np.stack([way[:, 1], -way[:, 0]], axis=-1)


def _corners(flat: Floats, must: Bools, slack_m: float) -> Indices:
    """Indices of the points that remain without those near a straight line; ``must`` stay, and points within 1 mm of
    the one before are dropped, of the last two the first."""
    index = thinned(flat, np.flatnonzero(must), slack_m)
    apart = np.concatenate([[True], np.diff(distances_m(flat[index])) > 1e-3])
    apart[-2:-1] &= apart[-1] or len(apart) == 2
    apart[-1] = True
    return np.asarray(index[apart])
