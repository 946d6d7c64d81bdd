"""The default planner on toy maps and on the real sample: short where the optimum is known, safe everywhere."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gcsplan.app.fleet.pipeline import load_mission, world_of
from gcsplan.app.fleet.pipeline import plan as plan_mission
from gcsplan.app.plan.problem import make_problem
from gcsplan.errors import InputError
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem, Progress, Solution, Via
from gcsplan.planners.registry import get, names
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from tests.support.effort import seeds
from tests.support.paths import MISSIONS
from tests.support.planner_worlds import FIELD, Floats, faults, ground, random_mission

LOW = Limits(min_agl_m=10.0)


def wall(east: Floats, north: Floats) -> Floats:
    """Ground with a wall 200 m high across the map, with one gap around 1500 m north."""
    gap = np.abs(north - 1500.0) < 100.0
    return np.where((np.abs(east - 1000.0) < 50.0) & ~gap, 200.0, 0.0)


def ridge(east: Floats, north: Floats) -> Floats:
    """Ground with a ridge across the map, 100 m high in the south, falling to 40 m in the north."""
    return np.maximum(0.0, (100.0 - 0.03 * north) - 0.2 * np.abs(east - 1000.0))


def climbing(degrees: float, max_agl_m: float | None = None) -> Limits:
    return Limits(min_agl_m=10.0, max_agl_m=max_agl_m, max_climb_deg=degrees, max_descent_deg=degrees)


def problem(
    surface: Surface,
    zones: tuple[Zone, ...] = (),
    limits: Limits = LOW,
    start: tuple[float, float, float] = (200.0, 1000.0, 20.0),
    goal: tuple[float, float, float] = (1800.0, 1000.0, 20.0),
    **more: object,
) -> Problem:
    return replace(Problem(Airspace(surface, zones), limits, start, goal), **more)  # type: ignore[arg-type]


def solve(p: Problem) -> Solution:
    """Plan; assert that the exact check and brute force pass the path."""
    s = plan(p)
    assert p.airspace.examine(Legs.of_path(s.path.points, p.limits), p.limits).violations == ()
    assert faults(p, s.path) == []
    assert s.lower_bound is not None
    assert p.cost(s.path) >= s.lower_bound - 1e-6
    return s


def tangent_length(half_m: float, radius_m: float) -> float:
    """Length of the shortest track past a disc, from ``half_m`` before its centre to ``half_m`` after it."""
    angle = math.acos(radius_m / half_m)
    return 2.0 * math.sqrt(half_m**2 - radius_m**2) + radius_m * (math.pi - 2.0 * angle)


def test_straight_line_where_nothing_stands_in_the_way() -> None:
    s = solve(problem(ground(0.0)))
    assert len(s.path.points) == 2
    assert s.stopped_by == "gap"
    assert s.lower_bound == pytest.approx(1600.0)


@pytest.mark.first_quick
@pytest.mark.parametrize("objective", ["length", "energy"])
@pytest.mark.parametrize("ceiling", [None, Level(300.0, "amsl"), Level(300.0, "agl")])
def test_a_cylinder_too_high_to_fly_over_is_as_one_without_a_top(objective: str, ceiling: Level | None) -> None:
    zone = Zone("tower", Circle(1000.0, 1000.0, 150.0), None, ceiling)
    s = solve(problem(ground(0.0), (zone,), climbing(30.0), objective=objective))
    assert s.stopped_by == "gap"
    assert s.path.length_m == pytest.approx(tangent_length(800.0, 150.0), rel=1e-3)


@pytest.mark.slow
def test_a_cylinder_that_is_cheaper_to_fly_over_is_flown_over() -> None:
    zone = Zone("tower", Circle(1000.0, 1000.0, 600.0), None, Level(120.0, "amsl"))
    s = solve(problem(ground(0.0), (zone,), climbing(60.0)))
    assert s.path.length_m < tangent_length(800.0, 600.0)
    assert float(s.path.points[:, 2].max()) == pytest.approx(120.0, abs=0.1)


@pytest.mark.parametrize("objective", ["length", "energy"])
def test_no_better_path_is_higher_than_the_incumbent_says(objective: str) -> None:
    rng = np.random.default_rng(5)
    p = problem(ground(0.0), start=(200.0, 1000.0, 20.0), goal=(1800.0, 1000.0, 55.0), objective=objective)
    p = replace(p, vertical_j_per_m=30.0, horizontal_j_per_m=10.0)
    incumbent = Incumbent(p)
    assert incumbent.highest(500.0) == 500.0
    middle = np.column_stack([rng.uniform(200.0, 1800.0, 2000), rng.uniform(800.0, 1200.0, 2000),
                              rng.uniform(20.0, 900.0, 2000)])  # fmt: skip
    paths = [np.array([p.start, m, p.goal]) for m in middle]
    costs = np.array([p.cost(Path(q)) for q in paths])
    for cost in np.quantile(costs, [0.02, 0.3, 0.9]).tolist():
        incumbent.best, incumbent.cost = paths[0], cost
        highest = incumbent.highest(math.inf)
        better = middle[costs < cost, 2]
        assert better.max() <= highest
        assert highest <= better.max() + 0.2 * (better.max() - 55.0) + 15.0  # and it says something


@pytest.mark.parametrize("clearance_m", [0.0, 40.0])
def test_one_cylinder_is_passed_on_its_tangents(clearance_m: float) -> None:
    p = problem(
        ground(0.0),
        (Zone("mast", Circle(1000.0, 1000.0, 260.0)),),
        replace(LOW, horizontal_clearance_m=clearance_m, track_error_m=clearance_m / 10.0),
    )
    s = solve(p)
    best = tangent_length(800.0, 260.0 + 1.1 * clearance_m)
    assert best <= s.path.length_m <= best * 1.01
    assert len(s.path.points) <= 14


def test_polygon_is_passed_at_its_corner() -> None:
    square = Polygon(np.array([[800.0, 700.0], [1200.0, 700.0], [1200.0, 1200.0], [800.0, 1200.0]]))
    p = problem(ground(0.0), (Zone("town", square),))
    s = plan(p)
    assert p.airspace.examine(Legs.of_path(s.path.points, p.limits), p.limits).violations == ()
    best = 400.0 + 2.0 * math.hypot(600.0, 200.0)
    assert best <= s.path.length_m <= best * 1.01


def test_wall_is_passed_through_its_gap() -> None:
    s = solve(problem(ground(wall), limits=replace(LOW, max_amsl_m=100.0)))
    best = 2.0 * math.hypot(800.0, 400.0)
    assert best <= s.path.length_m <= best * 1.06
    crossing = np.interp(1000.0, s.path.points[:, 0], s.path.points[:, 1])
    assert 1400.0 < crossing < 1600.0


@pytest.mark.slow
def test_ridge_under_a_ceiling_is_passed_where_it_is_low_enough() -> None:
    s = solve(problem(ground(ridge), limits=replace(LOW, max_amsl_m=80.0)))
    crossing = np.interp(1000.0, s.path.points[:, 0], s.path.points[:, 1])
    # The crest is 70 m high at 1000 m north.
    assert crossing == pytest.approx(1000.0, abs=30.0)
    s = solve(problem(ground(ridge), limits=replace(LOW, max_amsl_m=65.0)))
    crossing = np.interp(1000.0, s.path.points[:, 0], s.path.points[:, 1])
    assert crossing == pytest.approx(1500.0, abs=30.0)


@pytest.mark.slow
def test_band_over_the_ground_is_followed_up_and_down_a_hill() -> None:
    def hill(east: Floats, north: Floats) -> Floats:
        return 150.0 * np.exp(-(((east - 1000.0) / 300.0) ** 2 + ((north - 1000.0) / 300.0) ** 2))

    s = solve(problem(ground(hill), limits=climbing(35.0, max_agl_m=40.0)))
    assert s.path.length_m < 1600.0 * 1.06
    gentle = solve(problem(ground(hill), limits=climbing(6.0, max_agl_m=40.0)))
    assert gentle.path.length_m > s.path.length_m


@pytest.mark.nightly
def test_a_maximum_agl_over_level_ground_is_a_maximum_amsl() -> None:
    """Same bytes, and the searches of the plane apply: only a band over uneven ground is searched on a lattice."""
    level = ground(200.0)
    zones = [
        Zone(
            f"z{k}", Circle(600.0 + 200.0 * k, 1000.0 + 150.0 * (-1) ** k, 160.0), None, Level(240.0 + 20.0 * k, "amsl")
        )
        for k in range(5)
    ]
    limits = Limits(min_agl_m=30.0, max_agl_m=120.0, altitude_error_m=5.0, max_climb_deg=12.0, max_descent_deg=12.0)
    p = Problem(Airspace(level, zones), limits, (200.0, 1000.0, 240.0), (1800.0, 1000.0, 240.0), gap_percent=0.01)
    found = plan(p)
    same = plan(replace(p, limits=replace(limits, max_agl_m=None, max_amsl_m=320.0)))
    assert found.path.points.tobytes() == same.path.points.tobytes()
    assert found.lower_bound == same.lower_bound
    assert {"track_bound"}.isdisjoint(step.name for step in found.search)
    assert faults(p, found.path) == []
    assert found.notes == ()


@pytest.mark.slow
def test_zone_with_a_low_ceiling_is_flown_over_and_one_with_a_high_floor_under() -> None:
    over = Zone("mast", Circle(600.0, 1000.0, 150.0), None, Level(60.0, "agl"))
    under = Zone("airway", Circle(1400.0, 1000.0, 150.0), Level(40.0, "agl"), Level(900.0, "agl"))
    s = solve(problem(ground(5.0), (over, under)))
    east, amsl = s.path.points[:, 0], s.path.points[:, 2]
    assert s.path.length_m < 1600.0 * 1.01
    assert np.interp(600.0, east, amsl) >= 65.0
    assert np.interp(1400.0, east, amsl) <= 45.0


@pytest.mark.slow
def test_zones_one_over_the_other_are_passed_in_between() -> None:
    low = Zone("low", Circle(1000.0, 1000.0, 900.0), None, Level(60.0, "amsl"))
    high = Zone("high", Circle(1000.0, 1000.0, 900.0), Level(90.0, "amsl"), None)
    s = solve(
        problem(ground(0.0), (low, high), start=(50.0, 1000.0, 20.0), goal=(1950.0, 1000.0, 20.0), gap_percent=2.0)
    )
    assert 60.0 <= np.interp(1000.0, s.path.points[:, 0], s.path.points[:, 2]) <= 90.0
    assert s.path.length_m == pytest.approx(1800.0 + 2.0 * math.hypot(50.0, 40.0), abs=0.01)


@pytest.mark.slow
def test_start_under_a_zones_floor_is_legal() -> None:
    roof = Zone("airway", Circle(200.0, 1000.0, 300.0), Level(50.0, "agl"), None)
    s = solve(problem(ground(0.0), (roof,), goal=(1800.0, 1000.0, 400.0)))
    assert np.interp(490.0, s.path.points[:, 0], s.path.points[:, 2]) <= 50.0


@pytest.mark.slow
def test_via_points_are_passed_in_order_and_at_their_heights() -> None:
    mast = Zone("mast", Circle(1000.0, 1000.0, 300.0))
    p = problem(ground(0.0), (mast,), via=(Via(1000.0, 1500.0), Via(1500.0, 600.0, 80.0)))
    s = solve(p)
    flat = s.path.points[:, :2].tolist()
    first, second = flat.index([1000.0, 1500.0]), flat.index([1500.0, 600.0])
    assert 0 < first < second
    assert s.path.points[second, 2] == 80.0
    assert s.lower_bound == pytest.approx(math.hypot(800, 500) + math.hypot(500, 900) + math.hypot(300, 400), rel=0.01)


@pytest.mark.slow
def test_round_trip_over_a_via_and_a_via_on_the_start_are_flown() -> None:
    s = solve(problem(ground(0.0), via=(Via(1500.0, 1000.0),), goal=(200.0, 1000.0, 20.0)))
    assert s.path.length_m == pytest.approx(2600.0)
    s = solve(problem(ground(0.0), (Zone("mast", Circle(1000.0, 1000.0, 100.0)),), via=(Via(200.0, 1000.0),)))
    assert s.path.length_m < 1.01 * tangent_length(800.0, 100.0)


@pytest.mark.nightly
def test_energy_pays_the_detour_that_climbs_less_and_no_more() -> None:
    p = problem(ground(ridge), objective="energy", vertical_j_per_m=600.0)
    aside = np.linspace(0.0, 1000.0, 10_001)
    best = 2.0 * (100.0 * np.hypot(800.0, aside) + 600.0 * (60.0 - 0.03 * aside))
    assert best.min() < best[0] * 0.99
    assert best.min() - 1.0 <= p.cost(solve(p).path) <= best.min() * 1.001


@pytest.mark.nightly
def test_climb_limit_is_kept_by_climbing_early_and_by_a_longer_way() -> None:
    def step(east: Floats, north: Floats) -> Floats:
        return np.where(east > 1000.0, 150.0, 0.0)

    far = problem(ground(step), limits=climbing(12.0), goal=(1800.0, 1000.0, 165.0))
    assert solve(far).path.length_m < 1620.0
    s = solve(replace(far, start=(700.0, 1000.0, 20.0), gap_percent=5.0))
    assert s.path.length_m > 1150.0


@pytest.mark.slow
@pytest.mark.parametrize("error_m", [0.0, 2.0])
def test_a_zone_as_high_as_the_ceiling_is_passed_over_at_just_that_height(error_m: float) -> None:
    lid = Zone("lid", Circle(1000.0, 1000.0, 300.0), None, Level(100.0, "amsl"))
    limits = Limits(10.0, max_amsl_m=100.0 + 2.0 * error_m, altitude_error_m=error_m)
    p = problem(ground(0.0), (lid,), limits, start=(200.0, 1000.0, 60.0), goal=(1800.0, 1000.0, 60.0))
    s = solve(p)
    assert s.path.points[:, 2].max() == pytest.approx(100.0 + error_m, abs=1e-6)
    assert s.path.length_m == pytest.approx(2.0 * math.hypot(500.0, 40.0 + error_m) + 600.0, rel=1e-5)
    around = solve(replace(p, limits=replace(limits, max_amsl_m=99.99 + 2.0 * error_m)))
    assert around.path.length_m > s.path.length_m + 30.0


def test_same_question_same_bytes() -> None:
    p = random_mission(5)
    a, b = plan(p), plan(random_mission(5))
    assert a.path.points.tobytes() == b.path.points.tobytes()


def test_progress_tells_phase_and_cost() -> None:
    said: list[Progress] = []
    mast = Zone("mast", Circle(1000.0, 1000.0, 300.0))
    s = plan(problem(ground(0.0), (mast,), progress=said.append))
    assert said[0].phase == "search"
    assert said[-1].cost == pytest.approx(s.path.length_m)
    bounds = [x.lower_bound for x in said if x.lower_bound is not None]
    assert bounds == sorted(bounds)
    assert bounds[-1] == s.lower_bound
    costs = [x.cost for x in said if x.phase == "improve" and x.cost is not None]
    assert costs
    assert costs == sorted(costs, reverse=True)
    assert [x.elapsed_s for x in said] == sorted(x.elapsed_s for x in said)


@pytest.mark.slow
def test_spent_budget_still_gives_a_safe_path_and_says_so() -> None:
    s = solve(replace(random_mission(5), budget_s=0.0, gap_percent=1e-6))
    assert s.stopped_by in ("budget", "time")


SSGWO = [
    (250.0, 200.0, 40.0, 18.0), (600.0, 700.0, 30.0, 18.0), (130.0, 120.0, 30.0, 16.0), (300.0, 280.0, 40.0, 17.0),
    (350.0, 600.0, 40.0, 19.0), (480.0, 400.0, 60.0, 18.0), (700.0, 650.0, 40.0, 17.0), (720.0, 760.0, 50.0, 19.0),
]  # fmt: skip
"""SSGWO paper, Table 3: east, north, radius, height (m)."""


@pytest.mark.parametrize(("unlimited", "optimum_m"), [(False, 1132.432), (True, 1140.392)])
def test_ssgwo_table_3_is_solved_within_one_percent(unlimited: bool, optimum_m: float) -> None:
    zones = tuple(
        Zone(f"cylinder {k}", Circle(x, y, r), None, None if unlimited else Level(h, "amsl"))
        for k, (x, y, r, h) in enumerate(SSGWO)
    )
    surface = ground(0.0, size_m=800.0, step_m=200.0)
    s = solve(problem(surface, zones, Limits(0.0), (0.0, 0.0, 0.0), (800.0, 800.0, 15.0)))
    assert optimum_m - 0.01 <= s.path.length_m <= 1.01 * optimum_m


@pytest.mark.nightly_but("1")
@pytest.mark.slow
@pytest.mark.parametrize("seed", seeds(2, 2, 5))
def test_random_missions_on_the_sample_are_solved_safely(seed: int) -> None:
    assert faults_of_plan(random_mission(seed)) == []


@pytest.mark.slow
@pytest.mark.nightly_but("20")
@pytest.mark.parametrize("seed", [20, 21, 22])
def test_random_missions_under_the_120_m_rule(seed: int) -> None:
    assert faults_of_plan(random_mission(seed, replace(FIELD, min_agl_m=50.0, max_agl_m=120.0), zones=6)) == []


@pytest.mark.nightly_but("40")
@pytest.mark.slow
@pytest.mark.parametrize("seed", [40, 42, pytest.param(44, marks=pytest.mark.slow)])
def test_random_missions_under_a_ceiling(seed: int) -> None:
    assert faults_of_plan(random_mission(seed, replace(FIELD, max_amsl_m=690.5))) == []


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [60, 61])
def test_random_missions_for_energy(seed: int) -> None:
    assert faults_of_plan(random_mission(seed, objective="energy")) == []


def faults_of_plan(p: Problem) -> list[str]:
    """What the brute-force oracle has against the plan of a mission, or what keeps it from being one."""
    s = solve(p)
    found = list(faults(p, s.path, step_m=10.0))
    if np.linalg.norm(np.diff(s.path.points, axis=0), axis=1).min() <= 1.0:
        found.append("two way points within a metre")
    if s.lower_bound is None or not s.lower_bound <= p.cost(s.path) * (1.0 + 1e-9):
        found.append(f"a bound of {s.lower_bound} for a path that costs {p.cost(s.path)}")
    return found


@pytest.mark.slow
def test_jacksboro_mission_winds_through_the_gaps_that_its_ceiling_and_zones_leave() -> None:
    source = load_mission(MISSIONS / "jacksboro.yaml")
    vehicle = plan_mission(source).vehicles[0]
    p, s = vehicle.problem, vehicle.solution
    assert math.dist(p.start[:2], p.goal[:2]) >= 15_000.0
    assert len(source.zones) >= 8
    straight = Legs.of_path(np.array([[*p.start[:2], 680.0], [*p.goal[:2], 680.0]]), p.limits)
    assert "min_agl" in {v.kind for v in p.airspace.examine(straight, p.limits).violations}
    assert faults(p, s.path, step_m=10.0) == []
    assert s.path.length_m < 27_200.0
    # Without the zones the path is shorter, so they matter.
    bare = replace(p, airspace=Airspace(p.airspace.surface, scale=p.airspace.scale), gap_percent=1.0)
    assert plan(bare).path.length_m < s.path.length_m - 500.0


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "most_m"), [("krill-forest", 188.9), ("abo", 129.4), ("krill-hills", 162.6), ("krill-mound", 156.72)]
)
def test_worlds_as_high_as_wide_are_solved_no_worse_than_by_swarms(name: str, most_m: float) -> None:
    source = load_mission(MISSIONS / "papers" / f"{name}.yaml")
    p, _ = make_problem(source, source.vehicles[0], world_of(source), "length", 1)
    s = plan(p)
    assert p.airspace.examine(Legs.of_path(s.path.points, p.limits), p.limits).violations == ()
    assert faults(p, s.path, step_m=0.2) == []
    assert s.lower_bound is not None
    assert s.lower_bound <= p.cost(s.path) <= most_m


def needles(east: Floats, north: Floats) -> Floats:
    """Ground with nine needles 90 m high, 30 m apart."""
    z = np.zeros_like(east)
    for x in (30.0, 60.0, 90.0):
        for y in (30.0, 60.0, 90.0):
            z += 90.0 * np.exp(-(((east - x) / 8.0) ** 2) - ((north - y) / 8.0) ** 2)
    return z


AMONG = Limits(min_agl_m=3.0, horizontal_clearance_m=0.2, max_amsl_m=120.0)
MAST = Zone("mast", Circle(45.0, 38.0, 9.0), None, Level(60.0, "amsl"))
ROOF = Zone("roof", Circle(75.0, 60.0, 20.0), Level(50.0, "agl"), None)


@pytest.mark.slow
@pytest.mark.nightly_but("zones1-via1-90.0-length", "zones3-via3-90.0-energy")
@pytest.mark.parametrize(
    ("zones", "via", "degrees", "objective"),
    [
        pytest.param((), (Via(45.0, 75.0), Via(75.0, 45.0, 30.0)), 90.0, "length", marks=pytest.mark.slow),
        ((MAST, ROOF), (), 90.0, "length"),
        pytest.param((MAST,), (Via(75.0, 45.0, 10.0),), 60.0, "length", marks=pytest.mark.slow),
        pytest.param((), (Via(75.0, 45.0),), 90.0, "energy", marks=pytest.mark.slow),
    ],
)
def test_paths_among_needles_as_high_as_the_world_is_wide(
    zones: tuple[Zone, ...], via: tuple[Via, ...], degrees: float, objective: str
) -> None:
    limits = replace(AMONG, max_climb_deg=degrees, max_descent_deg=max(degrees - 10.0, 50.0))
    surface = ground(needles, size_m=120.0, step_m=1.0)
    p = problem(surface, zones, limits, (5.0, 5.0, 3.5), (115.0, 115.0, 80.0), via=via, objective=objective)
    found = plan(p)
    legs = Legs.of_path(found.path.points, limits)
    assert p.airspace.examine(legs, limits).violations == ()
    assert found.lower_bound is not None
    cost = p.cost(found.path)
    print(
        "GAP",
        cost / found.lower_bound - 1,
        found.stopped_by,
        [(s.name, round(s.s, 2), s.gained_percent, s.bound_percent) for s in found.search],
    )
    assert found.lower_bound <= cost * (1.0 + 1e-9) <= 1.1 * found.lower_bound


def test_table_names_the_nearest_planner() -> None:
    assert "optimal" in names()
    assert get("optimal").name == "optimal"
    with pytest.raises(InputError, match="Did you mean 'optimal'"):
        get("optimum")
    with pytest.raises(InputError, match="Known: optimal"):
        get("x")
