"""Altitude and place of an item by the state of the aircraft that comes to it."""

from __future__ import annotations

import pytest

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import MissionItem
from gcsplan.vehicle import Autopilot
from tests.support.followed import GROUND_M, TAKEOFF, VTOL_TAKEOFF, at, fly, fly_over_a_slope, unknown


@pytest.mark.parametrize(
    ("frame", "z", "amsl"), [(m.GLOBAL, 500, 500), (m.RELATIVE, 80, 380), (m.TERRAIN, 90, 390), (6, 80, 380)]
)
def test_each_frame_gives_its_altitude(frame: int, z: float, amsl: float) -> None:
    flight = fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, z, frame))
    assert flight.stretches[-1].end[2] == amsl
    assert flight.stretches[-1].terrain == (frame == m.TERRAIN)


def test_copter_keeps_its_altitude_at_zero_and_its_place_at_zero_zero() -> None:
    stay = MissionItem(cmd.WAYPOINT, m.RELATIVE, z=90.0)
    flight = fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 80), at(cmd.WAYPOINT, 0.02, 0, 0), stay)
    assert flight.stretches[2].end[2] == GROUND_M + 80
    assert flight.stretches[3].end == (*flight.stretches[2].end[:2], GROUND_M + 90)


def test_px4_flies_to_altitude_zero() -> None:
    flight = fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 0), autopilot=Autopilot.PX4)
    assert flight.stretches[1].end[2] == GROUND_M


@pytest.mark.parametrize(("z", "at_once"), [(79.9, True), (51, True), (80.1, False), (49, False)])
def test_arduplane_changes_height_by_less_than_its_glide_slope_minimum_at_once(z: float, at_once: bool) -> None:
    flight = fly(VTOL_TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, z), autopilot=Autopilot.ARDUPLANE)
    assert bool(flight.instead) == at_once
    for band in flight.instead:
        assert band.start[2] == band.end[2] == pytest.approx(GROUND_M + 0.5 * (65 + z))
        assert band.band_m == pytest.approx(abs(z - 65) / 2)


def test_arduplane_climbs_at_once_from_below_twenty_metres() -> None:
    low = at(cmd.WAYPOINT, 0.01, 0, 15)
    flight = fly(VTOL_TAKEOFF, low, at(cmd.WAYPOINT, 0.02, 0, 200), autopilot=Autopilot.ARDUPLANE)
    assert [s.seq for s in flight.instead] == [3]
    assert flight.instead[0].band_m == pytest.approx(92.5)


def test_copter_and_px4_change_height_along_the_leg() -> None:
    assert fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 70)).instead == []
    assert fly(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 70), autopilot=Autopilot.PX4).instead == []


def test_arduplanes_glide_slope_minimum_counts_above_ground_in_terrain_frame() -> None:
    level = at(cmd.WAYPOINT, 0.01, 0, 65, m.TERRAIN)  # 200 m higher in AMSL, the same height above ground
    flight = fly_over_a_slope(VTOL_TAKEOFF, level, autopilot=Autopilot.ARDUPLANE)
    (band,) = flight.instead
    assert band.terrain
    assert band.band_m == pytest.approx(0, abs=1e-6)


def test_copter_keeps_its_height_in_the_frame_of_the_item() -> None:
    flight = fly_over_a_slope(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 0, m.TERRAIN))
    assert flight.stretches[-1].end[2] == pytest.approx(GROUND_M + 200 + 65)
    flight = fly_over_a_slope(TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 0, m.GLOBAL))
    assert flight.stretches[-1].end[2] == pytest.approx(GROUND_M + 65)


def test_arduplane_keeps_its_altitude_only_where_there_is_no_place_either() -> None:
    flight = fly(VTOL_TAKEOFF, at(cmd.WAYPOINT, 0.01, 0, 0), autopilot=Autopilot.ARDUPLANE)
    assert flight.stretches[-1].end[2] == GROUND_M
    flight = fly(VTOL_TAKEOFF, MissionItem(cmd.LOITER_TIME, m.RELATIVE, (10, 0, 0, 0)), autopilot=Autopilot.ARDUPLANE)
    assert flight.stretches[-1].end[2] == GROUND_M + 65


def test_px4_knows_no_here() -> None:
    flight = fly(TAKEOFF, MissionItem(cmd.WAYPOINT, m.RELATIVE, z=90.0), autopilot=Autopilot.PX4)
    assert unknown(flight) == [16]
