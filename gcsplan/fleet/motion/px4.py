"""The motion of a PX4 multicopter through way points: braking by distance, and speeds in corners by radius.

PX4 (PositionSmoothing.cpp, TrajectoryConstraints.hpp, TrajMath.hpp) flies towards a way point as fast as it can still
slow down to the speed of the corner there, and turns to the next leg within the acceptance radius R of the way point:

- in a corner of angle A at most √(c·R/tan(A/2)), with c = MPC_XY_TRAJ_P · MPC_ACC_HOR (`Vehicle.corner_accel_m_s2`),
  and no faster than it can stop within the next leg; it stops where that leg is shorter than R;
- d metres before a way point at most the v with v² + v·4a²/j = 2·a·d + w², where w is the speed of the corner, a is
  MPC_ACC_HOR (`accel_m_s2`) and j is MPC_JERK_AUTO (`leg_jerk_m_s3`);
- speeds follow these limits with at most a and j: the true speed is above the limit by D²/2j while it falls by D m/s².

The limits are of horizontal speeds and distances; a slope bounds the speed by the rates of climb and descent.
`tests/oracles/px4_smoothing.py` flies the same rules step by step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.vehicle import Vehicle

__all__ = ["Smoothed", "smoothed"]

ALIGNED = math.radians(11.5)
"""PX4 counts as turning until its course is within this of the direction to the way point, and does not speed up."""

TURN_SHARE = 0.8
"""Part of the time in which the speed can be turned, at most, that a turn takes (fitted to the oracle's)."""

STILL_M_S = 0.4
"""At the last way point it counts as standing below this speed: the limit falls to 0 without an end."""

LAW_NODES = 8
_ROUNDS = 40
_LEAST_M = 1e-6
_CHORDS = 4
_CRAWL_M_S = 0.05


@dataclass(frozen=True, eq=False, slots=True)
class Smoothed:
    """N legs between two standstills.

    ``path`` (K, 3) is the track in metres with its corners rounded, ``at`` (K,) the metres along it: horizontal ones,
    or vertical ones where it goes straight up or down. ``leg_m`` (N,) are the legs from way point to way point,
    ``begin_m`` (N,) where along the track each begins: in the middle of the corner before it. A corner turns by
    ``turn`` (N - 1,) radians, begins and ends ``cut_m`` (N - 1,) from its way point, and is ``arc_m`` (N - 1,) long; it
    is planned with a stop where ``stops`` (N - 1,). The speed on a leg is at most ``most_m_s`` (N,) and at most the
    cruise speed times ``per_cruise`` (N,). ``owner`` (N,) is the caller's number of each leg.
    """

    path: Floats
    at: Floats
    leg_m: Floats
    begin_m: Floats
    cut_m: Floats
    arc_m: Floats
    turn: Floats
    stops: Bools
    most_m_s: Floats
    per_cruise: Floats
    owner: Indices
    vehicle: Vehicle

    @property
    def start(self) -> Floats:
        """(K - 1, 3) where each piece of the track begins."""
        return self.path[:-1]

    def time_s(self, cruise_m_s: float) -> float:
        """Seconds for the stretch at a cruise speed."""
        return float(self.times(cruise_m_s)[2][-1])

    def shares_s(self, cruise_m_s: float, legs: int) -> Floats:
        """(``legs``,) the seconds of each leg, 0 to ``legs`` - 1 in ``owner``; together they are `time_s`."""
        s, v, t = self.times(cruise_m_s)
        ends = np.append(_clock(self.begin_m, s, v, t), t[-1])
        return np.bincount(self.owner, weights=np.diff(ends), minlength=legs).astype(np.float64)

    def motion(self, cruise_m_s: float, error_m: float) -> tuple[Floats, Floats, Indices]:
        """Times (M,) since the stretch began, places (M, 3) and legs (M,) at the end of each of M straight pieces.

        Straight motion at constant speed between them is at most ``error_m`` away from the true motion: with an
        acceleration A, a piece of t seconds differs by A·t²/8.
        """
        s, v, t = self.times(cruise_m_s)
        span, change = np.maximum(np.diff(t), 0.0), np.abs(np.diff(v))
        pieces = np.maximum(np.ceil(np.sqrt(change * span / (8.0 * error_m)) - 1e-9), 1).astype(np.intp)
        phase = np.repeat(np.arange(len(span)), pieces)
        step = np.arange(len(phase)) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 1
        tau = span[phase] * step / pieces[phase]
        rate = np.divide(np.diff(v), span, out=np.zeros_like(span), where=span > 0.0)
        gone = s[:-1][phase] + v[:-1][phase] * tau + 0.5 * rate[phase] * tau * tau
        along = np.unique(np.concatenate([np.minimum(gone, self.at[-1]), self.at[1:]]))
        times = _clock(along, s, v, t)
        keep = np.append(np.diff(times) > 1e-9, True) & (times > 1e-9)
        keep[-1] = True
        along, times = along[keep], times[keep]
        places = np.column_stack([np.interp(along, self.at, self.path[:, k]) for k in range(3)])
        leg = np.clip(np.searchsorted(self.begin_m, along - _LEAST_M, side="right") - 1, 0, len(self.leg_m) - 1)
        return times, places, self.owner[leg]

    def times(self, cruise_m_s: float) -> tuple[Floats, Floats, Floats]:
        """Metres along the track, speeds and times at nodes; between two of them the speed changes evenly in time."""
        s, v = self._nodes(cruise_m_s)
        s = np.maximum.accumulate(s)
        mean = 0.5 * (v[1:] + v[:-1])
        t = np.append(0.0, np.cumsum(np.diff(s) / np.maximum(mean, _CRAWL_M_S)))
        return s, v, t

    def _nodes(self, cruise_m_s: float) -> tuple[Floats, Floats]:
        """Metres along the track and speeds at the nodes of all legs, in order."""
        law = _Law(self.vehicle)
        top = np.maximum(np.minimum(self.most_m_s, cruise_m_s * self.per_cruise), _CRAWL_M_S)
        corner, base, slow = self._corners(law, top)
        first = np.append(0.0, slow[:-1])
        cut = np.append(self.cut_m, 0.0)
        switches = self._switch_m
        length = np.diff(switches)
        turning = np.minimum(np.append(0.0, slow[:-1] * law.turning_s(self.turn, slow[:-1])), 0.5 * length)
        leg = _Leg(law, first, top, length - turning, cut, corner, base, slow)
        left, left_m_s = leg.nodes()
        before, speeds = np.vstack([length, left]), np.vstack([first, left_m_s])
        return (switches[1:] - before).T.ravel(), speeds.T.ravel()

    @property
    def _switch_m(self) -> Floats:
        """(N + 1,) metres along the track at which each leg is taken up, an acceptance radius before its way point, and
        where the last one ends."""
        return np.concatenate([[0.0], self.begin_m[1:] - 0.5 * self.arc_m, self.at[-1:]])

    def _corners(self, law: _Law, top: Floats) -> tuple[Floats, Floats, Floats]:
        """For the end of each leg (N,): the speed of the corner, the `_Law`'s base for it, and the speed where the
        corner begins."""
        within = np.minimum(law.limit_m_s(self.leg_m[1:], 0.0), np.minimum(top[:-1], top[1:]))
        sharp = np.tan(np.minimum(0.5 * self.turn, 0.5 * math.pi - 1e-6))
        free = np.sqrt(self.vehicle.corner_accel_m_s2 * self.cut_m / np.maximum(sharp, 1e-9))
        corner = np.append(np.where(self.stops, 0.0, np.minimum(free, within)), STILL_M_S)
        base = corner**2
        base[-1] += law.lag_m_s * STILL_M_S  # it is nearly still at the last way point, not some distance before it
        reached = np.maximum(law.limit_m_s(np.append(self.cut_m, 0.0), base), corner)
        return corner, base, np.minimum(reached, top)


class _Law:
    """PX4's limit of the speed before a way point, and how the speed follows it."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.accel, self.jerk = vehicle.accel_m_s2, vehicle.leg_jerk_m_s3
        self.lag_m_s = 4.0 * self.accel**2 / self.jerk
        self.ease_s = self.accel / self.jerk
        self.ease_m_s = 0.5 * self.accel * self.ease_s
        """Change of speed while the acceleration rises to its most."""

    def limit_m_s(self, metres: Floats, base: Floats | float) -> Floats:
        """The highest speed at ``metres`` before a way point; ``base``: the square of the speed of the corner there."""
        b = self.lag_m_s
        return np.asarray(0.5 * (np.sqrt(b * b + 8.0 * self.accel * metres + 4.0 * base) - b))

    def distance_m(self, limit: Floats, base: Floats) -> Floats:
        """The distance before the way point at which ``limit`` is the limit."""
        return np.asarray((limit**2 + self.lag_m_s * limit - base) / (2.0 * self.accel))

    def before_m(self, speed: Floats, corner: Floats, base: Floats) -> Floats:
        """The distance before the way point at which a speed is flown that follows the limit."""
        fall = 2.0 * self.accel * speed / (2.0 * speed + self.lag_m_s)
        return self.distance_m(np.maximum(speed - fall**2 / (2.0 * self.jerk), corner), base)

    def ramp_m(self, low: Floats, high: Floats) -> Floats:
        """The length in which it speeds up, or down, from one speed to another."""
        change = np.abs(high - low)
        full = change / self.accel + self.ease_s
        seconds = np.where(change > self.accel * self.ease_s, full, 2.0 * np.sqrt(change / self.jerk))
        return np.asarray(0.5 * (low + high) * seconds)

    def ease_m(self, peak: Floats) -> Floats:
        """The length after a peak until it brakes with all its acceleration."""
        return np.maximum(peak - self.ease_m_s / 3.0, 0.0) * self.ease_s

    def turning_s(self, turn: Floats, speed: Floats) -> Floats:
        """Seconds for which it is slow in a corner: until its course is nearly the course of the next leg."""
        change = 2.0 * speed * np.sin(0.5 * np.maximum(turn - ALIGNED, 0.0))
        full = change / self.accel + self.ease_s
        return TURN_SHARE * np.where(change > self.accel * self.ease_s, full, 2.0 * np.sqrt(change / self.jerk))


@dataclass(frozen=True, eq=False, slots=True)
class _Leg:
    """How N legs are flown from where the speed rises, at ``first``, to ``left`` metres later, where it is ``slow``.

    ``cut`` metres after that is the way point, whose corner is flown at ``corner``; ``base``: see `_Law.limit_m_s`.
    """

    law: _Law
    first: Floats
    top: Floats
    left: Floats
    cut: Floats
    corner: Floats
    base: Floats
    slow: Floats

    def nodes(self) -> tuple[Floats, Floats]:
        """Nodes (M, N), metres before the end and speeds: the end of speeding up, of flying level, of easing into
        braking; then braking along the limit.

        If it still speeds up where the limit is below its speed, it brakes late and hard; if not, it flies at its top
        speed until the limit falls. Between the two it reaches each speed at a place between theirs.
        """
        law, peak, share = self.law, self._peak(), self._early_share()
        begins = np.maximum(np.minimum(law.distance_m(peak, self.base) - law.ease_m(peak), self._after_m(peak)), 0.0)
        fell = np.clip(peak - law.ease_m_s, self.slow, peak)
        hard_m = begins - law.ease_m(peak) - fell**2 / (2.0 * law.accel)  # where it would stand
        low, high = self.slow, fell
        for _ in range(_ROUNDS):  # where it meets the limit
            middle = 0.5 * (low + high)
            over = hard_m + middle**2 / (2.0 * law.accel) < law.before_m(middle, self.corner, self.base)
            low, high = np.where(over, low, middle), np.where(over, middle, high)
        down = np.vstack([peak, fell, np.linspace(low, self.slow, LAW_NODES + 1)])
        down = (1.0 - share) * down + share * np.vstack(
            [self.top, self.top, np.linspace(self.top, self.slow, LAW_NODES + 1)]
        )
        eased = law.ease_m(peak) * np.clip((peak**2 - down**2) / np.maximum(peak**2 - fell**2, _LEAST_M), 0.0, 1.0)
        limit = law.before_m(down, self.corner, self.base)
        late = np.minimum(np.where(down > fell, begins - eased, hard_m + down**2 / (2.0 * law.accel)), limit)
        whole = [self.left + self.cut, self._after_m(peak), *((1.0 - share) * late + share * limit), self.cut]
        before = np.clip(np.array(whole) - self.cut, 0.0, self.left)
        return np.minimum.accumulate(before, axis=0), np.array([self.first, peak, *down, self.slow])

    def _early_share(self) -> Floats:
        """(N,) from 0, it brakes late, to 1, it flies at its top speed until the limit falls."""
        law = self.law
        latest = law.distance_m(self.top, self.base) - law.ease_m(self.top)
        room = law.before_m(self.top, self.corner, self.base) - latest
        return np.clip((self._after_m(self.top) - latest) / np.maximum(room, _LEAST_M), 0.0, 1.0)

    def _after_m(self, peak: Floats) -> Floats:
        """Metres from where it has sped up to ``peak`` to the way point."""
        return self.left - self.law.ramp_m(self.first, peak) + self.cut

    def _peak(self) -> Floats:
        """The highest speed: that which it will reach when its acceleration has ended is the limit then."""
        law = self.law
        low, high = np.minimum(np.maximum(self.first, self.corner), self.top), self.top
        for _ in range(_ROUNDS):
            middle = 0.5 * (low + high)
            over = np.maximum(law.distance_m(middle, self.base) - law.ease_m(middle), 0.0) > self._after_m(middle)
            low, high = np.where(over, low, middle), np.where(over, middle, high)
        return high


def smoothed(
    points: Floats, vehicle: Vehicle, owner: Indices, pace: Floats | None = None, rates_m_s: Floats | None = None,
    radius_m: Floats | None = None,
) -> Smoothed | None:  # fmt: skip
    """The stretch through ``points`` (N + 1, 3) without a stop; None if nothing moves.

    ``owner`` (N,) numbers the legs. ``pace`` (N,) is the speed that results from a cruise speed of 1, if that is not 1.
    ``rates_m_s`` (N, 2) are the rates of climb and descent on each leg, ``radius_m`` (N,) the acceptance radius at its
    end, if they are not the vehicle's own.
    """
    keep = np.append(True, np.linalg.norm(np.diff(points, axis=0), axis=1) > _LEAST_M)
    p, owner = points[keep], owner[keep[1:]]
    if len(p) < 2:
        return None
    d = np.diff(p, axis=0)
    run, rise = np.hypot(d[:, 0], d[:, 1]), np.abs(d[:, 2])
    upright = run <= 1e-3 * rise
    rates = np.array([[vehicle.climb_m_s, vehicle.descent_m_s]]) if rates_m_s is None else rates_m_s[keep[1:]]
    rate = np.where(d[:, 2] >= 0.0, rates[:, 0], rates[:, 1])
    level = np.where(upright, 1.0, run / np.maximum(rise, 1e-12))
    most = np.where(rise > 0.0, rate * level, math.inf)
    per_cruise = np.ones(len(d)) if pace is None else pace[keep[1:]].astype(np.float64)
    leg_m = np.where(upright, rise, run)
    unit = d / leg_m[:, None]
    heading = np.arctan2(d[:, 1], d[:, 0])
    turn = np.abs((np.diff(heading) + math.pi) % (2.0 * math.pi) - math.pi)
    stands = upright[:-1] | upright[1:]
    turn = np.where(stands, np.arccos(np.clip((unit[:-1] * unit[1:]).sum(axis=1), -1.0, 1.0)), turn)
    radius = np.full(len(d), vehicle.acceptance_m) if radius_m is None else radius_m[keep[1:]]
    stops = stands | (leg_m[1:] < radius[:-1])
    cut = np.minimum(radius[:-1], 0.5 * np.minimum(leg_m[:-1], leg_m[1:]))
    path, at, middle, arc = _rounded(p, leg_m, cut, turn, stands)
    begin = np.append(0.0, middle)
    return Smoothed(path, at, leg_m, begin, cut, arc, turn, stops, most, per_cruise, owner, vehicle)


def _rounded(
    p: Floats, leg_m: Floats, cut: Floats, turn: Floats, stands: Bools
) -> tuple[Floats, Floats, Floats, Floats]:
    """The track through ``p`` with rounded corners as chords, the metres along it, the metres at each corner's middle,
    and the corners' lengths."""
    share = np.linspace(0.0, 1.0, _CHORDS + 1)[:, None, None]
    unit = np.diff(p, axis=0) / leg_m[:, None]
    a, b = p[1:-1] - unit[:-1] * cut[:, None], p[1:-1] + unit[1:] * cut[:, None]
    # A parabola that touches both legs; for a sharp turn it is drawn to its chord, as far as an arc would be.
    bulge = np.cos(0.5 * turn)[:, None]
    bulge = 2.0 * bulge / (1.0 + bulge)
    tip = bulge * p[1:-1] + (1.0 - bulge) * 0.5 * (a + b)
    bend = (1.0 - share) ** 2 * a + 2.0 * share * (1.0 - share) * tip + share**2 * b
    chord = np.diff(bend, axis=0)
    chord_m = np.where(stands, np.linalg.norm(chord, axis=2), np.hypot(chord[..., 0], chord[..., 1]))
    arc = chord_m.sum(axis=0)
    straight = np.maximum(leg_m - np.append(0.0, cut) - np.append(cut, 0.0), 0.0)
    ends = np.cumsum(straight[:-1] + np.append(0.0, arc[:-1])) if len(arc) else arc
    at = (ends + np.vstack([np.zeros_like(arc), np.cumsum(chord_m, axis=0)])).T.ravel()
    last = straight[-1] + (ends[-1] + arc[-1] if len(arc) else 0.0)
    path = np.vstack([p[:1], bend.transpose(1, 0, 2).reshape(-1, 3), p[-1:]])
    along = np.concatenate([[0.0], at, [last]])
    keep = np.append(True, np.diff(along) > 1e-9)
    keep[-1] = True
    return path[keep], along[keep], ends + 0.5 * arc, arc


def _clock(along: Floats, s: Floats, v: Floats, t: Floats) -> Floats:
    """The times at which ``along`` (M,) metres are passed; ``s``, ``v``, ``t``: see `Smoothed.times`."""
    k = np.clip(np.searchsorted(s, along, side="left") - 1, 0, len(s) - 2)
    long, span = s[k + 1] - s[k], t[k + 1] - t[k]
    gone = np.clip(along - s[k], 0.0, long)
    square = v[k] ** 2 + (v[k + 1] ** 2 - v[k] ** 2) * np.divide(gone, long, out=np.zeros_like(gone), where=long > 0.0)
    mean = np.maximum(0.5 * (v[k] + np.sqrt(np.maximum(square, 0.0))), _CRAWL_M_S)
    return t[k] + np.minimum(gone / mean, span)
