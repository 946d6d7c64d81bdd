"""A forecast as Open-Meteo's API returns it, small, at 47° N, 8.01° E."""

from __future__ import annotations

import json
from pathlib import Path
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


def mission_in_forecast(file: Path, at: list[str], goal_deg: tuple[float, float]) -> dict[str, Any]:
    """A mission of one fast copter from the forecast's place, in a light wind of it, which is written to ``file``."""
    calm = {f"hourly__wind_{key}": [9.0] * len(HOURS) for key in ("speed_10m", "speed_80m", "gusts_10m")}
    file.write_text(json.dumps(forecast(**calm)))
    vehicle = {"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [47.0, 8.01], "goal": list(goal_deg)}
    return {
        "version": 1, "terrain": {"flat_m": 100}, "limits": {"min_agl_m": 30, "max_agl_m": 120}, "at": at,
        "wind": {"forecast": str(file)}, "vehicles": [vehicle | {"speed_m_s": 15}],
    }  # fmt: skip
