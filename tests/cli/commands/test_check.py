"""`gcsplan check`."""

from __future__ import annotations

import json
import re
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


def test_check_with_options_alone_tells_findings_and_way_home_in_the_units_asked(run: Any, tmp_path: Path) -> None:
    """The words of options once took the quantities out of findings."""
    steps = [(36.6, -84.35, 60, 22), (36.6, -84.30, 150, 16), (36.62, -84.25, 350, 16), (36.62, -84.25, 0, 21)]
    rows = ["QGC WPL 110", "0\t1\t0\t16\t0\t0\t0\t0\t36.6\t-84.35\t300\t1"]
    rows += [f"{k}\t0\t3\t{c}\t0\t0\t0\t0\t{y}\t{x}\t{z}\t1" for k, (y, x, z, c) in enumerate(steps, start=1)]
    file = tmp_path / "m.waypoints"
    file.write_text("\n".join(rows) + "\n")
    world = ("--dem", "sample:jacksboro", "--min-agl", "120", "--max-agl", "130", "--units", "aviation", "--way-home")
    code, out, err = run("check", str(file), *world, "-q")
    assert code == 4
    lines = [line for line in (out + err).splitlines() if not line.startswith(("note: ", "warning: "))]
    assert any("ft, limit" in line for line in lines)
    assert not [line for line in lines if re.search(r"\d ?(m|km|m/s)\b", line)]
