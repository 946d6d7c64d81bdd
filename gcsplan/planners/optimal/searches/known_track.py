"""A path that was legal before places or zones moved, drawn through the places as they are now.

While somebody drags a point, the path changes little from one place to the next; this takes a few checked legs.
"""

from __future__ import annotations

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.loop.search import Search, Size
from gcsplan.planners.problem import Problem

KNOWN_S = 2.05e-3
"""Counted seconds of the path: a little more than of the straight one, which goes first, and less than of all else."""


class KnownTrack(Search):
    """Once, after the straight track, where the problem has a known path. Remembers nothing."""

    NAME, IMPROVES, SHARE = "known_track", "paths", 1.0

    def applies(self) -> bool:
        """Whether a path is known, but none between the places as they are."""
        return self.problem.known is not None and self.incumbent.best is None

    def size(self) -> Size:
        """A few legs."""
        return self.takes(KNOWN_S)

    def run(self) -> None:
        """Take the known path if the exact check passes it; without the way points that it no longer needs."""
        assert self.problem.known is not None
        points, pinned = through_places(self.problem, self.problem.known)
        if not self.incumbent.judge.violations(points):
            self.incumbent.take_simpler(points, pinned, fine=False, longer=False)


def through_places(problem: Problem, known: Floats) -> tuple[Floats, Bools]:
    """The path (M, 3) from start to goal over the way points ``known`` (N, 3), and (M,) which points must stay.

    Each via is put in where it lies nearest to the track, after the via before it; a via without an altitude gets the
    altitude of the path there.
    """
    way, rest, goal = [np.array(problem.start)], list(known), np.array(problem.goal)
    stay = [True]
    for via in problem.via:
        track = np.array([way[-1], *rest, goal])
        along, off = np.diff(track, axis=0), np.array([via.east_m, via.north_m]) - track[:-1, :2]
        flat = along[:, :2]
        part = np.einsum("ij,ij->i", off, flat) / np.maximum(np.einsum("ij,ij->i", flat, flat), 1e-12)
        part = part.clip(0.0, 1.0)
        nearest = int(np.argmin(np.linalg.norm(off - part[:, None] * flat, axis=1)))
        amsl_m = track[nearest, 2] + part[nearest] * along[nearest, 2] if via.amsl_m is None else via.amsl_m
        way += [*rest[:nearest], np.array([via.east_m, via.north_m, amsl_m])]
        stay += [False] * nearest + [True]
        rest = rest[nearest:]
    return np.array([*way, *rest, goal]), np.array([*stay, *[False] * len(rest), True])
