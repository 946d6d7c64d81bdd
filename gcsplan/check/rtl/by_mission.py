"""The return that the mission itself holds, judged from every point: the way to where it joins the mission.

Parts of the mission are judged as a whole. From each part, for each item that `joins` may be joined from there, one
straight leg of the exact check covers all ways to that item: it is widened by where the vehicle may be when it turns,
in the plane and in height. Parts from which that is not legal are split, down to `SMALLEST_M`. So a point reported as
safe is safe; the others may be reported as unsafe up to the ends of a smallest part too early.

Which item is joined is decided by the nearest leg of the return path. A part's candidates are all that may be nearest
from anywhere in it, within the errors of the vehicle's place. What is flown from the join on is judged with the
mission.

Two grades. *Clear*: the vehicle, within its errors, meets no ground, obstacle or zone. *Legal*: it keeps all limits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.battery import BatteryHome, LegBattery
from gcsplan.check.rtl.joins import Join, Joins
from gcsplan.check.rtl.model import RULES, at_home_m
from gcsplan.check.rtl.places import Target, places_of_returns
from gcsplan.check.rtl.run_on import about_turn_m, levels_off_m, more_m
from gcsplan.check.rtl.stretches import without_doubles
from gcsplan.check.rtl.trace import TINY_M, MissionTrace, TraceParts
from gcsplan.check.rtl.verdict import UnsafeStretch
from gcsplan.check.stretch import Stretch
from gcsplan.check.verdict import Verdict
from gcsplan.units import Quantity, UnitText
from gcsplan.vehicle import Vehicle
from gcsplan.world.airspace import Legs, Violation
from gcsplan.world.limits import Limits

CLEAR, LEGAL = 0, 1
FIRST_M, FIRST_PARTS = 64.0, 2000
"""First parts are this long, or so long that there are no more than this many."""

SMALLEST_M = (4.0, 16.0)
"""Parts no longer than this are not split, by grade, m."""

PIECES, MOST_ROUNDS = 4, 8
MOST_LEGS = 400_000
"""Legs that are judged before nothing is split further."""

AWAY_PART = 0.002
"""By how much distances to far legs may be off, as a part of them: ArduPilot's plane is not ours."""

STRIP_PIECES = 6
"""Where the ways from a part do not pass as a whole, the strip in which they begin is cut into so many pieces."""

LOOKED_AT = 200
"""Most legs of one stretch that are looked at for the reason that is told."""


@dataclass(frozen=True, eq=False)
class ByMission:
    """The result: where returns are not clear, and clear but not legal; the battery; whether it was all looked at."""

    unsafe: tuple[UnsafeStretch, ...]
    irregular: tuple[UnsafeStretch, ...]
    battery: BatteryHome | None
    stopped_early: bool


def return_by_mission(
    trace: MissionTrace, joins: Joins, landing: frozenset[int], verdict: Verdict, vehicle: Vehicle
) -> ByMission:
    """Judge the returns that join the mission at one of ``joins``; ``landing``: wire items of landings."""
    past = math.inf if joins.past_seq is None else joins.past_seq
    judge = _Judge(trace, joins.joins, vehicle)
    length = float((trace.last - trace.first).sum())
    parts = trace.cut(max(FIRST_M, length / FIRST_PARTS))
    seq = trace.seq[parts.stretch]
    copter = RULES[vehicle.autopilot].climbs_first
    parts = parts.take((seq <= past) & ~(np.isin(seq, list(landing)) & copter))
    done: list[tuple[TraceParts, Floats, Bools]] = []
    stopped = False
    for _ in range(MOST_ROUNDS):
        good, back_j = judge.look(parts)
        open_ = np.zeros(len(parts), np.bool_)
        for grade, least_m in enumerate(SMALLEST_M):
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
    return ByMission(
        judge.stretches(parts, ~good[CLEAR], CLEAR), judge.stretches(parts, good[CLEAR] & ~good[LEGAL], LEGAL),
        _battery(trace, parts, back_j, verdict, vehicle), stopped,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Ways:
    """All ways from N parts to a join. Each begins in a strip along a line to the join.

    ``start`` (N, 2): its far end; ``unit`` (N, 2): the direction from there to the join; ``away_m`` (N,): the distance;
    ``reach_m`` (N,): the strip's length; ``wide_m`` (N,): its half width, with all errors in the plane; ``low``,
    ``high`` (N,): altitudes AMSL at which the ways begin; ``error_m`` (N,): the error in height. ``flown`` (N,): False
    where there is only a descent. ``column`` (N,): they climb or descend where the vehicle takes off or lands.
    """

    join: Join
    start: Floats
    unit: Floats
    away_m: Floats
    reach_m: Floats
    wide_m: Floats
    low: Floats
    high: Floats
    error_m: Floats
    flown: Bools
    column: Bools

    @property
    def rise_m(self) -> Floats:
        """(N,) by how much they rise or fall at most."""
        return np.asarray(np.maximum(np.abs(self.low - self.join.at[2]), np.abs(self.high - self.join.at[2])))

    def legs(self, some: Indices, piece: int = 0, pieces: int = 1, *, level: bool = False) -> Legs:
        """One leg for each of ``some``, that covers its ways from one of ``pieces`` of its strip.

        A way rises evenly. So where it begins nearer to the join by a part of the distance, it is off the leg by no
        more than that part of its rise. ``level``: instead it may be anywhere between its ends' altitudes.
        """
        away, step = self.away_m[some], self.reach_m[some] / pieces
        skipped = np.minimum(piece * step, away)
        start = self.start[some] + skipped[:, None] * self.unit[some]
        end = np.tile(self.join.at[:2], (len(some), 1))
        low, high = self.low[some], self.high[some]
        begins = finishes = 0.5 * (low + high)
        band = 0.5 * (high - low)
        if level and not self.join.lands:
            low, high = np.minimum(low, self.join.at[2]), np.maximum(high, self.join.at[2])
            begins = finishes = 0.5 * (low + high)
            band = 0.5 * (high - low)
        elif not self.join.lands:
            left = away - skipped
            share = np.divide(step, left, out=np.ones(len(some)), where=left > step)
            finishes, band = np.full(len(some), self.join.at[2]), band + share * self.rise_m[some]
        return Legs(
            np.column_stack([start, begins]), np.column_stack([end, finishes]), self.column[some],
            self.wide_m[some], self.error_m[some] + band,
        )  # fmt: skip


class _Judge:
    """Judges ways to joins; ``legs`` counts the legs that it has looked at."""

    def __init__(self, trace: MissionTrace, joins: Sequence[Join], vehicle: Vehicle) -> None:
        self.trace, self.joins, self.vehicle = trace, joins, vehicle
        limits = vehicle.limits
        free = replace(
            limits, min_agl_m=0.0, max_agl_m=None, max_amsl_m=None, horizontal_clearance_m=0.0, max_climb_deg=90.0,
            max_descent_deg=90.0,
        )  # fmt: skip
        self.limits: tuple[Limits, Limits] = (free, limits)
        self.copter = RULES[vehicle.autopilot].climbs_first
        self.legs = 0
        fastest = max(trace.speed_m_s.tolist(), default=vehicle.speed_max_m_s)
        self.about_m = 0.0 if self.copter else about_turn_m(vehicle, fastest, float(trace.amsl.max()))
        self.reached, self.beyond = zip(*(self._beyond(join) for join in joins), strict=True)

    def look(self, parts: TraceParts) -> tuple[Bools, Floats]:
        """(2, N) whether all returns from each part are clear and legal, and (N,) the most energy of one, J."""
        good = np.ones((2, len(parts)), np.bool_)
        back_j = np.zeros(len(parts))
        near = self.candidates(parts)
        for k, join in enumerate(self.joins):
            some = np.flatnonzero(near[:, k])
            if not len(some):
                continue
            ways = self._ways(parts.take(some), join)
            for grade in (CLEAR, LEGAL):
                good[grade, some] &= self._passes(ways, grade) & self._climbs(ways) & self.reached[k][grade]
            energy = self.vehicle.energy
            more = more_m(self.vehicle, self.vehicle.speed_max_m_s, float(self.trace.amsl.max()))
            way_j = (
                energy.horizontal_j_per_m * (ways.away_m + ways.wide_m + more) + energy.vertical_j_per_m * ways.rise_m
            )
            back_j[some] = np.maximum(back_j[some], way_j + join.rest_j)
        return good, back_j

    def candidates(self, parts: TraceParts) -> Bools:
        """(N, J) which joins a return from each part may choose."""
        out = np.ones((len(parts), len(self.joins)), np.bool_)
        counts = [len(join.legs) for join in self.joins]
        if not sum(counts):
            return out
        every = np.concatenate([join.legs for join in self.joins])
        owner = np.repeat(np.arange(len(self.joins)), counts)
        begin, levels = self.trace.beginnings(parts)
        low, high = self.trace.heights(parts)
        down_m, up_m = levels_off_m(self.vehicle)
        low, high = low - down_m * levels[:, 0], high + up_m * levels[:, 1]
        middle = np.column_stack([begin.mean(axis=1), 0.5 * (low + high)])
        limits = self.vehicle.limits
        reach = np.hypot(*(begin - middle[:, None, :2]).transpose(2, 0, 1)).max(axis=1)
        # Distances to legs change by no more than the vehicle moves: so a few places stand for all around them.
        first, far = (
            begin[:, 0],
            begin[np.arange(len(parts)), np.hypot(*(begin - begin[:, :1]).transpose(2, 0, 1)).argmax(1)],
        )
        pieces = max(1, math.ceil(float(2.0 * reach.max()) / SMALLEST_M[CLEAR]))
        share = (np.arange(pieces) + 0.5) / pieces
        width = np.abs(_beside(begin, first, far)).max(axis=1)
        error = math.hypot(limits.track_error_m, limits.altitude_error_m)
        out[:] = False
        for s in share:
            at = np.column_stack([first + s * (far - first), middle[:, 2]])
            away = _distances(at, every)
            own = (
                np.hypot(*(far - first).T) / (2 * pieces)
                + width
                + 0.5 * (high - low)
                + self.trace.track_m[parts.stretch]
            )
            room = 2.0 * (own + error) + AWAY_PART * away.min(axis=1)
            chosen = away <= (away.min(axis=1) + room)[:, None]
            for k in range(len(self.joins)):
                out[:, k] |= chosen[:, owner == k].any(axis=1)
        return out

    def _ways(self, parts: TraceParts, join: Join) -> _Ways:
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
        return _Ways(join, start, unit, away, reach, wide, places.low, places.high, error, flown, column)

    def _passes(self, ways: _Ways, grade: int) -> Bools:
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

    def _climbs(self, ways: _Ways) -> Bools:
        """(N,) whether a plane reaches the join's altitude on the way; a multicopter slows down for it."""
        if self.copter:
            return np.ones(len(ways.low), np.bool_)
        slope = min(self.vehicle.climb_m_s, self.vehicle.descent_m_s) / self.vehicle.speed_max_m_s
        return np.asarray(ways.rise_m <= slope * np.maximum(ways.away_m - ways.reach_m - 2.0 * self.about_m, 0.0))

    def _beyond(self, join: Join) -> tuple[tuple[bool, bool], str]:
        """Whether what follows the join is clear, and legal, for those who come from anywhere; and why it is not."""
        if join.unknown:
            return (False, False), "leads straight to a landing, and how is not known"
        if self.copter:
            return self._column(join), "descends there into what the limits forbid"
        from gcsplan.check.plane_legs import legs_in_plane

        wide_m, rest_m = 2.0 * self.about_m, 4.0 * self.about_m
        some: list[Stretch] = []
        for s in join.after:
            if rest_m <= 0.0 or s.column:
                break
            some.append(replace(s, reach_m=s.reach_m + wide_m))
            (a, b), (c, d) = (self.trace.world.frame.to_plane(*p[:2]).tolist() for p in (s.start, s.end))
            rest_m -= math.hypot(c - a, d - b)
        if rest_m > 0.0:
            return (False, False), "is not back on its line before the landing: the legs behind that item are too short"
        legs = legs_in_plane(some, self.vehicle.limits, self.trace.world, 0.0).legs
        clear, legal = (bool(self.trace.world.airspace.clear(legs, limits).all()) for limits in self.limits)
        return (clear, legal), "swings wide there into what the limits forbid"

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
        why, zone = self._why(parts.take(run[:: max(1, len(run) // LOOKED_AT)]), grade)
        return UnsafeStretch(
            int(trace.seq[parts.stretch[run[0]]]), int(trace.seq[parts.stretch[run[-1]]]),
            trace.place(a), trace.place(b), from_m, max(from_m, to_m), why, zone, None, None,
        )  # fmt: skip

    def _why(self, parts: TraceParts, grade: int) -> tuple[str, str]:
        """What the returns from ``parts`` do, worst first; the first zone's name."""
        near = self.candidates(parts)
        worst: dict[tuple[str, int], tuple[Violation, int]] = {}
        for k, join in enumerate(self.joins):
            some = np.flatnonzero(near[:, k])
            if not len(some):
                continue
            ways = self._ways(parts.take(some), join)
            bad = np.flatnonzero(~self._passes(ways, grade))
            for v in self.trace.world.airspace.examine(ways.legs(bad), self.limits[grade]).violations:
                old = worst.get((v.kind, v.zone))
                if old is None or v.by > old[0].by:
                    worst[v.kind, v.zone] = v, join.seq
            if not self._climbs(ways).all():
                return f"the return to item {join.seq} is too short for its climb or descent", ""
            if not self.reached[k][grade]:
                return f"the return to item {join.seq} {self.beyond[k]}", ""
        names = [z.name for z in self.trace.world.airspace.zones]
        found = sorted(worst.values(), key=lambda pair: pair[0].by, reverse=True)
        if not found:
            return "the return is not clear", ""
        v, seq = found[0]
        zone = next((names[w.zone] for w, _ in found if w.zone >= 0), "")
        lat, lon = (float(x) for x in self.trace.world.frame.to_degrees(v.east_m, v.north_m))
        what: str = "meets ground" if grade == CLEAR else WHAT.get(v.kind, "breaks a limit")
        if v.kind == "coverage":
            what = WHAT["coverage"]
        if v.kind == "zone":
            what = f"meets no-fly zone “{names[v.zone]}”" + (" or its clearance" if grade == LEGAL else "")
        words = UnitText(
            "the return, which joins the mission at item {}, {} at {:.6f}, {:.6f}, {}",
            seq, what, lat, lon, Quantity(v.amsl_m, "amsl", 0),
        )  # fmt: skip
        return words, zone


WHAT = {
    "min_agl": "comes nearer than min_agl_m to ground",
    "terrain_clearance": "comes too near to rising ground",
    "coverage": "leads over ground that is unknown to the terrain model,",
    "max_agl": "comes higher above ground than max_agl_m",
    "max_amsl": "rises above max_amsl_m",
    "climb": "climbs more steeply than max_climb_deg",
    "descent": "descends more steeply than max_descent_deg",
}


def _beside(points: Floats, first: Floats, far: Floats) -> Floats:
    """(N, K) how far points (N, K, 2) lie from the lines through ``first`` and ``far`` (N, 2)."""
    way = far - first
    length = np.hypot(*way.T)
    unit = np.divide(way, length[:, None], out=np.zeros_like(way), where=length[:, None] > 0.0)
    off = points - first[:, None]
    return np.asarray(off[..., 0] * unit[:, None, 1] - off[..., 1] * unit[:, None, 0])


def _distances(at: Floats, legs: Floats) -> Floats:
    """(N, L) the distances in space of places (N, 3) from legs (L, 2, 3)."""
    a, way = legs[:, 0], legs[:, 1] - legs[:, 0]
    square = np.maximum((way**2).sum(axis=1), 1e-12)
    part = np.clip(((at[:, None] - a) * way).sum(axis=2) / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(at[:, None] - (a + part[..., None] * way), axis=2))


def _battery(
    trace: MissionTrace, parts: TraceParts, back_j: Floats, verdict: Verdict, vehicle: Vehicle
) -> BatteryHome | None:
    """The energy spent so far plus the return, from every part; None if the capacity is not given."""
    energy = vehicle.energy
    if energy.battery_j is None or not verdict.legs or not len(parts):
        return None
    usable = (1.0 - energy.reserve) * energy.battery_j
    legs = [leg for leg in verdict.legs if leg.kind != "rtl"]
    along = np.cumsum([0.0, *(leg.horizontal_m for leg in legs)])
    spent = np.cumsum([0.0, *(leg.energy_j for leg in legs)])
    at = trace.points(parts.end)[:, 3]
    after = np.minimum(np.searchsorted(along, at + 0.01, "right"), len(along) - 1)
    run = np.maximum(along[after] - along[after - 1], 1e-9)
    share = np.clip((at - along[after - 1]) / run, 0.0, 1.0)
    used = spent[after - 1] + share * (spent[after] - spent[after - 1]) + back_j
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
    for leg, end_m, so_far in zip(legs, along[1:].tolist(), spent[1:].tolist(), strict=True):
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
