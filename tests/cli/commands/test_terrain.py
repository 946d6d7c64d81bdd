"""`gcsplan terrain`: files for the SD card, serving and comparing, against a loopback vehicle on a real socket."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gcsplan.dem.dat_file import read_dat
from gcsplan.mavlink.link import terrain as link_terrain
from gcsplan.mission_file import load_mission
from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot

Run = Callable[..., tuple[int, str, str]]

MISSION = """
version: 1
name: hill
terrain: {dem: sample:jacksboro}
limits: {min_agl_m: 60}
vehicles:
  - {name: uav1, sysid: 1, autopilot: arducopter, start: [36.59, -84.25], goal: [36.60, -84.24], speed_m_s: [3, 9]}
"""


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    file = tmp_path / "hill.yaml"
    file.write_text(MISSION)
    return file


@pytest.fixture
def vehicle() -> Iterator[str]:
    one = LoopbackVehicle(1, Autopilot.ARDUCOPTER, lat_deg=36.59, lon_deg=-84.25, amsl_m=400.0)
    with SimServer([one], "udpin:127.0.0.1:0", speedup=30.0) as server:
        yield server.url_for_gcs


@pytest.mark.slow
def test_files_for_the_card_read_as_terrain(run: Run, mission: Path, tmp_path: Path) -> None:
    out = tmp_path / "terrain"
    code, text, _ = run("terrain", "dat", mission, "-o", out, "--margin-km", 1, "--json")
    assert code == 0
    told = json.loads(text)
    assert [row["kept"] for row in told["files"]] == [0]
    file = read_dat(out / "N36W085.DAT", where="")
    assert len(file.blocks) == told["files"][0]["blocks"]
    assert told["unknown_blocks"] == told["partly_known_blocks"] == 0

    code, _, err = run("terrain", "dat", mission, "-o", out)
    assert code == 2
    assert "is there already" in err
    before = (out / "N36W085.DAT").read_bytes()
    code, text, _ = run("terrain", "dat", mission, "-o", out, "--margin-km", 0, "--add", "--json")
    assert code == 0
    assert (out / "N36W085.DAT").read_bytes() == before
    code, _, err = run("terrain", "dat", mission, "-o", out, "--spacing", 50, "--add")
    assert code == 2
    assert "posts every 100 m" in err

    flown = tmp_path / "again.yaml"
    flown.write_text(MISSION.replace("sample:jacksboro", f"{out}, vertical_datum: EGM96"))
    assert load_mission(flown).inputs["resolution_m"] == 100


def test_a_margin_that_is_too_wide_is_refused(run: Run, mission: Path, tmp_path: Path) -> None:
    code, _, err = run("terrain", "dat", mission, "-o", tmp_path / "x", "--margin-km", 100, "--spacing", 20)
    assert code == 2
    assert "more than 20000 blocks" in err
    assert "smaller --margin-km" in err
    assert not (tmp_path / "x").exists()


@pytest.mark.slow
def test_serve_until_loaded_and_check(run: Run, mission: Path, vehicle: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link_terrain, "ASK_AFTER_S", 0.0)
    monkeypatch.setattr("gcsplan.app.upload.terrain_service.QUIET_S", 0.3)
    monkeypatch.setattr("gcsplan.app.upload.terrain_service.LISTEN_S", 0.0)
    code, text, err = run("terrain", "serve", mission, "--link", vehicle, "--until-loaded", "--seconds", 60, "--json")
    assert code == 0, err
    [one] = json.loads(text)["vehicles"]
    assert one["complete"]
    assert one["pending"] == one["unknown_parts"] == 0
    assert one["parts"] >= one["loaded"] > 0
    code, text, err = run("terrain", "check", mission, "--link", vehicle, "--points", 4, "--json")
    assert code in (0, 6), err  # at the edge of the sample a part may be unknown, and stops the others
    [one] = json.loads(text)["vehicles"]
    assert one["worst_m"] < 0.5


def test_nobody_there_and_nobody_who_asks(run: Run, mission: Path) -> None:
    code, _, err = run("terrain", "serve", mission, "--link", "uav9=udpout:127.0.0.1:9")
    assert code == 2
    assert "no vehicle 'uav9'" in err
    mission.write_text(MISSION.replace("arducopter", "px4"))
    code, _, err = run("terrain", "check", mission, "--link", "udpout:127.0.0.1:9")
    assert code == 2
    assert "ArduPilot alone" in err
