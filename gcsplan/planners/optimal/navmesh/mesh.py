"""A mesh of convex free pieces: shortest tracks over it, and lower bounds of distances to all that a track may meet."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from gcsplan.arrays import Bools, Floats, Int8s, Int32s, Int64s
from gcsplan.planners.budget import RATES
from gcsplan.planners.optimal.navmesh.grid import Plane
from gcsplan.planners.optimal.navmesh.mesh_kernels import in_reach, least_of_cells, least_of_portals, within
from gcsplan.planners.optimal.navmesh.portals import GroundPlace, GroundTrack, Portals
from gcsplan.planners.optimal.navmesh.zone_shapes import LOOSE

BENT_M = LOOSE.bent_m
"""Metres that a raster's line may bow between the corners of a block, at most."""
PLACE_OFF_CELLS = 0.25
"""Cells that a place may lie beside its computed position on a lattice, at most."""
PIECE_OFF_CELLS = 1e-3
"""Cells that a place may lie beside a piece that tracks from it begin in, at most, east and north."""
MOST_OPENED, ANYHOW, OF_PORTAL = 3_000_000, 100_000, 64
"""Intervals that a search may open before it is given up: at most `MOST_OPENED`, and at most `ANYHOW` plus `OF_PORTAL`
per portal. If the goal is farther than the limit, and many tracks lead around many corners, it would open many more."""
INTERVAL_BYTES = 200.0
"""Bytes of an opened interval, with the intervals that it yields and that are never opened."""


@dataclass(eq=False, slots=True)
class Mesh(Portals):
    """The pieces of a plane's free cells, see `mesh_kernels`; ``row``, ``col``: the plane's cell where it begins."""

    plane: Plane
    fineness: int
    row: int
    col: int
    excess: Floats
    floor: Floats
    diagonal: Int8s
    span: Int32s
    piece: Int32s
    parts_of: Int32s = field(default_factory=lambda: np.empty((0, 2), np.int32))
    """(K, 2) the two pieces (or -1) of the cell that each of the last K pieces is a part of, see `necks`."""

    def lowest(self, cells: Int64s) -> Floats:
        """(K,) the lowest floor at each cell's corners; -inf if one of them is not looked at."""
        at = self._corners(cells)
        return np.asarray(np.where(np.isposinf(self.excess[at]), -np.inf, self.floor[at]).min(axis=0))

    def straight_to(self, place: GroundPlace, cells: Int64s) -> Floats:
        """(K,) a lower bound of the distance from a place to each cell, m; for meshes as fine as their plane."""
        x, y = self._corner_places(cells)
        middle = np.hypot(x.mean(axis=0) - place[0], y.mean(axis=0) - place[1])
        return np.asarray(middle - 0.5 * self.widths(cells) - BENT_M)

    def widths(self, cells: Int64s) -> Floats:
        """(K,) metres between opposite corners of each cell, along the longer diagonal; for meshes as fine as their
        plane."""
        x, y = self._corner_places(cells)
        return np.asarray(np.maximum(np.hypot(x[3] - x[0], y[3] - y[0]), np.hypot(x[2] - x[1], y[2] - y[1])))

    def _corners(self, cells: Int64s) -> tuple[Int64s, Int64s]:
        """(4, K) each: rows and columns of the nodes at the corners of cells, row by row."""
        j, i = np.divmod(cells, self.excess.shape[1] - 1)
        return np.stack([j, j, j + 1, j + 1]), np.stack([i, i + 1, i, i + 1])

    def _corner_places(self, cells: Int64s) -> tuple[Floats, Floats]:
        """(4, K) each: x and y of the corners of cells, row by row; for meshes as fine as their plane."""
        j, i = self._corners(cells)
        at = j + self.row, i + self.col
        return self.plane.x[at], self.plane.y[at]

    def places(self) -> tuple[Floats, Floats]:
        """(rows, cols) x and y of the plane's nodes that the mesh covers; for meshes as fine as their plane."""
        rows, cols = self.excess.shape
        part = np.s_[self.row : self.row + rows, self.col : self.col + cols]
        return np.ascontiguousarray(self.plane.x[part]), np.ascontiguousarray(self.plane.y[part])

    def over_plane(self, cells: Bools) -> Bools:
        """Extend a mask of the mesh's cells to all the plane's, false elsewhere; for meshes as fine as their plane."""
        out = np.zeros(self.plane.inside.shape, np.bool_)
        out[self.row : self.row + cells.shape[0], self.col : self.col + cells.shape[1]] = cells
        return out

    def cells_at(self, place: GroundPlace) -> Int64s:
        """The numbers of the cells that a place may lie in, rising; for meshes as fine as their plane."""
        rows, cols = self.excess.shape
        c, r = self.plane.at(place)
        i, j = (
            {math.floor(at - first + off) for off in (-PLACE_OFF_CELLS, PLACE_OFF_CELLS)}
            for at, first in ((c, self.col), (r, self.row))
        )
        found = {q * (cols - 1) + p for q in j for p in i if 0 <= q < rows - 1 and 0 <= p < cols - 1}
        return np.array(sorted(found), np.int64)

    def pieces_at(self, place: GroundPlace) -> list[int]:
        """The free pieces at a place: in its own cell, and in cells no farther than `PIECE_OFF_CELLS`."""
        found: list[int] = []
        rows, cols = self.excess.shape
        c, r = self.plane.at(place)
        c, r = self.fineness * (c - self.col), self.fineness * (r - self.row)
        for dj in (0.0, -PIECE_OFF_CELLS, PIECE_OFF_CELLS):
            for di in (0.0, -PIECE_OFF_CELLS, PIECE_OFF_CELLS):
                i, j = math.floor(c + di), math.floor(r + dj)
                if not (0 <= i < cols - 1 and 0 <= j < rows - 1):
                    continue
                u, v, k = c - i, r - j, j * (cols - 1) + i
                lower = u >= v if self.diagonal[k] == 0 else u + v <= 1.0
                p = int(self.piece[k, 0 if lower else 1])
                if p >= 0 and p not in found:
                    found.append(p)
        return found

    def track(
        self, start: GroundPlace, goal: GroundPlace, limit_m: float = math.inf, guide: Guide | None = None
    ) -> GroundTrack | None:
        """The shortest track, None if none is shorter than ``limit_m``. ``guide``: distances to ``goal`` over a mesh
        that is free wherever this one is. Raises Exhausted."""
        return self._search(start, goal, limit_m, -1.0, guide, None)

    def flood(
        self, start: GroundPlace, goal: GroundPlace, limit_m: float, slack: float, guide: Guide | None = None
    ) -> tuple[GroundTrack | None, Guide]:
        """The shortest track as in `track`, and lower bounds of the distance from ``start`` to the pieces.

        They cover all pieces that a track to ``goal`` may meet if it is shorter than ``limit_m`` and than 1 + ``slack``
        times the shortest.
        """
        met = np.full(len(self.joins), np.inf)
        track = self._search(start, goal, limit_m, slack, guide, met)
        entered = np.full(self.pieces, np.inf)
        least_of_portals(self.joins, met, entered)
        entered[self.pieces_at(start)] = 0.0
        return track, Guide(self, start, met, entered)

    def _search(
        self,
        start: GroundPlace,
        goal: GroundPlace,
        limit_m: float,
        slack: float,
        guide: Guide | None,
        met: Floats | None,
    ) -> GroundTrack | None:
        budget = self.plane.problem.budget
        most = min(MOST_OPENED, ANYHOW + OF_PORTAL * len(self.joins))
        most = int(min(most, budget.megabytes * 1e6 / INTERVAL_BYTES, max(budget.left, 0.0) / RATES["opened"] + ANYHOW))
        budget.spend("portal", len(self.joins))
        opened = float(most)
        try:
            found, opened = self.shortest(
                start, goal, self.pieces_at(start), self.pieces_at(goal), most, limit_m=limit_m, slack=slack,
                remaining=None if guide is None else guide.over(self), met=met,
            )  # fmt: skip
        finally:
            budget.spend("opened", opened)
        return found


@dataclass(eq=False, slots=True)
class Guide:
    """Lower bounds of the distance from ``place``, where a search began, to each portal (``met`` (portals,)) and to the
    entrance of each piece (``entered`` (pieces,)), m; inf where the search did not come."""

    mesh: Mesh
    place: GroundPlace
    met: Floats
    entered: Floats

    def over(self, finer: Mesh) -> Floats:
        """(pieces,) the lower bounds for a mesh on the same lattice, or on one finer by a whole factor."""
        # Meshes on a finer lattice begin at corners of coarse cells.
        share = finer.plane.parts * self.mesh.plane.stride // (self.mesh.plane.parts * finer.plane.stride)
        ratio = finer.fineness * share // self.mesh.fineness
        out = np.full(finer.pieces, np.inf)
        cols, fine_cols = self.mesh.excess.shape[1] - 1, finer.excess.shape[1] - 1
        first_row, first_col = finer.plane.begins(self.mesh.plane)
        row, col = (finer.row + first_row) // share - self.mesh.row, (finer.col + first_col) // share - self.mesh.col
        least_of_cells(
            self.mesh.piece, self.entered, cols, finer.piece, finer.span, fine_cols, ratio, row, col, out
        )  # fmt: skip
        if len(finer.parts_of):
            whole = np.append(out[: len(out) - len(finer.parts_of)], np.inf)
            out[len(out) - len(finer.parts_of) :] = whole[finer.parts_of].min(axis=1)
        return out

    def reach(self, place: GroundPlace, limit_m: float) -> Bools:
        """(rows - 1, cols - 1) the plane's cells that tracks shorter than ``limit_m`` from this guide's own place to
        another ``place`` may meet."""
        x, y = self.mesh.places()
        out = np.zeros((x.shape[0] - 1, x.shape[1] - 1), np.bool_)
        in_reach(self.mesh.piece, self.entered, x, y, *place, limit_m + BENT_M, out)
        return self.mesh.over_plane(out)

    def between(self, other: Guide, limit_m: float) -> Bools:
        """(rows - 1, cols - 1) as `cells_between`, of all the plane's cells."""
        cells = self.cells_between(other, limit_m)
        return self.mesh.over_plane(cells.reshape(self.mesh.excess.shape[0] - 1, -1))

    def cells_between(self, other: Guide, limit_m: float) -> Bools:
        """(cells,) which of the mesh's cells tracks from this guide's place to the place of another guide over the same
        mesh may enter, if they are no longer than ``limit_m``.

        Such a track meets the portal through which it enters a piece, so it is no shorter than the sum of the distances
        from both places to that portal. It may leave through the same portal: a shortest track does so where a finer
        mesh has walls that this one does not know.
        """
        mesh = self.mesh
        met = np.zeros(mesh.pieces, np.bool_)
        met[[*mesh.pieces_at(self.place), *mesh.pieces_at(other.place)]] = True
        out = np.zeros(len(mesh.piece), np.bool_)
        within(mesh.joins, self.met, other.met, limit_m, met, mesh.piece, out)
        return out

    def least(self, cells: Int64s) -> Floats:
        """(K,) the lower bound of the distance to each of ``cells`` (K,) of the mesh, m."""
        return np.asarray(np.minimum(*self._entered(cells)))

    def most(self, cells: Int64s) -> Floats:
        """(K,) an upper bound of the distance over the mesh to every place of each cell's pieces that the search came
        to, m; inf where it came to none. Each piece must be a part of one cell."""
        entered = self._entered(cells)
        most = np.fmax(*np.where(np.isfinite(entered), entered, np.nan))
        # The place itself may lie beside the pieces at it, see `Mesh.pieces_at`.
        across = (1.0 + 2.0 * PIECE_OFF_CELLS) * (self.mesh.widths(cells) + 2.0 * BENT_M)
        return np.asarray(np.where(np.isnan(most), np.inf, most + across))

    def _entered(self, cells: Int64s) -> Floats:
        """(2, K) `entered` of the two pieces of each cell; inf for a piece that it does not have."""
        return np.asarray(np.append(self.entered, np.inf)[self.mesh.piece[cells].T])
