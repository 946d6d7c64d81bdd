"""What an autopilot does with a mission, item by item."""

from __future__ import annotations

import math

import pytest

from gcsplan.check.flight import Flight, follow
from gcsplan.mavlink import mission as m
from gcsplan.mavlink.mission import Home, Mission, MissionItem
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world.limits import Limits

GROUND_M = 300.0
HOME = Home.at(36.6, -84.3, GROUND_M)


def vehicle(autopilot: Autopilot = Autopilot.ARDUCOPTER) -> Vehicle:
    return Vehicle("uav1", 1, autopilot, Limits(min_agl_m=60))


def fly(
    *items: MissionItem,
    autopilot: Autopilot = Autopilot.ARDUCOPTER,
    home: Home = HOME,
    ground_m: float = GROUND_M,
    rtl_rel_home_m: float | None = None,
) -> Flight:
    mission = Mission(autopilot, home, items)
    return follow(mission, vehicle(autopilot), lambda lat, lon: ground_m, rtl_rel_home_m=rtl_rel_home_m)


def at(command: int, north: float, east: float, z: float, frame: int = m.RELATIVE, p1: float = 0.0) -> MissionItem:
    return MissionItem(command, frame, (p1, 0, 0, 0), m.degrees_e7(36.6 + north), m.degrees_e7(-84.3 + east), z)


TAKEOFF = at(m.TAKEOFF, 0, 0, 65)


def test_a_whole_mission_is_followed_from_the_ground_to_the_ground() -> None:
    flight = fly(TAKEOFF, at(m.WAYPOINT, 0.01, 0, 80), at(m.WAYPOINT, 0.02, 0, 70), at(m.LAND, 0.02, 0, 0))
    assert flight.not_judged == []
    assert [(s.kind, s.column, s.on_path) for s in flight.stretches] == [
        ("takeoff", True, False), ("cruise", False, True), ("cruise", False, True), ("land", True, False),
    ]  # fmt: skip
    for before, after in zip(flight.stretches, flight.stretches[1:], strict=False):
        assert before.end == after.start
    assert flight.stretches[0].start[2] == GROUND_M
    assert flight.stretches[0].end[2] == GROUND_M + 65
    assert flight.stretches[-1].end[2] == GROUND_M


def test_relative_altitudes_count_from_the_ground_where_the_vehicle_arms_not_from_the_files_home_row() -> None:
    flight = fly(TAKEOFF, home=Home.at(36.6, -84.3, 0.0))
    assert flight.stretches[0].end[2] == GROUND_M + 65
    assert "terrain model was taken" in flight.notes[0]


@pytest.mark.parametrize(
    ("frame", "z", "amsl"), [(m.GLOBAL, 500, 500), (m.RELATIVE, 80, 380), (m.TERRAIN, 90, 390), (6, 80, 380)]
)
def test_each_frame_gives_its_altitude(frame: int, z: float, amsl: float) -> None:
    flight = fly(TAKEOFF, at(m.WAYPOINT, 0.01, 0, z, frame))
    assert flight.stretches[-1].end[2] == amsl
    assert flight.stretches[-1].terrain == (frame == m.TERRAIN)


def test_copter_keeps_its_altitude_at_zero_and_its_place_at_zero_zero() -> None:
    stay = MissionItem(m.WAYPOINT, m.RELATIVE, z=90.0)
    flight = fly(TAKEOFF, at(m.WAYPOINT, 0.01, 0, 80), at(m.WAYPOINT, 0.02, 0, 0), stay)
    assert flight.stretches[2].end[2] == GROUND_M + 80
    assert flight.stretches[3].end == (*flight.stretches[2].end[:2], GROUND_M + 90)


def test_px4_flies_to_altitude_zero() -> None:
    flight = fly(TAKEOFF, at(m.WAYPOINT, 0.01, 0, 0), autopilot=Autopilot.PX4)
    assert flight.stretches[1].end[2] == GROUND_M


def test_speed_changes_hold_from_there_on() -> None:
    slow = MissionItem(m.DO_CHANGE_SPEED, m.NO_POSITION, (1, 4.5, -1, 0))
    flight = fly(TAKEOFF, at(m.WAYPOINT, 0.01, 0, 80), slow, at(m.WAYPOINT, 0.02, 0, 80))
    assert [s.speed_m_s for s in flight.stretches] == [15, 15, 4.5]


def test_a_landing_elsewhere_flies_there_level_first() -> None:
    flight = fly(TAKEOFF, at(m.WAYPOINT, 0.01, 0, 80), at(m.LAND, 0.02, 0, 0))
    level, down = flight.stretches[-2:]
    assert not level.column
    assert level.end[2] == GROUND_M + 80
    assert down.column


def test_rtl_climbs_returns_straight_and_lands_at_home() -> None:
    flight = fly(TAKEOFF, at(m.WAYPOINT, 0.01, 0, 80), MissionItem(m.RTL, 2), rtl_rel_home_m=120)
    up, back, down = flight.stretches[-3:]
    assert (up.column, back.column, down.column) == (True, False, True)
    assert up.end[2] == GROUND_M + 120 == back.end[2]
    assert down.end == (36.6, -84.3, GROUND_M)


def test_rtl_does_not_descend_before_it_is_home() -> None:
    flight = fly(TAKEOFF, at(m.WAYPOINT, 0.01, 0, 200), MissionItem(m.RTL, 2), rtl_rel_home_m=120)
    assert flight.stretches[-2].end[2] == GROUND_M + 200


def test_an_arduplane_return_is_judged_over_the_whole_band_of_altitudes() -> None:
    flight = fly(
        at(m.VTOL_TAKEOFF, 0, 0, 65), at(m.WAYPOINT, 0.01, 0, 80), MissionItem(m.RTL, 2),
        autopilot=Autopilot.ARDUPLANE, rtl_rel_home_m=120,
    )  # fmt: skip
    back, circle = flight.stretches[-2:]
    assert (back.start[2], back.end[2], back.band_m) == (400, 400, 20)
    assert 60 < circle.reach_m < 75  # it widens with altitude
    assert math.isinf(circle.hold_s)


def test_rtl_at_an_unknown_altitude_is_not_judged() -> None:
    flight = fly(TAKEOFF, at(m.WAYPOINT, 0.01, 0, 80), MissionItem(m.RTL, 2))
    assert any("rtl_rel_home_m" in what for what in flight.not_judged)


@pytest.mark.parametrize(
    "item",
    [
        at(m.SPLINE_WAYPOINT, 0.02, 0, 80),
        MissionItem(m.DO_JUMP, 2, (1, 3, 0, 0)),
        MissionItem(m.DO_SET_HOME, 0, (0, 0, 0, 0), 366000000, -843000000, 10),
        at(31000, 0.02, 0, 80),
    ],
)
def test_a_command_whose_motion_is_unknown_is_named(item: MissionItem) -> None:
    flight = fly(TAKEOFF, at(m.WAYPOINT, 0.01, 0, 80), item, at(m.WAYPOINT, 0.03, 0, 80))
    assert any(f"command {item.command}" in what and "item 3" in what for what in flight.not_judged)


def test_servo_and_camera_commands_move_nothing() -> None:
    flight = fly(TAKEOFF, MissionItem(206, 2, (25, 0, 1, 0)), MissionItem(183, 2, (9, 1500, 0, 0)))
    assert flight.not_judged == []
    assert len(flight.stretches) == 1


def test_a_mission_without_take_off_is_not_judged_up_to_its_first_way_point() -> None:
    flight = fly(at(m.WAYPOINT, 0.01, 0, 80), at(m.WAYPOINT, 0.02, 0, 80))
    assert any("no take-off" in what for what in flight.not_judged)


def test_items_after_the_landing_are_named() -> None:
    flight = fly(TAKEOFF, at(m.LAND, 0, 0, 0), at(m.WAYPOINT, 0.01, 0, 80))
    assert any("after the landing" in what for what in flight.not_judged)


def test_a_fixed_wings_loiter_is_a_circle_and_a_copters_is_a_point() -> None:
    plane = fly(at(m.VTOL_TAKEOFF, 0, 0, 65), at(m.LOITER_UNLIM, 0.01, 0, 80), autopilot=Autopilot.ARDUPLANE)
    assert 60 < plane.stretches[-1].reach_m < 75
    assert fly(TAKEOFF, at(m.LOITER_UNLIM, 0.01, 0, 80)).stretches[-1].reach_m == 0
    turns = MissionItem(m.LOITER_TURNS, m.RELATIVE, (3, 0, -40, 0), m.degrees_e7(36.61), m.degrees_e7(-84.3), 80)
    circle = fly(TAKEOFF, turns).stretches[-1]
    assert circle.reach_m == 40
    assert circle.hold_s == pytest.approx(3 * 2 * math.pi * 40 / 15)


def test_an_arduplane_mission_that_ends_in_the_air_goes_home_unjudged() -> None:
    flight = fly(at(m.VTOL_TAKEOFF, 0, 0, 65), at(m.WAYPOINT, 0.01, 0, 80), autopilot=Autopilot.ARDUPLANE)
    assert any("RTL" in what for what in flight.not_judged)


def test_unknown_ground_at_home_is_named() -> None:
    assert any("ground at home" in what for what in fly(TAKEOFF, ground_m=math.nan).not_judged)


def test_a_hold_counts_on_copter_and_not_on_plane() -> None:
    hold = at(m.WAYPOINT, 0.01, 0, 80, p1=12)
    assert fly(TAKEOFF, hold).stretches[-1].hold_s == 12
    plane = fly(at(m.VTOL_TAKEOFF, 0, 0, 65), hold, autopilot=Autopilot.ARDUPLANE)
    assert plane.stretches[-1].hold_s == 0
