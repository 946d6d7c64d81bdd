"""The outside of keep-in areas as zones, so that whatever knows zones keeps a flight inside.

The set is the union of prisms, each an area of the plane from a floor to a ceiling. Its complement is cut into simple
polygons with a floor and a ceiling: what no area covers, at all heights; and for each interval between two levels that
follow each other, what no area covers that reaches over the interval. Polygons overlap where they meet, beside each
other and above each other, because touching a zone is legal: not even a line is left between two of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.world.geometry.outlines import fewer_corners
from gcsplan.world.geometry.zones import KeepIn, Level, Outside, Polygon, Zone

if TYPE_CHECKING:
    import shapely

OVERLAP_M = 1.0
"""Metres by which polygons of one outside overlap where it is cut; less where an area is smaller."""

RIM_M = 10.0
"""Metres by which the polygons above and below areas reach beyond them, into what is shut at all heights."""

SEAM_M = 1e-3
"""Metres by which areas whose levels count from the ground give way to those whose levels are above mean sea level."""

GRID_M = 1e-6
"""Corners of areas are rounded to this, so that edges which two areas share leave nothing between them."""

MOST_PIECES = 400
"""Most polygons of one outside; more areas apart from each other are refused."""

MOST_CORNERS, NARROWER_M = 20_000, 0.5
"""Most corners of one polygon; with more, the areas are drawn narrower by at most so many metres."""


@dataclass(frozen=True, slots=True, eq=False)
class _Prism:
    """One area with its shape; ``low`` and ``high`` are its levels in metres, -inf and inf without one."""

    shape: shapely.Geometry
    floor: Level | None
    ceiling: Level | None

    @property
    def datums(self) -> set[str]:
        return {level.datum for level in (self.floor, self.ceiling) if level is not None}

    def covers(self, low_m: float, high_m: float) -> bool:
        """Whether it reaches over an interval of heights, both in the datum of its own levels."""
        floor = -math.inf if self.floor is None else self.floor.value_m
        ceiling = math.inf if self.ceiling is None else self.ceiling.value_m
        return floor <= low_m and ceiling >= high_m


def outside_of(areas: Sequence[KeepIn], far_m: float, *, slit_m: float = 0.0) -> tuple[Zone, ...]:
    """The zones that hold all places outside the union of ``areas``, as far as ``far_m`` from the origin; none without
    areas.

    Slits between areas that are narrower than twice ``slit_m`` count as inside. Raises InputError if the areas have too
    many parts or corners.
    """
    if not areas:
        return ()
    import shapely

    prisms = [_Prism(_union([p.shape() for p in area.parts], 0.0), area.floor, area.ceiling) for area in areas]
    whole = _union([p.shape for p in prisms], slit_m)
    world = shapely.box(-far_m, -far_m, far_m, far_m)
    zones = list(_zones(areas, shapely.difference(world, whole), None, None))
    if whole.is_empty:
        return tuple(zones)
    beside = shapely.box(*(np.array(whole.bounds) + np.repeat([-RIM_M, RIM_M], 2)))
    taken = shapely.Polygon()
    groups = _groups(prisms)
    for group in groups:
        own = shapely.difference(_union([p.shape for p in group], slit_m), taken)
        taken = shapely.union(taken, own)
        for floor, ceiling, active in _intervals(group):
            free = _union([p.shape for p in active], slit_m)
            inside = _polygons(shapely.difference(own, free))
            if not inside:
                continue
            # Beyond its own part a group may shut nothing else than what is shut at all heights, but for a seam.
            wider = shapely.buffer(shapely.multipolygons(inside), SEAM_M, join_style="mitre")
            zones += _zones(areas, shapely.difference(beside if len(groups) == 1 else wider, free), floor, ceiling)
    return tuple(zones)


def _polygons(shape: shapely.Geometry) -> list[Any]:
    """The polygons of a shape; polygons as thin as rounding are left out."""
    import shapely

    return [p for p in shapely.get_parts(shape) if p.geom_type == "Polygon" and p.area > GRID_M * p.length]


def _union(shapes: Sequence[shapely.Geometry], slit_m: float) -> shapely.Geometry:
    """The union of some shapes, with slits between them closed."""
    import shapely

    whole = shapely.union_all(shapes, grid_size=GRID_M)
    if slit_m <= 0.0 or len(shapes) < 2:
        return whole
    wider = shapely.buffer(whole, slit_m)  # with round corners: nothing is added farther than this from the areas
    closed = shapely.buffer(wider, -slit_m, join_style="mitre", mitre_limit=2.0)
    # Parts as thin as the noise of both buffers are no slits. A hair more around a slit joins it to the areas.
    parts = shapely.get_parts(shapely.difference(closed, whole))
    slits = [p for p in parts if not shapely.buffer(p, -4.0 * GRID_M).is_empty]
    joined = [shapely.intersection(shapely.buffer(p, SEAM_M), closed) for p in slits]
    return shapely.union_all([whole, *joined], grid_size=GRID_M) if joined else whole


def _groups(prisms: Sequence[_Prism]) -> list[list[_Prism]]:
    """The prisms whose levels can be put in order: by datum, and each with two datums alone.

    Those without a level belong to every group of one datum.
    """
    plain = [p for p in prisms if not p.datums]
    groups = []
    for datum in ("amsl", "agl"):
        own = [p for p in prisms if p.datums == {datum}]
        if own:
            groups.append([*plain, *own])
    groups += [[p] for p in prisms if len(p.datums) > 1]
    return groups


def _intervals(group: Sequence[_Prism]) -> Iterator[tuple[Level | None, Level | None, list[_Prism]]]:
    """Floor and ceiling of each interval of heights, and the prisms that reach over any height of it.

    Between two levels that follow each other these are the prisms there. An interval over both of two neighbours holds
    what is shut in both of them: at the level between them, too.
    """
    floors = [p.floor for p in group if p.floor is not None]
    ceilings = [p.ceiling for p in group if p.ceiling is not None]
    if len({level.datum for level in (*floors, *ceilings)}) > 1:  # one prism: nothing is shut between its two levels
        yield None, floors[0], []
        yield ceilings[0], None, []
        return
    levels = sorted({level.value_m: level for level in (*floors, *ceilings)}.values(), key=lambda level: level.value_m)
    ends: list[Level | None] = [None, *levels, None]
    heights = [-math.inf, *(level.value_m for level in levels), math.inf]
    single = [[p for p in group if p.covers(a, b)] for a, b in pairwise(heights)]
    both = [[p for p in group if p in below or p in above] for below, above in pairwise(single)]
    for k, active in enumerate(single):
        if active not in both[max(k - 1, 0) : k + 1]:
            yield ends[k], ends[k + 1], active
    for k, active in enumerate(both):
        yield ends[k], ends[k + 2], active


def _zones(areas: Sequence[KeepIn], shut: Any, floor: Level | None, ceiling: Level | None) -> Iterator[Zone]:
    """The zones of one part of the outside, a shape from ``floor`` to ``ceiling``."""
    parts = _polygons(shut)
    rings = [np.asarray(r.coords) for p in parts for r in (p.exterior, *p.interiors)]
    edges = np.concatenate([np.stack([r[:-1], r[1:]], axis=1) for r in rings]) if rings else np.zeros((0, 2, 2))
    outside = Outside(tuple(areas), edges)
    for ring in _simple(parts):
        yield Zone(outside.name, Polygon(_few(ring, areas)), floor, ceiling, outside)


def _simple(parts: Sequence[Any]) -> list[Floats]:
    """Outlines of polygons without holes, counter-clockwise, that overlap and together hold ``parts``."""
    import shapely

    open_: list[Any] = list(parts)
    found: list[Floats] = []
    while open_:
        part = open_.pop()
        if not part.interiors:
            ring = np.asarray(part.exterior.coords)[:-1]
            found.append(ring if part.exterior.is_ccw else ring[::-1])
            if len(found) > MOST_PIECES:
                raise InputError(
                    f"the keep-in areas leave more than {MOST_PIECES} pieces around them; give fewer of them, those "
                    "near the mission"
                )
            continue
        west, south, east, north = part.bounds
        hole = max((shapely.Polygon(r) for r in part.interiors), key=lambda h: float(h.area))
        (x0, y0, x1, y1) = hole.bounds
        is_wide = x1 - x0 >= y1 - y0
        more = min(OVERLAP_M, 0.2 * max(x1 - x0, y1 - y0))
        middle = 0.5 * (x0 + x1) if is_wide else 0.5 * (y0 + y1)
        boxes = (
            ((west, south, middle + more, north), (middle - more, south, east, north))
            if is_wide
            else ((west, south, east, middle + more), (west, middle - more, east, north))
        )
        for box in boxes:
            cut = shapely.intersection(part, shapely.box(*box))
            open_ += _polygons(cut)
    return found


def _few(ring: Floats, areas: Sequence[KeepIn]) -> Floats:
    """An outline with few enough corners that holds the given one."""
    if len(ring) <= MOST_CORNERS:
        return np.ascontiguousarray(ring)
    few = fewer_corners(ring, NARROWER_M, most=MOST_CORNERS)
    if few is None:
        names = Outside(tuple(areas), np.zeros((0, 2, 2))).name
        raise InputError(f"{names} has {len(ring)} corners, more than {MOST_CORNERS}; simplify it, or cut it")
    return np.ascontiguousarray(few)
