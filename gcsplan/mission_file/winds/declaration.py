"""From the keys of ``wind:`` to the set of winds, with every mistake that takes more than one key."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file.published.times import Hours
from gcsplan.mission_file.values.schema import WindKeys, WindLevelKeys
from gcsplan.notes.note import Note
from gcsplan.wind.declared import DeclaredWind, WindHeights
from gcsplan.world.geodesy.frame import Frame

if TYPE_CHECKING:
    from gcsplan.mission_file.winds.forecast import Forecast

WIND_FORMS = ("speed_m_s", "up_to_m_s", "levels", "forecast")
"""The keys that say what blows; a mission has one of them."""

FARTHEST_GRID_M = 30_000.0
"""Farthest that a mission's places may lie from a forecast's grid point; global models have one every 25 km or so."""

ROUNDING_M_S = 1e-6
"""Difference of two speeds that were the same in another unit."""

NEEDS_DEPARTURE = (
    "a forecast needs the time of departure: write `at: 2026-11-28T10:00Z`, or [from, to] with all of the flight in it "
    "(--at, --gate-utc)"
)


def go_together(keys: WindKeys, where: str, problems: list[Mistake]) -> bool:
    """Whether one thing is declared, with no key of another."""
    before = len(problems)
    forms = [form for form in WIND_FORMS if getattr(keys, form) is not None]
    if len(forms) != 1:
        given = " and ".join(forms) or "none"
        choices = "give one of speed_m_s (with from_deg), up_to_m_s (any direction), levels and forecast"
        problems.append(Mistake(where, f"{choices}, given {given}"))
        return False
    form = forms[0]
    if keys.from_deg is not None and form != "speed_m_s":
        cure = {
            "up_to_m_s": "leave it out, for up_to_m_s means any direction; or give speed_m_s: [0, …] with it",
            "levels": "give each level its own",
            "forecast": "leave it out, for the forecast has directions; from_error_deg widens them",
        }[form]
        problems.append(Mistake(f"{where}.from_deg", f"belongs to speed_m_s; {cure}"))
    for key, cure in (("speed_error_m_s", "speed_m_s: [3, 7]"), ("from_error_deg", "from_deg: [250, 290]")):
        if getattr(keys, key) is not None and form != "forecast":
            problems.append(Mistake(f"{where}.{key}", f"belongs to a forecast; give a range, such as {cure}"))
    return len(problems) == before


def winds_of(keys: WindKeys, where: str, problems: list[Mistake]) -> DeclaredWind | None:
    """The winds whose numbers stand in the mission; None, and ``problems``, if they are none."""
    before = len(problems)
    if keys.levels is not None:
        heights, heights_m = _heights(keys.levels, f"{where}.levels", problems)
        ranges = [(level.speed_m_s, level.from_deg) for level in keys.levels]
    else:
        heights, heights_m, ranges = "agl", [0.0], [_one(keys, where, problems)]
    speed_m_s, from_deg = (np.array([list(values)]) for values in zip(*ranges, strict=True))
    if not _gust_is_fastest(keys, float(speed_m_s.max()), where, problems) or len(problems) > before:
        return None
    return DeclaredWind(
        speed_m_s, from_deg, np.array(heights_m), heights, varying=keys.varying, gust_m_s=keys.gust_m_s
    )  # fmt: skip


def winds_of_forecast(
    keys: WindKeys, read: Callable[[], Forecast], hours: Hours, frame: Frame, places_m: Sequence[tuple[float, float]],
    where: str, problems: list[Mistake],
) -> tuple[DeclaredWind, Note] | None:  # fmt: skip
    """The winds of the forecast that ``keys`` name, within ``hours``, and a note on it; None, and ``problems``, if it
    cannot be read, or does not hold the hours or the ``places_m`` of the mission's plane."""
    try:
        forecast = read().within(hours)
    except InputError as why:
        problems += why.problems
        return None
    away_m = forecast.away_m(frame, np.array(places_m))
    if away_m > FARTHEST_GRID_M:
        words = (
            f"is for {forecast.lat_deg:.4f}, {forecast.lon_deg:.4f}, more than {FARTHEST_GRID_M / 1000.0:.0f} km from "
            f"a place of the mission; get the forecast for {frame.lat_deg:.4f}, {frame.lon_deg:.4f}, or declare winds "
            "that hold everywhere (`up_to_m_s`)"
        )
        problems.append(Mistake(f"{where}.forecast", words))
        return None
    error_m_s, error_deg = keys.speed_error_m_s or 0.0, keys.from_error_deg or 0.0
    speed_m_s = np.stack([np.maximum(forecast.speed_m_s - error_m_s, 0.0), forecast.speed_m_s + error_m_s], axis=-1)
    from_deg = np.stack([forecast.from_deg - error_deg, forecast.from_deg + error_deg], axis=-1)
    most_m_s = float(speed_m_s.max())
    if not _gust_is_fastest(keys, most_m_s, where, problems):
        return None
    gust_m_s = keys.gust_m_s
    if gust_m_s is None and forecast.gust_m_s is not None:
        gust_m_s = most_m_s + forecast.gusts_add_m_s()
    wind = DeclaredWind(speed_m_s, from_deg, forecast.agl_m, "agl", forecast.times_s, keys.varying, gust_m_s)
    note = Note(
        "wind_of_forecast", file=Path(keys.forecast or "").name, lat_deg=forecast.lat_deg, lon_deg=forecast.lon_deg,
        away_m=away_m, hours=str(hours), sha256=forecast.sha256,
    )  # fmt: skip
    return wind, note


def _one(keys: WindKeys, where: str, problems: list[Mistake]) -> tuple[list[float], list[float]]:
    """The ranges of speed and direction at every height."""
    if keys.up_to_m_s is not None:
        return [0.0, keys.up_to_m_s], [0.0, 360.0]
    speed_m_s = keys.speed_m_s or [0.0, 0.0]
    if keys.from_deg is None and speed_m_s[1] > 0.0:
        words = "is missing: where the wind comes from, in degrees from north; if that is unknown, give up_to_m_s"
        problems.append(Mistake(f"{where}.from_deg", f"{words} alone", "missing"))
    return speed_m_s, keys.from_deg or [0.0, 0.0]


def _heights(levels: Sequence[WindLevelKeys], where: str, problems: list[Mistake]) -> tuple[WindHeights, list[float]]:
    """What the levels count from, and their heights."""
    found: list[tuple[WindHeights, float]] = []
    for i, level in enumerate(levels):
        if (level.agl_m is None) == (level.amsl_m is None):
            words = "give agl_m (above ground) or amsl_m (above sea level)"
            problems.append(Mistake(f"{where}[{i}]", words + (", not both" if level.agl_m is not None else "")))
        elif level.agl_m is not None:
            found.append(("agl", level.agl_m))
        elif level.amsl_m is not None:
            found.append(("amsl", level.amsl_m))
    if len(found) < len(levels):
        return "agl", [0.0]
    for i, (one, other) in enumerate(pairwise(found), 1):
        at = f"{where}[{i}].{other[0]}_m"
        if one[0] != other[0]:
            words = f"must count as the levels before it do: give {found[0][0]}_m, or all {other[0]}_m"
            problems.append(Mistake(at, words))
            break
        if other[1] <= one[1]:
            problems.append(Mistake(at, f"must be above the level before it, {one[1]:g}, given {other[1]:g}"))
    return found[0][0], [height for _, height in found]


def _gust_is_fastest(keys: WindKeys, most_m_s: float, where: str, problems: list[Mistake]) -> bool:
    """Whether no wind is faster than the gusts, if there are any."""
    if keys.gust_m_s is None or keys.gust_m_s >= most_m_s - ROUNDING_M_S:
        return True
    words = f"must be at least the fastest wind, {most_m_s:.4g} m/s, given {keys.gust_m_s:.4g}"
    problems.append(Mistake(f"{where}.gust_m_s", f"{words}; leave it out if there are no gusts"))
    return False
