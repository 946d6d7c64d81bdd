"""Heights of merged cells, and places of a lattice's nodes: against every node of the terrain model."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.planners.optimal.navmesh.clearance_kernels import lay, pool


def bilinear(z: Floats, stride: int) -> Floats:
    """All nodes of the terrain model between the nodes of merged cells."""
    rows, cols = z.shape
    t = np.arange((rows - 1) * stride + 1) / stride
    u = np.arange((cols - 1) * stride + 1) / stride
    j, i = np.minimum(t.astype(int), rows - 2), np.minimum(u.astype(int), cols - 2)
    v, w = (t - j)[:, None], (u - i)[None]
    a, b, c, d = z[np.ix_(j, i)], z[np.ix_(j, i + 1)], z[np.ix_(j + 1, i + 1)], z[np.ix_(j + 1, i)]
    return np.asarray(a * (1 - v) * (1 - w) + b * (1 - v) * w + c * v * w + d * v * (1 - w))


@pytest.mark.parametrize("stride", [2, 3, 5])
@pytest.mark.parametrize("seed", range(4))
def test_merged_cells_lie_nowhere_above_and_nowhere_below_the_terrain(seed: int, stride: int) -> None:
    z = np.random.default_rng(seed).normal(100.0, 20.0, (4 * stride + 1, 5 * stride + 1))
    low, high = np.empty((5, 6)), np.empty((5, 6))
    pool(z, np.array([0, 0, z.shape[1] - 1, z.shape[0] - 1]), stride, low, high)
    northward = z[::-1]
    assert (bilinear(low, stride) <= northward + 1e-9).all()
    assert (bilinear(high, stride) >= northward - 1e-9).all()
    assert (high - low < 200.0).all()


def test_an_unknown_node_shuts_merged_cells_for_paths_and_is_ignored_for_bounds() -> None:
    z = np.full((5, 5), 50.0)
    z[2, 1] = math.nan
    low, high = np.empty((3, 3)), np.empty((3, 3))
    pool(z, np.array([0, 0, 4, 4]), 2, low, high)
    assert np.isinf(high[:, :2]).all()
    assert (high[:, 2] == 50.0).all()
    assert (low == 50.0).all()


def test_nodes_lie_between_the_corners_and_cells_out_of_reach_are_left_out() -> None:
    corner_x, corner_y = np.meshgrid(np.arange(4) * 40.0, np.arange(3) * 40.0)
    x, y, inside = np.empty((9, 13)), np.empty((9, 13)), np.ones((8, 12), np.bool_)
    lay(corner_x, corner_y, 4, 20.0, 40.0, 100.0, 40.0, 100.0, x, y, inside)
    np.testing.assert_allclose(x, np.broadcast_to(np.arange(13) * 10.0, (9, 13)))
    np.testing.assert_allclose(y, np.broadcast_to(np.arange(9)[:, None] * 10.0, (9, 13)))
    sums = np.hypot(x - 20.0, y - 40.0) + np.hypot(x - 100.0, y - 40.0)
    within = sums <= 100.0
    expected = within[:-1, :-1] & within[:-1, 1:] & within[1:, :-1] & within[1:, 1:]
    assert np.array_equal(inside, expected)
    assert expected.any()
    assert not expected.all()
