"""A world of options: what check is told instead of a mission file."""

from __future__ import annotations

import pytest

from gcsplan.cli.commands.check import world_options
from gcsplan.errors import InputError
from gcsplan.mission_file.options_world import OpenWorld
from tests.mission_file.values.test_places import GRID, apart_m


def test_the_home_of_check_is_a_place_in_any_form() -> None:
    plain = world_options({"--home": "36.6,-84.38"})
    assert plain.home == (36.6, -84.38)
    assert plain.notes == ()
    assert world_options({"--home": "36.6 N, 84.38 W"}) == plain
    coarse = world_options({"--home": "32TMT 7312 4932", "--dem": "sample:jacksboro", "--min-agl": 60})
    assert apart_m(coarse.home, GRID) < 10.0
    [note] = [note for note in OpenWorld(coarse).notes if note.code == "place_is_a_square"]
    assert (note.data["place"], note.data["size"]) == ("--home", "10 m")
    with pytest.raises(InputError, match=r"--home 136.6, 84.38: .*look swapped"):
        world_options({"--home": "136.6, 84.38"})
