"""Data for the view in space: the zones as meshes whose floors and ceilings follow the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gcsplan.arrays import Floats, Indices
from gcsplan.report.parts.track_samples import TrackLine, level_amsl
from gcsplan.report.views.shaded_terrain import Relief
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Circle, Polygon, Zone

MESH_CIRCLE_CORNERS = 48
MESH_RINGS = (1.0, 0.66, 0.33)
MESH_EDGE_PARTS = 160
"""Corners of a polygon after its edges are cut, about; each corner has its own height above ground."""
MOST_MESH_CORNERS = 240
BELOW_M = 1.0
"""Metres below ground at which a zone without a floor is drawn to begin."""


def exaggeration(relief: Relief, lines: Sequence[TrackLine]) -> float:
    """The factor by which heights are stretched at first, to a tenth of the width: 1 to 8, in halves."""
    highest = max([relief.high_m, *(float(line.amsl_m.max()) for line in lines)])
    span = highest - relief.low_m
    if not span > 1e-6:
        return 1.0
    exaggeration = 0.1 * max(relief.extent.width_m, relief.extent.height_m) / span
    return float(min(max(round(2.0 * exaggeration) / 2.0, 1.0), 8.0))


def zone_meshes(
    zones: Sequence[Zone], surface: Surface, relief: Relief, lines: Sequence[TrackLine]
) -> list[dict[str, object]]:
    """Each zone on the map: name, whether it is open above (no ceiling), and the mesh of its sides and lids.

    ``at`` holds x, y, z of each corner (east and north of the map's south-western corner, AMSL, metres), ``faces``
    three corners each, ``edges`` two corners each.
    """
    extent = relief.extent
    if not math.isfinite(relief.low_m):
        return []
    top = max([relief.high_m, *(float(line.amsl_m.max()) for line in lines)])
    top += 0.25 * max(top - relief.low_m, 0.02 * extent.width_m)
    meshes: list[dict[str, object]] = []
    for index, zone in enumerate(zones):
        west, south, east, north = zone.bounds
        if west > extent.east_m or east < extent.west_m or south > extent.north_m or north < extent.south_m:
            continue
        ring, inner, lid = _lid(zone)
        every = np.concatenate([ring, inner]) if len(inner) else ring
        ground = surface.ground_at(every[:, 0], every[:, 1])
        if np.isnan(ground).all():
            continue
        ground = np.where(np.isnan(ground), np.nanmin(ground), ground)
        low = level_amsl(zone.floor, ground, math.nan)
        low = np.where(np.isnan(low), ground - BELOW_M, low)
        high = np.maximum(level_amsl(zone.ceiling, ground, max(top, float(ground.max()) + 1.0)), low)
        if zone.floor is not None and zone.floor.datum == "agl" and zone.floor.value_m <= 0.0:
            low = np.minimum(low, ground - BELOW_M)
        n, m = len(ring), len(every)
        here, then = np.arange(n), np.roll(np.arange(n), -1)
        sides = np.concatenate([np.column_stack([here, then, m + then]), np.column_stack([here, m + then, m + here])])
        faces = np.concatenate([sides, lid, lid + m]).ravel()
        stride = max(1, n // 6)
        upright = here[::stride] if isinstance(zone.shape, Circle) else here[_corners(zone, n)]
        edges = np.concatenate(
            [
                np.column_stack([here, then]),
                np.column_stack([m + here, m + then]),
                np.column_stack([upright, m + upright]),
            ]
        ).ravel()
        xy = every - (extent.west_m, extent.south_m)
        at = np.concatenate([np.column_stack([xy, low]), np.column_stack([xy, high])])
        meshes.append(
            {
                "zone": index, "name": zone.name, "open": zone.ceiling is None,
                "at": np.round(at, 1).ravel().tolist(), "faces": faces.tolist(), "edges": edges.tolist(),
            }
        )  # fmt: skip
    return meshes


def _lid(zone: Zone) -> tuple[Floats, Floats, Indices]:
    """The rim of a zone's shape, points inside it, and the triangles over both."""
    shape = zone.shape
    if isinstance(shape, Circle):
        turn = 2.0 * np.pi * np.arange(MESH_CIRCLE_CORNERS) / MESH_CIRCLE_CORNERS
        centre = np.array([shape.east_m, shape.north_m])
        rings = [centre + part * shape.radius_m * np.column_stack([np.cos(turn), np.sin(turn)]) for part in MESH_RINGS]
        here, then = np.arange(MESH_CIRCLE_CORNERS), np.roll(np.arange(MESH_CIRCLE_CORNERS), -1)
        faces = []
        for k in range(len(MESH_RINGS) - 1):
            a, b = k * MESH_CIRCLE_CORNERS, (k + 1) * MESH_CIRCLE_CORNERS
            faces += [np.column_stack([a + here, a + then, b + then]), np.column_stack([a + here, b + then, b + here])]
        last, middle = (len(MESH_RINGS) - 1) * MESH_CIRCLE_CORNERS, len(MESH_RINGS) * MESH_CIRCLE_CORNERS
        faces.append(np.column_stack([last + here, last + then, np.full(MESH_CIRCLE_CORNERS, middle)]))
        return rings[0], np.concatenate([*rings[1:], centre[None]]), np.concatenate(faces)
    corners = _thinned(shape)
    ends = np.roll(corners, -1, axis=0)
    ring = np.concatenate(
        [a + (b - a) * (np.arange(k) / k)[:, None] for a, b, k in zip(corners, ends, _parts(corners), strict=True)]
    )
    return ring, np.empty((0, 2)), triangles(ring)


def _thinned(shape: Polygon) -> Floats:
    """A polygon's corners, thinned out if there are very many."""
    return shape.vertices[:: max(1, len(shape.vertices) // MOST_MESH_CORNERS)]


def _parts(corners: Floats) -> Indices:
    """The number of parts that each edge is cut into."""
    lengths = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T)
    return np.asarray(np.maximum(1, np.round(MESH_EDGE_PARTS * lengths / lengths.sum())), dtype=np.intp)


def _corners(zone: Zone, n: int) -> Indices:
    """Positions of the polygon's own corners among the ``n`` of its cut edges; none if too many to draw."""
    assert isinstance(zone.shape, Polygon)
    at = np.concatenate([[0], np.cumsum(_parts(_thinned(zone.shape)))[:-1]])
    return np.asarray(at if len(at) <= 24 and at[-1] < n else at[:0], dtype=np.intp)


def triangles(corners: Floats) -> Indices:
    """(N - 2, 3) corners of the triangles of a simple polygon (N, 2), counter-clockwise, by ear clipping."""
    left = list(range(len(corners)))
    out: list[tuple[int, int, int]] = []
    size = float(np.abs(corners - corners.mean(axis=0)).max()) ** 2
    turns = 0
    while len(left) > 3 and turns <= 2 * len(left):
        a, b, c = left[-1], left[0], left[1]
        if _is_ear(corners, left, a, b, c, 1e-12 * size, flat=turns > len(left)):
            out.append((a, b, c))
            left.pop(0)
            turns = 0
        else:
            left.append(left.pop(0))
            turns += 1
    if len(left) == 3:
        out.append((left[0], left[1], left[2]))
    return np.array(out, dtype=np.intp).reshape(-1, 3)


def _is_ear(p: Floats, left: list[int], a: int, b: int, c: int, noise: float, *, flat: bool) -> bool:
    """Whether corners a, b, c are an ear; with ``flat``, also if they are on one line (the last resort)."""

    def twice(i: int, j: int, at: Floats) -> Floats:
        return np.asarray((p[j, 0] - p[i, 0]) * (at[..., 1] - p[i, 1]) - (p[j, 1] - p[i, 1]) * (at[..., 0] - p[i, 0]))

    area = float(twice(a, b, p[c]))
    if area <= noise:
        return flat and area >= -noise
    others = p[[k for k in left if k not in (a, b, c)]]
    inside = (twice(a, b, others) > noise) & (twice(b, c, others) > noise) & (twice(c, a, others) > noise)
    return not bool(inside.any())
