"""A mesh of convex free pieces: shortest tracks over it, and lower bounds of distances to all that a track may meet."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from gcsplan.arrays import Bools, Floats, Int8s, Int32s, Int64s
from gcsplan.planners.budget import RATES
from gcsplan.planners.optimal.navmesh.grid import Plane
from gcsplan.planners.optimal.navmesh.mesh_kernels import in_reach, least_of_cells, least_of_portals, within
from gcsplan.planners.optimal.navmesh.portals import GroundTrack, Place, Portals
from gcsplan.planners.optimal.navmesh.zone_shapes import LOOSE

BENT_M = LOOSE.bent_m
"""Metres that a raster's line may bow between the corners of a block, at most."""
ASIDE = 0.25
"""Cells that a place may lie beside its computed position on a lattice, at most."""
BESIDE = 1e-3
"""Cells that a place may lie beside a piece that tracks from it begin in, at most, east and north."""
MOST_OPENED, ANYHOW, OF_PORTAL = 3_000_000, 100_000, 64
"""Intervals that a search may open before it is given up: at most `MOST_OPENED`, and at most `ANYHOW` plus `OF_PORTAL`
per portal. If the goal is farther than the limit, and many tracks lead around many corners, it would open many more."""
NODE_BYTES = 200.0
"""Bytes of an opened interval, with those that it yields and that are never opened."""


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

    def lowest(self) -> Floats:
        """(cells,) the lowest floor at each cell's corners; -inf if one of them is not looked at."""
        f = np.where(np.isposinf(self.excess), -np.inf, self.floor)
        return np.minimum(np.minimum(f[:-1, :-1], f[:-1, 1:]), np.minimum(f[1:, :-1], f[1:, 1:])).ravel()

    def straight_to(self, place: Place) -> Floats:
        """(cells,) a lower bound of the distance from a place to each cell, m; for meshes as fine as their plane."""
        x, y = (at - own for at, own in zip(self.places(), place, strict=True))
        middle = (0.25 * (z[:-1, :-1] + z[:-1, 1:] + z[1:, :-1] + z[1:, 1:]) for z in (x, y))
        return np.asarray((np.hypot(*middle) - 0.5 * self._widths()).ravel() - BENT_M)

    def widest_m(self) -> float:
        """Metres between any two places of one cell, at most; for meshes as fine as their plane."""
        return float(self._widths().max()) + 2.0 * BENT_M

    def _widths(self) -> Floats:
        """(rows - 1, cols - 1) metres between opposite corners of each cell, along the longer diagonal."""
        x, y = self.places()
        across = np.hypot(x[1:, 1:] - x[:-1, :-1], y[1:, 1:] - y[:-1, :-1])
        other = np.hypot(x[1:, :-1] - x[:-1, 1:], y[1:, :-1] - y[:-1, 1:])
        return np.asarray(np.maximum(across, other))

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

    def of_plane(self, cells: Bools) -> Bools:
        """The part that the mesh covers of a mask of all the plane's cells."""
        rows, cols = self.excess.shape
        return cells[self.row : self.row + rows - 1, self.col : self.col + cols - 1]

    def cells_at(self, place: Place) -> Int64s:
        """The numbers of the cells that a place may lie in, rising; for meshes as fine as their plane."""
        rows, cols = self.excess.shape
        c, r = self.plane.at(place)
        i, j = (
            {math.floor(at - first + off) for off in (-ASIDE, ASIDE)} for at, first in ((c, self.col), (r, self.row))
        )
        found = {q * (cols - 1) + p for q in j for p in i if 0 <= q < rows - 1 and 0 <= p < cols - 1}
        return np.array(sorted(found), np.int64)

    def pieces_at(self, place: Place) -> list[int]:
        """The free pieces at a place: in its own cell, and in cells no farther than `BESIDE`."""
        found: list[int] = []
        rows, cols = self.excess.shape
        c, r = self.plane.at(place)
        c, r = self.fineness * (c - self.col), self.fineness * (r - self.row)
        for dj in (0.0, -BESIDE, BESIDE):
            for di in (0.0, -BESIDE, BESIDE):
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
        self, start: Place, goal: Place, limit_m: float = math.inf, guide: Guide | None = None
    ) -> GroundTrack | None:
        """The shortest track, None if none is shorter than ``limit_m``. ``guide``: distances to ``goal`` over a mesh
        that is free wherever this one is. Raises Exhausted."""
        return self._search(start, goal, limit_m, -1.0, guide, None)

    def flood(
        self, start: Place, goal: Place, limit_m: float, slack: float, guide: Guide | None = None
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
        self, start: Place, goal: Place, limit_m: float, slack: float, guide: Guide | None, met: Floats | None
    ) -> GroundTrack | None:
        budget = self.plane.problem.budget
        most = min(MOST_OPENED, ANYHOW + OF_PORTAL * len(self.joins))
        most = int(min(most, budget.left_mb * 1e6 / NODE_BYTES, max(budget.left, 0.0) / RATES["opened"] + ANYHOW))
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
    place: Place
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

    def reach(self, place: Place, limit_m: float) -> Bools:
        """(rows - 1, cols - 1) the plane's cells that tracks shorter than ``limit_m`` from this guide's own place to
        another ``place`` may meet."""
        x, y = self.mesh.places()
        out = np.zeros((x.shape[0] - 1, x.shape[1] - 1), np.bool_)
        in_reach(self.mesh.piece, self.entered, x, y, *place, limit_m + BENT_M, out)
        return self.mesh.over_plane(out)

    def between(self, other: Guide, limit_m: float) -> Bools:
        """(rows - 1, cols - 1) the plane's cells that tracks from this guide's place to the place of another guide over
        the same mesh may enter, if they are no longer than ``limit_m``.

        Such a track meets the portal through which it enters a piece, so it is no shorter than the sum of the distances
        from both places to that portal. It may leave through the same portal: a shortest track does so where a finer
        mesh has walls that this one does not know.
        """
        mesh = self.mesh
        met = np.zeros(mesh.pieces, np.bool_)
        met[[*mesh.pieces_at(self.place), *mesh.pieces_at(other.place)]] = True
        out = np.zeros(len(mesh.piece), np.bool_)
        within(mesh.joins, self.met, other.met, limit_m, met, mesh.piece, out)
        return mesh.over_plane(out.reshape(mesh.excess.shape[0] - 1, -1))

    def cells(self) -> Floats:
        """(cells,) the lower bound of the distance to each of the mesh's cells, m."""
        return np.asarray(np.append(self.entered, np.inf)[self.mesh.piece].min(axis=1))

    def farthest(self) -> Floats:
        """(cells,) an upper bound of the distance over the mesh to every place of each cell's pieces that the search
        came to, m; inf where it came to none. Each piece must be a part of one cell."""
        # The place itself may lie beside the pieces at it, see `Mesh.pieces_at`.
        across = (1.0 + 2.0 * BESIDE) * self.mesh.widest_m()
        entered = np.append(np.where(np.isfinite(self.entered), self.entered + across, -np.inf), -np.inf)
        most = entered[self.mesh.piece].max(axis=1)
        return np.asarray(np.where(np.isneginf(most), np.inf, most))
