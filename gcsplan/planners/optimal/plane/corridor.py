"""Corridors (the cells that short enough tracks between two terminals may meet), and tracks joined at terminals."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from gcsplan.arrays import Bools, Floats, Int64s
from gcsplan.planners.optimal.navmesh.clearance import Cone
from gcsplan.planners.optimal.navmesh.mesh import Guide

Spare = tuple[float, float]
"""Metres that a path may fly in laps near its start, and near its goal."""
PinnedTrack = tuple[Floats, Bools, Floats]
"""A track (N, 2), which of its points are terminals (N,), and their altitudes (N,) AMSL (NaN where free)."""


@dataclass(frozen=True, slots=True)
class End:
    """A terminal: its place and altitude; None if its altitude is free."""

    east_m: float
    north_m: float
    amsl_m: float | None

    @property
    def place(self) -> tuple[float, float]:
        """(east_m, north_m)."""
        return self.east_m, self.north_m

    def cone(self, slope: float, spare_m: float, off_m: float = 0.0) -> list[Cone]:
        """The cone of the altitudes that paths with ``spare_m`` metres to spare can reach near here, climbing or
        descending by ``slope``, if they begin or end up to ``off_m`` higher; none if the altitude is free or the slope
        is not limited."""
        if self.amsl_m is None or not math.isfinite(slope):
            return []
        return [(self.east_m, self.north_m, self.amsl_m + slope * spare_m + off_m, slope)]


@dataclass(frozen=True, eq=False, slots=True)
class Corridor:
    """The ``cells`` (rows - 1, cols - 1) of a leg's lattice that tracks up to some length may enter, and the ``guide``
    with lower bounds of their distance to the goal."""

    cells: Bools
    guide: Guide

    def within(self, cells: Bools) -> Corridor:
        """The part of the corridor in ``cells`` of the guide's mesh."""
        return Corridor(self.cells & self.guide.mesh.over_plane(cells), self.guide)


@dataclass(frozen=True, eq=False, slots=True)
class Nearby:
    """The cells that tracks shorter than ``limit_m`` may meet; guides from the start (``away``) and goal (``left``).

    For each of these ``cell`` (K,), rising numbers of cells of the guides' mesh: the lowest and the highest altitude
    that can be flown at, and bounds of the shortest tracks from the start to the cell and from there to the goal: the
    least (``away_m``, ``left_m``), and the greatest to any place that tracks may meet (``away_most_m``,
    ``left_most_m``; inf where it is not known).
    """

    limit_m: float
    away: Guide
    left: Guide
    cell: Int64s
    low_m: Floats
    high_m: Floats
    away_m: Floats
    left_m: Floats
    away_most_m: Floats
    left_most_m: Floats


@dataclass(slots=True)
class Narrow:
    """Places (2,) where earlier tracks through slits were pinched, and by how many metres; and metres that tracks keep
    from the levels of zones over ground."""

    pinched: list[tuple[Floats, float]] = field(default_factory=list)
    zones_m: float = 0.0


@dataclass(frozen=True, eq=False, slots=True)
class SideChoice:
    """``under``, ``over`` (zones,): which zones may be passed below their floor, above their ceiling; ``least_m``,
    ``most_m``: the range of spare metres near the ends; ``lower_m``: metres by which the cap is lowered. ``tried``:
    zones for which choices with one side more shut, and no fewer spare metres, have been made before."""

    under: Bools
    over: Bools
    least_m: Spare = (0.0, 0.0)
    most_m: Spare = (0.0, 0.0)
    lower_m: float = 0.0
    tried: frozenset[int] = frozenset()


def joined(ways: list[Floats], heights: list[float | None]) -> PinnedTrack:
    """Join the tracks of all legs (N, 2) into one; ``heights``: altitudes of the inner terminals, None where free."""
    points = np.vstack([ways[0], *(w[1:] for w in ways[1:])])
    pinned, pin_m = np.zeros(len(points), np.bool_), np.full(len(points), math.nan)
    pinned[0] = pinned[-1] = True
    at = 0
    for way, height in zip(ways[:-1], heights, strict=True):
        at += len(way) - 1
        pinned[at] = True
        pin_m[at] = math.nan if height is None else height
    return points, pinned, pin_m
