"""The flight that an autopilot makes of a mission, item by item."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from gcsplan.check.flight.follow import follow
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.notes.note import Note
from gcsplan.vehicle import Autopilot
from tests.support.followed import GROUND_M, HOME, TAKEOFF, VTOL_TAKEOFF, at, fly, fly_over_a_slope, unknown, vehicle
from tests.support.noted import codes


def test_a_whole_mission_is_followed_from_the_ground_to_the_ground() -> None:
    flight = fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 80), at(cmd.WAYPOINT, 0.02, 0, 70), at(cmd.LAND, 0.02, 0, 0))
    assert flight.not_judged == []
    assert [(s.kind, s.column, s.on_path) for s in flight.stretches] == [
        ("takeoff", True, False), ("cruise", False, True), ("cruise", False, True), ("land", True, False),
    ]  # fmt: skip
    for before, after in zip(flight.stretches, flight.stretches[1:], strict=False):
        assert before.end == after.start
    assert flight.stretches[0].start[2] == GROUND_M
    assert flight.stretches[0].end[2] == GROUND_M + 65
    assert flight.stretches[-1].end[2] == GROUND_M


def test_relative_altitudes_count_from_the_ground_at_arming_not_the_home_row() -> None:
    flight = fly(TAKEOFF, home=Home.at(36.6, -84.3, 0.0))
    assert flight.stretches[0].end[2] == GROUND_M + 65
    assert codes(flight.notes) == ["home_height_differs"]


def test_speed_changes_hold_from_there_on() -> None:
    slow = MissionItem(cmd.DO_CHANGE_SPEED, m.NO_POSITION, (1, 4.5, -1, 0))
    flight = fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 80), slow, at(cmd.WAYPOINT, 0.02, 0, 80))
    assert [s.speed_m_s for s in flight.stretches] == [15, 15, 4.5]


def test_a_landing_elsewhere_flies_there_level_first() -> None:
    flight = fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 80), at(cmd.LAND, 0.02, 0, 0))
    level, down = flight.stretches[-2:]
    assert not level.column
    assert level.end[2] == GROUND_M + 80
    assert down.column


def test_rtl_climbs_returns_straight_and_lands_at_home() -> None:
    flight = fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 80), MissionItem(cmd.RTL, 2), rtl_rel_home_m=120)
    up, back, waits, down = flight.stretches[-4:]
    assert (up.column, back.column, down.column) == (True, False, True)
    assert (waits.start, waits.hold_s) == (back.end, 5.0)  # RTL_LOIT_TIME
    assert up.end[2] == GROUND_M + 120 == back.end[2]
    assert down.end == (36.6, -84.3, GROUND_M)


def test_every_autopilot_returns_at_a_speed_of_its_own_not_the_missions() -> None:
    items = TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 80), MissionItem(cmd.RTL, 2)
    assert fly(*items, rtl_rel_home_m=120, autopilot=Autopilot.PX4).stretches[-2].speed_m_s == 5.0
    assert fly(*items, rtl_rel_home_m=120).stretches[-2].speed_m_s == 10.0  # WPNAV_SPEED, as RTL_SPEED is 0


@pytest.mark.parametrize(("above_m", "told"), [(4.0, False), (30.0, True), (-30.0, False)])
def test_a_px4_that_lands_far_above_home_does_not_slow_down_and_that_is_told(above_m: float, told: bool) -> None:
    items = TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 80), at(cmd.LAND, 0.01, 0, 0)
    for autopilot in (Autopilot.PX4, Autopilot.ARDUCOPTER):
        mission = Mission(autopilot, HOME, items)
        flight = follow(mission, vehicle(autopilot), lambda lat, lon: GROUND_M + (above_m if lat > 36.605 else 0.0))
        assert flight.stretches[-1].end[2] == GROUND_M + above_m
        said = "lands_fast" in codes(flight.notes)
        assert said is (told and autopilot is Autopilot.PX4)


def test_rtl_does_not_descend_before_it_is_home() -> None:
    flight = fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 200), MissionItem(cmd.RTL, 2), rtl_rel_home_m=120)
    assert flight.stretches[-2].end[2] == GROUND_M + 200


def test_an_arduplane_return_is_judged_over_the_whole_band_of_altitudes() -> None:
    flight = fly(
        at(cmd.VTOL_TAKEOFF, 0, 0, 65), at(cmd.WAYPOINT, 0.01, 0, 80), MissionItem(cmd.RTL, 2),
        autopilot=Autopilot.ARDUPLANE, rtl_rel_home_m=120,
    )  # fmt: skip
    back, circle = flight.stretches[-2:]
    assert (back.start[2], back.end[2], back.band_m) == (400, 400, 20)
    assert 70 < circle.reach_m < 80  # the circle grows with altitude, and is flown wide
    assert math.isinf(circle.hold_s)


def test_rtl_at_an_unknown_altitude_is_not_judged() -> None:
    flight = fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 80), MissionItem(cmd.RTL, 2))
    assert flight.not_judged == [Note("return_altitude_not_given", 3)]


def test_a_mission_without_take_off_is_not_judged_up_to_its_first_way_point() -> None:
    flight = fly(at(cmd.WAYPOINT, 0.01, 0, 80), at(cmd.WAYPOINT, 0.02, 0, 80))
    assert flight.not_judged == [Note("no_take_off", 1)]


def test_items_after_the_landing_are_named() -> None:
    flight = fly(TAKEOFF, at(cmd.LAND, 0, 0, 0), at(cmd.WAYPOINT, 0.01, 0, 80))
    assert flight.not_judged == [Note("comes_after_landing", 3)]


def test_a_fixed_wings_loiter_is_a_circle_and_a_copters_is_a_point() -> None:
    plane = fly(at(cmd.VTOL_TAKEOFF, 0, 0, 65), at(cmd.LOITER_UNLIM, 0.01, 0, 80), autopilot=Autopilot.ARDUPLANE)
    assert 60 < plane.stretches[-1].reach_m < 75
    assert fly(TAKEOFF, at(cmd.LOITER_UNLIM, 0.01, 0, 80)).stretches[-1].reach_m == 0
    turns = MissionItem(cmd.LOITER_TURNS, m.RELATIVE, (3, 0, -40, 0), m.degrees_e7(36.61), m.degrees_e7(-84.3), 80)
    circle = fly(TAKEOFF, turns).stretches[-1]
    assert circle.reach_m == 40
    assert circle.hold_s == pytest.approx(3 * 2 * math.pi * 40 / 15)


def test_an_arduplane_mission_that_ends_in_the_air_goes_home_unjudged() -> None:
    flight = fly(at(cmd.VTOL_TAKEOFF, 0, 0, 65), at(cmd.WAYPOINT, 0.01, 0, 80), autopilot=Autopilot.ARDUPLANE)
    assert flight.not_judged == [Note("returns_by_itself")]


def test_unknown_ground_at_home_is_named() -> None:
    assert codes(fly(TAKEOFF, ground_m=math.nan).not_judged)[0] == "home_ground_unknown"


def test_a_hold_counts_on_copter_and_not_on_plane() -> None:
    hold = at(cmd.WAYPOINT, 0.01, 0, 80, p1=12)
    assert fly(TAKEOFF, hold).stretches[-1].hold_s == 12
    plane = fly(at(cmd.VTOL_TAKEOFF, 0, 0, 65), hold, autopilot=Autopilot.ARDUPLANE)
    assert plane.stretches[-1].hold_s == 0


@pytest.mark.parametrize("frame", [m.GLOBAL, m.TERRAIN])
def test_arduplanes_vtol_take_off_in_another_frame_is_not_judged(frame: int) -> None:
    flight = fly(
        at(cmd.VTOL_TAKEOFF, 0, 0, 400, frame), at(cmd.LOITER_UNLIM, 0.01, 0, 80), autopilot=Autopilot.ARDUPLANE
    )
    assert Note("vtol_climbs_by_altitude", 1) in flight.not_judged
    assert flight.stretches[0].end[2] == GROUND_M + 400  # by its altitude


def test_a_vtol_take_off_of_px4_is_not_judged() -> None:
    assert unknown(fly(VTOL_TAKEOFF, autopilot=Autopilot.PX4)) == [84]


def test_a_take_off_to_less_than_the_least_climb_ends_there() -> None:
    assert fly(at(cmd.TAKEOFF, 0, 0, -20)).stretches[0].end[2] == GROUND_M + 1.0
    assert fly(at(cmd.TAKEOFF, 0, 0, 0), autopilot=Autopilot.PX4).stretches[0].end[2] == GROUND_M + 2.5


def test_a_landing_elsewhere_in_terrain_frame_keeps_its_height_above_ground() -> None:
    flight = fly_over_a_slope(TAKEOFF, at(cmd.LAND, 0.01, 0, 0, m.TERRAIN))
    over, down = flight.stretches[-2:]
    assert over.terrain
    assert over.end[2] == pytest.approx(GROUND_M + 200 + 65)
    assert down.end[2] == pytest.approx(GROUND_M + 200)


def test_what_follows_a_leg_above_ground_is_as_far_off_as_the_ground_it_read() -> None:
    """Until it has flown to an altitude of another frame; at 0 m it keeps the one that it has."""
    low, over = at(cmd.WAYPOINT, 0.001, 0, 80, m.TERRAIN), at(cmd.WAYPOINT, 0.002, 0, 80)
    kept, last = at(cmd.WAYPOINT, 0.003, 0, 0, m.GLOBAL), at(cmd.LAND, 0.004, 0, 0)
    assert [s.band_m for s in fly_over_a_slope(TAKEOFF, low, over, over).stretches] == [0.0, 0.0, 30.0, 0.0]
    assert [s.band_m for s in fly_over_a_slope(TAKEOFF, low, kept, last).stretches] == [0.0, 0.0, 30.0, 30.0, 30.0]
    home = MissionItem(cmd.RTL, 2)
    near = fly_over_a_slope(TAKEOFF, low, home, rtl_rel_home_m=120.0).stretches[2:]
    assert {s.band_m for s in near} == {30.0}  # 100 m above home, or up to 130 m
    far = fly_over_a_slope(TAKEOFF, low, home, rtl_rel_home_m=131.0).stretches[2:]
    assert {s.band_m for s in far} == {0.0}  # it climbs to the same altitude from wherever it is


def test_a_circle_above_ground_rises_and_falls_with_it() -> None:
    """A plane and a copter; where the ground around is not known, the circle is not judged."""
    ring = MissionItem(cmd.LOITER_TURNS, m.TERRAIN, (1, 0, 50, 0), m.degrees_e7(36.601), m.degrees_e7(-84.3), 80)
    for pilot, up in ((Autopilot.ARDUCOPTER, TAKEOFF), (Autopilot.ARDUPLANE, VTOL_TAKEOFF)):
        mission, craft = Mission(pilot, HOME, (up, ring)), vehicle(pilot)
        flight = follow(
            mission, craft, lambda lat, lon: GROUND_M, read_change_m=lambda lat, lon, reach_m: 0.1 * reach_m
        )  # fmt: skip
        circle = flight.stretches[-1]
        assert circle.reach_m > 0.0
        assert circle.band_m == pytest.approx(30.0 + 0.1 * circle.reach_m)
        assert unknown(follow(mission, craft, lambda lat, lon: GROUND_M)) == [cmd.LOITER_TURNS]


@pytest.mark.parametrize(
    ("radius_m", "speed_m_s", "judged"), [(45.0, 20.0, True), (40.0, 20.0, False), (0.0, 30.0, False)]
)
def test_a_circle_too_tight_for_the_planes_bank_is_not_judged(radius_m: float, speed_m_s: float, judged: bool) -> None:
    """45° at 20 m/s are a circle of 40.8 m; ArduPlane's own has 60 m."""
    speed = MissionItem(cmd.DO_CHANGE_SPEED, m.NO_POSITION, (0.0, speed_m_s, -1.0, 0.0))
    ring = MissionItem(cmd.LOITER_TURNS, m.RELATIVE, (1, 0, radius_m, 0), m.degrees_e7(36.601), m.degrees_e7(-84.3), 80)
    flight = fly(VTOL_TAKEOFF, speed, ring, autopilot=Autopilot.ARDUPLANE)
    assert ("circle_too_banked" in codes(flight.not_judged)) is not judged


def test_a_landing_elsewhere_is_judged_both_level_and_along_the_ground() -> None:
    flight = fly_over_a_slope(TAKEOFF, at(cmd.LAND, -0.01, 0, 0))
    over, down = flight.instead  # ArduCopter before 4.6 with terrain data
    assert over.terrain
    assert over.end[2] == pytest.approx(GROUND_M - 200 + 65)
    assert down.column
    assert flight.stretches[-2].end[2] == GROUND_M + 65
    assert fly_over_a_slope(TAKEOFF, at(cmd.LAND, -0.01, 0, 0), autopilot=Autopilot.PX4).instead == []


def test_rtl_from_near_home_climbs_less_than_its_altitude() -> None:
    near = at(cmd.WAYPOINT, 0.0002, 0, 40)  # 22.194 m from home
    copter = fly(TAKEOFF, near, MissionItem(cmd.RTL, 2), rtl_rel_home_m=120)
    (band,) = copter.instead
    assert band.start[2] - band.band_m == pytest.approx(GROUND_M + 3 * 22.194, abs=0.05)  # RTL_CONE_SLOPE 3
    assert band.start[2] + band.band_m == pytest.approx(GROUND_M + 120)
    px4 = fly(TAKEOFF, near, MissionItem(cmd.RTL, 2), rtl_rel_home_m=120, autopilot=Autopilot.PX4)
    assert px4.instead[0].start[2] - px4.instead[0].band_m == pytest.approx(GROUND_M + 40)
    assert fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 40), MissionItem(cmd.RTL, 2), rtl_rel_home_m=120).instead == []


def test_copter_reaches_a_circles_altitude_at_its_edge() -> None:
    turns = MissionItem(cmd.LOITER_TURNS, m.RELATIVE, (1, 0, 200, 0), m.degrees_e7(36.61), m.degrees_e7(-84.3), 165)
    edge = fly(TAKEOFF, turns).stretches[1]
    assert edge.end[2] == GROUND_M + 165
    assert (36.61 - edge.end[0]) * 110_971 == pytest.approx(200, rel=1e-4)  # metres per degree at 36.6° N


def test_a_circles_radius_holds_for_the_next_one_without() -> None:
    def circle(radius: float) -> MissionItem:
        place = m.degrees_e7(36.61), m.degrees_e7(-84.3)
        return MissionItem(cmd.LOITER_TURNS, m.RELATIVE, (1, 0, radius, 0), *place, 65)

    assert fly(TAKEOFF, circle(0)).stretches[-1].reach_m == 10
    assert fly(TAKEOFF, circle(80), circle(0)).stretches[-1].reach_m == 80


def test_an_arduplanes_endless_loiter_takes_the_items_radius_and_a_timed_one_its_own() -> None:
    place = m.degrees_e7(36.61), m.degrees_e7(-84.3)
    wide = MissionItem(cmd.LOITER_UNLIM, m.RELATIVE, (0, 0, -200, 0), *place, 65)
    timed = MissionItem(cmd.LOITER_TIME, m.RELATIVE, (30, 0, 200, 0), *place, 65)
    assert 200 < fly(VTOL_TAKEOFF, wide, autopilot=Autopilot.ARDUPLANE).stretches[-1].reach_m < 250
    assert 60 < fly(VTOL_TAKEOFF, timed, autopilot=Autopilot.ARDUPLANE).stretches[-1].reach_m < 75


def test_a_loiter_to_altitude_circles_the_band_on_arduplane_climbs_on_copter() -> None:
    place = m.degrees_e7(36.61), m.degrees_e7(-84.3)
    up = MissionItem(31, m.RELATIVE, (0, 100, 0, 0), *place, 165)
    circle = fly(VTOL_TAKEOFF, up, autopilot=Autopilot.ARDUPLANE).stretches[-1]
    assert circle.reach_m > 100
    assert (circle.start[2] - circle.band_m, circle.start[2] + circle.band_m) == (GROUND_M + 65, GROUND_M + 165)
    copter = fly(TAKEOFF, up)
    assert copter.not_judged == []
    assert copter.stretches[-1].end[2] == GROUND_M + 165
    px4 = fly(TAKEOFF, up, autopilot=Autopilot.PX4)
    assert [s.end[2] for s in px4.instead] == [GROUND_M + 65, GROUND_M + 165]


def test_rates_of_climb_and_descent_hold_from_there_on() -> None:
    rates = [MissionItem(cmd.DO_CHANGE_SPEED, m.NO_POSITION, (kind, value, -1, 0)) for kind, value in ((2, 5), (3, 4))]
    flight = fly(TAKEOFF, *rates, at(cmd.WAYPOINT, 0.01, 0, 80))
    assert [s.rates_m_s for s in flight.stretches] == [(2.5, 1.5), (5, 4)]


def test_a_spline_is_flown_as_a_curve_and_judged_from_a_standstill_too() -> None:
    spline, after = at(cmd.SPLINE_WAYPOINT, 0.01, 0.01, 80), at(cmd.WAYPOINT, 0.0, 0.02, 80)
    flight = fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 80), spline, after)
    assert flight.not_judged == []
    curve = [s for s in flight.stretches if s.seq == 3]
    assert curve[0].start == flight.stretches[1].end
    assert curve[-1].end[:2] == (spline.lat_deg, spline.lon_deg)
    assert max(s.end[0] for s in curve) > 36.6105  # the curve leaves northward
    assert max(s.end[0] for s in flight.instead) < 36.612
    assert all(0 < s.reach_m == s.band_m < 0.3 for s in curve)


@pytest.mark.parametrize("autopilot", [Autopilot.PX4, Autopilot.ARDUPLANE])
def test_a_spline_of_anything_but_arducopter_is_not_judged(autopilot: Autopilot) -> None:
    up = VTOL_TAKEOFF if autopilot is Autopilot.ARDUPLANE else TAKEOFF
    flight = fly(up, at(cmd.WAYPOINT, 0.01, 0, 80), at(cmd.SPLINE_WAYPOINT, 0.01, 0.01, 80), autopilot=autopilot)
    assert unknown(flight) == [82]


def test_a_take_off_written_elsewhere_is_remarked_on_copter() -> None:
    assert codes(fly(at(cmd.TAKEOFF, 0.01, 0, 65)).notes) == ["takes_off_where_it_stands"]


def test_px4_takes_no_turns() -> None:
    flight = fly(TAKEOFF, at(cmd.LOITER_TURNS, 0.01, 0, 80), autopilot=Autopilot.PX4)
    assert unknown(flight) == [18]


def test_a_ground_speed_is_no_target_on_arduplane() -> None:
    ground, air = (MissionItem(cmd.DO_CHANGE_SPEED, m.NO_POSITION, (kind, 9, -1, 0)) for kind in (1, 0))
    to = at(cmd.WAYPOINT, 0.01, 0, 80)
    flight = fly(VTOL_TAKEOFF, ground, to, air, to, autopilot=Autopilot.ARDUPLANE)
    assert [s.speed_m_s for s in flight.stretches] == [15, 15, 9]


def test_arduplane_does_not_wait_in_the_air() -> None:
    wait = MissionItem(cmd.DELAY, m.NO_POSITION, (60, 0, 0, 0))
    assert fly(VTOL_TAKEOFF, wait, autopilot=Autopilot.ARDUPLANE).stretches[-1].hold_s == 0
    assert fly(TAKEOFF, wait).stretches[-1].hold_s == 60


def test_a_copter_flies_the_vtol_commands_as_its_own() -> None:
    up, down = replace(TAKEOFF, command=cmd.VTOL_TAKEOFF), MissionItem(cmd.VTOL_LAND, 3, x=TAKEOFF.x, y=TAKEOFF.y)
    flight, own = fly(up, down), fly(TAKEOFF, replace(down, command=cmd.LAND))
    assert flight.not_judged == []
    assert [(s.kind, s.start, s.end) for s in flight.stretches] == [(s.kind, s.start, s.end) for s in own.stretches]
