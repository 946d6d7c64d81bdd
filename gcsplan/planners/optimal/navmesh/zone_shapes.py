"""Zones as the lattice wants them: discs and convex polygons, a hair smaller for bounds, a hair larger for paths."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.navmesh.zone_kernels import (
    BESIDE,
    BOTTOM,
    BOTTOM_2,
    EAST,
    FIRST,
    LAST,
    NORTH,
    NUMBERS,
    PAIR,
    RADIUS,
    TOP,
    TOP_2_AGL,
    TOP_AGL,
    UNDER,
    UNDER_2,
)
from gcsplan.planners.problem import Problem
from gcsplan.world.zones import Circle, Zone

Ints = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Fit:
    """Metres: how far a lattice's nodes may lie beside the terrain model's (``bent_m``); and for this and for rounding,
    by how much a bound's floors and zones are lower and smaller (``spare_m``), a path's higher and larger (``hair_m``).
    """

    bent_m: float
    spare_m: float
    hair_m: float


TOUCH_M = 1e-6
"""By so little too high is not too high, where nothing but the arithmetic is inexact."""

LOOSE, CLOSE = Fit(0.03, 0.05, 0.07), Fit(0.003, 0.01, 0.07)
"""As long as rows of cells may be pieces, and where slits a few centimetres wide count."""


@dataclass(frozen=True, eq=False, slots=True)
class Shapes:
    """Convex parts of zones, and crossings of two: ``low`` and ``high`` (numbers (K, NUMBERS), forms (E, 4)) for bounds
    and for paths.

    A form is a half-plane a - b x - c y > 0, or a disc (radius, x, y, 1). ``boxes`` (K, 4) first and last column and
    row of the cells that each part may touch, ``owner`` (K, 2) its zones, ``cells`` how many cells all boxes have.
    """

    low: tuple[Floats, Floats]
    high: tuple[Floats, Floats]
    boxes: Ints
    owner: NDArray[np.intp]
    cells: int


def make_shapes(problem: Problem, x: Floats, y: Floats, fit: Fit = LOOSE) -> Shapes:
    """The zones that reach into a lattice of nodes ``x``, ``y`` (rows, cols).

    Levels over ground are those over the zone's own ground, which tells what may be flown beside it too. There, a level
    is known by the ground below but for what that rises within reach. So such a zone is laid down twice: as it is, and
    grown, with levels moved by so much: the most that it rises anywhere, or, for paths, there, where cells are no
    smaller than that.
    """
    air, limits = problem.airspace, problem.limits
    reach = air.beside_m(limits)
    there = reach <= min(math.dist((x[0, 0], y[0, 0]), place) for place in ((x[0, 1], y[0, 1]), (x[1, 0], y[1, 0])))
    box = float(x.min()), float(y.min()), float(x.max()), float(y.max())
    found: list[tuple[int, Zone, Floats | None]] = []
    moved: list[float] = []
    """By how much levels over ground are moved; 0: by nothing, and the zone is not grown."""
    for number, zone in enumerate(air.zones):
        west, south, east, north = zone.bounds
        # A zone above or below all that may be flown stands in nobody's way.
        if west - reach > box[2] or east + reach < box[0] or south - reach > box[3] or north + reach < box[1]:
            continue
        parts: list[Floats | None] = [None]
        if not isinstance(zone.shape, Circle):
            parts = [*convex_parts(zone.shape.vertices)]
        rise = _rise(problem, zone, reach, box)
        for more in (0.0, rise) if rise > 0.0 else (0.0,):
            found.extend((number, zone, part) for part in parts)
            moved.extend(more for _ in parts)
    pairs = _crossing(found, reach + max(fit.spare_m, fit.hair_m))
    both: list[tuple[Floats, Floats]] = []
    bounds = np.zeros((len(found) + len(pairs), 4))
    for sign, off_m in ((-1.0, fit.spare_m), (1.0, fit.hair_m)):
        rows = np.zeros((len(found) + len(pairs), NUMBERS))
        forms: list[Floats] = []
        for k, (row, (_, zone, part)) in enumerate(zip(rows, found, strict=False)):
            grow = (0.0 if moved[k] == 0.0 and _follows(zone) else reach) + sign * off_m
            row[[BOTTOM, TOP]] = -np.inf, np.inf
            for level, at, more in ((zone.floor, BOTTOM, -1.0), (zone.ceiling, TOP, 1.0)):
                if level is not None:
                    over_ground = level.datum == "agl"
                    # What is told in AMSL is not rounded: a zone may be as high as the ceiling.
                    off = sign * off_m if over_ground or sign < 0.0 else -TOUCH_M
                    row[at] = level.value_m + more * (limits.altitude_error_m + off)
                    row[at + 2] = over_ground
                    if over_ground and moved[k] > 0.0 and there and sign > 0.0:
                        row[at + 2] = BESIDE
                    elif over_ground:
                        row[at] += more * sign * moved[k]
            row[UNDER] = zone.floor is not None
            row[RADIUS] = -1.0
            if part is None:
                assert isinstance(zone.shape, Circle)
                radius = max(zone.shape.radius_m * air.scale + grow, 0.0)
                row[[EAST, NORTH, RADIUS]] = zone.shape.east_m, zone.shape.north_m, radius
                forms.append(np.array([[radius, zone.shape.east_m, zone.shape.north_m, 1.0]]))
                middle = np.array([zone.shape.east_m, zone.shape.north_m])
                bounds[k] = np.concatenate([middle - radius, middle + radius])
            else:
                forms.append(_half_planes(part, grow, inner=sign < 0.0))
                bounds[k] = np.concatenate([part.min(axis=0) - grow, part.max(axis=0) + grow])
        for k, (a, b) in enumerate(pairs, len(found)):
            # Where two zones cross, an altitude that suits the one may not suit the other.
            rows[k] = rows[a]
            rows[k, [RADIUS, PAIR]] = -1.0, 1.0
            rows[k, BOTTOM_2 : TOP_2_AGL + 1] = rows[b, BOTTOM : TOP_AGL + 1]
            rows[k, UNDER_2] = rows[b, UNDER]
            forms.append(np.vstack([forms[a], forms[b]]))
            bounds[k, :2] = np.maximum(bounds[a, :2], bounds[b, :2])
            bounds[k, 2:] = np.minimum(bounds[a, 2:], bounds[b, 2:])
        lengths = np.cumsum([0] + [len(f) for f in forms])
        rows[:, FIRST], rows[:, LAST] = lengths[:-1], lengths[1:]
        both.append((rows, np.ascontiguousarray(np.concatenate(forms)) if forms else np.zeros((0, 4))))
    boxes = _cells(bounds, x, y)
    size = (boxes[:, 1] - boxes[:, 0] + 1).clip(0) * (boxes[:, 3] - boxes[:, 2] + 1).clip(0)
    numbers = [number for number, *_ in found]
    owner = np.array([(n, n) for n in numbers] + [(numbers[a], numbers[b]) for a, b in pairs], np.intp).reshape(-1, 2)
    return Shapes(both[0], both[1], boxes, owner, int(size.sum()))


def _follows(zone: Zone) -> bool:
    """Whether a level of a zone follows the ground."""
    return any(level is not None and level.datum == "agl" for level in (zone.floor, zone.ceiling))


def _rise(problem: Problem, zone: Zone, reach: float, box: tuple[float, float, float, float]) -> float:
    """How much the ground under a zone may differ from that at a place within reach; 0 where its levels are fixed."""
    if reach <= 0.0 or not _follows(zone):
        return 0.0
    surface = problem.airspace.surface
    west, south = (max(a, b) - reach for a, b in zip(zone.bounds[:2], box[:2], strict=True))
    east, north = (min(a, b) + reach for a, b in zip(zone.bounds[2:], box[2:], strict=True))
    e, n = np.meshgrid(np.linspace(west, east, 5), np.linspace(south, north, 5))
    at = surface.grid(e.ravel(), n.ravel())
    first = np.maximum(np.floor(at.min(axis=0)).astype(np.intp) - 1, 0)
    last = np.maximum(np.ceil(at.max(axis=0)).astype(np.intp) + 2, first + 1)
    z = surface.ground_m[first[1] : last[1], first[0] : last[0]]
    across, along = (float(np.abs(np.diff(z, axis=a)).max(initial=0.0)) for a in (1, 0))
    turned = surface.grid.jacobian(0.5 * (west + east), 0.5 * (south + north)).T
    steep = max(math.hypot(*(turned @ (across, along))), math.hypot(*(turned @ (across, -along))))
    return max(1.01 * reach * steep, 1e-9) if math.isfinite(steep) else math.inf


def _crossing(found: list[tuple[int, Zone, Floats | None]], reach: float) -> list[tuple[int, int]]:
    """Pairs of parts that may cross, of zones that each alone may be passed above or below."""
    some = [k for k, (_, zone, _) in enumerate(found) if zone.floor is not None or zone.ceiling is not None]
    out = []
    for n, a in enumerate(some):
        for b in some[n + 1 :]:
            p, q = found[a][1], found[b][1]
            # Both over, or both under, is passed as the higher (lower) of the two.
            one_way = (p.floor is None and q.floor is None) or (p.ceiling is None and q.ceiling is None)
            if found[a][0] == found[b][0] or one_way:
                continue
            u, v = p.bounds, q.bounds
            apart = 2.0 * reach
            if u[0] - v[2] < apart and v[0] - u[2] < apart and u[1] - v[3] < apart and v[1] - u[3] < apart:
                out.append((a, b))
    return out


def _half_planes(part: Floats, reach: float, *, inner: bool) -> Floats:
    """A convex polygon grown by ``reach``, round at its corners: a polygon inside that shape, or around it."""
    rows = []
    d = np.roll(part, -1, axis=0) - part
    normal = np.stack([d[:, 1], -d[:, 0]], axis=-1) / np.hypot(*d.T)[:, None]
    for k, (p, n) in enumerate(zip(part, normal, strict=True)):
        rows.append((n @ p + reach, n[0], n[1], 0.0))
        middle = n + normal[k - 1]
        size = float(np.hypot(*middle))
        if reach > 0.0 and size > 1e-9:
            # Across the corner: the chord of its arc from inside, the tangent from outside.
            m = middle / size
            rows.append((m @ p + reach * (0.5 * size if inner else 1.0), m[0], m[1], 0.0))
    return np.array(rows)


def convex_parts(vertices: Floats) -> list[Floats]:
    """Convex polygons, counter-clockwise, that make up a simple polygon."""
    d = np.roll(vertices, -1, axis=0) - vertices
    turn = d[:, 0] * np.roll(d[:, 1], -1) - d[:, 1] * np.roll(d[:, 0], -1)
    if (turn >= 0.0).all() and math.isclose(_turns(d), 1.0, abs_tol=0.1):
        return [vertices]
    import shapely  # most missions have no polygons

    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(vertices)))
    rings = [np.asarray(t.exterior.coords)[:-1] for t in triangles]
    return [r if shapely.LinearRing(r).is_ccw else r[::-1] for r in rings]


def _turns(d: Floats) -> float:
    """How often a closed way with steps ``d`` turns round."""
    e = np.roll(d, -1, axis=0)
    angle = np.arctan2(d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0], (d * e).sum(axis=1))
    return float(angle.sum() / (2.0 * np.pi))


def _cells(bounds: Floats, x: Floats, y: Floats) -> Ints:
    """Columns and rows of the cells whose nodes' box may meet each of ``bounds`` (K, 4); clipped to the lattice."""
    rows, cols = x.shape
    west, east = x.min(axis=0), x.max(axis=0)
    south, north = y.min(axis=1), y.max(axis=1)
    return np.stack([
        np.searchsorted(east[1:], bounds[:, 0]), np.searchsorted(west[:-1], bounds[:, 2], "right") - 1,
        np.searchsorted(north[1:], bounds[:, 1]), np.searchsorted(south[:-1], bounds[:, 3], "right") - 1,
    ], axis=-1).clip(0, [[cols - 2, cols - 2, rows - 2, rows - 2]]).astype(np.int32)  # fmt: skip
