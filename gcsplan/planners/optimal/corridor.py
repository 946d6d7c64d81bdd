"""What tracks from stop to stop that are short enough may meet of the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.optimal.navmesh.mesh import Guide

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class End:
    """A stop: where, and how high; None where its height is free."""

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
    from there at least. ``parts``: a side that the finer lattice's cells there are cut into; 0: as many as the leg's
    are."""

    cells: Bools
    guide: Guide
    parts: int = 0

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
