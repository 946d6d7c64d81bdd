"""A surface's map to its grid in the form that the exact check needs: packed numbers, and bounds of the map."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.world.geometry.surface import DEGREE, POWERS, GridMap
from gcsplan.world.kernels.shared import steps_of


class Field(NamedTuple):
    """The parts of a surface's map to its grid that the check uses.

    ``bend`` bounds the map's second derivative, 1/m, with cells taken as metres: a line of length L bows by at most
    bend·L²/8, and the metric changes by bend·d over a distance d. ``step_x``, ``step_y``: metres of one column and one
    row, a lower bound over the whole map: (step_x·Δcol)² + (step_y·Δrow)² <= distance². ``packed``: all of it for the
    kernels. Beyond the square to which the map was fitted the map is not valid, and the ground counts as unknown.
    """

    packed: Floats
    affine: bool
    bend: float
    error_m: float
    step_x: float
    step_y: float

    @classmethod
    def of(cls, grid: GridMap) -> Field:
        """The bounds of ``grid``, and its numbers in the kernels' order."""
        order = [POWERS.index((i, j)) for i in range(DEGREE, -1, -1) for j in range(DEGREE - i, -1, -1)]
        low = [POWERS.index(t) for t in ((0, 0), (1, 0), (0, 1))]
        affine = not grid.coefficients[[k for k, (i, j) in enumerate(POWERS) if i + j > 1]].any()
        bend, step_x, step_y = _bounds(grid, affine)
        half = math.inf if affine else 1.0 + 1e-9
        head = [affine, *grid.centre, 1.0 / grid.scale_m, half, bend, grid.error_m, step_x, step_y]
        packed = np.concatenate([head, grid.coefficients[low].ravel(), grid.coefficients[order].ravel()])
        packed.setflags(write=False)
        return cls(packed, affine, bend, float(grid.error_m), step_x, step_y)


def _bounds(grid: GridMap, affine: bool) -> tuple[float, float, float]:
    """``bend``, ``step_x``, ``step_y`` of `Field`, from a lattice over the fitted square."""
    f = np.linspace(-1.0, 1.0, 2 if affine else 33)
    in_u, in_v = ([a.ravel() ** k for k in range(DEGREE + 1)] for a in np.meshgrid(f, f))

    def derivative(du: int, dv: int) -> Floats:
        total = np.zeros((len(f) ** 2, 2))
        for k, (i, j) in enumerate(POWERS):
            if i >= du and j >= dv:
                factor = math.perm(i, du) * math.perm(j, dv) / grid.scale_m ** (du + dv)
                total += factor * (in_u[i - du] * in_v[j - dv])[:, None] * grid.coefficients[k]
        return total

    jacobian = np.stack([derivative(1, 0), derivative(0, 1)], axis=-1)
    inverse = np.linalg.inv(jacobian)
    steps = np.array([steps_of(*m) for m in inverse.reshape(-1, 4).tolist()])
    if affine:
        return 0.0, float(steps[:, 0].min()), float(steps[:, 1].min())
    # A symmetric form has its largest value over two directions where the two are equal.
    uu, uv, vv = (np.einsum("nij,nj->ni", inverse, derivative(*d)) for d in ((2, 0), (1, 1), (0, 2)))
    turn = np.linspace(0.0, np.pi, 24, endpoint=False)
    c, s = np.cos(turn)[:, None, None], np.sin(turn)[:, None, None]
    bend = 1.1 * float(np.linalg.norm(c * c * uu + 2.0 * c * s * uv + s * s * vv, axis=-1).max())
    spacing = grid.scale_m * (f[1] - f[0])
    keep = 1.0 - bend * spacing
    return bend, float(steps[:, 0].min()) * keep, float(steps[:, 1].min()) * keep
