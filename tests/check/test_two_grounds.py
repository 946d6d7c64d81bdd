"""Ground of which the files give two heights: each limit counts the unfavourable one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.check.fixed_wing.ends import slant_shortage
from gcsplan.check.judge import judge
from gcsplan.check.returns.way_home import way_home
from gcsplan.mavlink.build.multirotor import build_mission
from gcsplan.mavlink.build.order import Order
from gcsplan.mavlink.mission.mission import Mission
from gcsplan.vehicle import Vehicle
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Zone
from gcsplan.world.world import World
from tests.support.noted import coded
from tests.support.worlds import vehicle

HOME_DEG = (36.6, -84.3)
GRID = GridMap.affine(-6000.0, 6000.0, 100.0, 100.0)


def world_of(low: Floats, high: Floats, zones: tuple[Zone, ...] = (), obstacle_m: float = 0.0) -> World:
    top = high + obstacle_m if obstacle_m else high
    return World(Frame(*HOME_DEG), Airspace(Surface(low, top, GRID, high_m=high), zones))


def seam(from_m: float, by_m: float) -> tuple[Floats, Floats]:
    """Ground at 300 m; beyond an easting a second file says that it is ``by_m`` higher."""
    low = np.full((121, 121), 300.0)
    high = low.copy()
    high[:, np.linspace(-6000.0, 6000.0, 121) >= from_m] += by_m
    return low, high


def flown(where: World, amsl_m: float, craft: Vehicle, **order: object) -> Mission:
    points = np.array([[0.0, 0.0, amsl_m], [1500.0, 0.0, amsl_m], [3000.0, 0.0, amsl_m]])
    return build_mission(Path(points), where, craft, HOME_DEG, Order(**order))  # type: ignore[arg-type]


def test_the_lower_limit_counts_the_greatest_ground_and_the_upper_one_the_least() -> None:
    low, high = seam(1000.0, 60.0)
    one, both = world_of(high, high), world_of(low, high)
    for agl_m, kinds in ((66.0, {"min_agl"}), (130.0, set())):
        mission = flown(world_of(low, low), 300.0 + agl_m, vehicle())
        assert {f.kind for f in judge(mission, vehicle(), both).findings} == kinds
    upper = vehicle(max_agl_m=150.0)
    mission = flown(world_of(low, low), 300.0 + 150.0, upper)
    assert judge(mission, upper, one).findings != ()  # low before the seam
    assert {f.kind for f in judge(flown(both, 444.0, upper), upper, both).findings} == set()
    assert {f.kind for f in judge(flown(both, 448.0, upper), upper, both).findings} == {"max_agl"}


def test_home_without_one_height_is_not_judged_and_says_what_would_be() -> None:
    low, high = seam(-1000.0, 60.0)
    both, craft = world_of(low, high), vehicle()
    mission = flown(world_of(high, high), 440.0, craft)
    verdict = judge(mission, craft, both)
    assert verdict.safe is None
    assert not verdict.findings
    data = coded(verdict.not_judged, "home_has_two_heights").data
    assert (data["low_m"], data["high_m"], data["spread_m"]) == (300.0, 360.0, 60.0)
    assert way_home(verdict, craft, both).safe is None
    wide = vehicle(altitude_error_m=60.0)
    assert judge(flown(both, 300.0 + 60.0 + 60.0 + 60.0 + 60.0, wide), wide, both).safe is True


def test_an_uncertain_home_widens_the_error_of_all_altitudes() -> None:
    low, high = seam(-6000.0, 0.0)
    high[55:66, 55:66] += 4.0  # around home alone
    both, craft = world_of(low, high), vehicle(max_agl_m=200.0)
    assert judge(flown(both, 300.0 + 73.5, craft), craft, both).safe is True  # 60 + 5 + 4 + 4
    assert judge(flown(both, 300.0 + 72.5, craft), craft, both).safe is False
    assert judge(flown(both, 300.0 + 190.5, craft), craft, both).safe is True  # 200 - 5 - 4
    assert judge(flown(both, 300.0 + 191.5, craft), craft, both).safe is False


@pytest.mark.slow
def test_a_vehicle_that_reads_its_own_terrain_may_fly_lower_by_what_files_differ() -> None:
    low, high = seam(1000.0, 30.0)
    both, craft = world_of(low, high), vehicle()
    mission = flown(both, 500.0, craft, altitude_frame="terrain")
    told = [judge(mission, craft, w, terrain_error_m=0.0) for w in (world_of(high, high), both)]
    assert [v.safe for v in told] == [True, True]
    points = np.array([[0.0, 0.0, 367.0], [1500.0, 0.0, 397.0], [3000.0, 0.0, 397.0]])
    mission = build_mission(Path(points), both, craft, HOME_DEG, Order(altitude_frame="terrain"))
    assert judge(mission, craft, world_of(high, high), terrain_error_m=0.0).safe is True
    verdict = judge(mission, craft, both, terrain_error_m=0.0)
    assert max(f.by for f in verdict.findings if f.kind == "min_agl") == pytest.approx(28.0, abs=1.1)


@pytest.mark.parametrize("seed", range(12))
def test_what_is_clear_over_both_heights_is_clear_over_any_ground_between(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = 300.0 + 40.0 * rng.random((121, 121))
    high = low + np.where(rng.random((121, 121)) < 0.3, rng.uniform(0.0, 60.0, (121, 121)), 0.0)

    def level() -> Level | None:
        return None if rng.random() < 0.2 else Level(float(rng.uniform(0.0, 150.0)), "agl")

    zones = []
    for k in range(6):
        floor, ceiling = level(), level()
        if floor is not None and ceiling is not None and floor.value_m > ceiling.value_m:
            floor, ceiling = ceiling, floor
        zones.append(Zone(f"z{k}", Circle(*rng.uniform(-4000, 4000, 2), 900.0), floor, ceiling))
    start = np.column_stack([rng.uniform(-4500, 4500, (400, 2)), rng.uniform(380, 560, 400)])
    end = start + np.column_stack([rng.uniform(-900, 900, (400, 2)), rng.uniform(-15, 15, 400)])
    limits = Limits(min_agl_m=40.0, max_agl_m=170.0, horizontal_clearance_m=10.0)
    legs = Legs.between(start, end, limits)
    both = world_of(low, high, tuple(zones)).airspace.clear(legs, limits)
    assert 10 < both.sum() < 390
    for share in (0.0, 1.0, rng.random(low.shape)):
        true = low + share * (high - low)
        assert not (both & ~Airspace(Surface(true, true, GRID), zones).clear(legs, limits)).any()


def test_ground_of_one_height_takes_no_second_array() -> None:
    ground = np.full((121, 121), 300.0)
    surface = Surface(ground, ground, GRID)
    assert surface.high_m is surface.ground_m is surface.top_m
    assert not surface.differs
    zone = Zone("z", Circle(0.0, 0.0, 500.0), None, Level(100.0, "agl"))
    assert Airspace(surface, (zone,)).zones == (zone,)


def test_beyond_the_strip_a_climb_out_counts_what_stands_on_the_ground() -> None:
    ground = np.full((121, 121), 300.0)
    limits = replace(vehicle().limits, altitude_error_m=8.0)
    line = np.array([[0.0, 0.0, 300.0], [1000.0, 0.0, 400.0]])
    trees = ground.copy()
    trees[:, 63:65] += 55.0  # 300 m ahead and beyond, where the aircraft is 30 m high
    for top, short in ((ground, None), (trees, 33.0)):
        air = Airspace(Surface(ground, top, GRID))
        found = slant_shortage(line, line[0], 0.0, limits, air)
        assert (found is None) == (short is None)
        if short is not None and found is not None:
            assert found[3] == pytest.approx(short, abs=1.0)
    strip = ground.copy()
    strip[:, 60:61] += 3.0  # beside home: the landing strip is as it is
    assert slant_shortage(line, line[0], 0.0, limits, Airspace(Surface(ground, strip, GRID))) is None
    assert math.isfinite(float(line.max()))
