"""The speed of a vehicle at each point of one stretch of its path, from a standstill to the next.

The speed along the path is the largest that keeps four limits: the cruise speed horizontally, the climb and descent
rates, the corner's acceleration in turns, and one acceleration to reach it and to brake from it: with ``u = v²`` and
``s`` metres along the path, ``|du/ds| <= 2a``. The largest such profile at the nodes is ``u_i = min_j(cap_j² +
2a·|s_i - s_j|)``: two running minima, no loop (for the two passes over the speed limits see Bobrow, Dubowsky and Gibson
1985, "Time-optimal control of robotic manipulators along specified paths").
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.vehicle import Vehicle

CUT_M = 2.0
"""Distance between a way point and its rounded corner, m: 1 to 2 m were measured on a real ArduCopter at 10 m/s."""

POSITION_ERROR_M = 0.25
"""Largest distance, m, of the straight pieces at constant speed from the curved, accelerated motion they replace."""

_LEAST_RADIUS_M = 1e-9
_LEAST_LENGTH_M = 1e-9
_LEAST_TURN = 1e-7  # radians


@dataclass(frozen=True, eq=False, slots=True)
class Segments:
    """Segments between two standstills: straight ones and the arcs of rounded corners.

    ``start``, ``end`` are (S, 3) metres; ``length_m`` (S,) is along the path. The speed along a segment is at most
    ``most_m_s`` (S,) and at most the cruise speed times ``per_cruise`` (S,). Arcs have ``radius_m`` > 0 (S,) and turn
    by ``turn`` (S,) radians, left positive, from ``heading`` (S,), anticlockwise from east. ``owner`` (S,) is the
    caller's number of the leg. ``accel_m_s2`` may be inf. With ``stops`` False it ends at speed (a touch-down).
    """

    start: Floats
    end: Floats
    length_m: Floats
    most_m_s: Floats
    per_cruise: Floats
    radius_m: Floats
    turn: Floats
    heading: Floats
    owner: Indices
    accel_m_s2: float
    stops: bool = True

    def _profile(self, cruise_m_s: float) -> tuple[Floats, Floats]:
        """Speed caps (S,) of the segments, and squared speeds (S + 1,) at the nodes (meaningless if accel is inf)."""
        cap = np.minimum(self.most_m_s, cruise_m_s * self.per_cruise)
        node = np.empty(len(cap) + 1)
        node[0] = 0.0
        np.minimum(cap[:-1], cap[1:], out=node[1:-1])
        node[-1] = 0.0 if self.stops else cap[-1]
        if math.isinf(self.accel_m_s2):
            return cap, node
        node *= node
        gain = np.empty_like(node)
        gain[0] = 0.0
        np.cumsum(self.length_m, out=gain[1:])
        gain *= 2.0 * self.accel_m_s2
        node = np.minimum.accumulate(node - gain) + gain
        node = np.minimum.accumulate((node + gain)[::-1])[::-1] - gain
        return cap, np.maximum(node, 0.0)

    def _phases(self, cruise_m_s: float) -> tuple[Floats, Floats, Floats, Floats]:
        """Speeds at entry, peak and exit of each segment (S,); seconds (3, S) of acceleration, cruise and braking."""
        cap, u = self._profile(cruise_m_s)
        if math.isinf(self.accel_m_s2):
            nothing = np.zeros_like(cap)
            return cap, cap, cap, np.stack([nothing, self.length_m / cap, nothing])
        a = self.accel_m_s2
        peak = np.minimum(cap * cap, 0.5 * (u[:-1] + u[1:]) + a * self.length_m)
        peak = np.maximum(peak, np.maximum(u[:-1], u[1:]))
        level_m = np.maximum(self.length_m - (2.0 * peak - u[:-1] - u[1:]) / (2.0 * a), 0.0)
        v, top = np.sqrt(u), np.sqrt(peak)
        return v[:-1], top, v[1:], np.stack([(top - v[:-1]) / a, level_m / top, (top - v[1:]) / a])

    def time_s(self, cruise_m_s: float) -> float:
        """Seconds for the stretch at a cruise speed; never rises with the speed."""
        return float(self._phases(cruise_m_s)[3].sum())

    def shares_s(self, cruise_m_s: float, legs: int) -> Floats:
        """(``legs``,) the seconds of each leg, 0 to ``legs`` - 1 in ``owner``; together they are `time_s`.

        Each half of a corner belongs to its own leg.
        """
        seconds = self._phases(cruise_m_s)[3].sum(axis=0)
        shares: Floats = np.bincount(self.owner, weights=seconds, minlength=legs).astype(np.float64)
        return shares

    def motion(self, cruise_m_s: float, error_m: float = POSITION_ERROR_M) -> tuple[Floats, Floats, Indices]:
        """Times (M,) since the stretch began, places (M, 3) and legs (M,) at the end of each of M straight pieces.

        Straight motion at constant speed between them is at most ``error_m`` away from the true motion: with
        accelerations up to A, a piece of t seconds differs by A·t²/8.
        """
        entry, peak, leave, seconds = self._phases(cruise_m_s)
        slope = np.hypot(1.0, (self.end[:, 2] - self.start[:, 2]) / np.maximum(self._run_m(), 1e-300))
        arc = self.radius_m > 0.0
        inward = np.where(arc, (peak / slope) ** 2 / np.maximum(self.radius_m, _LEAST_RADIUS_M), 0.0)
        along = 0.0 if math.isinf(self.accel_m_s2) else self.accel_m_s2
        bend = np.stack([np.hypot(along, inward), inward, np.hypot(along, inward)])
        pieces = np.where(seconds > 0.0, np.maximum(np.ceil(seconds * np.sqrt(bend / (8.0 * error_m)) - 1e-9), 1), 0)
        count = pieces.T.astype(np.intp).ravel()  # segment by segment, phase by phase

        phase = np.repeat(np.arange(len(count)), count)
        step = np.arange(len(phase)) - np.repeat(np.cumsum(count) - count, count) + 1
        whole = seconds.T.ravel()
        tau = whole[phase] * (step / count[phase])
        from_s = np.concatenate([[0.0], np.cumsum(whole)])[:-1][phase]
        rise = np.array([along, 0.0, -along])[phase % 3]
        begin = np.stack([entry, peak, peak]).T.ravel()[phase]
        if math.isinf(self.accel_m_s2):
            covered = np.zeros((3, len(peak)))
            covered[2] = self.length_m
        else:
            covered = np.cumsum(np.stack([0.5 * (entry + peak), peak, 0.5 * (peak + leave)]) * seconds, axis=0)
        before = np.vstack([np.zeros(len(peak)), covered[:2]]).T.ravel()[phase]
        segment = phase // 3
        done = before + begin * tau + 0.5 * rise * tau * tau
        share = np.clip(done / self.length_m[segment], 0.0, 1.0)
        last = np.flatnonzero(np.append(segment[1:] != segment[:-1], True))
        share[last] = 1.0
        return from_s + tau, self._places(segment, share), self.owner[segment]

    def _run_m(self) -> Floats:
        straight = np.hypot(self.end[:, 0] - self.start[:, 0], self.end[:, 1] - self.start[:, 1])
        return np.where(self.radius_m > 0.0, self.radius_m * np.abs(self.turn), straight)

    def _places(self, segment: Indices, share: Floats) -> Floats:
        """(M, 3) points at the part ``share`` of ``segment``."""
        start, end = self.start[segment], self.end[segment]
        places = start + (end - start) * share[:, None]
        arc = np.flatnonzero((self.radius_m[segment] > 0.0) & (share < 1.0))
        s = segment[arc]
        # The chord of a part of the arc: its length, and its direction, which is half the turned angle from the
        # heading.
        part = self.turn[s] * share[arc]
        chord = 2.0 * self.radius_m[s] * np.sin(0.5 * np.abs(part))
        course = self.heading[s] + 0.5 * part
        places[arc, 0] = start[arc, 0] + chord * np.cos(course)
        places[arc, 1] = start[arc, 1] + chord * np.sin(course)
        return places


def rounded(
    points: Floats, vehicle: Vehicle, owner: Indices, pace: Floats | None = None, rates_m_s: Floats | None = None
) -> Segments | None:
    """The stretch through ``points`` (N, 3) without a stop, its corners rounded; None if nothing moves.

    ``owner`` (N - 1,) numbers the legs. With a corner acceleration of inf, corners are sharp. In the middle of a corner
    the vehicle has the way point's altitude, because the tangents of nearly straight tracks are half a leg long.
    ``pace`` (N - 1,) is the speed that results from a cruise speed of 1, if that is not 1. ``rates_m_s`` (N - 1, 2) are
    the rates of climb and descent on each leg, if they are not the vehicle's own.
    """
    whole = np.linalg.norm(np.diff(points, axis=0), axis=1)
    keep = np.append(True, whole > _LEAST_LENGTH_M)
    p, owner = points[keep], owner[keep[1:]]
    if len(p) < 2:
        return None
    d = np.diff(p, axis=0)
    run = np.hypot(d[:, 0], d[:, 1])
    n = len(d)
    heading = np.arctan2(d[:, 1], d[:, 0])
    back, turn, radius = _corners(heading, run, vehicle.corner_accel_m_s2)
    share = np.where(run > _LEAST_LENGTH_M, 1.0 / np.maximum(run, _LEAST_LENGTH_M), 0.0)
    leave = p[:-1] + d * (back[:-1] * share)[:, None]
    reach = p[1:] - d * (back[1:] * share)[:, None]
    # Leg, corner, corner, leg, …, leg: each half of a corner belongs to its own leg, in slope and in speed.
    size = 3 * n - 2
    bend, round_m = turn[1:-1], radius[1:-1]
    middle = reach[:-1].copy()
    chord, course = 2.0 * round_m * np.sin(0.25 * np.abs(bend)), heading[:-1] + 0.25 * bend
    middle[:, 0] += chord * np.cos(course)
    middle[:, 1] += chord * np.sin(course)
    middle[:, 2] = p[1:-1, 2]
    start, end = np.empty((size, 3)), np.empty((size, 3))
    start[0::3], end[0::3] = leave, reach
    start[1::3], end[1::3], start[2::3], end[2::3] = reach[:-1], middle, middle, leave[1:]
    arc_m, arc_turn, towards = np.zeros(size), np.zeros(size), np.zeros(size)
    arc_m[1::3] = arc_m[2::3] = round_m
    arc_turn[1::3] = arc_turn[2::3] = 0.5 * bend
    towards[1::3], towards[2::3] = heading[:-1], heading[:-1] + 0.5 * bend
    leg = np.empty(size, dtype=np.intp)
    leg[0::3], leg[1::3], leg[2::3] = np.arange(n), np.arange(n - 1), np.arange(1, n)
    owners = owner[leg]
    run_m = arc_m * np.abs(arc_turn)
    run_m[0::3] = np.maximum(run - back[:-1] - back[1:], 0.0)
    rise_m = end[:, 2] - start[:, 2]
    length = np.hypot(run_m, rise_m)
    there = arc_m > 0.0
    there[0::3] = length[0::3] > _LEAST_LENGTH_M
    rates = np.array([[vehicle.climb_m_s, vehicle.descent_m_s]]) if rates_m_s is None else rates_m_s[keep[1:]][leg]
    most, per_cruise = bounds(length, run_m, rise_m, rates)
    if pace is not None:
        per_cruise *= pace[keep[1:]][leg]
    arc = arc_m > 0.0
    bend_most = np.sqrt(vehicle.corner_accel_m_s2 * arc_m[arc]) * (length[arc] / run_m[arc])
    most[arc] = np.minimum(most[arc], bend_most)
    return Segments(
        start[there], end[there], length[there], most[there], per_cruise[there], arc_m[there], arc_turn[there],
        towards[there], owners[there], vehicle.accel_m_s2,
    )  # fmt: skip


def _corners(heading: Floats, run: Floats, corner_accel_m_s2: float) -> tuple[Floats, Floats, Floats]:
    """Tangent length, turn and radius (N,) of the corner at each point, for legs of ``heading`` and ``run`` (N - 1,).

    All are 0 at the ends, and where the path goes straight on, up or down.
    """
    n = len(run)
    back, turn, radius = np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1)
    if n < 2 or math.isinf(corner_accel_m_s2):
        return back, turn, radius
    bend = (np.diff(heading) + math.pi) % (2.0 * math.pi) - math.pi
    shorter = np.minimum(run[:-1], run[1:])
    turns = (shorter > _LEAST_LENGTH_M) & (np.abs(bend) >= _LEAST_TURN)
    half = 0.5 * np.abs(bend[turns])
    # R = cut/(1/cos - 1) and R·tan(half), in a form that also has a value for a turn back (half = 90 degrees).
    tangent = np.minimum(CUT_M / np.tan(0.5 * half), 0.5 * shorter[turns])
    at = np.flatnonzero(turns) + 1
    back[at], turn[at], radius[at] = tangent, bend[turns], np.maximum(tangent / np.tan(half), _LEAST_RADIUS_M)
    return back, turn, radius


def column(
    heights_m: Floats, most_m_s: Floats, place: Floats, vehicle: Vehicle, owner: int, *, stops: bool
) -> Segments:
    """A vertical stretch over ``place`` (2,) through ``heights_m`` (S + 1,) amsl, at most ``most_m_s`` (S,).

    A speed of inf means the cruise speed.
    """
    n = len(most_m_s)
    start, end = np.empty((n, 3)), np.empty((n, 3))
    start[:, :2] = end[:, :2] = place
    start[:, 2], end[:, 2] = heights_m[:-1], heights_m[1:]
    none = np.zeros(n)
    per_cruise = np.where(np.isinf(most_m_s), 1.0, math.inf)
    return Segments(
        start, end, np.abs(np.diff(heights_m)), most_m_s, per_cruise, none, none, none,
        np.full(n, owner, dtype=np.intp), vehicle.vertical_accel_m_s2, stops,
    )  # fmt: skip


def bounds(length: Floats, run: Floats, rise: Floats, rates_m_s: Floats) -> tuple[Floats, Floats]:
    """Largest speed along each segment by climb and descent rates, and its ratio to the cruise speed."""
    rate = np.where(rise >= 0.0, rates_m_s[:, 0], rates_m_s[:, 1])
    in_space = np.isinf(rate)
    with np.errstate(divide="ignore", invalid="ignore"):
        most = np.where(in_space | (rise == 0.0), math.inf, rate * length / np.abs(rise))
        per_cruise = np.where(in_space, 1.0, np.where(run > 0.0, length / run, math.inf))
    return most, per_cruise
