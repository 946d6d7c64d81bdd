"""The everyday missions: the same for a seed, readable, and drawn without a planner."""

from __future__ import annotations

import ast
import math
from pathlib import Path

import pytest

from gcsplan.bench.everyday import missions as everyday_missions
from gcsplan.bench.everyday import oracle as everyday_oracle
from gcsplan.bench.everyday import run as everyday
from gcsplan.bench.everyday.missions import EVERYDAY_KINDS, draw


@pytest.mark.first_quick
@pytest.mark.parametrize("kind", EVERYDAY_KINDS)
def test_missions_are_the_same_for_the_same_seed_and_can_be_read(kind: str) -> None:
    number = EVERYDAY_KINDS.index(kind) + len(EVERYDAY_KINDS)
    one = draw(7, number)
    assert one.kind == kind
    assert one.document == draw(7, number).document != draw(8, number).document
    problem = everyday.problem_of(one)
    straight = math.dist(problem.start[:2], problem.goal[:2])
    found = everyday.oracle_m(problem)
    assert (found is None) == (kind in ("peaks", "sample"))
    assert found is None or found >= straight - 1e-6


def test_neither_missions_nor_oracle_know_a_planner() -> None:
    for module in (everyday_missions, everyday_oracle):
        tree = ast.parse(Path(module.__file__ or "").read_text(encoding="utf-8"))
        names = [n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)]
        assert not [n for n in names if "planners" in n]
