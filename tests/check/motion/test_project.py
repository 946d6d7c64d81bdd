"""Missions in the terrain frame: judged over the ground that the vehicle reads, which is not the ground there is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.app.plan.replanning import MOST_SLOPE, larger
from gcsplan.check.judge import judge
from gcsplan.check.motion.project import follow_ground
from gcsplan.mavlink.build.multirotor import build_mission
from gcsplan.mavlink.build.order import MARGINS, Order
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission import mission as m
from gcsplan.mavlink.mission.mission import Home, Mission, MissionItem
from gcsplan.notes.note import Finding, Note
from gcsplan.vehicle import Autopilot
from gcsplan.world.airspace import Airspace
from gcsplan.world.geodesy.frame import Frame
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.terrain.grid import TerrainGrid
from gcsplan.world.world import World
from tests.oracles import terrain_grid as oracle
from tests.support.noted import coded
from tests.support.worlds import Height, vehicle


def fine_world(height: Height, *, at: tuple[float, float] = (36.6, -84.3), half_m: float = 2600.0) -> World:
    """A world with a node every 10 m, much finer than the vehicle's posts."""
    axis = np.arange(-half_m, half_m + 1.0, 10.0)
    east, north = np.meshgrid(axis, axis[::-1])
    z = height(east, north)
    return World(Frame(*at), Airspace(Surface(z, z, GridMap.affine(-half_m, half_m, 10.0, 10.0))))


def flown(where: World, agl_m: float, *points: tuple[float, float]) -> Mission:
    """Take-off at the first point, then way points at that height above the vehicle's terrain."""
    places = [where.frame.to_degrees(e, n) for e, n in points]
    e7 = [(round(float(a) * 1e7), round(float(o) * 1e7)) for a, o in places]
    ground = where.ground_amsl(*(x / 1e7 for x in e7[0]))
    items = [MissionItem(cmd.TAKEOFF, m.RELATIVE, x=e7[0][0], y=e7[0][1], z=agl_m)]
    items += [MissionItem(cmd.WAYPOINT, m.TERRAIN, x=a, y=o, z=agl_m) for a, o in e7[1:]]
    return Mission(Autopilot.ARDUCOPTER, Home.at(e7[0][0] / 1e7, e7[0][1] / 1e7, ground), tuple(items), "uav1", 1)


def post_east_m(where: World, near_east_m: float, north_m: float) -> float:
    """East of the post that is nearest to a point, m."""
    lat, lon = where.frame.to_degrees(near_east_m, north_m) * 1e7
    grid = TerrainGrid()
    [block] = grid.blocks_over(lat, lon)
    north, east = (round(float(x) / 100.0) for x in grid.offset_m(block.cell, lat, lon))
    post = grid.post_e7(block.cell, north, east)
    return float(where.frame.to_plane(post[0] / 1e7, post[1] / 1e7)[0])


def test_a_ridge_between_the_posts_is_there_although_the_vehicle_does_not_know_it() -> None:
    flat = fine_world(lambda e, n: 300.0 + 0 * e)
    middle = post_east_m(flat, 1000.0, 0.0) + 50.0
    ridge = fine_world(lambda e, n: 300.0 + np.maximum(0.0, 60.0 - 2.0 * np.abs(e - middle)))
    craft = vehicle(horizontal_clearance_m=0.0, min_agl_m=60.0)
    way = ((-2000.0, 0.0), (2000.0, 0.0))
    safe = judge(flown(flat, 125.0, *way), craft, flat)
    assert safe.safe is True
    assert coded(safe.notes, "reads_terrain_on_board").data["spacing_m"] == 100
    verdict = judge(flown(ridge, 125.0, *way), craft, ridge)
    [finding] = [f for f in verdict.findings if f.kind == "min_agl"]
    # 125 m above its own flat ground, less 5 m and 30 m of errors and the ridge, whose top the nodes cut by up to 10 m.
    assert 125.0 - 35.0 - 60.0 - 0.1 <= finding.value <= 125.0 - 35.0 - 50.0
    assert judge(flown(ridge, 160.0, *way), craft, ridge).safe is True


def test_a_valley_between_the_posts_lets_the_vehicle_fly_above_max_agl() -> None:
    flat = fine_world(lambda e, n: 300.0 + 0 * e)
    middle = post_east_m(flat, 1000.0, 0.0) + 50.0
    gorge = fine_world(lambda e, n: 300.0 - np.maximum(0.0, 50.0 - 1.4 * np.abs(e - middle)))
    craft = vehicle(horizontal_clearance_m=0.0, min_agl_m=20.0, max_agl_m=140.0)
    way = ((-2000.0, 0.0), (2000.0, 0.0))
    assert judge(flown(flat, 100.0, *way), craft, flat, terrain_error_m=10.0).safe is True
    found = judge(flown(gorge, 100.0, *way), craft, gorge, terrain_error_m=10.0).findings
    assert {f.kind for f in found} == {"max_agl"}


@pytest.mark.parametrize("at", [(36.6, -84.3), (37.0, -84.0), (-0.01, 0.02)])
def test_a_leg_follows_what_the_autopilot_interpolates(at: tuple[float, float]) -> None:
    where = fine_world(lambda e, n: 400.0 + 80.0 * np.sin(e / 210.0) * np.cos(n / 170.0), at=at)

    def post(lat_degrees: int, lon_degrees: int, north: int, east: int) -> float:
        metre = float(np.float32(0.011131884502145034)) * 1e7
        lat = lat_degrees + 100.0 * north / metre
        lon = lon_degrees + 100.0 * east / metre / math.cos(math.radians(0.5 * (lat + lat_degrees)))
        return math.ceil(where.ground_amsl(lat, lon) - 1e-6)

    rng = np.random.default_rng(5)
    for _ in range(2):
        xy = rng.uniform(-2000, 2000, (2, 2))
        z = where.vehicle_terrain.ground_at(xy[:, 0], xy[:, 1]) + np.array([80.0, 110.0])
        followed = follow_ground(np.column_stack([xy, z]), where.vehicle_terrain)
        assert followed is not None
        starts, ends, off_m, _ = followed
        f = rng.uniform(0.02, 0.98, 15)
        along = np.hypot(*(starts[:, :2] - xy[0]).T) / math.dist(*xy)
        k = np.searchsorted(along, f, side="right") - 1
        part = (f - along[k]) * math.dist(*xy) / np.hypot(*(ends[k, :2] - starts[k, :2]).T)
        ours = starts[k, 2] + part * (ends[k, 2] - starts[k, 2])
        for one, height, allowed in zip(f, ours, off_m[k], strict=True):
            lat, lon = where.frame.to_degrees(*(xy[0] + one * (xy[1] - xy[0])))
            read = oracle.height(math.floor(lat * 1e7), math.floor(lon * 1e7), post)
            assert abs(height - (read + 80.0 + 30.0 * one)) < allowed + 0.06


@pytest.mark.slow
def test_a_leg_that_ends_on_a_line_of_posts_has_no_steep_end() -> None:
    """A border that is crossed a hair before the end made a piece of 1e-12 m, whose slope was noise: 20.8°."""
    where = fine_world(lambda e, n: 300.0 + 0.01 * e)
    rng = np.random.default_rng(6)
    shortest = []
    for _ in range(40):
        xy = np.array([rng.uniform(-2000, 0, 2), rng.uniform(200, 2000, 2)])
        ((_, _, surface),) = where.vehicle_terrain.pieces(xy)
        east, north = xy[1]
        line = math.ceil(surface.grid(east, north)[0])
        low, high = east, east + 200.0
        while (middle := 0.5 * (low + high)) not in (low, high):  # the first float beyond the line of posts
            low, high = (middle, high) if surface.grid(middle, north)[0] <= line else (low, middle)
        for past_m in (0.0, 1e-12, 1e-9, 1e-6, 9e-4):
            xy[1, 0] = high + past_m
            z = surface.ground_at(xy[:, 0], xy[:, 1]) + 90.0
            followed = follow_ground(np.column_stack([xy, z]), where.vehicle_terrain)
            assert followed is not None
            starts, ends, _, steep = followed
            shortest.append(np.hypot(*(ends - starts)[:, :2].T).min())
            assert np.abs(steep).max() < 0.03
            np.testing.assert_array_equal((starts[0, :2], ends[-1, :2]), xy)
    assert min(shortest) > 0.9e-3


def test_a_step_of_the_vehicles_ground_between_two_degrees_takes_metres_and_energy() -> None:
    """Posts of two degree tiles lie apart, so the ground that the vehicle reads steps where it flies into the next."""
    where = fine_world(lambda e, n: 300.0 + 60.0 * np.sin(e / 90.0 + n / 160.0), at=(46.6, 9.0))
    steps = []
    for north_m in np.linspace(-300.0, 300.0, 7).tolist():
        mission = flown(where, 120.0, (-5.0, north_m), (5.0, north_m + 1.0))
        verdict = judge(mission, vehicle(), where)
        leg = verdict.legs[-1]
        rise_m = abs(leg.end[2] - leg.start[2])
        energy = vehicle().energy
        least_j = energy.under_way_j(rise_m, leg.horizontal_m, leg.time_s)
        assert leg.energy_j >= least_j - 1e-3
        assert leg.length_m >= math.hypot(leg.horizontal_m, rise_m) - 1e-6
        east, west = (np.array([[e, north_m + 0.5], [0.0, north_m + 0.5]]) for e in (-4.0, 4.0))
        ground = [float(where.vehicle_terrain.pieces(p)[0][2].ground_at(-1e-3 * k, north_m + 0.5))
                  for k, p in ((1, east), (-1, west))]  # fmt: skip
        steps.append(abs(ground[1] - ground[0]))
    assert max(steps) > 1.0


def test_ground_that_the_vehicle_does_not_get_is_not_flown_over() -> None:
    """Beside a void a part of 4 × 4 posts is unknown as a whole, far beyond the void itself."""
    flat = fine_world(lambda e, n: 300.0 + 0 * e)
    hole = post_east_m(flat, 500.0, 300.0)
    where = fine_world(lambda e, n: np.where((np.abs(e - hole) < 60) & (np.abs(n - 300.0) < 60), np.nan, 300.0))
    craft = vehicle(horizontal_clearance_m=0.0)
    found: list[Finding] = []
    for north in (-200.0, -100.0, 0.0, 100.0, 500.0, 600.0, 700.0):
        found += judge(flown(where, 130.0, (-1500.0, north), (2000.0, north)), craft, where).findings
    assert {f.kind for f in found} == {"coverage"}
    assert "over_ground_unread" in {f.note.code for f in found}
    path = Path(np.array([[-1500.0, 150.0, 430.0], [hole, 150.0, 430.0], [2000.0, 150.0, 430.0]]))
    lat, lon = where.frame.to_degrees(-1500.0, 150.0)
    with pytest.raises(ValueError, match="terrain grid does not know"):
        build_mission(path, where, craft, (float(lat), float(lon)), Order(altitude_frame="terrain"))


def test_margins_never_turn_a_climb_limit_around() -> None:
    steep = Finding(3, "climb", Note("over_unknown_ground", 3), 0.0, 0.0, 0.0, 30.0, 6.0, 24.0, "deg")
    assert larger(MARGINS, [steep]).slope == MOST_SLOPE < 1.0


def test_other_posts_are_another_ground() -> None:
    where = fine_world(lambda e, n: 300.0 + 40.0 * np.sin(e / 60.0))
    fine, coarse = (where.with_posts(s).vehicle_terrain.ground_at(*np.mgrid[0:900:50, 0:900:50]) for s in (10, 100))
    real = where.airspace.surface.ground_at(*np.mgrid[0:900:50, 0:900:50])
    assert np.abs(fine - real).max() < 3.0 < np.abs(coarse - real).max()
    assert where.with_posts(100) is where
