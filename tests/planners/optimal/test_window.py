"""Planning beyond the first window of the terrain: paths that leave it, proofs, and the check over wider windows."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely
import yaml

from gcsplan.app.fleet.pipeline import plan, world_of
from gcsplan.app.plan.problem import make_problem
from gcsplan.bench.everyday.oracle import EnclosedPlace, VisibilityGraph
from gcsplan.errors import NoMission
from gcsplan.mission_file import MissionFile, load_mission
from gcsplan.planners.border import border, enclosed, exit_cost, goes_on, margin_for, within_m
from gcsplan.planners.optimal import planner
from gcsplan.planners.optimal.window import plan_over
from gcsplan.planners.problem import Problem, Progress, Refusal, Solution, Via
from gcsplan.planners.refusal.explain import NoPath
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path as Track
from gcsplan.world.geometry.surface import NO_SIDES, GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Polygon, Zone
from tests.campaigns import worlds

ALL_SIDES = (True, True, True, True)
LOW = Limits(min_agl_m=60.0, horizontal_clearance_m=20.0, track_error_m=5.0)
ROW_4 = {
    "version": 1,
    "terrain": {"dem": "sample:jacksboro", "vertical_datum": "EGM96"},
    "limits": {"min_agl_m": 60, "max_amsl_m": 700.5},
    "vehicles": [
        {"name": "round", "sysid": 1, "autopilot": "arducopter", "start": [36.54917, -84.26],
         "goal": [36.59083, -84.22083], "end": "land", "speed_m_s": [3, 15]},
    ],
    "planner": {"budget_s": 600},
}  # fmt: skip
"""Start and goal 5.8 km apart on two sides of a ridge, which can be passed within the same DEM."""


def source_of(document: dict[str, object], **limits: float) -> MissionFile:
    text = yaml.safe_dump({**document, "limits": {**document["limits"], **limits}})  # type: ignore[dict-item]
    return load_mission("row4.yaml", text=text)


def problem_of(source: MissionFile, **changes: object) -> Problem:
    problem = make_problem(source, source.vehicles[0], world_of(source), "length", 1)[0]
    return replace(problem, **changes)  # type: ignore[arg-type]


def flat(half_m: float, zones: tuple[Zone, ...] = (), sides: tuple[bool, bool, bool, bool] = ALL_SIDES) -> Airspace:
    ground = np.zeros((2, 2))
    return Airspace(
        Surface(ground, ground, GridMap.affine(-half_m, half_m, 2 * half_m, 2 * half_m), goes_on=sides), zones
    )


def box(west: float, south: float, east: float, north: float) -> Zone:
    return Zone("box", Polygon(np.array([[west, south], [east, south], [east, north], [west, north]])))


# -- plans over several windows ----------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_a_way_that_leaves_the_first_window_is_found_and_judged_where_it_leads() -> None:
    source = source_of(ROW_4)
    done = plan(source)
    (vehicle,) = done.vehicles
    assert vehicle.verdict.safe
    assert 38_000.0 < vehicle.verdict.length_m < 43_000.0
    assert vehicle.gap_percent is not None
    assert vehicle.gap_percent < 0.3
    points = vehicle.solution.path.points
    assert np.isnan(source.surface.ground_at(points[:, 0], points[:, 1])).any()  # beyond the first window
    assert np.isfinite(done.world.airspace.surface.ground_at(points[:, 0], points[:, 1])).all()
    assert done.source.level > 0


@pytest.mark.nightly
def test_a_ceiling_that_shuts_the_whole_model_is_still_proved_to() -> None:
    with pytest.raises(NoMission) as caught:
        plan(source_of(ROW_4, max_amsl_m=600.5))
    assert caught.value.reason == "infeasible"
    assert "proved" in caught.value.message
    assert "not found within" not in caught.value.message


@pytest.mark.slow
def test_where_memory_ends_before_the_terrain_nothing_is_called_proved() -> None:
    problem = problem_of(source_of(ROW_4), budget_mb=1.0)
    with pytest.raises(Refusal) as caught:
        planner.plan(problem)
    assert caught.value.reason == "not_found"
    assert "proved" not in caught.value.message
    assert f"not found within {within_m(problem) / 1000.0:.1f} km" in caught.value.message


@pytest.mark.nightly
def test_every_vehicle_is_judged_over_the_widest_terrain_that_one_of_them_needed() -> None:
    short = {**ROW_4["vehicles"][0], "name": "short", "sysid": 2, "goal": [36.55317, -84.264]}  # type: ignore[index]
    done = plan(source_of({**ROW_4, "vehicles": [short, *ROW_4["vehicles"]]}))  # type: ignore[misc]
    assert [v.verdict.safe for v in done.vehicles] == [True, True]
    assert {v.brief.world for v in done.vehicles if v.brief is not None} == {done.world}


@pytest.mark.nightly
def test_two_plans_are_the_same_to_the_last_bit() -> None:
    one, other = (planner.plan(problem_of(source_of(ROW_4))) for _ in range(2))
    assert one.path.points.tobytes() == other.path.points.tobytes()
    assert one.lower_bound == other.lower_bound


# -- windows of a mission file -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_raster_tells_on_which_sides_it_goes_on() -> None:
    source = source_of(ROW_4)
    assert source.surface.goes_on == ALL_SIDES
    assert source.wider is not None
    wide = source.wider(math.inf, 10**6)
    assert wide is not None
    assert wide.surface.ground_m.shape == (344, 403)  # all of it
    assert wide.surface.goes_on == NO_SIDES
    assert wide.wider is not None
    assert wide.wider(math.inf, 10**6) is None


@pytest.mark.slow
def test_a_wider_window_is_as_wide_as_asked_the_same_for_all_and_never_too_large() -> None:
    source = source_of(ROW_4)
    assert source.wider is not None
    wide = source.wider(7000.0, 10**6)
    assert wide is source.wider(7000.0, 10**6)
    assert wide is not None
    for east, north, _ in (source.vehicles[0].start, source.vehicles[0].goal):
        around = np.array([east, north]) + 7000.0 * np.array([[1, 0], [-1, 0], [0, -1]])  # north is the model's edge
        assert np.isfinite(wide.surface.ground_at(around[:, 0], around[:, 1])).all()
    assert source.wider(math.inf, source.surface.ground_m.size) is None


def test_ground_of_a_wider_window_is_the_same() -> None:
    source = source_of(ROW_4)
    assert source.wider is not None
    wide = source.wider(math.inf, 10**6)
    assert wide is not None
    e, n = np.random.default_rng(1).uniform(-5000.0, 5000.0, (2, 500))
    assert np.abs(wide.surface.ground_at(e, n) - source.surface.ground_at(e, n)).max() < 1e-4


def test_a_window_over_flat_ground_grows_past_the_zones_across_its_border() -> None:
    wall = {"name": "wall", "polygon": [[36.6, -84.6], [36.6, -84.0], [36.601, -84.0], [36.601, -84.6]]}
    ends = {"start": [36.59, -84.3], "goal": [36.61, -84.3]}
    document = {**ROW_4, "terrain": {"flat_m": 0}, "no_fly": [wall], "limits": {"min_agl_m": 60}}
    document["vehicles"] = [{**ROW_4["vehicles"][0], **ends}]  # type: ignore[index]
    source = load_mission("wall.yaml", text=yaml.safe_dump(document))
    assert goes_on(problem_of(source))
    assert source.wider is not None
    wide = source.wider(math.inf, 10**6)
    assert wide is not None
    assert not goes_on(problem_of(wide))
    west, south, east, north = wide.zones[0].bounds
    assert np.isfinite(wide.surface.ground_at([west, east], [south, north])).all()


# -- the border --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(20))
def test_the_cost_of_leaving_is_that_of_the_shortest_way_over_the_border(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sides = tuple(bool(x) for x in rng.random(4) < 0.6)
    rows, cols = (int(x) for x in rng.integers(20, 60, 2))
    surface = Surface(rng.random((rows, cols)), rng.random((rows, cols)) + 1.0,
                      GridMap.affine(0.0, 100.0 * (rows - 1), 100.0, 100.0), goes_on=sides)  # fmt: skip
    width, height = 100.0 * (cols - 1), 100.0 * (rows - 1)
    stops = rng.uniform(0.1, 0.9, (int(rng.integers(2, 5)), 2)) * [width, height]
    via = tuple(Via(float(e), float(n)) for e, n in stops[1:-1])
    p = Problem(Airspace(surface), LOW, (*stops[0], 100.0), (*stops[-1], 160.0), via)  # type: ignore[arg-type]
    f = np.linspace(0.0, 1.0, 4001)[:, None]
    ring = [(f * [0, height]), [0, height] + f * [width, 0], [width, 0] + f * [0, height], f * [width, 0]]
    at = [line for line, more in zip(ring, sides, strict=True) if more]
    if not at:
        assert math.isinf(exit_cost(p))
        return
    places = np.concatenate(at)
    legs = [math.dist(a, b) for a, b in pairwise(stops)]
    past = [np.hypot(*(places - a).T) + np.hypot(*(places - b).T) for a, b in pairwise(stops)]
    true = math.hypot(sum(legs) + min(x.min() - leg for x, leg in zip(past, legs, strict=True)), 60.0)
    assert true - 4.0 * 230.0 < exit_cost(p) <= true


@pytest.mark.slow
def test_paths_that_keep_within_the_margin_for_a_cost_are_all_of_that_cost() -> None:
    rng = np.random.default_rng(3)
    p = Problem(flat(50_000.0), LOW, (-1000.0, 0.0, 60.0), (1500.0, 700.0, 60.0), (Via(400.0, -300.0),))
    cost = 9000.0
    low = np.array([-1000.0, -300.0]) - margin_for(p, cost)
    high = np.array([1500.0, 700.0]) + margin_for(p, cost)
    stops = np.array([[-1000.0, 0.0], [400.0, -300.0], [1500.0, 700.0]])
    for _ in range(2000):
        k, away = int(rng.integers(2)), rng.uniform(-8000.0, 8000.0, 2)
        track = np.insert(stops, k + 1, away, axis=0)
        if np.hypot(*np.diff(track, axis=0).T).sum() <= cost:
            assert (away > low).all()
            assert (away < high).all()


def test_over_empty_flat_ground_no_path_is_better_beyond_the_window() -> None:
    disc = Zone("disc", Circle(0.0, 0.0, 300.0))
    far = Zone("far", Circle(9000.0, 0.0, 300.0))
    ends = ((-1000.0, 0.0, 60.0), (1000.0, 0.0, 60.0))
    assert not goes_on(Problem(flat(3000.0, (disc, far)), LOW, *ends))
    assert goes_on(Problem(flat(3000.0, (box(-50.0, -4000.0, 50.0, 100.0),)), LOW, *ends))
    assert goes_on(Problem(flat(3000.0, (box(-50.0, -2980.0, 50.0, 100.0),)), LOW, *ends))  # no space beside the wall
    assert not goes_on(Problem(flat(3000.0, (box(-50.0, -4000.0, 50.0, 100.0),), NO_SIDES), LOW, *ends))


def test_what_is_shut_in_by_zones_is_so_whatever_lies_beyond() -> None:
    ring = [(-600, -600, 600, -500), (-600, 500, 600, 600), (-600, -600, -500, 600), (500, -600, 600, 600)]
    walls = tuple(box(*r) for r in ring)
    across = box(-50.0, 2000.0, 50.0, 4000.0)
    ends = ((0.0, 0.0, 60.0), (1500.0, 0.0, 60.0))
    shut = Problem(flat(3000.0, (*walls, across)), LOW, *ends)
    assert goes_on(shut)
    assert enclosed(shut)
    assert not enclosed(replace(shut, airspace=flat(3000.0, (*walls[1:], across))))
    # A slit as wide as two reaches is closed; a wider one is open.
    narrow = (*walls[:3], box(500.0, -450.1, 600.0, 600.0), across)
    assert enclosed(replace(shut, airspace=flat(3000.0, narrow)))
    wide = (*walls[:3], box(500.0, -449.9, 600.0, 600.0), across)
    assert not enclosed(replace(shut, airspace=flat(3000.0, wide)))


def test_a_wall_from_border_to_border_shuts_nothing_in() -> None:
    wall = box(-4000.0, -50.0, 4000.0, 50.0)
    p = Problem(flat(3000.0, (wall,)), LOW, (0.0, -1000.0, 60.0), (0.0, 1000.0, 60.0))
    assert not enclosed(p)
    assert not enclosed(replace(p, airspace=flat(3000.0, (wall,), (True, False, False, False))))
    assert enclosed(replace(p, airspace=flat(3000.0, (wall,), (False, True, False, False))))


def test_a_valley_is_shut_in_by_ground_where_it_does_not_reach_the_border() -> None:
    ground = np.full((41, 41), 100.0)
    row, col = np.mgrid[:41, :41]
    ground[(np.maximum(abs(row - 20), abs(col - 20)) > 8) & (np.maximum(abs(row - 20), abs(col - 20)) < 12)] = 900.0
    limits = replace(LOW, max_amsl_m=400.0)

    def over(z: np.ndarray) -> Problem:
        surface = Surface(z, z, GridMap.affine(-2000.0, 2000.0, 100.0, 100.0), goes_on=ALL_SIDES)
        return Problem(Airspace(surface), limits, (0.0, 0.0, 200.0), (1700.0, 0.0, 200.0))

    assert enclosed(over(ground))
    cut = ground.copy()
    cut[20, :] = 100.0
    assert not enclosed(over(cut))


# -- the loop over windows, with a visibility graph as the planner -----------------------------------------------------


WORLD_M = 24_000.0


def frame_walls(half_m: float) -> list[Zone]:
    far = 10.0 * WORLD_M
    return [
        box(-far, half_m, far, far), box(-far, -far, far, -half_m), box(-far, -far, -half_m, far),
        box(half_m, -far, far, far),
    ]  # fmt: skip


def shortest(problem: Problem, half_m: float) -> float:
    """Length (m) of the shortest track within a square; inf if there is none."""
    plane = VisibilityGraph.of([*problem.airspace.zones, *frame_walls(half_m)], 25.0)
    try:
        return math.hypot(plane.shortest([problem.start[:2], problem.goal[:2]]), 0.0)
    except EnclosedPlace:
        return math.inf


def half_of(problem: Problem) -> float:
    return float(abs(problem.airspace.surface.grid.to_plane(0, 0)[0]))


def by_graph(problem: Problem) -> Solution:
    """A planner that is exact within its window and ignores everything outside of it."""
    length = shortest(problem, half_of(problem))
    if math.isinf(length):
        proved = not goes_on(problem) or enclosed(problem)
        raise NoPath("none", reason="infeasible" if proved else "not_found")
    a, b = np.array(problem.start), np.array(problem.goal)
    aside = 0.5 * math.sqrt(max(length**2 - math.dist(a, b) ** 2, 0.0))
    middle = 0.5 * (a + b) + aside * np.array([-(b - a)[1], (b - a)[0], 0.0]) / math.dist(a, b)
    if problem.progress is not None:
        problem.progress(Progress(0.0, length, length))
    return Solution(Track(np.array([a, middle, b])), lower_bound=length, stopped_by="gap")


def random_walls(seed: int) -> tuple[Zone, ...]:
    rng = np.random.default_rng(seed)
    zones: list[Zone] = []
    for _ in range(int(rng.integers(1, 5))):
        half, thick, off = rng.uniform(500.0, 12_000.0), rng.uniform(20.0, 300.0), rng.uniform(-900.0, 900.0)
        middle = rng.uniform(-0.9, 0.9) * half
        along = (middle - half, off - thick, middle + half, off + thick)
        zones.append(box(*(along if rng.random() < 0.7 else (along[1], along[0], along[3], along[2]))))
    if rng.random() < 0.3:
        zones.append(Zone("disc", Circle(*rng.uniform(-6000.0, 6000.0, 2).tolist(), float(rng.uniform(200.0, 3000.0)))))
    return tuple(zones)


def attempt(problem: Problem) -> Solution | Refusal:
    try:
        return plan_over(problem, by_graph)
    except Refusal as refusal:
        return refusal


@pytest.mark.slow
@pytest.mark.parametrize("first", [0, *(pytest.param(k, marks=pytest.mark.nightly) for k in (50, 100, 150))])
def test_bounds_and_proofs_hold_for_the_world_beyond_the_window(first: int) -> None:
    wider = 0
    for seed in range(first, first + 50):
        zones = random_walls(seed)
        rng = np.random.default_rng([seed, 1])
        ends = [(*rng.uniform(-1500.0, 1500.0, 2).tolist(), 100.0) for _ in range(2)]
        most = WORLD_M if rng.random() < 0.7 else 8000.0  # the widest window that memory allows
        said: list[Progress] = []

        def over(half_m: float, zones: tuple[Zone, ...] = zones, most: float = most) -> Airspace:
            return flat(half_m, zones, ALL_SIDES if half_m < WORLD_M else NO_SIDES)

        def widen(now: float, margin_m: float, p: Problem, most: float = most) -> Problem | None:
            half = min(max(2.0 * now, 0.0 if math.isinf(margin_m) else 1500.0 + margin_m), WORLD_M)
            if half > most:
                return None
            return replace(p, airspace=over(half), widen=lambda m, mb: widen(half, m, p))

        p = Problem(over(4000.0), LOW, *ends, progress=said.append)
        p = replace(p, widen=lambda m, mb, p=p: widen(4000.0, m, p))
        touched = VisibilityGraph.of(zones, 25.0).shapes
        if any(s.buffer(2.0).covers(shapely.Point(e[:2])) for s in touched for e in ends):
            continue
        optimum = shortest(p, WORLD_M)
        found = attempt(p)
        if isinstance(found, Refusal):
            assert math.isinf(optimum) or (found.reason == "not_found" and most < WORLD_M), seed
            continue
        wider += found.problem is not None
        bounds = [found.lower_bound, *(x.lower_bound for x in said)]
        assert max(b for b in bounds if b is not None) <= optimum * (1.0 + 1e-9), seed
        if most == WORLD_M:
            assert found.path.length_m <= optimum * 1.0011, seed
            assert found.lower_bound is not None
            assert found.path.length_m <= found.lower_bound * 1.0011, seed
    assert wider > 3  # the case does occur


def test_a_plan_within_one_window_is_asked_once_and_as_it_was() -> None:
    asked = []

    def once(problem: Problem) -> Solution:
        asked.append(problem)
        return by_graph(problem)

    p = Problem(flat(4000.0), LOW, (-500.0, 0.0, 60.0), (500.0, 0.0, 60.0), widen=lambda m, mb: None)
    found = plan_over(p, once)
    assert found.problem is None
    assert len(asked) == 1
    assert asked[0].airspace is p.airspace


def test_the_lines_of_a_border_in_degrees_lie_within_the_nodes() -> None:
    p = problem_of(source_of(ROW_4))
    lines, bow_m = border(p)
    inward = lines * (1.0 - 1e-4)  # about 1 m shorter, because their ends lie on the border
    ground = p.airspace.surface.ground_at(inward[..., 0], inward[..., 1])
    assert np.isfinite(ground).all()
    assert bow_m < 0.5


# -- the campaign ------------------------------------------------------------------------------------------------------


@pytest.mark.nightly_but("tiles-3")
@pytest.mark.slow
@pytest.mark.parametrize(("family", "seed"), [("ridge", 4), ("tiles", 3), ("edge", 1)])
def test_campaign_of_worlds(family: str, seed: int) -> None:
    outcome = worlds.judge(family, seed, budget_s=600.0)
    assert outcome.wrong == [], str(outcome)
    assert outcome.windows > 1


@pytest.mark.slow
@pytest.mark.nightly_but("100-tiles", "101-edge")
@pytest.mark.parametrize("family", ["ridge", "tiles", "edge"])
@pytest.mark.parametrize("seed", range(100, 106))
def test_campaign_of_worlds_longer(family: str, seed: int) -> None:
    outcome = worlds.judge(family, seed)
    assert outcome.wrong == [], str(outcome)


@pytest.mark.nightly
def test_the_campaign_finds_a_planner_that_takes_its_window_for_the_world() -> None:
    def blind(problem: Problem) -> Solution:
        surface = replace(problem.airspace.surface, goes_on=NO_SIDES)
        return planner.plan(replace(problem, airspace=Airspace(surface, problem.airspace.zones), widen=None))

    assert any(worlds.judge("ridge", seed, blind).wrong for seed in (1, 4))
