"""Returns from every point of a mission: known worlds, random ones by brute force, rally points where none is safe."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.check.flight.follow import follow
from gcsplan.check.judge import judge
from gcsplan.check.returns import obstacles as sweep
from gcsplan.check.returns import rally
from gcsplan.check.returns.footprint import Target
from gcsplan.check.returns.obstacles import Obstacles, obstacles_of_returns
from gcsplan.check.returns.rally import rally_items
from gcsplan.check.returns.refinement import CLEAR, LEGAL
from gcsplan.check.returns.stretches import rel_home
from gcsplan.check.returns.trace import trace_of
from gcsplan.check.returns.verdict import worst_first
from gcsplan.check.returns.way_home import WayHome, refinement_of, way_home
from gcsplan.check.returns.words import together_m
from gcsplan.figures import counted
from gcsplan.mavlink.mission.autopilots import profile_of
from gcsplan.mavlink.mission.commands import LAND, RTL, TAKEOFF, VTOL_LAND, VTOL_TAKEOFF, WAYPOINT
from gcsplan.mavlink.mission.mission import RELATIVE, Home, Mission
from gcsplan.mavlink.mission.mission import MissionItem as Item
from gcsplan.notes.note import Note
from gcsplan.units import Reach
from gcsplan.vehicle import Autopilot, Vehicle
from gcsplan.world import level_lines
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.world import World
from tests.oracles.returns import breach, random_case, run_on
from tests.support.noted import codes, within
from tests.support.worlds import vehicle, world

COPTER, PLANE, PX4 = Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE, Autopilot.PX4


def mission(
    w: World, places: Sequence[tuple[float, float, float]], autopilot: Autopilot = COPTER, *, land: bool = True
) -> Mission:
    """A mission: take-off at the origin to the first height, along (east, north, above home), landing at the last."""
    plane = autopilot is PLANE
    lat, lon = w.frame.to_degrees(0.0, 0.0)
    home = Home.at(float(lat), float(lon), w.ground_amsl(float(lat), float(lon)))
    items = [Item(VTOL_TAKEOFF if plane else TAKEOFF, RELATIVE, x=home.lat_e7, y=home.lon_e7, z=places[0][2])]
    for east, north, up in places:
        lat, lon = w.frame.to_degrees(east, north)
        items.append(Item(WAYPOINT, RELATIVE, x=round(float(lat) * 1e7), y=round(float(lon) * 1e7), z=up + 0.001))
    if land:
        items.append(Item(VTOL_LAND if plane else LAND, RELATIVE, x=items[-1].x, y=items[-1].y))
    return Mission(autopilot, home, tuple(items))


def judged(w: World, m: Mission, v: Vehicle | None = None, rtl: float | None = None, *, rally: bool = True) -> WayHome:
    v = v or vehicle(m.autopilot)
    return way_home(judge(m, v, w, rtl_rel_home_m=rtl), v, w, rtl_rel_home_m=rtl, rally=rally)


def ridge(east: Floats, north: Floats) -> Floats:
    """Ground at 300 m with a ridge of 100 m: flat on top from 900 to 1100 m east, slopes 200 m wide on both sides."""
    return 300.0 + 100.0 * np.clip((300.0 - np.abs(east - 1000.0)) / 200.0, 0.0, 1.0) + 0.0 * north


BARE = {"min_agl_m": 20.0, "track_error_m": 0.0, "altitude_error_m": 5.0}
OVER: list[tuple[float, float, float]] = [(0, 0, 150), (2000, 0, 150), (2000, 0, 40), (3000, 0, 40)]
"""Points over the ridge at 150 m, down behind it to 40 m, and on at 40 m."""


def test_over_flat_ground_any_altitude_is_safe() -> None:
    home = judged(world(), mission(world(), [(0, 0, 80), (3000, 0, 80)]), rtl=15.0)
    assert home.safe is True
    assert home.unsafe == ()
    assert home.lowest_rel_home_m == pytest.approx(5.0, abs=0.2)  # the altitude error; landing columns start below it
    assert home.highest_rel_home_m is None
    assert home.rally == ()
    # Min AGL 60 m and 5 m of error: from the landing column at the goal the return must be at 65 m.
    assert home.lowest_legal_rel_home_m == pytest.approx(65.0, abs=0.2)
    assert [s.from_seq for s in home.irregular] == [4]
    words = "outside a limit: from a point of the path the return hits nothing but breaks a limit; first from km 3.00"
    assert words in home.describe()
    assert "; within all limits from there at 65" in home.describe()
    assert str(home.headline) == "path safe; safe return from all of it"
    assert "RTL_ALT 6600 (cm)" in str(home.advice)
    assert str(home.advice).endswith("then safe return from all of it, within all limits")


def test_behind_a_ridge_the_return_must_clear_it() -> None:
    w = world(ridge)
    home = judged(w, mission(w, OVER), vehicle(**BARE), 50.0)
    assert home.safe is False
    assert home.lowest_rel_home_m == pytest.approx(105.0, abs=0.6)
    assert home.lowest_legal_rel_home_m == pytest.approx(125.0, abs=0.6)
    assert home.rally == ()  # another return altitude is enough
    assert home.advised_rel_home_m == home.lowest_rel_home_m
    (stretch,) = home.unsafe
    # On the descent at 2000 m it falls below 105 m after two fifths; everything after that is low.
    assert stretch.from_m == pytest.approx(2000.0, abs=3.0)
    assert stretch.start[2] == pytest.approx(405.0, abs=6.0)
    assert stretch.to_m == pytest.approx(3000.0, abs=1.0)
    assert stretch.lowest_rel_home_m == pytest.approx(105.0, abs=0.6)
    assert stretch.obstacle is not None
    east, north = w.frame.to_plane(*stretch.obstacle[:2])
    assert 890.0 <= float(east) <= 1110.0
    assert abs(float(north)) < 1.0
    assert "does_meet_ground" in codes(within(stretch.why))


@pytest.mark.parametrize("autopilot", [COPTER, PX4])
def test_at_the_lowest_altitude_it_is_safe_and_a_little_below_it_is_not(autopilot: Autopilot) -> None:
    w = world(ridge)
    m, v = mission(w, OVER, autopilot), vehicle(autopilot, **BARE)
    lowest = judged(w, m, v).lowest_rel_home_m
    assert lowest is not None
    assert judged(w, m, v, lowest).safe is True
    assert judged(w, m, v, lowest - 1.2).safe is False


@pytest.mark.nightly_but("arducopter")
@pytest.mark.slow
@pytest.mark.parametrize("autopilot", [Autopilot.ARDUCOPTER, Autopilot.ARDUPLANE])
def test_lines_home_that_are_judged_a_few_at_once_give_the_same(
    autopilot: Autopilot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of 240 km had millions of pieces of ground, and all were held together: half a gigabyte."""
    w = world(ridge, [Zone("mast", Circle(1500.0, 60.0, 40.0), ceiling=Level(390.0, "amsl"))])
    m, v = mission(w, OVER, autopilot), vehicle(autopilot, **BARE)
    together = judged(w, m, v, 90.0)
    counted_at_once: list[int] = []
    over = level_lines.over

    def counting(*arguments: Any, **named: Any) -> level_lines.LevelLines:
        met = over(*arguments, **named)
        counted_at_once.append(len(met.piece_line))
        return met

    monkeypatch.setattr(level_lines, "over", counting)
    judged(w, m, v, 90.0)
    calls = len(counted_at_once)
    monkeypatch.setattr(sweep, "MOST_PIECES_HELD", max(counted_at_once) // 10)
    counted_at_once.clear()
    assert json.dumps(judged(w, m, v, 90.0).as_dict()) == json.dumps(together.as_dict())
    assert len(counted_at_once) > calls


@pytest.mark.slow
def test_without_an_altitude_the_autopilots_default_is_judged_and_said_so() -> None:
    for autopilot, parameter, default in (
        (COPTER, "RTL_ALT", 15.0), (PLANE, "RTL_ALTITUDE", 100.0), (PX4, "RTL_RETURN_ALT", 30.0),
    ):  # fmt: skip
        home = judged(world(), mission(world(), [(0, 0, 120), (2000, 0, 120)], autopilot))
        assert (home.parameter, home.rtl_rel_home_m, home.assumed) == (parameter, default, True)
        assert Note("return_altitude_assumed", rel_home_m=default, parameter=parameter) in home.notes
    home = judged(world(), mission(world(), [(0, 0, 120), (2000, 0, 120)]), rtl=40.0)
    assert not home.assumed
    assert home.notes == ()


@pytest.mark.slow
def test_a_zone_over_the_way_bounds_the_return_from_above() -> None:
    shelf = Zone("shelf", Circle(1000.0, 0.0, 200.0), floor=Level(420.0, "amsl"))
    w = world(300.0, [shelf])
    m, v = mission(w, [(0, 0, 80), (2500, 0, 80)]), vehicle(**BARE)
    home = judged(w, m, v, 60.0)
    assert home.safe is True
    assert home.highest_rel_home_m == pytest.approx(115.0, abs=0.01)
    high = judged(w, m, v, 130.0)
    assert [s.zone for s in high.unsafe] == ["shelf"]
    # Below the zone even the climb is blocked; it runs on by 46 m at 15 m/s, and so reaches it from short of it.
    assert high.unsafe[0].from_m == pytest.approx(800.0 - 46.25, abs=5.0)


@pytest.mark.slow
def test_over_a_zone_on_a_slope_the_climb_counts_the_ceiling_there_alone() -> None:
    # The ground, and with it the zone's ceiling, rises towards home. The flight passes 3 m above the ceiling under it,
    # lower than the ceiling nearer home; the return climbs on the spot above all of it.
    def slope(east: Floats, north: Floats) -> Floats:
        return 300.0 + 0.1 * np.clip(1500.0 - east, 0.0, 3000.0) + 0.0 * north

    shape, v = Circle(800.0, 0.0, 200.0), vehicle(**BARE)
    quarry = Zone("quarry", shape, ceiling=Level(50.0, "agl"))
    w = world(slope, [quarry])
    m = mission(w, [(0, 0, 58), (1500, 0, -92), (2000, 0, -92)])
    assert judge(m, v, w).safe is True
    assert judged(w, m, v, 20.0).unsafe == ()
    low = mission(w, [(0, 0, 40), (1500, 0, -110), (2000, 0, -110)])  # through the zone
    assert {s.zone for s in judged(w, low, v, 20.0).unsafe} == {"quarry"}
    shelf = Zone("shelf", shape, Level(70.0, "agl"), Level(120.0, "agl"))  # passed under
    under = world(slope, [shelf])
    assert judge(m, v, under).safe is True
    assert {s.zone for s in judged(under, m, v, 150.0).unsafe} == {"shelf"}


@pytest.mark.slow
def test_what_stays_unsafe_without_rally_points_is_no_matter_of_the_battery() -> None:
    w = world(300.0, [Zone("lid", Circle(1000.0, 0.0, 100.0), floor=Level(340.0, "amsl"))])
    home = judged(w, mission(w, [(0, 0, 20), (1000, 0, 20)]), vehicle(**BARE), 60.0)
    left = home.left or home.unsafe
    assert left
    told = replace(home, rally=(), left=left, set_rel_home_m=60.0, set_leaves_m=200.0)
    assert str(told.advice).endswith("then no safe return from 200 m of it")
    assert str(replace(told, left=()).advice).endswith("then no safe return from 200 m of it (battery)")


@pytest.mark.slow
def test_a_column_must_not_climb_into_a_zone_and_home_may_lie_under_one() -> None:
    lid = Zone("lid", Circle(0.0, 0.0, 50.0), floor=Level(400.0, "amsl"))
    w = world(300.0, [lid])
    m = mission(w, [(0, 0, 60), (2000, 0, 60)])
    assert judged(w, m, vehicle(**BARE), 90.0).safe is True
    assert judged(w, m, vehicle(**BARE), 99.0).unsafe[0].zone == "lid"
    assert judged(w, m, vehicle(**BARE)).highest_rel_home_m == pytest.approx(95.0, abs=0.01)


@pytest.mark.slow
def test_a_wall_without_a_top_leaves_no_altitude_and_rally_points_mend_it() -> None:
    tower = Zone("tower", Circle(1500.0, 0.0, 150.0))
    w = world(300.0, [tower])
    m = mission(w, [(0, 0, 80), (1500, 900, 80), (4000, 0, 80)])
    v = vehicle(**BARE)
    home = judged(w, m, v, 60.0)
    assert home.lowest_rel_home_m is None
    assert home.unsafe
    assert all(s.lowest_rel_home_m is None for s in home.unsafe)
    assert {s.zone for s in home.unsafe} == {"tower"}
    assert "zone_without_top" in codes(within(home.unsafe[0].why))
    assert home.rally
    assert sum(s.to_m - s.from_m for s in home.left) < 0.3 * home.no_return_m
    assert "rally_points_of_ardupilot" in codes(home.notes)
    for item, point in zip(rally_items(home.rally), home.rally, strict=True):
        assert (item.command, item.frame) == (5100, RELATIVE)
        assert item.lat_deg == pytest.approx(point.lat_deg)
        assert item.z == pytest.approx(point.rel_home_m)
        east, north = w.frame.to_plane(item.lat_deg, item.lon_deg)
        assert math.hypot(float(east) - 1500.0, float(north)) > 150.0
    assert judged(w, m, v, 60.0, rally=False).rally == ()


@pytest.mark.slow
def test_rally_points_are_chosen_by_few_parts_of_a_mission_of_many_stretches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each stretch was looked at from each candidate: most of the time that a long mission took."""
    w = world(300.0, [Zone("tower", Circle(1500.0, 0.0, 150.0))])
    v = vehicle(**BARE)
    there = [(7.5 * k, 900.0 * k / 200.0 + 3.0 * (k % 2), 80.0) for k in range(201)]
    back = [(1500.0 + 12.5 * k, 900.0 - 4.5 * k + 3.0 * (k % 2), 80.0) for k in range(1, 201)]
    m = mission(w, [*there, *back])
    looked_at: list[int] = []

    def counted_parts(trace: Any, parts: Any, target: Any, vehicle: Any, *, whole: bool) -> Any:
        looked_at.append(len(parts))
        return obstacles_of_returns(trace, parts, target, vehicle, whole=whole)

    monkeypatch.setattr(rally, "obstacles_of_returns", counted_parts)
    monkeypatch.setattr(rally, "MISSION_PARTS", 60)
    home = judged(w, m, v, 60.0)
    assert home.rally
    assert max(looked_at[: 1 + rally.CANDIDATES]) <= 120
    few = home.left
    monkeypatch.setattr(rally, "MISSION_PARTS", 1000)
    assert (
        together_m((s.from_m, s.to_m) for s in few)
        < 1.2 * together_m((s.from_m, s.to_m) for s in judged(w, m, v, 60.0).left) + 20.0
    )


@pytest.mark.slow
def test_a_mission_that_hugs_a_zone_is_not_called_shut_in() -> None:
    # The shortest track around a tower touches its clearance: returns from behind it are blocked, from before it not.
    turn, reach = math.asin(230.03 / 1500.0), math.sqrt(1500.0**2 - 230.03**2)
    touch = [(0.0, 0.0, 80.0), (reach * math.cos(turn), reach * math.sin(turn), 80.0), (1500.0, 1500.0, 80.0)]
    corner = Zone("tower", Circle(1500.0, 0.0, 200.0))
    w = world(300.0, [corner])
    v = vehicle(min_agl_m=20.0, track_error_m=0.0, altitude_error_m=5.0, horizontal_clearance_m=30.0)
    v = replace(v, corner_accel_m_s2=math.inf)  # turns on the spot
    m = mission(w, touch)
    assert judge(m, v, w).findings == ()
    home = judged(w, m, v, 60.0)
    assert home.unsafe == ()
    assert home.lowest_rel_home_m is not None
    block = np.array([[900.0, -300.0], [1500.0, -300.0], [1500.0, 200.0], [900.0, 200.0]])
    w = world(300.0, [Zone("block", Polygon(block))])
    along = [(0.0, 231.0, 80.0), (2500.0, 231.0, 80.0)]
    m = mission(w, [(0.0, 0.0, 80.0), *along])
    assert judge(m, v, w).findings == ()
    (stretch,) = judged(w, m, v, 60.0, rally=False).unsafe
    # At 231 m north, returns to the origin are blocked if they begin east of the block's western side.
    assert stretch.from_m == pytest.approx(231.0 + 900.0 + 0.0, abs=60.0)


@pytest.mark.slow
def test_each_autopilot_gets_rally_points_at_the_altitude_that_it_understands() -> None:
    def slope(east: Floats, north: Floats) -> Floats:
        return 300.0 + 0.02 * east + 0.0 * north

    w = world(slope, [Zone("tower", Circle(1500.0, 0.0, 150.0))])
    for autopilot in (COPTER, PX4):
        v = vehicle(autopilot, **BARE)
        m = mission(w, [(0, 0, 80), (1500, 900, 120), (4000, 0, 170)], autopilot)
        home = judged(w, m, v, 90.0)
        assert home.rally
        assert home.advised_rel_home_m is not None
        for point in home.rally:
            on_ground = point.ground_amsl_m - home.home[2]
            if autopilot is PX4:  # PX4 returns at RTL_RETURN_ALT above the point
                assert point.rel_home_m == pytest.approx(on_ground, abs=0.01)
            else:  # ArduPilot returns at the point's own altitude, or at RTL_ALT if that is higher
                assert point.rel_home_m >= max(home.advised_rel_home_m, on_ground + 5.0) - 0.01


@pytest.mark.slow
def test_what_rally_points_leave_unsafe_is_what_brute_force_finds() -> None:
    tower = Zone("tower", Circle(1500.0, 0.0, 150.0))
    w = world(300.0, [tower])
    home = judged(w, mission(w, [(0, 0, 80), (1500, 900, 80), (4000, 0, 80)]), vehicle(**BARE), 60.0)
    spots = np.array([(0.0, 0.0), *(w.frame.to_plane(r.lat_deg, r.lon_deg) for r in home.rally)])
    a, b, c = np.array([0.0, 0.0]), np.array([1500.0, 900.0]), np.array([4000.0, 0.0])
    first = math.dist(a, b)
    for along in np.linspace(0.0, first + math.dist(b, c), 400):
        p = a + (b - a) * along / first if along <= first else b + (c - b) * (along - first) / math.dist(b, c)
        target = spots[np.hypot(*(spots - p).T).argmin()]
        t = np.linspace(0.0, 1.0, 400)[:, None]
        met = np.hypot(*(p + t * (target - p) - np.array([1500.0, 0.0])).T).min() < 150.0
        if met:
            assert any(s.from_m <= along <= s.to_m for s in home.left), along


@pytest.mark.slow
def test_within_the_cone_less_is_climbed_and_both_are_judged() -> None:
    # A knob 60 m high, 100 m east of home; returns from 180 m east must pass above it.
    def knob(east: Floats, north: Floats) -> Floats:
        return np.where((np.abs(east - 100.0) < 1.0) & (np.abs(north) < 1.0), 360.0, 300.0)

    w = world(knob)
    low = mission(w, [(0, 0, 30), (0, 300, 30), (180, 0, 30)])
    steep = judged(w, low, vehicle(**BARE), 100.0)
    gentle = judged(w, mission(w, [(0, 0, 30), (0, 300, 30), (180, 0, 30)], PX4), vehicle(PX4, **BARE), 250.0)
    assert steep.unsafe == ()  # the cone, 3 · 180 m high, is above 100 m
    assert gentle.unsafe == ()  # PX4 climbs at least 180 m, above the knob's 60 m
    near = Zone("post", Circle(30.0, 0.0, 5.0), ceiling=Level(50.0, "agl"))
    w = world(300.0, [near])
    m = mission(w, [(0, 0, 20), (0, 200, 20), (45, 0, 20)])
    px4 = mission(w, [(0, 0, 20), (0, 200, 20), (45, 0, 20)], PX4)
    assert judged(w, m, vehicle(**BARE), 100.0).unsafe == ()  # from 45 m away it climbs to 100 m first
    sharp = replace(vehicle(PX4, **BARE), corner_accel_m_s2=math.inf)
    assert [s.zone for s in judged(w, px4, sharp, 100.0).unsafe] == ["post"]  # PX4's 45 m is below the post's 50 m


@pytest.mark.slow
def test_a_plane_climbs_on_its_way_and_may_meet_what_an_altitude_would_clear() -> None:
    w = world(ridge)
    far = [(0.0, 0.0, 150.0), (6000.0, 0.0, 150.0), (6000.0, 0.0, 60.0)]
    near = [(0.0, 0.0, 150.0), (2000.0, 0.0, 150.0), (1330.0, 300.0, 30.0)]
    limits = dict(BARE, track_error_m=10.0)
    assert judged(w, mission(w, far, PLANE, land=False), vehicle(PLANE, **limits), 120.0).unsafe == ()
    close = judged(w, mission(w, near, PLANE, land=False), vehicle(PLANE, **limits), 120.0)
    assert close.unsafe
    assert close.unsafe[-1].lowest_rel_home_m is None  # it cannot climb 75 m within 250 m
    copter = judged(w, mission(w, near, land=False), vehicle(**limits), 120.0)
    assert copter.unsafe == ()


@pytest.mark.slow
def test_a_planes_columns_are_left_out_and_said_so() -> None:
    m = mission(world(), [(0, 0, 120), (3000, 0, 120)], PLANE)
    home = judged(world(), m, vehicle(PLANE, **BARE), 100.0)
    assert home.safe is True
    assert home.lowest_rel_home_m is not None
    assert "return_from_flight" in codes(home.notes)
    v = replace(vehicle(PLANE, **dict(BARE, track_error_m=15.0)), turn_radius_m=60.0)
    bent = judged(world(), mission(world(), [(0, 0, 120), (1500, 0, 120), (1500, 1500, 120)], PLANE), v, 100.0)
    assert bent.unsafe == ()
    assert max(p.to_m for p in bent.profile) < 3000.0  # the corner is cut by an arc


def test_the_circle_over_home_is_judged_for_a_plane() -> None:
    def bump(east: Floats, north: Floats) -> Floats:
        return 300.0 + 90.0 * np.exp(-((east + 100.0) ** 2 + north**2) / 2e3)

    w = world(bump)
    m = mission(w, [(0, 0, 150), (2000, 0, 150)], PLANE, land=False)
    assert judged(w, m, vehicle(PLANE, **BARE), 60.0).safe is False
    assert judged(w, mission(w, [(0, 0, 150), (2000, 0, 150)], land=False), vehicle(**BARE), 60.0).safe is True


def test_the_lowest_height_of_all_returns_is_told() -> None:
    w = world(ridge)
    low, high = (judged(w, mission(w, OVER), vehicle(**BARE), rtl) for rtl in (50.0, 130.0))
    assert low.lowest is not None
    assert high.lowest is not None
    assert low.lowest.agl_m == pytest.approx(-50.0, abs=1.0)  # the ridge is 100 m above home
    assert high.lowest.agl_m == pytest.approx(30.0, abs=1.0)
    told = [row.note.code for home in (low, high) for row in home.rows() if row.about == "lowest"]
    assert told == ["lowest_below_ground", "lowest_on_return"]
    assert high.as_dict()["lowest_agl_m"] == high.lowest.agl_m


@pytest.mark.slow
def test_reasons_of_a_return_are_named_together_and_stretches_cut_where_they_change() -> None:
    # Behind the ridge, on the northern half of the way, the line home meets the tower too.
    tower = Zone("tower", Circle(1600.0, 400.0, 150.0))
    w = world(ridge, [tower])
    home = judged(
        w, mission(w, [(0, 0, 150), (2200, -600, 150), (2200, -600, 40), (2200, 1500, 40)]), vehicle(**BARE), 50.0
    )
    both = [s for s in home.unsafe if s.zone == "tower"]
    ground = [s for s in home.unsafe if not s.zone]
    assert both
    assert ground
    for s in both:
        assert {"and_also", "does_meet_zone", "zone_without_top"} < set(codes(within(s.why)))
        assert {"does_meet_ground", "does_meet_ground_on_climb"} & set(codes(within(s.why)))
        assert s.described().code == "no_altitude_helps"
    for s in ground:
        assert "does_meet_zone" not in codes(within(s.why))
        assert "does_meet_ground" in codes(within(s.why))
        assert s.lowest_rel_home_m == pytest.approx(105.0, abs=3.0)
        assert s.described().code == "altitude_helps"
    told = [row.note for row in home.rows() if row.about == "no_return"]
    assert "does_meet_zone" in codes(within(told[0]))  # the worst first: no altitude helps
    assert [s.from_m for s in home.unsafe] == sorted(s.from_m for s in home.unsafe)


@pytest.mark.slow
def test_where_no_altitude_helps_though_each_obstacle_has_one_it_says_what_is_above() -> None:
    lid = Zone("lid", Circle(1000.0, 0.0, 400.0), floor=Level(402.0, "amsl"))
    w = world(ridge, [lid])
    home = judged(w, mission(w, [(0, 0, 40), (0, 1500, 40), (2000, 1500, 130), (2500, 0, 40)]), vehicle(**BARE), 50.0)
    (worst, *_) = [s for s in worst_first(home.unsafe) if s.lowest_rel_home_m is None]
    words = str(worst.described())
    assert re.search("meets ground at .* and would clear it at 40[0-9] m AMSL; no return", words)
    assert (
        "no return altitude is safe from there: at another altitude it meets no-fly zone “lid” (from 397 m AMSL up)"
        in words
    )


@pytest.mark.slow
def test_over_unknown_ground_no_return_is_safe() -> None:
    def hole(east: Floats, north: Floats) -> Floats:
        return np.where((np.abs(east - 1000.0) < 150.0) & (np.abs(north) < 150.0), np.nan, 300.0)

    w = world(hole)
    home = judged(w, mission(w, [(0, 0, 80), (0, 1500, 80), (2500, 0, 80)]), vehicle(**BARE), 60.0)
    assert home.unsafe
    assert "does_over_unknown_ground" in codes(within(home.unsafe[0].why))
    assert home.lowest_rel_home_m is None


@pytest.mark.slow
def test_max_agl_and_max_amsl_are_limits_but_not_obstacles() -> None:
    def dip(east: Floats, north: Floats) -> Floats:
        return 300.0 - 80.0 * np.exp(-((east - 1000.0) ** 2) / 4e4) + 0.0 * north

    w = world(dip)
    m = mission(w, [(0, 0, 60), (0, 800, 60), (2500, 0, 60)])
    home = judged(w, m, vehicle(**BARE, max_agl_m=120.0), 60.0)
    assert home.safe is True
    assert all("does_above_max_agl" in codes(within(s.why)) for s in home.irregular)
    home = judged(w, m, vehicle(**BARE, max_amsl_m=370.0), 100.0)
    assert home.safe is True
    assert home.lowest_legal_rel_home_m is not None
    assert all("does_above_ceiling" in codes(within(s.why)) for s in home.irregular)


def test_a_low_landing_column_is_told_from_the_flight_above_it() -> None:
    def step(east: Floats, north: Floats) -> Floats:
        return 300.0 + 40.0 * np.clip((np.abs(east - 1500.0) < 300.0) * 1.0, 0, 1) + 0.0 * north

    w = world(step)
    home = judged(w, mission(w, [(0, 0, 100), (2500, 0, 100)]), vehicle(**BARE), 15.0)
    (stretch,) = home.unsafe
    assert (stretch.from_seq, stretch.to_seq) == (4, 4)
    assert stretch.start[2] == pytest.approx(345.0, abs=4.5)
    assert stretch.from_m == stretch.to_m == pytest.approx(2500.0, abs=0.5)


def test_a_mission_that_returns_by_itself_has_its_other_stretches_judged() -> None:
    w = world(ridge)
    m = mission(w, OVER, land=False)
    m = replace(m, items=(*m.items, Item(RTL, 2)))
    home = judged(w, m, vehicle(**BARE), 50.0)
    assert home.safe is False
    assert home.not_judged == ()
    assert home.unsafe[0].to_m == pytest.approx(3000.0, abs=1.0)


def test_what_cannot_be_followed_is_not_called_safe() -> None:
    w = world()
    m = mission(w, [(0, 0, 80), (1000, 0, 80)], land=False)
    home = judged(w, replace(m, items=(*m.items, Item(222, 2))), rtl=60.0)
    assert home.safe is None
    assert home.not_judged
    nothing = judged(w, replace(m, items=()), rtl=60.0)
    assert nothing.safe is None
    assert nothing.as_dict()["lowest_rel_home_m"] is None


@pytest.mark.parametrize(("autopilot", "name"), [(COPTER, "RTL_ALT_M "), (PX4, "RTL_RETURN_ALT ")])
def test_the_altitude_to_set_is_safe_within_all_limits_and_hardly_too_high(autopilot: Autopilot, name: str) -> None:
    w = world(ridge, [Zone("lid", Circle(1000.0, 600.0, 150.0), floor=Level(520.0, "amsl"))])
    m, v = mission(w, OVER, autopilot), vehicle(autopilot, **BARE)
    home = judged(w, m, v, 40.0)
    best, legal = home.set_rel_home_m, home.lowest_legal_rel_home_m
    assert best is not None
    assert legal is not None
    assert legal <= best < legal + 1.0
    assert f"{name}{best:g} (m)" in str(home.advice)
    set_to = judged(w, m, v, best)
    assert (set_to.unsafe, set_to.irregular) == ((), ())
    assert (set_to.set_rel_home_m, set_to.no_return_m) == (best, 0.0)


@pytest.mark.slow
def test_the_headline_tells_path_and_return_and_counts_overlaps_once() -> None:
    w = world(ridge)
    v = vehicle(**BARE)
    home = judged(w, mission(w, OVER), v, 50.0)
    assert str(home.headline) == "path safe; no safe return from 1.0 km of it"
    short = replace(v, energy=replace(v.energy, battery_j=450_000.0))
    low = judged(w, mission(w, OVER), short, 50.0)
    assert low.battery is not None
    [(a, b)] = low.battery.short
    assert low.no_return_m == pytest.approx(max(b, low.unsafe[0].to_m) - min(a, low.unsafe[0].from_m))
    assert (low.headline.code, low.headline.data["short_m"]) == ("no_return_for_battery_from", pytest.approx(b - a))
    assert low.set_leaves_m == pytest.approx(b - a, abs=60.0)  # the climb to a higher return takes energy
    high = judged(w, mission(w, OVER), short, 130.0)
    assert high.headline.code == "no_return_for_battery"
    broken = judged(w, mission(w, OVER), replace(v, limits=replace(v.limits, min_agl_m=45.0)), 50.0)
    assert str(broken.headline).startswith("path UNSAFE; no safe return from ")
    nothing = judged(w, replace(mission(w, OVER), items=()), rtl=60.0)
    assert str(nothing.headline).endswith(", return not judged: the mission could not be followed")
    assert nothing.advice is None


def test_words_know_one_from_many() -> None:
    assert [counted(n, "rally point") for n in (1, 2)] == ["1 rally point", "2 rally points"]
    assert [counted(n, "stretch", "stretches") for n in (1, 2)] == ["1 stretch", "2 stretches"]
    assert [Reach(m).text(None) for m in (0.4, 340.2, 999.4, 999.6, 9480.0)] == [
        "0 m",
        "340 m",
        "999 m",
        "1.0 km",
        "9.5 km",
    ]


@pytest.mark.slow
def test_figures_are_plain_values_and_words() -> None:
    w = world(ridge, [Zone("shelf", Circle(1000.0, 0.0, 200.0), floor=Level(520.0, "amsl"))])
    v = vehicle(**BARE)
    v = replace(v, energy=replace(v.energy, battery_j=450_000.0))
    home = judged(w, mission(w, OVER), v, 50.0)
    told = json.loads(json.dumps(home.as_dict(profile=True), allow_nan=False))
    assert told["unsafe"][0]["why"] in home.describe()
    assert told["highest_rel_home_m"] == pytest.approx(215.0, abs=0.01)
    assert len(told["profile"]) == len(home.profile) > 20
    along = [p.from_m for p in home.profile]
    assert along == sorted(along)
    assert max(p.to_m for p in home.profile) == pytest.approx(3000.0, abs=1.0)
    assert max(p.clear_amsl_m or 0.0 for p in home.profile) == pytest.approx(405.0, abs=0.6)


# -- brute force ----------------------------------------------------------------------------------------------------


@pytest.mark.nightly_but("px4-seeds1")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("autopilot", "seeds"), [(COPTER, (5002, 5119, 6077, 4000, 4002)), (PX4, (4003, 4007, 4011)), (PLANE, (4000, 4001))]
)
def test_never_kinder_than_brute_force_in_rough_random_worlds(autopilot: Autopilot, seeds: Sequence[int]) -> None:
    worlds = unsafe = strict = looked = 0
    for seed in seeds:
        case = random_case(np.random.default_rng(seed), autopilot)
        if case is None:
            continue
        worlds += 1
        stored = replace(case.mission, items=tuple(profile_of(autopilot).stored(i) for i in case.mission.items))
        flight = follow(stored, case.vehicle, case.world.ground_amsl, rtl_rel_home_m=case.level_rel_home_m)
        trace = trace_of(flight, case.vehicle, case.world, 30.0)
        assert trace is not None
        east, north, ground = case.corners[0].tolist()
        target, level = Target(east, north, ground, ground), ground + case.level_rel_home_m
        refinement = refinement_of(trace, target, case.vehicle, level)
        bad = [refinement.bad(grade, level) for grade in (CLEAR, LEGAL)]
        lowest = [refinement.strict[grade].together(refinement.start) for grade in (CLEAR, LEGAL)]
        first_leg = int(autopilot is PLANE)  # a plane's columns are not judged
        for i in range(trace.mains):
            for f in np.linspace(0.0, 1.0, 4):
                u = trace.first[i] + f * (trace.last[i] - trace.first[i])
                at, to = case.corners[i + first_leg : i + first_leg + 2]
                at = at + f * (to - at)
                after = case.corners[i + first_leg + 2 : i + first_leg + 3]
                on = run_on(case, at, to, after[0] if len(after) else None)
                assert trace.points(np.array([u]))[0, :3] == pytest.approx(at, abs=1e-3)
                part = (refinement.parts.start <= u + 1e-12) & (refinement.parts.end >= u - 1e-12)
                for grade in (CLEAR, LEGAL):
                    found = breach(case, at, legal=grade == LEGAL, on=on)
                    assert not found or bad[grade][part].any(), (seed, i, f, grade, found)
                    looked, unsafe = looked + 1, unsafe + bool(found)
                    strict += not found and bool(bad[grade][part].all())
                for grade, least in enumerate(lowest):
                    if math.isfinite(least):
                        higher = replace(case, level_rel_home_m=least - ground)
                        found = breach(higher, at, legal=grade == LEGAL, on=on)
                        assert not found, (seed, "lowest", i, f, grade, found)
    assert worlds >= 2
    assert 0.1 < unsafe / looked < 0.9
    assert strict <= 0.2 * looked  # on ground as rough as this, the bounds beside a line are that pessimistic


@pytest.mark.slow
def test_on_smooth_ground_the_lowest_altitude_is_hardly_higher_than_it_must_be() -> None:
    rng = np.random.default_rng(5)
    for _ in range(4):
        knobs = [(rng.uniform(-2e3, 2e3, 2), rng.uniform(30, 150), rng.uniform(300, 700)) for _ in range(8)]

        def hills(east: Floats, north: Floats, knobs: list[tuple[Floats, float, float]] = knobs) -> Floats:
            rise = np.zeros_like(east)
            for (e, n), top, wide in knobs:
                rise = rise + top * np.exp(-((east - e) ** 2 + (north - n) ** 2) / (2.0 * wide**2))
            return 300.0 + rise

        w = world(hills, half_m=4_000.0)
        corners = np.vstack([[0.0, 0.0], rng.uniform(-2500, 2500, (3, 2))])
        along = [a + np.linspace(0.0, 1.0, 60)[:, None] * (b - a) for a, b in pairwise(corners)]
        over = hills(*np.vstack(along).T) - w.ground_amsl(36.6, -84.3) + 45.0  # the mission follows the ground
        places = [(float(e), float(n), float(up)) for (e, n), up in zip(np.vstack(along), over, strict=True)]
        v = vehicle(min_agl_m=20.0, track_error_m=3.0, altitude_error_m=5.0)
        v = replace(v, accel_m_s2=math.inf)  # it stops at once: nothing ahead counts
        lowest = judged(w, mission(w, places), v).lowest_rel_home_m
        assert lowest is not None
        surface, home = w.airspace.surface, w.ground_amsl(36.6, -84.3)
        needed = 0.0
        for east, north, up in places:  # from above the hills on its way it returns as high as it is
            line = np.array([east, north]) * np.linspace(0.0, 1.0, 400)[:, None]
            top = float(surface.ground_at(line[:, 0], line[:, 1]).max()) + 5.0 - home
            needed = max(needed, top) if top > up else needed
        assert needed - 0.1 <= lowest <= needed + 3.0


def test_the_lowest_level_goes_up_from_top_to_top() -> None:
    back = np.array([0, 0, 0, 1, 2, 2], dtype=np.intp)
    obstacles = Obstacles(
        np.array([10.0, 10.0, 10.0]), back,
        np.array([-np.inf, 15.0, 60.0, -np.inf, -np.inf, 25.0]), np.array([20.0, 40.0, np.inf, 50.0, 30.0, np.inf]),
        np.array([10.0] * 6), np.array([np.inf, np.inf, np.inf, np.inf, np.inf, np.inf]),
        np.array([-1, 0, 1, -1, -1, 2], dtype=np.intp),
    )  # fmt: skip
    each = obstacles.lowest(0.0)
    assert each.tolist() == [40.0, 50.0, math.inf]  # just above ground it is in the zone; the third is capped at 25
    assert obstacles.together(0.0) == math.inf
    two = np.array([True, True, False])
    assert obstacles.together(0.0, two) == 50.0
    kept = obstacles.take(two)
    assert kept.together(0.0) == 50.0
    assert kept.highest(50.0) == 60.0
    assert kept.passes(50.0).all()
    assert not kept.passes(60.1).any() or kept.passes(60.1).tolist() == [False, True]
    assert rel_home(kept, 50.0, 3.0) == 47.0
    swapped = kept.ordered(np.array([1, 0]))
    assert swapped.lowest(0.0).tolist() == [50.0, 40.0]


def test_a_return_from_the_middle_is_never_judged_more_strictly_than_the_whole() -> None:
    w = world(ridge, [Zone("p", Polygon(np.array([[500.0, 50], [700, 50], [600, 300]])), ceiling=Level(60.0, "agl"))])
    v = replace(vehicle(**BARE), limits=Limits(20.0, 150.0, 480.0, 30.0, 3.0, 5.0))
    m = mission(w, OVER)
    trace = trace_of(follow(m, v, w.ground_amsl, rtl_rel_home_m=50.0), v, w, 30.0)
    assert trace is not None
    parts = trace.cut(50.0)
    target = Target(0.0, 0.0, 300.0, 300.0)
    whole, middle = (obstacles_of_returns(trace, parts, target, v, whole=x) for x in (True, False))
    for grade in (CLEAR, LEGAL):
        assert (middle[grade].lowest(300.0) <= whole[grade].lowest(300.0) + 1e-6).all()
        for level in (320.0, 380.0, 430.0):
            assert (middle[grade].passes(level) >= whole[grade].passes(level)).all()


@pytest.mark.parametrize("command", [188, 189])
def test_a_planes_return_that_leads_on_to_a_landing_sequence_is_not_called_safe(command: int) -> None:
    w = world()
    m = mission(w, [(0, 0, 120), (3000, 0, 120)], PLANE)
    m = replace(m, items=(*m.items[:2], Item(command, 2), *m.items[2:]))
    home = judged(w, m, vehicle(PLANE, **BARE), 100.0)
    assert home.unsafe == ()
    assert home.safe is None
    assert "return_leads_on" in codes(home.not_judged)
    copter = mission(w, [(0, 0, 120), (3000, 0, 120)])
    copter = replace(copter, items=(*copter.items[:2], Item(command, 2), *copter.items[2:]))
    assert judged(w, copter, vehicle(**BARE), 100.0).safe is True  # its RTL does not look for one
