"""A planned path: points in the plane with altitudes above mean sea level."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError, wrong_argument

PLACES_AT_ONCE = 512
"""Places whose distance from a track is computed in one batch."""


@dataclass(frozen=True, eq=False)
class Path:
    """``points`` (N, 3), N >= 2: east_m, north_m, amsl_m; straight between neighbours."""

    points: Floats

    def __post_init__(self) -> None:
        expected = "(N, 3) finite metres with N >= 2"
        try:
            p = np.ascontiguousarray(self.points, dtype=np.float64)
        except Exception as why:  # a stranger's numbers
            raise wrong_argument("Path()", "points", self.points, expected) from why
        if p.ndim != 2 or p.shape[1] != 3 or len(p) < 2 or not np.isfinite(p).all():
            raise InputError(f"a path is {expected}, given shape {p.shape}")
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


def nearest_on(places: Floats, track: Floats) -> tuple[Floats, Floats]:
    """(N,) distances of places (N, 2) from a track (M, 2), and metres along it (N,) of the points nearest to them."""
    a, d, s = track[:-1], np.diff(track, axis=0), distances_m(track)
    away, where = np.empty(len(places)), np.empty(len(places))
    for first in range(0, len(places), PLACES_AT_ONCE):
        part = slice(first, first + PLACES_AT_ONCE)
        t = ((places[part, None] - a) * d).sum(axis=-1) / np.maximum((d * d).sum(axis=-1), 1e-12)
        t = t.clip(0.0, 1.0)
        off = np.hypot(*(places[part, None] - a - t[..., None] * d).transpose(2, 0, 1))
        k = off.argmin(axis=1)
        rows = np.arange(len(k))
        away[part], where[part] = off[rows, k], s[k] + t[rows, k] * (s[k + 1] - s[k])
    return away, where
