"""A zone's own ground, read around nodes for paths and cell by cell for bounds, against dense samples and all cells."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.navmesh.zone_kernels import (
    BESIDE,
    EAST,
    NORTH,
    NUMBERS,
    PLACES,
    RADIUS,
    RIM,
    TOP_AGL,
    depth,
    look_beside,
    lowest_and_highest,
    value_at,
)

STEP_M, OWN_M, REACH_M, NODES = 10.0, 60.0, 33.0, 31
MIDDLE_M = 0.5 * STEP_M * (NODES - 1)
NO_EDGES = np.zeros((0, 4))


def lattice(seed: int) -> tuple[Floats, Floats, Floats]:
    """Ground on a slope with bumps, and x and y of its nodes."""
    x, y = np.meshgrid(STEP_M * np.arange(NODES), STEP_M * np.arange(NODES))
    return 0.3 * x - 0.1 * y + np.random.default_rng(seed).uniform(-1.0, 1.0, x.shape), x, y


def disc() -> Floats:
    """A zone of `OWN_M` metres around the middle, grown by the reach, whose top follows the ground."""
    zones = np.zeros((1, NUMBERS))
    zones[0, [EAST, NORTH, RADIUS, TOP_AGL]] = MIDDLE_M, MIDDLE_M, OWN_M + REACH_M, BESIDE
    return zones


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_nodes_see_the_ground_under_the_zone_within_reach(seed: int) -> None:
    ground, x, y = lattice(seed)
    zones, boxes = disc(), np.array([[0, NODES - 2, 0, NODES - 2]], np.int32)
    around = np.tile(np.array([0, NODES], np.int32), (NODES, 1))
    up, down = np.empty(x.shape), np.empty(x.shape)
    look_beside(
        around, np.zeros(x.shape), ground, ground, x, y, 1, zones, NO_EDGES, boxes, 0, REACH_M, 0.0, REACH_M * PLACES,
        up, down, np.zeros(1, np.int64),
    )  # fmt: skip
    away = np.hypot(x - MIDDLE_M, y - MIDDLE_M)
    assert np.isneginf(up[away > OWN_M + REACH_M]).all()
    side = np.arange(-REACH_M, REACH_M + 0.1, 1.5)
    off = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    off = off[np.hypot(*off.T) <= REACH_M]
    for j, i in np.argwhere(away < OWN_M + 0.7 * REACH_M)[::7].tolist():
        places = off + np.array([x[j, i], y[j, i]])
        own = places[np.hypot(*(places - MIDDLE_M).T) <= OWN_M + RIM * REACH_M]
        heights = [value_at(ground, 1, n / STEP_M, e / STEP_M) for e, n in own.tolist()]
        assert max(heights) - 2.5 <= ground[j, i] + up[j, i] <= max(heights) + 0.5
        assert min(heights) - 0.5 <= ground[j, i] - down[j, i] <= min(heights) + 2.5


def covered(x: Floats, y: Floats, cell: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether another cell lies wholly in the zone's own shape, each corner within reach of that of ``cell``."""
    for v, u in ((0, 0), (0, 1), (1, 0), (1, 1)):
        at, to = (cell[0] + v, cell[1] + u), (other[0] + v, other[1] + u)
        if math.hypot(x[at] - x[to], y[at] - y[to]) > REACH_M:
            return False
        if depth(disc(), NO_EDGES, 0, x[to], y[to]) <= REACH_M:
            return False
    return True


@pytest.mark.parametrize("seed", [1, 2])
def test_cells_name_ground_that_is_the_zones_own_and_within_reach(seed: int) -> None:
    ground, x, y = lattice(seed)
    found = 0
    for cell in [(14, 14), (10, 12), (15, 9), (18, 18), (8, 15), (2, 2)]:
        low_j, low_i, high_j, high_i, _ = lowest_and_highest(
            ground, x, y, 1, disc(), NO_EDGES, 0, REACH_M, REACH_M, *cell
        )
        near = [(j, i) for j in range(cell[0] - 4, cell[0] + 5) for i in range(cell[1] - 4, cell[1] + 5)]
        own = [other for other in near if min(other) >= 0 and covered(x, y, cell, other)]
        if not own:
            assert (low_j, low_i, high_j, high_i) == (-1, -1, -1, -1)
            continue
        found += 1
        assert {(low_j, low_i), (high_j, high_i)} <= set(own)
        heights = {(j, i): ground[j, i] + ground[j + 1, i + 1] for j, i in own}
        assert heights[low_j, low_i] <= heights[cell] if cell in heights else True
        spread = max(heights.values()) - min(heights.values())
        assert heights[high_j, high_i] - heights[low_j, low_i] >= 0.6 * spread
    assert found >= 4
