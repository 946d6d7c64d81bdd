"""How a simulated vehicle moves: its accelerations, its rates, and how it takes a corner.

A multicopter that follows way points; a QuadPlane in its lift mode and a PX4 multicopter likewise. Where a number was
measured, it was on an ArduCopter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gcsplan.vehicle import Vehicle

AT_ONCE_M_S2 = 1e4
"""What an acceleration without limit amounts to: 30 m/s in 3 ms."""

SHORT_LEG = 0.96
"""Of the peak of a short leg's S-curve that was measured."""

AIRSPEED_SPARE = 1.2
"""How much faster through the air than its fastest cruise a vehicle is taken to be: what it has against wind."""


@dataclass(frozen=True, slots=True)
class Kinematics:
    """Speeds in m/s, accelerations in m/s², lengths in metres.

    ``accel_m_s2``: along the path, up and down (the trapezoid that ArduCopter's WPNAV_ACCEL 2.5 with its jerk of
    1 m/s³ amounts to at 10 m/s). ``slowing_m_s2``: how fast a *lower commanded speed* takes hold of a vehicle that is
    moving (measured: from 10 m/s, 3 m/s were commanded and 7.0 reached after 60 m, 4.0 after 100 m).
    ``corner_accel_m_s2``: sideways, on the arc that rounds a corner and passes its way point at ``cut_m``.
    An acceleration without limit is instant; a corner without limit is not rounded. A climb or descent without limit
    means that the commanded speed holds in space, whatever the slope.
    ``land_m_s``: descent below ``land_below_m`` above the landing place. ``airspeed_m_s``: the most it can do through
    the air; a wind from ahead takes its part of that. ``leg_jerk_m_s3``, ``leg_accel_m_s2``: of ArduPilot's S-curves,
    see `leg_m_s`; an infinite jerk is none of their concern.
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

    @classmethod
    def of(cls, vehicle: Vehicle, airspeed_m_s: float | None = None) -> Kinematics:
        """What a vehicle's own keys say; the rest as above. ``airspeed_m_s`` None: with `AIRSPEED_SPARE`."""
        return cls(
            vehicle.climb_m_s, vehicle.descent_m_s,
            AIRSPEED_SPARE * vehicle.speed_max_m_s if airspeed_m_s is None else airspeed_m_s,
            vertical_accel_m_s2=vehicle.vertical_accel_m_s2, accel_m_s2=vehicle.accel_m_s2,
            corner_accel_m_s2=vehicle.corner_accel_m_s2, land_m_s=vehicle.land_m_s,
            leg_jerk_m_s3=vehicle.leg_jerk_m_s3 if vehicle.lays_curves else math.inf,
        )  # fmt: skip

    def __post_init__(self) -> None:
        for name in self.__slots__:
            value = getattr(self, name)
            if not value > 0.0 and not (value == 0.0 and name in ("cut_m", "land_below_m")):
                raise ValueError(f"{name} of a moving vehicle must be above 0, given {value:g}")
            if name.endswith("_m_s2") and name != "corner_accel_m_s2":
                object.__setattr__(self, name, min(value, AT_ONCE_M_S2))

    def corner_radius_m(self, turn_rad: float, shorter_leg_m: float) -> float:
        """Radius of the arc at a turn; 0 where the corner is not rounded.

        The arc touches both legs, passes the way point at `cut_m`, and uses no more than half of the shorter leg.
        """
        half = 0.5 * min(turn_rad, math.pi - 1e-3)
        if half <= 1e-7 or self.cut_m <= 0.0 or math.isinf(self.corner_accel_m_s2):
            return 0.0
        return min(self.cut_m / math.tan(0.5 * half), 0.5 * shorter_leg_m) / math.tan(half)

    def leg_m_s(self, length_m: float) -> float:
        """Fastest speed along a leg of ``length_m`` between two way points, however they are passed.

        ArduPilot lays every leg out as an S-curve that stops at its end, and lets the next one begin while this one
        brakes: a leg is flown no faster than its own curve's peak (`AC_WPNav`, `SCurve`). Measured on ArduCopter: 12 m
        at 3.1 m/s, 23 at 4.8, 39 at 6.9, 50 at 8.1, 61 at 9.1, 70 at 10; that is `SHORT_LEG` of the peak.
        """
        jerk, accel = self.leg_jerk_m_s3, self.leg_accel_m_s2
        if math.isinf(jerk):
            return math.inf
        if length_m <= 2.0 * accel**3 / jerk**2:  # the acceleration never gets so far
            return SHORT_LEG * jerk * math.pow(0.5 * length_m / jerk, 2.0 / 3.0)
        lag = accel**2 / jerk
        return SHORT_LEG * 0.5 * (math.sqrt(lag**2 + 4.0 * accel * length_m) - lag)

    def corner_m_s(self, radius_m: float) -> float:
        """Fastest speed over ground on an arc."""
        return math.sqrt(self.corner_accel_m_s2 * radius_m)
