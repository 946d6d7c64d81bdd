"""Reader for flight logs of all supported kinds: ArduPilot's .bin, PX4's .ulg, MAVLink .tlog, CSV."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from gcsplan.errors import InputError
from gcsplan.logs.csv_log import read_csv
from gcsplan.logs.dataflash import read_dataflash
from gcsplan.logs.flight_log import FlightLog
from gcsplan.logs.tlog import read_telemetry
from gcsplan.logs.ulog import read_ulog

MOST_LOG_BYTES = 256_000_000
"""Most bytes of a log, whatever its kind."""


def read_log(file: Path, *, columns: Mapping[str, str] | None = None, sysid: int | None = None) -> FlightLog:
    """The flight in ``file``: ArduPilot's .bin (or .BIN; .log is refused), PX4's .ulg, a .tlog, or CSV, by its ending.

    ``columns`` are the names of a CSV's columns; ``sysid`` selects the vehicle of a .tlog. Raises InputError with a
    cure.
    """
    if not file.exists():
        raise InputError("there is no such file", where=str(file))
    if file.is_dir():
        raise InputError("is a folder; give one log, or several", where=str(file))
    if file.stat().st_size == 0:
        raise InputError("is empty: the log was not closed, or not copied whole", where=str(file))
    if file.stat().st_size > MOST_LOG_BYTES:
        raise InputError(
            f"has more than {MOST_LOG_BYTES // 10**6} MB; cut it to the flight, or give its parts as several logs",
            where=str(file),
        )
    kind = file.suffix.lower()
    if columns and kind != ".csv":
        raise InputError("--csv-columns is for CSV files", where=str(file))
    if kind == ".csv":
        return read_csv(file, columns or {})
    if kind == ".bin":
        return read_dataflash(file)
    if kind in (".tlog", ".rlog"):
        return read_telemetry(file, sysid)
    if kind == ".ulg":
        return read_ulog(file)
    cure = {
        ".log": "a text log: give the .bin that it was made from",
    }.get(kind, f"the ending {kind or '(none)'} is not known")
    raise InputError(f"{cure}. Read are ArduPilot's .bin, PX4's .ulg, MAVLink .tlog, and .csv", where=str(file))
