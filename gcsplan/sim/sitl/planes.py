"""A plane in SITL: when it arrives at its goal, at which it does not stop, and when its flight is over."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import takewhile

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.commands import flown_in_order
from gcsplan.check.geodesy import flat_m
from gcsplan.check.stretch import Place
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.sim.part import Part

WIDE = 1.5
"""A plane is at a circle within so many radii of its centre: it flew circles with 1.12 of the radius asked for."""
LEAST_REACH_M = 100.0
_CIRCLES = frozenset({cmd.LOITER_UNLIM, cmd.LOITER_TURNS, cmd.LOITER_TIME, cmd.LOITER_TO_ALT})
CIRCLES_S = 60.0
"""Seconds for which it is watched at its goal or, after an RTL, at home."""


def reach_m(part: Part) -> float:
    """How near to its goal, m, a plane is there."""
    return max(LEAST_REACH_M, WIDE * part.vehicle.turn_radius_m)


def arrival_s(part: Part, times_s: Floats, apart_m: Floats, speed_m_s: Floats) -> float:
    """When it is at its goal: where it is nearest to it, seconds; NaN if it never comes within `reach_m`.

    A plane that is to circle about its goal turns aside before: it has arrived when it would have been there.
    """
    inside = apart_m <= reach_m(part)
    if not inside.any():
        return math.nan
    first = nearest = int(inside.argmax())
    while nearest + 1 < len(apart_m) and apart_m[nearest + 1] < apart_m[nearest]:
        nearest += 1
    if flown_in_order(part.mission)[-1].command in _CIRCLES:
        return float(times_s[first] + apart_m[first] / max(float(speed_m_s[first]), 1.0))
    return float(times_s[nearest])


def is_column(part: Part, points: Floats, items: Indices) -> Bools:
    """(M - 1,) whether each piece between M points belongs to the climb-out or the glide.

    A plane climbs out faster than planned: it is in its climb-out as long as the planned one is, whatever it flies to.
    """
    climb_out = takewhile(lambda leg: leg.column, part.verdict.legs)
    climb_out_m = math.fsum(leg.horizontal_m for leg in climb_out)
    flown_m = np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))
    landing = part.mission.first_seq + len(part.mission.items) - 1
    glides = (items[:-1] == landing) & (flown_in_order(part.mission)[-1].command == cmd.LAND)
    return np.asarray((flown_m <= climb_out_m) | glides)


def is_over(part: Part, places: Sequence[Place], boot_ms: Sequence[int], goal: Place) -> bool:
    """Whether it has been at the end of its flight for `CIRCLES_S`; a landing ends otherwise."""
    last = flown_in_order(part.mission)[-1].command
    home = part.mission.home
    end = (home.lat_e7 / 1e7, home.lon_e7 / 1e7, home.amsl_m) if last == cmd.RTL else goal
    if last == cmd.LAND or flat_m(places[-1], end) > reach_m(part):
        return False
    since = len(places) - 1
    while since > 0 and boot_ms[-1] - boot_ms[since - 1] <= 1000.0 * CIRCLES_S:
        since -= 1
    return boot_ms[-1] - boot_ms[since] >= 990.0 * CIRCLES_S and flat_m(places[since], end) <= reach_m(part)
