"""`gcsplan plan --leave-out`: who is left out is named everywhere, and the exit code tells it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.app.plan.test_left_out import GOOD, SHUT, WEAK, mission


@pytest.mark.slow
def test_the_command_names_them_writes_the_others_and_ends_with_three(run: Any, tmp_path: Path) -> None:
    file = tmp_path / "four.yaml"
    file.write_text(yaml.safe_dump(mission(GOOD[0], SHUT, GOOD[1], WEAK)))
    code, out, err = run("plan", file)
    assert code == 3
    assert not list((tmp_path / "four").glob("*.plan"))
    code, out, err = run("plan", file, "--leave-out", "--report", "--upload", "sim")
    assert code == 3
    assert "2 vehicles without a mission, left out: uav2, uav5" in err
    assert "verified" in out
    written = {f.name for f in (tmp_path / "four").iterdir()}
    assert {"uav1.plan", "uav3.plan", "summary.json", "report.html"} < written
    assert not [name for name in written if name.startswith(("uav2", "uav5"))]
    told = json.loads((tmp_path / "four" / "summary.json").read_text())
    assert [(v["name"], v["reason"]) for v in told["left_out"]] == [("uav2", "infeasible"), ("uav5", "battery")]
    page = (tmp_path / "four" / "report.html").read_text()
    assert "left out" in page
    assert "uav5" in page
    code, out, _ = run("plan", file, "--leave-out", "--json")
    document = json.loads(out)
    assert code == document["error"]["code"] == 3
    assert [v["name"] for v in document["left_out"]] == ["uav2", "uav5"]
    code, _, err = run("plan", file, "--leave-out", "-o", tmp_path / "good", "--planner", "nobody")
    assert code == 2


@pytest.mark.slow
def test_a_rehearsal_flies_the_others_and_ends_with_three(run: Any, tmp_path: Path) -> None:
    file = tmp_path / "four.yaml"
    file.write_text(yaml.safe_dump(mission(GOOD[0], SHUT, GOOD[1], leave_out=True)))
    code, out, err = run("rehearse", file)
    assert code == 3
    assert "1 vehicle without a mission, left out: uav2" in err
    assert "uav3" in out
    code, out, _ = run("rehearse", file, "--json")
    document = json.loads(out)
    assert code == document["error"]["code"] == 3
    assert [v["name"] for v in document["vehicles"]] == ["uav1", "uav3"]
