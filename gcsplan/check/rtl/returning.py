"""RTL: which way an autopilot takes home, as straight pieces.

It climbs first and returns straight; within a cone around home it climbs less (`RTL_CONE_SLOPE`, `RTL_CONE_ANG`).
ArduPlane climbs on the way, and turns about first: judged as the whole band between both altitudes. Its circles grow
with altitude (AP_L1_Control.cpp, `loiter_radius`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gcsplan.check.stretch import Place
from gcsplan.vehicle import Autopilot

EQUATOR_M, ECCENTRICITY_2 = 6_378_137.0, 6.694379990141e-3  # WGS84
PLANE_LOITER_RADIUS_M = 60.0  # ArduPlane WP_LOITER_RAD, default
COPTER_CONE_SLOPE = 3.0  # ArduCopter RTL_CONE_SLOPE, default: rise over run
PX4_CONE_SLOPE = 1.0  # PX4 RTL_CONE_ANG 45, default


@dataclass(frozen=True, slots=True)
class Piece:
    """One straight piece; ``instead``: flown in place of another one by some versions. The rest is `Stretch`'s."""

    start: Place
    end: Place
    column: bool = False
    band_m: float = 0.0
    reach_m: float = 0.0
    hold_s: float = 0.0
    instead: bool = False


def return_home(autopilot: Autopilot, at: Place, home: Place, height_amsl_m: float, *, about_m: float) -> list[Piece]:
    """The way from ``at`` to ``home`` (a place on the ground) at ``height_amsl_m``; the last piece ends where it ends.

    ``about_m`` is what a plane takes to turn about.
    """
    lat, lon, ground = home
    height = height_amsl_m
    if autopilot is Autopilot.ARDUPLANE:
        middle, half = 0.5 * (height + at[2]), 0.5 * abs(height - at[2])
        over = (lat, lon, height)
        return [
            Piece(at, at, reach_m=about_m, instead=True),
            Piece((*at[:2], middle), (lat, lon, middle), band_m=half),
            Piece(over, over, reach_m=PLANE_LOITER_RADIUS_M * circle_growth(height), hold_s=math.inf),
        ]
    height = max(height, at[2])  # neither autopilot descends before it is home
    slope = PX4_CONE_SLOPE if autopilot is Autopilot.PX4 else COPTER_CONE_SLOPE
    least = ground + slope * flat_m(at, home)
    if autopilot is Autopilot.PX4 and least < height:
        least = at[2]  # versions differ in what they do near home
    least = max(at[2], least)
    pieces = []
    if least < height:
        middle, half = 0.5 * (least + height), 0.5 * (height - least)
        pieces.append(Piece((*at[:2], middle), (lat, lon, middle), band_m=half, instead=True))
    up = (*at[:2], height)
    return [
        *pieces,
        Piece(at, up, column=True),
        Piece(up, (lat, lon, height)),
        Piece((lat, lon, height), (lat, lon, ground), column=True),
    ]


def circle_growth(amsl_m: float) -> float:
    """By how much ArduPlane widens a circle at an altitude: (true over equivalent airspeed)², ISA, on a hot day."""
    return float(1.1 / (1.0 - 2.25577e-5 * max(amsl_m, 0.0)) ** 4.2559)


def flat_m(a: Place, b: Place) -> float:
    """Horizontal metres between places on the ellipsoid, by its radii half way: good to a millionth over 100 km."""
    lat = math.radians(0.5 * (a[0] + b[0]))
    w = 1.0 - ECCENTRICITY_2 * math.sin(lat) ** 2
    north = EQUATOR_M * (1.0 - ECCENTRICITY_2) / w**1.5 * math.radians(b[0] - a[0])
    east = EQUATOR_M / math.sqrt(w) * math.cos(lat) * math.radians((b[1] - a[1] + 180.0) % 360.0 - 180.0)
    return math.hypot(north, east)
