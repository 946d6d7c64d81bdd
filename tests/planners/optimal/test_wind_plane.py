"""The stretched plane: the same airspace in other metres, and the least time that its shortest path is worth."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.planners.airspeed import Airspeed
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.optimal.wind_plane import WindPlane
from gcsplan.planners.problem import Problem, Via
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.planner_worlds import FIELD, ground, jacksboro, random_mission

FAST_M_S = 20.0
SKEW_M = 2.0


def in_wind(problem: Problem, part: float, angle: float) -> Problem:
    """``problem`` for a wing of 20 m/s in a wind of a part of that, which blows to an angle from east."""
    blows_m_s = part * FAST_M_S
    airspeed = Airspeed(FAST_M_S, wind_m_s=(blows_m_s * math.cos(angle), blows_m_s * math.sin(angle)))
    return replace(problem, objective="time", airspeed=airspeed, speed_m_s=45.0, turn_radius_m=60.0)


def plane_of(problem: Problem) -> WindPlane:
    assert problem.airspeed is not None
    return WindPlane.of(problem.airspeed, problem.start[2])


@pytest.mark.parametrize("grid", [GridMap.affine(-500.0, 900.0, 30.0, 20.0), jacksboro().grid])
def test_a_mapped_grid_has_the_same_cells_at_the_stretched_places(grid: GridMap) -> None:
    rng = np.random.default_rng(2)
    for part, angle in rng.uniform([0.1, 0.0], [0.95, 6.3], (5, 2)).tolist():
        airspeed = Airspeed(FAST_M_S, wind_m_s=(part * FAST_M_S * math.cos(angle), part * FAST_M_S * math.sin(angle)))
        plane = WindPlane.of(airspeed, 100.0)
        places = np.array(grid.centre) + rng.uniform(-1.0, 1.0, (200, 2)) * grid.scale_m
        there = plane.stretched(places)
        mapped = grid.mapped(plane.back)
        assert mapped(*there.T) == pytest.approx(grid(*places.T), abs=1e-7)
        assert there @ plane.back == pytest.approx(places, abs=1e-8)


def test_the_length_of_a_stretched_way_is_its_time() -> None:
    rng = np.random.default_rng(3)
    for part, angle in rng.uniform([0.0, 0.0], [0.95, 6.3], (20, 2)).tolist():
        wind = part * FAST_M_S * np.array([math.cos(angle), math.sin(angle)])
        plane = WindPlane.of(Airspeed(FAST_M_S, wind_m_s=(float(wind[0]), float(wind[1]))), 0.0)
        way = rng.uniform(-1000.0, 1000.0, 3)
        room = FAST_M_S**2 - wind @ wind
        took_s = (math.sqrt(room) * float(np.linalg.norm(plane.stretched(way[None]))) - way[:2] @ wind) / room
        # The airspeed through the air, over all of that time.
        assert np.linalg.norm(way - took_s * np.array([*wind, 0.0])) == pytest.approx(FAST_M_S * took_s)


def random_legs(problem: Problem, rng: np.random.Generator, n: int) -> Floats:
    """(K, 2, 3) up to n legs of up to 1.5 km in the region of a mission, low above ground."""
    start, goal = np.array(problem.start), np.array(problem.goal)
    first = start + rng.uniform(-0.1, 1.1, (n, 1)) * (goal - start) + rng.normal(0.0, 900.0, (n, 3))
    legs = np.stack([first, first + rng.uniform(-1500.0, 1500.0, (n, 3)) * rng.uniform(0.0, 1.0, (n, 1))], axis=1)
    legs[..., 2] = problem.airspace.surface.top_at(legs[..., 0], legs[..., 1]) + rng.uniform(40.0, 420.0, (n, 2))
    return np.asarray(legs[np.isfinite(legs).all(axis=(1, 2))])


@pytest.mark.parametrize("seed", [1, 2, 5, 9])
def test_every_legal_leg_is_legal_in_the_stretched_plane(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mission = random_mission(seed, replace(FIELD, max_agl_m=400.0, max_climb_deg=12.0))
    middle = 0.5 * (np.array(mission.start) + np.array(mission.goal))[:2]
    corners = middle + np.array([[500.0, -300.0], [1500.0, -300.0], [1500.0, 900.0]])
    zones = [Zone("agl", Circle(*middle.tolist(), 400.0), Level(0.0, "agl"), Level(150.0, "agl"))]
    zones.append(Zone("part", Polygon(corners)))
    mission = replace(mission, airspace=Airspace(mission.airspace.surface, [*mission.airspace.zones, *zones]))
    mission = in_wind(mission, float(rng.uniform(0.3, 0.95)), float(rng.uniform(0.0, 6.3)))
    plane = plane_of(mission)
    there = plane.problem(replace(mission, objective="length"))
    start, end = random_legs(mission, rng, 4000).swapaxes(0, 1)
    here = mission.airspace.clear(Legs.between(start, end, mission.limits), mission.limits)
    # On a skew grid the check takes ground to be nearer than it is.
    limits = replace(there.bound_limits, altitude_error_m=there.bound_limits.altitude_error_m - SKEW_M)
    legs = Legs.between(plane.stretched(start), plane.stretched(end), limits)
    assert here.sum() > 100
    assert not here.all()
    assert there.airspace.clear(legs, limits)[here].all()
    # Its metres are no less than here.
    assert (np.hypot(*(legs.end - legs.start).T[:2]) >= np.hypot(*(end - start).T[:2]) - 1e-9).all()


def past_a_wall(part: float, angle: float) -> Problem:
    """A long zone across the way of 16 km, which ends farther away on one side than on the other."""
    limits = Limits(50.0, max_climb_deg=8.0, max_descent_deg=8.0, max_amsl_m=120.0, track_error_m=10.0,
                    horizontal_clearance_m=50.0)  # fmt: skip
    wall = Zone("wall", Polygon(np.array([[9500.0, 6000.0], [10500.0, 6000.0], [10500.0, 14500.0], [9500.0, 14500.0]])))
    flat = Problem(
        Airspace(ground(0.0, size_m=2e4), [wall]), limits, (2000.0, 10000.0, 100.0), (18000.0, 10000.0, 100.0)
    )
    return in_wind(flat, part, angle)


@pytest.mark.parametrize(("part", "angle"), [(0.3, 0.4), (0.6, 1.5), (0.9, 2.5)])
def test_a_wing_past_a_wall_is_near_its_bound_in_every_wind(part: float, angle: float) -> None:
    problem = past_a_wall(part, angle)
    assert problem.airspeed is not None
    found = plan(problem)
    assert found.flown is not None
    assert found.lower_bound is not None
    took_s = problem.airspeed.path_s(found.flown.points)
    assert found.lower_bound <= took_s < 1.01 * found.lower_bound


def test_a_stretched_problem_has_its_places_and_limits() -> None:
    problem = replace(past_a_wall(0.8, 0.7), via=(Via(6000.0, 4000.0, 90.0),), rounding_m=(0.01, 0.01))
    plane = plane_of(problem)
    there = plane.problem(problem)
    via = np.array([[there.via[0].east_m, there.via[0].north_m]])
    ends = np.array([there.start, there.goal])
    assert ends[:, 2].tolist() == [problem.start[2], problem.goal[2]]
    assert ends[:, :2] @ plane.back == pytest.approx(np.array([problem.start[:2], problem.goal[:2]]))
    assert via @ plane.back == pytest.approx(np.array([[6000.0, 4000.0]]))
    assert there.rounding_m == (0.01 * plane.most, 0.01)
    assert there.turn_radius_m == 0.0
    assert there.limits == problem.limits
    assert there.bound_limits.track_error_m <= problem.bound_limits.track_error_m
