"""How numbers are rounded and counted for people: one rule for each kind of number, in every table, page and file.

A least value (a height above ground, a distance to a zone or between vehicles, what is left of a limit, a lower bound)
is rounded down, so that it is never shown better than it is. A greatest value (the highest altitude or height above
ground, the steepest climb or descent, the farthest distance) is rounded up for the same reason, and so is what must at
least be set or reached, to be safe. Every other number is rounded to the nearest.
"""

from __future__ import annotations

import math

NOISE = 1e-3
"""Part of the last digit that is taken for noise: a true 60.0 may arrive as 59.999999999999."""


def floored(value: float, decimals: int) -> float:
    """A least value, rounded down to ``decimals``; NaN and infinity are themselves."""
    power = 10.0**decimals
    scaled = value * power
    return math.floor(scaled + NOISE) / power if abs(scaled) < 1e15 else value


def raised(value: float, decimals: int) -> float:
    """A greatest value, or what must at least be set or reached, rounded up; NaN and infinity are themselves."""
    return 0.0 - floored(-value, decimals)  # not -0.0, which is printed with its sign


def steepened(degrees: float, decimals: int) -> float:
    """A steepest climb (positive) or descent (negative), rounded away from level; NaN and infinity are themselves.

    Less than half a digit is level: items are stored in centimetres, so a level leg is never level to the last digit.
    """
    if abs(degrees) < 0.5 * 10.0**-decimals:
        return 0.0
    return raised(degrees, decimals) if degrees > 0.0 else floored(degrees, decimals)


def counted(count: int, noun: str, several: str = "") -> str:
    """A count with its noun: ``1 item``, ``2 items``, ``3 stretches`` (``several``)."""
    return f"{count} {noun if count == 1 else several or f'{noun}s'}"
