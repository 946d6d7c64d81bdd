"""A run of the swarms' benchmark: what it refuses, that it goes on, and that its table counts what was measured."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from gcsplan.errors import InputError
from gcsplan.research.bench.swarms import run as swarms
from gcsplan.research.bench.swarms.run import Attempt, Method, Optimum, SwarmsResult


def test_a_method_that_does_not_exist_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no method 'gradient'"):
        swarms.run(tmp_path, names=["gradient"])
    with pytest.raises(InputError, match="no module nowhere"):
        swarms.run(tmp_path, names=["nowhere:rule"])


def test_an_added_optimiser_is_one_row_beside_all_or_beside_the_named_ones() -> None:
    place = "gcsplan.research.optimisers.classics:de"
    every = swarms.methods()
    assert swarms.methods(names=[place]) == [*every, Method("gcsplan", place)]
    assert [m.label for m in swarms.methods(names=["krill", place, place])] == ["krill", place]


def test_kept_attempts_of_an_added_optimiser_count_while_its_file_is_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "kept_rule.py"
    file.write_text("def rule(run):\n    yield run.first()\n")
    monkeypatch.syspath_prepend(tmp_path)
    job = swarms.SwarmJob(1, 10, "m", Method("gcsplan", "kept_rule:rule"))
    before = job.key
    assert job.key == before
    file.write_text("def rule(run):\n    yield run.first()  # another\n")
    assert job.key != before


@pytest.mark.slow
def test_a_run_goes_on_and_gives_the_same_paths(tmp_path: Path) -> None:
    told: list[str] = []
    first = swarms.run(tmp_path, count=1, evaluations=600, names=["ib-abc"], warm=True, tell=told.append)
    assert len(told) == 9  # optimal, ib-abc, ib-abc around its path, on three missions each
    assert all(a.evaluations == 600 for a in first.attempts)
    with (tmp_path / "swarms.jsonl").open("a") as file:
        file.write('\n{"key": "torn')
    assert (
        swarms.run(tmp_path, count=1, evaluations=600, names=["ib-abc"], warm=True, tell=told.append).lines()
        == first.lines()
    )
    assert len(told) == 9
    again = swarms.run(tmp_path / "again", count=1, evaluations=600, names=["ib-abc"], warm=True)
    assert [(a.status, a.length_m) for a in again.attempts] == [(a.status, a.length_m) for a in first.attempts]
    rows = list(csv.DictReader((tmp_path / "swarms.csv").read_text().splitlines()))
    assert [r["warm"] for r in rows] == ["False"] * 3 + ["True"] * 3
    for row, attempt in zip(rows, first.attempts, strict=True):
        assert row["status"] == attempt.status
        if attempt.length_m is not None:
            assert attempt.length_m > float(row["bound_m"]) - 1e-6
    assert "| ib-abc, warm | offsets | length |" in (tmp_path / "swarms.md").read_text()
    assert json.loads((tmp_path / "swarms.jsonl").read_text().splitlines()[1])["answer"]["length_m"] > 0


def attempts() -> list[Attempt]:
    method = Method("gcsplan", "de")
    told = [("raw legal", 102.0, 1), ("repaired", 101.0, 1), ("repaired", 210.0, 1), ("refused", None, 3),
            ("refused", None, None)]  # fmt: skip
    return [
        Attempt(f"m{k}", "room", method, status, length, 10, 0.1 * k, 0.5, searches)  # type: ignore[arg-type]
        for k, (status, length, searches) in enumerate(told)
    ]


def test_the_table_tells_raw_legal_repaired_and_refused_apart() -> None:
    optima = {f"m{k}": Optimum(100.0 if k < 2 else 200.0, 99.0, 0.1) for k in range(5)}
    [line] = SwarmsResult(1, 10, optima, attempts(), [(0, 0)]).lines()
    assert line[:8] == ("de", "offsets", "length", "1", "2", "2", "60", "80")
    assert line[8:] == ("2.00", "4.40", "5.00", "2.00", "3.00", "0.20", "0.50")
