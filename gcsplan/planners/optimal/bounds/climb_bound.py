"""How much longer than its ground track a path must be: altitudes that no short track avoids.

After s metres, every track shorter than some length is in one of the cells that are no farther than s from its start
and no farther than the remaining length from its goal. The lowest floor of those cells is a floor for the altitude
after s metres, whatever the track. A taut string over these floors is no longer than any path.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.navmesh.interval_kernels import range_along
from gcsplan.planners.optimal.plane.leg import Leg
from gcsplan.planners.profile.taut_string import Blocked, Profile, taut_string

STEPS = 400
"""Steps along a leg between the places at which the floor is read."""


def altitude_ranges(leg: Leg, track_m: float, limit_m: float) -> tuple[Floats, Floats, Floats]:
    """Metres along a leg (M,), and floor and ceiling there (M,), for all tracks of ``track_m`` to ``limit_m`` metres.

    A longer track is mapped to ``track_m`` by moving its points towards its start by at most what it is longer. So the
    floor at a place is the lowest, and the ceiling the highest, within that distance; inf and -inf where no cell is.
    """
    at = np.linspace(0.0, track_m, STEPS + 1)[1:-1]
    low, high = (np.full((STEPS.bit_length(), len(at)), fill) for fill in (np.inf, -np.inf))
    range_along(*leg.cells(limit_m), limit_m, max(limit_m - track_m, 0.0), track_m / STEPS, low, high)
    return at, low[0], high[0]


def rise_bound(legs: list[Leg], tracks_m: list[float], limits_m: list[float]) -> float:
    """A lower bound of the length in space of paths over tracks of ``tracks_m`` to ``limits_m`` metres, leg by leg.

    It ignores climb limits, which only make paths longer.
    """
    found = _string(legs, tracks_m, limits_m)
    return found.length_m if isinstance(found, Profile) else sum(tracks_m)


def climb_bound(legs: list[Leg], tracks_m: list[float], limits_m: list[float]) -> float:
    """A lower bound of the metres climbed and descended in all by paths over such tracks."""
    found = _string(legs, tracks_m, limits_m)
    return found.vertical_m if isinstance(found, Profile) else 0.0


def _string(legs: list[Leg], tracks_m: list[float], limits_m: list[float]) -> Profile | Blocked:
    """The taut string between the floors and ceilings of such tracks (`altitude_ranges`)."""
    places, lows, highs = [np.zeros(1)], [np.full(1, -np.inf)], [np.full(1, np.inf)]
    begin = 0.0
    for k, (leg, track_m, limit_m) in enumerate(zip(legs, tracks_m, limits_m, strict=True)):
        at, low, high = altitude_ranges(leg, track_m, limit_m)
        end = leg.goal.amsl_m if k < len(legs) - 1 else None
        places += [begin + at, np.array([begin + track_m])]
        lows += [np.where(np.isfinite(low), low, -np.inf), np.array([-np.inf if end is None else end])]
        highs += [np.where(np.isfinite(high), high, np.inf), np.array([np.inf if end is None else end])]
        begin += track_m
    s = np.concatenate(places)
    keep = np.concatenate([[True], np.diff(s) > 1e-9])
    low, high = np.concatenate(lows)[keep], np.concatenate(highs)[keep]
    z0, z1 = legs[0].start.amsl_m, legs[-1].goal.amsl_m
    assert z0 is not None
    assert z1 is not None
    low[0] = low[-1] = -math.inf
    high[0] = high[-1] = math.inf
    return taut_string(s[keep], np.minimum(low, high), high, z0, z1)
