"""The obstacles in height that returns from parts of a mission to a place meet.

How each autopilot returns is in `model`. Where several flights are possible, all are judged. A plane climbs from its
altitude at least at the slope of ``climb_m_s`` at its highest speed, or at once; it descends late or at once; it turns
about first. The line home lies between the line straight in the plane and the line straight in degrees. Inside the cone
min AGL does not apply, because the aircraft is about to land.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.rtl.model import RULES, about_turn_m, at_home_m
from gcsplan.check.rtl.obstacles import GROUND, MAX_AGL, MAX_AMSL, Obstacles
from gcsplan.check.rtl.trace import MissionTrace, TraceParts
from gcsplan.vehicle import Vehicle
from gcsplan.world import level_lines
from gcsplan.world.airspace import Legs
from gcsplan.world.limits import Limits
from gcsplan.world.zones import Level

GROUPS = 6
"""Most groups into which lines home of similar width are put; each group is judged with its greatest width."""

LEAST_IN_GROUP = 50

TANGENT = 2.1
"""The tangents at a parabola's ends cross at twice its height; the rest allows for the cubic term of the true curve."""

CIRCLE_ABOVE_M = 1000.0
"""The height above home, m, whose radius is used to judge a circle over home."""


@dataclass(frozen=True, slots=True)
class Target:
    """The end of a return, on ``ground_amsl_m``; ``cone_amsl_m`` is the altitude of the cone's tip."""

    east_m: float
    north_m: float
    ground_amsl_m: float
    cone_amsl_m: float

    @property
    def en(self) -> Floats:
        """(2,) east, north."""
        return np.array([self.east_m, self.north_m])


@dataclass(frozen=True, eq=False)
class GradedObstacles:
    """Obstacles in the way of returns from parts of a mission, by grade (see `WayHome`).

    ``cost``: the number of pieces of ground that were judged.
    """

    clear: Obstacles
    legal: Obstacles
    cost: int

    def __getitem__(self, grade: int) -> Obstacles:
        return (self.clear, self.legal)[grade]

    def take(self, parts: Bools) -> GradedObstacles:
        """The obstacles from some of the parts."""
        return GradedObstacles(self.clear.take(parts), self.legal.take(parts), 0)


def obstacles_of_returns(
    trace: MissionTrace, parts: TraceParts, target: Target, vehicle: Vehicle, *, whole: bool
) -> GradedObstacles:
    """The obstacles of returns from ``parts`` to ``target``: from all of each if ``whole``, else from its middle."""
    rule, limits, air = RULES[vehicle.autopilot], vehicle.limits, trace.world.airspace
    n = len(parts)
    middle = trace.points(parts.middle)
    start, end = np.ascontiguousarray(middle[:, :2]), np.tile(target.en, (n, 1))
    sides = parts if whole else TraceParts(parts.middle, parts.middle, parts.stretch)
    low, high = trace.heights(sides)
    distance = np.hypot(*(end - start).T)
    own = trace.track_m[parts.stretch] * air.scale
    regions, bow = _swept(trace, sides, target)
    reach = 0.5 * np.hypot(*(regions[:, 1] - regions[:, 0]).T)  # half the length of a part, straight or a column
    extra = reach + own + bow * air.scale
    there_m = at_home_m(limits)
    away = np.flatnonzero(distance + reach > there_m)
    cone = rule.cone_amsl_m(target.cone_amsl_m, np.maximum(distance - reach, there_m))
    about_m = about_turn_m(vehicle)
    climb = vehicle.climb_m_s / vehicle.speed_max_m_s if math.isfinite(vehicle.climb_m_s) else 1.0
    found = _Builder(high)
    for some in _alike(extra, away):
        swept = level_lines.Swept(regions[some], own[some])
        met = level_lines.over(air, start[some], end[some], limits, float(extra[some].max()), swept)
        found.cost += len(met.piece_line)
        at = met.crossings
        if rule.climbs_first:
            found.ground(some, met, low[some], cone[some], np.full(len(some), np.inf))
            i = some[at.line]
            found.zones(i, at, low[i], cone[i])
            spots = some[np.unique(at.line[at.begins])]
            if len(spots):
                _climbs_on_the_spot(found, trace, sides, limits, spots, regions, float(extra[spots].max()))
        else:
            found.ground(some, met, -np.inf, *_climbs(met, low[some], reach[some] + about_m, climb))
            i = some[at.line]
            found.zones(i, at, -np.inf, low[i] + climb * np.maximum(at.s0_m - reach[i] - about_m, 0.0))
    if rule.climbs_first:  # near home the altitude is not known: no zone may be within reach
        for some in _alike(extra, np.flatnonzero(distance + reach <= there_m)):
            swept = level_lines.Swept(regions[some], own[some])
            met = level_lines.over(air, start[some], end[some], limits, float(extra[some].max()), swept)
            i = some[met.crossings.line]
            found.zones(i, met.crossings, low[i], np.full(len(i), -np.inf))
    else:
        for some in _alike(extra, np.arange(n)):
            met = level_lines.over(
                air, start[some], start[some], limits, float(extra[some].max()) + about_m * air.scale
            )
            found.cost += len(met.piece_line)
            found.ground(some, met, -np.inf, low[some], low[some])
            i = some[met.crossings.line]
            found.zones(i, met.crossings, -np.inf, low[i])
    _over_home(found, trace, target, vehicle, n)
    if limits.max_amsl_m is not None:
        every = np.arange(n)
        found.ceiling(every, np.full(n, limits.max_amsl_m - limits.altitude_error_m), MAX_AMSL, (1,))
    return GradedObstacles(*found.by_grade(), found.cost)


def _climbs_on_the_spot(
    found: _Builder,
    trace: MissionTrace,
    sides: TraceParts,
    limits: Limits,
    spots: Indices,
    regions: Floats,
    wide_m: float,
) -> None:
    """Add the zones that returns meet while they climb, which they may begin anywhere on each part of ``spots``.

    A zone's ceiling above ground elsewhere on the line home does not count here. Where the part itself is clear of
    ground and zones under the exact check, a zone that stands on the ground is below it, and not in the way.
    """
    air, parts = trace.world.airspace, sides.take(spots)
    ends = regions[spots, :2]
    own = trace.track_m[parts.stretch]
    middle = ends.mean(axis=1)
    at = level_lines.over(air, middle, middle, limits, wide_m, level_lines.Swept(ends, own * air.scale)).crossings
    low, _ = trace.heights(parts)
    clear = air.clear(
        Legs(
            trace.points(parts.start)[:, :3],
            trace.points(parts.end)[:, :3],
            np.zeros(len(spots), np.bool_),
            limits.track_error_m + own,
            limits.altitude_error_m + trace.altitude_m[parts.stretch],
        ),
        replace(limits, min_agl_m=0.0, max_amsl_m=None, max_agl_m=None, max_climb_deg=90.0, max_descent_deg=90.0),
    )
    stands = np.array([z.floor is None or z.floor == Level(0.0, "agl") for z in air.zones])
    met = at.take(~(stands[at.zone] & (clear & trace.straight(parts))[at.line]))
    found.zones(spots[met.line], met, low[met.line], np.full(len(met.line), -np.inf))


def _swept(trace: MissionTrace, sides: TraceParts, target: Target) -> tuple[Floats, Floats]:
    """The regions that returns from parts of the trace cover, (N, 5, 2) points around each, and the bows, metres.

    A return lies between the line that is straight in the plane and the one that is straight in degrees. One curves
    away from the other as a parabola, which lies within the triangle of its ends and the crossing of its tangents.
    """
    frame = trace.world.frame
    goal = frame.to_degrees(target.east_m, target.north_m)
    points, bows = [], []
    for u in (sides.start, sides.end):
        at = trace.points(u)[:, :2]
        degrees = frame.to_degrees(*at.T)
        turn = (goal[1] - degrees[:, 1] + 180.0) % 360.0 - 180.0
        curved = frame.to_plane(0.5 * (degrees[:, 0] + goal[0]), degrees[:, 1] + 0.5 * turn)
        straight = 0.5 * (at + target.en)
        points.append((at, straight + TANGENT * (curved - straight)))
        bows.append(TANGENT / 2.0 * np.hypot(*(curved - straight).T))
    home = np.broadcast_to(target.en, points[0][0].shape)
    regions = np.stack([points[0][0], points[1][0], points[1][1], home, points[0][1]], axis=1)
    return regions, np.maximum(*bows)


def _over_home(found: _Builder, trace: MissionTrace, target: Target, vehicle: Vehicle, n: int) -> None:
    """Add the descent over home, or a plane's circle there, with which every return ends."""
    air, limits = trace.world.airspace, vehicle.limits
    if RULES[vehicle.autopilot].climbs_first:
        at = level_lines.over(air, target.en[None], target.en[None], limits).crossings
        for zone, bottom, top in zip(at.zone.tolist(), at.bottom_m.tolist(), at.top_m.tolist(), strict=True):
            if top > target.ground_amsl_m:
                found.ceiling(np.arange(n), np.full(n, bottom), zone, (0, 1))
        return
    circle = RULES[vehicle.autopilot].circle_m(target.ground_amsl_m + CIRCLE_ABOVE_M)
    met = level_lines.over(air, target.en[None], target.en[None], limits, circle * air.scale)
    every = np.arange(n)
    for grade, floor in enumerate((met.clear_m[0], met.legal_m[0])):
        found.one(grade, every, -np.inf, float(floor), GROUND)
    at = met.crossings
    for zone, bottom, top in zip(at.zone.tolist(), at.bottom_m.tolist(), at.top_m.tolist(), strict=True):
        for grade in (0, 1):
            found.one(grade, every, bottom, top, zone)
    if math.isfinite(met.ceiling_m[0]):
        found.ceiling(every, np.full(n, met.ceiling_m[0]), MAX_AGL, (1,))


def _climbs(met: level_lines.LevelLines, low: Floats, spare: Floats, climb: float) -> tuple[Floats, Floats]:
    """For both grades: inf for each plane that stays above the ground while it climbs from ``low``, else -inf."""
    out = []
    reached = low[met.piece_line] + climb * np.maximum(met.piece_s_m - spare[met.piece_line], 0.0)
    for floor in (met.piece_clear_m, met.piece_legal_m):
        limit = np.full(len(low), np.inf)
        limit[met.piece_line[reached < floor]] = -np.inf
        out.append(limit)
    return out[0], out[1]


def _alike(extra: Floats, which: Indices) -> list[Indices]:
    """Groups of similar width, each in order."""
    if not len(which):
        return []
    widest = float(extra[which].max())
    groups = min(max(len(which) // LEAST_IN_GROUP, 1), GROUPS)
    number = np.ceil(extra[which] * (groups / widest)) if widest > 0.0 else np.zeros(len(which))
    return [which[number == k] for k in np.unique(number)]


class _Builder:
    """Collects obstacles of both grades."""

    def __init__(self, high: Floats) -> None:
        self.high, self.cost = high, 0
        self.rows: tuple[list[tuple[NDArray[np.generic], ...]], ...] = ([], [])

    def _put(self, grade: int, *columns: NDArray[np.generic] | float) -> None:
        n = np.size(columns[0])
        if n:
            self.rows[grade].append(tuple(c if isinstance(c, np.ndarray) else np.full(n, c) for c in columns))

    def ground(
        self, i: Indices, met: level_lines.LevelLines, base: Floats | float, clear_limit: Floats, legal_limit: Floats
    ) -> None:
        """Add the terrain under each return, and the ceiling that max AGL sets above it."""
        self._put(0, i, -np.inf, met.clear_m, base, clear_limit, GROUND)
        self._put(1, i, -np.inf, met.legal_m, base, legal_limit, GROUND)
        if legal_limit is not clear_limit:  # a legal return must be clear too
            self._put(1, i, -np.inf, met.clear_m, base, clear_limit, GROUND)
        capped = np.isfinite(met.ceiling_m)
        self.ceiling(i[capped], met.ceiling_m[capped], MAX_AGL, (1,))

    def zones(self, i: Indices, at: level_lines.Crossings, base: Floats | float, limit: Floats) -> None:
        """Add the zones that returns meet."""
        for grade in (0, 1):
            self._put(grade, i, at.bottom_m, at.top_m, base, limit, at.zone)

    def one(self, grade: int, i: Indices, bottom: float, top: float, what: int) -> None:
        """Add the same obstacle for each of ``i``, where the return is at its level."""
        self._put(grade, i, bottom, top, -np.inf, np.inf, what)

    def ceiling(self, i: Indices, bottom: Floats, what: int, grades: tuple[int, ...]) -> None:
        """Add an altitude that the return may not exceed."""
        for grade in grades:
            self._put(grade, i, bottom, np.inf, -np.inf, np.inf, what)

    def by_grade(self) -> tuple[Obstacles, Obstacles]:
        """The obstacles of the grades clear and legal."""
        made = []
        for rows in self.rows:
            columns = [np.concatenate([r[k] for r in rows]) if rows else np.zeros(0) for k in range(6)]
            back, bottom, top, base, limit, what = columns
            made.append(Obstacles(self.high, back.astype(np.intp), bottom, top, base, limit, what.astype(np.intp)))
        return made[0], made[1]
