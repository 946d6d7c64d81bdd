"""The plane under a mission as a lattice of nodes, and what of it can be crossed below an altitude cap.

The lattice is the terrain model's own, each cell cut into parts where more is wanted, because ground is bilinear in
those cells and in no others: over a bilinear patch the two ways of cutting it into triangles give one linear surface
that never lies above it and one that never lies below it. So every question has two answers: a mesh that holds
every legal track (``low``: for bounds), and one in which every track is legal but for rounding (for paths).

In the plane the raster's lines are not quite straight. Here they are, between the corners of blocks so short that
nothing moves by more than a few centimetres, for which `SPARE_M` makes up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners._any_angle import search
from gcsplan.planners._fill import fill, raise_cone
from gcsplan.planners._mesh import least_of_cells, make_pieces, make_portals, sort_portals
from gcsplan.planners._stamp import UNDER, UNDER_2, stamp_zones
from gcsplan.planners.ground_nodes import nodes, places, slopes
from gcsplan.planners.problem import Problem
from gcsplan.planners.shapes import SPARE_M, Shapes, make_shapes

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

HAIR_M = 0.07
"""Kept from the ground, upward and sideways, by paths: what the exact check spares, and what the lattice rounds."""
BENT_M = 0.03
"""Most that a raster's line may bow between the corners of a block."""
MOST_OPENED = 3_000_000


class Exhausted(Exception):
    """A search was given up; all ways shorter than ``seen_m`` had been looked at, and none led to the goal."""

    def __init__(self, seen_m: float) -> None:
        super().__init__(f"no way of less than {seen_m:.1f} m, and too much to look at beyond")
        self.seen_m = seen_m


@dataclass(eq=False, slots=True)
class Way:
    """A shortest track over a mesh: ``points`` (N, 2) and its length."""

    points: Floats
    length_m: float


@dataclass(eq=False, slots=True)
class Mesh:
    """Convex free pieces and their portals, see `_mesh`; ``row``, ``col``: the plane's cell that it begins at."""

    plane: Plane
    fineness: int
    row: int
    col: int
    excess: Floats
    floor: Floats
    diagonal: NDArray[np.int8]
    piece: Ints
    start: Ints
    ends: Floats
    names: NDArray[np.int64]
    joins: Ints
    order: Ints

    def lowest(self) -> Floats:
        """(cells,) the lowest floor of each; of cells that are not looked at, anything."""
        f = self.floor
        return np.minimum(np.minimum(f[:-1, :-1], f[:-1, 1:]), np.minimum(f[1:, :-1], f[1:, 1:])).ravel()

    def straight_to(self, place: tuple[float, float]) -> Floats:
        """(cells,) metres that no way from a place to each is shorter than; of meshes as fine as their plane."""
        rows, cols = self.excess.shape
        part = np.s_[self.row : self.row + rows, self.col : self.col + cols]
        x, y = self.plane.x[part] - place[0], self.plane.y[part] - place[1]
        middle = (0.25 * (z[:-1, :-1] + z[:-1, 1:] + z[1:, :-1] + z[1:, 1:]) for z in (x, y))
        across = np.hypot(x[1:, 1:] - x[:-1, :-1], y[1:, 1:] - y[:-1, :-1])
        other = np.hypot(x[1:, :-1] - x[:-1, 1:], y[1:, :-1] - y[:-1, 1:])
        return np.asarray((np.hypot(*middle) - 0.5 * np.maximum(across, other) - BENT_M).ravel())

    def pieces_at(self, place: tuple[float, float]) -> list[int]:
        """The free pieces that a place lies in, or next to where its own is not free."""
        found: list[int] = []
        rows, cols = self.excess.shape
        c, r = self.plane.at(place)
        c, r = self.fineness * (c - self.col), self.fineness * (r - self.row)
        for dj in (0.0, -1e-3, 1e-3):
            for di in (0.0, -1e-3, 1e-3):
                i, j = math.floor(c + di), math.floor(r + dj)
                if not (0 <= i < cols - 1 and 0 <= j < rows - 1):
                    continue
                u, v, k = c - i, r - j, j * (cols - 1) + i
                lower = u >= v if self.diagonal[k] == 0 else u + v <= 1.0
                p = int(self.piece[k, 0 if lower else 1])
                if p >= 0 and p not in found:
                    found.append(p)
        return found

    def way(
        self,
        start: tuple[float, float],
        goal: tuple[float, float],
        limit_m: float = math.inf,
        guide: Guide | None = None,
    ) -> Way | None:
        """The shortest way that is shorter than ``limit_m``. ``guide``: distances to ``goal`` over a mesh that leaves
        no less room."""
        return self._search(start, goal, limit_m, -1.0, guide, np.zeros(0))

    def flood(
        self,
        start: tuple[float, float],
        goal: tuple[float, float],
        limit_m: float,
        slack: float,
        guide: Guide | None = None,
    ) -> tuple[Way | None, Guide]:
        """The same, and how far every piece is from ``start`` at least, as far as ways to ``goal`` lead that are
        shorter than ``limit_m`` and than the shortest with ``slack`` (as a part of it) added."""
        entered = np.full(len(self.start) - 1, np.inf)
        way = self._search(start, goal, limit_m, slack, guide, entered)
        entered[self.pieces_at(start)] = 0.0
        return way, Guide(self, entered)

    def _search(
        self,
        start: tuple[float, float],
        goal: tuple[float, float],
        limit_m: float,
        slack: float,
        guide: Guide | None,
        entered: Floats,
    ) -> Way | None:
        pieces, goal_pieces = self.pieces_at(start), self.pieces_at(goal)
        if not pieces or not goal_pieces:
            return None
        sources = np.array([(*start, 0.0)] * len(pieces))
        remaining = np.zeros(0) if guide is None else guide.over(self)
        room = 1 << 17
        while True:
            names = 8 * (self.excess.size + 1)
            best, origin = np.zeros(names), np.zeros(names, np.int64)  # cost nothing until they are touched
            node, link, name = np.empty((room, 8)), np.empty((room, 6), np.int32), np.empty((room, 3), np.int64)
            portals = len(self.joins)
            first, widest, span = np.zeros(2 * portals, np.int32), np.zeros(portals, np.int32), np.empty((portals, 2))
            out = np.empty((1 << 14, 3))
            n = search(
                self.start, self.ends, self.names, self.joins, self.order, best, origin, first, widest, span,
                sources,
                np.array(pieces, np.int32), np.array(goal, np.float64), np.array(goal_pieces, np.int32), limit_m, slack,
                MOST_OPENED, remaining, entered,
                node, link, name, np.empty(room), np.empty(room, np.int32), out,
            )  # fmt: skip
            if n != -1:
                break
            room *= 4
            entered[:] = np.inf
        if n == -2:
            raise Exhausted(float(out[0, 0]))
        if n <= 0:
            return None
        points = out[:n][::-1, :2].copy()
        keep = np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) > 1e-6])
        keep[-1] = True
        return Way(points[keep], float(out[1, 2]))


@dataclass(eq=False, slots=True)
class Guide:
    """``entered`` (pieces,): no way from where a search began to the entrance of a piece is shorter; inf: none was
    looked for."""

    mesh: Mesh
    entered: Floats

    def over(self, finer: Mesh) -> Floats:
        """The same for the pieces of a mesh on the same lattice, or one that is some times finer."""
        ratio = finer.fineness * self.mesh.plane.stride // (self.mesh.fineness * finer.plane.stride)
        out = np.full(len(finer.start) - 1, np.inf)
        cols, fine_cols = self.mesh.excess.shape[1] - 1, finer.excess.shape[1] - 1
        # A finer lattice's meshes begin at corners of coarse cells.
        share = self.mesh.plane.stride // finer.plane.stride
        row, col = finer.row // share - self.mesh.row, finer.col // share - self.mesh.col
        least_of_cells(self.mesh.piece, self.entered, cols, finer.piece, fine_cols, ratio, row, col, out)
        return out


@dataclass(eq=False, slots=True)
class Plane:
    """A lattice over a part of the terrain model: node (j, i) lies at ``x[j, i]``, ``y[j, i]``, north of (j - 1, i).

    ``tops``, ``grounds`` (rows, cols) AMSL, NaN where unknown: for bounds and for paths; ``steep`` the
    steepest slope of the cells around a node;
    ``inside`` (rows - 1, cols - 1) the cells that are looked at. A cell of the terrain model is ``parts`` cells wide
    and long here, or each cell here ``stride`` of those; ``block`` cells lie on straight lines.
    """

    problem: Problem
    col0: int
    row1: int
    parts: int
    stride: int
    block: int
    x: Floats
    y: Floats
    tops: tuple[Floats, Floats]
    grounds: tuple[Floats, Floats]
    steep: Floats
    inside: NDArray[np.bool_]
    shapes: Shapes

    def mesh(
        self,
        cap_m: float,
        low: bool,
        fineness: int = 1,
        wanted: NDArray[np.bool_] | None = None,
        cones: list[tuple[float, float, float, float]] | None = None,
        under: NDArray[np.bool_] | None = None,
        single: bool = False,
    ) -> Mesh:
        """What can be crossed at or below ``cap_m``: by a bound's way (``low``: all of it) or by a path's.

        ``wanted``: only these cells. ``cones`` (east_m, north_m, height, slope): where paths climb from, or, for a
        bound, how high a path of a length that matters can be near its ends. ``under`` (zones,): which zones may be
        passed below their floors; None for all. ``single``: each free cell is a piece of its own.
        """
        limits, scale = self.problem.limits, self.problem.airspace.scale
        near = limits.track_error_m * scale
        wanted = self.inside if wanted is None else wanted
        row, col, last_row, last_col = _box_of(wanted)
        part, corners = np.s_[row:last_row, col:last_col], np.s_[row : last_row + 1, col : last_col + 1]
        top, ground, steep, x, y = (
            np.ascontiguousarray(a[corners])
            for a in (self.tops[not low], self.grounds[not low], self.steep, self.x, self.y)
        )
        rows, cols = ((n - 1) * fineness + 1 for n in top.shape)
        excess = np.full((rows, cols), np.inf)
        floor, under_m, fine_x, fine_y = (np.empty((rows, cols)) for _ in range(4))
        cells = (rows - 1) * (cols - 1)
        diagonal = np.zeros(cells, np.int8)
        climbs = np.array([] if low or cones is None else cones).reshape(-1, 4)
        more = limits.min_agl_m + limits.altitude_error_m
        beside = near + HAIR_M
        if limits.horizontal_clearance_m > limits.min_agl_m:
            # Beside cliffs it is the clearance that binds; this is more than both demand together.
            beside += limits.horizontal_clearance_m * scale
        fill(
            top, ground, steep[:0] if low else steep, x, y, np.ascontiguousarray(wanted[part]), fineness,
            more + (-SPARE_M if low else HAIR_M), beside, cap_m, climbs, low, excess, floor, under_m, fine_x, fine_y,
            diagonal,
        )  # fmt: skip
        x, y = fine_x, fine_y
        of, values = np.zeros(cells, np.int32), np.zeros((1, 4))
        if len(self.shapes.boxes):
            zones, edges = self.shapes.low if low else self.shapes.high
            if under is not None:
                zones = zones.copy()
                zones[:, UNDER] *= under[self.shapes.owner[:, 0]]
                zones[:, UNDER_2] *= under[self.shapes.owner[:, 1]]
            values = np.empty((1 + self.shapes.cells * fineness**2, 4))
            boxes = (self.shapes.boxes - np.array([col, col, row, row])) * fineness
            boxes = boxes + np.array([0, fineness - 1, 0, fineness - 1])
            boxes = boxes.clip([0, -1, 0, -1], [cols, cols - 2, rows, rows - 2]).astype(np.int32)
            stamp_zones(excess, floor, under_m, x, y, zones, edges, boxes, low, of, values)
        if low and cones:
            cell_m = self.stride * float(self.problem.airspace.surface.grid.metres_per_cell(*cones[0][:2]).max())
            lone = _apart(cones, cap_m, 8.0 * cell_m)
            for east, north, height, slope in cones:
                c, r = self.at((east, north))
                raise_cone(
                    excess, floor, of, x, y, east, north, (c - col) * fineness, (r - row) * fineness, height, slope,
                    cap_m, lone, np.zeros((rows, cols), np.int8), np.full((rows, cols), np.inf),
                )  # fmt: skip
        piece = np.empty((cells, 2), np.int32)
        block = 1 if single else self.block * fineness
        count = make_pieces(excess, of, values, diagonal, piece, block)
        room = 2 * count + 1024
        scratch = np.empty(2)
        while True:
            ends, names, joins = np.empty((room, 4)), np.empty((room, 2), np.int64), np.empty((room, 2), np.int32)
            n = make_portals(excess, of, values, diagonal, piece, x, y, block, ends, names, joins, scratch)
            if n <= room:
                break
            room = n
        start, order = np.zeros(count + 1, np.int32), np.empty(2 * n, np.int32)
        sort_portals(joins[:n], start, order)
        return Mesh(
            self, fineness, row, col, excess, floor, diagonal, piece, start, ends[:n], names[:n], joins[:n], order
        )

    def at(self, place: tuple[float, float]) -> tuple[float, float]:
        """Column and row of a place on this lattice."""
        c, r = self.problem.airspace.surface.grid(*place)
        scale = self.parts / self.stride
        return scale * (float(c) - self.col0), scale * (self.row1 - float(r))


def make_plane(
    problem: Problem,
    box: tuple[float, float, float, float],
    parts: int = 1,
    stride: int = 1,
    whole: int = 1,
    inside: Callable[[Floats, Floats], NDArray[np.bool_]] | None = None,
) -> Plane:
    """The lattice over ``box`` (west, south, east, north) as far as the terrain model goes.

    ``parts``: into how many cells a side the terrain model's are cut; or ``stride``: how many become one, of lattices
    that are ``whole`` cells of the terrain model wide and long, times some number. ``inside(x, y)`` tells which nodes
    are to be looked at.
    """
    surface = problem.airspace.surface
    grid = surface.grid
    rows, cols = surface.ground_m.shape
    west, south, east, north = box
    if math.isinf(west):
        col0, row0, col1, row1 = 0, 0, cols - 1, rows - 1
    else:
        e, n = np.meshgrid(np.linspace(west, east, 5), np.linspace(south, north, 5))
        at = grid(e.ravel(), n.ravel())
        low, high = at.min(axis=0).clip(-2.0, [cols, rows]), at.max(axis=0).clip(-2.0, [cols, rows])
        col0, row0 = (min(max(math.floor(v) - 1, 0), m - 2) for v, m in zip(low, (cols, rows), strict=True))
        col1, row1 = (min(math.ceil(v) + 1, m - 1) for v, m in zip(high, (cols, rows), strict=True))
        col1, row1 = max(col1, col0 + 1), max(row1, row0 + 1)
    part = np.s_[row0 : row1 + 1, col0 : col1 + 1]
    grounds = nodes(surface.ground_m[part][::-1], parts, stride, whole)
    tops = grounds
    if surface.top_m is not surface.ground_m:
        tops = nodes(surface.top_m[part][::-1], parts, stride, whole)
    shape = tops[0].shape
    block = max(problem.airspace.straight_cells(BENT_M) * parts // stride, 1)
    x, y = places(grid, col0, row1, shape, parts / stride, block)
    cells = shape[0] - 1, shape[1] - 1
    looked_at = np.ones(cells, np.bool_)
    if inside is not None:
        node = inside(x, y)
        looked_at = node[:-1, :-1] & node[:-1, 1:] & node[1:, :-1] & node[1:, 1:]
    return Plane(
        problem,
        col0,
        row1,
        parts,
        stride,
        block,
        x,
        y,
        tops,
        grounds,
        slopes(tops[1], x, y),
        looked_at,
        make_shapes(problem, x, y),
    )


def _apart(cones: list[tuple[float, float, float, float]], cap_m: float, more_m: float) -> bool:
    """Whether cones about different places do not come nearer than ``more_m`` to each other below a cap."""
    wide = [max(cap_m - height, 0.0) / slope for *_, height, slope in cones]
    return all(
        a[:2] == b[:2] or math.dist(a[:2], b[:2]) > reach_a + reach_b + more_m
        for (a, reach_a), (b, reach_b) in combinations(zip(cones, wide, strict=True), 2)
    )


def _box_of(wanted: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """First row and column, and those after the last, of what is true; the first cell where nothing is."""
    rows, cols = np.flatnonzero(wanted.any(axis=1)), np.flatnonzero(wanted.any(axis=0))
    if not len(rows):
        return 0, 0, 1, 1
    return int(rows[0]), int(cols[0]), int(rows[-1]) + 1, int(cols[-1]) + 1
