"""Random worlds and missions for the campaign of bounds, as mission files: walls, slits, ground with voids, fleets.

Everything is drawn on a plane of metres whose origin lies on the central meridian of a UTM zone, so that the terrain's
grid lies square in it and `bound_paths` can look up heights without any of gcsplan's code.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import rasterio
import shapely
import yaml
from pyproj import Transformer
from scipy.ndimage import gaussian_filter

from gcsplan.arrays import Floats

LAT, LON, EPSG = 46.6, 9.0, "EPSG:32632"
UTM_SCALE = 0.9996
UTM_NORTH_M = float(Transformer.from_crs("EPSG:4326", EPSG, always_xy=True).transform(LON, LAT)[1])
BUDGET_S = 4.0
LONG_M, LONG_PART = (700.0, 2500.0, 30_000.0), (0.45, 0.45, 0.1)
"""Half lengths of long walls; the longest ones are seldom drawn, because a way around takes seconds to judge."""


@dataclass(eq=False)
class Terrain:
    """Heights (rows, cols) AMSL, north-up, NaN where unknown; ``west_m``, ``north_m``: the first node."""

    heights: Floats
    west_m: float
    north_m: float
    cell_m: float


@dataclass(eq=False)
class Barrier:
    """A no-fly zone: a ``ring`` (N, 2), or a circle with ``radius_m`` around its only point; levels as (m, datum)."""

    ring: Floats
    radius_m: float = 0.0
    floor: tuple[float, str] | None = None
    ceiling: tuple[float, str] | None = None

    def key(self, name: str) -> dict[str, object]:
        """The entry of ``no_fly``."""
        out: dict[str, object] = {"name": name}
        if self.radius_m > 0.0:
            out |= {"center": place(self.ring[0]), "radius_m": self.radius_m}
        else:
            out["polygon"] = [place(p) for p in self.ring]
        for which, level in (("floor", self.floor), ("ceiling", self.ceiling)):
            if level is not None:
                out[f"{which}_{level[1]}_m"] = level[0]
        return out


@dataclass(eq=False)
class Case:
    """One mission file and its content in numbers. ``flat_m``: the ground, where there is no ``terrain``."""

    family: str
    seed: int
    vehicles: list[dict[str, object]]
    limits: dict[str, float]
    barriers: list[Barrier] = field(default_factory=list)
    terrain: Terrain | None = None
    flat_m: float = 100.0
    objective: str = "length"
    altitude_frame: str = "relative"
    arrival: dict[str, object] | None = None
    inside_m: float = 0.0
    """Above 0: the free part of the plane within so many metres around all is written as keep-in areas, no zone is."""

    def timed(self, family: str) -> Case:
        """The same world with the objective time and rates of climb and descent; half of the wings climb as steeply as
        their slopes allow."""
        rng = np.random.default_rng([self.seed, 52, *family.encode()])
        rates = {key: float(rng.choice([0.5, 1.5, 3.0])) for key in ("climb_m_s", "descent_m_s")}
        frame = "relative" if self.altitude_frame == "terrain" else self.altitude_frame
        wing_rates = rates if rng.random() < 0.5 else {}
        vehicles = [v | (wing_rates if "turn_radius_m" in v else rates) for v in self.vehicles]
        return replace(self, family=family, objective="time", altitude_frame=frame, vehicles=vehicles)

    def areas(self) -> list[Floats]:
        """Rings that share edges: together the box around all, without the barriers."""
        ends = [[v[k]["east_m"], v[k]["north_m"]] for v in self.vehicles for k in ("start", "goal")]  # type: ignore[index]
        every = np.vstack([*(b.ring for b in self.barriers), ends])
        box = [*(every.min(axis=0) - self.inside_m), *(every.max(axis=0) + self.inside_m)]
        shut = shapely.union_all([shapely.Polygon(b.ring) for b in self.barriers])
        free = shapely.difference(shapely.box(*box), shut)
        holes = [shapely.Polygon(h).bounds for p in shapely.get_parts(free) for h in p.interiors]
        cuts = sorted({box[0], *(0.5 * (w + e) for w, _, e, _ in holes), box[2]})
        slabs = (shapely.intersection(free, shapely.box(w, box[1], e, box[3])) for w, e in pairwise(cuts))
        parts = [p for slab in slabs for p in shapely.get_parts(slab) if p.geom_type == "Polygon"]
        return [np.asarray(p.exterior.coords)[:-1] for p in parts]

    def document(self, *, filled: bool = False, barriers: bool = True, ceilings: bool = True) -> dict[str, object]:
        """The mission file, or one with known ground in the voids, without zones, or without ceilings."""
        ground: dict[str, object] = {"flat_m": self.flat_m}
        if self.terrain is not None:
            ground = {"dem": "filled.tif" if filled else "ground.tif", "vertical_datum": "EGM96"}
        limits = self.limits if ceilings else {k: v for k, v in self.limits.items() if not k.startswith("max_a")}
        out: dict[str, object] = {
            "version": 1, "terrain": ground, "frame": {"origin": [LAT, LON], "amsl_m": 0}, "limits": limits,
            "no_fly": [b.key(f"zone {k}") for k, b in enumerate(self.barriers)] if barriers else [],
            "vehicles": self.vehicles, "altitude_frame": self.altitude_frame,
            "planner": {"objective": self.objective, "budget_s": BUDGET_S},
        }  # fmt: skip
        if self.inside_m > 0.0 and barriers:
            out["no_fly"] = []
            out["keep_in"] = [
                {"name": f"area {k}", "polygon": [place(p) for p in a]} for k, a in enumerate(self.areas())
            ]
        return out | ({} if self.arrival is None else {"arrival": self.arrival})

    def write(self, folder: Path) -> Path:
        """Write terrain and mission file; return the latter's path."""
        if self.terrain is not None:
            z = self.terrain.heights
            write_tiff(folder / "ground.tif", self.terrain, z)
            write_tiff(folder / "filled.tif", self.terrain, filled(z))
        for name, changes in (
            ("mission", {}), ("filled", {"filled": True}), ("open", {"barriers": False}),
            ("bare", {"filled": True, "barriers": False, "ceilings": False}),
        ):  # fmt: skip
            text = yaml.safe_dump(self.document(**changes), sort_keys=False)
            (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
        return folder / "mission.yaml"


def place(p: Floats) -> dict[str, float]:
    return {"east_m": float(p[0]), "north_m": float(p[1])}


def filled(z: Floats) -> Floats:
    """Heights with the lowest known one in the voids: there it hinders nobody but at a ceiling above ground."""
    from scipy.ndimage import distance_transform_edt

    if not np.isnan(z).any() or np.isnan(z).all():
        return np.nan_to_num(z)
    nearest = distance_transform_edt(np.isnan(z), return_distances=False, return_indices=True)
    return np.asarray(z[tuple(nearest)])


def write_tiff(path: Path, t: Terrain, z: Floats) -> None:
    step = t.cell_m * UTM_SCALE
    corner = rasterio.Affine(
        step, 0.0, 500_000.0 + (t.west_m - 0.5 * t.cell_m) * UTM_SCALE,
        0.0, -step, UTM_NORTH_M + (t.north_m + 0.5 * t.cell_m) * UTM_SCALE,
    )  # fmt: skip
    with rasterio.open(
        path, "w", driver="GTiff", width=z.shape[1], height=z.shape[0], count=1, dtype="float64", crs=EPSG,
        transform=corner, nodata=-32768.0,
    ) as file:  # fmt: skip
        file.write(np.where(np.isnan(z), -32768.0, z), 1)


# -- parts -----------------------------------------------------------------------------------------------------------


def errors(rng: np.random.Generator) -> dict[str, float]:
    """Clearance and errors: none, the defaults, or others."""
    kind = int(rng.integers(0, 4))
    if kind == 0:
        return {"horizontal_clearance_m": 0.0, "track_error_m": 0.0, "altitude_error_m": 0.0}
    if kind < 3:
        return {"horizontal_clearance_m": 30.0 if kind == 1 else 10.0, "track_error_m": 3.0, "altitude_error_m": 5.0}
    return {
        "horizontal_clearance_m": float(rng.choice([0.0, 5.0])), "track_error_m": float(rng.choice([0.0, 1.0, 8.0])),
        "altitude_error_m": float(rng.choice([0.0, 1.0, 3.0])),
    }  # fmt: skip


def craft(
    rng: np.random.Generator, start: Floats, goal: Floats, autopilot: str = "", **more: object
) -> dict[str, object]:
    """A multicopter, mostly an ArduCopter."""
    out: dict[str, object] = {
        "name": "u", "sysid": 1, "autopilot": autopilot or str(rng.choice(["arducopter"] * 4 + ["px4", "arduplane"])),
        "start": place(start), "goal": place(goal), "speed_m_s": [3, 8], "accel_m_s2": 1.5,
        "end": str(rng.choice(["land", "land", "loiter"])),
    }  # fmt: skip
    if rng.random() < 0.85:  # else corners are turned on the spot
        out["corner_accel_m_s2"] = 2.5
    if rng.random() < 0.5:
        out["energy"] = {"vertical_j_per_m": float(rng.choice([30, 120, 600])), "horizontal_j_per_m": 100.0}
    return out | more


def objective(rng: np.random.Generator) -> str:
    return "length" if rng.random() < 0.6 else "energy"


def wall(east: float, south: float, north: float, thick: float = 20.0, turn: float = 0.0) -> Floats:
    ring = np.array([[-0.5 * thick, south], [0.5 * thick, south], [0.5 * thick, north], [-0.5 * thick, north]])
    c, s = math.cos(turn), math.sin(turn)
    return np.asarray(ring @ np.array([[c, s], [-s, c]]) + [east, 0.0])


def level(rng: np.random.Generator, low: float, high: float, ground: float) -> tuple[float, str]:
    value = float(rng.uniform(low, high))
    return (value, "agl") if rng.random() < 0.4 else (value + ground, "amsl")


def hills(rng: np.random.Generator, n: int, cell: float, height: float, flat: bool = False) -> Terrain:
    """Ground around the origin: smooth hills, sometimes with noise, towers or a ridge with a pass; or level."""
    half = 0.5 * (n - 1) * cell
    z = np.zeros((n, n))
    if not flat:
        z = gaussian_filter(rng.standard_normal((n, n)), float(rng.uniform(1.5, 5.0)))
        z = (z - z.min()) / max(float(np.ptp(z)), 1e-9) * height
        if rng.random() < 0.3:
            z = z + rng.uniform(0.0, 0.08 * height, z.shape)
        if rng.random() < 0.3:
            axis = np.arange(n)
            ridge = np.abs(axis - n // 2 - int(rng.integers(-n // 8, n // 8))) <= 1
            gap = np.abs(axis - int(rng.integers(2, n - 2))) > int(rng.integers(1, 5))
            z = z + height * ridge[None, :] * gap[:, None]
    return Terrain(z + float(rng.choice([0.0, 300.0])), -half, half, cell)


def voids(rng: np.random.Generator, t: Terrain, ends: list[Floats]) -> str:
    """Make nodes of the terrain unknown, at the ends never; returns the kind."""
    z, n = t.heights, len(t.heights)
    kind = str(rng.choice(["corner", "one", "block", "quadrant", "band", "ring", "dots", "half"]))
    hole = np.zeros(z.shape, bool)
    if kind == "corner":
        hole[[0, 0, -1, -1][k := int(rng.integers(4))], [0, -1, 0, -1][k]] = True
    elif kind == "one":
        hole[tuple(rng.integers(0, n, 2))] = True
    elif kind == "block":
        r, c, w, h = (int(v) for v in (*rng.integers(0, n, 2), *rng.integers(2, max(3, n // 3), 2)))
        hole[r : r + h, c : c + w] = True
    elif kind == "quadrant":
        rows, cols = rng.choice([-1, 1], 2)
        hole[:: int(rows)][: n // 2, :: int(cols)][:, : n // 2] = True
        hole = np.zeros(z.shape, bool)
        hole[slice(0, n // 2) if rows > 0 else slice(n // 2, n), slice(0, n // 2) if cols > 0 else slice(n // 2, n)] = (
            True
        )
    elif kind == "band":  # from edge to edge, at times with a way through
        c = int(rng.integers(n // 3, 2 * n // 3))
        hole[:, c : c + int(rng.integers(1, 4))] = True
        if rng.random() < 0.6:
            r = int(rng.integers(0, n - 3))
            hole[r : r + int(rng.integers(2, 8)), :] = False
    elif kind == "ring":
        row, col = np.mgrid[:n, :n]
        at = _node(t, ends[int(rng.integers(len(ends)))])
        far = np.hypot(row - at[0], col - at[1])
        hole = (far > (r := float(rng.uniform(2.5, n / 4)))) & (far < r + 2.5)
    elif kind == "dots":
        hole = rng.random(z.shape) < float(rng.uniform(0.005, 0.06))
    else:
        hole[:, : n // 4] = True
    for end in ends:
        r, c = (round(v) for v in _node(t, end))
        hole[max(r - 2, 0) : r + 3, max(c - 2, 0) : c + 3] = False
    z[hole] = np.nan
    return kind


def _node(t: Terrain, p: Floats) -> tuple[float, float]:
    return (t.north_m - float(p[1])) / t.cell_m, (float(p[0]) - t.west_m) / t.cell_m


def ends_on(rng: np.random.Generator, t: Terrain, least: float, inner: float = 0.8) -> list[Floats]:
    """Two places at least ``least`` of the terrain's width apart."""
    half = -t.west_m * inner
    while True:
        a, b = rng.uniform(-half, half, (2, 2))
        if math.dist(a, b) > least * -2.0 * t.west_m:
            return [a, b]


# -- families --------------------------------------------------------------------------------------------------------


def walls(rng: np.random.Generator) -> Case:
    """Flat ground with walls, blocks and circles, some of them with floors and ceilings."""
    far = float(rng.uniform(300.0, 4000.0))
    found = []
    for _ in range(int(rng.integers(1, 6))):
        east = float(rng.uniform(0.12, 0.88)) * far
        middle, half = float(rng.uniform(-0.2, 0.2)) * far, float(rng.uniform(0.04, 0.4)) * far
        kind = int(rng.integers(0, 4))
        if kind == 0:
            b = Barrier(np.array([[east, middle]]), min(half, 0.3 * abs(far - east), 0.3 * east))
        else:
            b = Barrier(wall(east, middle - half, middle + half, float(rng.uniform(2.0, 0.05 * far)),
                             float(rng.choice([0.0, rng.uniform(-0.5, 0.5)]))))  # fmt: skip
        if rng.random() < 0.3:
            b.ceiling = level(rng, 20.0, 150.0, 100.0)
        elif rng.random() < 0.2:
            b.floor = level(rng, 40.0, 120.0, 100.0)
        found.append(b)
    limits = {"min_agl_m": float(rng.choice([10.0, 30.0])), **errors(rng)}
    if rng.random() < 0.3:
        limits["max_amsl_m"] = 100.0 + float(rng.uniform(60.0, 200.0))
    elif rng.random() < 0.3:
        limits["max_agl_m"] = float(rng.uniform(60.0, 200.0))
    if rng.random() < 0.3:
        limits |= {"max_climb_deg": float(rng.uniform(5, 30)), "max_descent_deg": float(rng.uniform(5, 30))}
    vehicle = craft(rng, np.array([0.0, 0.0]), np.array([far, 0.0]))
    frame = str(rng.choice(["relative", "relative", "amsl"]))
    return Case("walls", 0, [vehicle], limits, found, objective=objective(rng), altitude_frame=frame)


def slits(rng: np.random.Generator) -> Case:
    """A long wall with a slit that is wider than the check requires by centimetres or metres."""
    far, half = float(rng.uniform(300.0, 1500.0)), float(rng.choice(LONG_M, p=LONG_PART))
    errors_of = errors(rng)
    room = float(rng.choice([0.08, 0.15, 0.3, 1.0, 3.0]))
    wide = 2.0 * (errors_of["horizontal_clearance_m"] + errors_of["track_error_m"]) + room
    at, east, thick = float(rng.uniform(-60.0, 60.0)), 0.5 * far, float(rng.choice([2.0, 20.0, 60.0]))
    found = [
        Barrier(wall(east, -half, at - 0.5 * wide, thick)), Barrier(wall(east, at + 0.5 * wide, half, thick)),
    ]  # fmt: skip
    limits = {"min_agl_m": 30.0, **errors_of}
    if rng.random() < 0.4:  # boxed in: without the slit there is no way
        x = (-200.0, far + 200.0)
        ring = [(x[0], -half, x[1], -half + 10.0), (x[0], half - 10.0, x[1], half), (x[0] - 10.0, -half, x[0], half),
                (x[1], -half, x[1] + 10.0, half)]  # fmt: skip
        found += [Barrier(np.array([[w, s], [e, s], [e, n], [w, n]])) for w, s, e, n in ring]
    vehicle = craft(rng, np.array([0.0, 0.0]), np.array([far, float(rng.uniform(-100, 100))]))
    return Case("slits", 0, [vehicle], limits, found, objective=objective(rng))


def over(rng: np.random.Generator) -> Case:
    """A long wall to pass over below the ceiling, or under, with centimetres to spare, or just none."""
    far, half = float(rng.uniform(300.0, 1500.0)), float(rng.choice(LONG_M, p=LONG_PART))
    errors_of = errors(rng)
    room, low = float(rng.choice([0.02, 0.04, 0.1, 0.5, 3.0])), 30.0
    b = Barrier(wall(0.5 * far, -half, half, float(rng.choice([4.0, 40.0]))))
    limits = {"min_agl_m": low, **errors_of}
    error = errors_of["altitude_error_m"]
    if rng.random() < 0.6:
        top = float(rng.uniform(40.0, 120.0))
        b.ceiling = (top, "agl") if rng.random() < 0.4 else (100.0 + top, "amsl")
        key, base = ("max_amsl_m", 100.0) if rng.random() < 0.6 else ("max_agl_m", 0.0)
        limits[key] = round(base + top + 2.0 * error + room, 3)
    else:
        under = low + 2.0 * error + room
        b.floor = (under, "agl") if rng.random() < 0.4 else (round(100.0 + under, 3), "amsl")
    vehicle = craft(rng, np.array([0.0, 0.0]), np.array([far, float(rng.uniform(-100, 100))]))
    return Case("over", 0, [vehicle], limits, [b], objective=objective(rng))


def climbs(rng: np.random.Generator) -> Case:
    """Goals so high above ground that the climb limit makes the path longer than the straight line."""
    far, steep = float(rng.uniform(200.0, 1200.0)), float(rng.uniform(4.0, 25.0))
    rise = far * math.tan(math.radians(steep)) * float(rng.uniform(0.6, 1.8))
    ends = {"takeoff_agl_m": 40.0, "approach_agl_m": 40.0 + rise}
    if rng.random() < 0.5:
        ends = {"takeoff_agl_m": 40.0 + rise, "approach_agl_m": 40.0}
    limits = {"min_agl_m": 30.0, **errors(rng), "max_climb_deg": steep, "max_descent_deg": steep}
    found = []
    if rng.random() < 0.5:
        found.append(Barrier(wall(0.5 * far, -float(rng.uniform(20, 300)), float(rng.uniform(20, 300)), 10.0)))
    vehicle = craft(rng, np.array([0.0, 0.0]), np.array([far, 0.0]), **ends)
    return Case("climbs", 0, [vehicle], limits, found, objective=objective(rng))


def mountains(rng: np.random.Generator) -> Case:
    """Hills with a ceiling at times, zones, errors or none; short missions whose ends weigh much, and long ones."""
    cell = float(rng.choice([15.0, 30.0, 60.0]))
    t = hills(rng, int(rng.integers(10, 34)), cell, float(rng.uniform(0.5, 6.0)) * cell)
    a, b = ends_on(rng, t, float(rng.choice([0.1, 0.45])))
    limits = {"min_agl_m": float(rng.choice([10.0, 30.0])), **errors(rng)}
    low, high = float(t.heights.min()), float(t.heights.max())
    if limits["horizontal_clearance_m"] > 10.0:
        limits["horizontal_clearance_m"] = 5.0
    if rng.random() < 0.5:
        limits["max_amsl_m"] = low + limits["min_agl_m"] + 15.0 + float(rng.uniform(0.5, 1.2)) * (high - low)
    elif rng.random() < 0.4:
        limits["max_agl_m"] = limits["min_agl_m"] + float(rng.uniform(25.0, 120.0))
    if rng.random() < 0.3:
        limits |= {"max_climb_deg": float(rng.uniform(8, 35)), "max_descent_deg": float(rng.uniform(8, 35))}
    found = _some_zones(rng, t, [a, b], high) if rng.random() < 0.4 else []
    vehicle = craft(rng, a, b)
    frame = str(rng.choice(["relative", "relative", "amsl", "terrain"]))
    if frame == "terrain" and vehicle["autopilot"] != "arducopter":
        frame = "relative"
    return Case("mountains", 0, [vehicle], limits, found, t, objective=objective(rng), altitude_frame=frame)


def _some_zones(rng: np.random.Generator, t: Terrain, ends: list[Floats], high: float) -> list[Barrier]:
    out = []
    for _ in range(int(rng.integers(1, 4))):
        half = -t.west_m
        at, r = rng.uniform(-0.8 * half, 0.8 * half, 2), float(rng.uniform(0.04, 0.2)) * half
        if min(math.dist(at, e) for e in ends) < 1.6 * r + 45.0:
            continue
        turn = np.sort(rng.uniform(0.0, 2.0 * np.pi, 5))
        ring = at + r * np.column_stack([np.cos(turn), np.sin(turn)])
        b = Barrier(at[None, :], r) if rng.random() < 0.5 or np.diff(turn, append=turn[0] + 6.283).max() > 3 \
            else Barrier(ring)  # fmt: skip
        if rng.random() < 0.4:
            b.ceiling = (float(rng.uniform(40, 120)), "agl") if rng.random() < 0.5 else (high + 20.0, "amsl")
        elif rng.random() < 0.3:
            b.floor = (float(rng.uniform(45, 120)), "agl")
        out.append(b)
    return out


def holes(rng: np.random.Generator) -> Case:
    """Ground with voids of every size and place, level ground too, with ceilings above ground and above the sea."""
    cell = float(rng.choice([20.0, 40.0]))
    t = hills(rng, int(rng.integers(12, 36)), cell, float(rng.uniform(0.3, 3.0)) * cell, flat=bool(rng.random() < 0.35))
    a, b = ends_on(rng, t, 0.4)
    limits = {"min_agl_m": 20.0, **errors(rng)}
    if limits["horizontal_clearance_m"] > 10.0:
        limits["horizontal_clearance_m"] = 5.0
    low, high = float(t.heights.min()), float(t.heights.max())
    if rng.random() < 0.6:
        limits["max_agl_m"] = 20.0 + float(rng.uniform(20.0, 100.0))
    elif rng.random() < 0.5:
        limits["max_amsl_m"] = low + 35.0 + float(rng.uniform(0.5, 1.2)) * (high - low)
    if rng.random() < 0.2:
        limits |= {"max_climb_deg": float(rng.uniform(10, 35)), "max_descent_deg": float(rng.uniform(10, 35))}
    voids(rng, t, [a, b])
    found = _some_zones(rng, t, [a, b], high) if rng.random() < 0.3 else []
    return Case("holes", 0, [craft(rng, a, b)], limits, found, t, objective=objective(rng))


def stops(rng: np.random.Generator) -> Case:
    """Walls or hills with one to three via points, some with a height."""
    case = walls(rng) if rng.random() < 0.5 else mountains(rng)
    v = case.vehicles[0]
    a, b = (np.array([v[k]["east_m"], v[k]["north_m"]]) for k in ("start", "goal"))  # type: ignore[index]
    via = []
    for part in np.sort(rng.uniform(0.1, 0.9, int(rng.integers(1, 4)))):
        aside = float(rng.uniform(-0.15, 0.15))
        at = a + part * (b - a) + aside * np.array([-(b - a)[1], (b - a)[0]])
        via.append(place(at) | ({"agl_m": float(rng.uniform(40, 60))} if rng.random() < 0.4 else {}))
    v["via"] = via
    case.family, case.altitude_frame = "stops", "relative"
    return case


def fleets(rng: np.random.Generator) -> Case:
    """Two or three ArduCopters in a row of arrivals that none may wait for: some fly a longer way."""
    far, count = float(rng.uniform(600.0, 1500.0)), int(rng.integers(2, 4))
    vehicles = []
    for k in range(count):
        start, goal = np.array([0.0, 120.0 * k]), np.array([far, 120.0 * k + float(rng.uniform(-20, 20))])
        if rng.random() < 0.3:
            goal = np.array([far, 120.0 * (count - 1 - k)])
        vehicles.append(craft(rng, start, goal, "arducopter", name=f"u{k}", sysid=k + 1, speed_m_s=[7, 8]))
    limits = {"min_agl_m": 30.0, **errors(rng)}
    limits["horizontal_clearance_m"] = min(limits["horizontal_clearance_m"], 10.0)
    found = []
    if rng.random() < 0.4:
        found.append(Barrier(wall(0.5 * far, -float(rng.uniform(20, 200)), float(rng.uniform(20, 150)), 10.0)))
    arrival: dict[str, object] = {
        "mode": "sequence", "interval_s": float(rng.uniform(5, 40)),
        "hold": str(rng.choice(["none", "none", "ground"])),
        "separation_m": 25.0,
    }  # fmt: skip
    if rng.random() < 0.3:
        arrival = {"mode": "none", "separation_m": 40.0}
    return Case("fleets", 0, vehicles, limits, found, objective=objective(rng), arrival=arrival)


def wings(rng: np.random.Generator) -> Case:
    """A fixed wing past walls or over hills."""
    t = None
    if rng.random() < 0.5:
        t = hills(rng, 70, 60.0, float(rng.uniform(20.0, 150.0)))
    a, b = np.array([-1500.0, 0.0]), np.array([float(rng.uniform(700.0, 1500.0)), float(rng.uniform(-300, 300))])
    found = []
    for _ in range(int(rng.integers(1, 3))):
        north = float(rng.uniform(50, 500))
        found.append(Barrier(wall(float(rng.uniform(-600, 400)), -north, float(rng.uniform(50, 500)), 20.0)))
    limits = {"min_agl_m": 60.0, "horizontal_clearance_m": 10.0, "track_error_m": float(rng.choice([5.0, 10.0])),
              "altitude_error_m": 5.0, "max_climb_deg": 12.0, "max_descent_deg": 12.0}  # fmt: skip
    if t is not None and rng.random() < 0.4:
        limits["max_amsl_m"] = float(t.heights.max()) + float(rng.uniform(80.0, 160.0))
    vehicle = craft(rng, a, b, "arduplane", turn_radius_m=float(rng.choice([60.0, 90.0])), speed_m_s=[14, 18])
    vehicle |= {"end": "loiter", "takeoff_agl_m": 70.0}
    if rng.random() < 0.6:
        vehicle["takeoff_heading_deg"] = float(rng.uniform(0, 360))
    return Case("wings", 0, [vehicle], limits, found, t, objective=objective(rng))


def returns(rng: np.random.Generator) -> Case:
    """Missions whose return path is flown back, with different angles up and down."""
    case = walls(rng) if rng.random() < 0.5 else mountains(rng)
    case.vehicles[0] |= {"autopilot": "arducopter", "end": "land", "return_route": "mission"}
    if rng.random() < 0.6:
        case.limits |= {"max_climb_deg": float(rng.uniform(10, 35)), "max_descent_deg": float(rng.uniform(8, 35))}
    case.family, case.altitude_frame = "returns", "relative"
    return case


def frames(rng: np.random.Generator) -> Case:
    """ArduCopters in the terrain altitude frame: their legs follow the ground, within the error of its heights. The
    vehicle's own grid has parts of some kilometres, all of which must be known."""
    t = hills(rng, 150, 80.0, float(rng.uniform(20.0, 250.0)))
    a, b = ends_on(rng, t, float(rng.choice([0.02, 0.12])), inner=0.25)
    limits = {"min_agl_m": float(rng.choice([10.0, 40.0])), **errors(rng)}
    low, high = float(t.heights.min()), float(t.heights.max())
    if rng.random() < 0.4:
        limits["max_amsl_m"] = low + limits["min_agl_m"] + 110.0 + float(rng.uniform(0.5, 1.2)) * (high - low)
    elif rng.random() < 0.5:
        limits["max_agl_m"] = limits["min_agl_m"] + float(rng.uniform(100.0, 200.0))
    if rng.random() < 0.3:
        limits |= {"max_climb_deg": float(rng.uniform(12, 35)), "max_descent_deg": float(rng.uniform(12, 35))}
    found = []
    for _ in range(int(rng.integers(0, 4))):
        at = a + float(rng.uniform(0.2, 0.8)) * (b - a) + rng.uniform(-0.1, 0.1, 2) * math.dist(a, b)
        r = float(rng.uniform(0.03, 0.2)) * math.dist(a, b)
        if min(math.dist(at, a), math.dist(at, b)) > r + 45.0:
            found.append(Barrier(at[None, :], r, ceiling=(float(rng.uniform(60, 200)), "agl")
                                 if rng.random() < 0.4 else None))  # fmt: skip
    terrain = {"altitude_frame": "terrain", "objective": objective(rng)}
    return Case("frames", 0, [craft(rng, a, b, "arducopter")], limits, found, t, **terrain)


def bends(rng: np.random.Generator) -> Case:
    """Zones that are not convex, mostly without errors: thin walls around yards open to one side, and stars."""
    case = mountains(rng) if rng.random() < 0.6 else climbs(rng)
    if rng.random() < 0.7:
        case.limits |= {"horizontal_clearance_m": 0.0, "track_error_m": 0.0}
    v = case.vehicles[0]
    ends = [np.array([v[k]["east_m"], v[k]["north_m"]]) for k in ("start", "goal")]  # type: ignore[index]
    far = math.dist(*ends)
    case.barriers = []
    for _ in range(int(rng.integers(1, 4))):
        turn = np.linspace(0.0, 2.0 * np.pi, 11)[:-1] + float(rng.uniform(0.0, 6.3))
        at = ends[0] + float(rng.uniform(0.1, 1.0)) * (ends[1] - ends[0]) + rng.uniform(-0.15, 0.15, 2) * far
        size, way = float(rng.uniform(0.1, 0.35)) * far, np.column_stack([np.cos(turn), np.sin(turn)])
        ring = at + size * np.vstack([way[:-2], (1.0 - float(rng.choice([0.03, 0.1]))) * way[-3::-1]])
        if rng.random() < 0.3:
            ring = at + 0.5 * size * way * rng.uniform(0.3, 1.0, (10, 1))
        if min(math.dist(p, end) for p in denser(ring) for end in ends) > 45.0:
            ceiling = (float(rng.uniform(60.0, 200.0)), "agl") if rng.random() < 0.3 else None
            case.barriers.append(Barrier(ring, ceiling=ceiling))
    case.family = "bends"
    return case


def insides(rng: np.random.Generator) -> Case:
    """Keep-in areas that share edges, with walls, slits and yards between them."""
    case = (walls, slits, bends)[int(rng.integers(0, 3))](rng)
    case.barriers = [Barrier(b.ring) for b in case.barriers if not b.radius_m]
    case.family, case.inside_m = "insides", float(rng.choice([120.0, 400.0, 3000.0])) if case.barriers else 0.0
    return case


def banded(rng: np.random.Generator) -> Case:
    """Mountains, stops or holes below a maximum height above ground, with levels of zones within that band."""
    case = (mountains, stops, holes)[int(rng.integers(0, 3))](rng)
    limits, vehicle = case.limits, case.vehicles[0]
    if rng.random() < 0.8:
        limits.pop("max_amsl_m", None)
    low = limits["min_agl_m"]
    high = low + 2.0 * limits["altitude_error_m"] + float(rng.uniform(12.0, 90.0))
    limits["max_agl_m"] = high
    if "takeoff_agl_m" not in vehicle:
        above_m = round(low + limits["altitude_error_m"] + float(rng.uniform(4.0, 10.0)), 1)
        vehicle["takeoff_agl_m"] = vehicle["approach_agl_m"] = above_m
    case.altitude_frame = "relative"
    ground = case.flat_m if case.terrain is None else float(np.nanmedian(case.terrain.heights))
    for barrier in case.barriers:
        kind = int(rng.integers(0, 4))  # without levels, with a floor, a ceiling, both
        barrier.floor = level(rng, low + 5.0, high, ground) if kind in (1, 3) else None
        barrier.ceiling = level(rng, low, high - 3.0, ground) if kind in (2, 3) else None
        if (
            barrier.floor
            and barrier.ceiling
            and (barrier.floor[1] != barrier.ceiling[1] or barrier.floor[0] >= barrier.ceiling[0])
        ):
            barrier.floor = None
    case.family = "banded"
    return case


def denser(ring: Floats) -> Floats:
    """Points along the edges of a ring (N, 2)."""
    part = np.linspace(0.0, 1.0, 20)[:, None, None]
    return np.asarray((ring + part * (np.roll(ring, -1, axis=0) - ring)).reshape(-1, 2))


FAMILIES: dict[str, Callable[[np.random.Generator], Case]] = {
    f.__name__: f for f in (
        walls, slits, over, climbs, mountains, holes, stops, fleets, wings, returns, frames, bends, insides, banded,
    )
}  # fmt: skip
TIMED = tuple(f"{name}+time" for name in FAMILIES if name != "frames")


def make(family: str, seed: int) -> Case:
    """World number ``seed`` of a family; of one of `TIMED`, for the least time."""
    if family in TIMED:
        return make(family.removesuffix("+time"), seed).timed(family)
    case = FAMILIES[family](np.random.default_rng([seed, *family.encode()]))
    case.seed = seed
    if case.terrain is None and np.random.default_rng([seed, 7, *family.encode()]).random() < 0.3:
        _turn(case)  # long walls from west to east: there the plane is larger than the ground
    return case


def _turn(case: Case) -> None:
    """Exchange east and north."""
    for b in case.barriers:
        b.ring = b.ring[:, ::-1].copy()
    for v in case.vehicles:
        for p in (v["start"], v["goal"], *v.get("via", [])):  # type: ignore[attr-defined, misc]
            p["east_m"], p["north_m"] = p["north_m"], p["east_m"]
