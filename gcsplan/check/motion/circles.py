"""Circles and arcs that ArduPlane flies: their radius, how it grows with altitude, and how far off the arc it flies.

ArduPlane has no arcs: where a turn begins it steers for the next leg, and approaches it at 45° at most
(AP_L1_Control.cpp, `update_waypoint`). A turn that begins at the tangent length stays near the arc, as long as the turn
is not much more than a right angle and the tangent not much longer than the L1 distance; else it cuts the corner or
swings wide. `l1_off_m` simulates that law. The aircraft also banks late: `late_m` is the offset of ArduPlane 4.6.0's
own simulated plane (NAVL1_PERIOD 17) at corners of 3° to 120°, on arcs of 100 m at 15 and 21 m/s and of 180 m at 28
m/s: 4 m at 6°, 6 m at 15°, 10 to 16 m from 30° on.
"""

from __future__ import annotations

import math
from functools import lru_cache

from gcsplan.check.motion.stretch import Stretch
from gcsplan.check.motion.turn_parameters import DEFAULTS, Tuning
from gcsplan.notes.note import Note
from gcsplan.vehicle import GRAVITY_M_S2
from gcsplan.world.geodesy.atmosphere import density_ratio, true_per_indicated

PLANE_LOITER_RADIUS_M = 60.0  # ArduPlane WP_LOITER_RAD, default


HOT_DAY = 1.1
"""How much thinner than the standard atmosphere the air may be."""

NOTED_GROWTH_M = 1.0
"""A circle that grows by less, m, gets no note."""


def circle_growth(amsl_m: float) -> float:
    """The factor by which ArduPlane widens a circle: (true over equivalent airspeed)² at an altitude, ISA, hot day.

    Source: AP_L1_Control.cpp, `loiter_radius`.
    """
    return float(HOT_DAY / density_ratio(max(amsl_m, 0.0)))


def circle_widened(seq: int, radius_m: float, amsl_m: float) -> Note | None:
    """A note on the radius that ArduPlane flies at an altitude; None where it is nearly the given one."""
    flown_m, most_m = radius_m / float(density_ratio(amsl_m)), radius_m * circle_growth(amsl_m)
    if flown_m - radius_m < NOTED_GROWTH_M:
        return None
    return Note("circle_widened", seq, radius_m=radius_m, amsl_m=amsl_m, flown_m=flown_m, judged_m=most_m)


def bank_of_deg(radius_m: float, speed_m_s: float) -> float:
    """The bank of a turn at a speed, degrees."""
    return math.degrees(math.atan(speed_m_s**2 / (GRAVITY_M_S2 * radius_m)))


def circle_too_banked(seq: int, radius_m: float, speed_m_s: float) -> Note | None:
    """Why a circle is flown wider than it is given, at an indicated airspeed; None if it is not.

    Thin air widens a circle by as much as it makes its bank larger, so the bank is the same at every altitude.
    """
    bank_deg = bank_of_deg(radius_m, speed_m_s)
    if bank_deg <= MOST_BANK_DEG:
        return None
    return Note(
        "circle_too_banked", seq, radius_m=radius_m, speed_m_s=speed_m_s, bank_deg=bank_deg, most_deg=MOST_BANK_DEG
    )


LATE_S, LATE_PER_SINE = 0.72, 3.0
"""Seconds of flight by which a turn lies outside its arc, and how fast that grows with the sine of a small turn."""

MOST_BANK_DEG, BANK_S = 45.0, 0.5
"""Default of ROLL_LIMIT_DEG, and the time constant of a simulated aircraft's bank, s."""

STEP_S, CALM_S = 0.1, 30.0
"""Time step (ArduPlane steers ten times a second), and how long the flight is simulated after the turn, s."""

SLOWEST_M_S = 1.0
"""Slower turns are simulated at this speed, which no plane flies: the steps of a turn grow as its speed falls."""

CAPTURE_SINE = math.sqrt(0.5)


def true_m_s(s: Stretch) -> float:
    """The true airspeed at the higher end of a stretch, m/s."""
    return s.speed_m_s * float(true_per_indicated(max(s.start[2], s.end[2])))


def late_m(turn_rad: float, speed_m_s: float, tuning: Tuning = DEFAULTS) -> float:
    """How far outside its arc a turn was measured to lie, m, scaled to a speed; and to a NAVL1_PERIOD that is longer
    than the one it was measured with."""
    turn = min(abs(turn_rad), 0.5 * math.pi)
    return LATE_S * tuning.l1_slower * speed_m_s * min(1.0, LATE_PER_SINE * math.sin(turn))


def tracking_m(
    radius_m: float, turn_rad: float, speed_m_s: float, tuning: Tuning = DEFAULTS, wind_m_s: float = 0.0
) -> float:
    """How far from its arc a turn that begins at the tangent length is flown, m; 0 at speed 0.

    ``wind_m_s``: in the worst of all winds up to this; 0: calm air.
    """
    if not speed_m_s > 0.0:
        return 0.0
    turn = min(math.radians(math.ceil(math.degrees(abs(turn_rad)) - 1e-6)), math.radians(170.0))
    speed = max(round(speed_m_s, 1), SLOWEST_M_S)
    late = late_m(turn_rad, speed_m_s + wind_m_s, tuning)
    blows = [(0.0, 0.0), *winds_around(math.ceil(10.0 * wind_m_s) / 10.0, speed)]
    return max(late, *(l1_off_m(radius_m, turn, speed, tuning, wind) for wind in blows))


WINDS_AROUND, LEAST_HEADWAY = 8, 0.1
"""Directions of the winds in which a turn is simulated; and the part of the airspeed that a wind must leave."""


def winds_around(wind_m_s: float, speed_m_s: float) -> list[tuple[float, float]]:
    """Winds of a speed from all around, along and across a leg; none in calm air.

    A wind that leaves less than `LEAST_HEADWAY` of the airspeed counts as one that leaves so much: no mission passes
    in it.
    """
    blows_m_s = min(wind_m_s, (1.0 - LEAST_HEADWAY) * speed_m_s)
    turns = [2.0 * math.pi * k / WINDS_AROUND for k in range(WINDS_AROUND)] if blows_m_s > 0.0 else []
    return [(blows_m_s * math.cos(turn), blows_m_s * math.sin(turn)) for turn in turns]


@lru_cache(maxsize=4096)
def l1_off_m(
    radius_m: float, turn_rad: float, speed_m_s: float, tuning: Tuning = DEFAULTS,
    wind_m_s: tuple[float, float] = (0.0, 0.0),
) -> float:  # fmt: skip
    """The largest distance from the arc under the L1 law, m, for a turn to the left between long legs.

    ``wind_m_s``: along the first leg, and to its left. The law steers the velocity over ground, by banking.
    """
    tangent = radius_m * math.tan(0.5 * turn_rad)
    cos, sin = math.cos(turn_rad), math.sin(turn_rad)
    x, y, bank, worst = -tangent, 0.0, 0.0, 0.0  # the corner is the origin, the first leg the x axis
    heading = -math.asin(wind_m_s[1] / speed_m_s)
    slowest = speed_m_s - math.hypot(*wind_m_s)
    steps = math.ceil((2.0 * tangent / slowest + CALM_S * tuning.l1_slower) / STEP_S)
    most = math.radians(min(tuning.roll_deg, MOST_BANK_DEG))
    for _ in range(steps):
        over_x, over_y = speed_m_s * math.cos(heading) + wind_m_s[0], speed_m_s * math.sin(heading) + wind_m_s[1]
        over_ground = math.hypot(over_x, over_y)
        ahead = tuning.l1_ahead_m(over_ground)
        gain = 4.0 * tuning.l1_damping**2 * over_ground**2 / ahead
        aside = cos * y - sin * x  # left of the new leg
        closing = math.asin(min(max(-aside / ahead, -CAPTURE_SINE), CAPTURE_SINE))
        turn_to_fly = closing + (turn_rad - math.atan2(over_y, over_x) + math.pi) % (2.0 * math.pi) - math.pi
        push = gain * math.sin(min(max(turn_to_fly, -0.5 * math.pi), 0.5 * math.pi))
        bank += (min(max(math.atan(push / GRAVITY_M_S2), -most), most) - bank) * STEP_S / BANK_S
        heading += GRAVITY_M_S2 * math.tan(bank) / speed_m_s * STEP_S
        x += (speed_m_s * math.cos(heading) + wind_m_s[0]) * STEP_S
        y += (speed_m_s * math.sin(heading) + wind_m_s[1]) * STEP_S
        off = min(
            math.hypot(max(x + tangent, 0.0), y),
            math.hypot(max(tangent - cos * x - sin * y, 0.0), cos * y - sin * x),
        )
        if math.atan2(x + tangent, radius_m - y) % (2.0 * math.pi) <= turn_rad:
            off = min(off, abs(math.hypot(x + tangent, y - radius_m) - radius_m))
        worst = max(worst, off)
    return worst


LAPS = 3
WIDEST_CIRCLE_M = 1000.0
"""A wider circle is simulated as this one, outside of which an aircraft gets farther."""


def circle_reach_m(radius_m: float, amsl_m: float, speed_m_s: float, wind_m_s: float) -> float:
    """How far from its middle a circle of ``radius_m`` reaches at an altitude, m, in all winds up to ``wind_m_s``.

    ``speed_m_s`` is the indicated airspeed.
    """
    flown_m, true = radius_m * circle_growth(amsl_m), speed_m_s * math.sqrt(circle_growth(amsl_m))
    # A smaller circle is left farther; so is a faster one, unless the wind leaves little headway.
    least_m, wind = min(max(math.floor(flown_m), 1.0), WIDEST_CIRCLE_M), math.ceil(10.0 * wind_m_s) / 10.0
    return flown_m + max(circle_off_m(least_m, speed, wind) for speed in (math.floor(true), math.ceil(true)))


@lru_cache(maxsize=1024)
def circle_off_m(radius_m: float, speed_m_s: float, wind_m_s: float, tuning: Tuning = DEFAULTS) -> float:
    """How far outside its circle ArduPlane gets in a wind under the L1 law, m, once it is on it; 0 in calm air.

    Source: AP_L1_Control.cpp, `update_loiter`, anticlockwise from a place east of the middle.
    """
    winds = winds_around(wind_m_s, speed_m_s)
    if not winds:
        return 0.0
    worst, omega = 0.0, 2.0 * math.pi / tuning.l1_period_s
    most = math.radians(min(tuning.roll_deg, MOST_BANK_DEG))
    east, north = winds[0]  # the circle is the same in every direction
    x, y, heading = radius_m, 0.0, 0.5 * math.pi + math.asin(min(east / speed_m_s, 1.0))
    bank = min(math.atan((speed_m_s * math.sin(heading) + north) ** 2 / (radius_m * GRAVITY_M_S2)), most)
    slowest = speed_m_s - math.hypot(east, north)
    for _ in range(math.ceil(LAPS * 2.0 * math.pi * radius_m / slowest / STEP_S)):
        over_x, over_y = speed_m_s * math.cos(heading) + east, speed_m_s * math.sin(heading) + north
        over_ground, away = math.hypot(over_x, over_y), math.hypot(x, y)
        out, around = (x * over_x + y * over_y) / away, (x * over_y - y * over_x) / away
        captures = min(max(math.atan2(around, -out), -0.5 * math.pi), 0.5 * math.pi)
        gain = 4.0 * tuning.l1_damping**2 * over_ground**2 / tuning.l1_ahead_m(over_ground)
        capture = gain * math.sin(captures)
        off = away - radius_m
        steers = off * omega**2 + out * 2.0 * tuning.l1_damping * omega
        if out > 0.0 and around < 0.0:
            steers = max(steers, 0.0)
        circle = steers + around**2 / max(0.5 * radius_m, radius_m + off)
        push = capture if off > 0.0 and capture < circle else circle
        bank += (min(max(math.atan(push / GRAVITY_M_S2), -most), most) - bank) * STEP_S / BANK_S
        turned = GRAVITY_M_S2 * math.tan(bank) / speed_m_s * STEP_S
        x += (speed_m_s * math.cos(heading + 0.5 * turned) + east) * STEP_S
        y += (speed_m_s * math.sin(heading + 0.5 * turned) + north) * STEP_S
        heading += turned
        worst = max(worst, math.hypot(x, y) - radius_m)
    return worst
