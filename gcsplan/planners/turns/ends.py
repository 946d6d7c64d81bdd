"""The ends of a fixed wing's flight, and a path joined to both: climb-outs and approaches, the most natural ones first.

A path of arcs has no heading at its ends, but a fixed wing has one at both. An end is described outwards from the
ground: a slant of the necessary length, a straight piece at whose end the first turn begins, and further turns where
the heading is far off the direction of the path. The turns at the joints are corners like any other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import count, islice, pairwise
from typing import Protocol, TypeVar

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.planners.problem import Problem, lowest_amsl
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.fly_by import flown_m, tangents_m, thinned
from gcsplan.world.geometry.limits import Limits

__all__ = [
    "EndJudge",
    "FlightEnd",
    "RequiredEnd",
    "around_m",
    "circling_ends",
    "column_clear",
    "cut_off_m",
    "joined",
    "numbers_of",
    "pairs",
    "problem_between",
    "straight_ends",
    "unfitting_legs",
]

Begin = TypeVar("Begin")
Finish = TypeVar("Finish")

SHARPEST_RAD = math.radians(60.0)
"""The largest turn at a joint that the straight pieces are long enough for; a larger turn is split into several."""

STEP_DEG = 15.0
"""Step between the headings that are tried if none is requested."""

LONGER_M, LONGEST_M, HIGHEST_M = 20.0, 6000.0, 1500.0
"""Climb-outs are lengthened in steps of the first, up to the second; upright ones in the same parts of the third."""

SAMPLE_M = 10.0

CIRCLES_FROM_M, HIGHEST_CIRCLE_M = (20.0, 30.0, 45.0, 65.0, 90.0), 1000.0
"""Heights above home at which a climb-out goes over to circles, and the most that the circles may climb."""


PART_OF_SLOPE = 0.9993
"""Factor on the slope limits: arcs are judged by their chords, which are shorter, and so steeper."""

LACKING_M = 0.05
"""Metres by which two arcs may be longer than their leg, and still fit."""


class EndJudge(Protocol):
    """The judge of an aircraft's clearance near the ground. The check knows it, and no planner."""

    @property
    def reached_m(self) -> float:
        """Metres below its altitude at which a climbing circle may end."""

    def slant_clear(self, ground: Floats, top: Floats) -> bool:
        """Whether the slant between two points (3,) is clear, with all that is flown above or below it."""

    def circle_growth(self, amsl_m: float) -> float:
        """The factor by which a circle is wider at an altitude."""

    def circle_missing_m(self, middle: Floats, reach_m: float) -> float:
        """Metres by which a circle around ``middle`` (3,) is too near to the ground; inf where that is unknown."""


@dataclass(frozen=True, eq=False, slots=True)
class RequiredEnd:
    """The required end: at ``ground`` (3,), with a slant as steep as ``slope``, to at least ``agl_m`` above it; upright
    if that is inf. ``run_m``: the least length of the level way behind it.

    ``heading``: the only one, radians from east to north, seen outwards; None for any. ``rank``: a heading of a lower
    rank is tried before others; of the same rank, the one nearer to the direction of the path.
    """

    ground: Floats
    slope: float
    agl_m: float | None
    heading: float | None
    judge: EndJudge
    rank: Callable[[float], float] = field(default=lambda heading: 0.0)
    run_m: float = 0.0


@dataclass(frozen=True, eq=False, slots=True)
class FlightEnd:
    """One end: from ``ground`` (3,) on a slant to ``top`` (3,), then through the level way points ``chain`` (N, 3).

    ``circle`` (3,): after the slant, the vehicle circles up to this point with radius ``circle_m`` (negative:
    anticlockwise).
    """

    ground: Floats
    top: Floats
    chain: Floats
    heading: float
    circle: Floats | None = None
    circle_m: float = 0.0

    @property
    def leaves(self) -> Floats:
        """Start of the first level leg: the end of the slant, or the top of the circles over their middle."""
        return self.top if self.circle is None else self.circle

    @property
    def slant(self) -> list[Floats]:
        """Its ground alone, seen from its top; nothing if that is upright."""
        return [] if math.dist(self.ground[:2], self.top[:2]) == 0.0 else [self.ground]


def around_m(problem: Problem) -> float:
    """Radius of a circle for waiting or climbing: whole metres, at least the turn radius."""
    return float(math.ceil(problem.turn_radius_m))


def straight_ends(problem: Problem, required: RequiredEnd, sharp: Floats) -> Iterator[FlightEnd]:
    """The legal ends, seen outwards from the ground; ``sharp`` (N, 3) is the path from there, without arcs."""
    ground, radius = required.ground, problem.turn_radius_m
    run_m = radius * math.tan(0.5 * SHARPEST_RAD) + max(required.run_m, 20.0)
    aim = _along(sharp, (float(sharp[0, 2]) - float(ground[2])) / required.slope + run_m + 2.0 * radius)
    for heading in _headings(ground, aim, required):
        end = _end(problem, required, heading, aim, run_m)
        if end is not None:
            yield end


def _headings(ground: Floats, aim: Floats, required: RequiredEnd) -> list[float]:
    """The requested heading alone; otherwise all by their rank, and the nearest to the direction of ``aim`` first."""
    if required.heading is not None:
        return [required.heading]
    natural = math.atan2(aim[1] - ground[1], aim[0] - ground[0])
    steps = range(1, round(180.0 / STEP_DEG))
    turns = [0.0, *(side * math.radians(STEP_DEG) * i for i in steps for side in (1.0, -1.0)), math.pi]
    return sorted((natural + turn for turn in turns), key=required.rank)


def _end(problem: Problem, required: RequiredEnd, heading: float, aim: Floats, run_m: float) -> FlightEnd | None:
    """The shortest legal end on a heading; None if there is none."""
    ground, slope = required.ground, required.slope
    air, limits = problem.airspace, problem.limits
    way = np.array([math.cos(heading), math.sin(heading)])
    least = ground[2] + max(required.agl_m or 0.0, limits.min_agl_m)
    slanted = _steep(limits)
    rise = least - ground[2]
    step = slope if math.isfinite(slope) else HIGHEST_M / LONGEST_M
    while rise <= step * LONGEST_M:
        z = math.floor(rise * 100.0) / 100.0 + ground[2]
        top = np.array([*(ground[:2] + rise / slope * way), z])
        chain = _chain(top, heading, aim, run_m, problem.turn_radius_m)
        needed = _floor(air, np.vstack([top, chain]), limits)
        if math.isinf(needed):
            return None
        if needed > z:
            rise += max(needed - z, step) if needed - z < 50.0 else LONGER_M * step
            continue
        if not required.judge.slant_clear(ground, top):
            return None
        if air.clear(Legs.of_path(np.vstack([top, chain]), slanted), slanted).all():
            return FlightEnd(ground, top, chain, heading)
        rise += LONGER_M * step
    return None


def column_clear(low: Floats, high: Floats, reach_m: float, limits: Limits, air: Airspace, band_m: float = 0.0) -> bool:
    """Whether zones and ceilings are clear from ``low`` to ``high``, ``reach_m`` around and ``band_m`` up and down."""
    track, height = np.array([limits.track_error_m + reach_m]), np.array([limits.altitude_error_m + band_m])
    legs = Legs(low[None], high[None], np.ones(1, bool), track, height)
    return bool(air.clear(legs, _steep(limits)).all())


def _steep(limits: Limits) -> Limits:
    return replace(limits, max_climb_deg=90.0, max_descent_deg=90.0)


def circling_ends(problem: Problem, required: RequiredEnd, sharp: Floats) -> Iterator[FlightEnd]:
    """Short climb-outs that continue in circles, up to where the first leg is legal in any direction."""
    air, limits, radius = problem.airspace, problem.limits, around_m(problem)
    ground, aim = required.ground, _along(sharp, 6.0 * radius)
    least = float(ground[2]) + max(required.agl_m or 0.0, limits.min_agl_m)
    for one in _headings(ground, aim, required):
        way = np.array([math.cos(one), math.sin(one)])
        for low_m in CIRCLES_FROM_M:
            top = np.array([*(ground[:2] + low_m / required.slope * way), ground[2] + low_m])
            if not required.judge.slant_clear(ground, top):
                break
            for side in (0.5 * math.pi, -0.5 * math.pi, 0.0):  # middle left, right (both on the circle) or ahead
                towards = np.array([math.cos(one + side), math.sin(one + side)])
                high = _circle(problem, required.judge, top + np.array([*(radius * towards), 0.0]), least, aim)
                if high is None:
                    continue
                middle, half = 0.5 * (high[0, 2] + top[2]), 0.5 * (high[0, 2] - top[2])
                line = np.array([[*ground[:2], middle], [*top[:2], middle]])  # it may fly there above the slant
                if column_clear(line[0], line[1], 0.0, limits, air, half):  # ArduPlane: negative is anticlockwise
                    yield FlightEnd(ground, top, high[1:], one, high[0], -radius if side > 0.0 else radius)


def _circle(problem: Problem, judge: EndJudge, middle: Floats, least_m: float, aim: Floats) -> Floats | None:
    """(2, 3) the point over a circle's middle, at the altitude that its first leg needs, and the end of that leg."""
    air, limits, radius = problem.airspace, problem.limits, around_m(problem)
    reach_m = radius * judge.circle_growth(middle[2] + HIGHEST_CIRCLE_M)
    if judge.circle_missing_m(middle, reach_m) > 0.0:
        return None
    wide = replace(_steep(limits), track_error_m=limits.track_error_m + reach_m)
    off = math.atan2(aim[1] - middle[1], aim[0] - middle[0])
    run_m = reach_m + radius * math.tan(0.5 * SHARPEST_RAD) + 20.0
    there = middle[:2] + run_m * np.array([math.cos(off), math.sin(off)])
    needed = max(_floor(air, np.array([[*middle[:2], 0.0], [*there, 0.0]]), wide), least_m)
    if not middle[2] < needed <= middle[2] + HIGHEST_CIRCLE_M:
        return None
    # It may leave the circle lower by the metres that the judge reports.
    z = middle[2] + math.ceil((needed - middle[2]) * 100.0 - 1e-6) / 100.0 + judge.reached_m
    line = np.array([[*middle[:2], z], [*there, z]])
    clear = column_clear(middle, line[0], reach_m, limits, air) and air.clear(Legs.of_path(line, wide), wide).all()
    return line if clear else None


def _chain(top: Floats, heading: float, aim: Floats, run_m: float, radius: float) -> Floats:
    """(N, 3) level corners after the slant, until the direction to ``aim`` is a turn of at most `SHARPEST_RAD`."""
    z, here = float(top[2]), top[:2]
    points = []
    for k in range(5):
        step = run_m if k == 0 else run_m + radius * math.tan(0.5 * SHARPEST_RAD)
        here = here + step * np.array([math.cos(heading), math.sin(heading)])
        points.append([*here, z])
        off = math.atan2(aim[1] - here[1], aim[0] - here[0]) - heading
        off = (off + math.pi) % (2.0 * math.pi) - math.pi
        if abs(off) <= SHARPEST_RAD:
            break
        heading += math.copysign(SHARPEST_RAD, off)
    return np.array(points)


def _floor(air: Airspace, points: Floats, limits: Limits) -> float:
    """The highest floor along a line of points, and at its end for any direction in which the path may continue."""
    low = lowest_amsl(air, float(points[-1, 0]), float(points[-1, 1]), limits)
    for a, b in pairwise(points):
        count = max(2, math.ceil(math.dist(a[:2], b[:2]) / SAMPLE_M) + 1)
        line = a[:2] + np.linspace(0.0, 1.0, count)[:, None] * (b[:2] - a[:2])
        low = max(low, float(air.floor_amsl(line[:, 0], line[:, 1], limits).max()))
    return low


def _along(points: Floats, metres: float) -> Floats:
    """(2,) the point of a track after ``metres``; its end if the track is shorter."""
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    return np.array([np.interp(metres, s, points[:, i]) for i in range(2)])


# -- a path between two ends -----------------------------------------------------------------------------------------


def pairs(begins: Iterator[Begin], finishes: Iterator[Finish]) -> Iterator[tuple[Begin, Finish]]:
    """All pairs of ends, the most natural ones first; neither end stays the same while all others are gone through."""
    left: list[Begin] = []
    right: list[Finish] = []
    for total in count():
        left += islice(begins, 1)
        right += islice(finishes, 1)
        if total > len(left) + len(right) - 2:
            return
        for k in range(total + 1):
            if k < len(left) and total - k < len(right):
                yield left[k], right[total - k]


def problem_between(problem: Problem, start: FlightEnd, goal: FlightEnd | None) -> Problem:
    """The planner's part: from the end of the climb-out and its turns to the beginning of the approach."""
    last = problem.goal if goal is None else numbers_of(goal.chain[-1])
    return replace(problem, start=numbers_of(start.chain[-1]), goal=last)


def joined(problem: Problem, inner: Floats, start: FlightEnd, goal: FlightEnd | None) -> Floats:
    """The way points (N, 3) of the path ``inner`` (M, 3) with both ends added, without the ends of the slants."""
    before = np.vstack([start.leaves, start.chain[:-1]])
    behind = np.empty((0, 3)) if goal is None else np.vstack([goal.chain[-2::-1], goal.top])
    points = thinned(np.vstack([before[1:], inner, behind]), problem.turn_radius_m)
    return _slowed(points, start.leaves, problem)


def _slowed(points: Floats, leaves: Floats, problem: Problem) -> Floats:
    """Lower ``points`` where they are too steep: arcs at the joints, unknown to the planner, shorten legs."""
    flown = flown_m(np.vstack([leaves, points]), problem.turn_radius_m)[1:]
    up, down = (PART_OF_SLOPE * s for s in (problem.limits.max_climb_slope, problem.limits.max_descent_slope))
    z = points[:, 2].copy()
    for i in range(1, len(z) - 1):
        z[i] = min(z[i], z[i - 1] + up * flown[i - 1])
    for i in range(len(z) - 2, 0, -1):
        z[i] = min(z[i], z[i + 1] + down * flown[i])
    return np.column_stack([points[:, :2], z])


def unfitting_legs(points: Floats, start: FlightEnd, goal: FlightEnd | None, radius_m: float) -> Indices:
    """The legs between whose corners, joints included, the arcs do not fit; leg 0 leaves the climb-out."""
    whole = np.array([start.leaves, *points, *([] if goal is None else goal.slant)])
    tangent = tangents_m(whole, radius_m)
    run = np.hypot(*np.diff(whole[:, :2], axis=0).T)
    return np.flatnonzero(tangent[:-1] + tangent[1:] > run + LACKING_M)


def cut_off_m(points: Floats, start: FlightEnd, goal: FlightEnd | None, radius_m: float) -> float:
    """Metres by which the flown path may be shorter than from the end of the climb-out to the approach: the arcs cut
    off both joints, and circles do not pass their middle. ``points`` (N, 3) begin behind the first joint."""
    whole = np.vstack([*start.slant, start.leaves, points, *([] if goal is None else goal.slant)])
    tangent = tangents_m(whole, radius_m)
    cut_m = 2.0 * (tangent - radius_m * np.arctan(tangent / radius_m))
    return float(cut_m[1] + cut_m[-2]) + abs(start.circle_m)


def numbers_of(point: Floats) -> tuple[float, float, float]:
    """East, north and altitude of a point (3,)."""
    return float(point[0]), float(point[1]), float(point[2])
