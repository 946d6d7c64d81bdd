"""A second, independent check of "safe" for a written mission: plain numpy and pyproj's geodesics alone.

It shares no code with the package. It reads a mission file's YAML, the sample DEM, and a written `.waypoints` or
`.plan`, and rounds numbers as the autopilot stores them. It flies each leg straight in degrees, along a geodesic, and
straight in the autopilot's own flat plane, samples it about every metre, and samples the ground around each point as
far as errors and clearances reach. Sampling can miss a violation, but every violation that it finds is one.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from matplotlib.cbook import get_sample_data
from pyproj import Geod

from gcsplan.arrays import Floats

Line = Literal["degrees", "geodesic", "flat"]
LINES: tuple[Line, ...] = ("degrees", "geodesic", "flat")

GEOD = Geod(ellps="WGS84")
A_M, E2 = 6378137.0, 0.0066943799901413165
TERRAIN_ERROR_M = 30.0
GLIDE_SLOPE_MIN_M = 15.0  # ArduPlane flies smaller altitude changes at once, not spread along the leg
HEIGHT_M, WIDTH_M, ANGLE_DEG = 2e-3, 1e-2, 0.35
"""Tolerances: m of altitude and m in the plane (projected plane against geodesics), and degrees of slope.

The angle covers the ground inside one cell.
"""


class Ground:
    """A terrain model: heights at cell centres, bilinear between them, NaN outside."""

    def __init__(self, heights: Floats, west: float, north: float, dx: float, dy: float) -> None:
        self.z, self.west, self.north, self.dx, self.dy = heights, west, north, dx, dy

    def read(self, lat: Floats, lon: Floats) -> Floats:
        """ArduPilot's ground: posts every 100 m of its own flat degree tiles, in metres upwards."""
        m = float(np.float32(0.011131884502145034)) * 1e7
        a, o = np.floor(lat), np.floor(lon)
        north, east = (lat - a) * m / 100.0, (lon - o) * m * np.cos(np.radians(0.5 * (lat + a))) / 100.0
        i, j = np.floor(north), np.floor(east)

        def post(k: Floats, n: Floats) -> Floats:
            at = a + k * 100.0 / m
            return np.ceil(self.at(at, o + n * 100.0 / m / np.cos(np.radians(0.5 * (at + a)))) - 1e-6)

        u, v = north - i, east - j
        west, right = (post(i, n) + u * (post(i + 1, n) - post(i, n)) for n in (j, j + 1))
        return np.asarray(west + v * (right - west))

    @classmethod
    def sample(cls) -> Ground:
        with np.load(get_sample_data("jacksboro_fault_dem.npz", asfileobj=False)) as file:
            west, north, dx, dy = (float(file[k]) for k in ("xmin", "ymin", "dx", "dy"))
            return cls(np.asarray(file["elevation"], float), west, north, dx, dy)

    def at(self, lat: Floats, lon: Floats) -> Floats:
        rows, cols = self.z.shape
        c, r = (lon - self.west) / self.dx - 0.5, (self.north - lat) / self.dy - 0.5
        outside = (c < 0) | (r < 0) | (c > cols - 1) | (r > rows - 1)
        c, r = np.clip(c, 0, cols - 1), np.clip(r, 0, rows - 1)
        i, j = np.minimum(c.astype(int), cols - 2), np.minimum(r.astype(int), rows - 2)
        u, v = c - i, r - j
        z = self.z
        north = z[j, i] + u * (z[j, i + 1] - z[j, i])
        south = z[j + 1, i] + u * (z[j + 1, i + 1] - z[j + 1, i])
        return np.where(outside, np.nan, north + v * (south - north))


def metres_per_degree(lat: Floats) -> tuple[Floats, Floats]:
    """Metres per degree to the north and to the east, from the ellipsoid's two radii of curvature."""
    s = np.sin(np.radians(lat))
    w = np.sqrt(1 - E2 * s * s)
    return np.radians(A_M * (1 - E2) / w**3), np.radians(A_M / w * np.cos(np.radians(lat)))


def moved(lat: Floats, lon: Floats, north_m: Floats | float, east_m: Floats | float) -> tuple[Floats, Floats]:
    north, east = metres_per_degree(lat)
    return lat + north_m / north, lon + east_m / east


# ── zones and limits, from the YAML ──────────────────────────────────────────────────────────────────────────────


@dataclass
class NoFly:
    name: str
    centre: tuple[float, float] | None
    radius_m: float
    corners: Floats
    floor: float
    ceiling: float
    floor_agl: bool
    ceiling_agl: bool

    @classmethod
    def of(cls, keys: dict[str, Any]) -> NoFly:
        def level(which: str, none: float) -> tuple[float, bool]:
            if f"{which}_agl_m" in keys:
                return float(keys[f"{which}_agl_m"]), True
            return float(keys.get(f"{which}_amsl_m", none)), False

        floor, floor_agl = level("floor", -math.inf)
        ceiling, ceiling_agl = level("ceiling", math.inf)
        corners = np.zeros((0, 2))
        if "polygon" in keys:  # edges are straight in degrees; in pieces of 100 m, any kind of line is the same
            ring = np.asarray(keys["polygon"], float)
            parts = []
            for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
                n = max(1, math.ceil(np.hypot(*(b - a)) * 111_000 / 100))
                parts.append(a + (b - a) * (np.arange(n) / n)[:, None])
            corners = np.concatenate(parts)
        centre = tuple(keys["center"]) if "center" in keys else None
        radius = float(keys.get("radius_m", 0))
        return cls(keys.get("name", ""), centre, radius, corners, floor, ceiling, floor_agl, ceiling_agl)

    def rough_m(self, lat: Floats, lon: Floats) -> Floats:
        """A lower bound of the distance (m), a few per mille too short."""
        middle, reach = self.centre, self.radius_m
        north, east = metres_per_degree(np.asarray(lat[:1]))
        if middle is None:
            middle = tuple(self.corners.mean(axis=0))
            off = (self.corners - middle) * np.array([north[0], east[0]])
            reach = float(np.hypot(off[:, 0], off[:, 1]).max())
        return 0.995 * np.hypot((lat - middle[0]) * north, (lon - middle[1]) * east) - 1.01 * reach - 5.0

    def distance_m(self, lat: Floats, lon: Floats) -> Floats:
        """The true distance to the outline (m), negative inside."""
        if self.centre is not None:
            there = np.full(len(lat), self.centre[0]), np.full(len(lat), self.centre[1])
            return np.asarray(GEOD.inv(lon, lat, there[1], there[0])[2]) - self.radius_m
        corners = self.corners
        middle = 0.5 * (lat[:, None] + corners[None, :, 0])
        north, east = metres_per_degree(middle)
        x, y = (corners[None, :, 1] - lon[:, None]) * east, (corners[None, :, 0] - lat[:, None]) * north
        x2, y2 = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
        dx, dy = x2 - x, y2 - y
        w = np.clip(-(x * dx + y * dy) / np.maximum(dx * dx + dy * dy, 1e-12), 0, 1)
        gap = np.hypot(x + w * dx, y + w * dy).min(axis=1)
        crosses = (y > 0) != (y2 > 0)
        at = x - np.where(crosses, y, 0) * dx / np.where(crosses, dy, 1)
        inside = (crosses & (at > 0)).sum(axis=1) % 2 == 1
        return np.asarray(np.where(inside, -gap, gap))


@dataclass
class Rules:
    """Limits and zones of one vehicle, from a mission file's parsed YAML."""

    min_agl_m: float
    max_agl_m: float
    max_amsl_m: float
    clearance_m: float
    track_m: float
    altitude_m: float
    climb_deg: float
    descent_deg: float
    obstacle_m: float
    zones: list[NoFly]
    terrain_error_m: float
    rtl_rel_home_m: float | None
    speed_m_s: float

    @classmethod
    def of(cls, mission: dict[str, Any], index: int = 0) -> Rules:
        vehicle = mission["vehicles"][index]
        limits = mission.get("limits", {}) | vehicle
        climb = float(limits.get("max_climb_deg", 15.0 if vehicle["autopilot"] == "arduplane" else 90.0))
        return cls(
            float(limits["min_agl_m"]),
            float(limits.get("max_agl_m", math.inf)), float(limits.get("max_amsl_m", math.inf)),
            float(limits.get("horizontal_clearance_m", 30)), float(limits.get("track_error_m", 3)),
            float(limits.get("altitude_error_m", 5)), climb, float(limits.get("max_descent_deg", climb)),
            float(mission["terrain"].get("obstacle_height_m", 0)), [NoFly.of(z) for z in mission.get("no_fly", [])],
            float(mission.get("terrain_error_m", TERRAIN_ERROR_M)), vehicle.get("rtl_rel_home_m"),
            float(vehicle.get("speed_m_s", [3, 15])[1]),
        )  # fmt: skip


# ── files, as the autopilot stores them ──────────────────────────────────────────────────────────────────────────


@dataclass
class Row:
    command: int
    frame: int
    params: tuple[float, ...]
    lat: float
    lon: float
    z: float


def read_waypoints(text: str, autopilot: str) -> tuple[tuple[float, float], list[Row]]:
    """Home and items of a `.waypoints` text, rounded as the autopilot stores them."""
    lines = text.splitlines()
    assert lines[0] == "QGC WPL 110"
    rows = [line.split("\t") for line in lines[1:]]
    assert [int(r[0]) for r in rows] == list(range(len(rows)))
    out = [
        Row(
            int(r[3]),
            int(r[2]),
            tuple(map(float, r[4:8])),
            e7(float(r[8])),
            e7(float(r[9])),
            kept(float(r[10]), autopilot),
        )
        for r in rows
    ]
    return (out[0].lat, out[0].lon), out[1:]


def read_plan(text: str, autopilot: str) -> tuple[tuple[float, float], list[Row]]:
    """Home and items of a `.plan` text, rounded as the autopilot stores them."""
    document = json.loads(text)["mission"]
    rows = []
    for item in document["items"]:
        p = [math.nan if x is None else float(x) for x in item["params"]]
        place = (0.0, 0.0, 0.0) if item["frame"] == 2 else (p[4], p[5], p[6])
        z = kept(place[2], autopilot)
        rows.append(Row(item["command"], item["frame"], tuple(p[:4]), e7(place[0]), e7(place[1]), z))
    home = document["plannedHomePosition"]
    return (e7(home[0]), e7(home[1])), rows


def e7(degrees: float) -> float:
    """Degrees as MAVLink transmits them: rounded to 1e-7."""
    return round(degrees * 1e7) / 1e7


def kept(metres: float, autopilot: str) -> float:
    """The stored altitude: ArduPilot float32 times 100, truncated to whole centimetres; PX4 float32."""
    z = np.float32(metres)
    return float(z) if autopilot == "px4" else int(np.float32(z * np.float32(100))) / 100


# ── the flight ───────────────────────────────────────────────────────────────────────────────────────────────────


@dataclass
class Flown:
    """One stretch: start and end as (latitude, longitude, AMSL); with ``terrain`` it follows the ground in between."""

    row: int
    start: tuple[float, float, float]
    end: tuple[float, float, float]
    column: bool = False
    terrain: bool = False
    reach_m: float = 0.0
    band_m: float = 0.0


def fly(home: tuple[float, float], rows: list[Row], rules: Rules, ground: Ground, autopilot: str) -> list[Flown]:
    """The stretches that a vehicle flies, for missions as gcsplan writes them: take-off, way points, one end."""

    def height(lat: float, lon: float) -> float:
        return float(ground.at(np.array([lat]), np.array([lon]))[0])

    def read(lat: float, lon: float) -> float:
        return float(ground.read(np.array([lat]), np.array([lon]))[0])

    datum = height(*home)
    at = (*home, datum)
    legs: list[Flown] = []
    plane = autopilot == "arduplane"
    for number, row in enumerate(rows, start=1):
        amsl = row.z + {0: 0.0, 3: datum, 10: 0.0, 2: 0.0}[row.frame]
        if row.frame == 10:
            amsl += read(row.lat, row.lon)
        if row.command in (22, 84):
            legs.append(Flown(number, at, (*home, amsl), column=True))
        elif row.command in (16, 17):
            to, terrain = (row.lat, row.lon, amsl), row.frame == 10
            rise = amsl - at[2] - (read(*to[:2]) - read(*at[:2]) if terrain else 0.0)
            if plane and (abs(rise) < GLIDE_SLOPE_MIN_M or (rise > 0 and at[2] - datum <= 20.0)):
                half = 0.5 * rise
                ends = (*at[:2], at[2] + half), (*to[:2], amsl - half)
                legs.append(Flown(number, *ends, terrain=terrain, band_m=abs(half)))
            else:
                legs.append(Flown(number, at, to, terrain=terrain))
            at = to
            if plane and row.command == 17:  # the circle's radius grows as air density falls
                thin = (1.0 - 0.0065 * amsl / 288.15) ** -4.2559
                legs.append(Flown(number, to, to, reach_m=60.0 * thin))
            continue
        elif row.command in (21, 85):
            over = (row.lat, row.lon, at[2])
            if GEOD.inv(at[1], at[0], row.lon, row.lat)[2] > 0.02:
                legs.append(Flown(number, at, over))
            legs.append(Flown(number, over, (row.lat, row.lon, height(row.lat, row.lon)), column=True))
        elif row.command == 20:
            assert rules.rtl_rel_home_m is not None
            assert not plane
            top = max(datum + rules.rtl_rel_home_m, at[2])
            legs.append(Flown(number, at, (*at[:2], top), column=True))
            legs.append(Flown(number, (*at[:2], top), (*home, top)))
            legs.append(Flown(number, (*home, top), (*home, datum), column=True))
        else:
            assert row.command == 178, f"command {row.command} is not one that we emit"
            continue
        at = legs[-1].end
    return legs


def samples(
    leg: Flown, ground: Ground, home: tuple[float, float], line: Line, step_m: float
) -> tuple[Floats, Floats, Floats]:
    """Latitude, longitude and AMSL, each (S,), of points at most ``step_m`` apart along a stretch."""
    (lat0, lon0, z0), (lat1, lon1, z1) = leg.start, leg.end
    run = GEOD.inv(lon0, lat0, lon1, lat1)[2]
    count = max(2, math.ceil(max(run, abs(z1 - z0)) / step_m) + 1)
    t = np.linspace(0, 1, count)
    if line == "geodesic" and run > 0.01:
        points = GEOD.inv_intermediate(
            lon0, lat0, lon1, lat1, npts=count, initial_idx=0, terminus_idx=0, return_back_azimuth=True
        )
        lat, lon = np.asarray(points.lats), np.asarray(points.lons)
    elif line == "flat":  # ArduPilot's plane: metres from home, east scaled at the middle latitude (Location.cpp)
        lat = lat0 + t * (lat1 - lat0)
        shrink = np.cos(np.radians(0.5 * (lat + home[0])))
        east0, east1 = (lon0 - home[1]) * shrink[0], (lon1 - home[1]) * shrink[-1]
        lon = home[1] + (east0 + t * (east1 - east0)) / shrink
    else:
        lat, lon = lat0 + t * (lat1 - lat0), lon0 + t * (lon1 - lon0)
    if not leg.terrain:
        return lat, lon, z0 + t * (z1 - z0)
    here = ground.read(lat, lon)
    return lat, lon, here + (z0 - here[0]) + t * ((z1 - here[-1]) - (z0 - here[0]))


# ── the judgement ────────────────────────────────────────────────────────────────────────────────────────────────


@dataclass
class Opinion:
    """The deepest breach of each kind (positive: the limit is broken), its row, and the least distances found.

    ``lowest_m``: least height above ground (m); ``zone_m``: least distance (m) to a zone with flat floor and ceiling
    where their altitudes meet.
    """

    depth: dict[str, float] = field(default_factory=dict)
    row: dict[str, int] = field(default_factory=dict)
    lowest_m: float = math.inf
    zone_m: float = math.inf

    def see(self, kind: str, row: int, depth: float) -> None:
        if not depth <= self.depth.get(kind, -math.inf):  # true for NaN too
            self.depth[kind], self.row[kind] = depth, row

    def breaches(self, slack: float = 1.0) -> dict[str, float]:
        allowed = {"zone": WIDTH_M, "climb": ANGLE_DEG, "descent": ANGLE_DEG, "coverage": 0.0}
        return {k: d for k, d in self.depth.items() if not d <= slack * allowed.get(k, HEIGHT_M)}


def rings(reach_m: float, radii: int, spokes: int) -> Iterator[tuple[float, float]]:
    yield 0.0, 0.0
    if reach_m > 0:
        for k in range(1, radii + 1):
            for a in np.arange(spokes) * (2 * math.pi / spokes) + 0.3 * k:
                yield reach_m * k / radii * math.cos(a), reach_m * k / radii * math.sin(a)


def judge(
    home: tuple[float, float], rows: list[Row], rules: Rules, ground: Ground, autopilot: str,
    *, step_m: float = 1.0, lines: tuple[Line, ...] = LINES,
) -> Opinion:  # fmt: skip
    """Check a mission that `read_waypoints` or `read_plan` has read, on each kind of line."""
    opinion = Opinion()
    for leg in fly(home, rows, rules, ground, autopilot):
        for k, line in enumerate(lines if leg.start[:2] != leg.end[:2] else lines[:1]):
            lat, lon, z = samples(leg, ground, home, line, step_m if k == 0 else 3 * step_m)
            look(leg, lat, lon, z, rules, ground, opinion)
    return opinion


def look(leg: Flown, lat: Floats, lon: Floats, z: Floats, rules: Rules, ground: Ground, opinion: Opinion) -> None:
    error = rules.altitude_m + leg.band_m + (rules.terrain_error_m if leg.terrain else 0.0)
    near = rules.track_m + leg.reach_m
    low, high = z - error, z + error

    def extreme(reach: float, radii: int, spokes: int) -> tuple[Floats, Floats]:
        most, least = np.full(len(lat), -np.inf), np.full(len(lat), np.inf)
        for north, east in rings(reach, radii, spokes):
            g = ground.at(*moved(lat, lon, north, east))
            most, least = np.maximum(most, g), np.minimum(least, g)  # both keep NaN: unknown ground
        return most, least

    most, least = extreme(near, 2, 12)
    opinion.see("coverage", leg.row, 1.0 if np.isnan(most).any() else 0.0)
    if np.isnan(most).any():
        return
    if not leg.column:
        opinion.see("min_agl", leg.row, float((rules.min_agl_m - (low - most - rules.obstacle_m)).max()))
        opinion.lowest_m = min(opinion.lowest_m, float((z - ground.at(lat, lon)).min()))
        if rules.clearance_m > 0:
            wide, _ = extreme(near + rules.clearance_m, 3, 16)
            opinion.see("coverage", leg.row, 1.0 if np.isnan(wide).any() else 0.0)
            opinion.see("terrain_clearance", leg.row, float((wide + rules.obstacle_m - low).max()))
        run = np.asarray(GEOD.inv(lon[:-1], lat[:-1], lon[1:], lat[1:])[2])
        if run.max() > 1e-3:
            slope = np.degrees(np.arctan2(np.diff(z), run))
            opinion.see("climb", leg.row, float(slope.max()) - rules.climb_deg)
            opinion.see("descent", leg.row, -float(slope.min()) - rules.descent_deg)
    opinion.see("max_agl", leg.row, float((high - least).max()) - rules.max_agl_m)
    opinion.see("max_amsl", leg.row, float(high.max()) - rules.max_amsl_m)
    for zone in rules.zones:
        reach = near + rules.clearance_m
        close = zone.rough_m(lat, lon) < reach
        if close.any():
            beside(leg, zone, lat[close], lon[close], low[close], high[close], reach, ground, opinion)


def beside(
    leg: Flown, zone: NoFly, lat: Floats, lon: Floats, low: Floats, high: Floats, reach: float, ground: Ground,
    opinion: Opinion,
) -> None:  # fmt: skip
    """Judge one zone: by true distance if its floor and ceiling are flat, else at sampled points around the track."""
    gap = zone.distance_m(lat, lon)
    if not (zone.floor_agl or zone.ceiling_agl):
        meets = (high > zone.floor + HEIGHT_M) & (low < zone.ceiling - HEIGHT_M)
        if meets.any():
            opinion.see("zone", leg.row, float((reach - gap[meets]).max()))
            opinion.zone_m = min(opinion.zone_m, float(gap[meets].min()))
        return
    close = gap < reach - WIDTH_M
    lat, lon, low, high, gap = lat[close], lon[close], low[close], high[close], gap[close]
    if not len(lat):
        return
    for north, east in rings(reach - WIDTH_M, 3, 16):
        qlat, qlon = moved(lat, lon, north, east)
        inside = zone.distance_m(qlat, qlon) < -1e-3
        g = ground.at(qlat, qlon)
        floor = zone.floor + (g if zone.floor_agl else 0.0)
        ceiling = zone.ceiling + (g if zone.ceiling_agl else 0.0)
        meets = inside & (floor < ceiling) & (high > floor + HEIGHT_M) & (low < ceiling - HEIGHT_M)
        if meets.any():
            opinion.see("zone", leg.row, float((reach - gap[meets]).max()))
