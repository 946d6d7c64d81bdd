"""ArduPilot's onboard logs (.bin), read with pymavlink's DFReader.

BAT holds Volt and Curr of each battery instance (AP_BattMonitor; CURR before 4.0, whose whole numbers are hundredths
until 3.3). POS is the estimator's position; GPS is used if there is none. XKF2 or NKF2 hold the wind that the estimator
finds, which is 0 throughout if it looks for none. TimeUS is in microseconds since boot; before ArduCopter 3.3 TimeMS is
in milliseconds, but in GPS messages it is the time of the week, and T that since boot.
"""

from __future__ import annotations

import io
import math
import mmap
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import Any

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.logs.flight_log import MOST_READINGS, FlightLog, Readings, together, too_long, watts_of
from gcsplan.notes.note import Note

HEAD = b"\xa3\x95"
FIX_3D = 3
MESSAGES_READ = ["BAT", "CURR", "POS", "GPS", "XKF2", "NKF2"]
FORMAT_RECORD, FORMAT_LENGTH = 0x80, 89
MOST_RECORDS = 10_000_000
"""Most records of a log, of all kinds: pymavlink keeps the place of each, 50 bytes. Logs of 256 MB have 6 million."""

COLUMNS = {
    "POS": ("Lat", "Lng", "Alt"),
    "GPS": ("Lat", "Lng", "Alt"),
    "BAT": ("Volt", "Curr"),
    "CURR": ("Volt", "Curr"),
}
"""The columns that a message is read by, besides its time."""

MOST_BATTERIES = 16  # AP_BATT_MONITOR_MAX_INSTANCES of ArduPilot 4.6
MOST_COMPLAINTS = 10_000  # pymavlink makes one for each byte that it cannot read
UNSCALED = frozenset("bBhHiIqQ")
"""Format characters of whole numbers that DFReader does not scale."""


def read_dataflash(file: Path) -> FlightLog:
    """The flight in a .bin; InputError if it is not one, is damaged, or has no places or battery readings."""
    with file.open("rb") as opened:
        if opened.read(2) != HEAD:
            raise InputError("is no ArduPilot log: it does not begin with A3 95", where=str(file))
    _require_few(file)
    from pymavlink import DFReader

    own = {f"battery {k}": 3 for k in range(MOST_BATTERIES)}
    read = Readings(str(file), places=4, gps=4, wind=3, old=3, **own)
    # the reader's own clock is found by reading up to a GPS message, and is not used
    reader: Any = type("Reader", (DFReader.DFReader_binary,), {"init_clock": DFReader.DFReader_binary.init_clock_usec})
    lacking: dict[str, tuple[str, ...]] = {}
    log: Any = object.__new__(reader)  # there, and closed, also if it cannot be made
    with _overheard() as complaints:
        try:
            log.__init__(str(file))
            kinds = {log.name_to_id.get(kind) for kind in MESSAGES_READ} - {None}
            if sum(log.counts[k] for k in kinds) > MOST_READINGS:
                raise too_long(str(file))
            while (m := log.recv_match(type=MESSAGES_READ)) is not None:
                lacking |= _take(m, read)
        except InputError:
            raise
        except Exception as error:  # the reader has no error class for a damaged file
            raise InputError(
                f"could not be read by pymavlink ({type(error).__name__}: {error}): it is damaged or not whole; "
                f"download it again",
                where=str(file),
            ) from None
        finally:
            with suppress(AttributeError):
                log.close()
    notes: list[Note] = []
    if complaints():
        notes.append(Note("log_damaged", log=file.name))
    places = read["places"]
    if not len(places) and len(read["gps"]):
        places = read["gps"]
        notes.append(Note("places_of_gps", file=file.name))
    batteries = {k: read[kind] for k, kind in enumerate(own) if len(read[kind])}
    if not batteries and len(read["old"]):
        batteries = {0: read["old"]}
    power = {which: watts_of(rows, str(file)) for which, rows in batteries.items()}
    _require(file, places, power, lacking)
    return FlightLog.of(str(file), places, together(power), tuple(notes), wind=read["wind"])


@contextmanager
def _overheard() -> Iterator[Callable[[], bool]]:
    """Keep pymavlink's messages about damage, from Python and C, off the console; yields whether there were any."""
    words = _Complaints()
    # a full pipe takes no more; a file would grow by 30 bytes for each damaged one
    reading, writing = os.pipe()
    with suppress(OSError, AttributeError):
        os.set_blocking(reading, False)
        os.set_blocking(writing, False)
    first = b""
    before = os.dup(2)
    try:
        os.dup2(writing, 2)
        with redirect_stderr(words), redirect_stdout(words):
            yield lambda: bool(first or words.count)
    finally:
        os.dup2(before, 2)
        with suppress(BlockingIOError):
            first = os.read(reading, 1)
        for end in (before, reading, writing):
            os.close(end)


class _Complaints(io.TextIOBase):
    """Counts the written complaints, and keeps none of them; raises ValueError once there are too many."""

    def __init__(self) -> None:
        self.count = 0

    def write(self, text: str, /) -> int:
        self.count += bool(text.strip())
        if self.count > MOST_COMPLAINTS:
            raise ValueError(f"{MOST_COMPLAINTS} places are damaged")
        return len(text)


def _require_few(file: Path) -> None:
    """Raise InputError if there are more than `MOST_RECORDS`: the length of each kind is in its format record."""
    lengths, count, at = {FORMAT_RECORD: FORMAT_LENGTH}, 0, 0
    with file.open("rb") as opened, mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as data:
        size = len(data)
        if size < len(HEAD) * MOST_RECORDS:
            return
        while at + FORMAT_LENGTH <= size:
            first, second, kind = data[at : at + 3]
            if first != HEAD[0] or second != HEAD[1]:
                at = data.find(HEAD, at + 1)  # damage
                if at < 0:
                    return
                continue
            count += 1
            if count > MOST_RECORDS:
                raise InputError(
                    f"holds more than {MOST_RECORDS} records; cut it to the flight, or give its parts as several logs",
                    where=str(file),
                )
            if kind == FORMAT_RECORD:
                lengths[data[at + 3]] = max(data[at + 4], 1)
            at += lengths.get(kind, 1)


def _take(m: Any, read: Readings) -> dict[str, tuple[str, ...]]:
    """Keep a message; its kind and the columns that it lacks, if it cannot be used for that."""
    kind, time_s = m.get_type(), _seconds(m)
    missing = tuple(column for column in COLUMNS.get(kind, ()) if column not in m.fmt.columns)
    if missing or time_s is None:
        return {kind: missing or ("TimeUS",)}
    if not math.isfinite(time_s):
        return {}
    if kind == "POS":
        read.add("places", time_s, float(m.Lat), float(m.Lng), float(m.Alt))
    elif kind == "GPS" and getattr(m, "I", 0) == 0 and getattr(m, "Status", FIX_3D) >= FIX_3D:
        read.add("gps", time_s, float(m.Lat), float(m.Lng), float(m.Alt))
    elif kind == "BAT":
        which = int(getattr(m, "Inst", getattr(m, "Instance", 0)))
        if 0 <= which < MOST_BATTERIES:
            read.add(f"battery {which}", time_s, *_volt_and_ampere(m))
    elif kind == "CURR":
        read.add("old", time_s, *_volt_and_ampere(m))
    elif kind in ("XKF2", "NKF2") and int(getattr(m, "C", 0)) == 0 and hasattr(m, "VWN"):
        read.add("wind", time_s, float(m.VWE), float(m.VWN))
    return {}


def _seconds(m: Any) -> float | None:
    """The time since boot; None if the message has none."""
    names = (("TimeUS", 1e-6), ("T", 1e-3)) if m.get_type() == "GPS" else (("TimeUS", 1e-6), ("TimeMS", 1e-3))
    return next((float(getattr(m, name)) * unit for name, unit in names if name in m.fmt.columns), None)


def _volt_and_ampere(m: Any) -> tuple[float, float]:
    """Voltage and current; whole numbers without a scale of their own are hundredths (ArduCopter until 3.3)."""
    form = dict(zip(m.fmt.columns, m.fmt.format, strict=False))
    volt, ampere = (float(getattr(m, key)) * (0.01 if form.get(key) in UNSCALED else 1.0) for key in ("Volt", "Curr"))
    return volt, ampere


def _require(file: Path, places: Floats, batteries: Mapping[int, Floats], lacking: Mapping[str, Sequence[str]]) -> None:
    def lacks(*kinds: str) -> str:
        found = [f"{kind} has no {', '.join(lacking[kind])}" for kind in kinds if kind in lacking]
        return f"; {'; '.join(found)}" if found else ""

    if not len(places):
        raise InputError(f"holds no places (POS or GPS): was there a fix?{lacks('POS', 'GPS')}", where=str(file))
    if not any((rows[:, 1] > 0.0).any() for rows in batteries.values()):
        raise InputError(
            "holds no battery current (BAT or CURR with Volt and Curr): a power module must measure it (BATT_MONITOR "
            f"4), and LOG_BITMASK must hold the battery{lacks('BAT', 'CURR')}",
            where=str(file),
        )
