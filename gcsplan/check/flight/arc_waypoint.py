"""The arc that ArduCopter 4.7 and later fly to a NAV_ARC_WAYPOINT, as chords and how far it bulges from each chord.

It is a circle's arc, seen from above, from where the leg begins to the item's place, over param1 degrees: clockwise, or
anticlockwise if negative (SCurve.cpp, `calculate_track`). Its radius follows from the chord. The altitude changes
evenly along it, and the speed is at most the root of 5 m/s² (WPNAV_ACCEL_C) times the radius. Below `STRAIGHT_DEG` it
flies straight. The circle is one in ArduPilot's plane around home, which is not quite ours. Older versions refuse the
item on upload. No released autopilot has flown such an arc here; see docs/concepts/flown.md for what has.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gcsplan.check.motion.flight_state import Aboard, reads_ground
from gcsplan.check.motion.stretch import Place
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot

DEGREE_M = 111318.84502145034
"""Metres per degree, Location.h, `LOCATION_SCALING_FACTOR`."""

STRAIGHT_DEG, MOST_DEG = 1.0, 359.0
"""Below the first it is a straight leg; beyond the second the angle is not judged: MAVLink's limit."""

LOADED_DEG = 270.0
"""Wider arcs may need terrain so far away that none is loaded for them; the check then says that it is unknown."""

SPLINE_BULGE = 0.6
"""The same for a spline, at most: its two tangents together are at most four times its length, which makes 16/27."""

CORNER_M_S2 = 5.0
"""Twice WPNAV_ACCEL, what WPNAV_ACCEL_C means by default, m/s²."""

BULGE_M = 0.25
LEAST_PIECES, MOST_PIECES = 4, 720


def fly_arc(pilot: Aboard, seq: int, item: MissionItem, after: MissionItem | None) -> bool:
    """Add the arc of ``item``; ``after``: what is flown next, None if a jump decides. False: it is not known.

    It is known for ArduCopter, from a place that is known, without the terrain frame, and not before a spline.
    """
    target, angle_deg = pilot.target(item), item.params[0]
    last = pilot.flight.stretches[-1] if pilot.flight.stretches else None
    placed = pilot.airborne and pilot.known and pilot.has_place(item) and not reads_ground(item)
    circled = last is not None and last.kind == "loiter" and last.reach_m > 0.0  # it may be left anywhere
    if pilot.autopilot is not Autopilot.ARDUCOPTER or target is None or not placed or circled:
        return False
    if after is None or after.command == cmd.SPLINE_WAYPOINT or not abs(angle_deg) <= MOST_DEG:
        return False
    places, bulge_m, radius_m = arc_chords(pilot.at, target, angle_deg, pilot.home)
    steep = None
    if math.isfinite(radius_m):
        slope = (target[2] - pilot.at[2]) / (radius_m * math.radians(abs(angle_deg)))
        steep = (slope, slope)
    pace = pilot.pace
    pilot.pace = replace(pace, speed_m_s=min(pace.speed_m_s, arc_speed_m_s(radius_m)))
    for a, b in pairwise(places):
        pilot.add(seq, "cruise", a, b, reach_m=bulge_m, on_path=True, steep=steep)
    pilot.pace, pilot.at, pilot.direction = pace, target, None
    pilot.settled(item)
    pilot.note(Note("arcs_by_version"))
    return True


def arc_chords(start: Place, end: Place, angle_deg: float, home: Place) -> tuple[list[Place], float, float]:
    """The arc's points from ``start`` to ``end`` (both exact), its bulge beyond the chords, m, and its radius, m.

    ``angle_deg``: within `MOST_DEG`; the radius is infinite for a straight leg.
    """
    (n0, e0), (n1, e1) = _vector(start, home), _vector(end, home)
    chord = complex(n1 - n0, e1 - e0)  # north and east as one number: a turn to the right is a positive angle
    turn = math.radians(angle_deg)
    if abs(angle_deg) < STRAIGHT_DEG or abs(chord) <= 0.0:
        return [start, end], 0.0, math.inf
    radius_m = abs(chord) / (2.0 * abs(math.sin(0.5 * turn)))
    step = 2.0 * math.acos(max(1.0 - BULGE_M / radius_m, 0.0))
    pieces = int(min(max(LEAST_PIECES, math.ceil(abs(turn) / step)), MOST_PIECES))
    part = np.arange(1, pieces) / pieces
    # From the start the circle leaves at half the turn to the other side of the chord.
    along = np.exp(1j * turn * part)
    points = chord * (along - 1.0) / (np.exp(1j * turn) - 1.0)
    rise = end[2] - start[2]
    inner = [
        (*_place(n0 + z.real, e0 + z.imag, home), start[2] + p * rise)
        for z, p in zip(points.tolist(), part.tolist(), strict=True)
    ]
    return [start, *inner, end], radius_m * (1.0 - math.cos(0.5 * turn / pieces)), radius_m


def curve_bulge(item: MissionItem) -> float:
    """How far the arc or spline of an item lies beside its chord, as a part of the chord; 0 for other items.

    Of an arc of more than `LOADED_DEG` only as far as that.
    """
    if item.command != cmd.ARC_WAYPOINT:
        return SPLINE_BULGE if item.command == cmd.SPLINE_WAYPOINT else 0.0
    angle = abs(item.params[0]) if math.isfinite(item.params[0]) else 0.0
    return 0.5 * math.tan(math.radians(0.25 * min(angle, LOADED_DEG)))


def arc_speed_m_s(radius_m: float) -> float:
    """The highest speed on an arc, m/s."""
    return math.sqrt(CORNER_M_S2 * radius_m)


def _vector(place: Place, home: Place) -> tuple[float, float]:
    """ArduPilot's north and east of a place, m from home (Location.cpp, `get_vector_xy_from_origin_NE`)."""
    east = ((place[1] - home[1] + 180.0) % 360.0 - 180.0) * math.cos(math.radians(0.5 * (place[0] + home[0])))
    return DEGREE_M * (place[0] - home[0]), DEGREE_M * east


def _place(north_m: float, east_m: float, home: Place) -> tuple[float, float]:
    """The latitude and longitude of ArduPilot's north and east, m from home."""
    lat = home[0] + north_m / DEGREE_M
    return lat, home[1] + east_m / DEGREE_M / math.cos(math.radians(0.5 * (lat + home[0])))
