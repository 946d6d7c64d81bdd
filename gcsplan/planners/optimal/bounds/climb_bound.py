"""How much longer than its ground track a path must be: heights that no short track avoids.

Every track shorter than some length is, after s metres, in one of the cells that are no farther than s from where it
began and no farther than what is left from where it ends. The lowest floor of those cells is a floor for the altitude
after s metres, whatever the track; a taut string over it is shorter than every path.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.leg import Leg
from gcsplan.planners.profile.taut_string import Blocked, Profile, taut_string

STEPS = 400
"""Places along a leg at which the floor is looked up."""


def altitude_ranges(leg: Leg, track_m: float, limit_m: float) -> tuple[Floats, Floats, Floats]:
    """Places along a leg (M,), the floor and the ceiling there (M,), for tracks as long as ``track_m`` at least.

    Tracks of more than ``limit_m`` are not asked about. A longer track is squeezed into ``track_m`` by moving its
    points towards its start by what it is longer at most; the floor is the least, the ceiling the greatest within that.
    """
    low, high, away, left = leg.cells(limit_m)
    met = np.isfinite(away) & np.isfinite(left) & (low <= high)
    low, high, away, left = low[met], high[met], away[met], left[met]
    at = np.linspace(0.0, track_m, STEPS + 1)[1:-1]
    slack = max(limit_m - track_m, 0.0)
    # Place k is in a cell's range from its nearest to its farthest, moved by the slack.
    first = np.searchsorted(at, away - slack, "left")
    last = np.searchsorted(at, limit_m - left, "right")
    return at, _least(low, first, last, len(at)), -_least(-high, first, last, len(at))


def _least(value: Floats, first: NDArray[np.intp], last: NDArray[np.intp], size: int) -> Floats:
    """For each of ``size`` places the least ``value`` of the ranges first : last that hold it; inf where none does."""
    # Ranges as two overlapping blocks of a power of two, laid down from the largest blocks to single places.
    keep = last > first
    value, first, last = value[keep], first[keep], last[keep]
    levels = max(size, 1).bit_length()
    table = np.full((levels, size), np.inf)
    k = np.floor(np.log2(last - first)).astype(np.intp)
    np.minimum.at(table, (k, first), value)
    np.minimum.at(table, (k, last - (1 << k)), value)
    for level in range(levels - 1, 0, -1):
        half = 1 << (level - 1)
        np.minimum(table[level - 1], table[level], out=table[level - 1])
        np.minimum(table[level - 1, half:], table[level, : size - half], out=table[level - 1, half:])
    return np.asarray(table[0])


def rise_bound(legs: list[Leg], tracks_m: list[float], limits_m: list[float]) -> float:
    """No path over tracks of at least ``tracks_m`` and at most ``limits_m`` metres is shorter in space.

    Climb limits are not in it: they only make paths longer.
    """
    found = _string(legs, tracks_m, limits_m)
    return found.length_m if isinstance(found, Profile) else sum(tracks_m)


def climb_bound(legs: list[Leg], tracks_m: list[float], limits_m: list[float]) -> float:
    """No path over such tracks climbs and descends less in all."""
    found = _string(legs, tracks_m, limits_m)
    return found.vertical_m if isinstance(found, Profile) else 0.0


def _string(legs: list[Leg], tracks_m: list[float], limits_m: list[float]) -> Profile | Blocked:
    """The tautest profile between what is known of such tracks' floors and ceilings."""
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
