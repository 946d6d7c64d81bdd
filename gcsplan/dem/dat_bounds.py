"""Bounds, on one post grid, of terrain that is bilinear between the posts of others.

In each cell of the grid a plane is fitted to the posts within a spacing of it. Whatever is bilinear between these posts
lies between that plane less the lowest of their distances from it and that plane plus the highest one. A node takes the
outermost value of the four cells around it, so that between nodes the bounds hold too. Over a plane they are the plane.
A cell whose posts lie in one row holds no ground between posts, and counts for no node.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gcsplan.arrays import Bools, Floats, Indices

REACH = 1.1
"""Spacings around a cell within which a post counts: one, and what the scales of two tiles differ by."""

FLATTEST = 1e-6
"""Posts whose places spread less than this, in squares of spacings, lie in one row or are one."""


def bounds(shape: tuple[int, int], row: Floats, col: Floats, high: Floats, low: Floats) -> tuple[Floats, Floats]:
    """(rows, cols) greatest and least heights of the nodes of a grid with that ``shape``.

    ``row``, ``col`` (N,): the posts' places, in spacings from the first node; ``high``, ``low`` (N,) their heights.
    NaN where no post is near, or where one that is near is unknown.
    """
    rows, cols = shape[0] + 1, shape[1] + 1  # cell (i, j) lies between the nodes i - 1 and i, j - 1 and j
    count = rows * cols
    near = (row > -3.0) & (row < shape[0] + 2.0) & (col > -3.0) & (col < shape[1] + 2.0)
    row, col, high, low = row[near], col[near], high[near], low[near]
    sums = np.zeros((9, count))
    for at, k, y, x in _posts_of_cells(row, col, rows, cols):
        h = high[k]
        for total, value in zip(sums, (None, x, y, x * x, x * y, y * y, h, x * h, y * h), strict=True):
            total += np.bincount(at, value, count)
    n, x, y, xx, xy, yy, h, xh, yh = sums
    n = np.where(n > 0.0, n, 1.0)
    x, y, h = x / n, y / n, h / n
    xx, xy, yy, xh, yh = xx / n - x * x, xy / n - x * y, yy / n - y * y, xh / n - x * h, yh / n - y * h
    spread = xx * yy - xy * xy
    some = spread > FLATTEST
    spread = np.where(some, spread, 1.0)
    along, across = (np.where(some, a / spread, 0.0) for a in (xh * yy - yh * xy, yh * xx - xh * xy))
    above, below = np.full(count, -np.inf), np.full(count, np.inf)
    for at, k, dy, dx in _posts_of_cells(row, col, rows, cols):
        plane = h[at] + along[at] * (dx - x[at]) + across[at] * (dy - y[at])
        with np.errstate(invalid="ignore"):  # unknown posts
            np.maximum.at(above, at, high[k] - plane)
            np.minimum.at(below, at, low[k] - plane)
    found = []
    for off, sign in ((above, 1.0), (below, -1.0)):
        node = np.full(shape, -np.inf)
        for i in (0, 1):
            for j in (0, 1):  # the node is the cell's corner in that direction from its middle
                value = h + off + along * (0.5 - j - x) + across * (0.5 - i - y)
                value = np.where(some, sign * value, -np.inf).reshape(rows, cols)
                node = np.maximum(node, value[i : i + shape[0], j : j + shape[1]])
        found.append(sign * np.where(np.isinf(node), np.nan, node))
    return found[0], found[1]


def _posts_of_cells(row: Floats, col: Floats, rows: int, cols: int) -> Iterator[tuple[Indices, Bools, Floats, Floats]]:
    """Each post with each cell that it is near to: the cell's number, which posts, their places from its middle."""
    down, left = np.floor(row).astype(int), np.floor(col).astype(int)
    for i in range(-1, 4):
        for j in range(-1, 4):
            r, c = down + i, left + j
            y, x = row - (r - 0.5), col - (c - 0.5)
            k = (np.abs(y) <= 0.5 + REACH) & (np.abs(x) <= 0.5 + REACH) & (r >= 0) & (r < rows) & (c >= 0) & (c < cols)
            if k.any():
                yield r[k] * cols + c[k], k, y[k], x[k]
