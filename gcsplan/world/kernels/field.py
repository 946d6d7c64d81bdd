"""A surface's map to its grid in the form that the exact check needs: packed numbers, and bounds of the map."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyder, polygrid2d

from gcsplan.arrays import Floats
from gcsplan.world.geometry.surface import DEGREE, POWERS, GridMap


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
    square = np.zeros((DEGREE + 1, DEGREE + 1, 2))
    square[tuple(zip(*POWERS, strict=True))] = grid.coefficients

    def derivative(du: int, dv: int) -> Floats:
        of_both = polyder(polyder(square, du, 1.0 / grid.scale_m), dv, 1.0 / grid.scale_m, axis=1)
        return np.asarray(polygrid2d(f, f, of_both), float).reshape(2, -1)

    (a, c), (b, d) = derivative(1, 0), derivative(0, 1)  # of column and row
    with np.errstate(divide="raise", invalid="raise"):  # no map of a raster folds
        inverse = np.array([d, -b, -c, a]) / (a * d - b * c)
    # `steps_of` over the whole lattice at once.
    xx, yy = inverse[0] ** 2 + inverse[2] ** 2, inverse[1] ** 2 + inverse[3] ** 2
    skew = np.abs(inverse[0] * inverse[1] + inverse[2] * inverse[3])
    ratio = np.sqrt(xx / yy)
    step_x, step_y = (math.sqrt(max(float(m.min()), 0.0)) for m in (xx - skew * ratio, yy - skew / ratio))
    if affine:
        return 0.0, step_x, step_y
    # A symmetric form has its largest value over two directions where the two are equal.
    uu, uv, vv = (
        np.array([inverse[0] * col + inverse[1] * row, inverse[2] * col + inverse[3] * row])
        for col, row in (derivative(2, 0), derivative(1, 1), derivative(0, 2))
    )
    turn = np.linspace(0.0, np.pi, 24, endpoint=False)
    form = np.array([np.cos(turn) ** 2, 2.0 * np.cos(turn) * np.sin(turn), np.sin(turn) ** 2])
    east, north = (form.T @ np.array(parts) for parts in zip(uu, uv, vv, strict=True))
    bend = 1.1 * float(np.sqrt((east * east + north * north).max()))
    spacing = grid.scale_m * (f[1] - f[0])
    keep = 1.0 - bend * spacing
    return bend, step_x * keep, step_y * keep
