"""`profile.csv`: one row per item, for spreadsheets and scripts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from gcsplan.export.rows import ItemRow
from gcsplan.export.table import csv_of
from gcsplan.figures import floored, steepened

COLUMNS: tuple[tuple[str, str, int], ...] = (
    ("lat", "lat_deg", 7),
    ("lon", "lon_deg", 7),
    ("amsl_m", "amsl_m", 3),
    ("agl_m", "agl_m", 3),
    ("min_agl_on_leg_m", "min_agl_on_leg_m", 3),
    ("leg_m", "leg_m", 3),
    ("climb_deg", "climb_deg", 3),
    ("energy_j", "energy_j", 1),
    ("cumulative_energy_j", "cumulative_energy_j", 1),
    ("time_s", "time_s", 2),
)
"""Column, field of `ItemRow`, decimals; the columns follow vehicle, seq and command."""

ROUNDED = {"agl_m": floored, "min_agl_on_leg_m": floored, "climb_deg": steepened}
"""How a field is rounded; others to the nearest."""


def write_profile(rows: Iterable[ItemRow]) -> str:
    """The CSV text: a header and one line per row, with LF and a decimal point; unknown values are empty."""
    lines: list[list[object]] = [["vehicle", "seq", "command", *(name for name, _, _ in COLUMNS)]]
    for row in rows:
        numbers = [_cell(getattr(row, key), decimals, ROUNDED.get(key, round)) for _, key, decimals in COLUMNS]
        lines.append([row.vehicle, row.seq, row.command, *numbers])
    return csv_of(lines)


def _cell(value: float | None, decimals: int, rounded: Callable[[float, int], float]) -> str:
    if value is None or not math.isfinite(value):
        return ""
    text = f"{rounded(value, decimals):.{decimals}f}"
    return text.lstrip("-") if float(text) == 0.0 else text
