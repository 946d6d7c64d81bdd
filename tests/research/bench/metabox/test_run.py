"""The benchmark beside MetaEvoBox, over a small package that looks like it: processes answer and end; its table."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from gcsplan.errors import InputError
from gcsplan.research.bench.metabox import run as metabox
from gcsplan.research.bench.metabox.run import Worker
from gcsplan.research.optimisers.registry import OPTIMISERS
from tests.research.bench.metabox.made import FEW
from tests.support.metabox import interpreter


@pytest.mark.slow
def test_every_run_has_its_record_and_nobody_more_than_the_budget(result: dict[str, Any]) -> None:
    keys = [(r["instance"], r["algorithm"], r["run"]) for r in result["runs"]]
    assert keys == [(i, a, k) for i in range(2) for a in FEW["algorithms"] for k in range(2)]  # type: ignore[attr-defined]
    for record in result["runs"]:
        fails = record["algorithm"] == "DE"
        assert record["evaluations"] == (60 if fails else 100)
        assert record["outside"] == (30 if fails else 0)
        assert record["failed"] == ("RuntimeError: no more" if fails else "")
        assert record["cost"] > 0.0
    assert result["settings"]["threats"] == [15, 30]
    assert result["settings"]["dims"] == [30, 30]
    assert result["versions"]["metaevobox"] == "9"


@pytest.mark.slow
def test_a_run_is_the_same_again_and_in_two_processes(result: dict[str, Any], python: Path, tmp_path: Path) -> None:
    again = metabox.run(tmp_path, python, jobs=2, **FEW)  # type: ignore[arg-type]
    assert again == result
    assert len(list(tmp_path.glob("*.pkl"))) == 2
    told: list[tuple[int, int]] = []
    metabox.run(tmp_path, python, done=lambda a, b: told.append((a, b)), **FEW | {"instances": 1})  # type: ignore[arg-type]
    assert told[-1] == (6, 6)


@pytest.mark.slow
def test_a_cost_that_is_not_the_known_one_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the cost of MetaEvoBox is not the known one"):
        metabox.run(tmp_path / "out", interpreter(tmp_path, extra=0.01), **FEW)  # type: ignore[arg-type]


@pytest.mark.parametrize("python", [Path("/nowhere/python"), Path(sys.executable)])
def test_without_metaevobox_the_message_says_how_to_get_it(python: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"MetaEvoBox needs an environment of its own: .*pip install") as raised:
        metabox.run(tmp_path, python)
    assert raised.value.problems[0].where == str(python)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"algorithms": ["gwoo"]}, "gwo"),
        ({"instances": 57}, "1 to 56 instances"),
        ({"runs": 0}, "not 2, 0, 2500 and 1"),
        ({"evaluations": 99}, "100 evaluations or more"),
    ],
)
def test_what_cannot_be_run_is_refused(change: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        metabox.run(tmp_path, Path("/nowhere"), **change)


def test_ours_are_all_rules_once() -> None:
    assert set(OPTIMISERS) - set(metabox.ours()) == {"po"}  # ABO with α = β = 1


@pytest.mark.slow
def test_clear_paths_are_those_without_a_penalty(tmp_path: Path, python: Path) -> None:
    file = tmp_path / "one.pkl"
    with Worker(python) as worker:
        worker.ask("make", file=str(file), threats=2, seed=1)
        worker.load([file])
        import numpy as np

        points = np.random.default_rng(2).random((200, 30))
        judged = worker.ask("judge", points, instance=0)
        found = worker.cost(0)(points)
    np.testing.assert_allclose(found, judged["costs"], rtol=1e-9)
    # Without a penalty of 10 000 a path of this little world costs a few thousand.
    assert judged["clear"] == [cost < 1e4 for cost in judged["costs"]]
    assert 0 < sum(judged["clear"]) < 200


def test_a_process_that_ends_is_told_with_its_last_words(tmp_path: Path) -> None:
    program = tmp_path / "python"
    program.write_text("#!/bin/sh\necho a broken thing >&2\n", encoding="utf-8")
    program.chmod(0o755)
    with pytest.raises(InputError, match="Its last words: a broken thing"):
        Worker(program)


@pytest.mark.slow
def test_rows_are_places_and_what_was_said_of_the_runs(tmp_path: Path) -> None:
    costs = {"gwo": [[1.0, 2.0], [10.0, 11.0]], "DE": [[3.0, 4.0], [20.0, None]]}
    result: dict[str, Any] = {
        "settings": {
            "algorithms": ["DE", "gwo"], "instances": 2, "runs": 2, "seed": 1, "evaluations": 100, "threats": [15, 30],
        },
        "versions": {"metaevobox": "9"},
        "runs": [
            {
                "instance": i, "algorithm": name, "run": k, "cost": costs[name][i][k], "clear": name == "gwo",
                "evaluations": 100, "outside": 25 * (name == "DE"), "failed": "x" * (name == "DE" and k == 1),
            }
            for i in range(2) for name in costs for k in range(2)
        ],
    }  # fmt: skip
    first, second = metabox.rows(result)
    assert (first["optimiser"], first["of"], first["place_percent"], first["p"]) == ("gwo", "gcsplan", 25.0, 1.0)
    assert first["over_percent"] == pytest.approx((50.0 + 5.0) / 2.0)
    assert (second["optimiser"], second["of"], second["place_percent"]) == ("DE", "MetaEvoBox", 75.0)
    assert 0.0 < second["p"] < 0.1
    assert (second["over_percent"], second["medians"]) == (None, [3.5, None])
    assert (first["clear"], second["clear"], second["outside"], second["failed"]) == (1.0, 0.0, 0.25, 2)
    files = metabox.write(result, tmp_path)
    assert [file.name for file in files] == ["metabox.json", "metabox.md", "metabox-runs.csv"]
    assert json.loads(files[0].read_text())["rows"][0]["optimiser"] == "gwo"
    page = files[1].read_text()
    assert "its published instances are others" in page
    assert "| DE | MetaEvoBox | 75 |" in page
    assert "25.0 % of its points are out of the box; 2 runs failed" in page
