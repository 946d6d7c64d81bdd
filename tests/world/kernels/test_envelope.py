"""Bounds of a surface beside a track: the slope that they use is at least that of every place within the box."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.kernels.envelope import lift_beside, put, put_unknown, steepest_in
from gcsplan.world.kernels.field import Field
from gcsplan.world.kernels.neighbourhood import extrema_around

GRID = GridMap.affine(0.0, 110.0, 10.0, 10.0)
FIELD = Field.of(GRID)


@pytest.mark.parametrize("seed", range(6))
def test_the_steepest_slope_in_a_box_is_that_of_its_places(seed: int) -> None:
    rng = np.random.default_rng(seed)
    z = rng.normal(100.0, 5.0, (12, 12))
    slopes = extrema_around(FIELD, z, 10.0).slope
    (c0, c1), (r0, r1) = np.sort(rng.uniform(3.0, 6.0, (2, 2))).tolist()
    found = steepest_in(FIELD.packed, z, slopes, int(c0), int(r0), c0, r0, c1, r1)
    surface = Surface(z, z, GRID)
    c, r = (a.ravel() for a in np.meshgrid(np.linspace(c0, c1, 60), np.linspace(r0, r1, 60)))
    east, north = GRID.to_plane(c, r).T
    d = 1e-3
    across = (surface.ground_at(east + d, north) - surface.ground_at(east, north)) / d
    along = (surface.ground_at(east, north + d) - surface.ground_at(east, north)) / d
    within = (c + d / 10.0 < np.floor(c) + 1.0) & (r - d / 10.0 > np.floor(r))  # both places in one cell
    steepest = np.hypot(across, along)[within].max()
    assert steepest - 1e-6 <= found <= 1.5 * steepest


def test_the_surface_beside_a_segment_is_raised_by_its_slope_or_unknown() -> None:
    east = np.arange(12) * 10.0
    z = np.broadcast_to(100.0 + 0.3 * east, (12, 12)).copy()
    extrema = extrema_around(FIELD, z, 10.0)
    at = (52.0, 55.0, 58.0, 55.0, 5.2, 5.5, 5.8, 5.5, 5, 5, 10.0)
    assert lift_beside(FIELD.packed, z, extrema, *at) == pytest.approx(3.0)
    z[5, 7] = math.nan
    assert math.isnan(lift_beside(FIELD.packed, z, extrema_around(FIELD, z, 10.0), *at))


def test_pieces_that_do_not_fit_are_counted_all_the_same() -> None:
    rows = np.zeros((1, 7))
    count = put(rows, 0, 5.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert rows[0].tolist() == [5.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert put_unknown(rows, count, 9.0) == 2
    assert rows[0, 0] == 5.0
