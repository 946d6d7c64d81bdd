"""The papers' worlds: flat ground, and sums of Gaussian peaks on a grid whose surface is never below the true one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.world.geometry.surface import GridMap
from gcsplan.world.geometry.zones import Box

TARGET_ERROR_M = 0.01
"""The gridded surface lies at most this far above the true one, m, if `MAX_PEAK_NODES` permits."""

MAX_PEAK_NODES = 4_000_000
_COARSEST = 32  # least number of cells along the shorter side


@dataclass(frozen=True, slots=True)
class Peak:
    """``height_m · exp(-((x - east_m)/decay_east_m)² - ((y - north_m)/decay_north_m)²)`` (krill paper, eq. 9)."""

    east_m: float
    north_m: float
    height_m: float
    decay_east_m: float
    decay_north_m: float


def flat_grid(base_m: float, box: Box) -> tuple[Floats, GridMap]:
    """Heights (2, 2) and grid of level ground over ``box``."""
    west, south, east, north = box
    return np.full((2, 2), base_m), GridMap.affine(west, north, east - west, north - south)


def peaks_grid(base_m: float, peaks: Sequence[Peak], box: Box, most_nodes: int | None = None) -> tuple[Floats, GridMap]:
    """Heights (rows, cols) and grid of ``base_m`` plus the peaks over ``box``.

    Between the nodes the bilinear surface is never below the true one: a chord lies below a concave curve by at most
    ``h²/8`` times its curvature, so each node is raised by that bound over the cells around it. If that needs more than
    `MAX_PEAK_NODES` nodes, the grid is coarser. With ``most_nodes`` InputError is raised instead, if that many do not
    suffice.
    """
    west, south, east, north = box
    width, height = east - west, north - south
    # The sharpest curvature anywhere in the box, cell by cell, decides the spacing.
    coarse = 256
    fraction = np.arange(coarse + 1) / coarse
    xs: Floats = west + width * fraction
    ys: Floats = south + height * fraction
    in_x, in_y = _concavity(peaks, xs, ys)
    sharpest = float((in_x + in_y).max())
    spacing = math.sqrt(8.0 * TARGET_ERROR_M / sharpest) if sharpest > 0.0 else math.inf
    spacing = min(spacing, min(width, height) / _COARSEST)
    cols, rows = math.ceil(width / spacing), math.ceil(height / spacing)
    if most_nodes is not None and (cols + 1) * (rows + 1) > min(most_nodes, MAX_PEAK_NODES):
        raise InputError(f"the peaks need {cols + 1} × {rows + 1} nodes, more than {min(most_nodes, MAX_PEAK_NODES)}")
    if (cols + 1) * (rows + 1) > MAX_PEAK_NODES:
        shrink = math.sqrt(MAX_PEAK_NODES / ((cols + 1) * (rows + 1)))
        cols, rows = max(1, math.floor((cols + 1) * shrink) - 1), max(1, math.floor((rows + 1) * shrink) - 1)
    dx, dy = width / cols, height / rows
    xs = np.asarray(west + dx * np.arange(cols + 1), dtype=np.float64)
    ys = np.asarray(north - dy * np.arange(rows + 1), dtype=np.float64)
    in_x, in_y = _concavity(peaks, xs, ys)
    lift = np.zeros((rows + 1, cols + 1))
    cell = dx * dx / 8.0 * in_x + dy * dy / 8.0 * in_y
    for j in (0, 1):
        for i in (0, 1):
            part = lift[j : j + rows, i : i + cols]
            np.maximum(part, cell, out=part)
    for p in peaks:
        with np.errstate(under="ignore"):
            lift += p.height_m * np.outer(
                np.exp(-(((ys - p.north_m) / p.decay_north_m) ** 2)), np.exp(-(((xs - p.east_m) / p.decay_east_m) ** 2))
            )
    return base_m + lift, GridMap.affine(west, north, dx, dy)


def _concavity(peaks: Sequence[Peak], xs: Floats, ys: Floats) -> tuple[Floats, Floats]:
    """Upper bounds of ``max(0, -f_xx)`` and ``max(0, -f_yy)`` in each cell, (len(ys) - 1, len(xs) - 1), 1/m."""
    in_x = np.zeros((len(ys) - 1, len(xs) - 1))
    in_y = np.zeros_like(in_x)
    for p in peaks:
        near_x, far_x = _squares(xs, p.east_m, p.decay_east_m)
        near_y, far_y = _squares(ys, p.north_m, p.decay_north_m)
        with np.errstate(under="ignore"):
            in_x += 2.0 * abs(p.height_m) / p.decay_east_m**2 * np.outer(
                np.exp(-near_y), _bend(near_x, far_x, p.height_m > 0)
            )  # fmt: skip
            in_y += 2.0 * abs(p.height_m) / p.decay_north_m**2 * np.outer(
                _bend(near_y, far_y, p.height_m > 0), np.exp(-near_x)
            )  # fmt: skip
    return in_x, in_y


def _squares(at: Floats, centre: float, decay: float) -> tuple[Floats, Floats]:
    """Least and greatest ``((x - centre)/decay)²`` between neighbouring values."""
    u = (at - centre) / decay
    a, b = u[:-1], u[1:]
    near = np.where(a * b <= 0.0, 0.0, np.minimum(np.abs(a), np.abs(b)))
    return near**2, np.maximum(np.abs(a), np.abs(b)) ** 2


def _bend(near: Floats, far: Floats, hill: bool) -> Floats:
    """Largest concave part of the second derivative over t in [near, far], in units of 2·height/decay².

    The second derivative is ``(2t - 1)·exp(-t)``. On a hill its negative is the concave part: it falls to 0 at t = 0.5
    and is 0 beyond. In a pit the concave part is the derivative itself, largest at t = 1.5.
    """
    with np.errstate(under="ignore"):
        if hill:
            return np.asarray(np.maximum(0.0, 1.0 - 2.0 * near) * np.exp(-near))
        t = np.clip(1.5, near, far)
        return np.asarray(np.maximum(0.0, 2.0 * t - 1.0) * np.exp(-t))
