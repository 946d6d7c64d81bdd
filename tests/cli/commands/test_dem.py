"""`gcsplan dem fetch` as a newcomer meets it: from nothing to a plan, and every mistake with its cure."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from gcsplan.world.terrain.cell import Cell
from tests.support.tiles import Served, serving

SURFACE_DEM = "surface DEM: trees and buildings as the radar saw them; newer ones, masts and wires are not in it"

MISSION = """version: 1
terrain:
  dem: copernicus-glo30
limits: {min_agl_m: 60}
vehicles:
  - {name: uav1, sysid: 1, autopilot: arducopter, start: [36.60, -84.05], goal: [36.61, -84.01]}
"""


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Served]:
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    monkeypatch.setenv("GCSPLAN_DEM_CACHE", str(tmp_path / "cache"))
    with serving(Served()) as server:
        land = [Cell(36, -85), Cell(36, -84)]
        for cell in land:
            server.put_tile(cell)
        server.put_lists(land=land, lacking=[Cell(40, 45)])
        monkeypatch.setenv("GCSPLAN_DEM_MIRROR", server.url)
        yield server


@pytest.fixture
def run(run: Any, tmp_path: Path) -> Any:
    """`run` of the folder, in a directory with a mission."""
    (tmp_path / "ridge.yaml").write_text(MISSION)
    return run


@pytest.mark.slow
def test_from_nothing_to_a_plan_by_the_commands_that_are_told(run: Any, served: Served, tmp_path: Path) -> None:
    code, _, err = run("plan", "ridge.yaml")
    assert code == 2
    assert len(err.splitlines()) == 1
    command = err.split("`")[1]
    assert command == "gcsplan dem fetch --source copernicus-glo30 --tiles N36W085,N36W084"
    code, out, err = run(*command.split()[1:])
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()] == ["N36W085", "N36W084"]
    assert "surface model (trees and buildings are in it), heights above EGM2008" in err
    asked = len(served.requests)
    code, out, _ = run("plan", "ridge.yaml")
    assert code == 0
    assert SURFACE_DEM in out
    inputs = json.loads((tmp_path / "ridge" / "summary.json").read_text())["inputs"]
    assert (inputs["dem_kind"], inputs["vertical_datum"], inputs["bare_dem"]) == ("surface", "EGM2008", False)
    code, out, _ = run("check", "ridge.yaml", "ridge/uav1.waypoints", "--json")
    assert code == 0
    assert json.loads(out)["inputs"]["dem_tiles"] == "N36W085,N36W084"
    assert len(served.requests) == asked


@pytest.mark.slow
def test_a_mission_is_fetched_by_its_file(run: Any, served: Served) -> None:
    code, out, _ = run("dem", "fetch", "ridge.yaml", "--offline", "--json")
    assert code == 2
    assert set(json.loads(out)["error"]["problems"][0]) == {"where", "message"}
    assert served.requests == []
    assert run("dem", "fetch", "ridge.yaml")[0] == 0
    code, out, _ = run("dem", "fetch", "ridge.yaml", "--offline", "--json")
    assert code == 0
    document = json.loads(out)
    assert (document["source"], document["kind"], document["vertical_datum"]) == (
        "copernicus-glo30", "surface", "EGM2008"
    )  # fmt: skip
    assert [(row["tile"], row["state"], row["cached"]) for row in document["tiles"]] == [
        ("N36W085", "tile", True), ("N36W084", "tile", True)
    ]  # fmt: skip


@pytest.mark.slow
def test_a_place_is_fetched_with_the_area_around_it(run: Any, served: Served) -> None:
    code, out, _ = run("dem", "fetch", "--around", "36°30'N 84°00'W", "--radius-km", 3)
    assert code == 0
    assert out.split()[0::4][:1] == ["N36W085"]
    assert "sea: neither this source nor GLO-90" in run("dem", "fetch", "--around", "10.5,10.5", "--radius-km", 3)[1]
    assert "unknown ground" in run("dem", "fetch", "--around", "40.5,45.5", "--radius-km", 3)[1]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "which area? Give one of MISSION, --around, --tiles; given none"),
        (("ridge.yaml", "--tiles", "N36W085"), "given MISSION and --tiles"),
        (("--around", "36.5,-84.5"), "--around LAT,LON and --radius-km N belong together"),
        (("ridge.yaml", "--radius-km", "3"), "--around LAT,LON and --radius-km N belong together"),
        (("--around", "here", "--radius-km", "3"), "--around here: give LAT,LON in degrees"),
        (("--tiles", "N36W85"), "names such as N36W085, with commas: given 'N36W85'"),
        (("--tiles", ","), "given 0 of them"),
        (("--tiles", "N36W085", "--source", "glo30"), "there is no source 'glo30'"),
        (("--tiles", "N36W085", "--mirror", "mirror.example"), "--mirror: expected an address such as https://"),
        (("ridge.yaml", "--source", "srtm"), "ridge.yaml says `dem: copernicus-glo30`; change it there"),
        (("nothing.yaml",), "nothing.yaml: there is no such file"),
        (("sample.yaml",), "terrain.dem: names no published source"),
        (("--around", "80,0", "--radius-km", "300"), "--radius-km: this area needs"),
        (("--around", "89,0", "--radius-km", "3"), "--around 89,0: give a place within ±85° of latitude"),
    ],
)
def test_a_mistake_is_one_message(run: Any, served: Served, tmp_path: Path, arguments: Any, words: str) -> None:
    sample = MISSION.replace("copernicus-glo30", "sample:jacksboro").replace("84.05", "84.35").replace("84.01", "84.33")
    (tmp_path / "sample.yaml").write_text(sample)
    code, out, err = run("dem", "fetch", *arguments)
    assert code == 2
    assert out == ""
    assert words in err
    assert served.requests == []


def test_an_interruption_says_that_nothing_is_lost(run: Any, served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("gcsplan.dem.fetch.download", stop)
    code, _, err = run("dem", "fetch", "ridge.yaml")
    assert code == 130
    assert err == "gcsplan: interrupted: what came is kept, and the same command goes on from here\n"


def test_what_cannot_be_had_is_exit_code_6_and_the_rest_stays(run: Any, served: Served) -> None:
    served.objects = {path: data for path, data in served.objects.items() if "W084" not in path}
    code, out, err = run("dem", "fetch", "ridge.yaml", "--json")
    assert code == 6
    assert json.loads(out)["error"]["reason"] == "download"
    assert "1 of 2 tiles could not be downloaded" in err
    assert "N36W084: http://127.0.0.1" in err
    assert "1 copernicus-glo30 tile of this area is not in the cache" in run("plan", "ridge.yaml")[2]
