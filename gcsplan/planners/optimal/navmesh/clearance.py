"""The clearance grid: by how much each lattice node's floor exceeds a cap, and the mesh of the free cells.

For bounds, the cap may be lowered near the ends of a leg to the height that a path can reach (`ClearanceGrid.hold`).
That shuts nodes, so tracks get longer and leave less length to climb with, and the cap can be lowered once more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices, Int8s, Int32s, Int64s
from gcsplan.planners.optimal.navmesh.clearance_kernels import fill
from gcsplan.planners.optimal.navmesh.climb_cones import hold_down, lift_lids, look_around, walk_around
from gcsplan.planners.optimal.navmesh.grid import Plane, Scratch, box_of
from gcsplan.planners.optimal.navmesh.interval_kernels import stamp_beside
from gcsplan.planners.optimal.navmesh.mesh import Mesh
from gcsplan.planners.optimal.navmesh.mesh_kernels import NEXT, WALL, make_pieces, make_portals, sort_portals
from gcsplan.planners.optimal.navmesh.portals import Exhausted
from gcsplan.planners.optimal.navmesh.zone_kernels import LOOKS, PAIR, PLACES, stamp_zones
from gcsplan.planners.profile.track import divided

Cone = tuple[float, float, float, float]
"""A climb cone, the highest altitudes near an end of a leg: its east_m and north_m, altitude there (m AMSL), slope."""

AROUND = 8
"""Most nodes on each side of the selected cells that are looked at too: more than `climb_cones.NODES_BESIDE`."""
RIM_CELLS = 12.0
"""Depth, in cells, to which a zone is looked at that may be too high to climb over so near an end."""
ALIKE = 12.0
"""A bound's floors make use of the track error only if a cell's diagonal is less than this many times the error."""
BORDER_HAIR_M = 0.1
"""Metres by which less than the demanded distance from a border is shut for bounds, and more for paths."""
LEARN_M, LEARN_SPARE_M, LEARN_HAIR_M = 2.0, 0.03, 0.05
"""Longest step, m, at which `learn` checks a track; metres that must be free there; metres by which nodes are raised
beyond the missing height."""
NODE_BYTES = 150.0
"""Bytes of a node that is looked at, with the cells and pieces beside it."""
MOST_MEET = 8
"""Most pieces of a lattice that meet at one node: two triangles of each of the four cells around it."""
MANY_NAMES = 8
"""If a mesh has more possible names per portal than this, names are renumbered without gaps: searches allocate arrays
with an entry for every name."""


@dataclass(frozen=True, eq=False, slots=True)
class PlaneSpec:
    """The use of a plane's mesh. For bounds (``low``) it holds all that any legal track may cross at or below
    ``cap_m``; for paths, only places that can certainly be crossed legally.

    ``ends``: the cones in which paths climb from the ends of the leg, see `clearance_kernels.fill`; ``under``, ``over``
    (zones,): which zones may be passed below their floors, above their ceilings; None for all. ``exact_m``: if not
    None, the nodes have the floors of the exact check, without a margin for the ground between them, and these metres
    are kept from levels of zones that follow the ground.
    """

    cap_m: float
    low: bool
    ends: tuple[Cone, ...] = ()
    under: Bools | None = None
    over: Bools | None = None
    exact_m: float | None = None


class ClearanceGrid:
    """The *excess* (floor minus cap, m) at the nodes of a plane's ``chosen`` cells (None: all), cut ``fineness`` times
    finer, and the walls of the zones.

    ``whole``: the mesh is kept and can be read at all its nodes; other grids are valid only until the plane's next one.
    Raises Exhausted if the nodes take more memory than the budget leaves.
    """

    def __init__(
        self, plane: Plane, spec: PlaneSpec, fineness: int = 1, chosen: Bools | None = None, *, whole: bool = False
    ) -> None:
        cap_m, low, exact_m = spec.cap_m, spec.low, spec.exact_m
        problem = plane.problem
        limits, scale = problem.bound_limits if low else problem.limits, problem.airspace.scale
        whole = whole or chosen is None
        chosen = plane.inside if chosen is None else chosen
        self.plane, self.fineness, self.cap_m, self.low = plane, fineness, cap_m, low
        self.row, self.col, last_row, last_col = box_of(chosen)
        inner = np.s_[self.row : last_row, self.col : last_col]
        nodes = np.s_[self.row : last_row + 1, self.col : last_col + 1]
        top, ground, x, y = (
            np.ascontiguousarray(a[nodes]) for a in (plane.tops[not low], plane.grounds[not low], plane.x, plane.y)
        )
        steep = np.empty((0, 0)) if low else plane.steep(self.row, self.col, last_row + 1, last_col + 1)
        rows, cols = self.shape = (top.shape[0] - 1) * fineness + 1, (top.shape[1] - 1) * fineness + 1
        self._array = Scratch().array if whole else plane.scratch.array
        self._excess, self._floor, self._ground, self._x, self._y = (self._array(f"{k}", self.shape) for k in range(5))
        self._span = _spans(chosen[inner], fineness)
        self._around = np.tile(np.array([0, cols], np.int32), (rows, 1)) if whole else columns_around(self._span, cols)
        self._diagonal = np.zeros((rows - 1) * (cols - 1), np.int8)
        looked_at = float((self._around[:, 1] - self._around[:, 0]).clip(0).sum())
        plane.problem.budget.spend("node", looked_at)
        if looked_at * NODE_BYTES > 1e6 * plane.problem.budget.megabytes:
            raise Exhausted(0.0)
        more = limits.min_agl_m + limits.altitude_error_m
        if low:
            more -= plane.fit.spare_m
            # In much larger cells the slope varies too much for a useful lower bound within the track error.
            cell_m = math.dist((x[0, 0], y[0, 0]), (x[1, 1], y[1, 1])) / fineness
            beside = limits.track_error_m if limits.track_error_m * ALIKE > cell_m else 0.0
        else:
            more += plane.fit.hair_m
            beside = limits.track_error_m * scale + plane.fit.hair_m
            if limits.horizontal_clearance_m > limits.min_agl_m:
                # Beside cliffs the horizontal clearance is the binding limit; the sum is more than both demand.
                beside += limits.horizontal_clearance_m * scale
        fill(
            top, ground, steep, x, y, np.ascontiguousarray(chosen[inner]), fineness, more, beside, cap_m,
            np.array(spec.ends).reshape(-1, 4), low, self._around, self._excess, self._floor, self._ground, self._x,
            self._y, self._diagonal,
        )  # fmt: skip
        if exact_m is not None:
            self._be_exact()
        self._zones, self._edges = plane.zones(low, spec.under, spec.over)
        self._boxes = plane.boxes(self.row, self.col, fineness, rows, cols)
        self._coarse, self._steep, self._exact_m = (ground, x, y), steep, exact_m
        self._lids = np.empty((0, 0))
        if low and limits.max_agl_m is not None:
            over_m = limits.max_agl_m - limits.altitude_error_m + plane.fit.spare_m
            self._lids = highest_of_cells(plane.grounds[1][nodes]) + over_m
        self._up, self._down = (self._array(name, self.shape) for name in ("up", "down"))
        self._of = self._array("of", (self._diagonal.size,), np.int32)
        self._of_zones = (plane.shapes.cells + low * plane.shapes.looking) * fineness**2
        self._walls: list[tuple[Indices, Floats]] = []
        self._values: Floats
        self._laid: bool
        self.add_walls(*self._border_walls())
        self._own: tuple[Int32s, Int64s, Int64s] | None = None
        self._held: list[Cone] = []
        self._lift: Floats
        self._either: Int8s

    def add_walls(self, *more: tuple[Indices, Floats]) -> None:
        """Give cells (K,) walls of their own, of the excess (K, 4) at their corners, see `mesh_kernels.make_pieces`."""
        self._walls += more
        self._values = np.empty((1 + self._of_zones + sum(len(cells) for cells, _ in self._walls), WALL))
        self._laid = False

    def _border_walls(self) -> Iterator[tuple[Indices, Floats]]:
        """For each border of the terrain, the cells (K,) nearer to it than ground must be known, and the excess (K, 4)
        of walls at their corners that stand as far in: no legal track crosses them.

        For bounds, a border beyond which there is more terrain has none.
        """
        plane, problem = self.plane, self.plane.problem
        limits = problem.bound_limits if self.low else problem.limits
        surface = problem.airspace.surface
        rows, cols = surface.ground_m.shape
        corners = [(plane.x[j, i], plane.y[j, i]) for j in (0, -1) for i in (0, -1)]
        cell_m = np.array([surface.grid.metres_per_cell(*at) for at in corners])
        hair_m = plane.fit.bent_m + BORDER_HAIR_M
        if self.low:
            reach_m = limits.horizontal_clearance_m + limits.track_error_m - hair_m
            east_m, north_m = 1.01 * cell_m.max(axis=0)
        else:
            reach_m = problem.airspace.beside_m(limits) + hair_m
            east_m, north_m = 0.99 * cell_m.min(axis=0)
        step = plane.stride / (plane.parts * self.fineness)  # all that follows is in cells of the terrain model
        col = plane.col0 + step * (self.col * self.fineness + np.arange(self.shape[1]))
        row = plane.row1 - step * (self.row * self.fineness + np.arange(self.shape[0]))
        away_m = east_m * col, north_m * row, east_m * (cols - 1 - col), north_m * (rows - 1 - row)
        first, last = self._span.T
        for side, more in enumerate(surface.goes_on):
            wall = reach_m - away_m[side]
            near = np.maximum(wall[:-1], wall[1:]) > 0.0
            if (self.low and more) or not near.any():
                continue
            if side % 2 == 0:
                k = np.flatnonzero(near)
                j, i = np.nonzero((first[:, None] <= k) & (k < last[:, None]))
                i = k[i]
                at = np.stack([i, i + 1, i + 1, i], axis=-1)
            else:
                k, i = np.flatnonzero(near), np.arange(self.shape[1] - 1)
                j, i = np.nonzero((first[k, None] <= i) & (i < last[k, None]))
                j = k[j]
                at = np.stack([j, j, j + 1, j + 1], axis=-1)
            yield j * (self.shape[1] - 1) + i, wall[at]

    def _be_exact(self) -> None:
        """Give the nodes that are looked at the floors of the exact check."""
        cols = np.arange(self.shape[1])
        seen = (cols >= self._around[:, :1]) & (cols < self._around[:, 1:])
        seen[seen] = np.isfinite(self._excess[seen])
        more = self._too_high(self._x[seen], self._y[seen]) - (self._floor[seen] - self.cap_m)
        self._floor[seen] += more
        self._excess[seen] += more

    def _too_high(self, east_m: Floats, north_m: Floats) -> Floats:
        """(N,) metres by which the exact check's floors at places exceed the cap."""
        floor = self.plane.problem.floors(east_m, north_m)
        return np.asarray(floor) - self.cap_m

    def learn(self, track: Floats) -> bool:
        """Raise the nodes of the cells in which the exact check shuts a track (N, 2), or leaves less than
        `LEARN_SPARE_M`; return whether there are any."""
        places = sampled(track, LEARN_M)
        over = self._too_high(*places.T)
        shut = np.isfinite(over) & (over > -LEARN_SPARE_M)
        self.lift(places[shut], over[shut])
        return bool(shut.any())

    def lift(self, places: Floats, by_m: Floats) -> None:
        """Raise the four nodes of each cell that holds one of ``places`` (N, 2) by ``by_m`` (N,) + `LEARN_HAIR_M`."""
        cells = np.floor((self.plane.all_at(places) - [self.col, self.row]) * self.fineness).astype(np.intp)
        more: dict[tuple[int, int], float] = {}  # only the few nodes to raise: an array would touch memory for all
        for (i, j), by in zip(cells.tolist(), by_m.tolist(), strict=True):
            for node in product((j, j + 1), (i, i + 1)):
                if 0 <= node[0] < self.shape[0] and 0 <= node[1] < self.shape[1]:
                    more[node] = max(more.get(node, 0.0), by + LEARN_HAIR_M)
        for node, by in more.items():
            self._floor[node] += by
            self._excess[node] += by
        self._laid = False

    def hold(self, cones: list[Cone]) -> None:
        """Limit the altitude near the ends of a leg to ``cones``, for a bound: no path of a length that matters is
        higher there. Distances for later cones take account of the walls that earlier ones raised."""
        if not cones:
            return
        cell_m = self.plane.stride * float(
            self.plane.problem.airspace.surface.grid.metres_per_cell(*cones[0][:2]).max()
        )
        if not self._held:
            self._lift, self._either = self._array("lift", self.shape), np.zeros(self.shape, np.int8)
            lift_lids(
                self._around, self._floor, self._ground, self._x, self._y, self._zones, self._edges, self._boxes,
                self.cap_m, RIM_CELLS * cell_m / (self.plane.parts * self.fineness), self._lift, self._either,
            )  # fmt: skip
        if not self._laid:
            self._lay()
        self._held += cones
        lone = _apart(self._held, self.cap_m, 8.0 * cell_m)
        excess, lift, x, y = self._excess, self._lift, self._x, self._y
        spend = self.plane.problem.budget.spend
        for east, north, height, slope in cones:
            c, r = self.plane.at((east, north))
            c, r = (c - self.col) * self.fineness, (r - self.row) * self.fineness
            if not 0 <= r < self.shape[0] or not self._around[int(r), 0] <= c < self._around[int(r), 1]:
                continue
            cone = np.array([east, north, c, r, height, slope, self.cap_m])
            seen, away = np.zeros(self.shape, np.int8), self._array("away", self.shape)
            missing = look_around(
                self._around, excess, self._floor, lift, self._of, self._values, x, y, cone, seen, away
            )
            spend("sighted", float(np.count_nonzero(seen)))
            if missing:
                way, root = self._array("way", self.shape), self._array("root", self.shape, np.int32)
                done = np.zeros(self.shape, np.int8)
                heap, ids = self._array("heap", (8 * way.size,)), self._array("ids", (8 * way.size,), np.int32)
                walk_around(
                    self._around, excess, lift, self._of, x, y, cone, seen, away, missing, way, root, done, heap, ids
                )
                spend("walked", float(np.count_nonzero(done)))
            hold_down(
                self._around, excess, self._floor, lift, self._either, self._of, self._values, x, y, cone, lone, seen,
                away,
            )  # fmt: skip
        # Altitudes that a path cannot reach so soon do not lead over a zone either: lay the zones anew.
        self._laid = False

    def obstructs(self, cones: list[Cone], track: Floats) -> bool:
        """`hold` the altitude to ``cones``; return whether that shuts anything in the cells that a track (N, 2)
        crosses."""
        cell_m = self.plane.stride * float(self.plane.problem.airspace.surface.grid.metres_per_cell(*track[0]).min())
        places = sampled(track, 0.5 * cell_m / (self.plane.parts * self.fineness))
        at = (self.plane.all_at(places) - [self.col, self.row]) * self.fineness
        i, j = np.floor(at).astype(np.intp).clip(0, [self.shape[1] - 2, self.shape[0] - 2]).T
        corners = np.stack([j, j, j + 1, j + 1]), np.stack([i, i + 1, i, i + 1])
        before = self._excess[corners]
        self.hold(cones)
        return bool(np.any(self._excess[corners] > np.maximum(before, 0.0)))

    def mesh(self, *, single: bool = False, alone: Bools | None = None) -> Mesh:
        """Make the mesh of the free cells. ``single``: each free cell is a piece of its own; ``alone`` (rows - 1,
        cols - 1): some of them."""
        if not self._laid:
            self._lay()
        rows, cols = self.shape
        excess, of, values, diagonal, span = self._excess, self._of, self._values, self._diagonal, self._span
        piece = self._array("piece", (diagonal.size, 2), np.int32)
        block = 1 if single else self.plane.block * self.fineness
        apart = np.empty(0, np.bool_) if alone is None else alone.ravel()
        count = make_pieces(excess, of, values, diagonal, self._around, span, piece, block, apart)
        capacity, part = 2 * count + 1024, np.empty(2)
        while True:
            ends, names, joins = (
                np.empty((capacity, 4)),
                np.empty((capacity, 2), np.int64),
                np.empty((capacity, 2), np.int32),
            )
            n = make_portals(excess, of, values, diagonal, span, piece, self._x, self._y, ends, names, joins, part)
            if n <= capacity:
                break
            capacity = n
        start, order = np.zeros(count + 1, np.int32), np.empty(2 * n, np.int32)
        sort_portals(joins[:n], start, order)
        names, named = names[:n], 8 * (rows * cols + 1)
        if named > MANY_NAMES * n:
            corner = names >= 0
            used, names[corner] = np.unique(names[corner], return_inverse=True)
            named = len(used)
        return Mesh(
            start, ends[:n], names, joins[:n], order, named, MOST_MEET, self.plane, self.fineness, self.row, self.col,
            excess, self._floor, diagonal, span, piece,
        )  # fmt: skip

    def _lay(self) -> None:
        """Give the cells the walls of the zones."""
        reach_m, near_m = self.plane.reach_m(self.low)
        spend, read = self.plane.problem.budget.spend, np.zeros(1, np.int64)
        count = stamp_zones(
            self._around, self._span, self._excess, self._floor, self._ground, *self._coarse, self._steep,
            self._lids, self.fineness, reach_m, -1.0 if self._exact_m is None else self._exact_m, reach_m * PLACES,
            read, self._up, self._down, self._x, self._y, self._zones, self._edges, self._boxes, self.low, self._of,
            self._values,
        )  # fmt: skip
        spend("read", float(read[0]))
        if self.low and self.plane.stride == 1:
            if self._own is None:
                self._own = self._no_own_ground()
            own_read = self._own[2]
            before = int(own_read[0])
            count = stamp_beside(
                self._span, self._excess, self._floor, *self._coarse, self.fineness, self._zones, self._edges,
                self._boxes, reach_m, near_m, np.empty((8, 4)), *self._own, self._of, self._values, count,
            )  # fmt: skip
            spend("read", float(own_read[0] - before))
        for cells, walls in self._walls:
            own = self._values[count : count + len(cells)]
            own[:, :NEXT], own[:, NEXT] = walls, self._of[cells]
            self._of[cells] = np.arange(count + 1, count + 1 + len(cells))
            count += len(cells)
        self._laid = True

    def _no_own_ground(self) -> tuple[Int32s, Int64s, Int64s]:
        """Where `stamp_beside` keeps the zones' own ground, all unknown yet: see `zone_kernels.own_ground`."""
        looks = (self._zones[:, LOOKS] > 0.0) & (self._zones[:, PAIR] == 0.0)
        wide, high = ((self._boxes[:, k + 1] - self._boxes[:, k] + 1).clip(0).astype(np.int64) for k in (0, 2))
        end = np.cumsum(np.where(looks, wide * high, 0))
        own = self._array("own", (int(end[-1]) if len(end) else 0, 4), np.int32)
        own[:] = -2
        return own, np.append(0, end[:-1]), np.zeros(1, np.int64)


def highest_of_cells(heights: Floats) -> Floats:
    """(rows - 1, cols - 1) the highest of ``heights`` (rows, cols) at each cell's corners; inf if one is unknown."""
    known = np.where(np.isnan(heights), np.inf, heights)
    rows = np.maximum(known[1:], known[:-1])
    return np.maximum(rows[:, 1:], rows[:, :-1])


def mesh_of(
    plane: Plane, cap_m: float, low: bool, fineness: int = 1, chosen: Bools | None = None, single: bool = False
) -> Mesh:
    """Make the mesh of the plane at or below ``cap_m``: for bounds (``low``), all that any legal track may cross; for
    paths, only places that can be crossed legally.

    ``chosen``: only these cells. ``single``: each free cell is a piece of its own. Raises Exhausted.
    """
    return ClearanceGrid(plane, PlaneSpec(cap_m, low), fineness, chosen, whole=single).mesh(single=single)


def sampled(track: Floats, step_m: float) -> Floats:
    """(K, 2) the middles of equal parts of each leg of a track (N, 2), none longer than ``step_m``."""
    leg, part, parts = divided(track, step_m)
    t = ((part + 0.5) / parts)[:, None]
    return np.asarray(track[leg] + t * (track[leg + 1] - track[leg]))


def _apart(cones: list[Cone], cap_m: float, more_m: float) -> bool:
    """Whether cones around different places stay more than ``more_m`` apart below a cap."""
    wide = [max(cap_m - height, 0.0) / slope for *_, height, slope in cones]
    return all(
        a[:2] == b[:2] or math.dist(a[:2], b[:2]) > reach_a + reach_b + more_m
        for (a, reach_a), (b, reach_b) in combinations(zip(cones, wide, strict=True), 2)
    )


def _spans(chosen: Bools, fineness: int) -> Int32s:
    """(rows, 2) for each row of cells, cut ``fineness`` times finer: the first ``chosen`` column, and the column after
    the last one."""
    first, last = chosen.argmax(axis=1), chosen.shape[1] - chosen[:, ::-1].argmax(axis=1)
    spans = np.stack([first, np.where(chosen.any(axis=1), last, first)], axis=-1) * fineness
    return np.ascontiguousarray(np.repeat(spans, fineness, axis=0), np.int32)


def columns_around(span: Int32s, cols: int) -> Int32s:
    """(rows + 1, 2) for each row of nodes: the first column no farther than `AROUND` nodes from cells of the ``span``,
    and that after the last."""
    first, last = np.full(len(span) + 1, cols), np.zeros(len(span) + 1, np.int64)
    some = span[:, 1] > span[:, 0]
    left, right = np.where(some, span[:, 0] - AROUND, cols), np.where(some, span[:, 1] + AROUND + 1, 0)
    for k in range(-AROUND, AROUND + 2):
        low = max(k, 0)
        high = max(min(len(span) + k, len(first)), low)
        np.minimum(first[low:high], left[low - k : high - k], out=first[low:high])
        np.maximum(last[low:high], right[low - k : high - k], out=last[low:high])
    return np.ascontiguousarray(np.stack([first.clip(0, cols), last.clip(0, cols)], axis=-1), np.int32)
