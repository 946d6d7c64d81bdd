"""Circles that ArduPlane flies: their default radius, and how they grow with altitude."""

from __future__ import annotations

PLANE_LOITER_RADIUS_M = 60.0  # ArduPlane WP_LOITER_RAD, default


def circle_growth(amsl_m: float) -> float:
    """By how much ArduPlane widens a circle at an altitude: (true over equivalent airspeed)², ISA, on a hot day.

    Source: AP_L1_Control.cpp, `loiter_radius`.
    """
    return float(1.1 / (1.0 - 2.25577e-5 * max(amsl_m, 0.0)) ** 4.2559)
