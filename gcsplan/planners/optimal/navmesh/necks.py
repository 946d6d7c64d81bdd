"""Necks: narrow places where a few cells of a mesh for bounds are looked at on a much finer lattice.

A cell may be free on both sides of a ridge that is too narrow for it: tracks cross it, and a whole valley seems open.
Finer cells show the ridge, but are too many for a whole corridor. So only the cells around shut places are looked at.
The free parts of a cell that hang together on the finer lattice become pieces of their own, with portals where the
parts of neighbouring cells meet. Whatever can be flown passes through these pieces in turn, so the mesh is one for
bounds as before. Pieces of one cell overlap in the plane, which does not matter to a track: it is led by portals.

There, the terrain beside a track makes walls for bounds, too: on a pass, the ground at both sides is higher than the
ground below. An aircraft may be as far from its track as the track error. So a place is shut if the terrain is too high
anywhere within that distance; for all places of a small cell, the terrain in one direction is the terrain of the cell
moved there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices
from gcsplan.planners.optimal.navmesh.clearance import ClearanceGrid, PlaneSpec
from gcsplan.planners.optimal.navmesh.clearance_kernels import SPARE
from gcsplan.planners.optimal.navmesh.grid import Plane, lattice
from gcsplan.planners.optimal.navmesh.mesh import Guide, Mesh
from gcsplan.planners.optimal.navmesh.mesh_kernels import sort_portals
from gcsplan.planners.optimal.navmesh.portals import GroundPlace, GroundTrack
from gcsplan.planners.optimal.navmesh.zone_shapes import Fit
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.zone_levels import shut_places
from gcsplan.world.geometry.path import runs_m

DIRECTIONS = 32
"""Directions in which the terrain is read for a cell."""


FINE_M, MOST_PARTS = 1.5, 24
"""Width of the finer cells, m, and most of them along a side of a cell."""
FIT = Fit(2e-4, 1e-3, 0.07)
"""Its lattice is small, and its nodes need not lie on straight lines for long."""
AROUND_M = 30.0
"""Metres around a shut place within which cells are looked at."""
MOST_NODES = 1e6
"""Most nodes in the box of one neck's finer lattice; a neck that needs more is not looked at."""
NEW = np.iinfo(np.int64).min
"""The name of the ends of a new portal until it gets one."""
SAME_END_M = 1e-4
"""Ends of portals that are no farther apart are at one place."""
LOOKS, LOOK_M = 24, 1.0
"""Most times that necks are looked at for one track; and the least step, m, at which it is read where it is shut. The
step is the track error if that is more: even the sharpest ridge shuts twice as much of a track."""
FAN = 24
"""Most pieces of a mesh with necks that a track passes while it turns at one node."""


def walls_beside(clearance: ClearanceGrid) -> Iterator[tuple[Indices, Floats]]:
    """Cells (K,) of a fine lattice for bounds, and the excess (K, 4) of walls at their corners, from the terrain as far
    away as the track error reaches, in several directions; see `ClearanceGrid.add_walls`."""
    from scipy.ndimage import maximum_filter  # most missions have no necks

    plane, limits = clearance.plane, clearance.plane.problem.bound_limits
    reach_m = SPARE * limits.track_error_m - 2.0 * plane.fit.bent_m
    if reach_m <= 0.0:
        return
    rows, cols = clearance.shape
    part = np.s_[clearance.row : clearance.row + rows, clearance.col : clearance.col + cols]
    more = limits.min_agl_m + limits.altitude_error_m - plane.fit.spare_m - clearance.cap_m
    excess, places = plane.tops[0][part] + more, np.stack([plane.x[part], plane.y[part]])
    step = np.stack([places[:, 0, 1] - places[:, 0, 0], places[:, 1, 0] - places[:, 0, 0]], axis=-1)
    angle = np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False)
    off = SPARE * reach_m * np.linalg.solve(step, np.stack([np.cos(angle), np.sin(angle)]))  # columns, and rows
    most = np.ceil(np.abs(off)).astype(np.intp).max(axis=1) + 1
    least = np.minimum(np.minimum(excess[:-1, :-1], excess[:-1, 1:]), np.minimum(excess[1:, :-1], excess[1:, 1:]))
    highest = maximum_filter(np.nan_to_num(excess, nan=-np.inf), size=(2 * most[1] + 1, 2 * most[0] + 1))[:-1, :-1]
    j, i = np.nonzero((least <= 0.0) & (highest > 0.0))
    for a, b in off.T.tolist():
        inside = (j + math.floor(b) >= 0) & (j + math.floor(b) < rows - 2)
        inside &= (i + math.floor(a) >= 0) & (i + math.floor(a) < cols - 2)
        jj, ii = j[inside], i[inside]
        walls = _moved(excess, jj, ii, b, a)
        apart = np.stack([_at(z, jj, ii, b, a) - z[jj, ii] for z in places])  # alike at the other corners
        stands = (walls.max(axis=1) > 0.0) & (np.hypot(*apart) <= reach_m)  # not where ground is unknown
        yield (jj * (cols - 1) + ii)[stands], walls[stands]


def _moved(z: Floats, j: Indices, i: Indices, b: float, a: float) -> Floats:
    """(K, 4) values at the corners of cells (K,) of a lattice, such that they are nowhere above the surface ``z`` moved
    by ``b`` rows and ``a`` columns, whichever diagonal the cells are cut along. ``z`` is bilinear in each cell."""
    v, u = b - math.floor(b), a - math.floor(a)
    rows, cols = ([math.floor(of) + more for more in (t, 1.0, 1.0 + t)] for of, t in ((b, v), (a, u)))
    # The lines of the moved lattice cut the cell into four parts. In each, the difference from a bilinear surface is
    # bilinear too, so it is least at a corner of a part.
    seen = [[_at(z, j, i, row, col) for col in cols] for row in rows]
    low, high = (seen[0][0], seen[0][2]), (seen[2][0], seen[2][2])
    lower = np.zeros(len(j))
    for row, t in zip(seen, (0.0, 1.0 - v, 1.0), strict=True):
        for value, s in zip(row, (0.0, 1.0 - u, 1.0), strict=True):
            west, east = ((1.0 - t) * of + t * on for of, on in zip(low, high, strict=True))
            np.minimum(lower, value - (1.0 - s) * west - s * east, out=lower)
    corners = np.stack([low[0], low[1], high[1], high[0]], axis=-1)
    twist = 0.25 * np.abs(corners[:, 0] + corners[:, 2] - corners[:, 1] - corners[:, 3])
    return np.asarray(corners + (lower - twist)[:, None])


def _at(z: Floats, j: Indices, i: Indices, b: float, a: float) -> Floats:
    """(K,) the bilinear values ``b`` rows and ``a`` columns from nodes (K,) of a lattice."""
    row, col = math.floor(b), math.floor(a)
    v, u = b - row, a - col
    south, north = (
        (1.0 - u) * z[j + row + k, i + col] + u * z[j + row + k, i + col + 1] if u > 0.0 else z[j + row + k, i + col]
        for k in (0, 1 if v > 0.0 else 0)
    )
    return np.asarray((1.0 - v) * south + v * north)


@dataclass(frozen=True, eq=False, slots=True)
class Neck:
    """``cells`` (K, 2): rows and columns, counted from the terrain model's first node. ``openings`` (N, 5): row and
    column of a cell, 0 if the next cell is that in the next column and 1 if that in the next row, and the parts of both
    (-1: that cell is not in the neck). ``range`` (N, 2): where the opening lies on the edge, from 0 to 1."""

    cells: Indices
    openings: Indices
    range: Floats


class LegNecks:
    """The necks of all lattices of one leg from ``start`` to ``goal``, below ``top_m``."""

    def __init__(self, problem: Problem, top_m: float, start: GroundPlace, goal: GroundPlace) -> None:
        self.problem, self.top_m, self.start, self.goal = problem, top_m, start, goal
        self._necks: dict[int, Necks] = {}
        """By the parts a side into which they cut the terrain model's cells."""

    def track(self, clearance: ClearanceGrid, limit_m: float, guide: Guide, closely: bool) -> GroundTrack | None:
        """The shortest track for a bound over a clearance grid with the necks so far; None if none is shorter than
        ``limit_m``. ``closely``: cells through which the exact check shuts it are looked at, and it is searched again.
        Raises Exhausted."""
        plane, parts = clearance.plane, clearance.plane.parts * clearance.fineness
        necks = self._necks.get(parts)
        if closely and necks is None:
            necks = Necks(plane, clearance.fineness, self.top_m, np.array([self.start, self.goal]))
        if plane.stride > 1 or necks is None or clearance.cap_m > self.top_m:
            return clearance.mesh().track(self.start, self.goal, limit_m, guide)
        self._necks[parts] = necks
        bare = self.problem.for_bounds
        step_m = max(LOOK_M, bare.limits.track_error_m)
        for _ in range(LOOKS):
            way = necks.mesh(clearance).track(self.start, self.goal, limit_m, guide)
            if way is None or not closely or not self.problem.budget.goes_on():
                break
            shut = shut_places(bare, way.points, self.top_m, step_m)
            if not len(shut) or not necks.look(plane, shut):
                break
        return way


class Necks:
    """The necks of a ``plane``'s lattice, cut ``fineness`` times finer. Cells at the places ``but_at`` (K, 2)
    are left as they are."""

    def __init__(self, plane: Plane, fineness: int, cap_m: float, but_at: Floats) -> None:
        self.cap_m, self.parts = cap_m, plane.parts * fineness
        self._seen = _grown(self._at(plane, but_at), 1)
        """Cells that are not looked at again."""
        self._necks: list[Neck] = []

    def look(self, plane: Plane, places: Floats) -> bool:
        """Look at the cells around the places (N, 2) of a track, as long as the budget lasts; return whether any was
        not looked at before. Raises Exhausted."""
        apart = np.flatnonzero(runs_m(places) > AROUND_M) + 1
        budget = plane.problem.budget
        looked = [budget.goes_on() and self._look(plane, group) for group in np.split(places, apart)]
        return any(looked)

    def _look(self, plane: Plane, places: Floats) -> bool:
        width_m = float(plane.problem.airspace.surface.grid.metres_per_cell(*places[0]).min()) / self.parts
        found = _grown(self._at(plane, places), max(1, math.ceil(AROUND_M / width_m))) - self._seen
        neck = self._neck(plane, np.array(sorted(found), np.intp), width_m) if found else None
        if neck is None:
            return False
        self._seen |= found
        self._necks.append(neck)
        return True

    def mesh(self, clearance: ClearanceGrid) -> Mesh:
        """The mesh of a clearance grid on this lattice, with the cells of the necks split."""
        cells = [self._local(clearance, neck.cells) for neck in self._necks]
        alone = np.zeros((clearance.shape[0] - 1, clearance.shape[1] - 1), np.bool_)
        for at in cells:
            row, col = at[((at >= 0) & (at < alone.shape)).all(axis=1)].T
            alone[row, col] = True
        mesh = clearance.mesh(alone=_widened(alone))
        alone &= _looked_at(mesh)
        return self._split(clearance, mesh, alone) if alone.any() else mesh

    def _at(self, plane: Plane, places: Floats) -> set[tuple[int, int]]:
        """Rows and columns of the cells at places."""
        at = plane.problem.airspace.surface.grid(places[:, 0], places[:, 1]) * self.parts
        return {(math.floor(-r), math.floor(c)) for c, r in at.tolist()}

    def _local(self, clearance: ClearanceGrid, cells: Indices) -> Indices:
        """The rows and columns of cells in a clearance grid's mesh."""
        plane = clearance.plane
        first = clearance.row - plane.row1 * plane.parts, clearance.col + plane.col0 * plane.parts
        return np.asarray(cells - np.array(first) * clearance.fineness)

    def _neck(self, plane: Plane, cells: Indices, width_m: float) -> Neck | None:
        """Look at cells (K, 2) on a finer lattice; None if that takes too many nodes."""
        problem = plane.problem
        low, high = (cells.min(axis=0) - 1) / self.parts, (cells.max(axis=0) + 2) / self.parts
        rows, cols = problem.airspace.surface.ground_m.shape
        col0, row0 = max(math.floor(low[1]), 0), max(math.floor(-high[0]), 0)
        col1, row1 = min(math.ceil(high[1]), cols - 1), min(math.ceil(-low[0]), rows - 1)
        ratio = min(MOST_PARTS, max(2, round(width_m / FINE_M)))
        nodes = max(col1 - col0, 0) * max(row1 - row0, 0) * (self.parts * ratio) ** 2
        if not 0 < nodes <= MOST_NODES:
            return None
        finer = lattice(problem, (col0, row0, col1, row1), self.parts * ratio, 1, 1, None, FIT)
        first = np.array([-finer.row1, finer.col0]) * self.parts
        size = finer.inside.shape[0] // ratio, finer.inside.shape[1] // ratio
        own, around = np.zeros(size, np.bool_), np.zeros(size, np.bool_)
        for mask, reach in ((own, 0), (around, 1)):
            at = np.array(sorted(_grown(set(map(tuple, cells.tolist())), reach)), np.intp) - first
            row, col = at[((at >= 0) & (at < size)).all(axis=1)].T
            mask[row, col] = True
        finely = np.repeat(np.repeat(around, ratio, axis=0), ratio, axis=1)
        clearance = ClearanceGrid(finer, PlaneSpec(self.cap_m, True), 1, finely, whole=True)
        clearance.add_walls(*walls_beside(clearance))
        mesh = clearance.mesh(single=True)
        return Neck(cells, *_openings(mesh, own, ratio, first))

    def _split(self, clearance: ClearanceGrid, mesh: Mesh, alone: Bools) -> Mesh:
        """Replace the pieces of the cells ``alone`` by the parts that the necks know, and their portals by openings."""
        own, near = (_pieces_of(mesh, cells) for cells in (alone, _widened(alone)))
        cut = own[mesh.joins].any(axis=1)
        if not cut.any():
            return mesh  # no track passes through these cells anyway
        portal, opening, cells = self._portals(clearance, mesh, np.flatnonzero(cut))
        at, aside = opening[:, :2].astype(np.intp), opening[:, 2] == 0.0
        begin, end = _node(mesh, at + np.stack([~aside, aside], axis=-1)), _node(mesh, at + 1)
        along = end - begin
        known = [((mesh.ends[portal, k : k + 2] - begin) * along).sum(axis=1) / (along**2).sum(axis=1) for k in (0, 2)]
        t = np.stack([np.maximum(opening[:, 5], known[0]), np.minimum(opening[:, 6], known[1])])
        new_ends = (begin + t[..., None] * along).transpose(1, 0, 2).reshape(-1, 4)
        # Each part of a cell of the necks is a new piece; other cells keep their pieces.
        new_joins, of = mesh.joins[portal].astype(np.int64), np.where(aside, 0, 1)
        rows = np.arange(len(of))
        parts = opening[:, 3:5].astype(np.int64)
        pairs = np.stack([cells, parts], axis=-1)[parts >= 0]
        unique, number = np.unique(pairs, axis=0, return_inverse=True)
        flat = np.full(parts.shape, -1, np.int64)
        flat[parts >= 0] = number.ravel()
        for k, side in ((0, of), (1, 1 - of)):
            new_joins[rows, side] = np.where(flat[:, k] >= 0, mesh.pieces + flat[:, k], new_joins[rows, side])
        open_ = t[1] >= t[0]
        joins = np.ascontiguousarray(np.vstack([mesh.joins[~cut], new_joins[open_]]), np.int32)
        ends = np.ascontiguousarray(np.vstack([mesh.ends[~cut], new_ends[open_]]))
        names = np.vstack([mesh.names[~cut], np.full((int(open_.sum()), 2), NEW)])
        beside = np.concatenate([near[mesh.joins[~cut]].any(axis=1), np.ones(int(open_.sum()), np.bool_)])
        names[beside] = _names(names[beside], joins[beside], ends[beside], mesh.ends[cut], mesh.named)
        named = int(names.max(initial=mesh.named)) + 1
        start, order = np.zeros(mesh.pieces + len(unique) + 1, np.int32), np.empty(2 * len(joins), np.int32)
        sort_portals(joins, start, order)
        return replace(
            mesh, start=start, ends=ends, names=names, joins=joins, order=order, named=named, fan=FAN,
            parts_of=np.ascontiguousarray(mesh.piece[unique[:, 0]], np.int32),
        )  # fmt: skip

    def _portals(self, clearance: ClearanceGrid, mesh: Mesh, cut: Indices) -> tuple[Indices, Floats, Indices]:
        """The portals (N,) of a mesh, out of the portals ``cut``, in which openings lie; the openings (N, 7) in them,
        with row and column in the mesh, and with the range; and the cells (N, 2) at both sides."""
        openings = _joined(self._necks)
        at = self._local(clearance, openings[:, :2].astype(np.intp))
        openings[:, :2] = at
        aside = openings[:, 2] == 0.0
        next_at = at + np.stack([~aside, aside], axis=-1)
        shape = np.array(mesh.excess.shape) - 1
        within = ((at >= 0) & (next_at < shape)).all(axis=1)
        openings, at, next_at, aside = (a[within] for a in (openings, at, next_at, aside))
        cells = np.stack([at @ [shape[1], 1], next_at @ [shape[1], 1]], axis=-1)
        # The pieces at both sides of the edge: of cells side by side, or one above the other.
        first, second = (mesh.diagonal[cells[:, k]] == k for k in (0, 1))
        one = mesh.piece[cells[:, 0], np.where(aside & first, 0, 1)]
        other = mesh.piece[cells[:, 1], np.where(aside & second, 0, np.where(aside, 1, 0))]
        left, right = np.where(aside, one, other), np.where(aside, other, one)
        keys = mesh.joins[cut, 0].astype(np.int64) * mesh.pieces + mesh.joins[cut, 1]
        order = np.argsort(keys)
        sought = left.astype(np.int64) * mesh.pieces + right
        place = np.searchsorted(keys[order], sought).clip(0, len(cut) - 1)
        open_ = (left >= 0) & (right >= 0) & _looked_at(mesh).ravel()[cells].all(axis=1)
        open_ &= keys[order][place] == sought
        return cut[order][place[open_]], openings[open_], cells[open_]


def _openings(mesh: Mesh, own: Bools, ratio: int, first: Indices) -> tuple[Indices, Floats]:
    """The openings of a neck, see `Neck`, from the finer mesh: ``own`` (rows, cols) which cells are in the neck, each
    ``ratio`` finer cells wide; ``first``: row and column of the first cell."""
    cols = mesh.excess.shape[1] - 1
    fine = np.zeros(mesh.pieces, np.intp)
    for half in mesh.piece.T:
        some = np.flatnonzero(_looked_at(mesh).ravel())
        some = some[half[some] >= 0]
        fine[half[some]] = some
    fine_at = np.stack([fine // cols + mesh.row, fine % cols + mesh.col], axis=-1)
    cell = fine_at // ratio
    inside = own[cell[:, 0], cell[:, 1]]
    number = cell[:, 0] * own.shape[1] + cell[:, 1]
    a, b = mesh.joins.T.astype(np.intp)
    same = (number[a] == number[b]) & inside[a]
    part = np.where(inside, _connected(a[same], b[same], mesh.pieces), -1)
    out = (number[a] != number[b]) & (inside[a] | inside[b])
    a, b = a[out], b[out]
    flip = (cell[b] < cell[a]).any(axis=1)
    a, b = np.where(flip, b, a), np.where(flip, a, b)
    above = cell[b, 0] > cell[a, 0]
    key = np.column_stack([cell[a] + first, above, part[a], part[b]])
    at = np.where(above, fine_at[a, 1], fine_at[a, 0]) % ratio
    if not len(key):
        return key.astype(np.intp), np.zeros((0, 2))
    key, group = np.unique(key, axis=0, return_inverse=True)
    low, high = np.full(len(key), ratio), np.zeros(len(key), np.intp)
    np.minimum.at(low, group.ravel(), at)
    np.maximum.at(high, group.ravel(), at + 1)
    # Another neck's nodes may lie a little beside these, so that an opening's end lies in the next finer cell there.
    more = (key[:, 3:] < 0).any(axis=1)
    return key, np.stack([low - more, high + more], axis=-1).clip(0, ratio) / ratio


def _joined(necks: list[Neck]) -> Floats:
    """(N, 7) the openings of all necks, with the range in the last two columns: openings of two necks on the edge
    between them become one for each pair of parts that may meet there."""
    openings = np.vstack([np.column_stack([neck.openings, neck.range]) for neck in necks])
    at, aside = openings[:, :2].astype(np.int64), openings[:, 2] == 0.0
    next_at = at + np.stack([~aside, aside], axis=-1)
    known = np.unique(_numbers(np.vstack([neck.cells for neck in necks])))
    edge = 2 * _numbers(at) + openings[:, 2].astype(np.int64)
    first, second = ((openings[:, 3 + k] < 0.0) & np.isin(_numbers(of), known) for k, of in enumerate((at, next_at)))
    left, right = np.flatnonzero(second), np.flatnonzero(first)
    right = right[np.argsort(edge[right], kind="stable")]
    begin, end = (np.searchsorted(edge[right], edge[left], side) for side in ("left", "right"))
    count = end - begin
    one = np.repeat(left, count)
    other = right[np.arange(len(one)) - np.repeat(np.cumsum(count) - count - begin, count)]
    pairs = openings[one]
    pairs[:, 4] = openings[other, 4]
    pairs[:, 5] = np.maximum(openings[one, 5], openings[other, 5])
    pairs[:, 6] = np.minimum(openings[one, 6], openings[other, 6])
    return np.vstack([openings[~first & ~second], pairs[pairs[:, 6] >= pairs[:, 5]]])


def _numbers(cells: Indices) -> Indices:
    """(K,) one number for each of cells (K, 2)."""
    return np.asarray(cells[:, 0].astype(np.int64) << 32) + cells[:, 1]


def _names(names: Indices, joins: Indices, ends: Floats, cut: Floats, first: int) -> Indices:
    """(N, 2) names of the ends of portals: new ones, from ``first``, where a portal of ``cut`` (M, 4) ended or ends.

    The ends at one place have the same name if pieces join them there: of the parts of a cell that meet at a node, a
    track at the node in one part is not in the other. If the way around a node is open, no track turns there.
    """
    both = np.round(np.vstack([ends, cut]).reshape(-1, 2) / SAME_END_M).astype(np.int64)
    place = np.unique(both, axis=0, return_inverse=True)[1].ravel()
    place, gone = place[: 2 * len(ends)], place[2 * len(ends) :]
    end = np.arange(len(place))
    around = np.concatenate([np.stack([place, np.repeat(joins[:, k], 2)], axis=-1) for k in range(2)])
    meeting = np.unique(around, axis=0, return_inverse=True)[1].ravel() + len(end)
    count = int(meeting.max(initial=-1)) + 1
    found = _connected(np.tile(end, 2), meeting, count)[: len(end)]
    # Pieces at a node whose portals form a circle: as many portals as pieces.
    pieces = np.unique(np.stack([np.tile(found, 2), np.repeat(joins.T, 2, axis=1).ravel()], axis=-1), axis=0)[:, 0]
    size = int(found.max(initial=-1)) + 1
    open_ = np.bincount(pieces, minlength=size) <= np.bincount(found, minlength=size)
    new = np.where(open_[found], -1 - first - found, first + found)
    touched = np.isin(place, np.union1d(gone, place[np.repeat(names[:, 0] == NEW, 2)]))
    return np.where(touched, new, names.ravel()).reshape(-1, 2)


def _connected(one: Indices, other: Indices, count: int) -> Indices:
    """(count,) numbers of the connected parts of a graph of ``count`` nodes, linked from ``one`` to ``other``."""
    from scipy.sparse import coo_array  # most missions have no necks
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(one)), (one, other)), (count, count))
    return np.asarray(connected_components(links, directed=False)[1], np.int64)


def _node(mesh: Mesh, at: Indices) -> Floats:
    """(K, 2) the places of a mesh's nodes ``at`` rows and columns (K, 2)."""
    plane = mesh.plane
    fine = at / mesh.fineness + [mesh.row, mesh.col]
    j, i = np.floor(fine).astype(np.intp).clip(0, np.array(plane.x.shape) - 2).T
    v, u = (fine - np.stack([j, i], axis=-1)).T
    weights = (((1.0 - v) * (1.0 - u), 0, 0), ((1.0 - v) * u, 0, 1), (v * (1.0 - u), 1, 0), (v * u, 1, 1))
    return np.stack([sum(w * z[j + q, i + p] for w, q, p in weights) for z in (plane.x, plane.y)], axis=-1)


def _pieces_of(mesh: Mesh, cells: Bools) -> Bools:
    """(pieces,) which pieces are in some of the cells."""
    out = np.zeros(mesh.pieces, np.bool_)
    found = mesh.piece[(cells & _looked_at(mesh)).ravel()]
    out[found[found >= 0]] = True
    return out


def _looked_at(mesh: Mesh) -> Bools:
    """(rows - 1, cols - 1) which cells of a mesh have been looked at; the pieces of others are not known."""
    i = np.arange(mesh.excess.shape[1] - 1)
    found: Bools = (mesh.span[:, :1] <= i) & (i < mesh.span[:, 1:])
    return found


def _widened(cells: Bools) -> Bools:
    """A mask of cells with all cells around them."""
    wide = np.pad(cells, 1)
    rows, cols = cells.shape
    found: Bools = np.any([wide[j : j + rows, i : i + cols] for j in range(3) for i in range(3)], axis=0)
    return found


def _grown(cells: set[tuple[int, int]], by: int) -> set[tuple[int, int]]:
    """Cells, and all cells no farther than ``by`` rows and columns from one of them."""
    steps = range(-by, by + 1)
    return {(row + j, col + i) for row, col in cells for j in steps for i in steps}
