"""Missions at the check's limit, drawn to undercut a bound or a proof: each is judged by `gcsplan.check` alone.

A witness begins with the plan's own items up to the take-off's top (a wing: its climb-out's end) and ends with the
items from its approach on; between them lie way points that this module draws. Each witness keeps whether the check
calls it safe, and its flown length or energy.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from gcsplan import check
from gcsplan.app.plan.model import Plan, VehiclePlan
from gcsplan.arrays import Floats
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import GLOBAL, RELATIVE, TERRAIN, Mission, MissionItem
from gcsplan.mission_file import MissionFile
from tests.campaigns.bound_paths import FINER, Air, ground_track, sampled, shortest_track, taut
from tests.campaigns.bound_worlds import Barrier, Case
from tests.oracles.optima_polish import thinner

LEG_M = 250.0
"""Longest leg of a drawn track: the check widens legs by their bow, which is a millimetre on such a leg."""
GROWN_M = (0.0, 0.006, 0.012, 0.03, 0.1, 0.4, 1.5, 4.0)
SAME_M = 1e-3
"""A witness begins and ends within this of where the plan does."""
LIFTED_M = (0.0, 0.01, 0.04, 0.15, 0.6, 2.5)


@dataclass(eq=False)
class Witness:
    """A judged mission and what it costs, in the plan's own unit."""

    how: str
    mission: Mission
    safe: bool
    cost: float


@dataclass(eq=False)
class Budget:
    """The budget of one vehicle: until ``until_s`` by the clock and at most ``left`` judgements."""

    until_s: float
    left: int

    @property
    def spent(self) -> bool:
        return self.left <= 0 or time.monotonic() > self.until_s


@dataclass(eq=False)
class Route:
    """The way points between the fixed ends of a plan, and the judge of others in their place.

    ``points`` (N, 3) are the plan's own, ends included: east, north, and z in the items' frame. ``fixed``: points that
    may not move (ends and vias). ``base_m``: AMSL of z = 0; NaN in the terrain frame. ``source``: judge there and not
    in the plan's world, for a plan of another world that only gives its ends.
    """

    case: Case
    plan: Plan
    vehicle: VehiclePlan
    budget: Budget
    source: MissionFile | None = None
    points: Floats = field(init=False)
    fixed: list[int] = field(init=False)
    base_m: float = field(init=False)
    seen: list[Witness] = field(default_factory=list)
    best: Witness | None = None
    known: dict[bytes, bool] = field(default_factory=dict)

    def __post_init__(self) -> None:
        v = self.vehicle
        m = v.mission
        legs = [leg for leg in check(self.plan)[v.name].legs if leg.on_path]
        self.first, self.last = legs[0].seq - m.first_seq, legs[-1].seq - m.first_seq
        self.inner = m.items[self.first : self.last]
        frame = m.items[self.last].frame
        self.base_m = {GLOBAL: 0.0, RELATIVE: m.home.amsl_m, TERRAIN: math.nan}[frame]
        start = legs[0].start
        z = (float(m.items[0].z) if math.isnan(self.base_m) else start[2] - self.base_m, float(m.items[self.last].z))
        rows = [[*self.place(start[0], start[1]), z[0]]]
        rows += [[*self.place(i.lat_deg, i.lon_deg), i.z] for i in self.inner]
        rows += [[*self.place(m.items[self.last].lat_deg, m.items[self.last].lon_deg), z[1]]]
        self.points = np.array(rows)
        vias = [np.array([p["east_m"], p["north_m"]]) for p in self.request.get("via", [])]  # type: ignore[attr-defined]
        # A wing passes a via on the arc between two way points.
        near = [np.argsort(np.hypot(*(self.points[:, :2] - p).T))[: 1 + self.wing] for p in vias]
        self.fixed = [0, *sorted(int(k) for pair in near for k in pair), len(self.points) - 1]
        if self.wing and len(self.points) > 3:  # its climb-out ends towards the second
            self.fixed.insert(1, 1)
        if self.vehicle.request.vehicle.vtol and self.vehicle.request.end == "land" and len(self.points) > 4:
            self.fixed.insert(-1, len(self.points) - 2)  # from there it has room to brake
        self.ends = (start, legs[-1].end)
        self.amsl = (start[2], legs[-1].end[2])

    @property
    def request(self) -> dict[str, object]:
        return next(v for v in self.case.vehicles if v["name"] == self.vehicle.name)

    @property
    def plain(self) -> bool:
        """Whether all items between the ends are way points that may be replaced."""
        return all(i.command == cmd.WAYPOINT for i in self.inner)

    @property
    def wing(self) -> bool:
        """Whether it flies on its wing, and its bound is that of missions with its climb-out: a VTOL's too."""
        return self.vehicle.request.vehicle.turn_radius_m > 0.0

    def place(self, lat: float, lon: float) -> tuple[float, float]:
        east, north = self.plan.world.frame.to_plane(lat, lon)
        return float(east), float(north)

    # -- judging -------------------------------------------------------------------------------------------------

    def mission(self, points: Floats, style: str) -> Mission:
        """The mission along ``points`` (N, 3); ``style``: "own" as the plan's way points are, "stop" where each is
        cut as little as the check allows: held by a copter, with the least radius of acceptance otherwise."""
        m = self.vehicle.mission
        own = self.inner[0] if self.inner else m.items[self.last]
        copter = m.autopilot == "arducopter"
        hold = 1.0 if style == "stop" and copter else 0.0
        radius = own.params[1]
        if style == "stop" and not copter:
            radius = 0.05 if m.autopilot == "px4" else 1.0
        middle = [self.item(p, m.items[self.last].frame, (hold, radius, 0.0, 0.0)) for p in points[1:-1]]
        tail = m.items[self.last :]
        if self.request.get("return_route") == "mission":
            at = next(k for k, i in enumerate(tail) if i.command == cmd.DO_RETURN_PATH_START)
            tail = (*tail[: at + 2], *middle[::-1], *tail[-2:])
        return replace(m, items=(*m.items[: self.first], *middle, *tail))

    def item(self, p: Floats, frame: int, params: tuple[float, float, float, float]) -> MissionItem:
        lat, lon = (float(x) for x in self.plan.world.frame.to_degrees(p[0], p[1]))
        z = round(float(p[2]) * 100.0 - 1e-4) / 100.0
        if self.vehicle.mission.autopilot != "px4":
            z = (math.floor(float(p[2]) * 100.0 + 0.5 - 1e-4) + 0.5) / 100.0  # it is cut to whole centimetres
        return MissionItem(cmd.WAYPOINT, frame, params, round(lat * 1e7), round(lon * 1e7), z)

    def judged(self, mission: Mission, how: str) -> bool:
        """Whether the check calls it safe; it is kept in `seen`, and in `best` if it is the cheapest safe one."""
        key = b"".join(item.wire for item in mission.items)
        if key in self.known:
            return self.known[key]
        self.budget.left -= 1
        verdict = self.verdict(mission)
        self.why = [f.message for f in verdict.findings][:2] + list(verdict.not_judged)[:1]
        found = Witness(how, mission, verdict.safe is True and self.ends_alike(verdict), self.cost_of(verdict))
        self.seen.append(found)
        self.known[key] = found.safe
        if found.safe and (self.best is None or found.cost < self.best.cost):
            self.best = found
        return found.safe

    def verdict(self, mission: Mission) -> Verdict:
        """The check's verdict in the world of the mission file."""
        if self.source is not None:
            return check(mission, self.source, vehicle=self.vehicle.name)
        return check(replace(self.plan, vehicles=(replace(self.vehicle, mission=mission),)))[self.vehicle.name]

    def ends_alike(self, verdict: Verdict) -> bool:
        """Whether the path begins and ends where the plan's does: a wing's climb-out may depend on what follows it."""
        legs = [leg for leg in verdict.legs if leg.on_path]
        if not legs:
            return False
        for place, end in ((legs[0].start, self.ends[0]), (legs[-1].end, self.ends[1])):
            off_m = math.dist(self.place(place[0], place[1]), self.place(end[0], end[1]))
            if off_m > SAME_M or abs(place[2] - end[2]) > SAME_M:
                return False
        return True

    def cost_of(self, verdict: Verdict) -> float:
        """Flown length in m, energy in J or time in s by the stated model, of the path; holds do not count."""
        if self.case.objective == "length":
            return verdict.length_m
        if self.case.objective == "time":
            fast = self.request["speed_m_s"][1]  # type: ignore[index]
            up, down = (float(self.request.get(key, math.inf)) for key in ("climb_m_s", "descent_m_s"))  # type: ignore[arg-type]
            rises = [(leg, leg.end[2] - leg.start[2]) for leg in verdict.path_legs]
            if self.wing:
                return math.fsum(
                    max(leg.length_m / fast, z / up, -z / down) * leg.times / thinner(0.5 * (leg.start[2] + leg.end[2]))
                    for leg, z in rises
                )
            return math.fsum(max(leg.horizontal_m / fast, z / up, -z / down) * leg.times for leg, z in rises)
        return math.fsum((leg.energy_j - leg.hold_j) * leg.times for leg in verdict.legs if leg.on_path)

    def try_points(self, points: Floats, how: str, style: str) -> bool:
        return not self.budget.spent and self.judged(self.mission(points, style), how)

    # -- the plan's own path -------------------------------------------------------------------------------------

    def tightened(self, points: Floats, fixed: list[int], style: str, how: str, sweeps: int = 3) -> Floats:
        """``points`` with fewer and nearer ones: all together, then each alone, by bisection until the check passes."""

        def chord(p: Floats) -> Floats:
            a, b, at = p[:-2], p[2:], p[1:-1]
            along = b - a
            t = ((at - a) * along).sum(1) / np.maximum((along * along).sum(1), 1e-12)
            out = p.copy()
            out[1:-1] = a + np.clip(t, 0.02, 0.98)[:, None] * along
            out[fixed] = p[fixed]
            return out

        for _ in range(sweeps):
            if self.budget.spent:
                break
            begun = points
            target = chord(points)
            low, high = 0.0, 1.0
            for _ in range(6):
                half = 0.5 * (low + high)
                if self.try_points(points + half * (target - points), f"{how}, pulled", style):
                    low = half
                else:
                    high = half
            points = points + low * (target - points)
            k = 1
            while k < len(points) - 1 and not self.budget.spent:
                if k in fixed:
                    k += 1
                    continue
                without = np.delete(points, k, axis=0)
                if self.try_points(without, f"{how}, one left out", style):
                    points, fixed = without, [i - (i > k) for i in fixed]
                    continue
                goal, part = chord(points)[k], 0.5
                while part > 0.03:
                    moved = points.copy()
                    moved[k] = points[k] + part * (goal - points[k])
                    if self.try_points(moved, f"{how}, one moved", style):
                        points = moved
                    else:
                        part *= 0.5
                        continue
                    break
                k += 1
            if len(begun) == len(points) and np.abs(begun - points).max() < 1e-3:
                break
        return points

    def sheared(self, points: Floats, fixed: list[int], style: str, how: str) -> Floats:
        """``points`` lowered together, and then each alone, until the check just passes."""
        free = np.ones(len(points), bool)
        free[fixed] = False
        if not free.any():
            return points
        least, most = 0.0, 3.0
        for _ in range(7):
            half = 0.5 * (least + most)
            if self.try_points(points - np.outer(free * half, [0.0, 0.0, 1.0]), f"{how}, lowered", style):
                least = half
            else:
                most = half
        points = points - np.outer(free * least, [0.0, 0.0, 1.0])
        line = np.interp(np.arange(len(points)), np.flatnonzero(~free), points[~free, 2])
        for k in np.flatnonzero(free):
            step = points[k, 2] - 0.5 * (points[k - 1, 2] + points[k + 1, 2])
            step = step if abs(step) > 0.02 else points[k, 2] - line[k]
            for part in (1.0, 0.4, 0.1):
                moved = points.copy()
                moved[k, 2] -= part * step
                if self.try_points(moved, f"{how}, one lowered", style):
                    points = moved
                    break
        return points

    # -- tracks of its own ---------------------------------------------------------------------------------------

    def along(self, track: Callable[[float], Floats | None], ways: tuple[str, ...], how: str) -> Floats | None:
        """The points of the tightest safe mission along ``track(grown_m)`` at a taut profile; None if none is safe."""
        if math.isnan(self.base_m):
            return None
        passed = None
        for style in ("stop", "own"):
            for lift in LIFTED_M if passed is None else LIFTED_M[:2]:
                for grown in GROWN_M:
                    if lift > 0.0 and grown not in (0.006, 0.1, 1.5):
                        continue
                    points = self.drawn(track, ways, grown, lift)
                    if points is not None and self.try_points(points, how, style):
                        passed = points if passed is None else passed
                        break
                else:
                    if self.budget.spent:
                        return passed
                    continue
                break
        return passed

    def drawn(
        self, track: Callable[[float], Floats | None], ways: tuple[str, ...], grown_m: float, lift_m: float
    ) -> Floats | None:
        """Points (N, 3) along a track at the lowest taut profile; longer aside where it would be too steep."""
        flat = track(grown_m)
        if flat is None or len(flat) < 2:
            return None
        for aside in (0.0, *self.asides(flat)):
            points = self._at_profile(_bulged(flat, aside), ways, lift_m)
            if points is not None:
                return points
        return None

    def asides(self, flat: Floats) -> Iterator[float]:
        """How far aside a track must bulge to be just long enough for its climb, m."""
        rise = self.amsl[1] - self.amsl[0]
        slope = self.air.slopes[0 if rise > 0 else 1]
        way = float(np.hypot(*np.diff(flat, axis=0).T).sum())
        if math.isfinite(slope) and abs(rise) / slope > way:
            leg = int(np.argmax(np.hypot(*np.diff(flat, axis=0).T)))
            long = float(math.dist(flat[leg], flat[leg + 1]))
            needed = long + abs(rise) / slope - way
            for more in (1e-5, 1e-4, 5e-4, 2e-3, 1e-2, 0.1):
                yield 0.5 * math.sqrt(max((needed * (1.0 + more)) ** 2 - long**2, 0.0))
                yield -0.5 * math.sqrt(max((needed * (1.0 + more)) ** 2 - long**2, 0.0))

    def _at_profile(self, flat: Floats, ways: tuple[str, ...], lift_m: float) -> Floats | None:
        air = self.air
        length = float(np.hypot(*np.diff(flat, axis=0).T).sum())
        cell = math.inf if air.ground.t is None else air.ground.t.cell_m
        step = max(min(0.125 * cell, length / 200.0), length / 700.0)
        passed = [b for b, way in zip(self.case.barriers, ways, strict=True) if way != "around"]
        at, s, corner = sampled(flat, step, passed, air.reach_m)
        low, high = air.band(at, ways, step / FINER)
        low, high = low + lift_m, high - min(lift_m, 0.01)
        for k, amsl in ((0, self.amsl[0]), (-1, self.amsl[1])):
            low[k] = high[k] = amsl
        for k, amsl in self.via_heights():
            place = int(np.argmin(np.hypot(*(at - self.points[k, :2]).T)))
            low[place] = high[place] = amsl
        profile = taut(s, low, high, air.slopes)
        if profile is None:
            return None
        kept = np.unique(np.concatenate([s[corner], profile[:, 0]]))
        kept = kept[np.concatenate([[True], np.diff(kept) > 1e-6])]
        kept = np.concatenate([[0.0], *(np.linspace(p, q, max(2, math.ceil((q - p) / LEG_M) + 1))[1:]
                                        for p, q in itertools.pairwise(kept))])  # fmt: skip
        z = np.interp(kept, *profile.T)
        return np.column_stack([np.interp(kept, s, at[:, 0]), np.interp(kept, s, at[:, 1]), z - self.base_m])

    def via_heights(self) -> list[tuple[int, float]]:
        agls = [p.get("agl_m") for p in self.request.get("via", [])]  # type: ignore[attr-defined]
        return [(k, self.points[k, 2] + self.base_m) for k, agl in zip(self.fixed[1:-1], agls, strict=True)
                if agl is not None]  # fmt: skip

    @cached_property
    def air(self) -> Air:
        return Air(self.case)

    def stops(self) -> list[Floats]:
        return [self.points[k, :2] for k in self.fixed]

    def choices(self, rng: np.random.Generator) -> Iterator[tuple[str, ...]]:
        """For each zone: around, over or under; all around and all passed first, then some at random."""
        can = [["around"] + ["over"] * (b.ceiling is not None) + ["under"] * (b.floor is not None)
               for b in self.case.barriers]  # fmt: skip
        seen: set[tuple[str, ...]] = set()
        draws = [tuple(c[-1] for c in can), tuple(c[0] for c in can), tuple(c[min(1, len(c) - 1)] for c in can)]
        draws += [tuple(str(rng.choice(c)) for c in can) for _ in range(4)]
        for ways in draws:
            if ways not in seen:
                seen.add(ways)
                yield ways

    def tracks(
        self, rng: np.random.Generator
    ) -> Iterator[tuple[str, tuple[str, ...], Callable[[float], Floats | None]]]:
        """Ways from end to end, seen from above: each a name, what becomes of the zones, and a track by growth."""
        stops = self.stops()
        air = self.air
        own = _merged(self.points[:, :2])
        for ways in self.choices(rng):
            shut = [b for b, way in zip(self.case.barriers, ways, strict=True) if way == "around"]

            def graph(grown: float, shut: list[Barrier] = shut) -> Floats | None:
                return shortest_track(stops, shut, air.reach_m + grown)

            yield f"graph {'/'.join(sorted(set(ways))) or 'free'}", ways, graph
            if shut:
                yield "other sides", ways, self._swapped(rng, shut)
            yield "own track", ways, lambda _: own
            if self.case.terrain is None:
                continue
            for fine, floors_too in ((1, True), (2, True), (1, False)):
                found = [ground_track(air, p, q, shut, fine, floors_too) for p, q in itertools.pairwise(stops)]
                if all(t is not None for t in found):
                    whole = _merged(np.vstack([t for t in found if t is not None]))
                    yield f"over ground {fine}", ways, lambda _, whole=whole: whole

    def _swapped(self, rng: np.random.Generator, shut: list[Barrier]) -> Callable[[float], Floats | None]:
        """The graph without the side of a zone on which its own track passes: a fence from the zone outwards."""
        first = shortest_track(self.stops(), shut, self.air.reach_m + 0.01, fine=2)
        if first is None or len(first) < 3:
            return lambda _: None
        corner = first[int(rng.integers(1, len(first) - 1))]
        middles = [b.ring.mean(axis=0) for b in shut]
        middle = min(middles, key=lambda p: math.dist(p, corner))
        far = middle + (corner - middle) * (1.0 + 5e4 / max(math.dist(middle, corner), 1.0))
        return lambda grown: shortest_track(self.stops(), shut, self.air.reach_m + grown, [(middle, far)])


def _merged(track: Floats) -> Floats:
    """The track without points that repeat the one before."""
    kept = np.concatenate([[True], np.hypot(*np.diff(track, axis=0).T) > 1e-6])
    return np.asarray(track[kept])


def _bulged(flat: Floats, aside_m: float) -> Floats:
    if aside_m == 0.0:
        return flat
    leg = int(np.argmax(np.hypot(*np.diff(flat, axis=0).T)))
    way = (flat[leg + 1] - flat[leg]) / max(math.dist(flat[leg], flat[leg + 1]), 1e-9)
    apex = 0.5 * (flat[leg] + flat[leg + 1]) + aside_m * np.array([-way[1], way[0]])
    return np.insert(flat, leg + 1, apex, axis=0)


def draw(route: Route, rng: np.random.Generator) -> None:
    """Draw witnesses against one plan until its budget is spent; they are in ``route.seen`` and ``route.best``."""
    if route.source is None and route.plain:
        for style in ("own",) if route.wing else ("own", "stop"):
            if route.try_points(route.points, f"the plan's own, {style}", style):
                points = route.sheared(route.points, route.fixed, style, "own path")
                route.tightened(points, route.fixed, style, "own path", 2 if style == "own" else 3)
    if route.wing:
        return
    for name, ways, track in route.tracks(rng):
        if route.budget.spent or (route.source is not None and route.best is not None):
            return  # one safe mission refutes a proof
        points = route.along(track, ways, name)
        if points is None or route.source is not None or len(points) > 25 or "other" in name:
            continue
        fixed = [int(np.argmin(np.hypot(*(points[:, :2] - p).T))) for p in route.stops()]
        fixed[0], fixed[-1] = 0, len(points) - 1
        route.tightened(points, fixed, "stop", name, 1)
