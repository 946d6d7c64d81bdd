"""How large the cells of a leg's lattices are: as small as leg and zones want them, and no more than memory allows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcsplan.planners.optimal.navmesh.grid import Box, box_of, extent
from gcsplan.planners.problem import Problem
from gcsplan.world.zones import Circle

COARSE_M = 100.0
"""Cells of the first look are no larger, if the terrain model's are not."""
FINE_M, FINE_PARTS, MOST_FINE = 24.0, 400.0, 6
"""Cells are cut until they are about as wide, or that part of the leg, but into no more parts a side."""
LEAST_M = 1.0
"""Cells are cut no smaller: walls of zones are drawn between nodes where they are, and ground is straight in there."""
MOST_FIRST, NODE_BYTES = 1.5e6, 400.0
"""Nodes of the first look's lattice, at most, and what one takes with its mesh and a search over that."""
BOX_NODE_BYTES = 50.0
"""What a node of the finer lattice takes, looked at or not."""


@dataclass(frozen=True, slots=True)
class Cells:
    """``parts``: a side that the terrain model's cells are cut into, where they are large beside leg or zones; or
    ``stride``: how many become one in the first look, and ``fine_stride`` in the finer lattice. ``ratio``: how many
    parts a side the first look's cells are cut into where it matters, in its own lattice (``cut``) or in the finer one.
    ``nodes``: of the first look, about."""

    parts: int
    stride: int
    fine_stride: int
    ratio: int
    cut: int
    nodes: float

    @property
    def has_fine(self) -> bool:
        """Whether there is a lattice finer than that of the first look."""
        return self.ratio > 1


def choose(problem: Problem, place: tuple[float, float], straight_m: float, box: Box) -> Cells:
    """The cells for a leg that begins at ``place``, ``straight_m`` long, over a box."""
    surface = problem.airspace.surface
    size = surface.grid.metres_per_cell(*place)
    col0, row0, col1, row1 = extent(problem, box)
    area_m2 = float((col1 - col0) * (row1 - row0) * size[0] * size[1])
    most = min(MOST_FIRST, 1e6 * problem.budget.left_mb / NODE_BYTES)
    wanted_m = max(_wanted_m(problem, straight_m), LEAST_M, math.sqrt(area_m2 / most))
    cell_m, finest_m = float(size.max()), max(min(FINE_M, straight_m / FINE_PARTS), LEAST_M)
    parts = max(1, round(cell_m / wanted_m))
    # Between nodes that are left out heights are guessed, so few are better kept.
    fine_stride = 1 if parts > 1 or finest_m < 2.0 * cell_m else round(finest_m / cell_m)
    stride = fine_stride * max(1, round(wanted_m / cell_m / fine_stride))
    if parts > 1 or stride < 3:
        stride = fine_stride = 1
    ratio, cut = stride // fine_stride, 1
    if stride == 1:
        ratio = cut = max(1, min(MOST_FINE, round(cell_m / parts / finest_m)))
    return Cells(parts, stride, fine_stride, ratio, cut, area_m2 / (cell_m / parts * stride) ** 2)


def _wanted_m(problem: Problem, straight_m: float) -> float:
    """How large cells may be for the first look."""
    least, most = straight_m / 250.0, min(straight_m / 60.0, COARSE_M)
    radii = [
        z.shape.radius_m
        if isinstance(z.shape, Circle)
        else 0.5 * min(z.bounds[2] - z.bounds[0], z.bounds[3] - z.bounds[1])
        for z in problem.airspace.zones
    ]
    return max(least, min([most, *(r / 3.0 for r in radii)]))


def fits_memory(problem: Problem, cells: NDArray[np.bool_], beside: int, ratio: int) -> bool:
    """Whether a lattice ``ratio`` times finer over the box of some cells, and ``beside`` more, fits into memory."""
    row, col, last_row, last_col = box_of(cells)
    nodes = (last_row - row + 2 * beside) * (last_col - col + 2 * beside) * ratio**2
    return nodes * BOX_NODE_BYTES <= 1e6 * problem.budget.left_mb
