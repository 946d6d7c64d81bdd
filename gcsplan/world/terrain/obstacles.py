"""Obstacles on the ground: one height everywhere, or a canopy raster that is never under-estimated between nodes."""

from __future__ import annotations

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.world.geometry.surface import GridMap
from gcsplan.world.terrain.mosaic import Window

TALLEST_M = 250.0
"""A canopy cell above this, m (or below -1 m) is an undeclared nodata value: unknown. The tallest tree has 116 m."""

_PAD_CELLS = 0.02  # a part of a DEM cell, far above the bows of pixel edges and the fit's error
_CHUNK_CELLS = 200_000  # at once: a hundred megabytes of corners and indices


def canopy_on(ground: Window, canopy: Window, *, unknown_m: float = np.nan) -> Floats:
    """Obstacle height at each node of ``ground``, (rows, cols) metres; NaN where the canopy is unknown.

    A canopy value holds for its whole pixel. Each DEM cell gets the greatest value of the pixels that it meets, each
    node the greatest of its four cells, so the bilinear surface over the nodes is nowhere below ground plus canopy.
    The canopy's heights are changed in place.
    ``unknown_m`` is the height of nodata pixels and of everything outside the canopy raster.
    """
    heights = canopy.heights_m
    heights[~((heights >= -1.0) & (heights <= TALLEST_M))] = unknown_m
    np.maximum(heights, 0.0, out=heights)  # NaN stays NaN
    rows, cols = ground.heights_m.shape
    to_ground = _grid_to_grid(canopy, ground)
    cells = np.zeros((rows - 1, cols - 1))
    # Coarse pixels are cut into parts no larger than a DEM cell, so that each part meets few cells.
    parts = max(1, int(np.ceil(_largest_pixel(canopy, to_ground))))
    fine_cols = heights.shape[1] * parts
    step = max(1, _CHUNK_CELLS // fine_cols)
    for first in range(0, heights.shape[0] * parts, step):
        n = min(step, heights.shape[0] * parts - first)
        j, i = np.arange(first, first + n), np.arange(fine_cols)
        corner_col = (np.arange(fine_cols + 1) / parts) - 0.5
        corner_row = (np.arange(first, first + n + 1) / parts) - 0.5
        at = to_ground(corner_col, corner_row[:, None])
        _raise_cells(cells, at, heights[np.ix_(j // parts, i // parts)])
    _outside(cells, ground, canopy, unknown_m)
    nodes = np.zeros((rows, cols))
    for dj in (0, 1):
        for di in (0, 1):
            part = nodes[dj : dj + rows - 1, di : di + cols - 1]
            np.maximum(part, cells, out=part)
    return nodes


def _raise_cells(cells: Floats, at: Floats, heights: Floats) -> None:
    """Raise each DEM cell to the pixels that it meets; ``at`` (n + 1, m + 1, 2) are their corners on the DEM grid."""
    corners = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]])
    low = np.floor(corners.min(axis=0) - _PAD_CELLS).astype(np.intp)
    high = np.floor(corners.max(axis=0) + _PAD_CELLS).astype(np.intp)
    span = (high - low).max(axis=(0, 1))
    for dr in range(int(span[1]) + 1):
        for dc in range(int(span[0]) + 1):
            c, r = low[..., 0] + dc, low[..., 1] + dr
            hit = (c <= high[..., 0]) & (r <= high[..., 1])
            hit &= (c >= 0) & (c < cells.shape[1]) & (r >= 0) & (r < cells.shape[0])
            np.maximum.at(cells, (r[hit], c[hit]), heights[hit])


def _outside(cells: Floats, ground: Window, canopy: Window, unknown_m: float) -> None:
    """Raise the cells that are not wholly on the canopy raster to ``unknown_m`` (a pixel there may be higher)."""
    to_canopy = _grid_to_grid(ground, canopy)
    rows, cols = ground.heights_m.shape
    step = max(1, _CHUNK_CELLS // cols)
    for first in range(0, rows - 1, step):
        n = min(step, rows - 1 - first)
        at = to_canopy(np.arange(cols), np.arange(first, first + n + 1)[:, None])
        limit = np.asarray(canopy.heights_m.shape[::-1]) - 0.5
        inside = np.asarray(((at >= -0.5) & (at <= limit)).all(axis=-1))
        whole = inside[:-1, :-1] & inside[:-1, 1:] & inside[1:, :-1] & inside[1:, 1:]
        part = cells[first : first + n]
        part[~whole] = np.maximum(part[~whole], unknown_m)


def _grid_to_grid(source: Window, target: Window) -> GridMap:
    """The map from columns and rows of one window to columns and rows of another, through the plane."""

    def exact(col: Floats, row: Floats) -> tuple[Floats, Floats]:
        plane = source.grid.to_plane(col, row)
        at = target.grid(plane[..., 0], plane[..., 1])
        return at[..., 0], at[..., 1]

    rows, cols = source.heights_m.shape
    return GridMap.fit(exact, (-0.5, -0.5, cols - 0.5, rows - 0.5))


def _largest_pixel(canopy: Window, to_ground: GridMap) -> float:
    """Side of a canopy pixel in DEM cells, the largest of nine places."""
    rows, cols = canopy.heights_m.shape
    sizes = [
        np.abs(to_ground.jacobian(c, r)).sum(axis=1).max()
        for c in np.linspace(0, cols - 1, 3)
        for r in np.linspace(0, rows - 1, 3)
    ]
    return float(max(sizes))
