"""Flight logs of a given size, of every kind, and what damage makes of them.

Each function writes one log into the current folder and returns the arguments of ``gcsplan``.
"""

from __future__ import annotations

import os
import random
import struct
from pathlib import Path

from tests.campaigns.large_inputs import LAT, LON

FMT = b"\xa3\x95\x80"


def log(count: int, rng: random.Random) -> list[str]:
    """A table of that many lines."""
    with Path("log.csv").open("w") as file:
        file.write("time_s,lat,lon,alt_m,power_w\n")
        for k in range(count):
            lat, lon = LAT + 0.00005 * (k % 500), LON
            file.write(f"{0.1 * k:.1f},{lat:.7f},{lon:.7f},{100.0 + 0.1 * (k % 300):.1f},{rng.uniform(280, 320):.1f}\n")
    return ["fit-energy", "log.csv"]


def _format(kind: int, size: int, name: bytes, form: bytes, columns: bytes) -> bytes:
    return FMT + struct.pack("<BB4s16s64s", kind, size, name, form, columns)


HEADS = (
    _format(128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    + _format(129, 3 + struct.calcsize("<QLLff"), b"POS", b"QLLff", b"TimeUS,Lat,Lng,Alt,RelHomeAlt")
    + _format(130, 3 + struct.calcsize("<QBff"), b"BAT", b"QBff", b"TimeUS,Inst,Volt,Curr")
)


def readings(count: int, rng: random.Random) -> list[str]:
    """An ArduPilot log of that many readings: every other one of the place, or of the battery."""
    with Path("log.bin").open("wb") as file:
        file.write(HEADS)
        for k in range(count):
            us = 100_000 * k + 1
            if k % 2:
                file.write(b"\xa3\x95\x82" + struct.pack("<QBff", us, 0, 22.0, rng.uniform(12.0, 15.0)))
            else:
                place = int(1e7 * (LAT + 0.00005 * (k % 500))), int(1e7 * LON)
                file.write(b"\xa3\x95\x81" + struct.pack("<QLLff", us, *place, 100.0 + 0.1 * (k % 300), 50.0))
    return ["fit-energy", "log.bin"]


def _megabytes(count: int, head: bytes, block: bytes) -> list[str]:
    with Path("log.bin").open("wb") as file:
        file.write(head)
        left = 1_000_000 * count - len(head)
        while left > 0:
            file.write(block[: min(left, len(block))])
            left -= len(block)
    return ["fit-energy", "log.bin"]


def noise(count: int, rng: random.Random) -> list[str]:
    """An ArduPilot log of that many megabytes of noise."""
    return _megabytes(count, HEADS, rng.randbytes(1_000_000))


def formats(count: int, rng: random.Random) -> list[str]:
    """An ArduPilot log of that many megabytes of format records, of all kinds in turn."""
    many = [
        _format(rng.randrange(1, 128), rng.randrange(4, 90), b"X%03d" % k, b"QBff", b"TimeUS,A,B,C") for k in range(999)
    ]
    return _megabytes(count, HEADS, b"".join(many))


def same_format(count: int, rng: random.Random) -> list[str]:
    """An ArduPilot log of that many megabytes of one format record."""
    return _megabytes(count, HEADS, HEADS[89 : 2 * 89] * 1000)


def small_records(count: int, rng: random.Random) -> list[str]:
    """An ArduPilot log of that many megabytes of the smallest records that there are, three bytes of head alone."""
    head = HEADS + _format(131, 3, b"NIL", b"", b"")
    return _megabytes(count, head, b"\xa3\x95\x83" * 100_000)


def messages(count: int, rng: random.Random) -> list[str]:
    """A ground station's log of that many messages: every other one of the place, or of the battery."""
    os.environ.setdefault("MAVLINK20", "1")
    import pymavlink.dialects.v20.ardupilotmega as dialect

    link = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    block = []
    for k in range(0, 1000, 2):
        lat = round(1e7 * (LAT + 0.00005 * (k % 500)))
        m = link.global_position_int_encode(k, lat, round(1e7 * LON), 100_000 + 100 * k, 100 * k, 0, 0, 0, 65535)
        block.append(m.pack(link))
        cells = [3667] * 6 + [65535] * 4
        block.append(link.battery_status_encode(0, 0, 0, 32767, cells, rng.randrange(999, 1500), -1, -1, 50).pack(link))
    with Path("log.tlog").open("wb") as file:
        for k in range(count):
            file.write(struct.pack(">Q", 1_700_000_000_000_000 + 100_000 * k) + block[k % len(block)])
    return ["fit-energy", "log.tlog"]


def tlog_noise(count: int, rng: random.Random) -> list[str]:
    """A ground station's log of that many megabytes of noise."""
    _megabytes(count, b"", rng.randbytes(1_000_000))
    Path("log.bin").rename("log.tlog")
    return ["fit-energy", "log.tlog"]
