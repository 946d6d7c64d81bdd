"""From a path to wire items: what is stored is within the margins that the planner kept."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.mavlink.build.multirotor import build_mission
from gcsplan.mavlink.build.order import BOW_M, LONGEST_LEG_M, MARGINS, Order, split_legs
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.autopilots import stored
from gcsplan.vehicle import Autopilot
from gcsplan.world.path import Path
from tests.support.effort import draws
from tests.support.worlds import vehicle, world

WORLD = world()
HOME_DEG = (36.6, -84.3)
PATH = Path(np.array([[0.0, 0, 366.0], [1500, 200, 380.123], [3000, -400, 402.987], [4000, 0, 370.0]]))


def commands(mission: m.Mission) -> list[int]:
    return [item.command for item in mission.items]


@pytest.mark.parametrize(
    ("end", "last"), [("land", [cmd.WAYPOINT, cmd.LAND]), ("loiter", [cmd.LOITER_UNLIM]),
                      ("rtl", [cmd.WAYPOINT, cmd.RTL]), ("none", [cmd.WAYPOINT])],
)  # fmt: skip
def test_each_end_has_its_items(end: str, last: list[int]) -> None:
    mission = build_mission(PATH, WORLD, vehicle(), HOME_DEG, Order(end=end))  # type: ignore[arg-type]
    assert commands(mission) == [cmd.TAKEOFF, cmd.DO_CHANGE_SPEED, cmd.WAYPOINT, cmd.WAYPOINT, *last]


def test_arduplane_takes_off_and_lands_as_a_vtol_and_sends_an_acceptance_radius() -> None:
    mission = build_mission(PATH, WORLD, vehicle(Autopilot.ARDUPLANE, track_error_m=40.7), HOME_DEG, Order())
    assert commands(mission)[0] == cmd.VTOL_TAKEOFF
    assert commands(mission)[-1] == cmd.VTOL_LAND
    assert mission.items[2].params[1] == 40.0


@pytest.mark.parametrize("slope", [0.05, 0.0, -0.05])
def test_a_copters_landing_says_where_the_ground_is(slope: float) -> None:
    """ArduCopter 4.7 slows down at 10 m above this altitude: with 0 it hits ground above home at full descent rate."""
    where = world(lambda e, n: 300.0 + slope * e)
    points = np.array([[0.0, 0, 366.0], [1500, 200, 480.0], [4000, 0, 600.0]])
    land = build_mission(Path(points), where, vehicle(), HOME_DEG, Order()).items[-1]
    assert (land.command, land.frame) == (cmd.LAND, m.RELATIVE)
    assert stored(land, Autopilot.ARDUCOPTER).z == pytest.approx(slope * 4000.0, abs=0.02)
    px4 = build_mission(Path(points), where, vehicle(Autopilot.PX4), HOME_DEG, Order()).items[-1]
    assert (px4.command, px4.z) == (cmd.LAND, 0.0)


def test_px4_points_its_nose_along_the_leg_and_ardupilot_is_sent_none() -> None:
    px4 = build_mission(PATH, WORLD, vehicle(Autopilot.PX4), HOME_DEG, Order())
    assert px4.items[2].params[3] == pytest.approx(np.degrees(np.arctan2(1500, 200)), abs=0.06)
    copter = build_mission(PATH, WORLD, vehicle(), HOME_DEG, Order())
    assert all(item.params[3] == 0 for item in copter.items)


@settings(max_examples=draws(60))
@given(
    st.lists(
        st.tuples(st.floats(-9000, 9000), st.floats(-9000, 9000), st.floats(360, 2000)), min_size=2, max_size=6,
        unique_by=lambda p: (round(p[0] / 50), round(p[1] / 50)),
    ),
    st.sampled_from(list(Autopilot)),
    st.sampled_from(["relative", "amsl"]),
)  # fmt: skip
def test_what_is_stored_lies_within_the_planners_margins(
    points: list[tuple[float, float, float]], autopilot: Autopilot, frame: str
) -> None:
    points[0] = (0.0, 0.0, 366.0)
    path = Path(np.array(points))
    if (path.leg_horizontal_m < 50).any():
        return
    craft = vehicle(autopilot)
    mission = build_mission(path, WORLD, craft, HOME_DEG, Order(end="none", altitude_frame=frame))  # type: ignore[arg-type]
    base = 300.0 if frame == "relative" else 0.0
    places = [stored(item, autopilot) for item in mission.items if item.command == cmd.WAYPOINT]
    flown = np.array([(i.lat_deg, i.lon_deg, i.z + base) for i in places])
    flown[:, :2] = WORLD.frame.to_plane(flown[:, 0], flown[:, 1])
    wanted = split_legs(path.points, WORLD)[1:]
    assert len(flown) == len(wanted)
    assert np.hypot(*(flown - wanted)[:, :2].T).max() <= MARGINS.track_m
    assert np.abs((flown - wanted)[:, 2]).max() <= MARGINS.altitude_m


def test_legs_are_split_until_the_bow_is_small() -> None:
    there = split_legs(np.array([[-11_000.0, 0, 400], [11_000, 100, 500]]), WORLD)
    places = WORLD.frame.to_degrees(there[:, 0], there[:, 1])
    assert WORLD.frame.bow_m(places[:-1], places[1:]).max() <= BOW_M
    assert np.hypot(*np.diff(there[:, :2], axis=0).T).max() <= LONGEST_LEG_M
    assert there[0] == pytest.approx([-11_000, 0, 400])
    assert there[-1] == pytest.approx([11_000, 100, 500])


def test_a_leg_at_the_climb_limit_does_not_grow_steeper_by_rounding() -> None:
    craft = vehicle(max_climb_deg=15.0)
    slope = np.tan(np.radians(15.0)) * (1 - MARGINS.slope)
    run = np.arange(0, 3000, 61.7)
    path = Path(np.column_stack([run, 0 * run, 366.0 + slope * run]))
    mission = build_mission(path, WORLD, craft, HOME_DEG, Order(end="none"))
    flown = [stored(i, craft.autopilot) for i in mission.items if i.command != cmd.DO_CHANGE_SPEED]
    z = np.array([i.z for i in flown])
    en = WORLD.frame.to_plane([i.lat_deg for i in flown], [i.lon_deg for i in flown])
    rise = np.degrees(np.arctan2(np.diff(z), np.hypot(*np.diff(en, axis=0).T)))
    assert rise.max() <= 15.0


def test_points_nearer_than_two_acceptance_radii_are_dropped() -> None:
    path = Path(np.array([[0.0, 0, 366], [1000, 0, 370], [1003, 0, 370.1], [2000, 0, 366]]))
    mission = build_mission(path, WORLD, vehicle(), HOME_DEG, Order(end="none"))
    assert commands(mission).count(cmd.WAYPOINT) == 2


def test_terrain_frame_heights_count_from_the_ground_under_each_point() -> None:
    hill = world(lambda e, n: 300 + 100 * np.exp(-((e - 1500) ** 2 + n**2) / 1e6))
    path = Path(np.array([[0.0, 0, 470.0], [1500, 0, 480.0], [3000, 0, 470.0]]))
    mission = build_mission(path, hill, vehicle(), HOME_DEG, Order(end="none", altitude_frame="terrain"))
    top = stored(mission.items[2], Autopilot.ARDUCOPTER)
    assert top.frame == m.TERRAIN
    assert top.z == pytest.approx(80.0, abs=0.5)
