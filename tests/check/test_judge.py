"""The verdict on a mission: limits, errors, frames, battery, and what cannot be judged."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.check.judge import judge
from gcsplan.check.verdict import Verdict
from gcsplan.mavlink.build.multirotor import build_mission
from gcsplan.mavlink.build.order import Order
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Mission, MissionItem
from gcsplan.vehicle import Autopilot, Energy, Vehicle
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Zone
from gcsplan.world.world import World
from tests.support.noted import coded
from tests.support.worlds import vehicle, world

HOME_DEG = (36.6, -84.3)


def mission_over(
    where: World, points: list[list[float]], craft: Vehicle | None = None, **order: object
) -> tuple[Mission, Vehicle]:
    craft = craft or vehicle()
    made = build_mission(Path(np.array(points)), where, craft, HOME_DEG, Order(**order))  # type: ignore[arg-type]
    if craft.autopilot is Autopilot.ARDUPLANE:  # a VTOL's
        upright = {cmd.TAKEOFF: cmd.VTOL_TAKEOFF, cmd.LAND: cmd.VTOL_LAND}
        made = replace(made, items=tuple(replace(i, command=upright.get(i.command, i.command)) for i in made.items))
    return made, craft


def ideal() -> Vehicle:
    """A vehicle that changes its speed at once, so that times are lengths over speeds."""
    at_once = dict.fromkeys(("accel_m_s2", "corner_accel_m_s2", "vertical_accel_m_s2", "land_m_s"), math.inf)
    return replace(vehicle(), **at_once)


def verdict_of(where: World, points: list[list[float]], craft: Vehicle | None = None, **order: object) -> Verdict:
    mission, craft = mission_over(where, points, craft, **order)
    return judge(mission, craft, where)


HIGH_ENOUGH = [[0.0, 0, 366], [3000, 0, 366], [6000, 1000, 366]]


def test_a_mission_above_every_limit_is_safe_and_its_figures_add_up() -> None:
    verdict = verdict_of(world(), HIGH_ENOUGH)
    assert verdict.safe is True
    assert verdict.length_m == pytest.approx(3000 + math.hypot(3000, 1000), rel=1e-5)
    assert verdict.lowest is not None
    assert verdict.lowest.min_agl_m == pytest.approx(66.0, abs=0.01)
    up_and_down = 120 * (66 + 66)
    assert verdict.energy_j == pytest.approx(up_and_down + 100 * verdict.length_m, rel=1e-5)
    at_once = verdict_of(world(), HIGH_ENOUGH, ideal())
    flight_s = verdict.length_m / 15 + 66 / 2.5 + 66 / 1.5
    assert at_once.time_s == pytest.approx(flight_s, rel=1e-5)
    assert at_once.arrive_s == pytest.approx(flight_s - 66 / 1.5, rel=1e-5)


def test_a_vehicle_that_flies_arcs_is_not_safe_for_its_straight_legs_alone() -> None:
    verdict = verdict_of(world(), HIGH_ENOUGH, replace(vehicle(), turn_radius_m=80.0))
    assert verdict.safe is None
    assert verdict.findings == ()
    assert coded(verdict.not_judged, "arcs_unread").data["radius_m"] == 80.0


def test_the_altitude_error_is_taken_off() -> None:
    verdict = verdict_of(world(), [[0.0, 0, 366], [3000, 0, 364.9], [6000, 1000, 366]])
    assert {f.kind for f in verdict.findings} == {"min_agl"}
    assert verdict.findings[0].by == pytest.approx(0.1, abs=0.02)


def test_a_hill_between_two_safe_way_points_is_found() -> None:
    hill = world(lambda e, n: 300 + 120 * np.exp(-((e - 1500) ** 2 + n**2) / 1e5))
    verdict = verdict_of(hill, [[0.0, 0, 366], [3000, 0, 366]])
    finding = verdict.findings[0]
    assert finding.kind == "min_agl"
    assert finding.seq == 3
    east, _ = hill.frame.to_plane(finding.lat_deg, finding.lon_deg)
    assert abs(east - 1500) < 120


def test_a_zone_its_clearance_and_its_name_are_in_the_finding() -> None:
    mast = Zone("mast", Circle(1500, 100, 60), None, Level(100, "agl"))
    craft = vehicle(horizontal_clearance_m=30)
    verdict = verdict_of(world(zones=[mast]), [[0.0, 0, 366], [3000, 0, 366]], craft)
    assert verdict.safe is True  # 40 m from its edge; 30 m and 3 m are required
    verdict = verdict_of(world(zones=[mast]), [[0.0, 10, 366], [3000, 10, 366]], craft)
    assert {f.zone for f in verdict.findings} == {"mast"}
    assert "mast" in verdict.findings[0].message
    over = verdict_of(world(zones=[mast]), [[0.0, 10, 406], [3000, 10, 406]], craft)
    assert over.safe is True


def test_take_off_columns_are_exempt_from_min_agl_and_not_from_zones() -> None:
    hat = Zone("hat", Circle(0, 0, 50), Level(20, "agl"), Level(40, "agl"))
    verdict = verdict_of(world(zones=[hat]), HIGH_ENOUGH)
    assert {(f.kind, f.seq) for f in verdict.findings} == {("zone", 1)}


def test_climb_is_held_to_the_airframe() -> None:
    steep = [[0.0, 0, 366], [1000, 0, 500], [3000, 0, 500]]
    assert verdict_of(world(), steep, vehicle(max_climb_deg=8)).safe is True
    verdict = verdict_of(world(), steep, vehicle(max_climb_deg=7))
    assert {f.kind for f in verdict.findings} == {"climb"}


def test_leaving_the_terrain_model_is_a_violation() -> None:
    small = world(half_m=2000)
    assert "coverage" in {f.kind for f in verdict_of(small, [[0.0, 0, 366], [3000, 0, 366]]).findings}


def test_what_ardupilot_stores_is_judged_not_what_was_meant() -> None:
    mission, craft = mission_over(world(), HIGH_ENOUGH)
    # 65.008 m is stored as 65.00 m, which is legal if 65 m are required; 64.9999 m is stored as 64.99 m: not legal.
    flat = replace(craft, limits=replace(craft.limits, track_error_m=0.0))

    def flying_at(z: float) -> Verdict:
        items = [replace(i, z=z) if i.command in (cmd.WAYPOINT, cmd.TAKEOFF) else i for i in mission.items]
        return judge(replace(mission, items=tuple(items)), flat, world())

    assert flying_at(65.008).safe is True
    assert flying_at(64.9999).safe is False


def test_the_battery_less_its_reserve_is_a_limit() -> None:
    craft = replace(vehicle(), energy=Energy(120, 100, battery_j=700_000, reserve=0.2))
    verdict = verdict_of(world(), HIGH_ENOUGH, craft)
    assert [f.kind for f in verdict.findings] == ["battery"]
    assert verdict.battery_used_percent == pytest.approx(100 * verdict.energy_j / 700_000)
    enough = replace(vehicle(), energy=Energy(120, 100, battery_j=900_000, reserve=0.2))
    assert verdict_of(world(), HIGH_ENOUGH, enough).safe is True


def test_a_return_home_over_a_hill_is_judged_and_its_energy_counted() -> None:
    hill = world(lambda e, n: 300 + 120 * np.exp(-((e - 1500) ** 2 + n**2) / 1e5))
    around = [[0.0, 0, 366], [1500, 3000, 366], [3000, 0, 366]]
    mission, craft = mission_over(hill, around, end="rtl")
    low = judge(mission, craft, hill, rtl_rel_home_m=100)
    assert {(f.kind, f.seq) for f in low.findings} == {("min_agl", mission.first_seq + len(mission.items) - 1)}
    high = judge(mission, craft, hill, rtl_rel_home_m=200)
    assert high.safe is True
    assert high.energy_j > high.path_energy_j + 100 * 2990
    unknown = judge(mission, craft, hill)
    assert unknown.safe is None


@pytest.mark.slow
def test_terrain_following_is_judged_as_interpolated_with_the_terrain_error() -> None:
    hill = world(lambda e, n: 300 + 200 * np.exp(-((e - 1500) ** 2 + n**2) / 4e5))
    points = [[0.0, 0, 400], [3000, 0, 400]]
    relative = verdict_of(hill, points)
    assert relative.safe is False
    follow = verdict_of(hill, points, altitude_frame="terrain")
    assert follow.safe is True, follow.describe()
    assert follow.lowest is not None
    assert follow.lowest.min_agl_m == pytest.approx(99, abs=2)
    steep = verdict_of(hill, points, vehicle(max_climb_deg=10), altitude_frame="terrain")
    assert "climb" in {f.kind for f in steep.findings}
    low = verdict_of(hill, [[0.0, 0, 390], [3000, 0, 390]], altitude_frame="terrain")
    assert "min_agl" in {f.kind for f in low.findings}  # 90 m less 30 m and 5 m is below 60 m


def test_a_mission_longer_than_the_autopilot_takes_is_a_violation() -> None:
    mission, craft = mission_over(world(), HIGH_ENOUGH)
    long = replace(mission, items=mission.items[:-1] + (mission.items[-2],) * 700)
    assert "too_many_items" in {f.kind for f in judge(long, craft, world()).findings}


def test_an_empty_mission_is_not_judged() -> None:
    mission, craft = mission_over(world(), HIGH_ENOUGH)
    assert judge(replace(mission, items=()), craft, world()).safe is None


def test_a_jump_back_is_judged_and_each_of_its_rounds_counts() -> None:
    points = [[0.0, 0, 366], [900, 0, 366], [900, 800, 366], [1800, 800, 366]]
    mission, craft = mission_over(world(), points, ideal())
    once = judge(mission, craft, world())

    def with_jump(rounds: int) -> Verdict:
        jump = MissionItem(cmd.DO_JUMP, m.NO_POSITION, (3, rounds, 0, 0))
        items = (*mission.items[:4], jump, *mission.items[4:])
        return judge(replace(mission, items=items), craft, world())

    for rounds in (0, 1, 2, 30):
        verdict = with_jump(rounds)
        assert verdict.safe is True, verdict.describe()
        assert verdict.length_m == pytest.approx(once.length_m + rounds * 1600.0, rel=1e-5)
        assert verdict.time_s == pytest.approx(once.time_s + rounds * 1600.0 / 15.0, rel=1e-5)
        assert verdict.energy_j == pytest.approx(once.energy_j + rounds * 1600.0 * 100.0, rel=1e-5)
    assert max(leg.times for leg in with_jump(30).legs) > 20  # equal rounds are judged once


@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_every_autopilot_is_judged(autopilot: Autopilot) -> None:
    verdict = verdict_of(world(), HIGH_ENOUGH, vehicle(autopilot))
    assert verdict.safe is True, verdict.describe()


def test_what_arduplane_may_fly_at_once_is_judged_too() -> None:
    # From 74 to 66 m: legal along the leg, but if it descends at once it is too low over the mound at the start.
    mound = world(lambda e, n: 300 + 6 * np.exp(-((e - 500) ** 2 + n**2) / 4e4))
    points = [[0.0, 0, 374], [3000, 0, 366]]
    verdict = verdict_of(mound, points, vehicle(Autopilot.ARDUPLANE), end="loiter")
    assert "min_agl" in {f.kind for f in verdict.findings}
    assert verdict_of(mound, points, vehicle(), end="loiter").safe is True


@pytest.mark.parametrize(
    ("lat_e7", "lon_e7", "z"),
    [
        (-366_000_000, 957_000_000, 80), (0, 57_000_000, 80), (900_000_000, 0, 80), (366_000_000, -700_000_000, 80),
        (2_000_000_000, 1, 80), (366_000_000, -843_000_000, 1e30), (366_000_000, -843_000_000, math.inf),
    ],
)  # fmt: skip
@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_a_way_point_beyond_all_reason_is_a_finding_and_not_a_crash(
    autopilot: Autopilot, lat_e7: int, lon_e7: int, z: float
) -> None:
    mission, craft = mission_over(world(), HIGH_ENOUGH, vehicle(autopilot))
    items = list(mission.items)
    items[2] = replace(items[2], x=lat_e7, y=lon_e7, z=z)
    verdict = judge(replace(mission, items=tuple(items)), craft, world())
    assert verdict.safe is not True
    if math.isfinite(z):
        assert "coverage" in {f.kind for f in verdict.findings}


@pytest.mark.slow
def test_terrain_following_is_as_steep_as_its_steepest_metre_not_as_a_chord() -> None:
    # In a twisted cell the ground under a diagonal is a parabola: equally high at both edges, and steep there.
    twisted = world(lambda e, n: 300 + np.where((np.abs(e) < 60) & (np.abs(n) < 60) & (e != n), 30.0, 0.0))
    points = [[-300.0, -280, 450], [300.0, 320, 450]]
    surface = twisted.airspace.surface
    t = np.linspace(0, 1, 20_001)
    ground = surface.ground_at(-300 + 600 * t, -280 + 600 * t)
    steepest = math.degrees(np.arctan(np.abs(np.diff(ground)).max() / (math.hypot(600, 600) / 20_000)))

    def verdict(max_climb_deg: float) -> Verdict:
        craft = vehicle(max_climb_deg=max_climb_deg, max_descent_deg=max_climb_deg)
        return verdict_of(twisted, points, craft, altitude_frame="terrain")

    assert {f.kind for f in verdict(steepest - 0.2).findings} >= {"climb"}
    assert verdict(steepest + 0.2).safe is True


@pytest.mark.slow
@pytest.mark.parametrize("frame", ["relative", "terrain"])
def test_who_moves_by_what_a_violation_tells_keeps_the_limit(frame: str) -> None:
    rng = np.random.default_rng(17)
    for _ in range(12):
        rough = rng.uniform(0.0, 60.0, (81, 81))
        ground = Surface(
            300.0 + rough, 300.0 + rough + rng.uniform(0.0, 8.0, rough.shape), GridMap.affine(-2000, 2000, 50, 50)
        )
        where = World(Frame(36.6, -84.3), Airspace(ground))
        craft = vehicle(horizontal_clearance_m=20.0, max_agl_m=None, track_error_m=float(rng.uniform(2.0, 40.0)))
        points = np.column_stack([rng.uniform(-1500, 1500, (4, 2)), rng.uniform(395, 440, 4)]).tolist()
        mission, craft = mission_over(where, points, craft, altitude_frame=frame)
        worst = [f for f in judge(mission, craft, where).findings if f.kind in ("min_agl", "terrain_clearance")]
        assert worst
        by = max(f.by for f in worst)
        assert all(f.by == round(f.by, 2) and f"by {f.by:.2f} m" in f.message for f in worst)

        def raised(m_: float, mission: Mission = mission) -> Mission:
            up = [replace(i, z=i.z + m_) if i.command in (cmd.WAYPOINT, cmd.TAKEOFF) else i for i in mission.items]
            return replace(mission, items=tuple(up))

        # Storage truncates to centimetres.
        left = {f.kind for f in judge(raised(by + 0.01), craft, where).findings}
        assert not left & {"min_agl", "terrain_clearance"}, left
        less = {f.kind for f in judge(raised(0.98 * by - 0.1), craft, where).findings}
        assert less & {"min_agl", "terrain_clearance"}  # and the reported lift is not much too large


@pytest.mark.slow
def test_terrain_following_over_small_cells_is_judged_in_a_fraction_of_a_second() -> None:
    rng = np.random.default_rng(3)
    n = 1801
    z = 300.0 + 60.0 * np.sin(np.arange(n) / 70.0) * np.cos(np.arange(n) / 90.0)[:, None] + rng.normal(0.0, 1.0, (n, n))
    where = World(Frame(36.6, -84.3), Airspace(Surface(z, z, GridMap.affine(-9000.0, 9000.0, 10.0, 10.0))))
    points = [[float(x), float(rng.uniform(-3000, 3000)), 480.0] for x in np.linspace(-7500, 7500, 9)]
    mission, craft = mission_over(where, points, vehicle(horizontal_clearance_m=0.0), altitude_frame="terrain")
    judge(mission, craft, where)
    begun = time.process_time()
    verdict = judge(mission, craft, where)
    assert time.process_time() - begun < 1.0  # 0.1 s when idle; 2 to 3 s when slopes were found by bisection
    assert verdict.length_m > 16_000
