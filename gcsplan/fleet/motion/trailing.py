"""How ArduCopter flies over steep ground: its height trails the ground's before it slows down.

On a leg that follows the ground it flies at full speed while its height is within half of WPNAV_TER_MARGIN (10 m) of
the wanted one, and the slower the more it is off, down to a standstill at the whole margin (AC_WPNav.cpp,
`advance_wp_target_along_track`; AC_PosControl.cpp, `pos_offset_z_scaler`). It climbs and sinks meanwhile with its rates
at most, and as fast as it can still stop at the wanted height. So on a long slope it comes to the speed that its rates
allow, and it is there a few seconds earlier than if it never left the height. Flown on a ramp of 50 %, where 2.5 m/s of
climb allow 5 m/s of the 10: 7.4 m too low; 7.5 m by this rule.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Bools, Floats

__all__ = ["trailing_s"]

MARGIN_M = 10.0
"""WPNAV_TER_MARGIN, default."""

STEP_S = 0.2
_SLOWEST = 0.01
_BEFORE = 3
"""How many parts before one that is too steep its height is followed."""


def trailing_s(
    part_m: Floats, rise_m: Floats, rates_m_s: Floats, speed_m_s: Floats, follows: Bools, accel_m_s2: float,
    vertical_m_s2: float,
) -> Floats:  # fmt: skip
    """(P,) seconds of parts that are flown one after another, ``part_m`` (P,) long and with ``rise_m`` (P,).

    ``rates_m_s`` (P, 2): of climb and descent; ``speed_m_s`` (P,): the highest speed on level ground. Those that
    ``follows`` (P,) follow the ground, the others are flown at that speed. ``accel_m_s2``, ``vertical_m_s2``:
    along the leg, and up or down.
    """
    seconds = part_m / speed_m_s
    limit = np.where(rise_m > 0.0, rates_m_s[:, 0], rates_m_s[:, 1])
    steep = np.flatnonzero(follows & (np.abs(rise_m) > limit * seconds))
    free = 0  # the first part that is not timed yet
    for k in steep.tolist():
        if k >= free:
            first = max(k - _BEFORE, free)
            while not follows[first:k].all():
                first += 1
            free = _fly(first, part_m, rise_m, rates_m_s, speed_m_s, follows, seconds, accel_m_s2, vertical_m_s2)
    return seconds


def _fly(
    first: int, part_m: Floats, rise_m: Floats, rates_m_s: Floats, speed_m_s: Floats, follows: Bools, seconds: Floats,
    accel_m_s2: float, vertical_m_s2: float,
) -> int:  # fmt: skip
    """Time the parts from ``first`` on, until it is on its height at full speed again; return the next part."""
    lengths, rises, speeds = part_m.tolist(), rise_m.tolist(), speed_m_s.tolist()
    up, down = rates_m_s[:, 0].tolist(), rates_m_s[:, 1].tolist()
    half, i, count = 0.5 * MARGIN_M, first, len(lengths)
    speed, gone_m, since_s = speeds[first], 0.0, 0.0
    climbs = max(-down[i], min(up[i], rises[i] / lengths[i] * speed))
    off = math.copysign(0.5 * climbs * climbs / vertical_m_s2, climbs)  # how far the height wanted is above its own
    most_z, most = vertical_m_s2 * STEP_S, accel_m_s2 * STEP_S
    while True:
        wanted = math.sqrt(2.0 * vertical_m_s2 * abs(off))
        wanted = min(wanted, up[i]) if off > 0.0 else -min(wanted, down[i])
        climbs += max(-most_z, min(most_z, wanted - climbs))
        share = max(_SLOWEST, min(1.0, 2.0 - abs(off) / half))
        speed += max(-most, min(most, share * speeds[i] - speed))
        step_m, left_s = max(speed, _SLOWEST) * STEP_S, STEP_S
        off -= climbs * STEP_S
        while gone_m + step_m >= lengths[i]:
            last_m = lengths[i] - gone_m
            off += rises[i] * last_m / lengths[i]
            seconds[i] = since_s + left_s * last_m / step_m
            left_s -= left_s * last_m / step_m
            step_m, gone_m, since_s = step_m - last_m, 0.0, 0.0
            i += 1
            if i == count or not follows[i]:
                return i
            calm = abs(off) < half and speed >= 0.999 * speeds[i]
            if calm and all(
                not follows[k] or -down[k] <= rises[k] / lengths[k] * speeds[k] <= up[k]
                for k in range(i, min(i + _BEFORE + 1, count))
            ):
                return i
        off += rises[i] * step_m / lengths[i]
        gone_m, since_s = gone_m + step_m, since_s + left_s
