"""A verdict on the terminal, in the units that are asked for."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any


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
