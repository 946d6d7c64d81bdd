"""A forecast as Open-Meteo's API returns it, small, at 47° N, 8.01° E."""

from __future__ import annotations

from typing import Any

HOURS = [f"2026-11-28T{hour:02d}:00" for hour in range(10, 16)]
"""Local times, an hour ahead of UTC."""


def forecast(**changes: Any) -> dict[str, Any]:
    """Six hours at two heights: 36 km/h at 10 m and 72 km/h at 80 m at first, and 3.6 km/h more every hour."""
    hourly = {
        "time": HOURS,
        "wind_speed_10m": [36.0 + 3.6 * k for k in range(6)],
        "wind_speed_80m": [72.0 + 3.6 * k for k in range(6)],
        "wind_direction_10m": [350, 355, 0, 5, 10, 15],
        "wind_direction_80m": [0, 5, 10, 15, 20, 25],
        "wind_gusts_10m": [54.0, 57.6, 64.8, 64.8, 68.4, 108.0],
    }
    units = {name: "°" if "direction" in name else "km/h" for name in hourly if name != "time"}
    whole = {
        "latitude": 47.0, "longitude": 8.01, "generationtime_ms": 0.05, "utc_offset_seconds": 3600,
        "timezone": "Europe/Zurich", "timezone_abbreviation": "CET", "elevation": 510.0,
        "hourly_units": {"time": "iso8601", **units}, "hourly": hourly,
    }  # fmt: skip
    for place, value in changes.items():
        section, _, key = place.rpartition("__")
        inside: Any = whole[section] if section else whole
        if value is ...:
            del inside[key]
        else:
            inside[key] = value
    return whole
