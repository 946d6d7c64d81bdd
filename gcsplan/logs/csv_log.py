"""CSV logs: a header line that names the columns, and one reading per line."""

from __future__ import annotations

import csv
import difflib
import math
from collections.abc import Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import TextIO

from gcsplan.errors import InputError
from gcsplan.figures import counted
from gcsplan.logs.flight_log import FlightLog, Readings, watts_of
from gcsplan.notes.note import Note

COLUMN_NAMES: dict[str, tuple[str, ...]] = {
    "time_s": ("time_s", "time", "t", "seconds", "timestamp_s"),
    "lat": ("lat", "latitude", "lat_deg", "latitude_deg"),
    "lon": ("lon", "lng", "longitude", "lon_deg", "longitude_deg"),
    "east_m": ("east_m", "east", "x_m", "x"),
    "north_m": ("north_m", "north", "y_m", "y"),
    "amsl_m": ("amsl_m", "amsl", "alt_m", "alt", "altitude", "altitude_m", "up_m", "z_m", "z"),
    "power_w": ("power_w", "power", "watts", "w"),
    "volt": ("volt", "voltage", "voltage_v", "volts", "v"),
    "amp": ("amp", "current", "current_a", "amps", "a"),
    "wind_east_m_s": ("wind_east_m_s", "wind_east"),
    "wind_north_m_s": ("wind_north_m_s", "wind_north"),
}
"""Accepted column names for each quantity, in any case of letters."""

NEEDED_COLUMNS = (
    "time_s, lat and lon (or east_m and north_m), amsl_m, and power_w (or volt and amp); name others with "
    "--csv-columns time_s=Time,lat=Latitude"
)
MOST_BAD = 0.1
"""Part of the lines that may be unreadable before the file is refused."""

MOST_CSV_LINES, MOST_CHARS = 1_000_000, 100_000
"""Most lines of a file (5 h at 50 Hz), and most characters of one."""


def read_csv(file: Path, columns: Mapping[str, str]) -> FlightLog:
    """The flight in a CSV file; ``columns`` maps a key of `COLUMN_NAMES` to the file's own name. Raises InputError."""
    for key in columns:
        if key not in COLUMN_NAMES:
            near = difflib.get_close_matches(key, COLUMN_NAMES, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise InputError(f"--csv-columns knows {', '.join(COLUMN_NAMES)}, given {key!r}{hint}", where=str(file))
    lines = _lines(file)
    names = [n.strip() for n in next(lines, [])]
    at = _places(names, columns, str(file))
    flat = "east_m" in at
    keys = ("time_s", *(("east_m", "north_m") if flat else ("lat", "lon")), "amsl_m")
    read = Readings(str(file), places=4, power=2, charge=3, wind=3)
    bad = first_bad = 0
    number = 1
    for number, line in enumerate(lines, start=2):
        if not any(cell.strip() for cell in line):
            continue
        values = {key: _number(line, k) for key, k in at.items()}
        watts = values["power_w"] if "power_w" in at else values["volt"] * values["amp"]
        if "wind_east_m_s" in at and math.isfinite(values["wind_east_m_s"] + values["wind_north_m_s"]):
            read.add("wind", values["time_s"], values["wind_east_m_s"], values["wind_north_m_s"])
        time_s = values["time_s"]
        good = False
        if all(math.isfinite(values[k]) for k in keys):  # position and power may be on separate lines
            read.add("places", time_s, values[keys[1]], values[keys[2]], values["amsl_m"])
            good = True
        if math.isfinite(time_s) and math.isfinite(watts):
            if "power_w" in at:
                read.add("power", time_s, watts)
            else:
                read.add("charge", time_s, values["volt"], values["amp"])
            good = True
        if not good:
            bad += 1
            first_bad = first_bad or number
    if bad > MOST_BAD * max(number - 1, 1):
        raise InputError(f"{counted(bad, 'line')} without numbers, the first is line {first_bad}", where=str(file))
    notes = (Note("lines_passed_over", file=file.name, count=bad),) if bad else ()
    power = read["power"] if "power_w" in at else watts_of(read["charge"], str(file))
    return FlightLog.of(str(file), read["places"], power, notes, degrees=not flat, wind=read["wind"])


def _lines(file: Path) -> Iterator[list[str]]:
    """The cells of one line after the other. Raises InputError."""
    try:
        with file.open(encoding="utf-8-sig", newline=None) as opened:
            lines = _counted(opened, file)
            head = next(lines, "")
            yield from csv.reader(chain([head], lines), delimiter=max(",;\t", key=head.count))
    except csv.Error as error:
        raise InputError(f"is no CSV: {error}", where=str(file)) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"is no readable text: {error}", where=str(file)) from None


def _counted(opened: TextIO, file: Path) -> Iterator[str]:
    """One line after the other. Raises InputError where there are too many, or one is too long."""
    number = 0
    while line := opened.readline(MOST_CHARS + 1):
        number += 1
        if len(line) > MOST_CHARS:
            raise InputError(f"line {number} has more than {MOST_CHARS} characters: no log in CSV", where=str(file))
        if number > MOST_CSV_LINES:
            raise InputError(
                f"has more than {MOST_CSV_LINES} lines; cut it to the flight, or to every tenth line", where=str(file)
            )
        yield line


def _places(names: list[str], columns: Mapping[str, str], where: str) -> dict[str, int]:
    """The column number of each quantity; InputError if a required one is missing."""
    lower = [n.lower() for n in names]
    at: dict[str, int] = {}
    for key, known in COLUMN_NAMES.items():
        if key in columns:
            if columns[key] not in names:
                raise InputError(f"has no column {columns[key]!r}; its header is {', '.join(names)[:200]}", where=where)
            at[key] = names.index(columns[key])
        else:
            found = next((lower.index(n) for n in known if n in lower), None)
            if found is not None:
                at[key] = found
    for pair in (("lat", "lon"), ("east_m", "north_m"), ("volt", "amp"), ("wind_east_m_s", "wind_north_m_s")):
        if len({*pair} & set(at)) == 1:
            at.pop(pair[0], None)
            at.pop(pair[1], None)
    if "lat" in at:
        at.pop("east_m", None)
        at.pop("north_m", None)
    lacking = [k for k in ("time_s", "amsl_m") if k not in at]
    lacking += [] if "lat" in at or "east_m" in at else ["lat and lon"]
    lacking += [] if "power_w" in at or "volt" in at else ["power_w"]
    if lacking:
        raise InputError(
            f"has no column for {', '.join(lacking)}; its header is {', '.join(names)[:200] or 'empty'}. "
            f"Needed are {NEEDED_COLUMNS}",
            where=where,
        )
    return at


def _number(line: list[str], k: int) -> float:
    try:
        return float(line[k])
    except (ValueError, IndexError):
        return math.nan
