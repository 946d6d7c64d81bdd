"""The position of a vehicle over time: the data that schedule, separation and report exchange."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Floats, Indices


@dataclass(frozen=True, eq=False, slots=True)
class TimedPath:
    """Piecewise linear motion of one vehicle through the air, from take-off to landing.

    ``times_s`` (N,) are seconds since the fleet's common start, strictly rising; ``points`` (N, 3) are east_m, north_m
    and amsl_m at those times. Before the first and after the last time the vehicle stands on the ground at its first or
    last point (with ``ends_in_air`` it stays at its last point for good). ``arrive_s`` is the time at which it reaches
    the goal at approach_agl_m. ``pieces`` (N - 1,) is the caller's number of each piece (its wire item), -1 if there is
    none.
    """

    name: str
    times_s: Floats
    points: Floats
    arrive_s: float
    ends_in_air: bool = False
    pieces: Indices | None = None

    def __post_init__(self) -> None:
        if self.times_s.ndim != 1 or self.points.shape != (len(self.times_s), 3) or len(self.times_s) < 2:
            raise ValueError(f"{len(self.times_s)} times and points of shape {self.points.shape} are not a motion")
        if not (np.diff(self.times_s) > 0.0).all():
            raise ValueError(f"the times of {self.name} do not rise")

    @property
    def begin_s(self) -> float:
        """The time at which it leaves the ground, s."""
        return float(self.times_s[0])

    @property
    def end_s(self) -> float:
        """The time at which it is on the ground again, or at its last point, s."""
        return float(self.times_s[-1])

    def at(self, times_s: ArrayLike) -> Floats:
        """(M, 3) positions at ``times_s`` (M,)."""
        t = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        return np.column_stack([np.interp(t, self.times_s, self.points[:, k]) for k in range(3)])

    def delayed(self, by_s: float) -> TimedPath:
        """The same motion, ``by_s`` seconds later."""
        return TimedPath(
            self.name, self.times_s + by_s, self.points, self.arrive_s + by_s, self.ends_in_air, self.pieces
        )
