"""The table of optimisers beside MetaEvoBox's."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gcsplan.research.bench.metabox import report as metabox_report


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
    first, second = metabox_report.rows(result)
    assert (first["optimiser"], first["of"], first["place_percent"], first["p"]) == ("gwo", "gcsplan", 25.0, 1.0)
    assert first["over_percent"] == pytest.approx((50.0 + 5.0) / 2.0)
    assert (second["optimiser"], second["of"], second["place_percent"]) == ("DE", "MetaEvoBox", 75.0)
    assert 0.0 < second["p"] < 0.1
    assert (second["over_percent"], second["medians"]) == (None, [3.5, None])
    assert (first["clear"], second["clear"], second["outside"], second["failed"]) == (1.0, 0.0, 0.25, 2)
    files = metabox_report.write(result, tmp_path)
    assert [file.name for file in files] == ["metabox.json", "metabox.md", "metabox-runs.csv"]
    assert json.loads(files[0].read_text())["rows"][0]["optimiser"] == "gwo"
    page = files[1].read_text()
    assert "its published instances are others" in page
    assert "| DE | MetaEvoBox | 75 |" in page
    assert "25.0 % of its points are out of the box; 2 runs failed" in page
