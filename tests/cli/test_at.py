"""`at`, key and option, of check, upload, verify, rehearse, batch and plan: the hours hold the flight, or say so."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.mission_file.published.made import ed269, volume

LAT, LON = 47.0, 8.0
MISSION = """
version: 1
terrain: {flat_m: 400}
limits: {min_agl_m: 40, max_agl_m: 100}
no_fly: [{file: zones.json}]
vehicles:
  - {name: uav1, sysid: 1, autopilot: arducopter, speed_m_s: [3, 9], start: [47.0, 8.0], goal: [47.01, 8.0]}
"""
ROW = "{}\t{}\t{}\t{}\t{}\t0\t0\t0\t{}\t{}\t{}\t1"
HOME = (0, 1, 0, 16, 0, LAT, LON, 400)
TAKEOFF = (1, 0, 3, 22, 0, LAT, LON, 60)
THERE = (2, 0, 3, 16, 0, 47.01, LON, 60)
LAND = (3, 0, 3, 21, 0, 47.01, LON, 0)
TUESDAY = "2026-11-24T10:00Z"
Run = Callable[..., tuple[int, str]]


def items(*rows: tuple[float, ...]) -> str:
    return "QGC WPL 110\n" + "\n".join(ROW.format(*row) for row in rows) + "\n"


def row(of: tuple[float, ...], **changes: float) -> tuple[float, ...]:
    names = ("seq", "current", "frame", "command", "hold_s", "lat", "lon", "up")
    return tuple({**dict(zip(names, of, strict=True)), **changes}.values())


SHORT = items(HOME, TAKEOFF, THERE, LAND)
WAITS = items(HOME, TAKEOFF, row(THERE, command=19, hold_s=8 * 3600), LAND)
ENDLESS = items(HOME, TAKEOFF, row(THERE, command=17))
OPEN = items(HOME, TAKEOFF, THERE)


def over(lat: float, lon: float) -> None:
    """Write the zone around a place."""
    corners = ((-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1))
    ring = [[lon + x, lat + y] for x, y in corners]
    zone = volume(horizontalProjection={"type": "Polygon", "coordinates": [ring]})
    times = [{"schedule": [{"day": ["TUE"], "startTime": "15:00Z", "endTime": "16:00Z"}]}]
    Path("zones.json").write_text(json.dumps({"features": [ed269(zone, applicability=times, name="tuesdays")]}))


@pytest.fixture
def call(run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """`run` in a folder with a mission, a zone over it that applies on Tuesdays from 15:00, and flights."""
    monkeypatch.chdir(tmp_path)
    over(LAT, LON)
    Path("m.yaml").write_text(MISSION)
    Path("dated.yaml").write_text(MISSION + f"at: {TUESDAY}\n")
    for name, text in (("short", SHORT), ("waits", WAITS), ("endless", ENDLESS), ("open", OPEN)):
        Path(f"{name}.waypoints").write_text(text)

    def called(*arguments: object) -> tuple[int, str]:
        code, out, err = run(*arguments)
        return code, " ".join((out + err).split())

    return called


@pytest.fixture
def url() -> Iterator[str]:
    board = LoopbackVehicle(1, Autopilot.ARDUCOPTER, lat_deg=LAT, lon_deg=LON, amsl_m=400.0)
    with SimServer([board], "udpin:127.0.0.1:0", speedup=10.0) as server:
        yield server.url_for_gcs


def test_check_judges_a_flight_within_the_hours_alone(call: Run) -> None:
    assert "tuesdays" in call("check", "m.yaml", "short.waypoints")[1]  # without a date all zones count
    code, said = call("check", "dated.yaml", "short.waypoints")
    assert code == 0
    assert (
        "not used, because they do not apply in the hours of the mission (2026-11-24 10:00Z to 12:00Z): tuesdays"
        in said
    )
    code, said = call("check", "dated.yaml", "waits.waypoints")
    assert code == 4
    assert (
        "not judged: the hours of zones: zones that do not apply from 2026-11-24 10:00Z to 12:00Z were left out" in said
    )
    assert "it lasts to 2026-11-24 18:0" in said
    assert "write at: [from, to] with all of the flight in it" in said
    for name in ("endless", "open"):
        code, said = call("check", "dated.yaml", f"{name}.waypoints", "-q")
        assert code == 4
        assert "it ends in the air, and when it lands is not known" in said
    assert call("check", "dated.yaml", "waits.waypoints", "--json-lines")[0] == 4


def test_the_option_counts_in_place_of_the_key(call: Run) -> None:
    for mission in ("m.yaml", "dated.yaml"):
        code, said = call("check", mission, "waits.waypoints", "--at", "2026-11-25T10:00Z/2026-11-25T20:00Z")
        assert (code, "2026-11-25 10:00Z to 20:00Z): tuesdays" in said) == (0, True)
        code, said = call("check", mission, "short.waypoints", "--at", "2026-11-24")
        assert "the start lies inside the no-fly zone" in said
    code, said = call("check", "m.yaml", "short.waypoints", "--at", "noon")
    assert code == 2
    assert "at: 'noon' is no time" in said
    assert "tuesdays" in call("check", "--list-zones", "zones.json", "--at", "2026-11-25")[1]
    assert call("check", "--list-zones", "zones.json", "--at", "2026-11-25")[1].startswith("0 zones")


@pytest.mark.slow
def test_check_with_options_takes_it_too(call: Run) -> None:
    over(36.6, -84.3)
    for name in ("short", "waits"):
        text = Path(f"{name}.waypoints").read_text()
        Path(f"{name}.waypoints").write_text(text.replace("\t47.0", "\t36.6").replace("\t8.0\t", "\t-84.3\t"))
    world = ["--dem", "sample:jacksboro", "--vertical-datum", "EGM96", "--min-agl", "1", "--zones", "zones.json"]
    assert "zone: inside no-fly zone “tuesdays”" in call("check", "short.waypoints", *world, "-q")[1]
    said = call("check", "short.waypoints", *world, "--at", TUESDAY, "-q")[1]
    assert "tuesdays”" not in said
    assert "the hours of zones" not in said
    assert "the hours of zones" in call("check", "waits.waypoints", *world, "--at", TUESDAY, "-q")[1]


@pytest.mark.slow
def test_upload_and_verify_refuse_a_flight_beyond_the_hours(call: Run, url: str) -> None:
    as_it_flies = ("--allow-parameters",)  # the file commands no speed, and WPNAV_SPEED is not the mission's
    code, said = call("upload", "waits.waypoints", "--to", url, "--mission", "dated.yaml")
    assert code == 4
    assert "the hours of zones" in said
    code, said = call("upload", "short.waypoints", "--to", url, "--mission", "m.yaml", "--at", TUESDAY, *as_it_flies)
    assert code == 0, said
    assert call("verify", "short.waypoints", "--to", url, "--mission", "dated.yaml", *as_it_flies)[0] == 0
    minutes = f"{TUESDAY}/2026-11-24T10:01Z"
    code, said = call("verify", "short.waypoints", "--to", url, "--mission", "m.yaml", "--at", minutes, *as_it_flies)
    assert code == 4
    assert "the hours of zones" in said
    assert call("upload", "short.waypoints", "--to", url, "--unchecked", "--at", TUESDAY)[0] == 2
    assert call("verify", "short.waypoints", "--to", url, "--at", TUESDAY)[0] == 2


@pytest.mark.nightly
def test_plan_batch_and_rehearse_take_the_option(call: Run) -> None:
    assert call("plan", "m.yaml", "-o", "out")[0] == 2  # the start lies inside the zone
    assert call("plan", "m.yaml", "-o", "out", "--at", TUESDAY)[0] == 0
    assert call("rehearse", "m.yaml", "--at", TUESDAY)[0] == 0
    assert call("rehearse", "dated.yaml")[0] == 0
    assert call("rehearse", "m.yaml")[0] == 2
    assert call("batch", "m.yaml", "-o", "all", "--at", TUESDAY)[0] == 0
    assert call("batch", "m.yaml", "-o", "all")[0] == 2  # another `at` is not done before
    endless = MISSION.replace("goal: [47.01, 8.0]", "goal: [47.01, 8.0], end: loiter")
    Path("m.yaml").write_text(endless)
    code, said = call("plan", "m.yaml", "-o", "out", "--at", TUESDAY)
    assert code == 4
    assert "it ends in the air, and when it lands is not known" in said
    assert call("plan", "m.yaml", "-o", "out", "--at", TUESDAY, "--allow-unjudged")[0] == 0
    code, said = call("plan", "m.yaml", "-o", "out", "--at", f"{TUESDAY}/2026-11-24T10:01Z")
    assert code == 4
