"""How long each stretch of a flight takes: the fleet's model of motion (`fleet.motion.timing`), with the mission's own
speeds.

The same model makes a fleet's time table (`timing.Course`), so all times of a mission are of one kind: a vehicle
accelerates, brakes, rounds its corners, and stops where it holds and where a take-off or a landing begins or ends. A
corner's halves count for their own legs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.motion.project import ends_of
from gcsplan.check.motion.stretch import Stretch
from gcsplan.fleet.motion.timing import lays, legs, upright
from gcsplan.vehicle import Vehicle
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.terrain.vehicle_terrain import VehicleTerrain
from gcsplan.world.world import World

__all__ = ["DAY_S", "MODEL_PART", "MODEL_S", "FlightTimes", "Parts", "over_ground", "pace_over_ground", "spare_s"]

TERRAIN_STEP_M = 25.0
"""Longest piece, m, into which a leg that follows the ground is cut."""

ARDUPILOT_DEGREE_M = 111318.84502145034
"""Metres per degree, Location.h, `LOCATION_SCALING_FACTOR`. An ArduCopter flew 0.2 % faster than commanded east and
west at 37° N."""

WITHOUT_STOP_M = 1.0
"""A stretch that begins within this of the end of the one before it is flown without a stop: halves of arcs that
overlap end this near to each other."""

SLANTS_M = 0.01

DAY_S = 86400.0
"""A vehicle that is late at a gate waits as long, but for its lateness."""

MODEL_PART, MODEL_S = 0.005, 0.5
"""Two models of one motion differ by no more than this part of the time, or by no more than these seconds."""


def spare_s(time_s: float) -> float:
    """The seconds that a vehicle is early at a gate at least, after ``time_s`` of flight by the model."""
    return max(MODEL_S, MODEL_PART * time_s)


@dataclass(frozen=True, eq=False, slots=True)
class Parts:
    """The parts of a flight that are flown over ground, P of them, in the order flown.

    ``start``, ``end`` (P, 3) are in metres of the plane, ``stretch`` (P,) numbers of stretches; ``speed_m_s`` (P,) is
    the commanded speed: a fixed wing's indicated airspeed, others' speed over ground.
    """

    start: Floats
    end: Floats
    stretch: Indices
    speed_m_s: Floats


@dataclass(frozen=True, eq=False, slots=True)
class _StopToStop:
    """Stretches ``first`` to ``last`` that are flown from one standstill to the next, over ground."""

    first: int
    last: int
    points: Floats
    owner: Indices
    speed_m_s: Floats
    keys: dict[str, Any]


class FlightTimes:
    """How long each of N stretches takes, without the hold at its end; ``home_deg``: home's latitude and longitude.

    ``radius_m``: acceptance radii of items, by seq, that are not the vehicle's own.
    """

    def __init__(
        self, stretches: Sequence[Stretch], vehicle: Vehicle, world: World, home_deg: tuple[float, float],
        radius_m: Mapping[int, float] = MappingProxyType({}),
    ) -> None:  # fmt: skip
        _, ends = ends_of(stretches, world)
        self.vehicle = vehicle
        self._columns_s = np.zeros(len(stretches))
        self._runs: list[_StopToStop] = []
        home_m = world.ground_amsl(*home_deg)
        home_amsl_m = None if math.isnan(home_m) else home_m
        for first, last in _runs(stretches, ends):
            if _upright(stretches[first], ends[first]):
                self._columns_s[first] = _column_s(stretches[first], ends[first], vehicle, home_amsl_m)
            else:
                self._runs.append(
                    _run(first, stretches[first:last], ends[first:last], vehicle, world, home_deg, radius_m)
                )

    def seconds(self, ground_m_s: Floats | None = None) -> Floats:
        """(..., N) seconds in still air, or where the `parts` are flown at ``ground_m_s`` (..., P) at most."""
        flights: tuple[int, ...] = () if ground_m_s is None else ground_m_s.shape[:-1]
        if ground_m_s is not None and flights and not lays(self.vehicle):
            return np.array([self.seconds(one) for one in ground_m_s])
        seconds, done = np.tile(self._columns_s, (*flights, 1)), 0
        for run in self._runs:
            count = len(run.owner)
            wind = None if ground_m_s is None else ground_m_s[..., done : done + count]
            done += count
            way = legs(run.points, self.vehicle, run.owner, **run.keys, pace=run.speed_m_s, ground_m_s=wind)
            if way is not None:
                seconds[..., run.first : run.last] = way.shares_s(1.0, run.last - run.first)
        return seconds

    @property
    def turns(self) -> Bools:
        """(N,) whether a stretch ends without a stop."""
        found = np.zeros(len(self._columns_s), dtype=np.bool_)
        for run in self._runs:
            found[run.first : run.last - 1] = True
        return found

    @property
    def parts(self) -> Parts:
        """What is flown over ground."""
        none = [np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, dtype=np.intp), np.zeros(0)]
        rows = [(run.points[:-1], run.points[1:], run.owner + run.first, run.speed_m_s) for run in self._runs]
        return Parts(*(np.concatenate(row) for row in zip(none, *rows, strict=True)))


def _column_s(s: Stretch, ends: Floats, vehicle: Vehicle, home_amsl_m: float | None) -> float:
    if s.rates_m_s is not None:
        vehicle = replace(vehicle, climb_m_s=s.rates_m_s[0], descent_m_s=s.rates_m_s[1])
    parts = upright(ends[0, :2], float(ends[0, 2]), float(ends[1, 2]), vehicle, 0, home_amsl_m)
    return math.fsum(part.time_s(s.speed_m_s) for part in parts)


def _run(
    first: int, run: Sequence[Stretch], ends: Floats, vehicle: Vehicle, world: World, home_deg: tuple[float, float],
    radius_m: Mapping[int, float],
) -> _StopToStop:  # fmt: skip
    points, owner = np.concatenate([ends[:1, 0], ends[:, 1]]), np.arange(len(run), dtype=np.intp)
    follows = np.array([s.terrain for s in run])
    if follows.any():
        points, _, owner = over_ground(points, np.zeros(len(points)), owner, world.vehicle_terrain, follows)
    speed = np.array([s.speed_m_s for s in run])[owner]
    if vehicle.lays_curves:
        speed = speed * pace_over_ground(points, home_deg, world.frame)[:-1]
    own = (vehicle.climb_m_s, vehicle.descent_m_s)
    keys = {
        "leg": np.array([s.seq for s in run], dtype=np.intp)[owner],
        "rates_m_s": np.array([s.rates_m_s or own for s in run])[owner],
        "radius_m": np.array([radius_m.get(s.seq, vehicle.acceptance_m) for s in run])[owner],
        "follows": follows[owner],
    }
    return _StopToStop(first, first + len(run), points, owner, speed, keys)


def _runs(stretches: Sequence[Stretch], ends: Floats) -> Iterator[tuple[int, int]]:
    """Index ranges of stretches that are flown without a stop; a column is a range of its own."""
    first = 0
    for i in range(1, len(stretches) + 1):
        if i == len(stretches) or _stops(stretches[i - 1], stretches[i], ends[i - 1], ends[i]):
            yield first, i
            first = i


def _stops(s: Stretch, after: Stretch, ends: Floats, ends_after: Floats) -> bool:
    if s.hold_s > 0.0 or s.kind != after.kind or _upright(s, ends) or _upright(after, ends_after):
        return True
    # Between stretches that do not meet something is flown that is not known; but from its circles a climb-out flies to
    # the point over their middle, which is a stretch without a length.
    return math.dist(ends[1], ends_after[0]) > WITHOUT_STOP_M and (math.dist(*ends_after) > 0.0 or after.hold_s > 0.0)


def _upright(s: Stretch, ends: Floats) -> bool:
    return s.column and math.dist(ends[0, :2], ends[1, :2]) <= SLANTS_M


def pace_over_ground(points: Floats, home_deg: tuple[float, float], frame: Frame) -> Floats:
    """(N,) metres over ground per ArduPilot metre on each leg of ``points`` (N, 3), and last on the line to the first.

    ArduPilot takes a degree of latitude as equally long everywhere, and a degree of longitude as that times the cosine
    of the latitude halfway between home and the way point (Location.cpp, `get_vector_xy_from_origin_NE`).
    """
    lat, lon = frame.to_degrees(points[:, 0], points[:, 1]).T
    north = (lat - home_deg[0]) * ARDUPILOT_DEGREE_M
    span = (lon - home_deg[1] + 180.0) % 360.0 - 180.0
    east = span * ARDUPILOT_DEGREE_M * np.cos(np.radians(0.5 * (lat + home_deg[0])))
    own = np.hypot(np.roll(east, -1) - east, np.roll(north, -1) - north)
    true = np.linalg.norm(np.roll(points[:, :2], -1, axis=0) - points[:, :2], axis=1)
    return np.where(own > 0.01, true / np.maximum(own, 0.01), 1.0)


def over_ground(
    points: Floats, holds: Floats, numbers: Indices, terrain: VehicleTerrain, follows: np.ndarray | None = None
) -> tuple[Floats, Floats, Indices]:
    """Points (N, 3), holds (N,) and legs' numbers (N - 1,) with legs cut so that each keeps its height above ground.

    That is interpolated between a leg's ends, over the ground that the vehicle reads.

    ``follows`` (N - 1,): the legs that do so; None: all.
    """
    ground_at = terrain.ground_at
    agl = points[:, 2] - ground_at(points[:, 0], points[:, 1])
    out, waits, owners = [points[:1]], [holds[:1]], []
    for i in range(1, len(points)):
        a, b = points[i - 1], points[i]
        if follows is not None and not follows[i - 1]:
            out.append(points[i : i + 1])
            waits.append(holds[i : i + 1])
            owners.append(numbers[i - 1 : i])
            continue
        parts = max(1, math.ceil(math.hypot(*(b - a)[:2]) / TERRAIN_STEP_M))
        t = np.arange(1, parts + 1) / parts
        flat = a[:2] + t[:, None] * (b - a)[:2]
        amsl = ground_at(flat[:, 0], flat[:, 1]) + agl[i - 1] + t * (agl[i] - agl[i - 1])
        out.append(np.column_stack([flat, np.where(np.isnan(amsl), a[2] + t * (b[2] - a[2]), amsl)]))
        waits.append(np.append(np.zeros(parts - 1), holds[i]))
        owners.append(np.full(parts, numbers[i - 1]))
    return np.concatenate(out), np.concatenate(waits), np.concatenate(owners)
