"""What tracks from terminal to terminal that are short enough may meet of the plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools, Floats
from gcsplan.planners.optimal.navmesh.mesh import Guide

Spare = tuple[float, float]
"""Metres that a path may fly in laps near its start and near its goal."""
PinnedTrack = tuple[Floats, Bools, Floats]
"""A track (N, 2), which of its points are terminals, and their altitudes (NaN free)."""


@dataclass(frozen=True, slots=True)
class End:
    """A terminal: where, and how high; None where its height is free."""

    east_m: float
    north_m: float
    amsl_m: float | None

    @property
    def place(self) -> tuple[float, float]:
        """(east_m, north_m)."""
        return self.east_m, self.north_m


@dataclass(frozen=True, eq=False, slots=True)
class Corridor:
    """(rows - 1, cols - 1) the cells of a leg's lattice that tracks of some length may enter, and how far the goal is
    from there at least."""

    cells: Bools
    guide: Guide

    def within(self, cells: Bools) -> Corridor:
        """That part of it which lies in some of the guide's mesh's cells."""
        return Corridor(self.cells & self.guide.mesh.over_plane(cells), self.guide)


@dataclass(frozen=True, eq=False, slots=True)
class Nearby:
    """What tracks shorter than ``limit_m`` may meet, and how far that is from start and goal.

    Of all cells of the guides' mesh (cells,) the lowest and the highest altitude that can be flown at, and how long
    ways there and on are at least.
    """

    limit_m: float
    away: Guide
    left: Guide
    low_m: Floats
    high_m: Floats
    away_m: Floats
    left_m: Floats


def joined(ways: list[Floats], heights: list[float | None]) -> PinnedTrack:
    """One track of those from terminal to terminal (N, 2), of which the ``heights`` of all but the ends are told."""
    points = np.vstack([ways[0], *(w[1:] for w in ways[1:])])
    pinned, pin_m = np.zeros(len(points), np.bool_), np.full(len(points), math.nan)
    pinned[0] = pinned[-1] = True
    at = 0
    for way, height in zip(ways[:-1], heights, strict=True):
        at += len(way) - 1
        pinned[at] = True
        pin_m[at] = math.nan if height is None else height
    return points, pinned, pin_m
