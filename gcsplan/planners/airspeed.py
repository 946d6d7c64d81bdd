"""The least time of a fixed wing, which is faster where the air is thinner: docs/concepts/bound.md#fixed-wings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.world.geodesy.atmosphere import TROPOPAUSE_M, true_per_indicated
from gcsplan.world.geometry.limits import Limits

_SLICES = 256
_SPARE = 2e-8
"""By how much a sine counts as larger, for a slope may be at its limit but for the rounding of its angle; and by how
much a bound counts as lower, as a part of it, for the error of Simpson's rule."""


@dataclass(frozen=True, slots=True)
class Airspeed:
    """The airspeed that a fixed wing keeps along its path, as it indicates it, and its largest rates of climb and
    descent at sea level, m/s. In thinner air all three are faster by the same factor."""

    indicated_m_s: float
    climb_m_s: float = math.inf
    descent_m_s: float = math.inf

    def leg_s(self, run_m: Floats | float, rise_m: Floats | float, amsl_m: Floats | float) -> Floats:
        """(...) seconds of straight legs by their metres of track, their rise, and the altitude of their middle.

        Simpson's rule has the mean over their altitudes: at its middle a long leg would seem faster than its parts.
        """
        along_s = np.divide(np.hypot(run_m, rise_m), self.indicated_m_s)
        rise_s = np.maximum(np.divide(rise_m, self.climb_m_s), np.divide(rise_m, -self.descent_m_s))
        half_m = np.multiply(0.5, rise_m)
        low, middle, high = (1.0 / true_per_indicated(np.add(amsl_m, off)) for off in (-half_m, 0.0, half_m))
        return np.asarray(np.maximum(along_s, rise_s) * (low + 4.0 * middle + high) / 6.0)

    def path_s(self, points: Floats, run_m: Floats | None = None) -> float:
        """Seconds of the path through ``points`` (N, 3); ``run_m`` (N - 1,): its track, if that is longer."""
        d, middle_m = np.diff(points, axis=0), 0.5 * (points[1:, 2] + points[:-1, 2])
        return float(self.leg_s(np.hypot(d[:, 0], d[:, 1]) if run_m is None else run_m, d[:, 2], middle_m).sum())

    def at_full_speed(self, limits: Limits) -> Limits:
        """``limits`` with no slope on which a rate of climb or descent takes speed away."""
        up, down = (
            math.degrees(math.asin(min(rate_m_s / self.indicated_m_s, 1.0)))
            for rate_m_s in (self.climb_m_s, self.descent_m_s)
        )
        if up >= limits.max_climb_deg and down >= limits.max_descent_deg:
            return limits
        return replace(
            limits, max_climb_deg=min(limits.max_climb_deg, up), max_descent_deg=min(limits.max_descent_deg, down)
        )

    def least_s(
        self, length_m: float, ends_amsl_m: tuple[float, float], limits: Limits, top_amsl_m: float, off_m: float = 0.0
    ) -> float:
        """No path takes less that is at least ``length_m`` long, begins and ends within ``off_m`` of two altitudes,
        keeps the slopes of ``limits`` and rises to ``top_amsl_m`` at most.

        Paths are sorted by their highest altitude into `_SLICES`. One that reaches an altitude passes all altitudes
        between that and either end, where it is slower, and not faster than its slopes allow.
        """
        begin_m = max(ends_amsl_m)
        edges_m = np.linspace(begin_m, max(begin_m, min(top_amsl_m, TROPOPAUSE_M)), _SLICES + 1)
        fastest_m_s = self.indicated_m_s * true_per_indicated(edges_m[1:])
        flown_m, lost_s = np.zeros(_SLICES), np.zeros(_SLICES)
        slopes = limits.max_climb_slope, limits.max_descent_slope
        for end_m, slope, rate_m_s in zip(ends_amsl_m, slopes, (self.climb_m_s, self.descent_m_s), strict=True):
            sine = min(math.sin(math.atan(slope)) + _SPARE, 1.0, rate_m_s / self.indicated_m_s)
            from_m = min(end_m + 2.0 * off_m, begin_m)
            heights_m = np.concatenate([np.linspace(from_m, begin_m, _SLICES), edges_m[1:]])
            # The speed over each step counts as the one at its top, so no step takes less.
            steps_m = np.diff(heights_m)
            passed_s = steps_m / (sine * self.indicated_m_s * true_per_indicated(heights_m[1:]))
            until_m, until_s = (np.concatenate([[0.0], np.cumsum(x)])[_SLICES - 1 : -1] for x in (steps_m, passed_s))
            flown_m += until_m / sine
            lost_s += until_s - until_m / sine / fastest_m_s
        least_s = (np.maximum(length_m, flown_m) / fastest_m_s + np.maximum(lost_s, 0.0)).min()
        return float(least_s * (1.0 - _SPARE))
