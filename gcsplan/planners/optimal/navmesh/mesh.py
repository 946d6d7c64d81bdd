"""A mesh of convex free pieces: shortest ways over it, and how far everything is that a way could meet."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.budget import RATES
from gcsplan.planners.optimal.navmesh.grid import Plane
from gcsplan.planners.optimal.navmesh.mesh_kernels import in_reach, least_of_cells, least_of_portals, within
from gcsplan.planners.optimal.navmesh.portals import GroundTrack, Place, Portals
from gcsplan.planners.optimal.navmesh.zone_shapes import LOOSE

Ints = NDArray[np.int32]

BENT_M = LOOSE.bent_m
"""Most that a raster's line may bow between the corners of a block."""
ASIDE = 0.25
"""How far beside where it is said to be a place may lie on a lattice, in cells, at most."""
MOST_OPENED, ANYHOW, OF_PORTAL = 3_000_000, 100_000, 64
"""Intervals that are looked at before a search is given up: in all, and, beyond some, for each portal. Where the goal
is farther than the limit, and there are many ways around many corners, they would be many times that."""
NODE_BYTES = 200.0
"""What an opened interval takes, with those that it leaves unopened."""


@dataclass(eq=False, slots=True)
class Mesh(Portals):
    """The pieces of a plane's free cells, see `mesh_kernels`; ``row``, ``col``: the plane's cell that it begins at."""

    plane: Plane
    fineness: int
    row: int
    col: int
    excess: Floats
    floor: Floats
    diagonal: NDArray[np.int8]
    span: Ints
    piece: Ints

    def lowest(self) -> Floats:
        """(cells,) the lowest floor of each; -inf where a corner is not looked at."""
        f = np.where(np.isposinf(self.excess), -np.inf, self.floor)
        return np.minimum(np.minimum(f[:-1, :-1], f[:-1, 1:]), np.minimum(f[1:, :-1], f[1:, 1:])).ravel()

    def straight_to(self, place: Place) -> Floats:
        """(cells,) metres that no way from a place to each is shorter than; of meshes as fine as their plane."""
        return self.middles_from(place) - 0.5 * self._widths().ravel() - BENT_M

    def middles_from(self, place: Place) -> Floats:
        """(cells,) metres straight from a place to the middle of each; of meshes as fine as their plane."""
        x, y = (at - own for at, own in zip(self.places(), place, strict=True))
        middle = (0.25 * (z[:-1, :-1] + z[:-1, 1:] + z[1:, :-1] + z[1:, 1:]) for z in (x, y))
        return np.asarray(np.hypot(*middle).ravel())

    def half_m(self) -> float:
        """No place of any cell is farther from its middle; of meshes as fine as their plane."""
        return 0.5 * float(self._widths().max()) + BENT_M

    def _widths(self) -> Floats:
        """(rows - 1, cols - 1) metres between opposite corners."""
        x, y = self.places()
        across = np.hypot(x[1:, 1:] - x[:-1, :-1], y[1:, 1:] - y[:-1, :-1])
        other = np.hypot(x[1:, :-1] - x[:-1, 1:], y[1:, :-1] - y[:-1, 1:])
        return np.asarray(np.maximum(across, other))

    def places(self) -> tuple[Floats, Floats]:
        """(rows, cols) x and y of the plane's nodes that the mesh is over; of meshes as fine as their plane."""
        rows, cols = self.excess.shape
        part = np.s_[self.row : self.row + rows, self.col : self.col + cols]
        return np.ascontiguousarray(self.plane.x[part]), np.ascontiguousarray(self.plane.y[part])

    def over_plane(self, cells: Bools) -> Bools:
        """The same of all the plane's cells: false elsewhere; of meshes as fine as their plane."""
        out = np.zeros(self.plane.inside.shape, np.bool_)
        out[self.row : self.row + cells.shape[0], self.col : self.col + cells.shape[1]] = cells
        return out

    def of_plane(self, cells: Bools) -> Bools:
        """That part of all the plane's cells that the mesh is over."""
        rows, cols = self.excess.shape
        return cells[self.row : self.row + rows - 1, self.col : self.col + cols - 1]

    def cells_at(self, place: Place) -> NDArray[np.int64]:
        """The cells that a place may lie in; of meshes as fine as their plane."""
        rows, cols = self.excess.shape
        c, r = self.plane.at(place)
        i, j = (
            {math.floor(at - first + off) for off in (-ASIDE, ASIDE)} for at, first in ((c, self.col), (r, self.row))
        )
        found = {q * (cols - 1) + p for q in j for p in i if 0 <= q < rows - 1 and 0 <= p < cols - 1}
        return np.array(sorted(found), np.int64)

    def pieces_at(self, place: Place) -> list[int]:
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

    def track(
        self, start: Place, goal: Place, limit_m: float = math.inf, guide: Guide | None = None
    ) -> GroundTrack | None:
        """The shortest track that is shorter than ``limit_m``. ``guide``: distances to ``goal`` over a mesh that leaves
        no less room. Raises Exhausted."""
        return self._search(start, goal, limit_m, -1.0, guide, None)

    def flood(
        self, start: Place, goal: Place, limit_m: float, slack: float, guide: Guide | None = None
    ) -> tuple[GroundTrack | None, Guide]:
        """The same, and how far every piece is from ``start`` at least, as far as tracks to ``goal`` lead that are
        shorter than ``limit_m`` and than the shortest with ``slack`` (as a part of it) added."""
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
    """``met`` (portals,), ``entered`` (pieces,): no way from ``place``, where a search began, to a portal or to the
    entrance of a piece is shorter; inf: none was looked for."""

    mesh: Mesh
    place: Place
    met: Floats
    entered: Floats

    def over(self, finer: Mesh) -> Floats:
        """The same for the pieces of a mesh on the same lattice, or one that is some times finer."""
        # A finer lattice's meshes begin at corners of coarse cells.
        share = finer.plane.parts * self.mesh.plane.stride // (self.mesh.plane.parts * finer.plane.stride)
        ratio = finer.fineness * share // self.mesh.fineness
        out = np.full(finer.pieces, np.inf)
        cols, fine_cols = self.mesh.excess.shape[1] - 1, finer.excess.shape[1] - 1
        first_row, first_col = finer.plane.begins(self.mesh.plane)
        row, col = (finer.row + first_row) // share - self.mesh.row, (finer.col + first_col) // share - self.mesh.col
        least_of_cells(
            self.mesh.piece, self.entered, cols, finer.piece, finer.span, fine_cols, ratio, row, col, out
        )  # fmt: skip
        return out

    def reach(self, place: Place, limit_m: float) -> Bools:
        """(rows - 1, cols - 1) the plane's cells that ways shorter than ``limit_m`` from here to a place may meet."""
        x, y = self.mesh.places()
        out = np.zeros((x.shape[0] - 1, x.shape[1] - 1), np.bool_)
        in_reach(self.mesh.piece, self.entered, x, y, *place, limit_m + BENT_M, out)
        return self.mesh.over_plane(out)

    def between(self, other: Guide, limit_m: float) -> Bools:
        """(rows - 1, cols - 1) the plane's cells that ways no longer than ``limit_m`` from here to where another
        search over the same mesh began may enter.

        Such a way meets the portal through which it enters a piece, and is no shorter than the ways there from both its
        ends. It may leave through the same one: a shortest way does so where finer walls stand that are not known here.
        """
        mesh = self.mesh
        met = np.zeros(mesh.pieces, np.bool_)
        met[[*mesh.pieces_at(self.place), *mesh.pieces_at(other.place)]] = True
        out = np.zeros(len(mesh.piece), np.bool_)
        within(mesh.joins, self.met, other.met, limit_m, met, mesh.piece, out)
        return mesh.over_plane(out.reshape(mesh.excess.shape[0] - 1, -1))

    def cells(self) -> Floats:
        """(cells,) how far the mesh's cells are at least."""
        return np.asarray(np.append(self.entered, np.inf)[self.mesh.piece].min(axis=1))
