"""Obstacles in height that returns from parts of a mission to a place meet, and the levels that pass them.

A return at the level ``h`` flies between a lowest and a highest altitude: *highest* is the greater of the level and the
altitude at which it begins, *lowest* depends on how the autopilot gets to its level. Ground is an obstacle without a
bottom, a ceiling one without a top; a zone may have both, one or neither. An obstacle is hit if the highest altitude is
above its bottom and the lowest below its top. Raising the level never brings a return below an obstacle again, so going
up from top to top finds the lowest level that passes all obstacles.

How each autopilot returns is in `return_rules`, how far it goes on before that in `stopping`. Where several flights are
possible, all are judged. A plane climbs from its altitude at least at the slope of ``climb_m_s`` at its highest speed,
or at once; it descends late or at once; it turns about first, and flies home from aside. The line home lies between the
line straight in the plane and the line straight in degrees. Inside the cone min AGL does not apply, because the
aircraft is about to land. Where a multicopter brakes, and on its way home from there, it keeps off zones themselves by
its errors; the clearance from zones is kept by returns from the mission's own line.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.motion.return_rules import ASIDE_PARTS, RETURN_RULES, at_home_m
from gcsplan.check.motion.stopping import circle_home_m
from gcsplan.check.returns.footprint import ReturnPlaces, Target, places_of_returns
from gcsplan.check.returns.trace import TINY_M, MissionTrace, TraceParts
from gcsplan.errors import heed_cancel
from gcsplan.vehicle import Vehicle
from gcsplan.world import level_lines
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Level

TOUCH_M = 1e-6
GROUND, MAX_AMSL, MAX_AGL, AHEAD, UNKNOWN = -1, -2, -3, -4, -5
"""Values of `Obstacles.what` for obstacles that are no zones; `AHEAD`: ground where the vehicle brakes before it
returns; `UNKNOWN`: ground that is not known (`Obstacles.kind` alone)."""


@dataclass(frozen=True, eq=False)
class Obstacles:
    """R obstacles in the way of N returns, altitudes AMSL.

    ``high`` (N,): the highest altitude at which each return begins. For each obstacle (R,): ``back``, the index of its
    return; its bottom and top; ``base`` and ``limit``: the lowest altitude of the return there
    is ``max(base, min(h, limit))``; ``what``: `GROUND`, `AHEAD`, `MAX_AMSL`, `MAX_AGL` or a zone's index.
    """

    high: Floats
    back: Indices
    bottom: Floats
    top: Floats
    base: Floats
    limit: Floats
    what: Indices

    def __len__(self) -> int:
        return len(self.high)

    def hit(self, level: Floats | float) -> Bools:
        """(R,) whether each obstacle is hit at a level, or at one level per return (N,)."""
        h = np.broadcast_to(np.asarray(level, float), self.high.shape)[self.back]
        lowest = np.maximum(self.base, np.minimum(h, self.limit))
        return np.asarray((np.maximum(self.high[self.back], h) > self.bottom + TOUCH_M) & (lowest < self.top - TOUCH_M))

    def passes(self, level: Floats | float) -> Bools:
        """(N,) whether each return hits nothing."""
        ok = np.ones(len(self), np.bool_)
        ok[self.back[self.hit(level)]] = False
        return ok

    def lowest(self, start: float) -> Floats:
        """(N,) the lowest level at or above ``start`` that passes; inf if none does."""
        level = np.full(len(self), start)
        for _ in range(len(self.back) + 1):
            hit = np.flatnonzero(self.hit(level))
            if not len(hit):
                break
            np.maximum.at(level, self.back[hit], self._over(hit))
            done = np.isinf(level)
            if done[self.back[hit]].all():
                break
        return level

    def together(self, start: float, returns: Bools | None = None) -> float:
        """The lowest level at or above ``start`` that all of ``returns`` pass (default: all returns); inf if none."""
        mine = np.ones(len(self), np.bool_) if returns is None else returns
        level = start
        for _ in range(len(self.back) + 1):
            hit = np.flatnonzero(self.hit(level) & mine[self.back])
            if not len(hit):
                break
            level = max(level, float(self._over(hit).max()))
            if level == np.inf:
                break
        return level

    def highest(self, level: float) -> float:
        """The highest level to which ``level``, which passes all returns, may be raised; inf if nothing bounds it."""
        h = np.minimum(level, self.limit)
        under = np.maximum(self.base, h) < self.top - TOUCH_M
        return float(self.bottom[under].min(initial=np.inf))

    def kind(self) -> Indices:
        """(R,) `what` of each obstacle, with `UNKNOWN` for ground that is not known."""
        unknown = np.isinf(self.top) & ((self.what == GROUND) | (self.what == AHEAD))
        return np.where(unknown, UNKNOWN, self.what)

    def over(self) -> Floats:
        """(R,) the level that passes over each obstacle; inf if none does."""
        return self._over(np.arange(len(self.back)))

    def last_hit(self, start: float) -> Bools:
        """(R,) the obstacles that no level passes over, hit by returns that rise from ``start`` until nothing helps."""
        level, over = np.full(len(self), start), self.over()
        for _ in range(len(self.back) + 1):
            hit = self.hit(level)
            more = hit & np.isfinite(over) & (over > level[self.back])
            if not more.any():
                return hit & np.isinf(over)
            np.maximum.at(level, self.back[more], over[more])
        return np.zeros(len(self.back), np.bool_)

    def _over(self, rows: Indices) -> Floats:
        """The level that passes over each obstacle of ``rows``; inf if none does."""
        return np.where(self.top[rows] <= self.limit[rows], self.top[rows], np.inf)

    def take(self, returns: Bools) -> Obstacles:
        """The obstacles of the returns that are True in ``returns``."""
        number = np.cumsum(returns) - 1
        rows = returns[self.back]
        return Obstacles(
            self.high[returns], number[self.back[rows]], self.bottom[rows], self.top[rows], self.base[rows],
            self.limit[rows], self.what[rows],
        )  # fmt: skip

    @classmethod
    def join(cls, parts: Sequence[Obstacles]) -> Obstacles:
        """The obstacles of all parts, with their returns numbered one part after the other."""
        offset = np.cumsum([0, *(len(p) for p in parts)])
        back = np.concatenate([p.back + o for p, o in zip(parts, offset[:-1], strict=True)])
        names = ("bottom", "top", "base", "limit", "what")
        return cls(
            np.concatenate([p.high for p in parts]),
            back,
            *(np.concatenate([getattr(p, name) for p in parts]) for name in names),
        )

    def ordered(self, order: Indices) -> Obstacles:
        """The same obstacles with the returns in another order."""
        place = np.empty(len(order), np.intp)
        place[order] = np.arange(len(order))
        return Obstacles(self.high[order], place[self.back], self.bottom, self.top, self.base, self.limit, self.what)


GROUPS = 6
"""Most groups into which lines home of similar width are put; each group is judged with its greatest width."""

LEAST_IN_GROUP = 50

MOST_PIECES_HELD = 1_000_000
"""Most pieces of ground under lines home held at once, 80 MB; over 240 km of cells of 30 m there are millions."""

CIRCLE_ABOVE_M = 1000.0
"""The height above home, m, whose radius is used to judge a circle over home."""


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
    rule, limits, air = RETURN_RULES[vehicle.autopilot], vehicle.limits, trace.world.airspace
    n = len(parts)
    sides = parts if whole else TraceParts(parts.middle, parts.middle, parts.stretch)
    places = places_of_returns(trace, sides, target, vehicle)
    low = places.low
    start, reach, half_m, nearest = places.lines_home()
    end = np.tile(target.en, (n, 1))
    extra = half_m + (places.wide_m + places.bow_m) * air.scale
    aside = places.aside_m * air.scale
    there_m = at_home_m(limits)
    away = np.hypot(*(end - start).T) > there_m
    cone = rule.cone_amsl_m(target.cone_amsl_m, np.maximum(nearest, there_m))
    climb = vehicle.climb_m_s / vehicle.speed_max_m_s if math.isfinite(vehicle.climb_m_s) else 1.0
    found, step_m = _Builder(places.high), level_lines.step_of(air, start, end)

    def groups(which: Bools) -> list[Indices]:
        kinds = (np.flatnonzero(which & corner) for corner in (~places.corner, places.corner))
        return [some for kind in kinds for some in alike_in_width(extra + aside, kind)]

    for alike in groups(away):
        wide, spots = float((extra + aside)[alike].max()), []
        if not rule.climbs_first:
            _flies_home(found, air, limits, alike, (start, end), (reach, extra, aside), low, climb, step_m)
        for some in _in_turn(air, start, end, alike, step_m):
            met = level_lines.over(air, start[some], end[some], limits, wide, places.swept(some, air.scale), step_m)
            found.cost += len(met.piece_line)
            at = met.crossings
            i = some[at.line]
            if rule.climbs_first:
                found.ground(some, met, low[some], cone[some], np.full(len(some), np.inf))
                found.zones(i, at, low[i], cone[i])
                spots.append(some[np.unique(at.line[at.begins])])
            else:
                found.zones(i, at, -np.inf, low[i] + climb * np.maximum(at.s0_m - reach[i] - aside[i], 0.0))
        if rule.climbs_first and len(on_spot := np.concatenate(spots)):
            _climbs_on_the_spot(found, trace, sides, limits, on_spot, places)
    if rule.climbs_first:  # near home the altitude is not known: no zone may be within reach
        for some in groups(~away):
            wide, swept = float(extra[some].max()), places.swept(some, air.scale)
            met = level_lines.over(air, start[some], end[some], limits, wide, swept)
            i = some[met.crossings.line]
            found.zones(i, met.crossings, low[i], np.full(len(i), -np.inf))
        _brakes(found, trace, limits, places)
    else:
        for some in alike_in_width(extra + aside, np.arange(n)):
            wide = float((reach + places.wide_m * air.scale + aside)[some].max())
            met = level_lines.over(air, start[some], start[some], limits, wide)
            found.cost += len(met.piece_line)
            found.ground(some, met, -np.inf, low[some], low[some])
            i = some[met.crossings.line]
            found.zones(i, met.crossings, -np.inf, low[i])
    _over_home(found, trace, target, vehicle, n)
    if limits.max_amsl_m is not None:
        every = np.arange(n)
        found.ceiling(every, np.full(n, limits.max_amsl_m - limits.altitude_error_m), MAX_AMSL, (1,))
    return GradedObstacles(*found.by_grade(), found.cost)


def _flies_home(
    found: _Builder,
    air: Airspace,
    limits: Limits,
    some: Indices,
    lines: tuple[Floats, Floats],
    widths: tuple[Floats, Floats, Floats],
    low: Floats,
    climb: float,
    step_m: float,
) -> None:
    """Add the ground under planes that fly home from aside of the line: near home they are near the line.

    ``widths``: how far from a line's start its returns begin, its half width, and how far aside planes turn about.
    """
    reach, extra, aside = widths
    start, step = lines[0][some], (lines[1] - lines[0])[some]
    length = np.hypot(*step.T)
    for a, b in pairwise(ASIDE_PARTS):
        wide = float((extra + (1.0 - a) * aside)[some].max())
        spare = (reach + aside)[some] - a * length
        for k in _in_turn(air, start + a * step, start + b * step, np.arange(len(some)), step_m):
            met = level_lines.over(air, start[k] + a * step[k], start[k] + b * step[k], limits, wide, step_m=step_m)
            found.cost += len(met.piece_line)
            found.ground(some[k], met, -np.inf, *_climbs(met, low[some[k]], spare[k], climb))


def _in_turn(air: Airspace, starts: Floats, ends: Floats, some: Indices, step_m: float) -> Iterator[Indices]:
    """Parts of the lines ``some`` that have about `MOST_PIECES_HELD` pieces together, and of which only one is held."""
    for first, last in pairwise(level_lines.batches(air, starts[some], ends[some], MOST_PIECES_HELD, step_m)):
        yield some[first:last]


def _brakes(found: _Builder, trace: MissionTrace, limits: Limits, places: ReturnPlaces) -> None:
    """Add the ground ahead, over which a multicopter brakes at the altitude at which its return begins.

    The mission keeps min AGL, but where it climbs with the ground the vehicle brakes lower than that: only what it may
    meet counts here.
    """
    air = trace.world.airspace
    begin = places.regions[:, :4]
    first, tip = begin[:, 0], begin[:, 1]
    along = np.hypot(*(tip - first).T)
    aside = np.hypot(*(begin[:, 2:] - tip[:, None]).transpose(2, 0, 1)).max(axis=1)
    wide = aside + places.wide_m * air.scale
    for some in alike_in_width(wide, np.flatnonzero(along > TINY_M)):
        met = level_lines.over(air, first[some], tip[some], limits, float(wide[some].max()))
        found.cost += len(met.piece_line)
        found.ahead(some, met.clear_m, places.low[some])


def _climbs_on_the_spot(
    found: _Builder,
    trace: MissionTrace,
    sides: TraceParts,
    limits: Limits,
    spots: Indices,
    places: ReturnPlaces,
) -> None:
    """Add the zones that returns meet while they climb, which they may begin anywhere on each part of ``spots``.

    A zone's ceiling above ground elsewhere on the line home does not count here. Where the part itself, and where it
    brakes, is clear of ground and zones under the exact check, a zone that stands on the ground is below it, and not in
    the way.
    """
    air, parts = trace.world.airspace, sides.take(spots)
    begin, own, low = places.regions[spots, :4], trace.track_m[parts.stretch], places.low[spots]
    middle = 0.5 * (begin[:, 0] + begin[:, 1])
    wide_m = float((np.hypot(*(begin - middle[:, None]).transpose(2, 0, 1)).max(axis=1) + own * air.scale).max())
    at = level_lines.over(
        air, middle, middle, limits, wide_m,
        level_lines.Swept(begin, own * air.scale, begin=4, inner=places.inner[spots, :2]),
    ).crossings  # fmt: skip
    clear = trace.straight(parts)
    legs = [(trace.points(parts.start)[:, :3], trace.points(parts.end)[:, :3])]
    legs += [(np.column_stack([begin[:, 0], low]), np.column_stack([begin[:, k], low])) for k in (1, 2, 3)]
    for first, last in legs:
        moves = (first != last).any(axis=1)
        clear[moves] &= air.clear(
            Legs(
                first[moves],
                last[moves],
                np.zeros(int(moves.sum()), np.bool_),
                limits.track_error_m + own[moves],
                limits.altitude_error_m + trace.altitude_m[parts.stretch][moves],
            ),
            replace(limits, min_agl_m=0.0, max_amsl_m=None, max_agl_m=None, max_climb_deg=90.0, max_descent_deg=90.0),
        )
    stands = np.array([z.floor is None or z.floor == Level(0.0, "agl") for z in air.zones])
    met = at.take(~(stands[at.zone] & clear[at.line]))
    found.zones(spots[met.line], met, low[met.line], np.full(len(met.line), -np.inf))


def _over_home(found: _Builder, trace: MissionTrace, target: Target, vehicle: Vehicle, n: int) -> None:
    """Add the descent over home, or a plane's circle there, with which every return ends."""
    air, limits = trace.world.airspace, vehicle.limits
    if RETURN_RULES[vehicle.autopilot].climbs_first:
        at = level_lines.over(air, target.en[None], target.en[None], limits).crossings
        for zone, bottom, top in zip(at.zone.tolist(), at.bottom_m.tolist(), at.top_m.tolist(), strict=True):
            if top > target.ground_amsl_m:
                found.ceiling(np.arange(n), np.full(n, bottom), zone, (0, 1))
        return
    high = target.ground_amsl_m + CIRCLE_ABOVE_M
    circle = circle_home_m(RETURN_RULES[vehicle.autopilot].circle_m(high), vehicle, high)
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


def alike_in_width(extra: Floats, which: Indices) -> list[Indices]:
    """Groups of similar width, each in order."""
    heed_cancel()
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

    def ahead(self, i: Indices, top: Floats, low: Floats) -> None:
        """Add ground that is passed at ``low``, whatever the level."""
        for grade in (0, 1):
            self._put(grade, i, -np.inf, top, low, low, AHEAD)

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
