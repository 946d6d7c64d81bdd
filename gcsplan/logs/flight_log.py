"""`FlightLog`: place and power over time, whichever kind of file they come from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gcsplan.errors import InputError

Floats = NDArray[np.float64]
EQUATOR_M, ECCENTRICITY_2 = 6_378_137.0, 6.694379990141e-3  # WGS84
LEAST_POINTS = 20
LONGEST_S, FARTHEST_DEG = 86_400.0, 3.0
"""From the middle of a log: what is farther off in time or place is a damaged reading, or one before the fix."""


@dataclass(frozen=True, eq=False)
class FlightLog:
    """Two series of one flight, each with its own clock readings (seconds, rising).

    ``place_s`` (P,), ``east_m``, ``north_m``, ``amsl_m`` (P,); ``power_s`` (Q,), ``power_w`` (Q,). ``notes`` on what
    was taken and what was passed over.
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
        """From (seconds, latitude, longitude, AMSL) and (seconds, watts), in any order; what is no number is left out.

        Raises InputError where there is too little to say anything.
        """
        at, watts = _sorted(places), _sorted(power)
        if degrees and len(at):
            away = np.abs(at[:, 1:3] - np.median(at[:, 1:3], axis=0))
            away[:, 1] = np.minimum(away[:, 1], 360.0 - away[:, 1])
            at = at[(away < FARTHEST_DEG).all(axis=1)]
        for what, rows in (("positions", at), ("battery readings", watts)):
            if len(rows) < LEAST_POINTS:
                raise InputError(f"holds {len(rows)} {what}, and at least {LEAST_POINTS} are needed", where=name)
        east, north = _in_metres(at[:, 1], at[:, 2]) if degrees else (at[:, 1], at[:, 2])
        return cls(name, at[:, 0], east, north, at[:, 3], watts[:, 0], watts[:, 1], notes)


def read_log(file: Path, *, columns: Mapping[str, str] | None = None, sysid: int | None = None) -> FlightLog:
    """The flight in ``file``: ArduPilot's .bin (.BIN, .log is refused), a .tlog, or CSV by its name's ending.

    ``columns``: names of a CSV's columns; ``sysid``: which vehicle of a .tlog. Raises InputError with the cure.
    """
    if not file.exists():
        raise InputError("there is no such file", where=str(file))
    if file.is_dir():
        raise InputError("is a folder; give one log, or several", where=str(file))
    if file.stat().st_size == 0:
        raise InputError("is empty: the log was not closed, or not copied whole", where=str(file))
    kind = file.suffix.lower()
    if columns and kind != ".csv":
        raise InputError("--csv-columns is for CSV files", where=str(file))
    if kind == ".csv":
        from gcsplan.logs.table import read_csv

        return read_csv(file, columns or {})
    if kind == ".bin":
        from gcsplan.logs.dataflash import read_dataflash

        return read_dataflash(file)
    if kind in (".tlog", ".rlog"):
        from gcsplan.logs.telemetry import read_telemetry

        return read_telemetry(file, sysid)
    cure = {
        ".ulg": "PX4's logs: make CSV of vehicle_global_position and battery_status with ulog2csv, join them by time",
        ".log": "a text log: give the .bin that it was made from",
    }.get(kind, f"the ending {kind or '(none)'} is not known")
    raise InputError(f"{cure}. Read are ArduPilot's .bin, MAVLink .tlog, and .csv", where=str(file))


def _sorted(rows: Sequence[tuple[float, ...]]) -> Floats:
    """By time, one row for each reading of the clock."""
    if not rows:
        return np.zeros((0, 4))
    a = np.array(rows, dtype=np.float64)
    a = a[np.isfinite(a).all(axis=1)]
    a = a[np.abs(a[:, 0] - np.median(a[:, 0])) < LONGEST_S] if len(a) else a  # a damaged log holds any number
    a = a[np.argsort(a[:, 0], kind="stable")]
    return a[np.concatenate([[True], np.diff(a[:, 0]) > 0.0])] if len(a) else a


def _in_metres(lat_deg: Floats, lon_deg: Floats) -> tuple[Floats, Floats]:
    """East and north of the first place, by the ellipsoid's radii in the middle: distances are good to 0.1 %."""
    lat = math.radians(0.5 * (float(lat_deg.min()) + float(lat_deg.max())))
    w = 1.0 - ECCENTRICITY_2 * math.sin(lat) ** 2
    north = EQUATOR_M * (1.0 - ECCENTRICITY_2) / w**1.5 * np.radians(lat_deg - lat_deg[0])
    turned = (lon_deg - lon_deg[0] + 180.0) % 360.0 - 180.0
    return EQUATOR_M / math.sqrt(w) * math.cos(lat) * np.radians(turned), north
