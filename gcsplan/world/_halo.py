"""What lies around each cell of a surface: the steepest slope, the highest and the lowest node within a reach."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gcsplan.world._sweep import Field

ROWS_AT_ONCE = 512  # bounds the memory of what is thrown away again


class Halo(NamedTuple):
    """Bounds over the known cells within ``cols`` and ``rows`` of each cell, (rows - 1, cols - 1) float32.

    ``slope`` (rise over run) is ``inf`` in a cell that is itself unknown, and negative (its size is the slope) where
    an unknown cell, or the border, lies within. ``high`` and ``low`` are AMSL metres; all three are rounded outward.
    """

    slope: NDArray[np.float32]
    high: NDArray[np.float32]
    low: NDArray[np.float32]
    cols: int
    rows: int

    @classmethod
    def around(cls, field: Field, heights: NDArray[np.float64], reach_m: float) -> Halo:
        """Bounds for every point within ``reach_m`` of a point of the cell."""
        cols, rows = (math.ceil(reach_m / step) for step in (field.step_x, field.step_y))
        slope, high, low = (np.empty((heights.shape[0] - 1, heights.shape[1] - 1), np.float32) for _ in range(3))
        for at in range(0, len(slope), ROWS_AT_ONCE):
            to = min(at + ROWS_AT_ONCE, len(slope))
            z = heights[at : to + 1]
            a, b, c, d = z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]
            # The gradient of a bilinear patch is largest in a corner.
            across = np.maximum(np.abs(b - a), np.abs(d - c)) / field.step_x
            down = np.maximum(np.abs(c - a), np.abs(d - b)) / field.step_y
            slope[at:to] = np.hypot(across, down) * (1.0 + 1e-6)
            most, least = np.maximum(np.maximum(a, b), np.maximum(c, d)), np.minimum(np.minimum(a, b), np.minimum(c, d))
            high[at:to] = most + 1e-4 + 1e-6 * np.abs(most)
            low[at:to] = least - 1e-4 - 1e-6 * np.abs(least)
        unknown = np.isnan(slope)
        slope[unknown] = 0.0
        if cols or rows:
            high[unknown] = -np.inf
            low[unknown] = np.inf
            near = unknown.astype(np.uint8)
            for axis, size in ((1, 2 * cols + 1), (0, 2 * rows + 1)):
                slope = ndimage.maximum_filter1d(slope, size, axis, mode="constant", cval=0.0)
                high = ndimage.maximum_filter1d(high, size, axis, mode="constant", cval=-np.inf)
                low = ndimage.minimum_filter1d(low, size, axis, mode="constant", cval=np.inf)
                near = ndimage.maximum_filter1d(near, size, axis, mode="constant", cval=1)
            slope = np.where(near, -slope - np.float32(1e-9), slope)
        slope[unknown] = np.inf
        return cls(slope, high, low, cols, rows)
