"""Distances between places given in degrees, without a plane."""

from __future__ import annotations

import math

from gcsplan.check.stretch import Place

EQUATOR_M, ECCENTRICITY_2 = 6_378_137.0, 6.694379990141e-3  # WGS84


def flat_m(a: Place, b: Place) -> float:
    """Horizontal metres between places on the ellipsoid, by its radii half way: good to a millionth over 100 km."""
    lat = math.radians(0.5 * (a[0] + b[0]))
    w = 1.0 - ECCENTRICITY_2 * math.sin(lat) ** 2
    north = EQUATOR_M * (1.0 - ECCENTRICITY_2) / w**1.5 * math.radians(b[0] - a[0])
    east = EQUATOR_M / math.sqrt(w) * math.cos(lat) * math.radians((b[1] - a[1] + 180.0) % 360.0 - 180.0)
    return math.hypot(north, east)
