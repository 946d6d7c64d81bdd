"""The SSGWO paper's cylinders: the default planner and the oracles find their true optima.

Tables 3, 5 and 7 of the paper over flat ground, zero clearance, from (0, 0, 0) to (800, 800, 15): in plan view, with
cylinders of unlimited height, and with overflight. The paper's own best are 1132, 1167 and 1129 m, the last of which
is shorter than the straight line.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gcsplan.planners.optimal.planner import plan
from gcsplan.planners.problem import Problem, Solution
from gcsplan.world.airspace import Airspace, Legs
from gcsplan.world.geometry.limits import Limits
from gcsplan.world.geometry.zones import Circle, Level, Zone
from tests.oracles.optima import shortest_past_discs
from tests.oracles.optima_polish import PATIENT, cost_of, is_feasible
from tests.oracles.optima_search import best_path
from tests.support.planner_worlds import faults, ground

pytestmark = pytest.mark.nightly

# East, north, radius, top (m). With the centres that Table 7 prints, its cylinders would float 0.5 m or 1 m above the
# ground. Here they stand on it, with the printed height ("7") or with the printed top ("7 raised").
TABLES = {
    "3": (
        (250, 200, 40, 18), (600, 700, 30, 18), (130, 120, 30, 16), (300, 280, 40, 17), (350, 600, 40, 19),
        (480, 400, 60, 18), (700, 650, 40, 17), (720, 760, 50, 19),
    ),
    "5": (
        (250, 200, 40, 18), (600, 700, 35, 16), (130, 120, 30, 16), (300, 280, 50, 17), (350, 600, 40, 19),
        (480, 400, 60, 18), (700, 650, 40, 17), (720, 760, 30, 17), (620, 650, 25, 15), (520, 560, 30, 19),
        (400, 200, 25, 16), (700, 400, 30, 17),
    ),
    "7": (
        (150, 180, 45, 13), (300, 100, 60, 11), (380, 400, 45, 15), (480, 210, 45, 14), (320, 650, 45, 13.5),
        (430, 700, 45, 14), (560, 630, 45, 13), (750, 660, 45, 14),
    ),
    "7 raised": (
        (150, 180, 45, 13.5), (300, 100, 60, 11.5), (380, 400, 45, 15.5), (480, 210, 45, 15), (320, 650, 45, 14.25),
        (430, 700, 45, 15), (560, 630, 45, 13.5), (750, 660, 45, 15),
    ),
}  # fmt: skip
OVERFLIGHT_M = {"3": 1132.45, "5": 1132.30, "7": 1131.83, "7 raised": 1131.86}
PLAN_VIEW_M = {"3": 1140.392, "5": 1136.249, "7": 1133.588}
START, GOAL = (0.0, 0.0, 0.0), (800.0, 800.0, 15.0)
FINE_PERCENT = 0.002
"""The requested gap, smaller than the tolerance of the comparison with the optima."""


def problem(table: str, unlimited: bool) -> Problem:
    zones = tuple(
        Zone(f"cylinder {k}", Circle(*map(float, row[:3])), None, None if unlimited else Level(float(row[3]), "amsl"))
        for k, row in enumerate(TABLES[table])
    )
    air = Airspace(ground(0.0, size_m=800.0, step_m=200.0), zones)
    return Problem(air, Limits(0.0), START, GOAL, gap_percent=FINE_PERCENT)


def discs(table: str) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.array([row[:3] for row in TABLES[table]], float)


@cache
def solved(table: str, unlimited: bool) -> Solution:
    p = problem(table, unlimited)
    s = plan(p)
    assert p.airspace.examine(Legs.of_path(s.path.points, p.limits), p.limits).violations == ()
    assert faults(p, s.path, step_m=0.5) == []
    return s


@pytest.mark.parametrize("table", PLAN_VIEW_M)
def test_tangents_reproduce_the_optimum_in_plan_view(table: str) -> None:
    exact = math.hypot(shortest_past_discs(START[:2], GOAL[:2], discs(table)), GOAL[2])
    assert exact == pytest.approx(PLAN_VIEW_M[table], abs=5e-4)


@pytest.mark.parametrize("table", PLAN_VIEW_M)
def test_planner_reaches_the_optimum_in_plan_view(table: str) -> None:
    s = solved(table, True)
    exact = math.hypot(shortest_past_discs(START[:2], GOAL[:2], discs(table)), GOAL[2])
    assert exact - 1e-5 <= s.path.length_m <= 1.0001 * PLAN_VIEW_M[table]
    assert s.lower_bound is not None
    assert s.lower_bound <= exact + 1e-5


@pytest.mark.parametrize("table", TABLES)
def test_planner_reaches_the_optimum_over_and_around(table: str) -> None:
    s = solved(table, False)
    assert s.path.length_m <= OVERFLIGHT_M[table]


@pytest.mark.parametrize("table", TABLES)
def test_no_bound_lies_over_a_way_that_patience_found(table: str) -> None:
    p = problem(table, False)
    points = best_path(p, 1, replace(PATIENT, tries=4, best=2))
    assert points is not None
    assert is_feasible(p, points)
    best = cost_of(p, points)
    assert best <= OVERFLIGHT_M[table]
    s = solved(table, False)
    assert s.lower_bound is not None
    assert s.lower_bound <= min(best, s.path.length_m) + 1e-5
    assert s.path.length_m <= 1.0001 * best
