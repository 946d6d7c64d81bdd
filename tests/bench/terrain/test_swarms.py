"""mealpy's swarms on a problem: their paths and costs."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gcsplan.bench.terrain.problems import NamedProblem
from tests.bench.terrain.made import easy

pytestmark = pytest.mark.slow


def test_a_swarms_path_joins_the_ends_and_a_legal_one_costs_its_length(
    main: list[NamedProblem],
) -> None:
    from gcsplan.bench.terrain.swarms import encoding

    one = easy(main).problem
    decode, cost = encoding(replace(one, airspace=main[8].problem.airspace))
    x = np.full(16, 0.5)
    x[8:] = 1.0
    points = decode(x)
    assert points.shape == (200, 3)
    assert tuple(points[0]) == one.start
    assert tuple(points[-1]) == one.goal
    hard, harder = encoding(main[8].problem)[1], encoding(main[48].problem)[1]
    low = x.copy()
    low[8:] = 0.0
    assert harder(low) >= hard(low) > 2.0 * math.dist(one.start, one.goal)
    assert cost(x) >= float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) * (1.0 - 1e-12)


def test_a_search_of_mealpys_ends_after_exactly_its_evaluations(monkeypatch: pytest.MonkeyPatch) -> None:
    from gcsplan.bench.terrain import swarms

    class Draws:
        """As mealpy's models: ``solve`` evaluates the function more often than it is allowed to."""

        def __init__(self, epoch: int, pop_size: int) -> None:
            self.calls = epoch * pop_size

        def solve(self, problem: dict[str, Any], seed: int) -> None:
            rng = np.random.default_rng(seed)
            for _ in range(self.calls):
                problem["obj_func"](rng.uniform(-0.1, 1.1, len(problem["bounds"])))

    mealpy = SimpleNamespace(DE=SimpleNamespace(OriginalDE=Draws), FloatVar=lambda lb, ub: lb)
    monkeypatch.setattr(swarms, "rival_module", lambda name: mealpy)
    tried: list[float] = []

    def cost(x: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        tried.append(float((x[0] ** 2).sum()))
        return np.array(tried[-1:])

    best, least = swarms.minimised(cost, 3, "DE", 40, seed=1)
    assert len(tried) == 40
    assert least.tolist() == [math.inf, *np.minimum.accumulate(tried)]
    assert (best**2).sum() == least[-1]
