"""Plane geometry of the exact check's kernels: against shapely, samples and the map itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from gcsplan.world.geometry.surface import GridMap
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.sweep import parts_of, plane_per_cell, point_segment, segment_box, slab, to_grid, within

SEEDS = range(6)


def curved() -> GridMap:
    """A map to the grid that is bent and turned."""

    def exact(e: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 40.0 + 0.03 * e + 0.004 * n + 1e-7 * e * n, 50.0 - 0.031 * n + 0.002 * e + 2e-7 * e**2

    return GridMap.fit(exact, (-1000.0, -1000.0, 1000.0, 1000.0))


@pytest.mark.parametrize("seed", SEEDS)
def test_distances_from_segments_are_those_of_shapely(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(50):
        px, py, ax, ay, bx, by = rng.uniform(-10.0, 10.0, 6).tolist()
        far_m, t = point_segment(px, py, ax, ay, bx, by)
        assert far_m == pytest.approx(shapely.Point(px, py).distance(shapely.LineString([(ax, ay), (bx, by)])))
        assert math.dist((px, py), (ax + t * (bx - ax), ay + t * (by - ay))) == pytest.approx(far_m)


def test_a_segment_without_length_is_a_point() -> None:
    assert point_segment(3.0, 4.0, 0.0, 0.0, 0.0, 0.0) == (5.0, 0.0)


@pytest.mark.parametrize("seed", SEEDS)
def test_distances_from_boxes_are_those_of_shapely(seed: int) -> None:
    rng = np.random.default_rng([seed, 1])
    for _ in range(50):
        ax, ay, bx, by = rng.uniform(-10.0, 10.0, 4).tolist()
        (x0, x1), (y0, y1) = np.sort(rng.uniform(-4.0, 4.0, (2, 2))).tolist()
        box, line = shapely.box(x0, y0, x1, y1), shapely.LineString([(ax, ay), (bx, by)])
        far_m, t = segment_box(ax, ay, bx, by, x0, y0, x1, y1)
        assert far_m == pytest.approx(box.distance(line))
        assert box.distance(shapely.Point(ax + t * (bx - ax), ay + t * (by - ay))) == pytest.approx(far_m)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_part_of_a_segment_near_a_box_is_that_of_its_samples(seed: int) -> None:
    rng = np.random.default_rng([seed, 2])
    for _ in range(20):
        ax, ay, dx, dy = rng.uniform(-10.0, 10.0, 4).tolist()
        (x0, x1), (y0, y1) = np.sort(rng.uniform(-4.0, 4.0, (2, 2))).tolist()
        reach = float(rng.uniform(0.1, 5.0))
        first, last = within(ax, ay, dx, dy, x0, y0, x1, y1, reach)
        t = np.linspace(0.0, 1.0, 2001)
        near = t[shapely.distance(shapely.box(x0, y0, x1, y1), shapely.points(ax + t * dx, ay + t * dy)) <= reach]
        if not len(near):
            assert last - first < 1e-3
        else:
            assert (first, last) == pytest.approx((near[0], near[-1]), abs=1e-3)


def test_a_slab_holds_what_lies_within_it() -> None:
    assert slab(0.0, 2.0, 1.0, 5.0, 0.0, 1.0) == (0.5, 1.0)
    assert slab(6.0, -2.0, 1.0, 5.0, 0.0, 9.0) == (0.5, 2.5)
    assert slab(3.0, 0.0, 1.0, 5.0, 0.0, 1.0) == (0.0, 1.0)
    empty = slab(0.0, 0.0, 1.0, 5.0, 0.0, 1.0)
    assert empty[0] > empty[1]


@pytest.mark.parametrize("grid", [curved(), GridMap.affine(10.0, 990.0, 7.0, 9.0)], ids=["curved", "affine"])
def test_the_packed_map_is_the_map(grid: GridMap) -> None:
    m = Field.of(grid).packed
    for e, n in np.random.default_rng(3).uniform(-900.0, 900.0, (40, 2)).tolist():
        assert to_grid(m, e, n) == pytest.approx(grid(e, n).tolist())
        inverse = np.linalg.inv(grid.jacobian(*grid(e, n).tolist()))
        there = np.array(plane_per_cell(m, e, n)).reshape(2, 2)
        step = grid(np.array([e, e + 1e-3, e]), np.array([n, n, n + 1e-3]))
        per_metre = ((step[1:] - step[0]) / 1e-3).T
        np.testing.assert_allclose(there @ per_metre, np.eye(2), atol=1e-4)
        assert inverse.shape == (2, 2)


def test_beyond_the_fitted_square_a_curved_map_knows_nothing() -> None:
    assert all(math.isnan(x) for x in to_grid(Field.of(curved()).packed, 5000.0, 0.0))


def test_a_leg_has_as_many_parts_as_its_bow_needs() -> None:
    m = Field.of(curved()).packed
    parts, bow_m = parts_of(m, 1500.0, 1e-4)
    whole_m = parts_of(m, 1500.0, math.inf)
    assert whole_m[0] == 1
    assert bow_m <= 1e-4 < whole_m[1] / (parts - 1) ** 2
    assert bow_m == pytest.approx(whole_m[1] / parts**2)
