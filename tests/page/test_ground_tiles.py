"""Terrain tiles are the ground of a plan, decoded as the map decodes them."""

from __future__ import annotations

import io
import json
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gcsplan.bench.sample import SAMPLE_MIDDLE_DEG, SAMPLE_TERRAIN
from gcsplan.errors import InputError
from gcsplan.mission_file import load_mission
from gcsplan.page.ground_tiles import GroundTiles
from gcsplan.units import FOOT, METRE, Unit
from gcsplan.world.geodesy.frame import Frame


def tile_at(lat_deg: float, lon_deg: float, zoom: int) -> tuple[int, int, int, int, int]:
    """Zoom, x and y of the tile, row and column of the pixel."""
    x = (lon_deg + 180.0) / 360.0 * 2**zoom
    y = (1.0 - math.asinh(math.tan(math.radians(lat_deg))) / math.pi) / 2.0 * 2**zoom
    return zoom, int(x), int(y), int(y % 1 * 256), int(x % 1 * 256)


def heights(png: bytes | None) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Metres, as MapLibre reads the terrarium encoding."""
    assert png is not None
    red, green, blue = np.moveaxis(np.asarray(Image.open(io.BytesIO(png)), np.float64), -1, 0)
    return red * 256.0 + green + blue / 256.0 - 32768.0


@pytest.mark.slow
def test_a_tile_has_the_heights_that_a_plan_flies_over() -> None:
    tiles = GroundTiles(SAMPLE_TERRAIN, Path(), None)
    lat, lon = SAMPLE_MIDDLE_DEG
    mission = load_mission({
        "version": 1, "terrain": SAMPLE_TERRAIN, "limits": {"min_agl_m": 30},
        "vehicles": [{"name": "a", "sysid": 1, "autopilot": "px4", "start": [lat, lon], "goal": [lat + 0.01, lon]}],
    })  # fmt: skip
    zoom, x, y, row, col = tile_at(lat, lon, 15)
    ground = heights(tiles.png(zoom, x, y))[row, col]
    east, north = mission.frame.to_plane(lat, lon)
    assert ground == pytest.approx(float(mission.surface.ground_at(east, north)), abs=3.0)  # a pixel is 4 m wide
    west, south, far_east, far_north = tiles.bounds or [math.nan] * 4
    assert west < lon < far_east
    assert south < lat < far_north


@pytest.mark.slow
def test_tiles_of_all_zooms_agree_and_are_kept() -> None:
    tiles = GroundTiles(SAMPLE_TERRAIN, Path(), None)
    lat, lon = SAMPLE_MIDDLE_DEG
    found = []
    for zoom in (9, 12, 14):
        z, x, y, row, col = tile_at(lat, lon, zoom)
        found.append(heights(tiles.png(z, x, y))[row, col])
        assert tiles.png(z, x, y) is tiles.png(z, x, y)
    assert max(found) - min(found) < 60.0


@pytest.mark.parametrize("tile", [(5, 1, 1), (16, 1, 1), (12, -1, 0), (12, 4096, 0), (12, 0, 0), (12, 3000, 1500)])
def test_there_is_no_tile_beyond_the_terrain(tile: tuple[int, int, int]) -> None:
    assert GroundTiles(SAMPLE_TERRAIN, Path(), None).png(*tile) is None


def test_flat_ground_is_flat_and_has_no_edge() -> None:
    tiles = GroundTiles({"flat_m": 400}, Path(), None)
    assert (tiles.flat, tiles.bounds) == (True, None)
    assert np.ptp(heights(tiles.png(12, 2144, 1455))) == 0.0
    assert heights(tiles.png(12, 2144, 1455))[0, 0] == 400.0


@pytest.mark.slow
def test_hills_of_a_local_mission_stand_in_its_own_frame() -> None:
    section = {"flat_m": 0, "peaks": [{"center": [500, 500], "height_m": 100, "decay_m": [80, 80]}]}
    frame = Frame(46.5, 8.5)
    tiles = GroundTiles(section, Path(), frame)
    lat, lon = frame.to_degrees(500.0, 500.0)
    z, x, y, row, col = tile_at(float(lat), float(lon), 14)
    assert heights(tiles.png(z, x, y))[row, col] == pytest.approx(100.0, abs=3.0)


@pytest.mark.parametrize("section", [{"dem": "nowhere.tif"}, {"dm": "x"}, "x", {"flat_m": "x"}])
def test_terrain_that_cannot_be_opened_is_bad_input(section: object, tmp_path: Path) -> None:
    with pytest.raises(InputError):
        GroundTiles(section, tmp_path, None)


@pytest.mark.slow
def test_a_tile_at_a_slanted_edge_is_there_because_the_page_requests_it() -> None:
    assert (heights(GroundTiles(SAMPLE_TERRAIN, Path(), None).png(11, 544, 801)) > 200.0).all()


def test_ground_that_is_too_much_for_one_tile_is_flat_there() -> None:
    assert (heights(GroundTiles(SAMPLE_TERRAIN, Path(), None).png(6, 17, 24)) == 0.0).all()


@pytest.mark.parametrize(("unit", "step_m"), [(METRE, 20.0), (FOOT, 50 * 0.3048)])
def test_contours_lie_on_the_ground_of_their_height(unit: Unit, step_m: float) -> None:
    tiles = GroundTiles(SAMPLE_TERRAIN, Path(), None)
    lat, lon = SAMPLE_MIDDLE_DEG
    zoom, x, y, _, _ = tile_at(lat, lon, 13)
    drawn = json.loads(tiles.contours(zoom, x, y, unit) or b"")
    rise = sorted({line["properties"]["height_m"] for line in drawn["features"]})
    assert np.diff(rise) == pytest.approx(step_m)
    assert {round(h / step_m) % 5 == 0 for h in rise} == {True, False}
    ground = heights(tiles.png(zoom, x, y))
    assert rise[0] - step_m < ground.min() <= rise[0] + 1.0  # a pixel's height is read at its middle
    assert rise[-1] - 1.0 <= ground.max() < rise[-1] + step_m
    for line in drawn["features"]:
        for part in line["geometry"]["coordinates"]:
            for lon_deg, lat_deg in part:
                _, i, j, row, col = tile_at(lat_deg, lon_deg, zoom)
                if (i, j) == (x, y) and 4 <= min(row, col) <= max(row, col) < 252:
                    near = ground[row - 4 : row + 5, col - 4 : col + 5]
                    assert near.min() - 1.0 <= line["properties"]["height_m"] <= near.max() + 1.0


def test_no_contours_where_there_is_no_ground() -> None:
    tiles = GroundTiles(SAMPLE_TERRAIN, Path(), None)
    assert json.loads(tiles.contours(13, 0, 0, METRE) or b"")["features"] == []
    assert [tiles.contours(z, x, 0, METRE) for z, x in ((13, -1), (40, 0))] == [None] * 2
