"""The world around a mission: ground at places in degrees, and what is said of its terrain model."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.units import AVIATION, in_units
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geodesy.height_unit import METRE
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.terrain.model_words import heights_line, heights_read, what_is_not_in
from gcsplan.world.world import ANSWERS_KEPT, World

BARE_DEM = "bare DEM: trees, masts and wires are not in it"
SURFACE_DEM = "surface DEM: trees and buildings as the radar saw them; newer ones, masts and wires are not in it"

FRAME = Frame(36.6, -84.3)


def world(*, spread_m: float = 0.0) -> World:
    """Ground that rises by 0.1 m each metre to the east, unknown in the far north."""
    axis = np.linspace(-1000.0, 1000.0, 41)
    low = np.tile(0.1 * axis + 300.0, (41, 1))
    low[:5] = np.nan
    high = low + spread_m if spread_m else low
    return World(FRAME, Airspace(Surface(low, high, GridMap.affine(-1000.0, 1000.0, 50.0, 50.0), high_m=high)))


def degrees(east_m: float, north_m: float) -> tuple[float, float]:
    lat, lon = FRAME.to_degrees(np.array([east_m]), np.array([north_m]))[0]
    return float(lat), float(lon)


def test_the_ground_at_a_place_is_that_of_the_plane_and_unknown_is_no_number() -> None:
    w = world()
    for east in (-800.0, 0.0, 123.4):
        assert w.ground_amsl(*degrees(east, 100.0)) == pytest.approx(300.0 + 0.1 * east, abs=1e-6)
    assert math.isnan(w.ground_amsl(*degrees(0.0, 950.0)))
    assert math.isnan(w.ground_amsl(*degrees(5000.0, 0.0)))


def test_more_places_than_are_kept_are_all_answered_right() -> None:
    w = world()
    east = np.linspace(-900.0, 900.0, 3 * ANSWERS_KEPT)
    for _ in range(2):
        assert [w.ground_amsl(*degrees(e, 0.0)) for e in east] == pytest.approx(300.0 + 0.1 * east, abs=1e-6)


def test_the_spread_is_between_the_two_grounds_where_sources_differ() -> None:
    assert world().spread_m(*degrees(0.0, 0.0)) == 0.0
    assert world(spread_m=7.0).spread_m(*degrees(0.0, 0.0)) == pytest.approx(7.0)
    assert world(spread_m=7.0).spread_m(*degrees(0.0, 950.0)) == 0.0  # unknown


def test_other_posts_are_another_world_and_the_same_ones_are_not() -> None:
    w = world()
    assert w.with_posts(w.post_spacing_m) is w
    other = w.with_posts(30)
    assert (other.post_spacing_m, other.frame, other.airspace) == (30, w.frame, w.airspace)


@pytest.mark.parametrize(
    ("info", "words"),
    [({}, BARE_DEM), ({"bare_dem": True}, BARE_DEM), ({"bare_dem": False}, ""), ({"dem_kind": "surface"}, SURFACE_DEM)],
)
def test_what_a_terrain_model_does_not_hold_is_said(info: dict[str, object], words: str) -> None:
    assert what_is_not_in(info) == words
    assert what_is_not_in(info, model="") == words.replace(" DEM", "")


def test_how_heights_were_read_is_one_line_with_the_ends_rounded_outwards() -> None:
    unit = replace(METRE, by="from the file")
    words = heights_read([unit, unit], "EGM96", 160.9, 439.1)
    assert words == f"{unit.stated()}; EGM96; ground 160–440 m AMSL"
    assert heights_read([unit], "EGM96", -3.2, 9.0).endswith("ground -4 to 9 m AMSL")
    assert heights_read([unit], "EGM96", 5.0, 5.0).endswith("ground 5 m AMSL")
    assert heights_line({"heights_read": words}) == f"heights: {words}"
    assert heights_line({}) is None
    line = heights_line({"heights_read": words})
    assert line is not None
    assert in_units(line, AVIATION).endswith("ground 527–1441 ft AMSL")
