"""Larger margins for the next plan of a vehicle whose mission breaks limits as it is flown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.build.order import Margins
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.notes.note import Finding

__all__ = ["larger", "on_path"]

HEIGHTS = ("min_agl", "max_agl", "max_amsl", "terrain_clearance")

MOST_SLOPE = 0.9
"""The most that is taken from the climb limit, as a part of it; a leg over the ground may be steeper than any path."""


def on_path(mission: Mission, verdict: Verdict) -> list[Finding]:
    """The findings that another path may cure: not those of the battery, the take-off, the landing or the return."""
    items, first = mission.items, mission.first_seq
    flown = {i + first for i, item in enumerate(items) if item.command in (cmd.WAYPOINT, cmd.LOITER_UNLIM)}
    return [f for f in verdict.findings if f.seq in flown and f.kind != "battery"]


def larger(margins: Margins, findings: Sequence[Finding], corner_m: float = math.inf) -> Margins:
    """``margins`` plus what the last mission lacked in height, distance and slope.

    ``corner_m``: metres before a way point at which the vehicle may turn onto the next leg; it cuts the corner by less,
    to the side and up or down. A finding tells only how far inside a zone the vehicle is to the side, so above and
    below zones, too, that much is added; inf for arcs, which are judged as they are flown.
    """
    low_m = max((f.by for f in findings if f.kind in HEIGHTS), default=0.0)
    near_m = max((min(f.by, corner_m) for f in findings if f.kind == "zone"), default=0.0)
    steep = max((f.by / f.limit for f in findings if f.kind in ("climb", "descent")), default=0.0)
    if math.isfinite(corner_m):
        low_m = max(low_m, near_m)
    return replace(
        margins,
        altitude_m=margins.altitude_m + 0.02 + 1.05 * low_m,
        track_m=margins.track_m + 0.03 + 1.05 * near_m,
        bow_m=3.0 * margins.bow_m,
        slope=min(margins.slope + (0.001 + 1.5 * steep if steep else 0.0), MOST_SLOPE),
    )
