"""The benchmark of the swarms' speed: one objective, its aims, and the parts of its time."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest

from gcsplan.errors import InputError
from gcsplan.research.bench.papers import speed as papers_speed


def test_speed_is_measured_on_one_and_the_same_objective(monkeypatch: pytest.MonkeyPatch) -> None:
    cost, size, rounds = papers_speed.cost_of(papers_speed.CASE, None)
    assert (cost.dim, size, rounds) == (90, 30, 500)
    u = np.random.default_rng(1).random((40, 90))
    assert np.array([cost(x[None])[0] for x in u]) == pytest.approx(cost(u))
    monkeypatch.setitem(sys.modules, "mealpy", None)
    with pytest.raises(InputError, match=re.escape("pip install 'gcsplan[bench]'")):
        papers_speed.run(1)
    with pytest.raises(InputError, match="1 or more"):
        papers_speed.run(0)


def test_the_speed_report_says_what_was_missed() -> None:
    made = {
        "repeats": 3, "population": 30, "iterations": 500, "run_s": 0.2, "single_s": 1.0,
        "krill_s": {"krill-mound": 0.6}, "costs_per_s": {"krill cost, bspline": 3e5},
        "single_ratio": 5.0, "mealpy_ratio": 9.0, "parts_us": {},
    }  # fmt: skip
    lines = [line.split() for line in papers_speed.report(made).splitlines()[1:]]
    assert [line[-1] for line in lines] == ["reached", "missed", "reached", "missed", "reached"]
    assert "mealpy" not in papers_speed.report(made | {"mealpy_ratio": None})
    assert "\n  zones                                                  0.80\n" in papers_speed.report(
        made | {"parts_us": {"zones": 0.8}}
    )


@pytest.mark.slow
def test_the_parts_of_the_costs_time_add_up() -> None:
    took = {name: float(i) for i, name in enumerate(papers_speed.parts_of_cost(), start=1)}
    parts = papers_speed.differences(took)
    assert list(parts) == list(took)
    bare = (papers_speed.BARE_PART, papers_speed.DIVIDED_PART, papers_speed.ZONES_PART)
    assert sum(parts[name] for name in bare) == took[papers_speed.ZONES_PART]
    for name in papers_speed.TERM_GROUPS:
        assert parts[name] + took[papers_speed.ZONES_PART] == took[name]
    for measured in papers_speed.parts_of_cost().values():
        measured()
