"""Tracks around, over or under each zone, and with laps, best first, on the finer lattice (`detour_search`)."""

from __future__ import annotations

from gcsplan.planners.optimal.loop.search import FAR, Search, Size

PAST_FINE, ROUNDS = 9, 2
"""Most tracks past obstacles that are tried at once, and how often that is repeated for length."""


class FineDetours(Search):
    """Once, when a path is known; for energy and time, beyond a gap of `FAR`. Remembers nothing."""

    NAME, IMPROVES, SHARE = "detours", "paths", 0.3

    def applies(self) -> bool:
        """Whether a path is known, and no maximum AGL."""
        i = self.incumbent
        far = self.problem.rates is None or i.gap > FAR
        return i.best is not None and far and self.problem.limits.max_agl_m is None

    def size(self) -> Size:
        """Four passes over the lattices."""
        return self.work.plane.size(4.0)

    def run(self) -> None:
        """Try tracks until none is better."""
        plane = self.work.plane
        if not plane.reach_longest():
            return
        for _ in range(ROUNDS if self.problem.rates is None else 1):
            if not self.incumbent.goes_on() or not plane.past(PAST_FINE, fine=True):
                break
