"""The speeds of a fixed wing's climb-out, where the vehicle says how it climbs (`vehicle.ClimbOut`).

It climbs at its own speed, is at the altitude of its take-off long before the slant of its least pitch is, levels off
there, and slows down to its cruise speed. The slant stays the climb-out's line, for with less power it is flown; its
pieces get the speeds over ground at which their places are passed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, takewhile

from gcsplan.check.motion.geodesy import flat_m
from gcsplan.check.motion.stretch import Stretch
from gcsplan.vehicle import ClimbOut, Vehicle
from gcsplan.world.geodesy.atmosphere import true_per_indicated

__all__ = ["climbed"]

SLOWS_M_S2 = 1.5
"""How quickly an aircraft that climbed with more than its cruise speed loses the rest: ten flights, within 1.4 s."""

SAME_M = 0.02


def climbed(stretches: Sequence[Stretch], vehicle: Vehicle) -> list[Stretch]:
    """The stretches with the climb-out in pieces at the speeds of the vehicle's own; the same if it says nothing."""
    known = vehicle.climb_out
    out = list(takewhile(lambda s: s.column and s.kind == "takeoff" and s.seq == stretches[0].seq, stretches))
    if known is None or not out or flat_m(out[0].start, out[-1].end) <= SAME_M:
        return list(stretches)
    top_m = out[-1].end[2]
    cruise_m_s = out[-1].speed_m_s * float(true_per_indicated(top_m))
    up_m = (top_m - out[0].start[2]) * known.speed_m_s / known.climb_m_s
    slow_m = max(known.space_m_s**2 - cruise_m_s**2, 0.0) / (2.0 * SLOWS_M_S2)
    pieces, at_m = [], 0.0
    for s in out:
        length = flat_m(s.start, s.end)
        if length <= SAME_M:
            pieces.append(s)
            continue
        within = {x for x in (up_m, up_m + slow_m) if at_m + SAME_M < x < at_m + length - SAME_M}
        for a, b in pairwise([at_m, *sorted(within), at_m + length]):
            took_s = _seconds(b, up_m, known, cruise_m_s) - _seconds(a, up_m, known, cruise_m_s)
            start, end = _on(s, (a - at_m) / length), _on(s, (b - at_m) / length)
            true_m_s = math.hypot(b - a, end[2] - start[2]) / took_s
            indicated = true_m_s / float(true_per_indicated(0.5 * (start[2] + end[2])))
            rates = (true_m_s, true_m_s)  # they bound nothing
            pieces.append(replace(s, start=start, end=end, speed_m_s=indicated, rates_m_s=rates))
        at_m += length
    return pieces + list(stretches[len(out) :])  # circles that continue it have another item


def _on(s: Stretch, part: float) -> tuple[float, float, float]:
    if part <= 0.0 or part >= 1.0:
        return s.start if part <= 0.0 else s.end
    a, b = s.start, s.end
    return a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1]), a[2] + part * (b[2] - a[2])


def _seconds(along_m: float, up_m: float, known: ClimbOut, cruise_m_s: float) -> float:
    """Seconds from leaving the ground to a place ``along_m`` ahead over ground; it is high enough at ``up_m``."""
    if along_m <= up_m:
        return along_m / known.speed_m_s
    first_s, level_m, fast_m_s = up_m / known.speed_m_s, along_m - up_m, known.space_m_s
    if fast_m_s <= cruise_m_s:
        return first_s + level_m / cruise_m_s
    slow_m = (fast_m_s**2 - cruise_m_s**2) / (2.0 * SLOWS_M_S2)
    if level_m < slow_m:
        return first_s + (fast_m_s - math.sqrt(fast_m_s**2 - 2.0 * SLOWS_M_S2 * level_m)) / SLOWS_M_S2
    return first_s + (fast_m_s - cruise_m_s) / SLOWS_M_S2 + (level_m - slow_m) / cruise_m_s
