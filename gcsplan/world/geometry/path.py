"""A planned path: points in the plane with altitudes above mean sea level."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats


@dataclass(frozen=True, eq=False)
class Path:
    """``points`` (N, 3), N >= 2: east_m, north_m, amsl_m; straight between neighbours."""

    points: Floats

    def __post_init__(self) -> None:
        p = np.ascontiguousarray(self.points, dtype=np.float64)
        if p.ndim != 2 or p.shape[1] != 3 or len(p) < 2 or not np.isfinite(p).all():
            raise ValueError(f"a path is (N, 3) finite metres with N >= 2, given shape {p.shape}")
        p.setflags(write=False)
        object.__setattr__(self, "points", p)

    @property
    def leg_horizontal_m(self) -> Floats:
        """(N - 1,) horizontal length of each leg."""
        return runs_m(self.points)

    @property
    def leg_length_m(self) -> Floats:
        """(N - 1,) length of each leg in space."""
        return np.asarray(np.linalg.norm(np.diff(self.points, axis=0), axis=1))

    @property
    def length_m(self) -> float:
        """Length in space, m."""
        return float(self.leg_length_m.sum())

    @property
    def vertical_m(self) -> float:
        """Total climb plus total descent, ``Σ|Δz|``, m."""
        return float(np.abs(np.diff(self.points[:, 2])).sum())

    def energy_j(self, vertical_j_per_m: float, horizontal_j_per_m: float) -> float:
        """Energy ``R1·Σ|Δz| + R2·Σ horizontal``, J (krill paper, Table 1)."""
        return vertical_j_per_m * self.vertical_m + horizontal_j_per_m * float(self.leg_horizontal_m.sum())


def runs_m(points: Floats) -> Floats:
    """(N - 1,) horizontal metres from point to point of a track or path (N, 2 or 3)."""
    d = np.diff(points[:, :2], axis=0)
    return np.asarray(np.hypot(d[:, 0], d[:, 1]))


def distances_m(points: Floats) -> Floats:
    """(N,) horizontal metres along a track or path (N, 2 or 3), from 0 at its first point."""
    return np.concatenate([[0.0], np.cumsum(runs_m(points))])


def track_length_m(points: Floats) -> float:
    """Horizontal metres of a track or path (N, 2 or 3)."""
    return float(runs_m(points).sum())
