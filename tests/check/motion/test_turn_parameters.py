"""The parameters that decide where an autopilot turns."""

from __future__ import annotations

import math
from dataclasses import replace

from gcsplan.check.motion.turn_parameters import Tuning
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.notes.note import Note
from tests.check.flight.test_corners import COPTER, HOME, PLANE, PX4, around, at, inside, verdict
from tests.support.noted import coded, within
from tests.support.worlds import vehicle


def test_px4_takes_its_own_parameter_where_the_item_gives_no_radius() -> None:
    craft = vehicle(PX4, horizontal_clearance_m=0.0)
    near = inside(991.0, 9.0, 4.0)  # 5 m from both legs; a turn 10 m before the corner passes it at 2 m
    for radius in (0.0, -3.0, math.nan, math.inf):
        one = verdict(around(PX4, radius), near, craft)
        assert one.safe is False, radius
        assert Note("reached_within_default", 1, radius_m=10.0, read=False) in one.notes
    assert verdict(around(PX4, 2.0), near, craft).safe is True
    read = verdict(around(PX4, 0.0), near, craft, Tuning.of({"NAV_ACC_RAD": 2.0}))
    assert read.safe is True, read.describe()


def test_arduplane_turns_by_its_own_parameters_where_the_item_gives_no_radius() -> None:
    craft = vehicle(PLANE, horizontal_clearance_m=0.0)  # at 15 m/s it turns 61 m before a right angle
    near = inside(970.0, 42.0, 10.0)
    assert verdict(around(PLANE, 0.0), near, craft).safe is False
    assert verdict(around(PLANE, 40.0), near, craft).safe is True
    assert verdict(around(PLANE, 0.0), near, craft, Tuning.of({"WP_RADIUS": 40.0})).safe is True


def test_arducopter_cuts_within_its_own_radius_and_stops_at_a_hold() -> None:
    sharp = vehicle(COPTER, horizontal_clearance_m=0.0, track_error_m=0.5)
    near = inside(998.5, 1.5, 0.9)  # 0.6 m from both legs, and 2 m from the corner
    assert verdict(around(COPTER, 0.0), near, sharp).safe is False
    assert verdict(around(COPTER, 0.0, hold_s=3.0), near, sharp).safe is True
    assert verdict(around(COPTER, 0.0), near, sharp, Tuning.of({"WPNAV_RADIUS": 10.0})).safe is True
    held = vehicle(COPTER, horizontal_clearance_m=0.0, track_error_m=2.0)  # its corner stays within 2 m of track error
    assert verdict(around(COPTER, 0.0), inside(996.0, 4.0, 1.9), held).safe is True
    ideal = replace(sharp, corner_accel_m_s2=math.inf)
    assert verdict(around(COPTER, 0.0), near, ideal).safe is True


def test_a_wing_with_a_slower_l1_controller_than_usual_is_judged_wider() -> None:
    items = [at(cmd.WAYPOINT, *p, 100, 0.0, 50.0) for p in ((1000.0, 0.0), (1600.0, 900.0), (2500.0, 900.0))]
    flown = Mission(
        PLANE, HOME, (at(cmd.VTOL_TAKEOFF, 0, 0, 100), *items, at(cmd.LOITER_UNLIM, 2500, 900, 100)), "uav1"
    )
    craft = replace(vehicle(PLANE, horizontal_clearance_m=0.0), turn_radius_m=100.0, speed_max_m_s=21.0)
    beside = inside(1320.8, 436.1, 2.0)  # 25 m to the right of the second leg
    assert verdict(flown, beside, craft).safe is True
    slow = verdict(flown, beside, craft, Tuning.of({"NAVL1_PERIOD": 30.0}))
    assert {(f.kind, f.zone) for f in slow.findings} == {("zone", "inside")}
    assert [n.data["period_s"] for told in slow.notes for n in within(told) if n.code == "turns_off_arcs"] == [30.0]
    for period_s in (1e6, 1e-6):
        odd = verdict(flown, beside, craft, Tuning.of({"NAVL1_PERIOD": period_s}))
        assert odd.safe is None
        assert coded(odd.not_judged, "l1_period_out_of_range").data["period_s"] == period_s
