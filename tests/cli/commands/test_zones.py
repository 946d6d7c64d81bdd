"""`--list-zones`: every zone with its shape, size, floor, ceiling and source, and nothing else done."""

from __future__ import annotations

import json
import math
import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from pyproj import Geod

from gcsplan.cli.main import main
from gcsplan.cli.output import console
from tests.support.paths import DATA

GEOD = Geod(ellps="WGS84")
RING = [[-84.3, 36.64], [-84.27, 36.64], [-84.27, 36.66], [-84.3, 36.66], [-84.3, 36.64]]
MISSION = """
version: 1
terrain: {dem: nowhere.tif}
no_fly:
  - {file: masts.csv, radius_ft: 200}
  - {file: z.geojson}
  - {name: ropeway, line: [[36.64, -84.36], [36.66, -84.35]], buffer_m: 40, floor_agl_m: 10, ceiling_agl_m: 80}
vehicles: 7
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.yaml").write_text(MISSION)
    (tmp_path / "masts.csv").write_text("name,lat,lon,height_m\nBrenton [mast],36.67,-84.33,95\n")
    feature = {"type": "Feature", "properties": {"name": "R-1 " * 12, "upper": "1500 FT AMSL"},
               "geometry": {"type": "Polygon", "coordinates": [RING]}}  # fmt: skip
    (tmp_path / "z.geojson").write_text(json.dumps(feature))
    return tmp_path


def run(*arguments: str) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["gcsplan", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)


def document(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    assert run(*arguments, "--list-zones", "--json") == 0
    return json.loads(capsys.readouterr().out)


def test_zones_are_listed_though_the_rest_of_the_mission_is_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(os.listdir())
    mast, restricted, ropeway = document(capsys, "plan", "m.yaml")["zones"]
    assert mast == {
        "name": "Brenton [mast]", "shape": "circle", "corners": 1, "extent_m": [121.9, 121.9], "radius_m": 61.0,
        "ceiling_agl_m": 95.0, "source": "masts.csv: line 2",
    }  # fmt: skip
    width_m = GEOD.inv(-84.3, 36.65, -84.27, 36.65)[2]
    height_m = GEOD.inv(-84.3, 36.64, -84.3, 36.66)[2]
    assert restricted["extent_m"] == [pytest.approx(width_m, rel=1e-3), pytest.approx(height_m, abs=0.5)]
    assert (restricted["shape"], restricted["ceiling_amsl_m"]) == ("polygon", 457.2)
    assert ropeway["length_m"] == pytest.approx(GEOD.inv(-84.36, 36.64, -84.35, 36.66)[2], abs=0.1)
    assert (ropeway["floor_agl_m"], ropeway["ceiling_agl_m"], ropeway["buffer_m"]) == (10.0, 80.0, 40.0)
    assert ropeway["source"] == "m.yaml: no_fly[2]"
    assert sorted(os.listdir()) == before


def test_the_table_fits_80_columns(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console.console, "width", 80)
    assert run("plan", "m.yaml", "--list-zones") == 0
    said = capsys.readouterr()
    lines = said.out.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[0].split() == ["name", "shape", "size", "floor", "ceiling", "source"]
    words = " ".join(said.out.split())
    assert "Brenton circle radius 61 m ground 95 m AGL masts.csv: [mast] line 2" in words
    assert "corridor 2.39 km, ±40 m 10 m AGL 80 m AGL no_fly[2]" in words
    assert "polygon 2.68 km x 2.22 km ground 457.2 m AMSL" in words
    assert lines[-1] == "3 zones"
    assert "note: z.geojson: floors and ceilings are read from other attributes" in said.err


def test_check_lists_files_of_zones_and_leaves_missions_of_others_out(capsys: pytest.CaptureFixture[str]) -> None:
    assert len(document(capsys, "check", "z.geojson", "no.plan", "m.yaml")["zones"]) == 4
    assert len(document(capsys, "check", "no.plan", "--zones", "z.geojson")["zones"]) == 1
    assert run("check", "z.geojson", "--list-zones", "--units", "aviation") == 0
    assert "1500 ft AMSL" in capsys.readouterr().out
    assert run("check", "no.plan", "--list-zones") == 2
    assert "of which zones? Give a mission file (.yaml) or a file of zones" in capsys.readouterr().err


def test_zones_of_an_authority_that_restrict_nothing_are_no_zones(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(DATA / "airspace" / "openair_openaip.txt", folder / "a.txt")
    (folder / "m.yaml").write_text("version: 1\nno_fly: [{file: a.txt}]\n")
    for arguments in (("check", "a.txt"), ("plan", "m.yaml")):
        told = document(capsys, *arguments)
        assert "TH-3-1" not in [zone["name"] for zone in told["zones"]]
        assert "a.txt: not used, because their kind restricts nothing: TH-3-1" in told["notes"]


def test_mistakes_in_zones_are_told_and_others_are_not(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "m.yaml").write_text(MISSION.replace("buffer_m: 40", "buffer_m: -40"))
    assert run("plan", "m.yaml", "--list-zones") == 2
    assert capsys.readouterr().err.startswith("gcsplan: m.yaml: no_fly[2].buffer_m: must be above 0 and at most 20000")
    assert run("check", "masts.csv", "--list-zones") == 2
    assert "a point needs a radius" in capsys.readouterr().err
    assert run("plan", "m.yaml", "--list-zones", "--upload", "sim") == 2
    assert "--list-zones plans nothing" in capsys.readouterr().err


def test_a_zone_as_large_as_the_earth_and_a_mission_without_zones_are_listed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world = [[-180, -89], [-60, -89], [60, -89], [180, -89], [180, 89], [60, 89], [-60, 89], [-180, 89]]
    (folder / "w.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [world]}))
    (zone,) = document(capsys, "check", "w.geojson")["zones"]
    assert all(math.isfinite(x) for x in zone.get("extent_m", []))
    (folder / "m.yaml").write_text("version: 1\n")
    assert run("plan", "m.yaml", "--list-zones") == 0
    assert capsys.readouterr().out == "0 zones\n"


def test_a_local_mission_lists_its_metres(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "m.yaml").write_text(
        "frame: {origin: [36.6, -84.3]}\n"
        "no_fly: [{line: [{east_m: 0, north_m: 0}, {east_m: 30, north_m: 40}], buffer_m: 5}]\n"
    )
    (zone,) = document(capsys, "plan", "m.yaml")["zones"]
    assert (zone["length_m"], zone["extent_m"]) == (50.0, [40.0, 50.0])
