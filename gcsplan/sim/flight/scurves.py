"""Legs between two standstills as ArduPilot's copter flies them, stepped in time.

Each leg is laid out as an S-curve from rest to rest. While it brakes, the autopilot looks at every step whether it may
begin the next leg: from then on both motions are added. This module steps through the curves; it shares no code with
`gcsplan.fleet.motion.ardupilot.curved`, which solves for the same motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.check.motion.stretch import Stretch
from gcsplan.sim.flight.kinematics import Kinematics

__all__ = ["leg_limits", "step_legs"]

CURVE_STEP_S = 0.01
"""Time step of the curves and of the look at the next leg."""
TRAIL_STEP_S, TERRAIN_MARGIN_M = 0.05, 10.0
"""Time step over ground that is followed; WPNAV_TER_MARGIN, default."""
RAMP_SAMPLE_S = 0.25
"""Time between places while a leg speeds up or slows down."""
LAG_S, LAG_FROM, REST_M_S = 0.36, 0.6, 0.96
"""Measured on ArduCopter 4.7: speeding up by a factor f takes LAG_S·(ln f - LAG_FROM) longer than the curves, for they
wait for the vehicle; a standstill counts as REST_M_S."""
JERK_RISE_S = 0.3
"""Seconds in which the jerk rises to its peak: twice ATC_INPUT_TC."""
CURVE_HALVINGS = 50


@dataclass(frozen=True, eq=False, slots=True)
class _CurvedLeg:
    """One leg: its start step by step (seconds, acceleration, speed, metres), and how long it keeps its peak speed.

    ``points`` (P, 3): from its beginning, metres; two for a straight leg, more for a curve. ``along_m`` (P,).
    """

    points: Floats
    along_m: Floats
    length_m: float
    t: Floats
    accel_m_s2: Floats
    speed_m_s: Floats
    gone_m: Floats
    level_s: float

    @property
    def start_s(self) -> float:
        return float(self.t[-1])

    @property
    def time_s(self) -> float:
        return 2.0 * self.start_s + self.level_s

    def at(self, t: Floats) -> Floats:
        """(N, 3) metres flown after ``t`` (N,) seconds."""
        gone = np.interp(t, *self._knots)
        return np.stack([np.interp(gone, self.along_m, axis) for axis in self.points.T], axis=1)

    @property
    def _knots(self) -> tuple[Floats, Floats]:
        return (
            np.append(self.t, self.time_s - self.t[::-1]),
            np.append(self.gone_m, self.length_m - self.gone_m[::-1]),
        )

    @property
    def bends_s(self) -> Floats:
        """Seconds at which it passes its inner points."""
        seconds, gone = self._knots
        return np.asarray(np.interp(self.along_m[1:-1], gone, seconds))

    @property
    def ways(self) -> tuple[Floats, Floats]:
        """Unit vectors (3,) at its beginning and at its end."""
        first, last = self.points[1] - self.points[0], self.points[-1] - self.points[-2]
        return first / np.linalg.norm(first), last / np.linalg.norm(last)


def step_legs(
    ways: Sequence[Floats], speed_m_s: Floats, accel_m_s2: Floats, kinematics: Kinematics
) -> tuple[Floats, Floats, Indices]:
    """Times (M,), places (M, 3) and legs (M,) of a flight along ``ways``, from rest to rest.

    ``ways``: (P, 3) points of each of L legs, more than two for a curve; each begins where the one before ends.
    ``speed_m_s``, ``accel_m_s2`` (L,) are the most along each leg. The leg of a sample is the one flown up to it; it
    changes in the middle of the turn.
    """
    legs = [
        _lay_out(way, float(v), float(a), kinematics.leg_jerk_m_s3)
        for way, v, a in zip(ways, speed_m_s, accel_m_s2, strict=True)
    ]
    begin, turned, slow = [0.0], [], [REST_M_S]
    for k in range(len(legs) - 1):
        overlap_s, turning_m_s = _begins_early(legs[k], legs[k + 1], min(speed_m_s[k], speed_m_s[k + 1]), kinematics)
        end = begin[k] + legs[k].time_s
        begin.append(end - overlap_s)
        turned.append(end - 0.5 * overlap_s)
        slow.append(max(turning_m_s, REST_M_S))
    times = _sample_times(legs, begin, turned)
    places = np.tile(ways[0][0], (len(times), 1))
    for leg, since in zip(legs, begin, strict=True):
        after = int(np.searchsorted(times, since))
        places[after:] += leg.at(times[after:] - since)
    late = np.zeros_like(times)
    for leg, since, from_m_s in zip(legs, [0.0, *turned], slow, strict=True):
        behind = LAG_S * (math.log(max(float(leg.speed_m_s[-1]) / from_m_s, 1.0)) - LAG_FROM)
        late += np.interp(times, [since, since + 0.5 * leg.start_s], [0.0, max(behind, 0.0)])
    return times + late, places, np.searchsorted(turned, times - 1e-6).astype(np.intp)


def leg_limits(parts: Floats, way: Floats, stretch: Stretch, kinematics: Kinematics) -> tuple[float, float]:
    """The highest speed and acceleration along a leg ``way`` (3,) that leads through the places ``parts`` (P, 3)."""
    climb, descent = stretch.rates_m_s or (kinematics.climb_m_s, kinematics.descent_m_s)
    took_s, free_m_s = 0.0, []
    for part, amsl_m in zip(np.diff(parts, axis=0), 0.5 * (parts[1:, 2] + parts[:-1, 2]), strict=True):
        length, rise = float(np.linalg.norm(part)), float(part[2])
        most = stretch.speed_m_s * length / max(math.hypot(part[0], part[1]), 1e-9)
        level = math.hypot(part[0], part[1]) / length
        free_m_s.append(level * kinematics.leaning_m_s(rise / length, float(amsl_m), most))
        if math.isinf(climb if rise > 0 else descent):  # the commanded speed is the speed in space
            most = stretch.speed_m_s
        elif rise:
            most = min(most, (climb if rise > 0 else descent) * length / abs(rise))
        took_s += length / kinematics.leaning_m_s(rise / length, float(amsl_m), most)
    length, run, rise = float(np.linalg.norm(way)), math.hypot(way[0], way[1]), abs(float(way[2]))
    if stretch.terrain and math.isfinite(climb) and math.isfinite(descent):
        took_s = _trailing_s(parts, free_m_s, climb, descent, kinematics)
    level, upright = kinematics.leg_accel_m_s2, kinematics.vertical_accel_m_s2
    accel = min(level * length / max(run, 1e-9), upright * length / max(rise, 1e-9))
    return length / took_s, accel


def _trailing_s(parts: Floats, free_m_s: list[float], climb: float, descent: float, kinematics: Kinematics) -> float:
    """Seconds along the ends ``parts`` (N + 1, 3) of pieces over the ground, step by step.

    ArduCopter's height follows the ground's with its rates, and it flies the slower the more it is off: at full speed
    within half of WPNAV_TER_MARGIN, not at all at the whole (AC_PosControl.cpp, `pos_offset_z_scaler`).
    """
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(parts[:, :2], axis=0).T)))
    gone_m, height_m, upward, speed, now_s = 0.0, float(parts[0, 2]), 0.0, free_m_s[0], 0.0
    up_m_s2, level_m_s2, k, last = kinematics.vertical_accel_m_s2, kinematics.leg_accel_m_s2, 0, len(free_m_s) - 1
    ends, heights = along.tolist(), parts[:, 2].tolist()
    while gone_m < ends[-1]:
        while k < last and gone_m >= ends[k + 1]:
            k += 1
        share = (gone_m - ends[k]) / max(ends[k + 1] - ends[k], 1e-9)
        short_m = heights[k] + share * (heights[k + 1] - heights[k]) - height_m
        stops = math.copysign(math.sqrt(2.0 * up_m_s2 * abs(short_m)), short_m)
        upward += min(max(min(max(stops, -descent), climb) - upward, -up_m_s2 * TRAIL_STEP_S), up_m_s2 * TRAIL_STEP_S)
        height_m += upward * TRAIL_STEP_S
        pace = min(max((TERRAIN_MARGIN_M - abs(short_m)) / (0.5 * TERRAIN_MARGIN_M), 0.01), 1.0) * free_m_s[k]
        change = level_m_s2 * TRAIL_STEP_S
        speed = max(speed + min(max(pace - speed, -change), change), 0.01 * free_m_s[k])
        gone_m += speed * TRAIL_STEP_S
        now_s += TRAIL_STEP_S
    return float(now_s - (gone_m - ends[-1]) / speed)


def _sample_times(legs: list[_CurvedLeg], begin: list[float], turned: list[float]) -> Floats:
    """Times from 0 to the end: close together where a leg speeds up or slows down."""
    found = [np.array(turned), np.array([begin[-1] + legs[-1].time_s])]
    for leg, since in zip(legs, begin, strict=True):
        ramp = np.append(np.arange(0.0, leg.start_s, RAMP_SAMPLE_S), leg.start_s)
        found += [since + ramp, since + leg.time_s - ramp, since + leg.bends_s]
    times = np.unique(np.round(np.concatenate(found), 6))
    return np.asarray(times[np.append(True, np.diff(times) > 0.1 * CURVE_STEP_S)])


def _begins_early(
    leg: _CurvedLeg, after: _CurvedLeg, slowest_m_s: float, kinematics: Kinematics
) -> tuple[float, float]:
    """How long before the end of ``leg`` the next one begins, and the speed in the middle of the turn.

    It begins at the first step of the braking at which all is right.
    """
    left = np.arange(min(leg.start_s, after.start_s), 0.0, -CURVE_STEP_S)
    into, out = leg.ways[1], after.ways[0]

    def added(of: str, sign: float) -> Floats:
        """(N, 3) what both legs add up to in the middle of each overlap."""
        one, two = np.interp(0.5 * left, leg.t, getattr(leg, of)), np.interp(0.5 * left, after.t, getattr(after, of))
        return np.asarray(two[:, None] * out + sign * one[:, None] * into)

    place, speed, accel = added("gone_m", -1.0), added("speed_m_s", 1.0), added("accel_m_s2", -1.0)
    right = (
        (np.linalg.norm(place, axis=1) < kinematics.cut_m)
        & (np.linalg.norm(speed, axis=1) < slowest_m_s + 1e-3)
        & (np.hypot(accel[:, 0], accel[:, 1]) < 2.0 * kinematics.corner_accel_m_s2 + 1e-3)
        & (np.abs(accel[:, 2]) < kinematics.vertical_accel_m_s2 + 1e-3)
    )
    if not right.any():
        return 0.0, 0.0
    first = int(right.argmax())
    return float(left[first]), float(np.linalg.norm(speed[first]))


def _lay_out(way: Floats, speed_m_s: float, accel_m_s2: float, jerk_m_s3: float) -> _CurvedLeg:
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1)))
    length_m = float(along[-1])
    t, accel, speed, gone = _start(length_m, speed_m_s, accel_m_s2, jerk_m_s3)
    level_s = max(length_m - 2.0 * float(gone[-1]), 0.0) / float(speed[-1])
    return _CurvedLeg(way - way[0], along, length_m, t, accel, speed, gone, level_s)


@lru_cache(maxsize=256)
def _start(
    length_m: float, speed_m_s: float, accel_m_s2: float, jerk_m_s3: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Seconds, acceleration, speed and metres at every step of the fastest start that the leg allows."""

    def fits(accel: float, steady_s: float) -> bool:
        ramp_s = _ramp(accel, jerk_m_s3)[0]
        peak = accel * (ramp_s + steady_s)
        return peak <= speed_m_s and peak * (2.0 * ramp_s + steady_s) <= length_m

    accel = _largest(accel_m_s2, lambda a: fits(a, 0.0))
    steady_s = _largest(speed_m_s / accel, lambda t: fits(accel, t)) if accel == accel_m_s2 else 0.0
    ramp_s, rise_s, jerk = _ramp(accel, jerk_m_s3)
    total_s = 2.0 * ramp_s + steady_s
    t = np.linspace(0.0, total_s, max(2, math.ceil(total_s / CURVE_STEP_S)) + 1)

    def pushed(since: Floats) -> Floats:
        """The jerk of one ramp: it rises and falls as a cosine."""
        edge = np.clip(np.minimum(since, ramp_s - since) / rise_s, 0.0, 1.0)
        return np.asarray(0.5 * jerk * (1.0 - np.cos(math.pi * edge)))

    rising = _summed(pushed(t) - pushed(t - ramp_s - steady_s), t)
    rising *= accel / rising.max()  # what the steps have lost
    faster = _summed(rising, t)
    return t, rising, faster, _summed(faster, t)


def _ramp(accel: float, jerk_m_s3: float) -> tuple[float, float, float]:
    """Seconds of an acceleration's rise, seconds of the jerk's rise in it, and the jerk's peak."""
    if accel >= jerk_m_s3 * JERK_RISE_S:
        return accel / jerk_m_s3 + JERK_RISE_S, JERK_RISE_S, jerk_m_s3
    part = math.sqrt(accel / (jerk_m_s3 * JERK_RISE_S))  # the jerk rises as fast, but not as far
    return 2.0 * JERK_RISE_S * part, JERK_RISE_S * part, jerk_m_s3 * part


def _largest(most: float, fits: Callable[[float], bool]) -> float:
    """The largest value up to ``most`` that fits."""
    if fits(most):
        return most
    low, high = 0.0, most
    for _ in range(CURVE_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low or high


def _summed(values: Floats, t: Floats) -> Floats:
    return np.append(0.0, np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t)))
