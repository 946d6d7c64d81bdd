"""Small random missions, by family and seed, for comparing planners with independent optima.

Each family has one difficulty: discs whose optimum is known exactly; cylinders to pass over, under or around; ground
whose pass is exactly as high as the ceiling; climb limits; a maximum AGL; clearances and errors; rasters that are
turned, in degrees, or have holes; via points. Each of them joins once more with voids in its ground (`with_voids`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import minimum_spanning_tree

from gcsplan.arrays import Floats
from gcsplan.planners.problem import Problem, Via
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.oracles.legs import Oracle
from tests.support.random_worlds import Ground, geographic, turned

Kind = tuple[bool, bool]


@dataclass(frozen=True, eq=False)
class Case:
    """A mission. ``ground`` has the true map of its raster, for brute force; ``discs`` (N, 3) of x, y, radius are all
    its obstacles, or None if there are others."""

    name: str
    problem: Problem
    ground: Ground
    discs: Floats | None = None

    def oracle(self, step_m: float) -> Oracle:
        """Brute force over this world."""
        air = self.problem.airspace
        return Oracle(
            air.surface.ground_m,
            air.surface.top_m,
            self.ground.to_grid,
            air.zones,
            air.scale,
            step_m,
            rings=1,
            spokes=8,
        )


def smooth(rng: np.random.Generator, rows: int, cols: int, height_m: float, waves: int = 10) -> Floats:
    """Smooth random ground (rows, cols) from 0 to ``height_m``."""
    y, x = np.mgrid[0:rows, 0:cols] / max(rows, cols)
    z = np.zeros((rows, cols))
    for _ in range(waves):
        k = rng.normal(0.0, 2.0 * math.pi * 1.6, 2)
        z += np.sin(k[0] * x + k[1] * y + rng.uniform(0.0, 2.0 * math.pi)) / (1.0 + np.hypot(*k) / 8.0)
    z += rng.normal(0.0, float(rng.choice([0.0, 0.05, 0.2])), z.shape)
    return np.asarray((z - z.min()) / max(float(np.ptp(z)), 1e-9) * height_m)


def plane_ground(heights: Floats, dx_m: float, dy_m: float) -> Ground:
    """A raster in the plane itself, its south-western corner at the origin."""
    rows, cols = heights.shape
    north = (rows - 1) * dy_m
    grid = GridMap.affine(0.0, north, dx_m, dy_m)
    box = (0.0, 0.0, (cols - 1) * dx_m, north)
    return Ground(heights, grid, lambda e, n: (e / dx_m, (north - n) / dy_m), box, min(dx_m, dy_m))


def hills(rng: np.random.Generator, height_m: float | None = None, whole: bool = False) -> Ground:
    """Ground of 18 to 35 nodes a side, 20 to 50 m apart; one in six is noise with towers."""
    rows, cols = (int(n) for n in rng.integers(18, 36, 2))
    height_m = float(rng.uniform(30.0, 250.0)) if height_m is None else height_m
    z = smooth(rng, rows, cols, height_m)
    if rng.random() < 0.16:
        z = 0.6 * z * rng.random(z.shape) + np.where(rng.random(z.shape) < 0.15, 0.4 * height_m, 0.0)
    dx, dy = rng.uniform(20.0, 50.0, 2)
    return plane_ground(np.round(z) if whole else z, float(dx), float(dx if rng.random() < 0.5 else dy))


def pass_height(z: Floats, a: tuple[int, int], b: tuple[int, int]) -> float:
    """The exact height of the lowest pass between two nodes (row, column) of the bilinear surface."""
    rows, cols = z.shape
    index = np.arange(rows * cols).reshape(rows, cols)
    corners = [z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]]
    twist = corners[0] + corners[3] - corners[1] - corners[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = (corners[0] - corners[2]) / twist, (corners[0] - corners[1]) / twist
        saddle = (corners[0] * corners[3] - corners[1] * corners[2]) / twist
    inside = (u > 0.0) & (u < 1.0) & (v > 0.0) & (v < 1.0)
    r, c = np.nonzero(inside)
    extra = rows * cols + np.arange(len(r))
    height = np.concatenate([z.ravel(), saddle[r, c]])
    one = [index[:, :-1].ravel(), index[:-1].ravel(), *[extra] * 4]
    two = [index[:, 1:].ravel(), index[1:].ravel(), index[r, c], index[r, c + 1], index[r + 1, c], index[r + 1, c + 1]]
    i, j = (np.concatenate(part).astype(np.int32) for part in (one, two))
    weight = np.maximum(height[i], height[j])
    least = float(weight.min())
    tree = minimum_spanning_tree(csr_array((weight - least + 1.0, (i, j)), shape=(len(height),) * 2)).tocoo()
    # Adding the tree's edges in order of height, the two ends become connected at the pass.
    parent = np.arange(len(height))

    def root(k: int) -> int:
        while parent[k] != k:
            parent[k] = parent[parent[k]]
            k = int(parent[k])
        return k

    first, last = int(index[a]), int(index[b])
    for k in np.argsort(tree.data):
        parent[root(int(tree.row[k]))] = root(int(tree.col[k]))
        if root(first) == root(last):
            p, q = int(tree.row[k]), int(tree.col[k])
            return float(max(height[p], height[q], height[first], height[last]))
    return math.inf


def level(rng: np.random.Generator, top_m: float) -> Level:
    if rng.random() < 0.5:
        return Level(float(rng.uniform(10.0, top_m)), "amsl")
    return Level(float(rng.uniform(10.0, 80.0)), "agl")


def zones(
    rng: np.random.Generator, ground: Ground, count: int, levels: Callable[[], tuple[Level | None, Level | None]],
    round_only: bool = False,
) -> list[Zone]:  # fmt: skip
    """Circles and star-shaped polygons anywhere."""
    west, south, east, north = ground.box
    size = min(east - west, north - south)
    out = []
    for k in range(count):
        e, n, r = rng.uniform(west, east), rng.uniform(south, north), rng.uniform(0.04, 0.16) * size
        shape: Circle | Polygon = Circle(float(e), float(n), float(r))
        if not round_only and rng.random() < 0.4:
            corners = int(rng.integers(3, 9))
            turn, radius = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners)), 1.4 * r * rng.uniform(0.3, 1.0, corners)
            if np.diff(turn, append=turn[0] + 2.0 * np.pi).max() < 0.95 * np.pi:
                shape = Polygon(np.stack([e + radius * np.cos(turn), n + radius * np.sin(turn)], axis=-1))
        out.append(Zone(f"zone {k}", shape, *levels()))
    return out


def legal_end(rng: np.random.Generator, air: Airspace, limits: Limits, place: Floats) -> tuple[float, ...] | None:
    """A legal altitude over a place, most often the lowest."""
    low = float(air.floor_amsl(place[0], place[1], limits)) + 1e-3
    high = float(air.ceiling_amsl(place[0], place[1], limits))
    if not low <= high:
        return None
    at = float(rng.choice([low, low, min(high, low + rng.uniform(0.0, 60.0))]))
    end = np.array([[*place, at]])
    legs = Legs(end, end, np.zeros(1, bool), np.array([limits.track_error_m]), np.array([limits.altitude_error_m]))
    return (float(place[0]), float(place[1]), at) if air.clear(legs, limits)[0] else None


def mission(
    rng: np.random.Generator, name: str, ground: Ground, found: list[Zone], limits: Limits,
    surface: Surface | None = None, scale: float = 1.0, least: float = 0.45,
) -> Case | None:  # fmt: skip
    """A mission with legal ends far apart and a random objective; None if 60 draws find no such ends."""
    air = Airspace(surface or Surface(ground.heights, ground.heights, ground.grid), found, scale=scale)
    west, south, east, north = ground.box
    low, high = np.array([west, south]), np.array([east, north])
    for _ in range(60):
        a, b = (low + rng.uniform(0.04, 0.96, 2) * (high - low) for _ in range(2))
        if math.dist(a, b) < least * float((high - low).max()):
            continue
        ends = legal_end(rng, air, limits, a), legal_end(rng, air, limits, b)
        if ends[0] is None or ends[1] is None:
            continue
        return Case(name, objective(rng, Problem(air, limits, ends[0], ends[1])), ground)  # type: ignore[arg-type]
    return None


def objective(rng: np.random.Generator, problem: Problem) -> Problem:
    if rng.random() < 0.6:
        return problem
    return replace(
        problem,
        objective="energy",
        vertical_j_per_m=float(rng.choice([0.0, 30.0, 120.0, 600.0])),
        horizontal_j_per_m=100.0,
    )


def angles(rng: np.random.Generator) -> dict[str, float]:
    return {"max_climb_deg": float(rng.uniform(6.0, 30.0)), "max_descent_deg": float(rng.uniform(6.0, 30.0))}


# --- families -----------------------------------------------------------------------------------------------------


def discs(rng: np.random.Generator) -> Case | None:
    """Zones without floor and ceiling over flat ground, far from the border: the optimum is known exactly."""
    ground = plane_ground(np.zeros((5, 5)), 1000.0, 1000.0)
    count = int(rng.integers(1, 16))
    d = np.column_stack([rng.uniform(1300.0, 2700.0, (count, 2)), rng.uniform(20.0, 220.0, count)])
    ends = rng.uniform(1250.0, 2750.0, (2, 2))
    clearance, error = float(rng.choice([0.0, 25.0])), float(rng.choice([0.0, 4.0]))
    grown = d + np.array([0.0, 0.0, clearance + error])
    far = np.hypot(*(ends[:, None] - grown[None, :, :2]).transpose(2, 0, 1)) > grown[:, 2] + 0.01
    if not far.all() or math.dist(*ends) < 700.0:
        return None
    found = [Zone(f"zone {k}", Circle(*row)) for k, row in enumerate(d.tolist())]
    limits = Limits(10.0, horizontal_clearance_m=clearance, track_error_m=error)
    heights = 10.05 + rng.choice([0.0, 60.0], 2)
    p = Problem(Airspace(Surface(ground.heights, ground.heights, ground.grid), found), limits,
                (*ends[0].tolist(), float(heights[0])), (*ends[1].tolist(), float(heights[1])))  # fmt: skip
    return Case("discs", objective(rng, p), ground, grown)


def fences(rng: np.random.Generator) -> Case | None:
    """A row of discs across the straight track, with gaps from 10 m to a millimetre, or overlaps."""
    ground = plane_ground(np.zeros((5, 5)), 1000.0, 1000.0)
    count = int(rng.integers(4, 14))
    radius = rng.uniform(5.0, 60.0, count)
    gap = rng.choice([1e-3, 0.02, 0.5, 10.0, -1e-3, -1.0, -5.0], count)
    north = np.cumsum(2.0 * radius + gap) - radius
    north += 2000.0 - north.mean()
    d = np.column_stack([np.full(count, 2000.0), north, radius])
    ends = np.column_stack([[1700.0, 2000.0 + rng.uniform(120.0, 400.0)], 2000.0 + rng.uniform(-200.0, 200.0, 2)])
    found = [Zone(f"zone {k}", Circle(*row)) for k, row in enumerate(d.tolist())]
    surface = Surface(ground.heights, ground.heights, ground.grid)
    start, goal = ((*p, 10.05) for p in ends.tolist())
    return Case("fences", objective(rng, Problem(Airspace(surface, found), Limits(10.0), start, goal)), ground, d)


def cylinders(rng: np.random.Generator) -> Case | None:
    """Cylinders and prisms with floors and ceilings over flat ground: the best path goes over, under or around."""
    ground = plane_ground(np.full((9, 9), float(rng.choice([0.0, 37.5]))), 150.0, 150.0)

    def levels() -> tuple[Level | None, Level | None]:
        kind = rng.integers(0, 4)
        top = Level(float(rng.uniform(20.0, 200.0)), "amsl" if rng.random() < 0.7 else "agl")
        if kind == 0:
            return None, None
        return (
            (None, top)
            if kind < 3
            else (Level(float(rng.uniform(60.0, 120.0)), "amsl"), rng.choice(np.array([None, top], object)))
        )

    found = zones(rng, ground, int(rng.choice([1, 2, 3, 4, 6, 8, 25])), levels)
    limits = Limits(
        float(rng.choice([0.0, 20.0])),
        max_amsl_m=None if rng.random() < 0.6 else float(rng.uniform(100.0, 200.0)),
        horizontal_clearance_m=float(rng.choice([0.0, 10.0])),
        altitude_error_m=float(rng.choice([0.0, 3.0])),
        **(angles(rng) if rng.random() < 0.4 else {}),
    )
    return mission(rng, "cylinders", ground, found, limits)


def mountains(rng: np.random.Generator) -> Case | None:
    """Smooth ground, much of which rises above the highest legal altitude; zones of every kind."""
    ground = hills(rng)
    top = float(ground.heights.max())

    def levels() -> tuple[Level | None, Level | None]:
        kind = rng.integers(0, 4)
        return (None, None) if kind == 0 else (None, level(rng, top)) if kind < 3 else (level(rng, top), None)

    found = zones(rng, ground, int(rng.choice([0, 2, 6])), levels)
    limits = Limits(15.0, max_amsl_m=15.0 + float(rng.uniform(0.45, 1.1)) * top)
    return mission(rng, "mountains", ground, found, limits)


def passes(rng: np.random.Generator) -> Case | None:
    """A ceiling that equals the pass between start and goal to the last bit, or lies 1 mm or 0.5 m above it."""
    whole = bool(rng.random() < 0.7)
    ground = hills(rng, whole=whole)
    z = ground.heights
    if whole:
        z = np.round(z / (s := float(rng.choice([1.0, 5.0, 10.0])))) * s
        ground = plane_ground(z, *(float(d) for d in np.divide(ground.box[2:], np.array(z.shape[::-1]) - 1.0)))
    rows, cols = z.shape
    limits = Limits(float(rng.choice([0.0, 10.0])))
    for _ in range(40):
        a = int(rng.integers(1, rows - 1)), int(rng.integers(1, cols - 1))
        b = int(rng.integers(1, rows - 1)), int(rng.integers(1, cols - 1))
        saddle = pass_height(z, a, b)
        if math.dist(a, b) > 0.45 * max(rows, cols) and saddle > max(z[a], z[b]):
            hair = float(rng.choice([0.0, 0.0, 0.0, 1e-3, 0.5]))
            limits = replace(limits, max_amsl_m=saddle + limits.min_agl_m + hair)
            air = Airspace(Surface(z, z, ground.grid))
            p, q = (ground.grid.to_plane(float(x[1]), float(x[0])) for x in (a, b))
            s, g = z[a] + limits.min_agl_m, z[b] + limits.min_agl_m
            problem = Problem(air, limits, (*p.tolist(), float(s)), (*q.tolist(), float(g)))
            return Case("passes", objective(rng, problem), ground)
    return None


def climbs(rng: np.random.Generator) -> Case | None:
    """Climb and descent limits that bind over hills, sometimes with zones to climb over."""
    ground = hills(rng, float(rng.uniform(40.0, 200.0)))
    top = float(ground.heights.max())
    found = zones(rng, ground, int(rng.choice([0, 3])), lambda: (None, level(rng, top)))
    limits = Limits(
        15.0, max_amsl_m=None if rng.random() < 0.5 else 15.0 + float(rng.uniform(0.6, 1.1)) * top, **angles(rng)
    )
    return mission(rng, "climbs", ground, found, limits)


def levels(rng: np.random.Generator) -> Case | None:
    """Zones in mid-air over hills, with climb and descent limits: in some places no path fits below a zone, in others
    none above it."""
    ground = hills(rng, float(rng.uniform(60.0, 200.0)))
    top = float(ground.heights.max())

    def levels() -> tuple[Level | None, Level | None]:
        datum: Literal["amsl", "agl"] = "amsl" if rng.random() < 0.75 else "agl"
        low = float(rng.uniform(0.3, 0.9)) * top if datum == "amsl" else float(rng.uniform(20.0, 80.0))
        return Level(low, datum), Level(low + float(rng.uniform(10.0, 100.0)), datum)

    found = zones(rng, ground, int(rng.choice([1, 2, 4])), levels)
    found = [replace(z, shape=replace(z.shape, radius_m=2.0 * z.shape.radius_m)) if isinstance(z.shape, Circle) else z
             for z in found]  # fmt: skip
    limits = Limits(15.0, max_amsl_m=15.0 + float(rng.uniform(0.7, 1.3)) * top, **angles(rng))
    return mission(rng, "levels", ground, found, limits)


def bands(rng: np.random.Generator) -> Case | None:
    """A maximum height above ground, with and without climb limits."""
    ground = hills(rng, float(rng.uniform(20.0, 150.0)))
    found = zones(rng, ground, int(rng.choice([0, 3])), lambda: (None, None))
    limits = Limits(
        20.0, max_agl_m=float(rng.uniform(30.0, 100.0)), **(angles(rng) if rng.random() < 0.6 else {})
    )  # fmt: skip
    return mission(rng, "bands", ground, found, limits)


def clearances(rng: np.random.Generator) -> Case | None:
    """Clearance from terrain and zones, track and altitude errors, trees on the ground, a plane with scale over 1."""
    ground = hills(rng, float(rng.uniform(30.0, 150.0)))
    top = float(ground.heights.max())
    surface = Surface(ground.heights, ground.heights, ground.grid)
    if rng.random() < 0.4:
        trees = np.where(rng.random(ground.heights.shape) < 0.2, 20.0, 0.0)
        surface = Surface(ground.heights, ground.heights + trees, ground.grid)

    def levels() -> tuple[Level | None, Level | None]:
        return (None, None if rng.random() < 0.4 else level(rng, top))

    found = zones(rng, ground, int(rng.choice([0, 4])), levels)
    limits = Limits(
        12.0,
        max_amsl_m=25.0 + float(rng.uniform(0.6, 1.2)) * top,
        horizontal_clearance_m=float(rng.choice([0.0, 15.0, 40.0])),
        track_error_m=float(rng.choice([0.0, 3.0])),
        altitude_error_m=float(rng.choice([0.0, 5.0])),
        **(angles(rng) if rng.random() < 0.3 else {}),
    )
    return mission(rng, "clearances", ground, found, limits, surface, float(rng.choice([1.0, 1.0004])))


def without_pinches(z: Floats) -> Floats:
    """Heights whose unknown cells touch along edges only: nodes at which two touch by a corner are made unknown, too.

    Without errors the exact check passes a path through such a single point, and bounds do not know of it.
    """
    while True:
        unknown = np.isnan(z)
        cell = unknown[:-1, :-1] | unknown[1:, :-1] | unknown[:-1, 1:] | unknown[1:, 1:]
        one, other = cell[:-1, :-1] & cell[1:, 1:], cell[1:, :-1] & cell[:-1, 1:]
        pinched = (one & ~cell[1:, :-1] & ~cell[:-1, 1:]) | (other & ~cell[:-1, :-1] & ~cell[1:, 1:])
        if not pinched.any():
            return z
        z = z.copy()
        z[1:-1, 1:-1][pinched] = np.nan


def rasters(rng: np.random.Generator) -> Case | None:
    """Rasters turned against the plane, in degrees, or with holes in the data."""
    rows, cols = (int(n) for n in rng.integers(18, 30, 2))
    z = smooth(rng, rows, cols, float(rng.uniform(30.0, 200.0)))
    kind = int(rng.integers(0, 3))
    if kind == 0:
        base = turned(rng)
        z = smooth(rng, len(base.heights), base.heights.shape[1], float(rng.uniform(20.0, 100.0)))
        ground = replace(base, heights=z)
    elif kind == 1:
        base = geographic(float(rng.uniform(-65.0, 65.0)), 10.0, 1.0 / 3600.0, z)
        w, s, e, n = base.box
        ground = replace(base, box=(w + 40.0, s + 40.0, e - 40.0, n - 40.0))
    else:
        z = without_pinches(np.where(rng.random(z.shape) < 0.02, np.nan, z))
        ground = plane_ground(z, 30.0, 30.0)
    top = float(np.nanmax(z))
    found = zones(rng, ground, int(rng.choice([0, 3])), lambda: (None, None if rng.random() < 0.5 else level(rng, top)))
    limits = Limits(
        10.0,
        max_amsl_m=10.0 + float(rng.uniform(0.6, 1.2)) * top,
        track_error_m=float(rng.choice([0.0, 2.0])),
        **(angles(rng) if rng.random() < 0.3 else {}),
    )
    return mission(rng, "rasters", ground, found, limits)


def stops(rng: np.random.Generator) -> Case | None:
    """One or two via points, with and without an altitude."""
    case: Case | None = rng.choice(np.array([mountains, cylinders, climbs], object))(rng)
    if case is None:
        return None
    p = case.problem
    west, south, east, north = case.ground.box
    found: list[Via] = []
    for _ in range(30):
        place = np.array([west, south]) + rng.uniform(0.05, 0.95, 2) * np.array([east - west, north - south])
        end = legal_end(rng, p.airspace, p.limits, place)
        if end is not None:
            found.append(Via(end[0], end[1], None if rng.random() < 0.6 else end[2]))
        if len(found) == 2 or (found and rng.random() < 0.5):
            break
    return replace(case, name="stops", problem=replace(p, via=tuple(found)))


def borders(rng: np.random.Generator) -> Case | None:
    """Zones that reach beyond the map's border, which no path may cross."""
    ground = plane_ground(np.zeros((12, 12)) if rng.random() < 0.5 else smooth(rng, 12, 12, 60.0), 60.0, 60.0)
    size = ground.box[2]
    reach = float(rng.uniform(0.5, 1.02)) * size
    east = float(rng.uniform(0.35, 0.65)) * size
    wide = float(rng.uniform(0.02, 0.1)) * size
    tall = None if rng.random() < 0.6 else Level(float(rng.uniform(60.0, 250.0)), "amsl")
    wall = np.array([[east - wide, -50.0], [east + wide, -50.0], [east + wide, reach], [east - wide, reach]])
    found = [Zone("wall", Polygon(wall), None, tall)]
    if rng.random() < 0.5:
        found.append(Zone("disc", Circle(east, size, float(rng.uniform(0.05, 0.3)) * size)))
    limits = Limits(
        10.0, max_amsl_m=None if rng.random() < 0.5 else 220.0, **(angles(rng) if rng.random() < 0.4 else {})
    )
    return mission(rng, "borders", ground, found, limits)


def pockets(rng: np.random.Generator) -> Case | None:
    """A wall just before a ridge: the detour around the wall is long enough to climb over the ridge on the way."""
    size, step = 1200.0, 30.0
    n = round(size / step) + 1
    east, _ = np.meshgrid(np.linspace(0.0, size, n), np.linspace(size, 0.0, n))
    ridge, wide = float(rng.uniform(480.0, 620.0)), float(rng.uniform(30.0, 90.0))
    height = float(rng.uniform(30.0, 90.0))
    z = np.where(np.abs(east - ridge) <= wide, height, 0.0)
    if rng.random() < 0.5:
        z = z + 0.1 * height * smooth(rng, n, n, 1.0)
    ground = plane_ground(z, step, step)
    wall = float(ridge - wide - rng.uniform(35.0, 90.0))
    low, high = sorted(rng.uniform(150.0, size - 150.0, 2).tolist())
    if high - low < 250.0:
        return None
    corners = np.array([[wall, low], [wall + 10.0, low], [wall + 10.0, high], [wall, high]])
    found = [Zone("wall", Polygon(corners))]
    limits = Limits(10.0, max_climb_deg=float(rng.uniform(5.0, 14.0)), max_descent_deg=float(rng.uniform(5.0, 30.0)))
    air = Airspace(Surface(z, z, ground.grid), found)
    places = np.array([[wall - rng.uniform(5.0, 60.0), 0.0], [ridge + wide + rng.uniform(20.0, 200.0), 0.0]])
    places[:, 1] = rng.uniform(low + 20.0, high - 20.0, 2)
    if rng.random() < 0.3:
        places[1, 1] = rng.uniform(100.0, size - 100.0)
    floors = air.floor_amsl(places[:, 0], places[:, 1], limits)
    tall = float(rng.choice([1e-3, rng.uniform(0.0, 1.2) * height]))
    start, goal = (*places[0].tolist(), float(floors[0]) + 1e-3), (*places[1].tolist(), float(floors[1]) + tall)
    return Case("pockets", objective(rng, Problem(air, limits, start, goal)), ground)


FAMILIES: dict[str, Callable[[np.random.Generator], Case | None]] = {
    f.__name__: f
    for f in (
        discs, fences, cylinders, mountains, passes, climbs, levels, bands, clearances, rasters, stops, borders,
        pockets,
    )
}  # fmt: skip


VOIDS = "+voids"
HOLED = tuple(family + VOIDS for family in FAMILIES)
"""Each family once more, on ground that is unknown in places: the same missions, so a path of one that keeps clear of
the voids is a path of the other."""


def make(family: str, seed: int) -> Case:
    """Mission number ``seed`` of a family; few missions are solved by straight legs."""
    if family.endswith(VOIDS):
        return with_voids(make(family.removesuffix(VOIDS), seed), np.random.default_rng([*family.encode(), seed]))
    rng = np.random.default_rng([*family.encode(), seed])
    while True:
        case = FAMILIES[family](rng)
        if case is not None and (rng.random() < 0.03 or not _open(case.problem)):
            return case


def with_voids(case: Case, rng: np.random.Generator) -> Case:
    """The same mission over ground with voids of any size and place that leave its terminals legal."""
    p, surface = case.problem, case.problem.airspace.surface
    air = p.airspace
    for _ in range(60):
        unknown = _void(rng, surface.ground_m.shape)
        ground = without_pinches(np.where(unknown, np.nan, surface.ground_m))
        top = np.where(np.isnan(ground), np.nan, surface.top_m)
        holed = Airspace(replace(surface, ground_m=ground, top_m=top), air.zones, scale=air.scale)
        stops = [p.start, *((v.east_m, v.north_m, v.amsl_m) for v in p.via), p.goal]
        if all(_is_legal(holed, p.limits, stop) for stop in stops):
            return replace(
                case, name=case.name + VOIDS, problem=replace(p, airspace=holed), discs=None,
                ground=replace(case.ground, heights=ground),
            )  # fmt: skip
    return case


def _void(rng: np.random.Generator, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Unknown nodes: one, a corner, a block, a quadrant, a band from edge to edge, or many single ones."""
    rows, cols = shape
    unknown = np.zeros(shape, bool)
    kind = int(rng.integers(0, 6))
    r, c = int(rng.integers(rows)), int(rng.integers(cols))
    if kind == 0:
        unknown[r, c] = True
    elif kind == 1:
        unknown[0 if r % 2 else -1, 0 if c % 2 else -1] = True
    elif kind == 2:
        unknown[r : r + int(rng.integers(1, max(2, rows // 2))), c : c + int(rng.integers(1, max(2, cols // 2)))] = True
    elif kind == 3:
        unknown[slice(0, rows // 2) if r % 2 else slice(rows // 2, rows),
                slice(0, cols // 2) if c % 2 else slice(cols // 2, cols)] = True  # fmt: skip
    elif kind == 4:
        unknown[:, c] = True
        unknown[r : r + int(rng.integers(0, max(1, rows // 3)))] = False
    else:
        unknown |= rng.random(shape) < 0.02
    return unknown


def _is_legal(air: Airspace, limits: Limits, stop: tuple[float, float, float | None]) -> bool:
    low, high = float(air.floor_amsl(*stop[:2], limits)), float(air.ceiling_amsl(*stop[:2], limits))
    if not low <= high:
        return False
    here = np.array([[*stop[:2], low if stop[2] is None else stop[2]]])
    return bool(air.clear(Legs.between(here, here, limits), limits)[0])


def _open(p: Problem) -> bool:
    """Whether straight legs from terminal to terminal are clear."""
    heights = np.array([p.start[2], *(np.nan if v.amsl_m is None else v.amsl_m for v in p.via), p.goal[2]])
    flat = np.array([p.start[:2], *((v.east_m, v.north_m) for v in p.via), p.goal[:2]])
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(flat, axis=0).T))])
    known = ~np.isnan(heights)
    points = np.column_stack([flat, np.interp(s, s[known], heights[known])])
    return bool(p.airspace.clear(Legs.of_path(points, p.limits), p.limits).all())
