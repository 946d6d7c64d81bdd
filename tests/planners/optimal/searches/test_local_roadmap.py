"""The local roadmap in small worlds: its paths are legal, and close to optima found by other means."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcsplan.planners.budget import RATES, Budget
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.optimal.searches import local_roadmap
from gcsplan.planners.optimal.searches.local_roadmap import FIRST, LAST, NEAR, LocalRoadmap, small_path
from gcsplan.planners.problem import Problem, Via
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Circle, Zone
from tests.oracles.optima import shortest_past_discs
from tests.oracles.optima_campaign import faults
from tests.oracles.optima_polish import cost_of
from tests.oracles.optima_witnesses import known
from tests.oracles.optima_worlds import Case, make, plane_ground
from tests.support.planner_worlds import Floats, random_mission
from tests.support.searches import plane_of, spent_budget, work_of


def flat(discs: list[tuple[float, float, float]], via: tuple[Via, ...] = (), clearance_m: float = 0.0) -> Case:
    """Cylinders of unlimited height (east, north, radius) on flat ground, past which the optimum is known exactly."""
    ground = plane_ground(np.zeros((5, 5)), 500.0, 500.0)
    zones = [Zone(f"zone {k}", Circle(*disc)) for k, disc in enumerate(discs)]
    air = Airspace(Surface(ground.heights, ground.heights, ground.grid), zones)
    limits = Limits(10.0, horizontal_clearance_m=clearance_m)
    return Case("flat", Problem(air, limits, (700.0, 1000.0, 10.05), (1300.0, 1010.0, 10.05), via), ground)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("family", "seed", "part"),
    [
        ("passes", 2, 0.005),
        ("pockets", 4, 0.03),
        pytest.param("cylinders", 3, 0.02, marks=pytest.mark.slow),
        pytest.param("passes", 7, 0.005, marks=pytest.mark.nightly),
        pytest.param("rasters", 5, 0.01, marks=pytest.mark.nightly),
        pytest.param("stops", 1, 0.02, marks=pytest.mark.nightly),
        pytest.param("clearances", 6, 0.01, marks=pytest.mark.slow),
    ],
)
def test_a_first_path_is_legal_by_brute_force_and_near_the_best_that_patience_found(
    family: str, seed: int, part: float
) -> None:
    case = make(family, seed)
    best = known(family, seed, case)
    assert best is not None
    found = small_path(case.problem, None)
    assert found is not None
    points, pinned = found
    assert faults(case, Path(points)) == []
    assert int(pinned.sum()) == len(case.problem.via) + 2
    assert cost_of(case.problem, points) <= (1.0 + part) * cost_of(case.problem, best)


@pytest.mark.nightly_but("0.5-0.0")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("gap_m", "clearance_m"), [(1e-3, 0.0), pytest.param(0.5, 0.0, marks=pytest.mark.slow), (0.02, 7.0)]
)
def test_a_slit_between_cylinders_is_flown_through(gap_m: float, clearance_m: float) -> None:
    radii = 40.0, 60.0
    north = np.array([960.0, 960.0 + sum(radii) + 2.0 * clearance_m + gap_m])
    north -= 0.5 * (north[0] + radii[0] + north[1] - radii[1]) - 1000.0
    discs = [(1000.0, float(n), r) for n, r in zip(north, radii, strict=True)]
    # Only long tracks lead around: more cylinders on both sides, so close to these that no track fits in between.
    discs += [(1000.0, float(north[0]) - radii[0] - 150.0 + 1.0, 150.0)]
    discs += [(1000.0, float(north[1]) + radii[1] + 150.0 - 1.0, 150.0)]
    case = flat(discs, clearance_m=clearance_m)
    found = small_path(case.problem, None)
    assert found is not None
    assert faults(case, Path(found[0])) == []
    grown = np.array(discs) + np.array([0.0, 0.0, clearance_m])
    p = case.problem
    exact = shortest_past_discs(p.start[:2], p.goal[:2], grown)
    assert exact - 1e-6 <= cost_of(p, found[0]) <= 1.0005 * exact


@pytest.mark.nightly
def test_only_a_cheaper_path_is_returned_and_the_same_one_each_time() -> None:
    case = flat([(1000.0, 1000.0, 80.0)])
    p = case.problem
    detour: Floats = np.array([p.start, (1000.0, 1300.0, 10.05), p.goal])
    first, again = (small_path(p, detour) for _ in range(2))
    assert first is not None
    assert again is not None
    assert first[0].tobytes() == again[0].tobytes()
    assert cost_of(p, first[0]) < cost_of(p, detour)
    optimum = small_path(p, first[0])
    assert optimum is None or cost_of(p, optimum[0]) < cost_of(p, first[0])
    assert small_path(replace(p, budget=spent_budget()), detour) is None


@pytest.mark.nightly
def test_stops_are_passed_in_their_order_at_their_heights() -> None:
    via = (Via(1100.0, 1150.0, 40.0), Via(900.0, 850.0))
    case = flat([(1000.0, 1000.0, 80.0)], via)
    found = small_path(case.problem, None)
    assert found is not None
    assert faults(case, Path(found[0])) == []
    stops = found[0][found[1]]
    assert stops[:, :2].tolist() == [[700.0, 1000.0], *([v.east_m, v.north_m] for v in via), [1300.0, 1010.0]]
    assert stops[1, 2] == 40.0


@pytest.mark.nightly
def test_worlds_with_very_many_zones_are_searched_as_well() -> None:
    rng = np.random.default_rng(5)
    discs = [(float(e), float(n), 4.0) for e, n in rng.uniform(0.0, 2000.0, (900, 2)) if abs(e - 1000.0) < 280.0]
    case = flat(discs)
    found = small_path(case.problem, None)
    assert found is not None
    assert faults(case, Path(found[0])) == []
    p = case.problem
    assert cost_of(p, found[0]) <= 1.01 * shortest_past_discs(p.start[:2], p.goal[:2], np.array(discs))


@pytest.mark.slow
def test_a_roadmap_asks_for_budget_between_blocks_of_legs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_roadmap, "LEGS_AT_ONCE", 500)
    asked: list[float] = []

    class Counted(Budget):
        def goes_on(self) -> bool:
            asked.append(self.spent)
            return len(asked) < 6

    p = replace(flat([(1000.0, 1000.0, 100.0)]).problem, budget=Counted(10.0, 100.0))
    assert small_path(p, None) is None  # too few legs were checked to reach the goal
    assert len(asked) >= 6
    legs = (np.diff(asked[:6]) - RATES["check"]) / RATES["leg"]
    assert (legs < 1750.0).all()


def test_long_missions_and_stops_in_one_place_are_left_alone() -> None:
    assert not plane_of(random_mission(0)).is_small
    assert not plane_of(flat([], (Via(700.0, 1000.0),)).problem).is_small
    assert plane_of(flat([]).problem).is_small


def test_it_has_a_turn_without_a_path_one_beyond_a_large_gap_and_one_at_last() -> None:
    work = work_of(flat([]).problem)
    search, incumbent = LocalRoadmap(work), work.incumbent
    shares = []
    for cost in (np.inf, 800.0, 800.0, 800.0, 700.0):
        if np.isfinite(cost):
            incumbent.best, incumbent.cost = np.array([incumbent.problem.start, incumbent.problem.goal]), cost
        shares.append(search.share if search.is_open() else 0.0)
        search.choose()
    assert shares == [FIRST[0], NEAR[0], LAST[0], 0.0, 0.0]
    near = LocalRoadmap(work)
    incumbent.cost = 1.01 * incumbent.bound
    assert near.share == LAST[0]
    incumbent.cost = 1.001 * incumbent.bound
    assert not near.is_open()


@pytest.mark.nightly
def test_the_planner_finds_passes_exactly_as_high_as_the_ceiling() -> None:
    case = make("passes", 2)
    solution = plan(replace(case.problem, gap_percent=1.0))
    assert faults(case, solution.path) == []
    assert solution.lower_bound is not None
    assert 0.0 < solution.lower_bound <= case.problem.cost(solution.path) + 1e-6
