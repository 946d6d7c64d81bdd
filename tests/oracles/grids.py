"""UTM and MGRS a second time: Krüger's series for the transverse Mercator projection, and the letters by counting."""

from __future__ import annotations

import math
from typing import NamedTuple

A_M, F = 6378137.0, 1.0 / 298.257223563
LETTERS = "ABCDEFGHJKLMNPQRSTUVWXYZ"


class Utm(NamedTuple):
    zone: int
    south: bool
    easting_m: float
    northing_m: float


def band_of(lat_deg: float) -> str:
    return "CDEFGHJKLMNPQRSTUVWXX"[int((lat_deg + 80.0) // 8.0)]


def zone_of(lat_deg: float, lon_deg: float) -> int:
    if band_of(lat_deg) == "V" and 3.0 <= lon_deg < 12.0:
        return 32
    if band_of(lat_deg) == "X" and 0.0 <= lon_deg < 42.0:
        return next(zone for zone, east in ((31, 9.0), (33, 21.0), (35, 33.0), (37, 42.0)) if lon_deg < east)
    return int((lon_deg + 180.0) // 6.0) % 60 + 1


def utm_of(lat_deg: float, lon_deg: float) -> Utm:
    """Krüger's series to the third order of n: a millimetre within a zone."""
    zone = zone_of(lat_deg, lon_deg)
    n = F / (2.0 - F)
    radius_m = A_M / (1.0 + n) * (1.0 + n**2 / 4.0 + n**4 / 64.0)
    alpha = (
        n / 2.0 - 2.0 * n**2 / 3.0 + 5.0 * n**3 / 16.0, 13.0 * n**2 / 48.0 - 3.0 * n**3 / 5.0, 61.0 * n**3 / 240.0
    )  # fmt: skip
    phi = math.radians(lat_deg)
    away = math.radians((lon_deg - (6.0 * zone - 183.0) + 180.0) % 360.0 - 180.0)
    e = 2.0 * math.sqrt(n) / (1.0 + n)
    t = math.sinh(math.atanh(math.sin(phi)) - e * math.atanh(e * math.sin(phi)))
    xi, eta = math.atan2(t, math.cos(away)), math.atanh(math.sin(away) / math.hypot(1.0, t))
    east = eta + sum(a * math.cos(2 * j * xi) * math.sinh(2 * j * eta) for j, a in enumerate(alpha, 1))
    north = xi + sum(a * math.sin(2 * j * xi) * math.cosh(2 * j * eta) for j, a in enumerate(alpha, 1))
    south = lat_deg < 0.0
    return Utm(zone, south, 500_000.0 + 0.9996 * radius_m * east, 0.9996 * radius_m * north + 1e7 * south)


def mgrs_of(lat_deg: float, lon_deg: float, digits: int) -> str:
    """MGRS of the square that holds the place, cut off after ``digits`` digits each."""
    utm = utm_of(lat_deg, lon_deg)
    e, n = math.floor(utm.easting_m), math.floor(utm.northing_m)
    column = LETTERS[(8 * ((utm.zone - 1) % 3) + e // 100_000 - 1) % 24]
    row = LETTERS[(n // 100_000 + (5 if utm.zone % 2 == 0 else 0)) % 20]
    within = (f"{x % 100_000:05d}"[:digits] for x in (e, n))
    return f"{utm.zone:02d}{band_of(lat_deg)}{column}{row}{''.join(within)}"
