"""The JSON Schema, judged by a validator of others: it takes what the reader takes, and finds what an editor can."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from gcsplan.mission_file import load_mission
from gcsplan.mission_file.json_schema import FILE_NAME, MODELINE, mission_schema
from gcsplan.mission_file.values import units
from gcsplan.mission_file.values.schema import MissionKeys
from gcsplan.mission_file.values.yaml import read_yaml
from gcsplan.planners import registry
from tests.support.paths import DATA, MISSIONS, REPOSITORY

FILES = [*sorted(MISSIONS.rglob("*.yaml")), *sorted(DATA.glob("*.yaml"))]


@pytest.fixture(scope="module")
def told() -> dict[str, Any]:
    return mission_schema()


@pytest.fixture(scope="module")
def judge(told: dict[str, Any]) -> Draft202012Validator:
    Draft202012Validator.check_schema(told)
    return Draft202012Validator(told)


def good() -> dict[str, Any]:
    """A mission that the reader takes, with sections of every kind."""
    return {
        "version": 1,
        "terrain": {"dem": "sample:jacksboro", "vertical_datum": "EGM96"},
        "limits": {"min_agl_m": 60},
        "no_fly": [{"name": "village", "center": [36.61, -84.31], "radius_m": 400}],
        "vehicles": [
            {"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [36.6, -84.38], "goal": "36.55, -84.2",
             "speed_m_s": [3, 10], "energy": {"battery_j": 5e6}},
        ],
        "arrival": {"mode": "none"},
        "planner": {"name": "optimal"},
    }  # fmt: skip


def changed(place: str, value: Any) -> dict[str, Any]:
    """The good mission with ``value`` at ``place`` (``vehicles.0.sysid``)."""
    whole = copy.deepcopy(good())
    at: Any = whole
    *path, last = [int(p) if p.isdigit() else p for p in place.split(".")]
    for part in path:
        at = at[part]
    at[last] = value
    return whole


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_mission_of_the_repository_fits(judge: Draft202012Validator, file: Path) -> None:
    assert [e.message for e in judge.iter_errors(read_yaml(file.read_text(encoding="utf-8"), where=""))] == []


def test_the_reference_s_example_fits(judge: Draft202012Validator) -> None:
    page = (REPOSITORY / "docs" / "reference" / "mission-file.md").read_text(encoding="utf-8")
    (example, *_) = re.findall(r"^```yaml\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert list(judge.iter_errors(read_yaml(example, where=""))) == []


TAKEN = [
    ("no_fly", None),
    ("planner", None),
    ("way_home", None),
    ("limits", {"min_agl_ft": 200, "max_agl_m": 300}),
    ("vehicles.0.speed_m_s", 8),
    ("vehicles.0.start", {"latitude": 36.6, "lng": -84.38}),
    ("vehicles.0.start", ["36°36'00\"N", "84°22'48\"W"]),
    ("vehicles.0.via", [[36.6, -84.33], [36.6, -84.32, 80], {"at": "36.6, -84.31", "agl_ft": 300}]),
    ("vehicles.0.via", [{"lat": 36.6, "lon": -84.31, "agl_m": 90}]),
    ("vehicles.0.energy", {"battery_mah": 16000, "battery_v": 22.2}),
    ("vehicles.0.max_climb_deg", 12),
    ("vehicles.0.limits", {"min_agl_m": 80}),
    ("no_fly.0.radius_ft", 1300),
    ("terrain.obstacle_height_m", 3),
    ("altitude_frame", "amsl"),
    ("name", "Ridge"),
    ("wind", None),
    ("wind", {"speed_kt": "10 ± 3", "from_deg": [350, 20], "gust_m_s": 12}),
    ("wind", {"levels": [{"agl_ft": 30, "speed_kmh": [9, 20], "from_deg": "270 ± 20"}], "varying": True}),
]


@pytest.mark.parametrize(("place", "value"), TAKEN)
def test_what_the_reader_takes_the_schema_takes(judge: Draft202012Validator, place: str, value: Any) -> None:
    whole = changed(place, value)
    if place == "no_fly.0.radius_ft":
        del whole["no_fly"][0]["radius_m"]
    load_mission(whole)
    assert [e.message for e in judge.iter_errors(whole)] == []


def test_local_metres_in_feet_fit(judge: Draft202012Validator) -> None:
    whole = changed("frame", {"origin": [36.6, -84.3], "amsl_ft": 0}) | {"no_fly": [], "terrain": {"flat_m": 100}}
    whole["vehicles"][0] |= {"start": {"east_ft": 0, "north_m": 0}, "goal": {"east_m": 900, "north_ft": 300}}
    load_mission(whole)
    assert list(judge.iter_errors(whole)) == []
    whole["vehicles"][0]["start"] = {"east_ft": 0}
    assert list(judge.iter_errors(whole))


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("versoin", 1),
        ("version", 2),
        ("limits.min_agl", 60),
        ("limits.min_agl_m", "60"),
        ("limits.min_agl_m", -1),
        ("vehicles.0.sysid", 256),
        ("vehicles.0.name", "my drone"),
        ("vehicles.0.autopilot", "ardupilot"),
        ("vehicles.0.start", [36.6]),
        ("vehicles.0.start", {"lat": 36.6}),
        ("vehicles.0.goal", None),
        ("vehicles.0.speed_m_s", [3, 10, 12]),
        ("vehicles.0.energy", {"battery_kj": 5000}),
        ("vehicles", []),
        ("no_fly.0.radius", 400),
        ("planner.name", "optimum"),
        ("arrival.mode", "all"),
        ("wind", {"speed_m_s": 76, "from_deg": 0}),
        ("wind", {"up_to_m_s": [1, 2]}),
        ("wind", {"levels": [{"agl_m": 30, "speed_m_s": 3}]}),
        ("terrain", None),
    ],
)
def test_what_an_editor_can_find_is_found(judge: Draft202012Validator, place: str, value: Any) -> None:
    assert list(judge.iter_errors(good())) == []
    assert list(judge.iter_errors(changed(place, value)))


def test_every_key_is_there_in_every_unit_and_says_what_it_is(told: dict[str, Any]) -> None:
    parts = {"MissionKeys": told, **told["$defs"]}
    for name in MissionKeys.model_fields:
        assert name in told["properties"]
    for section, part in parts.items():
        for key, one in part["properties"].items():
            assert len(one.get("description", "")) > 10, (section, key)
            assert "](" not in one["description"]
        for other, written in units.other_names(part["properties"]).items():
            assert other in part["properties"], (section, written.key)
    assert told["$defs"]["PlannerKeys"]["properties"]["name"]["enum"] == list(registry.names())
    assert told["$defs"]["LimitKeys"]["properties"]["horizontal_clearance_m"]["default"] == 30.0
    assert "default" not in told["$defs"]["VehicleKeys"]["properties"]["horizontal_clearance_m"]


def test_the_line_for_editors_is_a_comment_that_names_the_file() -> None:
    assert MODELINE.endswith(f"$schema={FILE_NAME}")
    assert re.fullmatch(r"# yaml-language-server: \$schema=[\w.]+\.json", MODELINE)
