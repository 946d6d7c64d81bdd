"""One aircraft: what it is, what it can do, and what a metre costs it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum

from gcsplan.world.limits import Limits


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
    """Energy model of the krill paper, Table 1: R1 joules per vertical metre, up or down, R2 per horizontal metre.

    ``hover_w`` is the power for hovering. With ``battery_j`` None, the capacity is not judged. ``reserve`` is the part
    of the battery that must be left at the end.
    """

    vertical_j_per_m: float = 120.0
    horizontal_j_per_m: float = 100.0
    hover_w: float = 0.0
    battery_j: float | None = None
    reserve: float = 0.2


@dataclass(frozen=True, slots=True)
class Vehicle:
    """An airframe with its limits. Speeds are in m/s: over ground (cruise) and vertical (climb, descent).

    ``accel_m_s2`` is the acceleration and braking along the path, ``corner_accel_m_s2`` bounds the speed in a rounded
    corner, ``vertical_accel_m_s2`` applies in the columns of take-off and landing, ``land_m_s`` is the descent rate
    just above the ground. ``leg_jerk_m_s3`` is the jerk of the S-curves that ArduPilot flies its legs with; it bounds
    the speed on a short leg. An acceleration of ``inf`` is an instant change of speed, a corner acceleration of ``inf``
    a sharp corner at full speed. A climb or descent rate of ``inf`` means that the cruise speed is the speed in space,
    whatever the slope: the ideal vehicle of the papers.
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
    energy: Energy = field(default_factory=Energy)
    link: str | None = None
    accel_m_s2: float = 1.5
    corner_accel_m_s2: float = 2.5
    land_m_s: float = 0.5
    vertical_accel_m_s2: float = 1.0
    leg_jerk_m_s3: float = math.inf

    @property
    def lays_curves(self) -> bool:
        """Whether it flies legs as ArduPilot does: each leg is its own S-curve, measured in ArduPilot's own metres."""
        return self.autopilot.is_ardupilot and math.isfinite(self.leg_jerk_m_s3) and math.isfinite(self.accel_m_s2)

    @property
    def can_hold(self) -> bool:
        """Whether its mission can make it wait in the air for a set time.

        A multicopter can. ArduPlane, also as a VTOL, continues at once while it is armed
        (``ModeAuto::verify_nav_delay``) and ignores the hold of a way point. A vehicle with a turn radius circles
        instead.
        """
        return self.autopilot is not Autopilot.ARDUPLANE and self.turn_radius_m <= 0.0
