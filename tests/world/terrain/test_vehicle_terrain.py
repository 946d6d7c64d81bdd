"""The grid of an ArduPilot vehicle over a mission's ground: posts in whole metres, bilinear between, cut at degrees."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.terrain.vehicle_terrain import VehicleTerrain

GRID = GridMap.affine(-4000.0, 4000.0, 50.0, 50.0)
EAST, NORTH = np.meshgrid(-4000.0 + 50.0 * np.arange(161), 4000.0 - 50.0 * np.arange(161))
HILLS = 300.0 + 0.02 * EAST - 0.01 * NORTH


def terrain(lat_deg: float, lon_deg: float, high: float = 0.0) -> VehicleTerrain:
    frame = Frame(lat_deg, lon_deg)
    more = HILLS + high if high else HILLS
    return VehicleTerrain(frame, Surface(HILLS, more, GRID, high_m=more if high else None))


def test_the_vehicle_knows_even_ground_to_half_a_metre() -> None:
    known = terrain(47.3, 8.3)
    east, north = np.random.default_rng(1).uniform(-1500.0, 1500.0, (2, 200))
    there = known.ground_at(east, north)
    assert np.abs(there - (300.0 + 0.02 * east - 0.01 * north)).max() <= 0.5 + 0.1
    assert known.amsl(47.3, 8.3) == pytest.approx(float(known.ground_at(0.0, 0.0)), abs=1e-6)


def test_beyond_the_terrain_the_vehicle_knows_nothing() -> None:
    assert math.isnan(terrain(47.3, 8.3).amsl(47.5, 8.3))


def test_a_line_within_one_degree_tile_is_one_piece_over_what_the_vehicle_reads() -> None:
    known = terrain(47.3, 8.3)
    ends = np.array([[-800.0, -300.0], [700.0, 500.0]])
    pieces = known.pieces(ends)
    assert pieces is not None
    [(first, last, surface)] = pieces
    assert (first, last) == (0.0, 1.0)
    east, north = (ends[0] + np.linspace(0.0, 1.0, 50)[:, None] * (ends[1] - ends[0])).T
    np.testing.assert_allclose(surface.ground_at(east, north), known.ground_at(east, north), atol=0.02)


def test_a_line_over_the_border_of_a_degree_tile_is_cut_there() -> None:
    known = terrain(48.0, 8.3)
    pieces = known.pieces(np.array([[0.0, -600.0], [0.0, 200.0]]))
    assert pieces is not None
    assert [(a, b) for a, b, _ in pieces] == [
        (0.0, pytest.approx(0.75, abs=1e-3)),
        (pytest.approx(0.75, abs=1e-3), 1.0),
    ]
    assert pieces[0][2] is not pieces[1][2]


def test_sources_that_differ_are_told_as_far_as_posts_lie() -> None:
    assert terrain(47.3, 8.3).spread_at(np.zeros(3), np.zeros(3)).tolist() == [0.0, 0.0, 0.0]
    assert terrain(47.3, 8.3, high=7.0).spread_at(np.array([0.0]), np.array([0.0])) == pytest.approx([7.0])


@pytest.mark.parametrize(("lat_deg", "lon_deg"), [(47.3, 8.3), (48.0, 8.0), (-40.0, 180.0)])
def test_around_a_place_the_ground_changes_by_no_more_than_it_says(lat_deg: float, lon_deg: float) -> None:
    """Within one tile, and where four meet: against thousands of places that the vehicle reads."""
    known, rng = terrain(lat_deg, lon_deg), np.random.default_rng(2)
    for reach_m in (5.0, 60.0, 400.0):
        (east, north), (a, r) = rng.uniform(-300.0, 300.0, 2), rng.uniform(0.0, 1.0, (2, 3000))
        middle, (lat, lon) = known.ground_at(east, north), Frame(lat_deg, lon_deg).to_degrees(east, north)
        way = reach_m * np.sqrt(r) * np.array([np.cos(2.0 * np.pi * a), np.sin(2.0 * np.pi * a)])
        most_m = float(np.abs(known.ground_at(east + way[0], north + way[1]) - middle).max())
        assert most_m <= known.change_m(lat, lon, reach_m) + 1e-6
        assert known.change_m(lat, lon, reach_m) <= 0.03 * (reach_m + 250.0) + 1.0  # corners of the square around


def test_around_unknown_posts_or_too_far_the_change_is_unknown() -> None:
    assert math.isnan(terrain(47.3, 8.3).change_m(47.3, 8.3, 5000.0))
    assert math.isnan(terrain(47.3, 8.3).change_m(47.3, 8.3, 200_000.0))
    assert math.isnan(terrain(47.3, 8.3).change_m(47.3, 8.3, math.nan))


def test_around_a_place_what_sources_differ_counts_too() -> None:
    alike, two = terrain(47.3, 8.3), terrain(47.3, 8.3, high=7.0)
    assert (alike.change_m(47.3, 8.3, 0.0), two.change_m(47.3, 8.3, 0.0)) == (0.0, pytest.approx(7.0))
    assert two.change_m(47.3, 8.3, 60.0) == pytest.approx(7.0 + alike.change_m(47.3, 8.3, 60.0), abs=1.0)
