"""The plane of a mission: where it lies, how large it may be, and its points in degrees and metres."""

from __future__ import annotations

from typing import Any

import pytest

from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.zones import Circle, Level
from tests.mission_file.test_load import base, load, local, the_problem, vehicle


def test_the_plane_lies_in_the_middle_and_its_scale_holds_over_the_whole_surface() -> None:
    mission = load(base())
    assert (mission.frame.lat_deg, mission.frame.lon_deg) == (36.575, -84.29)
    rows, cols = mission.surface.ground_m.shape
    corners = mission.surface.grid.to_plane([0, cols - 1, 0, cols - 1], [0, 0, rows - 1, rows - 1])
    assert mission.airspace_scale >= 1.0 + 0.99 * float((corners[:, 0] ** 2).min()) / (2 * 6371e3**2)
    assert mission.airspace_scale < 1.00002


def test_a_mission_wider_than_the_plane_is_refused() -> None:
    whole = base(
        terrain={"flat_m": 0}, no_fly=..., vehicles=[vehicle(), vehicle(name="b", sysid=2, goal=[36.5, -80.0])]
    )
    where, message = the_problem(whole)
    assert where == "vehicles[1].goal"
    assert "more than 150 km" in message


def test_a_mission_at_the_pole_is_refused() -> None:
    whole = base(terrain={"flat_m": 0}, no_fly=..., vehicles=[vehicle(start=[86.0, 0.0], goal=[86.01, 0.0])])
    assert "between 85° south and 85° north" in the_problem(whole)[1]


def test_a_mission_across_the_antimeridian_is_small() -> None:
    whole = base(terrain={"flat_m": 10}, no_fly=..., vehicles=[vehicle(start=[10, 179.99], goal=[10, -179.99])])
    mission = load(whole)
    assert mission.vehicles[0].goal[0] - mission.vehicles[0].start[0] == pytest.approx(2193, abs=3)


def test_amsl_of_a_local_frame_lifts_ground_and_points_but_not_amsl_words() -> None:
    zone = {"center": {"east_m": 50, "north_m": 0}, "radius_m": 5, "ceiling_amsl_m": 1010}
    end = {"east_m": 100, "north_m": 100, "agl_m": 7}
    whole = local(
        frame={"origin": [36.6, -84.3], "amsl_m": 1000}, terrain={"flat_m": 2}, no_fly=[zone],
        vehicles=[vehicle(start={"east_m": 0, "north_m": 0}, goal=end, via=[{"east_m": 9, "north_m": 9, "up_m": 12}])],
    )  # fmt: skip
    mission = load(whole)
    one = mission.vehicles[0]
    assert one.start == (0.0, 0.0, 1002.0)
    assert one.goal_amsl_m == 1009.0
    assert one.via == ((9.0, 9.0, 10.0),)
    assert mission.zones[0].ceiling == Level(1010.0, "amsl")
    assert isinstance(mission.zones[0].shape, Circle)


def test_a_local_mission_may_give_some_points_in_degrees() -> None:
    whole = local(terrain={"flat_m": 0}, vehicles=[vehicle(start={"east_m": 0, "north_m": 0}, goal=[36.601, -84.3])])
    assert load(whole).vehicles[0].goal[:2] == pytest.approx(Frame(36.6, -84.3).to_plane(36.601, -84.3))


@pytest.mark.parametrize(
    ("frame", "key"),
    [
        ({}, "frame.origin"),
        ({"origin": [36.6]}, "frame.origin"),
        ({"origin": [88.0, 0.0]}, "frame.origin"),
        (5, "frame"),
    ],
)
def test_a_bad_frame_is_told(frame: Any, key: str) -> None:
    assert the_problem(local(frame=frame))[0] == key
