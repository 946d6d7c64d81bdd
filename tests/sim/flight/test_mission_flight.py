"""Flight in simulated time beside arithmetic, and the limits of motion that no flight breaks."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.sim.flight.kinematics import Kinematics
from gcsplan.sim.flight.mission_flight import FLIGHT_STEP_S, fly
from gcsplan.sim.flight.track import make_track
from gcsplan.vehicle import Autopilot
from tests.support.short_flights import CLIMB_S, COPTER, FLAT, GROUND_M, TAKEOFF, at, speed, speed_at, track


def delay(seconds: float) -> MissionItem:
    return MissionItem(cmd.DELAY, m.NO_POSITION, (seconds, -1.0, -1.0, -1.0))


@pytest.mark.nightly_but("150.0-3.0")
@pytest.mark.slow
@pytest.mark.parametrize(("leg_m", "measured_m_s"), [(60.0, 7.0), (100.0, 4.0), (150.0, 3.0)])
def test_a_lower_speed_on_the_move_takes_hold_as_slowly_as_on_a_real_arducopter(
    leg_m: float, measured_m_s: float
) -> None:
    way = track(
        TAKEOFF, speed(10), at(cmd.WAYPOINT, 0, 300, 50), speed(3), at(cmd.WAYPOINT, 0, 300 + leg_m, 50),
        at(cmd.WAYPOINT, 0, 900, 50),
    )  # fmt: skip
    flown = fly([way], [0.0])
    assert speed_at(flown, 50 + 295) == pytest.approx(10.0, rel=0.01)
    assert speed_at(flown, 50 + 300 + leg_m) == pytest.approx(measured_m_s, rel=0.1)


@pytest.mark.slow
def test_a_speed_commanded_at_a_standstill_holds_from_the_start() -> None:
    way = track(
        TAKEOFF, speed(10), at(cmd.WAYPOINT, 0, 300, 50, p1=4), speed(3), at(cmd.WAYPOINT, 0, 400, 50),
        at(cmd.WAYPOINT, 0, 900, 50),
    )  # fmt: skip
    flown = fly([way], [0.0])
    first_s = 300 / 10 + 10 / 1.5
    second_s = 600 / 3 + 3 / 1.5
    assert flown.arrive_s[0] == pytest.approx(CLIMB_S + first_s + 4 + second_s, abs=0.05)
    assert max(speed_at(flown, 50 + x) for x in np.arange(310, 890, 20)) == pytest.approx(3.0, abs=0.01)


@pytest.mark.slow
def test_a_straight_flight_takes_the_time_of_its_trapezoids() -> None:
    way = track(TAKEOFF, at(cmd.WAYPOINT, 0, 800, 50), at(cmd.LAND, 0, 800, 0))
    flown = fly([way], [7.0])
    assert flown.begin_s[0] == 7.0
    assert flown.arrive_s[0] == pytest.approx(7 + CLIMB_S + 800 / 10 + 10 / 1.5, abs=0.03)
    down_s = 1.5 + (40 - 1.125 - 1.0) / 1.5 + 1.0 + (10 - 0.125) / 0.5 + 0.5
    assert flown.end_s[0] == pytest.approx(flown.arrive_s[0] + down_s, abs=0.1)
    assert flown.points(0)[-1] == pytest.approx([0, 800, GROUND_M], abs=0.02)
    assert not way.ends_in_air


def test_a_leg_too_short_for_its_speed_is_a_triangle() -> None:
    flown = fly([track(TAKEOFF, at(cmd.WAYPOINT, 0, 20, 50))], [0.0])
    assert flown.arrive_s[0] == pytest.approx(CLIMB_S + 2 * math.sqrt(20 / 1.5), abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("rise_m", "rate_m_s"), [(200.0, 2.5), (-200.0, 1.5)])
def test_a_steep_leg_is_flown_as_slowly_as_climb_and_descent_demand(rise_m: float, rate_m_s: float) -> None:
    way = track(at(cmd.TAKEOFF, 0, 0, 300), at(cmd.WAYPOINT, 0, 400, 300 + rise_m))
    flown = fly([way], [0.0])
    length_m = math.hypot(400, 200)
    v = rate_m_s * length_m / 200
    assert speed_at(flown, 300 + length_m / 2) == pytest.approx(v, rel=0.001)
    assert flown.arrive_s[0] == pytest.approx(300 / 2.5 + 2.5 + length_m / v + v / 1.5, abs=0.05)


@pytest.mark.nightly_but("38.8-6.93", "60.7-9.2")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("leg_m", "measured_m_s"),
    [(12.0, 3.08), (22.9, 4.80), (38.8, 6.93), (49.7, 8.17), (60.7, 9.20), (70.3, 10.1)],
)
def test_a_short_leg_is_flown_as_slowly_as_a_real_arducopter_flew_it(leg_m: float, measured_m_s: float) -> None:
    kinematics = replace(Kinematics.of(replace(COPTER, speed_max_m_s=15.0)), leg_jerk_m_s3=1.0)
    lat, lon = (float(x) for x in FLAT.frame.to_degrees(0.0, 0.0))
    items = [TAKEOFF, speed(15), *(at(cmd.WAYPOINT, 0, y, 50) for y in (600, 600 + leg_m, 1200))]
    mission = Mission(Autopilot.ARDUCOPTER, Home.at(lat, lon, GROUND_M), tuple(items))
    flown = fly([make_track(mission, COPTER, FLAT, kinematics)], [0.0])
    assert speed_at(flown, 50 + 600 + leg_m / 2) == pytest.approx(measured_m_s, rel=0.04)
    assert speed_at(flown, 50 + 400) == pytest.approx(15.0, rel=0.01)


@pytest.mark.nightly
def test_waits_in_the_air_and_on_the_ground_last_as_long_as_they_say() -> None:
    plain = fly([track(TAKEOFF, at(cmd.WAYPOINT, 0, 200, 50), at(cmd.WAYPOINT, 0, 400, 50))], [0.0])
    waits = track(delay(12), TAKEOFF, delay(7.5), at(cmd.WAYPOINT, 0, 200, 50), at(cmd.WAYPOINT, 0, 400, 50))
    flown = fly([waits], [3.0])
    assert flown.begin_s[0] == 15.0
    assert flown.arrive_s[0] == pytest.approx(plain.arrive_s[0] + 3 + 12 + 7.5, abs=0.01)
    held = track(TAKEOFF, at(cmd.WAYPOINT, 0, 200, 50), at(cmd.LOITER_TIME, 0, 400, 50, p1=30), at(cmd.LAND, 0, 400, 0))
    landed = track(TAKEOFF, at(cmd.WAYPOINT, 0, 200, 50), at(cmd.WAYPOINT, 0, 400, 50), at(cmd.LAND, 0, 400, 0))
    assert fly([held], [0.0]).end_s[0] == pytest.approx(fly([landed], [0.0]).end_s[0] + 30, abs=0.02)
    assert fly([held], [0.0]).hold_s[0] == 30.0


@pytest.mark.slow
def test_a_return_climbs_flies_straight_home_and_comes_down_there() -> None:
    way = track(TAKEOFF, at(cmd.WAYPOINT, 300, 400, 50), MissionItem(cmd.RTL, m.NO_POSITION), rtl_rel_home_m=80)
    flown = fly([way], [0.0])
    points = flown.points(0)
    assert points[:, 2].max() == pytest.approx(GROUND_M + 80, abs=0.01)
    assert points[-1] == pytest.approx([0, 0, GROUND_M], abs=0.05)
    assert flown.arrive_s[0] == pytest.approx(CLIMB_S + 500 / 10 + 10 / 1.5, abs=0.05)
    assert flown.end_s[0] > flown.arrive_s[0] + 30 / 2.5 + 50 + 70 / 1.5


def test_a_loiter_without_end_ends_in_the_air_and_what_follows_is_never_flown() -> None:
    way = track(TAKEOFF, at(cmd.LOITER_UNLIM, 0, 400, 50), at(cmd.LAND, 0, 400, 0))
    flown = fly([way], [0.0])
    assert way.ends_in_air
    assert flown.end_s[0] == flown.arrive_s[0]
    assert flown.points(0)[-1, 2] == pytest.approx(GROUND_M + 50, abs=0.01)


@pytest.mark.nightly
def test_the_ideal_vehicle_of_the_papers_flies_length_over_speed() -> None:
    ideal = replace(
        COPTER, accel_m_s2=math.inf, corner_accel_m_s2=math.inf, vertical_accel_m_s2=math.inf, climb_m_s=math.inf,
        descent_m_s=math.inf,
    )  # fmt: skip
    way = track(TAKEOFF, speed(8), at(cmd.WAYPOINT, 0, 300, 90), at(cmd.WAYPOINT, 400, 300, 50), vehicle=ideal)
    length_m = 50 / 10 * 8 + math.hypot(300, 40) + math.hypot(400, 40)  # the climb is flown at 10
    assert fly([way], [0.0]).arrive_s[0] == pytest.approx(length_m / 8, abs=0.1)


@pytest.mark.nightly
@settings(max_examples=8)
@given(
    legs=st.lists(st.tuples(st.floats(-150, 150), st.floats(-150, 150), st.floats(20, 90)), min_size=1, max_size=6),
    cruise=st.floats(2, 20),
    depart=st.floats(0, 30),
)
def test_no_limit_of_motion_is_ever_broken(
    legs: list[tuple[float, float, float]], cruise: float, depart: float
) -> None:
    vehicle = replace(COPTER, speed_max_m_s=20.0)
    way = track(TAKEOFF, speed(cruise), *(at(cmd.WAYPOINT, *place) for place in legs), vehicle=vehicle)
    flown = fly([way], [depart])
    t, points, s = flown.times_s, flown.points(0), flown.along_m[:, 0]
    assert math.isfinite(flown.arrive_s[0])
    assert (np.diff(s) >= 0).all()
    dt = np.diff(t)
    move = np.diff(points, axis=0)
    slack = 0.05
    assert (np.hypot(move[:, 0], move[:, 1]) / dt <= cruise + slack).all()
    assert (move[:, 2] / dt <= 2.5 + slack).all()
    assert (-move[:, 2] / dt <= 1.5 + slack).all()
    v = np.diff(s) / dt
    # From one step to the next the speed grows by the acceleration at most.
    assert (np.diff(v) <= 1.5 * dt[1:] + 0.02 * cruise + slack).all()
    goal = np.array([legs[-1][0], legs[-1][1], GROUND_M + legs[-1][2]])
    assert np.linalg.norm(points[-1] - goal) < 0.05


@pytest.mark.nightly
def test_a_quarter_of_the_step_flies_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    way = track(
        TAKEOFF, speed(9), at(cmd.WAYPOINT, 0, 200, 60), at(cmd.WAYPOINT, 150, 250, 40), at(cmd.WAYPOINT, 160, 100, 70),
        speed(4), at(cmd.WAYPOINT, 500, 0, 50), at(cmd.LAND, 500, 0, 0),
    )  # fmt: skip
    coarse = fly([way], [0.0])
    monkeypatch.setattr("gcsplan.sim.flight.mission_flight.FLIGHT_STEP_S", FLIGHT_STEP_S / 4)
    fine = fly([way], [0.0])
    assert coarse.arrive_s[0] == pytest.approx(fine.arrive_s[0], abs=0.03)
    assert coarse.end_s[0] == pytest.approx(fine.end_s[0], abs=0.05)


@pytest.mark.slow
def test_planes_and_px4_are_flown_too() -> None:
    for autopilot, takeoff in ((Autopilot.PX4, cmd.TAKEOFF), (Autopilot.ARDUPLANE, cmd.VTOL_TAKEOFF)):
        vehicle = replace(COPTER, autopilot=autopilot)
        flown = fly([track(at(takeoff, 0, 0, 50), at(cmd.WAYPOINT, 0, 800, 50), vehicle=vehicle)], [0.0])
        assert flown.arrive_s[0] == pytest.approx(CLIMB_S + 800 / 10 + 10 / 1.5, abs=0.05)
