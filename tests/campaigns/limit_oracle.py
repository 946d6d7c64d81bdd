"""An independent check of a case's mission: the lines that the vehicle may fly, judged at points 0.25 m apart.

It shares no code with the check except the conversion to and from degrees. It reads items from their wire numbers,
flies legs straight in the plane or in degrees, cuts corners as each autopilot may, and compares every point with the
surface and the zones around it, as far as errors and clearance reach. Sampling can miss a violation, but every
violation that it finds is one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.vehicle import Autopilot
from tests.campaigns.limit_cases import POSTS_M, WING_RADIUS_M, WINGED, Case
from tests.oracles.legs import Oracle

STEP_M = 0.25
ALLOWED = 0.05
"""Tolerance (m, or degrees): a mission called safe may break a limit by no more than this."""

TAKE_OFFS, LANDS, CIRCLES = (22, 84), (21, 85), (17, 18)


@dataclass(frozen=True, eq=False)
class Line:
    """Points (N, 3), flown one after the other. ``track_m``, ``altitude_m``: how far the vehicle may be off them.

    ``column``: exempt from min AGL, angles and terrain clearance; ``angles``: whether climb limits apply.
    """

    points: Floats
    track_m: float
    altitude_m: float
    column: bool = False
    angles: bool = True


def stored_m(item: MissionItem, autopilot: Autopilot) -> float:
    """The stored altitude: ArduPilot float32 times 100, truncated to whole centimetres; PX4 float32."""
    z = np.float32(item.z)
    return float(z) if autopilot is Autopilot.PX4 else int(np.float32(z * np.float32(100.0))) / 100.0


def _beside(points: Floats, a: Floats, b: Floats) -> Floats:
    """Horizontal distances (N,) of points from the leg from ``a`` to ``b``."""
    way = (b - a)[:2]
    t = np.clip((points[:, :2] - a[:2]) @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
    return np.asarray(np.hypot(*(points[:, :2] - a[:2] - t[:, None] * way).T))


class Flight:
    """The mission as flown: `lines` yields the lines that the vehicle may fly."""

    def __init__(self, case: Case, rng: np.random.Generator) -> None:
        self.case, self.rng = case, rng
        self.autopilot = case.mission.autopilot
        self.oracle = Oracle(case.surface.ground_m, case.surface.top_m, case.ground.to_grid, case.zones)
        self.degrees = bool(rng.random() < 0.5)
        home = case.mission.home
        self.home = self.place(home.lat_e7, home.lon_e7)
        self.datum = self.ground(self.home)
        self.shift_m = case.terrain_error_m * (1.0 if int(self.datum * 1e3) % 2 else -1.0)
        """How far all of the vehicle's terrain is off, since it armed."""

    # -- places ------------------------------------------------------------------------------------------------------

    def place(self, x: int, y: int) -> Floats:
        return np.asarray(self.case.frame.to_plane(x / 1e7, y / 1e7))

    def climbs_m(self, item: MissionItem) -> float:
        """A take-off's height (m) above home: at least 1 m on ArduCopter, at least MIS_TAKEOFF_ALT (2.5 m) on PX4."""
        least = {Autopilot.ARDUCOPTER: 1.0, Autopilot.PX4: 2.5}.get(self.autopilot, -math.inf)
        return max(stored_m(item, self.autopilot), least)

    def ground(self, en: Floats) -> float:
        return float(self.oracle.height(self.case.surface.ground_m, en[:1], en[1:2])[0])

    def read(self, en: Floats) -> Floats:
        """(N,) what ArduPilot takes for the ground at points (N, 2): whole metres at posts of its flat degree tiles."""
        lat, lon = self.case.frame.to_degrees(*en.T).T
        metre = float(np.float32(0.011131884502145034)) * 1e7 / POSTS_M
        a, o = np.floor(lat), np.floor(lon)
        north, east = (lat - a) * metre, (lon - o) * metre * np.cos(np.radians(0.5 * (lat + a)))
        i, j = np.floor(north), np.floor(east)

        def post(k: Floats, n: Floats) -> Floats:
            at = a + k / metre
            there = self.case.frame.to_plane(at, o + n / metre / np.cos(np.radians(0.5 * (at + a))))
            return np.ceil(self.oracle.height(self.case.surface.ground_m, *there.T) - 1e-6)

        u, v = north - i, east - j
        west, right = (post(i, n) + u * (post(i + 1, n) - post(i, n)) for n in (j, j + 1))
        return np.asarray(west + v * (right - west))

    def target(self, item: MissionItem, here: Floats) -> Floats:
        """The place an item leads to from ``here``; ArduCopter keeps its altitude if the item's altitude is 0."""
        en = self.place(item.x, item.y)
        if self.autopilot is Autopilot.ARDUCOPTER and stored_m(item, self.autopilot) == 0.0:
            read = self.read(np.array([here[:2], en]))
            kept = here[2] - read[0] + read[1] if item.frame == 10 else here[2]
            return np.array([*en, kept])
        base = {0: 0.0, 3: self.datum}.get(item.frame, float(self.read(en[None])[0]) + self.shift_m)
        return np.array([*en, base + stored_m(item, self.autopilot)])

    def around(self, item: MissionItem, middle: Floats, points: Floats) -> Floats:
        """Points (N, 3) of a circle around ``middle`` at its altitude, in the item's frame."""
        if item.frame == 10:
            points[:, 2] += self.read(points[:, :2]) - self.read(middle[None, :2])
        return points

    def straight(self, a: Floats, b: Floats, terrain: bool = False) -> Floats:
        """Points from ``a`` to ``b`` at an even slope; with ``terrain`` the height above ground changes evenly."""
        count = max(2, math.ceil(float(np.linalg.norm(b - a)) / STEP_M) + 1)
        t = np.linspace(0.0, 1.0, count)[:, None]
        points = a + t * (b - a)
        if self.degrees:
            ends = self.case.frame.to_degrees(*np.array([a[:2], b[:2]]).T)
            points[:, :2] = self.case.frame.to_plane(*(ends[0] + t * (ends[1] - ends[0])).T)
        if terrain:
            z = self.read(points[:, :2])
            agl = a[2] - z[0] + t[:, 0] * ((b[2] - z[-1]) - (a[2] - z[0]))
            points[:, 2] = z + agl
        return points

    # -- the flight --------------------------------------------------------------------------------------------------

    def lines(self) -> Iterator[Line]:
        if self.case.family in WINGED:
            yield from self.wing()
            return
        track, high = self.case.limits.track_error_m, self.case.limits.altitude_error_m
        here = np.array([*self.home, self.datum])
        begun, before = here, None  # where the vehicle truly is, and the way point before `here`
        stops, circle, left = True, 0.0, here  # `left`: a place on the circle
        for item, after in self.in_order():
            if item.command in TAKE_OFFS:
                up = np.array([*self.home, self.datum + self.climbs_m(item)])
                yield Line(self.straight(here, up), track, high, column=True)
                here = begun = up
            elif item.command == 20:
                yield from self.home_again(left if circle > 0.0 else begun, here)
                return
            elif item.command in LANDS:
                over = np.array([*self.place(item.x, item.y), here[2]])
                yield Line(self.straight(here, over), track, high)
                yield Line(self.straight(over, np.array([*over[:2], self.ground(over[:2])])), track, high, column=True)
                return
            elif item.command in (16, 17, 18, 82):
                to = self.target(item, here)
                if item.command == 82:
                    leaves = np.zeros(3) if stops or before is None else here - before
                    beyond = np.zeros(3) if item.params[0] > 0 or after is None else self.target(after, to) - to
                    yield Line(self.spline(here, to, leaves, beyond), track, high)
                elif circle > 0.0:  # from anywhere on the circle
                    yield Line(self.straight(left, to, item.frame == 10), track, high, angles=False)
                else:
                    edge = self.around(item, to, self.edge(item, here, to)[None])[0]
                    even = self.case.family != "frames"  # a shift is an error of height, which no angle counts
                    yield Line(self.straight(here, edge, item.frame == 10), track, high, angles=even)
                    yield from self.cut(item, begun, here, to, after)
                begun, circle = self.turn(item, begun, to), 0.0
                before, here, stops = here, to, item.command != 82 and item.params[0] > 0
                if item.command in CIRCLES:
                    circle = self.radius(item, to[2])
                    yield Line(self.around(item, to, self.ring(to, circle)), track, high, angles=False)
                    begun, left = to, self.around(item, to, self.on_circle(to, circle)[None])[0]

    def in_order(self) -> Iterator[tuple[MissionItem, MissionItem | None]]:
        """Items in the order flown, with at most three rounds of each jump; with each, the next item flown to."""
        items, first = self.case.mission.items, self.case.mission.first_seq
        flown, index, left = [], 0, {}
        while index < len(items) and len(flown) < 60:
            item = items[index]
            if item.command == 177:
                rounds = left.setdefault(index, min(int(item.params[1]), 3))
                left[index] = rounds - 1
                index = int(item.params[0]) - first if rounds > 0 else index + 1
                continue
            flown.append(item)
            index += 1
        for k, item in enumerate(flown):
            yield item, next((i for i in flown[k + 1 :] if i.command in (16, 17, 18, 82)), None)

    def edge(self, item: MissionItem, here: Floats, to: Floats) -> Floats:
        """Where ArduCopter reaches the circle that it is to fly, at the circle's altitude."""
        radius, way = self.radius(item, to[2]), to - here
        far = math.hypot(way[0], way[1])
        if item.command != 18 or self.autopilot is not Autopilot.ARDUCOPTER or far <= radius:
            return to
        return np.array([*(here[:2] + way[:2] * (far - radius) / far), to[2]])

    def radius(self, item: MissionItem, amsl: float) -> float:
        if item.command not in CIRCLES or (item.command == 17 and self.autopilot is not Autopilot.ARDUPLANE):
            return 0.0
        given = abs(item.params[2])
        if self.autopilot is Autopilot.ARDUCOPTER:
            return given if given > 0 else 10.0
        return (given if given > 1 else 60.0) * (1.0 - 0.0065 * amsl / 288.15) ** -4.2559

    def ring(self, middle: Floats, radius: float) -> Floats:
        a = np.linspace(0.0, 2.0 * np.pi, max(8, math.ceil(2.0 * np.pi * radius / STEP_M)))
        return middle + radius * np.column_stack([np.cos(a), np.sin(a), np.zeros(len(a))])

    def spline(self, a: Floats, b: Floats, leaves: Floats, beyond: Floats) -> Floats:
        way = b - a
        both, room = float(np.linalg.norm(leaves) + np.linalg.norm(beyond)), 4.0 * float(np.linalg.norm(way))
        if both > room:
            leaves, beyond = leaves * (room / both), beyond * (room / both)
        t = np.linspace(0.0, 1.0, max(50, math.ceil(6.0 * float(np.linalg.norm(way)) / STEP_M)))[:, None]
        return np.asarray(a + leaves * t + (3 * way - 2 * leaves - beyond) * t**2 + (leaves + beyond - 2 * way) * t**3)

    def on_circle(self, middle: Floats, radius: float) -> Floats:
        a = self.rng.uniform(0.0, 2.0 * np.pi)
        return middle + radius * np.array([math.cos(a), math.sin(a), 0.0])

    def home_again(self, here: Floats, meant: Floats) -> Iterator[Line]:
        """A copter's or PX4's return: up, straight home, down; ArduCopter may climb less within its cone.

        ``meant``: the nominal beginning of the return; ``here``: the true one.
        """
        track, high = self.case.limits.track_error_m, self.case.limits.altitude_error_m
        off = math.dist(here[:2], meant[:2])
        track = 0.0 if 0.0 < off <= track else track
        top = max(self.datum + self.case.rtl_m, here[2])
        if self.autopilot is Autopilot.ARDUCOPTER and self.rng.random() < 0.5:
            top = max(here[2], min(top, self.datum + 3.0 * math.dist(here[:2], self.home)))
        up, over = np.array([*here[:2], top]), np.array([*self.home, top])
        yield Line(self.straight(here, up), track, high, column=True)
        yield Line(self.straight(up, over), track, high)
        yield Line(self.straight(over, np.array([*self.home, self.datum])), track, high, column=True)

    # -- corners -----------------------------------------------------------------------------------------------------

    def accepts_m(self, item: MissionItem) -> float:
        """The distance (m) before a way point at which PX4 turns to the next leg."""
        return item.params[1] if item.command == 16 and item.params[1] > 0 else 10.0

    def turn(self, item: MissionItem, begun: Floats, to: Floats) -> Floats:
        """Where the vehicle turns to the next leg, having flown straight from its last turn at ``begun``."""
        if self.autopilot is Autopilot.ARDUCOPTER or self.case.family == "terrain":
            return to
        radius, way = self.accepts_m(item), to - begun
        far = math.hypot(way[0], way[1])
        part = max(0.0, 1.0 - radius / far) if far > 1e-6 else 0.0
        if self.autopilot is Autopilot.PX4 and abs(way[2]) * (1.0 - part) > 0.8:
            part = 1.0 - 0.8 / abs(way[2])  # it must also be within NAV_MC_ALT_RAD (0.8 m)
        return np.asarray(begun + part * way)

    def cut(
        self, item: MissionItem, begun: Floats, here: Floats, to: Floats, after: MissionItem | None
    ) -> Iterator[Line]:
        """The leg as flown from where the vehicle left the leg before; for ArduCopter, the corner at its end."""
        limits = self.case.limits
        track, high = limits.track_error_m, limits.altitude_error_m
        if self.autopilot is Autopilot.ARDUCOPTER:
            if item.command == 16 and item.params[0] == 0 and after is not None and after.command in (16, 17):
                one, two = to - here, self.target(after, to) - to
                long = [float(np.linalg.norm(v)) for v in (one, two)]
                if min(long) > 1e-3 and after.frame != 10 and item.frame != 10:
                    u, v = one / long[0], two / long[1]
                    d = min(0.5 * min(long), 4.0 * 2.0 / max(float(np.linalg.norm(v - u)), 1e-6))
                    s = np.linspace(0.0, 1.0, max(9, math.ceil(2.0 * d / STEP_M)))[:, None]
                    held = track >= 2.0
                    yield Line(
                        to - d * (1.0 - s) ** 2 * u + d * s**2 * v, 0.0 if held else track,
                        0.0 if held and high >= 2.0 else high, angles=False,
                    )  # fmt: skip
            return
        if np.array_equal(begun, here):
            return
        part = float(self.rng.choice([1.0, 1.0, self.rng.uniform(0.05, 1.0)]))
        joins = here + part * (to - here)
        points = np.concatenate([self.straight(begun, joins), self.straight(joins, to)])
        # Corners within the errors are covered by them; the millimetre covers a rounded acceptance radius.
        off = float(np.minimum(_beside(points, begun, here), _beside(points, here, to)).max())
        held, held_high = off <= track + 1e-3, abs(begun[2] - here[2]) <= high + 1e-3
        yield Line(points, 0.0 if held else track, 0.0 if held_high else high, angles=False)

    # -- a fixed wing ------------------------------------------------------------------------------------------------

    def wing(self) -> Iterator[Line]:
        limits = self.case.limits
        items = self.case.mission.items
        if self.case.family == "vtol":
            yield from self.upright(items)
            return
        climb = math.tan(math.radians(min(items[0].params[0], limits.max_climb_deg)))
        rise = stored_m(items[0], self.autopilot)
        ahead = self.place(items[0].x, items[0].y) - self.home
        top = np.array([*(self.home + ahead / math.hypot(*ahead) * rise / climb), self.datum + rise])
        yield Line(
            self.straight(np.array([*self.home, self.datum]), top), limits.track_error_m, limits.altitude_error_m, True
        )
        points = np.array([top, *(self.target(i, top) for i in items[1:])])
        yield Line(arcs(points, WING_RADIUS_M), limits.track_error_m, limits.altitude_error_m)
        thin = (1.0 - 0.0065 * points[-1, 2] / 288.15) ** -4.2559
        yield Line(
            self.ring(points[-1], abs(items[-1].params[2]) * thin), limits.track_error_m, limits.altitude_error_m,
            angles=False,
        )  # fmt: skip

    def upright(self, items: Sequence[MissionItem]) -> Iterator[Line]:
        """Up, along arcs, level to the landing and down."""
        track, high = self.case.limits.track_error_m, self.case.limits.altitude_error_m
        top = np.array([*self.home, self.datum + stored_m(items[0], self.autopilot)])
        points = np.array([top, *(self.target(i, top) for i in items[1:])])
        points[-1, 2] = points[-2, 2]
        yield Line(self.straight(np.array([*self.home, self.datum]), top), track, high, column=True)
        yield Line(arcs(points, WING_RADIUS_M), track, high)
        ground = float(self.case.surface.ground_at(*points[-1, :2]))
        yield Line(self.straight(points[-1], np.array([*points[-1, :2], ground])), track, high, column=True)


def arcs(points: Floats, radius: float) -> Floats:
    """The line through ``points`` with corners rounded by tangent arcs; even slope from arc middle to arc middle."""
    way = np.diff(points[:, :2], axis=0)
    unit = way / np.hypot(*way.T)[:, None]
    turn = np.array([math.atan2(u[0] * v[1] - u[1] * v[0], float(u @ v)) for u, v in pairwise(unit)])
    tangent = np.concatenate([[0.0], radius * np.tan(0.5 * np.abs(turn)), [0.0]])
    flown = []
    for k in range(len(way)):
        a, b, u = points[k, :2], points[k + 1, :2], unit[k]
        parts = []
        if k:
            parts.append(_half(a + tangent[k] * u, -u, -turn[k - 1], radius)[::-1])
        ends = a + tangent[k] * u, b - tangent[k + 1] * u
        count = max(2, math.ceil(math.dist(*ends) / STEP_M))
        parts.append(ends[0] + np.linspace(0.0, 1.0, count)[:, None] * (ends[1] - ends[0]))
        if k + 1 < len(way):
            parts.append(_half(ends[1], u, turn[k], radius))
        line = np.concatenate(parts)
        s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
        flown.append(np.column_stack([line, points[k, 2] + s / s[-1] * (points[k + 1, 2] - points[k, 2])]))
    return np.concatenate(flown)


def _half(start: Floats, heading: Floats, turn: float, radius: float) -> Floats:
    """The first half of an arc from ``start`` with heading vector (2,) that turns by ``turn`` (rad, left positive)."""
    side = math.copysign(1.0, turn)
    centre = start + side * radius * np.array([-heading[1], heading[0]])
    a = np.linspace(0.0, 0.5 * turn, max(2, math.ceil(0.5 * radius * abs(turn) / STEP_M)))
    spoke = start - centre
    return centre + np.column_stack(
        [np.cos(a) * spoke[0] - np.sin(a) * spoke[1], np.sin(a) * spoke[0] + np.cos(a) * spoke[1]]
    )


# -- the judgement ---------------------------------------------------------------------------------------------------


def worst(case: Case, rng: np.random.Generator) -> tuple[float, str]:
    """The deepest breach of a limit (m or degrees) by the mission of ``case``, and its kind; negative if none."""
    flight = Flight(case, rng)
    found = (-math.inf, "")
    for line in flight.lines():
        for depth, kind in _depths(flight.oracle, case, line):
            found = max(found, (depth, kind))
    return found


def _depths(oracle: Oracle, case: Case, line: Line) -> Iterator[tuple[float, str]]:
    limits, (e, n, h) = case.limits, line.points.T
    error, near, clearance = line.altitude_m, line.track_m, limits.horizontal_clearance_m
    top = oracle.highest(oracle.top, e, n, near)
    if np.isnan(top).any():
        yield math.inf, "coverage"
        return
    if not line.column:
        yield float((limits.min_agl_m + error - (h - top)).max()), "min_agl"
        if clearance > 0:
            wide = np.fmax(oracle.highest(oracle.top, e, n, near + clearance), top)
            yield (math.inf, "coverage") if np.isnan(wide).any() else (float((wide - h + error).max()), "clearance")
        run = np.hypot(np.diff(e), np.diff(n))
        if line.angles and run.max() > 1e-3:
            slope = np.degrees(np.arctan2(np.diff(h), run))[run > 1e-3]
            yield float(slope.max()) - limits.max_climb_deg, "climb"
            yield float(-slope.min()) - limits.max_descent_deg, "descent"
    if limits.max_agl_m is not None:
        lowest = -oracle.highest(-oracle.ground, e, n, near)
        yield float((h + error - lowest).max()) - limits.max_agl_m, "max_agl"
    if limits.max_amsl_m is not None:
        yield float(h.max()) + error - limits.max_amsl_m, "max_amsl"
    for k in range(len(case.zones)):
        if breached(oracle, k, line, near + clearance - ALLOWED, error - ALLOWED):
            yield 2.0 * ALLOWED, f"zone {k}"


def breached(oracle: Oracle, k: int, line: Line, reach: float, error: float) -> bool:
    """Whether a point of zone ``k`` within ``reach`` of the line has the line within ``error`` of its altitudes."""
    zone, (e, n, h) = oracle.zones[k], line.points.T
    gap = oracle.shape_distance(zone, e, n)
    close = gap < reach
    if not close.any():
        return False
    e, n, h, gap = e[close], n[close], h[close], gap[close]
    over_ground = any(x is not None and x.datum == "agl" for x in (zone.floor, zone.ceiling))
    low, high = oracle.levels(zone, e, n)
    if not over_ground:
        return bool(((low < high) & (h + error > low) & (h - error < high)).any())
    rings = 4 if reach > 0 else 0
    for ring in range(rings + 1):
        for a in np.arange(16 if ring else 1) * (2 * np.pi / 16) + 0.3 * ring:
            d = reach * ring / max(rings, 1) * (1 - 1e-9)
            qe, qn = e + d * np.cos(a), n + d * np.sin(a)
            low, high = oracle.levels(zone, qe, qn)
            met = (low < high) & (h + error > low) & (h - error < high)
            deep = 0.0 if ring else min(reach, 0.0)
            if met.any() and (oracle.shape_distance(zone, qe[met], qn[met]) <= deep).any():
                return True
    return False


def battery_needed_j(case: Case) -> float:
    """Energy (J) of the whole mission, with every round of its jumps."""
    flight, energy = Flight(case, np.random.default_rng(0)), case.vehicle.energy
    items, first = case.mission.items, case.mission.first_seq
    here, spent, index, left = np.array([*flight.home, flight.datum]), 0.0, 0, {}

    def move(to: Floats, hold_s: float = 0.0) -> float:
        flat, rise = math.dist(here[:2], to[:2]), abs(float(to[2] - here[2]))
        return energy.horizontal_j_per_m * flat + energy.vertical_j_per_m * rise + energy.hover_w * hold_s

    while index < len(items):
        item = items[index]
        if item.command == 177:
            rounds = left.setdefault(index, int(item.params[1]))
            left[index] = rounds - 1
            index = int(item.params[0]) - first if rounds > 0 else index + 1
            continue
        if item.command in TAKE_OFFS:
            to = np.array([*flight.home, flight.datum + flight.climbs_m(item)])
        elif item.command in LANDS:
            over = np.array([*flight.place(item.x, item.y), here[2]])
            spent += move(over)
            here, to = over, np.array([*over[:2], flight.ground(over[:2])])
        else:
            to = flight.target(item, here)
        spent += move(to, item.params[0] if item.command == 16 else 0.0)
        here, index = to, index + 1
    return spent


def read_again(case: Case, text: str, plan: bool) -> Case:
    """The case with its mission read from a written file."""
    from gcsplan.mavlink.files.plan_file import read_plan
    from gcsplan.mavlink.files.waypoints_file import read_waypoints

    read = read_plan if plan else read_waypoints
    mission = read(text, autopilot=case.mission.autopilot, where="campaign", home_hint=case.mission.home)
    return replace(case, mission=replace(mission, name=case.mission.name))
