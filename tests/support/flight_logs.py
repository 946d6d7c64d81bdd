"""Logs of flights that were made with known coefficients, in every kind of file."""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.logs.fit import EnergyFit

R1, R2, HOVER = 120.0, 100.0, 400.0
LAT, LON = 36.6, -84.38
Leg = tuple[float, float, float, float]
"""Metres east, north and up, and seconds that it takes."""

MISSION: tuple[Leg, ...] = (
    (0, 0, 60, 30), (0, 0, 0, 40), (900, 0, 0, 90), (500, 300, 100, 60), (0, 0, 0, 30),
    (600, -400, 0, 70), (300, 0, -80, 55), (800, 0, 0, 80), (0, 0, 0, 30), (200, 0, 60, 30), (0, 0, -138, 92),
)  # fmt: skip


def flown(
    legs: Sequence[Leg] = MISSION, *, seed: int = 1, noise: float = 0.05, hz: float = 5.0,
    cost: Callable[[float, float, bool], float] | None = None,
) -> tuple[Floats, Floats, Floats]:  # fmt: skip
    """Seconds (N,), places (N, 3) with the noise of a receiver, watts (N,) with ``noise`` of theirs."""
    rng = np.random.default_rng(seed)
    knots, at = [np.zeros(3)], [0.0]
    for e, n, u, s in legs:
        knots.append(knots[-1] + np.array([e, n, u]))
        at.append(at[-1] + s)
    t = np.arange(0.0, at[-1], 1.0 / hz)
    place = np.stack([np.interp(t, at, [k[i] for k in knots]) for i in range(3)], axis=-1)
    leg = np.minimum(np.searchsorted(at, t, side="right") - 1, len(legs) - 1)
    speed = np.array([(math.hypot(e, n) / s, abs(u) / s, not (e or n or u)) for e, n, u, s in legs])[leg]
    rule = cost or (lambda run, rise, still: R1 * rise + R2 * run + HOVER * still)
    watts = np.array([rule(float(run), float(rise), bool(still)) for run, rise, still in speed])
    watts *= 1.0 + noise * rng.standard_normal(len(t))
    return t, place + rng.normal(0.0, (0.15, 0.15, 0.1), place.shape), watts


def within(found: EnergyFit, part: float = 0.02) -> bool:
    values = (found.vertical.value, found.horizontal.value, found.hover.value)
    return all(v is not None and abs(v - w) <= part * w for v, w in zip(values, (R1, R2, HOVER), strict=True))


def degrees(place: Floats) -> tuple[Floats, Floats]:
    """Latitude, longitude of places in metres, by the ellipsoid's radii there."""
    w = 1.0 - 6.694379990141e-3 * math.sin(math.radians(LAT)) ** 2
    north, east = 6_378_137.0 * (1 - 6.694379990141e-3) / w**1.5, 6_378_137.0 / math.sqrt(w)
    return LAT + np.degrees(place[:, 1] / north), LON + np.degrees(place[:, 0] / east / math.cos(math.radians(LAT)))


def csv_of(path: Path, header: str, columns: Sequence[Floats], mark: str = ",") -> Path:
    rows = [header, *(mark.join(f"{v:.9f}" for v in row) for row in zip(*columns, strict=True))]
    path.write_text("\r\n".join(rows) + "\r\n", encoding="utf-8-sig")
    return path


def tlog(path: Path, *, sysids: Sequence[int] = (1,), status: bool = False, battery: bool = True) -> Path:
    os.environ.setdefault("MAVLINK20", "1")
    import pymavlink.dialects.v20.ardupilotmega as dialect

    t, place, watts = flown(seed=11)
    lat, lon = degrees(place)
    out = bytearray()
    for sysid in sysids:
        link = dialect.MAVLink(None, srcSystem=sysid, srcComponent=1)
        for i, s in enumerate(t):
            stamp = struct.pack(">Q", int((1.7e9 + s) * 1e6))
            messages = [
                link.global_position_int_encode(
                    int(s * 1e3), round(lat[i] * 1e7), round(lon[i] * 1e7), round((300 + place[i, 2]) * 1e3),
                    round(place[i, 2] * 1e3), 0, 0, 0, 65535,
                )
            ]  # fmt: skip
            amp = round(watts[i] / 22.0 * 100)
            if battery and status:
                messages.append(link.sys_status_encode(0, 0, 0, 0, 22_000, amp, 50, 0, 0, 0, 0, 0, 0))
            elif battery:
                cells = [3667] * 6 + [65535] * 4
                messages.append(link.battery_status_encode(0, 0, 0, 32767, cells, amp, -1, -1, 50))
            for m in messages:
                out.extend(stamp + m.pack(link))
    path.write_bytes(out)
    return path


# A ULog is messages behind its head: F describes a topic, A subscribes to it, D is one of its messages.
ULOG_TOPICS = {
    "battery_status": ("float voltage_v;float current_a;bool connected", "<Qff?"),
    "vehicle_global_position": ("double lat;double lon;float alt", "<Qddf"),
    "vehicle_gps_position": ("int32_t lat;int32_t lon;int32_t alt;uint8_t fix_type", "<QiiiB"),
    "wind": ("float windspeed_north;float windspeed_east", "<Qff"),
}


def ulog(
    path: Path, rows: Sequence[tuple[str, int, tuple[float, ...]]], topics: dict[str, tuple[str, str]] = ULOG_TOPICS
) -> Path:
    """A log of (topic, instance, values after the microseconds that are the first of them)."""
    out = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0))

    def message(kind: str, content: bytes) -> None:
        out.extend(struct.pack("<HB", len(content), ord(kind)) + content)

    message("B", bytes(40))
    for name, (fields, _) in topics.items():
        message("F", f"{name}:uint64_t timestamp;{fields};".encode())
    ids: dict[tuple[str, int], int] = {}
    for name, instance, values in rows:
        if (name, instance) not in ids:
            ids[name, instance] = len(ids)
            message("A", struct.pack("<BH", instance, ids[name, instance]) + name.encode())
        message("D", struct.pack("<H", ids[name, instance]) + struct.pack(topics[name][1], *values))
    path.write_bytes(out)
    return path


def ulog_rows(batteries: int = 1, *, gps: bool = False) -> list[tuple[str, int, tuple[float, ...]]]:
    t, place, watts = flown(seed=10)
    lat, lon = degrees(place)
    rows: list[tuple[str, int, tuple[float, ...]]] = []
    for i, s in enumerate(t):
        us, up = int(s * 1e6) + 1, 300.0 + float(place[i, 2])
        whole = (us, round(lat[i] * 1e7), round(lon[i] * 1e7), round(up * 1e3), 3)
        rows.append(
            ("vehicle_gps_position", 0, whole) if gps else ("vehicle_global_position", 0, (us, lat[i], lon[i], up))
        )
        for b in range(batteries):
            rows.append(("battery_status", b, (us, 22.0, watts[i] / 22.0 / batteries, True)))
    return rows


# A DataFlash log is messages behind A3 95: FMT (128) describes each type by its size, name, format and columns.
FORMATS = {
    "BAT": (129, "QBffff", "TimeUS,Inst,Volt,Curr,CurrTot,EnrgTot", "<QBffff"),
    "POS": (130, "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt", "<Qiiff"),
}


def dataflash(path: Path, rows: Sequence[tuple[str, tuple[float, ...]]]) -> Path:
    out = bytearray()

    def fmt(kind: int, size: int, name: str, form: str, columns: str) -> None:
        out.extend(
            b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", kind, size, name.encode(), form.encode(), columns.encode())
        )

    fmt(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
    for name, (kind, form, columns, packed) in FORMATS.items():
        fmt(kind, 3 + struct.calcsize(packed), name, form, columns)
    for name, values in rows:
        kind, _, _, packed = FORMATS[name]
        out.extend(b"\xa3\x95" + bytes([kind]) + struct.pack(packed, *values))
    path.write_bytes(out)
    return path


def dataflash_rows(batteries: int = 1) -> list[tuple[str, tuple[float, ...]]]:
    t, place, watts = flown(seed=10)
    lat, lon = degrees(place)
    rows: list[tuple[str, tuple[float, ...]]] = []
    for i, s in enumerate(t):
        us = int(s * 1e6) + 1
        rows.append(("POS", (us, round(lat[i] * 1e7), round(lon[i] * 1e7), 300 + place[i, 2], place[i, 2])))
        for b in range(batteries):
            rows.append(("BAT", (us, b, 22.0, watts[i] / 22.0 / batteries, 0.0, 0.0)))
    return rows
