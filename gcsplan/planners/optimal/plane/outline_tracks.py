"""Tracks around the zones' own outlines: exact where only zones are in the way, and a lower bound everywhere."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.navmesh.outlines import Solids, ZoneOutline
from gcsplan.planners.optimal.navmesh.portals import Exhausted
from gcsplan.planners.optimal.plane.corridor import PinnedTrack, SideChoice, joined
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.problem import Problem, terminals_of

HARDLY_M, TOUCH_M = 0.1, 1e-4
"""Zones that lack less than this to be passed under or over count as passable, m: `HARDLY_M` where a level or a limit
counts from the ground, `TOUCH_M` for rounding where both count from mean sea level."""
HAIR_M, HAIR_BENT_M = 2e-3, 0.07
"""Metres kept from outlines for rounding; and where the terrain model's lines are curved in the plane, as in the exact
check."""


class OutlineTracks:
    """The plane of one problem with its zones only; paths and bounds go to the incumbent. ``top_m``: highest altitude
    AMSL at which zones may be passed over."""

    def __init__(self, incumbent: Incumbent, top_m: float) -> None:
        self.incumbent, self.problem = incumbent, incumbent.problem
        places = terminals_of(self.problem)
        heights = [*(v.amsl_m for v in self.problem.via), self.problem.goal[2]]
        self.legs = [(a, b, z) for (a, b), z in zip(pairwise(places), heights, strict=True) if math.dist(a, b) > 1e-3]
        self.under, self.tops_m = _sides(self.problem)
        by_ground = self.problem.airspace.zone_table.over_ground[:, 1] | (self.problem.limits.max_agl_m is not None)
        self.over = self.tops_m <= top_m + np.where(by_ground, HARDLY_M, TOUCH_M)
        self._solids: dict[bool, Solids] = {}
        self._hints: list[Floats] = []
        """The tracks of the bound. Outlines are refined along them, so that paths find slits that coarse ones shut."""

    def terminals(self, choice: SideChoice) -> PinnedTrack | None:
        """The shortest track past the zones that a choice shuts; None if there is none or it takes too much work."""
        which = ~((choice.under & self.under) | (choice.over & self.over))
        try:
            tracks = self.tracks(which, outer=True)
        except Exhausted:
            return None
        if tracks is None:
            return None
        return joined(tracks, [z for _, _, z in self.legs[:-1]])

    def look(self) -> list[Floats] | None:
        """The shortest tracks of the legs around the zones that can be passed neither over nor under, along which all
        outlines are refined from now on; None if a leg has none. Raises Exhausted."""
        tracks = self.tracks(~(self.under | self.over), outer=False)
        self._hints = tracks or []
        return tracks

    def walls(self) -> Bools:
        """(zones,) which zones can be passed neither over nor under by a path that is better than the best."""
        too_high = self.over & (self.tops_m > self.incumbent.highest(math.inf) + HARDLY_M)
        return (too_high & ~self.under) | ~(self.under | self.over)

    def outline(self, zone: int, *, outer: bool) -> ZoneOutline:
        """A zone's outline for paths (``outer``) or for bounds, once `tracks` has used one."""
        return self._solids[outer].outlines[zone]

    def tracks(self, which: Bools, *, outer: bool) -> list[Floats] | None:
        """The shortest track of each leg past the zones ``which`` (zones,); None if a leg has none. ``outer``: outlines
        for paths instead of bounds. Raises Exhausted."""
        if outer not in self._solids:
            air, limits = self.problem.airspace, self.problem.limits if outer else self.problem.bound_limits
            reach_m, wider_m = air.beside_m(limits), air.beside_over_ground_m(limits) if outer else 0.0
            hair = HAIR_M if air.surface.grid.error_m == 0.0 else HAIR_BENT_M
            hair_m = np.full(len(air.zones), hair if outer else hair + self.problem.bound_spare_m)
            hair_m += max(wider_m - reach_m, 0.0) * air.zone_table.follow_ground
            solids = Solids(air.zone_table, reach_m, hair_m, self.incumbent.budget, outer=outer)
            for hint in self._hints:
                solids.look_along(hint, which)
            self._solids[outer] = solids
        tracks = []
        for a, b, _ in self.legs:
            found = self._solids[outer].shortest(a, b, which)
            if found is None:
                return None
            tracks.append(found.points)
        return tracks


def _sides(problem: Problem) -> tuple[Bools, Floats]:
    """(zones,) which zones can perhaps be passed under at some place, and the least altitude AMSL over each, inf over
    those without a top."""
    limits, surface, table = problem.bound_limits, problem.airspace.surface, problem.airspace.zone_table
    high = float(np.nanmax(surface.ground_m)) if table.follow_ground.any() else 0.0
    low = float(np.nanmin(surface.ground_m))
    bottoms_m, _ = table.levels_m(limits.over_zone_m)
    # A floor AGL and the lowest legal altitude count from the same ground, except for ground within clearance.
    beside_m = high - low if problem.airspace.beside_m(limits) > 0.0 else 0.0
    lowest_m = limits.min_agl_m + limits.altitude_error_m
    under = bottoms_m - lowest_m - np.where(table.over_ground[:, 0], -beside_m, low) >= -HARDLY_M
    return under, table.levels_m(limits.over_zone_m, low)[1]
