"""ArduPilot's terrain grid, a second time: one point after another, in the autopilot's order and with its rounding.

``single=True`` computes as boards without hardware double do (``ftype`` is float32), else as SITL and H7 boards do.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

f32 = np.float32
M = f32(0.011131884502145034)
INV = f32(89.83204953368922)


def scale(lat: int, single: bool) -> float | np.float32:
    if single:
        return max(f32(np.cos(f32(f32(lat) * f32(1e-7 * math.pi / 180)))), f32(0.01))
    return max(math.cos(lat * (1.0e-7 * math.pi / 180)), 0.01)


def turn(a: int, b: int) -> int:
    d = a - b
    return d - 3_600_000_000 if d > 1_800_000_000 else d + 3_600_000_000 if d < -1_800_000_000 else d


def c_half(n: int) -> int:
    return int(n / 2)  # C rounds towards zero


def distance_ne(lat1: int, lon1: int, lat2: int, lon2: int, single: bool) -> tuple[np.float32, np.float32]:
    north = f32(f32(lat2 - lat1) * M)
    east = f32(turn(lon2, lon1)) * M
    return north, f32(float(east) * float(scale(c_half(lat2 + lat1), single)))


def offset(lat: int, lon: int, north: float, east: float, single: bool) -> tuple[int, int]:
    if single:
        dlat = int(f32(f32(north) * INV))
        dlon = int(f32(f32(f32(east) * INV) / scale(lat + c_half(dlat), True)))
    else:
        dlat = int(float(f32(north)) * float(INV))
        dlon = int(float(f32(east)) * float(INV) / scale(lat + c_half(dlat), False))
    lon += dlon
    if lon >= 1_800_000_000:
        lon -= 3_600_000_000
    return lat + dlat, lon


@dataclass
class Info:
    lat_degrees: int
    lon_degrees: int
    grid_lat: int
    grid_lon: int
    grid_idx_x: int
    grid_idx_y: int
    idx_x: int
    idx_y: int
    frac_x: float
    frac_y: float
    north: float
    east: float


def info_of(lat: int, lon: int, spacing: int = 100, single: bool = False) -> Info:
    lat_deg = int((lat - 9999999 if lat < 0 else lat) / 10_000_000)
    lon_deg = int((lon - 9999999 if lon < 0 else lon) / 10_000_000)
    ref = lat_deg * 10_000_000, lon_deg * 10_000_000
    north, east = distance_ne(*ref, lat, lon, single)
    ix, iy = int(north / f32(spacing)), int(east / f32(spacing))
    gx, gy = ix // 24, iy // 28
    corner = offset(*ref, gx * 24 * float(spacing), gy * 28 * float(spacing), single)
    return Info(
        lat_deg, lon_deg, *corner, gx, gy, ix % 24, iy % 28,
        float((north - f32(ix * spacing)) / f32(spacing)), float((east - f32(iy * spacing)) / f32(spacing)),
        float(north), float(east),
    )  # fmt: skip


def height(lat: int, lon: int, post: Callable[[int, int, int, int], float], spacing: int = 100) -> float:
    """``post(lat_degrees, lon_degrees, north, east)``: height of a post by its number from the tile's corner."""
    g = info_of(lat, lon, spacing)
    x, y = g.grid_idx_x * 24 + g.idx_x, g.grid_idx_y * 28 + g.idx_y
    at = [[post(g.lat_degrees, g.lon_degrees, x + a, y + b) for b in (0, 1)] for a in (0, 1)]
    west = (1 - g.frac_x) * at[0][0] + g.frac_x * at[1][0]
    east = (1 - g.frac_x) * at[0][1] + g.frac_x * at[1][1]
    return (1 - g.frac_y) * west + g.frac_y * east


def blocks_a_row(lat_degrees: int, lon_degrees: int, spacing: int = 100) -> int:
    lat, lon = lat_degrees * 10_000_000, lon_degrees * 10_000_000
    far = offset(lat, lon + 10_000_000, 0.0, 2 * spacing * 32, False)
    return int(distance_ne(lat, lon, *far, False)[1] / f32(spacing * 28))


def crc16(data: bytes) -> int:
    """CRC-16/XMODEM bit by bit: polynomial 0x1021, begun with 0."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = ((crc << 1) ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc
