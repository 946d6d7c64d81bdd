"""A fixed wing that climbs well is at the altitude of its take-off early, and turns to the next item there."""

from __future__ import annotations

import math

from gcsplan.check.fixed_wing.climb_out import MOST_PARTS, between, over_m, place_of
from gcsplan.check.motion.flight_state import Aboard
from gcsplan.check.motion.geodesy import flat_m, offset_m
from gcsplan.check.motion.stopping import about_turn_m
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.notes.note import Note

STEEPEST_DEG = 45.0
"""No aircraft climbs out more steeply; 30° were flown in simulation, with TECS_PITCH_MAX 25."""

OVER_FOR_M = 150.0
"""It is above the altitude of its take-off for so many metres after it was there first."""


def turns_early(pilot: Aboard, seq: int, after: MissionItem | None) -> None:
    """The ways to the next item from all places of the climb-out at which the aircraft may be at its altitude."""
    if after is None or not pilot.known or place_of(pilot, after) is None or after.command == cmd.LOITER_TO_ALT:
        return
    target = pilot.target(after)
    if target is None:
        return
    home, end = pilot.home, pilot.at
    first = min((end[2] - home[2]) / math.tan(math.radians(STEEPEST_DEG)) / flat_m(home, end), 1.0)
    ahead = offset_m(home, end)
    place = (home[0] + first * (end[0] - home[0]), home[1] + first * (end[1] - home[1]), end[2])
    way, rest = offset_m(place, target), offset_m(place, end)
    part = min(max((rest[0] * way[0] + rest[1] * way[1]) / max(way[0] ** 2 + way[1] ** 2, 1e-9), 0.0), 1.0)
    aside_m = math.hypot(rest[0] - part * way[0], rest[1] - part * way[1])
    if aside_m <= pilot.vehicle.limits.track_error_m:
        return
    parts = min(math.ceil(aside_m / max(pilot.vehicle.limits.track_error_m, 1.0)), MOST_PARTS)
    half = over_m(pilot.vehicle) / 2.0
    terrain = m.FRAME_SYNONYMS.get(after.frame, after.frame) == m.TERRAIN
    for k in range(parts):
        share = first + (1.0 - first) * (k + 0.5) / parts
        start = (home[0] + share * (end[0] - home[0]), home[1] + share * (end[1] - home[1]), end[2])
        turn = offset_m(start, target)
        length = math.hypot(*ahead) * math.hypot(*turn)
        cosine = (ahead[0] * turn[0] + ahead[1] * turn[1]) / max(length, 1e-9)
        swing_m = 0.5 * (1.0 - cosine) * about_turn_m(pilot.vehicle, pilot.pace.speed_m_s, end[2])
        gap_m = 0.5 * (1.0 - first) * math.hypot(*ahead) / parts * math.sqrt(max(0.0, 1.0 - cosine**2))
        pilot.instead(seq, "cruise", start, target, terrain=terrain, reach_m=swing_m + gap_m)
        pilot.at_once(seq, "cruise", start, target, terrain=terrain, reach_m=swing_m + gap_m)
        if half > 0.0:
            near = min(1.0, OVER_FOR_M / max(flat_m(start, target), 1.0))
            low, high = (*start[:2], end[2] + half), (*between(start, target, near), end[2] + half)
            pilot.instead(seq, "takeoff", low, high, column=True, reach_m=swing_m + gap_m, band_m=half)
    pilot.note(Note("turns_early", seq))
