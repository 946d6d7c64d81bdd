"""Planning between min and max AGL with a climb limit, and climbs on the spot; brute force checks the paths."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.errors import NoMission
from gcsplan.planners.budget import Budget
from gcsplan.planners.lattice.planner import plan_band, sides_to_pass
from gcsplan.planners.optimal import planner as optimal
from gcsplan.planners.problem import Problem, Progress, Via, straight_bound
from gcsplan.planners.profile.climb_laps import climb_tracks, extend, laps, pins_of
from gcsplan.planners.profile.exact import LegJudge, Unsettled, settle
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.planner_worlds import FIELD, Floats, faults, ground, jacksboro

BAND = replace(FIELD, max_agl_m=120.0)
STEEP = Limits(10.0, max_climb_deg=15.0, max_descent_deg=15.0)


def band_mission(seed: int, degrees: float, zones: tuple[Zone, ...] = (), objective: str = "length") -> Problem:
    """A mission between two places of the sample DEM, 4 to 9 km apart, in the middle between min and max AGL."""
    limits = replace(BAND, max_climb_deg=degrees, max_descent_deg=degrees)
    air = Airspace(jacksboro(), zones)
    rng = np.random.default_rng(seed)
    while True:
        a = rng.uniform(-9000.0, 9000.0, 2)
        turn, way = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(4000.0, 9000.0)
        b = a + way * np.array([math.cos(turn), math.sin(turn)])
        low, high = (
            f(np.array([a[0], b[0]]), np.array([a[1], b[1]]), limits) for f in (air.floor_amsl, air.ceiling_amsl)
        )
        if np.abs(b).max() < 12_000.0 and (high > low + 2.0).all():
            break
    z = 0.5 * (low + high)
    start, goal = ((float(p[0]), float(p[1]), float(h)) for p, h in zip((a, b), z, strict=True))
    return Problem(air, limits, start, goal, objective="energy" if objective == "energy" else "length")


def plan(problem: Problem) -> Path:
    """A path by the lattice alone."""
    begun = time.perf_counter()
    problem = replace(problem, budget=Budget(problem.budget_s, problem.budget_mb, problem.budget.clocked))

    def tell(phase: str, cost: float | None) -> None:
        if problem.progress is not None:
            problem.progress(Progress(time.perf_counter() - begun, cost, None, phase))

    return Path(plan_band(problem, tell))


def disc(middle: Floats, radius_m: float) -> Circle:
    return Circle(float(middle[0]), float(middle[1]), radius_m)


def is_clear(problem: Problem, points: Floats) -> bool:
    return bool(problem.airspace.clear(Legs.of_path(points, problem.limits), problem.limits).all())


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "degrees"), [(1, 10.0), pytest.param(2, 10.0, marks=pytest.mark.slow), (3, 15.0)])
def test_crosses_real_ground_between_60_and_120_m(seed: int, degrees: float) -> None:
    p = band_mission(seed, degrees)
    path = plan(p)
    assert not p.airspace.examine(Legs.of_path(path.points, p.limits), p.limits).violations
    assert faults(p, path) == []
    assert straight_bound(p) <= path.length_m <= 1.15 * straight_bound(p)


@pytest.mark.nightly
def test_a_plan_is_the_same_every_time_and_tells_of_its_progress() -> None:
    told: list[Progress] = []
    p = replace(band_mission(4, 15.0), progress=told.append)
    first, second = plan(p).points, plan(p).points
    assert np.array_equal(first, second)
    assert told[0].phase == "search"
    assert told[-1].phase == "done"
    assert told[-1].cost == pytest.approx(Path(second).length_m)


@pytest.mark.slow
def test_zones_in_the_band_are_passed_over_under_and_around() -> None:
    bare = band_mission(5, 15.0)
    a, b = np.array(bare.start[:2]), np.array(bare.goal[:2])
    along = b - a
    across = np.array([-along[1], along[0]]) / math.hypot(*along)
    corners = np.array([(-300.0, -300.0), (300.0, -300.0), (300.0, 300.0), (-300.0, 300.0)])
    zones = (
        Zone("low", disc(a + 0.25 * along, 400.0), None, Level(80.0, "agl")),
        Zone("high", disc(a + 0.5 * along, 400.0), Level(105.0, "agl"), None),
        Zone("wall", disc(a + 0.75 * along + 50.0 * across, 350.0)),
        Zone("field", Polygon(a + 0.62 * along - 250.0 * across + corners)),
    )
    p = replace(bare, airspace=Airspace(jacksboro(), zones))
    path = plan(p)
    assert is_clear(p, path.points)
    circles = replace(p, airspace=Airspace(jacksboro(), zones[:3]))
    assert faults(circles, path) == []


def test_a_path_with_two_points_at_one_place_has_sides() -> None:
    """A track keeps one of the two, while the path's heights are those of all its points."""
    bare = band_mission(1, 10.0)
    start, goal = np.array(bare.start), np.array(bare.goal)
    middle = 0.5 * (start + goal)
    low, high = Zone("low", disc(middle, 300.0), None, Level(1.0, "agl")), Zone("high", disc(middle, 300.0), None, None)
    problem = replace(bare, airspace=Airspace(bare.airspace.surface, (low, high)))
    points = np.array([start, middle, (middle[0] + 1e-4, *middle[1:]), goal])
    assert sides_to_pass(problem, points, *pins_of(problem, points)) == {0: True, 1: False}


@pytest.mark.nightly
def test_vias_are_passed_at_their_altitudes() -> None:
    p = band_mission(6, 15.0)
    middle = 0.5 * (np.array(p.start[:2]) + np.array(p.goal[:2])) + 400.0
    low = float(p.airspace.floor_amsl(middle[0], middle[1], p.limits))
    p = replace(p, via=(Via(float(middle[0]), float(middle[1]), low + 8.0),))
    points = plan(p).points
    assert is_clear(p, points)
    off = np.linalg.norm(points - np.array([*middle, low + 8.0]), axis=1)
    assert off.min() < 1e-6


@pytest.mark.slow
def test_energy_is_worth_a_detour_around_climbs() -> None:
    p = band_mission(7, 15.0, objective="energy")
    thrifty = plan(p)
    short = plan(replace(p, objective="length"))
    assert is_clear(p, thrifty.points)
    assert p.cost(thrifty) <= 1.005 * p.cost(short)
    assert straight_bound(p) <= p.cost(thrifty)


def test_the_bound_knows_how_long_a_climb_takes() -> None:
    p = Problem(Airspace(ground(0.0)), STEEP, (500.0, 500.0, 20.0), (600.0, 500.0, 320.0))
    assert straight_bound(p) == pytest.approx(300.0 / math.sin(math.radians(15.0)))
    energy = straight_bound(replace(p, objective="energy"))
    assert energy == pytest.approx(120.0 * 300.0 + 100.0 * 300.0 / math.tan(math.radians(15.0)))


# Climbs on the spot.


def pit(east: Floats, north: Floats) -> Floats:
    """A round pit, 120 m wide at the bottom, 200 m deep, its sides 45 degrees steep."""
    return np.clip(np.hypot(east - 500.0, north - 1000.0) - 120.0, 0.0, 200.0)


def needle(east: Floats, north: Floats) -> Floats:
    return np.clip(300.0 - 1.5 * np.hypot(east - 1500.0, north - 1000.0), 0.0, 300.0)


def pit_problem(**changes: object) -> Problem:
    p = Problem(Airspace(ground(pit, step_m=10.0)), STEEP, (500.0, 1000.0, 10.0), (1700.0, 1000.0, 210.0))
    return replace(p, **changes)  # type: ignore[arg-type]


def extended(p: Problem) -> Floats:
    """Points of a path over the straight track from start to goal, with laps."""
    stops = np.array([p.start[:2], p.goal[:2]])
    found = extend(p, stops, np.ones(2, bool), np.full(2, np.nan))
    assert found is not None
    settled = settle(p, LegJudge(p), found[0].points, found[0].pinned, found[0].pin_m)
    assert not isinstance(settled, Unsettled)
    return settled[0]


def test_laps_lead_out_of_a_pit() -> None:
    p = pit_problem()
    points = extended(p)
    assert faults(p, Path(points)) == []
    # No longer than the climb and the track out of the pit require, plus 10 %.
    assert Path(points).length_m < 1.1 * (200.0 / math.sin(math.radians(15.0)) + 900.0)


def test_laps_lead_down_to_a_goal_in_a_pit() -> None:
    p = pit_problem()
    p = replace(p, start=p.goal, goal=p.start)
    points = extended(p)
    assert faults(p, Path(points)) == []
    assert np.allclose(points[-1], p.goal)


def test_laps_lead_up_to_a_needles_top() -> None:
    p = Problem(Airspace(ground(needle, step_m=10.0)), STEEP, (1150.0, 1000.0, 10.0), (1500.0, 1000.0, 310.0))
    assert faults(p, Path(extended(p))) == []


def test_laps_keep_clear_of_a_zone_beside_the_start() -> None:
    bare = pit_problem()
    p = replace(bare, airspace=Airspace(bare.airspace.surface, [Zone("mast", Circle(455.0, 1000.0, 30.0))]))
    assert faults(p, Path(extended(p))) == []


def test_laps_are_circles_no_tighter_than_the_turn_radius() -> None:
    p = pit_problem(turn_radius_m=40.0)
    points = extended(p)
    assert faults(p, Path(points)) == []
    lap, _ = next(laps(p, 600.0, None))
    closed = np.vstack([np.zeros(2), lap, np.zeros(2)])
    d = np.diff(closed, axis=0)
    turn = np.abs((np.diff(np.arctan2(d[:, 1], d[:, 0])) + math.pi) % (2.0 * math.pi) - math.pi)
    # An arc takes radius * tan(turn / 2) of each of its two legs.
    assert (40.0 * np.tan(0.5 * turn.max()) * 2.0 <= np.hypot(d[:, 0], d[:, 1])).all()


def test_laps_too_wide_for_the_pit_are_not_flown() -> None:
    p = pit_problem(turn_radius_m=400.0)
    stops = np.array([p.start[:2], p.goal[:2]])
    assert extend(p, stops, np.ones(2, bool), np.full(2, np.nan)) is None


@pytest.mark.slow
def test_out_of_a_pit_under_max_agl_the_way_winds_up() -> None:
    p = pit_problem(limits=replace(STEEP, max_agl_m=60.0))
    path = plan(p)
    assert faults(p, path) == []


@pytest.mark.nightly
def test_pits_narrower_than_the_search_sees_are_left_and_entered_in_laps() -> None:
    def pits(east: Floats, north: Floats) -> Floats:
        away = np.minimum(np.hypot(east - 1000.0, north - 4000.0), np.hypot(east - 7000.0, north - 4000.0))
        return np.clip(1.2 * (away - 50.0), 0.0, 150.0)

    air = Airspace(ground(pits, size_m=8000.0, step_m=20.0))
    p = Problem(air, replace(STEEP, max_climb_deg=10.0), (1000.0, 4000.0, 10.0), (7000.0, 4000.0, 10.0))
    path = plan(p)
    assert faults(p, path) == []
    # Both climbs add length, neither more than twice the necessary one.
    assert path.length_m < 6000.0 + 2.0 * 150.0 / math.sin(math.radians(10.0))


@pytest.mark.parametrize("down", [False, True])
def test_start_and_goal_over_one_place(down: bool) -> None:
    ends = ((500.0, 1000.0, 12.0), (500.0, 1000.0, 180.0))
    p = pit_problem(start=ends[down], goal=ends[not down])
    solution = optimal.plan(p)
    assert is_clear(p, solution.path.points)
    assert solution.lower_bound is not None
    assert solution.lower_bound <= solution.path.length_m <= 1.05 * solution.lower_bound
    assert np.allclose(solution.path.points[[0, -1]], [p.start, p.goal])


@pytest.mark.nightly
def test_no_room_to_climb_over_one_place_is_refused_with_its_limit() -> None:
    limits = replace(STEEP, max_climb_deg=2.0)
    walls = [Zone(f"wall {k}", Circle(500.0 + 60.0 * x, 1000.0 + 60.0 * y, 52.0)) for k, (x, y) in enumerate(AROUND)]
    p = pit_problem(
        limits=limits, airspace=Airspace(ground(0.0), walls), goal=(500.0, 1000.0, 500.0), turn_radius_m=30.0
    )
    with pytest.raises(NoMission, match=r"490\.0 m apart in height.*max_climb_deg 2"):
        optimal.plan(p)
    assert climb_tracks(p, p.start[:2], 10.0, 500.0) is None


AROUND = [(math.cos(t), math.sin(t)) for t in np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False)]
