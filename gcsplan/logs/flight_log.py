"""`FlightLog`: position and power over time, from any kind of file."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.figures import counted
from gcsplan.notes.note import Note

EQUATOR_M, ECCENTRICITY_2 = 6_378_137.0, 6.694379990141e-3  # WGS84
LEAST_POINTS = 20
LEAST_V, MOST_V, LEAST_A, MOST_A, LEAST_W, MOST_W = 2.0, 1000.0, 0.02, 1000.0, 1.0, 100_000.0
"""Between these lie voltage, current and power of the aircraft that gcsplan plans for, in the middle of a flight."""

MOST_A_PER_V = 15.0
"""No aircraft flies with so many ampere for each volt, in the middle of a flight: most have 1 to 5."""

MOST_WIND_M_S = 60.0
MOST_READINGS = 2_000_000
"""Most readings of one log, of all kinds together: 5 h of place and battery at 50 Hz."""

NumberRows = Floats | Sequence[tuple[float, ...]]
"""NumberRows of equally many numbers."""

LONGEST_LOG_S, FARTHEST_READING_DEG = 86_400.0, 3.0
"""Readings farther than this from the middle of a log, in time or place, are damaged, or from before the GPS fix."""


class Readings:
    """The rows of one log by their kind, 8 bytes a number; refuses more than `MOST_READINGS`.

    ``widths``: the kinds, and how many numbers a row of each has.
    """

    def __init__(self, name: str, **widths: int) -> None:
        self.name, self.widths = name, widths
        self.count = 0
        self._numbers = {kind: array("d") for kind in widths}

    def add(self, kind: str, *row: float) -> None:
        """Add a row. Raises InputError if there are too many."""
        self.count += 1
        if self.count > MOST_READINGS:
            raise too_long(self.name)
        self._numbers[kind].extend(row)

    def __getitem__(self, kind: str) -> Floats:
        """(N, width) the rows of a kind, in the order in which they came."""
        return np.frombuffer(self._numbers[kind], dtype=np.float64).reshape(-1, self.widths[kind])


def too_long(name: str) -> InputError:
    """The refusal of a log that holds more than is read."""
    return InputError(
        f"holds more than {MOST_READINGS} readings of place, battery and wind; cut it to the flight, or give its parts "
        f"as several logs",
        where=name,
    )


@dataclass(frozen=True, eq=False)
class FlightLog:
    """The series of one flight, each with its own clock readings (seconds, rising).

    ``place_s``, ``east_m``, ``north_m``, ``amsl_m`` are (P,), ``power_s``, ``power_w`` are (Q,). ``wind`` (W, 3) are
    seconds and the velocity of the air to the east and to the north, m/s; empty if the log lacks it. ``notes``
    state which data was used and which was skipped.
    """

    name: str
    place_s: Floats
    east_m: Floats
    north_m: Floats
    amsl_m: Floats
    power_s: Floats
    power_w: Floats
    notes: tuple[Note, ...] = ()
    wind: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    @classmethod
    def of(
        cls, name: str, places: NumberRows, power: NumberRows, notes: tuple[Note, ...] = (), *, degrees: bool = True,
        wind: NumberRows = (),
    ) -> FlightLog:  # fmt: skip
        """A log from (seconds, latitude, longitude, AMSL) and (seconds, watts), in any order, without rows with NaN.

        ``wind``: (seconds, east, north) of the air; a wind of 0 throughout comes from a vehicle that does not estimate
        it. Raises InputError if there is too little data, or if its power is not an aircraft's.
        """
        at, watts = _sorted(places), _sorted(power)
        if degrees and len(at):
            away = np.abs(at[:, 1:3] - np.median(at[:, 1:3], axis=0))
            away[:, 1] = np.minimum(away[:, 1], 360.0 - away[:, 1])
            at = at[(away < FARTHEST_READING_DEG).all(axis=1)]
        for what, rows in (("position", at), ("battery reading", watts)):
            if len(rows) < LEAST_POINTS:
                raise InputError(
                    f"holds {counted(len(rows), what)}, and at least {LEAST_POINTS} are needed", where=name
                )
        require_power(watts[:, 1], name)
        blows = _sorted(wind)
        if len(blows) < LEAST_POINTS or not (blows[:, 1:] != 0.0).any() or np.abs(blows[:, 1:]).max() > MOST_WIND_M_S:
            blows = np.zeros((0, 3))
        east, north = _in_metres(at[:, 1], at[:, 2]) if degrees else (at[:, 1], at[:, 2])
        return cls(name, at[:, 0], east, north, at[:, 3], watts[:, 0], watts[:, 1], notes, blows)


def require_power(watts: Floats, name: str) -> None:
    """Raise InputError if the power of a flight is not an aircraft's: then a unit is mistaken."""
    flying = watts[watts > 0.0]
    middle_w = float(np.median(flying)) if len(flying) else 0.0
    if len(flying) and not LEAST_W <= middle_w <= MOST_W:
        raise InputError(
            f"has a power of {middle_w:.3g} W, and {LEAST_W:g} to {MOST_W:g} W are an aircraft's: its power, its "
            f"voltage (V) or its current (A) is in another unit, such as hundredths or thousandths; convert it",
            where=name,
        )


def watts_of(readings: NumberRows, name: str) -> Floats:
    """(N, 2) seconds and watts of readings of (seconds, volt, ampere).

    Raises InputError if voltage or current is not an aircraft battery's, or the current is too much for the voltage:
    then a unit is mistaken.
    """
    rows = np.array(readings, dtype=np.float64).reshape(-1, 3)
    for what, unit, column, least, most in (("voltage", "V", 1, LEAST_V, MOST_V), ("current", "A", 2, LEAST_A, MOST_A)):
        values = rows[np.isfinite(rows).all(axis=1) & (rows[:, 2] > 0.0), column]
        middle = float(np.median(values)) if len(values) else math.nan
        if len(values) and not least <= middle <= most:
            raise InputError(
                f"has a {what} of {middle:.3g} {unit}, and {least:g} to {most:g} {unit} are an aircraft "
                f"battery's: it is in another unit, such as hundredths or thousandths; convert it",
                where=name,
            )
    used = rows[np.isfinite(rows).all(axis=1) & (rows[:, 2] > 0.0), 1:]
    volt, amp = np.median(used, axis=0).tolist() if len(used) else (1.0, 0.0)
    if amp > MOST_A_PER_V * volt:
        raise InputError(
            f"has a current of {amp:.3g} A at {volt:.3g} V, and more than {MOST_A_PER_V:g} A for each volt are no "
            "aircraft's: one of both is in another unit, such as hundredths or thousandths; convert it",
            where=name,
        )
    return np.column_stack([rows[:, 0], rows[:, 1] * rows[:, 2]])


def _sorted(rows: NumberRows) -> Floats:
    """The rows sorted by time, one row per clock reading."""
    if not len(rows):
        return np.zeros((0, 4))
    a = np.array(rows, dtype=np.float64)
    a = a[np.isfinite(a).all(axis=1)]
    a = a[np.abs(a[:, 0] - np.median(a[:, 0])) < LONGEST_LOG_S] if len(a) else a  # a damaged log may hold any number
    a = a[np.argsort(a[:, 0], kind="stable")]
    return a[np.concatenate([[True], np.diff(a[:, 0]) > 0.0])] if len(a) else a


def _in_metres(lat_deg: Floats, lon_deg: Floats) -> tuple[Floats, Floats]:
    """East and north of the first place, m, by the ellipsoid's radii at the middle latitude: distances within 0.1 %."""
    lat = math.radians(0.5 * (float(lat_deg.min()) + float(lat_deg.max())))
    w = 1.0 - ECCENTRICITY_2 * math.sin(lat) ** 2
    north = EQUATOR_M * (1.0 - ECCENTRICITY_2) / w**1.5 * np.radians(lat_deg - lat_deg[0])
    turned = (lon_deg - lon_deg[0] + 180.0) % 360.0 - 180.0
    return EQUATOR_M / math.sqrt(w) * math.cos(lat) * np.radians(turned), north


def together(batteries: Mapping[int, NumberRows]) -> Floats:
    """The sum of the power of all batteries, at the times of the one with the most readings."""
    series = sorted(batteries.values(), key=len, reverse=True)
    if len(series) == 1:
        return np.array(series[0], dtype=np.float64)
    base, *others = (rows[np.lexsort(rows.T[::-1])] for rows in (np.array(s, dtype=np.float64) for s in series))
    for rows in others:
        base[:, 1] += np.interp(base[:, 0], rows[:, 0], rows[:, 1])
    return base
