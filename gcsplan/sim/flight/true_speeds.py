"""What a commanded speed comes to over ground: in ArduPilot's metres, and in thin air."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gcsplan.check.stretch import Stretch
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.world.world import World

__all__ = ["SAME_M", "as_measured", "in_thin_air"]

SAME_M = 0.01
"""Metres: positions nearer than this are the same."""
METRES_PER_DEGREE = 0.011131884502145034 * 1e7
"""Metres per degree of latitude in ArduPilot (`LOCATION_SCALING_FACTOR`)."""


def as_measured(s: Stretch, mission: Mission, world: World) -> Stretch:
    """Return a leg with its true speed over ground, because ArduPilot flies the commanded speed in its own metres.

    Those are measured on a sphere, from home; longitudes are scaled by the cosine of the latitude midway between home
    and the way point (`Location::get_vector_xy_from_origin_NE`).
    """
    if s.column:
        return s
    home_lat, home_lon = mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7

    def from_home(lat: float, lon: float) -> tuple[float, float]:
        east = math.remainder(lon - home_lon, 360.0) * math.cos(math.radians(lat + home_lat) / 2.0)
        return east * METRES_PER_DEGREE, (lat - home_lat) * METRES_PER_DEGREE

    counted_m = math.dist(from_home(*s.start[:2]), from_home(*s.end[:2]))
    places = np.array([s.start[:2], s.end[:2]])
    true_m = math.dist(*world.frame.to_plane(places[:, 0], places[:, 1]).tolist())
    return s if counted_m <= SAME_M else replace(s, speed_m_s=s.speed_m_s * true_m / counted_m)


def in_thin_air(s: Stretch, kinematics: Kinematics) -> Stretch:
    """Return a stretch with the true airspeed at its middle in place of the indicated one, and rates to match."""
    kelvin_per_288 = 1.0 - 0.0065 * 0.5 * (s.start[2] + s.end[2]) / 288.15
    faster = kelvin_per_288 ** (-0.5 * (9.80665 / (287.053 * 0.0065) - 1.0))  # the standard atmosphere
    climb, descent = s.rates_m_s or (kinematics.climb_m_s, kinematics.descent_m_s)
    return replace(s, speed_m_s=s.speed_m_s * faster, rates_m_s=(climb * faster, descent * faster))
