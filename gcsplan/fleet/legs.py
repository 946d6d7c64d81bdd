"""Legs flown from one standstill to the next, as the vehicle's autopilot flies them."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.fleet.curved import Curved, curved
from gcsplan.fleet.speeds import Stretch, rounded
from gcsplan.vehicle import Vehicle

__all__ = ["legs"]


def legs(
    points: Floats, vehicle: Vehicle, owner: Indices, leg: Indices | None = None, pace: Floats | None = None,
    rates_m_s: Floats | None = None,
) -> Stretch | Curved | None:  # fmt: skip
    """The stretch through ``points`` (N, 3) without a stop; None if nothing moves.

    ``owner`` (N - 1,) are the caller's numbers of the parts between them. Parts with the same number of ``leg`` (N -
    1,) are one leg, cut to follow the ground or a curve; None: each part is a leg. ``pace`` (N - 1,) is the speed that
    results from a cruise speed of 1, if that is not 1. ``rates_m_s`` (N - 1, 2) are the rates of climb and descent on
    each part, if they are not the vehicle's own.

    ArduPilot flies S-curves (`curved`) unless a motion key of the vehicle is not bounded; every other vehicle rounds
    its corners (`speeds`).
    """
    if vehicle.lays_curves and math.isfinite(vehicle.corner_accel_m_s2):
        numbers = np.arange(len(owner), dtype=np.intp) if leg is None else leg
        return curved(points, vehicle, owner, numbers, pace, rates_m_s)
    return rounded(points, vehicle, owner, pace, rates_m_s)
