"""Problems, outcomes and a planner that are made for the tests."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from gcsplan.bench.terrain.outcome import OUR_METHOD, MethodOutcome
from gcsplan.bench.terrain.problems import NamedProblem
from gcsplan.planners.problem import Problem, Solution
from gcsplan.world.geometry.path import Path as Flight


def straight(problem: Problem) -> np.ndarray:
    return np.array([problem.start, problem.goal])


def easy(main: list[NamedProblem]) -> NamedProblem:
    """One whose straight line is legal."""
    p = main[8]
    high = replace(p.problem.limits, max_amsl_m=None, max_climb_deg=90.0, max_descent_deg=90.0)
    up = [(e, n, 2000.0) for e, n, _ in (p.problem.start, p.problem.goal)]
    return replace(p, problem=replace(p.problem, limits=high, start=up[0], goal=up[1]))


class Fake:
    """A planner that goes the straight way, once it was asked ``fails`` times."""

    def __init__(self, error: Exception | None = None) -> None:
        self.error = error
        self.airspaces: list[int] = []

    def plan(self, problem: Problem) -> Solution:
        self.airspaces.append(id(problem.airspace))
        if self.error is not None:
            raise self.error
        way = math.dist(problem.start, problem.goal)
        return Solution(Flight(straight(problem)), 0.5 * way, "gap", 0.2, 0.1)


def outcome(key: str, method: str, cost: float | None, **more: object) -> MethodOutcome:
    status = "not found" if cost is None else "solved"
    return replace(MethodOutcome(key, f"p {key}", "main", "0 zones", method, status, cost=cost), **more)  # type: ignore[arg-type]


def several() -> list[MethodOutcome]:
    return [
        outcome("a", OUR_METHOD, 101.0, bound=100.0, first_path_s=0.02, planning_s=0.1, sweep_s=0.05, memory_mb=10.0),
        outcome("b", OUR_METHOD, 204.0, bound=200.0, first_path_s=0.04, planning_s=0.3, sweep_s=0.05, memory_mb=20.0),
        replace(outcome("c", OUR_METHOD, None), status="infeasible", detail="no way"),
        outcome("a", "OMPL RRT* 1 s", 110.0, planning_s=1.0),
        outcome("b", "OMPL RRT* 1 s", 202.0, planning_s=1.0),
        outcome("c", "OMPL RRT* 1 s", None),
    ]
