"""The objects that the searches of one problem share: incumbent, lattices of its legs, and outlines of its zones.

Each is made at first use, because many missions need none.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch, above_all, in_window
from gcsplan.planners.problem import terminals_of
from gcsplan.planners.profile.track import Flown, Obstruction, Track, fly, make_track
from gcsplan.world.geometry.path import runs_m

if TYPE_CHECKING:
    from gcsplan.planners.optimal.plane.outline_tracks import OutlineTracks


class Workspace:
    """The objects that the searches of one problem share; ``farthest``: see `Leg`."""

    def __init__(self, incumbent: Incumbent, farthest: float = math.inf) -> None:
        self.incumbent, self.farthest = incumbent, farthest
        self.known_outlines: OutlineTracks | None = None
        """The outlines, if a search has needed them."""

    @cached_property
    def straight(self) -> tuple[Track, Flown | Obstruction]:
        """The straight track through all terminals, and its profile or why there is none."""
        p = self.incumbent.problem
        places = np.array(terminals_of(p))
        apart = np.concatenate([[True], runs_m(places) > 1e-3])
        pin_m = np.array([math.nan, *(math.nan if v.amsl_m is None else v.amsl_m for v in p.via), math.nan])[apart]
        track = make_track(p, places[apart], np.ones(int(apart.sum()), np.bool_), pin_m)
        return track, fly(p, track)

    @cached_property
    def plane(self) -> PlaneSearch:
        """The lattices of the legs."""
        return PlaneSearch(self.incumbent, in_window(self.incumbent), self.farthest)

    def outlines(self) -> OutlineTracks:
        """The plane with the outlines of the zones only."""
        if self.known_outlines is None:
            from gcsplan.planners.optimal.plane.outline_tracks import OutlineTracks  # shapely: many missions need none

            problem = self.incumbent.problem
            limits = problem.bound_limits
            highest_m = float(np.nanmax(problem.airspace.surface.ground_m))
            most_m = [*([] if limits.max_amsl_m is None else [limits.max_amsl_m]),
                      *([] if limits.max_agl_m is None else [highest_m + limits.max_agl_m])]  # fmt: skip
            top_m = min(most_m) - limits.altitude_error_m if most_m else above_all(problem)
            self.known_outlines = OutlineTracks(self.incumbent, top_m)
        return self.known_outlines
