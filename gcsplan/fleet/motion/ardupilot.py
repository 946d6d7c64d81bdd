"""The motion of ArduPilot through way points: each leg an S-curve of its own, the next begun while this one ends.

ArduPilot flies each leg as if it stopped at its end, and begins the next leg while this one slows down, adding both
motions (SCurve.cpp, `advance_target_along_track`). It begins as early as the middle of the turn then lies within
WPNAV_RADIUS of the way point, is no faster than either leg allows, and turns with no more than WPNAV_ACCEL_C and
WPNAV_ACCEL_Z (parameters' defaults). So a flight takes the seconds of its legs less the seconds of their overlaps.

It waits for a vehicle that lags behind (`advance_wp_target_along_track`), which it does where it speeds up from a low
speed: `LAG_S` is the measured delay.

**Over steep ground** its height trails the ground's before it slows down. On a leg that follows the ground it flies at
full speed while its height is within half of WPNAV_TER_MARGIN (10 m) of the commanded one, and the slower the more it
is off, down to a standstill at the whole margin (AC_WPNav.cpp, `advance_wp_target_along_track`; AC_PosControl.cpp,
`pos_offset_z_scaler`). It climbs and sinks meanwhile with its rates at most, and as fast as it can still stop at the
commanded height. So on a long slope it comes to the speed that its rates allow, and it is there a few seconds earlier
than if it never left the height. Flown on a ramp of 50 %, where 2.5 m/s of climb allow 5 m/s of the 10: 7.4 m too low;
7.5 m by this rule.

**Its largest lean angle** limits the speed along a slope, against the drag. The airframe is ArduPilot's
simulated quadrotor (SIM_Frame.h: 3 kg, 15.08 m/s at 45° of lean, 593 m above sea level), whose drag is a body's, which
grows with the square of the speed through the air, and the rotors', which grows with the speed itself. An airframe with
less drag is faster. Along the body's longitudinal axis drag balances gravity, for the thrust is across it; so down a
slope, where the body leans further from its course, the same angle is slower.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.fleet.motion.scurve import Begun, Curves, along_slope, curves
from gcsplan.fleet.motion.speeds import POSITION_ERROR_M, bounds
from gcsplan.vehicle import COPTER_CORNER_ACCEL, COPTER_PEAK_ACCEL, LARGEST_LEAN_DEG, Autopilot, Vehicle
from gcsplan.world.geodesy.atmosphere import density_ratio

__all__ = ["CORNER_M", "MOST_TILT_DEG", "Curved", "curved", "lean_needed_deg", "leaning_m_s", "trailing_s"]

BODY, ROTORS = 0.003627, 0.02532
"""Drag at sea level per weight, of the body at 1 m/s, and of the rotors at 1 m/s with a thrust of one weight."""

_LEAN_ROUNDS = 30

MEASURED_AMSL_M, SPARE = 593.0, 1.007
"""The altitude at which the drag was measured, and the part of the fastest speed to keep at an unknown altitude."""


TERRAIN_MARGIN_M = 10.0
"""WPNAV_TER_MARGIN, default."""

STEP_S = 0.2
_SLOWEST = 0.01
_BEFORE = 3
"""How many parts before one that is too steep its height is followed."""

CORNER_M = 2.0
"""WPNAV_RADIUS, default: the middle of a turn lies this near to its way point."""

FULL_ACCEL, CORNER_ACCEL = COPTER_PEAK_ACCEL, COPTER_CORNER_ACCEL
"""A curve's peak acceleration and the one across a turn, per `Vehicle.accel_m_s2` and `Vehicle.corner_accel_m_s2`."""

LAG_S, LAG_FROM, REST_M_S = 0.36, 0.6, 0.96
"""Speeding up by a factor f costs LAG_S·(ln f - LAG_FROM) seconds more than its curve, if that is above 0; a standstill
counts as REST_M_S. Measured on ArduCopter 4.7 at 5 to 15 m/s, from rest and out of turns of 4 to 135 degrees."""

LAST_FLOWN = 16
"""Last speeds on stretches whose legs are kept: a search for a speed asks again for the two ends of its range, and the
motion at the speed that it found is made next."""

MOST_TILT_DEG = 80.0
"""Most degrees between the rotors' plane and the way through the air; on a steeper way a copter is slower."""

_TRIED, _ROUNDS = 16, 3
_STEPS, _WITHIN = 30, 1e-6
_HALVINGS = 60
_LEAST_CURVE_M = 1e-3
_SAME_S = 1e-9
_LEVEL = np.array([1.0, 1.0, 0.0])


def leaning_m_s(lean_deg: float | Floats, slope_rad: Floats, amsl_m: Floats) -> Floats:
    """(N,) the fastest speeds in space along slopes (N,), climbs positive, at altitudes (N,), in still air.

    ``lean_deg``: one for all, or (N,).
    """
    thin = density_ratio(amsl_m)
    lean = np.radians(lean_deg)
    tilt = np.clip(lean + slope_rad, None, np.radians(MOST_TILT_DEG))
    lift, push, rise, body = np.cos(lean), 2.0 * np.sin(lean), np.tan(tilt), BODY * thin
    drag = 4.0 * BODY * thin * np.sin(lean)
    thrust = np.ones_like(tilt)
    for _ in range(_LEAN_ROUNDS):
        rotors = ROTORS * np.sqrt(thin * thrust)
        along = push / (rotors + np.sqrt(rotors**2 + drag))
        across = along * rise
        thrust = np.maximum(lift + body * across * np.abs(across) + rotors * across, 0.01)
    return np.asarray(along / np.cos(tilt))


@lru_cache(maxsize=256)
def lean_needed_deg(speed_m_s: float, amsl_m: float | None = None) -> float:
    """The lean, in whole degrees, that level flight at a speed needs at an altitude, at most `LARGEST_LEAN_DEG` + 1.

    Without an altitude: with a little to spare, where the drag was measured.
    """
    least_m_s = SPARE * speed_m_s if amsl_m is None else speed_m_s * (1.0 - 1e-3)
    leans = np.arange(1.0, LARGEST_LEAN_DEG + 1.0)
    height = np.full(len(leans), MEASURED_AMSL_M if amsl_m is None else amsl_m)
    enough = np.flatnonzero(leaning_m_s(leans, np.zeros(len(leans)), height) >= least_m_s)
    return float(leans[enough[0]]) if len(enough) else LARGEST_LEAN_DEG + 1.0


def trailing_s(
    part_m: Floats, rise_m: Floats, rates_m_s: Floats, speed_m_s: Floats, follows: Bools, accel_m_s2: float,
    vertical_m_s2: float,
) -> Floats:  # fmt: skip
    """(P,) seconds of parts that are flown one after another, ``part_m`` (P,) long and with ``rise_m`` (P,).

    ``rates_m_s`` (P, 2): of climb and descent; ``speed_m_s`` (P,): the highest speed on level ground. Parts that
    ``follows`` (P,) marks follow the ground, the others are flown at that speed. ``accel_m_s2``, ``vertical_m_s2``:
    along the leg, and up or down.
    """
    seconds = part_m / speed_m_s
    limit = np.where(rise_m > 0.0, rates_m_s[:, 0], rates_m_s[:, 1])
    steep = np.flatnonzero(follows & (np.abs(rise_m) > limit * seconds))
    free = 0  # the first part that is not timed yet
    for k in steep.tolist():
        if k >= free:
            first = max(k - _BEFORE, free)
            while not follows[first:k].all():
                first += 1
            free = _fly(first, part_m, rise_m, rates_m_s, speed_m_s, follows, seconds, accel_m_s2, vertical_m_s2)
    return seconds


def _fly(
    first: int, part_m: Floats, rise_m: Floats, rates_m_s: Floats, speed_m_s: Floats, follows: Bools, seconds: Floats,
    accel_m_s2: float, vertical_m_s2: float,
) -> int:  # fmt: skip
    """Time the parts from ``first`` on, until it is on its height at full speed again; return the next part."""
    lengths, rises, speeds = part_m.tolist(), rise_m.tolist(), speed_m_s.tolist()
    up, down = rates_m_s[:, 0].tolist(), rates_m_s[:, 1].tolist()
    half, i, count = 0.5 * TERRAIN_MARGIN_M, first, len(lengths)
    speed, gone_m, since_s = speeds[first], 0.0, 0.0
    climbs = max(-down[i], min(up[i], rises[i] / lengths[i] * speed))
    off = math.copysign(0.5 * climbs * climbs / vertical_m_s2, climbs)  # the commanded height above its own
    most_z, most = vertical_m_s2 * STEP_S, accel_m_s2 * STEP_S
    while True:
        rate = math.sqrt(2.0 * vertical_m_s2 * abs(off))
        rate = min(rate, up[i]) if off > 0.0 else -min(rate, down[i])
        climbs += max(-most_z, min(most_z, rate - climbs))
        share = max(_SLOWEST, min(1.0, 2.0 - abs(off) / half))
        speed += max(-most, min(most, share * speeds[i] - speed))
        step_m, left_s = max(speed, _SLOWEST) * STEP_S, STEP_S
        off -= climbs * STEP_S
        while gone_m + step_m >= lengths[i]:
            last_m = lengths[i] - gone_m
            off += rises[i] * last_m / lengths[i]
            seconds[i] = since_s + left_s * last_m / step_m
            left_s -= left_s * last_m / step_m
            step_m, gone_m, since_s = step_m - last_m, 0.0, 0.0
            i += 1
            if i == count or not follows[i]:
                return i
            calm = abs(off) < half and speed >= 0.999 * speeds[i]
            if calm and all(
                not follows[k] or -down[k] <= rises[k] / lengths[k] * speeds[k] <= up[k]
                for k in range(i, min(i + _BEFORE + 1, count))
            ):
                return i
        off += rises[i] * step_m / lengths[i]
        gone_m, since_s = gone_m + step_m, since_s + left_s


@dataclass(frozen=True, eq=False, slots=True)
class Curved:
    """Legs between two standstills, L of them, each of one or more straight parts, P in all.

    ``knots`` (P + 1, 3) are the ends of the parts in metres, ``at`` (P + 1,) where these are: number of the leg plus
    part of the leg. ``way`` (L, 3) are the legs as the autopilot counts them, in metres: a leg that follows the ground
    is level. ``begins``, ``ends`` (L, 3) are the directions in which each leg begins and ends; of a curve they differ.
    ``part_m`` (P,) are the parts' lengths so counted. The speed along a part is at most ``most_m_s`` (P,) and
    at most the cruise speed times ``per_cruise`` (P,). ``owner`` (P,) is the caller's number of each part. Parts that
    ``follows`` (P,) follow the ground, with ``rates_m_s`` (P, 2) of climb and descent (`trailing_s`).

    ``per_cruise`` may be (K, P): so many flights over the same way, of which `shares_s` tells all at once.
    """

    knots: Floats
    at: Floats
    way: Floats
    begins: Floats
    ends: Floats
    part_m: Floats
    most_m_s: Floats
    per_cruise: Floats
    owner: Indices
    vehicle: Vehicle
    follows: Bools
    rates_m_s: Floats

    @property
    def start(self) -> Floats:
        """(P, 3) where each part begins."""
        return self.knots[:-1]

    def time_s(self, cruise_m_s: float) -> float:
        """Seconds for the stretch at a cruise speed."""
        flown, overlap, lag = _flown(self, cruise_m_s)
        return float(flown.time_s.sum() - overlap.sum() + lag.sum())

    def shares_s(self, cruise_m_s: float, legs: int) -> Floats:
        """(..., ``legs``) the seconds of each leg, 0 to ``legs`` - 1 in ``owner``; together they are `time_s`.

        A leg ends in the middle of the turn, where ArduPilot counts its way point as reached.
        """
        flown, overlap, lag = _flown(self, cruise_m_s)
        seconds = flown.time_s + lag
        seconds[1:] -= 0.5 * overlap
        seconds[:-1] -= 0.5 * overlap
        part_s, leg = self.part_s(cruise_m_s), self.leg
        share = part_s / _summed(part_s, leg, len(self.way))[..., leg]
        each = seconds.reshape(*part_s.shape[:-1], len(self.way))
        return _summed(each[..., leg] * share, self.owner, legs)

    def motion(self, cruise_m_s: float, error_m: float = POSITION_ERROR_M) -> tuple[Floats, Floats, Indices]:
        """Times (M,) since the stretch began, places (M, 3) and legs (M,) at the end of each of M straight pieces.

        Straight motion at constant speed between them is at most ``error_m`` away from the true motion: with
        accelerations up to A, a piece of t seconds differs by A·t²/8.
        """
        flown, overlap, lag = _flown(self, cruise_m_s)
        seconds, ramp = flown.time_s, flown.start_s
        begin = np.append(0.0, np.cumsum(seconds[:-1] - overlap))
        end = begin + seconds
        turned = end[:-1] - 0.5 * overlap
        step = np.sqrt(8.0 * error_m / (2.0 * flown.accel_m_s2))  # two legs may accelerate at once
        pieces = np.ceil(ramp / step).astype(np.intp)
        times = np.unique(np.concatenate([
            turned, _spread(begin, ramp, pieces), _spread(end - ramp, ramp, pieces), self._parts_s(flown, begin),
        ]))  # fmt: skip
        times = times[np.append(np.diff(times) > _SAME_S, True)]
        times = times[times > _SAME_S]
        places, part = self._places(flown, begin, times), self._parts_at(flown, begin, turned, times)
        since = np.append(0.0, turned)
        late = np.interp(times, np.column_stack([since, since + 0.5 * ramp]).ravel(), _steps(lag))
        return times + late, places, self.owner[part]

    @property
    def leg(self) -> Indices:
        """(P,) the leg of each part."""
        return np.floor(0.5 * (self.at[1:] + self.at[:-1])).astype(np.intp)

    def part_s(self, cruise_m_s: float) -> Floats:
        """(..., P) seconds of each part at its highest speed."""
        speed = np.minimum(self.most_m_s, cruise_m_s * self.per_cruise)
        if not self.follows.any():
            return np.asarray(self.part_m / speed)
        found = [
            trailing_s(
                self.part_m, np.diff(self.knots[:, 2]), self.rates_m_s, one, self.follows,
                FULL_ACCEL * self.vehicle.accel_m_s2, self.vehicle.vertical_accel_m_s2,
            )
            for one in speed.reshape(-1, speed.shape[-1])
        ]  # fmt: skip
        return np.reshape(found, speed.shape)

    def _parts_s(self, flown: Curves, begin: Floats) -> Floats:
        """(K,) the times at which the ends of parts within a leg are passed."""
        inner = np.flatnonzero(self.at != np.floor(self.at))
        leg = np.floor(self.at[inner]).astype(np.intp)
        one = flown.of(leg)
        low, high = np.zeros(len(leg)), one.time_s
        for _ in range(_HALVINGS if len(leg) else 0):
            middle = 0.5 * (low + high)
            short = one.gone_m(middle) < (self.at[inner] - leg) * one.length_m
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return begin[leg] + high

    def _parts_at(self, flown: Curves, begin: Floats, turned: Floats, times: Floats) -> Indices:
        """(M,) the parts that end at ``times`` (M,) or are flown then; a leg ends in the middle of its turn."""
        leg = np.searchsorted(turned, times - 0.5 * _SAME_S)
        one = flown.of(leg)
        here = np.clip(one.gone_m(times - begin[leg]) / one.length_m, 1e-6, 1.0)
        return np.searchsorted(self.at, leg + here * (1.0 - 1e-9)) - 1

    def _places(self, flown: Curves, begin: Floats, times: Floats) -> Floats:
        """(M, 3) where it is at ``times`` (M,): the motions of two legs added, of which one may have ended."""
        leg = np.searchsorted(begin, times, side="right") - 1
        before = np.maximum(leg - 1, 0)
        places = self._on(leg, flown, begin, times)
        return np.where((leg > 0)[:, None], places + self._on(before, flown, begin, times) - self._along(leg), places)

    def _on(self, leg: Indices, flown: Curves, begin: Floats, times: Floats) -> Floats:
        one = flown.of(leg)
        return self._along(leg + np.minimum(one.gone_m(times - begin[leg]) / one.length_m, 1.0))

    def _along(self, at: Floats | Indices) -> Floats:
        return np.column_stack([np.interp(at, self.at, self.knots[:, k]) for k in range(3)])


@lru_cache(maxsize=LAST_FLOWN)
def _flown(way: Curved, cruise_m_s: float) -> tuple[Curves, Floats, Floats]:
    """The legs' curves at a cruise speed; the seconds (L - 1,) for which each overlaps with the next; and the seconds
    (L,) by which the vehicle lags behind while it speeds up on each.

    Several flights stand one after another, as if it stood still between them: K·L legs.
    """
    part_s, count, vehicle = way.part_s(cruise_m_s), len(way.way), way.vehicle
    flights = part_s.size // part_s.shape[-1]
    along, ends, begins = (np.tile(each, (flights, 1)) for each in (way.way, way.ends, way.begins))
    run, rise = np.hypot(along[:, 0], along[:, 1]), along[:, 2]
    length = np.hypot(run, rise)
    speed = length / _summed(part_s, way.leg, count).ravel()
    upward = np.full(len(length), vehicle.vertical_accel_m_s2)
    accel = along_slope(run, rise, np.full(len(length), FULL_ACCEL * vehicle.accel_m_s2), upward, upward)
    flown = curves(length, speed, accel, vehicle.leg_jerk_m_s3)
    joint = np.arange(1, len(length))
    joint = joint[joint % count > 0]  # where the leg with this number follows one without a stop
    turns = _Turns.between(flown, (ends, begins), speed, vehicle, joint)
    overlap, slow = np.zeros(len(length) - 1), np.full(len(length), REST_M_S)
    overlap[joint - 1], turned_m_s = _overlaps(turns)
    slow[joint] = np.maximum(turned_m_s, REST_M_S)
    lag = LAG_S * np.maximum(np.log(np.maximum(flown.peak_m_s / slow, 1.0)) - LAG_FROM, 0.0)
    return flown, overlap, lag


def curved(
    points: Floats, vehicle: Vehicle, owner: Indices, leg: Indices, pace: Floats | None, rates_m_s: Floats | None,
    follows: Bools | None = None,
) -> Curved | None:  # fmt: skip
    """The stretch through ``points`` (N, 3) without a stop; None if nothing moves.

    ``owner`` (N - 1,) are the caller's numbers of the parts, ``leg`` (N - 1,) numbers of the legs that they belong to;
    for the others see `timing.legs`.
    """
    keep = np.append(True, np.linalg.norm(np.diff(points, axis=0), axis=1) > _LEAST_CURVE_M)
    p, owner, leg = points[keep], owner[keep[1:]], leg[keep[1:]]
    if len(p) < 2:
        return None
    d = np.diff(p, axis=0)
    new = np.append(True, leg[1:] != leg[:-1])
    number = np.cumsum(new) - 1
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(d))
    run, length = np.hypot(d[:, 0], d[:, 1]), np.linalg.norm(d, axis=1)
    rates = np.array([[vehicle.climb_m_s, vehicle.descent_m_s]]) if rates_m_s is None else rates_m_s[keep[1:]]
    rates = np.broadcast_to(rates, (len(d), 2))
    most, per_cruise = bounds(length, run, d[:, 2], rates)
    several = last - first > 1
    cut = several[number] & (run > 0.0)  # parts of a leg that follows the ground or a curve
    trails = np.zeros(len(d), dtype=np.bool_)
    if follows is not None:
        trails = follows[keep[1:]] & cut
        most = np.where(trails, math.inf, most)  # `trailing_s` keeps the rates
    if vehicle.autopilot is Autopilot.ARDUCOPTER and vehicle.lean_angle_deg is not None:
        slope = np.arctan2(d[:, 2], np.maximum(run, 1e-12))
        lean = leaning_m_s(vehicle.lean_angle_deg, slope, 0.5 * (p[1:, 2] + p[:-1, 2]))
        most = np.minimum(most, lean)
    if pace is not None:
        per_cruise = per_cruise * pace[..., keep[1:]]
    way = p[last] - p[first]
    level = np.where(cut, run / length, 1.0)
    way[several, 2] = 0.0
    part_m = length * level
    whole = np.bincount(number, weights=part_m)
    straight = np.linalg.norm(way, axis=1)
    way = np.where((straight > 0.0)[:, None], way, d[last - 1])
    way *= (whole / np.linalg.norm(way, axis=1))[:, None]
    begins, ends = (_unit(np.where(several[:, None], d[k] * _LEVEL, d[k]), way) for k in (first, last - 1))
    done = np.cumsum(part_m) - np.concatenate([[0.0], np.cumsum(whole)])[number]
    at = np.append(0.0, number + np.minimum(done / whole[number], 1.0))
    at[last] = number[last - 1] + 1.0
    return Curved(p, at, way, begins, ends, part_m, most * level, per_cruise * level, owner, vehicle, trails, rates)


def _unit(way: Floats, instead: Floats) -> Floats:
    """(L, 3) the directions of ``way``, or of ``instead`` where it has no length."""
    known = np.linalg.norm(way, axis=1) > _LEAST_CURVE_M
    course = np.where(known[:, None], way, instead)
    return np.asarray(course / np.linalg.norm(course, axis=1)[:, None])


def _summed(values: Floats, bins: Indices, count: int) -> Floats:
    """(..., ``count``) the sums of values (..., P) with the same number in ``bins`` (P,)."""
    rows = values.reshape(-1, values.shape[-1])
    found = [np.bincount(bins, weights=row, minlength=count) for row in rows]
    return np.reshape(found, (*values.shape[:-1], count)).astype(np.float64)


def _spread(begin: Floats, seconds: Floats, pieces: Indices) -> Floats:
    """The ends of ``pieces`` (N,) equal pieces of each of N spans, and their beginnings."""
    count = pieces + 1
    span = np.repeat(np.arange(len(begin)), count)
    step = np.arange(len(span)) - np.repeat(np.cumsum(count) - count, count)
    return begin[span] + seconds[span] * step / pieces[span]


def _steps(lag: Floats) -> Floats:
    """(2L,) the delay before and after each of L rises of it."""
    after = np.cumsum(lag)
    return np.column_stack([after - lag, after]).ravel()


def _overlaps(turns: _Turns) -> tuple[Floats, Floats]:
    """(T,) for how many seconds the leg before each turn is still flown when the next begins, and (T,) the speed in
    the middle of the turn."""
    found = turns.most_s.copy()
    excess = turns.excess(found)
    left = np.flatnonzero(excess > 0.0)
    if len(left):
        found[left] = _zero(turns.of(left).excess, found[left], excess[left])
    # Accelerations rise and fall again. The vehicle waits until all is right: the latest is the earliest in time.
    middle = turns.middle(found)
    if turns.gentle(middle).all():
        return found, turns.speed_m_s(middle)
    low, high = np.zeros_like(found), found
    for _ in range(_ROUNDS):
        low, high = _latest(low, high, lambda tried: turns.gentle(turns.middle(tried)))
    return low, turns.speed_m_s(turns.middle(low))


def _zero(excess: Callable[[Floats], Floats], high: Floats, above: Floats) -> Floats:
    """(T,) where an excess that rises from -1 at 0 to ``above`` at ``high`` is 0: regula falsi (Illinois)."""
    low, below = np.zeros_like(high), np.full_like(high, -1.0)
    before = np.zeros_like(high)
    for _ in range(_STEPS):
        tried = high - (high - low) * above / (above - below)
        now = excess(tried)
        if (np.abs(now) < _WITHIN).all():
            break
        over = now > 0.0
        kept_low, kept_high = np.where(before > 0.0, 0.5, 1.0), np.where(before < 0.0, 0.5, 1.0)
        low, below = np.where(over, low, tried), np.where(over, kept_low * below, np.minimum(now, -1e-12))
        high, above = np.where(over, tried, high), np.where(over, now, kept_high * above)
        before = np.where(over, 1.0, -1.0)
    return np.asarray(tried)


def _latest(low: Floats, high: Floats, allowed: Callable[[Floats], Bools]) -> tuple[Floats, Floats]:
    """(T,) the largest allowed of some values from ``low``, which is, to ``high``; and the next larger one."""
    tried = low + (high - low) * np.linspace(1.0, 0.0, _TRIED + 1)[:, None]
    first = allowed(tried).argmax(axis=0)
    turn = np.arange(len(low))
    return tried[first, turn], tried[np.maximum(first - 1, 0), turn]


@dataclass(frozen=True, eq=False, slots=True)
class _Turns:
    """T turns between two legs each: the curves of the legs before, then of the legs after (2T,), the legs' directions
    (T, 3), and the lower speed limit of both (T,)."""

    pairs: Curves
    into: Floats
    out: Floats
    slower_m_s: Floats
    vehicle: Vehicle

    @classmethod
    def between(
        cls, flown: Curves, courses: tuple[Floats, Floats], speed_m_s: Floats, vehicle: Vehicle, after: Indices
    ) -> _Turns:
        """The turns into the legs ``after`` (T,) of legs ``flown``, which may be as fast as ``speed_m_s`` (L,).

        ``courses``: the directions in which each leg ends and begins, (L, 3) each.
        """
        ends, begins = courses
        slower = np.minimum(speed_m_s[after - 1], speed_m_s[after])
        pairs = flown.of(np.concatenate([after - 1, after]))
        return cls(pairs, ends[after - 1], begins[after], slower, vehicle)

    def of(self, turns: Indices) -> _Turns:
        """The turns with these indices."""
        pairs = self.pairs.of(np.concatenate([turns, turns + len(self.slower_m_s)]))
        return _Turns(pairs, self.into[turns], self.out[turns], self.slower_m_s[turns], self.vehicle)

    @property
    def most_s(self) -> Floats:
        """(T,) the longest overlap: one leg brakes and the other speeds up all the time."""
        n = len(self.slower_m_s)
        return np.minimum(self.pairs.start_s[:n], self.pairs.start_s[n:])

    @property
    def _cosine(self) -> Floats:
        return np.asarray((self.into * self.out).sum(axis=1))

    def excess(self, overlap: Floats) -> Floats:
        """(T,) above 0 where the middle of a turn is too far from the way point, or too fast; it rises with the
        overlap, nearly evenly, because distances rise as its cube and speeds as its square."""
        (_, v, s), (_, w, r) = self.middle(overlap)
        far = np.sqrt(np.maximum(s * s + r * r - 2.0 * s * r * self._cosine, 0.0)) / CORNER_M
        fast = np.sqrt(np.maximum(v * v + w * w + 2.0 * v * w * self._cosine, 0.0)) / (self.slower_m_s * (1.0 + 1e-6))
        return np.asarray(np.maximum(np.cbrt(far), np.sqrt(fast)) - 1.0)

    def speed_m_s(self, middle: tuple[Begun, Begun]) -> Floats:
        """(..., T) the speed in the ``middle`` of each turn."""
        (_, v, _), (_, w, _) = middle
        return np.asarray(np.sqrt(np.maximum(v * v + w * w + 2.0 * v * w * self._cosine, 0.0)))

    def gentle(self, middle: tuple[Begun, Begun]) -> Bools:
        """(..., T) whether the accelerations in the ``middle`` of each turn are small enough."""
        (a, _, _), (b, _, _) = middle
        bend = b[..., None] * self.out - a[..., None] * self.into
        across = np.hypot(bend[..., 0], bend[..., 1]) < CORNER_ACCEL * self.vehicle.corner_accel_m_s2 * (1.0 + 1e-6)
        return np.asarray(across & (np.abs(bend[..., 2]) < self.vehicle.vertical_accel_m_s2 * (1.0 + 1e-6)))

    def middle(self, overlap: Floats) -> tuple[Begun, Begun]:
        """Acceleration, speed and metres of both legs, from the end of one and the start of the other, in the middle
        of overlaps (..., T)."""
        half = 0.5 * overlap
        a, v, s = self.pairs.begun(np.concatenate([half, half], axis=-1))
        n = len(self.slower_m_s)
        return (a[..., :n], v[..., :n], s[..., :n]), (a[..., n:], v[..., n:], s[..., n:])
