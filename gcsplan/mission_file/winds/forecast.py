"""`Forecast`: the hourly wind at one place, read from JSON as Open-Meteo's forecast API returns it.

Its hours are local times with ``utc_offset_seconds``, or seconds UTC (``timeformat=unixtime``). Speeds are in the unit
of ``hourly_units``. Each height above ground with speeds and directions (``wind_speed_80m``, ``wind_direction_80m``) is
read, and the gusts at 10 m if they are there. Everything else in the file is left.
"""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.mission_file.published.times import Hours
from gcsplan.mission_file.values.schema import MOST_DECLARED_M_S, shown
from gcsplan.mission_file.zones.attributes import is_number
from gcsplan.mission_file.zones.contents import load_json
from gcsplan.units import KM_PER_HOUR, KNOT, METRE_PER_SECOND, MILE_PER_HOUR
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.terrain.input_files import absent, tell_file

MOST_FORECAST_BYTES = 5_000_000
"""Largest file that is read: 16 days of every height take 100 kB."""

LONGEST_STEP_S = 6.0 * 3600.0
"""Longest time between two hours, between which the wind is linear."""

SPEED_UNITS = {"m/s": METRE_PER_SECOND, "km/h": KM_PER_HOUR, "kn": KNOT, "mp/h": MILE_PER_HOUR}
"""The units of speed that the API has, by its own names."""

DIRECTION_UNIT = "°"
"""The unit of directions; 6 is another wind in radians."""

GUSTS_AGL_M = 10.0
"""The height of a forecast's gusts."""

ASK = "ask Open-Meteo for hourly=wind_speed_10m,wind_direction_10m,wind_gusts_10m and the same speeds and directions "\
    "at 80m, 120m and 180m"  # fmt: skip

_SPEED = re.compile(r"wind_speed_(\d{1,4})m", re.ASCII)


@dataclass(frozen=True, eq=False, slots=True)
class Forecast:
    """Winds at T times and L heights above ground; numbers that the file lacks are NaN.

    ``times_s`` (T,) rise, seconds UTC since 1970, and ``agl_m`` (L,) rise. ``speed_m_s``, ``from_deg`` are (T, L),
    ``gust_m_s`` is (T,), or None if the file has no gusts. ``where`` is the file's name in messages, ``sha256`` the sum
    of its bytes.
    """

    where: str
    lat_deg: float
    lon_deg: float
    times_s: Floats
    agl_m: Floats
    speed_m_s: Floats
    from_deg: Floats
    gust_m_s: Floats | None
    sha256: str = ""

    def within(self, hours: Hours) -> Forecast:
        """The times that hold ``hours``: from the last before them to the first after them. Raises InputError."""
        first, last = hours.start.timestamp(), hours.end.timestamp()
        if first < self.times_s[0] or last > self.times_s[-1]:
            raise InputError(
                f"covers {self._times()}, and the flight's hours are {hours}; get a forecast of these hours, or set "
                "`at` (--at) within them",
                where=self.where,
            )
        low = int(np.searchsorted(self.times_s, first, side="right")) - 1
        part = slice(low, int(np.searchsorted(self.times_s, last, side="left")) + 1)
        rows = replace(
            self, times_s=self.times_s[part], speed_m_s=self.speed_m_s[part], from_deg=self.from_deg[part],
            gust_m_s=None if self.gust_m_s is None else self.gust_m_s[part],
        )  # fmt: skip
        rows._require_whole()
        return rows

    def _require_whole(self) -> None:
        """Raise InputError where a number is absent, or a time."""
        gaps = np.flatnonzero(np.diff(self.times_s) > LONGEST_STEP_S)
        if gaps.size:
            raise InputError(
                f"has no hours from {_shown(self.times_s[gaps[0]])} to {_shown(self.times_s[gaps[0] + 1])}, and at "
                f"most {LONGEST_STEP_S / 3600.0:g} hours may lie between two; get the forecast again",
                where=self.where,
            )
        for name, values in (("wind_speed", self.speed_m_s), ("wind_direction", self.from_deg)):
            for k, level in zip(*np.nonzero(np.isnan(values)), strict=True):
                raise self._without(f"{name}_{self.agl_m[level]:g}m", int(k))
        if self.gust_m_s is not None:
            for k in np.flatnonzero(np.isnan(self.gust_m_s)):
                raise self._without("wind_gusts_10m", int(k))

    def gusts_add_m_s(self) -> float:
        """How far the gusts exceed the wind at their height at most, m/s; they add as much at the other heights.

        The gusts of an hour are the highest since the hour before it, so the lower wind of both counts.
        """
        if self.gust_m_s is None:
            return 0.0
        speed = self.speed_m_s[:, self.agl_m == GUSTS_AGL_M][:, 0]
        lower = np.minimum(speed, np.concatenate([speed[:1], speed[:-1]]))
        return float(np.maximum(self.gust_m_s - lower, 0.0).max())

    def away_m(self, frame: Frame, places_m: Floats) -> float:
        """How far the grid point is from the farthest of ``places_m`` (N, 2) in the plane; inf if it is very far."""
        away = np.hypot(*(places_m - frame.to_plane(self.lat_deg, self.lon_deg)).T)
        return float(np.where(np.isfinite(away), away, np.inf).max())

    def _without(self, name: str, k: int) -> InputError:
        return InputError(
            f"has no {name} at {_shown(self.times_s[k])}, within the flight's hours; get the forecast again, or "
            "another model's",
            where=self.where,
        )

    def _times(self) -> str:
        return f"{_shown(self.times_s[0])} to {_shown(self.times_s[-1])}"


def read_forecast(path: Path, where: str) -> Forecast:
    """The forecast in a file; ``where`` is the key that names it. Raises InputError."""
    data = _bytes(path, where)
    whole = load_json(path, data)
    at = str(path)
    if isinstance(whole, list):
        raise InputError(f"holds forecasts of {len(whole)} places; ask for one place, the mission's", where=at)
    if not isinstance(whole, dict):
        raise InputError(f"must be a forecast as Open-Meteo returns it, given {shown(whole)}", where=at)
    if whole.get("error"):
        raise InputError(f"is Open-Meteo's refusal: {str(whole.get('reason'))[:200]}", where=at)
    hourly, units = whole.get("hourly"), whole.get("hourly_units")
    if not isinstance(hourly, dict) or not isinstance(units, dict):
        raise InputError(f"has no hourly winds (hourly, hourly_units); {ASK}", where=at)
    times_s = _times(hourly.get("time"), whole, at)
    agl_m, names = _heights(hourly, at)
    speeds = [_column(hourly, f"wind_speed_{name}m", len(times_s), at) for name in names]
    known = [bool(np.isfinite(column).any()) for column in speeds]  # models without a height give null for all hours
    if not any(known):
        raise InputError(f"has no speed at any hour; {ASK}", where=at)
    names = [name for name, is_known in zip(names, known, strict=True) if is_known]
    speed = [_speed(hourly, units, f"wind_speed_{name}m", len(times_s), at) for name in names]
    turned = [_direction(hourly, units, f"wind_direction_{name}m", len(times_s), at) for name in names]
    gusts = None if hourly.get("wind_gusts_10m") is None else _speed(hourly, units, "wind_gusts_10m", len(times_s), at)
    gusts = None if gusts is None or np.isnan(gusts).all() else gusts
    heights = agl_m[np.array(known)]
    if gusts is not None and GUSTS_AGL_M not in heights:
        raise InputError(f"has gusts at {GUSTS_AGL_M:g} m without the wind there; {ASK}", where=at)
    return Forecast(
        at, _degrees(whole, "latitude", 90.0, at), _degrees(whole, "longitude", 360.0, at), times_s,
        heights, np.stack(speed, axis=1), np.stack(turned, axis=1), gusts,
        hashlib.sha256(data).hexdigest(),
    )  # fmt: skip


def _bytes(path: Path, where: str) -> bytes:
    tell_file(path)
    try:
        size = path.stat().st_size if path.is_file() else None
        if size is not None and size <= MOST_FORECAST_BYTES:
            return path.read_bytes()
    except (OSError, ValueError) as why:
        raise InputError(f"{path} cannot be read: {why}", where=where) from None
    large = f"{path} has {size} bytes, more than {MOST_FORECAST_BYTES}; {ASK}"
    raise InputError(absent(path) if size is None else large, where=where)


def _times(given: Any, whole: dict[str, Any], at: str) -> Floats:
    """(T,) rising seconds UTC."""
    if not isinstance(given, list) or not given:
        raise InputError(f"has no hours (hourly.time); {ASK}", where=at)
    offset: Any = whole.get("utc_offset_seconds")
    if not is_number(offset) or abs(offset) > 86400.0:
        raise InputError(f"must be the seconds of the hours' time zone, given {shown(offset)}",
                         where=f"{at}: utc_offset_seconds")  # fmt: skip
    times = []
    for k, time in enumerate(given):
        try:
            if is_number(time):  # timeformat=unixtime: UTC, whatever the time zone
                moment = datetime.fromtimestamp(time, UTC)
            else:
                moment = datetime.fromisoformat(time)
                if moment.tzinfo is None:
                    moment = moment.replace(tzinfo=UTC) - timedelta(seconds=offset)
            times.append(moment.timestamp())
        except (TypeError, ValueError, OverflowError, OSError):
            raise InputError(f"must be a time such as 2026-11-28T10:00, given {shown(time)}",
                             where=f"{at}: hourly.time[{k}]") from None  # fmt: skip
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if late.size:
        raise InputError("must be later than the hour before it", where=f"{at}: hourly.time[{late[0] + 1}]")
    return np.array(times)


def _heights(hourly: dict[str, Any], at: str) -> tuple[Floats, list[str]]:
    """(L,) rising heights that have speeds, and their names."""
    names = sorted((m[1] for name in hourly if (m := _SPEED.fullmatch(name))), key=int)
    if not names:
        raise InputError(f"has no wind_speed_10m in hourly; {ASK}, of one model", where=at)
    for name in names:
        if hourly.get(f"wind_direction_{name}m") is None:
            raise InputError(f"has wind_speed_{name}m without wind_direction_{name}m; {ASK}", where=at)
    heights = np.array([float(name) for name in names])
    if (np.diff(heights) <= 0.0).any():
        raise InputError("has the speeds of one height twice", where=at)
    return heights, names


def _column(hourly: dict[str, Any], name: str, count: int, at: str) -> Floats:
    """(T,) the numbers of a list; NaN for null."""
    values = hourly.get(name)
    where = f"{at}: hourly.{name}"
    if not isinstance(values, list) or len(values) != count:
        given = f"{len(values)} values" if isinstance(values, list) else shown(values)
        raise InputError(f"must be a list of {count}, one for each hour, given {given}", where=where)
    for k, value in enumerate(values):
        if value is not None and not is_number(value):
            raise InputError(f"must be a number or null, given {shown(value)}", where=f"{where}[{k}]")
    return np.array([math.nan if value is None else float(value) for value in values])


def _speed(hourly: dict[str, Any], units: dict[str, Any], name: str, count: int, at: str) -> Floats:
    """(T,) speeds in m/s."""
    unit = units.get(name)
    if not isinstance(unit, str) or unit not in SPEED_UNITS:
        raise InputError(f"must be one of {', '.join(SPEED_UNITS)}, given {shown(unit)}",
                         where=f"{at}: hourly_units.{name}")  # fmt: skip
    speeds = _column(hourly, name, count, at) * SPEED_UNITS[unit].size
    _require_between(speeds, MOST_DECLARED_M_S, f"{at}: hourly.{name}", "m/s")
    return speeds


def _direction(hourly: dict[str, Any], units: dict[str, Any], name: str, count: int, at: str) -> Floats:
    """(T,) directions that the wind comes from, degrees."""
    if units.get(name) != DIRECTION_UNIT:
        raise InputError(
            f"must be {DIRECTION_UNIT}, given {shown(units.get(name))}", where=f"{at}: hourly_units.{name}"
        )
    turned = _column(hourly, name, count, at)
    _require_between(turned, 360.0, f"{at}: hourly.{name}", "°")
    return turned


def _require_between(values: Floats, most: float, where: str, symbol: str) -> None:
    wrong = np.flatnonzero((values < 0.0) | (values > most))
    if wrong.size:
        raise InputError(f"must be 0 to {most:g} {symbol}, given {values[wrong[0]]:g} {symbol}; get the forecast again",
                         where=f"{where}[{wrong[0]}]")  # fmt: skip


def _degrees(whole: dict[str, Any], name: str, most: float, at: str) -> float:
    value: Any = whole.get(name)
    if not is_number(value) or abs(value) > most:
        raise InputError(f"must be the degrees of the grid point, given {shown(value)}", where=f"{at}: {name}")
    return float(value)


def _shown(time_s: float) -> str:
    return f"{datetime.fromtimestamp(float(time_s), UTC):%Y-%m-%d %H:%M}Z"
