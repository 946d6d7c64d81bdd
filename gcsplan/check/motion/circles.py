"""Circles that ArduPlane flies: their default radius, and how they grow with altitude."""

from __future__ import annotations

from gcsplan.notes.note import Note
from gcsplan.world.geodesy.atmosphere import density_ratio

PLANE_LOITER_RADIUS_M = 60.0  # ArduPlane WP_LOITER_RAD, default


HOT_DAY = 1.1
"""How much thinner than the standard atmosphere the air may be."""

TOLD_M = 1.0
"""A circle that grows by less is not told."""


def circle_growth(amsl_m: float) -> float:
    """The factor by which ArduPlane widens a circle: (true over equivalent airspeed)² at an altitude, ISA, hot day.

    Source: AP_L1_Control.cpp, `loiter_radius`.
    """
    return float(HOT_DAY / density_ratio(max(amsl_m, 0.0)))


def circle_widened(seq: int, radius_m: float, amsl_m: float) -> Note | None:
    """What ArduPlane makes of a circle's radius at an altitude; None where that is nearly the same."""
    flown_m, most_m = radius_m / float(density_ratio(amsl_m)), radius_m * circle_growth(amsl_m)
    if flown_m - radius_m < TOLD_M:
        return None
    return Note("circle_widened", seq, radius_m=radius_m, amsl_m=amsl_m, flown_m=flown_m, judged_m=most_m)
