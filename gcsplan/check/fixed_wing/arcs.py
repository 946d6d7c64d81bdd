"""Corners as a fixed wing flies them: arcs that touch both legs replace the corners of a flight's straight stretches.

What is assumed of ArduPlane (commands_logic.cpp, `verify_nav_wp`; AP_L1_Control.cpp; altitude.cpp):

- A way point counts as reached at its own acceptance radius (param2), else at `turn_distance`: the smaller of
  WP_RADIUS and the L1 distance, times turn/90°. There the turn begins, on an arc of ``turn_radius_m``.
- If that is not the tangent length of the corner, the arc moves along the leg before it by the difference, and the leg
  after it moves to the side by the difference times the turn's sine: both legs are widened by that, the leg after it
  until the aircraft is back on it (`SETTLES_S`).
- The aircraft leaves the arc, in calm air too (`tracking_m`): the excess over ``track_error_m`` widens both legs, too.
  In declared winds the worst of them counts, and the bank that the arc needs with that wind behind.
- Altitude changes evenly along what is flown, from the middle of one arc to the middle of the next. ArduPlane instead
  computes it along the straight line between way points, and aims at the altitude of the way point once a turn begins:
  all altitudes between these are judged too (``Flight.instead``).
- After a circle a leg may begin anywhere on it.

Corners whose arcs do not fit between their way points are reported as not judged, and left sharp.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.fixed_wing.ends import climbed
from gcsplan.check.motion.circles import bank_of_deg, circle_growth, tracking_m, true_m_s
from gcsplan.check.motion.stretch import SAME_PLACE_M, Flight, Place, Stretch, flat_m
from gcsplan.check.motion.turn_parameters import DEFAULTS, Tuning
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.geodesy.frame import Frame

__all__ = ["SAG_M", "bend", "tangent_m"]


SAG_M = 0.2
"""How far an arc may lie outside its chords, m; the chords are widened by that."""

FIT_M = 0.25
"""Arcs of neighbouring corners may overlap by this, m: rounding on the wire moves arcs that just touch."""

LEAST_TURN = math.radians(0.02)
ABOUT = math.radians(170.0)
"""Below `LEAST_TURN` a leg continues straight; above `ABOUT` it turns back, on an arc begun far before its end."""

MOST_BANK_DEG = 45.0
"""Default of ArduPlane's ROLL_LIMIT_DEG."""

SETTLES_S, REMAINS = 15.0, 0.03
"""An aircraft that is some metres off a straight leg is back on it, but for this part, after this many seconds
(NAVL1_PERIOD 17) and as many metres as it was off: the L1 law simulated, with NAVL1_DAMPING from 0.6 to 1."""

L1_PERIODS_S = (1.0, 60.0)
"""ArduPlane's range for NAVL1_PERIOD, s; it also bounds the simulation of a turn in `tracking_m`."""


def tangent_m(radius_m: float, turn_rad: float) -> float:
    """How far before its corner an arc begins, m."""
    return radius_m * math.tan(0.5 * abs(turn_rad))


def bend(flight: Flight, mission: Mission, vehicle: Vehicle, frame: Frame, tuning: Tuning = DEFAULTS) -> None:
    """Replace the corners of ``flight`` by arcs of the vehicle's turn radius, in place.

    ``mission`` is the mission that is followed, as stored. Each stretch is replaced by the chords of the second half of
    the arc before it, its remaining straight part, and the chords of the first half of the arc after it, all with its
    item number.
    """
    radius = vehicle.turn_radius_m
    if mission.autopilot is not Autopilot.ARDUPLANE:
        flight.not_judged.append(
            Note("arcs_unread", radius_m=radius, vehicle=vehicle.name, autopilot=mission.autopilot.value)
        )
        return
    least_s, most_s = L1_PERIODS_S
    if not least_s <= tuning.l1_period_s <= most_s:
        period_s = tuning.l1_period_s
        flight.not_judged.append(Note("l1_period_out_of_range", period_s=period_s, least_s=least_s, most_s=most_s))
        return
    fastest = max((s.speed_m_s for s in flight.stretches), default=0.0) + vehicle.wind_m_s
    bank_deg = bank_of_deg(radius, fastest)
    if bank_deg > MOST_BANK_DEG:
        flight.not_judged.append(
            Note("arcs_too_banked", radius_m=radius, speed_m_s=fastest, bank_deg=bank_deg, most_deg=MOST_BANK_DEG)
        )
    bent, other = [], list(flight.instead)
    new: list[Stretch] = []
    flight.not_judged += [
        Note("turns_late", k, past_m=float(item.params[2]))
        for k, item in enumerate(mission.items, mission.first_seq)
        if item.command == cmd.WAYPOINT and item.params[2] >= 1.0
    ]
    wander_m = 0.0
    for first, last in _runs(flight.stretches):
        run = flight.stretches[first:last]
        if not _moves(run[0]):
            bent += run
            continue
        before = flight.stretches[first - 1] if first else None
        behind = before.reach_m if before is not None and not _moves(before) else 0.0
        legs = _Run(run, mission, vehicle, frame, flight, behind, tuning)
        wander_m = max(wander_m, legs.wander_m)
        bent += [piece for k in range(len(run)) for piece in legs.flown(k)]
        for k, s in enumerate(run):
            banded = [i for i in other if _same_way(i, s)]
            for i in banded:
                other.remove(i)
            new += [piece for band in banded for piece in legs.banded(k, band)] if banded else legs.instead(k)
    flight.stretches[:] = climbed(bent, vehicle)
    flight.instead[:] = other + new
    error_m = vehicle.limits.track_error_m
    off = None
    if wander_m > 0.0:
        wider = wander_m > error_m
        off = Note("turns_off_arcs", period_s=tuning.l1_period_s, wander_m=wander_m, wider=wider)
    note = Note(
        "turns_as_arcs", radius_m=radius, error_m=error_m, bank_deg=bank_deg, speed_m_s=round(fastest, 1), off=off
    )
    if note not in flight.notes:
        flight.notes.append(note)


@dataclass(frozen=True, slots=True)
class _Corner:
    """One corner. ``turn``: radians, left positive; 0 if it is left sharp.

    ``tangent``: tangent length of its arc, m; ``off_m``: how far the arc may lie elsewhere; ``begins_m``: how far
    before the way point the turn begins.
    """

    turn: float = 0.0
    tangent: float = 0.0
    off_m: float = 0.0
    begins_m: float = 0.0


class _Run:
    """Straight stretches that are flown one after the other without a stop, in the plane."""

    def __init__(
        self, run: Sequence[Stretch], mission: Mission, vehicle: Vehicle, frame: Frame, flight: Flight, behind_m: float,
        tuning: Tuning,
    ) -> None:  # fmt: skip
        self.tuning = tuning
        self.run, self.frame, self.radius, self.wind_m_s = run, frame, vehicle.turn_radius_m, vehicle.wind_m_s
        self.error_m, self.wander_m = vehicle.limits.track_error_m, 0.0
        places = np.array([run[0].start, *(s.end for s in run)])
        self.points = np.column_stack([frame.to_plane(places[:, 0], places[:, 1]), places[:, 2]])
        way = np.diff(self.points[:, :2], axis=0)
        self.long_m = np.hypot(*way.T)
        self.heading = np.arctan2(way[:, 1], way[:, 0])
        self.behind_m = behind_m
        self.corners = self._corners(mission, flight)
        half = np.array([0.5 * self.radius * abs(c.turn) for c in self.corners])
        tangent = np.array([c.tangent for c in self.corners])
        self.straight_m = self.long_m - tangent[:-1] - tangent[1:]
        # Arcs may overlap by `FIT_M`: the aircraft then flies less than both arcs and still climbs the whole altitude.
        self.flown_m = half[:-1] + self.straight_m + half[1:]
        self.half_m = half

    def _corners(self, mission: Mission, flight: Flight) -> list[_Corner]:
        turns = (np.diff(self.heading) + math.pi) % (2.0 * math.pi) - math.pi
        found = [_Corner()]
        for k, turn in enumerate(turns.tolist()):
            s, after = self.run[k], self.run[k + 1]
            if abs(turn) < LEAST_TURN:
                found.append(_Corner())
                continue
            if s.terrain or after.terrain or abs(turn) > ABOUT:
                flight.not_judged.append(
                    Note("corner_in_terrain_frame", s.seq)
                    if abs(turn) <= ABOUT
                    else Note("corner_turns_back", s.seq, turn_deg=math.degrees(abs(turn)))
                )
                found.append(_Corner())
                continue
            tangent = tangent_m(self.radius, turn)
            begins = self._begins_m(mission, s, abs(turn), flight)
            early_m, late_m = (abs(b - tangent) for b in begins)
            wander_m = tracking_m(self.radius, turn, true_m_s(s), self.tuning, self.wind_m_s)
            self.wander_m = max(self.wander_m, wander_m)
            off_m = max(early_m, late_m) * math.sin(min(abs(turn), 0.5 * math.pi))
            off_m += max(0.0, wander_m - self.error_m)
            found.append(_Corner(turn, tangent, off_m, max(begins)))
        found.append(_Corner())
        for k, s in enumerate(self.run):
            a, b = found[k], found[k + 1]
            if max(a.tangent + b.tangent, b.begins_m) <= self.long_m[k] + FIT_M:
                continue
            seq, leg_m, arcs_m = self.run[max(k - 1, 0)].seq, float(self.long_m[k]), a.tangent + b.tangent
            flight.not_judged.append(
                Note("arcs_too_long", seq, radius_m=self.radius, arcs_m=arcs_m, leg=s.seq, leg_m=leg_m)
                if arcs_m > leg_m + FIT_M
                else Note("turn_too_early", seq, begins_m=b.begins_m, leg=s.seq, leg_m=leg_m)
            )
            # Left sharp, so that the rest can be judged.
            found[k], found[k + 1] = _Corner(off_m=a.off_m), _Corner(off_m=b.off_m)
        for k in range(len(self.run) - 1):  # on a leg too short to settle, the offset remains at the next turn
            straight_m = self.long_m[k] - found[k].tangent - found[k + 1].tangent
            if straight_m < self._settles_m(k, found[k].off_m):
                found[k + 1] = replace(found[k + 1], off_m=found[k + 1].off_m + found[k].off_m)
        return found

    def _begins_m(self, mission: Mission, s: Stretch, turn: float, flight: Flight) -> tuple[float, float]:
        """How far before the end of ``s`` the turn after it begins, m: at least and at most."""
        item = _item(mission, s.seq)
        if item is None or item.command != cmd.WAYPOINT:
            return 0.0, 0.0  # a take-off ends where its height is reached, not before
        if math.isfinite(item.params[1]) and item.params[1] > 0.0:
            return item.params[1], item.params[1]
        tuning = self.tuning
        note = Note(
            "arc_begun_by_default", s.seq, radius_m=tuning.plane_radius_m, radius_read="WP_RADIUS" in tuning.read,
            period_s=tuning.l1_period_s, period_read="NAVL1_PERIOD" in tuning.read,
        )  # fmt: skip
        if note not in flight.notes:
            flight.notes.append(note)
        thin = circle_growth(max(s.start[2], s.end[2]))  # WP_RADIUS grows with altitude as circles do
        least = self.tuning.plane_turns_m(max(s.speed_m_s - self.wind_m_s, 0.0), turn)
        return least, self.tuning.plane_turns_m(s.speed_m_s * math.sqrt(thin) + self.wind_m_s, turn, thin)

    def _widen_m(self, k: int, *, settled: bool = False) -> float:
        """How much a leg is widened, m: for a turn before it until it ``settled``, and for a circle at its start."""
        return (REMAINS if settled else 1.0) * self.corners[k].off_m + (self.behind_m if k == 0 else 0.0)

    def _settles_m(self, k: int, off_m: float) -> float:
        """After how many metres of its straight part an aircraft that begins leg ``k`` ``off_m`` off is back on it."""
        over_ground = true_m_s(self.run[k]) + self.wind_m_s
        return SETTLES_S * self.tuning.l1_slower * over_ground + off_m if off_m > 0.0 else 0.0

    def _track(self, k: int) -> list[tuple[Floats, float, float]]:
        """Leg ``k`` as flown: (east and north, metres flown, how far the piece up to there may lie elsewhere)."""
        a, b, heading = self.corners[k], self.corners[k + 1], float(self.heading[k])
        along = np.array([math.cos(heading), math.sin(heading)])
        leaves = self.points[k, :2] + a.tangent * along
        reaches = self.points[k + 1, :2] - b.tangent * along
        # The arc that ends here, backwards: on the opposite heading it turns to the other side.
        behind, sag = self._half_arc(leaves, heading + math.pi, -a.turn)
        n = len(behind) - 1
        off = a.off_m + sag
        track = [(p, self.half_m[k] * (n - i) / max(n, 1), off) for i, p in reversed(list(enumerate(behind)))]
        done = float(self.half_m[k]) + max(float(self.straight_m[k]), 0.0)
        if settled := (settled_m := self._settles_m(k, a.off_m)) < self.straight_m[k]:
            track.append((leaves + settled_m * along, float(self.half_m[k]) + settled_m, self._widen_m(k)))
        track.append((reaches, done, self._widen_m(k, settled=settled)))
        ahead, sag = self._half_arc(reaches, heading, b.turn)
        n = len(ahead) - 1
        off = b.off_m + sag + (self.behind_m if k == 0 else 0.0)
        track += [(p, done + self.half_m[k + 1] * i / n, off) for i, p in enumerate(ahead) if i]
        return track

    def _half_arc(self, start: Floats, heading: float, turn: float) -> tuple[list[Floats], float]:
        """The ends of the chords of the first half of an arc, and how far it lies outside them, m."""
        if not turn:
            return [start], 0.0
        n = self._parts(turn)
        points = [start + _chord(self.radius, heading, 0.5 * turn * i / n) for i in range(n + 1)]
        return points, self.radius * (1.0 - math.cos(0.25 * abs(turn) / n))

    def _parts(self, turn: float) -> int:
        step = 2.0 * math.acos(max(1.0 - SAG_M / self.radius, 0.0))
        return max(1, math.ceil(0.5 * abs(turn) / step))

    def flown(self, k: int) -> Iterator[Stretch]:
        """Leg ``k`` with altitude changing evenly along what is flown."""
        z0, z1 = self.points[k, 2], self.points[k + 1, 2]
        whole = max(float(self.flown_m[k]), 1e-9)
        track = [(p, z0 + (z1 - z0) * min(s / whole, 1.0), off) for p, s, off in self._track(k)]
        yield from self._pieces(k, track)

    def _pieces(self, k: int, track: list[tuple[Floats, float, float]]) -> Iterator[Stretch]:
        s = self.run[k]
        if s.terrain:
            yield replace(s, reach_m=s.reach_m + self._widen_m(k))
            return
        kept = [track[0]]
        for one in track[1:]:
            if math.dist(one[0], kept[-1][0]) > SAME_PLACE_M:
                kept.append(one)
        if len(kept) == 1:
            kept.append(track[-1])
        places = [self._place(p, z) for p, z, _ in kept]
        if not self.corners[k].turn:
            places[0] = s.start  # exactly, without a conversion to the plane and back
        if not self.corners[k + 1].turn:
            places[-1] = s.end
        for i, (a, b) in enumerate(pairwise(places)):
            last = i == len(places) - 2
            yield replace(
                s, start=a, end=b, reach_m=s.reach_m + kept[i + 1][2], hold_s=s.hold_s if last else 0.0,
                jumped_from=s.jumped_from if i == 0 else None,
            )  # fmt: skip

    def _place(self, p: Floats, z: float) -> Place:
        lat, lon = (float(x) for x in self.frame.to_degrees(p[0], p[1]))
        return lat, lon, float(z)

    def banded(self, k: int, band: Stretch) -> Iterator[Stretch]:
        """Leg ``k`` at the altitudes of a level ``band``, as that one."""
        level = band.start[2]
        if band.terrain:
            yield band
            return
        for piece in self._pieces(k, [(p, level, off) for p, _, off in self._track(k)]):
            yield replace(
                piece,
                start=(*piece.start[:2], level),
                end=(*piece.end[:2], level),
                band_m=band.band_m,
                reach_m=piece.reach_m + band.reach_m,
            )

    def instead(self, k: int) -> Iterator[Stretch]:
        """Leg ``k`` at the altitudes that ArduPlane computes along the line between the way points."""
        s = self.run[k]
        a, b = self.corners[k], self.corners[k + 1]
        z0, z1 = self.points[k, 2], self.points[k + 1, 2]
        if s.terrain or z0 == z1 or not (a.turn or b.turn):
            return
        slope = (z1 - z0) / max(float(self.long_m[k]), 1e-9)
        whole = max(float(self.flown_m[k]), 1e-9)
        leaves, reaches = z0 + slope * a.tangent, z1 - slope * b.tangent
        first, last = self.half_m[k] / whole, 1.0 - self.half_m[k + 1] / whole
        # Over half an arc: the band from the way point's altitude to both altitudes computed for the arc's other end.
        for corner, at, other, even in (
            (a, z0, leaves, z0 + (z1 - z0) * first), (b, z1, reaches, z0 + (z1 - z0) * last),
        ):  # fmt: skip
            if not corner.turn:
                continue
            low, high = min(at, other, even), max(at, other, even)
            track = self._track(k)
            half = self._parts(corner.turn)
            part = track[: half + 1] if corner is a else track[-half - 1 :]
            for p, q in pairwise(part):
                if math.dist(p[0], q[0]) > SAME_PLACE_M:
                    level = 0.5 * (low + high)
                    yield replace(
                        s, start=self._place(p[0], level), end=self._place(q[0], level), band_m=0.5 * (high - low),
                        reach_m=s.reach_m + q[2], hold_s=0.0,
                    )  # fmt: skip
        if self.straight_m[k] > SAME_PLACE_M:
            along = np.array([math.cos(self.heading[k]), math.sin(self.heading[k])])
            settled_m = min(self._settles_m(k, a.off_m), float(self.straight_m[k]))
            cuts = a.tangent + np.array([0.0, settled_m, float(self.straight_m[k])])
            for i, (p, q) in enumerate(pairwise(cuts.tolist())):
                if q - p > SAME_PLACE_M:
                    start, end = (self._place(self.points[k, :2] + m * along, z0 + slope * m) for m in (p, q))
                    yield replace(
                        s, start=start, end=end, reach_m=s.reach_m + self._widen_m(k, settled=i == 1), hold_s=0.0
                    )


def _chord(radius: float, heading: float, turn: float) -> Floats:
    """The vector from the start of an arc to the place where it has turned by ``turn``."""
    length, course = 2.0 * radius * math.sin(0.5 * abs(turn)), heading + 0.5 * turn
    return np.array([length * math.cos(course), length * math.sin(course)])


def _moves(s: Stretch) -> bool:
    """Whether a stretch leads to another place with turns on arcs at its ends."""
    circles = s.reach_m > 0.0  # a climb in circles is a turn already
    return s.kind in ("takeoff", "cruise", "land") and not circles and flat_m(s.start, s.end) > SAME_PLACE_M


def _runs(stretches: Sequence[Stretch]) -> Iterator[tuple[int, int]]:
    """Index ranges of stretches flown through without a stop; every other stretch is a range of its own."""
    first = 0
    for i in range(1, len(stretches) + 1):
        if i < len(stretches):
            here, after = stretches[i - 1], stretches[i]
            joined = here.end == after.start and here.hold_s == 0.0
            if _moves(here) and _moves(after) and joined:
                continue
        yield first, i
        first = i


def _same_way(band: Stretch, s: Stretch) -> bool:
    return band.seq == s.seq and band.kind == s.kind and band.start[:2] == s.start[:2] and band.end[:2] == s.end[:2]


def _item(mission: Mission, seq: int) -> MissionItem | None:
    index = seq - mission.first_seq
    return mission.items[index] if 0 <= index < len(mission.items) else None
