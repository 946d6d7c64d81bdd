"""The exact shortest track around the zones' own outlines; zones that can be passed over or under are shut one by one.

Zones that can be passed neither over nor under are obstacles in the plane. The shortest track around them is a bound
for every path. Tracks around them, and around zones whose sides are shut because passing over or under costs more, give
paths (`detour_search`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.loop.search import FAR, Search, Size
from gcsplan.planners.optimal.navmesh.portals import Exhausted
from gcsplan.planners.optimal.plane.corridor import SideChoice
from gcsplan.planners.optimal.plane.detour_search import DetourSearch
from gcsplan.planners.profile.track import Obstruction
from gcsplan.world.geometry.path import track_length_m

OUTLINES_S, ZONE_S = 1.3e-3, 0.8e-3
"""Counted seconds of the search, and more for each zone."""
TRACKS = 24
"""Most tracks that are tried."""


class Outlines(Search):
    """Once, where zones may obstruct the straight track or make a path over it dearer. Remembers nothing: the outlines
    are the workspace's."""

    NAME, IMPROVES, SHARE = "outlines", "paths, bounds", 1.0

    def applies(self) -> bool:
        """Whether there are zones, and more than a pinched straight track speaks for them."""
        if not self.problem.airspace.zones:
            return False
        _, flown = self.work.straight
        far = self.incumbent.best is not None and self.incumbent.gap > FAR
        return far or not (isinstance(flown, Obstruction) and flown.kind == "pinched")

    def size(self) -> Size:
        """By the number of zones."""
        return self.takes(OUTLINES_S, ZONE_S)

    def run(self) -> None:
        """Raise the bound to the shortest track around the zones that can be passed neither over nor under, or prove
        that there is none; then look for paths."""
        incumbent, outlines = self.incumbent, self.work.outlines()
        try:
            tracks = outlines.look()
        except Exhausted:
            tracks = []
        if tracks is None:
            incumbent.prove_infeasible()
            return
        if tracks:
            incumbent.raise_track_bound(_length_m(tracks))
        zones = len(outlines.under)
        root = SideChoice(np.ones(zones, np.bool_), np.ones(zones, np.bool_))
        laps = incumbent.climbs and incumbent.sharp
        roots = [root]
        if laps and math.isfinite(incumbent.cost):
            roots.insert(0, replace(root, most_m=(incumbent.cost - incumbent.bound,) * 2))
        DetourSearch(incumbent, outlines.terminals, False).run(roots, TRACKS, first=False, laps=laps)


def _length_m(tracks: list[Floats]) -> float:
    """The length of all tracks together, rounded down."""
    return sum(track_length_m(t) for t in tracks) * (1.0 - 1e-9)
