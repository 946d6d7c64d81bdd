"""The path of one simulated vehicle: its stored mission as a line in space, with the speed limits of each piece.

The items are interpreted as in the check (`check.flight.follow`). How long they take is computed only here and in
`mission_flight`, which share no code with the planning of the times.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.fixed_wing.arcs import bend
from gcsplan.check.flight.follow import follow_in
from gcsplan.check.motion.project import ends_of
from gcsplan.check.motion.stretch import Flight, Stretch
from gcsplan.errors import InputError
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.notes.note import Note
from gcsplan.sim.flight.kinematics import AT_ONCE_M_S2, STANDS_M, Kinematics, rounded
from gcsplan.sim.flight.scurves import leg_limits, step_legs
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.world import World

TERRAIN_PART_M = 10.0
"""Longest piece of a leg that follows the terrain, in metres."""
GROUND_STEP_M = 30.0
"""Metres along a track between the places whose ground tells the height of the air around the vehicle."""
PX4_TAKE_OFF_M_S = 1.5
"""m/s: PX4's speed in the first metres of a take-off (MPC_TKO_SPEED)."""
SCALING_M_PER_DEGREE = 0.011131884502145034 * 1e7
"""Metres per degree of latitude in ArduPilot (`LOCATION_SCALING_FACTOR`)."""
PASSED = -1.0
"""Value in `CommandedTrack.hold_s` of a node that is passed without a stop."""


@dataclass(frozen=True, eq=False)
class CommandedTrack:
    """N nodes and the N - 1 straight pieces between them.

    ``points`` (N, 3): east_m, north_m, amsl_m. ``hold_s`` (N,): seconds that the vehicle stands at a node, `PASSED` if
    it does not stop, infinite if it stays. ``until_s`` (N,): the time at which it goes on, seconds since the fleet's
    common start, where that is a time of day; else NaN. Of the pieces (N - 1,): ``cap_m_s``, the highest speed that
    climb, descent and corners allow; ``command_m_s``, the commanded speed over ground; ``level``, the horizontal
    fraction of its length; ``accel_m_s2``; ``airspeed_m_s`` (N - 1, 2), the highest level and on its slope; ``column``
    (take-off or landing); ``seq``, the wire item. ``ground`` (M, 2): metres along the track, and the ground below, m
    AMSL. ``goal``: the node at which the planned path ends. ``keeps_airspeed``: the commanded speed is through the air,
    and wind adds to it.
    """

    name: str
    points: Floats
    hold_s: Floats
    until_s: Floats
    cap_m_s: Floats
    command_m_s: Floats
    level: Floats
    accel_m_s2: Floats
    column: Bools
    seq: Indices
    ground: Floats
    goal: int
    ends_in_air: bool
    slowing_m_s2: float
    airspeed_m_s: Floats
    not_flown: tuple[Note, ...]
    keeps_airspeed: bool = False

    @cached_property
    def length_m(self) -> Floats:
        """(N - 1,) length of each piece in space."""
        return np.asarray(np.linalg.norm(np.diff(self.points, axis=0), axis=1))

    @cached_property
    def node_m(self) -> Floats:
        """(N,) metres along the track to each node."""
        return np.concatenate([[0.0], np.cumsum(self.length_m)])

    def heights_m(self, along_m: Floats) -> tuple[Floats, Floats]:
        """The heights above sea and above ground at ``along_m`` (K,), metres along the track."""
        amsl_m = np.interp(along_m, self.node_m, self.points[:, 2])
        return amsl_m, amsl_m - np.interp(along_m, *self.ground.T)

    def slack_m(self, times_s: Floats, along_m: Floats) -> Floats:
        """(M - 1,) metres along the path by which the motion between two samples may deviate from uniform motion.

        ``times_s``, ``along_m`` (M,): samples, including every stop. Between two of them, the speed changes no faster
        than their pieces allow, and lies between 0 and the highest speed that they allow. So the slack is 0 between
        samples that are flown at that highest speed.
        """
        seconds, flown = np.diff(times_s), np.diff(along_m)
        speed = flown / seconds
        ends = np.cumsum(self.length_m)[:-1]
        first, last = np.searchsorted(ends, along_m[:-1], side="left"), np.searchsorted(ends, along_m[1:], side="right")
        ranges = np.column_stack([first, last + 1]).ravel()
        allowed = np.minimum(self.cap_m_s, self.command_m_s / np.maximum(self.level, 0.05))
        fastest = np.maximum.reduceat(np.append(allowed, 0.0), ranges)[::2]
        accel = np.maximum.reduceat(np.append(self.accel_m_s2, 0.0), ranges)[::2]
        # A lower commanded speed takes effect slowly; until then the speed before it counts.
        fastest = np.maximum.reduce([fastest, speed, np.append(0.0, speed[:-1]), np.full_like(speed, 1e-9)])
        return np.asarray(np.minimum(accel * seconds**2 / 8.0, flown * (1.0 - speed / fastest)))

    def braking(self) -> Floats:
        """(N,) the largest v² at each node from which every later speed cap and stop can still be met.

        The vehicle does not brake ahead of a lower commanded speed, because the command comes only at its item.
        """
        heard = self.command_m_s.copy()
        for i in range(1, len(heard)):
            if self.hold_s[i] == PASSED:
                heard[i] = max(heard[i], heard[i - 1])
        with np.errstate(divide="ignore"):
            square = np.minimum(np.minimum(self.cap_m_s, heard / self.level), 1e6) ** 2
        gain = 2.0 * self.accel_m_s2 * self.length_m
        w = np.zeros(len(self.points))
        for i in range(len(w) - 2, 0, -1):
            w[i] = 0.0 if self.hold_s[i] != PASSED else min(square[i - 1], square[i], w[i + 1] + gain[i])
        return w


class _Line:
    """Collects nodes and pieces in order. ``in_space``: the commanded speed is along the path, not over ground."""

    def __init__(self, start: Floats, *, in_space: bool) -> None:
        self.in_space = in_space
        self.points = [start]
        self.hold_s, self.until_s = [0.0], [math.nan]
        self.pieces: list[tuple[float, float, float, float, bool, int]] = []

    def add(
        self, to: Floats, stretch: Stretch, kinematics: Kinematics, *, corner_m_s: float = math.inf, cap_m_s: float = 0
    ) -> None:
        """Add a piece to ``to``; ``cap_m_s`` > 0 sets its speed in a column."""
        delta = to - self.points[-1]
        length = float(np.linalg.norm(delta))
        if length <= 1e-9:
            return
        level, rise = float(math.hypot(delta[0], delta[1])) / length, float(delta[2]) / length
        climb, descent = stretch.rates_m_s or (kinematics.climb_m_s, kinematics.descent_m_s)
        vertical = climb if rise > 0 else descent
        if not cap_m_s:
            rate = vertical / abs(rise) if abs(rise) > 1e-9 else math.inf
            cap_m_s = min(rate, corner_m_s / level if level else math.inf)
        if self.in_space or (rise != 0.0 and math.isinf(vertical)):  # the ideal vehicle holds it in space
            level = 1.0
        accel = kinematics.vertical_accel_m_s2 if stretch.column else kinematics.accel_m_s2
        self.pieces.append((cap_m_s, stretch.speed_m_s, level, accel, stretch.column, stretch.seq))
        self.points.append(to)
        self.hold_s.append(PASSED)
        self.until_s.append(math.nan)

    def add_timed(self, to: Floats, stretch: Stretch, seconds: float) -> None:
        """Add a piece to ``to`` that takes this time; its speed changes at once at its ends."""
        delta = to - self.points[-1]
        length = float(np.linalg.norm(delta))
        level = 1.0 if length == 0.0 else float(math.hypot(delta[0], delta[1])) / length
        self.pieces.append((length / seconds, stretch.speed_m_s, level, AT_ONCE_M_S2, stretch.column, stretch.seq))
        self.points.append(to)
        self.hold_s.append(PASSED)
        self.until_s.append(math.nan)

    def stop(self, s: Stretch, depart_s: float) -> None:
        """Stop at the last node for the hold of a stretch, in addition to an earlier stop there."""
        self.hold_s[-1] = max(self.hold_s[-1], 0.0) + (s.hold_s if s.until_s is None else 0.0)
        if s.until_s is not None:
            self.until_s[-1] = depart_s + s.until_s


def make_track(
    mission: Mission,
    vehicle: Vehicle,
    world: World,
    kinematics: Kinematics,
    *,
    rtl_rel_home_m: float | None = None,
    airborne: bool = False,
    depart_s: float = 0.0,
) -> CommandedTrack:
    """Return the path that ``mission`` (as stored on board) commands ``vehicle`` to fly.

    ``airborne``: it begins at the top of its take-off. ``depart_s``: when it is planned to leave, after the common
    start.

    ``not_flown`` lists the parts that are not understood or cannot be simulated. Raises ValueError if the mission does
    not fly at all.
    """
    flight = follow_in(world, mission, vehicle, rtl_rel_home_m=rtl_rel_home_m, terrain_error_m=0.0)
    if not flight.stretches:
        raise ValueError(f"{vehicle.name}: the mission flies nowhere")
    if vehicle.lays_curves:
        flight.stretches = [_as_measured(s, mission, world) for s in flight.stretches]
    wing = vehicle.turn_radius_m > 0.0
    if wing:
        bend(flight, mission, vehicle, world.frame)
        if vehicle.autopilot is Autopilot.ARDUPLANE:
            flight.stretches = [_in_thin_air(s, kinematics) for s in flight.stretches]
    _, ends = ends_of(flight.stretches, world)
    if airborne:
        first = next((k for k, s in enumerate(flight.stretches) if not s.column), 0)
        flight.stretches, ends = flight.stretches[first:], ends[first:]
    # A leg begins where the last one ended: a gap between them was not understood and is listed in `not_flown`.
    line, goal, i = _Line(ends[0, 0], in_space=wing), 0, 0
    home_amsl_m = _home_amsl_m(mission, world) if vehicle.autopilot is Autopilot.PX4 else None
    stretches = flight.stretches
    while i < len(stretches):
        s = stretches[i]
        if s.column and not (wing and _slants(ends[i])):
            _column(line, ends[i], s, kinematics, home_amsl_m)
            line.stop(s, depart_s)
        elif _stands(ends[i]):
            line.stop(s, depart_s)
        else:
            last = _end_of_flight(stretches, i) if wing else _end_of_run(stretches, ends, i)
            _run(line, stretches[i : last + 1], ends[i : last + 1], kinematics, world)
            line.stop(stretches[last], depart_s)
            i = last
        if stretches[i].on_path:
            goal = len(line.points) - 1
        if math.isinf(line.hold_s[-1]):
            break
        i += 1
    if not line.pieces:
        raise ValueError(f"{vehicle.name}: the mission flies nowhere")
    return _track(vehicle, line, goal, flight, kinematics, stretches[min(i, len(stretches) - 1)], world)


def _home_amsl_m(mission: Mission, world: World) -> float:
    """The ground at home, or home's own altitude where that is unknown."""
    ground = world.ground_amsl(mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7)
    return mission.home.amsl_m if math.isnan(ground) else ground


def _track(
    vehicle: Vehicle, line: _Line, goal: int, flight: Flight, kinematics: Kinematics, last: Stretch, world: World
) -> CommandedTrack:
    name, turns = vehicle.name, []
    if vehicle.turn_radius_m > 0.0 and vehicle.autopilot is not Autopilot.ARDUPLANE:
        turns.append(Note("turns_flown_as_corners", radius_m=vehicle.turn_radius_m))
    cap, command, level, accel, column, seq = zip(*line.pieces, strict=True)
    points = np.array(line.points)
    if not np.isfinite(points).all():
        raise InputError(f"{name}: the mission follows terrain that the terrain model does not know")
    return CommandedTrack(
        name, points, np.array(line.hold_s), np.array(line.until_s), np.array(cap), np.array(command), np.array(level),
        np.array(accel), np.array(column, dtype=np.bool_), np.array(seq, dtype=np.intp), _ground(points, world), goal,
        not (last.column and last.end[2] < last.start[2]), kinematics.slowing_m_s2,
        _airspeeds(points, kinematics),
        (*flight.not_judged, *_left_out(flight), *turns), vehicle.keeps_airspeed,
    )  # fmt: skip


def _ground(points: Floats, world: World) -> Floats:
    """(M, 2) metres along a track, every `GROUND_STEP_M` and at its nodes, and the ground there; its own height where
    that is unknown."""
    node_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at_m = np.union1d(node_m, np.linspace(0.0, node_m[-1], math.ceil(node_m[-1] / GROUND_STEP_M) + 1))
    east_m, north_m, amsl_m = (np.interp(at_m, node_m, points[:, k]) for k in range(3))
    ground_m = world.airspace.surface.high_at(east_m, north_m)
    return np.column_stack([at_m, np.where(np.isnan(ground_m), amsl_m, ground_m)])


def _airspeeds(points: Floats, kinematics: Kinematics) -> Floats:
    """(N - 1, 2) the highest airspeeds along each piece: level at its altitude, and on its slope."""
    way = np.diff(points, axis=0)
    rise = way[:, 2] / np.maximum(np.linalg.norm(way, axis=1), STANDS_M)
    each = zip(rise.tolist(), points[1:, 2].tolist(), strict=True)
    return np.array([(kinematics.airspeed_on(0.0, z), kinematics.airspeed_on(r, z)) for r, z in each])


def _left_out(flight: Flight) -> list[Note]:
    """Return what is flown more simply than an autopilot would."""
    circles = sorted({s.seq for s in flight.stretches if s.kind == "loiter" and s.reach_m > 0.0})
    again = sorted({s.seq for s in flight.stretches if s.times > 1})
    return [
        *(Note("circle_not_flown", seq) for seq in circles),
        *(Note("jump_flown_once", seq) for seq in again),
    ]


def _stands(ends: Floats) -> bool:
    return bool(np.linalg.norm(ends[1] - ends[0]) <= STANDS_M)


def _end_of_run(stretches: Sequence[Stretch], ends: Floats, first: int) -> int:
    """Return the index of the stretch at whose end the vehicle stops; way points without a hold are passed.

    It stops before a landing or a return, and where the frame changes from terrain to another or back (mode_auto.cpp,
    `set_next_wp`).
    """
    i = first
    while i + 1 < len(stretches):
        here, after = stretches[i], stretches[i + 1]
        if here.hold_s > 0.0 or after.column or after.kind != here.kind or after.terrain != here.terrain:
            break
        if _stands(ends[i + 1]) and after.hold_s > 0.0:
            break
        i += 1
    return i


def _end_of_flight(stretches: Sequence[Stretch], first: int) -> int:
    """Return the index of the last stretch of the same kind that a fixed wing flies; its stop there takes no time."""
    i = first
    while i + 1 < len(stretches) and stretches[i + 1].kind == stretches[first].kind:
        i += 1
    return i


def _slants(ends: Floats) -> bool:
    return bool(np.hypot(*(ends[1] - ends[0])[:2]) > STANDS_M)


def _column(line: _Line, ends: Floats, s: Stretch, kinematics: Kinematics, home_amsl_m: float | None) -> None:
    """Add a vertical piece: straight up, or straight down, with slow descent at the end.

    ``home_amsl_m``: the vehicle slows down by its height over home, wherever it lands (PX4); None: over its landing.
    """
    start, end = line.points[-1], ends[1]
    climb, descent = s.rates_m_s or (kinematics.climb_m_s, kinematics.descent_m_s)
    if end[2] >= start[2]:
        low = start[2] + kinematics.takes_off_below_m
        if s.kind == "takeoff" and start[2] < low < end[2]:
            line.add(np.array([*end[:2], low]), s, kinematics, cap_m_s=min(climb, PX4_TAKE_OFF_M_S))
        line.add(end, s, kinematics, cap_m_s=climb)
        return
    low = (end[2] if home_amsl_m is None else home_amsl_m) + kinematics.land_below_m
    if start[2] > low:
        line.add(np.array([*end[:2], max(low, end[2])]), s, kinematics, cap_m_s=descent)
    line.add(end, s, kinematics, cap_m_s=min(kinematics.land_m_s, descent))


def _run(line: _Line, stretches: Sequence[Stretch], ends: Floats, kinematics: Kinematics, world: World) -> None:
    """Add legs that are flown without a stop, with rounded corners."""
    terrain = stretches[0].terrain
    legs = [i for i, s in enumerate(stretches) if not _stands(ends[i])]
    if not legs:
        return
    corners = np.array([line.points[-1], *(ends[i, 1] for i in legs)])
    if terrain:  # the height above ground changes linearly along the leg
        corners[:, 2] -= world.vehicle_terrain.ground_at(corners[:, 0], corners[:, 1])
    if kinematics.lays_curves:
        _curves(line, corners, [stretches[i] for i in legs], kinematics, world)
        return
    arcs = [rounded(corners[k : k + 3], kinematics) for k in range(len(legs) - 1)]
    sharp_end = corners[-1][None, :], math.inf
    for k, i in enumerate(legs):  # second half of the previous corner, straight piece, first half of the next corner
        way: list[tuple[Floats, float]] = []
        if k > 0:
            nodes, corner_m_s = arcs[k - 1]
            way += [(node, corner_m_s) for node in nodes[len(nodes) // 2 + 1 :]]
        nodes, corner_m_s = arcs[k] if k < len(arcs) else sharp_end
        way.append((nodes[0], math.inf))
        way += [(node, corner_m_s) for node in nodes[1 : len(nodes) // 2 + 1]]
        for to, corner_m_s in way:
            if terrain:
                _over_ground(line, to, stretches[i], kinematics, corner_m_s, world)
            else:
                line.add(to, stretches[i], kinematics, corner_m_s=corner_m_s)


def _curves(line: _Line, corners: Floats, stretches: Sequence[Stretch], kinematics: Kinematics, world: World) -> None:
    """Add legs that are flown as ArduPilot's S-curves; in the terrain frame ``corners`` hold heights above ground."""
    terrain, ground_at = stretches[0].terrain, world.vehicle_terrain.ground_at

    def cut(a: Floats, b: Floats) -> Floats:
        """The way from ``a`` to ``b`` in short parts, if it follows the ground."""
        parts = max(1, math.ceil(float(np.hypot(*(b - a)[:2])) / TERRAIN_PART_M)) if terrain else 1
        places = np.linspace(a, b, parts + 1)
        places[:, 2] += ground_at(places[:, 0], places[:, 1]) if terrain else 0.0
        return places

    most = [
        leg_limits(cut(a, b), b - a, s, kinematics)
        for a, b, s in zip(corners[:-1], corners[1:], stretches, strict=True)
    ]
    first = [0, *(k for k in range(1, len(stretches)) if terrain or stretches[k].seq != stretches[k - 1].seq)]
    ends = [*first[1:], len(stretches)]  # chords of one curve are one leg
    ways = [corners[a : b + 1] for a, b in zip(first, ends, strict=True)]
    speed, accel = (np.minimum.reduceat(np.array([one[n] for one in most]), first) for n in (0, 1))
    times, places, leg = step_legs(ways, speed, accel, kinematics)
    for k in range(1, len(times)):
        parts = cut(places[k - 1], places[k])[1:]
        for to in parts:
            line.add_timed(to, stretches[first[leg[k]]], (times[k] - times[k - 1]) / len(parts))


def _over_ground(line: _Line, to: Floats, s: Stretch, kinematics: Kinematics, corner_m_s: float, world: World) -> None:
    """Add a piece whose height is above ground, in parts that follow the terrain."""
    here = line.points[-1]
    parts = max(1, math.ceil(float(math.hypot(*(to[:2] - here[:2]))) / TERRAIN_PART_M))
    f = np.arange(parts + 1) / parts
    en = here[:2] + f[:, None] * (to[:2] - here[:2])
    ground = world.vehicle_terrain.ground_at(en[:, 0], en[:, 1])
    agl = here[2] - ground[0]
    for point in np.column_stack([en, ground + agl + f * (to[2] - agl)])[1:]:
        line.add(point, s, kinematics, corner_m_s=corner_m_s)


def _as_measured(s: Stretch, mission: Mission, world: World) -> Stretch:
    """Return a leg with its true speed over ground, because ArduPilot flies the commanded speed in its own metres.

    Those are measured on a sphere, from home; longitudes are scaled by the cosine of the latitude midway between home
    and the way point (`Location::get_vector_xy_from_origin_NE`).
    """
    if s.column:
        return s
    home_lat, home_lon = mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7

    def from_home(lat: float, lon: float) -> tuple[float, float]:
        east = math.remainder(lon - home_lon, 360.0) * math.cos(math.radians(lat + home_lat) / 2.0)
        return east * SCALING_M_PER_DEGREE, (lat - home_lat) * SCALING_M_PER_DEGREE

    counted_m = math.dist(from_home(*s.start[:2]), from_home(*s.end[:2]))
    places = np.array([s.start[:2], s.end[:2]])
    true_m = math.dist(*world.frame.to_plane(places[:, 0], places[:, 1]).tolist())
    return s if counted_m <= STANDS_M else replace(s, speed_m_s=s.speed_m_s * true_m / counted_m)


def _in_thin_air(s: Stretch, kinematics: Kinematics) -> Stretch:
    """Return a stretch with the true airspeed at its middle in place of the indicated one, and rates to match."""
    kelvin_per_288 = 1.0 - 0.0065 * 0.5 * (s.start[2] + s.end[2]) / 288.15
    faster = kelvin_per_288 ** (-0.5 * (9.80665 / (287.053 * 0.0065) - 1.0))  # the standard atmosphere
    climb, descent = s.rates_m_s or (kinematics.climb_m_s, kinematics.descent_m_s)
    return replace(s, speed_m_s=s.speed_m_s * faster, rates_m_s=(climb * faster, descent * faster))
