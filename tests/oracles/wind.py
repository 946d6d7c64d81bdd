"""Flights in a wind, integrated in small steps from the definitions of `docs/concepts/wind.md` alone.

It shares no code with the package: a set of winds is read from plain numbers, the wind is looked up at the aircraft's
own height and time in every step, and the aircraft advances at the speed over ground that the wind triangle, or the
largest lean, allows there. A copter speeds up and brakes evenly; it rounds a corner 2 m inside the way point, at the
speed that its acceleration across allows there. ArduCopter's curves take up to some tenths of a second longer or
shorter at each corner, so a flight in still air is compared as well. A wing has no acceleration along its path; its
corners are arcs, cut to chords of `CHORD_M`.

`Extremes` looks for the winds of a set with the earliest and the latest arrivals: corners, random ones, and from the
best of these a search step by step. Where the wind varies, each leg has the wind that is best or worst for that leg.
"""

from __future__ import annotations

import math
import random
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product

Share = tuple[float, float]
Vector = tuple[float, float]
Point = tuple[float, float, float]

STEP_S, FINE_S = 1.0, 0.05
"""Steps at a steady speed, and while a copter speeds up or brakes, s."""
SLOWEST_M_S = 0.02
CHORD_M, CUT_M = 2.0, 2.0
GRAVITY_M_S2 = 9.80665
LONGEST_S = 50_000.0


@dataclass(frozen=True)
class Winds:
    """A set: ``speed_m_s[t][l]``, ``from_deg[t][l]`` are the ranges (low, high) at a time and a height."""

    speed_m_s: Sequence[Sequence[tuple[float, float]]]
    from_deg: Sequence[Sequence[tuple[float, float]]]
    heights_m: Sequence[float] = (0.0,)
    above_ground: bool = True
    times_s: Sequence[float] = (0.0,)

    def at(self, share: Share, amsl_m: float, agl_m: float, at_s: float) -> Vector:
        """East and north, m/s: linear between heights and times, the nearest beyond them."""
        t, dt = _between(self.times_s, at_s)
        h, dh = _between(self.heights_m, agl_m if self.above_ground else amsl_m)
        east = north = 0.0
        for i, part_t in ((t, 1.0 - dt), (t + 1, dt)):
            for k, part_h in ((h, 1.0 - dh), (h + 1, dh)):
                if part_t and part_h:
                    low, high = self.speed_m_s[i][k]
                    first, last = self.from_deg[i][k]
                    speed = low + share[0] * (high - low)
                    angle = math.radians(first + share[1] * (last - first))
                    east -= part_t * part_h * speed * math.sin(angle)
                    north -= part_t * part_h * speed * math.cos(angle)
        return east, north


def _between(nodes: Sequence[float], x: float) -> tuple[int, float]:
    if x <= nodes[0]:
        return 0, 0.0
    if x >= nodes[-1]:
        return len(nodes) - 1, 0.0
    k = bisect_right(nodes, x) - 1
    return k, (x - nodes[k]) / (nodes[k + 1] - nodes[k])


@dataclass(frozen=True)
class Craft:
    """``speed_m_s``: a copter's over ground, a wing's indicated. ``air_m_s``: a copter's highest airspeed on the level.

    ``per_slope``: that at the `SLOPES` through the air, as parts of it; empty: the same at each. ``radius_m``: of a
    wing's arcs; 0 is a copter. ``accel_m_s2``, ``corner_m_s2`` are a copter's.
    """

    speed_m_s: float
    air_m_s: float = math.inf
    radius_m: float = 0.0
    climb_m_s: float = 5.0
    descent_m_s: float = 5.0
    accel_m_s2: float = 1.5
    corner_m_s2: float = 2.5
    per_slope: tuple[float, ...] = ()

    def air_at_m_s(self, slope: float) -> float:
        """A copter's highest airspeed where it rises by ``slope`` through the air."""
        if not self.per_slope:
            return self.air_m_s
        at = min(max((slope - SLOPES[0]) * 100.0, 0.0), len(SLOPES) - 1.001)
        k = int(at)
        return self.air_m_s * (self.per_slope[k] + (at - k) * (self.per_slope[k + 1] - self.per_slope[k]))

    @property
    def wing(self) -> bool:
        return self.radius_m > 0.0


def leaning_air_m_s(lean_deg: float, amsl_m: float, slope: float = 0.0) -> float:
    """The horizontal airspeed at which ArduPilot's simulated quadrotor balances its drag (SIM_Frame.h), while it rises
    by ``slope`` metres per metre through the air."""
    weight = 3.0 * GRAVITY_M_S2

    def density(amsl: float) -> float:
        return 1.225 * math.pow(1.0 - 0.0065 * amsl / 288.15, 4.2559)

    def rotors(thrust: float, amsl: float) -> float:
        return 0.2 * math.sqrt(thrust * density(amsl) * 0.385)

    # It holds 15.08 m/s at 45° and 593 m, which gives the area of its body.
    of_rotors = 0.5 * 15.08 * rotors(weight * math.sqrt(2.0), 593.0)
    area = (weight - of_rotors) / (0.5 * density(593.0) * 15.08**2)
    lean, low, high = math.radians(lean_deg), 0.0, 80.0
    push = 0.5 * density(amsl_m) * area
    for _ in range(60):
        v = 0.5 * (low + high)
        ahead = v * (math.cos(lean) - slope * math.sin(lean))
        above = v * (math.sin(lean) + slope * math.cos(lean))
        thrust = weight
        for _ in range(20):
            thrust = weight * math.cos(lean) + push * above * abs(above) + rotors(max(thrust, 0.0), amsl_m) * above
        slows = push * ahead * abs(ahead) + rotors(max(thrust, 0.0), amsl_m) * ahead
        low, high = (v, high) if slows < weight * math.sin(lean) else (low, v)
    return low


SLOPES = tuple(k / 100.0 for k in range(-60, 61))


def air_per_slope(lean_deg: float, amsl_m: float) -> tuple[float, ...]:
    """Airspeeds at the `SLOPES` through the air, as parts of the one on the level."""
    level = leaning_air_m_s(lean_deg, amsl_m)
    return tuple(leaning_air_m_s(lean_deg, amsl_m, slope) / level for slope in SLOPES)


def true_air_m_s(indicated_m_s: float, amsl_m: float) -> float:
    """The true airspeed, by the standard atmosphere."""
    kelvin = 288.15 - 0.0065 * amsl_m
    pressure = (kelvin / 288.15) ** (9.80665 / (287.053 * 0.0065))
    return indicated_m_s * math.sqrt(kelvin / 288.15 / pressure)


@dataclass
class Path:
    """Nodes of what is flown; ``leg``: the leg that each lies on; ``passed``: the node of each way point."""

    nodes: list[Point] = field(default_factory=list)
    leg: list[int] = field(default_factory=list)
    most_m_s: list[float] = field(default_factory=list)
    passed: list[int] = field(default_factory=list)

    def add(self, point: Point, leg: int, most_m_s: float = math.inf) -> None:
        self.nodes.append(point)
        self.leg.append(leg)
        self.most_m_s.append(most_m_s)


def path_of(points: Sequence[Point], craft: Craft) -> Path:
    """What is flown between ``points``, from the first one; heights change evenly along the way between two of them."""
    path = Path()
    path.add(points[0], 0, 0.0)
    path.passed.append(0)
    corners = [_corner(points[k - 1], points[k], points[k + 1], craft) for k in range(1, len(points) - 1)]
    before = 0.0
    for k in range(1, len(points)):
        a, b = points[k - 1], points[k]
        run = math.dist(a[:2], b[:2])
        ux, uy = ((b[0] - a[0]) / run, (b[1] - a[1]) / run) if run else (0.0, 0.0)
        if k == len(points) - 1 or not corners[k - 1][0]:
            path.add(b, k, 0.0 if k == len(points) - 1 else math.inf)
            path.passed.append(len(path.nodes) - 1)
            before = 0.0
            continue
        turn, radius, most_m_s = corners[k - 1]
        tangent = radius * math.tan(0.5 * abs(turn))
        half = 0.5 * radius * abs(turn)
        nxt = math.dist(b[:2], points[k + 1][:2])
        after = corners[k][1] * math.tan(0.5 * abs(corners[k][0])) if k < len(points) - 2 else 0.0
        half_after = 0.5 * corners[k][1] * abs(corners[k][0]) if k < len(points) - 2 else 0.0
        arrive = before_half(path, a, before) + run - before - tangent  # metres flown up to the arc
        whole_in = arrive + half
        whole_out = half + nxt - tangent - after + half_after
        start = b[0] - tangent * ux, b[1] - tangent * uy
        heading = math.atan2(uy, ux)
        z_in = b[2] - (b[2] - a[2]) * half / max(whole_in, 1e-9)
        path.add((*start, z_in), k, most_m_s)
        parts = 2 * max(1, math.ceil(half / CHORD_M))
        for i in range(1, parts + 1):
            now = turn * i / parts
            chord = 2.0 * radius * math.sin(0.5 * abs(now))
            x, y = start[0] + chord * math.cos(heading + 0.5 * now), start[1] + chord * math.sin(heading + 0.5 * now)
            rest = 2.0 * i / parts - 1.0
            slope = (b[2] - z_in) if rest <= 0.0 else (points[k + 1][2] - b[2]) * half / max(whole_out, 1e-9)
            path.add((x, y, b[2] + rest * slope), k if rest <= 0.0 else k + 1, most_m_s)
            if 2 * i == parts:
                path.passed.append(len(path.nodes) - 1)
        before = tangent
    return path


def before_half(path: Path, a: Point, before: float) -> float:
    """Metres flown from way point ``a`` to the last node, along the second half of its arc."""
    if not before:
        return 0.0
    way = path.nodes[path.passed[-1] :]
    return math.fsum(math.dist(p[:2], q[:2]) for p, q in pairwise(way))


def _corner(before: Point, here: Point, after: Point, craft: Craft) -> tuple[float, float, float]:
    """Its turn, the radius of its arc, and the speed that it allows."""
    ax, ay, bx, by = here[0] - before[0], here[1] - before[1], after[0] - here[0], after[1] - here[1]
    if math.hypot(ax, ay) < 0.01 or math.hypot(bx, by) < 0.01:
        return 0.0, 0.0, 0.0
    turn = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
    if abs(turn) < 1e-3:
        return 0.0, 0.0, math.inf
    if craft.wing:
        return turn, craft.radius_m, math.inf
    half = min(0.5 * abs(turn), 0.5 * math.pi - 1e-3)
    tangent = min(CUT_M / math.tan(0.5 * half), 0.5 * math.hypot(ax, ay), 0.5 * math.hypot(bx, by))
    radius = tangent / math.tan(half)
    return turn, radius, math.sqrt(craft.corner_m_s2 * radius)


@dataclass
class Flown:
    """``arrive_s``: at each way point since the first, inf if never; ``air_m``: metres through the air."""

    arrive_s: list[float]
    air_m: float


def fly(
    path: Path, craft: Craft, winds: Winds, share_of: Callable[[int], Share], *,
    ground: Callable[[float, float], float] = lambda east, north: 0.0, start_s: float = 0.0,
) -> Flown:  # fmt: skip
    """Fly a path in the wind whose share on leg k is ``share_of(k)``, from the time ``start_s``."""
    length = [math.dist(p, q) for p, q in pairwise(path.nodes)]
    braking = [0.0] * len(path.nodes)
    for i in range(len(length) - 1, 0, -1):
        cap = path.most_m_s[i] ** 2 if craft.accel_m_s2 < math.inf else math.inf
        braking[i] = min(cap, braking[i + 1] + 2.0 * craft.accel_m_s2 * length[i])
    clock, v, air_m = 0.0, 0.0, 0.0
    reached = [0.0]
    for i, whole in enumerate(length):
        p, q = path.nodes[i], path.nodes[i + 1]
        done = 0.0
        while whole - done > 1e-9:
            z = p[2] + (q[2] - p[2]) * done / whole
            here = p[0] + (q[0] - p[0]) * done / whole, p[1] + (q[1] - p[1]) * done / whole
            wind = winds.at(share_of(path.leg[i + 1]), z, z - ground(*here), start_s + clock)
            most = _along_m_s(p, q, whole, z, craft, wind)
            if not most > 0.0 or clock > LONGEST_S:
                return Flown(reached + [math.inf] * (len(path.nodes) - i - 1), math.inf)
            left = whole - done
            if craft.wing or math.isinf(craft.accel_m_s2):
                v, mean, step = most, most, min(STEP_S, left / most)
            else:
                rounds = path.most_m_s[i] == path.most_m_s[i + 1] > 0.0  # a chord of an arc
                cap = min(most, path.most_m_s[i]) if rounds else most

                def may(left_m: float, most_m_s: float = cap, then: float = braking[i + 1]) -> float:
                    return min(most_m_s, math.sqrt(then + 2.0 * craft.accel_m_s2 * max(left_m, 0.0)))

                even = abs(v - may(left)) < 1e-6 and v * v < braking[i + 1] + craft.accel_m_s2 * left
                step = STEP_S if even else FINE_S
                gain = craft.accel_m_s2 * step
                ends = min(max(may(left - v * step), v - gain), v + gain)
                begins, v = v, max(ends, SLOWEST_M_S)
                mean = max(0.5 * (begins + v), SLOWEST_M_S)
                step = min(step, left / mean)
            done += mean * step
            clock += step
            flat = math.dist(p[:2], q[:2]) / whole
            course = ((q[0] - p[0]) / whole, (q[1] - p[1]) / whole)
            air_m += math.hypot(mean * course[0] - wind[0], mean * course[1] - wind[1]) * step if flat > 0.0 else 0.0
        reached.append(clock)
    return Flown([reached[k] for k in path.passed], air_m)


def _along_m_s(p: Point, q: Point, whole: float, z: float, craft: Craft, wind: Vector) -> float:
    """The highest speed along a piece in a wind; 0 where it cannot keep its track."""
    flat, rise = math.dist(p[:2], q[:2]) / whole, (q[2] - p[2]) / whole
    rate = craft.climb_m_s if rise > 0.0 else craft.descent_m_s
    by_rate = rate / abs(rise) if abs(rise) > 1e-9 else math.inf
    if flat < 1e-9:
        return by_rate
    east, north = (q[0] - p[0]) / whole / flat, (q[1] - p[1]) / whole / flat
    along, across = wind[0] * east + wind[1] * north, wind[1] * east - wind[0] * north
    if craft.wing:  # |v·d - w| = V, with the direction d in space
        square = true_air_m_s(craft.speed_m_s, z) ** 2 - across**2 - along**2 * (1.0 - flat**2)
        return min(along * flat + math.sqrt(square), by_rate) if square > 0.0 else 0.0
    air, most = craft.air_m_s, 0.0
    for _ in range(8 if craft.per_slope and rise else 1):  # what it leans for depends on how fast it climbs
        air = craft.air_at_m_s(rise / flat * most / air)
        if air <= abs(across):
            return 0.0
        most = max(along + math.sqrt(air**2 - across**2), 0.0)
    return min(min(craft.speed_m_s, most) / flat, by_rate)


@dataclass
class Extremes:
    """The earliest and latest arrival at each way point that witnesses found, and the least and most metres of air."""

    earliest_s: list[float]
    latest_s: list[float]
    most_air_m: float

    @classmethod
    def of(
        cls, path: Path, craft: Craft, winds: Winds, rng: random.Random, *, varying: bool = False, draws: int = 6,
        searched: int = 12, start_s: float = 0.0, ground: Callable[[float, float], float] = lambda east, north: 0.0,
    ) -> Extremes:  # fmt: skip
        """Look for witnesses among the winds of a set."""
        found: list[Flown] = []

        def flown(share_of: Callable[[int], Share]) -> Flown:
            found.append(fly(path, craft, winds, share_of, ground=ground, start_s=start_s))
            return found[-1]

        tried: dict[Share, float] = {}

        def arrival(share: Share) -> float:
            if share not in tried:
                tried[share] = flown(lambda leg: share).arrive_s[-1]
            return tried[share]

        for share in [*product((0.0, 1.0), (0.0, 0.5, 1.0)), *((rng.random(), rng.random()) for _ in range(draws))]:
            arrival(share)
        for sign in (1.0, -1.0):
            best = max(tried, key=lambda s: sign * tried[s])
            size, left = 0.25, searched
            while left > 0 and size > 0.01:
                near = [
                    (min(max(best[0] + a * size, 0.0), 1.0), min(max(best[1] + b * size, 0.0), 1.0))
                    for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))
                ]
                left -= len(near)
                better = max(near, key=lambda s: sign * arrival(s))
                if sign * arrival(better) > sign * arrival(best):
                    best = better
                else:
                    size *= 0.5
        if varying:
            legs = sorted(set(path.leg))
            for sign in (1.0, -1.0):
                chosen = {leg: _of_leg(path, craft, winds, leg, sign, start_s) for leg in legs}
                flown(chosen.__getitem__)
            for _ in range(draws):
                drawn = {leg: (rng.random(), rng.random()) for leg in legs}
                flown(drawn.__getitem__)
        return cls(
            [min(column) for column in zip(*(f.arrive_s for f in found), strict=True)],
            [max(column) for column in zip(*(f.arrive_s for f in found), strict=True)],
            max(f.air_m for f in found),
        )


def _of_leg(path: Path, craft: Craft, winds: Winds, leg: int, sign: float, at_s: float) -> Share:
    """The share, of some, with the lowest (``sign`` 1) or highest speed in the middle of a leg."""
    pieces = [i for i, k in enumerate(path.leg[1:]) if k == leg]
    if not pieces:
        return 0.5, 0.5
    i = max(pieces, key=lambda i: math.dist(path.nodes[i], path.nodes[i + 1]))
    p, q = path.nodes[i], path.nodes[i + 1]
    whole, z = math.dist(p, q), 0.5 * (p[2] + q[2])
    shares = list(product((0.0, 0.5, 1.0), [k / 8.0 for k in range(9)]))
    if whole < 1e-9:
        return 0.5, 0.5
    return min(shares, key=lambda s: sign * _along_m_s(p, q, whole, z, craft, winds.at(s, z, z, at_s)))


def still(craft: Craft, path: Path) -> Flown:
    """The flight without a wind."""
    calm = Winds([[(0.0, 0.0)]], [[(0.0, 0.0)]])
    return fly(path, replace(craft), calm, lambda leg: (0.0, 0.0))
