"""What lies around each cell of a surface: the steepest slope, the highest and the lowest node within a reach."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcsplan.world._field import Field
from gcsplan.world._shared import Halo

CELLS_AT_ONCE = 200_000  # stay in the processor's cache
FEW_STEPS = 4  # up to so many cells of reach, shifting is faster than scipy's filter


def halo_around(field: Field, heights: NDArray[np.float64], reach_m: float) -> Halo:
    """Bounds for every point within ``reach_m`` of a point of the cell."""
    cols, rows = (math.ceil(reach_m / step) for step in (field.step_x, field.step_y))
    shape = heights.shape[0] - 1, heights.shape[1] - 1
    slope, high, low = (np.empty(shape, np.float32) for _ in range(3))
    unknown, near = np.empty(shape, np.bool_), np.empty(shape, np.bool_)
    at_once = max(CELLS_AT_ONCE // shape[1], 1)
    for at in range(0, shape[0], at_once):
        part = slice(at, min(at + at_once, shape[0]))
        steep, most, least = _cells(field, heights[at : part.stop + 1])
        lost = np.isnan(steep)
        unknown[part] = lost
        if lost.any():
            steep[lost], most[lost], least[lost] = 0.0, -np.inf, np.inf
        near[part] = _spread(lost, cols, 1, True)
        slope[part] = _spread(steep, cols, 1, 0.0)
        high[part] = _spread(most, cols, 1, -np.inf)
        low[part] = -_spread(-least, cols, 1, -np.inf)
    slope = _spread(slope, rows, 0, 0.0)
    high = _spread(high, rows, 0, -np.inf)
    low = -_spread(-low, rows, 0, -np.inf)
    if cols or rows:
        near = _spread(near, rows, 0, True)
        slope[near] = -slope[near] - np.float32(1e-9)
    slope[unknown] = np.inf
    return Halo(slope, high, low, cols, rows)


def _cells(
    field: Field, z: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Steepest slope, highest and lowest node of each cell; NaN where one of them is unknown."""
    a, b, c, d = z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]
    east, south = z[:, 1:] - z[:, :-1], z[1:] - z[:-1]
    # The gradient of a bilinear patch is largest in a corner.
    across = np.maximum(np.abs(east[:-1]), np.abs(east[1:])) * (1.0 / field.step_x)
    down = np.maximum(np.abs(south[:, :-1]), np.abs(south[:, 1:])) * (1.0 / field.step_y)
    steep = np.sqrt(across * across + down * down) * (1.0 + 1e-6)
    most, least = np.maximum(np.maximum(a, b), np.maximum(c, d)), np.minimum(np.minimum(a, b), np.minimum(c, d))
    return (
        steep.astype(np.float32),
        (most + (1e-4 + 1e-6 * np.abs(most))).astype(np.float32),
        (least - (1e-4 + 1e-6 * np.abs(least))).astype(np.float32),
    )


def _spread(a: NDArray[Any], reach: int, axis: int, beyond: float | bool) -> NDArray[Any]:
    """Greatest of ``a`` within ``reach`` places along ``axis``; ``beyond`` the border it is that."""
    if reach == 0:
        return a
    if reach > FEW_STEPS:
        from scipy import ndimage

        kind = np.uint8 if a.dtype == np.bool_ else a.dtype
        spread = ndimage.maximum_filter1d(a.astype(kind), 2 * reach + 1, axis, mode="constant", cval=beyond)
        return np.asarray(spread.astype(a.dtype))
    source, out = (a, a.copy()) if axis == 0 else (a.T, a.copy().T)
    for step in range(1, reach + 1):
        np.maximum(out[step:], source[:-step], out=out[step:])
        np.maximum(out[:-step], source[step:], out=out[:-step])
    if beyond:
        np.maximum(out[:reach], beyond, out=out[:reach])
        np.maximum(out[-reach:], beyond, out=out[-reach:])
    return out if axis == 0 else out.T
