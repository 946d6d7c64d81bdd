"""Zones as the arrays that the kernels take."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcsplan.arrays import Floats, Int64s
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Circle, Level, Zone
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.shared import (
    BAND_HIGH,
    BAND_LOW,
    CEILING,
    CEILING_AGL,
    COL0,
    COL1,
    EAST,
    EAST_E,
    FIRST,
    FLOOR,
    FLOOR_AGL,
    LAST,
    NORTH,
    NORTH_N,
    RADIUS,
    ROW0,
    ROW1,
    SOUTH_N,
    WEST_E,
    ZONE_NUMBERS,
    Zones,
)

BOX = [WEST_E, SOUTH_N, EAST_E, NORTH_N]
MOST_SQUARES = 128  # most squares of the lattice along one side
MOST_LISTED = 2_000_000  # most zones in all squares together, 8 bytes each: large zones lie in every square


def over_both_grounds(zones: Sequence[Zone], surface: Surface, field: Field, scale: float) -> tuple[Zone, ...]:
    """``zones`` over a ground of two heights: their levels above ground count from the least one, so a ceiling is
    higher by the largest difference under its zone. Such a zone holds the zone over any ground between the two."""
    out = []
    for zone in zones:
        if surface.differs and zone.ceiling is not None and zone.ceiling.datum == "agl":
            west, south, east, north = zone.bounds
            more = 0.5 * (scale - 1.0) * max(east - west, north - south)  # a radius becomes metres of the plane
            box = np.array([west - more, south - more, east + more, north + more])
            i0, i1, j0, j1 = _cells(box, surface, field)
            part = slice(max(j0, 0), max(j1 + 2, 0)), slice(max(i0, 0), max(i1 + 2, 0))
            spread_m = surface.spread_m(*part)
            zone = replace(zone, ceiling=replace(zone.ceiling, value_m=zone.ceiling.value_m + spread_m))
        out.append(zone)
    return tuple(out)


def zones_as_arrays(zones: Sequence[Zone], surface: Surface, field: Field, scale: float) -> Zones:
    """Arrays of ``zones``; radii become metres of the plane, levels over ground get bounds over the zone's ground."""
    rows: list[list[float]] = []  # lists, because numpy takes longer to fill a row of a few numbers
    vertices: list[Floats] = []
    corners = 0
    for zone in zones:
        row = [0.0] * ZONE_NUMBERS
        shape = zone.shape
        row[FIRST] = row[LAST] = corners
        if isinstance(shape, Circle):
            row[EAST], row[NORTH], row[RADIUS] = shape.east_m, shape.north_m, (radius := shape.radius_m * scale)
            box = shape.east_m - radius, shape.north_m - radius, shape.east_m + radius, shape.north_m + radius
        else:
            v = np.asarray(shape.vertices, dtype=np.float64)
            vertices.append(v)
            corners += len(v)
            row[EAST], row[NORTH], row[RADIUS], row[LAST] = float(v[0, 0]), float(v[0, 1]), -1.0, corners
            box = shape.bounds
        for number, value in zip(BOX, box, strict=True):
            row[number] = value
        floor, ceiling = zone.floor or Level(-math.inf, "amsl"), zone.ceiling or Level(math.inf, "amsl")
        row[FLOOR] = row[BAND_LOW] = floor.value_m
        row[CEILING] = row[BAND_HIGH] = ceiling.value_m
        row[FLOOR_AGL], row[CEILING_AGL] = floor.datum == "agl", ceiling.datum == "agl"
        if zone.follows_ground:
            cell = _cells(np.array(box), surface, field)
            low, high = _ground_range(cell, surface.ground_m)
            row[COL0], row[COL1], row[ROW0], row[ROW1] = cell
            row[BAND_LOW] += low if row[FLOOR_AGL] else 0.0
            row[BAND_HIGH] += high if row[CEILING_AGL] else 0.0
        rows.append(row)
    table = np.array(rows, np.float64).reshape(len(zones), ZONE_NUMBERS)
    most = max((len(v) for v in vertices), default=0)
    return Zones(table, np.concatenate(vertices) if vertices else np.zeros((0, 2)), *lattice_over(table[:, BOX]), most)


def _cells(box: Floats, surface: Surface, field: Field) -> tuple[int, int, int, int]:
    """First and last column and row of the cells that a box of the plane may touch; beyond the DEM too."""
    f = np.linspace(0.0, 1.0, 2 if field.affine else 9)
    if not field.affine:  # beyond the fitted square the map is not valid, and no leg is judged there
        middle = np.array(surface.grid.centre * 2)
        box = np.clip(box, middle - 1.05 * surface.grid.scale_m, middle + 1.05 * surface.grid.scale_m)
    east, north = box[0] + f * (box[2] - box[0]), box[1] + f * (box[3] - box[1])
    e, n = (a.ravel() for a in np.meshgrid(east, north))
    at = surface.grid(e, n)
    # Between the lattice's points the map deviates by its bend; a cell and a half more is far beyond that.
    spare = 1.5 + field.bend * (box[2] - box[0] + box[3] - box[1]) ** 2 / min(field.step_x, field.step_y)
    low, high = np.floor(at.min(axis=0) - spare), np.floor(at.max(axis=0) + spare)
    low, high = np.maximum(low, -1e9), np.minimum(high, 1e9)
    return int(low[0]), int(high[0]), int(low[1]), int(high[1])


def _ground_range(cell: tuple[int, int, int, int], ground: Floats) -> tuple[float, float]:
    """Lowest and highest node of the cells; infinite if one of them is unknown."""
    rows, cols = ground.shape
    i0, i1, j0, j1 = cell
    part = ground[max(j0, 0) : max(j1 + 2, 0), max(i0, 0) : max(i1 + 2, 0)]
    if i0 < 0 or j0 < 0 or i1 > cols - 2 or j1 > rows - 2 or not part.size or np.isnan(part).any():
        return -math.inf, math.inf
    return float(part.min()), float(part.max())


def lattice_over(box: Floats) -> tuple[Floats, Int64s, Int64s]:
    """The lattice of coarse squares over all zones, and the zones of each square, one square after the other."""
    if not len(box):
        return np.array([0.0, 0.0, 1.0, 1.0, 1.0]), np.zeros(2, np.int64), np.zeros(0, np.int64)
    west, south = box[:, 0].min(), box[:, 1].min()
    wide, tall = box[:, 2].max() - west, box[:, 3].max() - south
    side = max(max(wide, tall) / min(MOST_SQUARES, 2.0 * math.sqrt(len(box)) + 1.0), 1.0)
    while True:
        cols, rows = int(wide / side) + 1, int(tall / side) + 1
        corner = np.floor((box - (west, south, west, south)) / side).astype(np.int64)
        corner[:, 0::2] = corner[:, 0::2].clip(0, cols - 1)
        corner[:, 1::2] = corner[:, 1::2].clip(0, rows - 1)
        count = (corner[:, 2] - corner[:, 0] + 1) * (corner[:, 3] - corner[:, 1] + 1)
        if count.sum() <= MOST_LISTED or cols * rows == 1:
            break
        side *= 2.0
    wide = corner[:, 2] - corner[:, 0] + 1
    zone = np.repeat(np.arange(len(box)), count)
    place = np.arange(len(zone)) - np.repeat(np.cumsum(count) - count, count)
    square = (corner[zone, 1] + place // wide[zone]) * cols + corner[zone, 0] + place % wide[zone]
    near = np.ascontiguousarray(zone[np.argsort(square, kind="stable")], np.int64)
    bucket = np.zeros(cols * rows + 1, np.int64)
    bucket[1:] = np.cumsum(np.bincount(square, minlength=cols * rows))
    return np.array([west, south, 1.0 / side, cols, rows]), bucket, near
