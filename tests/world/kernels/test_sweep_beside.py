"""The surface beside a short segment: against dense samples of all places within reach."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.neighbourhood import unknown_gaps
from gcsplan.world.kernels.sweep_beside import bar_above, beside_point, deepest, unknown_near

CELL_M = 10.0
GRID = GridMap.affine(0.0, 110.0, CELL_M, CELL_M)
FIELD = Field.of(GRID)
NEED_M = 5.0


def rough(seed: int) -> Floats:
    return np.random.default_rng(seed).normal(100.0, 8.0, (12, 12))


def sampled(z: Floats, start: Floats, end: Floats, reach_m: float) -> float:
    """The deepest break at samples of the segment and of the disc around each."""
    surface = Surface(z, z, GRID)
    t = np.linspace(0.0, 1.0, 81)
    places = start + t[:, None] * (end - start)
    turn, part = np.linspace(0.0, 2.0 * math.pi, 64, endpoint=False), np.linspace(0.0, 1.0, 9)[:, None]
    off = reach_m * np.stack([part * np.cos(turn), part * np.sin(turn)], axis=-1).reshape(-1, 2)
    beside = places[:, None, :2] + off
    ground = surface.ground_at(beside[..., 0].ravel(), beside[..., 1].ravel()).reshape(beside.shape[:2])
    return float((NEED_M - (places[:, None, 2] - ground)).max())


@pytest.mark.parametrize("seed", range(8))
def test_the_deepest_break_beside_a_segment_is_found(seed: int) -> None:
    z, rng = rough(seed), np.random.default_rng([seed, 1])
    start, end = np.append(rng.uniform(45.0, 65.0, 2), 104.0), np.append(rng.uniform(45.0, 65.0, 2), 108.0)
    reach_m = float(rng.uniform(3.0, 12.0))
    stack = np.empty((256, 8))
    depth, at, worked = deepest(FIELD.packed, z, 1.0, *start.tolist(), *end.tolist(), NEED_M, reach_m, 0.0, stack, True)
    expected = sampled(z, start, end, reach_m)
    assert expected > 1.0
    assert 0.9 * expected - 0.02 <= depth <= 1.1 * expected + 0.3
    assert 0.0 <= at <= 1.0
    assert worked > 0


def test_a_break_counts_only_if_it_is_deeper_than_the_known_one() -> None:
    z = rough(1)
    stack = np.empty((256, 8))
    _, at, _ = deepest(FIELD.packed, z, 1.0, 50.0, 50.0, 100.0, 60.0, 60.0, 100.0, NEED_M, 8.0, 1000.0, stack, True)
    assert at < 0.0
    assert bar_above(1000.0) > 1000.0


def test_places_around_a_point_are_read_at_its_reach() -> None:
    east, north = np.meshgrid(np.arange(12) * CELL_M, 110.0 - np.arange(12) * CELL_M)
    slope = 100.0 + 0.2 * east + 0.0 * north
    depth = beside_point(FIELD.packed, slope, 1.0, 55.0, 55.0, 111.0, NEED_M, 10.0)
    assert depth == pytest.approx(NEED_M + 2.0)  # 10 m farther east the ground is 2 m higher


NO_GAPS = np.zeros((0, 0), np.int8)


def test_the_nearest_unknown_patch_is_found_and_none_is_infinitely_far() -> None:
    z = rough(2)
    args = (3, 3, 52.0, 55.0, 58.0, 55.0, 30.0, 5, 5, math.inf)
    assert unknown_near(FIELD.packed, z, NO_GAPS, *args)[0] == math.inf
    assert unknown_near(FIELD.packed, z, unknown_gaps(z), *args)[0] == math.inf
    z[5, 8] = math.nan  # its four cells begin at column 7, 70 m east
    for gaps in (NO_GAPS, unknown_gaps(z)):
        far_m, at = unknown_near(FIELD.packed, z, gaps, *args)
        assert (far_m, at) == pytest.approx((12.0, 1.0))
        assert unknown_near(FIELD.packed, z, gaps, *args[:-1], 11.0)[0] == 11.0


@pytest.mark.slow
@pytest.mark.nightly_but("1", "6")
@pytest.mark.parametrize("seed", range(12))
def test_columns_find_the_unknown_patch_that_looking_at_every_cell_finds(seed: int) -> None:
    rng = np.random.default_rng([seed, 2])
    rows, cols = (int(n) for n in rng.integers(3, 300, 2))
    z = np.full((rows, cols), 100.0)
    holes = int(rng.integers(0, 4))
    z[rng.integers(0, rows, holes), rng.integers(0, cols, holes)] = math.nan
    gaps, field = unknown_gaps(z), Field.of(GridMap.affine(0.0, rows * 7.0, 5.0, 7.0))
    for _ in range(25):
        i, j = int(rng.integers(0, cols - 1)), int(rng.integers(0, rows - 1))
        ends = [(x, rows * 7.0 - y) for x, y in (rng.uniform((i, j), (i + 1, j + 1), (2, 2)) * (5.0, 7.0)).tolist()]
        reach = int(rng.integers(1, 80)), int(rng.integers(1, 200))
        args = (*reach, *ends[0], *ends[1], 50.0, i, j, math.inf)
        expected = unknown_near(field.packed, z, NO_GAPS, *args)
        assert unknown_near(field.packed, z, gaps, *args)[0] == pytest.approx(expected[0], abs=1e-9)


def test_gaps_are_rows_to_the_nearest_unknown_cell_of_the_column_or_the_border() -> None:
    rng = np.random.default_rng(5)
    z = np.full((400, 6), 100.0)
    z[rng.integers(0, 400, 3), rng.integers(0, 6, 3)] = math.nan
    lost = np.isnan(z[:-1, :-1] + z[:-1, 1:] + z[1:, :-1] + z[1:, 1:])
    for i in range(5):
        unknown = [-1, *np.flatnonzero(lost[:, i]).tolist(), 399]
        expected = [min(127, min(abs(j - k) for k in unknown)) for j in range(399)]
        assert unknown_gaps(z)[:, i].tolist() == expected
