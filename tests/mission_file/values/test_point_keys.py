"""Places in local metres."""

from __future__ import annotations

import math

import pytest

from tests.mission_file.test_load import local, the_problem, vehicle


@pytest.mark.parametrize(
    ("point", "key", "words"),
    [
        ({"east_m": 50, "north_m": 50, "up_m": 10}, "start.up_m", "under ground"),
        ({"east_m": 50, "north_m": 50, "up_m": 10, "agl_m": 5}, "start", "not both"),
        ({"east_m": 50}, "start.north_m", "is missing"),
        ({"east": 50, "east_m": 1, "north_m": 1}, "start.east", "did you mean east_m?"),
        ({"east_m": 5e5, "north_m": 0}, "start", "from the frame's origin"),
        ({"east_m": math.nan, "north_m": 0}, "start.east_m", "finite"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_local_point_is_told(point: dict[str, float], key: str, words: str) -> None:
    where, message = the_problem(local(vehicles=[vehicle(start=point, goal={"east_m": 9, "north_m": 9})]))
    assert where == f"vehicles[0].{key}"
    assert words in message
