"""The table of zones: what the exact check, meshes, lattices and swarms know of each zone, and its own ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from gcsplan.arrays import Bools, Floats, Int64s
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Box, Circle, Level, Zone
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
DEEP_M, DEEP_PART = 0.005, 0.0005
MOST_LOOKS = 200_000

OWN_GROUND_RINGS = ((0.0, 1), (1.0 / 3.0, 8), (2.0 / 3.0, 16), (0.9, 32), (1.0, 64))
"""Circles of points on which a zone's own ground is read: their radius, as a part of the reach, and how many."""
RING_POINTS = sum(n for _, n in OWN_GROUND_RINGS)


def places_on(rings: Sequence[tuple[float, int]]) -> Floats:
    """(N, 2) places on circles around (0, 0), each of a radius and with as many places."""
    return np.array([(r * math.cos(a), r * math.sin(a)) for r, n in rings for a in np.arange(n) * (2.0 * math.pi / n)])


_RING_PLACES = places_on(OWN_GROUND_RINGS)


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


@dataclass(frozen=True, eq=False)
class ZoneTable:
    """The zones of an airspace, one row each: the exact check, meshes, lattices and swarms read them here.

    ``zones`` (Z,): the zones themselves; ``arrays``: the same as kernels read them, in metres of the plane. Distances
    are metres of the plane, altitudes m AMSL, or m above the ground where a level follows it.
    """

    zones: tuple[Zone, ...]
    arrays: Zones
    surface: Surface
    _polygons: dict[int, Any] = field(default_factory=dict, init=False, repr=False)
    _rises: dict[tuple[float, ...], float] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(cls, zones: Sequence[Zone], surface: Surface, map_: Field, scale: float) -> ZoneTable:
        """The table of ``zones``; radii become metres of the plane (``scale`` to a real one, at most), and levels over
        ground get bounds over the zone's ground."""
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
                cell = _cells(np.array(box), surface, map_)
                low, high = _ground_range(cell, surface.ground_m)
                row[COL0], row[COL1], row[ROW0], row[ROW1] = cell
                row[BAND_LOW] += low if row[FLOOR_AGL] else 0.0
                row[BAND_HIGH] += high if row[CEILING_AGL] else 0.0
            rows.append(row)
        table = np.array(rows, np.float64).reshape(len(zones), ZONE_NUMBERS)
        most = max((len(v) for v in vertices), default=0)
        vertex = np.concatenate(vertices) if vertices else np.zeros((0, 2))
        return cls(tuple(zones), Zones(table, vertex, *lattice_over(table[:, BOX]), most), surface)

    def __len__(self) -> int:
        return len(self.zones)

    @cached_property
    def box_m(self) -> Floats:
        """(Z, 4) west, south, east and north of each zone's shape."""
        return self.arrays.table[:, BOX]

    @cached_property
    def discs_m(self) -> Floats:
        """(Z, 3) east, north and radius of each circle; the radius of a polygon is -1."""
        return self.arrays.table[:, [EAST, NORTH, RADIUS]]

    @cached_property
    def over_ground(self) -> Bools:
        """(Z, 2) whether the floor, and whether the ceiling, follow the ground."""
        return np.asarray(self.arrays.table[:, [FLOOR_AGL, CEILING_AGL]] != 0.0)

    @cached_property
    def follow_ground(self) -> Bools:
        """(Z,) whether the floor or the ceiling follows the ground."""
        return np.asarray(self.over_ground.any(axis=1))

    def corners_m(self, zone: int) -> Floats:
        """(V, 2) the corners of a polygon; none of a circle."""
        first, last = self.arrays.table[zone, [FIRST, LAST]].astype(np.intp).tolist()
        return self.arrays.vertex[first:last]

    def levels_m(self, error_m: float = 0.0, ground_m: float = 0.0) -> tuple[Floats, Floats]:
        """(Z,) the lowest and the highest altitude that each zone forbids, with an altitude error, over ground at
        ``ground_m`` AMSL; -inf and inf without a level, NaN where that ground is NaN and the level follows it."""
        table, follows = self.arrays.table, np.where(self.over_ground, ground_m, 0.0)
        return table[:, FLOOR] - error_m + follows[:, 0], table[:, CEILING] + error_m + follows[:, 1]

    def within(self, box_m: Box, reach_m: float) -> list[int]:
        """The zones whose box comes within ``reach_m`` of another box."""
        west, south, east, north = self.box_m.T
        near = (west - reach_m <= box_m[2]) & (east + reach_m >= box_m[0])
        return np.flatnonzero(near & (south - reach_m <= box_m[3]) & (north + reach_m >= box_m[1])).tolist()

    def spans(self, track: Floats, within_m: float, over_ground_m: float) -> list[tuple[int, float, float]]:
        """(zone, s0_m, s1_m) of each span of ``track`` (N, 2) within reach of a zone, by zone and metres along.

        The reach is ``within_m``, or ``over_ground_m`` for a zone with a level over ground.
        """
        table = self.arrays.table
        start, step = track[:-1], np.diff(track, axis=0)
        length = np.hypot(step[:, 0], step[:, 1])
        begin = np.cumsum(length) - length
        reach = np.where(self.follow_ground, over_ground_m, within_m)
        low, high = np.minimum(start, start + step), np.maximum(start, start + step)
        legs, which = np.nonzero(
            (length[:, None] > 0.0)
            & (table[:, WEST_E] - reach <= high[:, None, 0])
            & (table[:, EAST_E] + reach >= low[:, None, 0])
            & (table[:, SOUTH_N] - reach <= high[:, None, 1])
            & (table[:, NORTH_N] + reach >= low[:, None, 1])
        )
        found: list[tuple[int, float, float]] = []
        for leg, k in zip(legs.tolist(), which.tolist(), strict=True):
            unit = step[leg] / length[leg]
            if table[k, RADIUS] >= 0.0:
                away = table[k, [EAST, NORTH]] - start[leg]
                parts = _circle(away, unit, float(table[k, RADIUS] + reach[k]), float(length[leg]))
            else:
                corners = self.corners_m(k) - start[leg]
                parts = _polygon(corners, unit, float(reach[k]), float(length[leg]))
            found += [(k, float(begin[leg] + a), float(begin[leg] + b)) for a, b in parts]
        found.sort()
        merged: list[tuple[int, float, float]] = []
        for k, s0, s1 in found:
            # A span that continues on the next leg is one span.
            if merged and merged[-1][0] == k and s0 <= merged[-1][2] + 1e-6:
                merged[-1] = (k, merged[-1][1], max(merged[-1][2], s1))
            else:
                merged.append((k, s0, s1))
        return merged

    def near(self, zone: int, a: Floats, b: Floats, reach_m: float) -> Bools:
        """(K,) whether segments ``a``–``b`` (K, 2) come within ``reach_m`` of a zone's shape."""
        east_m, north_m, radius_m = self.discs_m[zone].tolist()
        if radius_m >= 0.0:
            centre = np.array([east_m, north_m])
            d = b - a
            t = np.clip(((centre - a) * d).sum(-1) / np.maximum((d * d).sum(-1), 1e-300), 0.0, 1.0)
            off = a + t[:, None] * d - centre
            return np.asarray(np.hypot(off[:, 0], off[:, 1]) < radius_m + reach_m)
        if not len(a):
            return np.zeros(0, np.bool_)
        low, high = np.minimum(a, b).min(axis=0) - reach_m - 1.0, np.maximum(a, b).max(axis=0) + reach_m + 1.0
        box_m = self.box_m[zone]
        if (box_m[:2] > high).any() or (box_m[2:] < low).any():  # as most zones of a country's file are
            return np.zeros(len(a), np.bool_)
        import shapely  # most missions have no polygons

        # To shapely a line of no length is near nothing: lengthen it by a micrometre.
        far = np.where((a == b).all(axis=1, keepdims=True), b + 1e-6, b)
        return np.asarray(shapely.dwithin(self.polygon(zone), shapely.linestrings(np.stack([a, far], axis=1)), reach_m))

    def holds(self, zone: int, places: Floats) -> Bools:
        """(N,) whether places (N, 2) lie in a zone's shape as it is, not grown by the plane's scale."""
        shape = self.zones[zone].shape
        if isinstance(shape, Circle):
            return np.asarray(np.hypot(places[:, 0] - shape.east_m, places[:, 1] - shape.north_m) <= shape.radius_m)
        import shapely  # most missions have no polygons

        return np.asarray(shapely.contains_xy(self.polygon(zone), places))

    def own_ground_m(self, zone: int, places: Floats, reach_m: float) -> tuple[Floats, Floats]:
        """(N,) lowest and highest ground under a zone within ``reach_m`` of places (N, 2), as far as `RING_POINTS`
        around each show; inf and -inf where none of them is under the zone or known."""
        points = (places[:, None] + reach_m * _RING_PLACES).reshape(-1, 2)
        ground = self.surface.ground_at(*points.T)
        own = self.holds(zone, points) & np.isfinite(ground)
        low, high = np.where(own, ground, np.inf), np.where(own, ground, -np.inf)
        return low.reshape(len(places), -1).min(axis=1), high.reshape(len(places), -1).max(axis=1)

    def rise_m(self, zone: int, box_m: Box, reach_m: float) -> float:
        """Metres by which the ground under a zone may differ from the ground at a place of a box within reach, at most;
        0 if neither floor nor ceiling follows the ground, inf where ground is unknown."""
        if reach_m <= 0.0 or not self.follow_ground[zone]:
            return 0.0
        own_m = self.zones[zone].bounds
        west, south = (max(a, b) - reach_m for a, b in zip(own_m[:2], box_m[:2], strict=True))
        east, north = (min(a, b) + reach_m for a, b in zip(own_m[2:], box_m[2:], strict=True))
        key = zone, west, south, east, north, reach_m
        if key not in self._rises:  # a wider lattice holds the same zones
            self._rises[key] = self._rise_in(west, south, east, north, reach_m)
        return self._rises[key]

    def _rise_in(self, west: float, south: float, east: float, north: float, reach_m: float) -> float:
        grid = self.surface.grid
        e, n = np.meshgrid(np.linspace(west, east, 5), np.linspace(south, north, 5))
        at = grid(e.ravel(), n.ravel())
        first = np.maximum(np.floor(at.min(axis=0)).astype(np.intp) - 1, 0)
        last = np.maximum(np.ceil(at.max(axis=0)).astype(np.intp) + 2, first + 1)
        z = self.surface.ground_m[first[1] : last[1], first[0] : last[0]]
        across, along = (float(np.abs(np.diff(z, axis=a)).max(initial=0.0)) for a in (1, 0))
        turned = grid.jacobian(0.5 * (west + east), 0.5 * (south + north)).T
        steep = max(math.hypot(*(turned @ (across, along))), math.hypot(*(turned @ (across, -along))))
        return max(1.01 * reach_m * steep, 1e-9) if math.isfinite(steep) else math.inf

    def polygon(self, zone: int) -> Any:
        """The polygon of a zone that is none of the circles, as shapely has it, prepared for many questions."""
        if zone not in self._polygons:
            import shapely  # most missions have no polygons

            polygon = self._polygons[zone] = shapely.Polygon(self.corners_m(zone))
            shapely.prepare(polygon)
        return self._polygons[zone]


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


def _circle(away: Floats, unit: Floats, radius: float, length: float) -> list[tuple[float, float]]:
    middle, aside = float(away @ unit), float(away[1] * unit[0] - away[0] * unit[1])
    if abs(aside) >= radius:
        return []
    half = float(np.sqrt((radius - aside) * (radius + aside)))
    a, b = max(middle - half, 0.0), min(middle + half, length)
    return [(a, b)] if a <= b else []


def _polygon(corners: Floats, unit: Floats, reach: float, length: float) -> list[tuple[float, float]]:
    """Parts of the line from the origin along ``unit`` within ``reach`` of a polygon, its inside included."""
    along = corners @ unit
    aside = corners[:, 1] * unit[0] - corners[:, 0] * unit[1]
    low, high, crossing = grown_edges(along, aside, reach)
    keep = (low <= high) & (high >= 0.0) & (low <= length)
    marks = sorted(zip(low[keep].clip(0.0, length).tolist(), high[keep].clip(0.0, length).tolist(), strict=True))
    crossings = np.sort(crossing[~np.isnan(crossing)])
    out: list[tuple[float, float]] = []
    done = 0.0
    for a, b in [*marks, (length, length)]:
        # A gap between two parts is entirely inside or outside the polygon; an inside gap belongs to the span.
        inside = a > done and np.searchsorted(crossings, 0.5 * (a + done)) % 2 == 1
        first = done if inside else a
        if out and first <= out[-1][1]:
            out[-1] = (out[-1][0], max(out[-1][1], b))
        elif first < b:
            out.append((first, b))
        done = max(done, b)
    return out


def deepest_inside(edges: Floats, start: Floats, end: Floats) -> tuple[float, float]:
    """Greatest distance from a border, ``edges`` (E, 2, 2), of a segment's point inside it, and where on it (0 … 1).

    Never too small, and too large by at most `DEEP_M` or `DEEP_PART` of it, unless `MOST_LOOKS` places end the search
    early; 0 if no part is inside. For reports.
    """
    length = float(np.hypot(*(end - start)))
    best, at, looks = 0.0, 0.5, 0
    middle, half = np.linspace(0.0, 1.0, 33), 1.0 / 64
    while len(middle):
        depth = _depth_inside(edges, start + middle[:, None] * (end - start))
        k = int(depth.argmax())
        if depth[k] > best:
            best, at = float(depth[k]), float(middle[k])
        # The signed distance from the border changes by no more than the distance moved, inside and outside.
        looks += len(middle)
        spare = max(DEEP_M, DEEP_PART * best) if looks < MOST_LOOKS else np.inf
        open_ = middle[depth + half * length > best + spare]
        half *= 0.5
        middle = np.concatenate([open_ - half, open_ + half])
        middle = middle[(middle >= -half) & (middle <= 1.0 + half)].clip(0.0, 1.0)
    return (best + max(DEEP_M, DEEP_PART * best) if best > 0.0 else 0.0), at


def deepest_in_circle(shape: Circle, radius_m: float, p: Floats, q: Floats) -> tuple[float, float]:
    """How deep a segment gets into a circle, m, and where on it."""
    way, to = q - p, np.array([shape.east_m, shape.north_m]) - p
    square = float(way @ way)
    t = min(max(float(to @ way) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return radius_m - float(np.hypot(*(to - t * way))), t


def _depth_inside(edges: Floats, p: Floats) -> Floats:
    """(N,) signed distance of points (N, 2) from a border of edges (E, 2, 2), positive inside."""
    corners, after = edges[:, 0], edges[:, 1]
    edge = after - corners
    away = p[:, None] - corners
    w = ((away * edge).sum(-1) / np.maximum((edge * edge).sum(-1), 1e-30)).clip(0.0, 1.0)
    distance = np.linalg.norm(away - w[..., None] * edge, axis=-1).min(axis=1)
    e, n = p[:, :1], p[:, 1:]
    spans_n = (corners[:, 1] > n) != (after[:, 1] > n)
    with np.errstate(divide="ignore", invalid="ignore"):
        east_of = corners[:, 0] + (n - corners[:, 1]) / edge[:, 1] * edge[:, 0] > e
    return np.asarray(np.where((spans_n & east_of).sum(axis=1) % 2 == 1, distance, -distance))


def grown_edges(along: Floats, aside: Floats, reach: float) -> tuple[Floats, Floats, Floats]:
    """For each edge of a polygon, grown by ``reach``: the part of a line within it, and where the line crosses it.

    ``along``, ``aside`` (…, N) are the corners' coordinates along and beside the line. If no part is met, the beginning
    is above the end (inf, -inf); if nothing is crossed, the crossing is NaN.
    """
    along1, aside1 = np.roll(along, -1, axis=-1), np.roll(aside, -1, axis=-1)
    low, high = np.full(along.shape, np.inf), np.full(along.shape, -np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        # An edge grown by a disc is a strip and two discs; the hull of the line's parts in them is exact.
        for a, o in ((along, aside), (along1, aside1)):
            half = np.sqrt(reach * reach - o * o)
            low, high = np.fmin(low, a - half), np.fmax(high, a + half)
        edge = np.hypot(along1 - along, aside1 - aside)
        for side in (-reach, reach):
            a = along - side * (aside1 - aside) / edge
            o = aside + side * (along1 - along) / edge
            w = -o / (aside1 - aside)
            cut = np.where((w >= 0.0) & (w <= 1.0), a + w * (along1 - along), np.nan)
            low, high = np.fmin(low, cut), np.fmax(high, cut)
        crossing = np.where(
            (aside > 0.0) != (aside1 > 0.0), along - aside * (along1 - along) / (aside1 - aside), np.nan
        )
    return low, high, crossing
