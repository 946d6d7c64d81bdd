"""A fixed wing's landing: a straight glide, and the flare at its end.

A NAV_LAND glides straight from the way point before it (AP_Landing_Slope.cpp), towards a point before and above its
place from which the flare is flat: a few metres below the line between the two. What a glide keeps from the ground is
that of a climb-out (`climb_out`).
"""

from __future__ import annotations

import math
from itertools import pairwise

from gcsplan.check.motion.flight_state import Aboard
from gcsplan.check.motion.stretch import Place, flat_m, offset_m
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.notes.note import Note

FLARE_S, FLARE_MOST_M, LAND_SINK_M_S = 2.0, 6.0, 0.25
"""Defaults of LAND_FLARE_SEC, of twice LAND_FLARE_ALT, and of TECS_LAND_SINK."""

BEFORE_M, STEP_M = 200.0, 10.0
DOWNHILL, DOWNHILL_M = 0.02, 2.0
"""How far before a landing its ground is looked at, m; the slope and height from which that ground gets a note."""


def glide(pilot: Aboard, seq: int, item: MissionItem) -> None:
    """NAV_LAND: a straight descent from the present place to the place of the item."""
    target = pilot.target(item) if pilot.has_place(item) else None
    pilot.landed = True
    if target is None:
        pilot.flight.not_judged.append(Note("landing_without_place", seq))
        return
    ground = pilot.ground(*target[:2])
    off_m = target[2] - ground
    if not abs(off_m) <= max(1.0, pilot.vehicle.limits.altitude_error_m):
        pilot.flight.not_judged.append(
            Note("glide_to_unknown_ground", seq)
            if math.isnan(off_m)
            else Note("glide_off_ground", seq, off_m=abs(off_m), below=off_m > 0.0)
        )
        return
    end = (*target[:2], ground)
    pilot.note(Note("glide_straight", seq))
    pilot.note(_downhill(pilot, seq, end))
    pilot.add(seq, "land", pilot.at, end, column=True)
    for a, b in pairwise(flared(pilot.at, end, flat_m(pilot.at, end), pilot.pace.speed_m_s)):
        pilot.instead(seq, "land", a, b, column=True)
    pilot.at = end


def _downhill(pilot: Aboard, seq: int, end: Place) -> Note | None:
    """That a landing leads down a slope, where the aircraft meets the ground before its place; None if not."""
    top, run_m = pilot.at, flat_m(pilot.at, end)
    if run_m < STEP_M:
        return None
    steepest, early_m = (0.0, 0.0), 0.0
    for k in range(1, int(min(BEFORE_M, run_m) / STEP_M) + 1):
        away_m = k * STEP_M
        part = away_m / run_m
        lat, lon = (end[i] + part * (top[i] - end[i]) for i in (0, 1))
        higher_m = pilot.ground(lat, lon) - end[2]
        if higher_m >= max(DOWNHILL * away_m, DOWNHILL_M) and higher_m / away_m > steepest[0]:
            steepest = higher_m / away_m, away_m
        if part * (top[2] - end[2]) - pilot.vehicle.limits.altitude_error_m <= higher_m:
            early_m = away_m
    slope, away_m = steepest
    if slope == 0.0:
        return None
    east_m, north_m = offset_m(top, end)
    uphill_deg = (math.degrees(math.atan2(east_m, north_m)) + 180.0) % 360.0
    return Note(
        "lands_downhill", seq, away_m=away_m, higher_m=slope * away_m, slope_percent=100.0 * slope, early_m=early_m,
        uphill_deg=uphill_deg,
    )  # fmt: skip


def flared(top: Place, ground: Place, run_m: float, speed_m_s: float) -> list[Place]:
    """The second half of a glide as it is flown below its line: to the beginning of the flare, then to the ground.

    A place may be any three numbers. Empty if the glide stays on its line. AP_Landing_Slope.cpp,
    `type_slope_setup_landing_glide_slope`, with the defaults.
    """
    fall = top[2] - ground[2]
    sink_m_s = speed_m_s * fall / max(run_m, 1.0)
    high_m = min(FLARE_S * sink_m_s, FLARE_MOST_M)
    part = min(0.5, speed_m_s * high_m / max(0.5 * (LAND_SINK_M_S + sink_m_s), 0.1) / max(run_m, 1.0))
    if high_m >= part * fall:
        return []

    def at(down: float, z: float) -> Place:
        return top[0] + down * (ground[0] - top[0]), top[1] + down * (ground[1] - top[1]), z

    aim = at(1.0 - part, ground[2] + high_m)
    middle = at(0.5, top[2] - 0.5 * (fall - high_m) / (1.0 - part))
    return [aim, ground] if part == 0.5 else [middle, aim, ground]
