"""Random surfaces, zones and legs with many special cases, for the tests of the exact check and of the tube."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from matplotlib.cbook import get_sample_data

from gcsplan.arrays import Floats
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.oracles.legs import Oracle

ToGrid = Callable[[Floats, Floats], tuple[Floats, Floats]]


@dataclass(frozen=True, eq=False)
class Ground:
    """Heights (rows, cols), gcsplan's map from plane to grid, and the true map ``to_grid``.

    ``box``: west, south, east, north in the plane; ``cell_m``: size of a cell.
    """

    heights: Floats
    grid: GridMap
    to_grid: ToGrid
    box: tuple[float, float, float, float]
    cell_m: float


def rough_heights(rng: np.random.Generator, rows: int, cols: int) -> Floats:
    """Noise of random strength, sometimes with towers, with voids, or in whole metres."""
    z = rng.uniform(0.0, rng.choice([0.0, 5.0, 40.0, 150.0]), (rows, cols))
    if rng.random() < 0.4:
        z = np.where(rng.random(z.shape) < 0.1, z + rng.uniform(50.0, 200.0), z)
    if rng.random() < 0.4:
        z = np.where(rng.random(z.shape) < 0.05, np.nan, z)
    return np.round(z) if rng.random() < 0.2 else z


def in_plane(rng: np.random.Generator) -> Ground:
    """A grid in the plane itself."""
    rows, cols = (int(n) for n in rng.integers(4, 16, 2))
    dx, dy = rng.uniform(5.0, 40.0, 2)
    north = (rows - 1) * dy
    box = (0.0, 0.0, (cols - 1) * dx, north)
    grid = GridMap.affine(0.0, north, dx, dy)
    return Ground(rough_heights(rng, rows, cols), grid, lambda e, n: (e / dx, (north - n) / dy), box, min(dx, dy))


def turned(rng: np.random.Generator) -> Ground:
    """A grid rotated against the plane's axes."""
    rows, cols = (int(n) for n in rng.integers(4, 16, 2))
    dx, dy = rng.uniform(5.0, 40.0, 2)
    a = rng.uniform(0.0, 2.0 * np.pi)
    per_cell = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) @ np.diag([dx, -dy])
    m = np.linalg.inv(per_cell)
    middle = per_cell @ np.array([(cols - 1) / 2, (rows - 1) / 2])
    half = 0.35 * math.hypot(dx * cols, dy * rows)
    box = (middle[0] - half, middle[1] - half, middle[0] + half, middle[1] + half)

    def to_grid(e: Floats, n: Floats) -> tuple[Floats, Floats]:
        return m[0, 0] * e + m[0, 1] * n, m[1, 0] * e + m[1, 1] * n

    return Ground(rough_heights(rng, rows, cols), GridMap.fit(to_grid, box), to_grid, box, min(dx, dy))


def in_degrees(rng: np.random.Generator) -> Ground:
    """A grid with a step of 1, 3 or 30 arc seconds, up to 70° from the equator; the true map goes through pyproj."""
    lat, lon = rng.uniform(-70.0, 70.0), rng.uniform(-170.0, 170.0)
    rows, cols = (int(n) for n in rng.integers(20, 60, 2))
    step = rng.choice([1.0, 3.0, 30.0]) / 3600.0
    z = rng.uniform(0.0, rng.choice([20.0, 80.0, 400.0]), (rows, cols)) * min(1.0, step * 1200.0)
    if rng.random() < 0.3:
        z = np.where(rng.random(z.shape) < 0.01, np.nan, z)
    frame = Frame(lat + rng.uniform(-0.3, 0.3), lon + rng.uniform(-0.3, 0.3))
    grid, to_grid, box = _geographic(frame, lat + step * rows / 2, lon - step * cols / 2, step, rows, cols)
    return Ground(z, grid, to_grid, box, step * 111_000.0 * math.cos(math.radians(lat)))


@cache
def jacksboro() -> Ground:
    """The sample DEM; heights belong to cell centres."""
    with np.load(str(get_sample_data("jacksboro_fault_dem.npz", asfileobj=False))) as file:
        z = np.asarray(file["elevation"], float)
        west, north, dx, dy = (float(file[k]) for k in ("xmin", "ymin", "dx", "dy"))
    frame = Frame(36.5896, -84.2458)
    grid, to_grid, box = _geographic(frame, north - 0.5 * dy, west + 0.5 * dx, (dx, dy), *z.shape)
    inner = (box[0] + 400.0, box[1] + 400.0, box[2] - 400.0, box[3] - 400.0)
    return Ground(z, grid, to_grid, inner, 74.0)


def geographic(lat_deg: float, lon_deg: float, step_deg: float, heights: Floats) -> Ground:
    """A grid in degrees of the given heights; the plane's origin is in its middle."""
    rows, cols = heights.shape
    frame = Frame(lat_deg, lon_deg)
    corner = lat_deg + step_deg * rows / 2, lon_deg - step_deg * cols / 2
    grid, to_grid, box = _geographic(frame, *corner, step_deg, rows, cols)
    return Ground(heights, grid, to_grid, box, step_deg * 111_000.0 * math.cos(math.radians(lat_deg)))


def _geographic(
    frame: Frame, north: float, west: float, step: float | tuple[float, float], rows: int, cols: int
) -> tuple[GridMap, ToGrid, tuple[float, float, float, float]]:
    dx, dy = step if isinstance(step, tuple) else (step, step)

    def to_grid(e: Floats, n: Floats) -> tuple[Floats, Floats]:
        at = frame.to_degrees(e, n)
        return (at[..., 1] - west) / dx, (north - at[..., 0]) / dy

    lat, lon = np.meshgrid(np.linspace(north - dy * (rows - 1), north, 9), np.linspace(west, west + dx * (cols - 1), 9))
    plane = frame.to_plane(lat.ravel(), lon.ravel())
    box = (*plane.min(axis=0).tolist(), *plane.max(axis=0).tolist())
    return GridMap.fit(to_grid, box), to_grid, box


def random_zones(rng: np.random.Generator, ground: Ground, most: int = 5) -> list[Zone]:
    """Up to ``most`` circles and star-shaped polygons with levels of every kind."""
    west, south, east, north = ground.box
    top = float(np.nanmax(ground.heights)) + 60.0

    def level() -> Level | None:
        kind = rng.integers(0, 3)
        if kind == 0:
            return None
        return Level(float(rng.uniform(0.0, top)), "amsl") if kind == 1 else Level(float(rng.uniform(0.0, 80.0)), "agl")

    out = []
    for k in range(rng.integers(0, most + 1)):
        e, n, size = rng.uniform(west, east), rng.uniform(south, north), rng.uniform(0.3, 4.0) * ground.cell_m
        shape: Circle | Polygon = Circle(float(e), float(n), float(size))
        if rng.random() < 0.5:
            corners = int(rng.integers(3, 9))
            turn, radius = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners)), size * rng.uniform(0.2, 1.0, corners)
            shape = Polygon(np.stack([e + radius * np.cos(turn), n + radius * np.sin(turn)], axis=-1))
        levels = level(), level()
        if rng.random() < 0.8:  # else the floor may lie above the ceiling: such a zone is empty
            levels = tuple(sorted(levels, key=lambda v: v.value_m if v else 0.0))  # type: ignore[assignment]
        out.append(Zone(f"zone {k}", shape, *levels))
    return out


def random_limits(rng: np.random.Generator, ground: Ground) -> Limits:
    """Limits and errors, of which some bind, some are missing, and some are zero."""
    cell = ground.cell_m
    return Limits(
        min_agl_m=float(rng.uniform(0.0, 60.0)),
        max_agl_m=None if rng.random() < 0.5 else float(rng.uniform(60.0, 160.0)),
        max_amsl_m=None if rng.random() < 0.5 else float(np.nanmax(ground.heights) + rng.uniform(20.0, 100.0)),
        horizontal_clearance_m=float(rng.choice([0.0, rng.uniform(0.0, 1.5) * cell, rng.uniform(0.0, 0.3) * cell])),
        track_error_m=float(rng.choice([0.0, rng.uniform(0.0, 0.2) * cell, rng.uniform(0.0, 1.0) * cell])),
        altitude_error_m=float(rng.choice([0.0, rng.uniform(0.0, 5.0)])),
        max_climb_deg=float(rng.choice([90.0, 20.0])),
        max_descent_deg=float(rng.choice([90.0, 20.0])),
    )


def random_leg(rng: np.random.Generator, ground: Ground, most_cells: float = 6.0) -> tuple[Floats, Floats]:
    """Ends (east, north) of a leg: anywhere, along a grid line, from node to node, or both at one place."""
    west, south, east, north = ground.box
    rows, cols = ground.heights.shape
    a = np.array([rng.uniform(west, east), rng.uniform(south, north)])
    turn, length = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, most_cells) * ground.cell_m
    b = a + length * np.array([np.cos(turn), np.sin(turn)])
    kind = rng.integers(0, 8)
    if kind == 0:
        a, b = ground.grid.to_plane(rng.integers(0, cols, 2).astype(float), rng.integers(0, rows, 2).astype(float))
    elif kind == 1:
        a, b = ground.grid.to_plane(np.sort(rng.uniform(0.0, cols - 1.0, 2)), float(rng.integers(0, rows)))
    elif kind == 2:
        b = a.copy()
    if math.dist(a, b) > most_cells * ground.cell_m:
        b = a + (b - a) * (most_cells * ground.cell_m / math.dist(a, b))
    return a, b


def surface_of(rng: np.random.Generator, ground: Ground) -> Surface:
    """The surface, in 40 % of draws with obstacles up to 10 m high."""
    top = ground.heights if rng.random() < 0.6 else ground.heights + rng.uniform(0.0, 10.0, ground.heights.shape)
    return Surface(ground.heights, top, ground.grid)


def oracle_of(surface: Surface, ground: Ground, zones: list[Zone], scale: float, step_m: float = 0.5) -> Oracle:
    """The brute-force oracle of the same world, by the true map."""
    return Oracle(surface.ground_m, surface.top_m, ground.to_grid, tuple(zones), scale, step_m)
