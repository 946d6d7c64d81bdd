"""Level ground cut into cells: a terrain model of two by two nodes has none that a lattice could look at alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gcsplan.planners.optimal.incumbent import Incumbent
from gcsplan.planners.problem import Problem, terminals_of
from gcsplan.world.airspace import Airspace
from gcsplan.world.surface import GridMap, Surface

FEW = 64
"""Nodes of a terrain model, at most, that are replaced where all are alike."""
NODES = 65
"""Along each side of what replaces it."""
MARGIN = 0.02
"""Beyond what paths can reach, as a part of that."""


def in_window(incumbent: Incumbent) -> Problem:
    """The incumbent's problem over ground that is cut into cells, as far as a better path could go; the same problem
    where its terrain model is no level one."""
    problem = incumbent.problem
    surface = problem.airspace.surface
    ground, top = surface.ground_m, surface.top_m
    if ground.size > FEW or not (np.ptp(ground) == 0.0 and np.ptp(top) == 0.0):
        return problem
    rows, cols = ground.shape
    corners = surface.grid.to_plane([0.0, cols - 1.0], [rows - 1.0, 0.0])
    low, high = corners.min(axis=0), corners.max(axis=0)
    length_m = incumbent.longest(math.inf)
    if math.isfinite(length_m):
        places = np.array(terminals_of(problem))
        straight = float(np.hypot(*np.diff(places, axis=0).T).sum())
        # No place of a track that long is farther from all terminals than this.
        reach = 0.5 * (length_m - straight) * (1.0 + MARGIN) + 0.5 * straight * MARGIN
        reach = max(reach, 0.5 * math.sqrt(max(length_m**2 - straight**2, 0.0)) * (1.0 + MARGIN)) + 1.0
        low, high = np.maximum(low, places.min(axis=0) - reach), np.minimum(high, places.max(axis=0) + reach)
    step = (high - low) / (NODES - 1)
    grid = GridMap.affine(float(low[0]), float(high[1]), float(step[0]), float(step[1]))
    heights = np.full((NODES, NODES), float(ground[0, 0]))
    tops = heights if top is ground else np.full((NODES, NODES), float(top[0, 0]))
    air = Airspace(
        Surface(heights, tops, grid, dict(surface.info)), problem.airspace.zones, scale=problem.airspace.scale
    )
    return replace(problem, airspace=air)
