"""How far a flight comes from home: what a fence on board must hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gcsplan.check.motion.geodesy import degree_m
from gcsplan.check.motion.stretch import Stretch
from gcsplan.mavlink.mission.mission import Home
from gcsplan.mavlink.mission.parameter_safety import FlightExtent
from gcsplan.world.airspace import Legs
from gcsplan.world.geometry.limits import Limits

__all__ = ["extent_of"]


def extent_of(
    stretches: Sequence[Stretch], legs: Sequence[Legs], home: Home, limits: Limits, home_error_m: float = 0.0
) -> FlightExtent:
    """The extent of ``stretches``, at least one, with the errors of ``limits`` and what widens each of them.

    ``legs``: the same in the plane, where those of the terrain frame follow the ground; their errors of height count,
    but for ``home_error_m``, which moves home and all heights above it alike. The ground at home is part of it.
    """
    ends = np.array([(*s.start, *s.end) for s in stretches])
    lat, lon = ends[:, [0, 3]], ends[:, [1, 4]]
    home_lat, home_lon = home.lat_e7 / 1e7, home.lon_e7 / 1e7
    north_m = degree_m(0.5 * (home_lat + float(lat.mean())))[1]
    east_m = degree_m(float(np.abs(np.append(lat, home_lat)).min()))[0]  # the longest of the flight's degrees
    away_m = np.hypot(east_m * ((lon - home_lon + 180.0) % 360.0 - 180.0), north_m * (lat - home_lat)).max(axis=1)
    reach_m = float((away_m + np.array([s.reach_m for s in stretches])).max()) + limits.track_error_m
    top_m, bottom_m = -np.inf, home.amsl_m - limits.altitude_error_m
    for part in legs:
        error_m = part.altitude_error_m - home_error_m
        top_m = max(top_m, float((np.maximum(part.start[:, 2], part.end[:, 2]) + error_m).max()))
        bottom_m = min(bottom_m, float((np.minimum(part.start[:, 2], part.end[:, 2]) - error_m).min()))
    return FlightExtent(top_m - home.amsl_m, bottom_m - home.amsl_m, reach_m)
