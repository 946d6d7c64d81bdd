"""`gcsplan batch`."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

from typer import testing as runner

from gcsplan.cli.command_table import app
from tests.support.batches import four_missions


def test_the_command_ends_with_a_table_and_a_page(tmp_path: Path) -> None:
    folder = four_missions(tmp_path / "missions")
    out = tmp_path / "out"
    done = runner.CliRunner().invoke(app, ["batch", str(folder), "-o", str(out), "--jobs", "1"])
    assert done.exit_code == 2, done.output
    assert "2 of 4 missions planned, 2 vehicles" in done.output
    assert "shut: error:" in done.output
    rows = list(csv.DictReader(io.StringIO((out / "results.csv").read_text())))
    assert [(r["mission"], r["vehicle"], r["code"]) for r in rows] == [
        ("good", "uav1", "0"), ("north/broken", "", "2"), ("north/good", "uav1", "0"), ("shut", "", "2"),
    ]  # fmt: skip
    page = (out / "index.html").read_text()
    assert page.count("<path data-row=") == 2
    assert 'href="north/good/summary.json"' in page
    again = runner.CliRunner().invoke(app, ["batch", str(folder), "-o", str(out), "--json"])
    assert "4 of 4 missions are done and unchanged" in again.output
    told = json.loads(again.stdout)
    assert (told["missions"], len(told["rows"])) == (4, 4)
