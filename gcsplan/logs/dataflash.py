"""ArduPilot's onboard logs (.bin), read with pymavlink's DFReader.

BAT holds Volt and Curr of each battery instance (AP_BattMonitor; CURR before 4.0, whose whole numbers are hundredths
until 3.3). POS is the estimator's position; GPS is used if there is none. XKF2 or NKF2 hold the wind that the estimator
finds, which is 0 throughout if it looks for none. TimeUS is in microseconds since boot.
"""

from __future__ import annotations

import io
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError
from gcsplan.logs.flight_log import FlightLog, together, watts_of

HEAD = b"\xa3\x95"
FIX_3D = 3
WHOLE = frozenset("bBhHiIqQ")
"""Format characters of whole numbers that DFReader does not scale."""


def read_dataflash(file: Path) -> FlightLog:
    """The flight in a .bin; InputError if it is not one, is damaged, or has no places or battery readings."""
    with file.open("rb") as opened:
        if opened.read(2) != HEAD:
            raise InputError("is no ArduPilot log: it does not begin with A3 95", where=str(file))
    from pymavlink import DFReader

    places: list[tuple[float, float, float, float]] = []
    gps: list[tuple[float, float, float, float]] = []
    batteries: dict[int, list[tuple[float, float, float]]] = {}
    wind: list[tuple[float, float, float]] = []
    old: list[tuple[float, float, float]] = []
    log = None
    with _overheard() as said:
        try:
            log = DFReader.DFReader_binary(str(file))
            while (m := log.recv_match(type=["BAT", "CURR", "POS", "GPS", "XKF2", "NKF2"])) is not None:
                _take(m, places, gps, batteries, old, wind)
        except Exception as error:  # the reader has no error class for a damaged file
            raise InputError(
                f"could not be read by pymavlink ({type(error).__name__}: {error}): it is damaged or not whole; "
                f"download it again",
                where=str(file),
            ) from None
        finally:
            if log is not None:
                log.close()
    notes = []
    if said():
        notes.append(f"{file.name} is damaged in places, which were passed over")
    if not places and gps:
        places = gps
        notes.append(f"{file.name}: no POS messages, so the GPS's own places were taken")
    if not batteries and old:
        batteries = {0: old}
    power = {which: watts_of(rows, str(file)) for which, rows in batteries.items()}
    _require(file, places, power)
    return FlightLog.of(str(file), places, together(power), tuple(notes), wind=wind)


@contextmanager
def _overheard() -> Iterator[Callable[[], bool]]:
    """Keep pymavlink's messages about damage, from Python and C, off the console; yields whether there were any."""
    words = io.StringIO()
    length = 0
    with tempfile.TemporaryFile() as kept, redirect_stderr(words), redirect_stdout(words):
        before = os.dup(2)
        os.dup2(kept.fileno(), 2)
        try:
            yield lambda: bool(length or words.getvalue().strip())
        finally:
            os.dup2(before, 2)
            os.close(before)
            length = kept.seek(0, os.SEEK_END)


def _take(
    m: Any, places: list[Any], gps: list[Any], batteries: dict[int, list[tuple[float, float, float]]], old: list[Any],
    wind: list[Any],
) -> None:  # fmt: skip
    kind, time_s = m.get_type(), float(getattr(m, "TimeUS", math.nan)) * 1e-6
    if not math.isfinite(time_s):
        return
    if kind == "POS":
        places.append((time_s, float(m.Lat), float(m.Lng), float(m.Alt)))
    elif kind == "GPS" and getattr(m, "I", 0) == 0 and getattr(m, "Status", FIX_3D) >= FIX_3D:
        gps.append((time_s, float(m.Lat), float(m.Lng), float(m.Alt)))
    elif kind == "BAT":
        which = int(getattr(m, "Inst", getattr(m, "Instance", 0)))
        batteries.setdefault(which, []).append((time_s, *_volt_and_ampere(m)))
    elif kind == "CURR" and hasattr(m, "Curr"):
        old.append((time_s, *_volt_and_ampere(m)))
    elif kind in ("XKF2", "NKF2") and int(getattr(m, "C", 0)) == 0 and hasattr(m, "VWN"):
        wind.append((time_s, float(m.VWE), float(m.VWN)))


def _volt_and_ampere(m: Any) -> tuple[float, float]:
    """Voltage and current; whole numbers without a scale of their own are hundredths (ArduCopter until 3.3)."""
    form = dict(zip(m.fmt.columns, m.fmt.format, strict=False))
    volt, ampere = (float(getattr(m, key)) * (0.01 if form.get(key) in WHOLE else 1.0) for key in ("Volt", "Curr"))
    return volt, ampere


def _require(file: Path, places: list[Any], batteries: dict[int, list[tuple[float, float]]]) -> None:
    if not places:
        raise InputError("holds no places (POS or GPS): was there a fix?", where=str(file))
    if not any(w > 0.0 for rows in batteries.values() for _, w in rows):
        raise InputError(
            "holds no battery current (BAT with Volt and Curr): a power module must measure it (BATT_MONITOR 4), and "
            "LOG_BITMASK must hold the battery",
            where=str(file),
        )
