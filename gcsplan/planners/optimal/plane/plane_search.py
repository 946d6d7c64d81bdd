"""Tracks over the lattices of a problem's legs, and the lower bounds that follow from them; see `planner`.

Level ground is cut into cells first: a terrain model of two by two nodes is a single cell, too coarse for a lattice.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from gcsplan.planners.optimal.plane.corridor import End, Narrow, PinnedTrack, SideChoice, joined
from gcsplan.planners.optimal.plane.detour_search import DetourSearch
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.plane.leg import Leg
from gcsplan.planners.problem import Problem, terminals_of
from gcsplan.planners.profile.exact import Unsettled
from gcsplan.planners.profile.track import Flown, fly, make_track
from gcsplan.planners.profile.zone_levels import may_pass
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.path import track_length_m
from gcsplan.world.geometry.surface import GridMap, Surface

FEW_NODES = 64
"""A level terrain model of at most this many nodes is replaced."""
LEVEL_NODES = 65
"""Nodes along each side of the terrain model that replaces it."""
MARGIN = 0.02
"""Part by which the new model extends beyond the places that paths can reach."""


SLACKS = (0.008, 0.15, 0.6)
"""While no path is known, tracks longer than the shortest by these parts of it are searched, in turn."""
ZONES_SHUT = 8
"""Most tracks that are tried below a cap if a zone can be passed neither over nor under on the first."""
PROVED = 1e-8
"""A gap, as a part, that is smaller is due to rounding: the best path is proved optimal."""
NODE_S, NODE_MB = 0.8e-6, 3e-4
"""Counted seconds and megabytes of a searched node, with its kept data."""
SMALL = 50.0
"""A world is small if the straight line of each leg is at most this many cells of the terrain model long."""


def in_window(incumbent: Incumbent) -> Problem:
    """The incumbent's problem with its level ground cut into cells, over the area that a better path could reach; the
    unchanged problem if its terrain model is not level or has many nodes."""
    problem = incumbent.problem
    surface = problem.airspace.surface
    ground, top = surface.ground_m, surface.top_m
    if ground.size > FEW_NODES or surface.level_m is None:
        return problem
    rows, cols = ground.shape
    corners = surface.grid.to_plane([0.0, cols - 1.0], [rows - 1.0, 0.0])
    low, high = corners.min(axis=0), corners.max(axis=0)
    length_m = incumbent.longest(math.inf)
    if math.isfinite(length_m):
        places = np.array(terminals_of(problem))
        straight = track_length_m(places)
        # No place of a track of that length is farther outside the terminals' box.
        reach = 0.5 * (length_m - straight) * (1.0 + MARGIN) + 0.5 * straight * MARGIN
        reach = max(reach, 0.5 * math.sqrt(max(length_m**2 - straight**2, 0.0)) * (1.0 + MARGIN)) + 1.0
        low, high = np.maximum(low, places.min(axis=0) - reach), np.minimum(high, places.max(axis=0) + reach)
    step = (high - low) / (LEVEL_NODES - 1)
    grid = GridMap.affine(float(low[0]), float(high[1]), float(step[0]), float(step[1]))
    heights = np.full((LEVEL_NODES, LEVEL_NODES), float(ground[0, 0]))
    tops = heights if top is ground else np.full((LEVEL_NODES, LEVEL_NODES), float(top[0, 0]))
    air = Airspace(
        Surface(heights, tops, grid, dict(surface.info)), problem.airspace.zones, scale=problem.airspace.scale
    )
    return replace(problem, airspace=air)


class PlaneSearch:
    """The legs of one problem in the plane; paths and bounds go to the incumbent.

    ``problem``: the incumbent's own (None), or the same problem over other cells; ``farthest``: see `Leg`.
    """

    def __init__(self, incumbent: Incumbent, problem: Problem | None = None, farthest: float = math.inf) -> None:
        self.incumbent = incumbent
        self.problem = problem = incumbent.problem if problem is None else problem
        most_m = above_all(problem)
        paths_m, bounds_m = (
            most_m if limits.max_amsl_m is None else limits.max_amsl_m - limits.altitude_error_m
            for limits in (problem.limits, problem.bound_limits)
        )
        self.top_m = incumbent.highest(bounds_m)
        """Highest altitude AMSL that bounds assume: the ceiling, or the height that better paths can reach."""
        self.path_top_m = min(self.top_m, paths_m)
        """Highest altitude AMSL of the paths that are searched."""
        places = terminals_of(problem)
        heights = [problem.start[2], *(v.amsl_m for v in problem.via), problem.goal[2]]
        ends = [End(*place, z) for place, z in zip(places, heights, strict=True)]
        apart = [(a, b) for a, b in pairwise(ends) if math.dist(a.place, b.place) > 1e-3]
        self.legs = [Leg(problem, a, b, self.top_m, farthest) for a, b in apart]
        zones = len(problem.airspace.zones)
        self._open = SideChoice(np.ones(zones, np.bool_), np.ones(zones, np.bool_))
        self.choice = self._open
        """The choice of open zone sides with which the last path past obstacles was found."""

    def terminals(
        self, choice: SideChoice, cap_m: float, fine: bool, narrow: Narrow | None = None
    ) -> PinnedTrack | None:
        """The shortest track below a cap with a choice of zone sides, through all terminals; None if a leg has none.

        ``fine``: on the finer lattice; ``narrow``: see `Leg.track`.
        """
        ways = []
        for leg in self.legs:
            if not self.incumbent.budget.goes_on():
                return None
            limit = self.limit(leg)
            corridor = leg.corridor(limit) if fine and leg.cells_of.has_fine else None
            way = leg.track(cap_m - choice.lower_m, corridor, limit, choice, narrow)
            if way is None:
                return None
            ways.append(way.points)
        return joined(ways, [leg.goal.amsl_m for leg in self.legs[:-1]])

    # -------------------------------------------------------------------- paths

    def flood(self, slack: float) -> bool:
        """Flood all legs, for tracks longer than the shortest by at most the part ``slack``. Returns False if it is
        proved that a leg has no track."""
        for leg in self.legs:
            leg.flood(slack)
            if math.isinf(leg.length_m):
                self._prove_nothing_better()
                return False
        return True

    def _prove_nothing_better(self) -> None:
        """Note that there is no better path, or no path at all."""
        if self.incumbent.best is None:
            self.incumbent.prove_infeasible()
        else:
            self.incumbent.raise_bound(math.inf)

    def reach_longest(self) -> bool:
        """Flood the legs as far as tracks lead that are no longer than the best path, if there is one. Returns False if
        that proves it optimal, if there is no path and that is proved, or if better tracks have any length."""
        incumbent = self.incumbent
        if math.isinf(incumbent.longest(math.inf)):  # no path is known, or a level metre costs nothing
            return incumbent.best is None and (all(leg.seen for leg in self.legs) or self.flood(SLACKS[-1]))
        for leg in self.legs:
            limit = self.limit(leg)
            if not leg.seen:
                leg.flood(SLACKS[0], limit)
                self.raise_tracks()
                limit = self.limit(leg)
            if limit > leg.reach_m:
                leg.flood((limit / leg.length_m - 1.0) * (1.0 + 1e-9), limit)
        return incumbent.gap > PROVED

    def try_below(self, cap_m: float, *, fine: bool) -> bool:
        """Look for a path below a cap; return whether it is the best so far."""
        return self.look_below(cap_m, fine=fine)[0]

    def look_below(self, cap_m: float, *, fine: bool, narrow: Narrow | None = None) -> tuple[bool, Unsettled | None]:
        """`try_below`, and why no path leads over the track, if that is known. ``narrow``: see `Leg.track`."""
        incumbent = self.incumbent
        terminals = self.terminals(self.choice, cap_m, fine, narrow)
        if terminals is None:
            return False, None
        track = make_track(incumbent.problem, *terminals)
        flown = fly(incumbent.problem, track)
        why = None
        if isinstance(flown, Flown) or narrow is not None or may_pass(incumbent.problem, track, flown):
            found = incumbent.exact(track, flown)
            if not isinstance(found, Unsettled):
                return incumbent.take_simpler(*found, fine=fine, longer=False), None
            why = found
        past = not isinstance(flown, Flown) and (flown.kind == "zone" or incumbent.best is None)
        return past and self.past(ZONES_SHUT, fine=fine, cap_m=cap_m, given=terminals), why

    def past(
        self,
        most: int,
        *,
        fine: bool,
        first: bool = False,
        cap_m: float | None = None,
        given: PinnedTrack | None = None,
    ) -> bool:
        """Try at most ``most`` tracks past obstacles; return whether a path over one of them is the best so far.

        With ``cap_m``: search below that cap, begin with the track ``given`` if there is one, stop at the first better
        path, and use no laps if a path is known. Without: spare metres for laps near the ends are allowed, and the
        search stops at the first better path only if ``first``.
        """
        incumbent = self.incumbent
        laps = incumbent.climbs and (incumbent.best is None or (incumbent.sharp and cap_m is None))
        spare_m = self.longest() - sum(leg.length_m for leg in self.legs) if laps else 0.0
        below_m = self.path_top_m if cap_m is None else cap_m
        search = DetourSearch(incumbent, lambda choice: self.terminals(choice, below_m, fine), fine)
        roots = [self.choice]
        if cap_m is None:
            roots = [replace(c, most_m=(spare_m, spare_m)) for c in dict.fromkeys([self._open, self.choice])]
            if laps:
                roots.append(self.choice)  # a climb far from the ends needs laps there, not near the ends
        found = search.run(roots, most, first=first or cap_m is not None, laps=laps, given=given)
        if found is not None:
            self.choice = replace(found, least_m=(0.0, 0.0), most_m=(0.0, 0.0))
        return found is not None

    # -------------------------------------------------------------------- bounds

    def size(self, looks: float) -> tuple[float, float]:
        """Counted seconds of ``looks`` searches over the lattices of all legs, and megabytes of the lattices."""
        nodes = sum(leg.cells_of.nodes for leg in self.legs)
        return looks * nodes * NODE_S, nodes * NODE_MB

    def size_nearby(self, cell_s: float) -> tuple[float, float]:
        """As `size`, of a search over the cells of the finer lattices that short enough tracks may meet: ``cell_s``
        counted seconds for each."""
        return sum(leg.nearby_cells for leg in self.legs) * cell_s, self.size(1.0)[1]

    def longest(self) -> float:
        """An upper bound, metres, of the track length of every path better than the best."""
        return self.incumbent.longest(sum(leg.reach_m for leg in self.legs))

    def limit(self, leg: Leg) -> float:
        """`longest` for one leg: the length that remains if the other legs are as short as possible."""
        return self.longest() - sum(other.lower_m for other in self.legs if other is not leg)

    def raise_tracks(self) -> None:
        """Raise the lower bound of the cost to the cost of the shortest tracks."""
        self.incumbent.raise_track_bound(sum(leg.lower_m for leg in self.legs))

    @property
    def is_small(self) -> bool:
        """Whether every leg is so short (`SMALL`) that a search among few places costs little."""
        cell_m = float(self.problem.airspace.surface.grid.metres_per_cell(*self.problem.start[:2]).max())
        short = [leg for leg in self.legs if leg.straight_m <= SMALL * cell_m]
        return len(short) == len(self.problem.via) + 1  # legs from a place to itself are not among the legs


def above_all(problem: Problem) -> float:
    """An altitude AMSL, metres, above all ground, zone ceilings and terminals, with at least 100 m to spare."""
    surface, limits = problem.airspace.surface, problem.limits
    high = float(np.nanmax(surface.top_m))
    _, tops = problem.airspace.zone_table.levels_m(ground_m=high)
    ends = [problem.start[2], problem.goal[2], *(v.amsl_m for v in problem.via if v.amsl_m is not None)]
    most = max(high + limits.min_agl_m, float(tops[np.isfinite(tops)].max(initial=0.0)), *ends)
    return most + limits.over_zone_m + 2.0 * limits.track_error_m + 100.0
