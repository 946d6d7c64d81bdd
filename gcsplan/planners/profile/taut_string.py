"""The best altitude profile over a fixed ground track: a taut string through a tube, in one pass.

A tube's floor and ceiling are linear between breakpoints and may jump there. A profile that is straight between
breakpoints is therefore legal exactly if it passes every *door*, the span between floor and ceiling at a breakpoint.
The shortest such profile minimises the sum of any convex function of the slope: length, total climb and the steepest
climb or descent at once (Barlow et al. 1972, ch. 1; the funnel is Lee and Preparata's, 1984). If it breaks a climb
limit, so does every other profile through the same doors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gcsplan.arrays import Floats, Int64s
from gcsplan.planners.profile.taut_kernels import draw

NO_LIMIT = 1e12
"""Slope (rise over run) that stands for "no limit"; an infinite slope times a run of 0 would be NaN."""


@dataclass(frozen=True, eq=False, slots=True)
class Profile:
    """Vertices of an altitude profile: ``s_m`` (K,) rising, metres along the track; ``amsl_m`` (K,)."""

    s_m: Floats
    amsl_m: Floats

    @property
    def length_m(self) -> float:
        """Length in the (s, altitude) plane; over a track of straight legs this is the length of the path in space."""
        return float(np.hypot(np.diff(self.s_m), np.diff(self.amsl_m)).sum())

    @property
    def vertical_m(self) -> float:
        """Total climb plus total descent, in metres."""
        return float(np.abs(np.diff(self.amsl_m)).sum())

    def at(self, s_m: Floats) -> Floats:
        """Altitude at ``s_m`` along the track."""
        return np.asarray(np.interp(s_m, self.s_m, self.amsl_m))


@dataclass(frozen=True, slots=True)
class Blocked:
    """Why no profile is legal; the reason lies between ``s0_m`` and ``s1_m`` along the track.

    ``pinched``: at one place (the worst) the floor is ``by`` metres above the ceiling. ``climb`` or ``descent``: the
    straight piece from ``s0_m`` to ``s1_m`` rises (drops) ``by`` metres more than the limit allows.
    """

    kind: Literal["pinched", "climb", "descent"]
    s0_m: float
    s1_m: float
    by: float


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
    rise over run, both positive. O(n). Touching a door's edge or a slope limit is legal; slopes may exceed their limit
    by 1e-9 (rise over run), for rounding. `Blocked` if no profile is legal.
    """
    worst, gap = _pinch(low_m, high_m, start_m, end_m)
    if gap > 0.0 or not np.isfinite(gap):
        return Blocked("pinched", float(s_m[worst]), float(s_m[worst]), float(gap))
    at, z = _pull(s_m, low_m, high_m, start_m, end_m)
    s = s_m[at]
    run, rise = np.diff(s), np.diff(z)
    steepest, deepest = (min(slope, NO_LIMIT) + 1e-9 for slope in (climb_slope, descent_slope))
    over = np.maximum(rise - steepest * run, -rise - deepest * run)
    k = int(np.argmax(over))
    if over[k] > 0.0:
        return Blocked("climb" if rise[k] > 0 else "descent", float(s[k]), float(s[k + 1]), float(over[k]))
    return Profile(s, z)


def _pinch(low: Floats, high: Floats, z0: float, z1: float) -> tuple[int, float]:
    """Index of the tightest door, and by how many metres its floor is above its ceiling (negative: it is open).

    A door with NaN is closed: unknown altitudes are never free.
    """
    with np.errstate(invalid="ignore"):
        by = low - high
    by[0] = max(by[0], low[0] - z0, z0 - high[0])
    by[-1] = max(by[-1], low[-1] - z1, z1 - high[-1])
    by[np.isnan(by)] = np.inf
    worst = int(np.argmax(by))
    gap = float(by[worst])
    return worst, -1.0 if gap == -math.inf else gap  # -inf: every door is unbounded


def _pull(s: Floats, low: Floats, high: Floats, z0: float, z1: float) -> tuple[Int64s, Floats]:
    n = len(s)
    at, chains = np.empty((3, n + 1), np.int64), np.empty((3, n + 1))
    count = draw(*(np.ascontiguousarray(a, np.float64) for a in (s, low, high)), z0, z1, at, chains)
    return at[0, :count].copy(), chains[0, :count].copy()
