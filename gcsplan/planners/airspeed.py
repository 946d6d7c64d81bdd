"""The least time of a fixed wing, which is faster where the air is thinner, in still air or in one constant wind:
docs/concepts/bound.md#fixed-wings."""

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
_ABOVE = 1.0 + 1e-9
"""By how much a number is above another one where rounding alone does not tell."""
_NO_WAY_M = 1e-9


@dataclass(frozen=True, slots=True)
class Shortest:
    """No path is shorter than ``length_m``, nor than ``stretched_m`` in the plane that is stretched along the wind for
    the true airspeed ``true_m_s`` (`WindPlane`); 0: not known."""

    length_m: float
    stretched_m: float = 0.0
    true_m_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Airspeed:
    """The airspeed that a fixed wing keeps along its path, as it indicates it, and its largest rates of climb and
    descent at sea level, m/s. In thinner air all three are faster by the same factor. ``wind_m_s``: the one wind that
    blows everywhere, to east and to north, slower than the aircraft."""

    indicated_m_s: float
    climb_m_s: float = math.inf
    descent_m_s: float = math.inf
    wind_m_s: tuple[float, float] = (0.0, 0.0)

    @property
    def blows_m_s(self) -> float:
        """The speed of the wind."""
        return math.hypot(*self.wind_m_s)

    def true_m_s(self, amsl_m: float) -> float:
        """The true airspeed at an altitude."""
        return self.indicated_m_s * float(true_per_indicated(amsl_m))

    def leg_s(
        self, run_m: Floats | float, rise_m: Floats | float, amsl_m: Floats | float, way_m: Floats | None = None
    ) -> Floats:
        """(...) seconds of straight legs by their metres of track, their rise, and the altitude of their middle.

        ``way_m`` (..., 2): where they lead, to east and to north; None: against the wind.
        Simpson's rule has the mean over their altitudes: at its middle a long leg would seem faster than its parts.
        """
        with_wind = np.multiply(run_m, -self.blows_m_s) if way_m is None else way_m @ np.array(self.wind_m_s)
        long_m, half_m = np.hypot(run_m, rise_m), np.multiply(0.5, rise_m)
        thinner = [true_per_indicated(np.add(amsl_m, off)) for off in (-half_m, 0.0, half_m)]
        along = np.array([self._over_ground_s(long_m, with_wind, self.indicated_m_s * f) for f in thinner])
        rise_s = np.maximum(np.divide(rise_m, self.climb_m_s), np.divide(rise_m, -self.descent_m_s))
        rising = np.array([rise_s / f for f in thinner])
        low, middle, high = np.maximum(along, rising)
        # Where a rate binds at some of the altitudes alone, Simpson's rule may have too little, and this has not.
        bent = (along * _ABOVE < rising).any(axis=0) & (along > rising * _ABOVE).any(axis=0)
        return np.asarray(np.where(bent, (low + 2.0 * middle + high) / 4.0, (low + 4.0 * middle + high) / 6.0))

    def _over_ground_s(self, long_m: Floats | float, with_wind: Floats | float, true_m_s: Floats | float) -> Floats:
        """(...) the least seconds of ways ``long_m`` metres long at a true airspeed, by the product of their way from
        end to end with the wind's velocity, m²/s; of straight ones, their seconds."""
        tail_m_s = np.divide(with_wind, np.maximum(long_m, _NO_WAY_M))
        room = np.square(true_m_s) - self.blows_m_s**2 + np.square(tail_m_s)
        return np.asarray(np.divide(long_m, tail_m_s + np.sqrt(room)))

    def _stretched_s(self, least: Shortest, with_wind: float, true_m_s: Floats) -> Floats:
        """(...) as `_over_ground_s`, by the least length of stretched ways as well."""
        room, of_plane = np.square(true_m_s) - self.blows_m_s**2, least.true_m_s**2 - self.blows_m_s**2
        faster = (room - of_plane) * least.length_m**2 + of_plane * least.stretched_m**2
        slower = room * least.stretched_m**2 + (1.0 - room / of_plane) * with_wind**2
        return np.asarray((np.sqrt(np.where(room >= of_plane, faster, slower)) - with_wind) / room)

    def path_s(self, points: Floats, run_m: Floats | None = None) -> float:
        """Seconds of the path through ``points`` (N, 3); ``run_m`` (N - 1,): its track, if that is longer."""
        d, middle_m = np.diff(points, axis=0), 0.5 * (points[1:, 2] + points[:-1, 2])
        track_m = np.hypot(d[:, 0], d[:, 1]) if run_m is None else run_m
        return float(self.leg_s(track_m, d[:, 2], middle_m, d[:, :2]).sum())

    def at_full_speed(self, limits: Limits) -> Limits:
        """``limits`` with no slope on which a rate of climb or descent takes speed away."""
        up, down = (
            math.degrees(math.asin(min(rate_m_s / (self.indicated_m_s + self.blows_m_s), 1.0)))
            for rate_m_s in (self.climb_m_s, self.descent_m_s)
        )
        if up >= limits.max_climb_deg and down >= limits.max_descent_deg:
            return limits
        return replace(
            limits, max_climb_deg=min(limits.max_climb_deg, up), max_descent_deg=min(limits.max_descent_deg, down)
        )

    def least_s(
        self, least: Shortest, ends_amsl_m: tuple[float, float], limits: Limits, top_amsl_m: float, off_m: float = 0.0,
        way_m: tuple[float, float] = (0.0, 0.0), aside_m: float = 0.0,
    ) -> float:  # fmt: skip
        """No path takes less that is no shorter than ``least``, begins and ends within ``off_m`` of two altitudes,
        leads ``way_m`` to east and to north within ``aside_m``, keeps the slopes of ``limits`` and rises to
        ``top_amsl_m`` at most.

        Paths are sorted by their highest altitude into `_SLICES`. One that reaches an altitude passes all altitudes
        between that and either end, where it is slower, and not faster than its slopes allow.
        """
        begin_m, wind_m_s = max(ends_amsl_m), self.blows_m_s
        edges_m = np.linspace(begin_m, max(begin_m, min(top_amsl_m, TROPOPAUSE_M)), _SLICES + 1)
        fastest_m_s = self.indicated_m_s * true_per_indicated(edges_m[1:])
        passed_s, lost_s = np.zeros(_SLICES), np.zeros(_SLICES)
        slopes = limits.max_climb_slope, limits.max_descent_slope
        for end_m, slope, rate_m_s in zip(ends_amsl_m, slopes, (self.climb_m_s, self.descent_m_s), strict=True):
            sine = min(math.sin(math.atan(slope)) + _SPARE, 1.0)
            from_m = min(end_m + 2.0 * off_m, begin_m)
            heights_m = np.concatenate([np.linspace(from_m, begin_m, _SLICES), edges_m[1:]])
            # The speed over each step counts as the one at its top, so no step takes less.
            thinner = true_per_indicated(heights_m[1:])
            most_m_s = self.indicated_m_s * thinner + wind_m_s
            rises_m_s = np.minimum(sine * most_m_s, min(rate_m_s, self.indicated_m_s) * thinner)
            steps_s = np.diff(heights_m) / rises_m_s
            until_s, until_m = (np.concatenate([[0.0], np.cumsum(x)])[_SLICES - 1 : -1]
                                for x in (steps_s, steps_s * most_m_s))  # fmt: skip
            passed_s += until_s
            lost_s += until_s - until_m / (fastest_m_s + wind_m_s)
        with_wind = float(np.dot(way_m, self.wind_m_s)) + aside_m * wind_m_s
        over_s = self._over_ground_s(least.length_m, with_wind, fastest_m_s)
        if least.stretched_m > 0.0:
            over_s = np.maximum(over_s, self._stretched_s(least, with_wind, fastest_m_s))
        return float(np.maximum(over_s + np.maximum(lost_s, 0.0), passed_s).min() * (1.0 - _SPARE))
