"""mealpy's swarms on a problem: their paths and costs."""

from __future__ import annotations

import math
from dataclasses import replace

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
