"""What a set of winds is in words and in JSON; the sentences themselves are in the catalogue of notes."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.notes.note import Note
from gcsplan.wind.declared import DeclaredWind


def wind_note(wind: DeclaredWind) -> Note:
    """The one sentence on the winds of a mission: still air, or what is declared."""
    if wind.still:
        return Note("still_air")
    return Note(
        "wind_declared", speeds=speeds_note(wind.speed_m_s), directions=directions_note(wind.from_deg),
        blows=Note("wind_varies" if wind.varying else "wind_is_one"),
        gusts=gusts_note(wind),
    )  # fmt: skip


def gusts_note(wind: DeclaredWind) -> Note | str:
    """The gusts of a set, as the end of a sentence on its winds; nothing where none are declared."""
    return "" if wind.gust_m_s is None else Note("wind_gusts", gust_m_s=wind.gust_m_s)


def speeds_note(speed_m_s: Floats) -> Note:
    """The span of speeds (..., 2), lowest and highest."""
    least, most = float(speed_m_s[..., 0].min()), float(speed_m_s[..., 1].max())
    return Note("wind_speed", most_m_s=most) if least == most else Note("wind_speeds", least_m_s=least, most_m_s=most)


def directions_note(from_deg: Floats) -> Note:
    """The smallest arc of directions that holds all of ``from_deg`` (..., 2)."""
    low, high = arc_deg(from_deg)
    if high - low >= 360.0:
        return Note("wind_from_any")
    one = high == low
    return Note("wind_from", from_deg=low) if one else Note("wind_from_range", from_deg=low, to_deg=high % 360.0)


def arc_deg(from_deg: Floats) -> tuple[float, float]:
    """The smallest arc, clockwise, that holds all arcs (..., 2); it begins from 0 to 360, and is 360 long at most."""
    arcs = np.reshape(from_deg, (-1, 2))
    low = arcs[:, 0] % 360.0
    order = np.argsort(low, kind="stable")
    begins = np.concatenate([low[order], low[order] + 360.0])
    ends = begins + np.tile((arcs[:, 1] - arcs[:, 0])[order], 2)
    reach = np.maximum.accumulate(ends)
    gaps = (begins[1:] - reach[:-1])[len(arcs) - 1 :]  # one turn: the gap before each arc, behind all that came before
    k = int(np.argmax(gaps))
    if gaps[k] <= 0.0:
        return 0.0, 360.0
    start = float(begins[len(arcs) + k] % 360.0)
    return start, start + 360.0 - float(gaps[k])


def as_dict(wind: DeclaredWind) -> dict[str, Any]:
    """The set for programs: SI, degrees, times in UTC; speeds and directions by time and height."""
    several = len(wind.times_s) > 1
    return {
        "still": wind.still,
        "varying": wind.varying,
        "gust_m_s": wind.gust_m_s,
        "heights": wind.heights,
        "heights_m": wind.heights_m.tolist(),
        "times": [datetime.fromtimestamp(t, UTC).isoformat() for t in wind.times_s.tolist()] if several else [],
        "speed_m_s": wind.speed_m_s.tolist(),
        "from_deg": wind.from_deg.tolist(),
    }
