"""The rows of the papers' tables, and IB-ABC's schedule."""

from __future__ import annotations

import numpy as np
import pytest

from gcsplan.research.bench.papers.pictures import best_run
from gcsplan.research.bench.papers.statistics import row, schedule, values
from tests.research.bench.papers.made import SCENARIO, record


def test_a_row_says_what_numpy_says() -> None:
    records = [record("gwo", k, x, k % 2) for k, x in enumerate((1140.0, 1132.0, 1160.0))]
    line = row(SCENARIO, "gwo", [*records, {"status": "refused"}], 9)
    lengths = [r["length_m"] for r in records]
    assert line["mean_length_m"] == pytest.approx(np.mean(lengths))
    assert line["std_length_m"] == pytest.approx(np.std(lengths, ddof=1))
    assert line["median_length_m"] == 1140.0
    assert line["best_length_m"] == 1132.0
    assert line["best_legal_length_m"] == 1140.0
    assert (line["runs"], line["refused"], line["legal"], line["collided"]) == (4, 1, 2, 1)
    assert line["mean_cost_at_equal_evaluations"] is None  # at 9 evaluations no cost was finite
    assert values(records, "cost, equal evaluations", 10).tolist() == lengths
    assert best_run(records) is records[0]
    assert best_run(records[1:2]) is records[1]
    assert row(SCENARIO, "gwo", [{"status": "refused"}], 0)["mean_length_m"] is None


def test_the_schedules_arithmetic_is_the_papers() -> None:
    slots = schedule([261.115, 306.704, 350.520, 421.547], "sequence", 9.0, 3.0, 30.0)
    assert [s.time_s for s in slots] == pytest.approx([8.7038, 17.7038, 26.7038, 35.7038], abs=1e-4)
    assert [s.speed_m_s for s in slots] == pytest.approx([30.0, 17.324, 13.126, 11.807], abs=1e-3)
    together = schedule([261.670, 349.734, 327.469, 301.035], "together", 9.0, 3.0, 30.0)
    assert {round(s.time_s, 3) for s in together} == {11.658}
    assert together[1].speed_m_s == pytest.approx(30.0)
    late = schedule([90.0, 450.0, 30.0], "sequence", 9.0, 3.0, 30.0)
    assert [bool(s.trouble) for s in late] == [False, True, True]
    assert "faster" in late[1].trouble
    assert "slower" in late[2].trouble
