"""Circles that ArduPlane flies: their default radius, and how they grow with altitude."""

from __future__ import annotations

PLANE_LOITER_RADIUS_M = 60.0  # ArduPlane WP_LOITER_RAD, default


def circle_growth(amsl_m: float) -> float:
    """The factor by which ArduPlane widens a circle: (true over equivalent airspeed)² at an altitude, ISA, hot day.

    Source: AP_L1_Control.cpp, `loiter_radius`.
    """
    return float(1.1 / (1.0 - 2.25577e-5 * max(amsl_m, 0.0)) ** 4.2559)
