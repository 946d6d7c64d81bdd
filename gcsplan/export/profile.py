"""The altitude profile of a mission: `profile.csv`, one row per item, for spreadsheets and scripts; and a few lines of
text, for a terminal, a log or a review.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from gcsplan.check.verdict import Verdict
from gcsplan.export.rows import ItemRow
from gcsplan.export.table import csv_of
from gcsplan.figures import floored, raised, steepened
from gcsplan.units import METRIC, Quantity, Units
from gcsplan.world.world import World

PROFILE_COLUMNS: tuple[tuple[str, str, int], ...] = (
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

WIND_COLUMNS = (("earliest_s", "earliest_s", 2), ("latest_s", "latest_s", 2))
"""The last columns, where winds are declared."""

ROUNDED = {
    "agl_m": floored, "min_agl_on_leg_m": floored, "climb_deg": steepened, "earliest_s": floored, "latest_s": raised
}  # fmt: skip
"""The rounding of each field; the others are rounded to the nearest."""


GROUND, TRACK, BOTH, UNKNOWN = "█", "•", "▒", "?"


def write_profile(rows: Iterable[ItemRow]) -> str:
    """The CSV text: a header and one line per row, with LF and a decimal point; unknown values are empty."""
    rows = list(rows)
    columns = PROFILE_COLUMNS + (WIND_COLUMNS if any(row.latest_s is not None for row in rows) else ())
    lines: list[list[object]] = [["vehicle", "seq", "command", *(name for name, _, _ in columns)]]
    for row in rows:
        numbers = [_cell(getattr(row, key), decimals, ROUNDED.get(key, round)) for _, key, decimals in columns]
        lines.append([row.vehicle, row.seq, row.command, *numbers])
    return csv_of(lines)


def _cell(value: float | None, decimals: int, rounded: Callable[[float, int], float]) -> str:
    if value is None or not math.isfinite(value):
        return ""
    text = f"{rounded(value, decimals):.{decimals}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def profile_lines(
    verdict: Verdict, world: World, units: Units = METRIC, *, columns: int = 72, rows: int = 10
) -> list[str]:
    """``rows`` lines that begin with the altitude AMSL, and one below with the track length; none if nothing is flown.

    In each column, ground is filled up to its highest sample, the path is drawn at its altitude, and ``▒`` marks a cell
    with both. Columns of take-off and landing are left out, because they have no width.
    """
    legs = [leg for leg in verdict.legs if not leg.column and leg.horizontal_m > 0.0]
    total_m = math.fsum(leg.horizontal_m for leg in legs)
    if not legs or total_m <= 0.0:
        return []
    ends = np.cumsum([0.0, *(leg.horizontal_m for leg in legs)])
    at = np.linspace(0.0, total_m, 8 * columns)
    which = np.clip(np.searchsorted(ends, at, side="right") - 1, 0, len(legs) - 1)
    starts = np.array([leg.start for leg in legs])[which]
    stops = np.array([leg.end for leg in legs])[which]
    part = ((at - ends[which]) / np.maximum(ends[which + 1] - ends[which], 1e-9)).clip(0.0, 1.0)[:, None]
    places = starts + part * (stops - starts)
    plane = world.frame.to_plane(places[:, 0], places[:, 1])
    ground = world.airspace.surface.ground_at(plane[..., 0], plane[..., 1]).reshape(columns, 8)
    track = places[:, 2].reshape(columns, 8)
    both = np.concatenate([ground[np.isfinite(ground)], track.ravel()])
    low, high = float(both.min()), float(both.max())
    span = max(high - low, 10.0)
    low, high = low - span / rows, high + 0.02 * span  # the lowest ground gets a row of its own
    step = (high - low) / rows
    top = np.array([np.nan if np.isnan(g).all() else np.nanmax(g) for g in ground])
    lines = []
    for row in range(rows):
        above, below = high - row * step, high - (row + 1) * step
        cells = []
        for column in range(columns):
            fill = top[column] > 0.5 * (above + below)  # False for NaN
            here = bool(((track[column] >= below) & (track[column] <= above)).any())
            unknown = row == rows - 1 and math.isnan(top[column])
            if here:
                cells.append(BOTH if fill else TRACK)
            else:
                cells.append(GROUND if fill else UNKNOWN if unknown else " ")
        lines.append(f"{units.height.of(0.5 * (above + below)):7.0f} {''.join(cells)}".rstrip())
    length = Quantity(total_m, "far", 2).text(units)
    lines.append(f"{units.amsl.symbol:>7} 0{length:>{columns - 1}}")
    return lines
