"""How far a vehicle goes on before it flies home: a multicopter brakes, a plane turns about.

Speeds are over ground in calm air; a tail wind adds to all of these lengths.

- ArduCopter (AC_PosControl.cpp, `get_stopping_point_NE_m`; mode_rtl.cpp, `build_path`): a return begins at the
  stopping point, straight ahead by v²/2a + a/2p², with a = WPNAV_ACCEL (2.5 m/s²) and p = PSC_POSXY_P (1 per second).
  Faster than WPNAV_SPEED (10 m/s) it brakes harder and stops earlier: anything up to that length is judged. In height
  it stops at most 3 m higher and 2 m lower, and climbs while it brakes.
- PX4 (FlightTaskAuto) brakes with MPC_ACC_HOR (3 m/s²) and MPC_JERK_AUTO (4 m/s³); flown: 18.5 to 19.4 m from 10 m/s.
- A mission slows down for its corners and stops with the same acceleration. So a return that begins before a corner
  runs past it by no more than one that begins in the corner, at the corner's speed (SCurve.cpp: the arc stays within
  WPNAV_RADIUS of the corner, and pulls twice WPNAV_ACCEL).
- ArduPlane (AP_L1_Control.cpp, `update_loiter`) banks by up to 45° and steers straight for home; it does not come back
  to the line from where it began. `about_turn_m` is a formula above how far it gets in simulation and as flown. It
  circles over home no tighter than its bank allows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gcsplan.check.motion.circles import circle_growth
from gcsplan.check.motion.turn_parameters import DEFAULTS
from gcsplan.vehicle import COPTER_CORNER_ACCEL, COPTER_PEAK_ACCEL, GRAVITY_M_S2, Autopilot, Vehicle

CORNER_M_S2, CORNER_M = 5.0, 2.0
"""ArduCopter: acceleration in a corner, twice WPNAV_ACCEL; how far the arc stays from the corner, WPNAV_RADIUS."""

STOP_UP_M, STOP_DOWN_M = 3.0, 2.0
"""How far above or below the place of its beginning a return may level off (`get_stopping_point_U_m`)."""

ABOUT_SPARE, ABOUT_SPARE_NEAR = 1.2, 1.5
"""Factors on the turn of `about_turn_m`: for the bank that comes late; near home, where the circle begins at once."""

CIRCLE_SPARE, CIRCLE_LATE_S = 1.6, 0.4
"""A circle over home: its radius over the tightest one, and seconds of flight that it swings wide."""


@dataclass(frozen=True, slots=True)
class Brakes:
    """``accel_m_s2``; the length that is added at any speed, m, and the seconds at the speed that are added."""

    accel_m_s2: float
    lag_m: float
    lag_s: float

    def length_m(self, speed_m_s: float) -> float:
        """The greatest length in which it stops."""
        return 0.5 * speed_m_s**2 / self.accel_m_s2 + self.lag_m + self.lag_s * speed_m_s


BRAKES = {
    Autopilot.ARDUCOPTER: Brakes(2.5, 1.25, 0.0),
    Autopilot.PX4: Brakes(3.0, 0.0, 0.375),
}


def braking_distance_m(vehicle: Vehicle, speed_m_s: float) -> float:
    """The braking distance: how far a multicopter flies on straight ahead before it turns home, m; 0 for a plane."""
    brakes = brakes_of(vehicle)
    return 0.0 if brakes is None else brakes.length_m(speed_m_s)


def brakes_of(vehicle: Vehicle) -> Brakes | None:
    """A multicopter's brakes: no harder than by default, and less hard if it accelerates less; None for a plane."""
    brakes = BRAKES.get(vehicle.autopilot)
    if brakes is None or math.isinf(vehicle.accel_m_s2):
        return None
    if vehicle.autopilot is Autopilot.ARDUCOPTER:
        accel = COPTER_PEAK_ACCEL * vehicle.accel_m_s2
        return brakes if accel >= brakes.accel_m_s2 else Brakes(accel, brakes.lag_m, brakes.lag_s)
    if not vehicle.smooths:
        return brakes
    accel, lag_s = vehicle.accel_m_s2, 0.5 * vehicle.accel_m_s2 / vehicle.leg_jerk_m_s3
    return Brakes(min(accel, brakes.accel_m_s2), brakes.lag_m, max(lag_s, brakes.lag_s))


def run_past_m(vehicle: Vehicle, speed_m_s: float, turn_rad: float | None) -> float:
    """How far past the end of a leg a multicopter runs, m; ``turn_rad``: the corner there, None: a stop."""
    brakes = brakes_of(vehicle)
    if brakes is None:
        return 0.0
    if turn_rad is None:
        return brakes.lag_m
    half = 0.5 * min(turn_rad, math.pi - 1e-3)
    radius_m = CORNER_M / max(1.0 / math.cos(half) - 1.0, 1e-9)
    across = COPTER_CORNER_ACCEL * vehicle.corner_accel_m_s2
    corner_m_s2 = max(across, CORNER_M_S2) if math.isfinite(across) else CORNER_M_S2
    return brakes.length_m(min(speed_m_s, math.sqrt(corner_m_s2 * radius_m)))


def levels_off_m(vehicle: Vehicle) -> tuple[float, float]:
    """How far below and above its altitude a return may level off if it begins on a leg that descends or climbs, m."""
    if vehicle.autopilot not in BRAKES or math.isinf(vehicle.accel_m_s2):
        return 0.0, 0.0
    return STOP_DOWN_M, STOP_UP_M


def about_turn_m(vehicle: Vehicle, speed_m_s: float, amsl_m: float, home_m: float = math.inf) -> float:
    """How far from the beginning of its return a plane at a speed gets while it turns about, m.

    ``home_m``: the distance home. Half of the turn is flown at the greatest bank, the rest as the L1 law fades. Without
    a turn radius the track error includes a turn, and to turn about takes twice as much: it is never less than that.
    """
    least = 2.0 * max(vehicle.limits.track_error_m, vehicle.turn_radius_m)
    if vehicle.autopilot is not Autopilot.ARDUPLANE:
        return least
    speed = speed_m_s * math.sqrt(circle_growth(amsl_m)) + vehicle.wind_m_s
    fade_s = DEFAULTS.l1_ahead_m(1.0) / (4.0 * DEFAULTS.l1_damping**2)
    turn_m = speed**2 / min(GRAVITY_M_S2, speed / fade_s) + 0.5 * math.pi * fade_s * speed
    spare = ABOUT_SPARE_NEAR if home_m < 2.0 * turn_m else ABOUT_SPARE
    return max(least, spare * turn_m)


def circle_home_m(radius_m: float, vehicle: Vehicle, amsl_m: float) -> float:
    """How far from home a plane's circle of ``radius_m`` reaches, m."""
    speed = vehicle.speed_max_m_s * math.sqrt(circle_growth(amsl_m)) + vehicle.wind_m_s
    return max(radius_m, CIRCLE_SPARE * speed**2 / GRAVITY_M_S2) + CIRCLE_LATE_S * speed


def detour_home_m(vehicle: Vehicle, speed_m_s: float, amsl_m: float) -> float:
    """How much longer than the straight line home a return is, m: out and back, or the turn about."""
    if vehicle.autopilot is Autopilot.ARDUPLANE:
        return 0.5 * math.pi * about_turn_m(vehicle, speed_m_s, amsl_m)
    return 2.0 * braking_distance_m(vehicle, speed_m_s)
