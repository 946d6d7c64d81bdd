"""MAVLink logs of a ground station (.tlog), read with pymavlink.

GLOBAL_POSITION_INT has the position, BATTERY_STATUS the power (SYS_STATUS is used if there is none), and WIND, which
ArduPilot sends where it estimates one, the direction that the wind comes from and its speed. Before each
message is the ground station's clock, in microseconds since 1970.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from pathlib import Path
from typing import Any

from gcsplan.errors import InputError
from gcsplan.logs.flight_log import FlightLog, together

UNKNOWN_MV = 65535
POSITION, BATTERY, STATUS, WIND = "GLOBAL_POSITION_INT", "BATTERY_STATUS", "SYS_STATUS", "WIND"


def read_telemetry(file: Path, sysid: int | None) -> FlightLog:
    """The flight of one vehicle in a .tlog; InputError if there are several and ``sysid`` selects none."""
    os.environ.setdefault("MAVLINK20", "1")
    from pymavlink import mavutil

    places: dict[int, list[tuple[float, float, float, float]]] = {}
    batteries: dict[int, dict[int, list[tuple[float, float]]]] = {}
    status: dict[int, list[tuple[float, float]]] = {}
    winds: dict[int, list[tuple[float, float, float]]] = {}
    heard: Counter[int] = Counter()
    log = mavutil.mavlogfile(str(file))
    try:
        while (m := log.recv_match(type=[POSITION, BATTERY, STATUS, WIND])) is not None:
            who, time_s = int(m.get_srcSystem()), float(m._timestamp)
            heard[who] += 1
            if m.get_type() == POSITION:
                places.setdefault(who, []).append((time_s, m.lat / 1e7, m.lon / 1e7, m.alt / 1e3))
            elif m.get_type() == WIND:
                from_rad = math.radians(m.direction)
                blown = -m.speed * math.sin(from_rad), -m.speed * math.cos(from_rad)
                winds.setdefault(who, []).append((time_s, *blown))
            elif m.get_type() == BATTERY:
                if math.isfinite(watts := _watts(m)):
                    batteries.setdefault(who, {}).setdefault(int(m.id), []).append((time_s, watts))
            elif m.current_battery >= 0 and 0 < m.voltage_battery < UNKNOWN_MV:
                status.setdefault(who, []).append((time_s, m.voltage_battery * 1e-3 * m.current_battery * 1e-2))
    except Exception as error:  # the reader has no error class for a damaged file
        raise InputError(
            f"could not be read by pymavlink ({type(error).__name__}: {error}): it is damaged or no .tlog",
            where=str(file),
        ) from None
    finally:
        log.close()
    flew = sorted(places)
    if sysid is None and len(flew) > 1:
        raise InputError(
            f"holds the flights of the systems {', '.join(map(str, flew))}: say which with --sysid N", where=str(file)
        )
    who = sysid if sysid is not None else flew[0] if flew else 0
    if who not in places:
        words = f"of system {who}; it holds {', '.join(map(str, flew)) or 'none'}" if sysid is not None else ""
        raise InputError(f"holds no places (GLOBAL_POSITION_INT) {words}".rstrip(), where=str(file))
    power = together(batteries[who]) if who in batteries else status.get(who, [])
    notes = () if who in batteries else (f"{file.name}: no BATTERY_STATUS, so SYS_STATUS was taken",)
    if not any(w > 0.0 for _, w in power):
        raise InputError(
            "holds no battery current (BATTERY_STATUS or SYS_STATUS with voltage and current): a power module must "
            "measure it, and the link must carry it (SR0_EXT_STAT)",
            where=str(file),
        )
    return FlightLog.of(str(file), places[who], power, notes, wind=winds.get(who, ()))


def _watts(m: Any) -> float:
    """Voltage times current of one BATTERY_STATUS, W; NaN if either is unknown."""
    cells = [*m.voltages, *(v for v in getattr(m, "voltages_ext", ()) if v)]
    volts = math.fsum(v * 1e-3 for v in cells if 0 < v < UNKNOWN_MV)
    return volts * m.current_battery * 1e-2 if m.current_battery >= 0 and volts > 0.0 else math.nan
