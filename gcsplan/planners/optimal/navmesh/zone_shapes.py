"""Zones as the lattice takes them: discs and convex polygons, slightly smaller for bounds and larger for paths."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices, Int32s
from gcsplan.planners.optimal.navmesh.zone_kernels import (
    BESIDE,
    BOTTOM,
    BOTTOM_2,
    EAST,
    FIRST,
    LAST,
    LOOKS,
    NORTH,
    NUMBERS,
    ONE,
    OTHER,
    OWN_BOTTOM,
    OWN_TOP,
    PAIR,
    RADIUS,
    RISE,
    THIN,
    TOP,
    TOP_2_AGL,
    TOP_AGL,
    UNDER,
    UNDER_2,
)
from gcsplan.planners.problem import Problem
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.zone_table import ZoneTable


@dataclass(frozen=True, slots=True)
class Fit:
    """Margins in metres: how far a lattice's nodes may lie beside the terrain model's (``bent_m``); and, to make up for
    that and for rounding, by how much floors are lower and zones smaller for bounds (``spare_m``), higher and larger
    for paths (``hair_m``)."""

    bent_m: float
    spare_m: float
    hair_m: float


TOUCH_M = 1e-6
"""Metres of overlap in height that are allowed where only the arithmetic is inexact."""

LOOSE, CLOSE = Fit(0.03, 0.05, 0.07), Fit(0.003, 0.01, 0.07)
"""`LOOSE` lets long rows of cells be one piece; `CLOSE` is for where slits a few centimetres wide count."""


OVERLAP = 0.2
"""Part of the spare by which parts of one zone overlap at least, in a zone that is made smaller."""

NOTHING = np.array([[-1.0, 0.0, 0.0, 0.0]])
"""The form of a part that holds no place."""


@dataclass(frozen=True, eq=False, slots=True)
class _Part:
    """A convex part of a zone, ``sides``: for bounds and for paths (None: none), of which it need not be the same one;
    a disc has none. ``inset_m``: that for bounds is of a zone that is already so much smaller."""

    sides: tuple[Floats | None, Floats | None] = (None, None)
    inset_m: float = 0.0


@dataclass(frozen=True, eq=False, slots=True)
class Shapes:
    """Convex parts of zones, and crossings of two parts: numbers (K, NUMBERS) and forms (E, 4), ``low`` for bounds and
    ``high`` for paths.

    A form is a half-plane a - b x - c y > 0, or a disc (radius, x, y, 1). ``boxes`` (K, 4): first and last column,
    first and last row of the cells that each part may touch; ``owner`` (K, 2): indices of its zones (twice the same,
    or both of a crossing); ``cells``: number of cells in all boxes; ``looking``: in the boxes of zones that `LOOKS`.
    """

    low: tuple[Floats, Floats]
    high: tuple[Floats, Floats]
    boxes: Int32s
    owner: Indices
    cells: int
    looking: int


def make_shapes(problem: Problem, x: Floats, y: Floats, fit: Fit = LOOSE) -> Shapes:
    """Make the shapes of the zones that reach into a lattice of nodes ``x``, ``y`` (rows, cols).

    A level over ground (AGL) counts from the ground in the zone itself, also where it limits flight beside the zone,
    within reach. There, the ground below gives the level with an error of as much as the ground rises within reach. So
    such a zone is laid down twice: as it is, and grown by the reach with its levels moved by that rise. For bounds, the
    rise is the most anywhere at the zone; for paths, the rise around each node (`BESIDE`), as far as it is known.
    """
    air = problem.airspace
    reach = air.beside_m(problem.limits)  # no less than what bounds assume
    there = reach <= min(math.dist((x[0, 0], y[0, 0]), place) for place in ((x[0, 1], y[0, 1]), (x[1, 0], y[1, 0])))
    box = float(x.min()), float(y.min()), float(x.max()), float(y.max())
    table = air.zone_table
    found: list[tuple[int, _Part]] = []
    moved: list[float] = []
    """Metres by which each part's levels over ground are moved; 0: they are not, and a part with such is not grown."""

    def growth(zone: int, more: float, sign: float, off_m: float, limits: Limits) -> float:
        return (0.0 if more == 0.0 and table.follow_ground[zone] else air.beside_m(limits)) + sign * off_m

    sides = (-1.0, fit.spare_m, problem.bound_limits), (1.0, fit.hair_m, problem.limits)
    for zone in table.within(box, reach):
        rise = table.rise_m(zone, box, reach)
        for more in (0.0, rise) if rise > 0.0 else (0.0,):
            parts = _parts(table.corners_m(zone), growth(zone, more, *sides[0]), OVERLAP * fit.spare_m)
            found.extend((zone, part) for part in parts)
            moved.extend(more for _ in parts)
    levels_m = np.transpose(table.levels_m())
    pairs = _crossing(table, [zone for zone, _ in found], reach + max(fit.spare_m, fit.hair_m))
    both: list[tuple[Floats, Floats]] = []
    bounds = np.tile([np.inf, np.inf, -np.inf, -np.inf], (len(found) + len(pairs), 1))
    for side, (sign, off_m, limits) in enumerate(sides):
        rows = np.zeros((len(found) + len(pairs), NUMBERS))
        forms: list[Floats] = []
        for k, (row, (zone, part)) in enumerate(zip(rows, found, strict=False)):
            grow = growth(zone, moved[k], sign, off_m, limits)
            _set_levels(row, levels_m[zone], table.over_ground[zone], moved[k], sign, off_m, limits)
            row[RISE], row[RADIUS] = 0.0 if there else moved[k], -1.0
            east_m, north_m, radius_m = table.discs_m[zone].tolist()
            corners: Floats | None
            if radius_m >= 0.0:
                grow = max(radius_m + grow, 0.0)
                row[[EAST, NORTH, RADIUS]] = east_m, north_m, grow
                forms.append(np.array([[grow, east_m, north_m, 1.0]]))
                corners = np.array([[east_m, north_m]])
            elif (corners := part.sides[side]) is None:
                forms.append(NOTHING)
                continue
            else:
                grow += part.inset_m * (sign < 0.0)
                forms.append(_half_planes(corners, grow, inner=sign < 0.0))
            bounds[k, :2] = np.minimum(bounds[k, :2], corners.min(axis=0) - grow)
            bounds[k, 2:] = np.maximum(bounds[k, 2:], corners.max(axis=0) + grow)
        for k, (a, b) in enumerate(pairs, len(found)):
            _cross(rows, k, a, b)
            forms.append(np.vstack([forms[a], forms[b]]))
        lengths = np.cumsum([0] + [len(f) for f in forms])
        rows[:, FIRST], rows[:, LAST] = lengths[:-1], lengths[1:]
        both.append((rows, np.ascontiguousarray(np.concatenate(forms)) if forms else np.zeros((0, 4))))
    for k, (a, b) in enumerate(pairs, len(found)):
        bounds[k, :2] = np.maximum(bounds[a, :2], bounds[b, :2])
        bounds[k, 2:] = np.minimum(bounds[a, 2:], bounds[b, 2:])
    boxes = _cells(bounds, x, y)
    size = (boxes[:, 1] - boxes[:, 0] + 1).clip(0) * (boxes[:, 3] - boxes[:, 2] + 1).clip(0)
    numbers = [number for number, _ in found]
    owner = np.array([(n, n) for n in numbers] + [(numbers[a], numbers[b]) for a, b in pairs], np.intp).reshape(-1, 2)
    return Shapes(both[0], both[1], boxes, owner, int(size.sum()), int(size[both[0][0][:, LOOKS] > 0.0].sum()))


def _set_levels(
    row: Floats, levels_m: Floats, over_ground: Bools, moved_m: float, sign: float, off_m: float, limits: Limits
) -> None:
    """Fill in the levels of a part, for bounds (``sign`` -1) or for paths (1), off by a margin ``off_m``; ``levels_m``,
    ``over_ground`` (2,): floor and ceiling of its zone."""
    row[LOOKS] = sign < 0.0 and moved_m > 0.0
    row[THIN] = 2.0 * (limits.over_zone_m - off_m) if sign < 0.0 else -np.inf
    for side, at, own, more in ((0, BOTTOM, OWN_BOTTOM, -1.0), (1, TOP, OWN_TOP, 1.0)):
        # For paths, AMSL levels get no margin for rounding: a zone may be exactly as high as the ceiling.
        off = sign * off_m if over_ground[side] or sign < 0.0 else -TOUCH_M
        row[at] = row[own] = levels_m[side] + more * (limits.over_zone_m + off)
        row[at + 2] = over_ground[side]
        if over_ground[side] and moved_m > 0.0 and sign > 0.0:
            row[at + 2] = BESIDE
        elif over_ground[side]:
            row[at] -= more * moved_m
    row[UNDER] = row[BOTTOM] > -np.inf


def _cross(rows: Floats, k: int, a: int, b: int) -> None:
    """Fill row ``k`` for the crossing of two parts: an altitude that is free of ``a`` may lie in ``b``."""
    rows[k] = rows[a]
    rows[k, [RADIUS, PAIR, ONE, OTHER]] = -1.0, 1.0, a, b
    rows[k, [LOOKS, RISE]] = rows[[a, b]][:, [LOOKS, RISE]].max(axis=0)
    rows[k, BOTTOM_2 : TOP_2_AGL + 1] = rows[b, BOTTOM : TOP_AGL + 1]
    rows[k, UNDER_2] = rows[b, UNDER]


def _crossing(table: ZoneTable, owner: list[int], reach: float) -> list[tuple[int, int]]:
    """Pairs of parts that may cross, of two zones each of which, by itself, may be passed above or below; ``owner``:
    the zone of each part."""
    bottoms, tops = (np.isfinite(levels).tolist() for levels in table.levels_m())
    some = [k for k, zone in enumerate(owner) if bottoms[zone] or tops[zone]]
    boxes, apart = table.box_m.tolist(), 2.0 * reach
    out = []
    for n, a in enumerate(some):
        for b in some[n + 1 :]:
            p, q = owner[a], owner[b]
            # Two that can both be passed only above (or only below) are passed as the higher (lower) of them.
            if p == q or not (bottoms[p] or bottoms[q]) or not (tops[p] or tops[q]):
                continue
            u, v = boxes[p], boxes[q]
            if u[0] - v[2] < apart and v[0] - u[2] < apart and u[1] - v[3] < apart and v[1] - u[3] < apart:
                out.append((a, b))
    return out


def _parts(corners: Floats, grow_m: float, overlap_m: float) -> list[_Part]:
    """The convex parts of a zone of these ``corners`` (none: a circle) that is grown by ``grow_m`` for bounds. Parts
    that are made smaller one by one would leave slits between them, so the zone is made smaller first, and its parts
    grown until they overlap."""
    if not len(corners):
        return [_Part()]
    whole = convex_parts(corners)
    if len(whole) == 1 or grow_m >= overlap_m:
        return [_Part((part, part)) for part in whole]
    import shapely

    inset_m = overlap_m - grow_m
    small = shapely.Polygon(corners).buffer(-inset_m, join_style="mitre", mitre_limit=100.0)
    rings = [p.exterior for p in shapely.get_parts(small) if not p.is_empty]
    ccw = [shapely.get_coordinates(ring if ring.is_ccw else ring.reverse())[:-1] for ring in rings]
    low = [part for vertices in ccw for part in convex_parts(vertices)]
    return [_Part(sides, inset_m) for sides in zip_longest(low, whole)]


def _half_planes(part: Floats, reach: float, *, inner: bool) -> Floats:
    """(E, 4) half-planes of a convex polygon grown by ``reach``, with round corners: they form a polygon inside that
    shape (``inner``), or around it."""
    rows = []
    d = np.roll(part, -1, axis=0) - part
    normal = np.stack([d[:, 1], -d[:, 0]], axis=-1) / np.hypot(*d.T)[:, None]
    for k, (p, n) in enumerate(zip(part, normal, strict=True)):
        rows.append((n @ p + reach, n[0], n[1], 0.0))
        middle = n + normal[k - 1]
        size = float(np.hypot(*middle))
        if reach > 0.0 and size > 1e-9:
            # One more edge across the corner: the chord of its arc (inner), or the tangent to it.
            m = middle / size
            rows.append((m @ p + reach * (0.5 * size if inner else 1.0), m[0], m[1], 0.0))
    return np.array(rows)


def convex_parts(vertices: Floats) -> list[Floats]:
    """Split a simple polygon into convex polygons, counter-clockwise."""
    d = np.roll(vertices, -1, axis=0) - vertices
    turn = d[:, 0] * np.roll(d[:, 1], -1) - d[:, 1] * np.roll(d[:, 0], -1)
    if (turn >= 0.0).all() and math.isclose(_turns(d), 1.0, abs_tol=0.1):
        return [vertices]
    import shapely  # imported here: most missions have no polygons

    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shapely.Polygon(vertices)))
    rings = [np.asarray(t.exterior.coords)[:-1] for t in triangles]
    return [r if shapely.LinearRing(r).is_ccw else r[::-1] for r in rings]


def _turns(d: Floats) -> float:
    """Full turns of a closed line with steps ``d`` (N, 2), counter-clockwise."""
    e = np.roll(d, -1, axis=0)
    angle = np.arctan2(d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0], (d * e).sum(axis=1))
    return float(angle.sum() / (2.0 * np.pi))


def _cells(bounds: Floats, x: Floats, y: Floats) -> Int32s:
    """(K, 4) first and last column, first and last row of the cells whose nodes' bounding box may meet each of
    ``bounds`` (K, 4: west, south, east, north); clipped to the lattice."""
    rows, cols = x.shape
    west, east = x.min(axis=0), x.max(axis=0)
    south, north = y.min(axis=1), y.max(axis=1)
    return np.stack([
        np.searchsorted(east[1:], bounds[:, 0]), np.searchsorted(west[:-1], bounds[:, 2], "right") - 1,
        np.searchsorted(north[1:], bounds[:, 1]), np.searchsorted(south[:-1], bounds[:, 3], "right") - 1,
    ], axis=-1).clip(0, [[cols - 2, cols - 2, rows - 2, rows - 2]]).astype(np.int32)  # fmt: skip
