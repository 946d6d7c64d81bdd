"""The tiles that an area needs: by name, around a place, for a mission; everything else is refused with its cure."""

from __future__ import annotations

import re
from typing import Any

import pytest

from gcsplan.app.tiles import tiles_of
from gcsplan.dem import DEFAULT_SOURCE
from gcsplan.dem.sources import MOST_TILES_OF_AREA, SOURCES
from gcsplan.errors import InputError, UsageError
from gcsplan.world.terrain.cell import cell_of


def test_tiles_by_name_are_taken_once_in_any_case() -> None:
    source, cells = tiles_of(None, None, None, "n36w085, N36W085,S01E010", None)
    assert source is SOURCES[DEFAULT_SOURCE]
    assert list(cells) == [cell_of("N36W085"), cell_of("S01E010")]


def test_around_a_corner_of_four_tiles_all_four_are_needed() -> None:
    _, cells = tiles_of(None, "46.0001,14.0001", 5.0, None, None)
    assert set(cells) == {cell_of(name) for name in ("N46E014", "N45E014", "N46E013", "N45E013")}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "given none"),
        ({"around": "46,14", "tiles": "N46E014", "radius_km": 1.0}, "--around and --tiles"),
        ({"around": "46,14"}, "belong together"),
        ({"tiles": "N46E014", "radius_km": 1.0}, "belong together"),
        ({"tiles": "Ljubljana"}, "given 'LJUBLJANA'"),
        ({"tiles": ","}, "given 0 of them"),
        ({"tiles": ",".join(["N46E014"] * (MOST_TILES_OF_AREA + 1))}, f"1 to {MOST_TILES_OF_AREA} names"),
        ({"tiles": "N46E014", "source": "strm"}, "no source 'strm'"),
        ({"around": "here", "radius_km": 1.0}, "give LAT,LON in degrees"),
        ({"around": "89,14", "radius_km": 1.0}, "within ±85°"),
    ],
)
def test_an_area_that_is_none_is_refused_with_its_cure(given: dict[str, Any], words: str) -> None:
    whole = {"mission": None, "around": None, "radius_km": None, "tiles": None, "source": None} | given
    with pytest.raises(UsageError, match=re.escape(words)):
        tiles_of(**whole)


def test_a_mission_over_terrain_of_its_own_names_no_source() -> None:
    with pytest.raises(InputError, match="names no published source"):
        tiles_of("sample:jacksboro", None, None, None, None)
