"""Zones that can be passed over: the bound is as near the best path as that of walls, and never above it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from gcsplan.planners.optimal.loop.workspace import Workspace
from gcsplan.planners.optimal.plane.incumbent import Incumbent
from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.optimal.searches.outline_bound import OutlineBound
from gcsplan.planners.optimal.searches.outlines import Outlines
from gcsplan.planners.problem import Problem, Via
from gcsplan.world.airspace import Airspace
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.surface import Surface
from gcsplan.world.geometry.zones import Circle, Level, Polygon, Zone
from gcsplan.world.terrain.peaks import flat_grid

GRID, FRAME = flat_grid(0.0, (-3000.0, -3000.0, 3000.0, 3000.0))
FLAT = Surface(GRID, GRID, FRAME)
START, GOAL = (-700.0, 0.0, 36.0), (700.0, 0.0, 36.0)


def box(west: float, south: float, east: float, north: float, top_m: float, datum: Any = "agl") -> Zone:
    ring = np.array([[west, south], [east, south], [east, north], [west, north]], float)
    return Zone(f"box {west:g}", Polygon(ring), None, Level(top_m, datum))


def disc(east: float, north: float, radius: float, top_m: float) -> Zone:
    return Zone(f"disc {east:g}", Circle(east, north, radius), None, Level(top_m, "agl"))


def mission(*zones: Zone, **more: Any) -> Problem:
    limits = Limits(30.0, **{"horizontal_clearance_m": 30.0, "track_error_m": 3.0, "altitude_error_m": 5.0} | more)
    return Problem(Airspace(FLAT, zones), limits, START, GOAL)


CASES: dict[str, Problem] = {
    "over the middle": mission(box(-150, -300, 150, 300, 100)),
    "over a corner": mission(box(-150, -300, 150, 220, 200)),
    "around": mission(box(-150, -300, 150, 300, 400)),
    "over a long wall": mission(box(-50, -2500, 50, 2500, 150)),
    "over a disc": mission(disc(0, 60, 300, 120)),
    "three in a row": mission(box(-400, -200, -250, 200, 100), disc(0, 0, 100, 130), box(250, -200, 400, 200, 160)),
    "beside a wall": mission(box(-150, -300, 150, 300, 100), Zone("wall", Circle(-450, -20, 150))),
    "below 120 m": mission(box(-150, -300, 150, 300, 80), max_agl_m=120.0),
    "around, below 120 m": mission(box(-150, -300, 150, 300, 300), max_agl_m=120.0),
    "steeper than it may climb": mission(box(-500, -900, 150, 900, 150), max_climb_deg=15.0, max_descent_deg=15.0),
}


@pytest.mark.nightly_but("over a disc", "three in a row", "around, below 120 m", "steeper than it may climb")
@pytest.mark.first_quick
@pytest.mark.parametrize("name", CASES)
def test_the_gap_closes_in_tenths_of_a_second(name: str) -> None:
    found = plan(CASES[name])
    # A path over several zones rises to each of them, but the bound counts the dearest climb alone.
    assert found.path.length_m <= found.lower_bound * (1.0015 if name == "three in a row" else 1.001)
    assert CASES[name].budget.spent < 0.5


@pytest.mark.slow
def test_a_via_in_between_may_be_reached_at_any_altitude() -> None:
    p = mission(box(-150, -300, 150, 300, 100))
    free, high = (
        plan(Problem(p.airspace, p.limits, START, GOAL, (Via(300.0, 40.0, z),), gap_percent=0.01)) for z in (None, 90.0)
    )
    for found in (free, high):
        assert found.path.length_m <= found.lower_bound * (1.0 + 2.5e-4)
    assert high.path.length_m > free.path.length_m


@pytest.mark.slow
def test_the_path_over_a_zone_is_the_best_of_all_sampled_ones() -> None:
    found = plan(CASES["over a corner"])
    # Up to p, level to q, down: over the grown outline of the box, brute force over its sides.
    top, reach = 205.0 - 36.0, 33.0
    north = np.linspace(-300.0 - reach, 220.0 + reach, 1200)
    p, q = np.meshgrid(north, north)
    off = np.maximum(0.0, np.maximum(p - 220.0, -300.0 - p)), np.maximum(0.0, np.maximum(q - 220.0, -300.0 - q))
    half = [150.0 + np.sqrt(np.maximum(reach**2 - o**2, 0.0)) for o in off]
    lengths = (
        np.sqrt((700.0 - half[0]) ** 2 + p**2 + top**2)
        + np.hypot(half[0] + half[1], p - q)
        + np.sqrt((700.0 - half[1]) ** 2 + q**2 + top**2)
    )
    assert found.lower_bound <= lengths.min() <= found.path.length_m * (1.0 + 1e-6)
    assert found.path.length_m == pytest.approx(float(lengths.min()), rel=2e-4)


@pytest.mark.first_quick
@pytest.mark.parametrize("seed", range(4))
def test_the_bound_of_energy_counts_the_climb_over_the_highest_zone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    zones = [disc(float(e), float(rng.uniform(-80, 80)), 90.0, float(rng.uniform(60, 200))) for e in (-400, 0, 400)]
    p = mission(*zones, horizontal_clearance_m=10.0)
    p = Problem(p.airspace, p.limits, START, GOAL, (), "energy", vertical_j_per_m=2.0, horizontal_j_per_m=100.0)
    found = plan(p)
    cost = p.cost(found.path)
    assert found.lower_bound <= cost <= found.lower_bound * 1.001
    assert math.isfinite(cost)


@pytest.mark.slow
def test_the_bound_over_a_long_wall_has_its_climb_and_its_descent() -> None:
    """Around the wall it is kilometres: over it a path rises by 119 m within 617 m, and sinks again."""
    work = Workspace(Incumbent(CASES["over a long wall"]))
    incumbent = work.incumbent
    Outlines(work).run()
    around_m = incumbent.bound
    OutlineBound(work).run()
    over_m = 2.0 * math.hypot(617.0, 155.0 - 36.0) + 166.0
    assert around_m == pytest.approx(1400.0, rel=1e-3)
    assert incumbent.bound == pytest.approx(over_m, rel=1e-3)
    assert incumbent.bound <= incumbent.cost == pytest.approx(over_m, rel=2e-3)
