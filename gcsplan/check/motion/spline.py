"""The curve that ArduCopter flies to a SPLINE_WAYPOINT, as chords and how far the curve bulges from each chord.

It is a cubic Hermite curve between two way points with a direction at each end. The directions are shortened if their
lengths together exceed `LONGEST` times the distance (ArduCopter 4.1 and later: SplineCurve.cpp,
`set_origin_and_destination`; AC_WPNav.cpp, `set_spline_destination`). The curve leaves along the leg before it, or with
no direction if the aircraft stopped. It arrives parallel to the leg after it or, if that is a spline too, to the line
from this curve's beginning to that one's end. In simulation ArduCopter 4.6.0 flew within 1.2 m of these chords, 57 m
beside the straight line.

It has half of the accelerations of a straight leg, across and along (SplineCurve.cpp, `calc_dt_speed_max`), and slows
down within a bend, not ahead of it. `mean_speed_m_s` is the speed of the whole curve.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.motion.commands import Pace
from gcsplan.check.motion.stretch import Place, degree_m, offset_m
from gcsplan.fleet.motion.ardupilot import FULL_ACCEL
from gcsplan.fleet.motion.scurve import along_slope, curves
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.vehicle import Vehicle

LONGEST = 4.0  # SPLINE_FACTOR
BULGE_M = 0.25
MOST_CHORDS = 200
LOOKS, BESIDE, STILL = 16, 1e-5, 1e-6
"""Samples per piece; offset of the samples on both sides of a place, as a part of the curve; and the part of its
fastest speed below which a curve counts as standing still."""


SPLINE_ACCEL_PART = 0.5
"""TANGENTIAL_ACCEL_SCALER, LATERAL_ACCEL_SCALER: the part of the accelerations that a curve is flown with."""

PASSES_TO = (cmd.WAYPOINT, cmd.SPLINE_WAYPOINT, cmd.LOITER_UNLIM, cmd.LOITER_TIME)
"""ArduCopter does not stop at a spline's end before these (mode_auto.cpp, `set_next_wp`)."""

SAMPLES, ROUNDS = 256, 12
"""Samples of a curve, and steps of the search for its mean speed, each of which halves the error."""

Direction = tuple[float, float, float]
"""East, north, up, metres."""

NO_DIRECTION: Direction = (0.0, 0.0, 0.0)


def towards(a: Place, b: Place) -> Direction:
    """The vector from ``a`` to ``b``."""
    return *offset_m(a, b), b[2] - a[2]


Slopes = list[tuple[float, float]]


def chords(start: Place, end: Place, leaving: Direction, arriving: Direction) -> tuple[list[Place], float, Slopes]:
    """The curve's points from ``start`` to ``end`` (both exact), its bulge beyond the chords, m, and its slopes.

    The slopes are, for each chord, the steepest rise over run of the curve over it, up and down (negative).
    """
    leaves, square, cube = _cubic(start, end, leaving, arriving)
    bend = max(float(np.linalg.norm(2.0 * square)), float(np.linalg.norm(2.0 * square + 6.0 * cube)))
    pieces = int(min(max(4, math.ceil(math.sqrt(bend / (8.0 * BULGE_M)))), MOST_CHORDS))
    t = np.linspace(0.0, 1.0, pieces + 1)[1:-1, None]
    points = leaves * t + square * t**2 + cube * t**3
    east_m, north_m = degree_m(0.5 * (start[0] + end[0]))
    inner = [(start[0] + n / north_m, start[1] + e / east_m, start[2] + u) for e, n, u in points.tolist()]
    return [start, *inner, end], bend / (8.0 * pieces**2), steepest_slopes(leaves, square, cube, pieces)


def _cubic(start: Place, end: Place, leaving: Direction, arriving: Direction) -> tuple[Floats, Floats, Floats]:
    """The coefficients of t, t² and t³, (3,) each, of the way from ``start``; t is 0 there and 1 at ``end``."""
    way, leaves, arrives = (np.array(d) for d in (towards(start, end), leaving, arriving))
    both = float(np.linalg.norm(leaves) + np.linalg.norm(arrives))
    most = LONGEST * float(np.linalg.norm(way))
    if both > most:
        leaves, arrives = leaves * (most / both), arrives * (most / both)
    return leaves, 3.0 * way - 2.0 * leaves - arrives, leaves + arrives - 2.0 * way


def slowed(pace: Pace, vehicle: Vehicle, ends: tuple[Place, Place], ways: tuple[Direction, Direction], to: int) -> Pace:
    """The pace of a spline, as a leg of its length. ``to``: the command after it; others see `mean_speed_m_s`."""
    stops = not any(ways[0]), not any(ways[1]) or to not in PASSES_TO
    return replace(pace, speed_m_s=mean_speed_m_s(*ends, ways, stops, vehicle, pace.speed_m_s, pace.rates_m_s))


def mean_speed_m_s(
    start: Place, end: Place, ways: tuple[Direction, Direction], stops: tuple[bool, bool], vehicle: Vehicle,
    speed_m_s: float, rates_m_s: tuple[float, float],
) -> float:  # fmt: skip
    """The speed at which an S-curve as long as the spline takes as long as the spline; ``speed_m_s`` at most.

    ``ways``: its directions at its beginning and its end; ``stops``: whether the vehicle stops there.
    """
    if not vehicle.lays_curves or not speed_m_s > 0.0:
        return speed_m_s
    level, upright = FULL_ACCEL * vehicle.accel_m_s2, vehicle.vertical_accel_m_s2
    leaves, square, cube = _cubic(start, end, *ways)
    t = np.linspace(0.0, 1.0, SAMPLES + 1)[:, None]
    points = leaves * t + square * t**2 + cube * t**3
    run = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = float(run.sum())
    if length <= 0.0:
        return speed_m_s
    velocity, bend = leaves + 2.0 * square * t + 3.0 * cube * t**2, 2.0 * square + 6.0 * cube * t
    pace = np.linalg.norm(velocity, axis=1)
    unit = np.divide(velocity, pace[:, None], out=np.zeros_like(velocity), where=pace[:, None] > STILL)
    across = bend - unit * (bend * unit).sum(axis=1)[:, None]
    along = _limit(unit, level, upright, upright) * SPLINE_ACCEL_PART
    turning = _limit(across, level, upright, upright) * SPLINE_ACCEL_PART
    most = np.minimum(_limit(unit, speed_m_s, *rates_m_s), 1e3)
    with np.errstate(divide="ignore", invalid="ignore"):
        bent = pace * np.sqrt(turning / np.linalg.norm(across, axis=1))
    most = np.where(pace > STILL, np.fmin(most, bent), most)
    away = np.linalg.norm(points - points[-1], axis=1)
    last = 0.0 if stops[1] else float(most[-1])
    most = np.minimum(most, np.sqrt(2.0 * along * away + last**2))
    now, seconds = 0.0 if stops[0] else float(most[0]), 0.0
    for top, gain, step in zip(most[1:].tolist(), (2.0 * along[:-1] * run).tolist(), run.tolist(), strict=True):
        then = min(max(top, math.sqrt(max(now * now - gain, 0.0))), math.sqrt(now * now + gain))
        seconds += 2.0 * step / max(now + then, 1e-3)
        now = then
    mean = length / seconds
    accel = np.array([level])
    for _ in range(ROUNDS):
        begins_s = float(curves(np.array([length]), np.array([mean]), accel, vehicle.leg_jerk_m_s3).start_s[0])
        left_s = seconds - 0.5 * sum(stops) * begins_s
        mean = 0.5 * (mean + min(length / max(left_s, length / speed_m_s), speed_m_s))
    return min(mean, speed_m_s)


def _limit(way: Floats, level: float, up: float, down: float) -> Floats:
    """(N,) the largest length along directions (N, 3) whose parts keep limits; ``level`` without a direction."""
    run = np.hypot(way[:, 0], way[:, 1])
    each = along_slope(run, way[:, 2], *(np.full(len(way), x) for x in (level, up, down)))
    return np.where(np.isfinite(each), each, level)


def steepest_slopes(leaves: Floats, square: Floats, cube: Floats, pieces: int) -> Slopes:
    """Steepest slopes of each piece, up and down: at its ends, at the slope's extremes, and at samples between.

    With the speed v(t), a quadratic in each direction, the slope is v_up / sqrt(r), r = v_east² + v_north². Its
    derivative is 0 at the roots of 2 v_up' r - v_up r': at most five. Where the curve stands still, at an end or within
    it, the slope is its limit on either side: a place `BESIDE` it is near enough. `LOOKS` samples of each piece are a
    safety net, because computed roots are inexact where several coincide.
    """
    speed = zip(leaves, 2.0 * square, 3.0 * cube, strict=True)
    east, north, up = (np.polynomial.Polynomial(coefficients) for coefficients in speed)
    level = east * east + north * north
    extremes = (2.0 * up.deriv() * level - up * level.deriv()).roots().real
    edges = np.linspace(0.0, 1.0, pieces + 1)
    near = np.concatenate([extremes, edges])
    t = np.concatenate([np.linspace(0.0, 1.0, pieces * LOOKS + 1), near, near - BESIDE, near + BESIDE])
    t = np.unique(t.clip(0.0, 1.0))
    run = np.hypot(east(t), north(t))
    moves = run > STILL * max(float(run.max()), 1e-9)
    if not moves.any():
        return [(np.inf, -np.inf)] * pieces
    t = t[moves]
    slope = up(t) / run[moves]
    first, last = np.searchsorted(t, edges[:-1], "left"), np.searchsorted(t, edges[1:], "right")
    return [(float(slope[a:b].max()), float(slope[a:b].min())) for a, b in zip(first, last, strict=True)]
