"""Terrain and zones as objects of a script: read as the files that they would be, mistakes with place and cure."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rasterio
import shapely
from rasterio.io import DatasetReader

from gcsplan.errors import GcsplanError, InputError
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.memory_files import with_rasters, with_zones
from gcsplan.mission_file.request import MissionFile
from tests.support.effort import alike

HEIGHTS = (300.0 + np.random.default_rng(1).uniform(0.0, 50.0, (160, 160))).astype(np.float32)
CELL = 0.0005
TRANSFORM = (CELL, 0.0, -84.34, 0.0, -CELL, 36.55)
TERRAIN: dict[str, Any] = {"dem": HEIGHTS, "transform": TRANSFORM, "crs": "EPSG:4326", "vertical_datum": "EGM96"}
RING = [[-84.31, 36.51], [-84.29, 36.51], [-84.30, 36.515], [-84.31, 36.51]]
POLYGON = {"type": "Polygon", "coordinates": [RING]}
FEATURE = {"type": "Feature", "geometry": POLYGON, "properties": {"name": "village", "ceiling_agl_m": 90}}


def mission(terrain: Any = None, no_fly: Any = (), **more: Any) -> MissionFile:
    vehicle = {"name": "u", "sysid": 1, "autopilot": "arducopter", "start": [36.50, -84.3], "goal": [36.52, -84.3]}
    whole = {
        "version": 1,
        "terrain": TERRAIN if terrain is None else terrain,
        "limits": {"min_agl_m": 30},
        "vehicles": [vehicle],
    }
    return load_mission(whole | {"vehicles": [vehicle], "no_fly": no_fly} | more)


def written(folder: Path, heights: Any = HEIGHTS, transform: Any = TRANSFORM) -> Path:
    file = folder / "dem.tif"
    with rasterio.open(
        file, "w", driver="GTiff", count=1, dtype=heights.dtype.name, height=heights.shape[0], width=heights.shape[1],
        crs="EPSG:4326", transform=rasterio.Affine(*transform),
    ) as dataset:  # fmt: skip
        dataset.write(heights, 1)
    return file


def as_dataset(file: Path) -> DatasetReader:
    return rasterio.open(file)


def as_xarray(file: Path) -> Any:
    """What rioxarray has, by its names; rows go north, as xarray often has them."""
    rows = len(HEIGHTS)
    north = rasterio.Affine(CELL, 0.0, TRANSFORM[2], 0.0, CELL, TRANSFORM[5] - rows * CELL)
    rio = SimpleNamespace(crs="EPSG:4326", nodata=float("nan"), transform=lambda: north)
    flipped = HEIGHTS[::-1][None]

    class Found:
        shape, dtype, attrs, encoding = flipped.shape, flipped.dtype, {"units": "m"}, {}

        def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
            return flipped

    found = Found()
    found.rio = rio  # type: ignore[attr-defined]
    return found


@pytest.mark.parametrize("make", [as_dataset, as_xarray])
def test_every_form_of_one_terrain_gives_the_ground_of_its_file(make: Callable[[Path], Any], tmp_path: Path) -> None:
    file = written(tmp_path)
    of_file = mission({"dem": str(file), "vertical_datum": "EGM96"}).surface
    of_array = mission().surface
    of_object = mission({"dem": make(file), "vertical_datum": "EGM96"}).surface
    for found in (of_array, of_object):
        np.testing.assert_array_equal(found.ground_m, of_file.ground_m)
        assert found.grid.error_m == of_file.grid.error_m


@pytest.mark.slow
def test_a_masked_cell_and_a_nan_are_unknown_ground_in_every_type() -> None:
    for dtype in (np.int16, np.int64, np.float32, np.float64):
        heights = np.ma.array(HEIGHTS.astype(dtype), mask=np.zeros(HEIGHTS.shape, bool))
        heights[80, 80] = np.ma.masked
        surface = mission({**TERRAIN, "dem": heights}).surface
        assert np.isnan(surface.ground_m).sum() == 1
    holed = HEIGHTS.copy()
    holed[80, 80] = np.nan
    assert np.isnan(mission({**TERRAIN, "dem": holed}).surface.ground_m).sum() == 1


def test_a_dataset_in_gdals_memory_is_read_while_it_is_open(tmp_path: Path) -> None:
    with rasterio.MemoryFile(written(tmp_path).read_bytes()) as held, held.open() as dataset:
        found = mission({"dem": dataset, "vertical_datum": "EGM96"})
    assert found.surface.ground_m.shape == mission().surface.ground_m.shape
    with pytest.raises(InputError, match=r"terrain\.dem: the dataset is closed"):
        mission({"dem": dataset, "vertical_datum": "EGM96"})


@pytest.mark.parametrize(
    ("terrain", "words"),
    [
        ({"crs": None}, r"terrain\.crs: is missing: an array needs"),
        ({"transform": None}, r"terrain\.transform: is missing: an array needs"),
        ({"transform": (1, 2, 3)}, r"terrain\.transform: must be six numbers"),
        ({"transform": "abcdef"}, r"terrain\.transform: must be six numbers"),
        ({"transform": (-84.34, CELL, 0.0, 36.55, 0.0, -CELL)}, r"GDAL's order of the six numbers"),
        ({"dem": HEIGHTS[0]}, r"terrain\.dem: must be rows and columns"),
        ({"dem": HEIGHTS.astype(complex)}, r"terrain\.dem: must be heights as numbers"),
        ({"dem": HEIGHTS.astype(object)}, r"terrain\.dem: must be heights as numbers"),
        ({"vertical_datum": None}, r"terrain\.vertical_datum: .* add `vertical_datum:`"),
        ({"crs": object()}, r"terrain\.crs: must be a coordinate system"),
        ({"crs": "EPSG:99999"}, r"state it with `crs:`"),
        ({"transform": (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)}, r"terrain\.dem"),
        ({"dem": HEIGHTS * 100.0}, r"holds nothing but voids"),
    ],
)
def test_a_mistake_in_a_terrain_of_arrays_has_its_place_and_cure(terrain: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        mission({**TERRAIN, **terrain})


class Geo:
    """Anything that says what it is as GeoJSON."""

    __geo_interface__ = FEATURE


class Frame:
    """What a GeoDataFrame has, by its names: a system of its own, and the same in degrees."""

    def __init__(self, crs: Any) -> None:
        self.crs, self.asked = crs, 0

    def to_crs(self, code: int) -> Frame:
        return Frame(code)

    def to_json(self) -> str:
        assert self.crs == 4326, "the text must be in degrees"
        return json.dumps({"type": "FeatureCollection", "features": [FEATURE]})

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        raise AssertionError("its places are in another system")


@pytest.mark.parametrize(
    "no_fly",
    [
        [FEATURE], FEATURE, [{"type": "FeatureCollection", "features": [FEATURE]}], [Geo()], Geo(), Frame(32617),
        [{"file": FEATURE}], [{"file": Frame(32617)}],
    ],
)  # fmt: skip
def test_every_form_of_one_zone_gives_the_zone_of_its_file(no_fly: Any, tmp_path: Path) -> None:
    file = tmp_path / "zones.geojson"
    file.write_text(json.dumps(FEATURE), encoding="utf-8")
    (of_file,), (found,) = mission(no_fly=[{"file": str(file)}]).zones, mission(no_fly=no_fly).zones
    assert (found.name, found.ceiling) == (of_file.name, of_file.ceiling) == ("village", found.ceiling)
    np.testing.assert_array_equal(found.shape.vertices, of_file.shape.vertices)  # type: ignore[union-attr]


def test_areas_to_stay_in_may_be_geojson_too() -> None:
    ring = [[-84.32, 36.49], [-84.28, 36.49], [-84.28, 36.53], [-84.32, 36.53], [-84.32, 36.49]]
    area = {"type": "Feature", "properties": {"name": "field"}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    outside = mission(keep_in=[area]).zones
    assert outside
    small = {**area, "geometry": {"type": "Polygon", "coordinates": [RING]}}
    with pytest.raises(InputError, match="start"):
        mission(keep_in=small)


def test_shapes_tuples_and_numbers_of_numpy_are_geojson_too() -> None:
    assert len(mission(no_fly=shapely.Polygon(RING)).zones) == 1
    line = {"type": "LineString", "coordinates": [(np.float64(-84.31), 36.51), (-84.3, np.float64(36.511))]}
    assert len(mission(no_fly=[{"file": line, "buffer_m": 40}]).zones) == 1


@pytest.mark.parametrize(
    ("no_fly", "words"),
    [
        ([{"type": "Polygon"}], r"no_fly\[0\]\.geojson: feature\.coordinates: a polygon is a list of rings"),
        ([{"type": "Point", "coordinates": [-84.3, 36.51]}], "a point needs a radius"),
        ([{"type": "Polygon", "coordinates": object()}], r"no_fly\[0\]: GeoJSON holds text, numbers"),
        ([{"type": "Polygon", "coordinates": [[[float("nan"), 36.5]] * 4]}], "NaN is no number"),
        (Frame(None), r"no_fly\[0\]: states no coordinate system"),
        ([7], r"no_fly\[0\]: must be a mapping"),
    ],
)
def test_a_mistake_in_zones_of_objects_has_its_place_and_cure(no_fly: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        mission(no_fly=no_fly)


@pytest.mark.slow
def test_numbers_as_yaml_loaders_give_them_are_read_as_in_files() -> None:
    found = mission(limits={"min_agl_m": "3e1"}, planner={"budget_s": "1.0E1"})
    assert found.vehicles[0].vehicle.limits.min_agl_m == 30.0
    assert found.planner.budget_s == 10.0
    assert mission(name="1e3").name == "1e3"
    with pytest.raises(InputError, match=r"limits\.min_agl_m"):
        mission(limits={"min_agl_m": "30"})  # quoted in a file, it is text there, too


@pytest.mark.parametrize("value", [object(), HEIGHTS, *alike(7, "x", [], {}, [object()], b"x", {1}, Frame(1), np.nan)])
@pytest.mark.parametrize("key", ["terrain", "no_fly", "vehicles", "limits", "planner", "frame"])
def test_any_object_in_the_place_of_a_section_raises_gcsplans_own_errors(key: str, value: Any) -> None:
    raised: Exception | None = None
    try:
        mission(**{key: value})
    except Exception as error:
        raised = error
    assert raised is None or isinstance(raised, GcsplanError), repr(raised)


def test_held_files_have_names_and_the_other_keys_stay() -> None:
    held: dict[str, bytes] = {}
    assert with_rasters(TERRAIN, "m: terrain", held) == {
        "dem": "terrain.dem", "crs": "EPSG:4326", "vertical_datum": "EGM96",
    }  # fmt: skip
    assert with_zones([FEATURE, {"name": "a"}], "m: no_fly", held)[1] == {"name": "a"}
    assert sorted(held) == ["no_fly[0].geojson", "terrain.dem"]
