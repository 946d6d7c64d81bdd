"""Validation of numbers received over the wire: NaN, infinity and values out of range are rejected.

Every number from a vehicle's messages passes through here before it is used in a calculation. Mission items do not:
they are compared bit for bit, and NaN has a meaning in them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

_MOST_HEIGHT_M = 100_000.0


class VehiclePosition(NamedTuple):
    """A position in degrees and metres above mean sea level."""

    lat_deg: float
    lon_deg: float
    amsl_m: float


def finite(value: object) -> float | None:
    """Return ``value`` as a float; None if it is NaN, infinite or not a number."""
    if not isinstance(value, (int, float)):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def whole(value: object, low: int, high: int) -> int | None:
    """Return ``value`` as a whole number within ``low`` … ``high``; None if it is not one."""
    number = finite(value)
    return int(number) if number is not None and number == int(number) and low <= number <= high else None


def place(lat_e7: object, lon_e7: object, alt_mm: object) -> VehiclePosition | None:
    """Return the place for 1e-7 degrees and millimetres; None if out of range, or at 0, 0, which means no fix."""
    lat, lon = whole(lat_e7, -900_000_000, 900_000_000), whole(lon_e7, -1_800_000_000, 1_800_000_000)
    height_mm = finite(alt_mm)
    if lat is None or lon is None or height_mm is None or (lat, lon) == (0, 0):
        return None
    amsl_m = height_mm / 1e3
    return VehiclePosition(lat / 1e7, lon / 1e7, amsl_m) if abs(amsl_m) <= _MOST_HEIGHT_M else None
