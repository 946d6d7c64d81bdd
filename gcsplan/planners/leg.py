"""The plane between two stops: shortest tracks below an altitude cap, and how long any track must be at least.

The lattice is cut to an ellipse of detours around the stops, and widened when that is not enough. A flood from the far
stop, over all that may be free below the highest cap, tells every later search how far it still is: lower caps and
finer lattices only leave less room. So the fine lattices, too, need to be looked at only along the few tracks that may
be short enough.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.plane import Exhausted, Guide, Mesh, Plane, Way, make_plane
from gcsplan.planners.problem import Problem
from gcsplan.world.zones import Circle

Floats = NDArray[np.float64]
Cone = tuple[float, float, float, float]
"""Where it stands (east_m, north_m), its height there, and its slope."""

DETOURS = (1.25, 2.5, math.inf)
"""How long tracks may be, in times the straight way, before the lattice must be widened."""
COARSE_M = 100.0
"""Cells of the first look are no larger, if the terrain model's are not."""
FINE_M, FINE_PARTS, MOST_FINE = 24.0, 400.0, 6
"""Cells are cut until they are about as wide, or that part of the leg, but into no more parts a side."""

FEWER = 0.6
"""Cells are looked up anew for tracks that are longer than the shortest by that part of what was asked before."""
RAISED, WORTHWHILE = 4, 0.05
"""Times that walls are raised near the ends, and by what part of the way to spare it must have helped to go on."""


@dataclass(frozen=True, slots=True)
class End:
    """A stop: where, and how high; None where its height is free."""

    east_m: float
    north_m: float
    amsl_m: float | None

    @property
    def place(self) -> tuple[float, float]:
        """(east_m, north_m)."""
        return self.east_m, self.north_m


@dataclass(frozen=True, eq=False, slots=True)
class Cells:
    """Of each cell the lowest floor and how long ways there and on are at least; all cells that tracks no longer than
    ``limit_m`` may meet."""

    limit_m: float
    low_m: Floats
    away_m: Floats
    left_m: Floats


class Leg:
    """One leg of a problem, from stop to stop, under caps of at most ``top_m``."""

    def __init__(self, problem: Problem, start: End, goal: End, top_m: float) -> None:
        self.problem, self.start, self.goal, self.top_m = problem, start, goal, top_m
        self.straight_m = math.dist(start.place, goal.place)
        self.length_m = math.inf
        """A lower bound of every track's length below the highest cap; inf: there is none, proved."""
        self.reach_m = 0.0
        """Tracks shorter than this lie within the lattice, and within what the flood has seen."""
        self.plane: Plane
        self._twin: Plane | None = None
        self._guide: Guide
        self._ahead: Guide | None = None
        self._seen: dict[bool, Cells] = {}
        cell_m = float(problem.airspace.surface.grid.metres_per_cell(*start.place).max())
        wanted_m, finest_m = self._cell_m(), min(FINE_M, self.straight_m / FINE_PARTS)
        self.parts = max(1, round(cell_m / wanted_m))
        """Parts a side that the terrain model's cells are cut into, where they are large beside leg or zones."""
        self._fine_stride = max(1, round(finest_m / cell_m)) if self.parts == 1 else 1
        self._stride = self._fine_stride * max(1, round(wanted_m / cell_m / self._fine_stride))
        if self.parts > 1 or self._stride < 3:
            self._stride = self._fine_stride = 1
        # How many parts a side the first look's cells are cut into where it matters, of the plane or of its finer twin.
        self._ratio = self._stride // self._fine_stride
        self._cut = 1
        if self._stride == 1:
            self._ratio = self._cut = max(1, min(MOST_FINE, round(cell_m / self.parts / finest_m)))
        self.has_fine = self._ratio > 1
        """Whether there is a lattice finer than that of the first look."""

    def _cell_m(self) -> float:
        """How large cells may be for the first look."""
        least, most = self.straight_m / 250.0, min(self.straight_m / 60.0, COARSE_M)
        radii = [
            z.shape.radius_m
            if isinstance(z.shape, Circle)
            else 0.5 * min(z.bounds[2] - z.bounds[0], z.bounds[3] - z.bounds[1])
            for z in self.problem.airspace.zones
        ]
        return max(least, min([most, *(r / 3.0 for r in radii)]))

    def flood(self, slack: float) -> None:
        """Look at all that is free below the highest cap, as far as ways ``slack`` longer than the shortest lead.

        Widens the lattice until that way lies within it.
        """
        self._ahead = None
        self._seen.clear()
        for detour in DETOURS:
            if math.isfinite(detour) and detour * self.straight_m < self.length_m * (1.0 + slack) < math.inf:
                continue
            within = detour * self.straight_m if math.isfinite(detour) else math.inf
            self.plane, self._twin = self._lattice(detour, self._stride), None
            self._detour = detour
            mesh = self.plane.mesh(self.top_m, True)
            a, b = self.goal.place, self.start.place
            try:
                way, self._guide = mesh.flood(a, b, within, slack)
            except Exhausted as given_up:
                # What was seen is as good as a flood that was asked to go no farther.
                self.length_m = self.reach_m = given_up.seen_m * (1.0 - 1e-9)
                self._guide = mesh.flood(a, b, self.reach_m, slack)[1]
                return
            if way is not None:
                self.length_m = way.length_m
                self.reach_m = min(within, way.length_m * (1.0 + slack))
                return

    def _mesh(
        self,
        cap_m: float,
        low: bool,
        wanted: NDArray[np.bool_] | None,
        cones: list[Cone] | None = None,
        under: NDArray[np.bool_] | None = None,
    ) -> Mesh:
        """The first look's mesh, or with ``wanted`` (cells of the first look) the finer one there."""
        if wanted is None or not self.has_fine:
            return self.plane.mesh(cap_m, low, 1, wanted, cones, under)
        if self._stride == 1:
            return self.plane.mesh(cap_m, low, self._cut, wanted, cones, under)
        if self._twin is None:
            self._twin = self._lattice(self._detour, self._fine_stride)
        finer = np.repeat(np.repeat(wanted, self._ratio, axis=0), self._ratio, axis=1)
        return self._twin.mesh(cap_m, low, 1, finer, cones, under)

    def track(
        self, cap_m: float, wanted: NDArray[np.bool_] | None, under: NDArray[np.bool_] | None, spare_m: float = 0.0
    ) -> Way | None:
        """The shortest track of which the mesh for paths holds that it is legal below ``cap_m``.

        ``spare_m``: metres that may be added near the ends to climb.
        """
        limits = self.problem.limits
        cones = self._cones(limits.max_climb_slope, limits.max_descent_slope, spare_m)
        mesh = self._mesh(cap_m, False, wanted, cones, under)
        try:
            return mesh.way(self.start.place, self.goal.place, self.reach_m, self._guide)
        except Exhausted:
            return None

    def bound(self, cap_m: float, wanted: NDArray[np.bool_] | None, limit_m: float, climbs: bool = False) -> float:
        """A lower bound of every track's length below ``cap_m``; ``limit_m``, or `reach_m`, if it is more.

        ``climbs``: near the ends hold tracks to what they can climb to, if they are shorter than ``limit_m``.
        """
        limit, limits = min(limit_m, self.reach_m), self.problem.limits
        cones: list[Cone] = []
        known = self.length_m
        for _ in range(RAISED):
            spare = max(limit - known, 0.0)
            if climbs:
                cones += self._cones(limits.max_climb_slope, limits.max_descent_slope, spare)
            mesh = self._mesh(cap_m, True, wanted, cones)
            try:
                way = mesh.way(self.start.place, self.goal.place, limit, self._guide)
            except Exhausted as given_up:
                return max(known, min(limit, given_up.seen_m))
            if way is None:
                return limit
            # Ways are longer between the walls that the cones raised, so there is less to spare for a climb: again.
            if not cones or way.length_m < known + WORTHWHILE * spare:
                return max(known, way.length_m)
            known = way.length_m
        return known

    def corridor(self, limit_m: float) -> NDArray[np.bool_]:
        """(rows - 1, cols - 1) the lattice's cells that a track shorter than ``limit_m`` may meet."""
        mesh = self._guide.mesh
        through = np.append(self._from_start().entered + self._guide.entered, np.inf)
        out = np.zeros(self.plane.inside.shape, np.bool_)
        near = through[mesh.piece].min(axis=1) <= limit_m
        rows, cols = mesh.excess.shape[0] - 1, mesh.excess.shape[1] - 1
        out[mesh.row : mesh.row + rows, mesh.col : mesh.col + cols] = near.reshape(rows, cols)
        return out

    def cells(self, limit_m: float, *, closely: bool = False) -> tuple[Floats, Floats, Floats]:
        """Of the cells that tracks shorter than ``limit_m`` may meet (and more): lowest floor, ways there and on.

        ``closely``: the ways of each cell alone, where else whole pieces are as near as their entrances.
        """
        if limit_m > self.reach_m * (1.0 + 1e-6):  # a longer track may meet cells that the flood did not
            return np.full(1, -math.inf), np.zeros(1), np.zeros(1)  # of nothing it is known that it is high
        seen = self._seen.get(closely)
        again = seen is None or limit_m > seen.limit_m
        if seen is not None and closely:  # fewer cells lie on shorter tracks
            again = again or limit_m - self.length_m < FEWER * (seen.limit_m - self.length_m)
        if seen is None or again:
            seen = self._seen[closely] = self._cells_alone(limit_m) if closely else self._cells_of_pieces()
        near = seen.away_m + seen.left_m <= limit_m
        return seen.low_m[near], seen.away_m[near], seen.left_m[near]

    def _cells_of_pieces(self) -> Cells:
        mesh = self._guide.mesh
        both = mesh.piece.reshape(-1, 2)
        ways = []
        for guide, end in ((self._from_start(), self.start), (self._guide, self.goal)):
            entered = np.append(guide.entered, np.inf)[both].min(axis=1)
            ways.append(np.maximum(entered, mesh.straight_to(end.place)))
        return Cells(math.inf, mesh.lowest(), *ways)

    def _cells_alone(self, limit_m: float) -> Cells:
        mesh = self.plane.mesh(self.top_m, True, 1, self.corridor(limit_m), single=True)
        a, b = self.start.place, self.goal.place
        try:
            _, left = mesh.flood(b, a, limit_m, math.inf, self._from_start())
            _, away = mesh.flood(a, b, limit_m, math.inf, left)
        except Exhausted:
            return self._cells_of_pieces()
        both = mesh.piece.reshape(-1, 2)
        ways = [np.append(guide.entered, np.inf)[both].min(axis=1) for guide in (away, left)]
        return Cells(limit_m, mesh.lowest(), *ways)

    def _from_start(self) -> Guide:
        """Distances from the start over the coarse mesh, as far as the flood from the goal has seen."""
        if self._ahead is None:
            mesh = self._guide.mesh
            try:
                _, self._ahead = mesh.flood(self.start.place, self.goal.place, self.reach_m, math.inf, self._guide)
            except Exhausted:
                self._ahead = Guide(mesh, np.zeros(len(mesh.start) - 1))
        return self._ahead

    def _cones(self, climb: float, descent: float, slack_m: float) -> list[Cone]:
        """Height and slope of what can be reached near the ends, by paths with ``slack_m`` to spare."""
        ends = ((self.start, climb), (self.goal, descent))
        return [
            (end.east_m, end.north_m, end.amsl_m + slope * slack_m, slope)
            for end, slope in ends
            if end.amsl_m is not None and math.isfinite(slope)
        ]

    def _lattice(self, detour: float, stride: int) -> Plane:
        a, b, d = self.start.place, self.goal.place, self.straight_m
        if math.isinf(detour):
            everywhere = (-math.inf, -math.inf, math.inf, math.inf)
            return make_plane(self.problem, everywhere, self.parts, stride, self._stride)
        more = max(0.5 * d * math.sqrt(detour**2 - 1.0), 0.5 * (detour - 1.0) * d) + 1.0
        box = (min(a[0], b[0]) - more, min(a[1], b[1]) - more, max(a[0], b[0]) + more, max(a[1], b[1]) + more)
        cell = self._stride * float(self.problem.airspace.surface.grid.metres_per_cell(*a).max())

        def inside(x: Floats, y: Floats) -> NDArray[np.bool_]:
            to = np.hypot(x - a[0], y - a[1]) + np.hypot(x - b[0], y - b[1])
            return np.asarray(to <= detour * d + 4.0 * cell)

        return make_plane(self.problem, box, self.parts, stride, self._stride, inside)
