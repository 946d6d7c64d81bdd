"""The plane between two terminals: shortest tracks below an altitude cap, and how long any track must be at least.

The lattice is cut to an ellipse of detours around the terminals, and widened when that is not enough. A flood from the
far terminal, over all that may be free below the highest cap, tells every later search how far it still is: lower caps
and finer lattices only leave less room. So the fine lattices, too, need to be looked at only along the few tracks that
may be short enough.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.bounds.altitude_intervals import MOST, SPARE_M, AltitudeIntervals, Reached, Terminal
from gcsplan.planners.optimal.cells import choose, fits_memory
from gcsplan.planners.optimal.corridor import Corridor, End, Nearby, Spare
from gcsplan.planners.optimal.navmesh.clearance import ClearanceGrid, Cone, mesh_of
from gcsplan.planners.optimal.navmesh.free_altitudes import intervals, ranges
from gcsplan.planners.optimal.navmesh.grid import Box, Plane, box_of, extent, finer_plane, make_plane, on_finer
from gcsplan.planners.optimal.navmesh.mesh import Guide, Mesh
from gcsplan.planners.optimal.navmesh.portals import Exhausted, GroundTrack
from gcsplan.planners.optimal.navmesh.zone_shapes import CLOSE, LOOSE
from gcsplan.planners.problem import Problem

DETOURS, LEAST_DETOUR = (1.25, 2.5, math.inf), 1.02
"""How long tracks may be, in times the straight way, before the lattice must be widened; and how long they may be in
the narrowest one."""
MUCH = 0.5
"""What part of the terrain model is so much that all of it may be looked at as well."""
MOST_NODES, MOST_BESIDE, LARGE = 16e6, 6e6, 4e6
"""Nodes of the finest lattice, at most, in the box around a corridor: so many, and fewer beside a terrain model of more
nodes than that, to need no more than half a gigabyte besides."""
MOST_ALONE = 50_000
"""Cells of the finer lattice that may be looked at each alone in four parts."""
LEARNT = 10
"""Times that a track is looked for where nodes alone are as high as the exact check has them."""
BESIDE = 8
"""How many cells more the finer lattice is over than those that are asked for: later tracks may lie beside them."""
MUCH_LONGER, ROUGHLY = 1.1, 3
"""Where tracks may be so many times as long as is known, cells for their bound are so many times larger."""
RAISED, WORTHWHILE = 4, 0.05
"""Times that walls are raised near the ends, and by what part of the way to spare it must have helped to go on."""


Lacking = tuple[Floats, float]
"""A place (2,) at which a track lacked so many metres of height."""


class Leg:
    """One leg of a problem, from terminal to terminal, under caps of at most ``top_m``."""

    def __init__(self, problem: Problem, start: End, goal: End, top_m: float) -> None:
        self.problem, self.start, self.goal, self.top_m = problem, start, goal, top_m
        self.straight_m = math.dist(start.place, goal.place)
        self.length_m = math.inf
        """A lower bound of every track's length below the highest cap; inf: there is none, proved."""
        self.seen = False
        """Whether the leg was flooded."""
        self.reach_m = 0.0
        """Tracks shorter than this lie within the lattice, and within what the flood has seen."""
        self.farthest = math.inf
        """No ways are looked for that may be more times as long as the straight one."""
        self.plane: Plane
        self._twin: tuple[Plane, Bools] | None = None
        self._detour = 0.0
        self._mesh: Mesh
        self._guide: Guide
        self._ahead: Guide | None = None
        self.last_track = np.array([start.place, goal.place])  # of flood or bound
        self._close: Nearby | None = None
        self._reached: tuple[Nearby, Reached] | None = None
        self.cells_of = choose(problem, start.place, self.straight_m, self._box(DETOURS[0]))
        self.closer = 1
        """Into how many parts a side the finer lattice's cells are cut once more, see `refine`."""

    @property
    def lower_m(self) -> float:
        """No track is shorter, as far as is known."""
        return self.length_m if self.seen else self.straight_m

    def flood(self, slack: float, within_m: float = math.inf) -> None:
        """Look at all that is free below the highest cap, as far as tracks ``slack`` longer than the shortest lead, and
        no farther than tracks of ``within_m``.

        Widens the lattice until that track lies within it.
        """
        self._ahead = self._close = self._reached = None
        self.closer = 1
        self.seen = True
        detours: tuple[float, ...] = DETOURS
        limited = math.isfinite(within_m)
        if limited:
            asked = max(within_m / self.straight_m, LEAST_DETOUR) * (1.0 + 1e-9)
            much = asked > DETOURS[0] and self._is_most(asked)
            detours = (self._detour if self._detour >= asked else math.inf if much else asked,)
        for detour in detours:
            if detour > self.farthest:
                break
            if not limited and math.isfinite(detour):
                if detour * self.straight_m < self.length_m * (1.0 + slack) < math.inf:
                    continue
                if detour != self._detour and detour > DETOURS[0] and self._is_most(detour):
                    continue
            within = min(detour * self.straight_m if math.isfinite(detour) else math.inf, within_m)
            if detour != self._detour:
                self.cells_of = choose(self.problem, self.start.place, self.straight_m, self._box(detour))
                self.plane, self._twin = self._lattice(detour), None
                self._detour = detour
                self._mesh = mesh_of(self.plane, self.top_m, True)
            a, b = self.goal.place, self.start.place
            try:
                way, self._guide = self._mesh.flood(a, b, within, slack)
            except Exhausted as given_up:
                # What was seen is as good as a flood that was asked to go no farther.
                self.length_m = self.reach_m = given_up.seen_m * (1.0 - 1e-9)
                self._guide = self._mesh.flood(a, b, self.reach_m, slack)[1]
                return
            if way is not None:
                self.length_m, self.last_track = way.length_m, way.points
                self.reach_m = min(within, way.length_m * (1.0 + slack))
                return
            if limited:
                self.length_m = self.reach_m = within_m  # no track is shorter
                return

    def _clearance(
        self,
        cap_m: float,
        low: bool,
        within: Corridor | None,
        limit_m: float,
        ends: list[Cone] | None = None,
        under: Bools | None = None,
        over: Bools | None = None,
        exact: bool = False,
        roughly: bool = False,
    ) -> tuple[ClearanceGrid, Guide]:
        """What to make a mesh of, finer ``within`` a corridor, or else the first look's for tracks shorter than
        ``limit_m``; and how far the goal is."""
        if within is None:
            plane, fineness, guide = self.plane, 1, self._guide
            cells = guide.reach(self.start.place, limit_m)
        else:
            plane, guide, cells = within.guide.mesh.plane, within.guide, within.cells
            fineness = self.closer
            if plane is self.plane and self.cells_of.stride == 1:
                fineness *= self.cells_of.cut
            elif (
                plane is self.plane
                and self.cells_of.has_fine
                and fits_memory(self.problem, cells, BESIDE, self.cells_of.ratio)
            ):
                plane, cells = self._over(cells)
        if roughly:
            fineness = -(-fineness // ROUGHLY)
        return ClearanceGrid(plane, cap_m, low, fineness, cells, ends, under, over, exact=exact), guide

    def track(
        self,
        cap_m: float,
        within: Corridor | None,
        limit_m: float,
        under: Bools | None,
        spare_m: Spare = (0.0, 0.0),
        over: Bools | None = None,
        shut: Sequence[Lacking] | None = None,
    ) -> GroundTrack | None:
        """The shortest track of which the mesh for paths holds that it is legal below ``cap_m``, if it is shorter than
        ``limit_m``, and than `reach_m`.

        ``within``: on the finer lattice there; else on that of the first look. ``spare_m``: metres that may be added
        near start and goal to climb. ``under``, ``over`` (zones,): which zones may be passed so; None for all.
        ``shut``: nodes are as high as the exact check has them, though what is between them may be shut by a little,
        and higher where tracks lacked height before.
        """
        limit, limits = min(limit_m, self.reach_m), self.problem.limits
        cones = self._cones(limits.max_climb_slope, limits.max_descent_slope, *spare_m)
        try:
            clearance, guide = self._clearance(cap_m, False, within, limit, cones, under, over, shut is not None)
            for place, by in shut or ():
                clearance.lift(place[None], np.array([by]))
            for _ in range(1 if shut is None else LEARNT):
                way = clearance.mesh().track(self.start.place, self.goal.place, limit, guide)
                if way is None or shut is None or not clearance.learn(way.points):
                    return way
        except Exhausted:
            pass
        return None

    def bound(self, cap_m: float, within: Corridor | None, limit_m: float, climbs: bool = False) -> float:
        """A lower bound of every track's length below ``cap_m``; ``limit_m``, or `reach_m`, if it is more.

        ``climbs``: near the ends hold tracks to what they can climb to, if they are shorter than ``limit_m``.
        """
        limit, limits = min(limit_m, self.reach_m), self.problem.limits
        known = self.length_m
        try:
            clearance, guide = self._clearance(cap_m, True, within, limit, roughly=limit > MUCH_LONGER * known)
        except Exhausted:
            return known
        for _ in range(RAISED):
            spare = max(limit - known, 0.0)
            cones = self._cones(limits.max_climb_slope, limits.max_descent_slope, spare, spare) if climbs else []
            clearance.hold(cones)
            try:
                way = clearance.mesh().track(self.start.place, self.goal.place, limit, guide)
            except Exhausted as given_up:
                return max(known, min(limit, given_up.seen_m))
            if way is None:
                return limit
            self.last_track = way.points
            # Ways are longer between the walls that the cones raised, so there is less to spare for a climb: again.
            enough = not cones or way.length_m < known + WORTHWHILE * spare or not self.problem.budget.goes_on()
            known = max(known, way.length_m)
            if enough:
                break
        return known

    def refine(self, limit_m: float, parts: int, cut: int) -> bool:
        """Look anew, at each cell of the finer lattice alone, at what tracks shorter than ``limit_m`` may meet; where
        they are few, at each of their ``cut`` parts a side.

        No longer ones are known after that. `track` and `bound` cut the cells of such corridors into ``parts`` a side.
        False, and nothing is done, where that would be too many.
        """
        limit = min(limit_m, self.reach_m)
        close = self._closer(limit)
        if close.left is self._guide or self.closer > 1:
            return False
        wanted = close.away.between(close.left, limit)
        row, col, last_row, last_col = box_of(wanted)
        most = MOST_NODES if self.problem.airspace.surface.ground_m.size < LARGE else MOST_BESIDE
        if (last_row - row) * (last_col - col) * (self.cells_of.ratio * parts) ** 2 > most:
            return False
        if not fits_memory(self.problem, wanted, 0, self.cells_of.ratio * parts):
            return False
        if self.cells_of.fine_stride > 1 or np.count_nonzero(wanted) * self.cells_of.ratio**2 > MOST_ALONE:
            cut = 1
        finer = cut * (self.cells_of.parts * self.cells_of.cut if self.cells_of.stride == 1 else self.cells_of.parts)
        # Nodes lie elsewhere by as much as the other lattice is bent.
        more = limit + 2.0 * LOOSE.bent_m
        found = self._each_cell(
            *finer_plane(self.plane, wanted, finer, self.cells_of.fine_stride, CLOSE), more, close.away
        )
        if found is None:
            return False
        self._close, self.reach_m, self.closer = found, limit, parts // cut
        return True

    def corridor(self, limit_m: float) -> Corridor:
        """What tracks shorter than ``limit_m``, and than `reach_m`, may meet."""
        limit = min(limit_m, self.reach_m)
        close = self._closer(limit)
        return Corridor(close.away.between(close.left, limit), close.left)

    def cells(self, limit_m: float) -> tuple[Floats, Floats, Floats, Floats]:
        """Of the cells that tracks shorter than ``limit_m`` may meet (and more): the lowest and the highest altitude
        that can be flown at, ways there and on."""
        if limit_m > self.reach_m * (1.0 + 1e-6):  # a longer track may meet cells that the flood did not
            return np.full(1, -math.inf), np.full(1, math.inf), np.zeros(1), np.zeros(1)  # of those nothing is known
        close = self._closer(min(limit_m, self.reach_m))
        near = self._near(close, limit_m)
        if self._reached is not None and self._reached[0] is close and limit_m <= close.limit_m:
            of = self._reached[1].known(limit_m, near)
            return of.low_m, of.high_m, of.away_m, of.left_m
        return close.low_m[near], close.high_m[near], close.away_m[near], close.left_m[near]

    def intervals(self, limit_m: float) -> AltitudeIntervals:
        """Those that tracks shorter than ``limit_m``, and than `reach_m`, may enter by what they climb and descend."""
        limit = min(limit_m, self.reach_m)
        close = self._closer(limit)
        if self._reached is None or self._reached[0] is not close:
            mesh, a, b = close.left.mesh, self.start, self.goal
            near = self._near(close, close.limit_m)
            count, low, high = intervals(mesh, close.low_m, close.high_m, MOST, SPARE_M)
            cell, nth = np.nonzero((np.arange(MOST) < count[:, None]) & near[:, None])
            every = AltitudeIntervals(
                (mesh.excess.shape[0] - 1, mesh.excess.shape[1] - 1),
                cell,
                low[cell, nth],
                high[cell, nth],
                close.away_m[cell],
                close.left_m[cell],
                mesh.middles_from(a.place)[cell],
                mesh.middles_from(b.place)[cell],
                mesh.half_m(),
                Terminal(mesh.cells_at(a.place), a.amsl_m),
                Terminal(mesh.cells_at(b.place), b.amsl_m),
            )
            self._reached = close, Reached(every, self.problem.limits, close.limit_m)
        return self._reached[1].within(limit, self._near(close, limit))

    def _near(self, close: Nearby, limit_m: float) -> Bools:
        """(cells,) what tracks no longer than ``limit_m`` may meet."""
        return close.left.mesh.of_plane(close.away.between(close.left, limit_m)).ravel()

    def _closer(self, limit_m: float) -> Nearby:
        """A look at each cell alone, for tracks shorter than ``limit_m``; at whole pieces where that is too much."""
        if self._close is None or limit_m > self._close.limit_m:
            away, left = self._from_start(), self._guide
            found = self._each_cell(self.plane, away.between(left, limit_m), limit_m, away)
            if found is None:  # pieces are as near as their entrances
                mesh = left.mesh
                ends = (away, self.start), (left, self.goal)
                ways = (np.maximum(guide.cells(), mesh.straight_to(end.place)) for guide, end in ends)
                found = Nearby(limit_m, away, left, *ranges(mesh, self.top_m), *ways)
            self._close = found
        return self._close

    def _each_cell(self, plane: Plane, wanted: Bools, limit_m: float, ahead: Guide) -> Nearby | None:
        """Each of the ``wanted`` cells of a lattice alone; None where that is too much to look at. ``ahead``: from the
        start, over a mesh that leaves no less room."""
        mesh = mesh_of(plane, self.top_m, True, 1, wanted, single=True)
        a, b = self.start.place, self.goal.place
        try:
            left = mesh.flood(b, a, limit_m, math.inf, ahead)[1]
            away = mesh.flood(a, b, limit_m, math.inf, left)[1]
        except Exhausted:
            return None
        return Nearby(limit_m, away, left, *ranges(mesh, self.top_m), away.cells(), left.cells())

    def _over(self, cells: Bools) -> tuple[Plane, Bools]:
        """The finer lattice over some cells, and perhaps more, and which of its cells these are."""
        if self._twin is None or (cells & ~self._twin[1]).any():
            row, col, last_row, last_col = box_of(cells)
            wide = np.zeros(cells.shape, np.bool_)
            wide[max(row - BESIDE, 0) : last_row + BESIDE, max(col - BESIDE, 0) : last_col + BESIDE] = True
            self._twin = finer_plane(self.plane, wide, self.cells_of.parts, self.cells_of.fine_stride, LOOSE)[0], wide
        plane = self._twin[0]
        return plane, on_finer(self.plane, cells, plane)

    def _from_start(self) -> Guide:
        """Distances from the start over the coarse mesh, as far as the flood from the goal has seen."""
        if self._ahead is None:
            mesh = self._guide.mesh
            try:
                _, self._ahead = mesh.flood(self.start.place, self.goal.place, self.reach_m, math.inf, self._guide)
            except Exhausted:
                self._ahead = Guide(mesh, self.start.place, np.zeros(len(mesh.joins)), np.zeros(len(mesh.start) - 1))
        return self._ahead

    def _cones(self, climb: float, descent: float, at_start_m: float, at_goal_m: float) -> list[Cone]:
        """Height and slope of what can be reached near the ends, by paths with so many metres to spare there."""
        ends = ((self.start, climb, at_start_m), (self.goal, descent, at_goal_m))
        return [
            (end.east_m, end.north_m, end.amsl_m + slope * spare_m, slope)
            for end, slope, spare_m in ends
            if end.amsl_m is not None and math.isfinite(slope)
        ]

    def _lattice(self, detour: float) -> Plane:
        reach = None
        if math.isfinite(detour):
            a, b = self.start.place, self.goal.place
            cell = self.cells_of.stride * float(self.problem.airspace.surface.grid.metres_per_cell(*a).max())
            reach = a, b, detour * self.straight_m + 4.0 * cell
        return make_plane(
            self.problem, self._box(detour), self.cells_of.parts, self.cells_of.stride, self.cells_of.stride, reach
        )

    def _box(self, detour: float) -> Box:
        """What tracks may meet that are so many times as long as the straight way."""
        if math.isinf(detour):
            return -math.inf, -math.inf, math.inf, math.inf
        (x0, y0), (x1, y1), d = self.start.place, self.goal.place, self.straight_m
        more = max(0.5 * d * math.sqrt(detour**2 - 1.0), 0.5 * (detour - 1.0) * d) + 1.0
        return min(x0, x1) - more, min(y0, y1) - more, max(x0, x1) + more, max(y0, y1) + more

    def _is_most(self, detour: float) -> bool:
        """Whether a lattice for such tracks is so large that one might as well look at everything."""
        col0, row0, col1, row1 = extent(self.problem, self._box(detour))
        return (col1 - col0) * (row1 - row0) > MUCH * self.problem.airspace.surface.ground_m.size
