"""A brute-force check of returns: dense samples along the return from a point of a mission; shares no code with it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.mavlink.mission.commands import LAND, TAKEOFF, VTOL_LAND, VTOL_TAKEOFF, WAYPOINT
from gcsplan.mavlink.mission.mission import RELATIVE, Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap
from gcsplan.world.geometry.zones import Circle, Zone
from gcsplan.world.world import World
from tests.oracles.legs import Oracle
from tests.support.random_worlds import Ground, in_plane, oracle_of, random_limits, random_zones, surface_of, turned

CONE = {Autopilot.ARDUCOPTER: 3.0, Autopilot.PX4: 1.0}


@dataclass(frozen=True, eq=False)
class Case:
    """A world, a vehicle, and its mission. ``corners`` (N, 3): home, top of the take-off, way points, landing."""

    world: World
    oracle: Oracle
    vehicle: Vehicle
    mission: Mission
    corners: Floats
    level_rel_home_m: float


def wide_ground(rng: np.random.Generator) -> Ground:
    """Ground wide enough for a circle over home."""
    rows, cols = (int(n) for n in rng.integers(10, 16, 2))
    dx, dy = rng.uniform(60.0, 120.0, 2)
    north = (rows - 1) * dy
    z = rng.uniform(0.0, rng.choice([5.0, 40.0, 120.0]), (rows, cols))
    box = (0.0, 0.0, (cols - 1) * dx, north)
    grid = GridMap.affine(0.0, north, dx, dy)
    return Ground(z, grid, lambda e, n: (e / dx, (north - n) / dy), box, min(dx, dy) / 4.0)


def random_case(rng: np.random.Generator, autopilot: Autopilot) -> Case | None:
    """A small rough world with a mission of a few legs; None if the ground at home is unknown."""
    plane = autopilot is Autopilot.ARDUPLANE
    ground = wide_ground(rng) if plane else (in_plane, turned)[int(rng.integers(0, 2))](rng)
    flat = rng.random() < 0.5
    if flat:  # so flat that only zones are obstacles
        ground = replace(ground, heights=0.04 * np.nan_to_num(ground.heights, nan=20.0))
    limits = replace(random_limits(rng, ground), max_climb_deg=90.0, max_descent_deg=90.0)
    if rng.random() < 0.4:
        limits = Limits(min_agl_m=5.0, horizontal_clearance_m=float(rng.choice([0.0, 3.0])))
    west, south, east, north = ground.box
    wide = 0.15 * (east - west), 0.15 * (north - south)
    count = int(rng.integers(2, 5))
    en = np.stack(
        [
            rng.uniform(west + wide[0], east - wide[0], count),
            rng.uniform(south + wide[1], north - wide[1], count),
        ],
        axis=-1,
    )
    reach = limits.track_error_m + limits.horizontal_clearance_m + 1.0
    zones = [z for _ in range(4 if flat else 1) for z in random_zones(rng, ground, 4)]
    if rng.random() < 0.8:  # mostly no zone near home, which would make every return unsafe
        zones = [z for z in zones if _away(z, en[0]) > reach]
    surface = surface_of(rng, ground)
    scale = float(rng.choice([1.0, 1.0005]))
    world = World(Frame(36.6, -84.3), Airspace(surface, zones, scale=scale))
    vehicle = Vehicle("uav1", 1, autopilot, limits, climb_m_s=float(rng.uniform(1.0, 8.0)))
    degrees = world.frame.to_degrees(*en.T)
    home = Home.at(float(degrees[0, 0]), float(degrees[0, 1]), 0.0)
    level = world.ground_amsl(home.lat_e7 / 1e7, home.lon_e7 / 1e7)
    if math.isnan(level):
        return None
    up = rng.uniform(1.0, 60.0 if flat else 150.0, count).round(1)
    takeoff, land = (VTOL_TAKEOFF, VTOL_LAND) if plane else (TAKEOFF, LAND)
    items = [MissionItem(takeoff, RELATIVE, z=float(up[0]), x=home.lat_e7, y=home.lon_e7)]
    for (lat, lon), z in zip(degrees[1:].tolist(), up[1:].tolist(), strict=True):
        items.append(MissionItem(WAYPOINT, RELATIVE, x=round(lat * 1e7), y=round(lon * 1e7), z=z + 0.005))
    last = items[-1]
    ends = rng.random() < 0.5
    if ends:
        items.append(MissionItem(land, RELATIVE, x=last.x, y=last.y, z=0.0))
    mission = Mission(autopilot, replace(home, amsl_m=level), tuple(items))
    places = [(home.lat_e7 / 1e7, home.lon_e7 / 1e7, level)]
    least = {Autopilot.ARDUCOPTER: 1.0, Autopilot.PX4: 2.5}.get(autopilot, 0.0)
    places.append((*places[0][:2], level + max(_stored(items[0].z, autopilot), least)))
    places += [(i.lat_deg, i.lon_deg, level + _stored(i.z, autopilot)) for i in items[1 : len(up)]]
    corners = np.array(places)
    corners[:, :2] = world.frame.to_plane(corners[:, 0], corners[:, 1])
    if ends:
        down = float(surface.ground_at(*corners[-1, :2]))
        if not math.isnan(down):
            corners = np.vstack([corners, [*corners[-1, :2], down]])
    if plane:  # a VTOL plane's landing column is not judged
        corners = corners[: len(up) + 1]
    oracle = oracle_of(surface, ground, zones, scale, step_m=max(0.4, 0.15 * ground.cell_m))
    return Case(world, oracle, vehicle, mission, corners, float(rng.uniform(2.0, 60.0 if flat else 160.0)))


def _away(zone: Zone, place: Floats) -> float:
    """The approximate distance (m) from a place to a zone's surrounding circle."""
    if isinstance(zone.shape, Circle):
        middle, radius = np.array([zone.shape.east_m, zone.shape.north_m]), zone.shape.radius_m
    else:
        middle = zone.shape.vertices.mean(axis=0)
        radius = float(np.hypot(*(zone.shape.vertices - middle).T).max())
    return float(np.hypot(*(place - middle))) - 1.001 * radius


def _stored(z: float, autopilot: Autopilot) -> float:
    """The stored altitude: on ArduPilot truncated to whole centimetres."""
    return z if autopilot is Autopilot.PX4 else math.trunc(float(np.float32(z) * np.float32(100.0))) / 100.0


def run_on(case: Case, at: Floats, to: Floats, after: Floats | None) -> Floats:
    """How far a multicopter at ``at`` on its way to ``to`` runs on at its highest speed there, east and north, m.

    ``after``: where it flies next, None if it stops at ``to``. It slows down for the stop, and for the corner, to the
    speed of an arc that passes 2 m from the corner and pulls 5 m/s².
    """
    way = (to - at)[:2]
    left = float(np.hypot(*way))
    if case.vehicle.autopilot is Autopilot.ARDUPLANE or left < 1.0:
        return np.zeros(2)
    corner = 0.0
    if after is not None and np.hypot(*(after - to)[:2]) > 0.1:
        cosine = float(way @ (after - to)[:2]) / left / float(np.hypot(*(after - to)[:2]))
        half = 0.5 * math.acos(max(-1.0, min(1.0, cosine)))
        corner = math.sqrt(5.0 * 2.0 / max(1.0 / max(math.cos(half), 1e-6) - 1.0, 1e-9))
    if case.vehicle.autopilot is Autopilot.ARDUCOPTER:
        speed = min(case.vehicle.speed_max_m_s, math.sqrt(corner**2 + 5.0 * left))
        return np.asarray(way / left * (speed**2 / 5.0 + 1.2))
    speed = min(case.vehicle.speed_max_m_s, math.sqrt(corner**2 + 6.0 * left))
    return np.asarray(way / left * speed**2 / 6.0)


def breach(
    case: Case, at: Floats, *, legal: bool, more_m: float = 0.0, lift_m: float = 0.0, on: Floats | None = None
) -> str:
    """The limits that the return from ``at`` (east, north, AMSL) breaks; empty if none; ``on``: see `run_on`.

    ``legal``: judge AGL and AMSL limits too; ``more_m``, ``lift_m``: metres added to track and altitude error.
    """
    limits, oracle, home = case.vehicle.limits, case.oracle, case.corners[0]
    if legal and (found := breach(case, at, legal=False, more_m=more_m, lift_m=lift_m, on=on)):
        return found
    if not legal:
        limits = replace(limits, min_agl_m=0.0, max_agl_m=None, max_amsl_m=None)
    track, altitude = limits.track_error_m + more_m / oracle.scale, limits.altitude_error_m + lift_m
    level = home[2] + case.level_rel_home_m
    ways = _ways(case, at, level, cone=not legal)
    own = len(ways)  # from the mission's own line; the others keep no clearance from zones
    if on is not None and on.any():
        for part in (0.4, 1.0):
            stop = at + part * np.array([*on, 0.0])
            ways += _ways(case, stop, level, cone=not legal)
        if not legal:
            ways.append((at, stop, False))
    bare = replace(limits, horizontal_clearance_m=0.0)
    for number, (start, end, column) in enumerate(ways):
        for k in range(len(oracle.zones)):
            kept = limits if number < own else bare
            if oracle.zone_breach(k, start, end, track, altitude, kept, spokes=10, rings=2):
                return f"zone {k}, column {column}"
        if column:
            continue
        depths = oracle.depths(start, end, False, track, altitude, limits)
        depths["coverage"] -= 0.5
        bad = [name for name, depth in depths.items() if depth > 1e-6 and name not in ("climb", "descent")]
        if bad:
            return f"{bad[0]} by {depths[bad[0]]:.3f}"
    return ""


def _ways(case: Case, at: Floats, level: float, *, cone: bool) -> list[tuple[Floats, Floats, bool]]:
    """Straight pieces (start, end, column) of the returns that the autopilot may fly from ``at``."""
    home, away = case.corners[0], math.hypot(*(at[:2] - case.corners[0][:2]))

    def point(en: Floats, amsl: float) -> Floats:
        return np.array([*en[:2], amsl])

    near = away <= max(5.0, case.vehicle.limits.track_error_m)
    if case.vehicle.autopilot is not Autopilot.ARDUPLANE:
        full = max(level, at[2])
        least = max(at[2], min(level, home[2] + CONE[case.vehicle.autopilot] * away)) if cone else full
        ways = []
        for flown in (least, 0.5 * (least + full), full):
            up, over = point(at, flown), point(home, flown)
            ways += [(at, up, True), (over, home, True)] + ([] if near else [(up, over, False)])
        return ways
    over = point(home, level)
    circle = [(point(over + 55.0 * np.array([c, s, 0.0]), level), over, False) for c, s in ((1, 0), (0, 1), (-1, -0.2))]
    if near:
        return circle
    climb = case.vehicle.climb_m_s / case.vehicle.speed_max_m_s
    if at[2] >= level:  # it may descend at once, at the end, or all along
        lines = [(point(at, level), over), (point(at, at[2]), point(home, at[2])), (at, over)]
        return circle + [(a, b, False) for a, b in lines]
    part = min((level - at[2]) / climb / away, 1.0)
    there = at + part * (point(home, at[2]) - at)
    there[2] = min(at[2] + climb * part * away, level)
    slow = [(at, there, False), (there, point(home, there[2]), False)]
    return circle + slow + [(point(at, level), over, False), (at, at + 1e-3, False)]
