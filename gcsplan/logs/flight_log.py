"""`FlightLog`: position and power over time, from any kind of file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.figures import counted

EQUATOR_M, ECCENTRICITY_2 = 6_378_137.0, 6.694379990141e-3  # WGS84
LEAST_POINTS = 20
LONGEST_S, FARTHEST_DEG = 86_400.0, 3.0
"""Readings farther than this from the middle of a log, in time or place, are damaged, or from before the GPS fix."""


@dataclass(frozen=True, eq=False)
class FlightLog:
    """Two series of one flight, each with its own clock readings (seconds, rising).

    ``place_s``, ``east_m``, ``north_m``, ``amsl_m`` are (P,), ``power_s``, ``power_w`` are (Q,). ``notes`` state which
    data was used and which was skipped.
    """

    name: str
    place_s: Floats
    east_m: Floats
    north_m: Floats
    amsl_m: Floats
    power_s: Floats
    power_w: Floats
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, name: str, places: list[tuple[float, float, float, float]], power: list[tuple[float, float]],
        notes: tuple[str, ...] = (), *, degrees: bool = True,
    ) -> FlightLog:  # fmt: skip
        """A log from (seconds, latitude, longitude, AMSL) and (seconds, watts), in any order, without rows with NaN.

        Raises InputError if there is too little data.
        """
        at, watts = _sorted(places), _sorted(power)
        if degrees and len(at):
            away = np.abs(at[:, 1:3] - np.median(at[:, 1:3], axis=0))
            away[:, 1] = np.minimum(away[:, 1], 360.0 - away[:, 1])
            at = at[(away < FARTHEST_DEG).all(axis=1)]
        for what, rows in (("position", at), ("battery reading", watts)):
            if len(rows) < LEAST_POINTS:
                raise InputError(
                    f"holds {counted(len(rows), what)}, and at least {LEAST_POINTS} are needed", where=name
                )
        east, north = _in_metres(at[:, 1], at[:, 2]) if degrees else (at[:, 1], at[:, 2])
        return cls(name, at[:, 0], east, north, at[:, 3], watts[:, 0], watts[:, 1], notes)


def _sorted(rows: Sequence[tuple[float, ...]]) -> Floats:
    """The rows sorted by time, one row per clock reading."""
    if not rows:
        return np.zeros((0, 4))
    a = np.array(rows, dtype=np.float64)
    a = a[np.isfinite(a).all(axis=1)]
    a = a[np.abs(a[:, 0] - np.median(a[:, 0])) < LONGEST_S] if len(a) else a  # a damaged log may hold any number
    a = a[np.argsort(a[:, 0], kind="stable")]
    return a[np.concatenate([[True], np.diff(a[:, 0]) > 0.0])] if len(a) else a


def _in_metres(lat_deg: Floats, lon_deg: Floats) -> tuple[Floats, Floats]:
    """East and north of the first place, m, by the ellipsoid's radii at the middle latitude: distances within 0.1 %."""
    lat = math.radians(0.5 * (float(lat_deg.min()) + float(lat_deg.max())))
    w = 1.0 - ECCENTRICITY_2 * math.sin(lat) ** 2
    north = EQUATOR_M * (1.0 - ECCENTRICITY_2) / w**1.5 * np.radians(lat_deg - lat_deg[0])
    turned = (lon_deg - lon_deg[0] + 180.0) % 360.0 - 180.0
    return EQUATOR_M / math.sqrt(w) * math.cos(lat) * np.radians(turned), north


def together(batteries: dict[int, list[tuple[float, float]]]) -> list[tuple[float, float]]:
    """The sum of the power of all batteries, at the times of the one with the most readings."""
    series = sorted(batteries.values(), key=len, reverse=True)
    if len(series) == 1:
        return series[0]
    base = np.array(sorted(series[0]))
    for other in series[1:]:
        rows = np.array(sorted(other))
        base[:, 1] += np.interp(base[:, 0], rows[:, 0], rows[:, 1])
    return [(float(t), float(w)) for t, w in base]
