"""The benchmark of scale: a small batch by one process, by two, and with one of them killed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gcsplan.app.parallel import executor
from gcsplan.bench.scale import run as scale
from gcsplan.errors import UsageError


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"axes": ["planets"]}, "cells, workers, given planets"),
        ({"axes": []}, "given none"),
        ({"missions": 3}, "4 to 10000 missions"),
        ({"workers": 1}, "2 to 64 workers, not 40 and 1"),
    ],
)
def test_what_cannot_be_measured_is_refused(change: dict[str, Any], message: str) -> None:
    told: list[str] = []
    with pytest.raises(UsageError, match=message):
        scale.run(**change, tell=told.append)
    assert told == []


def test_a_cluster_is_bounded_by_the_process_that_writes() -> None:
    alone = {"cpu_s": 100.0, "result_bytes": 5e4}
    shared = {"missions": 100, "worker_cpu_s": [49.0, 51.0], "own_cpu_s": 2.0, "scheduler_ms": 5.0, "item_bytes": 60.0}
    found = scale.cluster_of(alone, shared)
    assert [round(c["missions_per_s"], 9) for c in found["cores"]] == [1.0, 10.0, 50.0, 50.0]
    assert [c["bound"] for c in found["cores"]] == ["work", "work", "writer", "writer"]
    assert found["serial_part"] == pytest.approx(0.02 / 1.02)


@pytest.mark.nightly
def test_two_processes_write_the_same_bytes_as_one_even_if_one_is_killed(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    result = scale.run(["workers", "zones"], 30, 2, 2, kill=True)
    alone, two, killed = (row for row in result["rows"] if row["axis"] == "workers")
    assert alone["planned"] + alone["refused"] == 30
    assert alone["planned"] >= 25
    assert two["same_bytes"]
    assert killed["same_bytes"]
    assert (two["done_again"], two["killed"]) == (0, 0)
    assert killed["killed"] == 1
    # What was handed out and not yet fetched: begun, or done with its result still at the worker.
    assert killed["done_again"] <= executor.AHEAD * 2
    files = scale.write(result, tmp_path)
    assert {file.name for file in files} == {"scale.json", "scale.csv", "scale.md", "scale.png"}
    assert json.loads((tmp_path / "scale.json").read_text())["rows"][0]["axis"] == "zones"
    assert "| cores |" in (tmp_path / "scale.md").read_text()
