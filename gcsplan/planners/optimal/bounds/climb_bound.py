"""How much longer than its ground track a path must be: altitudes that no short track avoids.

After s metres, every track shorter than some length is in one of the cells that are no farther than s from its start
and no farther than the remaining length from its goal. The lowest floor of those cells is a floor for the altitude
after s metres, whatever the track. A taut string over these floors is no longer than any path.
"""

from __future__ import annotations

import math

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.planners.optimal.leg import Leg
from gcsplan.planners.profile.taut_string import Blocked, Profile, taut_string

STEPS = 400
"""Steps along a leg between the places at which the floor is read."""


def altitude_ranges(leg: Leg, track_m: float, limit_m: float) -> tuple[Floats, Floats, Floats]:
    """Metres along a leg (M,), and floor and ceiling there (M,), for all tracks of ``track_m`` to ``limit_m`` metres.

    A longer track is mapped to ``track_m`` by moving its points towards its start by at most what it is longer. So the
    floor at a place is the lowest, and the ceiling the highest, within that distance.
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


def _least(value: Floats, first: Indices, last: Indices, size: int) -> Floats:
    """(size,) the least ``value`` of all ranges ``first`` : ``last`` that contain a place; inf if none does."""
    # Each range is two overlapping blocks whose size is a power of two; minima pass from larger blocks to smaller ones.
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
