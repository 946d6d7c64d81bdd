"""Changes of a mission document: what each sets, and that the saved file says the same as the changed document."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import pytest

from gcsplan.app.fleet.pipeline import plan
from gcsplan.app.output.files import outputs_of
from gcsplan.errors import InputError, UsageError
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.changes import MissionChange, changed, saved_text, saving
from gcsplan.mission_file.values.yaml import read_yaml
from tests.support.effort import draws, seeds

STYLES = (
    """\
# A mission.
version: 1
name: field   # its name
terrain: {flat_m: 100}
limits:
  min_agl_m: 30     # least
  #max_agl_m: 120
  horizontal_clearance_m: 20
# Zones.
no_fly:
  - {name: mast, center: [47.002, 8.01], radius_m: 50}   # red

# The aircraft.
vehicles:
  - name: uav1
    sysid: 1
    autopilot: arducopter
    start: [47.0, 8.0]   # the pad
    goal: [47.0, 8.02]
    via: []
    speed_m_s: [3, 10]
""",
    """\
version: 1
name: field
terrain: {flat_m: 100}
limits: {min_agl_ft: 98.425, max_agl_ft: 500, horizontal_clearance_m: 20}   # feet
vehicles:
- {name: uav1, sysid: 1, autopilot: arducopter, start: "47.0, 8.0", goal: [47.0, 8.02], speed_kt: [6, 19],
   limits: {min_agl_m: 35}}
""",
    """\
{version: 1, name: field, terrain: {flat_m: 100}, limits: {min_agl_m: 30},
 no_fly: [], vehicles: [{name: uav1, sysid: 1, autopilot: arducopter, start: [47.0, 8.0], goal: [47.0, 8.02]}]}
""",
)


def drawn_changes(rng: random.Random) -> list[MissionChange]:
    """One to four changes of every kind; most of them leave a mission that can be planned."""

    def place(spread_deg: float) -> list[float]:
        return [round(47.0 + rng.uniform(-spread_deg, spread_deg), 5), round(8.01 + rng.uniform(-0.004, 0.004), 5)]

    name = rng.choice([None, "uav1"])
    every = [
        MissionChange("--avoid", "zone", "no_fly", {"center": place(0.003), "radius_m": rng.randint(20, 150)}),
        MissionChange("--avoid", "zone", "no_fly", {"center": place(0.003), "radius_m": 90, "ceiling_agl_m": 40}),
        MissionChange("--max-agl", "limit", "max_agl_m", rng.choice([80, 99.5, 120]), name),
        MissionChange("--min-agl", "limit", "min_agl_m", rng.choice([25, 31.5, 40]), name),
        MissionChange("--goal", "vehicle", "goal", [47.001, round(8.02 + rng.uniform(-0.003, 0.003), 6)], name),
        MissionChange("--start", "vehicle", "start", "32T 424000 5205600", name),
        MissionChange("--via", "vehicle", "via", [place(0.004) for _ in range(rng.randint(0, 2))], name),
        MissionChange("--speed", "vehicle", "speed_m_s", rng.choice([8, [4, 9.5]]), name),
        MissionChange("--wind", "wind", "wind", {"speed_m_s": [3, 5], "from_deg": rng.choice([270, [350, 20]])}),
    ]
    return rng.sample(every, rng.randint(1, 4))


def outcome(file: Path, changes: list[MissionChange]) -> dict[str, str] | str:
    """The bytes of every output of a plan, or the words of its refusal."""
    try:
        return outputs_of(plan(load_mission(file, changes=changes)))
    except (InputError, RuntimeError) as why:
        return str(why).replace(" (line", "\n(line").splitlines()[0].rpartition(": ")[2]


@pytest.mark.slow
@pytest.mark.nightly_but("2", "0")
@pytest.mark.parametrize("seed", seeds(1, 3, 20))
def test_options_and_the_saved_file_give_the_same_bytes(tmp_path: Path, seed: int) -> None:
    rng, planned, count = random.Random(seed), 0, draws(10)
    for k in range(count):
        text, changes = STYLES[k % len(STYLES)], drawn_changes(rng)
        file = tmp_path / "field.yaml"
        file.write_text(text, newline="")
        given = load_raw(file)
        made = changed(given, changes, tmp_path)
        file.write_text(saved_text(text, made.raw, "field.yaml"), newline="")
        after = outcome(file, [])
        file.write_text(text, newline="")
        before = outcome(file, changes)
        assert before == after, changes
        planned += isinstance(before, dict)
    assert planned > count // 2


def load_raw(file: Path) -> dict[str, Any]:
    return dict(read_yaml(file.read_text(), where=file.name))


@pytest.mark.parametrize("text", STYLES)
def test_a_saved_file_keeps_every_comment_and_all_lines_that_did_not_change(tmp_path: Path, text: str) -> None:
    file = tmp_path / "field.yaml"
    file.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    zone = MissionChange("--avoid", "zone", "no_fly", {"center": [47.001, 8.01], "radius_m": 60})
    content = load_mission(file, changes=[zone, MissionChange("--max-agl", "limit", "max_agl_m", 90)]).content
    assert content is not None
    saving(content)()
    data = file.read_bytes()
    assert data.startswith(b"\xef\xbb\xbf")
    assert data.count(b"\n") == data.count(b"\r\n")
    assert [
        line for line in text.splitlines() if "#" in line and "feet" not in line and line not in data.decode()
    ] == []
    again = load_mission(file)
    assert [v.vehicle.limits.max_agl_m for v in again.vehicles] == [90.0]
    assert "avoid 1" in [zone.name for zone in again.zones]


def test_another_wind_replaces_the_section_and_names_its_file_from_the_mission(tmp_path: Path) -> None:
    raw = {"wind": {"speed_kt": 9, "from_deg": 3}}
    change = MissionChange("--wind a.json", "wind", "wind", {"forecast": str(tmp_path / "a.json")})
    made = changed(raw, [change], tmp_path / "missions")
    assert made.raw == {"wind": {"forecast": "../a.json"}}
    assert made.options == (("wind", "--wind a.json"),)


def test_a_limit_of_all_counts_for_a_vehicle_with_its_own() -> None:
    raw = {"limits": {"max_agl_ft": 400}, "vehicles": [{"name": "a", "max_agl_m": 50}, {"name": "b"}]}
    made = changed(raw, [MissionChange("--max-agl 80", "limit", "max_agl_m", 80)], Path())
    assert made.raw == {"limits": {"max_agl_m": 80}, "vehicles": [{"name": "a", "max_agl_m": 80}, {"name": "b"}]}
    assert [str(note) for note in made.notes] == [
        "--max-agl 80: limits.max_agl_m is 80 in place of max_agl_ft: 400",
        "--max-agl 80: vehicles[0].max_agl_m is 80 in place of 50",
    ]


def test_a_named_vehicle_alone_gets_its_limit() -> None:
    raw = {"limits": {"max_agl_m": 120}, "vehicles": [{"name": "a"}, {"name": "b", "limits": {"max_agl_ft": 99}}]}
    made = changed(raw, [MissionChange("", "limit", "max_agl_m", 80, name) for name in "ab"], Path())
    assert made.raw["limits"] == {"max_agl_m": 120}
    assert made.raw["vehicles"] == [{"name": "a", "max_agl_m": 80}, {"name": "b", "limits": {"max_agl_m": 80}}]


@pytest.mark.parametrize(("name", "words"), [(None, "has 2 vehicles; name one"), ("ua1", "did you mean uav1?")])
def test_a_vehicle_that_is_not_clear_is_refused(name: str | None, words: str) -> None:
    raw = {"vehicles": [{"name": "uav1"}, {"name": "uav2"}]}
    with pytest.raises(UsageError, match=words.replace("?", r"\?")):
        changed(raw, [MissionChange("--goal 47, 8", "vehicle", "goal", [47, 8], name)], Path())


def test_a_file_of_zones_is_named_as_the_mission_finds_it(tmp_path: Path) -> None:
    there = tmp_path / "zones" / "a.kml"
    changes = [MissionChange("--zones", "zones", "no_fly", {"file": str(there)})]
    made = changed({"no_fly": [{"file": "old.kml"}]}, changes, tmp_path / "missions")
    assert made.raw["no_fly"] == [{"file": "../zones/a.kml"}]


def test_a_mistake_in_an_option_has_the_option_as_its_place() -> None:
    far = MissionChange("--avoid 47,8.01,999999", "zone", "no_fly", {"center": [47, 8.01], "radius_m": 999999})
    with pytest.raises(InputError, match=r"^--avoid 47,8.01,999999: no_fly.1.* 100000"):
        load_mission(STYLES[0], changes=[far])


@pytest.mark.parametrize(
    ("key", "value", "vehicle", "words"),
    [
        (
            "max_agl_m",
            20,
            None,
            r"^--max: vehicles.0..min_agl_m: .* write max_agl_m 41 or more, or min_agl_m 9 or less",
        ),
        ("min_agl_m", 115, "uav1", r"^--min: vehicles.0..max_agl_m: leaves no room: .*, or min_agl_m 109 or less"),
        ("min_agl_m", 95, None, r"^--min: vehicles.0..via.0.: must be at least 100 m AGL"),
        ("max_agl_m", 60, None, r"^--max: vehicles.0..via.0.: must be at most 55 m AGL"),
    ],
)
def test_a_limit_of_an_option_is_named_by_it_where_another_key_breaks_it(
    tmp_path: Path, key: str, value: int, vehicle: str | None, words: str
) -> None:
    text = STYLES[0].replace("  #max_agl_m", "  max_agl_m").replace("via: []", "via: [[47.0, 8.01, 90]]")
    (tmp_path / "m.yaml").write_text(text)
    with pytest.raises(InputError, match=words):
        load_mission(tmp_path / "m.yaml", changes=[MissionChange(f"--{key[:3]}", "limit", key, value, vehicle)])


def test_text_that_shares_a_changed_part_is_refused() -> None:
    text = "limits: &l {min_agl_m: 30}\nother: *l\n"
    with pytest.raises(UsageError, match="alias"):
        saved_text(text, {"limits": {"min_agl_m": 40}, "other": {"min_agl_m": 30}}, "m.yaml")


def test_a_file_that_changed_meanwhile_is_left_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "field.yaml"
    file.write_text(STYLES[0])
    content = load_mission(file, changes=[MissionChange("--speed", "vehicle", "speed_m_s", 8)]).content
    assert content is not None
    save = saving(content)
    file.write_text(STYLES[1])
    with pytest.raises(InputError, match="changed meanwhile"):
        save()
    assert file.read_text() == STYLES[1]


def test_a_sample_and_a_mission_without_a_change_are_not_saved() -> None:
    change = MissionChange("--speed", "vehicle", "speed_m_s", 8)
    for mission, changes in (("sample:jacksboro", [change]), (STYLES[0], [])):
        content = load_mission(mission, changes=changes).content
        assert content is not None
        with pytest.raises(UsageError, match="--save"):
            saving(content)
