"""Chains on sections: no path is cheaper than their bound, and little is left between it and the best path."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.plane.section_kernels import lay_leg
from gcsplan.planners.optimal.plane.sections import lay_out, lines_of, widest_spans
from gcsplan.planners.optimal.searches.bound import Bound
from gcsplan.planners.optimal.searches.sections import Planes, SectionChains
from gcsplan.planners.optimal.searches.straight import Straight
from gcsplan.planners.problem import Objective, Problem, Via
from gcsplan.planners.profile.cross_sections import tightened
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.path import Path
from gcsplan.world.geometry.surface import GridMap, Surface
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.support.planner_worlds import faults
from tests.support.searches import improve, looked, over_flat

POST_M = 40.0


def hills(seed: int, objective: Objective = "length", climb_deg: float = 90.0, errors: bool = False) -> Problem:
    """Over hills of some hundred metres, 3.4 km from west to east, 30 to 90 m above ground; the zone in the way has a
    ceiling above ground if the seed is odd."""
    rng = np.random.default_rng(seed)
    n = 101
    x, y = np.meshgrid(np.arange(n) * POST_M, np.arange(n) * POST_M)
    z = np.zeros((n, n))
    for _ in range(12):
        a, b = rng.uniform(-1.0, 1.0, 2) * 2.0 * np.pi / rng.uniform(500.0, 2500.0)
        z += rng.uniform(4.0, 22.0) * np.sin(a * x + b * y + rng.uniform(0.0, 6.0))
    surface = Surface(z, z, GridMap.affine(0.0, (n - 1) * POST_M, POST_M, POST_M))
    some = {"track_error_m": 3.0, "altitude_error_m": 4.0, "horizontal_clearance_m": 20.0} if errors else {}
    limits = Limits(30.0, 90.0, max_climb_deg=climb_deg, max_descent_deg=climb_deg, **some)
    lid = Level(60.0, "agl") if seed % 2 else None
    air = Airspace(surface, (Zone("disc", Circle(2000.0, 2100.0, 180.0), None, lid),))
    (e0, n0), (e1, n1) = (300.0, 2000.0), (3700.0, 2000.0)
    low = air.floor_amsl(np.array([e0, e1]), np.array([n0, n1]), limits) + 5.0
    return Problem(air, limits, (e0, n0, float(low[0])), (e1, n1, float(low[1])), objective=objective)


def found(problem: Problem) -> Workspace:
    """A workspace after all searches."""
    work = looked(problem)
    improve(work)
    assert work.incumbent.best is not None
    return work


def look(work: Workspace) -> None:
    """Run all looks at the sections."""
    search = SectionChains(work)
    while search.is_open():
        search.choose()
        search.run()


@pytest.mark.slow
@pytest.mark.parametrize("errors", [pytest.param(False, marks=pytest.mark.nightly), True])
@pytest.mark.parametrize(("objective", "climb_deg"), [("length", 90.0), ("length", 12.0), ("energy", 20.0)])
def test_a_path_drawn_together_costs_no_less_than_the_bound(
    objective: Objective, climb_deg: float, errors: bool
) -> None:
    for seed in (1, 2):
        problem = hills(seed, objective, climb_deg, errors)
        work = looked(problem)
        improve(work, without=("bound", "cap_pairs", "bound_corridor", "outline_bound"))
        incumbent = work.incumbent
        assert incumbent.best is not None
        look(work)
        points = incumbent.best
        for _ in range(3):
            points, _ = tightened(problem, points)
        path = Path(points)
        assert faults(problem, path) == []
        assert problem.cost(path) >= incumbent.bound


@pytest.mark.parametrize(
    ("objective", "gap"), [("length", 0.0025), pytest.param("energy", 0.02, marks=pytest.mark.slow)]
)
def test_the_bound_over_hills_comes_near_the_best_path(objective: Objective, gap: float) -> None:
    work = looked(hills(6, objective, 25.0))
    improve(work, without=("bound", "outline_bound"))
    assert work.incumbent.gap < gap
    assert max(s.bound_percent for s in work.incumbent.steps if s.name == "sections") > 0.1


def test_a_via_is_passed_and_the_bound_counts_the_way_by_it() -> None:
    problem = replace(hills(4), via=(Via(2000.0, 2600.0),))
    work = found(problem)
    assert work.incumbent.gap < 0.005
    ends = np.array([problem.start[:2], (2000.0, 2600.0), problem.goal[:2]])
    assert work.incumbent.bound > np.hypot(*np.diff(ends, axis=0).T).sum()


def test_it_needs_a_ceiling_above_ground_and_a_path() -> None:
    work = looked(over_flat())
    assert work.incumbent.best is not None
    assert not SectionChains(work).applies()
    low = Workspace(Incumbent(over_flat(max_agl_m=120.0)))
    search = SectionChains(low)
    assert not search.applies()
    Straight(low).run()
    assert search.applies()
    search.run()
    assert low.incumbent.gap < 1e-6


def test_unknown_ground_among_the_nodes_leaves_no_sections() -> None:
    problem = hills(5)
    heights = problem.airspace.surface.ground_m.copy()
    heights[40, 45:55] = np.nan
    surface = Surface(heights, heights, problem.airspace.surface.grid)
    for air, known in ((Airspace(surface), False), (problem.airspace, True)):
        plane = looked(replace(problem, airspace=air)).plane
        lines = lines_of(plane, 120.0)
        assert (lay_out(plane, lines, widest_spans(plane, lines, 3700.0), 20.0) is not None) == known


@pytest.mark.parametrize("limits", [Limits(30.0, 60.0), Limits(30.0, max_amsl_m=130.0)])
def test_where_level_metres_cost_nothing_no_bound_is_above_a_long_way_around(limits: Limits) -> None:
    x, y = np.meshgrid(np.arange(61) * POST_M, 2400.0 - np.arange(61) * POST_M)
    ridge = 60.0 * np.exp(-(((x - 1200.0) / 150.0) ** 2)) * np.clip((y - 300.0) / 200.0, 0.0, 1.0)
    air = Airspace(Surface(ridge, ridge, GridMap.affine(0.0, 2400.0, POST_M, POST_M)))
    problem = Problem(
        air, limits, (900.0, 1800.0, 40.0), (1500.0, 1800.0, 40.0), objective="energy", horizontal_j_per_m=0.0
    )
    around = Path(np.array([problem.start, (900.0, 100.0, 40.0), (1500.0, 100.0, 40.0), problem.goal]))
    assert faults(problem, around) == []
    assert problem.cost(around) == 0.0
    work = looked(problem)
    for search in (Straight(work), Bound(work), SectionChains(work)):
        search.run()
    assert work.incumbent.best is not None
    assert work.incumbent.bound == 0.0


def limited(objective: Objective, climb_deg: float, descent_deg: float) -> Problem:
    """A problem with these climb limits."""
    problem = over_flat(max_agl_m=120.0, objective=objective)
    return replace(problem, limits=replace(problem.limits, max_climb_deg=climb_deg, max_descent_deg=descent_deg))


def cost_of(problem: Problem, run: float, rise: float) -> float:
    """The cost of the shortest path over ``run`` metres of track that rises ``rise`` metres within the climb limits."""
    limits = problem.limits
    longer = max(run, abs(rise) / (limits.max_climb_slope if rise > 0.0 else limits.max_descent_slope))
    if problem.objective == "energy":
        return problem.horizontal_j_per_m * longer + problem.vertical_j_per_m * abs(rise)
    return math.hypot(longer, rise)


@given(
    st.sampled_from(["length", "energy"]), st.floats(5.0, 90.0), st.floats(5.0, 90.0), st.floats(0.0, 500.0),
    st.floats(-500.0, 500.0),
)  # fmt: skip
def test_no_leg_is_cheaper_than_a_plane(
    objective: Objective, climb_deg: float, descent_deg: float, run: float, rise: float
) -> None:
    problem = limited(objective, climb_deg, descent_deg)
    planes = Planes.of(problem)
    assert np.all(np.diff(planes.slope) > 0.0)
    cost = float((planes.slant * run + planes.slope * rise).max())
    assert cost <= cost_of(problem, run, rise) * (1.0 + 1e-6) + 1e-9
    if run > 0.0 and abs(rise) < 0.5 * run:
        assert cost >= cost_of(problem, run, rise) * (0.98 if objective == "length" else 0.95)


@given(
    st.sampled_from(["length", "energy"]), st.floats(5.0, 44.0), st.floats(5.0, 90.0), st.floats(0.0, 1.0),
    st.floats(0.0, 1.2), st.sampled_from([-1.0, 1.0]), st.integers(0, 30), st.floats(0.2, 12.0), st.floats(30.0, 240.0),
)  # fmt: skip
def test_a_rounded_leg_costs_in_expectation_no_more_than_leg_and_rebate(
    objective: Objective, climb_deg: float, other_deg: float, kink: float, slope: float, sign: float, steps: int,
    step: float, gap: float,
) -> None:  # fmt: skip
    problem = limited(objective, *((climb_deg, other_deg) if sign > 0.0 else (other_deg, climb_deg)))
    planes = Planes.of(problem)
    runs = np.hypot(gap, step * (steps + np.arange(2)))
    # At the limit on a leg between the two that it is rounded to, and on any slope.
    at_limit = math.tan(math.radians(climb_deg)) * math.hypot(gap, step * (steps + kink))
    legs, most = np.empty((steps + 2, len(planes.slope) + 1)), np.array([step, planes.level, math.inf])
    for at in range(steps + 2):
        lay_leg(legs, at, gap, len(planes.slope), planes.slant, planes.loss, most)
    for rise in (sign * at_limit, sign * slope * runs[0]):
        rounded = (legs[steps:, :-1] + planes.slope * rise).max(axis=1)
        for part in np.linspace(0.0, 1.0, 9):  # the rounded difference is a step more with this probability
            cost = cost_of(problem, math.hypot(gap, step * (steps + part)), rise)
            assert rounded @ (1.0 - part, part) <= cost * (1.0 + 1e-6) + planes.level * step**2 / (8.0 * gap)
