"""Level ground cut into cells: a terrain model of two by two nodes is a single cell, too coarse for a lattice."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.problem import Problem, terminals_of
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.surface import GridMap, Surface

FEW = 64
"""A level terrain model of at most this many nodes is replaced."""
NODES = 65
"""Nodes along each side of the terrain model that replaces it."""
MARGIN = 0.02
"""Part by which the new model extends beyond the places that paths can reach."""


def in_window(incumbent: Incumbent) -> Problem:
    """The incumbent's problem with its level ground cut into cells, over the area that a better path could reach; the
    unchanged problem if its terrain model is not level or has many nodes."""
    problem = incumbent.problem
    surface = problem.airspace.surface
    ground, top = surface.ground_m, surface.top_m
    if ground.size > FEW or surface.level_m is None:
        return problem
    rows, cols = ground.shape
    corners = surface.grid.to_plane([0.0, cols - 1.0], [rows - 1.0, 0.0])
    low, high = corners.min(axis=0), corners.max(axis=0)
    length_m = incumbent.longest(math.inf)
    if math.isfinite(length_m):
        places = np.array(terminals_of(problem))
        straight = float(np.hypot(*np.diff(places, axis=0).T).sum())
        # No place of a track of that length is farther outside the terminals' box.
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
