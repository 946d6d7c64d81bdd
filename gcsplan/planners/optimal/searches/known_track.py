"""A path that was legal before places or zones moved, drawn through the places as they are now.

While somebody drags a point, the path changes little from one place to the next; this takes a few checked legs. It
leads straight from the last way point to the new end; else by way of the old end, so that it keeps its side of a zone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.loop.search import Search, Size
from gcsplan.planners.problem import Problem
from gcsplan.planners.profile.exact import way_points
from gcsplan.planners.profile.track import Flown, fly, make_track

KNOWN_S = 2.05e-3
"""Counted seconds of the path: a little more than of the straight one, which goes first, and less than of all else."""

AT_OLD_END_M = 0.05
"""An end of the known path that lies so near to an end as it is now has not moved, m."""


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
        """Take the known path if the exact check passes it: without its old ends, or else with them. Legs that do not
        pass get another profile; way points that are no longer needed go."""
        problem, judge, known = self.problem, self.incumbent.judge, self.problem.known
        assert known is not None
        moved = np.linalg.norm(known[:, None] - [problem.start, problem.goal], axis=-1).min(axis=1) > AT_OLD_END_M
        for kept in (known[1:-1], known[moved]):
            points, pinned = through_places(problem, kept)
            if broken := judge.violations(points):
                legs = [leg for leg, _ in broken]
                found = redrawn(problem, points, pinned, (min(legs), max(legs)))
                if found is None or judge.violations(found[0]):
                    continue
                points, pinned = found
            self.incumbent.take_simpler(points, pinned, fine=False, longer=False)
            return


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


def redrawn(problem: Problem, points: Floats, pinned: Bools, legs: tuple[int, int]) -> tuple[Floats, Bools] | None:
    """The path (N, 3) with another profile from the leg before the first of ``legs`` to the leg behind the last, and
    which points must stay; None if no profile leads over that part of its track. Points ``pinned`` (N,) keep their
    altitudes."""
    first, last = max(legs[0] - 1, 0), min(legs[1] + 2, len(points) - 1)
    part, stay = points[first : last + 1], pinned[first : last + 1].copy()
    stay[[0, -1]] = True
    piece = replace(problem, start=tuple(part[0].tolist()), goal=tuple(part[-1].tolist()), via=())
    track = make_track(piece, part[:, :2], stay, part[:, 2])
    flown = fly(piece, track)
    if not isinstance(flown, Flown):
        return None
    drawn, must = way_points(piece, track, flown)
    must[[0, -1]] = pinned[[first, last]]
    return np.vstack([points[:first], drawn, points[last + 1 :]]), np.concatenate(
        [pinned[:first], must, pinned[last + 1 :]]
    )
