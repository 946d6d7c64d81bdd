"""From a path to a motion in time: take-off, gate, way-point legs with acceleration and corners, landing.

The model is a multicopter that follows way points. It takes off vertically from rest to rest, may hold at the top (the
gate), and then sets its speed from a standstill. It flies legs at the largest speed that cruise, climb and descent
rates, leg lengths, corners and the acceleration allow, looking ahead (`speeds`). It passes way points without a hold in
a rounded corner, and stops at the goal: that time is the arrival. Wind and noise are not modelled.

The legs from one standstill to the next are flown as the vehicle's autopilot flies them (`legs`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.fleet.motion.ardupilot import Curved, curved
from gcsplan.fleet.motion.px4 import Smoothed, smoothed
from gcsplan.fleet.motion.speeds import POSITION_ERROR_M, Segments, column, rounded
from gcsplan.vehicle import LIFTS_M_S, Autopilot, MissionEnd, Vehicle
from gcsplan.wind.drift import Drift, Drifts
from gcsplan.world.geodesy.atmosphere import true_per_indicated


@dataclass(frozen=True, eq=False, slots=True)
class TimedPath:
    """Piecewise linear motion of one vehicle through the air, from take-off to landing.

    ``times_s`` (N,) are seconds since the fleet's common start, strictly rising; ``points`` (N, 3) are east_m, north_m
    and amsl_m at those times. Before the first and after the last time the vehicle stands on the ground at its first or
    last point (with ``ends_in_air`` it stays at its last point for good). ``arrive_s`` is the time at which it reaches
    the goal at approach_agl_m. ``pieces`` (N - 1,) is the caller's number of each piece (its wire item), -1 if there is
    none. ``drifts`` (of N - 1 pieces): how much earlier or later each is in the declared winds, and ``begin_drifts``
    (1) its departure; None: not at all.
    """

    name: str
    times_s: Floats
    points: Floats
    arrive_s: float
    ends_in_air: bool = False
    pieces: Indices | None = None
    drifts: Drifts | None = None
    begin_drifts: Drifts = field(default_factory=lambda: Drifts.none(1))

    def __post_init__(self) -> None:
        if self.times_s.ndim != 1 or self.points.shape != (len(self.times_s), 3) or len(self.times_s) < 2:
            raise ValueError(f"{len(self.times_s)} times and points of shape {self.points.shape} are not a motion")
        if not (np.diff(self.times_s) > 0.0).all():
            raise ValueError(f"the times of {self.name} do not rise")

    @property
    def begin_s(self) -> float:
        """The time at which it leaves the ground, s."""
        return float(self.times_s[0])

    @property
    def end_s(self) -> float:
        """The time at which it is on the ground again, or at its last point, s."""
        return float(self.times_s[-1])

    def at(self, times_s: ArrayLike) -> Floats:
        """(M, 3) positions at ``times_s`` (M,)."""
        t = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
        return np.column_stack([np.interp(t, self.times_s, self.points[:, k]) for k in range(3)])

    def delayed(self, by_s: float) -> TimedPath:
        """The same motion, ``by_s`` seconds later."""
        return replace(self, times_s=self.times_s + by_s, arrive_s=self.arrive_s + by_s)

    def drifting(self, drift: Drift | None) -> TimedPath:
        """The same motion with its drifts, cut where they change; itself if no time changes."""
        if drift is None or not drift.moves or self.pieces is None:
            return self
        times_s = drift.cut(self.times_s, self.pieces)
        of = np.searchsorted(self.times_s, times_s[:-1], side="right") - 1
        return replace(
            self, times_s=times_s, points=self.at(times_s), pieces=self.pieces[of],
            drifts=drift.along(times_s, self.pieces[of]), begin_drifts=drift.departure,
        )  # fmt: skip

    @property
    def end_drifts(self) -> Drifts:
        """The drift with which the motion ends (1 of them)."""
        return Drifts.none(1) if self.drifts is None else self.drifts.take(np.array([-1]))


__all__ = [
    "POSITION_ERROR_M",
    "Course",
    "Motion",
    "Route",
    "at_own_speed",
    "flown_corners",
    "legs",
    "motion_error_m",
    "speed_for",
    "upright",
]

Motion = Segments | Curved | Smoothed
"""A flight from one standstill to the next, by the autopilot's own rules."""


LAND_SLOWLY_M = 10.0
"""Height above ground, m, below which a landing is slow (ArduCopter's LAND_ALT_LOW)."""

PX4_TAKE_OFF_M, PX4_TAKE_OFF_M_S = 10.0, 1.5
"""Below this height, m, a PX4 takes off at this speed (MPC_LAND_ALT1, MPC_TKO_SPEED): flown, 22.0 s to 44 m."""

PX4_LAND_SLOWLY_M = 7.0
"""Height above home, m, below which a landing PX4 without a range finder is slow. It slows down from MPC_LAND_ALT1
(10 m) to MPC_LAND_ALT2 (5 m), which takes as long."""

_LEAST_S = 1e-9


def legs(
    points: Floats, vehicle: Vehicle, owner: Indices, leg: Indices | None = None, pace: Floats | None = None,
    rates_m_s: Floats | None = None, radius_m: Floats | None = None, follows: Bools | None = None,
    ground_m_s: Floats | None = None,
) -> Motion | None:  # fmt: skip
    """The stretch through ``points`` (N, 3) without a stop; None if nothing moves.

    ``owner`` (N - 1,) are the caller's numbers of the parts between them. Parts with the same number of ``leg`` (N -
    1,) are one leg, cut to follow the ground or a curve; None: each part is a leg. ``pace`` (N - 1,) is the speed that
    results from a cruise speed of 1, if that is not 1. ``rates_m_s`` (N - 1, 2) are the rates of climb and descent on
    each part, ``radius_m`` (N - 1,) PX4's acceptance radius at its end, if they are not the vehicle's own; ``follows``
    (N - 1,) the parts that follow the ground. ``ground_m_s`` (N - 1,) are the largest horizontal speeds in a wind,
    which count in place of ``pace`` and of the largest lean angle; where it `lays` S-curves, (K, N - 1) are as many
    flights.

    ArduPilot flies S-curves (`curved`) and PX4 smooths (`smoothed`) unless a motion key of the vehicle is not
    bounded; every other vehicle rounds its corners (`speeds`). A fixed wing keeps the airspeed that it indicates,
    so it is faster in thin air, and its rates of climb and descent are of the slopes that it flies.
    """
    if vehicle.keeps_airspeed:
        pace, rates_m_s = _in_air(points, vehicle, pace, rates_m_s)
    if ground_m_s is not None:
        pace, vehicle = ground_m_s, replace(vehicle, lean_angle_deg=None)
    if lays(vehicle):
        numbers = np.arange(len(owner), dtype=np.intp) if leg is None else leg
        return curved(points, vehicle, owner, numbers, pace, rates_m_s, follows)
    if vehicle.smooths:
        return smoothed(points, vehicle, owner, pace, rates_m_s, radius_m)
    return rounded(points, vehicle, owner, pace, rates_m_s)


def lays(vehicle: Vehicle) -> bool:
    """Whether it flies S-curves (`curved`)."""
    return vehicle.lays_curves and math.isfinite(vehicle.corner_accel_m_s2)


def at_own_speed(way: Motion, speed_m_s: float) -> Motion:
    """The same flight at ``speed_m_s``, whatever the cruise speed."""
    most_m_s = np.minimum(way.most_m_s, speed_m_s * way.per_cruise)
    return replace(way, most_m_s=most_m_s, per_cruise=np.full_like(way.per_cruise, math.inf))


def _in_air(points: Floats, vehicle: Vehicle, pace: Floats | None, rates_m_s: Floats | None) -> tuple[Floats, Floats]:
    """``pace`` and ``rates_m_s`` with the part of the true airspeed that is horizontal on each part, in still air."""
    d = np.diff(points, axis=0)
    length = np.linalg.norm(d, axis=1)
    run = np.hypot(d[:, 0], d[:, 1])
    level = np.where(run > 0.0, run / np.where(length > 0.0, length, 1.0), 1.0)  # straight up its rates alone bound it
    faster = true_per_indicated(0.5 * (points[1:, 2] + points[:-1, 2]))
    rates = np.array([[vehicle.climb_m_s, vehicle.descent_m_s]]) if rates_m_s is None else rates_m_s
    return faster * level * (1.0 if pace is None else pace), faster[:, None] * rates


@dataclass(frozen=True, eq=False, slots=True)
class Route:
    """The flight of one vehicle in space, without times.

    ``points`` (N, 3), N >= 2, are east_m, north_m, amsl_m from the top of take-off to the approach point. Grounds are
    amsl. Without ``start_ground_amsl_m`` the flight begins in the air at the first point (as in the papers); without
    ``goal_ground_amsl_m`` there is no landing. ``end`` is as in a mission file: ``rtl`` climbs to ``rtl_amsl_m`` if it
    is lower, flies straight home at `Vehicle.return_speed_m_s`, and lands; ``none`` is gone on arrival. ``holds_s``
    (N,) are seconds of holding at each point; the first is the gate. ``items`` (N + 1,) are the caller's numbers of the
    take-off, of each way point but the first, and of the end of the flight; legs with the same number are parts of one
    leg. ``pace`` (N,) is the speed over ground that results from a commanded speed of 1 on each leg, and last on the
    straight line home. ``follows``: its legs follow the ground. ``hold_items`` (N,): the caller's numbers of the
    holds; None: the numbers of the legs before them.

    A fixed wing has no columns (a VTOL has): ``climb_out`` (K, 3) leads from the ground to the first point, ``glide``
    (K, 3) from the last point down to the ground if it lands. After a return it circles over home and stays in the air.
    ``climb_out_m_s`` (K - 1,) are true speeds along the climb-out, if they differ from every leg's speed.
    """

    name: str
    points: Floats
    start_ground_amsl_m: float | None = None
    goal_ground_amsl_m: float | None = None
    end: MissionEnd = "land"
    rtl_amsl_m: float | None = None
    holds_s: Floats | None = None
    items: Indices | None = None
    climb_out: Floats | None = None
    climb_out_m_s: Floats | None = None
    glide: Floats | None = None
    pace: Floats | None = None
    follows: bool = False
    hold_items: Indices | None = None

    def __post_init__(self) -> None:
        p = self.points
        if p.ndim != 2 or p.shape[1] != 3 or len(p) < 2 or not np.isfinite(p).all():
            raise ValueError(f"a route is (N, 3) finite metres with N >= 2, given shape {p.shape}")
        if self.holds_s is not None and (self.holds_s.shape != (len(p),) or not (self.holds_s >= 0.0).all()):
            raise ValueError(f"{len(p)} points need as many holds of 0 s or more, given {self.holds_s}")
        if self.pace is not None and (self.pace.shape != (len(p),) or not (self.pace > 0.0).all()):
            raise ValueError(f"{len(p)} points need as many paces above 0, given {self.pace}")
        if self.items is not None and self.items.shape != (len(p) + 1,):
            raise ValueError(f"{len(p)} points need {len(p) + 1} item numbers, given {len(self.items)}")
        if self.start_ground_amsl_m is not None and self.start_ground_amsl_m > p[0, 2]:
            raise ValueError(f"{self.name}: the ground at the start lies above the top of take-off")
        if self.end == "rtl":
            _home(self)
        if self.end == "land" and self.goal_ground_amsl_m is not None and self.goal_ground_amsl_m > p[-1, 2]:
            raise ValueError(f"{self.name}: the ground at the goal lies above the approach point")

    @property
    def length_m(self) -> float:
        """Length in space of the way-point legs, with corners not cut, m."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    def energy_j(self, vehicle: Vehicle, hold_s: float = 0.0, moving_s: float = math.nan) -> float:
        """Energy of the flight, J, by `gcsplan.vehicle.Energy`.

        Corners are not cut. ``hold_s`` is added to the route's own holds; ``moving_s``: seconds of flight without any
        hold (`Course.moving_s`), needed with a base power alone. Waiting on the ground costs nothing.
        """
        corners = flown_corners(self)
        d = np.diff(corners, axis=0)
        held = hold_s + (0.0 if self.holds_s is None else float(self.holds_s.sum()))
        held += vehicle.return_waits_s if self.end == "rtl" else 0.0
        up_m, along_m = float(np.abs(d[:, 2]).sum()), float(np.hypot(d[:, 0], d[:, 1]).sum())
        return vehicle.energy.under_way_j(up_m, along_m, moving_s) + vehicle.energy.hold_w() * held


class Course:
    """The stretches of a route for a vehicle, ready for any speed.

    ``to_goal`` are the stretches before the arrival, each with the seconds of holding after it; ``after`` are the
    stretches after the arrival.
    """

    def __init__(self, route: Route, vehicle: Vehicle) -> None:
        self.route, self.vehicle = route, vehicle
        holds = np.zeros(len(route.points)) if route.holds_s is None else route.holds_s
        self.gate_s = float(holds[0])
        self.takeoff = _takeoff(route, vehicle)
        self.to_goal: list[tuple[Motion, float]] = []
        stops = [0, *(np.flatnonzero(holds[1:-1] > 0.0) + 1).tolist(), len(holds) - 1]
        leg = None if route.items is None else route.items[1:-1]
        waited = 0.0
        for i, j in pairwise(stops):
            owner = np.arange(i + 1, j + 1, dtype=np.intp)
            pace = None if route.pace is None else route.pace[i:j]
            follows = np.full(j - i, route.follows)
            numbers = None if leg is None else leg[i:j]
            stretch = legs(route.points[i : j + 1], vehicle, owner, numbers, pace, follows=follows)
            held = float(holds[j]) if j < stops[-1] else 0.0
            if stretch is not None:
                self.to_goal.append((stretch, held))
            else:
                waited += held  # it is at this place already: the hold adds to the gate or to the hold before
                if self.to_goal:
                    last, before = self.to_goal[-1]
                    self.to_goal[-1], waited = (last, before + waited), 0.0
        self.gate_s += waited
        self.goal_s = float(holds[-1])
        self.after = _after(route, vehicle)

    def time_to_goal_s(self, speed_m_s: float, hold_s: float = 0.0) -> float:
        """Seconds from leaving the ground to the arrival at a cruise speed, with ``hold_s`` more at the gate.

        They never rise with the speed.
        """
        first = 0.0 if self.takeoff is None else self.takeoff.time_s(speed_m_s)
        return first + self.gate_s + hold_s + sum(s.time_s(speed_m_s) + held for s, held in self.to_goal)

    def moving_s(self, speed_m_s: float) -> float:
        """Seconds of the whole flight at a cruise speed, its end included and without holds."""
        parts = [*([] if self.takeoff is None else [self.takeoff]), *(s for s, _ in self.to_goal), *self.after]
        return math.fsum(part.time_s(speed_m_s) for part in parts)

    def fly(
        self, speed_m_s: float, depart_s: float = 0.0, hold_s: float = 0.0, error_m: float = POSITION_ERROR_M
    ) -> TimedPath:
        """The motion of the whole flight at a cruise speed, leaving at ``depart_s``, with ``hold_s`` more at the gate.

        Accelerated and curved parts are cut into straight pieces of constant speed that are at most ``error_m`` from
        the true motion at any time (`motion_error_m`). Pieces carry the route's item numbers.
        """
        route = self.route
        start = route.points[0] if self.takeoff is None else self.takeoff.start[0]
        motion = _Motion(depart_s, start)
        if self.takeoff is not None:
            motion.go(self.takeoff, speed_m_s, error_m)
        motion.wait(self.gate_s + hold_s, 0)
        for stretch, held in self.to_goal:
            motion.go(stretch, speed_m_s, error_m)
            motion.wait(held, int(stretch.owner[-1]) + (0 if route.hold_items is None else len(route.points) + 1))
        arrive_s = motion.now_s
        if self.after:
            motion.wait(self.goal_s, len(route.points) - 1)
        for stretch in self.after:
            if route.end == "rtl" and stretch is self.after[-1] and (stretch.start[0, :2] == route.points[0, :2]).all():
                motion.wait(self.vehicle.return_waits_s, len(route.points))
            motion.go(stretch, speed_m_s, error_m)
        return motion.path(route, arrive_s)


def motion_error_m(vehicle: Vehicle, error_m: float = POSITION_ERROR_M) -> float:
    """Largest distance, m, of a `TimedPath` of this module from the true motion; 0 if nothing accelerates or turns."""
    sharp = math.isinf(vehicle.corner_accel_m_s2)
    instant = math.isinf(vehicle.accel_m_s2) and math.isinf(vehicle.vertical_accel_m_s2)
    return 0.0 if sharp and instant else error_m


def speed_for(
    time_s: Callable[[float], float], target_s: float, slow_m_s: float, fast_m_s: float, within_s: float = 1e-9
) -> float:
    """The speed between two at which ``time_s`` (falling) is ``target_s``; the faster end where it is flat.

    If ``target_s`` is not between the times at the two ends, the nearer end is returned.
    """
    low, high = slow_m_s, fast_m_s
    t_low, t_high = time_s(low) - target_s, time_s(high) - target_s
    if t_high >= -within_s:
        return high
    if t_low <= within_s:
        return low
    # Regula falsi in 1/v, in which time is nearly linear (Illinois: the value at an end that stays is halved).
    x_low, x_high = 1.0 / low, 1.0 / high
    side = 0
    for _ in range(200):
        x = (x_low * t_high - x_high * t_low) / (t_high - t_low)
        if not x_high < x < x_low:
            x = 0.5 * (x_low + x_high)
        t = time_s(1.0 / x) - target_s
        if abs(t) <= within_s or x_low - x_high <= 1e-15 * x_low:
            break
        if t > 0.0:
            x_low, t_low, t_high = x, t, t_high * (0.5 if side > 0 else 1.0)
            side = 1
        else:
            x_high, t_high, t_low = x, t, t_low * (0.5 if side < 0 else 1.0)
            side = -1
    return 1.0 / x


class _Motion:
    """The break points of a flight, collected stretch by stretch."""

    def __init__(self, depart_s: float, start: Floats) -> None:
        self.now_s = depart_s
        self.times = [np.array([depart_s])]
        self.points = [start[None, :]]
        self.legs: list[Indices] = []

    def go(self, stretch: Motion, speed_m_s: float, error_m: float) -> None:
        times, points, owner = stretch.motion(speed_m_s, error_m)
        self.times.append(self.now_s + times)
        self.points.append(points)
        self.legs.append(owner)
        self.now_s = float(self.times[-1][-1])

    def wait(self, seconds: float, leg: int) -> None:
        if seconds > 0.0:
            self.now_s += seconds
            self.times.append(np.array([self.now_s]))
            self.points.append(self.points[-1][-1:])
            self.legs.append(np.array([leg], dtype=np.intp))

    def path(self, route: Route, arrive_s: float) -> TimedPath:
        times, points = np.concatenate(self.times), np.concatenate(self.points)
        if len(times) < 2:
            raise ValueError(f"{route.name} does not move")
        legs_ = np.concatenate(self.legs)
        keep = np.append(True, np.diff(times) > _LEAST_S)
        keep[-1] = True
        if times[-1] - times[keep][-2] <= _LEAST_S:  # keep the last point, drop one that is almost at the same time
            keep[np.flatnonzero(keep)[-2]] = False
        items = np.full(len(legs_), -1, dtype=np.intp)
        if route.items is not None:
            items = np.append(route.items, [] if route.hold_items is None else route.hold_items).astype(np.intp)[legs_]
        stays = route.end == "loiter" or (route.end == "rtl" and route.climb_out is not None)
        return TimedPath(route.name, times[keep], points[keep], arrive_s, stays, items[keep[1:]])


def _takeoff(route: Route, vehicle: Vehicle) -> Motion | None:
    ground, top = route.start_ground_amsl_m, route.points[0]
    if route.climb_out is not None and not vehicle.vtol:
        owner, own = np.zeros(len(route.climb_out) - 1, dtype=np.intp), route.climb_out_m_s
        if own is not None:
            indicated = own / true_per_indicated(0.5 * (route.climb_out[1:, 2] + route.climb_out[:-1, 2]))
            way = legs(route.climb_out, vehicle, owner, pace=indicated, rates_m_s=np.column_stack([own, own]))
            return None if way is None else at_own_speed(way, 1.0)
        # The mission sets its speed after the climb-out, which is flown at the vehicle's own.
        way = legs(route.climb_out, vehicle, owner)
        return None if way is None else at_own_speed(way, vehicle.speed_max_m_s)
    climb = [] if ground is None else upright(top[:2], ground, float(top[2]), vehicle, 0, ground)
    # So is a climb that no rate bounds.
    return at_own_speed(climb[0], vehicle.speed_max_m_s) if climb else None


def _after(route: Route, vehicle: Vehicle) -> list[Motion]:
    """The stretches after the arrival."""
    goal, home = route.points[-1], route.points[0]
    number = len(route.points)
    slanted = None if vehicle.vtol else route.glide
    if route.climb_out is not None and route.end == "rtl":
        slanted = np.array([goal, [*route.climb_out[0, :2], _home(route)[1]]])
    if slanted is not None or (route.climb_out is not None and not (vehicle.vtol and route.end == "land")):
        if slanted is None:
            return []
        # A wing's return is judged level, in the middle of the band in which it may change its altitude.
        d = np.diff(slanted, axis=0)
        level = np.linalg.norm(d, axis=1) / np.hypot(d[:, 0], d[:, 1]) if route.end == "rtl" else None
        down = legs(slanted, vehicle, np.full(len(d), number, dtype=np.intp), pace=level)
        if down is not None and route.end == "rtl" and vehicle.return_speed_m_s is not None:
            down = at_own_speed(down, vehicle.return_speed_m_s)
        return [] if down is None else [down]
    if route.end == "land" and route.goal_ground_amsl_m is not None:
        home_m = route.start_ground_amsl_m
        return upright(goal[:2], float(goal[2]), route.goal_ground_amsl_m, vehicle, number, home_m)
    if route.end != "rtl":
        return []
    home_amsl, rtl_amsl = _home(route)
    level = max(float(goal[2]), rtl_amsl)
    stretches = upright(goal[:2], float(goal[2]), level, vehicle, number)
    above = np.array([[goal[0], goal[1], level], [home[0], home[1], level]])
    pace = None if route.pace is None else route.pace[-1:]
    way = legs(above, vehicle, np.array([number], dtype=np.intp), pace=pace)
    if way is not None and vehicle.return_speed_m_s is not None:
        way = at_own_speed(way, vehicle.return_speed_m_s)
    stretches += [way] if way is not None else []
    return stretches + upright(home[:2], level, home_amsl, vehicle, number)


def _home(route: Route) -> tuple[float, float]:
    """Ground at home and altitude of the flight there, both amsl, for a route that ends with a return."""
    if route.start_ground_amsl_m is None or route.rtl_amsl_m is None:
        raise ValueError(f"{route.name}: a return needs rtl_amsl_m and the ground at home")
    return route.start_ground_amsl_m, route.rtl_amsl_m


def upright(
    place: Floats, from_amsl_m: float, to_amsl_m: float, vehicle: Vehicle, owner: int, home_amsl_m: float | None = None
) -> list[Motion]:
    """A column over ``place`` (2,): a climb to a standstill, or a landing that is slow near the ground.

    ``home_amsl_m``: the ground at home, above which PX4 slows down, wherever it lands; None: as at the landing place.
    Empty if both altitudes are the same.
    """
    if from_amsl_m == to_amsl_m:
        return []
    if vehicle.vtol:
        vehicle = replace(vehicle, climb_m_s=LIFTS_M_S[0], descent_m_s=LIFTS_M_S[1])
    slow_m_s = min(vehicle.land_m_s, vehicle.descent_m_s)
    slow_from = to_amsl_m + LAND_SLOWLY_M
    if vehicle.autopilot is Autopilot.PX4:
        slow_from = (to_amsl_m if home_amsl_m is None else home_amsl_m) + PX4_LAND_SLOWLY_M
    fast_from = from_amsl_m + PX4_TAKE_OFF_M
    if vehicle.smooths and home_amsl_m is not None and home_amsl_m == from_amsl_m and fast_from < to_amsl_m:
        heights, most = (
            [from_amsl_m, fast_from, to_amsl_m],
            [min(PX4_TAKE_OFF_M_S, vehicle.climb_m_s), vehicle.climb_m_s],
        )
    elif from_amsl_m < to_amsl_m:
        heights, most = [from_amsl_m, to_amsl_m], [vehicle.climb_m_s]
    elif from_amsl_m <= slow_from:
        heights, most = [from_amsl_m, to_amsl_m], [slow_m_s]
    elif slow_from <= to_amsl_m:
        heights, most = [from_amsl_m, to_amsl_m], [vehicle.descent_m_s]
    else:
        heights, most = [from_amsl_m, slow_from, to_amsl_m], [vehicle.descent_m_s, slow_m_s]
    climbs = from_amsl_m < to_amsl_m
    return [column(np.array(heights), np.array(most), place, vehicle, owner, stops=climbs)]


def flown_corners(route: Route) -> Floats:
    """(N, 3) the corners of the whole flight as a polyline, with columns and the return."""
    first, last = route.points[0], route.points[-1]
    before, behind = [], []
    if route.climb_out is not None:
        before, behind = list(route.climb_out[:-1]), [] if route.glide is None else list(route.glide[1:])
        if route.end == "rtl":
            behind = [np.array([*route.climb_out[0, :2], _home(route)[1]])]
        return np.array([*before, *route.points, *behind], dtype=np.float64)
    if route.start_ground_amsl_m is not None:
        before.append([first[0], first[1], route.start_ground_amsl_m])
    if route.end == "land" and route.goal_ground_amsl_m is not None:
        behind.append([last[0], last[1], route.goal_ground_amsl_m])
    if route.end == "rtl":
        level = max(float(last[2]), _home(route)[1])
        behind += [[last[0], last[1], level], [first[0], first[1], level], before[0]]
    return np.array([*before, *route.points, *behind], dtype=np.float64)
