"""The papers' report: ours beside the printed, in text, tables and files; remarks follow from printed numbers alone."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import pytest

from gcsplan.research.bench.papers.printed import PRINTED
from gcsplan.research.bench.papers.report import IMPOSSIBLE_MARK as MARK
from gcsplan.research.bench.papers.report import remarks, report, scenario_table, schedules, write
from gcsplan.research.bench.papers.run import PAPER_RUNS_FILE, plain, run
from gcsplan.research.bench.papers.runs import Store
from gcsplan.research.bench.papers.scenarios import mission_text, prepare
from gcsplan.research.bench.papers.statistics import row
from tests.research.bench.papers.made import PAIR, SCENARIO, record


@pytest.mark.slow
def test_the_report_has_ours_beside_the_printed_and_marks_the_impossible(
    finished: tuple[dict[str, Any], Path],
) -> None:
    result, _ = finished
    table = scenario_table(result["scenarios"][0])
    best = table.header.index("best, m")
    assert table.header[best + 1] == "printed"
    ours = result["scenarios"][0]["rows"][0]
    assert table.rows[0][best] == f"{ours['best_length_m']:,.2f}"
    assert table.rows[0][best + 1] == f"1129 {MARK}"
    assert table.rows[1][best + 1] == "1263"
    text = report(result)
    assert "Straight line: 1,131.47 m" in text
    assert "Rankings are judged from 30 runs on" in text


@pytest.mark.slow
def test_the_files_hold_the_numbers_and_the_page_needs_no_other_file(finished: tuple[dict[str, Any], Path]) -> None:
    result, out = finished
    files = {path.name: path for path in write(result, out)}
    assert set(files) == {
        "papers.csv", "papers-claims.csv", "papers-claims.md", "papers-readings.csv", "papers-times.csv",
        "papers-times.md", "papers.md", "papers.html", f"{SCENARIO}-map.png", f"{SCENARIO}-convergence.png",
        f"{SCENARIO}-space.png", f"{SCENARIO}-boxes.png",
    }  # fmt: skip
    with files["papers.csv"].open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    rows = result["scenarios"][0]["rows"]
    assert [float(line["mean_length_m"]) for line in lines] == [r["mean_length_m"] for r in rows]
    for name in (n for n in files if n.endswith(".png")):
        assert files[name].read_bytes().startswith(b"\x89PNG\r\n")
    said = json.loads(json.dumps(plain(result), allow_nan=False))["scenarios"][0]
    assert said["rows"] == rows
    assert said["printed"]["ssgwo"]["best_length_m"] == "1129"
    page = files["papers.html"].read_text(encoding="utf-8")
    assert re.findall(r'src="(.{0,22})', page) == ["data:image/png;base64,"] * 4
    assert "http" not in page
    assert "<script" not in page
    text = files["papers.md"].read_text(encoding="utf-8")
    assert f"1129 {MARK}" in text
    assert "the straight line is 1131.47 m" in text


def test_another_clock_changes_the_files_of_times_alone(
    finished: tuple[dict[str, Any], Path], missions: Path, tmp_path: Path
) -> None:
    (tmp_path / "slow").mkdir()
    (tmp_path / "fast").mkdir()
    runs = [json.loads(line) for line in (finished[1] / PAPER_RUNS_FILE).read_text(encoding="utf-8").splitlines()]
    for one in runs[::-1]:  # finished in another order, at another speed
        Store(tmp_path / "slow" / PAPER_RUNS_FILE).append(one | {"time_s": 7.0 + one["time_s"]})
    (tmp_path / "fast" / PAPER_RUNS_FILE).write_bytes((finished[1] / PAPER_RUNS_FILE).read_bytes())
    said, seen = [], []
    for place in (tmp_path / "slow", tmp_path / "fast"):
        result = run([SCENARIO], PAIR, 2, jobs=1, out=place, missions=missions)
        said.append(report(result))
        seen.append({file.name: file.read_bytes() for file in write(result, place, draw=lambda _: {})})
    assert said[0] == said[1]
    assert {name for name in seen[0] if seen[0][name] != seen[1][name]} == {"papers-times.csv", "papers-times.md"}


def test_what_is_said_of_the_tables_is_worked_out_from_them() -> None:
    krill = " ".join(remarks("krill-forest"))
    assert "5 of the paper's 9 printed energies are 14.32 J/m" in krill
    assert "1.0 % against abc" in krill
    assert "2.1 % against aco" in krill
    msfoa = [" ".join(remarks(f"msfoa-{i}")) for i in (1, 2, 3)]
    assert "abc 411.17 < msfoa 416.96 < mfoa 417.06" in msfoa[0]
    assert "mfoa 388.33 < abc 401.01 < msfoa 404.21" in msfoa[1]
    assert "msfoa 454.52 < abc 457.46" in msfoa[2]
    assert "rows of foa and pso are identical" in msfoa[1]
    assert "identical" not in msfoa[0] + msfoa[2]


@pytest.mark.slow
def test_printed_times_that_stand_in_the_wrong_column_are_marked() -> None:
    name = "ib-abc-sequence"
    rows = [row(name, a, [record(a, 0, 1000.0, lengths_m=[250.0] * 4)], 0) for a in ("ib-abc", "b-abc", "abc")]
    summary = {"paper": "ib-abc", "set": prepare(name, mission_text(name)), "rows": rows,
               "printed": {a: PRINTED[name, a] for a in ("ib-abc", "b-abc", "abc")}}  # fmt: skip
    header, cells = schedules(summary)
    at = header.index("printed T, s")
    marked = {(c[0], c[1]) for c in cells if "≠" in c[at]}
    right = {("ib-abc", "uav1"), ("b-abc", "uav1"), ("abc", "uav1"), ("ib-abc", "uav4")}
    assert marked == {(a, f"uav{i}") for a in ("ib-abc", "b-abc", "abc") for i in (1, 2, 3, 4)} - right
