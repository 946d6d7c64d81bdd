"""Worlds for the planner's tests, and a brute-force check of paths that shares no code with `Airspace`'s check."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from matplotlib.cbook import get_sample_data

from gcsplan.arrays import Floats
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Zone


def ground(
    height: Callable[[Floats, Floats], Floats] | float, *, size_m: float = 2000.0, step_m: float = 20.0
) -> Surface:
    """A square grid in the plane from (0, 0) to (size_m, size_m)."""
    n = round(size_m / step_m) + 1
    axis = np.linspace(0.0, size_m, n)
    east, north = np.meshgrid(axis, axis[::-1])
    z = np.full((n, n), float(height)) if isinstance(height, float | int) else height(east, north)
    return Surface(z, z, GridMap.affine(0.0, size_m, step_m, step_m))


@cache
def jacksboro() -> Surface:
    """The sample DEM in a plane around its middle; heights belong to cell centres."""
    data: Any = get_sample_data("jacksboro_fault_dem.npz")
    z = data["elevation"].astype(float)
    dx, dy, west, north = (float(data[k]) for k in ("dx", "dy", "xmin", "ymin"))  # "ymin" is the northern edge
    frame = Frame(36.59, -84.246)

    def cells(east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
        degrees = frame.to_degrees(east_m, north_m)
        return (degrees[..., 1] - west) / dx - 0.5, (north - degrees[..., 0]) / dy - 0.5

    return Surface(z, z, GridMap.fit(cells, (-17_000.0, -17_500.0, 17_000.0, 17_500.0)))


FIELD = Limits(
    min_agl_m=60.0,
    horizontal_clearance_m=30.0,
    track_error_m=3.0,
    altitude_error_m=5.0,
    max_climb_deg=15.0,
    max_descent_deg=15.0,
)
"""Limits as a real mission has them."""


def random_mission(seed: int, limits: Limits = FIELD, zones: int = 10, objective: str = "length") -> Problem:
    """A mission between two places of the sample DEM, 5 to 16 km apart, with zones of every kind between them.

    Start and goal are outside of the zones.
    """
    rng = np.random.default_rng(seed)
    bare = Airspace(jacksboro())
    while True:
        a = rng.uniform(-13_000.0, 13_000.0, 2)
        turn, way = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(5_000.0, 16_000.0)
        b = a + way * np.array([math.cos(turn), math.sin(turn)])
        floor = bare.floor_amsl(np.array([a[0], b[0]]), np.array([a[1], b[1]]), limits)
        if np.abs(b).max() < 13_000.0 and (limits.max_amsl_m is None or floor.max() < limits.max_amsl_m - 30.0):
            break
    found: list[Zone] = []
    while len(found) < zones:
        centre = a + (b - a) * rng.uniform(0.05, 0.95) + rng.normal(0.0, 0.08 * way, 2)
        radius = float(rng.uniform(100.0, 0.06 * way))
        kind = len(found) % 3
        low = Level(float(rng.uniform(80.0, 130.0)), "agl") if kind == 2 else None
        high = None if kind == 0 else Level(float(rng.uniform(150.0, 350.0)), "agl")
        if min(math.dist(centre, a), math.dist(centre, b)) > radius + 60.0:
            found.append(Zone(f"zone {len(found)}", Circle(float(centre[0]), float(centre[1]), radius), low, high))
    return Problem(
        Airspace(jacksboro(), found),
        limits,
        (float(a[0]), float(a[1]), float(floor[0]) + 0.01),
        (float(b[0]), float(b[1]), float(floor[1]) + 0.01),
        objective="energy" if objective == "energy" else "length",
    )


def faults(problem: Problem, path: Path, step_m: float = 3.0, slack_m: float = 1e-3) -> list[str]:
    """Faults of a path, found by samples along it and around it; zones must be circles. Empty if none is found."""
    air, limits = problem.airspace, problem.limits
    out = []
    if not np.allclose(path.points[0], problem.start) or not np.allclose(path.points[-1], problem.goal):
        out.append("ends elsewhere")
    slope = np.diff(path.points[:, 2]) / path.leg_horizontal_m
    angle = np.degrees(np.arctan(slope))
    if (angle > limits.max_climb_deg + 1e-6).any() or (-angle > limits.max_descent_deg + 1e-6).any():
        out.append(f"climbs at {angle.max():.3f}, sinks at {-angle.min():.3f} degrees")
    parts = [path.points[:1]]
    for a, b in zip(path.points[:-1], path.points[1:], strict=True):
        n = max(2, math.ceil(math.dist(a[:2], b[:2]) / step_m))
        parts.append(a + np.linspace(0.0, 1.0, n + 1)[1:, None] * (b - a))
    p = np.vstack(parts)
    rings = np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
    error = limits.altitude_error_m

    def around(reach_m: float) -> tuple[Floats, Floats]:
        radii = np.array([0.0, 0.5, 1.0]) * reach_m * air.scale
        at = np.stack([np.outer(radii, np.cos(rings)).ravel(), np.outer(radii, np.sin(rings)).ravel()], axis=-1)
        return p[:, None, 0] + at[:, 0], p[:, None, 1] + at[:, 1]

    near = around(limits.track_error_m)
    far = around(limits.track_error_m + limits.horizontal_clearance_m)
    top = air.surface.top_at(*near).max(axis=1)
    low = top + limits.min_agl_m + error
    if limits.horizontal_clearance_m > 0.0:
        low = np.maximum(low, air.surface.top_at(*far).max(axis=1) + error)
    if not (p[:, 2] >= low - slack_m).all():  # NaN fails too
        out.append(f"{np.nanmax(low - p[:, 2]):.3f} m too low")
    if limits.max_amsl_m is not None and p[:, 2].max() + error > limits.max_amsl_m + slack_m:
        out.append("over max AMSL")
    if limits.max_agl_m is not None:
        high = air.surface.ground_at(*near).min(axis=1) + limits.max_agl_m - error
        if not (p[:, 2] <= high + slack_m).all():
            out.append("over max AGL")
    out.extend(_zone_faults(problem, p, slack_m))
    return out


def _zone_faults(problem: Problem, p: Floats, slack_m: float) -> Sequence[str]:
    """Zones that have a point within reach of the path, and the path between their floor and ceiling there."""
    air, limits = problem.airspace, problem.limits
    reach = (limits.track_error_m + limits.horizontal_clearance_m) * air.scale - slack_m
    turn = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
    radii = np.array([0.0, 0.4, 0.8, 1.0]) * max(reach, 0.0)
    ring = np.stack([np.outer(radii, np.cos(turn)).ravel(), np.outer(radii, np.sin(turn)).ravel()], axis=-1)
    out = []
    for zone in air.zones:
        c = zone.shape
        assert isinstance(c, Circle)
        near = p[np.hypot(p[:, 0] - c.east_m, p[:, 1] - c.north_m) < c.radius_m * air.scale + reach]
        at = near[:, None, :2] + ring
        inside = np.hypot(at[..., 0] - c.east_m, at[..., 1] - c.north_m) < c.radius_m * air.scale - slack_m
        height = air.surface.ground_at(at[..., 0], at[..., 1])
        low, high = (
            end if level is None else level.value_m + (height if level.datum == "agl" else 0.0)
            for level, end in ((zone.floor, -np.inf), (zone.ceiling, np.inf))
        )
        up, down = near[:, None, 2] + limits.altitude_error_m, near[:, None, 2] - limits.altitude_error_m
        if (inside & (up > low + slack_m) & (down < high - slack_m)).any():
            out.append(f"in {zone.name}")
    return out
