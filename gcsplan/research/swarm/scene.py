"""A problem in plain arrays for the swarms' cost kernels: raster, zones, limits and flight volume."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gcsplan.arrays import Floats, Indices, Singles
from gcsplan.errors import InputError
from gcsplan.native.signature import Held
from gcsplan.planners.problem import Problem
from gcsplan.planners.registry import VOLUME_KEYS
from gcsplan.research.swarm import scene_kernels as k
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import distances_m
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.kernels.shared import FIRST, LAST

GROWN = 0.1
"""Margin of the flight volume around the terminals, on every side, as a part of their box's longer side. The box is
first made square: a mission due east needs as much space to either side."""

SAMPLED_KEEP_M = 0.05
"""Metres that the sampled cost keeps from floor, ceiling and zones, for what lies between two samples."""

KEEP_SLOPE = 0.999
"""Part of a slope limit that the sampled cost allows."""

SAMPLES = 200
"""Approximate number of samples of a path."""

FAR = 1e9

FLOOR_NODES = 160_000
"""Nodes of the raster of floors, at most and roughly; it takes some milliseconds to make."""


@dataclass(frozen=True, eq=False)
class Scene:
    """``heights`` (rows, cols): top of the ground around the volume; ``quadratic`` (2, 6): the map from the plane to
    (col, row) over 1, u, v, u², uv, v²; ``floors`` and ``floor_map``: the same for the lowest legal altitude, terrain
    clearance and errors included; ``numbers``, ``zones`` and ``corners``: see `scene_kernels`; ``low``, ``high`` (3,):
    the flight volume; ``terminals`` (M, 3): start, via points, goal; ``straight_m``: length from terminal to terminal
    in space."""

    heights: Singles
    quadratic: Floats
    floors: Singles
    floor_map: Floats
    numbers: Floats
    zones: Floats
    corners: Floats
    low: Floats
    high: Floats
    terminals: Floats
    straight_m: float

    @classmethod
    def of(cls, problem: Problem, volume: Mapping[str, float] | None = None) -> Scene:
        """The scene of ``problem``. Raises InputError if ``volume`` (`VOLUME_KEYS`) does not contain the terminals."""
        surface, limits = problem.airspace.surface, problem.limits
        flat = np.array([problem.start[:2], *((v.east_m, v.north_m) for v in problem.via), problem.goal[:2]])
        west, south, east, north = _flat_volume(flat, volume or {})
        u, v = np.meshgrid(np.linspace(west, east, 9), np.linspace(south, north, 9))
        quadratic, centre, scale_m = _fit(surface, u.ravel(), v.ravel())
        numbers = np.zeros(k.NUMBERS)
        numbers[[k.CENTRE_E, k.CENTRE_N, k.PER_UNIT]] = *centre, 1.0 / scale_m
        top, ground = surface.top_m, surface.ground_m
        c0, r0, c1, r1 = _window(surface, (west, south, east, north))
        quadratic[:, 0] -= c0, r0
        # A part of the raster in single precision (0.1 mm at 1000 m) fits into the processor's cache.
        heights = np.ascontiguousarray(top[r0:r1, c0:c1], dtype=np.float32)
        known = heights[np.isfinite(heights)]
        lowest, highest = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
        standing = 0.0 if top is ground else float(np.nanmax((top - ground)[r0:r1, c0:c1], initial=0.0))
        error = limits.altitude_error_m + SAMPLED_KEEP_M
        floors, floor_map = _floors(problem, (c0, r0, c1, r1), (west, south, east, north), centre, scale_m)
        floor_map = quadratic if floor_map is None else floor_map
        least = floors[np.isfinite(floors)]
        lower, upper = (float(least.min()), float(least.max())) if least.size else (lowest, highest)
        agl = FAR if limits.max_agl_m is None else limits.max_agl_m - error - standing
        amsl = FAR if limits.max_amsl_m is None else limits.max_amsl_m - error
        numbers[[k.MAX_AGL, k.MAX_AMSL]] = max(agl, limits.min_agl_m + error), amsl
        numbers[k.UP] = min(KEEP_SLOPE * limits.max_climb_slope, FAR)
        numbers[k.DOWN] = min(KEEP_SLOPE * limits.max_descent_slope, FAR)
        numbers[[k.H_MIN, k.H_MAX]] = limits.min_agl_m, highest
        ends = [problem.start[2], problem.goal[2], *(v.amsl_m for v in problem.via if v.amsl_m is not None)]
        bottom = min(lower, *ends)
        ceiling = min(amsl, highest + agl, max(upper, *ends) + 0.2 * (upper - lowest))
        ceiling = max(ceiling, *ends, bottom + 1.0)
        given = volume or {}
        low = np.array([west, south, float(given.get("bottom_m", bottom))])
        high = np.array([east, north, float(given.get("top_m", ceiling))])
        numbers[[k.WEST, k.SOUTH, k.BOTTOM, k.EAST, k.NORTH, k.TOP]] = *low, *high
        scene = cls(
            heights,
            quadratic,
            floors,
            floor_map,
            numbers,
            *_zones(problem.airspace, limits),
            low,
            high,
            np.zeros((0, 3)),
            0.0,
        )  # incomplete, but `_terminals` can read heights from it
        terminals = scene._terminals(problem, flat)
        if not ((terminals >= low - 1e-6).all() and (terminals <= high + 1e-6).all()):
            raise InputError(
                f"the flight volume of the swarm ({', '.join(VOLUME_KEYS)}) must hold start, via points and goal: "
                f"from {np.round(low, 1).tolist()} to {np.round(high, 1).tolist()} it does not"
            )
        straight = float(np.linalg.norm(np.diff(terminals, axis=0), axis=1).sum())
        # Between two samples a chord enters a circle by at most spacing² / 8R.
        spacing = 1.5 * straight / SAMPLES
        numbers[k.SPACING] = spacing
        zones = scene.zones.copy()
        zones[:, k.REACH] += np.minimum(spacing**2 / (8.0 * zones[:, k.ZR]), 0.2 * zones[:, k.ZR]) + SAMPLED_KEEP_M
        return cls(heights, quadratic, floors, floor_map, numbers, zones, scene.corners, low, high, terminals, straight)

    @property
    def ceiling_follows_ground(self) -> bool:
        """Whether the mission has a maximum AGL."""
        return bool(self.numbers[k.MAX_AGL] < 0.5 * FAR)

    @property
    def follows_ground(self) -> bool:
        """Whether the ceiling or a zone's level follows the ground."""
        return self.ceiling_follows_ground or bool(self.zones[:, [k.LOW_AGL, k.HIGH_AGL]].any())

    def ground(self, points: Floats) -> Floats:
        """Height of the ground (...,) under points (..., 2 or more); NaN where unknown."""
        return self._heights(self.heights, self.quadratic, points)

    def floor(self, points: Floats) -> Floats:
        """Lowest legal altitude (...,) at points (..., 2 or more); NaN where ground within reach is unknown."""
        return self._heights(self.floors, self.floor_map, points)

    def _heights(self, raster: Singles, to_raster: Floats, points: Floats) -> Floats:
        flat = np.ascontiguousarray(points).reshape(-1, points.shape[-1])
        out = np.empty(len(flat))
        k.heights_at(raster, to_raster, self.numbers, flat, out)
        return out.reshape(points.shape[:-1])

    def room(self, points: Floats) -> tuple[Floats, Floats]:
        """Lowest and highest legal altitude at points, clipped to the volume; the lowest is never above the highest.

        Over unknown ground the lowest is the volume's top.
        """
        flat = np.ascontiguousarray(points).reshape(-1, points.shape[-1])
        low, high = np.empty(len(flat)), np.empty(len(flat))
        k.rooms(self._ground, flat, self.ceiling_follows_ground, low, high)
        shape = points.shape[:-1]
        return low.reshape(shape), high.reshape(shape)

    @cached_property
    def _ground(self) -> Held:
        """The arrays that `rooms` reads, prepared for the many calls that each have few points."""
        return Held(k.GROUND, self.heights, self.quadratic, self.floors, self.floor_map, self.numbers)

    def _terminals(self, problem: Problem, flat: Floats) -> Floats:
        """Start, via points and goal (M, 3). A via of free altitude is put on the line between its neighbours of fixed
        altitude, clipped to floor and ceiling."""
        known = [problem.start[2], *(math.nan if v.amsl_m is None else v.amsl_m for v in problem.via), problem.goal[2]]
        z = np.array(known)
        along = distances_m(flat)
        fixed = np.isfinite(z)
        low, high = self.room(flat)
        z = np.where(fixed, z, np.clip(np.interp(along, along[fixed], z[fixed]), low, high))
        return np.column_stack([flat, z])


def _flat_volume(terminals: Floats, given: Mapping[str, float]) -> tuple[float, float, float, float]:
    """West, south, east, north of the square around the terminals plus `GROWN`; sides in ``given`` replace its own."""
    low, high = terminals.min(axis=0), terminals.max(axis=0)
    longest = float((high - low).max())
    more = 0.5 * (longest - (high - low)) + GROWN * longest
    low, high = low - more, high + more
    west, south = float(given.get("west_m", low[0])), float(given.get("south_m", low[1]))
    return west, south, float(given.get("east_m", high[0])), float(given.get("north_m", high[1]))


def _fit(surface: Surface, east: Floats, north: Floats) -> tuple[Floats, tuple[float, float], float]:
    """Fit a quadratic to the map to the grid, over the volume: a raster in degrees bends by metres in tens of km.

    Returns the coefficients (2, 6), the centre (east, north) and the metres of one unit of u and v.
    """
    centre = (float(east.mean()), float(north.mean()))
    scale_m = max(float(np.ptp(east)), float(np.ptp(north)), 1.0)
    u, v = (east - centre[0]) / scale_m, (north - centre[1]) / scale_m
    basis = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)
    solved, *_ = np.linalg.lstsq(basis, surface.grid(east, north), rcond=None)
    return np.ascontiguousarray(solved.T), centre, scale_m


def _floors(
    problem: Problem,
    window: tuple[int, int, int, int],
    box: tuple[float, float, float, float],
    centre: tuple[float, float],
    scale_m: float,
) -> tuple[Singles, Floats | None]:
    """Lowest legal altitudes on the raster's own nodes, or on a grid over ``box`` if these are too many or too few.

    Returns the floors and the map to their grid, None if that is the raster's own.
    """
    air = problem.airspace
    c0, r0, c1, r1 = window
    to_nodes: Floats | None = None
    if 16 < (c1 - c0) * (r1 - r0) <= FLOOR_NODES:
        at = _nodes(air.surface, np.arange(c0, c1), np.arange(r0, r1))
    else:
        west, south, east, north = box
        side = math.isqrt(FLOOR_NODES)
        at = np.stack(np.meshgrid(np.linspace(west, east, side + 1), np.linspace(north, south, side + 1)), axis=-1)
        per_e, per_n = side / (east - west), side / (north - south)
        to_nodes = np.zeros((2, 6))
        to_nodes[0, :2] = (centre[0] - west) * per_e, scale_m * per_e
        to_nodes[1, [0, 2]] = (north - centre[1]) * per_n, -scale_m * per_n
    floor = air.floor_amsl(at[..., 0], at[..., 1], problem.limits) + SAMPLED_KEEP_M
    return np.ascontiguousarray(np.where(np.isfinite(floor), floor, np.nan), dtype=np.float32), to_nodes


def _nodes(surface: Surface, cols: Indices, rows: Indices) -> Floats:
    """Places (rows, cols, 2) of nodes, by a quadratic fit: the exact inverse would take longer than the floors."""
    some_c, some_r = np.meshgrid(np.linspace(cols[0], cols[-1], 9), np.linspace(rows[0], rows[-1], 9))
    places = surface.grid.to_plane(some_c.ravel(), some_r.ravel())

    def basis(c: Floats, r: Floats) -> Floats:
        u, v = (c - cols[0]) / (cols[-1] - cols[0]), (r - rows[0]) / (rows[-1] - rows[0])
        return np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=-1)

    solved, *_ = np.linalg.lstsq(basis(some_c.ravel(), some_r.ravel()), places, rcond=None)
    c, r = np.meshgrid(cols.astype(np.float64), rows.astype(np.float64))
    return np.asarray(basis(c, r) @ solved)


def _window(surface: Surface, box: tuple[float, float, float, float]) -> tuple[int, int, int, int]:
    """First column and row, end column and row (exclusive), at least two of each, around a box of the plane plus one
    cell."""
    west, south, east, north = box
    edge = np.linspace(0.0, 1.0, 5)
    e = np.concatenate([west + edge * (east - west)] * 2 + [np.full(5, west), np.full(5, east)])
    n = np.concatenate([np.full(5, south), np.full(5, north)] + [south + edge * (north - south)] * 2)
    at = surface.grid(e, n)
    rows, cols = surface.top_m.shape
    c0, r0 = np.clip(np.floor(at.min(axis=0)).astype(int) - 1, 0, [cols - 2, rows - 2])
    c1, r1 = np.clip(np.ceil(at.max(axis=0)).astype(int) + 2, [c0 + 2, r0 + 2], [cols, rows])
    return int(c0), int(r0), int(c1), int(r1)


def _zones(air: Airspace, limits: Limits) -> tuple[Floats, Floats]:
    """Zones (Z, ZONE_COLUMNS), and the corners (C, 2) of all polygons. Each zone lies in a disc: a polygon in that
    around the middle of its box."""
    table = air.zone_table
    zones, corners = np.zeros((len(table), k.ZONE_COLUMNS)), table.arrays.vertex
    zones[:, [k.ZE, k.ZN, k.ZR]] = table.discs_m
    zones[:, k.FIRST], last = table.arrays.table[:, [FIRST, LAST]].T
    zones[:, k.CORNERS] = last - zones[:, k.FIRST]
    for zone in np.flatnonzero(zones[:, k.CORNERS]).tolist():
        middle = 0.5 * (table.box_m[zone, :2] + table.box_m[zone, 2:])
        zones[zone, [k.ZE, k.ZN, k.ZR]] = *middle, np.hypot(*(table.corners_m(zone) - middle).T).max()
    zones[:, k.REACH] = air.beside_m(limits)
    zones[:, [k.Z_LOW, k.Z_HIGH]] = np.clip(np.transpose(table.levels_m(limits.over_zone_m)), -FAR, FAR)
    zones[:, [k.LOW_AGL, k.HIGH_AGL]] = table.over_ground
    # The centre of IB-ABC's sphere for a zone is half-way up, or at 0 if the zone has no ceiling.
    low, high = table.levels_m()
    zones[:, k.Z_MIDDLE] = np.where(np.isfinite(high), 0.5 * (high + np.where(np.isfinite(low), low, 0.0)), 0.0)
    return zones, corners
