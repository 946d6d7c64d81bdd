"""`gcsplan check`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.support.batches import mission
from tests.support.crossing import CROSSING
from tests.support.forecasts import mission_in_forecast


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


@pytest.mark.slow
def test_what_cannot_be_judged_is_exit_4_unless_allowed(run: Any, tmp_path: Path) -> None:
    assert run("plan", CROSSING, "-o", "out")[0] == 0
    text = (tmp_path / "out" / "uav1.waypoints").read_text()
    text += f"{len(text.splitlines()) - 1}\t0\t2\t177\t3\t2\t0\t0\t0\t0\t0\t1\n"
    (tmp_path / "uav1.waypoints").write_text(text)
    assert run("check", CROSSING, "uav1.waypoints")[0] == 4
    assert run("check", CROSSING, "uav1.waypoints", "--allow-unjudged")[0] == 0


@pytest.mark.slow
def test_a_file_gets_the_windows_of_a_plan_in_the_wind(run: Any, tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(mission(terrain={"flat_m": 300}))
    planned = json.loads(run("plan", "m.yaml", "-o", "out", "--wind", "8,80,9", "--json")[1])["vehicles"][0]
    (dem := tmp_path / "dem.asc").write_text(
        "ncols 21\nnrows 21\nxllcorner 7.9\nyllcorner 46.9\ncellsize 0.01\n" + "300 " * 441
    )
    options = ["--dem", dem.name, "--vertical-datum", "EGM96", "--crs", "EPSG:4326", "--min-agl", "30", "--speed", "12"]
    for world in (["m.yaml", "out/uav1.plan"], ["out/uav1.plan", *options]):
        code, out, err = run("check", *world, "--wind", "8,80,9", "--json")
        assert code == 0, err
        [judged] = json.loads(out)["verdicts"]
        assert judged["arrive_latest_s"] > 1.1 * planned["arrive_s"]
        for key in ("arrive_earliest_s", "arrive_latest_s"):
            assert abs(judged[key] - planned[key]) < 0.5
        assert run("check", *world, "--wind", "still", "--json")[1].count("arrive_latest_s") == 0
    code, out, err = run("check", *options, "out/uav1.plan", "--wind", "90,270")
    assert (code, "--wind: wind.speed_m_s: must be at most 75, given 90" in err) == (2, True)


@pytest.mark.slow
def test_a_forecast_counts_for_files_near_its_place_in_its_hours(run: Any, tmp_path: Path) -> None:
    spec = mission_in_forecast(tmp_path / "f.json", ["2026-11-28T10:00Z", "2026-11-28T11:00Z"], (47.005, 8.01))
    del spec["wind"], spec["at"]
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(spec))
    assert run("plan", "m.yaml", "-o", "out")[0] == 0
    for place, code in (("8.01", 0), ("9.01", 2)):
        west = float(place) - 0.1
        (tmp_path / "dem.asc").write_text(
            f"ncols 21\nnrows 21\nxllcorner {west}\nyllcorner 46.9\ncellsize 0.01\n" + "100 " * 441
        )
        moved = (tmp_path / "out" / "uav1.waypoints").read_text().replace("8.01", place)
        (tmp_path / "uav1.waypoints").write_text(moved)
        args = ["uav1.waypoints", "--dem", "dem.asc", "--vertical-datum", "EGM96", "--crs", "EPSG:4326", "--min-agl",
                "30", "--speed", "15", "--wind", "f.json"]  # fmt: skip
        got, out, err = run("check", *args, "--at", "2026-11-28T10:00Z/2026-11-28T11:00Z")
        assert (got, "in still air, within 0:0" in out, "more than 30 km" in err) == (code, code == 0, code == 2), err
    assert "needs the time of departure" in run("check", *args)[2]
