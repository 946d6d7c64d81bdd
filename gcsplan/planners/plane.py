"""The plane under a mission as a lattice of nodes, and what of it can be crossed below an altitude cap.

The lattice is the terrain model's own, each cell cut into parts where more is wanted, because ground is bilinear in
those cells and in no others: over a bilinear patch the two ways of cutting it into triangles give one linear surface
that never lies above it and one that never lies below it. So every question has two answers: a mesh that holds
every legal track (``low``: for bounds), and one in which every track is legal but for rounding (for paths).

In the plane the raster's lines are not quite straight. Here they are, between the corners of blocks so short that
nothing moves by more than a few centimetres, or millimetres, for which a `Fit` makes up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners._cones import hold_down, look_around, walk_around
from gcsplan.planners._fill import fill
from gcsplan.planners._mesh import WALL, make_pieces, make_portals, sort_portals
from gcsplan.planners._stamp import PAIR, TOP, TOP_2, UNDER, UNDER_2, lift_lids, narrow_rooms, own_zones, stamp_zones
from gcsplan.planners.ground_nodes import nodes, places, slopes
from gcsplan.planners.mesh import Mesh
from gcsplan.planners.problem import Problem
from gcsplan.planners.scratch import Scratch
from gcsplan.planners.shapes import LOOSE, Fit, Shapes, make_shapes

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

AROUND = 8
"""How many nodes beside those of cells that are wanted are looked at, at most: more than `_cones.BESIDE`."""
RIM = 12.0
"""How many cells deep zones are looked at that cannot be climbed over so near to an end."""
MANY = 8
"""Names a portal from which on a mesh's are numbered one by one, for searches have room for every name."""


@dataclass(eq=False, slots=True)
class Plane:
    """A lattice over a part of the terrain model: node (j, i) lies at ``x[j, i]``, ``y[j, i]``, north of (j - 1, i).

    ``tops``, ``grounds`` (rows, cols) AMSL, NaN where unknown: for bounds and for paths;
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
    inside: NDArray[np.bool_]
    shapes: Shapes
    fit: Fit
    known: dict[tuple[float, float], tuple[float, float]] = field(default_factory=dict)
    """Places that were asked for, and where they lie on the lattice."""
    scratch: Scratch = field(default_factory=Scratch)
    """Room for meshes that are no longer needed when the next one is made."""

    def mesh(
        self,
        cap_m: float,
        low: bool,
        fineness: int = 1,
        wanted: NDArray[np.bool_] | None = None,
        cones: list[tuple[float, float, float, float]] | None = None,
        under: NDArray[np.bool_] | None = None,
        over: NDArray[np.bool_] | None = None,
        single: bool = False,
        sheets: bool = False,
    ) -> Mesh:
        """What can be crossed at or below ``cap_m``: by a bound's way (``low``: all of it) or by a path's.

        ``wanted``: only these cells. ``cones`` (east_m, north_m, height, slope): where paths climb from, or, for a
        bound, how high a path of a length that matters can be near its ends. ``under``, ``over`` (zones,): which
        zones may be passed below their floors, above their ceilings; None for all. ``single``: each free
        cell is a piece of its own. ``sheets``: zones that are passed over here and under there lie on two.
        """
        limits, scale = self.problem.limits, self.problem.airspace.scale
        near = limits.track_error_m * scale
        whole = wanted is None or single  # such meshes are asked for places all over them
        wanted = self.inside if wanted is None else wanted
        row, col, last_row, last_col = _box_of(wanted)
        part, corners = np.s_[row:last_row, col:last_col], np.s_[row : last_row + 1, col : last_col + 1]
        top, ground, x, y = (
            np.ascontiguousarray(a[corners]) for a in (self.tops[not low], self.grounds[not low], self.x, self.y)
        )
        steep = np.empty((0, 0)) if low else self._steep(row, col, last_row + 1, last_col + 1)
        rows, cols = ((n - 1) * fineness + 1 for n in top.shape)
        array = Scratch().array if whole else self.scratch.array
        excess, floor, under_m, fine_x, fine_y = (array(f"{k}", (rows, cols)) for k in range(5))
        cells = (rows - 1) * (cols - 1)
        span = _spans(wanted[part], fineness)
        places = [self.at((east, north)) for east, north, _, _ in cones or []]
        own = [((r - row) * fineness, (c - col) * fineness) for c, r in places]
        around = np.tile(np.array([0, cols], np.int32), (rows, 1)) if whole else _around(span, own, cols)
        diagonal = np.zeros(cells, np.int8)
        climbs = np.array([] if low or cones is None else cones).reshape(-1, 4)
        more = limits.min_agl_m + limits.altitude_error_m
        beside = near + self.fit.hair_m
        if limits.horizontal_clearance_m > limits.min_agl_m:
            # Beside cliffs it is the clearance that binds; this is more than both demand together.
            beside += limits.horizontal_clearance_m * scale
        more += -self.fit.spare_m if low else self.fit.hair_m
        fill(
            top, ground, steep, x, y, np.ascontiguousarray(wanted[part]), fineness, more, beside, cap_m, climbs, low,
            around, excess, floor, under_m, fine_x, fine_y, diagonal,
        )  # fmt: skip
        x, y = fine_x, fine_y
        of, values, owner = array("of", (cells, 1), np.int32), np.zeros((1, WALL)), np.zeros(0, np.int32)
        zones, edges = self._zones(low, under, over)
        boxes = self._boxes(row, col, fineness, rows, cols)
        if len(boxes):
            values = np.empty((1 + self.shapes.cells * fineness**2, WALL))
        laid = excess, floor, under_m, x, y, zones, edges, boxes
        if low and cones:
            stamp_zones(around, span, *laid, low, owner, 0, of, values, 0)
            lift, either = array("lift", (rows, cols)), np.zeros((rows, cols), np.int8)
            cell_m = self.stride * float(self.problem.airspace.surface.grid.metres_per_cell(*cones[0][:2]).max())
            rim_m = RIM * cell_m / (self.parts * fineness)
            lift_lids(around, floor, under_m, x, y, zones, edges, boxes, cap_m, rim_m, lift, either)
            lone = _apart(cones, cap_m, 8.0 * cell_m)
            for east, north, height, slope in cones:
                c, r = self.at((east, north))
                cone = np.array([east, north, (c - col) * fineness, (r - row) * fineness, height, slope, cap_m])
                seen, away = np.zeros((rows, cols), np.int8), array("away", (rows, cols))
                missing = look_around(around, excess, floor, lift, of, values, x, y, cone, seen, away)
                if missing:
                    way, root = array("way", (rows, cols)), array("root", (rows, cols), np.int32)
                    done = np.zeros((rows, cols), np.int8)
                    heap, ids = array("heap", (8 * way.size,)), array("ids", (8 * way.size,), np.int32)
                    walk_around(around, excess, lift, of, x, y, cone, seen, away, missing, way, root, done, heap, ids)
                hold_down(around, excess, floor, lift, either, of, values, x, y, cone, lone, seen, away)
            # What cannot be reached so soon is no way over a zone either: they are laid anew.
        steepest = max(limits.max_climb_slope, limits.max_descent_slope)
        if sheets and self.shapes.either and math.isfinite(steepest):
            owner = np.zeros(cells, np.int32)
            if own_zones(span, *laid, steepest, owner):
                of, values = array("of", (cells, 2), np.int32), np.empty((2 * len(values), WALL))
            else:
                owner = owner[:0]
        walls = stamp_zones(around, span, *laid, low, owner, 0, of, values, 0)
        if len(owner):
            stamp_zones(around, span, *laid, low, owner, 1, of, values, walls)
        piece = array("piece", (cells, 2 * of.shape[1]), np.int32)
        block = 1 if single else self.block * fineness
        count = make_pieces(excess, of, values, diagonal, owner, around, span, piece, block)
        room = 2 * count + 1024
        scratch = np.empty(2)
        while True:
            ends, names, joins = np.empty((room, 4)), np.empty((room, 2), np.int64), np.empty((room, 2), np.int32)
            n = make_portals(excess, of, values, diagonal, owner, span, piece, x, y, ends, names, joins, scratch)
            if n <= room:
                break
            room = n
        start, order = np.zeros(count + 1, np.int32), np.empty(2 * n, np.int32)
        sort_portals(joins[:n], start, order)
        names, named = names[:n], 8 * (excess.size + 1) * of.shape[1]
        if named > MANY * n:
            corner = names >= 0
            used, names[corner] = np.unique(names[corner], return_inverse=True)
            named = len(used)
        return Mesh(
            self, fineness, row, col, excess, floor, diagonal, span, piece, start, ends[:n], names, joins[:n], order,
            named,
        )  # fmt: skip

    def rooms(self, mesh: Mesh, top_m: float) -> tuple[Floats, Floats]:
        """(cells,) the lowest and the highest altitude, ``top_m`` at most, that can be flown at in each cell of a mesh
        for bounds that is as fine as its plane; the wrong way round where there is none."""
        rows, cols = mesh.excess.shape
        low = mesh.lowest().reshape(rows - 1, cols - 1)
        high = np.full(low.shape, top_m)
        x, y = mesh.places()
        ground = np.ascontiguousarray(self.grounds[0][mesh.row : mesh.row + rows, mesh.col : mesh.col + cols])
        boxes = self._boxes(mesh.row, mesh.col, 1, rows, cols)
        narrow_rooms(ground, x, y, *self.shapes.low, boxes, self.stride == 1, low, high)
        return low.ravel(), high.ravel()

    def _zones(
        self, low: bool, under: NDArray[np.bool_] | None, over: NDArray[np.bool_] | None
    ) -> tuple[Floats, Floats]:
        """The shapes' numbers and forms; zones that may not be passed ``under``, or ``over``, changed."""
        zones, edges = self.shapes.low if low else self.shapes.high
        first, other = self.shapes.owner.T
        if under is not None or over is not None:
            zones = zones.copy()
        if under is not None:
            zones[:, UNDER] *= under[first]
            zones[:, UNDER_2] *= under[other]
        if over is not None:
            zones[~over[first], TOP] = np.inf
            zones[~over[other] & (zones[:, PAIR] > 0.0), TOP_2] = np.inf
        return zones, edges

    def _boxes(self, row: int, col: int, fineness: int, rows: int, cols: int) -> Ints:
        """The shapes' boxes on a part of the lattice, cut finer, of so many nodes."""
        boxes = (self.shapes.boxes - np.array([col, col, row, row])) * fineness
        boxes = boxes + np.array([0, fineness - 1, 0, fineness - 1])
        return np.asarray(boxes.clip([0, -1, 0, -1], [cols, cols - 2, rows, rows - 2]), np.int32)

    def _steep(self, row: int, col: int, last_row: int, last_col: int) -> Floats:
        """The steepest slope of the cells around each node of a part of the lattice."""
        less_row, less_col = min(row, 1), min(col, 1)
        part = np.s_[row - less_row : last_row + 1, col - less_col : last_col + 1]
        around = slopes(self.tops[1][part], self.x[part], self.y[part])
        return np.ascontiguousarray(around[less_row:, less_col:][: last_row - row, : last_col - col])

    def at(self, place: tuple[float, float]) -> tuple[float, float]:
        """Column and row of a place on this lattice."""
        if place not in self.known:
            c, r = self.problem.airspace.surface.grid(*place)
            scale = self.parts / self.stride
            self.known[place] = scale * (float(c) - self.col0), scale * (self.row1 - float(r))
        return self.known[place]


def make_plane(
    problem: Problem,
    box: tuple[float, float, float, float],
    parts: int = 1,
    stride: int = 1,
    whole: int = 1,
    reach: tuple[tuple[float, float], tuple[float, float], float] | None = None,
    fit: Fit = LOOSE,
) -> Plane:
    """The lattice over ``box`` (west, south, east, north) as far as the terrain model goes.

    ``parts``: into how many cells a side the terrain model's are cut; or ``stride``: how many become one, of lattices
    that are ``whole`` cells of the terrain model wide and long, times some number. ``reach``: only what is no farther
    from two places together is looked at.
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
    block = max(problem.airspace.straight_cells(fit.bent_m) * parts // stride, 1)
    x, y, looked_at = places(grid, col0, row1, shape, parts / stride, block, reach)
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
        looked_at,
        make_shapes(problem, x, y, fit),
        fit,
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


def _spans(wanted: NDArray[np.bool_], fineness: int) -> Ints:
    """(rows, 2) of cells cut so many times finer: of each row the first that is wanted, and that after the last."""
    first, last = wanted.argmax(axis=1), wanted.shape[1] - wanted[:, ::-1].argmax(axis=1)
    spans = np.stack([first, np.where(wanted.any(axis=1), last, first)], axis=-1) * fineness
    return np.ascontiguousarray(np.repeat(spans, fineness, axis=0), np.int32)


def _around(span: Ints, places: list[tuple[float, float]], cols: int) -> Ints:
    """(rows + 1, 2) of nodes: of each row the first that is no farther than `AROUND` from cells of the ``span``, or
    from ``places`` (row, column), and that after the last."""
    first, last = np.full(len(span) + 1, cols), np.zeros(len(span) + 1, np.int64)

    def widen(low: int, high: int, left: Ints | int, right: Ints | int) -> None:
        np.minimum(first[low:high], left, out=first[low:high])
        np.maximum(last[low:high], right, out=last[low:high])

    some = span[:, 1] > span[:, 0]
    left, right = np.where(some, span[:, 0] - AROUND, cols), np.where(some, span[:, 1] + AROUND + 1, 0)
    for k in range(-AROUND, AROUND + 2):
        low, high = max(k, 0), min(len(span) + k, len(first))
        widen(low, high, left[low - k : high - k], right[low - k : high - k])
    for r, c in places:
        low, high = (min(max(math.floor(r) + k, 0), len(first)) for k in (-AROUND, AROUND + 1))
        widen(low, high, math.floor(c) - AROUND, math.floor(c) + AROUND + 1)
    return np.ascontiguousarray(np.stack([first.clip(0, cols), last.clip(0, cols)], axis=-1), np.int32)
