"""The motion model of a simulated vehicle: its accelerations, its climb and descent rates, and how it rounds a corner.

It models a multicopter that follows way points, and also a QuadPlane in lift mode and a PX4 multicopter. Measured
numbers were measured on an ArduCopter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gcsplan.vehicle import Autopilot, Vehicle

AT_ONCE_M_S2 = 1e4
"""Acceleration that stands for "unlimited", m/s²: 30 m/s in 3 ms."""

SHORT_LEG = 0.96
"""Measured speed on a short leg, as a fraction of the peak speed of its S-curve."""

AIRSPEED_SPARE = 1.2
"""Assumed highest airspeed of a vehicle, as a multiple of its fastest cruise: its reserve against wind."""

PX4_EVEN_ACCEL = 0.65
"""PX4's even acceleration and braking that take about as long as its own, per MPC_ACC_HOR."""

PX4_LAND_BELOW_M = 7.0
"""Height above home, m, below which a landing PX4 is slow: the middle of MPC_LAND_ALT1 and MPC_LAND_ALT2 in time."""


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Speeds in m/s, accelerations in m/s², lengths in metres.

    ``accel_m_s2``: along the path, speeding up and slowing down (ArduCopter's WPNAV_ACCEL 2.5 with its jerk of 1 m/s³
    is equivalent to this trapezoid at 10 m/s). ``slowing_m_s2``: deceleration of a moving vehicle to a *lower commanded
    speed* (measured: from 10 m/s, with 3 m/s commanded, 7.0 was reached after 60 m and 4.0 after 100 m).
    ``corner_accel_m_s2``: lateral, on the arc that rounds a corner and passes its way point at ``cut_m``. With an
    infinite acceleration speeds change instantly; with an infinite corner acceleration corners are not rounded. With an
    infinite climb or descent rate the commanded speed is the speed in space on any slope. ``land_m_s``: descent rate in
    the last ``land_below_m`` above the landing place (above home for a PX4). ``airspeed_m_s``: highest airspeed; a
    headwind is subtracted from it. ``leg_jerk_m_s3``, ``leg_accel_m_s2``: of ArduPilot's S-curves, see `leg_m_s`; an
    infinite jerk disables them.
    """

    climb_m_s: float
    descent_m_s: float
    airspeed_m_s: float
    vertical_accel_m_s2: float = 1.0
    accel_m_s2: float = 1.5
    slowing_m_s2: float = 0.42
    corner_accel_m_s2: float = 2.5
    cut_m: float = 2.0
    land_m_s: float = 0.5
    land_below_m: float = 10.0
    leg_jerk_m_s3: float = math.inf
    leg_accel_m_s2: float = 2.5
    accepts_m: float = 0.0
    takes_off_below_m: float = 0.0

    @classmethod
    def of(cls, vehicle: Vehicle, airspeed_m_s: float | None = None) -> Kinematics:
        """Return a vehicle's kinematics, with defaults for the rest; ``airspeed_m_s`` None: use `AIRSPEED_SPARE`."""
        return cls(
            vehicle.climb_m_s, vehicle.descent_m_s,
            AIRSPEED_SPARE * vehicle.speed_max_m_s if airspeed_m_s is None else airspeed_m_s,
            vertical_accel_m_s2=vehicle.vertical_accel_m_s2,
            accel_m_s2=(PX4_EVEN_ACCEL if vehicle.smooths else 1.0) * vehicle.accel_m_s2,
            corner_accel_m_s2=vehicle.corner_accel_m_s2, land_m_s=vehicle.land_m_s,
            leg_jerk_m_s3=vehicle.leg_jerk_m_s3 if vehicle.lays_curves else math.inf,
            takes_off_below_m=10.0 if vehicle.smooths else 0.0,
            accepts_m=vehicle.acceptance_m if vehicle.smooths else 0.0,
            land_below_m=PX4_LAND_BELOW_M if vehicle.autopilot is Autopilot.PX4 else 10.0,
        )  # fmt: skip

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if not value > 0.0 and not (
                value == 0.0 and name in ("cut_m", "land_below_m", "accepts_m", "takes_off_below_m")
            ):
                raise ValueError(f"{name} of a moving vehicle must be above 0, given {value:g}")
            if name.endswith("_m_s2") and name != "corner_accel_m_s2":
                object.__setattr__(self, name, min(value, AT_ONCE_M_S2))

    def corner_radius_m(self, turn_rad: float, shorter_leg_m: float) -> float:
        """Return the radius of the arc at a turn; 0 if the corner is not rounded.

        The arc touches both legs, passes the way point at `cut_m`, and uses at most half of the shorter leg. A PX4
        begins it ``accepts_m`` before the way point instead.
        """
        half = 0.5 * min(turn_rad, math.pi - 1e-3)
        if half <= 1e-7 or self.cut_m <= 0.0 or math.isinf(self.corner_accel_m_s2):
            return 0.0
        tangent = self.accepts_m or self.cut_m / math.tan(0.5 * half)
        return min(tangent, 0.5 * shorter_leg_m) / math.tan(half)

    def leg_m_s(self, length_m: float) -> float:
        """Return the highest speed along a leg of ``length_m`` between two way points, passed with or without a stop.

        ArduPilot plans every leg as an S-curve that stops at its end, and begins the next one while this one brakes.
        So a leg is flown no faster than the peak of its own curve (`AC_WPNav`, `SCurve`). Measured on ArduCopter: 12 m
        at 3.1 m/s, 23 at 4.8, 39 at 6.9, 50 at 8.1, 61 at 9.1, 70 at 10, which is `SHORT_LEG` of the peak.
        """
        jerk, accel = self.leg_jerk_m_s3, self.leg_accel_m_s2
        if math.isinf(jerk):
            return math.inf
        if length_m <= 2.0 * accel**3 / jerk**2:  # too short to reach the full acceleration
            return SHORT_LEG * jerk * math.pow(0.5 * length_m / jerk, 2.0 / 3.0)
        lag = accel**2 / jerk
        return SHORT_LEG * 0.5 * (math.sqrt(lag**2 + 4.0 * accel * length_m) - lag)

    def corner_m_s(self, radius_m: float) -> float:
        """Return the highest speed over ground on an arc."""
        return math.sqrt(self.corner_accel_m_s2 * radius_m)
