"""A PX4 multicopter on level legs, step by step: the rules of `gcsplan.fleet.motion.px4`, integrated in time.

In each step the commanded speed follows from the place alone: towards the way point, or while it turns towards a
point on the leg; the speed then changes with a bounded acceleration and a bounded jerk.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats

STEP_S = 0.02
ALIGNED = 0.98
LEAST_AHEAD_M = 5.0
NEAR_M, STILL_M_S = 3.0, 0.4


def limit_m_s(accel: float, jerk: float, metres: float, final: float) -> float:
    """The highest speed from which it slows down to ``final`` within ``metres``."""
    b = 4.0 * accel**2 / jerk
    return max(0.5 * (math.sqrt(b * b + 8.0 * accel * metres + 4.0 * final**2) - b), final)


def fly(
    points: Floats, cruise_m_s: float, radius_m: float, *, accel: float = 3.0, jerk: float = 4.0, gain: float = 0.5
) -> tuple[float, list[float]]:
    """Seconds until it stands at the last of ``points`` (N, 2), and its speeds where it takes up the next leg."""
    place, speed, push = points[0].copy(), np.zeros(2), np.zeros(2)
    corners: list[float] = []
    k, now_s, before = 1, 0.0, cruise_m_s
    while now_s < 3600.0:
        target, after = points[k], points[min(k + 1, len(points) - 1)]
        ahead, further = target - place, after - target
        away = float(np.linalg.norm(ahead))
        corner = _corner(ahead, further, cruise_m_s, radius_m, accel, jerk, gain)
        most = min(cruise_m_s, limit_m_s(accel, jerk, away, corner))
        now = float(np.linalg.norm(speed))
        aim = target
        if now > 0.2 and speed @ ahead < ALIGNED * now * away and away > radius_m:
            leg = (target - points[k - 1]) / np.linalg.norm(target - points[k - 1])
            nearest = points[k - 1] + leg * ((place - points[k - 1]) @ leg)
            off, reach = float(np.linalg.norm(nearest - place)), max(radius_m, LEAST_AHEAD_M)
            aim = nearest + math.sqrt(max(reach**2 - off**2, 0.0)) * leg
            most = min(before, most)
        else:
            before = most
        way = aim - place
        commanded = way / max(float(np.linalg.norm(way)), 1e-9) * most
        error = commanded - (speed + push * np.linalg.norm(push) / (2.0 * jerk))
        size = float(np.linalg.norm(error))
        pull = error / max(size, 1e-9) * (accel if size >= 0.05 else min(accel, math.sqrt(2.0 * jerk * size)))
        change = pull - push
        push = push + change * min(1.0, jerk * STEP_S / max(float(np.linalg.norm(change)), 1e-9))
        speed = speed + push * STEP_S
        place = place + speed * STEP_S
        now_s += STEP_S
        away = float(np.linalg.norm(target - place))
        if k == len(points) - 1:
            if away < NEAR_M and np.linalg.norm(speed) < STILL_M_S:
                return now_s, corners
        elif away < radius_m:
            corners.append(float(np.linalg.norm(speed)))
            k += 1
    raise AssertionError("it never arrives")


def _corner(
    ahead: Floats, further: Floats, cruise_m_s: float, radius_m: float, accel: float, jerk: float, gain: float
) -> float:
    """The speed of the corner between two legs."""
    length = float(np.linalg.norm(further))
    if length < max(radius_m, 1e-3):
        return 0.0
    cosine = float(ahead @ further) / max(length * float(np.linalg.norm(ahead)), 1e-12)
    half = 0.5 * math.acos(min(max(cosine, -1.0), 1.0))
    free = math.sqrt(gain * accel * radius_m / math.tan(half)) if 1e-9 < half < 0.5 * math.pi - 1e-9 else math.inf
    if half >= 0.5 * math.pi - 1e-9:
        free = 0.0
    return min(free, cruise_m_s, limit_m_s(accel, jerk, length, 0.0))
