"""An ArduCopter over ground, in short steps of time: its height above ground scales its speed by WPNAV_TER_MARGIN.

From AC_WPNav.cpp and AC_PosControl.cpp: the commanded height is the height of the ground below plus a constant; the
vehicle follows it with bounded rates and one bounded acceleration, as fast as it can still stop there; and its speed is
the commanded one times 1 - (|error| - margin / 2) / (margin / 2), from 0.01 to 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable

STEP_S = 0.02


def fly(
    ground_m: Callable[[float], float], length_m: float, speed_m_s: float, *, climb_m_s: float = 2.5,
    descent_m_s: float = 1.5, margin_m: float = 10.0, accel_m_s2: float = 2.5, vertical_m_s2: float = 1.0,
) -> tuple[float, float]:  # fmt: skip
    """Seconds over ``length_m`` of ground, at full speed from the beginning, and the largest error of height, m."""
    along_m, height_m, climbs, speed, now_s, worst_m = 0.0, ground_m(0.0), 0.0, speed_m_s, 0.0, 0.0
    while along_m < length_m:
        error_m = ground_m(along_m) - height_m
        worst_m = max(worst_m, abs(error_m))
        stops_at = math.sqrt(2.0 * vertical_m_s2 * abs(error_m))
        rate = min(stops_at, climb_m_s) if error_m > 0.0 else -min(stops_at, descent_m_s)
        change = max(-vertical_m_s2 * STEP_S, min(vertical_m_s2 * STEP_S, rate - climbs))
        climbs += change
        height_m += climbs * STEP_S
        scale = max(0.01, min(1.0, 1.0 - (abs(error_m) - 0.5 * margin_m) / (0.5 * margin_m)))
        change = max(-accel_m_s2 * STEP_S, min(accel_m_s2 * STEP_S, scale * speed_m_s - speed))
        speed += change
        along_m += speed * STEP_S
        now_s += STEP_S
    return now_s, worst_m
