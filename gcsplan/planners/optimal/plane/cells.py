"""The cell sizes of a leg's lattices: as small as leg and zones need them, and as many cells as memory allows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Bools
from gcsplan.planners.optimal.navmesh.grid import Box, box_of, extent
from gcsplan.planners.problem import Problem
from gcsplan.world.geometry.zones import Circle

COARSE_M = 100.0
"""Largest cells wanted for the first-look lattice, metres, unless the terrain model's own are larger."""
FINE_M, FINE_PARTS, MOST_FINE = 24.0, 400.0, 6
"""Cells of the finer lattice are about as wide as the smaller of `FINE_M` metres and the leg's length / `FINE_PARTS`;
but a cell is cut into at most `MOST_FINE` parts a side."""
LEAST_M = 1.0
"""Smallest cells, metres: zone walls are drawn at their true place between nodes, and the ground within a cell is
straight, so smaller cells gain nothing."""
MOST_FIRST, MANY, NODE_BYTES = 1.5e6, 1e5, 400.0
"""Most nodes of the first-look lattices of all legs, unless a leg has fewer than `MANY`; and bytes of a node with its
mesh and a search over it."""
MUCH = 0.5
"""A lattice that needs more than this part of the terrain model's nodes is made over all of it."""
MOST_SEARCHED = 1.5e6
"""Most cells of the finer lattices of all legs that are searched for one track; in long corridors they are larger."""
BOX_NODE_BYTES = 50.0
"""Bytes of a node in the box of the finer lattice, whether it is searched or not."""


@dataclass(frozen=True, slots=True)
class Cells:
    """``parts``: parts a side into which the terrain model's cells are cut, if they are large compared with leg or
    zones; or ``stride``: terrain cells a side that are merged into one in the first-look lattice, and ``fine_stride``
    in the finer lattice. ``ratio``: parts a side into which first-look cells are cut where it matters, within their own
    lattice (``cut``) or by the finer lattice. ``nodes``: of the first-look lattice, about."""

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
    """The cell sizes for a leg of ``straight_m`` metres that begins at ``place``, for lattices over a box."""
    surface = problem.airspace.surface
    size = surface.grid.metres_per_cell(*place)
    col0, row0, col1, row1 = extent(problem, box)
    cells = float((col1 - col0) * (row1 - row0))
    legs = len(problem.via) + 1  # all of them keep their lattices
    fitting = 1e6 * problem.budget.megabytes / NODE_BYTES / legs
    most = min(max(MOST_FIRST / legs, MANY), fitting)
    cell_m, finest_m = float(size.max()), max(min(FINE_M, straight_m / FINE_PARTS), LEAST_M)
    wanted_m = max(_wanted_m(problem, straight_m), LEAST_M, cell_m * math.sqrt(cells / most))
    parts = max(1, round(cell_m / wanted_m))
    # Merged cells only bound the heights between their nodes, so cells are merged only if that saves many nodes.
    fine_stride = 1 if parts > 1 or finest_m < 2.0 * cell_m else round(finest_m / cell_m)
    stride = fine_stride * max(1, round(wanted_m / cell_m / fine_stride))
    if parts > 1 or (stride < 3 and cells <= fitting):
        stride = fine_stride = 1
    ratio, cut = stride // fine_stride, 1
    if stride == 1:
        ratio = cut = max(1, min(MOST_FINE, round(cell_m / parts / finest_m)))
    return Cells(parts, stride, fine_stride, ratio, cut, cells * (parts / stride) ** 2)


def _wanted_m(problem: Problem, straight_m: float) -> float:
    """Cell width for the first look, metres, from the length of the leg and the sizes of the zones."""
    least, most = straight_m / 250.0, min(straight_m / 60.0, COARSE_M)
    radii = [
        z.shape.radius_m
        if isinstance(z.shape, Circle)
        else 0.5 * min(z.bounds[2] - z.bounds[0], z.bounds[3] - z.bounds[1])
        for z in problem.airspace.zones
    ]
    return max(least, min([most, *(r / 3.0 for r in radii)]))


def fits_memory(problem: Problem, cells: Bools, beside: int, ratio: int) -> bool:
    """Whether a lattice ``ratio`` times finer over the box of ``cells``, widened by ``beside`` cells on each side, fits
    into memory."""
    row, col, last_row, last_col = box_of(cells)
    nodes = (last_row - row + 2 * beside) * (last_col - col + 2 * beside) * ratio**2
    return nodes * BOX_NODE_BYTES <= 1e6 * problem.budget.megabytes


def most_parts(problem: Problem, cells: Bools) -> int:
    """Most parts a side into which ``cells`` of one leg may be cut to be searched."""
    each = MOST_SEARCHED / (len(problem.via) + 1) / max(int(np.count_nonzero(cells)), 1)
    return max(int(math.sqrt(each)), 1)


def box_around(a: tuple[float, float], b: tuple[float, float], detour: float) -> Box:
    """The box that contains all tracks from ``a`` to ``b`` of at most ``detour`` times the straight track; infinite for
    inf."""
    if math.isinf(detour):
        return -math.inf, -math.inf, math.inf, math.inf
    (x0, y0), (x1, y1), straight_m = a, b, math.dist(a, b)
    more = max(0.5 * straight_m * math.sqrt(detour**2 - 1.0), 0.5 * (detour - 1.0) * straight_m) + 1.0
    return min(x0, x1) - more, min(y0, y1) - more, max(x0, x1) + more, max(y0, y1) + more


def needs_most(problem: Problem, box: Box) -> bool:
    """Whether a lattice over a box needs more than the part `MUCH` of the terrain model's nodes."""
    col0, row0, col1, row1 = extent(problem, box)
    return (col1 - col0) * (row1 - row0) > MUCH * problem.airspace.surface.ground_m.size
