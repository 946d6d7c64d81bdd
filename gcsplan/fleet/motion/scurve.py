"""ArduPilot's S-curves: a straight leg flown from rest to rest with bounded speed, acceleration, jerk and snap.

A leg speeds up for `start_s`, flies at its peak speed, and slows down as it sped up. Speeding up is a ramp of the
acceleration (the jerk rises as a raised cosine for `rise_s`, holds, and falls), a constant acceleration, and the same
ramp down. Rules from SCurve.cpp (`calculate_path`, `kinematic_limit`), with the parameters' defaults.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats

__all__ = ["INPUT_TC_S", "Curves", "along_slope", "curves"]

INPUT_TC_S = 0.15
"""ATC_INPUT_TC, default: bounds the snap to half of jerk·π/(2·tc) (AC_WPNav.cpp, `calc_scurve_jerk_and_snap`)."""

Begun = tuple[Floats, Floats, Floats]

_NEWTON = 40
"""Most steps of the search for the acceleration that a short leg's length allows; it takes about six."""


@dataclass(frozen=True, eq=False, slots=True)
class Curves:
    """N legs, each (N,): length, peaks of jerk, acceleration and speed, and seconds of three risings.

    ``rise_s``: of the jerk to its peak. ``ramp_s``: of the acceleration. ``start_s``: of the speed, from rest.
    ``half_ramp_m``: metres flown in the first half of the ramp.
    """

    length_m: Floats
    jerk_m_s3: Floats
    accel_m_s2: Floats
    rise_s: Floats
    ramp_s: Floats
    start_s: Floats
    peak_m_s: Floats
    half_ramp_m: Floats

    @property
    def time_s(self) -> Floats:
        """Seconds from rest to rest."""
        return self.start_s + self.length_m / self.peak_m_s

    def of(self, legs: object) -> Curves:
        """The legs with these indices."""
        return Curves(*(getattr(self, name)[legs] for name in self.__slots__))

    def begun(self, t: Floats) -> Begun:
        """Acceleration, speed and metres flown ``t`` (..., N) seconds after the start, 0 to `start_s`."""
        late = t > 0.5 * self.start_s
        accel, speed, gone = self._rising(np.where(late, self.start_s - t, t))
        rest = self.start_s - t
        gone = np.where(late, self.peak_m_s * (0.5 * self.start_s - rest) + gone, gone)
        return accel, np.where(late, self.peak_m_s - speed, speed), gone

    def gone_m(self, t: Floats) -> Floats:
        """Metres flown ``t`` (N,) seconds after the start; 0 before it, and the whole length after the end."""
        t = np.clip(t, 0.0, self.time_s)
        left = self.time_s - t
        end = self.begun(np.minimum(np.minimum(t, left), self.start_s))[2]
        level = self.peak_m_s * (t - 0.5 * self.start_s)
        whole = np.where(t > self.start_s, level, end)
        return np.where(left < self.start_s, self.length_m - end, whole)

    def _rising(self, t: Floats) -> Begun:
        """Acceleration, speed and metres in the first half of the start: the ramp, and the constant acceleration."""
        ramp = self.ramp_s
        over, rest = np.maximum(t - ramp, 0.0), np.maximum(ramp - t, 0.0)
        accel, speed, gone = _jerked(np.minimum(np.minimum(t, rest), 0.5 * ramp), self.jerk_m_s3, self.rise_s)
        half_speed = 0.5 * self.accel_m_s2 * ramp
        whole = 2.0 * self.half_ramp_m + 0.125 * self.accel_m_s2 * ramp**2
        second = t > 0.5 * ramp
        gone = np.where(second, whole - half_speed * rest + 0.5 * self.accel_m_s2 * rest**2 - gone, gone)
        speed = np.where(second, half_speed - self.accel_m_s2 * rest + speed, speed)
        accel = np.where(second, self.accel_m_s2 - accel, accel)
        return accel, speed + self.accel_m_s2 * over, gone + half_speed * over + 0.5 * self.accel_m_s2 * over**2


def _jerked(t: Floats, jerk_m_s3: Floats, rise_s: Floats) -> Begun:
    """Acceleration, speed and metres in the first half of the ramp: the jerk rises, then holds."""
    half, turn = 0.5 * jerk_m_s3, math.pi / rise_s
    u = np.minimum(t, rise_s)
    sine, cosine = np.sin(turn * u), np.cos(turn * u)
    accel = half * (u - sine / turn)
    speed = half * (0.5 * u**2 + (cosine - 1.0) / turn**2)
    gone = half * (u**3 / 6.0 + sine / turn**3 - u / turn**2)
    x = t - u
    gone = gone + speed * x + 0.5 * accel * x**2 + jerk_m_s3 * x**3 / 6.0
    return accel + jerk_m_s3 * x, speed + accel * x + half * x**2, gone


def along_slope(run_m: Floats, rise_m: Floats, level: Floats, up: Floats, down: Floats) -> Floats:
    """(N,) the largest value along each leg whose horizontal part is at most ``level``, and its vertical part at most
    ``up`` or ``down``."""
    length = np.hypot(run_m, rise_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        across = np.where(run_m > 0.0, level * length / run_m, math.inf)
        upright = np.where(rise_m != 0.0, np.where(rise_m > 0.0, up, down) * length / np.abs(rise_m), math.inf)
    return np.minimum(across, upright)


def curves(length_m: Floats, speed_m_s: Floats, accel_m_s2: Floats, jerk_m_s3: float) -> Curves:
    """The S-curves of legs (N,) that are flown at ``speed_m_s`` at most, with ``accel_m_s2`` at most."""
    snap = 0.5 * jerk_m_s3 * math.pi / (2.0 * INPUT_TC_S)
    half_m = 0.5 * length_m
    # A leg that is too short, too slow or too gentle for the whole jerk has a shorter rise of it, and no plateau.
    slight = np.minimum(
        np.minimum((half_m * math.pi / (8.0 * snap)) ** 0.25, (speed_m_s * math.pi / (4.0 * snap)) ** (1.0 / 3.0)),
        np.sqrt(accel_m_s2 * math.pi / (2.0 * snap)),
    )
    rise = np.minimum(slight, jerk_m_s3 * math.pi / (2.0 * snap))
    jerk = np.where(slight <= rise, 2.0 * snap * rise / math.pi, jerk_m_s3)
    by_speed = 0.5 * jerk * (np.sqrt(rise**2 + 4.0 * speed_m_s / jerk) - rise)
    accel = np.minimum(np.minimum(accel_m_s2, by_speed), _accel_by_length(half_m, jerk, rise))
    accel = np.where(slight <= rise, jerk * rise, np.maximum(accel, jerk * rise))
    ramp = accel / jerk + rise
    steady = np.minimum(
        speed_m_s / accel - ramp, 0.5 * (np.sqrt(ramp**2 + 8.0 * half_m / accel) - 3.0 * ramp)
    )  # fmt: skip
    steady = np.maximum(steady, 0.0)
    half_ramp_m = _jerked(0.5 * ramp, jerk, rise)[2]
    return Curves(length_m, jerk, accel, rise, ramp, 2.0 * ramp + steady, accel * (ramp + steady), half_ramp_m)


def _accel_by_length(half_m: Floats, jerk: Floats, rise: Floats) -> Floats:
    """(N,) the peak acceleration a that ends its two ramps after ``half_m``: a·(a/jerk + rise)² = half_m."""
    a = np.cbrt(half_m * jerk**2)  # never below the root, and the function is convex: Newton falls towards it
    for _ in range(_NEWTON):
        ramp = a / jerk + rise
        step = (a * ramp**2 - half_m) / (ramp * (ramp + 2.0 * a / jerk))
        a = a - step
        if not (np.abs(step) > 1e-12 * a).any():
            break
    return np.asarray(a)
