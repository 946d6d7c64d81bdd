"""`gcsplan wind`: the winds of a mission as they are understood."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.batches import mission
from tests.support.forecasts import forecast

LEVELS = [{"agl_m": 10, "speed_m_s": 3, "from_deg": 250}, {"agl_m": 100, "speed_m_s": [5, 7], "from_deg": [350, 10]}]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "f.json").write_text(json.dumps(forecast()))
    made = tmp_path / "m.yaml"
    made.write_text(mission(wind={"levels": LEVELS, "varying": True, "gust_m_s": 9}))
    return made


def test_the_winds_of_a_file_are_a_table_by_height(run: Any, file: Path) -> None:
    code, out, _ = run("wind", file)
    assert code == 0
    assert [line.split() for line in out.splitlines()[:3]] == [
        ["m", "above", "ground", "speed", "from"],
        ["10", "3.0", "m/s", "250°"],
        ["100", "5.0", "to", "7.0", "m/s", "350°", "to", "10°"],
    ]
    assert "declared wind: 3.0 to 7.0 m/s from 250° to 10°; another one at each place and time; gusts up to 9.0" in out
    assert "declared by the key `wind`" in out


def test_an_option_counts_in_place_of_the_file_and_units_are_the_readers(run: Any, file: Path) -> None:
    out = run("wind", file, "--wind", "5,270", "--units", "aviation")[1]
    assert "9.7 kt" in out
    assert "declared by --wind 5,270" in out
    assert "still air" in run("wind", file, "--wind", "still")[1]


def test_a_mission_without_the_key_has_still_air(run: Any, file: Path) -> None:
    file.write_text(mission())
    code, out, err = run("wind", file)
    assert (code, out, err) == (
        0, "still air: times, energies and paths count no wind\nthe mission has no key `wind`\n", "",
    )  # fmt: skip


def test_a_forecast_is_shown_by_hour_within_eighty_columns(run: Any, file: Path) -> None:
    code, out, err = run("wind", file, "--wind", "f.json", "--at", "2026-11-28T10:30Z")
    assert code == 0
    rows = [line for line in out.splitlines() if line.startswith("2026-")]
    assert len(rows) == 8
    assert max(map(len, rows)) <= 80
    assert "f.json for 47.0000, 8.0100" in err
    whole = json.loads(run("wind", file, "--wind", "f.json", "--at", "2026-11-28T10:30Z", "--json")[1])
    assert whole["wind"]["times"][0] == "2026-11-28T10:00:00+00:00"
    assert whole["wind"]["heights_m"] == [10.0, 80.0]
    assert (whole["source"], whole["departure"]) == ("--wind f.json", "2026-11-28T10:30:00+00:00")
    assert whole["notes_data"][0]["code"] == "wind_of_forecast"


def test_a_wrong_wind_is_refused_at_the_option(run: Any, file: Path) -> None:
    code, _, err = run("wind", file, "--wind", "90,270")
    assert code == 2
    assert "--wind 90,270: wind.speed_m_s: must be at most 75, given 90" in err
    assert run("wind", file, "--wind", "5")[0] == 2
