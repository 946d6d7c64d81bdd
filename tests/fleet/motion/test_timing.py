"""Motion in time: by hand where possible, else against a fine step-by-step integration; and what is no motion."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.arrays import Floats
from gcsplan.fleet.motion.ardupilot import CORNER_M
from gcsplan.fleet.motion.speeds import CUT_M
from gcsplan.fleet.motion.timing import POSITION_ERROR_M, Course, Route, TimedPath, motion_error_m, speed_for
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.world.geometry.limits import Limits
from tests.support.effort import draws
from tests.support.flights import fly, time_to_goal_s

TIMES = np.array([10.0, 12.0, 16.0])
POINTS = np.array([[0.0, 0.0, 5.0], [4.0, 2.0, 5.0], [4.0, 10.0, 9.0]])


def test_a_vehicle_is_between_its_points_in_time_and_stands_before_and_after() -> None:
    path = TimedPath("uav1", TIMES, POINTS, 16.0)
    assert (path.begin_s, path.end_s) == (10.0, 16.0)
    assert path.at([0.0, 11.0, 14.0, 99.0]).tolist() == [
        [0.0, 0.0, 5.0], [2.0, 1.0, 5.0], [4.0, 6.0, 7.0], [4.0, 10.0, 9.0],
    ]  # fmt: skip


def test_a_later_start_moves_all_times_and_nothing_else() -> None:
    path = TimedPath("uav1", TIMES, POINTS, 15.0, ends_in_air=True, pieces=np.array([3, 4]))
    later = path.delayed(2.5)
    assert later.times_s.tolist() == (TIMES + 2.5).tolist()
    assert (later.arrive_s, later.name, later.ends_in_air) == (17.5, "uav1", True)
    assert later.points is path.points
    assert later.pieces is path.pieces
    assert np.array_equal(later.at(TIMES + 2.5), path.at(TIMES))


@pytest.mark.parametrize(
    ("times", "points", "said"),
    [
        (TIMES[:1], POINTS[:1], "are not a motion"),
        (TIMES, POINTS[:2], "are not a motion"),
        (np.array([1.0, 1.0, 2.0]), POINTS, "do not rise"),
    ],
)
def test_what_is_no_motion_is_refused(times: np.ndarray, points: np.ndarray, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        TimedPath("uav1", times, points, 2.0)


FREE = math.inf


def vehicle(**changes: Any) -> Vehicle:
    return replace(Vehicle("a", 1, Autopilot.ARDUCOPTER, Limits(min_agl_m=5)), **changes)


JERKY = vehicle(leg_jerk_m_s3=1.0)  # ArduPilot's S-curves, as they are left at the factory
IDEAL = vehicle(
    climb_m_s=FREE, descent_m_s=FREE, land_m_s=FREE, accel_m_s2=FREE, corner_accel_m_s2=FREE, vertical_accel_m_s2=FREE
)
SHARP = vehicle(corner_accel_m_s2=FREE)  # acceleration, but full speed round corners


def route(*points: tuple[float, float, float], **more: Any) -> Route:
    return Route("a", np.array(points, dtype=float), **more)


def random_points(rng: np.random.Generator, n: int) -> Floats:
    """Legs of very different length, some steep, some corners sharp, now and then a point twice."""
    length = rng.choice([0.0, 0.5, 4.0, 25.0, 120.0], n - 1, p=[0.08, 0.12, 0.2, 0.3, 0.3])
    course = np.cumsum(rng.choice([0.0, 0.02, 0.3, 1.2, math.pi], n - 1) * rng.choice([-1, 1], n - 1))
    rise = length * rng.choice([0.0, 0.1, -0.1, 0.8, -0.8], n - 1)
    steps = np.column_stack([length * np.cos(course), length * np.sin(course), rise])
    return np.vstack([[0.0, 0.0, 100.0], np.array([0.0, 0.0, 100.0]) + np.cumsum(steps, axis=0)])


routes = st.integers(0, 2**32 - 1).map(
    lambda seed: Route("a", random_points(np.random.default_rng(seed), int(seed % 9) + 2))
)


# -- by hand ------------------------------------------------------------------------------------------------------


def test_an_ideal_vehicle_takes_length_over_speed_whatever_slope_and_corner() -> None:
    way = route((0, 0, 100), (300, 400, 100), (300, 400, 250), (0, 400, 650))
    assert time_to_goal_s(way, IDEAL, 12.5) == pytest.approx((500 + 150 + 500) / 12.5, rel=1e-12)
    motion = fly(way, IDEAL, 12.5, depart_s=7.0)
    assert motion.times_s == pytest.approx([7, 47, 59, 99], rel=1e-12)
    assert np.array_equal(motion.points, way.points)
    assert motion_error_m(IDEAL) == 0.0
    assert motion_error_m(vehicle()) == motion_error_m(SHARP) == POSITION_ERROR_M


@pytest.mark.parametrize("speed", [2.0, 7.3, 15.0])
def test_one_level_leg_costs_one_speed_up_and_one_braking(speed: float) -> None:
    way = route((0, 0, 100), (600, 0, 100))
    assert time_to_goal_s(way, vehicle(), speed) == pytest.approx(600 / speed + speed / 1.5, rel=1e-12)


def test_a_leg_too_short_for_cruise_is_two_parabolas() -> None:
    assert time_to_goal_s(route((0, 0, 100), (6, 0, 100)), vehicle(), 15.0) == pytest.approx(2 * math.sqrt(6 / 1.5))


@pytest.mark.parametrize(("rise", "rate"), [(120.0, 2.5), (-120.0, 1.5)])
def test_a_steep_leg_is_flown_at_the_climb_or_descent_rate(rise: float, rate: float) -> None:
    way = route((0, 0, 200), (160, 0, 200 + rise))  # 200 m long, three in five are height
    along = rate * 200 / 120
    assert time_to_goal_s(way, vehicle(), 10.0) == pytest.approx(200 / along + along / 1.5, rel=1e-12)
    assert time_to_goal_s(way, vehicle(), 10.0) == time_to_goal_s(way, vehicle(), 15.0)
    # Slow enough, the cruise speed is the tight one: its horizontal part counts.
    assert time_to_goal_s(way, vehicle(), 1.0) == pytest.approx(160 + 1.25 / 1.5, rel=1e-12)


def test_it_brakes_before_a_slower_leg_and_speeds_up_after_it() -> None:
    way = route((0, 0, 100), (400, 0, 100), (400 + 160, 0, 220), (960, 0, 220))
    slow = 2.5 * 200 / 120
    v, a = 10.0, 1.5
    level = 2 * (400 - v * v / (2 * a) - (v * v - slow * slow) / (2 * a)) / v
    ramps = 2 * v / a + 2 * (v - slow) / a
    assert time_to_goal_s(way, SHARP, v) == pytest.approx(level + ramps + 200 / slow, rel=1e-12)


def test_a_right_angle_is_rounded_two_metres_inside_and_slow() -> None:
    way = route((0, 0, 100), (300, 0, 100), (300, 300, 100))
    radius = CUT_M / (math.sqrt(2) - 1)
    bend = math.sqrt(2.5 * radius)
    v, a = 10.0, 1.5
    straight = 300 - radius
    level = (straight - v * v / (2 * a) - (v * v - bend * bend) / (2 * a)) / v
    expected = 2 * (level + v / a + (v - bend) / a) + radius * math.pi / 2 / bend
    assert time_to_goal_s(way, vehicle(), v) == pytest.approx(expected, rel=1e-12)
    near = fly(way, vehicle(), v, error_m=0.001).at(np.linspace(0, expected, 4001))
    assert np.linalg.norm(near - [300, 0, 100], axis=1).min() == pytest.approx(CUT_M, abs=0.002)


def test_a_slight_turn_costs_no_time() -> None:
    bent = route((0, 0, 100), (300, 0, 100), (600, 10, 100))
    straight = route((0, 0, 100), (300, 0, 100), (600.166, 0, 100))
    assert time_to_goal_s(bent, vehicle(), 10.0) == pytest.approx(time_to_goal_s(straight, vehicle(), 10.0), abs=0.01)


@pytest.mark.parametrize(
    ("leg_m", "measured_m_s"),
    [(12.0, 3.08), (22.9, 4.80), (38.8, 6.93), (49.7, 8.17), (60.7, 9.20), (70.3, 10.1)],
)
def test_a_short_leg_is_flown_as_slowly_as_a_real_arducopter_flew_it(leg_m: float, measured_m_s: float) -> None:
    way = route((0, 0, 100), (600, 0, 100), (600 + leg_m, 0, 100), (1200 + leg_m, 0, 100))
    motion = fly(way, JERKY, 15.0, error_m=0.001)
    speed = np.linalg.norm(np.diff(motion.points, axis=0), axis=1) / np.diff(motion.times_s)
    east = 0.5 * (motion.points[1:, 0] + motion.points[:-1, 0])
    assert speed[(east > 600) & (east < 600 + leg_m)] == pytest.approx(measured_m_s, rel=0.04)
    assert speed[east < 600].max() == pytest.approx(15.0, rel=0.01)  # it brakes before, and speeds up again


def test_short_legs_cost_nothing_where_no_curve_is_laid_out_for_each() -> None:
    way = route((0, 0, 100), (600, 0, 100), (612, 0, 100), (1200, 0, 100))
    plain = 1200 / 15 + 15 / 1.5
    assert time_to_goal_s(way, vehicle(), 15.0) == pytest.approx(plain, rel=1e-12)
    assert time_to_goal_s(way, vehicle(autopilot=Autopilot.PX4), 15.0) == pytest.approx(plain, rel=1e-12)
    assert time_to_goal_s(way, replace(IDEAL, leg_jerk_m_s3=1.0), 15.0) == pytest.approx(1200 / 15, rel=1e-12)
    assert time_to_goal_s(way, JERKY, 15.0) > plain + 5.0


def test_a_leg_in_parts_is_as_fast_as_in_one() -> None:
    whole = route((0, 0, 100), (400, 0, 130), (900, 0, 100), (912, 0, 100), (1500, 0, 100), items=np.arange(6))
    east = np.unique([*range(0, 1500, 20), 900, 912, 1500]).astype(float)
    corners = whole.points[:, 0]
    cut = np.column_stack([east, 0 * east, np.interp(east, corners, whole.points[:, 2])])
    owner = np.searchsorted(corners, east[1:])
    parts = Route("a", cut, items=np.array([0, *owner, 5]))
    assert time_to_goal_s(parts, JERKY, 12.0) == pytest.approx(time_to_goal_s(whole, JERKY, 12.0), rel=1e-3)
    assert time_to_goal_s(replace(parts, items=None), JERKY, 12.0) > 2 * time_to_goal_s(whole, JERKY, 12.0)


def test_a_leg_is_flown_at_its_pace_of_the_commanded_speed_and_so_is_the_way_home() -> None:
    more = {"start_ground_amsl_m": 100.0, "end": "rtl", "rtl_amsl_m": 100.0}
    way = route((0, 0, 100), (600, 0, 100), (1500, 0, 100), **more)
    plain, v, a = fly(way, SHARP, 10.0), 10.0, 1.5
    paced = fly(replace(way, pace=np.array([1.01, 0.98, 1.05])), SHARP, v)
    fast, slow, home = 1.01 * v, 0.98 * v, 1.05 * v
    out_s = 600 / fast + fast / (2 * a) + 900 / slow + slow / (2 * a) + (fast - slow) ** 2 / (2 * a * fast)
    assert paced.arrive_s == pytest.approx(out_s, rel=1e-12)
    assert paced.end_s - paced.arrive_s == pytest.approx(1500 / home + home / a, rel=1e-12)
    assert fly(replace(way, pace=np.ones(3)), SHARP, v).arrive_s == plain.arrive_s
    climb = route((0, 0, 100), (160, 0, 220))  # where the climb rate is what counts, the pace is nothing
    assert time_to_goal_s(replace(climb, pace=np.full(2, 1.1)), SHARP, v) == time_to_goal_s(climb, SHARP, v)


@pytest.mark.parametrize("turn_deg", [0.02, 0.3, 0.9])
@pytest.mark.parametrize(("craft", "cut_m"), [(vehicle(), 0.0), (JERKY, CORNER_M)])
def test_hilltops_on_nearly_straight_tracks_are_not_cut_off(turn_deg: float, craft: Vehicle, cut_m: float) -> None:
    """ArduCopter cuts them as it cuts corners, by as much as the radius of a way point."""
    run = np.array([2000.0, 3000.0, 1200.0, 2500.0])
    course = np.radians(turn_deg) * np.array([0.0, 1.0, 0.0, -1.0])
    steps = np.column_stack([run * np.cos(course), run * np.sin(course), [300.0, -350.0, 200.0, -100.0]])
    points = np.array([0.0, 0.0, 400.0]) + np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    motion = fly(Route("a", points, end="none"), craft, 12.0)
    flown = motion.at(np.linspace(0.0, motion.end_s, 40001))
    # Where it is over the mission's own line, it is as high as that line is there.
    high = np.interp(flown[:, 0], points[:, 0], points[:, 2])
    assert np.abs(flown[:, 2] - high).max() < POSITION_ERROR_M + cut_m
    for point in points[1:-1]:
        near = flown[np.argmin(np.linalg.norm(flown[:, :2] - point[:2], axis=1))]
        assert near[2] == pytest.approx(point[2], abs=POSITION_ERROR_M + cut_m)
        assert np.linalg.norm(near[:2] - point[:2]) <= CUT_M + POSITION_ERROR_M


def test_take_off_rests_at_the_top_and_landing_is_slow_near_the_ground() -> None:
    way = route((0, 0, 100), (600, 0, 100), start_ground_amsl_m=40, goal_ground_amsl_m=35)
    take_off = 60 / 2.5 + 2.5  # 1 m/s²: a second of 2.5 m/s for each of the two ramps
    leg = 600 / 10 + 10 / 1.5
    assert time_to_goal_s(way, vehicle(), 10.0) == pytest.approx(take_off + leg, rel=1e-12)
    motion = fly(way, vehicle(), 10.0, depart_s=3.0)
    assert motion.begin_s == 3.0
    assert motion.arrive_s == pytest.approx(3.0 + take_off + leg, rel=1e-12)
    ramp, brake = 1.5, 1.0  # 0 to 1.5 m/s, and 1.5 to 0.5 m/s
    fast = (55 - 1.5**2 / 2 - (1.5**2 - 0.5**2) / 2) / 1.5
    assert motion.end_s - motion.arrive_s == pytest.approx(ramp + fast + brake + 10 / 0.5, rel=1e-12)
    assert np.array_equal(motion.points[0], [0, 0, 40])
    assert np.array_equal(motion.points[-1], [600, 0, 35])
    low = route((0, 0, 100), (600, 0, 100), goal_ground_amsl_m=92)  # never out of the slow part
    motion = fly(low, vehicle(), 10.0)
    assert motion.end_s - motion.arrive_s == pytest.approx(0.5 + (8 - 0.125) / 0.5, rel=1e-12)


def test_a_return_climbs_first_flies_home_level_and_lands() -> None:
    more = {"start_ground_amsl_m": 40.0, "end": "rtl", "rtl_amsl_m": 120.0}
    motion = fly(route((0, 0, 100), (600, 0, 100), **more), vehicle(), 10.0)
    climb, home = 20 / 2.5 + 2.5, 600 / 10 + 10 / 1.5
    down = 1.5 + (70 - 1.5**2 / 2 - 1.0) / 1.5 + 1.0 + 20
    waits = 5.0  # RTL_LOIT_TIME
    assert motion.end_s - motion.arrive_s == pytest.approx(climb + home + waits + down, rel=1e-9)
    assert np.array_equal(motion.points[-1], [0, 0, 40])
    assert motion.at(motion.arrive_s + climb + home)[0] == pytest.approx([0, 0, 120])
    assert motion.at(motion.arrive_s + climb + home + waits)[0] == pytest.approx([0, 0, 120])
    high = fly(route((0, 0, 200), (600, 0, 200), **more), vehicle(), 10.0)  # higher than that: no climb, no descent
    assert high.at(high.arrive_s + home)[0] == pytest.approx([0, 0, 200])


@pytest.mark.parametrize(
    ("goal_m", "slow_from_m"), [(300.0, 307.0), (280.0, 307.0), (304.0, 307.0), (320.0, 320.0), (200.0, 307.0)]
)
def test_a_landing_px4_slows_down_by_its_height_over_home(goal_m: float, slow_from_m: float) -> None:
    px4 = vehicle(autopilot=Autopilot.PX4, descent_m_s=1.5, land_m_s=0.7, vertical_accel_m_s2=FREE)
    there = (500.0, 0.0, 400.0)
    way = route((0, 0, 365), there, start_ground_amsl_m=300.0, goal_ground_amsl_m=goal_m)
    motion = fly(way, px4, 10.0)
    takes_s = (there[2] - slow_from_m) / 1.5 + (slow_from_m - goal_m) / 0.7
    assert motion.end_s - motion.arrive_s == pytest.approx(takes_s)


def test_px4_returns_at_a_speed_of_its_own() -> None:
    free = {"vertical_accel_m_s2": FREE, "climb_m_s": FREE, "descent_m_s": FREE, "land_m_s": FREE}
    way = route((0, 0, 365), (1000, 0, 365), start_ground_amsl_m=300.0, end="rtl", rtl_amsl_m=365.0)
    for speed in (4.0, 10.0):
        motion = fly(way, vehicle(autopilot=Autopilot.PX4, **free), speed)
        home_s = float(motion.times_s[(motion.points[:, 0] <= 1e-6) & (motion.times_s > motion.arrive_s)][0])
        assert home_s - motion.arrive_s == pytest.approx(1000 / 5.0 + 5.0 / 1.5)


def test_what_stays_in_the_air_says_so_and_what_ends_there_does_not() -> None:
    points = ((0.0, 0.0, 100.0), (600.0, 0.0, 100.0))
    assert fly(route(*points, end="loiter"), vehicle(), 10.0).ends_in_air
    gone = fly(route(*points, end="none"), vehicle(), 10.0)
    assert not gone.ends_in_air
    assert gone.end_s == gone.arrive_s


# -- holds, items, limit cases ------------------------------------------------------------------------------------


def test_holds_stop_the_vehicle_and_the_gate_comes_before_the_first_leg() -> None:
    points = ((0.0, 0.0, 100.0), (300.0, 0.0, 100.0), (600.0, 0.0, 100.0))
    way = route(*points, holds_s=np.array([5.0, 7.0, 11.0]), start_ground_amsl_m=40, goal_ground_amsl_m=90)
    course = Course(way, vehicle())
    leg = 300 / 10 + 10 / 1.5
    top = 60 / 2.5 + 2.5
    assert course.time_to_goal_s(10.0, hold_s=2.0) == pytest.approx(top + 7 + leg + 7 + leg, rel=1e-12)
    motion = course.fly(10.0, hold_s=2.0)
    assert np.array_equal(motion.at([top + 0.001, top + 6.999]), [points[0], points[0]])
    assert np.array_equal(motion.at([top + 7 + leg, top + 14 + leg]), [points[1], points[1]])
    assert motion.arrive_s == pytest.approx(top + 14 + 2 * leg)
    assert np.array_equal(motion.at(motion.arrive_s + 11)[0], points[2])


def test_pieces_carry_the_item_that_is_flown_to() -> None:
    way = route(
        (0, 0, 100), (300, 0, 100), (300, 0, 100), (300, 300, 100),
        start_ground_amsl_m=40, goal_ground_amsl_m=35, items=np.array([1, 3, 4, 5, 6]),
    )  # fmt: skip
    motion = fly(way, vehicle(), 10.0, hold_s=3.0)
    assert motion.pieces is not None
    runs = motion.pieces[np.append(True, np.diff(motion.pieces) != 0)]
    assert runs.tolist() == [1, 3, 5, 6]  # item 4 is where it is already
    plain = fly(replace(way, items=None), vehicle(), 10.0).pieces
    assert plain is not None
    assert set(plain.tolist()) == {-1}


def test_points_twice_change_nothing() -> None:
    once = route((0, 0, 100), (300, 0, 100), (300, 300, 110))
    twice = route((0, 0, 100), (0, 0, 100), (300, 0, 100), (300, 0, 100), (300, 300, 110), (300, 300, 110))
    assert time_to_goal_s(once, vehicle(), 9.0) == time_to_goal_s(twice, vehicle(), 9.0)
    held = replace(twice, holds_s=np.array([1.0, 2.0, 4.0, 8.0, 0.0, 0.0]))
    as_once = replace(once, holds_s=np.array([3.0, 12.0, 0.0]))
    assert time_to_goal_s(held, vehicle(), 9.0) == pytest.approx(time_to_goal_s(as_once, vehicle(), 9.0), rel=1e-12)


def test_turning_right_back_stops_and_a_vertical_leg_is_a_column() -> None:
    back = route((0, 0, 100), (300, 0, 100), (0, 0, 100))
    there = route((0, 0, 100), (300 - CUT_M, 0, 100))
    assert time_to_goal_s(back, vehicle(), 10.0) == pytest.approx(2 * time_to_goal_s(there, vehicle(), 10.0), abs=0.01)
    up = route((0, 0, 100), (300, 0, 100), (300, 0, 150), (600, 0, 150))
    v, rate, a = 10.0, 2.5, 1.5
    level = 2 * (300 - v * v / (2 * a) - (v * v - rate * rate) / (2 * a)) / v + 2 * v / a + 2 * (v - rate) / a
    assert time_to_goal_s(up, vehicle(), v) == pytest.approx(level + 50 / rate, rel=1e-12)


def test_a_route_that_makes_no_sense_is_refused() -> None:
    line = np.array([[0.0, 0, 100], [300, 0, 100]])
    for more in (
        {"points": line[:1]}, {"points": line * math.nan}, {"holds_s": np.zeros(3)}, {"holds_s": -np.ones(2)},
        {"items": np.arange(2)}, {"pace": np.ones(1)}, {"pace": np.zeros(2)}, {"start_ground_amsl_m": 101.0},
        {"goal_ground_amsl_m": 101.0}, {"end": "rtl"},
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"route|need|above"):
            Route(**({"name": "a", "points": line} | more))
    with pytest.raises(ValueError, match="does not move"):
        fly(route((0, 0, 100), (0, 0, 100)), vehicle(), 10.0)


def test_energy_counts_columns_the_way_home_and_hovering() -> None:
    craft = vehicle(energy=Energy(vertical_j_per_m=10, horizontal_j_per_m=1, hover_w=400))
    way = route((0, 0, 100), (300, 400, 150), start_ground_amsl_m=40, goal_ground_amsl_m=90)
    assert way.energy_j(craft) == pytest.approx(10 * (60 + 50 + 60) + 500)
    assert way.energy_j(craft, hold_s=3) == pytest.approx(10 * 170 + 500 + 1200)
    home = replace(way, end="rtl", rtl_amsl_m=200.0, holds_s=np.array([1.0, 0.0]))
    assert home.energy_j(craft) == pytest.approx(10 * (60 + 50 + 50 + 160) + 1000 + 400 + 400 * 5)


# -- properties ---------------------------------------------------------------------------------------------------


@settings(max_examples=draws(50))
@given(routes, st.floats(0.5, 20), st.floats(1.0, 3.0))
def test_faster_is_never_later(way: Route, speed: float, factor: float) -> None:
    for craft in (vehicle(), SHARP, IDEAL, vehicle(accel_m_s2=FREE)):
        course = Course(way, craft)
        slow = course.time_to_goal_s(speed)
        assert course.time_to_goal_s(speed * factor) <= slow * (1 + 1e-9)


@settings(max_examples=draws(50))
@given(routes, st.floats(0.5, 20))
def test_the_way_back_with_climb_and_descent_swapped_takes_as_long(way: Route, speed: float) -> None:
    craft = vehicle()
    swapped = replace(craft, climb_m_s=craft.descent_m_s, descent_m_s=craft.climb_m_s)
    back = replace(way, points=way.points[::-1].copy())
    assert time_to_goal_s(back, swapped, speed) == pytest.approx(time_to_goal_s(way, craft, speed), rel=1e-6, abs=1e-6)


@settings(max_examples=draws(50))
@given(routes, st.floats(0.5, 20), st.sampled_from([0.05, 0.25, 1.0]))
def test_straight_pieces_stray_no_further_than_they_say(way: Route, speed: float, error_m: float) -> None:
    if len(np.unique(way.points, axis=0)) < 2:
        return
    way = replace(way, start_ground_amsl_m=60.0 + float(way.points[0, 2]) - 100.0)
    course = Course(way, vehicle())
    coarse, fine = course.fly(speed, error_m=error_m), course.fly(speed, error_m=1e-5)
    assert coarse.arrive_s == pytest.approx(fine.arrive_s, rel=1e-12)
    assert coarse.arrive_s == pytest.approx(course.time_to_goal_s(speed), rel=1e-12)
    t = np.linspace(0.0, fine.end_s, 3001)
    assert np.linalg.norm(coarse.at(t) - fine.at(t), axis=1).max() <= error_m + 1e-4


@settings(max_examples=draws(50))
@given(routes, st.floats(0.5, 20))
def test_no_piece_is_faster_than_the_vehicle(way: Route, speed: float) -> None:
    if len(np.unique(way.points, axis=0)) < 2:
        return
    craft = vehicle()
    motion = fly(way, craft, speed)
    seconds = np.diff(motion.times_s)
    step = np.diff(motion.points, axis=0)
    slack = 1e-6 / seconds + 1e-9
    assert (np.hypot(step[:, 0], step[:, 1]) / seconds <= speed * (1 + 1e-6) + slack).all()
    assert (step[:, 2] / seconds <= craft.climb_m_s * (1 + 1e-6) + slack).all()
    assert (-step[:, 2] / seconds <= craft.descent_m_s * (1 + 1e-6) + slack).all()


@settings(max_examples=draws(50))
@given(routes, st.floats(0.0, 1.0))
def test_the_speed_for_a_time_is_found(way: Route, share: float) -> None:
    time_s = Course(way, vehicle()).time_to_goal_s
    slow, fast = time_s(2.0), time_s(15.0)
    wanted = fast + share * (slow - fast)
    speed = speed_for(time_s, wanted, 2.0, 15.0)
    assert 2.0 <= speed <= 15.0
    assert time_s(speed) == pytest.approx(wanted, abs=1e-6)


def test_a_time_out_of_reach_gives_the_nearer_end() -> None:
    assert speed_for(lambda v: 100 / v, 5.0, 2.0, 10.0) == 10.0
    assert speed_for(lambda v: 100 / v, 60.0, 2.0, 10.0) == 2.0
    assert speed_for(lambda v: 7.0, 7.0, 2.0, 10.0) == 10.0


# -- step by step -------------------------------------------------------------------------------------------------


def dense(points: Floats, craft: Vehicle, speed: float, step_m: float) -> tuple[Floats, Floats]:
    """Places along the rounded path every ``step_m`` or nearer, and the largest speed at each: another derivation.

    Arcs are walked on their circle about its centre (on the bisector), not by chords; their middle is as high as the
    way point.
    """
    places: list[Floats] = []
    caps: list[float] = []

    def walk(
        a: Floats, b: Floats, run_m: float, cap_m_s: float = math.inf,
        circle: tuple[Floats, float] | None = None,
    ) -> None:  # fmt: skip
        rise = b[2] - a[2]
        length = math.hypot(run_m, rise)
        if length <= 1e-9:
            return
        most = [math.inf]
        most += [cap_m_s * length / run_m] if run_m > 0 else []
        most += [speed * length / run_m] if run_m > 0 else []
        most += [craft.climb_m_s * length / rise] if rise > 1e-12 else []
        most += [craft.descent_m_s * length / -rise] if rise < -1e-12 else []
        n = max(2, math.ceil(length / step_m))
        for f in np.linspace(0.0, 1.0, n + 1):
            place = a + f * (b - a)
            if circle is not None:
                centre, turn = circle
                arm = a[:2] - centre
                c, s = math.cos(f * turn), math.sin(f * turn)
                place[:2] = centre + np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])
            places.append(place)
            caps.append(min(most))

    at = points[0]
    n = len(points)
    for i in range(1, n):
        a, b = points[i - 1], points[i]
        leg = b[:2] - a[:2]
        run = float(np.linalg.norm(leg))
        if i < n - 1:
            following = points[i + 1][:2] - b[:2]
            run_next = float(np.linalg.norm(following))
            turn = math.atan2(leg[0] * following[1] - leg[1] * following[0], float(leg @ following))
            if abs(turn) > 1e-6 and abs(turn) < math.pi - 1e-6:
                radius = CUT_M / (1.0 / math.cos(turn / 2) - 1.0)
                tangent = min(radius * math.tan(abs(turn) / 2), run / 2, run_next / 2)
                radius = tangent / math.tan(abs(turn) / 2)
                into = b - (b - a) * (tangent / run)
                out = b + (points[i + 1] - b) * (tangent / run_next)
                left = np.array([-leg[1], leg[0]]) / run
                centre = into[:2] + left * radius * math.copysign(1.0, turn)
                to_centre = centre - b[:2]
                apex = np.append(centre - to_centre * (radius / np.linalg.norm(to_centre)), b[2])
                bend = math.sqrt(craft.corner_accel_m_s2 * radius)
                walk(at, into, float(np.linalg.norm(into[:2] - at[:2])))
                walk(into, apex, radius * abs(turn) / 2, bend, (centre, turn / 2))
                walk(apex, out, radius * abs(turn) / 2, bend, (centre, turn / 2))
                at = out
                continue
        walk(at, b, float(np.linalg.norm(b[:2] - at[:2])))
        at = b
    return np.array(places), np.array(caps)


def stepped(points: Floats, craft: Vehicle, speed: float) -> tuple[Floats, Floats]:
    """Times and places of a vehicle that speeds up as it may and brakes as it must, millimetre by millimetre."""
    places, caps = dense(points, craft, speed, 0.02)
    gaps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    v = np.append(caps, 0.0)[: len(caps)].copy()
    v[0] = v[-1] = 0.0
    for k in range(len(v) - 2, -1, -1):  # what can still be braked
        v[k] = min(v[k], math.sqrt(v[k + 1] ** 2 + 2 * craft.accel_m_s2 * gaps[k]))
    for k in range(1, len(v)):  # what has been reached
        v[k] = min(v[k], math.sqrt(v[k - 1] ** 2 + 2 * craft.accel_m_s2 * gaps[k - 1]))
    moved = gaps > 0
    mean = 0.5 * (v[1:] + v[:-1])
    seconds = np.where(moved, gaps / np.maximum(mean, 1e-12), 0.0)
    return np.append(0.0, np.cumsum(seconds)), places


@pytest.mark.first_quick
@pytest.mark.parametrize("seed", range(12))
def test_a_step_by_step_flight_takes_as_long_and_is_in_the_same_places(seed: int) -> None:
    craft = vehicle()
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    length = rng.choice([3.0, 8.0, 25.0, 60.0], n)
    course = np.cumsum(rng.uniform(-2.5, 2.5, n))
    steps = np.column_stack([length * np.cos(course), length * np.sin(course), length * rng.uniform(-0.6, 0.6, n)])
    points = np.vstack([[0.0, 0.0, 100.0], np.array([0.0, 0.0, 100.0]) + np.cumsum(steps, axis=0)])
    speed = float(rng.uniform(2, 14))
    times, places = stepped(points, craft, speed)
    motion = fly(Route("a", points, end="none"), craft, speed, error_m=0.01)
    assert motion.arrive_s == pytest.approx(times[-1], rel=2e-3, abs=0.02)
    some = np.linspace(0, len(times) - 1, 200).astype(int)
    scaled = times[some] * (motion.arrive_s / times[-1])
    assert np.linalg.norm(motion.at(scaled) - places[some], axis=1).max() < 0.15
