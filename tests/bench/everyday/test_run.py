"""The run of the everyday missions: its outcomes beside the visibility graph, and their table."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from gcsplan.bench.everyday.run import MissionOutcome, as_csv, line, report, run
from gcsplan.errors import InputError


def made() -> list[MissionOutcome]:
    step = {"name": "straight", "gained_percent": 1.5, "bound_percent": 0.0, "refused": 0, "s": 0.25}
    solved = MissionOutcome(
        "1/000", "leg", False, 500.0, 0, "solved", cost=505.0, bound=500.0, gap_percent=1.0, oracle_m=500.0,
        over_percent=1.0, first_path_s=0.1, planning_s=0.5, memory_mb=3.0, search=json.dumps([step, step]),
    )  # fmt: skip
    lost = replace(
        solved, name="1/013", status="not found", cost=None, gap_percent=None, over_percent=None, search="[]"
    )
    return [solved, lost, replace(lost, name="1/002", kind="wall", status="infeasible")]


def test_the_table_counts_statuses_by_kind_and_what_each_search_gained() -> None:
    rows = [[cell.strip() for cell in row.split("|")[1:-1]] for row in report(made()).splitlines()]
    assert rows[2][:7] == ["leg", "2", "1", "0", "1", "0", "1, 1, 1"]
    assert rows[3][:6] == ["wall", "1", "0", "1", "0", "0"]
    assert rows[4][:6] == ["all", "3", "1", "1", "1", "0"]
    assert rows[-1] == ["straight", "2", "2", "1.5", "0", "0", "0", "0.5"]


def test_lines_and_rows_have_every_mission_and_leave_empty_what_is_unknown() -> None:
    rows = list(csv.DictReader(as_csv(made()).splitlines()))
    assert [(row["name"], row["status"], row["cost"]) for row in rows] == [
        ("1/000", "solved", "505.0"), ("1/013", "not found", ""), ("1/002", "infeasible", ""),
    ]  # fmt: skip
    assert "gap   1.000 % over oracle   1.000 %" in line(made()[0])
    assert "gap - % over oracle - %" in line(made()[1])


@pytest.mark.slow
def test_a_mission_with_nothing_in_the_way_is_as_long_as_the_graph_says(tmp_path: Path) -> None:
    told: list[str] = []
    (found,) = run(tmp_path, count=1, kinds=["leg"], tell=told.append)
    assert (found.name, found.kind, found.status, found.zones) == ("1/000", "leg", "solved", 0)
    assert found.over_percent == pytest.approx(0.0, abs=1e-4)
    assert found.oracle_m == pytest.approx(found.straight_m)
    assert told == [line(found)]
    assert (tmp_path / "everyday.csv").read_text(encoding="utf-8").count("\n") == 2
    assert (tmp_path / "everyday.md").read_text(encoding="utf-8") == report([found])


def test_an_unknown_kind_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="given 'legs'"):
        run(tmp_path, kinds=["legs"])
    assert list(tmp_path.iterdir()) == []
