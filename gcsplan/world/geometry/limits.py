"""The limits that every leg of one vehicle must keep."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits and errors of one vehicle; metres and degrees. ``None`` means no limit.

    ``track_error_m`` and ``altitude_error_m`` widen every check: the aircraft may be that far from the mission's line.
    ``horizontal_clearance_m`` is kept from zones to the side, ``vertical_clearance_m`` above and below them. Touching a
    limit is legal.
    """

    min_agl_m: float
    max_agl_m: float | None = None
    max_amsl_m: float | None = None
    horizontal_clearance_m: float = 0.0
    track_error_m: float = 0.0
    altitude_error_m: float = 0.0
    max_climb_deg: float = 90.0
    max_descent_deg: float = 90.0
    vertical_clearance_m: float = 0.0

    @property
    def over_zone_m(self) -> float:
        """Metres above and below the line within which no zone may be: the error and the clearance."""
        return self.altitude_error_m + self.vertical_clearance_m

    @property
    def max_climb_slope(self) -> float:
        """Rise over run of the steepest legal climb; ``inf`` for 90 degrees."""
        return math.inf if self.max_climb_deg >= 90.0 else math.tan(math.radians(self.max_climb_deg))

    @property
    def max_descent_slope(self) -> float:
        """Drop over run (positive) of the steepest legal descent; ``inf`` for 90 degrees."""
        return math.inf if self.max_descent_deg >= 90.0 else math.tan(math.radians(self.max_descent_deg))
