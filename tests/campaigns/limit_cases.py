"""Random worlds, missions of every kind in them, and knobs: parameters that bring a mission to a limit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.world import World
from tests.support.random_worlds import Ground, random_zones

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4
LOITER_TO_ALT = 31

FAMILIES = (
    "copter", "px4", "vtol", "terrain", "return", "spline", "circle", "jump", "wing", "battery", "fleet", "frames",
)  # fmt: skip
"""Kinds of mission: straight legs of each autopilot, terrain frame, a return, curves, circles, arcs, jumps, fleets,
another frame at each item. A family's place is part of its seeds."""
POSTS_M = 20
"""Spacing of the vehicle's terrain, m: the worlds are too small for one of 100 m."""

WINGED = ("wing", "vtol")
WING_RADIUS_M, WING_SPEED_M_S = 40.0, 14.0
STRIP_M = 1000.0
"""Around home, m: nothing stands there in the worlds of fixed wings."""


@dataclass(frozen=True)
class Case:
    """One mission in one world; ``limits`` are the vehicle's."""

    family: str
    ground: Ground
    surface: Surface
    zones: tuple[Zone, ...]
    frame: Frame
    vehicle: Vehicle
    mission: Mission
    rtl_m: float = 40.0
    terrain_error_m: float = 5.0

    @property
    def limits(self) -> Limits:
        return self.vehicle.limits

    def limited(self, **changes: float | None) -> Case:
        limits = replace(self.limits, **changes)  # type: ignore[arg-type]
        return replace(self, vehicle=replace(self.vehicle, limits=limits))

    def verdict(self, mission: Mission | None = None) -> Verdict:
        world = World(self.frame, airspace_of(self.surface, self.zones), POSTS_M)
        return judge(
            mission or self.mission, self.vehicle, world, rtl_rel_home_m=self.rtl_m,
            terrain_error_m=self.terrain_error_m,
        )  # fmt: skip


@lru_cache(maxsize=8)
def airspace_of(surface: Surface, zones: tuple[Zone, ...]) -> Airspace:
    return Airspace(surface, zones)


# -- worlds --------------------------------------------------------------------------------------------------------


def make_ground(rng: np.random.Generator, size_m: float) -> Ground:
    """Rough ground about ``size_m`` wide; half of the grids are rotated against the plane; the origin is the middle."""
    cell = float(rng.uniform(8.0, 60.0) if size_m < 1000.0 else rng.uniform(60.0, 90.0))
    n = int(min(max(size_m / cell, 6), 60))
    z = rng.uniform(0.0, rng.choice([0.0, 3.0, 15.0, 40.0]), (n, n))
    axis = np.linspace(-1.0, 1.0, n)
    for _ in range(int(rng.integers(0, 4))):
        e, nn, wide = rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0.1, 0.6)
        z += rng.uniform(5.0, 80.0) * np.exp(-((axis[None, :] - e) ** 2 + (axis[:, None] - nn) ** 2) / wide**2)
    if rng.random() < 0.3:
        z = np.where(rng.random(z.shape) < 0.04, z + rng.uniform(10.0, 60.0), z)
    z = np.round(z) if rng.random() < 0.2 else z
    half = 0.5 * (n - 1) * cell
    if rng.random() < 0.5:
        box = (-half, -half, half, half)
        return Ground(
            z, GridMap.affine(-half, half, cell, cell), lambda e, n: ((e + half) / cell, (half - n) / cell), box, cell
        )
    a = rng.uniform(0.0, 2.0 * np.pi)
    cos, sin = math.cos(a) / cell, math.sin(a) / cell
    middle = 0.5 * (n - 1)

    def to_grid(e: Floats, n: Floats) -> tuple[Floats, Floats]:
        return middle + cos * e + sin * n, middle + sin * e - cos * n

    inner = half / math.sqrt(2.0)
    box = (-inner, -inner, inner, inner)
    return Ground(z, GridMap.fit(to_grid, box), to_grid, box, cell)


def make_case(rng: np.random.Generator, family: str) -> Case | None:
    """A safe mission with loose limits; zones that make it unsafe are left out. None if it is unsafe without zones."""
    size = 5000.0 if family in WINGED else float(rng.uniform(300.0, 900.0))
    ground = make_ground(rng, size)
    top = ground.heights
    if rng.random() < 0.4:  # a canopy
        top = top + rng.uniform(0.0, 20.0, top.shape) * (rng.random(top.shape) < 0.6)
    surface = Surface(ground.heights, top, ground.grid)
    frame = Frame(float(rng.uniform(-60.0, 60.0)), float(rng.uniform(-170.0, 170.0)))
    autopilot = {"px4": PX4, "vtol": PLANE, "wing": PLANE}.get(family, COPTER)
    if family in ("circle", "return", "jump", "battery"):
        autopilot = (COPTER, COPTER if family == "circle" else PX4)[int(rng.integers(0, 2))]
    limits = Limits(
        0.0, horizontal_clearance_m=float(rng.choice([0.0, 2.0, 15.0])),
        track_error_m=float(rng.choice([0.0, 0.5, 3.0, 8.0])), altitude_error_m=float(rng.choice([0.0, 1.0, 5.0])),
    )  # fmt: skip
    speed = WING_SPEED_M_S if family in WINGED else float(rng.uniform(4.0, 15.0))
    radius = WING_RADIUS_M if family in WINGED else 0.0
    craft = Vehicle(
        "uav1", 1, autopilot, limits, speed_max_m_s=speed, turn_radius_m=radius, vtol=family == "vtol",
        energy=Energy(120.0, 100.0, hover_w=300.0, battery_j=1e9),
    )  # fmt: skip
    mission = make_mission(rng, family, autopilot, ground, surface, frame)
    if family == "wing":
        surface = with_strip(surface, frame, mission)
    case = Case(family, ground, surface, (), frame, craft, mission, terrain_error_m=30.0 if family == "frames" else 5.0)
    if case.verdict().safe is not True:
        return None
    for zone in (*random_zones(rng, ground), *corner_zones(rng, case)):
        more = replace(case, zones=(*case.zones, zone))
        case = more if more.verdict().safe is True else case
    return case


def corner_zones(rng: np.random.Generator, case: Case) -> list[Zone]:
    """Small circles on the inside of corners, where a vehicle that turns early passes."""
    places = [case.frame.to_plane(i.lat_deg, i.lon_deg) for i in case.mission.items if i.command == cmd.WAYPOINT]
    found = []
    for a, b, c in zip(places, places[1:], places[2:], strict=False):
        ways = [(p - b) / max(float(np.hypot(*(p - b))), 1e-6) for p in (a, c)]
        off = float(rng.choice([2.0, 6.0, 20.0, 60.0])) * float(rng.uniform(0.5, 1.5))
        inside = b + off * (ways[0] + ways[1])
        found.append(Zone(f"corner {len(found)}", Circle(float(inside[0]), float(inside[1]), 0.1 * off)))
    return found[:2]


def with_strip(surface: Surface, frame: Frame, mission: Mission) -> Surface:
    """The surface without its canopy within `STRIP_M` of home, where a fixed wing climbs out from the ground."""
    rows, cols = np.indices(surface.ground_m.shape)
    nodes = surface.grid.to_plane(cols.ravel(), rows.ravel()).reshape(*rows.shape, 2)
    home = frame.to_plane(mission.home.lat_e7 / 1e7, mission.home.lon_e7 / 1e7)
    near = np.hypot(*(nodes - home).transpose(2, 0, 1)) <= STRIP_M
    return Surface(surface.ground_m, np.where(near, surface.ground_m, surface.top_m), surface.grid)


# -- missions ------------------------------------------------------------------------------------------------------


def make_mission(
    rng: np.random.Generator, family: str, autopilot: Autopilot, ground: Ground, surface: Surface, frame: Frame
) -> Mission:
    box = np.array(ground.box).reshape(2, 2) * 0.62
    count = int(rng.integers(2, 6))
    points = np.column_stack([rng.uniform(box[0], box[1], (count + 1, 2)), np.zeros(count + 1)])
    if family in WINGED:
        points = _wing_points(rng, box)
    over = float(np.nanmax(surface.top_m)) + rng.uniform(60.0, 90.0)
    points[:, 2] = over + rng.uniform(0.0, 25.0 if family not in WINGED else 4.0, len(points))
    home_e7 = [m.degrees_e7(float(x)) for x in frame.to_degrees(*points[0, :2])]
    at_home = frame.to_plane(home_e7[0] / 1e7, home_e7[1] / 1e7)
    datum = float(surface.ground_at(*at_home))
    kind = m.TERRAIN if family == "terrain" else int(rng.choice([m.RELATIVE, m.GLOBAL]))

    def item(command: int, p: Floats, frame_: int, *params: float) -> MissionItem:
        lat, lon = (float(x) for x in frame.to_degrees(p[0], p[1]))
        base = {m.GLOBAL: 0.0, m.RELATIVE: datum}.get(frame_, float(surface.ground_at(p[0], p[1])))
        four = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
        return MissionItem(command, frame_, four, m.degrees_e7(lat), m.degrees_e7(lon), round(p[2] - base, 2) + 0.004)

    def accept() -> float:
        if autopilot is COPTER or rng.random() < 0.25:
            return 0.0
        return float(rng.choice([1.0, 2.0, 5.0, 12.0, 40.0, 120.0]))

    first = np.array([*at_home, points[0, 2]])
    items = [item(cmd.TAKEOFF, first, m.RELATIVE)]
    kinds = [kind] * (len(points) - 1)
    if family == "frames":
        kinds = rng.choice([m.RELATIVE, m.GLOBAL, m.TERRAIN], count).tolist()
        points[1:, 2] += np.where(np.array(kinds) == m.TERRAIN, rng.uniform(0.0, 80.0, count), 0.0)  # its error is 30 m
    way = [
        item(cmd.WAYPOINT, p, k, float(rng.choice([0.0, 0.0, 3.0])), accept())
        for p, k in zip(points[1:], kinds, strict=True)
    ]
    land = item(cmd.LAND, points[-1], m.RELATIVE)
    items += way
    if family == "frames" and rng.random() < 0.6:
        circle = (1.0, 0.0, float(rng.choice([20.0, -35.0, 80.0])), 0.0)
        items.insert(2, item(cmd.LOITER_TURNS, 0.5 * (points[1] + points[-1]), int(rng.choice(kinds)), *circle))
    returns = family == "return" or (family == "frames" and rng.random() < 0.5)
    if returns:
        items.append(MissionItem(cmd.RTL, m.NO_POSITION))
    elif family == "spline":
        items.insert(-1, replace(way[-2], command=cmd.SPLINE_WAYPOINT, params=(float(rng.choice([0, 2])), 0, 0, 0)))
        items.pop(-3 if len(way) > 2 else -1)
        items.append(item(cmd.WAYPOINT, points[1] + [1.0, 1.0, 0.0], kind))
    elif family == "circle":
        middle = 0.5 * (points[0] + points[-1])
        circle = (2.0, 0.0, float(rng.choice([0.0, 20.0, -35.0, 80.0])), 0.0)
        items.insert(2, item(cmd.LOITER_TURNS, middle, kind, *circle))
    elif family in WINGED:
        items = _wing_items(points, item, upright=family == "vtol")
    elif family == "battery":
        items.append(MissionItem(cmd.DO_JUMP, m.NO_POSITION, (2.0, float(rng.integers(20, 2500)), 0, 0)))
    elif family == "jump":
        items.insert(-1, MissionItem(cmd.DO_JUMP, m.NO_POSITION, (2.0, float(rng.integers(0, 4)), 0, 0)))
    if not returns and family not in WINGED:
        items.append(
            replace(land, z=0.0) if rng.random() < 0.6 else item(cmd.LOITER_UNLIM, points[-1], kind, 0, 0, 25.0)
        )
    home = Home(home_e7[0], home_e7[1], round(datum, 2))
    return Mission(autopilot, home, tuple(items), "uav1")


def _wing_points(rng: np.random.Generator, box: Floats) -> Floats:
    """Points of a random walk that turns by up to 1.7 rad (97°), with legs long enough for their arcs."""
    heading = float(rng.uniform(0.0, 2.0 * np.pi))
    points = [np.array([*(rng.uniform(box[0], box[1]) * 0.3), 0.0])]
    for step in (600.0, *rng.uniform(240.0, 330.0, int(rng.integers(1, 4)))):
        points.append(points[-1] + step * np.array([math.cos(heading), math.sin(heading), 0.0]))
        heading += float(rng.uniform(-1.7, 1.7))
    return np.array(points)


def _wing_items(points: Floats, item: Callable[..., MissionItem], *, upright: bool) -> list[MissionItem]:
    way = np.diff(points[:, :2], axis=0)
    heading = np.arctan2(way[:, 1], way[:, 0])
    turn = np.abs((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)
    radii = np.maximum(1.0, np.ceil(WING_RADIUS_M * np.tan(0.5 * turn)))
    ahead = points[0] + 0.9 * (points[1] - points[0])
    items = [item(cmd.TAKEOFF, np.array([*ahead[:2], points[0, 2]]), m.RELATIVE, 20.0)]
    items += [item(cmd.WAYPOINT, p, m.RELATIVE, 0.0, float(r)) for p, r in zip(points[1:-1], radii, strict=True)]
    if upright:
        return [item(cmd.VTOL_TAKEOFF, points[0], m.RELATIVE), *items[1:], item(cmd.VTOL_LAND, points[-1], m.RELATIVE)]
    return [*items, item(cmd.LOITER_UNLIM, points[-1], m.RELATIVE, 0.0, 0.0, WING_RADIUS_M)]


# -- knobs: (name, function from case and value to a changed case, loose value, tight value) --------------------------

Knob = tuple[str, Callable[[Case, float], Case], float, float]


def knobs(rng: np.random.Generator, case: Case) -> list[Knob]:
    """The knobs that apply to a case, in random order."""

    def limit(name: str) -> Callable[[Case, float], Case]:
        return lambda c, v: c.limited(**{name: v})

    high = float(np.nanmax(case.surface.top_m)) + 400.0
    found: list[Knob] = [
        ("lower", lambda c, v: lifted(c, -v), 0.0, 150.0), ("higher", lifted, 0.0, 600.0),
        ("min_agl", limit("min_agl_m"), 0.0, 300.0), ("max_agl", limit("max_agl_m"), 2000.0, 1.0),
        ("max_amsl", limit("max_amsl_m"), high, 0.0), ("clearance", limit("horizontal_clearance_m"), 0.0, 250.0),
        ("track_error", limit("track_error_m"), case.limits.track_error_m, 120.0),
        ("altitude_error", limit("altitude_error_m"), case.limits.altitude_error_m, 200.0),
        ("climb", limit("max_climb_deg"), 90.0, 0.05), ("descent", limit("max_descent_deg"), 90.0, 0.05),
    ]  # fmt: skip
    for k, zone in enumerate(case.zones):
        found.append((f"grow {type(zone.shape).__name__}", grown(k), 1.0, 60.0))
        for which, far in (("floor", -400.0), ("ceiling", 400.0)):
            level: Level | None = getattr(zone, which)
            if level is not None:
                found.append((f"{which} {level.datum}", moved(k, which), 0.0, far))
    if case.mission.autopilot is not COPTER and case.family not in WINGED:
        found.append(("accept", accepted, 1.0, 250.0))
    if any(item.command == cmd.RTL for item in case.mission.items):
        found.append(("return", lambda c, v: replace(c, rtl_m=v), 300.0, -20.0))
    if case.family == "battery":
        found = [("battery", with_battery, 1e9, 0.0)]
    order = rng.permutation(len(found))
    return [found[k] for k in order]


def lifted(case: Case, by_m: float) -> Case:
    def item(i: MissionItem) -> MissionItem:
        keeps = i.command in (cmd.LAND, cmd.VTOL_LAND, cmd.RTL, cmd.DO_JUMP)
        return i if keeps else replace(i, z=i.z + round(by_m, 2))

    return replace(case, mission=replace(case.mission, items=tuple(map(item, case.mission.items))))


def accepted(case: Case, radius_m: float) -> Case:
    def item(i: MissionItem) -> MissionItem:
        return (
            replace(i, params=(i.params[0], float(math.ceil(radius_m)), 0.0, 0.0)) if i.command == cmd.WAYPOINT else i
        )

    return replace(case, mission=replace(case.mission, items=tuple(map(item, case.mission.items))))


def with_battery(case: Case, battery_j: float) -> Case:
    return replace(case, vehicle=replace(case.vehicle, energy=replace(case.vehicle.energy, battery_j=battery_j + 1.0)))


def grown(k: int) -> Callable[[Case, float], Case]:
    def change(case: Case, factor: float) -> Case:
        shape = case.zones[k].shape
        if isinstance(shape, Circle):
            shape = replace(shape, radius_m=shape.radius_m * factor)
        else:
            middle = shape.vertices.mean(axis=0)
            shape = Polygon(middle + factor * (shape.vertices - middle))
        return _with_zone(case, k, replace(case.zones[k], shape=shape))

    return change


def moved(k: int, which: str) -> Callable[[Case, float], Case]:
    def change(case: Case, by_m: float) -> Case:
        level: Level = getattr(case.zones[k], which)
        return _with_zone(case, k, replace(case.zones[k], **{which: replace(level, value_m=level.value_m + by_m)}))

    return change


def _with_zone(case: Case, k: int, zone: Zone) -> Case:
    return replace(case, zones=(*case.zones[:k], zone, *case.zones[k + 1 :]))
