"""The ends of a fixed wing's flight: climb-outs and approaches, straight or in circles, most natural ones first.

An end is described outwards from the ground: a slant of the necessary length, a straight piece at whose end the first
turn begins, and further turns where the heading is far off the direction of the path.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.fixed_wing.climb_out import (
    REACHED_M,
    above_slant,
    beside_strip,
    circle_missing_m,
    over_m,
    slant_shortage,
)
from gcsplan.check.fixed_wing.glide import flared
from gcsplan.check.motion.circles import circle_growth
from gcsplan.errors import NoMission
from gcsplan.mavlink.build.fixed_wing import pitch_deg
from gcsplan.mavlink.build.order import FLOWN_SLOPE
from gcsplan.mission_file import VehicleRequest
from gcsplan.planners.problem import Problem, lowest_amsl
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits

__all__ = ["FlightEnd", "circle_m", "goals", "starts"]


SHARPEST = math.radians(60.0)
"""The largest turn at a joint that the straight pieces are long enough for; a larger turn is split into several."""

STEP_DEG = 15.0
"""Step between the headings that are tried if none is requested."""

LONGER_M, LONGEST_M = 20.0, 6000.0
"""Climb-outs are lengthened in steps of the first, up to the second."""

SAMPLE_M = 10.0

CIRCLES_FROM_M, HIGHEST_CIRCLE_M = (20.0, 30.0, 45.0, 65.0, 90.0), 1000.0
"""Heights above home at which a climb-out goes over to circles, and the most that the circles may climb."""


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


def circle_m(problem: Problem) -> float:
    """Radius of the requested circle at the goal: whole metres, at least the turn radius."""
    return float(math.ceil(problem.turn_radius_m))


def starts(problem: Problem, request: VehicleRequest, sharp: Floats) -> Iterator[FlightEnd]:
    """Climb-outs, on the requested heading or the most natural ones first. Raises NoMission if there is none."""
    slope = math.tan(math.radians(pitch_deg(request.vehicle)))
    given = request.takeoff_heading_deg
    heading = None if given is None else math.radians(90.0 - given)
    found = False
    over = over_m(request.vehicle)
    for end in _ends(problem, request.start, slope, request.takeoff_agl_m, sharp, heading, 0.0, over):
        found = True
        yield end
    for end in () if found else _circles(problem, request.start, slope, request.takeoff_agl_m, sharp, heading, over):
        found = True
        yield end
    if not found:
        which = "on any heading" if given is None else f"on takeoff_heading_deg {given:g}"
        other = "start" if given is None else "heading"
        raise NoMission(
            f"{request.vehicle.name}: no climb-out {which} clears the ground, the zones and the ceiling at "
            f"{pitch_deg(request.vehicle)}° (max_climb_deg, whole degrees) and leads to where min AGL is met, straight "
            f"or in circles: another {other} or a steeper climb may{beside_strip(problem.airspace)}",
            reason="not_found",
        )


def goals(problem: Problem, request: VehicleRequest, sharp: Floats) -> Iterator[FlightEnd | None]:
    """Approaches, the most natural ones first; one None if it does not land. Raises NoMission if there is none."""
    if request.end != "land":
        yield None
        return
    slope = request.vehicle.limits.max_descent_slope * (1.0 - FLOWN_SLOPE)
    found = False
    for end in _ends(
        problem, request.goal, slope, request.approach_agl_m, sharp[::-1], None, request.vehicle.speed_max_m_s, 0.0
    ):
        found = True
        yield end
    if not found:
        raise NoMission(
            f"{request.vehicle.name}: no straight approach to the goal, on any heading, clears the ground and the "
            f"zones at max_descent_deg {request.vehicle.limits.max_descent_deg:g}: use end: loiter, or another goal"
            f"{beside_strip(problem.airspace)}",
            reason="not_found",
        )


def _ends(
    problem: Problem,
    place: tuple[float, float, float],
    slope: float,
    agl_m: float | None,
    sharp: Floats,
    heading: float | None,
    lands_m_s: float,
    over: float,
) -> Iterator[FlightEnd]:
    """The legal ends at ``place`` (on the ground), seen outwards from it; ``sharp`` (N, 3) is the path from there.

    ``lands_m_s`` is the speed of a landing, 0 for a take-off; ``over``: how far a take-off gets above its altitude, m.
    """
    ground, radius = np.array(place), problem.turn_radius_m
    run_m = radius * math.tan(0.5 * SHARPEST) + 20.0
    aim = _along(sharp, (float(sharp[0, 2]) - place[2]) / slope + run_m + 2.0 * radius)
    for one in _headings(ground, aim, heading):
        end = _end(problem, ground, one, slope, agl_m, aim, run_m, lands_m_s, over)
        if end is not None:
            yield end


def _headings(ground: Floats, aim: Floats, given: float | None) -> list[float]:
    """The requested heading alone; otherwise all headings, those nearest to the direction of ``aim`` first."""
    if given is not None:
        return [given]
    natural = math.atan2(aim[1] - ground[1], aim[0] - ground[0])
    steps = range(1, round(180.0 / STEP_DEG))
    turns = [0.0, *(side * math.radians(STEP_DEG) * i for i in steps for side in (1.0, -1.0)), math.pi]
    return [natural + turn for turn in turns]


def _end(
    problem: Problem,
    ground: Floats,
    heading: float,
    slope: float,
    agl_m: float | None,
    aim: Floats,
    run_m: float,
    lands_m_s: float,
    over: float,
) -> FlightEnd | None:
    """The shortest legal end on a heading; None if there is none."""
    air, limits = problem.airspace, problem.limits
    way = np.array([math.cos(heading), math.sin(heading)])
    wanted = ground[2] + max(agl_m or 0.0, limits.min_agl_m)
    slanted = _steep(limits)
    length = (wanted - ground[2]) / slope
    while length <= LONGEST_M:
        z = math.floor((ground[2] + slope * length - ground[2]) * 100.0) / 100.0 + ground[2]
        top = np.array([*(ground[:2] + length * way), z])
        chain = _chain(top, heading, aim, run_m, problem.turn_radius_m)
        needed = _floor(air, np.vstack([top, chain]), limits)
        if math.isinf(needed):
            return None
        if needed > z:
            length += max((needed - z) / slope, 1.0) if needed - z < 50.0 else LONGER_M
            continue
        if not _slant_clear(ground, top, limits, air, lands_m_s, over):
            return None
        if air.clear(Legs.of_path(np.vstack([top, chain]), slanted), slanted).all():
            return FlightEnd(ground, top, chain, heading)
        length += LONGER_M
    return None


def _slant_clear(ground: Floats, top: Floats, limits: Limits, air: Airspace, lands_m_s: float, over: float) -> bool:
    lines = [np.array([ground, top])]
    if lands_m_s > 0.0:
        below = flared(_three(top), _three(ground), math.dist(top[:2], ground[:2]), lands_m_s)
        lines += [np.array([b, a]) for a, b in pairwise(below)]
    elif not all(
        _column_clear(np.array(a), np.array(b), 0.0, limits, air, band_m)
        for a, b, band_m in above_slant(_three(ground), _three(top), limits, over)
    ):
        return False
    return all(
        _column_clear(line[0], line[1], 0.0, limits, air) and slant_shortage(line, ground, 0.0, limits, air) is None
        for line in lines
    )


def _three(point: Floats) -> tuple[float, float, float]:
    return float(point[0]), float(point[1]), float(point[2])


def _column_clear(
    low: Floats, high: Floats, reach_m: float, limits: Limits, air: Airspace, band_m: float = 0.0
) -> bool:
    """Whether zones and ceilings are clear from ``low`` to ``high``, ``reach_m`` around and ``band_m`` up and down."""
    track, height = np.array([limits.track_error_m + reach_m]), np.array([limits.altitude_error_m + band_m])
    legs = Legs(low[None], high[None], np.ones(1, bool), track, height)
    return bool(air.clear(legs, _steep(limits)).all())


def _steep(limits: Limits) -> Limits:
    return replace(limits, max_climb_deg=90.0, max_descent_deg=90.0)


def _circles(
    problem: Problem,
    place: tuple[float, float, float],
    slope: float,
    agl_m: float | None,
    sharp: Floats,
    heading: float | None,
    over: float,
) -> Iterator[FlightEnd]:
    """Short climb-outs that continue in circles, up to where the first leg is legal in any direction."""
    air, limits, radius = problem.airspace, problem.limits, circle_m(problem)
    ground, aim = np.array(place), _along(sharp, 6.0 * radius)
    wanted = place[2] + max(agl_m or 0.0, limits.min_agl_m)
    for one in _headings(ground, aim, heading):
        way = np.array([math.cos(one), math.sin(one)])
        for low_m in CIRCLES_FROM_M:
            top = np.array([*(ground[:2] + low_m / slope * way), place[2] + low_m])
            if not _slant_clear(ground, top, limits, air, 0.0, over):
                break
            for side in (0.5 * math.pi, -0.5 * math.pi, 0.0):  # middle left, right (both on the circle) or ahead
                towards = np.array([math.cos(one + side), math.sin(one + side)])
                high = _circle(problem, top + np.array([*(radius * towards), 0.0]), wanted, aim)
                if high is None:
                    continue
                middle, half = 0.5 * (high[0, 2] + top[2]), 0.5 * (high[0, 2] - top[2])
                line = np.array([[*ground[:2], middle], [*top[:2], middle]])  # it may fly there above the slant
                if _column_clear(line[0], line[1], 0.0, limits, air, half):  # ArduPlane: negative is anticlockwise
                    yield FlightEnd(ground, top, high[1:], one, high[0], -radius if side > 0.0 else radius)


def _circle(problem: Problem, middle: Floats, wanted_m: float, aim: Floats) -> Floats | None:
    """(2, 3) the point over a circle's middle, at the altitude that its first leg needs, and the end of that leg."""
    air, limits, radius = problem.airspace, problem.limits, circle_m(problem)
    reach_m = radius * circle_growth(middle[2] + HIGHEST_CIRCLE_M)
    if circle_missing_m(middle, reach_m, limits, air) > 0.0:
        return None
    wide = replace(_steep(limits), track_error_m=limits.track_error_m + reach_m)
    off = math.atan2(aim[1] - middle[1], aim[0] - middle[0])
    run_m = reach_m + radius * math.tan(0.5 * SHARPEST) + 20.0
    there = middle[:2] + run_m * np.array([math.cos(off), math.sin(off)])
    needed = max(_floor(air, np.array([[*middle[:2], 0.0], [*there, 0.0]]), wide), wanted_m)
    if not middle[2] < needed <= middle[2] + HIGHEST_CIRCLE_M:
        return None
    z = middle[2] + math.ceil((needed - middle[2]) * 100.0 - 1e-6) / 100.0 + REACHED_M  # it may leave that much lower
    line = np.array([[*middle[:2], z], [*there, z]])
    clear = _column_clear(middle, line[0], reach_m, limits, air) and air.clear(Legs.of_path(line, wide), wide).all()
    return line if clear else None


def _chain(top: Floats, heading: float, aim: Floats, run_m: float, radius: float) -> Floats:
    """(N, 3) level corners after the slant, until the direction to ``aim`` is a turn of at most `SHARPEST`."""
    z, here = float(top[2]), top[:2]
    points = []
    for k in range(5):
        step = run_m if k == 0 else run_m + radius * math.tan(0.5 * SHARPEST)
        here = here + step * np.array([math.cos(heading), math.sin(heading)])
        points.append([*here, z])
        off = math.atan2(aim[1] - here[1], aim[0] - here[0]) - heading
        off = (off + math.pi) % (2.0 * math.pi) - math.pi
        if abs(off) <= SHARPEST:
            break
        heading += math.copysign(SHARPEST, off)
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
