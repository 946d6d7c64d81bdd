"""Start, via points and goal against the ground and the zones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.mission_file.test_load import base, dem, load, local, the_problem, vehicle


def test_obstacles_count_for_take_off() -> None:
    terrain = {"dem": "sample:jacksboro", "obstacle_height_m": 20}
    where, message = the_problem(base(terrain=terrain, vehicles=[vehicle(takeoff_agl_m=70)]))
    assert where == "vehicles[0].takeoff_agl_m"
    assert "at least 85" in message


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"start": [-84.38, 36.6]}, "start", "look swapped"),
        ({"goal": [36.55, 84.2]}, "goal", "outside the DEM"),
        ({"goal": [-95.0, 36.6]}, "goal", "look swapped"),
        ({"goal": [95.0, 195.0]}, "goal", "latitude must be within"),
        ({"goal": [36.55, -284.2]}, "goal", "longitude must be within"),
        ({"goal": [89.9, 0.0]}, "goal", "outside the DEM"),
        ({"via": [[36.58, -84.3], [38.0, -84.3]]}, "via[1]", "outside the DEM"),
        ({"via": [[36.58, -84.3], [-84.3, 36.58]]}, "via[1]", "look swapped"),
        ({"start": [36.6, -84.4136]}, "start", "edge of the DEM"),
        ({"start": [36.61, -84.31]}, "start", "the start lies inside the no-fly zone 'village'"),
        ({"goal": [36.611, -84.312]}, "goal", "the goal lies inside the no-fly zone 'village'"),
        ({"via": [[36.61, -84.31]]}, "via[0]", "inside the no-fly zone 'village'"),
        ({"via": [[36.61, -84.31, 90]]}, "via[0]", "inside the no-fly zone 'village'"),
    ],
)  # fmt: skip
def test_a_point_that_cannot_be_flown_from_or_to_is_told(change: dict[str, Any], key: str, words: str) -> None:
    where, message = the_problem(base(vehicles=[vehicle(**change)]))
    assert where == f"vehicles[0].{key}"
    assert words in message


def test_a_start_on_a_void_is_told(tmp_path: Path) -> None:
    heights = np.full((100, 100), 300, "int16")
    heights[48:52, 48:52] = -32768
    dem(tmp_path / "a.tif", heights)
    spec = {"dem": "a.tif", "vertical_datum": "EGM96"}
    where, message = the_problem(
        base(terrain=spec, no_fly=..., vehicles=[vehicle(start=[36.5, -84.5], goal=[36.55, -84.45])]), tmp_path
    )
    assert where == "vehicles[0].start"
    assert "void" in message


@pytest.mark.parametrize(
    ("bounds", "inside"),
    [({}, True), ({"ceiling_agl_m": 1}, True), ({"floor_agl_m": 0}, True), ({"floor_agl_m": 1}, False),
     ({"floor_amsl_m": 100}, True), ({"floor_amsl_m": 900}, False), ({"ceiling_amsl_m": 900}, True)],
)  # fmt: skip
def test_a_start_is_inside_a_zone_that_reaches_its_ground(bounds: dict[str, float], inside: bool) -> None:
    zone = {"name": "z", "center": [36.6, -84.38], "radius_m": 100} | bounds
    if inside:
        assert "zone 'z'" in the_problem(base(no_fly=[zone]))[1]
    else:
        assert len(load(base(no_fly=[zone])).zones) == 1


def test_a_start_may_touch_a_zone() -> None:
    at = {"east_m": 10, "north_m": 0}
    zone = {"center": {"east_m": 0, "north_m": 0}, "radius_m": 10}
    square = {"polygon": [{"east_m": x, "north_m": y} for x, y in ((10, -5), (15, -5), (15, 5), (10, 5))]}
    goal = {"east_m": 100, "north_m": 100}
    touching = local(terrain={"flat_m": 0}, no_fly=[zone, square], vehicles=[vehicle(start=at, goal=goal)])
    assert load(touching).vehicles[0].start == (10.0, 0.0, 0.0)
    zone["radius_m"] = 10.001
    assert "zone 'no_fly[0]'" in the_problem(touching)[1]


def test_a_start_in_the_air_takes_no_take_off_height() -> None:
    start = {"east_m": 0, "north_m": 0, "up_m": 30}
    whole = local(vehicles=[vehicle(start=start, goal={"east_m": 9, "north_m": 9}, takeoff_agl_m=30)])
    assert "leave takeoff_agl_m out" in the_problem(whole)[1]
