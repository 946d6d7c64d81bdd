"""Where a return joins the mission: ArduPilot's jump to a return path or to a landing sequence; and all ways there.

- ArduCopter's Auto RTL (mode 27; a failsafe set to 6), and ArduPlane's RTL with RTL_AUTOLAND 4, look for the nearest
  leg of all return paths and fly to the item at that leg's end (AP_Mission.cpp, `jump_to_closest_mission_leg`). A
  return path begins at a DO_RETURN_PATH_START and ends at the next landing or DO_LAND_START. Nearness is in space; the
  first place counts as a point. ArduCopter measures from where it will have stopped, ArduPlane from where it is.
  ArduCopter 4.6.0 and ArduPlane 4.6.2 are the first to know the command; older ones refuse it on upload.
- Without a return path ArduCopter's Auto RTL, and ArduPlane's RTL with RTL_AUTOLAND 2, go to the first place behind the
  nearest DO_LAND_START. How near each is depends on the version, so every one of them is judged.
- An ArduCopter that lands, or is past such a start in the order of its items, just continues.
- The way there is the leg of an ordinary item: straight in space for ArduCopter. To a landing ArduCopter flies level
  since 4.6.

Not judged: jumps behind a start or over it, return paths that hold more than way points and a landing, places in the
terrain frame.

`candidates` says which joins may be chosen from a part of the mission, and the legs of `Ways` cover all ways to one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.flight.times import FlightTimes
from gcsplan.check.flight.winds import FlightInWind
from gcsplan.check.motion.commands import LAND_STARTS
from gcsplan.check.motion.stopping import levels_off_m
from gcsplan.check.motion.stretch import Flight, Stretch, flat_m
from gcsplan.check.returns.trace import MissionTrace, TraceParts
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.wind.declared import FlightWind
from gcsplan.world.airspace import Legs
from gcsplan.world.world import World

LANDS = (cmd.LAND, cmd.VTOL_LAND)
WITHOUT_PLACE = frozenset({cmd.DO_CHANGE_SPEED, cmd.CONDITION_YAW, cmd.DO_SET_CAM_TRIGG_DIST, cmd.DO_SET_SERVO})
"""Commands besides way points and landings that a judged return path may hold."""


@dataclass(frozen=True, eq=False)
class Join:
    """One item to which a return may fly first.

    ``at`` (3,): east_m, north_m, amsl_m of its place; ``lands``: it is a landing, to which a multicopter flies level.
    ``legs`` (L, 2, 3): the return goes there if one of them is the nearest; empty: it may always. ``rest_j``: energy
    from there to the ground. ``after``: what is flown next. ``unknown``: how it is flown to is not known, so no return
    to it counts as safe.
    """

    seq: int
    at: Floats
    lands: bool
    legs: Floats
    rest_j: float
    after: tuple[Stretch, ...]
    unknown: bool = False


@dataclass(frozen=True, eq=False)
class Joins:
    """All items to which returns may fly first. ``path``: along a return path, else to a landing sequence.

    ``why_not``: why they cannot be judged. ``starts``: the wire items of the starts. ``past_seq``: from behind this
    item on the vehicle just continues; None: from nowhere.
    """

    path: bool
    starts: tuple[int, ...]
    joins: tuple[Join, ...] = ()
    why_not: tuple[Note, ...] = ()
    past_seq: int | None = None

    @property
    def command(self) -> int:
        """The command that begins what the returns join."""
        return cmd.DO_RETURN_PATH_START if self.path else cmd.DO_LAND_START


def land_starts(mission: Mission, command: int) -> list[int]:
    """The indices of the items with ``command``."""
    return [k for k, item in enumerate(mission.items) if item.command == command]


def joins_of(
    mission: Mission, flight: Flight, vehicle: Vehicle, world: World, wind: FlightWind | None = None
) -> Joins:  # fmt: skip
    """The items of ``mission`` (as stored; ``flight`` is what `follow` makes of it) that a return may fly to first.

    ``wind``: the declared winds, whose worst counts for the energy.
    """
    paths, landings = (land_starts(mission, c) for c in LAND_STARTS)
    starts = tuple(mission.first_seq + k for k in (paths or landings))
    if not starts:
        one, other = (cmd.command_name(c) for c in LAND_STARTS)
        return Joins(False, (), why_not=(Note("nothing_to_join", one=one, other=other),))
    finder = _Finder(mission, flight, vehicle, world, wind)
    if (jump := _jump_at_starts(mission, min(*paths, *landings, len(mission.items)))) is not None:
        finder.why_not.append(Note("jump_decides_join", jump))
    for k in paths:
        finder.path(k)
    for k in () if paths else landings:
        finder.join(k, ())
    joins = finder.found()
    in_order = [k for k in (*paths, *landings) if flight.apart_from is None or k < flight.apart_from]
    past = min(in_order, default=None) if mission.autopilot is Autopilot.ARDUCOPTER else None
    return Joins(
        bool(paths), starts, joins, tuple(dict.fromkeys(finder.why_not)),
        None if past is None else mission.first_seq + past,
    )  # fmt: skip


def _jump_at_starts(mission: Mission, first: int) -> int | None:
    """The wire item of a jump behind the first start, at index ``first``, or from before it to behind it; or None."""
    seq = mission.first_seq
    for k, item in enumerate(mission.items):
        tagged = item.command == cmd.DO_JUMP_TAG
        if item.command == cmd.DO_JUMP or tagged:
            target = item.params[0] - seq
            if k > first or tagged or not target <= first:
                return seq + k
    return None


@dataclass(eq=False)
class _Finder:
    """Collects joins; ``legs`` by index of the item that is flown to."""

    mission: Mission
    flight: Flight
    vehicle: Vehicle
    world: World
    wind: FlightWind | None = None
    why_not: list[Note] = field(default_factory=list)
    legs: dict[int, list[tuple[Floats, Floats]]] = field(default_factory=dict)

    def path(self, start: int) -> None:
        """Add the legs of the return path that begins at the index ``start``."""
        before: Floats | None = None
        for k in range(start, len(self.mission.items)):
            item = self.mission.items[k]
            if k > start and item.command not in (cmd.WAYPOINT, *LANDS, cmd.DO_LAND_START, *WITHOUT_PLACE):
                self.why_not.append(Note("join_unknown_on_path", self._seq(k), way=self._name(k)))
                return
            if item.command not in WITHOUT_PLACE and (item.x, item.y, item.z) != (0, 0, 0.0):
                place = self._place(item)
                if place is None:
                    self.why_not.append(Note("join_distance_unknown", self._seq(k), way=self._name(k)))
                    return
                if before is None:
                    self.join(k, ((place, place),))
                    before = place
                elif (place != before).any():
                    self.join(k, ((before, place),))
                    before = place
            if item.command in (*LANDS, cmd.DO_LAND_START):
                return

    def join(self, index: int, legs: Sequence[tuple[Floats, Floats]]) -> None:
        """A return may continue at the item with this index; it flies to the first item from there on that moves it."""
        items = self.mission.items
        first = next((k for k in range(index, len(items)) if cmd.is_nav(items[k].command)), None)
        if first is None:
            self.why_not.append(Note("join_leads_nowhere", self._seq(index), way=self._name(index)))
            return
        self.legs.setdefault(first, []).extend(legs)

    def found(self) -> tuple[Join, ...]:
        """The joins; empty if one of them is not known."""
        joins = [j for k, legs in sorted(self.legs.items()) if (j := self._join(k, legs)) is not None]
        if not joins:
            self.why_not.append(Note("join_without_item"))
        return () if self.why_not else tuple(joins)

    @property
    def along_path(self) -> bool:
        """Whether there is a return path; then the autopilot is one that holds its altitude to a landing place."""
        return any(item.command == cmd.DO_RETURN_PATH_START for item in self.mission.items)

    def _join(self, index: int, legs: Sequence[tuple[Floats, Floats]]) -> Join | None:
        item, seq = self.mission.items[index], self.mission.first_seq + index
        copter = self.mission.autopilot is Autopilot.ARDUCOPTER
        lands = item.command == cmd.LAND and copter and self.along_path
        if item.command in LANDS and not lands and (place := self._place(item)) is not None:
            return Join(seq, place, False, np.array(legs).reshape(-1, 2, 3), 0.0, (), unknown=True)
        if (item.command != cmd.WAYPOINT and not lands) or item.frame in (m.TERRAIN, 11) or not (item.x or item.y):
            self.why_not.append(Note("join_not_way_point", self._seq(index), way=self._name(index)))
            return None
        for part in (self.flight, *self.flight.apart):
            mine = [k for k, s in enumerate(part.stretches) if s.seq == seq and (lands or s.kind == "cruise")]
            if not mine:
                continue
            rest = part.stretches[mine[-1] + (0 if lands else 1) :]
            if part.stretches[-1].kind not in ("land", "rtl") or any(math.isinf(s.hold_s) for s in rest):
                self.why_not.append(Note("join_without_landing", self._seq(index), way=self._name(index)))
                return None
            lat, lon, amsl = part.stretches[mine[-1]].end
            east, north = (float(x) for x in self.world.frame.to_plane(lat, lon))
            pairs = np.array(legs).reshape(-1, 2, 3)
            return Join(seq, np.array([east, north, amsl]), lands, pairs, self._energy_j(rest), tuple(rest))
        self.why_not.append(Note("join_not_followed", self._seq(index), way=self._name(index)))
        return None

    def _energy_j(self, stretches: Sequence[Stretch]) -> float:
        """The energy from a join to the end, J; inf if a declared wind is too strong for that."""
        energy, times = self.vehicle.energy, np.full(len(stretches), math.nan)
        air_m = np.array([flat_m(s.start, s.end) for s in stretches])
        hold_s, wind_m_s = np.array([s.hold_s for s in stretches]), np.zeros(len(stretches))
        if (energy.base_w or self.wind) and stretches:
            home = self.mission.home.lat_e7 / 1e7, self.mission.home.lon_e7 / 1e7
            clock = FlightTimes(stretches, self.vehicle, self.world, home)
            times = clock.seconds()
            if self.wind is not None:
                unknown = np.full((len(stretches), 2), math.nan)
                blown = FlightInWind(stretches, clock, self.vehicle, self.wind, unknown)
                if blown.too_windy is not None:
                    return math.inf
                costs = blown.costs_so_far
                air_m, times, hold_s, wind_m_s = costs.air_m, costs.seconds, costs.hold_s, costs.wind_m_s
        rise_m = [abs(s.end[2] - s.start[2]) for s in stretches]
        rows = zip(rise_m, air_m.tolist(), times.tolist(), hold_s.tolist(), wind_m_s.tolist(), strict=True)
        return math.fsum(
            energy.under_way_j(rise, way, took_s) + energy.hold_w(w) * held for rise, way, took_s, held, w in rows
        )

    def _place(self, item: MissionItem) -> Floats | None:
        """(3,) the place of an item as ArduPilot measures to it; None if it is not known."""
        frame = m.FRAME_SYNONYMS.get(item.frame, item.frame)
        if frame not in (m.RELATIVE, m.GLOBAL) or not (item.x or item.y) or not math.isfinite(item.z):
            return None
        home = self.mission.home
        ground = self.world.ground_amsl(home.lat_e7 / 1e7, home.lon_e7 / 1e7)
        base = ground if frame == m.RELATIVE else 0.0
        east, north = (float(x) for x in self.world.frame.to_plane(item.lat_deg, item.lon_deg))
        return np.array([east, north, base + item.z])

    def _seq(self, index: int) -> int:
        return self.mission.first_seq + index

    def _name(self, index: int) -> str:
        return cmd.command_name(self.mission.items[index].command)


PLACES_M = 4.0
"""Places that stand for all around them are this far apart, m."""

AWAY_PART = 0.002
"""By how much distances to far legs may be off, as a part of them: ArduPilot's plane is not ours."""


@dataclass(frozen=True, eq=False)
class Ways:
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


def candidates(trace: MissionTrace, joins: Sequence[Join], vehicle: Vehicle, parts: TraceParts) -> Bools:
    """(N, J) which joins a return from each part may choose."""
    out = np.ones((len(parts), len(joins)), np.bool_)
    counts = [len(join.legs) for join in joins]
    if not sum(counts):
        return out
    every = np.concatenate([join.legs for join in joins])
    owner = np.repeat(np.arange(len(joins)), counts)
    begin, levels = trace.beginnings(parts)
    low, high = trace.heights(parts)
    down_m, up_m = levels_off_m(vehicle)
    low, high = low - down_m * levels[:, 0], high + up_m * levels[:, 1]
    middle = np.column_stack([begin.mean(axis=1), 0.5 * (low + high)])
    limits = vehicle.limits
    reach = np.hypot(*(begin - middle[:, None, :2]).transpose(2, 0, 1)).max(axis=1)
    # Distances to legs change by no more than the vehicle moves: so a few places stand for all around them.
    first, far = (
        begin[:, 0],
        begin[np.arange(len(parts)), np.hypot(*(begin - begin[:, :1]).transpose(2, 0, 1)).argmax(1)],
    )
    pieces = max(1, math.ceil(float(2.0 * reach.max()) / PLACES_M))
    share = (np.arange(pieces) + 0.5) / pieces
    width = np.abs(_beside(begin, first, far)).max(axis=1)
    error = math.hypot(limits.track_error_m, limits.altitude_error_m)
    out[:] = False
    for s in share:
        at = np.column_stack([first + s * (far - first), middle[:, 2]])
        away = _distances(at, every)
        own = np.hypot(*(far - first).T) / (2 * pieces) + width + 0.5 * (high - low) + trace.track_m[parts.stretch]
        room = 2.0 * (own + error) + AWAY_PART * away.min(axis=1)
        chosen = away <= (away.min(axis=1) + room)[:, None]
        for k in range(len(joins)):
            out[:, k] |= chosen[:, owner == k].any(axis=1)
    return out


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
