"""The fitted map from plane to grid, against the exact projection; the bilinear surface, against a plain version."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pyproj import Transformer

from gcsplan.arrays import Floats
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import MAPPED_AT_ONCE, GridMap, Surface
from tests.support.effort import draws
from tests.support.planes import crs_of

FLAT = GridMap.affine(0.0, 0.0, 1.0, 1.0)  # column = east, row = south


class Exact:
    """The map from plane to nodes of a raster in ``epsg``, by pyproj alone; ``cell``: cell size in raster units."""

    def __init__(self, frame: Frame, epsg: int, cell: float) -> None:
        self.transformer = Transformer.from_crs(crs_of(frame), epsg, always_xy=True)
        self.cell = cell
        self.x0, self.y0 = self.transformer.transform(0.0, 0.0)

    def __call__(self, east_m: Floats, north_m: Floats) -> tuple[Floats, Floats]:
        x, y = self.transformer.transform(east_m, north_m)
        return (x - self.x0) / self.cell, (self.y0 - y) / self.cell


# EPSG code, cell size, and valid latitudes and longitudes: degrees, Mercator, two UTM zones, Albers, Lambert azimuthal.
RASTERS = [
    (4326, 1 / 1200, (-60.0, 60.0), (-179.0, 179.0)),
    (3857, 30.0, (-60.0, 60.0), (-179.0, 179.0)),
    (32616, 10.0, (0.0, 70.0), (-90.0, -84.0)),
    (32632, 10.0, (0.0, 70.0), (6.0, 12.0)),
    (5070, 30.0, (25.0, 48.0), (-120.0, -70.0)),
    (3035, 25.0, (35.0, 68.0), (-5.0, 30.0)),
]


@pytest.mark.nightly
@settings(max_examples=draws(14))
@given(st.data())
def test_the_fitted_grid_is_nowhere_farther_from_the_exact_one_than_it_says(data: st.DataObject) -> None:
    epsg, cell, lats, lons = data.draw(st.sampled_from(RASTERS))
    frame = Frame(data.draw(st.floats(*lats)), data.draw(st.floats(*lons)))
    half_m = data.draw(st.sampled_from([500.0, 10_000.0, 40_000.0, 120_000.0]))
    assume(epsg not in (4326, 3857) or abs(frame.lon_deg) < 177.0)
    exact = Exact(frame, epsg, cell)
    middle = data.draw(st.floats(-0.2, 0.2)) * half_m
    box = (middle - half_m, -half_m, middle + half_m, 0.8 * half_m)
    fitted = GridMap.fit(exact, box)
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    east, north = rng.uniform(box[0], box[2], 400), rng.uniform(box[1], box[3], 400)
    off = fitted(east, north) - np.stack(exact(east, north), axis=-1)
    worst = np.argsort(np.linalg.norm(off, axis=1))[-8:]
    for i in worst:
        in_plane = np.linalg.solve(fitted.jacobian(east[i], north[i]), off[i])
        assert np.linalg.norm(in_plane) <= fitted.error_m + 1e-9
    limit_m = {500.0: 1e-6, 10_000.0: 1e-6, 40_000.0: 1e-6, 120_000.0: 1e-3}[half_m]
    assert fitted.error_m < limit_m


@pytest.mark.nightly
@settings(max_examples=draws(12))
@given(st.data())
def test_the_way_back_from_the_grid_closes(data: st.DataObject) -> None:
    epsg, cell, lats, lons = data.draw(st.sampled_from(RASTERS))
    frame = Frame(data.draw(st.floats(*lats)), data.draw(st.floats(*lons)))
    assume(epsg not in (4326, 3857) or abs(frame.lon_deg) < 177.0)
    half_m = data.draw(st.sampled_from([500.0, 40_000.0, 120_000.0]))
    fitted = GridMap.fit(Exact(frame, epsg, cell), (-half_m, -half_m, half_m, half_m))
    east, north = (a.ravel() for a in np.meshgrid(*(np.linspace(-half_m, half_m, 9),) * 2))
    at = fitted(east, north)
    back = fitted.to_plane(at[:, 0], at[:, 1])
    assert np.abs(back - np.stack([east, north], axis=-1)).max() < 1e-6


def test_rows_go_south_and_columns_go_east() -> None:
    frame = Frame(36.6, -84.3)
    fitted = GridMap.fit(Exact(frame, 4326, 1 / 1200), (-1000, -1000, 1000, 1000))
    jacobian = fitted.jacobian(0.0, 0.0)
    assert jacobian[0, 0] > 0
    assert jacobian[1, 1] < 0
    assert np.abs(fitted(0.0, 0.0)).max() < 1e-9
    # 3 arc seconds: 92.5 m along the meridian; along the parallel times the cosine of the latitude.
    dx, dy = fitted.metres_per_cell(0.0, 0.0)
    assert dy == pytest.approx(92.47, abs=0.05)
    assert dx == pytest.approx(dy * math.cos(math.radians(36.6)), rel=0.01)


@pytest.mark.nightly
def test_the_jacobian_is_the_slope_of_the_map() -> None:
    fitted = GridMap.fit(Exact(Frame(60.0, 20.0), 3035, 25.0), (-50_000, -50_000, 50_000, 50_000))
    for east, north in ((0.0, 0.0), (40_000.0, -30_000.0), (-50_000.0, 50_000.0)):
        step = 10.0
        by_east = (fitted(east + step, north) - fitted(east - step, north)) / (2 * step)
        by_north = (fitted(east, north + step) - fitted(east, north - step)) / (2 * step)
        assert fitted.jacobian(east, north) == pytest.approx(np.stack([by_east, by_north], axis=-1), rel=1e-6, abs=1e-9)


def test_an_affine_grid_is_exact() -> None:
    grid = GridMap.affine(100.0, 2000.0, 30.0, 10.0)
    assert grid.error_m == 0.0
    assert grid(100.0, 2000.0).tolist() == [0.0, 0.0]
    assert grid(160.0, 1970.0) == pytest.approx([2.0, 3.0])
    assert grid.metres_per_cell(0.0, 0.0) == pytest.approx([30.0, 10.0])
    assert grid.to_plane(2.0, 3.0) == pytest.approx([160.0, 1970.0])
    assert grid.to_plane([[2.0, 0.0]], [[3.0, 0.0]]).shape == (1, 2, 2)
    assert grid(np.zeros((3, 4)), np.zeros((3, 4))).shape == (3, 4, 2)


@pytest.mark.parametrize("count", [MAPPED_AT_ONCE, MAPPED_AT_ONCE + 1, 2 * MAPPED_AT_ONCE + 7])
def test_many_places_are_mapped_as_a_few_are(count: int) -> None:
    east, north = np.random.default_rng(count).uniform(-4000.0, 4000.0, (2, count))
    for grid in (GridMap.fit(Exact(Frame(47.0, 11.0), 4326, 1 / 1200), (-5000.0, -5000.0, 5000.0, 5000.0)), FLAT):
        few = np.concatenate([grid(east[k : k + 500], north[k : k + 500]) for k in range(0, count, 500)])
        assert grid(east, north) == pytest.approx(few, abs=1e-10)
        assert np.array_equal(grid(east[None, :], north[None, :])[0], grid(east, north))


# -- the surface --------------------------------------------------------------------------------------------------


def by_hand(z: Floats, col: float, row: float) -> float:
    """The textbook bilinear height; NaN outside, and where an unknown node has non-zero weight."""
    rows, cols = z.shape
    if not (0 <= col <= cols - 1 and 0 <= row <= rows - 1):
        return math.nan
    total = 0.0
    for r in range(rows):
        for c in range(cols):
            weight = max(0.0, 1 - abs(col - c)) * max(0.0, 1 - abs(row - r))
            if weight > 0.0:
                total += weight * float(z[r, c])
    return total


heights = st.one_of(st.floats(-400, 9000), st.just(math.nan))


@settings(max_examples=draws(100))
@given(st.data())
def test_heights_are_those_worked_out_by_hand_unknown_nodes_included(data: st.DataObject) -> None:
    rows, cols = data.draw(st.integers(2, 4)), data.draw(st.integers(2, 4))
    z = np.array(data.draw(st.lists(heights, min_size=rows * cols, max_size=rows * cols))).reshape(rows, cols)
    surface = Surface(z, z, FLAT)
    position = st.integers(-64, 320).map(lambda n: n / 64)
    for _ in range(4):
        col, row = data.draw(position), data.draw(position)
        found, wanted = float(surface.ground_at(col, -row)), by_hand(z, col, row)
        assert found == pytest.approx(wanted, rel=1e-9, abs=1e-6, nan_ok=True)


def test_an_unknown_node_is_unknown_up_to_its_neighbours_and_no_farther() -> None:
    z = np.array([[1.0, 2.0, 3.0], [4.0, np.nan, 6.0], [7.0, 8.0, 9.0]])
    surface = Surface(z, z, FLAT)
    assert float(surface.ground_at(0.0, -1.0)) == 4.0  # on the cell's edge the unknown node has weight 0
    assert float(surface.ground_at(0.5, 0.0)) == 1.5
    assert float(surface.ground_at(2.0, -1.5)) == 7.5
    assert np.isnan(surface.ground_at(1e-9, -1.0))
    assert np.isnan(surface.ground_at([0.01, 1.0, 1.99], [-0.01, -1.0, -1.99])).all()


def test_the_border_belongs_to_the_surface_and_nothing_beyond_it() -> None:
    z = np.arange(6.0).reshape(2, 3)
    surface = Surface(z, z, FLAT)
    assert surface.ground_at([0, 2, 0, 2], [0, 0, -1, -1]).tolist() == [0.0, 2.0, 3.0, 5.0]
    beyond = 1e-9
    assert np.isnan(surface.ground_at([-beyond, 2 + beyond, 1, 1], [0, 0, beyond, -1 - beyond])).all()
    nowhere = [math.nan, math.inf, -math.inf, 0.0, 1e300, math.inf]
    assert np.isnan(surface.ground_at(nowhere, nowhere[::-1])).all()
    assert np.isnan(
        Surface(z, z, GridMap.fit(lambda e, n: (e / 9, -n / 9), (0, 0, 9, 9))).ground_at(nowhere, 1.0)
    ).all()


def test_the_top_is_ground_and_what_stands_on_it() -> None:
    z = np.zeros((3, 3))
    top = z.copy()
    top[1, 1] = 20.0
    surface = Surface(z, top, FLAT)
    assert float(surface.top_at(1.0, -1.0)) == 20.0
    assert float(surface.top_at(0.5, -0.5)) == 5.0
    assert float(surface.ground_at(1.0, -1.0)) == 0.0


def test_shapes_of_the_answers_are_those_of_the_points() -> None:
    surface = Surface(np.zeros((2, 2)), np.zeros((2, 2)), FLAT)
    assert surface.ground_at(0.5, -0.5).shape == ()
    assert surface.ground_at(np.zeros((3, 4)), np.zeros((3, 4))).shape == (3, 4)
    assert surface.top_at([], []).shape == (0,)


def test_a_lattice_is_a_row_of_eastings_and_a_column_of_northings() -> None:
    frame = Frame(47.0, 11.0)
    grid = GridMap.fit(Exact(frame, 4326, 1 / 1200), (-5000.0, -5000.0, 5000.0, 5000.0))
    east, north = np.linspace(-4000.0, 4000.0, 7), np.linspace(-3000.0, 3000.0, 5)
    whole = grid(*np.meshgrid(east, north))
    assert grid(east, north[:, None]).shape == whole.shape
    assert grid(east, north[:, None]) == pytest.approx(whole, abs=1e-9)
    assert grid(east, north[0]) == pytest.approx(whole[0], abs=1e-9)


def test_what_is_no_surface_is_refused_and_what_is_one_cannot_be_changed() -> None:
    good = np.zeros((3, 3))
    for bad in (np.zeros((1, 3)), np.zeros((3, 1)), np.zeros(9)):
        with pytest.raises(ValueError, match="must be"):
            Surface(bad, bad, FLAT)
    with pytest.raises(ValueError, match="differ in shape"):
        Surface(good, np.zeros((3, 4)), FLAT)
    surface = Surface(good.astype(np.float32), good.astype(int), FLAT)
    assert surface.ground_m.dtype == surface.top_m.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        surface.ground_m[0, 0] = 1.0
