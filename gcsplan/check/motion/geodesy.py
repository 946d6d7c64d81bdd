"""Distances between places in degrees, without a projected plane."""

from __future__ import annotations

import math
from functools import lru_cache

from gcsplan.check.motion.stretch import Place

EQUATOR_M, ECCENTRICITY_2 = 6_378_137.0, 6.694379990141e-3  # WGS84


def degree_m(lat_deg: float) -> tuple[float, float]:
    """Metres per degree of longitude and per degree of latitude, at a latitude on the WGS84 ellipsoid."""
    lat = math.radians(lat_deg)
    w = 1.0 - ECCENTRICITY_2 * math.sin(lat) ** 2
    east, north = EQUATOR_M / math.sqrt(w) * math.cos(lat), EQUATOR_M * (1.0 - ECCENTRICITY_2) / w**1.5
    return math.radians(east), math.radians(north)


@lru_cache(maxsize=1024)
def offset_m(a: Place, b: Place) -> tuple[float, float]:
    """Metres east and north from ``a`` to ``b``, by the ellipsoid's radii at mid latitude: 1e-6 off over 100 km."""
    east, north = degree_m(0.5 * (a[0] + b[0]))
    return east * ((b[1] - a[1] + 180.0) % 360.0 - 180.0), north * (b[0] - a[0])


def flat_m(a: Place, b: Place) -> float:
    """Horizontal distance in metres, by `offset_m`."""
    return math.hypot(*offset_m(a, b))
