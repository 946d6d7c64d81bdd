"""The shortest track below the ceiling on the finer lattice, within the corridor of tracks that may be shorter.

With a track error, first over nodes that are only as high as in the exact check: through slits that are shut in the
other lattices, because these reserve the possible rise of the ground beside a track, and nearer to terrain.
"""

from __future__ import annotations

import math

from gcsplan.planners.optimal.loop.search import Search, Size
from gcsplan.planners.optimal.plane.corridor import Narrow
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch

DARED_M, PINCHED_M = (0.05, 0.1, 0.2, 0.4, 0.8), 1.0
"""Metres by which the nodes beside a track through a slit are raised, in turn, beyond the altitude that it lacked, or
that later tracks keep from zones over ground; and the most it may be pinched for another track to be searched."""


class FineTracks(Search):
    """Runs once, when a path is known, also if the gap is nearly as small as requested. Remembers nothing."""

    NAME, IMPROVES, SHARE = "fine_tracks", "paths", 0.9

    @property
    def nearer(self) -> bool:
        """It is cheap and mostly helps."""
        return True

    def applies(self) -> bool:
        """Whether a path is known, and no maximum AGL."""
        return self.incumbent.best is not None and self.problem.limits.max_agl_m is None

    def size(self) -> Size:
        """Half a pass over the lattices."""
        return self.work.plane.size(0.5)

    def run(self) -> None:
        """Look for a path."""
        if self.work.plane.reach_longest():
            look_finely(self.work.plane)


def look_finely(plane: PlaneSearch) -> bool:
    """Look for a path on the finer lattice; return whether it is the best so far."""
    # With a track error, that lattice keeps metres from the terrain that the exact check leaves open.
    near = plane.incumbent.sharp and plane.problem.limits.track_error_m > 0.0
    return (near and narrow_passage(plane)) or plane.try_below(plane.path_top_m, fine=True)


def narrow_passage(plane: PlaneSearch) -> bool:
    """Look for a path over nodes that are only as high as in the exact check, and raised where the last track lacked
    altitude. Returns whether the path is the best so far."""
    narrow, before_m = Narrow(), math.nan
    for more_m in DARED_M:
        better, lacks = plane.look_below(plane.path_top_m, fine=True, narrow=narrow)
        if better:
            return True
        # Where the last change did not matter, the next one will not.
        if lacks is None or math.isclose(lacks.by, before_m, rel_tol=1e-3) or not plane.incumbent.goes_on():
            break
        before_m = lacks.by
        if lacks.kind == "zone":
            narrow.zones_m = more_m
        elif lacks.kind == "pinched" and lacks.by < PINCHED_M:
            narrow.pinched.append((lacks.place, lacks.by + more_m))
        else:
            break
    return False
