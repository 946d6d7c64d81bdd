"""Rally points: places to return to where the way home is not clear, proposed on the ground under the mission.

The autopilot goes to the nearest of home and its rally points, not to the one that it can reach: ArduPilot with
RALLY_INCL_HOME 1 and no RALLY_LIMIT_KM (0; by default a point farther than 0.3 km, for planes 5 km, is not used), PX4
with RTL_TYPE 0. A proposal is judged accordingly: from every part of the mission, to each place that may be nearest
from there. Of many points the least useful is removed, one by one, as long as that costs little. What the altitude of a
point means to each autopilot is in `return_rules.RallyAltitude`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.motion.return_rules import RETURN_RULES, RallyAltitude
from gcsplan.check.returns.footprint import Target
from gcsplan.check.returns.obstacles import GradedObstacles, Obstacles, obstacles_of_returns
from gcsplan.check.returns.refinement import CLEAR, Refinement, pieces_of
from gcsplan.check.returns.stretches import stretches_of
from gcsplan.check.returns.trace import MissionTrace, TraceParts
from gcsplan.check.returns.verdict import RallyPoint, UnsafeStretch
from gcsplan.mavlink.mission.commands import RALLY_POINT
from gcsplan.mavlink.mission.mission import RELATIVE, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Vehicle

MOST_RALLY_POINTS = 6
MOST_RETURN_LEVELS = 40
"""Most return altitudes that are compared."""

CANDIDATES = 16
PLACES_TRIED = 4
"""Places examined for each candidate; the flattest is used."""

MISSION_PARTS, FEWEST_PARTS, CANDIDATE_PIECES = 120, 60, 400_000
"""Most parts of a mission that are looked at to choose the points; the choice is then refined. Fewer where their
returns have more than so many pieces of ground for each candidate: a mission of 100 km over cells of 30 m."""

NEAREST_HOME_M = 200.0
FLAT_WITHIN_M = 10.0
WORTH_PART = 0.01
"""The least part of the mission that a point, or a higher altitude, must make safe."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """Rally points, the return altitude with which they are judged, and the stretches that stay unsafe."""

    points: tuple[RallyPoint, ...]
    rel_home_m: float
    left: tuple[UnsafeStretch, ...]
    notes: tuple[Note, ...]


@dataclass(frozen=True, slots=True, eq=False)
class RallyReturns:
    """Returns to the nearest of home and rally points on board, and the highest altitude AMSL of one.

    ``notes`` are the conditions under which they hold; ``unknown`` names points that are not judged.
    """

    refinement: Refinement
    highest_amsl_m: float
    notes: tuple[Note, ...]
    unknown: tuple[Note, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """A place to return to, the level of the return there, and the obstacles from the parts that it serves."""

    target: Target
    level: float
    slope: float
    at_end: bool
    obstacles: Obstacles
    serves: Indices


def rally_items(points: Sequence[RallyPoint]) -> tuple[MissionItem, ...]:
    """The wire items (MAV_CMD_NAV_RALLY_POINT, relative to home) of proposed rally points."""
    return tuple(
        MissionItem(RALLY_POINT, RELATIVE, x=round(p.lat_deg * 1e7), y=round(p.lon_deg * 1e7), z=p.rel_home_m)
        for p in points
    )


def propose(
    trace: MissionTrace, refinement: Refinement, home: Target, vehicle: Vehicle, return_rel_home_m: float
) -> Proposal:
    """Propose rally points for a mission without a single return altitude that is clear from every point."""
    ground = home.ground_amsl_m
    level = _rounded(
        best_level(refinement.strict[CLEAR], refinement.parts.size, ground + return_rel_home_m, refinement.start),
        ground,
    )
    parts, size = _few_parts(trace, home, refinement.first_m)
    middle = trace.points(parts.middle)[:, :2]
    obstacles = obstacles_of_returns(trace, parts, home, vehicle, whole=False).clear
    away, safe = [np.hypot(*(middle - home.en).T)], [obstacles.passes(level)]
    places = [_Place(home, level, 0.0, False, obstacles, np.arange(len(parts)))]
    for target, slope, at_end in _candidates(trace, home, vehicle):
        apart = np.hypot(*(middle - target.en).T)
        serves = np.flatnonzero(apart < away[0])
        if not len(serves):
            continue
        obstacles = obstacles_of_returns(trace, parts.take(serves), target, vehicle, whole=False).clear
        at = _level_there(obstacles, size[serves], target, level, vehicle, ground)
        ok = np.zeros(len(parts), np.bool_)
        ok[serves] = obstacles.passes(at)
        away.append(apart)
        safe.append(ok)
        places.append(_Place(target, at, slope, at_end, obstacles, serves))
    chosen = _choose(np.array(away), np.array(safe), size)
    apart = np.array(away)[[0, *chosen]]
    nearest = apart.argmin(axis=0)
    used = [places[k] for k in (0, *chosen)]
    for i, place in enumerate(used):  # each place now serves only the parts from which it is the nearest
        mine = nearest[place.serves] == i
        mine = mine if mine.any() else ~mine
        few, lengths = place.obstacles.take(mine), size[place.serves][mine]
        if i == 0:
            level = _rounded(best_level(few, lengths, ground + return_rel_home_m, refinement.start), ground)
            used[0] = replace(place, level=level)
        else:
            used[i] = replace(place, level=_level_there(few, lengths, place.target, level, vehicle, ground))
    closer = _judged_with(trace, vehicle, [(p.target, p.level) for p in used], refinement)
    left = stretches_of(trace, closer, CLEAR, closer.start, None)
    if not chosen:
        return Proposal((), level - ground, left, (Note("no_rally_point_helps"),))
    served_m = [float(size[nearest == i].sum()) for i in range(len(used))]
    points = tuple(_point(trace, p, m, vehicle, ground) for p, m in zip(used[1:], served_m[1:], strict=True))
    return Proposal(points, level - ground, left, _conditions(vehicle, float(apart.min(axis=0).max())))


def returns_to(
    trace: MissionTrace,
    like: Refinement,
    home: Target,
    vehicle: Vehicle,
    points: Sequence[MissionItem],
    return_rel_home_m: float,
) -> RallyReturns:
    """The refined returns to the nearest of home and ``points``, rally points as the autopilot stores them."""
    rally, ground = RETURN_RULES[vehicle.autopilot].rally, home.ground_amsl_m
    level = ground + return_rel_home_m
    places = [(home, level)]
    surface, unknown = trace.world.airspace.surface, []
    for number, point in enumerate(points, start=1):
        east, north = (float(x) for x in trace.world.frame.to_plane(point.lat_deg, point.lon_deg))
        under, own = float(surface.ground_at(east, north)), ground + point.z
        if math.isnan(under):
            unknown.append(Note("rally_point_off_terrain", number=number, lat=point.lat_deg, lon=point.lon_deg))
            continue
        at = {RallyAltitude.GROUND: own + return_rel_home_m, RallyAltitude.RAISES: max(level, own)}.get(rally, own)
        tip = own if rally is RallyAltitude.GROUND else ground
        places.append((Target(east, north, under, tip), at))
    middle = trace.points(trace.cut(like.first_m).middle)[:, :2]
    apart = np.min([np.hypot(*(middle - target.en).T) for target, _ in places], axis=0)
    found = _judged_with(trace, vehicle, places, like, legal=True)
    notes = _conditions(vehicle, float(apart.max(initial=0.0)))
    return RallyReturns(found, max(at for _, at in places), notes, tuple(unknown))


def _few_parts(trace: MissionTrace, home: Target, least_m: float) -> tuple[TraceParts, Floats]:
    """Parts of the mission to choose the points by, and the length in u (N,), m, for which each stands."""
    field = trace.world.airspace.field
    away_m = float(np.hypot(trace.east - home.east_m, trace.north - home.north_m).mean())
    pieces = pieces_of(away_m, min(field.step_x, field.step_y))
    most = int(np.clip(CANDIDATE_PIECES / pieces, FEWEST_PARTS, MISSION_PARTS))
    parts = trace.cut(max(least_m, float((trace.last - trace.first).sum()) / most))
    size = np.maximum(parts.size, 1e-3)
    if len(parts) <= 2 * most:  # each stretch has a part at least
        return parts, size
    after = np.cumsum(size)
    chosen, times = np.unique(np.searchsorted(after, (np.arange(most) + 0.5) * (after[-1] / most)), return_counts=True)
    return parts.take(chosen), times * (after[-1] / most)


def best_level(obstacles: Obstacles, size: Floats, level: float, start: float) -> float:
    """The lowest of ``level`` and higher levels whose unsafe length is within `WORTH_PART` of the least."""
    each = obstacles.lowest(start)
    each = np.sort(each[np.isfinite(each) & (each > level)])
    few = each[np.linspace(0, len(each) - 1, min(len(each), MOST_RETURN_LEVELS)).astype(int)]
    levels: list[float] = [level, *few.tolist()]
    unsafe = [float(size[~obstacles.passes(h)].sum()) for h in levels]
    enough = min(unsafe) + WORTH_PART * float(size.sum())
    return next(h for h, m in zip(levels, unsafe, strict=True) if m <= enough)


def _level_there(
    obstacles: Obstacles, size: Floats, target: Target, level: float, vehicle: Vehicle, home_amsl_m: float
) -> float:
    """The level of a return to ``target``, chosen if the autopilot leaves a choice."""
    rally = RETURN_RULES[vehicle.autopilot].rally
    if rally is RallyAltitude.GROUND:
        return target.ground_amsl_m + level - home_amsl_m
    start = level if rally is RallyAltitude.RAISES else max(level, target.ground_amsl_m)
    best = best_level(obstacles, size, start, start)
    return _rounded(best, home_amsl_m)


def _rounded(level: float, home_amsl_m: float) -> float:
    """The level rounded up to a whole metre above home, as parameters and rally points are set."""
    return home_amsl_m + math.ceil(level - home_amsl_m - 1e-6)


def _candidates(trace: MissionTrace, home: Target, vehicle: Vehicle) -> list[tuple[Target, float, bool]]:
    """Candidate places on the ground: the flattest near each of a few places along the mission, and where it ends."""
    ends = trace.last[: trace.mains]
    u = np.linspace(trace.first[0], ends[-1], CANDIDATES * PLACES_TRIED + 1)
    places = trace.points(np.append(u, ends[-1]))[:, :2]
    surface = trace.world.airspace.surface
    ground = surface.ground_at(*places.T)
    gradient = [
        (surface.ground_at(*(places + d).T) - surface.ground_at(*(places - d).T)) / (2.0 * FLAT_WITHIN_M)
        for d in FLAT_WITHIN_M * np.eye(2)
    ]
    slope = np.hypot(*gradient)
    fit = np.hypot(*(places - home.en).T) > NEAREST_HOME_M
    fit &= np.isfinite(ground) & np.isfinite(slope)
    found = []
    for k in range(CANDIDATES):
        some = np.arange(k * PLACES_TRIED, (k + 1) * PLACES_TRIED)
        some = some[fit[some]]
        if len(some):
            found.append((int(some[slope[some].argmin()]), False))
    if fit[-1]:
        found.append((len(places) - 1, True))
    on_ground = RETURN_RULES[vehicle.autopilot].rally is RallyAltitude.GROUND
    out = []
    for i, end in found:
        east, north = places[i].tolist()
        level = float(ground[i])
        out.append((Target(east, north, level, level if on_ground else home.ground_amsl_m), float(slope[i]), end))
    return out


def _choose(away: Floats, safe: Bools, size: Floats) -> list[int]:
    """Choose the rows of points that leave little unsafe, if each part uses its nearest place (home is row 0).

    Points are removed one by one from the full set, because a single added point takes over all that lies beyond it and
    may make things worse.
    """

    def safe_m(rows: list[int]) -> float:
        nearest = away[rows].argmin(axis=0)
        return float(size[safe[rows][nearest, np.arange(len(size))]].sum())

    total = float(size.sum())
    rows = list(range(1, len(away)))
    tried = [(safe_m([0, *rows]), rows)]
    while rows:
        rows = max(([k for k in rows if k != out] for out in rows), key=lambda fewer: safe_m([0, *fewer]))
        tried.append((safe_m([0, *rows]), rows))
    few = [(m, rows) for m, rows in tried if len(rows) <= MOST_RALLY_POINTS]
    best = max(m for m, _ in few)
    return min((rows for m, rows in few if m >= best - WORTH_PART * total), key=len)


def _judged_with(
    trace: MissionTrace,
    vehicle: Vehicle,
    places: Sequence[tuple[Target, float]],
    like: Refinement,
    *,
    legal: bool = False,
) -> Refinement:
    """The refined returns to the nearest of ``places``, each with the altitude AMSL of a return to it.

    A part that may go to several must reach each of them. ``legal``: also by the grade `LEGAL`, else by `CLEAR` alone.
    """
    spots = np.array([target.en for target, _ in places])

    def judge(parts: TraceParts, whole: bool) -> GradedObstacles:
        middle = trace.points(parts.middle)[:, :2]
        apart = np.hypot(*(middle[:, None] - spots[None]).transpose(2, 0, 1))
        slack = (parts.size if whole else np.zeros(len(parts))) + 2.0 * trace.track_m[parts.stretch] + TIE_M
        may = apart <= apart.min(axis=1, keepdims=True) + slack[:, None]
        clear, lawful, cost = [], [], 0
        for j, (target, level) in enumerate(places):
            some = np.flatnonzero(may[:, j])
            if len(some):
                found = obstacles_of_returns(trace, parts.take(some), target, vehicle, whole=whole)
                cost += found.cost
                clear.append(_failures(found.clear, level, some, len(parts)))
                lawful += [_failures(found.legal, level, some, len(parts))] if legal else []
        one = _on_one(clear, len(parts))
        return GradedObstacles(one, _on_one(lawful, len(parts)) if legal else one, cost)

    return Refinement(trace, judge, like.start, (like.start,), 2.0 * like.first_m, 4.0 * like.smallest_m)


TIE_M = 1.0
"""Two places whose distances differ by no more than this, m, count as equally far."""


def _failures(obstacles: Obstacles, level: float, some: Indices, count: int) -> Obstacles:
    """The obstacles that are hit at ``level``, as obstacles that no level passes."""
    hit = obstacles.hit(level)
    n = int(hit.sum())
    none = np.full(n, -np.inf)
    return Obstacles(
        np.zeros(count), some[obstacles.back[hit]], none, obstacles.top[hit], none, none, obstacles.what[hit]
    )


def _on_one(parts: Sequence[Obstacles], count: int) -> Obstacles:
    """Obstacles of the same returns, joined."""
    names = ("back", "bottom", "top", "base", "limit", "what")
    return Obstacles(np.zeros(count), *(np.concatenate([getattr(p, name) for p in parts]) for name in names))


def _point(trace: MissionTrace, place: _Place, serves_m: float, vehicle: Vehicle, home_amsl_m: float) -> RallyPoint:
    t = place.target
    lat, lon = trace.world.frame.to_degrees(t.east_m, t.north_m).tolist()
    on_ground = RETURN_RULES[vehicle.autopilot].rally is RallyAltitude.GROUND
    rel = round((t.ground_amsl_m if on_ground else place.level) - home_amsl_m, 2)
    why = Note("where_mission_ends") if place.at_end else Note("under_mission", slope_percent=100.0 * place.slope)
    return RallyPoint(round(lat, 7), round(lon, 7), t.ground_amsl_m, rel, serves_m, why)


def _conditions(vehicle: Vehicle, farthest_m: float) -> tuple[Note, ...]:
    look = Note("look_at_rally_points")
    if RETURN_RULES[vehicle.autopilot].rally is RallyAltitude.GROUND:
        return Note("rally_points_of_px4"), look
    return Note("rally_points_of_ardupilot", limit_km=farthest_m / 1e3 + 0.05), look
