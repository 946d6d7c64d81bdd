"""The best altitude profile over a fixed ground track: a taut string through a tube, in one pass.

A tube's floor and ceiling are linear between breakpoints and may jump there, so a profile is legal exactly when
it passes every *door*, the span between floor and ceiling at a breakpoint, and is straight in between. The
shortest such profile minimises the sum of any convex function of the slope: length, total climb and the steepest
climb or descent at once (Barlow et al. 1972, ch. 1; the funnel is Lee and Preparata's, 1984). If it breaks a
climb limit, every profile through those doors does.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Profile:
    """Vertices of a profile: ``s_m`` (K,) rising, metres along the track; ``amsl_m`` (K,)."""

    s_m: Floats
    amsl_m: Floats

    @property
    def length_m(self) -> float:
        """Length in the (s, altitude) plane, so of the path in space over a track of straight legs."""
        return float(np.hypot(np.diff(self.s_m), np.diff(self.amsl_m)).sum())

    @property
    def vertical_m(self) -> float:
        """Total climb plus total descent."""
        return float(np.abs(np.diff(self.amsl_m)).sum())

    def at(self, s_m: Floats) -> Floats:
        """Altitude at ``s_m`` along the track."""
        return np.asarray(np.interp(s_m, self.s_m, self.amsl_m))


@dataclass(frozen=True, slots=True)
class Blocked:
    """Why no profile passes: between ``s0_m`` and ``s1_m`` along the track.

    ``pinched``: at one place the floor is ``by`` metres over the ceiling (the worst such place); ``climb`` or
    ``descent``: the straight piece between must rise (drop) ``by`` metres more than the limit allows.
    """

    kind: Literal["pinched", "climb", "descent"]
    s0_m: float
    s1_m: float
    by: float


def doors(floor_m: Floats, ceiling_m: Floats) -> tuple[Floats, Floats]:
    """(M + 1,) lowest and highest altitude at each breakpoint of M pieces given by (M, 2) their ends."""
    low = np.empty(len(floor_m) + 1)
    high = np.empty(len(ceiling_m) + 1)
    low[0], low[-1] = floor_m[0, 0], floor_m[-1, 1]
    high[0], high[-1] = ceiling_m[0, 0], ceiling_m[-1, 1]
    np.maximum(floor_m[:-1, 1], floor_m[1:, 0], out=low[1:-1])
    np.minimum(ceiling_m[:-1, 1], ceiling_m[1:, 0], out=high[1:-1])
    return low, high


def taut_string(
    s_m: Floats,
    low_m: Floats,
    high_m: Floats,
    start_m: float,
    end_m: float,
    climb_slope: float = np.inf,
    descent_slope: float = np.inf,
) -> Profile | Blocked:
    """Pull a string from altitude ``start_m`` at ``s_m[0]`` to ``end_m`` at ``s_m[-1]`` through every door.

    ``s_m`` (n,) rises strictly, n >= 2; ``low_m``, ``high_m`` (n,) AMSL, infinite where unbounded; slopes are
    rise over run, both positive. O(n). Touching a door's edge or a slope's limit is legal (the slope within 1e-9
    of rise over run, for rounding).
    """
    worst, gap = _pinch(low_m, high_m, start_m, end_m)
    if gap > 0.0 or not np.isfinite(gap):
        return Blocked("pinched", float(s_m[worst]), float(s_m[worst]), float(gap))
    at, z = _pull(s_m, low_m, high_m, start_m, end_m)
    s = s_m[at]
    run, rise = np.diff(s), np.diff(z)
    over = np.maximum(rise - (climb_slope + 1e-9) * run, -rise - (descent_slope + 1e-9) * run)
    k = int(np.argmax(over))
    if over[k] > 0.0:
        return Blocked("climb" if rise[k] > 0 else "descent", float(s[k]), float(s[k + 1]), float(over[k]))
    return Profile(s, z)


@njit(cache=True)
def _pinch(low: Floats, high: Floats, z0: float, z1: float) -> tuple[int, float]:
    """Index of the tightest door and by how much its floor is over its ceiling (negative: it is open).

    NaN in a door is a closed door: unknown is never room.
    """
    n = len(low)
    worst, gap = 0, -np.inf
    for i in range(n):
        by = low[i] - high[i]
        if i == 0:
            by = max(by, max(low[i] - z0, z0 - high[i]))
        elif i == n - 1:
            by = max(by, max(low[i] - z1, z1 - high[i]))
        if by != by:
            by = np.inf
        if by > gap:
            worst, gap = i, by
    if gap == -np.inf:
        gap = -1.0  # every door open without end
    return worst, gap


@njit(cache=True)
def _pull(s: Floats, low: Floats, high: Floats, z0: float, z1: float) -> tuple[NDArray[np.intp], Floats]:
    """The funnel: the shortest paths to the last door's two edges, from the apex where they part."""
    n = len(s)
    # The string never leaves the range of what it must touch, so an edge beyond it is no edge: no infinities below.
    top, bottom = max(z0, z1), min(z0, z1)
    for i in range(1, n - 1):
        top = max(top, low[i])
        bottom = min(bottom, high[i])
    out = np.empty(n, np.intp)
    out_z = np.empty(n)
    over = np.empty(n + 1, np.intp)  # chain to the high edge: convex, hangs under ceilings
    over_z = np.empty(n + 1)
    under = np.empty(n + 1, np.intp)  # chain to the low edge: concave, lies over floors
    under_z = np.empty(n + 1)
    over[0] = under[0] = 0
    over_z[0] = under_z[0] = z0
    out[0], out_z[0], count = 0, z0, 1
    over_head = over_tail = under_head = under_tail = 0  # head is the apex in both
    for i in range(1, n):
        if i == n - 1:
            up = down = z1
        else:
            up, down = min(high[i], top), max(low[i], bottom)
        # High edge: keep slopes rising along its chain.
        t = over_tail
        while t > over_head and (over_z[t] - over_z[t - 1]) * (s[i] - s[over[t]]) >= (up - over_z[t]) * (
            s[over[t]] - s[over[t - 1]]
        ):
            t -= 1
        if t == over_head:
            # The straight line may dive under the low chain: then the apex walks along that chain.
            h = under_head
            while h < under_tail and (under_z[h + 1] - under_z[h]) * (s[i] - s[under[h]]) > (up - under_z[h]) * (
                s[under[h + 1]] - s[under[h]]
            ):
                h += 1
                out[count], out_z[count] = under[h], under_z[h]
                count += 1
            under_head = h
            t = over_head = 0
            over[0], over_z[0] = under[h], under_z[h]
        over_tail = t + 1
        over[over_tail], over_z[over_tail] = i, up
        # Low edge: keep slopes falling along its chain.
        t = under_tail
        while t > under_head and (under_z[t] - under_z[t - 1]) * (s[i] - s[under[t]]) <= (down - under_z[t]) * (
            s[under[t]] - s[under[t - 1]]
        ):
            t -= 1
        if t == under_head:
            h = over_head
            while h < over_tail and (over_z[h + 1] - over_z[h]) * (s[i] - s[over[h]]) < (down - over_z[h]) * (
                s[over[h + 1]] - s[over[h]]
            ):
                h += 1
                out[count], out_z[count] = over[h], over_z[h]
                count += 1
            over_head = h
            t = under_head = 0
            under[0], under_z[0] = over[h], over_z[h]
        under_tail = t + 1
        under[under_tail], under_z[under_tail] = i, down
    # Both chains end in (s[-1], z1) now and have no room between them beyond the apex.
    for k in range(over_head + 1, over_tail + 1):
        if over[k] != out[count - 1]:
            out[count], out_z[count] = over[k], over_z[k]
            count += 1
    return out[:count].copy(), out_z[:count].copy()
