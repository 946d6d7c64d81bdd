"""Bounds of a leg's tracks, held against paths that are known."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.planners.budget import Budget
from gcsplan.planners.optimal.navmesh import mesh
from gcsplan.planners.optimal.plane.corridor import End
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.plane.leg import Leg
from gcsplan.planners.optimal.plane.plane_search import PlaneSearch
from gcsplan.planners.optimal.planner import plan, search
from gcsplan.planners.problem import Problem, Refusal
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import GridMap, Surface
from tests.support.planner_worlds import Floats, ground


def track_of(path: Floats) -> float:
    """Metres of a path's ground track."""
    return float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum())


@pytest.mark.nightly_but("700.0-12.0")
@pytest.mark.slow
@pytest.mark.parametrize(("start_east_m", "climb_deg"), [(600.0, 8.0), (700.0, 8.0), (700.0, 12.0), (830.0, 12.0)])
def test_bound_of_a_climb_in_front_of_a_ridge_holds_whatever_bounds_came_before(
    start_east_m: float, climb_deg: float
) -> None:
    """The climb takes laps in front of the ridge, so a path has flown far more than the shortest track when it comes
    there. What an earlier bound counted of that is not counted once more as metres that cannot be spent on climbing."""
    across = ground(lambda east, _: np.maximum(0.0, 80.0 - 0.5 * np.abs(east - 1000.0)))
    limits = Limits(min_agl_m=10.0, max_climb_deg=climb_deg, max_descent_deg=climb_deg)
    problem = Problem(
        Airspace(across, ()), limits, (start_east_m, 1000.0, 20.0), (1800.0, 1000.0, 30.0), budget=Budget(2.0, 500.0)
    )
    best = search(problem).incumbent.best
    assert best is not None
    known_m = track_of(best)
    plane = PlaneSearch(Incumbent(problem))
    assert plane.flood(1.0)
    (leg,) = plane.legs
    assert known_m > 1.02 * leg.length_m
    for part in (0.5, 0.8, 0.95, 0.999, 1.001, 1.02, 1.1):
        limit_m = leg.length_m + part * (known_m - leg.length_m)
        found_m = leg.bound(plane.top_m, leg.corridor(limit_m), limit_m, True)
        assert found_m <= known_m * (1.0 + 1e-9), (part, found_m, known_m)
        assert found_m <= limit_m


@pytest.mark.slow
@pytest.mark.first_quick
@pytest.mark.parametrize("cell_m", [(20.0, 20.0), (20.0, 10.0)])
def test_little_memory_makes_cells_larger_instead_of_failing(cell_m: tuple[float, float]) -> None:
    """Half a million nodes and a goal behind a ring wall, so that the lattice grows to the whole model."""
    j, i = np.mgrid[:500, :500]
    away = np.hypot(i - 250, j - 250)
    z = np.where((away > 20) & (away < 26), 200.0, 0.0)
    surface = Surface(z, z, GridMap.affine(0.0, 499.0 * cell_m[1], *cell_m), {})
    middle, outside = (250 * cell_m[0], 249 * cell_m[1], 50.0), (250 * cell_m[0], 300 * cell_m[1], 50.0)
    limits = Limits(min_agl_m=5.0, max_amsl_m=100.0)
    for budget_mb in (1024.0, 64.0, 20.0, 2.0):
        with pytest.raises(Refusal) as refused:
            plan(Problem(Airspace(surface, ()), limits, middle, outside, budget_mb=budget_mb))
        assert refused.value.reason == "infeasible" or budget_mb < 10.0


def test_bounds_hold_if_the_work_ends_during_a_flood(monkeypatch: pytest.MonkeyPatch) -> None:
    """Mazes; the work that a flood may do beyond the budget is made so small that it ends on its way."""
    rng = np.random.default_rng(1)
    blocks = np.kron(rng.uniform(0.0, 100.0, (101, 101)), np.ones((4, 4)))[:400, :400]
    z = np.where(blocks > 45.0, 100.0, 0.0)
    for east, north in ((50, 50), (350, 350)):
        z[393 - north : 406 - north, east - 6 : east + 7] = 0.0
    air = Airspace(Surface(z, z, GridMap.affine(0.0, 399.0 * 20.0, 20.0, 20.0), {}), ())
    ends = End(1000.0, 1000.0, 35.0), End(7000.0, 7000.0, 35.0)

    def flooded(part: float) -> Leg:
        budget = Budget.endless(clocked=False) if part == 1.0 else Budget(0.0, 1e6, clocked=False)
        monkeypatch.setattr(mesh, "ANYHOW", int(part * 9415))
        if part < 1.0:
            budget.found_first()
        limits = Limits(min_agl_m=5.0, max_amsl_m=60.0)
        leg = Leg(Problem(air, limits, (1000.0, 1000.0, 35.0), (7000.0, 7000.0, 35.0), budget=budget), *ends, 60.0)
        leg.flood(0.15)
        return leg

    whole = flooded(1.0)
    for part in (0.0, 0.02, 0.1, 0.3, 0.6):
        leg = flooded(part)
        assert leg.straight_m * 0.999 <= leg.length_m <= whole.length_m
        assert leg.corridor(leg.length_m).cells.any()
