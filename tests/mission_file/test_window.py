"""The terrain under a mission: its files, the room for detours, and what is wrong with them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.mission_file.test_load import base, dem, load, the_problem, vehicle


def test_the_surface_leaves_room_for_detours() -> None:
    mission = load(base())
    start, goal = mission.vehicles[0].start, mission.vehicles[0].goal
    # A quarter of the extent to the south, where the sample goes on for long enough.
    south = min(start[1], goal[1]) - 0.25 * (goal[0] - start[0])
    assert math.isfinite(float(mission.surface.ground_at(0.0, south)))


def test_tiles_are_found_beside_the_mission(tmp_path: Path) -> None:
    dem(tmp_path / "w.tif", np.full((100, 100), 300, "int16"))
    dem(tmp_path / "e.tif", np.full((100, 100), 310, "int16"), west=-84.4)
    whole = base(
        terrain={"dem": ["w.tif", "e.tif"], "vertical_datum": "EGM96"}, no_fly=...,
        vehicles=[vehicle(start=[36.5, -84.5], goal=[36.5, -84.3])],
    )  # fmt: skip
    mission = load(whole, tmp_path)
    assert (mission.vehicles[0].start[2], mission.vehicles[0].goal[2]) == pytest.approx((300, 310))


@pytest.mark.parametrize(
    ("terrain", "key", "words"),
    [
        ({"dem": "none.tif"}, ".dem", "is not there"),
        ({"dem": ["none.tif", "none2.tif"]}, ".dem[0]", "is not there"),
        ({"dem": 5}, ".dem", "must be text"),
        ({"dem": []}, ".dem", "at least 1"),
        ({}, "", "either"),
        ({"dem": "sample:jacksboro", "flat_m": 0}, "", "either"),
        ({"flat_m": math.inf}, ".flat_m", "finite"),
        ({"peaks": [{"center": [0, 0], "height_m": 1, "decay_m": [1, 1]}]}, ".peaks", "add `frame:"),
        ({"peaks": [{"center": [0, 0], "height_m": 1, "decay_m": [1, 0]}]}, ".peaks[0].decay_m[1]", "at least 0.001"),
        ({"dem": "sample:jacksboro", "obstacle_height_m": -1}, ".obstacle_height_m", "at least 0"),
        ({"dem": "sample:jacksboro", "canopy": "none.tif"}, ".canopy", "is not there"),
        ({"dem": "sample:jacksboro", "geoid_grid": "g.gtx"}, ".geoid_grid", "remove it"),
        ({"dem": "sample:jacksboro", "vertical_datum": "EGM2008"}, ".vertical_datum", "EGM96"),
        ({"dem": "sample:jacksboro", "vertical_datums": "EGM96"}, ".vertical_datums", "did you mean vertical_datum?"),
        ("sample:jacksboro", "", "must be a mapping"),
    ],
)  # fmt: skip
def test_a_mistake_in_the_terrain_is_told_with_its_key(terrain: Any, key: str, words: str, tmp_path: Path) -> None:
    where, message = the_problem(base(terrain=terrain), tmp_path)
    assert where == f"terrain{key}"
    assert words in message
