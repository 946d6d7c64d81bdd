"""`gcsplan new`: from a start and a goal to a verified upload; nothing is assumed or overwritten silently."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer

import gcsplan
from gcsplan.cli.commands import new
from gcsplan.mission_file.json_schema import FILE_NAME, mission_schema
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.support.paths import REPOSITORY

START, GOAL = ("--start", "36.6175,-84.3892"), ("--goal", "36.6133, -84.3000")
PLACES = (*START, *GOAL)
SAMPLE = ("--dem", "sample:jacksboro")


def test_the_tutorial_s_three_commands_lead_to_a_verified_upload(run: Any, tmp_path: Path) -> None:
    page = (REPOSITORY / "docs" / "tutorial.md").read_text(encoding="utf-8").split("## 1.")[0]
    commands = [shlex.split(line) for line in re.findall(r"^\$ gcsplan (.*)$", page, re.MULTILINE)]
    assert [command[0] for command in commands] == ["new", "plan", "plan"]
    said = [run(*command) for command in commands]
    assert [code for code, _, _ in said] == [0, 0, 0]
    assert said[0][1:] == ("written: first.yaml, gcsplan.schema.json\nplan it: gcsplan plan first.yaml\n", "")
    for text, gap in ((said[1][1], "\u2009"), (page, " ")):
        assert re.search(rf"length, m +19{gap}940\n", text)
        assert re.search(r"verdict +path safe, return not judged\n", text)
    assert "verified" in said[2][1]
    assert json.loads((tmp_path / FILE_NAME).read_text()) == mission_schema()


@pytest.mark.slow
@pytest.mark.parametrize("autopilot", list(Autopilot))
def test_what_is_written_plans_for_every_autopilot(run: Any, autopilot: Autopilot) -> None:
    assert run("new", *PLACES, *SAMPLE, "--autopilot", autopilot, "-o", "a.yaml")[0] == 0
    assert run("plan", "a.yaml")[0] == 0
    assert run("new", *PLACES, "--flat", "300", "--autopilot", autopilot, "-o", "b.yaml")[0] == 0
    assert run("plan", "b.yaml")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (PLACES, "--flat M: flat ground at that altitude, which is never assumed"),
        (SAMPLE, "give --start, --goal (see"),
        ((*PLACES, *SAMPLE, "--flat", "3"), "give --dem or --flat, not both"),
        ((*PLACES, "--flat", "3", "--vertical-datum", "EGM96"), "--flat is above sea level"),
        ((*PLACES, "--flat", "nan"), "--flat: must be a number"),
        ((*PLACES, *SAMPLE, "--autopilot", "pixhawk"), "give one of arducopter, arduplane, px4"),
        ((*PLACES, *SAMPLE, "-o", "m.txt"), "give a name that ends in .yaml"),
        ((*PLACES, *SAMPLE, "-o", "no/m.yaml"), "give a file in a directory that exists"),
        ((*PLACES, *SAMPLE, "--min-agl", "-1"), "--min-agl: must be at least 0, given -1"),
        ((*PLACES, "--dem", "no.tif"), "--dem: no.tif is not there"),
        ((*START, "--goal", "46,8", *SAMPLE), "--goal: 46, 8 lies outside the DEM"),
        (("--start", "home", *GOAL, *SAMPLE), "--start: 'home' is no place"),
        ((*PLACES, *SAMPLE, "--from", "nonsense"), "nonsense"),
    ],
)
def test_every_mistake_names_its_option_and_nothing_is_written(
    run: Any, tmp_path: Path, arguments: tuple[str, ...], said: str
) -> None:
    code, _, err = run("new", *arguments)
    assert code == 2
    assert said in err
    assert "(line" not in err
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_there_is_replaced_with_force_alone(run: Any, tmp_path: Path) -> None:
    file, schema = tmp_path / "mission.yaml", tmp_path / FILE_NAME
    file.write_text("mine")
    schema.write_text("mine too")
    code, _, err = run("new", *PLACES, "--flat", "300")
    assert code == 2
    assert "--force" in err
    assert file.read_text() == "mine"
    code, out, err = run("new", *PLACES, "--flat", "300", "--force")
    assert code == 0
    assert out.startswith("written: mission.yaml\n")
    assert "flat at 300 m above sea level" in err
    assert "is not gcsplan's and stays as it is" in err
    assert schema.read_text() == "mine too"
    assert gcsplan.load_mission(file).vehicles[0].start[2] == 300.0


def test_a_raster_is_named_from_the_mission_s_folder_and_json_says_what_was_written(run: Any, tmp_path: Path) -> None:
    (tmp_path / "missions").mkdir()
    (tmp_path / "tile.asc").write_text("")
    _, out, _ = run("new", *PLACES, *SAMPLE, "-o", "missions/a.yaml", "--json")
    document = json.loads(out)
    assert document["files"] == [str(Path("missions", name)) for name in ("a.yaml", FILE_NAME)]
    assert new.beside("tile.asc", Path("missions/a.yaml")) == "../tile.asc"
    assert new.beside("sample:jacksboro", Path("missions/a.yaml")) == "sample:jacksboro"


@pytest.mark.slow
def test_a_vehicle_tells_start_autopilot_and_settings(run: Any, tmp_path: Path) -> None:
    vehicle = LoopbackVehicle(
        3, Autopilot.ARDUCOPTER, lat_deg=36.6175, lon_deg=-84.3892, amsl_m=399.0,
        parameters={"RTL_ALT": 12_000.0, "ANGLE_MAX": 2500.0},
    )  # fmt: skip
    with SimServer([vehicle], "udpin:127.0.0.1:0", speedup=10.0) as server:
        url = server.url_for_gcs
        link = ("--from", url, "--sysid", "3")
        code, _, err = run("new", *link, *GOAL, *SAMPLE, "--autopilot", "px4")
        assert code == 5
        assert "leave it out, or give arducopter" in err
        assert list(tmp_path.iterdir()) == []
        assert run("new", *link, *GOAL, *SAMPLE)[0] == 0
        (request,) = gcsplan.load_mission(tmp_path / "mission.yaml").vehicles
        assert request.start_deg == pytest.approx((36.6175, -84.3892), abs=1e-6)
        assert (request.vehicle.sysid, request.vehicle.autopilot) == (3, Autopilot.ARDUCOPTER)
        assert (request.rtl_rel_home_m, request.vehicle.lean_angle_deg) == (120.0, 25.0)
        assert request.vehicle.link == url
        assert server.vehicles[0].items()[1:] == ()


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """A terminal whose user types the lines of the list; what was asked stays in it."""
    answers: list[str] = []

    def prompt(text: str, default: str | None = None, **_: object) -> str:
        if not answers:
            raise typer.Abort
        return answers.pop(0) or (default or "")

    monkeypatch.setattr(typer, "prompt", prompt)
    monkeypatch.setattr(new, "on_a_terminal", lambda: True)
    return answers


def test_on_a_terminal_what_is_missing_is_asked_for(run: Any, tmp_path: Path, terminal: list[str]) -> None:
    terminal += ["nowhere", "36.6175, -84.3892", "36.6133 N 84.3 W", "flat", "flat high", "flat 310", "px5", "px4"]
    terminal += ["high", "120"]
    code, _, err = run("new")
    assert code == 0
    assert terminal == []
    assert "'nowhere' is no place" in err
    assert "flat ground needs its height" in err
    assert "--autopilot px5" in err
    assert "give metres above ground, or nothing" in err
    (request,) = gcsplan.load_mission(tmp_path / "mission.yaml").vehicles
    assert request.vehicle.limits.max_agl_m == 120.0
    assert request.vehicle.autopilot is Autopilot.PX4
    assert request.start == pytest.approx((request.start[0], request.start[1], 310.0))


@pytest.mark.slow
def test_several_vehicles_zones_a_battery_and_a_ceiling_stand_in_the_file(run: Any, tmp_path: Path) -> None:
    zone = {"type": "Polygon", "coordinates": [[[-84.35, 36.65], [-84.34, 36.65], [-84.34, 36.66], [-84.35, 36.65]]]}
    feature = {"type": "Feature", "properties": {"name": "wood"}, "geometry": zone}
    (tmp_path / "zones.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    more = ("--zones", "zones.geojson", "--battery-wh", "250", "--max-agl", "120", "--sysid", "4")
    two = (*PLACES, "--start", "36.62,-84.39", "--goal", "36.615,-84.30")
    code, _, err = run("new", *two, *SAMPLE, *more)
    assert code == 0, err
    mission = gcsplan.load_mission(tmp_path / "mission.yaml")
    assert [(r.vehicle.name, r.vehicle.sysid) for r in mission.vehicles] == [("uav4", 4), ("uav5", 5)]
    assert [r.start_deg for r in mission.vehicles] == [(36.6175, -84.3892), (36.62, -84.39)]
    assert all(r.vehicle.energy.battery_j == 250.0 * 3600.0 for r in mission.vehicles)
    assert all(r.vehicle.limits.max_agl_m == 120.0 for r in mission.vehicles)
    assert [z.name for z in mission.zones] == ["wood"]
    for bad, words in (
        ((*PLACES, *START), "2 --start, 1 --goal"),
        ((*PLACES, "--max-agl", "20"), "max_agl_m"),
        ((*PLACES, "--zones", "none.kml"), "--zones"),
    ):
        code, _, err = run("new", *bad, *SAMPLE, "--force")
        assert code == 2
        assert words in err


def test_questions_end(run: Any, tmp_path: Path, terminal: list[str]) -> None:
    terminal += ["nowhere"] * 9
    assert run("new")[0] == 2
    terminal.clear()
    assert run("new")[0] == 130
    assert list(tmp_path.iterdir()) == []
