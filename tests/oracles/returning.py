"""Returns as they are flown, step by step: a second implementation of what `gcsplan.check.returns` bounds.

A multicopter brakes to ArduCopter's stopping point, climbs there, flies home level and descends (AC_PosControl,
mode_rtl.cpp); a plane flies ArduPlane's `update_loiter` law with a bank that comes late (AP_L1_Control.cpp).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats

G_M_S2 = 9.80665
COPTER_M_S2, PUSH_M_S2, LAG_S, COPTER_P = 2.5, 5.6, 0.25, 1.0
UP_M_S, DOWN_M_S, RATE_M_S2 = 2.5, 1.5, 1.0
STEP_S = 0.05


@dataclass(frozen=True)
class Begin:
    """Where a return begins: place (east, north, AMSL) and velocity."""

    place: Floats
    velocity: Floats


def _stopping_m(speed: float, accel: float) -> float:
    if speed < accel / COPTER_P:
        return speed / COPTER_P
    return accel / (2.0 * COPTER_P**2) + speed**2 / (2.0 * accel)


def _toward(left: float, accel: float) -> float:
    """Speed at which a distance is closed (sqrt controller)."""
    linear = accel / COPTER_P**2
    return COPTER_P * left if left < linear else math.sqrt(2.0 * accel * (left - 0.5 * linear))


def copter(begin: Begin, home: Floats, return_amsl_m: float, *, wpnav_m_s: float) -> Floats:
    """(N, 3) places from the beginning of the return until it stands over home."""
    at, v = begin.place.copy(), begin.velocity.copy()
    speed = math.hypot(*v[:2])
    course = v[:2] / max(speed, 1e-9)
    stop = at[:2] + _stopping_m(min(speed, wpnav_m_s), COPTER_M_S2) * course
    away = math.dist(stop, home[:2])
    own = at[2] - home[2]
    target = home[2] + max(own, min(return_amsl_m - home[2], max(3.0 * away, own)))
    rise = math.copysign(min(_stopping_m(abs(v[2]), RATE_M_S2), 3.0 if v[2] > 0.0 else 2.0), v[2])
    levels = at[2] + rise
    push, out = np.zeros(2), [at.copy()]
    goals = [(stop, target), (home[:2], target)]
    while goals and len(out) < 60_000:
        goal, height = goals[0]
        to = goal - at[:2]
        left = math.hypot(*to)
        commanded = min(_toward(left, COPTER_M_S2), wpnav_m_s) * to / max(left, 1e-9)
        change = 2.0 * (commanded - v[:2])
        size = math.hypot(*change)
        push += (change * min(1.0, PUSH_M_S2 / max(size, 1e-9)) - push) * STEP_S / LAG_S
        v[:2] += push * STEP_S
        levels += math.copysign(min(UP_M_S * STEP_S, abs(height - levels)), height - levels)
        sink = max(min(_toward(abs(levels - at[2]), RATE_M_S2), UP_M_S), 0.0) * math.copysign(1.0, levels - at[2])
        v[2] += max(-RATE_M_S2 * STEP_S, min(RATE_M_S2 * STEP_S, sink - v[2]))
        at += v * STEP_S
        out.append(at.copy())
        if left < 2.0 and abs(at[2] - height) < 2.0 and math.hypot(*v[:2]) < 1.0:
            goals.pop(0)
    assert not goals, "it never came home"
    return np.array(out)


def plane(
    begin: Begin, home: Floats, return_amsl_m: float, *, radius_m: float, climb_m_s: float, bank_s: float, late: bool,
    turns_left: bool = False, rounds: float = 2.0,
) -> Floats:  # fmt: skip
    """(N, 3) places from the beginning of the return until ``rounds`` are flown around home.

    ``late``: a descent is flown at the end, else at once; a climb always at once, at ``climb_m_s``.
    """
    x, y = (begin.place[:2] - home[:2]).tolist()
    east, north, _ = begin.velocity.tolist()
    speed, heading, bank, z = math.hypot(east, north), math.atan2(north, east), 0.0, float(begin.place[2])
    ahead, gain = 0.75 * 17.0 / math.pi * speed, 4.0 * 0.75**2
    omega = math.tau / 17.0
    way = 1.0 if turns_left else -1.0
    last, out, time_s, circling = 0.0, [begin.place.copy()], 0.0, 0.0
    step = 2.0 * STEP_S
    while circling * speed < rounds * math.tau * radius_m and time_s < 3600.0:
        r = max(math.hypot(x, y), 1e-6)
        ux, uy = x / r, y / r
        vx, vy = speed * math.cos(heading), speed * math.sin(heading)
        across, inward = ux * vy - uy * vx, -(ux * vx + uy * vy)
        nu = math.atan2(across, inward)
        if abs(nu) > 0.9 * math.pi and abs(last) > 0.9 * math.pi and nu * last < 0.0:
            nu = last
        last = nu
        capture = gain * speed**2 / ahead * math.sin(max(-0.5 * math.pi, min(0.5 * math.pi, nu)))
        off, along = r - radius_m, across * way
        hold = off * omega**2 - inward * 2.0 * 0.75 * omega
        if inward < 0.0 and along < 0.0:
            hold = max(hold, 0.0)
        circle = way * (hold + along**2 / max(0.5 * radius_m, r))
        straight = off > 0.0 and way * capture < way * circle
        circling += 0.0 if straight else step
        demanded = math.atan((capture if straight else circle) / G_M_S2)
        bank += (max(-math.pi / 4.0, min(math.pi / 4.0, demanded)) - bank) * step / bank_s
        heading += G_M_S2 * math.tan(bank) / speed * step
        x, y, time_s = x + speed * math.cos(heading) * step, y + speed * math.sin(heading) * step, time_s + step
        if z < return_amsl_m:
            z = min(z + climb_m_s * step, return_amsl_m)
        elif not late or r < 6.0 * radius_m:
            z = max(z - 2.5 * step, return_amsl_m)
        out.append(np.array([home[0] + x, home[1] + y, z]))
    return np.array(out)
