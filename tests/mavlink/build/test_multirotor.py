"""From a path to wire items: what is stored is within the margins that the planner kept."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.mavlink.build.multirotor import SHORT_LEG_M, build_mission, moved_corners, sharpened_corners
from gcsplan.mavlink.build.order import LEG_BOW_M, LONGEST_LEG_M, MARGINS, Order, slope_margin, split_legs
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.autopilots import stored
from gcsplan.vehicle import Autopilot
from gcsplan.world.geometry.path import Path
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
    assert WORLD.frame.bow_m(places[:-1], places[1:]).max() <= LEG_BOW_M
    assert np.hypot(*np.diff(there[:, :2], axis=0).T).max() <= LONGEST_LEG_M
    assert there[0] == pytest.approx([-11_000, 0, 400])
    assert there[-1] == pytest.approx([11_000, 100, 500])


def steepest_deg(mission: m.Mission) -> tuple[float, float]:
    """The steepest climb and descent of a mission in the frame of home, as stored."""
    flown = [stored(i, mission.autopilot) for i in mission.items if i.command != cmd.DO_CHANGE_SPEED]
    z = np.array([i.z for i in flown])
    en = WORLD.frame.to_plane([i.lat_deg for i in flown], [i.lon_deg for i in flown])
    rise = np.degrees(np.arctan2(np.diff(z), np.hypot(*np.diff(en, axis=0).T)))
    return float(rise.max()), float(-rise.min())


@pytest.mark.parametrize("autopilot", list(Autopilot))
@pytest.mark.parametrize("leg_m", [2.81, 5.3, 61.7])
@pytest.mark.parametrize("down", [False, True])
def test_legs_at_the_climb_limit_do_not_grow_steeper_by_rounding(
    autopilot: Autopilot, leg_m: float, down: bool
) -> None:
    """Of 30 legs of some metres each would lose half a centimetre: what all lose together is moved, not steep."""
    craft = vehicle(autopilot, max_climb_deg=15.0, max_descent_deg=15.0)
    slope = np.tan(np.radians(15.0)) * (1 - slope_margin(30 * leg_m * np.tan(np.radians(15.0)), cut=False))
    run = np.arange(31) * leg_m
    run = np.append(run, run[-1] + 500.0)
    aside = np.where(np.arange(len(run)) % 2, 0.07 * leg_m, 0.0)
    z = 600.0 + slope * (-1 if down else 1) * np.minimum(run, run[-2])
    path = Path(np.column_stack([run, aside, z]))
    mission = build_mission(path, WORLD, craft, HOME_DEG, Order(end="none", spaced=False))
    assert max(steepest_deg(mission)) <= 15.0
    flown = np.array([stored(i, autopilot).z for i in mission.items if i.command == cmd.WAYPOINT])
    assert np.abs(flown + 300.0 - z[1:]).max() < 0.3


def test_a_way_back_is_no_steeper_than_the_gentler_limit() -> None:
    craft = vehicle(max_climb_deg=15.0, max_descent_deg=8.0)
    run = np.arange(31) * 3.7
    slope = np.tan(np.radians(8.0)) * (1 - 1e-4)
    path = Path(np.column_stack([run, 0 * run, 366.0 + slope * np.minimum(run, run[-2])]))
    mission = build_mission(path, WORLD, craft, HOME_DEG, Order(end="none", spaced=False))
    assert steepest_deg(mission)[0] > 8.0
    mission = build_mission(path, WORLD, craft, HOME_DEG, Order(end="none", spaced=False, return_path=True))
    out = m.Mission(mission.autopilot, mission.home, mission.items[: len(run) + 1], mission.name, mission.sysid)
    assert steepest_deg(out)[0] <= 8.0


def test_a_place_whose_altitude_the_file_gives_keeps_it() -> None:
    craft, slope = vehicle(max_climb_deg=15.0), np.tan(np.radians(15.0))
    run = np.arange(21) * 2.81
    run[-1] += 100.0
    path = Path(np.column_stack([run, 0 * run, 366.0 + slope * np.minimum(run, run[-2])]))
    at = tuple(path.points[19, :2].tolist())
    free, given = (
        build_mission(path, WORLD, craft, HOME_DEG, Order(end="none", spaced=False, exact=exact))
        for exact in ((), (at,))
    )
    wanted = path.points[19, 2] - 300.0
    z = [stored(mission.items[20], craft.autopilot).z for mission in (free, given)]
    assert abs(z[0] - wanted) > 0.02
    assert abs(z[1] - wanted) <= 0.005


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


def test_the_leg_behind_a_corner_is_no_steeper_than_the_next_whatever_is_rounded() -> None:
    points = np.array([[0.0, 0.0, 100.0], [500.0, 0.0, 200.0], [1000.0, 0.0, 330.0]])
    mended = sharpened_corners(points, {1})
    assert len(mended) == 4
    run, rise = mended[2, 0] - mended[1, 0], mended[2, 2] - mended[1, 2]
    assert run == pytest.approx(SHORT_LEG_M)
    assert 0.0 <= rise <= max(0.26 * SHORT_LEG_M - 0.01, 0.0)


def test_a_moved_corner_is_turned_before_beyond_the_old_next_leg() -> None:
    """From where the turn begins, straight to the end of the next leg: nowhere inside the old corner."""
    for degrees in (5.0, 30.0, 60.0, 90.0, 120.0):
        turn = np.radians(degrees)
        old = np.array([[0.0, 0.0, 50.0], [100.0, 0.0, 50.0], [100.0 + 80 * np.cos(turn), 80 * np.sin(turn), 50.0]])
        new = moved_corners(old, {1}, 1.0)
        assert np.array_equal(new[[0, 2]], old[[0, 2]])
        way = (new[1] - new[0])[:2] / np.hypot(*(new[1] - new[0])[:2])
        begun, end = new[1, :2] - way, old[2, :2]
        inside = np.array([-np.sin(turn), np.cos(turn)])  # of the old next leg
        flown = begun + np.linspace(0.0, 1.0, 50)[:, None] * (end - begun)
        beyond = (flown[:, 0] - 100.0) * np.cos(turn) + flown[:, 1] * np.sin(turn) >= 0.0
        assert ((flown - old[1, :2]) @ inside)[beyond].max() <= 1e-9
    straight = np.array([[0.0, 0.0, 50.0], [100.0, 0.0, 50.0], [200.0, 0.0, 50.0]])
    assert np.array_equal(moved_corners(straight, {1}, 1.0), straight)
