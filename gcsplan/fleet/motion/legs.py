"""Legs flown from one standstill to the next, as the vehicle's autopilot flies them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.fleet.motion.ardupilot import Curved, curved
from gcsplan.fleet.motion.px4 import Smoothed, smoothed
from gcsplan.fleet.motion.speeds import Stretch, rounded
from gcsplan.vehicle import Vehicle
from gcsplan.world.geodesy.atmosphere import true_per_indicated

__all__ = ["Motion", "at_own_speed", "legs"]

Motion = Stretch | Curved | Smoothed
"""A flight from one standstill to the next, by the autopilot's own rules."""


def legs(
    points: Floats, vehicle: Vehicle, owner: Indices, leg: Indices | None = None, pace: Floats | None = None,
    rates_m_s: Floats | None = None, radius_m: Floats | None = None, follows: Bools | None = None,
) -> Motion | None:  # fmt: skip
    """The stretch through ``points`` (N, 3) without a stop; None if nothing moves.

    ``owner`` (N - 1,) are the caller's numbers of the parts between them. Parts with the same number of ``leg`` (N -
    1,) are one leg, cut to follow the ground or a curve; None: each part is a leg. ``pace`` (N - 1,) is the speed that
    results from a cruise speed of 1, if that is not 1. ``rates_m_s`` (N - 1, 2) are the rates of climb and descent on
    each part, ``radius_m`` (N - 1,) PX4's acceptance radius at its end, if they are not the vehicle's own; ``follows``
    (N - 1,) those that follow the ground.

    ArduPilot flies S-curves (`curved`) and PX4 smooths (`smoothed`) unless a motion key of the vehicle is not
    bounded; every other vehicle rounds its corners (`speeds`). A fixed wing keeps the airspeed that it indicates,
    so it is faster in thin air, and its rates of climb and descent are of the slopes that it flies.
    """
    if vehicle.keeps_airspeed:
        pace, rates_m_s = _in_air(points, vehicle, pace, rates_m_s)
    if vehicle.lays_curves and math.isfinite(vehicle.corner_accel_m_s2):
        numbers = np.arange(len(owner), dtype=np.intp) if leg is None else leg
        return curved(points, vehicle, owner, numbers, pace, rates_m_s, follows)
    if vehicle.smooths:
        return smoothed(points, vehicle, owner, pace, rates_m_s, radius_m)
    return rounded(points, vehicle, owner, pace, rates_m_s)


def at_own_speed(way: Motion, speed_m_s: float) -> Motion:
    """The same flight at ``speed_m_s``, whatever the cruise speed."""
    most_m_s = np.minimum(way.most_m_s, speed_m_s * way.per_cruise)
    return replace(way, most_m_s=most_m_s, per_cruise=np.full_like(way.per_cruise, math.inf))


def _in_air(points: Floats, vehicle: Vehicle, pace: Floats | None, rates_m_s: Floats | None) -> tuple[Floats, Floats]:
    """``pace`` and ``rates_m_s`` with the part of the true airspeed that is horizontal on each part, in still air."""
    d = np.diff(points, axis=0)
    length = np.linalg.norm(d, axis=1)
    level = np.hypot(d[:, 0], d[:, 1]) / np.where(length > 0.0, length, 1.0)
    faster = true_per_indicated(0.5 * (points[1:, 2] + points[:-1, 2]))
    rates = np.array([[vehicle.climb_m_s, vehicle.descent_m_s]]) if rates_m_s is None else rates_m_s
    return faster * level * (1.0 if pace is None else pace), faster[:, None] * rates
