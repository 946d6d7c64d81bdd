"""How long a return takes at most, in still air: what a base power (`gcsplan.vehicle.Energy`) needs to know of it."""

from __future__ import annotations

import math

from gcsplan.fleet.motion.timing import LAND_SLOWLY_M, PX4_LAND_SLOWLY_M
from gcsplan.vehicle import Autopilot, Vehicle

__all__ = ["return_s"]

CHANGES = 1.5
"""A flight home stops, starts and stops: each takes half of speed over acceleration longer than at full speed."""

OWN_METRES = 1.02
"""ArduPilot's own metres may be this much longer than those over ground, 150 km from home at most."""


def return_s(vehicle: Vehicle, way_m: float, rise_m: float, down_m: float, speed_m_s: float) -> float:
    """Seconds of a return without its wait over home: no fewer than the time table has (`fleet.timing`).

    ``way_m``: horizontal; ``rise_m``: from its beginning to its level, negative if that is lower; ``down_m``: from
    there to the ground at home; ``speed_m_s``: that of the mission where it begins (NaN: the vehicle's fastest). It is
    convex in the three lengths.
    """
    own_m_s = vehicle.speed_max_m_s if math.isnan(speed_m_s) else speed_m_s
    speed = own_m_s if vehicle.return_speed_m_s is None else min(own_m_s, vehicle.return_speed_m_s)
    # A rate that is not bounded is the speed in space.
    climb, descent, land = (
        speed if math.isinf(rate) else rate for rate in (vehicle.climb_m_s, vehicle.descent_m_s, vehicle.land_m_s)
    )
    slow_m = PX4_LAND_SLOWLY_M if vehicle.autopilot is Autopilot.PX4 else LAND_SLOWLY_M
    seconds = max(rise_m, 0.0) / climb + max(-rise_m, 0.0) / descent + down_m / descent
    seconds += min(down_m, slow_m) / min(land, descent)
    seconds += way_m / speed * (OWN_METRES if vehicle.lays_curves else 1.0)
    if math.isfinite(vehicle.vertical_accel_m_s2):
        seconds += (climb + 2.0 * descent) / vehicle.vertical_accel_m_s2
    if math.isfinite(vehicle.accel_m_s2):
        # PX4 brakes by 2 a/j seconds at the speed earlier (`fleet.smoothed`); without a bound of the jerk this is 0.
        jerks_s = (4.0 if vehicle.smooths else 2.0) * vehicle.accel_m_s2 / vehicle.leg_jerk_m_s3
        seconds += CHANGES * (speed / vehicle.accel_m_s2 + jerks_s)
    return seconds
