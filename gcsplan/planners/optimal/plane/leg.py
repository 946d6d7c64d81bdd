"""The plane between two terminals: shortest tracks below an altitude cap, and lower bounds of every track's length.

The lattice is cut to an ellipse of detours around the terminals, and widened when that is not enough. Its cells are as
small as leg and zones need them, and as many as memory allows. A flood from the goal over all cells that may be free
below the highest cap gives every later search lower bounds of the distance that is left: lower caps and finer lattices
only make tracks longer. So the fine lattices, too, need to be searched only in the corridor of the few tracks that may
be short enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.navmesh.clearance import ClearanceGrid, PlaneSpec, mesh_of
from gcsplan.planners.optimal.navmesh.grid import Plane, box_of, extent, finer_plane, make_plane, on_finer
from gcsplan.planners.optimal.navmesh.mesh import Guide, Mesh
from gcsplan.planners.optimal.navmesh.necks import LegNecks
from gcsplan.planners.optimal.navmesh.portals import Exhausted, GroundPlace, GroundTrack
from gcsplan.planners.optimal.navmesh.zone_shapes import CLOSE, LOOSE
from gcsplan.planners.optimal.plane.altitude_intervals import (
    INTERVAL_SPARE_M,
    MOST_INTERVALS,
    AltitudeIntervals,
    Reached,
    Terminal,
    intervals,
    ranges,
)
from gcsplan.planners.optimal.plane.corridor import Corridor, End, Narrow, Nearby, SideChoice
from gcsplan.planners.problem import Problem
from gcsplan.world.geometry.zones import Box, Circle

COARSE_M = 100.0
"""Largest cells of the first-look lattice, metres, unless the terrain model's own are larger."""
FINE_M, FINE_PARTS, MOST_FINE = 24.0, 400.0, 6
"""Cells of the finer lattice are about as wide as the smaller of `FINE_M` metres and the leg's length / `FINE_PARTS`;
but a cell is cut into at most `MOST_FINE` parts a side."""
LEAST_M = 1.0
"""Smallest cells, metres: zone walls are drawn at their true place between nodes, and the ground within a cell is
straight, so smaller cells gain nothing."""
MOST_FIRST, MANY, NODE_BYTES = 1.5e6, 1e5, 400.0
"""Most nodes of the first-look lattices of all legs, unless a leg has fewer than `MANY`; and bytes of a node with its
mesh and a search over it."""
MUCH = 0.5
"""A lattice that needs more than this part of the terrain model's nodes is made over all of it."""
MOST_SEARCHED = 1.5e6
"""Most cells of the finer lattices of all legs that are searched for one track; in long corridors they are larger."""
BOX_NODE_BYTES = 50.0
"""Bytes of a node in the box of the finer lattice, whether it is searched or not."""


DETOURS, LEAST_DETOUR = (1.25, 2.5, math.inf), 1.02
"""Lengths of tracks, in multiples of the straight track, that each lattice holds before it is widened; and the length
that the narrowest lattice holds."""
MOST_NODES, MOST_BESIDE, LARGE = 16e6, 6e6, 4e6
"""Most nodes of the finest lattice in the box around a corridor: the first number; the second if the terrain model has
at least `LARGE` nodes, so that the lattice needs no more than half a gigabyte besides it."""
MOST_ALONE = 50_000
"""Most cells of the finer lattice that `refine` cuts again, into four parts for ``cut`` 2."""
LEARNT = 10
"""Most searches for one track over nodes that are only as high as in the exact check; see ``narrow`` of `track`."""
CELLS_BESIDE = 8
"""Cells that the finer lattice extends beyond the requested ones, because later tracks may lie beside them."""
MUCH_LONGER, ROUGHLY = 1.1, 3
"""If tracks may be this many times as long as the known bound, cells for their bound are this many times larger."""
RAISED, WORTHWHILE = 4, 0.05
"""Most times that walls near the ends are raised for one bound; and the part of the spare metres by which a round must
raise the bound for another to follow."""


@dataclass(frozen=True, slots=True)
class Cells:
    """``parts``: parts a side into which the terrain model's cells are cut, if they are large compared with leg or
    zones; or ``stride``: terrain cells a side that are merged into one in the first-look lattice, and ``fine_stride``
    in the finer lattice. ``ratio``: parts a side into which first-look cells are cut where it matters, within their own
    lattice (``cut``) or by the finer lattice. ``nodes``: of the first-look lattice, about."""

    parts: int
    stride: int
    fine_stride: int
    ratio: int
    cut: int
    nodes: float

    @property
    def has_fine(self) -> bool:
        """Whether there is a lattice finer than the first-look lattice."""
        return self.ratio > 1


def choose(problem: Problem, place: tuple[float, float], straight_m: float, box: Box) -> Cells:
    """The cell sizes for a leg of ``straight_m`` metres that begins at ``place``, for lattices over a box."""
    surface = problem.airspace.surface
    size = surface.grid.metres_per_cell(*place)
    col0, row0, col1, row1 = extent(problem, box)
    cells = float((col1 - col0) * (row1 - row0))
    legs = len(problem.via) + 1  # all of them keep their lattices
    fitting = 1e6 * problem.budget.megabytes / NODE_BYTES / legs
    most = min(max(MOST_FIRST / legs, MANY), fitting)
    cell_m, finest_m = float(size.max()), max(min(FINE_M, straight_m / FINE_PARTS), LEAST_M)
    first_m = max(_first_cell_m(problem, straight_m), LEAST_M, cell_m * math.sqrt(cells / most))
    parts = max(1, round(cell_m / first_m))
    # Merged cells only bound the heights between their nodes, so cells are merged only if that saves many nodes.
    fine_stride = 1 if parts > 1 or finest_m < 2.0 * cell_m else round(finest_m / cell_m)
    stride = fine_stride * max(1, round(first_m / cell_m / fine_stride))
    if parts > 1 or (stride < 3 and cells <= fitting):
        stride = fine_stride = 1
    ratio, cut = stride // fine_stride, 1
    if stride == 1:
        ratio = cut = max(1, min(MOST_FINE, round(cell_m / parts / finest_m)))
    return Cells(parts, stride, fine_stride, ratio, cut, cells * (parts / stride) ** 2)


def _first_cell_m(problem: Problem, straight_m: float) -> float:
    """Cell width for the first look, metres, from the length of the leg and the sizes of the zones."""
    least, most = straight_m / 250.0, min(straight_m / 60.0, COARSE_M)
    radii = [
        z.shape.radius_m
        if isinstance(z.shape, Circle)
        else 0.5 * min(z.bounds[2] - z.bounds[0], z.bounds[3] - z.bounds[1])
        for z in problem.airspace.zones
    ]
    return max(least, min([most, *(r / 3.0 for r in radii)]))


def fits_memory(problem: Problem, cells: Bools, beside: int, ratio: int) -> bool:
    """Whether a lattice ``ratio`` times finer over the box of ``cells``, widened by ``beside`` cells on each side, fits
    into memory."""
    row, col, last_row, last_col = box_of(cells)
    nodes = (last_row - row + 2 * beside) * (last_col - col + 2 * beside) * ratio**2
    return nodes * BOX_NODE_BYTES <= 1e6 * problem.budget.megabytes


def most_parts(problem: Problem, cells: Bools) -> int:
    """Most parts a side into which ``cells`` of one leg may be cut to be searched."""
    each = MOST_SEARCHED / (len(problem.via) + 1) / max(int(np.count_nonzero(cells)), 1)
    return max(int(math.sqrt(each)), 1)


def box_around(a: tuple[float, float], b: tuple[float, float], detour: float) -> Box:
    """The box that contains all tracks from ``a`` to ``b`` of at most ``detour`` times the straight track; infinite for
    inf."""
    if math.isinf(detour):
        return -math.inf, -math.inf, math.inf, math.inf
    (x0, y0), (x1, y1), straight_m = a, b, math.dist(a, b)
    more = max(0.5 * straight_m * math.sqrt(detour**2 - 1.0), 0.5 * (detour - 1.0) * straight_m) + 1.0
    return min(x0, x1) - more, min(y0, y1) - more, max(x0, x1) + more, max(y0, y1) + more


def needs_most(problem: Problem, box: Box) -> bool:
    """Whether a lattice over a box needs more than the part `MUCH` of the terrain model's nodes."""
    col0, row0, col1, row1 = extent(problem, box)
    return (col1 - col0) * (row1 - row0) > MUCH * problem.airspace.surface.ground_m.size


class Leg:
    """One leg of a problem, from terminal to terminal, under caps of at most ``top_m`` AMSL, the highest of bounds.

    ``farthest``: most times as long as the straight track that tracks may be for which the lattice is widened.
    """

    def __init__(self, problem: Problem, start: End, goal: End, top_m: float, farthest: float = math.inf) -> None:
        self.problem, self.start, self.goal, self.top_m, self.farthest = problem, start, goal, top_m, farthest
        self.straight_m = math.dist(start.place, goal.place)
        self.length_m = math.inf
        """A lower bound of every track's length below the highest cap; inf: it is proved that there is no track."""
        self._flown_m = 0.0
        """The same for the tracks of paths, which are longer where they fly laps to climb."""
        self.seen = False
        """Whether the leg was flooded."""
        self.reach_m = 0.0
        """Tracks shorter than this, in metres, lie within the lattice and within the flooded cells."""
        self.plane: Plane
        self._twin: tuple[Plane, Bools] | None = None
        self._detour = 0.0
        self._mesh: Mesh
        self._guide: Guide
        self._ahead: Guide | None = None
        self.last_track = np.array([start.place, goal.place])  # of flood or bound
        self._close: Nearby | None = None
        self._reached: tuple[Nearby, Reached] | None = None
        self.cells_of = choose(problem, start.place, self.straight_m, self._around(DETOURS[0]))
        self._necks = LegNecks(problem, top_m, start.place, goal.place)
        self._finer = 1
        """Parts a side into which the finer lattice's cells are cut once more; see `refine`."""

    @property
    def lower_m(self) -> float:
        """The best known lower bound of the length of every path's track, metres."""
        return max(self.length_m, self._flown_m) if self.seen else self.straight_m

    @property
    def nearby_cells(self) -> float:
        """How many cells of the finer lattice short enough tracks may meet, by the last look at them; before that, the
        number of first-look cells, because a corridor is a small part of these."""
        return self.cells_of.nodes if self._close is None else len(self._close.cell) * self.cells_of.ratio**2

    def flood(self, slack: float, within_m: float = math.inf) -> None:
        """Flood all cells that are free below the highest cap, as far as tracks lead that are longer than the shortest
        by at most ``slack`` (a part of it), and no longer than ``within_m``. Sets `length_m` and `reach_m`.

        Widens the lattice until these tracks lie within it.
        """
        self._ahead = self._close = self._reached = None
        self._finer = 1
        self.seen = True
        detours = (*(d for d in DETOURS if d < self.farthest), self.farthest)
        limited = math.isfinite(within_m)
        if limited:
            least_detour = max(within_m / self.straight_m, LEAST_DETOUR) * (1.0 + 1e-9)
            much = least_detour > DETOURS[0] and needs_most(self.problem, self._around(least_detour))
            detours = (self._detour if self._detour >= least_detour else math.inf if much else least_detour,)
        for detour in detours:
            if not limited and detour < self.farthest:
                if detour * self.straight_m < self.length_m * (1.0 + slack) < math.inf:
                    continue
                if detour != self._detour and detour > DETOURS[0] and needs_most(self.problem, self._around(detour)):
                    continue
            within = min(detour * self.straight_m if math.isfinite(detour) else math.inf, within_m)
            if detour != self._detour:
                self.cells_of = choose(self.problem, self.start.place, self.straight_m, self._around(detour))
                self.plane, self._twin = self._lattice(detour), None
                self._detour = detour
                self._mesh = mesh_of(self.plane, self.top_m, True)
            a, b = self.goal.place, self.start.place
            try:
                way, self._guide = self._mesh.flood(a, b, within, slack)
            except Exhausted as given_up:
                # The searched part is the same as a finished flood with a shorter limit.
                self.length_m = self.reach_m = given_up.seen_m * (1.0 - 1e-9)
                self._guide = _flooded(self._mesh, a, b, self.reach_m)
                return
            if way is not None:
                self.length_m, self.last_track = way.length_m, way.points
                self.reach_m = min(within, way.length_m * (1.0 + slack))
                return
            if limited:
                self.length_m = self.reach_m = within_m  # no track is shorter
                return

    def _clearance(
        self, spec: PlaneSpec, within: Corridor | None, limit_m: float, *, roughly: bool = False
    ) -> tuple[ClearanceGrid, Guide]:
        """The clearance grid, and a guide with distances to the goal: on the finer lattice ``within`` a corridor, or
        else on the first-look lattice for tracks shorter than ``limit_m``. ``roughly``: cells are `ROUGHLY` times
        larger. Raises Exhausted."""
        if within is None:
            plane, fineness, guide = self.plane, 1, self._guide
            cells = guide.reach(self.start.place, limit_m)
        else:
            plane, guide, cells = within.guide.mesh.plane, within.guide, within.cells
            fineness = self._finer
            if plane is self.plane and self.cells_of.stride == 1:
                fineness *= self.cells_of.cut
            elif (
                plane is self.plane
                and self.cells_of.has_fine
                and fits_memory(self.problem, cells, CELLS_BESIDE, self.cells_of.ratio)
            ):
                plane, cells = self._over(cells)
        if roughly:
            fineness = -(-fineness // ROUGHLY)
        fineness = min(fineness, most_parts(self.problem, cells))
        return ClearanceGrid(plane, spec, fineness, cells), guide

    def track(
        self, cap_m: float, within: Corridor | None, limit_m: float, choice: SideChoice | None = None,
        narrow: Narrow | None = None,
    ) -> GroundTrack | None:  # fmt: skip
        """The shortest track that is legal below ``cap_m`` by the mesh for paths, if it is shorter than ``limit_m`` and
        `reach_m`; None if there is none or the search is exhausted.

        ``within``: the corridor to search on the finer lattice; None: the first-look lattice. ``choice``: which zones
        may be passed below and above, and the most metres that may be added near start and goal to climb (None: all
        zones, no metres). ``narrow``: if not None, nodes are only as high as in the exact check, which may miss a
        little between nodes, and are raised where earlier tracks lacked altitude.
        """
        limit, limits = min(limit_m, self.reach_m), self.problem.limits
        under, over, spare_m = (
            (None, None, (0.0, 0.0)) if choice is None else (choice.under, choice.over, choice.most_m)
        )
        cones = self.start.cone(limits.max_climb_slope, spare_m[0])
        cones += self.goal.cone(limits.max_descent_slope, spare_m[1])
        exact_m = None if narrow is None else narrow.zones_m
        try:
            clearance, guide = self._clearance(
                PlaneSpec(cap_m, False, tuple(cones), under, over, exact_m), within, limit
            )
            for place, by in narrow.pinched if narrow else ():
                clearance.lift(place[None], np.array([by]))
            for _ in range(1 if narrow is None else LEARNT):
                way = clearance.mesh().track(self.start.place, self.goal.place, limit, guide)
                if way is None or narrow is None or not clearance.learn(way.points):
                    return way
        except Exhausted:
            pass
        return None

    def bound(
        self,
        cap_m: float,
        within: Corridor | None,
        limit_m: float,
        climbs: bool = False,
        suffices: Callable[[float], bool] = lambda _: False,
        closely: bool = False,
    ) -> float:
        """A lower bound of the length of every path's track below ``cap_m``, at most ``limit_m`` and `reach_m`.

        ``climbs``: near the ends, allow only altitudes that tracks shorter than ``limit_m`` can climb to. It is raised
        in rounds; the last is the first whose bound ``suffices``. ``closely``: where the exact check shuts the track,
        look at the cells around it (`necks`).
        """
        limit = min(limit_m, self.reach_m)
        if self.lower_m >= limit:
            return limit
        found = max(self._bound(cap_m, within, limit, climbs, suffices, closely), self.lower_m)
        if cap_m >= self.top_m:
            self._flown_m = found
        return found

    def _bound(
        self, cap_m: float, within: Corridor | None, limit: float, climbs: bool, suffices: Callable[[float], bool],
        closely: bool,
    ) -> float:  # fmt: skip
        limits, off_m = self.problem.bound_limits, self.problem.rounding_m[1]
        climb, descent = (limits.max_climb_slope, limits.max_descent_slope) if climbs else (math.inf, math.inf)
        # Not `lower_m`, which counts laps: near the ends, a path that flew laps has climbed for as many metres.
        known = self.length_m
        try:
            clearance, guide = self._clearance(
                PlaneSpec(cap_m, True), within, limit, roughly=limit > MUCH_LONGER * known
            )
        except Exhausted:
            return known
        for k in range(RAISED):
            spare = max(limit - known, 0.0)
            cones = self.start.cone(climb, spare, off_m) + self.goal.cone(descent, spare, off_m)
            if k == 0:
                clearance.hold(cones)
            elif not clearance.obstructs(cones, self.last_track):
                break  # that track is still the shortest
            try:
                way = self._necks.track(clearance, limit, guide, closely)
            except Exhausted as given_up:
                return max(known, min(limit, given_up.seen_m))
            if way is None:
                return limit
            self.last_track = way.points
            # The cones raised walls, tracks got longer, and less length is left to climb with: tighten the cones again.
            enough = not cones or way.length_m < known + WORTHWHILE * spare or not self.problem.budget.goes_on()
            known = max(known, way.length_m)
            if enough or suffices(known):
                break
        return known

    def refine(self, limit_m: float, parts: int, cut: int) -> bool:
        """Compute the corridor of tracks shorter than ``limit_m`` again, with each cell of the finer lattice as a piece
        of its own; if they are few, with each cell cut into ``cut`` parts a side.

        Afterwards `reach_m` is at most ``limit_m``, and `track` and `bound` cut the finer lattice's cells into
        ``parts`` a side. Returns False and changes nothing if that takes too many nodes, or was done before.
        """
        limit = min(limit_m, self.reach_m)
        close = self._closer(limit)
        if close.left is self._guide or self._finer > 1:
            return False
        chosen = close.away.between(close.left, limit)
        row, col, last_row, last_col = box_of(chosen)
        most = MOST_NODES if self.problem.airspace.surface.ground_m.size < LARGE else MOST_BESIDE
        if (last_row - row) * (last_col - col) * (self.cells_of.ratio * parts) ** 2 > most:
            return False
        if not fits_memory(self.problem, chosen, 0, self.cells_of.ratio * parts):
            return False
        if self.cells_of.fine_stride > 1 or np.count_nonzero(chosen) * self.cells_of.ratio**2 > MOST_ALONE:
            cut = 1
        finer = cut * (self.cells_of.parts * self.cells_of.cut if self.cells_of.stride == 1 else self.cells_of.parts)
        # The nodes of the two lattices may differ in place by `LOOSE.bent_m`.
        more = limit + 2.0 * LOOSE.bent_m
        found = self._each_cell(
            *finer_plane(self.plane, chosen, finer, self.cells_of.fine_stride, CLOSE), more, close.away
        )
        if found is None:
            return False
        self._close, self.reach_m, self._finer = found, limit, parts // cut
        return True

    def corridor(self, limit_m: float) -> Corridor:
        """The corridor of tracks shorter than ``limit_m`` and `reach_m`."""
        limit = min(limit_m, self.reach_m)
        close = self._closer(limit)
        return Corridor(close.away.between(close.left, limit), close.left)

    def cells(self, limit_m: float) -> tuple[Floats, Floats, Floats, Floats]:
        """(K,) each, for the cells that tracks shorter than ``limit_m`` may meet (or more cells): the lowest and the
        highest altitude that can be flown at, and least metres from the start to the cell and from there to the goal.
        One cell without any limits if ``limit_m`` is beyond `reach_m`."""
        if limit_m > self.reach_m * (1.0 + 1e-6):  # a longer track may meet cells that were not flooded
            return np.full(1, -math.inf), np.full(1, math.inf), np.zeros(1), np.zeros(1)
        close = self._closer(min(limit_m, self.reach_m))
        of: Nearby | AltitudeIntervals = close
        if self._reached is not None and self._reached[0] is close and limit_m <= close.limit_m:
            of = self._reached[1].known(limit_m)
        near = close.away.cells_between(close.left, limit_m)[of.cell]
        return of.low_m[near], of.high_m[near], of.away_m[near], of.left_m[near]

    def intervals(self, limit_m: float) -> AltitudeIntervals:
        """The altitude intervals that tracks shorter than ``limit_m`` and `reach_m` may enter within the climb and
        descent limits."""
        limit = min(limit_m, self.reach_m)
        close = self._closer(limit)
        if self._reached is None or self._reached[0] is not close:
            mesh, a, b, off_m = close.left.mesh, self.start, self.goal, self.problem.rounding_m[1]
            count, low, high = intervals(mesh, close.cell, close.low_m, close.high_m, INTERVAL_SPARE_M)
            k, nth = np.nonzero(np.arange(MOST_INTERVALS) < count[:, None])
            every = AltitudeIntervals(
                (mesh.excess.shape[0] - 1, mesh.excess.shape[1] - 1),
                close.cell[k],
                low[k, nth],
                high[k, nth],
                close.away_m[k],
                close.left_m[k],
                np.column_stack([close.away_m[k], close.away_most_m[k]]),
                np.column_stack([close.left_m[k], close.left_most_m[k]]),
                Terminal(mesh.cells_at(a.place), a.amsl_m, off_m),
                Terminal(mesh.cells_at(b.place), b.amsl_m, off_m),
            )
            self._reached = close, Reached(every, self.problem.bound_limits, close.limit_m)
        found = self._reached[1].within(limit, close.away.cells_between(close.left, limit))
        self.problem.budget.spend("interval", self._reached[1].looked_at)
        return found

    def _closer(self, limit_m: float) -> Nearby:
        """Distances and altitudes cell by cell, for tracks shorter than ``limit_m``; by whole mesh pieces if that is
        too much work."""
        if self._close is None or limit_m > self._close.limit_m:
            away, left = self._from_start(), self._guide
            found = self._each_cell(self.plane, away.between(left, limit_m), limit_m, away)
            if found is None:  # every cell of a piece is as near as the piece's entrance, or as the straight line
                mesh, cell = left.mesh, np.flatnonzero(away.cells_between(left, limit_m))
                ends = (away, self.start), (left, self.goal)
                away_m, left_m = (np.maximum(of.least(cell), mesh.straight_to(end.place, cell)) for of, end in ends)
                unknown = np.full(len(cell), math.inf)
                free = ranges(mesh, self.top_m, cell)
                found = Nearby(limit_m, away, left, cell, *free, away_m, left_m, unknown, unknown)
            self._close = found
        return self._close

    def _each_cell(self, plane: Plane, chosen: Bools, limit_m: float, ahead: Guide) -> Nearby | None:
        """Flood the ``chosen`` cells of a lattice, each as a piece of its own; None if the work exceeds its limit.
        ``ahead``: distances from the start over a mesh that has at least the same free cells."""
        a, b = self.start.place, self.goal.place
        try:
            mesh = mesh_of(plane, self.top_m, True, 1, chosen, single=True)
            left = mesh.flood(b, a, limit_m, math.inf, ahead)[1]
            away = mesh.flood(a, b, limit_m, math.inf, left)[1]
        except Exhausted:
            return None
        cell = np.flatnonzero(away.cells_between(left, limit_m))
        ways = away.least(cell), left.least(cell), away.most(cell), left.most(cell)
        return Nearby(limit_m, away, left, cell, *ranges(mesh, self.top_m, cell), *ways)

    def _over(self, cells: Bools) -> tuple[Plane, Bools]:
        """The finer lattice over ``cells`` of the first-look lattice, or over more, and which of its cells they are."""
        if self._twin is None or (cells & ~self._twin[1]).any():
            row, col, last_row, last_col = box_of(cells)
            wide = np.zeros(cells.shape, np.bool_)
            wide[
                max(row - CELLS_BESIDE, 0) : last_row + CELLS_BESIDE,
                max(col - CELLS_BESIDE, 0) : last_col + CELLS_BESIDE,
            ] = True
            self._twin = finer_plane(self.plane, wide, self.cells_of.parts, self.cells_of.fine_stride, LOOSE)[0], wide
        plane = self._twin[0]
        return plane, on_finer(self.plane, cells, plane)

    def _from_start(self) -> Guide:
        """Distances from the start over the coarse mesh, as far as the flood from the goal went."""
        if self._ahead is None:
            self._ahead = _flooded(self._guide.mesh, self.start.place, self.goal.place, self.reach_m, self._guide)
        return self._ahead

    def _around(self, detour: float) -> Box:
        """The box that contains all tracks of at most ``detour`` times the straight track."""
        return box_around(self.start.place, self.goal.place, detour)

    def _lattice(self, detour: float) -> Plane:
        """The first-look lattice for tracks of ``detour`` times the straight track."""
        reach = None
        if math.isfinite(detour):
            a, b = self.start.place, self.goal.place
            cell = self.cells_of.stride * float(self.problem.airspace.surface.grid.metres_per_cell(*a).max())
            reach = a, b, detour * self.straight_m + 4.0 * cell
        parts, stride = self.cells_of.parts, self.cells_of.stride
        return make_plane(self.problem, self._around(detour), parts, stride, stride, reach)


def _flooded(mesh: Mesh, start: GroundPlace, goal: GroundPlace, limit_m: float, ahead: Guide | None = None) -> Guide:
    """Distances from ``start`` over a mesh, for tracks to ``goal`` shorter than ``limit_m``; zeros, which are bounds as
    well, if the budget leaves too little to find them."""
    try:
        return mesh.flood(start, goal, limit_m, math.inf, ahead)[1]
    except Exhausted:
        return Guide(mesh, start, np.zeros(len(mesh.joins)), np.zeros(mesh.pieces))
