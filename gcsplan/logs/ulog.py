"""PX4's logs (.ulg), read with pyulog, which is the extra `logs`.

battery_status holds voltage_v and current_a of each battery (-1 if it measures none), vehicle_global_position the
estimator's position; the receiver's is used if there is none: sensor_gps since PX4 1.14, and before it
vehicle_gps_position in whole numbers of 1e-7 degrees and millimetres. wind (wind_estimate before 1.12) is the velocity
of the air. Times are microseconds since boot.
"""

from __future__ import annotations

import contextlib
import io
import re
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.logs.flight_log import MOST_READINGS, FlightLog, NumberRows, together, too_long, watts_of
from gcsplan.notes.note import Note

ULOG_HEAD = b"ULog\x01\x12\x35"
BATTERY, PLACE = "battery_status", "vehicle_global_position"
ULOG_PLACES: Mapping[str, tuple[tuple[tuple[str, float], ...], ...]] = {
    PLACE: ((("lat", 1.0), ("lon", 1.0), ("alt", 1.0)),),
    "sensor_gps": ((("latitude_deg", 1.0), ("longitude_deg", 1.0), ("altitude_msl_m", 1.0)),
                   (("lat", 1e-7), ("lon", 1e-7), ("alt", 1e-3))),
    "vehicle_gps_position": ((("latitude_deg", 1.0), ("longitude_deg", 1.0), ("altitude_msl_m", 1.0)),
                             (("lat", 1e-7), ("lon", 1e-7), ("alt", 1e-3))),
}  # fmt: skip
"""The topics of places, the best first; for each the names of latitude, longitude and AMSL, with their units."""

WINDS = ("wind", "wind_estimate")
FIX_3D = 3
MOST_FIELDS, MOST_FORMATS = 10_000, 2000
"""Most numbers in one message of a topic (they have some twenty), and most kinds of messages."""

_FORMAT = re.compile(r"(\w+)(?:\[(\d+)\])? \w+")


def read_ulog(file: Path) -> FlightLog:
    """The flight in a .ulg; InputError if pyulog is not there, if it is no such log, or has no places or current."""
    try:
        from pyulog import ULog
    except ImportError:
        words = ".ulg files are read by pyulog, which is not there: pip install 'gcsplan[logs]'"
        raise InputError(words, where=str(file)) from None
    _require_small(file)
    topics = [BATTERY, *ULOG_PLACES, *WINDS]
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            log = ULog(str(file), topics)
    except Exception as error:  # the reader has no error class for all damages
        raise InputError(
            f"could not be read by pyulog ({type(error).__name__}: {str(error)[:200]}): it is damaged or not whole; "
            "download it again",
            where=str(file),
        ) from None
    if sum(len(topic.data["timestamp"]) for topic in log.data_list) > MOST_READINGS:
        raise too_long(str(file))
    data: dict[str, list[Mapping[str, Any]]] = {name: [] for name in topics}
    for topic in sorted(log.data_list, key=lambda topic: int(topic.multi_id)):
        data[topic.name].append(topic.data)
    lacking: list[str] = []
    notes = [Note("log_damaged", log=file.name)] if log.file_corruption else []
    found, places = _places(data, lacking)
    if found not in ("", PLACE):
        notes.append(Note("places_of_receiver", file=file.name, topic=found))
    power = _batteries(data[BATTERY], lacking, str(file))
    _require(file, data, places, power, lacking)
    blows = next((rows for name in WINDS for rows in _winds(data[name])), np.zeros((0, 3)))
    return FlightLog.of(str(file), places, together(power), tuple(notes), wind=blows)


def _places(data: Mapping[str, list[Mapping[str, Any]]], lacking: list[str]) -> tuple[str, Floats]:
    """The topic of the places, and (N, 4) seconds, latitude, longitude, AMSL; empty if none has a fix."""
    for name, layouts in ULOG_PLACES.items():
        for given in data[name]:
            layout = next((one for one in layouts if all(key in given for key, _ in one)), None)
            if layout is None:
                lacking.append(f"{name} has no {', '.join(key for key, _ in layouts[0] if key not in given)}")
                continue
            valid = np.ones(len(given["timestamp"]), bool)
            for key in ("lat_lon_valid", "alt_valid"):
                valid &= given[key] > 0 if key in given else True
            valid &= given["fix_type"] >= FIX_3D if "fix_type" in given else True
            rows = np.column_stack([given["timestamp"] * 1e-6, *(given[key] * unit for key, unit in layout)])
            if valid.any():
                return name, rows[valid]
    return "", np.zeros((0, 4))


def _batteries(given: Sequence[Mapping[str, Any]], lacking: list[str], name: str) -> dict[int, NumberRows]:
    """The power of each battery whose current is measured."""
    power: dict[int, NumberRows] = {}
    for k, one in enumerate(given):
        missing = [key for key in ("voltage_v", "current_a") if key not in one]
        if missing:
            lacking.append(f"{BATTERY} has no {', '.join(missing)}")
            continue
        known = one["current_a"] >= 0.0  # -1 is unknown
        if (one["current_a"][known] > 0.0).any():
            rows = np.column_stack([one["timestamp"] * 1e-6, one["voltage_v"], one["current_a"]])
            power[k] = watts_of(rows[known], name)
    return power


def _winds(given: Sequence[Mapping[str, Any]]) -> list[Floats]:
    keys = ("windspeed_east", "windspeed_north")
    return [
        np.column_stack([one["timestamp"] * 1e-6, *(one[key] for key in keys)]).astype(float)
        for one in given
        if all(key in one for key in keys)
    ]


def _require(
    file: Path,
    data: Mapping[str, Sequence[object]],
    places: Floats,
    power: Mapping[int, object],
    lacking: Sequence[str],
) -> None:
    lacks = f"; {'; '.join(dict.fromkeys(lacking))}" if lacking else ""
    if not len(places):
        topics = " or ".join(ULOG_PLACES)
        raise InputError(f"holds no places ({topics} with a fix){lacks}", where=str(file))
    if not power:
        why = "its current_a is never above 0" if data[BATTERY] and not lacking else f"it needs {BATTERY}"
        raise InputError(
            f"holds no battery current{lacks}: {why} with voltage_v and current_a, a power module must measure it "
            "(BAT1_SOURCE), and SDLOG_PROFILE must hold the default topics",
            where=str(file),
        )


def _require_small(file: Path) -> None:
    """Raise InputError for a file that is no log, or whose messages would have more numbers than any topic."""
    formats: dict[str, list[tuple[str, int]]] = {}
    with file.open("rb") as opened:
        if opened.read(16)[:7] != ULOG_HEAD:
            raise InputError("is no PX4 log: it does not begin with ULog", where=str(file))
        while len(head := opened.read(3)) == 3:
            size, kind = struct.unpack("<HB", head)
            if kind in b"ALCDSO":
                break  # the definitions end here
            content = opened.read(size)
            if kind == ord("F"):
                name, _, fields = content.decode("utf-8", "replace").partition(":")
                formats[name] = [(m[1], int((m[2] or "1")[:9])) for m in _FORMAT.finditer(fields)]
            if len(formats) > MOST_FORMATS:
                raise InputError(f"has more than {MOST_FORMATS} kinds of messages: it is damaged", where=str(file))
    sizes: dict[str, int] = {}

    def fields_of(name: str, depth: int) -> int:
        if name not in formats:
            return 1
        if name not in sizes:
            deep = depth > 20 or len(formats[name]) > MOST_FIELDS
            inner = MOST_FIELDS + 1 if deep else sum(n * fields_of(one, depth + 1) for one, n in formats[name])
            sizes[name] = min(inner, MOST_FIELDS + 1)
        return sizes[name]

    for name in (BATTERY, *ULOG_PLACES, *WINDS):
        if fields_of(name, 0) > MOST_FIELDS:
            raise InputError(f"its {name} has more than {MOST_FIELDS} numbers: it is damaged", where=str(file))
