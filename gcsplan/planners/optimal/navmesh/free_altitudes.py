"""Between which altitudes each cell of a mesh can be flown through, by the ground below and by what zones leave."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.navmesh.interval_kernels import cut_intervals
from gcsplan.planners.optimal.navmesh.mesh import Mesh
from gcsplan.planners.optimal.navmesh.zone_kernels import narrow_ranges

Ints = NDArray[np.int32]


def ranges(mesh: Mesh, top_m: float) -> tuple[Floats, Floats]:
    """(cells,) the lowest and the highest altitude, ``top_m`` at most, that can be flown at in each cell of a mesh for
    bounds that is as fine as its plane; the wrong way round where there is none."""
    low = mesh.lowest().reshape(mesh.excess.shape[0] - 1, -1)
    high = np.full(low.shape, top_m)
    narrow_ranges(*_laid(mesh), low, high)
    return low.ravel(), high.ravel()


def intervals(mesh: Mesh, low_m: Floats, high_m: Floats, most: int, spare_m: float) -> tuple[Ints, Floats, Floats]:
    """How many intervals each cell of such a mesh has (cells,), ``most`` at most, by what zones leave of what `ranges`
    tells of it, and (cells, most) from where to where they go, ``spare_m`` wider."""
    low, high = np.empty((len(low_m), most)), np.empty((len(low_m), most))
    low[:, 0], high[:, 0] = low_m - spare_m, high_m + spare_m
    count = (low_m <= high_m).astype(np.int32)
    cut_intervals(*_laid(mesh), spare_m, count, low, high)
    return count, low, high


def _laid(mesh: Mesh) -> tuple[Floats, Floats, Floats, Floats, Floats, Ints, bool]:
    """Ground and places of such a mesh's nodes, the shapes that are shut for certain and their boxes there, and
    whether the ground is the terrain model's own."""
    plane, (rows, cols) = mesh.plane, mesh.excess.shape
    ground = np.ascontiguousarray(plane.grounds[0][mesh.row : mesh.row + rows, mesh.col : mesh.col + cols])
    boxes = plane.boxes(mesh.row, mesh.col, 1, rows, cols)
    return ground, *mesh.places(), *plane.shapes.low, boxes, plane.stride == 1
