"""The text of a new mission: it reads as it was meant, and says of every key what it is."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from gcsplan.mission_file import load_mission
from gcsplan.mission_file.json_schema import MODELINE, mission_schema
from gcsplan.mission_file.new_file import Draft, place_text, text_of
from gcsplan.mission_file.values.yaml import read_yaml
from gcsplan.vehicle import Autopilot

START, GOAL = "[36.6175, -84.3892]", "[36.6133, -84.1667]"
SAMPLE = Draft(START, GOAL, dem=("sample:jacksboro",))


@pytest.mark.first_quick
@pytest.mark.parametrize("autopilot", list(Autopilot))
@pytest.mark.parametrize("whole", [False, True])
def test_the_file_reads_as_it_was_meant(autopilot: Autopilot, whole: bool) -> None:
    draft = Draft(
        START, GOAL, dem=("sample:jacksboro",), vertical_datum="EGM96" if whole else None, autopilot=autopilot,
        sysid=7, min_agl_m=80.0, rtl_rel_home_m=120.5 if whole else None, link="udpout:127.0.0.1:14560",
        lean_deg=25.0 if whole and autopilot is Autopilot.ARDUCOPTER else None,
    )  # fmt: skip
    text = text_of(draft, "a.yaml", "a")
    read = load_mission(Path("a.yaml"), text=text)
    (request,) = read.vehicles
    assert (request.vehicle.name, request.vehicle.sysid, request.vehicle.autopilot) == ("uav7", 7, autopilot)
    assert request.start_deg == (36.6175, -84.3892)
    assert request.goal_deg == (36.6133, -84.1667)
    assert request.rtl_rel_home_m == (120.5 if whole else None)
    assert request.vehicle.limits.min_agl_m == 80.0
    assert request.vehicle.link == "udpout:127.0.0.1:14560"
    if whole and autopilot is Autopilot.ARDUCOPTER:
        assert request.vehicle.lean_angle_deg == 25.0
    Draft202012Validator(mission_schema()).validate(read_yaml(text, where=""))
    assert whole or not any("bounds_speed" in note.code for note in read.notes)


@pytest.mark.slow
def test_every_choice_that_is_left_can_be_made() -> None:
    """Each line that is a key behind a # is a good one without it, the zones all together."""
    lines = text_of(SAMPLE, "a.yaml", "a").splitlines()
    left = [i for i, line in enumerate(lines) if re.match(r" *#[a-z_]+:", line)]
    assert len(left) >= 7
    for i in left:
        changed = list(lines)
        zones = [j for j, line in enumerate(lines) if line.startswith("#  - ") and "file:" not in line]
        for j in [i, *zones] if "no_fly" in lines[i] else [i]:
            changed[j] = changed[j].replace("#", "", 1)
        load_mission(Path("a.yaml"), text="\n".join(changed).replace("max_amsl_m: 1500", "max_amsl_m: 1500.5"))


def test_every_key_has_a_comment_with_its_unit_above_it() -> None:
    lines = text_of(SAMPLE, "a.yaml", "a").splitlines()
    assert lines[0] == MODELINE
    assert max(map(len, lines)) <= 115
    for above, line in pairwise(lines):
        key = re.match(r" +(?:- )?#?([a-z_]+):", line)
        if key:
            assert re.match(r" +# \S", above), line
    text = " ".join("\n".join(lines).replace("# ", "").split())
    assert "Least distance to every zone, and to ground that reaches flight level. In m. Default: 30." in text
    assert "or nothing. One of land, loiter, rtl, none. Default: land." in text
    assert "Slowest and fastest cruise speed; one number is both. A fixed wing's is the airspeed" in text
    assert "that it indicates. In m/s. Default: [3, 15]." in text


def test_flat_ground_and_odd_names() -> None:
    text = text_of(Draft(START, GOAL, flat_m=412.5), "no.yaml", "no")
    read = load_mission(Path("no.yaml"), text=text)
    assert read.name == "no"
    assert read.vehicles[0].start[2] == 412.5
    odd = text_of(Draft(START, GOAL, dem=("my tiles/a b.tif", "null", "#x.tif", "é.tif")), "a.yaml", 'a: "b" # c')
    raw = read_yaml(odd, where="")
    assert raw["terrain"]["dem"] == ["my tiles/a b.tif", "null", "#x.tif", "é.tif"]
    assert raw["name"] == 'a: "b" # c'


@pytest.mark.parametrize(
    ("given", "written"),
    [
        ("36.6175,-84.3892", "[36.6175, -84.3892]"),
        (" +36.6175 , -84.3892 ", "[+36.6175, -84.3892]"),
        ("36.6175 N, 84.3892 W", '"36.6175 N, 84.3892 W"'),
        ("36°37'03\"N 84°23'21\"W", '"36°37\'03\\"N 84°23\'21\\"W"'),
        ("1e1, 20", '"1e1, 20"'),
    ],
)
def test_a_place_keeps_its_form(given: str, written: str) -> None:
    assert place_text(given) == written
    with pytest.raises(ValueError, match="is no place"):
        place_text("home")
