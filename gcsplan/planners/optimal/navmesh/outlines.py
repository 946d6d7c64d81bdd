"""Zones as outlines in the plane: the exact shortest track around zones that can be passed neither over nor under.

A zone is grown by the distance to keep from it, with round corners. A polygon inside that shape gives a bound, and one
around it gives a path; their arcs are drawn more finely where a track touches them. The free plane between the
polygons is cut into triangles, and Polyanya finds the shortest track over them (`polyanya`).

Zones are added one by one: the shortest track past the zones known so far is a bound for all of them, and as soon as
it meets no other zone it is the answer. So the work depends on the zones that matter, however many there are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal.navmesh.mesh_kernels import sort_portals
from gcsplan.planners.optimal.navmesh.portals import Exhausted, GroundPlace, GroundTrack, Portals
from gcsplan.world.geometry.outlines import few_corners
from gcsplan.world.zone_table import ZoneTable

COARSE = 4
"""Chords per quarter circle of every arc, at first."""
OFF_M, OFF_OUTER_M, OFF_OUTER = 5e-3, 0.1, 6e-4
"""Metres that chords may be off their arc where a track comes near: `OFF_M` for bounds; for paths, of which each chord
is a leg, `OFF_OUTER_M` or the share `OFF_OUTER` of the radius, whichever is more."""
NEAR = 1.03
"""Arcs are drawn finely where a track comes nearer than this times the distance to keep: there, coarse arcs may block
what fine ones leave free, or leave a slit that fine ones shut; chords of `COARSE` are off by 2 % of the radius."""
MOST_SEARCHES_OF_TRACK = 300
"""Times that a track is searched for, each time with more zones or finer arcs, at most."""
MOST_OUTLINE_CORNERS = 12_000
"""Corners of all outlines of one mesh, at most: with more, the triangulation takes seconds."""
MOST_GROWN = 1000
"""Corners of one polygon that is grown, at most: its edges are grown one by one, a thousand in half a second."""
CORNERS_APART_M = 1e-5
"""Metres that corners of a mesh are apart at least: where outlines meet, rounding may make two of one, and a track that
turns there would be missed. Outlines keep a hair that is much more."""
BEYOND_M = 1.0
"""Metres that the mesh reaches beyond the outlines and the places."""
MOST_SEARCH_NODES = 1_000_000
"""Search nodes that Polyanya may open over one mesh."""


@dataclass(eq=False, slots=True)
class ZoneOutline:
    """A zone of a table, by its number, grown by ``reach_m``: its polygon for paths (``outer``) or for bounds.

    ``sectors``: the finely drawn sectors of a circle, each as wide as a coarse chord; ``fine``: whether the corners
    of a polygon are drawn finely.
    """

    table: ZoneTable
    zone: int
    reach_m: float
    outer: bool
    hair_m: float
    sectors: set[int] = field(default_factory=set)
    fine: bool = False
    _shape: shapely.Geometry | None = None

    @property
    def shape(self) -> shapely.Geometry:
        """The polygon; several, or an empty one, if a zone made smaller by ``hair_m`` falls into parts or vanishes."""
        if self._shape is None:
            corners = self.table.corners_m(self.zone)
            self._shape = self._grown(corners) if len(corners) else self._disc()
        return self._shape

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east, north of a box that contains the shape, however finely it is drawn."""
        west, south, east, north = self.table.box_m[self.zone].tolist()
        more = (self.reach_m + self.hair_m) * NEAR + (NEAR - 1.0) * max(east - west, north - south)
        return west - more, south - more, east + more, north + more

    def refine(self, track: Floats) -> bool:
        """Draw the arcs finely where a track (N, 2) comes so near that it matters; return whether anything changes."""
        *middle, radius = self.table.discs_m[self.zone].tolist()
        if radius < 0.0:
            if self.fine or self.reach_m <= self.hair_m:
                return False
            line = shapely.LineString(track)
            self.fine = bool(shapely.dwithin(self.table.polygon(self.zone), line, NEAR * self.reach_m))
            new = {0} if self.fine else set()
        else:
            radius += self.reach_m
            a, d = track[:-1], np.diff(track, axis=0)
            t = ((middle - a) * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-12)
            off = np.vstack([a + t.clip(0.0, 1.0)[:, None] * d, track]) - middle
            off = off[np.hypot(*off.T) < NEAR * radius]
            angles = np.arctan2(off[:, 1], off[:, 0]) % (2.0 * math.pi)
            # A track that turns at a corner between two sectors may turn in either once they are drawn finely.
            at = {math.floor((x + more) / WIDTH) % (4 * COARSE) for x in angles.tolist() for more in (-1e-3, 1e-3)}
            new = at - self.sectors
            self.sectors |= new
        if new:
            self._shape = None
        return bool(new)

    def _disc(self) -> shapely.Polygon:
        *middle, radius = self.table.discs_m[self.zone].tolist()
        radius = max(radius + self.reach_m + (self.hair_m if self.outer else -self.hair_m), 0.0)
        corners = _around(self._angles(radius, self.sectors), radius, outer=self.outer)
        return shapely.Polygon(np.array(middle) + corners)

    def _angles(self, radius: float, sectors: Iterable[int]) -> Floats:
        """Angles (rad, rising) at which the chords of a circle begin; chords in ``sectors`` are drawn finely."""
        off_m = max(OFF_OUTER_M, OFF_OUTER * radius) if self.outer else OFF_M
        step = math.sqrt(8.0 * off_m / max(radius, 1e-3))
        parts = max(math.ceil(WIDTH / step), 2)
        more = [s * WIDTH + np.arange(1, parts) * (WIDTH / parts) for s in sectors]
        return np.sort(np.concatenate([np.arange(4 * COARSE) * WIDTH, *more]))

    def _grown(self, vertices: Floats) -> shapely.Geometry:
        """The polygon grown edge by edge, with round corners: `shapely.buffer` would smooth the result."""
        bare = shapely.Polygon(vertices)
        reach = self.reach_m + (self.hair_m if self.outer else -self.hair_m)
        if reach <= 0.0:
            return bare.buffer(reach, join_style="mitre")
        angle = self._angles(reach, range(4 * COARSE) if self.fine else ())
        few = few_corners(vertices, MOST_GROWN, outward=self.outer)
        if few is None:
            raise Exhausted(0.0)
        vertices, bare = few, shapely.Polygon(few)
        following = np.roll(vertices, -1, axis=0)
        turn = np.arctan2(*(following - vertices).T[::-1])
        # An edge with half a circle around each of its ends is convex: the hull of the two circles' corners.
        parts = [
            np.vstack([p + corners, q + corners])
            for p, q, first in zip(vertices, following, turn.tolist(), strict=True)
            for corners in (_around(np.sort((angle + first) % (2.0 * math.pi)), reach, outer=self.outer),)
        ]
        return shapely.union_all([bare, *shapely.convex_hull(shapely.multipoints(np.array(parts)))])


WIDTH = 0.5 * math.pi / COARSE
"""Radians of a coarse chord."""


def _around(angle: Floats, radius: float, *, outer: bool) -> Floats:
    """(N, 2) corners of a circle's polygon with chords from angle to angle: inside it, or (``outer``) around it."""
    if not outer:
        return radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    # Corners lie where neighbouring tangents meet: the shorter the chords, the nearer to the circle.
    half = 0.5 * np.diff(np.append(angle, angle[0] + 2.0 * math.pi))
    return radius * np.stack([np.cos(angle + half), np.sin(angle + half)], axis=-1) / np.cos(half)[:, None]


class Triangles(Portals):
    """The part of the free plane between polygons that holds two places, cut into triangles; it reaches as far as the
    shortest track between them can go."""

    __slots__ = ("corner",)

    def __init__(self, part: shapely.Polygon) -> None:
        """Raises Exhausted if the triangles' area is not the part's: then nothing is known."""
        corner = shapely.get_coordinates(shapely.get_parts(shapely.constrained_delaunay_triangles(part)))
        corner = corner.reshape(-1, 4, 2)[:, :3]
        u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        twice = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        corner[twice < 0.0] = corner[twice < 0.0, ::-1]
        if not math.isclose(0.5 * float(np.abs(twice).sum()), part.area, rel_tol=1e-9, abs_tol=1e-6):
            raise Exhausted(0.0)
        self.corner = corner
        _, name = np.unique(corner.reshape(-1, 2).view(np.complex128).ravel(), return_inverse=True)
        name = name.reshape(-1, 3)
        named = int(name.max()) + 1
        first, second = name.ravel(), np.roll(name, -1, axis=1).ravel()
        key, back = first * named + second, second * named + first
        order = np.argsort(key)
        at = np.searchsorted(key[order], back).clip(0, len(key) - 1)
        other = order[at]
        here = np.flatnonzero((key[other] == back) & (first < second))
        other = other[here]
        ends = np.concatenate([corner.reshape(-1, 2)[here], corner.reshape(-1, 2)[other]], axis=1)
        names = np.ascontiguousarray(np.stack([first[here], second[here]], axis=-1), np.int64)
        joins = np.ascontiguousarray(np.stack([here // 3, other // 3], axis=-1), np.int32)
        start, of_piece = np.zeros(len(corner) + 1, np.int32), np.empty(2 * len(here), np.int32)
        sort_portals(joins, start, of_piece)
        super().__init__(
            start, np.ascontiguousarray(ends), names, joins, of_piece, named, int(np.bincount(first).max())
        )

    def pieces_at(self, place: GroundPlace) -> list[int]:
        """The triangles in which, or on whose border, a place lies."""
        d = np.array(place) - self.corner
        e = np.roll(self.corner, -1, axis=1) - self.corner
        left = (e[..., 0] * d[..., 1] - e[..., 1] * d[..., 0]) / np.maximum(np.hypot(e[..., 0], e[..., 1]), 1e-12)
        return np.flatnonzero((left >= -1e-6).all(axis=1)).tolist()


def shortest_past(a: GroundPlace, b: GroundPlace, shapes: Sequence[shapely.Polygon]) -> GroundTrack | None:
    """The shortest track around some polygons; None if they separate the places. Raises Exhausted."""
    places = np.array([a, b])
    bounds = np.array([*(s.bounds for s in shapes), (*places.min(axis=0), *places.max(axis=0))])
    box = shapely.box(*(bounds[:, :2].min(axis=0) - BEYOND_M), *(bounds[:, 2:].max(axis=0) + BEYOND_M))
    free = shapely.set_precision(box.difference(shapely.union_all(shapes)), CORNERS_APART_M) if shapes else box
    if shapely.get_num_coordinates(free) > MOST_OUTLINE_CORNERS:
        raise Exhausted(0.0)
    parts = [p for p in shapely.get_parts(free) if shapely.dwithin(p, shapely.points(places), 1e-6).all()]
    if not parts:
        return None
    mesh = Triangles(parts[0])
    return mesh.shortest(a, b, mesh.pieces_at(a), mesh.pieces_at(b), MOST_SEARCH_NODES)[0]


class Solids:
    """Zones that no track may enter, and the shortest tracks around them; zones that one track met are known to the
    next search.

    ``outer``: for paths, which keep ``hair_m`` (zones,) more from each zone; else for bounds, which keep that much
    less. Raises Exhausted if the meshes, or the work, would be too large.
    """

    def __init__(
        self,
        table: ZoneTable,
        reach_m: float,
        hair_m: Floats,
        budget: Budget,
        *,
        outer: bool,
    ) -> None:
        self.outlines = [ZoneOutline(table, k, reach_m, outer, hair) for k, hair in enumerate(hair_m.tolist())]
        self._budget = budget
        self._tree = shapely.STRtree(shapely.box(*np.array([o.bounds for o in self.outlines]).reshape(-1, 4).T))
        self._known: set[int] = set()

    def look_along(self, track: Floats, which: Bools) -> None:
        """Add the zones, out of ``which`` (zones,), that a track (N, 2) comes near, and draw their outlines finely
        there, before the first search."""
        line = shapely.LineString(track)
        for k in self._tree.query(line).tolist():
            if which[k] and self.outlines[k].refine(track):
                self._known.add(k)

    def shortest(self, a: GroundPlace, b: GroundPlace, which: Bools) -> GroundTrack | None:
        """The shortest track from ``a`` to ``b`` around the zones ``which`` (zones,); None if they separate the two."""
        for _ in range(MOST_SEARCHES_OF_TRACK):
            known = [k for k in sorted(self._known) if which[k]]
            track = self._past(a, b, known)
            if track is None:
                return None
            line = shapely.LineString(track.points)
            near = [k for k in self._tree.query(line).tolist() if which[k]]
            # Coarse arcs lie inside or outside the true ones: draw the arcs near the track finely first.
            finer = [k for k in near if self.outlines[k].refine(track.points) and k in self._known]
            unknown = (k for k in near if k not in self._known)
            met = {k for k in unknown if shapely.relate_pattern(self.outlines[k].shape, line, "T********")}
            self._known |= met
            if not met and not finer:
                return track
            if not self._budget.goes_on():
                break
        raise Exhausted(0.0)

    def _past(self, a: GroundPlace, b: GroundPlace, known: list[int]) -> GroundTrack | None:
        if not known:
            return GroundTrack(np.array([a, b]), math.dist(a, b))
        shapes = [s for k in known if not (s := self.outlines[k].shape).is_empty]
        self._budget.spend("corner", sum(shapely.get_num_coordinates(s) for s in shapes))
        return shortest_past(a, b, shapes)
