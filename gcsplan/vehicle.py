"""One aircraft: what it is, what it can do, and what a metre costs it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal, TypeVar

from gcsplan.arrays import Floats
from gcsplan.notes.note import Note
from gcsplan.world.geodesy.atmosphere import true_per_indicated
from gcsplan.world.geometry.limits import Limits

GRAVITY_M_S2 = 9.80665
"""Standard gravity."""

DEFAULT_LEAN_DEG, LARGEST_LEAN_DEG = 30.0, 80.0
"""ArduCopter's largest lean angle: its default, and the most that it accepts."""

PX4_TILT_DEG = 45.0
"""PX4's MPC_TILTMAX_AIR, default: the most that it tilts in flight."""

AIRSPEED_SPARE = 1.2
"""Assumed highest airspeed of a vehicle whose lean is not known, per its fastest cruise: its reserve against wind."""

COPTER_RETURN_WAITS_S = 5.0  # ArduCopter RTL_LOIT_TIME, default
LEAN_DEG_PER_M_S = 3.0
"""Lean that an ArduCopter needs for 1 m/s of cruise speed, against its drag: its speed was measured to end near 10 m/s
with 30° and near 15 m/s with 45°, whatever was commanded. An airframe with less drag is faster."""

LIFTS_M_S = 2.5, 1.5
"""Rates at which an ArduPlane VTOL's lift motors carry it up and down: the defaults of Q_WP_SPEED_UP, Q_WP_SPEED_DN."""

BRAKES_M_S2 = 2.0
"""How hard it brakes for its landing: the default of Q_TRANS_DECEL."""

PX4_VEL_MAX_M_S = 12.0
"""PX4's MPC_XY_VEL_MAX, default: it flies no faster, whatever is commanded, and says nothing."""

FITS_WITHIN = 0.2
"""A fitted energy model is taken to hold up to this part slower or faster than it was flown."""

OWN_METRES = 1.0035
"""Most metres over ground per metre of ArduPilot near home: it takes a degree as equally long everywhere."""

PX4_RETURN_M_S = 5.0
"""PX4's MPC_XY_CRUISE, default: the speed of its return, whatever speed the mission has commanded."""

COPTER_RETURN_M_S = 10.0
"""The speed of ArduCopter's return, whatever the mission has commanded: RTL_SPEED, or, if that is 0 (the default),
WPNAV_SPEED, whose default this is (mode_rtl.cpp, `climb_start`)."""

COPTER_PEAK_ACCEL = 2.5 / 1.5
"""ArduCopter's WPNAV_ACCEL (default 2.5) per ``accel_m_s2`` (1.5), which is that of the trapezoid that takes about as
long."""

COPTER_CORNER_ACCEL = 2.0
"""ArduCopter's WPNAV_ACCEL_C (default: twice WPNAV_ACCEL) per ``corner_accel_m_s2`` (2.5)."""


def lean_for_deg(speed_m_s: float) -> float:
    """The lean angle that an ArduCopter needs for a cruise speed, about."""
    return LEAN_DEG_PER_M_S * speed_m_s


def fastest_at_m_s(lean_deg: float) -> float:
    """The fastest cruise speed that an ArduCopter's lean angle allows, about."""
    return lean_deg / LEAN_DEG_PER_M_S


def lean_words(lean_deg: float, autopilot: Autopilot) -> Note:
    """The parameter of the lean angle with its value, for every version of ArduCopter or PX4."""
    if autopilot is Autopilot.PX4:
        return Note("tilt_parameter", lean_deg=lean_deg)
    return Note("lean_parameter", lean_deg=lean_deg, lean_cdeg=100.0 * lean_deg)


Amount = TypeVar("Amount", float, Floats)

MissionEnd = Literal["land", "loiter", "rtl", "none"]
"""The end of a mission."""


class Autopilot(StrEnum):
    """The autopilot that a mission is written for."""

    ARDUCOPTER = "arducopter"
    ARDUPLANE = "arduplane"
    PX4 = "px4"

    @property
    def is_ardupilot(self) -> bool:
        """True for the firmware family that keeps home as item 0."""
        return self is not Autopilot.PX4


@dataclass(frozen=True, slots=True)
class Energy:
    """The energy of a flight: E = ``base_w`` · seconds + R2 · horizontal metres through the air + R1 · vertical metres.

    R1 (``vertical_j_per_m``, up or down), R2 and a base power of 0 are the model of the krill paper, Table 1. In a hold
    the power is ``hover_w``, the whole of it, or what `hold_w` says if that is more. `under_way_j` and `hold_w` are the
    model; everything that counts energy calls them.

    With ``battery_j`` None, the capacity is not judged. ``reserve`` is the part of the battery that must be left at the
    end. ``battery_v`` is its nominal voltage, which only tells energies in mAh. ``fitted_m_s``: slowest and fastest
    airspeed of the flights that the numbers are fitted to, None if that is not known. ``stated``: the numbers were
    given; else they are the paper's, which say nothing about this aircraft, and no output tells an energy. ``papers``:
    a battery or a hover was given and nothing of what flying takes, so the paper's numbers count, marked in every
    output. ``battery_key`` is the key of the mission file that gave ``battery_j``, in units of ``battery_unit_j``.
    ``endurance_s`` is the given endurance of that battery, where ``base_w`` comes from it.
    """

    vertical_j_per_m: float = 120.0
    horizontal_j_per_m: float = 100.0
    hover_w: float = 0.0
    battery_j: float | None = None
    reserve: float = 0.2
    battery_v: float | None = None
    base_w: float = 0.0
    fitted_m_s: tuple[float, float] | None = None
    stated: bool = True
    papers: bool = False
    battery_key: str = field(default="battery_j", compare=False, repr=False)
    battery_unit_j: float = field(default=1.0, compare=False, repr=False)
    endurance_s: float | None = field(default=None, compare=False, repr=False)

    def under_way_j(self, vertical_m: Amount, air_m: Amount, seconds: Amount) -> Amount:
        """Joules of moving for ``seconds``: ``vertical_m`` up and down, ``air_m`` horizontally through the air.

        ``seconds`` do not count without a base power, and may then be NaN.
        """
        metres_j = self.vertical_j_per_m * vertical_m + self.horizontal_j_per_m * air_m
        return metres_j + self.base_w * seconds if self.base_w else metres_j

    def hold_w(self, airspeed_m_s: float = 0.0) -> float:
        """Power of a hold, W: ``hover_w``, or that of flying at the airspeed of a circle or of the wind, if more."""
        return max(self.hover_w, self.base_w + self.horizontal_j_per_m * airspeed_m_s)

    def unlike_fitted(self, airspeed_m_s: float) -> bool:
        """Whether an airspeed is so far from the fitted ones that the numbers may not hold."""
        if self.fitted_m_s is None:
            return False
        slow, fast = self.fitted_m_s
        return not (1.0 - FITS_WITHIN) * slow <= airspeed_m_s <= (1.0 + FITS_WITHIN) * fast


OVER_TAKEOFF_M = 16.0
"""Metres above the altitude of its take-off to which a fixed wing whose climb is not known is judged to rise."""


@dataclass(frozen=True, slots=True)
class ClimbOut:
    """A fixed wing's take-off as it was flown, means from leaving the ground to its altitude: climb rate and speed over
    ground in still air, both in m/s."""

    climb_m_s: float
    speed_m_s: float

    @property
    def space_m_s(self) -> float:
        """Speed along its path."""
        return math.hypot(self.climb_m_s, self.speed_m_s)


@dataclass(frozen=True, slots=True)
class Vehicle:
    """An airframe with its limits. Speeds are in m/s: over ground (cruise; of a fixed wing, the airspeed that it
    indicates) and vertical (climb, descent).

    ``accel_m_s2`` is the acceleration and braking along the path, ``corner_accel_m_s2`` bounds the speed in a rounded
    corner, ``vertical_accel_m_s2`` applies in the columns of take-off and landing, ``land_m_s`` is the descent rate
    just above the ground. ``leg_jerk_m_s3`` is the jerk of the S-curves that ArduPilot flies its legs with; it bounds
    the speed on a short leg. An acceleration of ``inf`` is an instant change of speed, a corner acceleration of ``inf``
    a sharp corner at full speed. A climb or descent rate of ``inf`` means that the cruise speed is the speed in space,
    whatever the slope: the ideal vehicle of the papers. ``lean_angle_deg`` is a multicopter's largest lean angle, and
    ``vel_max_m_s`` a PX4's MPC_XY_VEL_MAX: they have bounded ``speed_max_m_s`` already; None: they bound nothing.
    ``climb_out``: a fixed wing's, if it is known. ``blows_m_s``: the most that the declared winds and gusts blow along
    each of so many courses, evenly all around from east to north; of a fixed wing, whose `limits` then hold over ground
    in every one of these winds; empty: still air. ``climbs_deg``: its steepest climb through the air;
    None: `limits` has it. ``return_m_s``, ``return_wait_s``: the speed of the autopilot's own
    return and its wait over home, if they are not the defaults. ``vtol``: an ArduPlane that takes off and lands
    vertically, and flies on its wing in between, with its turn radius.
    """

    name: str
    sysid: int
    autopilot: Autopilot
    limits: Limits
    speed_min_m_s: float = 3.0
    speed_max_m_s: float = 15.0
    climb_m_s: float = 2.5
    descent_m_s: float = 1.5
    turn_radius_m: float = 0.0
    energy: Energy = field(default_factory=lambda: Energy(stated=False))
    link: str | None = None
    accel_m_s2: float = 1.5
    corner_accel_m_s2: float = 2.5
    land_m_s: float = 0.5
    vertical_accel_m_s2: float = 1.0
    leg_jerk_m_s3: float = math.inf
    lean_angle_deg: float | None = None
    vel_max_m_s: float | None = None
    climb_out: ClimbOut | None = None
    return_m_s: float | None = None
    return_wait_s: float | None = None
    blows_m_s: tuple[float, ...] = ()
    climbs_deg: float | None = None
    vtol: bool = False

    @property
    def wind_m_s(self) -> float:
        """The strongest of the winds and gusts in ``blows_m_s``; 0 in still air."""
        courses = len(self.blows_m_s)
        return max(self.blows_m_s) / math.cos(math.pi / courses) if courses else 0.0

    def tail_m_s(self, course_rad: float) -> float:
        """The most that a wind pushes a fixed wing along a course, radians from east to north; 0 if none does."""
        return max(0.0, self.blows_along_m_s(course_rad))

    def blows_along_m_s(self, course_rad: float) -> float:
        """As `tail_m_s`, below 0 if every wind blows against the course."""
        courses = len(self.blows_m_s)
        if not courses:
            return 0.0
        step = 2.0 * math.pi / courses
        k, past = divmod(course_rad % (2.0 * math.pi), step)
        before, after = (self.blows_m_s[(int(k) + i) % courses] for i in (0, 1))
        # A course between two others is a sum of both, and a wind blows along it by at most the same sum.
        return (math.sin(step - past) * before + math.sin(past) * after) / math.sin(step)

    def aside_m_s(self, course_rad: float) -> float:
        """The most that a wind blows a fixed wing to either side of a course."""
        return max(self.tail_m_s(course_rad + side) for side in (0.5 * math.pi, -0.5 * math.pi))

    @property
    def tail_ratio(self) -> float:
        """A slope over ground with the strongest wind behind, per the slope through the air, at the slowest speed."""
        return self.speed_min_m_s / (self.speed_min_m_s + self.wind_m_s)

    @property
    def steepest_in_air_deg(self) -> float:
        """The steepest climb through the air."""
        return self.limits.max_climb_deg if self.climbs_deg is None else self.climbs_deg

    def fastest_over_ground_m_s(self, speed_m_s: float, amsl_m: float) -> float:
        """No faster than this over ground in still air, with a commanded speed, near home and up to an altitude."""
        if self.keeps_airspeed:
            return speed_m_s * float(true_per_indicated(amsl_m))
        return speed_m_s * OWN_METRES if self.lays_curves else speed_m_s

    @property
    def lays_curves(self) -> bool:
        """Whether it flies legs as ArduPilot does: each leg is its own S-curve, measured in ArduPilot's own metres."""
        return self.autopilot.is_ardupilot and math.isfinite(self.leg_jerk_m_s3) and math.isfinite(self.accel_m_s2)

    @property
    def smooths(self) -> bool:
        """Whether it flies legs as PX4 does: braking by distance, at a speed in corners that its radius decides."""
        bounds = self.accel_m_s2, self.corner_accel_m_s2, self.leg_jerk_m_s3
        return self.autopilot is Autopilot.PX4 and all(map(math.isfinite, bounds))

    @property
    def acceptance_m(self) -> float:
        """The acceptance radius that is sent with each way point (1 … 255): the track error; not for ArduCopter."""
        return min(max(1.0, math.floor(self.limits.track_error_m)), 255.0)

    @property
    def return_speed_m_s(self) -> float | None:
        """The speed of the autopilot's own return, whatever the mission has commanded; None: the mission's own speed.

        A plane returns at the airspeed of AIRSPEED_CRUISE (navigation.cpp, `calc_airspeed_errors`).
        """
        if self.autopilot is Autopilot.ARDUPLANE:
            return self.speed_max_m_s if self.keeps_airspeed or math.isfinite(self.accel_m_s2) else None
        if math.isinf(self.accel_m_s2):
            return None
        if self.return_m_s is not None:
            return self.return_m_s
        return PX4_RETURN_M_S if self.autopilot is Autopilot.PX4 else COPTER_RETURN_M_S

    @property
    def return_waits_s(self) -> float:
        """How long it hovers over home at the end of the autopilot's own return, before it descends."""
        if self.return_wait_s is not None:
            return self.return_wait_s
        copter = self.autopilot is Autopilot.ARDUCOPTER and math.isfinite(self.accel_m_s2)
        return COPTER_RETURN_WAITS_S if copter else 0.0

    @property
    def keeps_airspeed(self) -> bool:
        """Whether its speed is the airspeed that it indicates, along its path: a fixed wing's, a VTOL's too."""
        return self.autopilot is Autopilot.ARDUPLANE and self.turn_radius_m > 0.0

    @property
    def largest_lean_deg(self) -> float | None:
        """How far a multicopter leans at most; None if that is not known.

        A PX4 is taken for an airframe with the drag of ArduPilot's simulated quadrotor, as an ArduCopter is.
        """
        return PX4_TILT_DEG if self.smooths and self.lean_angle_deg is None else self.lean_angle_deg

    @property
    def can_hold(self) -> bool:
        """Whether its mission can make it wait in the air for a set time.

        A multicopter can. ArduPlane, also as a VTOL, continues at once while it is armed
        (``ModeAuto::verify_nav_delay``) and ignores the hold of a way point. A vehicle with a turn radius circles
        instead.
        """
        return self.autopilot is not Autopilot.ARDUPLANE and self.turn_radius_m <= 0.0
