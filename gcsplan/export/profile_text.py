"""The altitude profile of a mission as a few lines of text, for a terminal, a log or a review."""

from __future__ import annotations

import math

import numpy as np

from gcsplan.check.verdict import Verdict
from gcsplan.units import METRIC, Quantity, Units
from gcsplan.world.world import World

GROUND, TRACK, BOTH, UNKNOWN = "█", "•", "▒", "?"


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
