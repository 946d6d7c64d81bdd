"""How each autopilot returns, and what that meets on the way from parts of a mission to a place.

ArduCopter (mode_rtl.cpp, ``compute_return_target``): climbs on the spot to the greatest of its altitude and RTL_ALT
(RTL_ALT_M since 4.7; relative to home, 15 m by default), flies straight home at it, descends. Within a cone around home
it climbs less: to RTL_CONE_SLOPE (3) times the distance, 2.5 m at least. RTL_CLIMB_MIN (0) adds to its own altitude.
PX4 (rtl.cpp): the same with RTL_RETURN_ALT (60 m) and RTL_CONE_ANG (45 degrees); versions differ in where the cone
counts. ArduPlane, a QuadPlane too: turns and flies home at once, climbing to RTL_ALTITUDE (ALT_HOLD_RTL before 4.5;
100 m, -1 keeps its altitude) as it goes, or gliding down to it, and circles over home.

What is left open is judged both ways. In the cone: every altitude from the cone's to the whole. A plane: climbs from
where it is no slower than at ``climb_m_s`` at its fastest, or at once; descends late or at once; turns about first,
within twice the larger of track error and turn radius; circles with WP_LOITER_RAD 60 m, grown with altitude. The line
home lies between the one straight in the plane and the one straight in degrees. In the cone min AGL is not asked for:
the aircraft is about to land. Not looked at: RTL_ALT_TYPE 1 (terrain), RTL_CLIMB_MIN, fences that cap the return,
Q_RTL_MODE, missions with DO_LAND_START.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.check.rtl.returning import COPTER_CONE_SLOPE, PLANE_LOITER_RADIUS_M, PX4_CONE_SLOPE, circle_growth
from gcsplan.check.rtl.trail import Cuts, Trail
from gcsplan.check.rtl.walls import GROUND, MAX_AGL, MAX_AMSL, Walls
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world import ways

AT_HOME_M = 5.0
"""Nearer to home than this, or than the track error, a return is a descent."""

GROUPS = 6
"""Ways are looked at in so many groups of similar width at most, all of a group with its greatest."""

WORTH_A_GROUP = 50

TANGENT = 2.1
"""Where the tangents at a parabola's ends cross: twice its height; a little more for the cube beside the square."""

GROWN_M = 1000.0
"""A circle over home is judged with the radius that it has this high above it."""


@dataclass(frozen=True, slots=True)
class Rule:
    """One autopilot's manner; see the head of this module. ``cone_slope``: rise over run, 0 for none."""

    parameter: str
    default_rel_home_m: float
    climbs_first: bool
    cone_slope: float


RULES = {
    Autopilot.ARDUCOPTER: Rule("RTL_ALT", 15.0, True, COPTER_CONE_SLOPE),
    Autopilot.ARDUPLANE: Rule("RTL_ALTITUDE", 100.0, False, 0.0),
    Autopilot.PX4: Rule("RTL_RETURN_ALT", 60.0, True, PX4_CONE_SLOPE),
}


@dataclass(frozen=True, slots=True)
class Target:
    """Where a return ends: on ``ground_amsl_m``; ``cone_amsl_m`` is the height that the cone stands on."""

    east_m: float
    north_m: float
    ground_amsl_m: float
    cone_amsl_m: float

    @property
    def en(self) -> Floats:
        """(2,) east, north."""
        return np.array([self.east_m, self.north_m])


@dataclass(frozen=True, eq=False)
class Returns:
    """Walls in the way of returns from parts of a trail, by grade (see `WayHome`); ``cost``: pieces looked at."""

    clear: Walls
    legal: Walls
    cost: int

    def __getitem__(self, grade: int) -> Walls:
        return (self.clear, self.legal)[grade]

    def take(self, parts: NDArray[np.bool_]) -> Returns:
        """Those from some of the parts."""
        return Returns(self.clear.take(parts), self.legal.take(parts), 0)


def returns(trail: Trail, cuts: Cuts, target: Target, vehicle: Vehicle, *, whole: bool) -> Returns:
    """Returns from ``cuts`` to ``target``: from all of each part if ``whole``, else from its middle alone."""
    rule, limits, air = RULES[vehicle.autopilot], vehicle.limits, trail.world.airspace
    n = len(cuts)
    middle = trail.points(cuts.middle)
    start, end = np.ascontiguousarray(middle[:, :2]), np.tile(target.en, (n, 1))
    sides = cuts if whole else Cuts(cuts.middle, cuts.middle, cuts.stretch)
    low, high = trail.heights(sides)
    distance = np.hypot(*(end - start).T)
    own = trail.track_m[cuts.stretch] * air.scale
    regions, bow = _swept(trail, sides, target)
    reach = 0.5 * np.hypot(*(regions[:, 1] - regions[:, 0]).T)  # a part is straight in the plane, or a column
    extra = reach + own + bow * air.scale
    there_m = max(AT_HOME_M, limits.track_error_m)
    away = np.flatnonzero(distance + reach > there_m)
    cone = target.cone_amsl_m + rule.cone_slope * np.maximum(distance - reach, there_m)
    about_m = 2.0 * max(limits.track_error_m, vehicle.turn_radius_m)
    climb = vehicle.climb_m_s / vehicle.speed_max_m_s if math.isfinite(vehicle.climb_m_s) else 1.0
    made = _Maker(high)
    for some in _alike(extra, away):
        swept = ways.Swept(regions[some], own[some])
        met = ways.over(air, start[some], end[some], limits, float(extra[some].max()), swept)
        made.cost += len(met.piece_way)
        at = met.crossings
        if rule.climbs_first:
            made.ground(some, met, low[some], cone[some], np.full(len(some), np.inf))
            i = some[at.way]
            made.zones(i, at, low[i], np.where(at.begins, -np.inf, cone[i]))
        else:
            made.ground(some, met, -np.inf, *_climbs(met, low[some], reach[some] + about_m, climb))
            i = some[at.way]
            made.zones(i, at, -np.inf, low[i] + climb * np.maximum(at.s0_m - reach[i] - about_m, 0.0))
    if rule.climbs_first:  # near home, where the climb leads nobody knows: no zone may be within reach of it
        for some in _alike(extra, np.flatnonzero(distance + reach <= there_m)):
            swept = ways.Swept(regions[some], own[some])
            met = ways.over(air, start[some], end[some], limits, float(extra[some].max()), swept)
            i = some[met.crossings.way]
            made.zones(i, met.crossings, low[i], np.full(len(i), -np.inf))
    else:
        for some in _alike(extra, np.arange(n)):
            met = ways.over(air, start[some], start[some], limits, float(extra[some].max()) + about_m * air.scale)
            made.cost += len(met.piece_way)
            made.ground(some, met, -np.inf, low[some], low[some])
            i = some[met.crossings.way]
            made.zones(i, met.crossings, -np.inf, low[i])
    _over_home(made, trail, target, vehicle, n)
    if limits.max_amsl_m is not None:
        everywhere = np.arange(n)
        made.ceiling(everywhere, np.full(n, limits.max_amsl_m - limits.altitude_error_m), MAX_AMSL, (1,))
    return Returns(*made.walls(), made.cost)


def _swept(trail: Trail, sides: Cuts, target: Target) -> tuple[Floats, Floats]:
    """What the returns from parts of the trail cover: (N, 5, 2) points around it, and how far the ways bow, metres.

    A way lies between the line that is straight in the plane and the one that is straight in degrees. The one curves
    away from the other as a parabola, which lies within the triangle of its ends and the crossing of its tangents.
    """
    frame = trail.world.frame
    goal = frame.to_degrees(target.east_m, target.north_m)
    points, bows = [], []
    for u in (sides.start, sides.end):
        at = trail.points(u)[:, :2]
        degrees = frame.to_degrees(*at.T)
        turn = (goal[1] - degrees[:, 1] + 180.0) % 360.0 - 180.0
        curved = frame.to_plane(0.5 * (degrees[:, 0] + goal[0]), degrees[:, 1] + 0.5 * turn)
        straight = 0.5 * (at + target.en)
        points.append((at, straight + TANGENT * (curved - straight)))
        bows.append(TANGENT / 2.0 * np.hypot(*(curved - straight).T))
    home = np.broadcast_to(target.en, points[0][0].shape)
    regions = np.stack([points[0][0], points[1][0], points[1][1], home, points[0][1]], axis=1)
    return regions, np.maximum(*bows)


def _over_home(made: _Maker, trail: Trail, target: Target, vehicle: Vehicle, n: int) -> None:
    """The descent over home, or a plane's circle there, which every return ends with."""
    air, limits = trail.world.airspace, vehicle.limits
    if RULES[vehicle.autopilot].climbs_first:
        at = ways.over(air, target.en[None], target.en[None], limits).crossings
        for zone, bottom, top in zip(at.zone.tolist(), at.bottom_m.tolist(), at.top_m.tolist(), strict=True):
            if top > target.ground_amsl_m:
                made.ceiling(np.arange(n), np.full(n, bottom), zone, (0, 1))
        return
    circle = PLANE_LOITER_RADIUS_M * circle_growth(target.ground_amsl_m + GROWN_M)
    met = ways.over(air, target.en[None], target.en[None], limits, circle * air.scale)
    everywhere = np.arange(n)
    for grade, floor in enumerate((met.clear_m[0], met.legal_m[0])):
        made.wall(grade, everywhere, -np.inf, float(floor), GROUND)
    at = met.crossings
    for zone, bottom, top in zip(at.zone.tolist(), at.bottom_m.tolist(), at.top_m.tolist(), strict=True):
        for grade in (0, 1):
            made.wall(grade, everywhere, bottom, top, zone)
    if math.isfinite(met.ceiling_m[0]):
        made.ceiling(everywhere, np.full(n, met.ceiling_m[0]), MAX_AGL, (1,))


def _climbs(met: ways.Ways, low: Floats, spare: Floats, climb: float) -> tuple[Floats, Floats]:
    """Whether each plane, climbing from ``low`` as it goes, is above the ground all the way: inf, or -inf if not."""
    out = []
    reached = low[met.piece_way] + climb * np.maximum(met.piece_s_m - spare[met.piece_way], 0.0)
    for floor in (met.piece_clear_m, met.piece_legal_m):
        limit = np.full(len(low), np.inf)
        limit[met.piece_way[reached < floor]] = -np.inf
        out.append(limit)
    return out[0], out[1]


def _alike(extra: Floats, which: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Groups of similar width, each in order."""
    if not len(which):
        return []
    widest = float(extra[which].max())
    groups = min(max(len(which) // WORTH_A_GROUP, 1), GROUPS)
    number = np.ceil(extra[which] * (groups / widest)) if widest > 0.0 else np.zeros(len(which))
    return [which[number == k] for k in np.unique(number)]


class _Maker:
    """Collects walls of both grades."""

    def __init__(self, high: Floats) -> None:
        self.high, self.cost = high, 0
        self.rows: tuple[list[tuple[NDArray[np.generic], ...]], ...] = ([], [])

    def _put(self, grade: int, *columns: NDArray[np.generic] | float) -> None:
        n = np.size(columns[0])
        if n:
            self.rows[grade].append(tuple(c if isinstance(c, np.ndarray) else np.full(n, c) for c in columns))

    def ground(
        self, i: NDArray[np.intp], met: ways.Ways, base: Floats | float, clear_limit: Floats, legal_limit: Floats
    ) -> None:
        """Terrain under each way, and what max AGL leaves above it."""
        self._put(0, i, -np.inf, met.clear_m, base, clear_limit, GROUND)
        self._put(1, i, -np.inf, met.legal_m, base, legal_limit, GROUND)
        if legal_limit is not clear_limit:  # what is legal is clear besides
            self._put(1, i, -np.inf, met.clear_m, base, clear_limit, GROUND)
        capped = np.isfinite(met.ceiling_m)
        self.ceiling(i[capped], met.ceiling_m[capped], MAX_AGL, (1,))

    def zones(self, i: NDArray[np.intp], at: ways.Crossings, base: Floats | float, limit: Floats) -> None:
        """Zones that ways meet."""
        for grade in (0, 1):
            self._put(grade, i, at.bottom_m, at.top_m, base, limit, at.zone)

    def wall(self, grade: int, i: NDArray[np.intp], bottom: float, top: float, what: int) -> None:
        """The same wall for each of ``i``, where the return is at its level."""
        self._put(grade, i, bottom, top, -np.inf, np.inf, what)

    def ceiling(self, i: NDArray[np.intp], bottom: Floats, what: int, grades: tuple[int, ...]) -> None:
        """What may not be risen above."""
        for grade in grades:
            self._put(grade, i, bottom, np.inf, -np.inf, np.inf, what)

    def walls(self) -> tuple[Walls, Walls]:
        """Clear and legal."""
        made = []
        for rows in self.rows:
            columns = [np.concatenate([r[k] for r in rows]) if rows else np.zeros(0) for k in range(6)]
            back, bottom, top, base, limit, what = columns
            made.append(Walls(self.high, back.astype(np.intp), bottom, top, base, limit, what.astype(np.intp)))
        return made[0], made[1]
