"""ArduPilot's terrain grid against a second implementation, in the autopilot's order and with its rounding."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.world.terrain.cell import Cell
from gcsplan.world.terrain.grid import (
    ALL_PARTS,
    SAME_CORNER_E7,
    Block,
    PostHeights,
    TerrainGrid,
    cell_at,
    known_parts,
    part_of,
)
from tests.oracles import terrain_grid as oracle

RNG = np.random.default_rng(22)
PLACES = [
    (int(lat), int(lon))
    for lat, lon in np.column_stack([RNG.uniform(-84e7, 84e7, 150), RNG.uniform(-180e7, 180e7 - 1, 150)])
] + [(366_000_000, -844_000_000), (369_999_999, -840_000_001), (-1, -1), (0, 0), (-365_000_000, 1_799_999_999)]


def hills(lat_deg: Floats, lon_deg: Floats) -> Floats:
    return np.asarray(400.0 + 300.0 * np.sin(lat_deg * 900.0) * np.cos(lon_deg * 700.0))


@pytest.mark.parametrize("spacing_m", [100, 30, 250])
def test_blocks_and_their_corners_are_the_autopilots(spacing_m: int) -> None:
    grid = TerrainGrid(spacing_m)
    for lat, lon in PLACES:
        cell = cell_at(lat, lon)
        [block] = grid.blocks_over(lat, lon)
        for single in (False, True):
            theirs = oracle.info_of(lat, lon, spacing_m, single)
            assert cell == (theirs.lat_degrees, theirs.lon_degrees)
            north, east = grid.offset_m(cell, lat, lon)
            assert abs(north - theirs.north) < 0.012
            assert abs(east - theirs.east) < 0.012 * (3 if single else 1)
            if (block.north, block.east) != (theirs.grid_idx_x, theirs.grid_idx_y):
                inside = min(float(m) % spacing_m for m in (north + 0.02, east + 0.02))
                assert inside < 0.05, "another block only on the border of both"
                continue
            # TERRAIN_MARGIN 0.05 allows 5; boards without double round by more near the poles alone.
            most = SAME_CORNER_E7 if abs(lat) > 75e7 else 4
            ours = grid.corner_e7(block)
            assert max(abs(ours[0] - theirs.grid_lat), abs(ours[1] - theirs.grid_lon)) <= (most if single else 0)
            assert grid.block_at(theirs.grid_lat, theirs.grid_lon) == block
        assert grid.blocks_a_row(cell) == oracle.blocks_a_row(*cell, spacing_m)


def test_a_post_is_where_the_autopilot_reads_it() -> None:
    grid = TerrainGrid()
    for lat, lon in PLACES:
        cell = cell_at(lat, lon)
        north, east = (round(float(m) / 100.0) for m in grid.offset_m(cell, lat, lon))
        there = oracle.info_of(*(math.floor(float(x)) for x in grid.post_e7(cell, north, east)))
        if (there.lat_degrees, there.lon_degrees) == cell:
            assert abs(there.north - 100.0 * north) < 0.03
            assert abs(there.east - 100.0 * east) < 0.03


def test_heights_between_posts_are_the_autopilots() -> None:
    grid = TerrainGrid()
    posts = PostHeights(grid, hills)

    def post(lat_degrees: int, lon_degrees: int, north: int, east: int) -> float:
        lat, lon = grid.post_e7(Cell(lat_degrees, lon_degrees), north, east)
        return math.ceil(float(hills(lat / 1e7, lon / 1e7)))

    places = [(a, o) for a, o in PLACES if abs(a) < 60e7][:60]
    ours = posts.amsl(*np.array(places, float).T)
    theirs = [oracle.height(a, o, post) for a, o in places]
    assert np.abs(ours - theirs).max() < 0.15  # the hills are as steep as 5:1, and places differ by up to 1 cm


def test_no_post_lies_below_the_ground_and_none_a_metre_above_it() -> None:
    grid, block = TerrainGrid(), Block(Cell(36, -85), 17, 20)
    heights = PostHeights(grid, hills).block(block)
    north, east = np.mgrid[17 * 24 : 17 * 24 + 28, 20 * 28 : 20 * 28 + 32]
    lat, lon = grid.post_e7(block.cell, north, east)
    over = heights - hills(lat / 1e7, lon / 1e7)
    assert (over >= -1e-6).all()
    assert (over < 1.0).all()
    assert (heights == np.round(heights)).all()
    assert (PostHeights(grid, lambda a, o: 0 * a + 300.0 + 1e-9).block(block) == 300.0).all()


@pytest.mark.nightly
def test_blocks_of_a_box_are_those_of_all_its_points() -> None:
    grid = TerrainGrid()
    for lat, lon, reach in ((36.55, -84.4, 0.1), (-33.02, 151.98, 0.1), (0.001, -0.001, 0.05), (61.0, 179.95, 0.2)):
        south, west, north, east = ((lat - reach) * 1e7, (lon - reach) * 1e7, (lat + reach) * 1e7, (lon + reach) * 1e7)
        ours = set(grid.blocks_within(south, west, north, east))
        f = np.linspace(0.0, 1.0, 120)
        points = (a.ravel() for a in np.meshgrid(south + f * (north - south), west + f * (east - west)))
        theirs = set(grid.blocks_over(*points))
        assert theirs <= ours
        assert len(ours) <= len(theirs) + 12
    assert next(TerrainGrid(5).blocks_within(-90e7, -180e7, 90e7, 179e7)).cell == Cell(-90, -180)  # not all of them
    assert len(list(grid.blocks_within(365_000_000, -844_000_000, 365_000_000, -844_000_000))) == 1


def test_neighbouring_blocks_share_posts_and_a_window_is_their_mosaic() -> None:
    posts, cell = PostHeights(TerrainGrid(), hills), Cell(36, -85)
    whole = posts.window(cell, (410, 470), (555, 640))
    for block in (Block(cell, 17, 20), Block(cell, 18, 20), Block(cell, 17, 21), Block(cell, 18, 21)):
        own = posts.block(block)
        for i in range(28):
            for j in range(32):
                r, c = block.north * 24 + i - 410, block.east * 28 + j - 555
                if 0 <= r < whole.shape[0] and 0 <= c < whole.shape[1]:
                    assert whole[r, c] == own[i, j]


def test_a_part_with_an_unknown_post_is_unknown() -> None:
    grid, block = TerrainGrid(), Block(Cell(36, -85), 3, 5)
    hole = grid.post_e7(block.cell, 3 * 24 + 9, 5 * 28 + 14)

    def holed(lat_deg: Floats, lon_deg: Floats) -> Floats:
        near = (np.abs(lat_deg * 1e7 - hole[0]) < 1000) & (np.abs(lon_deg * 1e7 - hole[1]) < 1000)
        return np.where(near, np.nan, 100.0)

    posts = PostHeights(grid, holed)
    heights = posts.block(block)
    bit = (9 // 4) * 8 + 14 // 4
    assert known_parts(heights) == ALL_PARTS & ~(1 << bit)
    assert np.isnan(part_of(heights, bit)).all()
    assert np.isnan(heights).sum() == 16
    # Between an unknown part and a known one the autopilot lacks a post, one post farther it does not.
    for north, east, known in ((3 * 24 + 7.5, 5 * 28 + 13.5, False), (3 * 24 + 6.5, 5 * 28 + 13.5, True)):
        lat, lon = grid.post_e7(block.cell, north, east)
        assert np.isfinite(posts.amsl(lat, lon)).all() == known


def test_unknown_places_and_the_antimeridian() -> None:
    posts = PostHeights(TerrainGrid(), hills)
    assert np.isnan(posts.amsl([np.nan], [0.0])).all()
    lat = np.full(3, -165_000_000.0)
    around = posts.amsl(lat, [1_799_999_999, -1_800_000_000, 1_800_000_000])
    assert np.ptp(around) < 2.0
    assert TerrainGrid().blocks_over(0, 1_800_000_000)[0].cell == (0, -180)
