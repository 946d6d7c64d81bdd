"""`gcsplan check`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.support.crossing import CROSSING


def test_check_passes_what_plan_wrote_and_finds_what_was_spoilt(run: Any, tmp_path: Path) -> None:
    assert run("plan", CROSSING, "-o", "out")[0] == 0
    for name in ("uav1.waypoints", "uav1.plan"):
        assert run("check", CROSSING, f"out/{name}")[0] == 0
    rows = (tmp_path / "out" / "uav1.waypoints").read_text().splitlines()
    for i in range(4, len(rows) - 1):
        spoilt = rows[i].split("\t")
        spoilt[10] = str(float(spoilt[10]) - 20)
        rows[i] = "\t".join(spoilt)
    (tmp_path / "uav1.waypoints").write_text("\n".join(rows) + "\n")
    code, out, _ = run("check", CROSSING, "uav1.waypoints", "--json")
    assert code == 4
    kinds = {v["kind"] for v in json.loads(out)["verdicts"][0]["violations"]}
    assert "min_agl" in kinds
    code, out, _ = run("check", CROSSING, "uav1.waypoints")
    assert code == 4
    assert "too low above ground" in out


def test_what_cannot_be_judged_is_exit_4_unless_allowed(run: Any, tmp_path: Path) -> None:
    assert run("plan", CROSSING, "-o", "out")[0] == 0
    text = (tmp_path / "out" / "uav1.waypoints").read_text()
    text += f"{len(text.splitlines()) - 1}\t0\t2\t177\t3\t2\t0\t0\t0\t0\t0\t1\n"
    (tmp_path / "uav1.waypoints").write_text(text)
    assert run("check", CROSSING, "uav1.waypoints")[0] == 4
    assert run("check", CROSSING, "uav1.waypoints", "--allow-unjudged")[0] == 0
