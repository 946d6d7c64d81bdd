"""The shortest track below the ceiling on a lattice of the terrain's cells, and tracks past obstacles that cannot be
climbed over. Under a maximum AGL over uneven ground, the track alone: its length is a bound."""

from __future__ import annotations

from gcsplan.planners.optimal.loop.search import Search, Size
from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.plane.plane_search import SLACKS

PAST = 12
"""Most tracks past obstacles that are tried on the first-look lattice."""


class CapSearch(Search):
    """Once, while no path is known. Remembers nothing: the lattices are the workspace's.

    ``slacks``: parts of the shortest track by which tracks may be longer, in turn.
    """

    NAME, IMPROVES, SHARE = "cap_search", "paths, bounds", 1.0

    def __init__(self, work: Workspace, slacks: tuple[float, ...] = SLACKS) -> None:
        super().__init__(work)
        self.slacks = slacks

    def applies(self) -> bool:
        """Whether no path is known; under a maximum AGL, whether a bound may help."""
        i = self.incumbent
        may_help = i.best is None if self.problem.limits.max_agl_m is None else i.bound < i.cost
        return may_help and bool(self.work.plane.legs)

    def size(self) -> Size:
        """One pass over the lattices."""
        return self.work.plane.size(1.0)

    def run(self) -> None:
        """Look for a path over tracks that are longer than the shortest by at most each of the slacks in turn; the legs
        are flooded that far. Ends when a path is found, or when it is proved that there is none."""
        plane = self.work.plane
        for slack in self.slacks:
            if not plane.flood(slack):
                return
            plane.raise_tracks()
            if self.problem.limits.max_agl_m is not None:
                return
            # Tracks that only the finer lattice shows are nearly the shortest; in the last round nothing else is left.
            patient = slack in (self.slacks[0], self.slacks[-1])
            top_m = plane.path_top_m
            if plane.try_below(top_m, fine=False) or (patient and plane.try_below(top_m, fine=True)):
                return
            if plane.past(PAST, fine=False, first=True) or not self.incumbent.budget.goes_on():
                return
