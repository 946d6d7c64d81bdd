"""The motion model of a simulated vehicle: its accelerations, its climb and descent rates, and how it rounds a corner.

It models a multicopter that follows way points, and also a QuadPlane in lift mode and a PX4 multicopter. Measured
numbers were measured on an ArduCopter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.vehicle import AIRSPEED_SPARE, GRAVITY_M_S2, Autopilot, Vehicle

AT_ONCE_M_S2 = 1e4
"""Acceleration that stands for "unlimited", m/s²: 30 m/s in 3 ms."""

CURVE_PEAK_ACCEL = 2.5 / 1.5
"""Peak acceleration of an S-curve per acceleration of the trapezoid that it is equivalent to."""

FASTEST_LEANING_M_S = 60.0
SLOPE_STEP, STEEPEST_STEPS, AMSL_STEP_M = 0.01, 50, 25.0
"""Slopes (rise per metre) and altitudes are rounded to these where only the airspeed depends on them."""

PX4_EVEN_ACCEL = 0.65
"""PX4's even acceleration and braking that take about as long as its own, per MPC_ACC_HOR."""

PX4_LAND_BELOW_M = 7.0
"""Height above home, m, below which a landing PX4 is slow: the middle of MPC_LAND_ALT1 and MPC_LAND_ALT2 in time."""

STANDS_M = 0.01
"""Metres: positions nearer than this are the same."""
CORNER_SAG_M = 0.02
"""Metres by which the chords of a rounded corner may lie off its arc."""
FAST_M_S = 60.0
"""m/s: a corner that allows more than this, and is cut by at most half of `CORNER_SAG_M`, is not rounded."""


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
    headwind is subtracted from it. ``leg_jerk_m_s3``, ``leg_accel_m_s2``: of ArduPilot's S-curves (`scurves`); an
    infinite jerk disables them. ``lean_deg``: the largest lean of ArduPilot's simulated quadrotor, which bounds its
    speed. ``accepts_m``: PX4's acceptance radius, where its turns begin; 0 for others.
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
    lean_deg: float = math.inf
    accepts_m: float = 0.0
    takes_off_below_m: float = 0.0

    @classmethod
    def of(cls, vehicle: Vehicle, airspeed_m_s: float | None = None) -> Kinematics:
        """Return a vehicle's kinematics, with defaults for the rest.

        ``airspeed_m_s`` None: what its lean angle allows; without one, `AIRSPEED_SPARE`.
        """
        if airspeed_m_s is None:
            spare = AIRSPEED_SPARE * vehicle.speed_max_m_s
            airspeed_m_s = spare if vehicle.largest_lean_deg is None else math.inf
        return cls(
            vehicle.climb_m_s, vehicle.descent_m_s,
            airspeed_m_s,
            vertical_accel_m_s2=vehicle.vertical_accel_m_s2,
            accel_m_s2=(PX4_EVEN_ACCEL if vehicle.smooths else 1.0) * vehicle.accel_m_s2,
            corner_accel_m_s2=vehicle.corner_accel_m_s2, land_m_s=vehicle.land_m_s,
            leg_jerk_m_s3=vehicle.leg_jerk_m_s3 if vehicle.lays_curves else math.inf,
            takes_off_below_m=10.0 if vehicle.smooths else 0.0,
            accepts_m=vehicle.acceptance_m if vehicle.smooths else 0.0,
            land_below_m=PX4_LAND_BELOW_M if vehicle.autopilot is Autopilot.PX4 else 10.0,
            leg_accel_m_s2=CURVE_PEAK_ACCEL * vehicle.accel_m_s2,
            lean_deg=vehicle.largest_lean_deg or math.inf,
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

    @property
    def lays_curves(self) -> bool:
        """Whether its legs are S-curves."""
        return math.isfinite(self.leg_jerk_m_s3) and math.isfinite(self.corner_accel_m_s2)

    def leaning_m_s(self, rise: float, amsl_m: float, commanded_m_s: float) -> float:
        """Return the speed along a slope at which the largest lean just balances the drag, at most ``commanded_m_s``.

        ``rise``: sine of the slope. The quadrotor is the one of SIM_Frame.h.
        """
        if math.isinf(self.lean_deg) or _pushes_on(self.lean_deg, commanded_m_s, rise, amsl_m):
            return commanded_m_s
        slow, fast = 0.0, commanded_m_s
        for _ in range(30):
            middle = 0.5 * (slow + fast)
            slow, fast = (middle, fast) if _pushes_on(self.lean_deg, middle, rise, amsl_m) else (slow, middle)
        return slow

    def airspeed_on(self, rise: float, amsl_m: float) -> float:
        """Return the highest airspeed on a slope, about."""
        steps, height_m = (
            max(-STEEPEST_STEPS, min(STEEPEST_STEPS, round(rise / SLOPE_STEP))),
            AMSL_STEP_M * round(amsl_m / AMSL_STEP_M),
        )
        return min(self.airspeed_m_s, _leaning_m_s(self, SLOPE_STEP * steps, height_m))

    def corner_m_s(self, radius_m: float) -> float:
        """Return the highest speed over ground on an arc."""
        return math.sqrt(self.corner_accel_m_s2 * radius_m)


@lru_cache(maxsize=4096)
def _leaning_m_s(kinematics: Kinematics, rise: float, amsl_m: float) -> float:
    return kinematics.leaning_m_s(rise, amsl_m, FASTEST_LEANING_M_S)


MASS_KG, DISC_M2, ROTOR_DRAG = 3.0, 0.385, 0.2
HELD_M_S, HELD_DEG, HELD_AMSL_M = 15.08, 45.0, 593.0
"""ArduPilot's simulated quadrotor (SIM_Frame.h): it holds this speed with this lean at this altitude."""


def _pushes_on(lean_deg: float, speed_m_s: float, rise: float, amsl_m: float) -> bool:
    """Whether at this speed along the slope the thrust at this lean still speeds the quadrotor up."""
    weight_n = MASS_KG * GRAVITY_M_S2

    def density(amsl: float) -> float:
        return 1.225 * math.pow(1.0 - 0.0065 * amsl / 288.15, 4.2559)

    def of_rotors(thrust_n: float, amsl: float) -> float:
        return ROTOR_DRAG * math.sqrt(thrust_n * density(amsl) * DISC_M2)

    held = math.radians(HELD_DEG)
    rotors_n = math.cos(held) ** 2 * HELD_M_S * of_rotors(weight_n / math.cos(held), HELD_AMSL_M)
    body_m2 = (weight_n * math.tan(held) - rotors_n) / (0.5 * density(HELD_AMSL_M) * HELD_M_S**2)
    lean, level = math.radians(lean_deg), math.sqrt(1.0 - rise**2)
    ahead = speed_m_s * (level * math.cos(lean) - rise * math.sin(lean))
    above = speed_m_s * (level * math.sin(lean) + rise * math.cos(lean))
    push, thrust_n = 0.5 * density(amsl_m) * body_m2, weight_n
    for _ in range(12):  # the thrust that keeps it on the slope; drag from above adds to it
        across = weight_n * math.cos(lean) + push * above * abs(above) + of_rotors(thrust_n, amsl_m) * above
        thrust_n = max(across, 0.01 * weight_n)
    return push * ahead * abs(ahead) + of_rotors(thrust_n, amsl_m) * ahead < weight_n * math.sin(lean)


def rounded(corner: Floats, kinematics: Kinematics) -> tuple[Floats, float]:
    """Return the nodes of a rounded corner, an odd number, and the speed that it allows.

    ``corner`` (3, 3): the way point between its neighbours. If there is no turn, the way point is the only node.
    """
    before, here, after = corner
    into, out = here - before, after - here
    run_in, run_out = math.hypot(into[0], into[1]), math.hypot(out[0], out[1])
    sharp = here[None, :]
    if min(run_in, run_out) <= STANDS_M:
        return sharp, math.inf
    cross, dot = into[0] * out[1] - into[1] * out[0], into[0] * out[0] + into[1] * out[1]
    turn = min(abs(math.atan2(cross, dot)), math.pi - 1e-3)
    radius = kinematics.corner_radius_m(turn, min(run_in, run_out))
    corner_m_s = kinematics.corner_m_s(radius)
    straight = radius * (1.0 / math.cos(0.5 * turn) - 1.0) <= 0.5 * CORNER_SAG_M and corner_m_s > FAST_M_S
    if straight or radius <= 0.0:
        return sharp, math.inf
    tangent = radius * math.tan(0.5 * turn)
    begin, end = here - into * (tangent / run_in), here + out * (tangent / run_out)
    side = math.copysign(1.0, cross)
    normal = side * np.array([-into[1], into[0]]) / run_in
    centre = begin[:2] + radius * normal
    parts = 2 * max(1, math.ceil(0.5 * turn / math.sqrt(8.0 * CORNER_SAG_M / radius)))
    u = np.arange(parts + 1) / parts
    angle = side * turn * u
    spoke = begin[:2] - centre
    turned = np.column_stack(
        [spoke[0] * np.cos(angle) - spoke[1] * np.sin(angle), spoke[0] * np.sin(angle) + spoke[1] * np.cos(angle)]
    )
    height = np.interp(u, [0.0, 0.5, 1.0], [begin[2], here[2], end[2]])  # a change of slope is not rounded
    return np.column_stack([centre + turned, height]), corner_m_s
