"""The mission trace: where a vehicle is along its mission, every stretch except the return itself, in the plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.check.motion.project import legs_in_plane
from gcsplan.check.motion.return_rules import RETURN_RULES
from gcsplan.check.motion.stopping import braking_distance_m, run_past_m
from gcsplan.check.motion.stretch import Flight, Place, Stretch
from gcsplan.vehicle import Vehicle
from gcsplan.world.world import World

TINY_M = 1e-3
LEAST_HALF = 0.25
"""Cosine of half a corner's angle, at least: beyond 150° a vehicle nearly stops in the corner."""


@dataclass(frozen=True, eq=False)
class MissionTrace:
    """Vertices by a running coordinate ``u`` that grows by horizontal plus vertical metres along each stretch.

    ``u``, ``east``, ``north``, ``amsl``, ``along`` (V,); between stretches ``u`` has a gap. ``along`` is the horizontal
    distance flown so far. For each stretch (S,): ``first`` and ``last`` u; ``seq``; ``track_m``, ``altitude_m``: by how
    much its errors exceed the limits' own errors; ``speed_m_s``. The first ``mains`` stretches are the mission's; the
    others may be flown instead.

    ``run_m`` (S,): how far the vehicle runs on, straight ahead, before it turns home; ``past`` (S, 3, 2): east and
    north, metres, of a triangle with the end of the stretch within which it stays that began its return there.
    """

    u: Floats
    east: Floats
    north: Floats
    amsl: Floats
    along: Floats
    first: Floats
    last: Floats
    seq: Indices
    track_m: Floats
    altitude_m: Floats
    speed_m_s: Floats
    run_m: Floats
    past: Floats
    world: World
    mains: int

    def cut(self, size_m: float) -> TraceParts:
        """The whole trace in parts of at most ``size_m`` or so."""
        counts = np.maximum(np.ceil((self.last - self.first) / size_m), 1.0).astype(int)
        stretch = np.repeat(np.arange(len(counts)), counts)
        step = (self.last - self.first) / counts
        number = np.concatenate([np.arange(n) for n in counts])
        start = self.first[stretch] + number * step[stretch]
        end = np.where(number + 1 == counts[stretch], self.last[stretch], start + step[stretch])
        return TraceParts(start, end, stretch)

    def points(self, u: Floats) -> Floats:
        """(N, 4) east, north, amsl, along at places on the trace."""
        return np.stack([np.interp(u, self.u, a) for a in (self.east, self.north, self.amsl, self.along)], axis=-1)

    def heights(self, parts: TraceParts) -> tuple[Floats, Floats]:
        """The lowest and the highest altitude AMSL of the vehicle on each part, with the stretch's own band."""
        ends = np.stack([np.interp(u, self.u, self.amsl) for u in (parts.start, parts.end)])
        low, high = ends.min(axis=0), ends.max(axis=0)
        a, b = np.searchsorted(self.u, parts.start, "right"), np.searchsorted(self.u, parts.end, "left")
        inner = np.flatnonzero(b > a)
        if len(inner):
            padded = np.append(self.amsl, 0.0)
            pairs = np.stack([a[inner], b[inner]], axis=-1).ravel()
            low[inner] = np.minimum(low[inner], np.minimum.reduceat(padded, pairs)[::2])
            high[inner] = np.maximum(high[inner], np.maximum.reduceat(padded, pairs)[::2])
        band = self.altitude_m[parts.stretch]
        return low - band, high + band

    def beginnings(self, parts: TraceParts) -> tuple[Floats, Floats]:
        """Where returns from each part begin, after the vehicle ran on: (N, 4, 2) points around it, and rise or fall.

        The second array (N, 2): by how much a return may begin below and above the part, 0 or 1 times `levels_off_m`.
        """
        ends = np.stack([self.points(u) for u in (parts.start, parts.end)], axis=1)
        first, last = ends[:, 0], ends[:, 1]
        whole = self.points(self.last[parts.stretch])
        way = whole - self.points(self.first[parts.stretch])
        past = self.past[parts.stretch]
        left = np.hypot(*(whole - last)[:, :2].T)
        ahead = np.hypot(*past[:, 0].T) + left
        run = np.minimum(self.run_m[parts.stretch], ahead)
        length = np.hypot(*way[:, :2].T)
        course = np.divide(way[:, :2], length[:, None], out=np.zeros((len(parts), 2)), where=length[:, None] > TINY_M)
        tip = last[:, :2] + run[:, None] * course
        tips = np.repeat(tip[:, None], 3, axis=1)
        ends_here = left <= TINY_M
        tips[ends_here] = (last[:, None, :2] + past)[ends_here]
        moves = length > TINY_M
        levels = np.stack([moves & (way[:, 2] < 0.0), moves & (way[:, 2] > 0.0)], axis=1)
        return np.concatenate([first[:, None, :2], tips], axis=1), levels.astype(float)

    def straight(self, parts: TraceParts) -> Bools:
        """(N,) whether each part is one straight piece, without a vertex within."""
        return np.searchsorted(self.u, parts.start, "right") >= np.searchsorted(self.u, parts.end, "left")

    def place(self, u: float) -> Place:
        """Latitude, longitude and AMSL of a place on the trace."""
        east, north, amsl, _ = self.points(np.array([u]))[0].tolist()
        lat, lon = self.world.frame.to_degrees(east, north).tolist()
        return lat, lon, amsl


@dataclass(frozen=True, eq=False)
class TraceParts:
    """N parts of a trace: from ``start`` to ``end`` (N,), on ``stretch`` (N,)."""

    start: Floats
    end: Floats
    stretch: Indices

    def __len__(self) -> int:
        return len(self.start)

    @property
    def size(self) -> Floats:
        """(N,) length of each part in u, metres."""
        return self.end - self.start

    @property
    def middle(self) -> Floats:
        """(N,) the u of each part's middle."""
        return 0.5 * (self.start + self.end)

    def take(self, which: Bools | Indices) -> TraceParts:
        """The chosen parts."""
        return TraceParts(self.start[which], self.end[which], self.stretch[which])

    def split(self, pieces: int) -> TraceParts:
        """Each part cut into ``pieces`` of equal size."""
        step = self.size / pieces
        start = (self.start[:, None] + np.arange(pieces) * step[:, None]).ravel()
        end = np.append(start[1:], 0.0)
        end[pieces - 1 :: pieces] = self.end
        return TraceParts(start, end, np.repeat(self.stretch, pieces))


def trace_of(flight: Flight, vehicle: Vehicle, world: World, terrain_error_m: float) -> MissionTrace | None:
    """The trace of a flight, including what may be flown instead of its stretches; None if it goes nowhere.

    A plane's columns, climb-outs and glides are left out: how it returns from near the ground is not known.
    """
    mains = [s for s in flight.stretches if s.kind != "rtl"]
    others = [s for s in flight.instead if s.kind != "rtl"]
    limits = vehicle.limits
    flown: list[tuple[Stretch, Floats, float, float]] = []
    for group in (mains, others):
        if not group:
            continue
        plane = legs_in_plane(group, limits, world, terrain_error_m)
        bounds = np.searchsorted(plane.owner, np.arange(len(group) + 1))
        for s, i, j in zip(group, bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
            points = np.vstack([plane.legs.start[i : i + 1], plane.legs.end[i:j]])
            track = float(plane.legs.track_error_m[i:j].max()) - limits.track_error_m
            altitude = float(plane.legs.altitude_error_m[i:j].max()) - limits.altitude_error_m
            if s.reach_m > 0.0 and s.start == s.end:  # a circle, which is left in any direction
                track += braking_distance_m(vehicle, s.speed_m_s)
            flown.append((s, points, max(track, 0.0), max(altitude, 0.0)))
    u, along, first, last = [], [], [], []
    at_u = so_far = 0.0
    kept: list[int] = []
    begun: dict[int, tuple[float, float]] = {}
    for number, (s, points, _, _) in enumerate(flown):
        run = np.hypot(*np.diff(points[:, :2], axis=0).T)
        rise = np.abs(np.diff(points[:, 2]))
        mine = at_u + np.concatenate([[0.0], np.cumsum(run + rise)])
        way = np.concatenate([[0.0], np.cumsum(run)])
        if number < len(mains):
            low, high = begun.get(s.seq, (so_far, so_far))
            begun[s.seq] = low, so_far + float(way[-1])
            mine_along = so_far + way
            so_far += float(way[-1])
        else:  # it lies beside the stretch that it replaces
            low, high = begun.get(s.seq, (so_far, so_far))
            part = way / way[-1] if way[-1] > 0.0 else way
            mine_along = low + part * (high - low)
        if s.column and not RETURN_RULES[vehicle.autopilot].climbs_first:
            continue
        kept.append(number)
        along.append(mine_along)
        u.append(mine)
        first.append(at_u)
        last.append(float(mine[-1]))
        at_u = float(mine[-1]) + 1.0
    if not kept or kept[0] >= len(mains):
        return None
    count = sum(number < len(mains) for number in kept)
    past = np.array([_past(flown, number, len(mains), vehicle) for number in kept])
    flown = [flown[number] for number in kept]
    points = np.vstack([p for _, p, _, _ in flown])
    run = np.array([braking_distance_m(vehicle, s.speed_m_s) for s, *_ in flown])
    return MissionTrace(
        np.concatenate(u), points[:, 0].copy(), points[:, 1].copy(), points[:, 2].copy(), np.concatenate(along),
        np.array(first), np.array(last), np.array([s.seq for s, *_ in flown], dtype=np.intp),
        np.array([t for *_, t, _ in flown]), np.array([a for *_, a in flown]),
        np.array([s.speed_m_s for s, *_ in flown]), run, past, world, count,
    )  # fmt: skip


def _past(
    flown: Sequence[tuple[Stretch, Floats, float, float]], number: int, mains: int, vehicle: Vehicle
) -> list[list[float]]:
    """`MissionTrace.past` of one stretch: straight on, on the course after the corner there, and the point between."""
    s = flown[number][0]
    course = _course(flown[number][1])
    if course is None:
        return [[0.0, 0.0]] * 3
    after = _course(flown[number + 1][1]) if number + 1 < len(flown) else None
    if number >= mains:  # what follows it is not known: as far as straight on
        after = course
    elif s.hold_s > 0.0 or number + 1 == mains or flown[number + 1][0].column or flown[number + 1][0].kind != s.kind:
        after = None
    if after is None:
        past_m = run_past_m(vehicle, s.speed_m_s, None)
        return [[past_m * course[0], past_m * course[1]]] * 3
    turn = abs((math.atan2(after[1], after[0]) - math.atan2(course[1], course[0]) + math.pi) % math.tau - math.pi)
    past_m = run_past_m(vehicle, s.speed_m_s, turn)
    both = course[0] + after[0], course[1] + after[1]
    share = 2.0 * past_m / max(both[0] ** 2 + both[1] ** 2, 4.0 * LEAST_HALF**2)
    return [
        [past_m * course[0], past_m * course[1]],
        [share * both[0], share * both[1]],
        [past_m * after[0], past_m * after[1]],
    ]


def _course(points: Floats) -> tuple[float, float] | None:
    """The unit vector from the first to the last of (N, 3) points in the plane; None if they stand above each other."""
    east, north = (points[-1, :2] - points[0, :2]).tolist()
    length = math.hypot(east, north)
    return None if length <= TINY_M else (east / length, north / length)
