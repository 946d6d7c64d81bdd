"""MAVLink logs of a ground station (.tlog), read with pymavlink.

GLOBAL_POSITION_INT has the position, BATTERY_STATUS the power (SYS_STATUS is used if there is none), and WIND, which
ArduPilot sends where it estimates one, the direction that the wind comes from and its speed. Before each
message is the ground station's clock, in microseconds since 1970.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from gcsplan.errors import InputError
from gcsplan.logs.flight_log import FlightLog, Readings, together
from gcsplan.notes.note import Note

UNKNOWN_MV = 65535
MOST_MESSAGES = 2_000_000
"""Most messages of a file, of any kind: 11 h at 50 Hz."""

READS = 4
"""Reads of a file for a message: its clock, its head, the rest. Damaged parts are read byte by byte."""

POSITION, BATTERY, STATUS, WIND = "GLOBAL_POSITION_INT", "BATTERY_STATUS", "SYS_STATUS", "WIND"


def read_telemetry(file: Path, sysid: int | None) -> FlightLog:
    """The flight of one vehicle in a .tlog; InputError if there are several and ``sysid`` selects none."""
    os.environ.setdefault("MAVLINK20", "1")
    from pymavlink import mavutil

    read: dict[int, Readings] = {}
    log = mavutil.mavlogfile(str(file))
    try:
        log.f = _Counted(log.f, str(file))
        while (m := log.recv_msg()) is not None:
            _take(m, read, str(file))
    except InputError:
        raise
    except Exception as error:  # the reader has no error class for a damaged file
        raise InputError(
            f"could not be read by pymavlink ({type(error).__name__}: {error}): it is damaged or no .tlog",
            where=str(file),
        ) from None
    finally:
        log.close()
    flew = sorted(who for who, own in read.items() if len(own[POSITION]))
    if sysid is None and len(flew) > 1:
        raise InputError(
            f"holds the flights of the systems {', '.join(map(str, flew))}: choose one with --sysid N", where=str(file)
        )
    who = sysid if sysid is not None else flew[0] if flew else 0
    if who not in flew:
        words = "" if sysid is None else f" with sysid {who}; it holds {', '.join(map(str, flew)) or 'none'}"
        raise InputError(f"holds no places (GLOBAL_POSITION_INT){words}", where=str(file))
    own = read[who]
    batteries = {k: own[BATTERY][own[BATTERY][:, 0] == k, 1:] for k in np.unique(own[BATTERY][:, 0]).tolist()}
    power = together(batteries) if batteries else own[STATUS]
    notes = () if batteries else (Note("power_of_system_status", file=file.name),)
    if not (power[:, 1] > 0.0).any():
        raise InputError(
            "holds no battery current (BATTERY_STATUS or SYS_STATUS with voltage and current): a power module must "
            "measure it, and the link must carry it (SR0_EXT_STAT)",
            where=str(file),
        )
    return FlightLog.of(str(file), own[POSITION], power, notes, wind=own[WIND])


class _Counted:
    """A file that is read no more often than a log of `MOST_MESSAGES` needs."""

    def __init__(self, file: Any, name: str) -> None:
        self._file, self._name, self._left = file, name, READS * MOST_MESSAGES
        self.tell, self.close = file.tell, file.close

    def read(self, size: int) -> bytes:
        """The next ``size`` bytes. Raises InputError after too many calls."""
        self._left -= 1
        if self._left < 0:
            raise InputError(
                f"holds more than {MOST_MESSAGES} messages, or is damaged; cut it to the flight "
                f"(mavlogdump.py --output), or give its parts as several logs",
                where=self._name,
            )
        return bytes(self._file.read(size))


def _take(m: Any, read: dict[int, Readings], name: str) -> None:
    """Add a message's readings of its vehicle."""
    kind = m.get_type()
    if kind not in (POSITION, BATTERY, STATUS, WIND):
        return
    who, time_s = int(m.get_srcSystem()), float(m._timestamp)
    own = read.setdefault(who, Readings(name, **{POSITION: 4, BATTERY: 3, STATUS: 2, WIND: 3}))
    if kind == POSITION:
        own.add(kind, time_s, m.lat / 1e7, m.lon / 1e7, m.alt / 1e3)
    elif kind == WIND:
        from_rad = math.radians(m.direction)
        own.add(kind, time_s, -m.speed * math.sin(from_rad), -m.speed * math.cos(from_rad))
    elif kind == BATTERY:
        if math.isfinite(watts := _watts(m)):
            own.add(kind, int(m.id), time_s, watts)
    elif m.current_battery >= 0 and 0 < m.voltage_battery < UNKNOWN_MV:
        own.add(kind, time_s, m.voltage_battery * 1e-3 * m.current_battery * 1e-2)


def _watts(m: Any) -> float:
    """Voltage times current of one BATTERY_STATUS, W; NaN if either is unknown."""
    cells = [*m.voltages, *(v for v in getattr(m, "voltages_ext", ()) if v)]
    volts = math.fsum(v * 1e-3 for v in cells if 0 < v < UNKNOWN_MV)
    return volts * m.current_battery * 1e-2 if m.current_battery >= 0 and volts > 0.0 else math.nan
