"""Options that change the mission: how their texts are read, and what a wrong one is told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gcsplan.cli.arguments.changes import changes_of, wind_changes
from gcsplan.errors import UsageError
from tests.support.batches import mission


def given(**texts: list[str]) -> list[tuple[str, Any, str | None]]:
    """Key, value and vehicle of each change."""
    limits = {f"{name}_m": texts.get(name) for name in ("max_agl", "min_agl")}
    places = {name: texts.get(name) for name in ("start", "goal")}
    avoid, file, zones, via, speed = (texts.get(name) for name in ("avoid", "avoid_file", "zones", "via", "speed"))
    return [(c.key, c.value, c.vehicle) for c in changes_of(avoid, file, zones, limits, places, via, speed, {})]


@pytest.mark.parametrize(
    ("text", "zone"),
    [
        ("36.61,-84.31,400", {"center": [36.61, -84.31], "radius_m": 400}),
        ("36.61, -84.31, 60.5, 0-100", {"center": [36.61, -84.31], "radius_m": 60.5, "ceiling_agl_m": 100}),
        ("36.61,-84.31,60,50-", {"center": [36.61, -84.31], "radius_m": 60, "floor_agl_m": 50}),
        ("32TMT7312349321,60,-80", {"center": "32TMT7312349321", "radius_m": 60, "ceiling_agl_m": 80}),
        ("36.61 N, 84.31 W,60", {"center": "36.61 N,84.31 W", "radius_m": 60}),
    ],
)
def test_a_circle_to_avoid_is_a_zone(text: str, zone: dict[str, Any]) -> None:
    assert given(avoid=[text]) == [("no_fly", zone, None)]


def test_values_may_be_for_one_vehicle() -> None:
    assert given(max_agl=["100", "uav2=80"], speed=["3-8.5"], via=["uav1=1,2", "uav1=3,4,50"], goal=["uav1=5,6"]) == [
        ("max_agl_m", 100, None),
        ("max_agl_m", 80, "uav2"),
        ("goal", [5.0, 6.0], "uav1"),
        ("speed_m_s", [3, 8.5], None),
        ("via", [[1.0, 2.0], [3.0, 4.0, 50.0]], "uav1"),
    ]
    assert given(via=["none"]) == [("via", [], None)]


@pytest.mark.parametrize(
    ("option", "text", "words"),
    [
        ("avoid", "36.61,-84.31", "--avoid"),
        ("avoid", "36.61,-84.31,60,100-50", "ceiling must be above the floor"),
        ("avoid", "36.61,-84.31,60,-", "FLOOR-CEILING"),
        ("avoid", "136.61,-84.31,60", "swapped"),
        ("avoid", "36.61,-84.31,x", "give a number"),
        ("max_agl", "nan", "--max-agl nan: give a number"),
        ("max_agl", "low", "--max-agl low: give a number"),
        ("speed", "9-3", "the slowest and the fastest"),
        ("goal", "somewhere", "--goal"),
        ("via", "1", "--via"),
    ],
)
def test_a_wrong_text_is_refused_with_its_cure(option: str, text: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        given(**{option: [text]})


@pytest.mark.parametrize(
    ("text", "section"),
    [
        ("5,270", {"speed_m_s": 5, "from_deg": 270}),
        ("5, 270, 9.5", {"speed_m_s": 5, "from_deg": 270, "gust_m_s": 9.5}),
        ("3-7,350-20", {"speed_m_s": [3, 7], "from_deg": [350, 20]}),
        ("up-to:8", {"up_to_m_s": 8}),
        ("up-to:8,12", {"up_to_m_s": 8, "gust_m_s": 12}),
        ("still", {"up_to_m_s": 0}),
        ("winds/today.JSON", {"forecast": "winds/today.JSON"}),
    ],
)
def test_a_wind_is_the_section_of_a_mission(text: str, section: dict[str, Any]) -> None:
    assert [(c.part, c.key, c.value) for c in wind_changes(text)] == [("wind", "wind", section)]


@pytest.mark.parametrize("text", ["5", "", "north", "5,270,9,1", "up-to:", "up-to:1,2,3", "-5,270", "5,nan", "3-,270"])
def test_a_text_that_is_no_wind_is_refused_with_the_forms(text: str) -> None:
    with pytest.raises(UsageError, match=r"--wind .*: give"):
        wind_changes(text)


@pytest.mark.slow
def test_a_wind_of_a_run_is_named_and_saved_in_place_of_the_files(run: Any, tmp_path: Path) -> None:
    file = tmp_path / "field.yaml"
    file.write_text(mission() + "wind: {up_to_m_s: 3, varying: true}  # calm\n")
    code, out, _ = run("plan", file, "--wind", "5,270", "--json")
    assert (code, json.loads(out)["changes"]) == (
        0,
        ["--wind 5,270: wind is {speed_m_s: 5, from_deg: 270} in place of {up_to_m_s: 3, varying: true}"],
    )
    assert "up_to_m_s: 3" in file.read_text()
    assert run("plan", file, "--wind", "5,270", "--save")[0] == 0
    assert "from_deg: 270}  # calm\n" in file.read_text()
    assert "up_to_m_s" not in file.read_text()


def test_an_option_that_counts_once_is_refused_twice() -> None:
    with pytest.raises(UsageError, match="--max-agl is given twice; keep one"):
        given(max_agl=["80", "90"])


@pytest.mark.slow
def test_plan_names_each_change_and_saves_it_on_request(run: Any, tmp_path: Path) -> None:
    file = tmp_path / "field.yaml"
    file.write_text("# mine\n" + mission())
    before = file.read_bytes()
    code, out, err = run("plan", file, "--avoid", "47.0,8.01,60", "--json")
    assert code == 0
    assert file.read_bytes() == before
    assert json.loads(out)["changes_data"][0]["code"] == "change_adds_zone"
    assert "changed for this run alone" in err
    outputs = {p.name: p.read_bytes() for p in (tmp_path / "field").iterdir() if p.is_file()}
    assert run("plan", file, "--avoid", "47.0,8.01,60", "--save")[0] == 0
    assert "# mine" in file.read_text()
    assert "avoid 1" in file.read_text()
    code, out, err = run("plan", file, "--json")
    assert (code, json.loads(out)["changes"]) == (0, [])
    assert {p.name: p.read_bytes() for p in (tmp_path / "field").iterdir() if p.is_file()} == outputs


def test_a_plan_that_fails_saves_nothing(run: Any, tmp_path: Path) -> None:
    file = tmp_path / "field.yaml"
    file.write_text(mission())
    before = file.read_bytes()
    assert run("plan", file)[0] == 0
    assert run("plan", file, "--avoid", "47.0,8.0,60", "--save")[0] == 2
    assert file.read_bytes() == before
    assert not (tmp_path / "field" / "uav1.plan").exists()


@pytest.mark.slow
def test_save_without_a_change_leaves_the_last_plan(run: Any, tmp_path: Path) -> None:
    file = tmp_path / "field.yaml"
    file.write_text(mission())
    assert run("plan", file)[0] == 0
    code, _, err = run("plan", file, "--save")
    assert code == 2
    assert "--save has nothing to write" in err
    assert (tmp_path / "field" / "uav1.plan").exists()
