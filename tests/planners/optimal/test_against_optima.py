"""The default planner's paths and lower bounds, compared with optima that are found by other means.

A lower bound holds for every path, so any path that passes the exact check and costs less disproves it. On discs and
in tunnels the optimum itself is known.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import label
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from gcsplan.arrays import Floats
from gcsplan.errors import NoMission
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Polygon, Zone
from tests.oracles.optima import profile_by_programme, shortest_past_discs
from tests.oracles.optima_campaign import TOUCH_M, exact_past_discs, judge, reverse, summary
from tests.oracles.optima_polish import PATIENT, Effort, cost_of, is_feasible
from tests.oracles.optima_search import best_path
from tests.oracles.optima_worlds import FAMILIES, HOLED, hills, make, pass_height, plane_ground
from tests.support.effort import seeds

pytestmark = pytest.mark.slow


WORLDS = dict.fromkeys(FAMILIES, 12) | {"clearances": 6, "passes": 6, "stops": 6, "pockets": 4}
"""Missions of each family that a run judges. `tests.oracles.optima_campaign` judges more: for up to 46 of each family
a path is stored, for all others it searches for one."""
HOLED_WORLDS = 4
"""Missions of each family with voids in its ground; `bands+voids` 2 was called infeasible although a path is known."""
BACKWARDS = 2
"""Missions of each of some families that are planned forwards and backwards."""
BRIEF = Effort(300, 3, 1, 1, 1, 0.04)
"""Effort of polishing the planner's own path, for each mission with a stored path."""
MOST_MISSED = {"passes": 1.0, "stops": 0.5}
"""Largest part of a family's missions that the planner may miss although a path is known; 0.1 for other families.

A pass that equals the ceiling to the last bit leaves a path no clearance: the planner may miss it, but must not call
it infeasible."""


# --- the oracles themselves ---------------------------------------------------------------------------------------


def test_one_disc_is_passed_on_its_tangents() -> None:
    found = shortest_past_discs((0.0, 0.0), (10.0, 0.0), np.array([[5.0, 0.0, 3.0]]))
    assert found == pytest.approx(2.0 * 4.0 + 3.0 * (math.pi - 2.0 * math.acos(3.0 / 5.0)), rel=1e-12)
    assert shortest_past_discs((0.0, 0.0), (10.0, 0.0), np.array([[5.0, 3.0, 3.0]])) == pytest.approx(10.0)
    assert shortest_past_discs((0.0, 0.0), (3.0, 4.0), np.zeros((0, 3))) == pytest.approx(5.0)


def test_no_way_out_of_a_ring_of_overlapping_discs() -> None:
    turn = np.arange(12) * (2.0 * math.pi / 12)
    ring = np.column_stack([10.0 * np.cos(turn), 10.0 * np.sin(turn), np.full(12, 3.0)])
    assert shortest_past_discs((0.0, 0.0), (30.0, 0.0), ring) == math.inf
    assert math.isfinite(shortest_past_discs((0.0, 0.0), (30.0, 0.0), ring[1:]))


def test_shortest_past_discs_lies_between_past_polygons_within_and_around_them() -> None:
    for seed in range(6):
        rng = np.random.default_rng(seed)
        discs = np.column_stack([rng.uniform(2.0, 8.0, (8, 2)), rng.uniform(0.3, 1.6, 8)])
        found = shortest_past_discs((0.0, 0.0), (10.0, 10.0), discs)
        outer, inner = (_past_polygons(discs, around, 60) for around in (True, False))
        assert inner * (1.0 - 1e-4) <= found <= outer + 1e-9, seed
        assert outer <= inner * 1.003 or math.isinf(outer), seed


def _past_polygons(discs: Floats, around: bool, corners: int) -> float:
    """Shortest track from (0, 0) to (10, 10) over corners of regular polygons around or in discs, by visibility.

    Legs stay outside of the polygons' inner circles. With ``around`` those are the discs themselves: the track is
    legal, so no shorter than the optimum. Otherwise it is no longer than the optimum, except for the corners' effect.
    """
    turn = np.arange(corners) * (2.0 * math.pi / corners)
    points = [np.array([[0.0, 0.0], [10.0, 10.0]])]
    shrink = math.cos(math.pi / corners)
    inner, grow = (discs[:, 2], 1.0 / shrink) if around else (discs[:, 2] * shrink, 1.0)
    for x, y, r in discs:
        points.append(np.column_stack([x + r * grow * np.cos(turn), y + r * grow * np.sin(turn)]))
    p = np.vstack(points)
    free = (np.hypot(*(p[:, None] - discs[:, :2]).transpose(2, 0, 1)) >= inner - 1e-9).all(axis=1)
    p = p[free]
    i, j = (k.astype(np.int32) for k in np.triu_indices(len(p), 1))
    a, d = p[i], p[j] - p[i]
    ok = np.ones(len(i), bool)
    for x, y, r in np.column_stack([discs[:, :2], inner]):
        off = np.array([x, y]) - a
        t = np.clip((off * d).sum(axis=1) / (d**2).sum(axis=1), 0.0, 1.0)
        ok &= np.hypot(*(off - t[:, None] * d).T) >= r - 1e-9
    graph = csr_array((np.hypot(*d[ok].T), (i[ok], j[ok])), shape=(len(p), len(p)))
    return float(dijkstra(graph, directed=False, indices=0)[1])


@pytest.mark.parametrize("seed", range(6))
def test_pass_height_is_where_a_fine_flood_joins_the_ends(seed: int) -> None:
    rng = np.random.default_rng(seed)
    z = hills(rng, whole=bool(seed % 2)).heights[:14, :14]
    a, b = (1, 1), (12, 12)
    found = pass_height(z, a, b)
    fine = np.linspace(0.0, 13.0, 13 * 40 + 1)
    ground = plane_ground(z, 1.0, 1.0)
    surface = Surface(z, z, ground.grid)
    at = surface.ground_at(*np.meshgrid(fine, 13.0 - fine))

    def joined(level: float) -> bool:
        parts, _ = label(at <= level, np.ones((3, 3)))
        return bool(parts[40, 40] and parts[40, 40] == parts[480, 480])

    # Samples 1/40 cell apart show a narrow pass a little too high, and diagonal steps a corner a little too low.
    spread = float(np.ptp(z)) * 0.02
    assert joined(found + spread)
    assert not joined(found - spread)


@pytest.mark.nightly
def test_patient_search_comes_within_a_hair_of_known_optima() -> None:
    for seed in range(4):
        case = make("discs", seed)
        points = best_path(case.problem, seed, PATIENT)
        assert points is not None
        assert is_feasible(case.problem, points)
        exact = exact_past_discs(case)
        assert exact - 1e-5 * exact <= cost_of(case.problem, points) <= 1.0003 * exact, seed


# --- the planner --------------------------------------------------------------------------------------------------


@pytest.mark.nightly_but("bands")
@pytest.mark.parametrize("family", FAMILIES)
def test_bound_is_never_over_and_path_never_under_what_is_known(family: str) -> None:
    verdicts = [judge(family, seed, BRIEF) for seed in range(WORLDS[family])]
    wrong = [str(v) for v in verdicts if v.wrong]
    assert not wrong, "\n".join([*wrong, summary(verdicts)])
    missed = [str(v) for v in verdicts if v.missed]
    assert len(missed) <= MOST_MISSED.get(family, 0.1) * len(verdicts), "\n".join(missed)


@pytest.mark.nightly
@pytest.mark.parametrize("family", HOLED)
def test_no_void_makes_a_bound_or_a_proof_wrong(family: str) -> None:
    verdicts = [judge(family, seed, BRIEF) for seed in range(HOLED_WORLDS)]
    wrong = [str(v) for v in verdicts if v.wrong]
    assert not wrong, "\n".join([*wrong, summary(verdicts)])


@pytest.mark.nightly_but("cylinders", "mountains", "borders")
@pytest.mark.parametrize("family", ["cylinders", "mountains", "climbs", "clearances", "borders"])
def test_bound_holds_for_the_path_of_the_mission_flown_backwards(family: str) -> None:
    for seed in range(100, 100 + BACKWARDS):
        problem = make(family, seed).problem
        try:
            one, other = plan(problem), plan(reverse(problem))
        except NoMission:
            continue
        legs = Legs.of_path(other.path.points[::-1], problem.limits)
        assert problem.airspace.examine(legs, problem.limits).violations == (), seed
        touch = TOUCH_M * (1.0 + problem.vertical_j_per_m + problem.horizontal_j_per_m)
        assert one.lower_bound is not None
        assert other.lower_bound is not None
        assert one.lower_bound <= problem.cost(other.path) + touch, seed
        assert other.lower_bound <= problem.cost(one.path) + touch, seed


@pytest.mark.nightly_but("0.0")
@pytest.mark.parametrize("budget_s", [0.0, 0.02])
def test_bound_holds_however_soon_the_planner_is_stopped(budget_s: float) -> None:
    wrong = [
        str(v)
        for family in ("discs", "cylinders", "mountains", "stops")
        for v in (judge(family, seed, BRIEF, budget_s=budget_s) for seed in range(3))
        if v.wrong
    ]
    assert not wrong, "\n".join(wrong)


def tunnel(seed: int, climb_deg: float, band: bool) -> tuple[Problem, Floats]:
    """A mission over hills between two walls 0.1 m apart, which leave only the altitudes free; and its track (N, 2)."""
    rng = np.random.default_rng(seed)
    ground = hills(rng, float(rng.uniform(20.0, 120.0)))
    east, north = ground.box[2:]
    a = np.array([0.05 * east, float(rng.uniform(0.2, 0.8)) * north])
    b = np.array([0.95 * east, float(rng.uniform(0.2, 0.8)) * north])
    along = (b - a) / math.dist(a, b)
    across = np.array([-along[1], along[0]])
    walls = []
    for side in (1.0, -1.0):
        inner = [p + side * 0.05 * across for p in (a - 3000.0 * along, b + 3000.0 * along)]
        outer = [p + side * 3000.0 * across for p in (b + 3000.0 * along, a - 3000.0 * along)]
        walls.append(Zone(f"wall {side:+g}", Polygon(np.array(inner + outer)[:: int(side)])))
    limits = Limits(
        15.0, max_agl_m=float(rng.uniform(35.0, 60.0)) if band else None, max_climb_deg=climb_deg,
        max_descent_deg=climb_deg,
    )  # fmt: skip
    air = Airspace(Surface(ground.heights, ground.heights, ground.grid), walls)
    start, goal = ((*p.tolist(), float(air.surface.ground_at(*p)) + 15.05) for p in (a, b))
    problem = Problem(
        air, limits, start, goal, objective="energy", vertical_j_per_m=float(rng.choice([40.0, 120.0]))
    )  # fmt: skip
    # Every metre, and where the track crosses a line of the raster: in between the ground is a parabola.
    cells = np.array(ground.box[2:]) / (np.array(ground.heights.shape[::-1]) - 1.0)
    lines = [np.arange(1, 40) * cells[k] for k in range(2)]
    at = np.concatenate([(x - a[k]) / (b[k] - a[k]) for k, x in enumerate(lines)])
    at = np.unique(np.concatenate([at[(at > 0.0) & (at < 1.0)], np.linspace(0.0, 1.0, round(math.dist(a, b)) + 1)]))
    return problem, a + at[np.diff(at, prepend=-1.0) > 1e-6][:, None] * (b - a)


@pytest.mark.nightly_but("2-True", "0-True", "2-False")
@pytest.mark.parametrize("band", [False, True])
@pytest.mark.parametrize("seed", seeds(4, 4, 8))
def test_profile_in_a_tunnel_is_the_linear_programmes(seed: int, band: bool) -> None:
    climb_deg = (90.0, 25.0, 12.0, 6.0)[seed % 4]
    problem, track = tunnel(seed, climb_deg, band)
    limits, air = problem.limits, problem.airspace
    s = np.hypot(*(track - track[0]).T)
    low = air.surface.ground_at(*track.T) + limits.min_agl_m
    high = low + ((limits.max_agl_m or 1e4) - limits.min_agl_m)
    low[0], low[-1] = high[0], high[-1] = problem.start[2], problem.goal[2]
    slope = min(limits.max_climb_slope, 1e3)
    # The first programme ignores the ground between samples (least cost); the second more than allows for it.
    least = profile_by_programme(s, low, high, 1.002 * slope + 1e-3, 1.002 * slope + 1e-3)
    inner = np.zeros(len(s))
    inner[1:-1] = 0.04
    safe = profile_by_programme(s, low + inner, high - inner, slope, slope)
    try:
        solution = plan(problem)
    except NoMission:
        assert safe is None
        return
    cost = problem.cost(solution.path)
    assert least is not None
    flat = problem.horizontal_j_per_m * float(s[-1])
    # The walls leave 0.1 m, across which the ground may fall a little.
    slack = problem.vertical_j_per_m * 1.0
    assert cost >= flat + problem.vertical_j_per_m * least.vertical_m - slack
    assert solution.lower_bound is not None
    assert solution.lower_bound <= cost + 1e-3
    if safe is not None:
        points = np.column_stack([track, safe.amsl_m])
        assert is_feasible(problem, points)
        assert solution.lower_bound <= cost_of(problem, points) + 1e-3
        assert cost <= cost_of(problem, points) * 1.002 + slack


@pytest.mark.nightly
def test_bound_holds_for_a_path_that_touches_its_limits() -> None:
    """A ceiling that equals the ground's pass: the only path touches the limits at one point."""
    z = np.full((21, 21), 50.0)
    z[:, 10] = 100.0
    z[16, 10] = 80.0
    ground = plane_ground(z, 50.0, 50.0)
    air = Airspace(Surface(z, z, ground.grid))
    limits = Limits(10.0, max_amsl_m=90.0)
    problem = Problem(air, limits, (100.0, 800.0, 60.0), (900.0, 800.0, 60.0))
    crossing = np.array([[450.0, 200.0, 90.0], [550.0, 200.0, 90.0]])
    assert air.clear(Legs.of_path(crossing, limits), limits).all()
    best = best_path(problem, 0, PATIENT)
    assert best is not None
    assert np.abs(best[:, 0] - 500.0).min() < 1.0
    # No clearance at all: the planner may miss the path, but must not prove it infeasible or exceed it by a bound.
    try:
        bound, reason = plan(problem).lower_bound, "not_found"
    except NoMission as refusal:
        bound, reason = 0.0, refusal.reason
    assert reason == "not_found"
    assert bound is not None
    assert bound <= cost_of(problem, best) + 1e-5
    # With 0.3 m more the pass is found, and the touching path is still legal.
    solution = plan(replace(problem, limits=replace(limits, max_amsl_m=90.3)))
    assert solution.lower_bound is not None
    assert solution.lower_bound <= cost_of(problem, best) + 1e-5
    assert solution.path.length_m <= 1.01 * cost_of(problem, best)


@pytest.mark.nightly
def test_bound_lets_height_be_won_on_the_way_out_of_a_pocket() -> None:
    """A ridge behind a wall, 200 m from the start in a straight line; only the 400 m track around the wall is long
    enough for the climb."""
    n = 41
    east, _ = np.meshgrid(np.linspace(0.0, 1200.0, n), np.linspace(1200.0, 0.0, n))
    z = np.where((east >= 450.0) & (east <= 510.0), 45.0, 0.0)
    wall = Polygon(np.array([[390.0, 300.0], [400.0, 300.0], [400.0, 900.0], [390.0, 900.0]]))
    air = Airspace(Surface(z, z, plane_ground(z, 30.0, 30.0).grid), (Zone("wall", wall),))
    limits = Limits(10.0, max_climb_deg=9.0, max_descent_deg=60.0)
    problem = Problem(air, limits, (380.0, 600.0, 10.01), (570.0, 600.0, 56.0), budget_s=60.0)
    way = np.array([problem.start, [389.99, 900.01, 56.0], [400.01, 900.01, 56.0], problem.goal])
    assert is_feasible(problem, way)
    solution = plan(problem)
    assert solution.lower_bound is not None
    assert solution.lower_bound <= min(cost_of(problem, way), solution.path.length_m) + 1e-5
    assert solution.path.length_m <= 1.001 * cost_of(problem, way)


@pytest.mark.nightly_but("90", "91")
@pytest.mark.parametrize("seed", [89, 90, 91])
def test_bound_holds_along_the_edges_of_holes_in_a_turned_raster(seed: int) -> None:
    """In a rotated raster rounding leaves nothing exactly in line: a track along a wall lies slightly beside it."""
    rng = np.random.default_rng(seed)
    side, step_m = int(rng.integers(6, 14)), float(rng.choice([30.0, 29.7, 33.3, 27.123]))
    turn = rng.uniform(0.0, 2.0 * math.pi)
    per = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]) @ np.diag([step_m, -step_m])
    back, middle, half = np.linalg.inv(per), per @ np.full(2, 0.5 * (side - 1)), step_m * side
    grid = GridMap.fit(
        lambda e, n: (back[0, 0] * e + back[0, 1] * n, back[1, 0] * e + back[1, 1] * n),
        (middle[0] - half, middle[1] - half, middle[0] + half, middle[1] + half),
    )
    z = np.where(rng.random((side, side)) < rng.choice([0.03, 0.1]), np.nan, 0.0)
    ends = [per @ rng.uniform(0.05, side - 1.05, 2) for _ in range(2)]
    limits = Limits(10.0, max_amsl_m=100.0)
    start, goal = ((*end.tolist(), 10.5) for end in ends)
    problem = Problem(Airspace(Surface(z, z, grid)), limits, start, goal)
    one, other = plan(problem), plan(reverse(problem))
    for solution in (one, other):
        assert solution.lower_bound is not None
        assert solution.lower_bound <= min(one.path.length_m, other.path.length_m) + 1e-5
