"""Rally points: places to return to where the way home is not clear, proposed from the ground under the mission.

The autopilot goes to the nearest of home and its rally points, not to the one that it can reach: ArduPilot with
RALLY_INCL_HOME 1 and no RALLY_LIMIT_KM (0; by default a point farther than 0.3 km, for planes 5 km, is not used), PX4
with RTL_TYPE 0. A proposal is judged just so: from every part of the mission, to each place that may be the nearest
from there. Of many points the one that is missed least is left out, one by one, as long as that costs little.
ArduCopter returns at the greatest of its altitude, RTL_ALT and the point's own; ArduPlane at
the point's; PX4 at RTL_RETURN_ALT above the point, which must lie on the ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.check.rtl.rules import Returns, Target, returns
from gcsplan.check.rtl.stretches import stretches_of
from gcsplan.check.rtl.study import CLEAR, Study
from gcsplan.check.rtl.trail import Cuts, Trail
from gcsplan.check.rtl.verdict import RallyPoint, UnsafeStretch
from gcsplan.check.rtl.walls import Walls
from gcsplan.mavlink.mission.mission import RELATIVE, MissionItem
from gcsplan.vehicle import Autopilot, Vehicle

RALLY_POINT = 5100  # MAV_CMD_NAV_RALLY_POINT
MOST_POINTS = 6
LEVELS = 40
"""Return altitudes that are compared."""

CANDIDATES = 16
LOOKED_AT = 4
"""Places looked at for each candidate; the flattest is taken."""

PARTS = 120
"""Into which a mission is cut to choose by; what is chosen is judged closely."""

NEAREST_HOME_M = 200.0
FLAT_WITHIN_M = 10.0
WORTH = 0.01
"""A point or a greater altitude that makes a smaller part of the mission safe is not proposed."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """Rally points, the return altitude that they are judged with, and what stays unsafe."""

    points: tuple[RallyPoint, ...]
    rel_home_m: float
    left: tuple[UnsafeStretch, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """Somewhere to return to, the level of the return there, and what is in its way from the parts that it serves."""

    target: Target
    level: float
    slope: float
    at_end: bool
    walls: Walls
    serves: NDArray[np.intp]


def rally_items(points: Sequence[RallyPoint]) -> tuple[MissionItem, ...]:
    """The wire items (MAV_CMD 5100, relative to home) of proposed rally points."""
    return tuple(
        MissionItem(RALLY_POINT, RELATIVE, x=round(p.lat_deg * 1e7), y=round(p.lon_deg * 1e7), z=p.rel_home_m)
        for p in points
    )


def propose(trail: Trail, study: Study, home: Target, vehicle: Vehicle, given_m: float) -> Proposal:
    """Rally points for a mission from which no one return altitude brings it home from everywhere."""
    ground = home.ground_amsl_m
    level = _rounded(best_level(study.strict[CLEAR], study.cuts.size, ground + given_m, study.start), ground)
    cuts = trail.cut(max(study.first_m, float((trail.last - trail.first).sum()) / PARTS))
    middle = trail.points(cuts.middle)[:, :2]
    size = np.maximum(cuts.size, 1e-3)
    walls = returns(trail, cuts, home, vehicle, whole=False).clear
    away, safe = [np.hypot(*(middle - home.en).T)], [walls.passes(level)]
    places = [_Place(home, level, 0.0, False, walls, np.arange(len(cuts)))]
    for target, slope, at_end in _candidates(trail, home, vehicle):
        apart = np.hypot(*(middle - target.en).T)
        serves = np.flatnonzero(apart < away[0])
        if not len(serves):
            continue
        walls = returns(trail, cuts.take(serves), target, vehicle, whole=False).clear
        at = _level_there(walls, size[serves], target, level, vehicle, ground)
        ok = np.zeros(len(cuts), np.bool_)
        ok[serves] = walls.passes(at)
        away.append(apart)
        safe.append(ok)
        places.append(_Place(target, at, slope, at_end, walls, serves))
    chosen = _choose(np.array(away), np.array(safe), size)
    apart = np.array(away)[[0, *chosen]]
    nearest = apart.argmin(axis=0)
    used = [places[k] for k in (0, *chosen)]
    for i, place in enumerate(used):  # each place now serves but those from which it is the nearest
        mine = nearest[place.serves] == i
        mine = mine if mine.any() else ~mine
        few, lengths = place.walls.take(mine), size[place.serves][mine]
        if i == 0:
            level = _rounded(best_level(few, lengths, ground + given_m, study.start), ground)
            used[0] = replace(place, level=level)
        else:
            used[i] = replace(place, level=_level_there(few, lengths, place.target, level, vehicle, ground))
    closer = _judged_with(trail, vehicle, used, study)
    left = stretches_of(trail, closer, CLEAR, closer.start, None)
    if not chosen:
        return Proposal((), level - ground, left, ("no rally point under the mission makes more of it safe",))
    served_m = [float(size[nearest == i].sum()) for i in range(len(used))]
    points = tuple(_point(trail, p, m, vehicle, ground) for p, m in zip(used[1:], served_m[1:], strict=True))
    return Proposal(points, level - ground, left, _conditions(vehicle, float(apart.min(axis=0).max())))


def best_level(walls: Walls, size: Floats, given: float, start: float) -> float:
    """The given level, or a higher one that leaves clearly less unsafe: the lowest of those nearly as good as any."""
    each = walls.lowest(start)
    each = np.sort(each[np.isfinite(each) & (each > given)])
    few = each[np.linspace(0, len(each) - 1, min(len(each), LEVELS)).astype(int)]
    levels: list[float] = [given, *few.tolist()]
    unsafe = [float(size[~walls.passes(h)].sum()) for h in levels]
    enough = min(unsafe) + WORTH * float(size.sum())
    return next(h for h, m in zip(levels, unsafe, strict=True) if m <= enough)


def _level_there(
    walls: Walls, size: Floats, target: Target, level: float, vehicle: Vehicle, home_amsl_m: float
) -> float:
    """The level of a return to ``target``, chosen where the autopilot leaves a choice."""
    if vehicle.autopilot is Autopilot.PX4:
        return target.ground_amsl_m + level - home_amsl_m
    start = level if vehicle.autopilot is Autopilot.ARDUCOPTER else max(level, target.ground_amsl_m)
    best = best_level(walls, size, start, start)
    return _rounded(best, home_amsl_m)


def _rounded(level: float, home_amsl_m: float) -> float:
    """Up to a whole metre above home, as parameters and rally points are set."""
    return home_amsl_m + math.ceil(level - home_amsl_m - 1e-6)


def _candidates(trail: Trail, home: Target, vehicle: Vehicle) -> list[tuple[Target, float, bool]]:
    """Places on the ground under the mission, the flattest near each of a few evenly along it; and where it ends."""
    ends = trail.last[: trail.mains]
    u = np.linspace(trail.first[0], ends[-1], CANDIDATES * LOOKED_AT + 1)
    places = trail.points(np.append(u, ends[-1]))[:, :2]
    surface = trail.world.airspace.surface
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
        some = np.arange(k * LOOKED_AT, (k + 1) * LOOKED_AT)
        some = some[fit[some]]
        if len(some):
            found.append((int(some[slope[some].argmin()]), False))
    if fit[-1]:
        found.append((len(places) - 1, True))
    px4 = vehicle.autopilot is Autopilot.PX4
    out = []
    for i, end in found:
        east, north = places[i].tolist()
        level = float(ground[i])
        out.append((Target(east, north, level, level if px4 else home.ground_amsl_m), float(slope[i]), end))
    return out


def _choose(away: Floats, safe: NDArray[np.bool_], size: Floats) -> list[int]:
    """Rows (home is row 0) with which little is unsafe, by the nearest from each part.

    Thinned out from all of them, for a single point takes over all that lies beyond it and may make things worse.
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
    few = [(m, rows) for m, rows in tried if len(rows) <= MOST_POINTS]
    best = max(m for m, _ in few)
    return min((rows for m, rows in few if m >= best - WORTH * total), key=len)


def _judged_with(trail: Trail, vehicle: Vehicle, places: Sequence[_Place], like: Study) -> Study:
    """A close look at returns to the nearest of ``places``; a part that may go to several must reach each of them."""
    spots = np.array([p.target.en for p in places])

    def judge(cuts: Cuts, whole: bool) -> Returns:
        middle = trail.points(cuts.middle)[:, :2]
        apart = np.hypot(*(middle[:, None] - spots[None]).transpose(2, 0, 1))
        slack = (cuts.size if whole else np.zeros(len(cuts))) + 2.0 * trail.track_m[cuts.stretch] + TIE_M
        may = apart <= apart.min(axis=1, keepdims=True) + slack[:, None]
        walls, cost = [], 0
        for j, place in enumerate(places):
            some = np.flatnonzero(may[:, j])
            if len(some):
                found = returns(trail, cuts.take(some), place.target, vehicle, whole=whole)
                cost += found.cost
                walls.append(_failures(found.clear, place.level, some, len(cuts)))
        one = _on_one(walls, len(cuts))
        return Returns(one, one, cost)

    return Study(trail, judge, like.start, (like.start,), 2.0 * like.first_m, 4.0 * like.smallest_m)


TIE_M = 1.0
"""Two places that are so nearly equally far count as equally far."""


def _failures(walls: Walls, level: float, some: NDArray[np.intp], count: int) -> Walls:
    """The walls that are hit at ``level``, as walls that no level passes."""
    hit = walls.hit(level)
    n = int(hit.sum())
    none = np.full(n, -np.inf)
    return Walls(np.zeros(count), some[walls.back[hit]], none, walls.top[hit], none, none, walls.what[hit])


def _on_one(parts: Sequence[Walls], count: int) -> Walls:
    """Walls of the same returns, put together."""
    names = ("back", "bottom", "top", "base", "limit", "what")
    return Walls(np.zeros(count), *(np.concatenate([getattr(p, name) for p in parts]) for name in names))


def _point(trail: Trail, place: _Place, serves_m: float, vehicle: Vehicle, home_amsl_m: float) -> RallyPoint:
    t = place.target
    lat, lon = trail.world.frame.to_degrees(t.east_m, t.north_m).tolist()
    on_ground = vehicle.autopilot is Autopilot.PX4
    rel = round((t.ground_amsl_m if on_ground else place.level) - home_amsl_m, 2)
    why = "where the mission ends" if place.at_end else f"under the mission, ground slopes {100.0 * place.slope:.0f} %"
    return RallyPoint(round(lat, 7), round(lon, 7), t.ground_amsl_m, rel, serves_m, why)


def _conditions(vehicle: Vehicle, farthest_m: float) -> tuple[str, ...]:
    look = "look at each rally point before it is used: the terrain model knows no trees, wires, people or owners"
    if vehicle.autopilot is Autopilot.PX4:
        return ("the rally points are judged with RTL_TYPE 0: the nearest of home and rally points", look)
    return (
        f"the rally points are judged with RALLY_INCL_HOME 1 and RALLY_LIMIT_KM 0 (or {farthest_m / 1e3 + 0.05:.1f} "
        f"at least): the nearest of home and rally points",
        look,
    )
