"""The return that the mission itself holds, judged from every point: the way to where it joins the mission.

Parts of the mission are judged as a whole. From each part, for each item that `joins` may be joined from there, one
straight leg of the exact check covers all ways to that item: it is widened by where the vehicle may be when it turns,
in the plane and in height. Parts from which that is not legal are split, down to `SMALLEST_BY_GRADE_M`. So a point
reported as safe is safe; the others may be reported as unsafe up to the ends of a smallest part too early.

Which item is joined is decided by the nearest leg of the return path. A part's candidates are all that may be nearest
from anywhere in it, within the errors of the vehicle's place. The flight from the join on is judged with the mission.

Two grades. *Clear*: the vehicle, within its errors, meets no ground, obstacle or zone. *Legal*: it keeps all limits.

The battery along such a mission: what was spent so far, plus the longest way to the ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.battery import BatteryHome, LegBattery
from gcsplan.check.flight.ways_home import WaysHome
from gcsplan.check.motion.return_rules import RETURN_RULES, at_home_m, return_s, speed_home_m_s
from gcsplan.check.motion.stopping import about_turn_m, detour_home_m
from gcsplan.check.motion.stretch import Stretch
from gcsplan.check.returns.footprint import Target, places_of_returns
from gcsplan.check.returns.return_targets import Join, Joins, Ways, candidates
from gcsplan.check.returns.stretches import without_doubles
from gcsplan.check.returns.trace import TINY_M, MissionTrace, TraceParts
from gcsplan.check.returns.verdict import UnsafeStretch
from gcsplan.check.verdict import LegFigures, Verdict
from gcsplan.notes.note import Note
from gcsplan.vehicle import Vehicle
from gcsplan.world.airspace import Legs, Violation
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Zone

CLEAR, LEGAL, KNOWN = 0, 1, 2
FIRST_M, FIRST_PARTS = 64.0, 2000
"""First parts are this long, or so long that there are no more than this many."""

SMALLEST_BY_GRADE_M = (4.0, 16.0)
"""Parts no longer than this are not split, by grade, m."""

PIECES, MOST_ROUNDS = 4, 8
MOST_LEGS = 400_000
"""Legs that are judged before nothing is split further."""

STRIP_PIECES = 6
"""Where the ways from a part do not pass as a whole, the strip in which they begin is cut into so many pieces."""

LEGS_LOOKED_AT = 200
"""Most legs of one stretch among which the check looks for the reason that it reports."""


@dataclass(frozen=True, eq=False)
class ByMission:
    """The result: where returns are not clear, and clear but not legal; from where it is not known; the battery.

    ``stopped_early``: not all of it was looked at closely.
    """

    unsafe: tuple[UnsafeStretch, ...]
    irregular: tuple[UnsafeStretch, ...]
    unknown: tuple[UnsafeStretch, ...]
    battery: BatteryHome | None
    stopped_early: bool


def return_by_mission(
    trace: MissionTrace, joins: Joins, landing: frozenset[int], verdict: Verdict, vehicle: Vehicle
) -> ByMission:
    """Judge the returns that join the mission at one of ``joins``; ``landing``: wire items of landings."""
    past = math.inf if joins.past_seq is None else joins.past_seq
    flies_in = None if verdict.in_wind is None else verdict.in_wind.flies_in
    heights_m = float(trace.amsl.min()), float(trace.amsl.max())
    ways = None if flies_in is None else WaysHome(vehicle, flies_in, heights_m)
    judge = _Judge(trace, joins.joins, vehicle, ways)
    length = float((trace.last - trace.first).sum())
    parts = trace.cut(max(FIRST_M, length / FIRST_PARTS))
    seq = trace.seq[parts.stretch]
    copter = RETURN_RULES[vehicle.autopilot].climbs_first
    parts = parts.take((seq <= past) & ~(np.isin(seq, list(landing)) & copter))
    done: list[tuple[TraceParts, Floats, Bools]] = []
    stopped = False
    for _ in range(MOST_ROUNDS):
        good, back_j = judge.look(parts)
        open_ = ~good[KNOWN] & (parts.size > SMALLEST_BY_GRADE_M[CLEAR])
        for grade, least_m in enumerate(SMALLEST_BY_GRADE_M):
            open_ |= ~good[grade] & (parts.size > least_m)
        stopped = judge.legs > MOST_LEGS and bool(open_.any())
        if stopped:
            open_[:] = False
        done.append((parts.take(~open_), back_j[~open_], good[:, ~open_]))
        if not open_.any():
            break
        parts = parts.take(open_).split(PIECES)
    start, end, stretch = (
        np.concatenate([getattr(p, name) for p, _, _ in done]) for name in ("start", "end", "stretch")
    )
    order = np.argsort(start, kind="stable")
    parts = TraceParts(start[order], end[order], stretch[order])
    back_j = np.concatenate([j for _, j, _ in done])[order]
    good = np.concatenate([g for *_, g in done], axis=1)[:, order]
    clear, legal, known = good
    return ByMission(
        judge.stretches(parts, ~clear & known, CLEAR), judge.stretches(parts, clear & ~legal & known, LEGAL),
        judge.stretches(parts, ~known, KNOWN), battery_by_mission(trace, parts, back_j, verdict, vehicle), stopped,
    )  # fmt: skip


class _Judge:
    """Judges ways to joins; ``legs`` counts the legs that it has looked at."""

    def __init__(
        self, trace: MissionTrace, joins: Sequence[Join], vehicle: Vehicle, in_wind: WaysHome | None
    ) -> None:  # fmt: skip
        self.trace, self.joins, self.vehicle, self.in_wind = trace, joins, vehicle, in_wind
        limits = vehicle.limits
        free = replace(
            limits, min_agl_m=0.0, max_agl_m=None, max_amsl_m=None, horizontal_clearance_m=0.0,
            vertical_clearance_m=0.0, max_climb_deg=90.0,
            max_descent_deg=90.0,
        )  # fmt: skip
        self.limits: tuple[Limits, Limits] = (free, limits)
        self.copter = RETURN_RULES[vehicle.autopilot].climbs_first
        self.legs = 0
        fastest = max(trace.speed_m_s.tolist(), default=vehicle.speed_max_m_s)
        self.about_m = 0.0 if self.copter else about_turn_m(vehicle, fastest, float(trace.amsl.max()))
        self.reached = [self._beyond(join) for join in joins]

    def look(self, parts: TraceParts) -> tuple[Bools, Floats]:
        """(3, N) whether all returns from each part are clear, legal, and known; (N,) the most energy of one, J."""
        good = np.ones((3, len(parts)), np.bool_)
        back_j = np.zeros(len(parts))
        near = candidates(self.trace, self.joins, self.vehicle, parts)
        for k, join in enumerate(self.joins):
            some = np.flatnonzero(near[:, k])
            if not len(some):
                continue
            ways = self._ways(parts.take(some), join)
            for grade in (CLEAR, LEGAL):
                good[grade, some] &= self._passes(ways, grade) & self.reached[k][grade]
            good[KNOWN, some] &= self._climbs(ways) & self.reached[k][KNOWN]
            back_j[some] = np.maximum(back_j[some], self._way_j(parts.take(some), ways) + join.rest_j)
        return good, back_j

    def _way_j(self, parts: TraceParts, ways: Ways) -> Floats:
        """(N,) energy of the longest way from each part, J."""
        vehicle, speed = self.vehicle, self.trace.speed_m_s[parts.stretch]
        way_m = ways.away_m + ways.wide_m + detour_home_m(vehicle, vehicle.speed_max_m_s, float(self.trace.amsl.max()))
        rise_m, seconds = ways.rise_m, np.zeros(len(way_m))
        slow_m = way_m
        if self.in_wind is not None:  # in the worst direction
            home_m_s = np.array([speed_home_m_s(vehicle, v) for v in speed.tolist()])
            air, took_s = np.array([self.in_wind.worst(v) for v in home_m_s.tolist()]).reshape(-1, 2).T
            way_m, slow_m = way_m * air, way_m * took_s * home_m_s
        if vehicle.energy.base_w:  # it climbs or descends: the slower of both
            each = zip(slow_m.tolist(), rise_m.tolist(), speed.tolist(), strict=True)
            seconds[:] = [
                max(return_s(vehicle, way, rise, 0.0, v), return_s(vehicle, way, -rise, 0.0, v))
                for way, rise, v in each
            ]
        return vehicle.energy.under_way_j(rise_m, way_m, seconds)

    def _ways(self, parts: TraceParts, join: Join) -> Ways:
        """The ways from each part to ``join``."""
        trace, limits, air = self.trace, self.vehicle.limits, self.trace.world.airspace
        target = Target(float(join.at[0]), float(join.at[1]), float(join.at[2]), float(join.at[2]))
        places = places_of_returns(trace, parts, target, self.vehicle)
        start, reach, half, _ = places.lines_home()
        out = target.en - start
        away = np.hypot(*out.T)
        unit = np.divide(out, away[:, None], out=np.zeros_like(out), where=away[:, None] > 0.0)
        wide = limits.track_error_m + half + (places.wide_m + places.bow_m + self.about_m) * air.scale
        there = away + half <= at_home_m(limits)
        ends = trace.points(trace.first[parts.stretch]), trace.points(trace.last[parts.stretch])
        column = there & (np.hypot(*(ends[1] - ends[0])[:, :2].T) <= TINY_M)
        flown = ~there if join.lands else np.ones(len(parts), np.bool_)
        error = np.full(len(parts), limits.altitude_error_m)
        return Ways(join, start, unit, away, reach, wide, places.low, places.high, error, flown, column)

    def _passes(self, ways: Ways, grade: int) -> Bools:
        """(N,) whether all ways from each part keep the limits of ``grade``."""
        clear, limits = self.trace.world.airspace.clear, self.limits[grade]
        every = np.arange(len(ways.low))
        ok = ~ways.flown
        if self.copter:
            ok = ok | clear(ways.legs(every), limits)
            self.legs += len(every)
        pieces = STRIP_PIECES if self.copter else 1
        left = np.flatnonzero(~ok)
        for piece in range(pieces):
            if not len(left):
                break
            passes = clear(ways.legs(left, piece, pieces, level=True), limits)
            if self.copter:
                passes |= clear(ways.legs(left, piece, pieces), limits)
            self.legs += 2 * len(left)
            left = left[passes]
        ok[left] = True
        return ok

    def _climbs(self, ways: Ways) -> Bools:
        """(N,) whether a plane reaches the join's altitude on the way; a multicopter slows down for it."""
        if self.copter:
            return np.ones(len(ways.low), np.bool_)
        slope = min(self.vehicle.climb_m_s, self.vehicle.descent_m_s) / self.vehicle.speed_max_m_s
        return np.asarray(ways.rise_m <= slope * np.maximum(ways.away_m - ways.reach_m - 2.0 * self.about_m, 0.0))

    def _beyond(self, join: Join) -> tuple[bool, bool, bool]:
        """Whether the flight behind the join is clear, legal, and known, for a return from anywhere."""
        if join.unknown:
            return True, True, False
        if self.copter:
            return (*self._column(join), True)
        from gcsplan.check.motion.project import legs_in_plane

        wide_m, rest_m = 2.0 * self.about_m, 4.0 * self.about_m
        some: list[Stretch] = []
        for s in join.after:
            if rest_m <= 0.0 or s.column:
                break
            some.append(replace(s, reach_m=s.reach_m + wide_m))
            (a, b), (c, d) = (self.trace.world.frame.to_plane(*p[:2]).tolist() for p in (s.start, s.end))
            rest_m -= math.hypot(c - a, d - b)
        if rest_m > 0.0:
            return True, True, False
        legs = legs_in_plane(some, self.vehicle.limits, self.trace.world, 0.0).legs
        clear, legal = (bool(self.trace.world.airspace.clear(legs, limits).all()) for limits in self.limits)
        return clear, legal, True

    def _column(self, join: Join) -> tuple[bool, bool]:
        """Whether a multicopter may descend onto a landing place from as high as the mission goes."""
        if not join.lands:
            return True, True
        limits = self.vehicle.limits
        top = np.array([[*join.at[:2], max(float(self.trace.amsl.max()), float(join.at[2]))]])
        legs = Legs(
            top,
            join.at[None],
            np.ones(1, np.bool_),
            np.array([limits.track_error_m]),
            np.array([limits.altitude_error_m]),
        )
        clear, legal = (bool(self.trace.world.airspace.clear(legs, one).all()) for one in self.limits)
        return clear, legal

    # -- words ---------------------------------------------------------------------------------------------------

    def stretches(self, parts: TraceParts, bad: Bools, grade: int) -> tuple[UnsafeStretch, ...]:
        """Runs of bad parts as stretches, each with its worst reason."""
        where = np.flatnonzero(bad)
        if not len(where):
            return ()
        runs = np.split(where, np.flatnonzero(np.diff(where) > 1) + 1)
        return without_doubles([self._stretch(parts, run, grade) for run in runs])

    def _stretch(self, parts: TraceParts, run: Indices, grade: int) -> UnsafeStretch:
        trace = self.trace
        a, b = float(parts.start[run[0]]), float(parts.end[run[-1]])
        from_m, to_m = (float(np.interp(u, trace.u, trace.along)) for u in (a, b))
        why, zone = self._why(parts.take(run[:: max(1, len(run) // LEGS_LOOKED_AT)]), grade)
        return UnsafeStretch(
            int(trace.seq[parts.stretch[run[0]]]), int(trace.seq[parts.stretch[run[-1]]]),
            trace.place(a), trace.place(b), from_m, max(from_m, to_m), why, zone, None, None,
        )  # fmt: skip

    def _why(self, parts: TraceParts, grade: int) -> tuple[Note, str]:
        """The faults of the returns from ``parts``, worst first; the first zone's name."""
        near = candidates(self.trace, self.joins, self.vehicle, parts)
        worst: dict[tuple[str, int], tuple[Violation, int]] = {}
        for k, join in enumerate(self.joins):
            some = np.flatnonzero(near[:, k])
            if not len(some):
                continue
            reached = self.reached[k]
            if grade == KNOWN and not reached[KNOWN]:
                return Note("joins_landing" if join.unknown else "joins_short_legs", join=join.seq), ""
            if grade == KNOWN and not self._climbs(self._ways(parts.take(some), join)).all():
                return Note("joins_too_steeply", join=join.seq), ""
            if grade != KNOWN and not reached[grade]:
                return Note("joins_into_limit", join=join.seq, descends=self.copter), ""
            if grade == KNOWN:
                continue
            ways = self._ways(parts.take(some), join)
            bad = np.flatnonzero(~self._passes(ways, grade))
            for v in self.trace.world.airspace.examine(ways.legs(bad), self.limits[grade]).violations:
                old = worst.get((v.kind, v.zone))
                if old is None or v.by > old[0].by:
                    worst[v.kind, v.zone] = v, join.seq
        names = [z.name for z in self.trace.world.airspace.zones]
        found = sorted(worst.values(), key=lambda pair: pair[0].by, reverse=True)
        if not found:
            return Note("joining_not_clear"), ""
        v, seq = found[0]
        zone = next((names[w.zone] for w, _ in found if w.zone >= 0), "")
        lat, lon = (float(x) for x in self.trace.world.frame.to_degrees(v.east_m, v.north_m))
        does = _does(v.kind, self.trace.world.airspace.zones[v.zone] if v.zone >= 0 else None, grade)
        return Note("joining_fails", join=seq, does=does, lat=lat, lon=lon, amsl_m=v.amsl_m), zone


WHAT = {
    "min_agl": "way_near_ground",
    "terrain_clearance": "way_near_rising_ground",
    "max_agl": "does_above_max_agl",
    "max_amsl": "does_above_ceiling",
    "climb": "way_climbs_too_steeply",
    "descent": "way_descends_too_steeply",
}
"""The note on a return that breaks a limit, by the kind of the violation."""


def _does(kind: str, zone: Zone | None, grade: int) -> Note:
    if kind == "coverage":
        return Note("way_over_unknown_ground")
    if zone is not None and zone.outside is not None:
        return Note("way_leaves_keep_in", areas=zone.title)
    if zone is not None:
        return Note("way_meets_clearance" if grade == LEGAL else "way_meets_zone", zone=zone.name)
    if grade == CLEAR:
        return Note("way_meets_ground")
    return Note(WHAT[kind]) if kind in WHAT else Note("way_breaks_limit")


def battery_by_mission(
    trace: MissionTrace, parts: TraceParts, back_j: Floats, verdict: Verdict, vehicle: Vehicle
) -> BatteryHome | None:
    """The energy spent so far plus the return, from every part; None if the capacity is not given."""
    energy = vehicle.energy
    if energy.battery_j is None or not verdict.legs or not len(parts):
        return None
    usable = (1.0 - energy.reserve) * energy.battery_j
    legs = [leg for leg in verdict.legs if leg.kind != "rtl"]
    along, spent, ends = _spent(legs)
    at = trace.points(parts.end)[:, 3]
    after = np.minimum(np.searchsorted(along, at + 0.01, "right"), len(along) - 1)
    run = np.maximum(along[after] - along[after - 1], 1e-9)
    share = np.clip((at - along[after - 1]) / run, 0.0, 1.0)
    lead = _lead(legs, len(along))[after]
    used = spent[after - 1] + lead + share * (spent[after] - spent[after - 1] - lead) + back_j
    begin = trace.points(parts.start)[:, 3]
    short: list[tuple[float, float]] = []
    over = np.flatnonzero(used > usable)
    for a, b in zip(begin[over].tolist(), at[over].tolist(), strict=True):
        if short and a <= short[-1][1] + 1e-6:
            short[-1] = short[-1][0], max(short[-1][1], b)
        else:
            short.append((a, b))
    most, first = int(used.argmax()), int(over[0]) if len(over) else None
    rows = []
    for leg, end_m, so_far in zip(legs, along[ends].tolist(), spent[ends].tolist(), strict=True):
        back = float(back_j[int(np.abs(at - end_m).argmin())])
        rows.append(
            LegBattery(
                leg.seq, leg.kind, leg.energy_j, so_far, back, 100.0 * so_far / energy.battery_j,
                100.0 * (so_far + back) / energy.battery_j,
            )
        )  # fmt: skip
    return BatteryHome(
        usable, energy.battery_j, float(used[most]), trace.place(float(parts.end[most])), float(at[most]),
        None if first is None else trace.place(float(parts.start[first])),
        None if first is None else float(begin[first]),
        None if first is None else int(trace.seq[parts.stretch[first]]), tuple(short), tuple(rows),
    )  # fmt: skip


def _lead(legs: Sequence[LegFigures], count: int) -> Floats:
    """(count,) `LegFigures.lead_j` of the leg that ends at each place of `_spent`; 0 where a group begins."""
    out = []
    for _, group in groupby(legs, key=lambda leg: leg.times):
        out += [0.0, *(leg.lead_j for leg in group)]
    return np.array([0.0, *out][:count])


def _spent(legs: Sequence[LegFigures]) -> tuple[Floats, Floats, list[int]]:
    """Horizontal metres along the mission, and the energy spent there at most, J; and the index of each leg's end.

    Legs that are flown several times count once along the mission: there the last round is meant.
    """
    along, spent, ends = [0.0], [0.0], []
    for times, group in groupby(legs, key=lambda leg: leg.times):
        run = list(group)
        along.append(along[-1])
        spent.append(spent[-1] + (times - 1) * math.fsum(leg.energy_j for leg in run))
        for leg in run:
            along.append(along[-1] + leg.horizontal_m)
            spent.append(spent[-1] + leg.energy_j)
            ends.append(len(along) - 1)
    return np.array(along), np.array(spent), ends
