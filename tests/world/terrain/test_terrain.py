"""Terrain: every raster compared with bilinear interpolation in its own coordinates, written out here."""

from __future__ import annotations

import hashlib
import math
import struct
import subprocess
import sys
import time
import tracemalloc
import warnings
import zipfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray
from pyproj import CRS, Transformer
from rasterio.enums import ColorInterp
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine
from rasterio.windows import Window

from gcsplan.arrays import Floats
from gcsplan.errors import InputError
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.terrain import mosaic, peaks, raster
from gcsplan.world.terrain.geoid import GeoidGrid
from gcsplan.world.terrain.model_words import notes_on
from gcsplan.world.terrain.mosaic import tiles_of
from gcsplan.world.terrain.peaks import Peak
from gcsplan.world.terrain.raster import open_raster
from gcsplan.world.terrain.terrain import TerrainSpec, load_terrain, open_terrain
from tests.support.attacks import draw_attacks, require_placed_words
from tests.support.effort import draws

FRAME = Frame(36.5, -84.5)
PLANE = CRS.from_proj4("+proj=tmerc +lat_0=36.5 +lon_0=-84.5 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m")
BOX = (-3000.0, -2000.0, 3000.0, 2000.0)
SAMPLE = TerrainSpec(dem=("sample:jacksboro",), vertical_datum="EGM96")


def hills(cols: int, rows: int, seed: int = 1) -> Floats:
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(cols), np.arange(rows))
    return np.asarray(np.round(400 + 150 * np.sin(x / 7) + 90 * np.cos(y / 5) + rng.uniform(-20, 20, (rows, cols))))


def from_origin(west: float, north: float, dx: float, dy: float) -> Affine:
    return Affine(dx, 0.0, west, 0.0, -dy, north)


def tif(path: Path, heights: Any, transform: Any, crs: Any = "EPSG:4326", **more: Any) -> str:
    heights = np.atleast_3d(np.asarray(heights).T).T
    tags = more.pop("tags", {})
    after = {k: more.pop(k) for k in ("scales", "offsets", "units", "colorinterp") if k in more}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(
            path, "w", driver="GTiff", width=heights.shape[2], height=heights.shape[1], count=heights.shape[0],
            dtype=heights.dtype, crs=crs, transform=transform, **more,
        ) as file:  # fmt: skip
            file.write(heights)
            file.update_tags(**tags)
            for key, value in after.items():
                setattr(file, key, value)
    return str(path)


def degrees_tif(path: Path, heights: Any = None, *, west: float = -84.6, north: float = 36.6, **more: Any) -> str:
    """A GeoTIFF of 0.2° by 0.2° around the frame, in cells of 0.002°, with heights at cell centres."""
    return tif(path, hills(100, 100) if heights is None else heights, from_origin(west, north, 0.002, 0.002), **more)


def load(path: Any, *, frame: Frame = FRAME, box: tuple[float, float, float, float] = BOX, **keys: Any) -> Surface:
    paths = tuple(str(p) for p in path) if isinstance(path, list | tuple) else (str(path),)
    return load_terrain(TerrainSpec(dem=paths, **({"vertical_datum": "EGM96"} | keys)), frame, box, where="m: terrain")


def refusal(*args: Any, **keys: Any) -> InputError:
    with pytest.raises(InputError) as caught:
        load(*args, **keys)
    assert caught.value.exit_code == 2
    return caught.value


def by_hand(heights: Floats, col: Floats, row: Floats) -> Floats:
    i, j = np.floor(col).astype(int), np.floor(row).astype(int)
    u, v = col - i, row - j
    return np.asarray(
        (1 - u) * (1 - v) * heights[j, i] + u * (1 - v) * heights[j, i + 1]
        + (1 - u) * v * heights[j + 1, i] + u * v * heights[j + 1, i + 1]
    )  # fmt: skip


def inside(box: tuple[float, float, float, float], n: int = 2000) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(7)
    return rng.uniform(box[0], box[2], n), rng.uniform(box[1], box[3], n)


# -- the sample ---------------------------------------------------------------------------------------------------


def height_of(peaks: Sequence[Peak], east_m: ArrayLike, north_m: ArrayLike) -> Floats:
    """Sum of the peaks at points of the plane (any equal shapes), metres."""
    e, n = np.broadcast_arrays(np.asarray(east_m, float), np.asarray(north_m, float))
    total = np.zeros(e.shape)
    for p in peaks:
        with np.errstate(under="ignore"):
            total += p.height_m * np.exp(-(((e - p.east_m) / p.decay_east_m) ** 2)
                                         - ((n - p.north_m) / p.decay_north_m) ** 2)  # fmt: skip
    return total


def test_the_sample_has_its_heights_at_cell_centres_with_row_0_in_the_north() -> None:
    from matplotlib.cbook import get_sample_data

    with get_sample_data("jacksboro_fault_dem.npz") as file:
        heights, dx, dy = file["elevation"], float(file["dx"]), float(file["dy"])
        west, north = float(file["xmin"]), float(file["ymin"])
    frame = Frame(36.59, -84.24)
    surface = load_terrain(SAMPLE, frame, (-20e3, -20e3, 20e3, 20e3), where="m")
    assert surface.ground_m.shape == heights.shape == (344, 403)
    assert np.array_equal(surface.ground_m, heights)
    rng = np.random.default_rng(2)
    i, j = rng.integers(0, 403, 500), rng.integers(0, 344, 500)
    plane = frame.to_plane(north - (j + 0.5) * dy, west + (i + 0.5) * dx)
    # 1 cm inward from the nodes: exactly at the grid's border, half of them would be outside.
    col, row = surface.grid(plane[:, 0], plane[:, 1]).T
    assert np.abs(col - i).max() < 1e-6
    assert np.abs(row - j).max() < 1e-6


def test_the_outer_half_cell_of_the_sample_is_unknown() -> None:
    frame = Frame(36.59, -84.24)
    surface = load_terrain(SAMPLE, frame, (-20e3, -20e3, 20e3, 20e3), where="m")
    west, third = -84.41375, 0.0008333333333333334 / 3
    outside, within = frame.to_plane([36.59, 36.59], [west + third, west + 2 * third])
    assert np.isnan(surface.ground_at(*outside))
    assert np.isfinite(surface.ground_at(*within))


def test_the_sample_tells_its_source() -> None:
    info = load_terrain(SAMPLE, Frame(36.59, -84.24), BOX, where="m").info
    assert info["vertical_datum"] == "EGM96"
    assert info["resolution_m"] == 92
    assert info["bare_dem"] is True
    assert len(str(info["dem_sha256"])) == 64


def test_the_sample_knows_its_datum_and_is_not_told_another() -> None:
    spec = TerrainSpec(dem=("sample:jacksboro",))
    assert load_terrain(spec, Frame(36.59, -84.24), BOX, where="m").info["vertical_datum"] == "EGM96"
    error = refusal("sample:jacksboro", vertical_datum="EGM2008")
    assert "EGM2008" in str(error)
    assert error.where == "m: terrain.vertical_datum"


# -- formats and coordinate systems -------------------------------------------------------------------------------


@pytest.mark.parametrize("tags", [{}, {"AREA_OR_POINT": "Point"}])
def test_a_geotiff_in_degrees_is_bilinear_between_its_cell_centres(tmp_path: Path, tags: dict[str, str]) -> None:
    heights = hills(100, 100)
    surface = load(degrees_tif(tmp_path / "a.tif", heights, tags=tags))
    e, n = inside(BOX)
    lat, lon = FRAME.to_degrees(e, n).T
    wanted = by_hand(heights, (lon + 84.6) / 0.002 - 0.5, (36.6 - lat) / 0.002 - 0.5)
    assert np.abs(surface.ground_at(e, n) - wanted).max() < 1e-6
    assert surface.grid.error_m < 0.01


@pytest.mark.nightly_but("EPSG:32617", "EPSG:3857", "EPSG:32616")
@pytest.mark.slow
@pytest.mark.parametrize("crs", ["EPSG:32616", "EPSG:3857", "EPSG:5070", "EPSG:4269", "EPSG:32617", "EPSG:26916+5703"])
def test_a_geotiff_in_any_system_is_bilinear_in_its_own_grid(tmp_path: Path, crs: str) -> None:
    there = Transformer.from_crs(PLANE, crs.split("+")[0], always_xy=True, allow_ballpark=False)
    x, y = there.transform(*inside(BOX))
    cell = 0.001 if crs == "EPSG:4269" else 90.0
    west, north = float(x.min()) - 5 * cell, float(y.max()) + 5 * cell
    heights = hills(int((x.max() - x.min()) / cell) + 12, int((y.max() - y.min()) / cell) + 12)
    path = tif(tmp_path / "a.tif", heights.astype("int16"), from_origin(west, north, cell, cell), crs)
    surface = load(path, vertical_datum=None if "+" in crs else "AMSL")
    wanted = by_hand(heights, (x - west) / cell - 0.5, (north - y) / cell - 0.5)
    assert np.abs(surface.ground_at(*inside(BOX)) - wanted).max() < 1e-5


def hgt(path: Path, posts: Floats) -> Path:
    posts.astype(">i2").tofile(path)
    return path


@pytest.mark.nightly
def test_srtm_posts_lie_on_whole_degrees_and_neighbouring_tiles_join(tmp_path: Path) -> None:
    both = hills(2401, 1201)
    tiles = [hgt(tmp_path / "N36W085.hgt", both[:, :1201]), hgt(tmp_path / "N36W084.hgt", both[:, 1200:])]
    frame = Frame(36.5, -84.0)
    box = (-2000.0, -2000.0, 2000.0, 2000.0)
    surface = load(tiles, frame=frame, box=box)
    e, n = inside(box)
    lat, lon = frame.to_degrees(e, n).T
    wanted = by_hand(both, (lon + 85.0) * 1200, (37.0 - lat) * 1200)
    assert np.abs(surface.ground_at(e, n) - wanted).max() < 1e-5
    assert notes_on(surface.info) == ()
    hashes = [hashlib.sha256(t.read_bytes()).hexdigest() for t in tiles]
    assert surface.info["dem_sha256"] == hashlib.sha256("\n".join(hashes).encode()).hexdigest()


@pytest.mark.nightly
def test_a_zipped_hgt_as_mavproxy_keeps_it_is_the_same_ground(tmp_path: Path) -> None:
    posts = hills(1201, 1201)
    posts[7, 9] = -32768
    plain = hgt(tmp_path / "N36W085.hgt", posts)
    (tmp_path / "zipped").mkdir()
    zipped = tmp_path / "zipped" / "N36W085.hgt.zip"
    with zipfile.ZipFile(zipped, "w", zipfile.ZIP_DEFLATED) as file:
        file.write(plain, "N36W085.hgt")
    assert np.array_equal(load(plain).ground_m, load(zipped).ground_m, equal_nan=True)


@pytest.mark.parametrize(
    ("name", "inside", "data"),
    [
        ("N36W085.hgt.zip", "N36W086.hgt", bytes(2 * 1201 * 1201)),
        ("N36W085.hgt.zip", "N36W085.hgt", bytes(5000)),
        ("N36W085.hgt.zip", "N36W085.hgt", None),
        ("tile.hgt.zip", "tile.hgt", bytes(2 * 1201 * 1201)),
    ],
    ids=["another tile", "short", "no zip", "no corner"],
)
def test_a_zipped_hgt_that_is_none_is_refused_with_what_it_must_be(
    tmp_path: Path, name: str, inside: str, data: bytes | None
) -> None:
    path = tmp_path / name
    if data is None:
        path.write_bytes(b"PK\3\4" + bytes(100))
    else:
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr(inside, data)
    assert "N36W085.hgt.zip with that inside" in str(refusal(path))


def test_a_gap_between_tiles_is_unknown(tmp_path: Path) -> None:
    left = degrees_tif(tmp_path / "l.tif", hills(40, 100))
    right = degrees_tif(tmp_path / "r.tif", hills(40, 100), west=-84.6 + 60 * 0.002)
    surface = load([left, right])
    lon = np.array([-84.6 + 30 * 0.002, -84.5, -84.6 + 70 * 0.002])
    ground = surface.ground_at(*FRAME.to_plane(np.full(3, 36.5), lon).T)
    assert np.isfinite(ground).tolist() == [True, False, True]
    assert any(n.code == "nodes_unknown" for n in notes_on(surface.info))


@pytest.mark.parametrize(("upper", "lower"), [(0.003, 0.002), (0.002, 0.003), (0.005, 0.003), (0.004, 0.002)])
def test_tiles_whose_columns_differ_by_a_simple_ratio_are_one_ground(
    tmp_path: Path, upper: float, lower: float
) -> None:
    """As published models widen their columns towards the poles: each side is bilinear in its own grid."""
    heights, files, first = {}, [], -84.596  # of the first nodes of all
    for name, dx, north in (("upper", upper, 36.6), ("lower", lower, 36.5)):
        heights[name] = hills(round(0.2 / dx), 50)
        cols = heights[name].shape[1]
        for part, columns in (("west", slice(0, cols // 2)), ("east", slice(cols // 2, cols))):
            west = first + columns.start * dx - 0.5 * dx
            transform = from_origin(west, north, dx, 0.002)
            files.append(tif(tmp_path / f"{name}-{part}.tif", heights[name][:, columns], transform))
    box = (-7000.0, -9000.0, 7000.0, 9000.0)
    surface = load(files, box=box)
    e, n = inside(box)
    degrees = FRAME.to_degrees(e, n)
    lat, lon = degrees[:, 0], degrees[:, 1]
    ground = surface.ground_at(e, n)
    for name, dx, north in (("upper", upper, 36.6), ("lower", lower, 36.5)):
        row, col = (north - 0.001 - lat) / 0.002, (lon - first) / dx
        within = (row > 0.0) & (row < 49.0)
        assert within.sum() > 300
        expected = by_hand(heights[name], col[within], row[within])
        assert ground[within] == pytest.approx(expected, abs=0.02)
    seam = ground[(lat < 36.501) & (lat > 36.499)]  # between the last row of one and the first of the other
    assert len(seam) > 5
    assert np.isfinite(seam).all()


@pytest.mark.parametrize("dx", [0.002 * 1.37, 0.002 * 11, 0.002 / 12])
def test_columns_of_no_simple_ratio_are_another_layer(tmp_path: Path, dx: float) -> None:
    odd = tif(tmp_path / "b.tif", hills(100, 100), from_origin(-84.6, 36.6, dx, 0.002))
    both = load([degrees_tif(tmp_path / "a.tif"), odd])
    near = dx > 0.001  # else it ends beside the mission
    assert any("the terrain has layers" in str(n) for n in notes_on(both.info)) == near


def test_where_tiles_differ_both_heights_are_kept_and_told(tmp_path: Path) -> None:
    heights = hills(100, 100)
    raised = heights.copy()
    raised[50, 50] += 7.0
    surface = load([degrees_tif(tmp_path / "a.tif", heights), degrees_tif(tmp_path / "b.tif", raised)])
    at = FRAME.to_plane(36.6 - 50.5 * 0.002, -84.6 + 50.5 * 0.002)
    assert surface.high_at(*at) == surface.top_at(*at) == pytest.approx(raised[50, 50], abs=1e-3)
    assert surface.ground_at(*at) == pytest.approx(heights[50, 50], abs=1e-3)
    assert not load(degrees_tif(tmp_path / "c.tif", heights)).differs
    assert any("1 nodes, 7 m" in str(n) for n in notes_on(surface.info))


def test_an_ascii_grid_needs_its_coordinate_system(tmp_path: Path) -> None:
    heights = hills(100, 100).astype(int)
    heights[3, 4] = -9999
    path = tmp_path / "a.asc"
    head = "ncols 100\nnrows 100\nxllcorner -84.6\nyllcorner 36.4\ncellsize 0.002\nNODATA_value -9999\n"
    path.write_text(head + "\n".join(" ".join(map(str, row)) for row in heights))
    assert "crs: EPSG:4326" in str(refusal(path))
    surface = load(path, crs="EPSG:4326")
    e, n = inside(BOX)
    lat, lon = FRAME.to_degrees(e, n).T
    wanted = by_hand(heights.astype(float), (lon + 84.6) / 0.002 - 0.5, (36.6 - lat) / 0.002 - 0.5)
    assert np.abs(surface.ground_at(e, n) - wanted).max() < 1e-5


@pytest.mark.nightly_but("one across--179.98", "one across-179.98", "two tiles--179.98", "two tiles-179.98")
@pytest.mark.first_quick
@pytest.mark.parametrize("lon_deg", [179.98, -179.98])
@pytest.mark.parametrize("layout", ["two tiles", "one across", "global"])
def test_the_antimeridian_is_no_edge(tmp_path: Path, lon_deg: float, layout: str) -> None:
    heights = hills(200, 100)
    if layout == "two tiles":
        paths = [
            degrees_tif(tmp_path / "e.tif", heights[:, :100], west=179.8),
            degrees_tif(tmp_path / "w.tif", heights[:, 100:], west=-180.0),
        ]
    elif layout == "one across":
        paths = [degrees_tif(tmp_path / "x.tif", heights, west=179.8)]
    else:
        whole = np.full((100, 180_000), 300.0, dtype="float32")
        whole[:, -100:], whole[:, :100] = heights[:, :100], heights[:, 100:]
        paths = [degrees_tif(tmp_path / "g.tif", whole, west=-180.0, tiled=True, compress="deflate")]
    frame = Frame(36.5, lon_deg)
    surface = load(paths, frame=frame)
    e, n = inside(BOX)
    lat, lon = frame.to_degrees(e, n).T
    wanted = by_hand(heights, (lon % 360.0 - 179.8) / 0.002 - 0.5, (36.6 - lat) / 0.002 - 0.5)
    assert np.abs(surface.ground_at(e, n) - wanted).max() < 1e-5


@pytest.mark.nightly
def test_only_the_part_that_the_box_needs_is_read(tmp_path: Path) -> None:
    path = degrees_tif(tmp_path / "a.tif", hills(1000, 1000), west=-85.5, north=37.5)
    rows, cols = load(path, box=(-100.0, -100.0, 100.0, 100.0)).ground_m.shape
    # 3 km on each side and three cells: 6.2 km in cells of 222 m and 179 m.
    assert 28 + 6 <= rows <= 38
    assert 34 + 6 <= cols <= 46


# -- unknown ground -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "nodata", "dtype"),
    [(-9999, -9999, "int16"), (-32768, None, "int16"), (-9999, None, "float32"), (np.nan, None, "float32"),
     (np.inf, None, "float32"), (3.4e38, None, "float32"), (0, 0, "int16"), (65535, None, "uint16")],
)  # fmt: skip
def test_voids_declared_or_not_are_unknown_and_never_ground(
    tmp_path: Path, value: float, nodata: float | None, dtype: str
) -> None:
    heights = hills(100, 100).astype(dtype)
    heights[50, 50] = value
    surface = load(degrees_tif(tmp_path / "a.tif", heights, nodata=nodata))
    assert np.count_nonzero(np.isnan(surface.ground_m)) == 1
    near = FRAME.to_plane(36.6 - 50.2 * 0.002, -84.6 + 50.2 * 0.002)
    assert np.isnan(surface.ground_at(*near))
    assert any("1 of" in str(n) for n in notes_on(surface.info))


def test_a_mask_beside_the_heights_is_honoured(tmp_path: Path) -> None:
    path = degrees_tif(tmp_path / "a.tif", hills(100, 100).astype("int16"))
    with rasterio.open(path, "r+") as file:
        mask = np.full((100, 100), 255, dtype="uint8")
        mask[40:42, 50] = 0
        file.write_mask(mask)
    assert np.count_nonzero(np.isnan(load(path).ground_m)) == 2


def test_nothing_but_voids_is_refused(tmp_path: Path) -> None:
    assert "voids" in str(refusal(degrees_tif(tmp_path / "a.tif", np.full((100, 100), -9999, "int16"))))


def test_a_box_beyond_the_dem_is_refused(tmp_path: Path) -> None:
    path = degrees_tif(tmp_path / "a.tif")
    assert "does not cover the mission" in str(refusal(path, frame=Frame(40.0, -84.5)))
    assert "does not cover the mission" in str(refusal(path, frame=Frame(36.5, 95.5)))


def test_covers_asks_for_the_tile_and_not_for_its_heights(tmp_path: Path) -> None:
    path = degrees_tif(tmp_path / "a.tif", np.full((100, 100), -9999, "int16"))
    terrain = open_terrain(TerrainSpec(dem=(path,), vertical_datum="EGM96"), where="m")
    assert terrain.covers(36.5, -84.5)
    assert not terrain.covers(36.5, -84.7)
    assert not terrain.covers(-84.5, 36.5)
    assert not terrain.covers(89.0, -84.5)


@pytest.mark.parametrize("west", [-84.6, 179.9])
def test_covers_tells_of_many_places_what_it_tells_of_each(tmp_path: Path, west: float) -> None:
    other = (west + 0.4 + 180.0) % 360.0 - 180.0
    tiles = degrees_tif(tmp_path / "a.tif", west=west), degrees_tif(tmp_path / "b.tif", west=other)
    terrain = open_terrain(TerrainSpec(dem=tiles, vertical_datum="EGM96"), where="m")
    rng = np.random.default_rng(3)
    lat, lon = rng.uniform(36.3, 36.7, 400), (west + rng.uniform(-0.1, 0.7, 400) + 180.0) % 360.0 - 180.0
    lon[:3] = (0.0, 180.0, -180.0)
    found = terrain.covers(lat, lon)
    assert found.tolist() == [bool(terrain.covers(*at)) for at in zip(lat, lon, strict=True)]
    east = (lon - west + 180.0) % 360.0 - 180.0  # of the first tile's edge
    inside = (lat > 36.4) & (lat < 36.6) & (((east > 0.0) & (east < 0.2)) | ((east > 0.4) & (east < 0.6)))
    assert 50 < np.count_nonzero(inside) < 350
    assert found.tolist() == inside.tolist()
    assert terrain.covers([], []).shape == (0,)


# -- units and datums ---------------------------------------------------------------------------------------------


@pytest.mark.first_quick
@pytest.mark.parametrize(
    ("more", "keys", "metres"),
    [({"units": ("ft",)}, {}, 0.3048), ({"units": ("US survey foot",)}, {}, 1200 / 3937),
     ({"units": ("metre",)}, {}, 1.0), ({}, {"height_unit": "ft"}, 0.3048),
     ({"scales": (0.1,), "offsets": (5.0,)}, {}, 0.1),
     ({"crs": "EPSG:4269+6360"}, {"vertical_datum": None}, 1200 / 3937)],
)  # fmt: skip
def test_units_scale_and_offset_are_honoured(
    tmp_path: Path, more: dict[str, Any], keys: dict[str, Any], metres: float
) -> None:
    heights = hills(100, 100)
    surface = load(degrees_tif(tmp_path / "a.tif", heights.astype("int16"), **more), **keys)
    offset = more.get("offsets", (0.0,))[0]
    rows, cols = surface.ground_m.shape
    wanted = heights * metres + offset
    flat = surface.ground_m.ravel()
    assert any(
        np.allclose(wanted[r : r + rows, c : c + cols].ravel(), flat, atol=1e-9)
        for r in range(101 - rows) for c in range(101 - cols)
    )  # fmt: skip


def test_a_unit_that_contradicts_or_is_unknown_is_refused(tmp_path: Path) -> None:
    assert "two units" in str(refusal(degrees_tif(tmp_path / "a.tif", units=("ft",)), vertical_datum="EPSG:5703"))
    assert "furlong" in str(refusal(degrees_tif(tmp_path / "b.tif", units=("furlong",))))


@pytest.mark.slow
def test_a_raster_that_does_not_say_its_datum_needs_the_key(tmp_path: Path) -> None:
    error = refusal(degrees_tif(tmp_path / "a.tif"), vertical_datum=None)
    assert error.where == "m: terrain.vertical_datum"
    assert "EGM96" in str(error)
    assert "fathom" in str(refusal(degrees_tif(tmp_path / "b.tif"), vertical_datum="fathoms"))


@pytest.mark.parametrize(
    ("crs", "said", "name"),
    [("EPSG:4326+5773", None, "EGM96"), ("EPSG:4326+3855", "EGM 2008", "EGM2008"), ("EPSG:4269+5703", "AMSL", "NAVD88"),
     ("EPSG:4326", "EPSG:5773", "EGM96"), ("EPSG:4326", "msl", "AMSL"), ("EPSG:4326", "navd88", "NAVD88")],
)  # fmt: skip
def test_a_geoid_datum_is_taken_as_amsl(tmp_path: Path, crs: str, said: str | None, name: str) -> None:
    surface = load(degrees_tif(tmp_path / "a.tif", crs=crs), vertical_datum=said)
    assert surface.info["vertical_datum"] == name
    told = any(n.code == "heights_taken_as_amsl" for n in notes_on(surface.info))
    assert told == (name == "NAVD88")


def test_a_datum_that_contradicts_the_raster_is_refused(tmp_path: Path) -> None:
    error = refusal(degrees_tif(tmp_path / "a.tif", crs="EPSG:4326+5773"), vertical_datum="EGM2008")
    assert "EGM2008" in str(error)
    assert "EGM96" in str(error)


def gtx(path: Path, height: Any, *, south: float = 36.0, west: float = -85.0) -> str:
    """A GTX geoid grid of 5 × 5 posts, 0.25° apart: south-west corner, spacing, size, then rows from the south."""
    rows = np.broadcast_to(np.asarray(height, dtype=">f4"), (5, 5))
    path.write_bytes(struct.pack(">4d2i", south, west, 0.25, 0.25, 5, 5) + rows.tobytes())
    return str(path)


@pytest.mark.parametrize(("crs", "said"), [("EPSG:4326", "WGS84"), ("EPSG:4979", None), ("EPSG:32616", "ellipsoidal")])
def test_ellipsoidal_heights_lose_the_geoid_that_the_grid_gives(tmp_path: Path, crs: str, said: str | None) -> None:
    # The geoid is linear in degrees, so the grid's own interpolation is exact everywhere.
    lat, lon = np.meshgrid(36.0 + 0.25 * np.arange(5), -85.0 + 0.25 * np.arange(5), indexing="ij")
    grid = gtx(tmp_path / "geoid with a space.gtx", -33.0 + 4.0 * (lat - 36.5) + 2.0 * (lon + 84.5))
    if crs == "EPSG:32616":
        path = tif(tmp_path / "a.tif", hills(200, 200), from_origin(715_000.0, 4_055_000.0, 150.0, 150.0), crs)
    else:
        path = degrees_tif(tmp_path / "a.tif", crs=crs)
    plain = load(path, vertical_datum="EGM96" if said else None, geoid_grid=None) if said else None
    surface = load(path, vertical_datum=said, geoid_grid=grid)
    e, n = inside(BOX)
    at_lat, at_lon = FRAME.to_degrees(e, n).T
    geoid = -33.0 + 4.0 * (at_lat - 36.5) + 2.0 * (at_lon + 84.5)
    if plain is not None:
        assert np.abs(plain.ground_at(e, n) - geoid - surface.ground_at(e, n)).max() < 2e-3
    else:
        heights = by_hand(hills(100, 100), (at_lon + 84.6) / 0.002 - 0.5, (36.6 - at_lat) / 0.002 - 0.5)
        assert np.abs(heights - geoid - surface.ground_at(e, n)).max() < 2e-3
    assert "geoid with a space.gtx" in str(surface.info["vertical_datum"])
    assert "geoid_sha256" in surface.info


def test_ellipsoidal_heights_without_a_grid_are_refused_with_the_key(tmp_path: Path) -> None:
    error = refusal(degrees_tif(tmp_path / "a.tif"), vertical_datum="WGS84")
    assert error.where == "m: terrain.geoid_grid"
    assert "geoid_grid: FILE" in str(error)


@pytest.mark.parametrize(
    ("make", "words"),
    [(lambda p: gtx(p / "g.gtx", 0.0), "changes nothing"), (lambda p: gtx(p / "g.gtx", 500.0), "within ±120"),
     (lambda p: gtx(p / "g.gtx", -30.0, west=10.0), "does not cover"), (lambda p: str(p / "none.gtx"), "not there"),
     (lambda p: str(p), "folder")],
)  # fmt: skip
def test_a_geoid_grid_that_does_nothing_or_not_here_is_refused(tmp_path: Path, make: Any, words: str) -> None:
    grid = make(tmp_path)
    assert words in str(refusal(degrees_tif(tmp_path / "a.tif"), vertical_datum="WGS84", geoid_grid=grid))


def test_a_broken_geoid_grid_is_refused(tmp_path: Path) -> None:
    path = degrees_tif(tmp_path / "a.tif")
    whole = Path(gtx(tmp_path / "g.gtx", -30.0)).read_bytes()
    for i, data in enumerate((whole[:60], whole[:20], b"nonsense" * 9)):
        broken = tmp_path / f"broken{i}.gtx"
        broken.write_bytes(data)
        error = refusal(path, vertical_datum="WGS84", geoid_grid=str(broken))
        assert error.where == "m: terrain.geoid_grid"
        assert broken.name in str(error)


def geoid_tif(path: Path, posts: NDArray[Any], west: float, north: float, step: float, **more: Any) -> str:
    """A GeoTIFF geoid grid whose first post (north-west) is at ``west``, ``north``."""
    bands = posts[None] if posts.ndim == 2 else posts
    with rasterio.open(
        path, "w", driver="GTiff", width=bands.shape[2], height=bands.shape[1], count=len(bands), dtype="float32",
        crs="EPSG:4326", transform=from_origin(west - step / 2, north + step / 2, step, step), **more,
    ) as file:  # fmt: skip
        file.write(bands.astype("float32"))
    return str(path)


@pytest.mark.parametrize("kind", ["gtx", "tif", "whole world", "whole world from 0"])
def test_a_geoid_is_what_proj_makes_of_the_same_grid(tmp_path: Path, kind: str) -> None:
    rng = np.random.default_rng(3)
    if kind in ("gtx", "tif"):
        posts = rng.uniform(-60.0, 60.0, (5, 5))
        grid = (
            gtx(tmp_path / "g.gtx", posts[::-1])
            if kind == "gtx"
            else geoid_tif(tmp_path / "g.tif", posts, -85.0, 37.0, 0.25)
        )
        lat = np.concatenate([rng.uniform(36.0, 37.0, 500), [36.0, 37.0, 36.25]])
        lon = np.concatenate([rng.uniform(-85.0, -84.0, 500), [-85.0, -84.0, -84.5]])
    else:
        posts = rng.uniform(-60.0, 60.0, (37, 72))
        grid = geoid_tif(tmp_path / "w.tif", posts, 0.0 if kind.endswith("0") else -180.0, 90.0, 5.0)
        lat, lon = rng.uniform(-90.0, 90.0, 3000), rng.uniform(-180.0, 180.0, 3000)
    shift = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        f'+step +proj=vgridshift +grids="{grid}" +multiplier=1 +step +proj=unitconvert +xy_in=rad +xy_out=deg'
    )
    theirs = np.asarray(shift.transform(lon, lat, np.zeros_like(lat))[2])
    theirs = np.where(np.isfinite(theirs), theirs, np.nan)
    ours = GeoidGrid(Path(grid), where="m").height_m(lat, lon)
    np.testing.assert_allclose(ours, theirs, atol=1e-5)


@pytest.mark.parametrize(("unit", "metres"), [("ft", 0.3048), ("US survey foot", 1200 / 3937), ("metre", 1.0)])
def test_a_geoid_grid_counts_in_its_own_unit(tmp_path: Path, unit: str, metres: float) -> None:
    path = Path(geoid_tif(tmp_path / "g.tif", np.full((3, 3), -98.0), -85.0, 37.0, 0.5))
    with rasterio.open(path, "r+") as file:
        file.units = (unit,)
    assert GeoidGrid(path, where="m").height_m(36.5, -84.5) == pytest.approx(-98.0 * metres, abs=1e-9)


def test_a_geoid_grid_in_a_unit_that_nobody_knows_is_refused(tmp_path: Path) -> None:
    path = Path(geoid_tif(tmp_path / "g.tif", np.full((3, 3), -30.0), -85.0, 37.0, 0.5))
    with rasterio.open(path, "r+") as file:
        file.units = ("ell",)
    with pytest.raises(InputError, match="unit 'ell' is not known"):
        GeoidGrid(path, where="m")


def test_a_geoid_grid_knows_its_band_and_its_voids(tmp_path: Path) -> None:
    posts = np.stack([np.full((3, 3), 7.0), np.full((3, 3), -30.0)])
    posts[1, 0, 0] = -9999.0
    path = geoid_tif(tmp_path / "g.tif", posts, -85.0, 37.0, 0.25, nodata=-9999.0)
    with rasterio.open(path, "r+") as file:
        file.set_band_description(2, "geoid_undulation")
    grid = GeoidGrid(Path(path), where="m")
    assert grid.height_m([36.6], [-84.6]).tolist() == [-30.0]
    with pytest.raises(InputError, match="does not cover"):
        grid.height_m([36.9], [-84.9])


@pytest.mark.parametrize("kind", ["never written", "complex", "one block"])
def test_a_geoid_grid_that_no_heights_are_in_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    path = tmp_path / "g.tif"
    with rasterio.open(
        path, "w", driver="GTiff", width=64, height=64, count=1, dtype="complex64" if kind == "complex" else "float32",
        crs="EPSG:4326", transform=from_origin(-85.0, 37.0, 0.02, 0.02), sparse_ok=True, tiled=True, blockxsize=32,
        blockysize=32,
    ) as file:  # fmt: skip
        file.write(np.full((32, 32), -30.0), 1, window=Window(32, 0, 32, 32))
    if kind == "one block":
        monkeypatch.setattr(raster, "MAX_BLOCK_BYTES", 4000)
    with pytest.raises(InputError, match=r"does not cover|picture|TILED"):
        GeoidGrid(path, where="m").height_m([36.8, 36.9], [-84.1, -84.9])
    if kind == "never written":
        assert GeoidGrid(path, where="m").height_m([36.8], [-84.1]).tolist() == [-30.0]


@pytest.mark.parametrize("step", [1e-310, 1e-7, 95.0])
def test_a_geoid_grid_of_impossible_steps_is_refused(tmp_path: Path, step: float) -> None:
    path = geoid_tif(tmp_path / "g.tif", np.full((3, 3), -30.0), -85.0, 37.0, step)
    with pytest.raises(InputError, match="in degrees"):
        GeoidGrid(Path(path), where="m")


@pytest.mark.slow
def test_a_geoid_grid_with_strips_of_no_rows_is_no_danger(tmp_path: Path) -> None:
    """PROJ divides by the number of rows per strip, which would end the process."""
    path = Path(geoid_tif(tmp_path / "g.tif", np.full((60, 60), -30.0), -85.0, 37.0, 0.02, compress="deflate"))
    data = bytearray(path.read_bytes())
    at = data.index(struct.pack("<HHI", 278, 3, 1))
    data[at + 8 : at + 10] = b"\0\0"
    path.write_bytes(bytes(data))
    code = (
        "import sys\nfrom pathlib import Path\nfrom gcsplan.errors import InputError\n"
        "from gcsplan.world.terrain.geoid import GeoidGrid\n"
        "try:\n    print(GeoidGrid(Path(sys.argv[1]), where='m').height_m([36.5], [-84.5]))\n"
        "except InputError as error:\n    print(error)\n"
    )
    ended = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, timeout=60)
    assert (ended.returncode, bool(ended.stdout)) == (0, True), ended


def test_a_geoid_grid_beside_geoid_heights_is_refused(tmp_path: Path) -> None:
    assert "remove it" in str(refusal(degrees_tif(tmp_path / "a.tif"), geoid_grid=gtx(tmp_path / "g.gtx", -30.0)))


# -- refused files and grids --------------------------------------------------------------------------------------


def test_rasters_that_are_not_north_up_are_refused_with_the_cure(tmp_path: Path) -> None:
    turned = from_origin(-84.6, 36.6, 0.002, 0.002) @ Affine.rotation(10)
    upside = Affine(0.002, 0.0, -84.6, 0.0, 0.002, 36.4)
    for i, transform in enumerate((turned, upside)):
        assert "gdalwarp" in str(refusal(tif(tmp_path / f"{i}.tif", hills(100, 100), transform)))


@pytest.mark.parametrize("kind", ["tif", "asc", "canopy"])
@pytest.mark.parametrize(
    ("cell", "west"),
    [(1e-310, -84.6), (5e-324, 0.0), (1e-16, -84.6), (1e-12, 7e5), (1e12, 7e5), (1e307, 7e5), (30, 1e300)],
)
def test_a_grid_that_is_none_on_earth_is_refused(tmp_path: Path, kind: str, cell: float, west: float) -> None:
    """If cell numbers overflow or are lost in rounding, the places of all nodes would be wrong too."""
    keys: dict[str, Any] = {"crs": "EPSG:32616" if abs(west) > 180.0 else "EPSG:4326"}
    path = tmp_path / ("a.asc" if kind == "asc" else "a.tif")
    if kind == "asc":
        head = f"ncols 60\nnrows 60\nxllcorner {west!r}\nyllcorner 36.4\ncellsize {cell!r}\n"
        path.write_text(head + "\n".join(" ".join("400" for _ in range(60)) for _ in range(60)))
    else:
        tif(path, hills(60, 60), from_origin(west, 36.6, cell, cell), **keys)
    ground = degrees_tif(tmp_path / "d.tif")
    error = refusal(ground, canopy=str(path)) if kind == "canopy" else refusal(path, **keys)
    assert "broken georeference" in str(error)


def test_a_raster_without_a_place_is_refused(tmp_path: Path) -> None:
    error = refusal(tif(tmp_path / "a.tif", hills(100, 100), Affine.identity(), None))
    assert "no georeference" in str(error)


def test_a_picture_is_no_dem(tmp_path: Path) -> None:
    colours = (ColorInterp.red, ColorInterp.green, ColorInterp.blue)
    picture = np.zeros((3, 100, 100), "uint8")
    assert "picture" in str(refusal(degrees_tif(tmp_path / "a.tif", picture, photometric="RGB", colorinterp=colours)))


def test_a_second_band_is_told(tmp_path: Path) -> None:
    two = np.stack([hills(100, 100), hills(100, 100, seed=5)]).astype("int16")
    assert any("2 bands" in str(n) for n in notes_on(load(degrees_tif(tmp_path / "a.tif", two)).info))


@pytest.mark.nightly
def test_tiles_that_do_not_fit_together_are_layers(tmp_path: Path) -> None:
    first = degrees_tif(tmp_path / "a.tif")
    finer = tif(tmp_path / "b.tif", hills(100, 100), from_origin(-84.6, 36.6, 0.001, 0.001))
    shifted = degrees_tif(tmp_path / "c.tif", west=-84.6005)
    other = tif(tmp_path / "d.tif", hills(100, 100), from_origin(7e5, 4e6, 90, 90), "EPSG:32616")
    datum = degrees_tif(tmp_path / "e.tif", crs="EPSG:4326+3855")
    for path in (finer, shifted, other, datum):
        both = load([first, path])
        assert any("the terrain has layers" in str(n) for n in notes_on(both.info)) == (path is not other)
    assert both.info["vertical_datum"] == "EGM96 and EGM2008"


def test_a_system_without_a_known_datum_is_refused_with_the_cure(tmp_path: Path) -> None:
    path = degrees_tif(tmp_path / "a.tif", crs="+proj=longlat +ellps=GRS80 +no_defs")
    assert "`crs:`" in str(refusal(path))
    assert any(n.code == "crs_replaced" for n in notes_on(load(path, crs="EPSG:4326").info))


def test_metres_taken_for_degrees_are_refused(tmp_path: Path) -> None:
    path = tif(tmp_path / "a.tif", hills(100, 100), from_origin(7e5, 4e6, 90, 90), None)
    assert "if it is in metres" in str(refusal(path, crs="EPSG:4326"))


@pytest.mark.parametrize(
    "path", ["/vsicurl/http://127.0.0.1:9/a.tif", "http://127.0.0.1:9/a.tif", "zip://a.zip!a.tif", "nil"]
)
def test_only_files_are_opened_never_an_address(path: str) -> None:
    assert "is not there" in str(refusal(path))


def test_other_formats_are_refused_with_the_cure(tmp_path: Path) -> None:
    vrt = tmp_path / "a.vrt"
    vrt.write_text('<VRTDataset rasterXSize="9" rasterYSize="9"></VRTDataset>')
    assert "`rio convert FILE a.tif`" in str(refusal(vrt))


def test_a_window_that_would_not_fit_into_memory_is_refused_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mosaic, "MAX_CELLS", 1000)
    assert "gdalwarp -tr" in str(refusal(degrees_tif(tmp_path / "a.tif")))


def test_a_file_in_one_huge_block_is_refused(tmp_path: Path) -> None:
    heights = hills(16, 16).astype("uint8")
    tile = {"tiled": True, "blockxsize": 16, "blockysize": 16}
    path = tif(tmp_path / "a.tif", heights, from_origin(-84.6, 36.6, 1e-5, 1e-5), **tile)
    data = bytearray(Path(path).read_bytes())
    (directory,) = struct.unpack("<I", data[4:8])  # GDAL has rewritten it behind the first one, which nobody reads
    # Set ImageWidth, ImageLength, TileWidth and TileLength (tags 256, 257, 322, 323) of a little-endian TIFF to 20,000.
    for tag in (256, 257, 322, 323):
        at = data.index(struct.pack("<HHI", tag, 3, 1), directory)
        data[at + 8 : at + 10] = struct.pack("<H", 20_000)
    Path(path).write_bytes(bytes(data))
    assert "is stored in blocks of (20000, 20000) cells" in str(refusal(path))


def test_a_grid_that_lacks_rows_is_refused_at_once(tmp_path: Path) -> None:
    """GDAL's time to read a row doubles with every missing row before it."""
    head = "ncols 60\nnrows 601\nxllcorner -84.41\nyllcorner 36.57\ncellsize 0.001\n"
    (tmp_path / "a.asc").write_text(head + "\n".join(" ".join("400" for _ in range(60)) for _ in range(60)))
    read = open_raster(tmp_path / "a.asc", where="m", crs="EPSG:4326").read
    assert [len(part) for _, part in read(0, 20, 60, 30)] == [30]
    began = time.monotonic()
    with pytest.raises(InputError, match="cannot be read"):
        list(read(0, 500, 60, 60))
    assert time.monotonic() - began < 30.0


def test_a_small_file_that_claims_large_ground_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = degrees_tif(tmp_path / "a.tif")
    load(path)
    monkeypatch.setattr(mosaic, "FEW_CELLS", 1000)
    load(path)
    monkeypatch.setattr(mosaic, "CELLS_IN_BYTE", 0.01)
    assert "claims" in str(refusal(path))


def test_a_small_file_that_unpacks_into_a_large_block_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.tif"
    with rasterio.open(
        path, "w", driver="GTiff", width=64, height=64, count=3, dtype="float32", crs="EPSG:4326", interleave="pixel",
        transform=from_origin(-84.6, 36.6, 1e-3, 1e-3), compress="deflate", tiled=True, blockxsize=64, blockysize=64,
    ) as file:  # fmt: skip
        file.write(np.zeros((3, 64, 64), "float32"))
    monkeypatch.setattr(raster, "MAX_BLOCK_BYTES", 64 * 64 * 4 * 3)
    open_raster(path, where="m")
    monkeypatch.setattr(raster, "MAX_BLOCK_BYTES", 64 * 64 * 4 * 3 - 1)
    monkeypatch.setattr(raster, "remembered_headers", {})  # opened a moment ago
    with pytest.raises(InputError, match="TILED"):
        open_raster(path, where="m")


def test_a_block_is_no_larger_than_what_a_check_may_hold_of_it(tmp_path: Path) -> None:
    """A check may use 600 MB and itself holds 460 MB when it reads terrain again for a file that goes beyond it."""
    for rows, fits in ((4096, True), (8192, False)):
        path = tmp_path / f"{rows}.tif"
        with rasterio.open(
            path, "w", driver="GTiff", width=4096, height=rows, count=1, dtype="float32", crs="EPSG:4326",
            transform=from_origin(-84.6, 36.6, 1e-5, 1e-5), compress="deflate", blockysize=rows, sparse_ok=True,
        ):  # fmt: skip
            pass
        if fits:
            assert open_raster(path, where="m").rows == rows
        else:
            with pytest.raises(InputError, match="64 MB"):
                open_raster(path, where="m")


@pytest.mark.parametrize("tiled", [True, False])
def test_blocks_that_were_never_written_are_unknown_and_no_sea(tmp_path: Path, tiled: bool) -> None:
    path, heights = tmp_path / "a.tif", np.full((96, 96), 400.0, "float32")
    shape: dict[str, Any] = {"tiled": True, "blockxsize": 32, "blockysize": 32} if tiled else {"blockysize": 32}
    with rasterio.open(
        path, "w", driver="GTiff", width=96, height=96, count=1, dtype="float32", crs="EPSG:4326", sparse_ok=True,
        transform=from_origin(-84.6, 36.6, 1e-3, 1e-3), **shape,
    ) as file:  # fmt: skip
        file.write(heights[:32, :32] if tiled else heights[:32], 1, window=Window(0, 0, 32 if tiled else 96, 32))
    read = open_raster(path, where="m").read
    for col, row, cols, rows in ((0, 0, 96, 96), (5, 7, 60, 50), (40, 40, 10, 10), (31, 31, 2, 2), (0, 0, 32, 32)):
        found = np.full((rows, cols), -1.0)
        for first, part in read(col, row, cols, rows):
            found[first : first + len(part)] = part
        wanted = np.full((96, 96), np.nan)
        wanted[:32, : 32 if tiled else 96] = 400.0
        np.testing.assert_array_equal(found, wanted[row : row + rows, col : col + cols])


# -- flat ground and peaks ----------------------------------------------------------------------------------------

MOUND = (Peak(50.0, 50.0, 70.0, 20.0, 20.0),)
MIXED = (Peak(20.0, 70.0, 33.0, 7.0, 11.0), Peak(60.0, 40.0, -25.0, 9.0, 8.0), Peak(62.0, 45.0, 50.0, 6.0, 15.0))


@pytest.mark.first_quick
@pytest.mark.parametrize("shapes", [MOUND, MIXED], ids=["mound", "hills and a pit"])
@pytest.mark.parametrize("most", [4_000_000, 3_000], ids=["affordable", "too coarse"])
def test_gridded_peaks_are_never_below_the_true_ones(
    shapes: tuple[Peak, ...], most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(peaks, "MAX_PEAK_NODES", most)
    box = (-50.0, -50.0, 150.0, 160.0)
    surface = load_terrain(TerrainSpec(peaks=shapes, flat_m=2.0), Frame(36.6, -84.3, 10.0), box, where="m")
    assert surface.ground_m.size <= most
    e, n = inside(box, 200_000)
    above = surface.ground_at(e, n) - (12.0 + height_of(shapes, e, n))
    assert above.min() > -1e-9
    if most > 3_000:
        assert above.max() <= 0.02


@pytest.mark.slow
@settings(max_examples=draws(24))
@given(
    st.lists(
        st.builds(
            Peak, st.floats(-100, 200), st.floats(-100, 200), st.floats(-300, 300), st.floats(0.5, 300),
            st.floats(0.5, 300),
        ),
        min_size=1, max_size=5,
    ),
    st.integers(0, 1000),
)  # fmt: skip
def test_any_peaks_are_never_undercut(shapes: list[Peak], seed: int) -> None:
    box = (0.0, 0.0, 100.0, 60.0)
    heights, grid = peaks.peaks_grid(0.0, shapes, box)
    rng = np.random.default_rng(seed)
    e, n = rng.uniform(0, 100, 2000), rng.uniform(0, 60, 2000)
    ground = Surface(heights, heights, grid).ground_at(e, n)
    assert (ground - height_of(shapes, e, n)).min() > -1e-9


def test_flat_ground_is_flat_and_known_everywhere_in_the_box() -> None:
    surface = load_terrain(TerrainSpec(flat_m=5.0), Frame(36.6, -84.3, 100.0), (0.0, 0.0, 10.0, 20.0), where="m")
    assert surface.ground_at([0.0, 10.0, 5.0], [0.0, 20.0, 7.0]).tolist() == [105.0, 105.0, 105.0]
    assert np.isnan(surface.ground_at(-1.0, 5.0))
    assert surface.info["resolution_m"] == 0


def test_the_papers_worlds_are_hashed_by_what_they_say() -> None:
    def sha(**keys: Any) -> object:
        return load_terrain(TerrainSpec(**keys), FRAME, (0.0, 0.0, 99.0, 99.0), where="m").info["dem_sha256"]

    assert sha(peaks=MOUND) == sha(peaks=MOUND)
    assert len({sha(peaks=MOUND), sha(peaks=MIXED), sha(flat_m=0.0), sha(flat_m=1.0)}) == 4


@pytest.mark.parametrize(
    ("keys", "words"),
    [({}, "either"), ({"dem": ("sample:jacksboro",), "flat_m": 0.0}, "either"),
     ({"flat_m": 0.0, "crs": "EPSG:4326"}, "crs"),
     ({"flat_m": 0.0, "vertical_datum": "WGS84"}, "mean sea level"), ({"dem": ("sample:everest",)}, "sample:jacksboro"),
     ({"dem": ("sample:jacksboro", "b.tif")}, "alone")],
)  # fmt: skip
def test_a_terrain_that_is_two_or_none_is_refused(keys: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        open_terrain(TerrainSpec(**keys), where="m")


# -- obstacles on the ground --------------------------------------------------------------------------------------


def test_an_obstacle_height_stands_on_all_ground(tmp_path: Path) -> None:
    surface = load(degrees_tif(tmp_path / "a.tif"), obstacle_height_m=25.0)
    assert np.allclose(surface.top_m - surface.ground_m, 25.0)
    assert surface.info["bare_dem"] is False


@pytest.mark.slow
@pytest.mark.parametrize(
    ("crs", "cell"),
    [("EPSG:4326", 0.0003), ("EPSG:4326", 0.0071), ("EPSG:4326", 0.002), ("EPSG:32616", 35.0), ("EPSG:32616", 400.0)],
)
def test_a_canopy_is_never_under_estimated(tmp_path: Path, crs: str, cell: float) -> None:
    box = (-1500.0, -1500.0, 1500.0, 1500.0)
    there = Transformer.from_crs(PLANE, crs, always_xy=True)
    x, y = there.transform(*(a.ravel() for a in np.meshgrid(np.linspace(-9e3, 9e3, 9), np.linspace(-9e3, 9e3, 9))))
    west, north = float(np.min(x)) + 0.3 * cell, float(np.max(y)) - 0.2 * cell
    cols, rows = int((np.max(x) - west) / cell), int((north - np.min(y)) / cell)
    trees = np.random.default_rng(4).integers(0, 40, (rows, cols)).astype("uint8")
    canopy = tif(tmp_path / "c.tif", trees, from_origin(west, north, cell, cell), crs)
    surface = load(degrees_tif(tmp_path / "a.tif"), box=box, canopy=canopy)
    e, n = inside(box, 100_000)
    px, py = there.transform(e, n)
    pixel = trees[np.floor((north - py) / cell).astype(int), np.floor((px - west) / cell).astype(int)]
    stands = surface.top_at(e, n) - surface.ground_at(e, n)
    assert (stands - pixel).min() > -1e-6
    assert stands.max() <= 39.0 + 1e-6
    assert surface.info["bare_dem"] is False
    assert "canopy_sha256" in surface.info


@pytest.mark.nightly
def test_a_lone_tree_stands_in_the_cells_that_it_meets_and_nowhere_else(tmp_path: Path) -> None:
    trees = np.zeros((1000, 1000), "uint8")
    trees[500, 500] = 30
    canopy = tif(tmp_path / "c.tif", trees, from_origin(-84.6, 36.6, 0.0002, 0.0002))
    surface = load(degrees_tif(tmp_path / "a.tif"), canopy=canopy)
    raised = surface.top_m - surface.ground_m
    # The canopy pixel lies in one DEM cell, so four nodes rise.
    assert np.count_nonzero(raised) == 4
    assert surface.top_at(0.0, 0.0) - surface.ground_at(0.0, 0.0) == pytest.approx(30.0, abs=1e-6)


@pytest.mark.nightly
def test_unknown_canopy_is_unknown_unless_its_height_is_given(tmp_path: Path) -> None:
    trees = np.full((1000, 1000), 10, "uint8")
    trees[500, 500] = 255
    trees = trees[:, :-200]
    canopy = tif(tmp_path / "c.tif", trees, from_origin(-84.6, 36.6, 0.0002, 0.0002), nodata=255)
    dem = degrees_tif(tmp_path / "a.tif")
    box = (-3000.0, -2000.0, 8000.0, 2000.0)
    surface = load(dem, canopy=canopy, box=box)
    inner, outer = (0.0, 0.0), (7000.0, 0.0)
    for at in (inner, outer):
        assert np.isnan(surface.top_at(*at))
        assert np.isfinite(surface.ground_at(*at))
    assert any(n.code == "canopy_unknown" for n in notes_on(surface.info))
    given_m = load(dem, canopy=canopy, box=box, canopy_nodata_m=20.0, obstacle_height_m=3.0)
    for at in (inner, outer):
        assert given_m.top_at(*at) - given_m.ground_at(*at) == pytest.approx(20.0, abs=1e-6)


# -- hostile files ------------------------------------------------------------------------------------------------


def judged(path: Path, **keys: Any) -> str:
    """Read a file: it is ``read`` or ``refused`` as an input; any other exception or a warning is an error here."""
    try:
        surface = load(path, **keys)
    except InputError as error:
        require_placed_words(error)
        return "refused"
    known = surface.ground_m[np.isfinite(surface.ground_m)]
    assert known.size == 0 or -500.0 <= known.min() <= known.max() <= 9000.0
    return "read"


@pytest.fixture(scope="module")
def good_tif(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("tif") / "a.tif"
    degrees_tif(path, hills(100, 100).astype("int16"), compress="deflate", nodata=-9999)
    return path.read_bytes()


@pytest.mark.slow
@pytest.mark.draws
def test_a_corrupted_geotiff_is_read_or_refused(good_tif: bytes, tmp_path: Path) -> None:
    assert draw_attacks(90, partial(corrupted_geotiff, good_tif, tmp_path / "broken.tif")) == {"read", "refused"}


def corrupted_geotiff(good_tif: bytes, path: Path, data: st.DataObject) -> str:
    broken = bytearray(good_tif)
    header = st.integers(0, min(700, len(broken) - 1))
    for _ in range(data.draw(st.integers(0, 6))):
        broken[data.draw(header | st.integers(0, len(broken) - 1))] = data.draw(st.integers(0, 255))
    if data.draw(st.booleans()):
        broken = broken[: data.draw(st.integers(1, len(broken)))]
    path.write_bytes(bytes(broken))
    return judged(path)


@settings(max_examples=draws(25), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 1201 * 1201 * 2 + 50), st.binary(max_size=64))
def test_an_hgt_of_the_wrong_size_is_refused(tmp_path: Path, size: int, head: bytes) -> None:
    path = tmp_path / "N36W085.hgt"
    path.write_bytes((head + bytes(size))[:size])
    if size != 1201 * 1201 * 2:
        assert "hgt" in str(refusal(path))


def test_an_hgt_without_its_name_is_refused_with_the_cure(tmp_path: Path) -> None:
    assert "N36W085.hgt" in str(refusal(hgt(tmp_path / "tile.hgt", hills(1201, 1201))))


@pytest.mark.draws
def test_a_garbled_ascii_grid_is_read_or_refused(tmp_path: Path) -> None:
    assert draw_attacks(80, partial(garbled_grid, tmp_path / "a.asc")) == {"read", "refused"}


def garbled_grid(path: Path, data: st.DataObject) -> str:
    number = st.sampled_from(["100", "0", "-1", "1e9", "99999999999", "nan", "inf", "0.002", "-84.6", "x", "", "36.4"])
    lines = [
        f"{key} {data.draw(number)}" for key in ("ncols", "nrows", "xllcorner", "yllcorner", "cellsize", "NODATA_value")
    ]
    if data.draw(st.booleans()):
        lines[:5] = ["ncols 9", "nrows 9", "xllcorner -84.6", "yllcorner 36.4", "cellsize 0.02"]
    row = "400 410 420 430 440 450 460 470 480"
    junk = st.sampled_from(["1 2 3", "nan 1e400 -", "5" * 400, "\x00", "4 5 6 7 8 9 1 2 3"])
    lines += data.draw(st.lists(st.just(row) | junk, max_size=9) | st.just([row] * 9))
    path.write_text("\n".join(lines))
    return judged(path, crs="EPSG:4326")


def test_empty_files_and_folders_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.tif").touch()
    assert "empty" in str(refusal(tmp_path / "a.tif"))
    assert "folder" in str(refusal(tmp_path))
    assert "is not there" in str(refusal("a\0b.tif"))


def test_a_file_that_cannot_be_opened_is_named_once(tmp_path: Path) -> None:
    (tmp_path / "empty.tif").touch()
    for path in (tmp_path / "none.tif", tmp_path / "empty.tif", tmp_path):
        words = str(refusal(path))
        assert words.count(str(path)) == 1, words
        assert words.count("terrain.dem") == 1, words


def test_every_tile_at_fault_is_named(tmp_path: Path) -> None:
    error = refusal([degrees_tif(tmp_path / "a.tif"), tmp_path / "none.tif"])
    assert error.where == "m: terrain.dem[1]"


def test_an_option_of_the_command_line_has_no_keys() -> None:
    with pytest.raises(InputError) as caught:
        load_terrain(TerrainSpec(dem=("none.tif",)), FRAME, BOX, where="--dem")
    assert caught.value.where == "--dem"


def test_a_mission_too_wide_for_the_polynomial_is_refused(tmp_path: Path) -> None:
    heights = np.full((200, 2000), 300, "int16")
    path = tif(tmp_path / "a.tif", heights, from_origin(-10.0, 82.0, 0.05, 0.05))
    frame = Frame(78.0, 20.0)
    with pytest.raises(InputError, match="too wide"):
        load(path, frame=frame, box=(-250e3, -250e3, 250e3, 250e3))
    assert math.isfinite(load(path, frame=frame, box=(-20e3, -20e3, 20e3, 20e3)).ground_at(0.0, 0.0))


@pytest.mark.slow
def test_a_unit_that_proj_does_not_know_is_no_line_of_a_library(tmp_path: Path) -> None:
    good, odd = tmp_path / "good.tif", tmp_path / "odd.tif"
    profile = {"driver": "GTiff", "height": 3, "width": 3, "count": 1, "dtype": "float32", "crs": "EPSG:4326"}
    with rasterio.open(good, "w", transform=Affine(0.01, 0.0, 8.0, 0.0, -0.01, 47.0), **profile) as dataset:
        dataset.write(np.ones((1, 3, 3), np.float32))
    header = good.read_bytes()
    for key, known, unknown in ((2048, 4326, 33510), (2054, 9102, 65422)):  # the system, and the unit of its angles
        before = struct.pack("<HHHH", key, 0, 1, known)
        assert header.count(before) == 1
        header = header.replace(before, struct.pack("<HHHH", key, 0, 1, unknown))
    odd.write_bytes(header)
    code = (
        "import sys; from gcsplan.world.geodesy.frame import Frame; from gcsplan.world.terrain.terrain import *; "
        "spec = TerrainSpec(dem=(sys.argv[1],), vertical_datum='EGM96', crs='EPSG:4326'); "
        "print(load_terrain(spec, Frame(46.985, 8.015), (-9.0, -9.0, 9.0, 9.0), where='').ground_m.shape)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(odd)], capture_output=True, text=True, timeout=60.0, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def tile_of(folder: Path, col: int, row: int, *, written: bool) -> Path:
    """A tile of 0.2° with 3600 × 3600 nodes: 52 MB that take some kilobytes on the disk where nothing is written."""
    path = folder / f"t{col:02d}{row:02d}.tif"
    shape = {"width": 3600, "height": 3600, "tiled": True, "blockxsize": 256, "blockysize": 256}
    at = from_origin(8.0 + 0.2 * col, 48.0 - 0.2 * row, 0.2 / 3600, 0.2 / 3600)
    with rasterio.open(
        path, "w", driver="GTiff", count=1, dtype="float32", crs="EPSG:4326", transform=at, sparse_ok=True,
        compress="deflate", **shape,
    ) as file:  # fmt: skip
        if written:
            file.write(np.full((3600, 3600), 100.0 + 10 * col + row, np.float32), 1)
    return path


@pytest.mark.nightly
def test_many_tiles_are_read_by_windows(tmp_path: Path) -> None:
    """36 tiles, 1.9 GB if they were read: the memory is that of the window, and the hash that of what was read."""
    for col in range(6):
        for row in range(6):
            tile_of(tmp_path, col, row, written=(col, row) == (2, 3))
    frame, box = Frame(47.3, 8.5), (-3000.0, -3000.0, 3000.0, 3000.0)
    spec = TerrainSpec(dem=(str(tmp_path),), vertical_datum="EGM96")

    def load() -> Surface:
        return load_terrain(spec, frame, box, where="m")

    first = load()
    tracemalloc.start()
    again = load()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 6 * again.ground_m.nbytes < 500e6
    assert np.unique(again.ground_m).tolist() == [123.0]
    assert first.info == again.info

    assert len(tiles_of([str(tmp_path)], where="m")) == 36
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gcsplan.world.terrain.mosaic.HASHED_BYTES", 0)
        patch.setattr("gcsplan.world.terrain.raster.sha256_of_all", lambda path: pytest.fail(f"{path} is read whole"))
        read = load().info["dem_sha256"]
        assert read == load().info["dem_sha256"] != first.info["dem_sha256"]
        tile_of(tmp_path, 0, 0, written=True)  # far away, but of another size
        assert load().info["dem_sha256"] != read
    (tmp_path / "t0203.tif").unlink()
    with pytest.raises(InputError, match=r"nothing but voids|does not cover|damaged or empty"):
        load()
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="a folder without tiles"):
        load_terrain(TerrainSpec(dem=(str(tmp_path / "empty"),)), frame, box, where="m")
