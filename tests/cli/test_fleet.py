"""Fleets on the command line: one line plans, uploads and tells when to start whom; refusals; rehearsal; report."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.sim.vehicle.server import SimServer
from gcsplan.vehicle import Autopilot
from tests.app.fleet.test_fleet import CROSS

LIMITS = CROSS["limits"] | {"track_error_m": 3, "altitude_error_m": 3}
ARRIVAL = {"mode": "sequence", "order": ["west", "south"], "interval_s": 20, "separation_m": 30}


def write(tmp_path: Path, arrival: dict[str, Any] = ARRIVAL, **more: Any) -> Path:
    file = tmp_path / "cross.yaml"
    file.write_text(yaml.safe_dump(CROSS | {"limits": LIMITS, "arrival": arrival} | more))
    return file


def boards(**trouble: Any) -> list[LoopbackVehicle]:
    places = {"west": (1, 36.6, -84.3055881), "south": (2, 36.5954942, -84.3)}
    return [
        LoopbackVehicle(
            sysid, Autopilot.ARDUCOPTER, lat_deg=lat, lon_deg=lon, amsl_m=0.0,
            misbehave=Misbehaviour(**trouble.get(name, {})),
        )
        for name, (sysid, lat, lon) in places.items()
    ]  # fmt: skip


@pytest.mark.slow
def test_one_line_plans_uploads_verifies_and_tells_when_to_start_whom(run: Any, tmp_path: Path) -> None:
    with SimServer(boards(), "udpin:127.0.0.1:0", speedup=10.0) as server:
        code, out, err = run("plan", write(tmp_path), "--upload", server.url_for_gcs, "--atomic")
    assert code == 0, err
    assert "arrival: sequence, 20 s apart; order west, south" in out
    assert "separation:" in out
    assert "release" in out
    assert "nothing is armed or started" in out
    upload = json.loads((tmp_path / "cross" / "upload.json").read_text())
    assert all(v["upload"]["verified"] for v in upload["vehicles"])
    assert upload["fleet"]["order"] == ["west", "south"]


@pytest.mark.slow
def test_json_names_who_refused_and_whose_mission_was_withdrawn(run: Any, tmp_path: Path) -> None:
    with SimServer(boards(south={"refuse": 2}), "udpin:127.0.0.1:0", speedup=10.0) as server:
        code, out, _ = run("plan", write(tmp_path), "--upload", server.url_for_gcs, "--atomic", "--json")
        assert server.vehicles[0].items()[1:] == ()
    told = json.loads(out)
    assert code == told["error"]["code"] == 5
    assert "south" in told["error"]["message"]
    assert [v["upload"]["outcome"] for v in told["vehicles"]] == ["withdrawn", "refused"]


@pytest.mark.parametrize(
    ("arrival", "reason", "words"),
    [
        ({"interval_s": 3600, "hold": "gate", "clock": "first"}, "time", "interval_s"),
        ({"interval_s": 20}, "separation", "apart"),
    ],
)
def test_what_cannot_be_kept_is_exit_3_with_its_reason(
    run: Any, tmp_path: Path, arrival: dict[str, Any], reason: str, words: str
) -> None:
    west, south = CROSS["vehicles"]
    if reason == "time":  # a plane that may not wait, and whose path cannot grow so much
        south = south | {"speed_m_s": [9.9, 10], "autopilot": "arduplane", "end": "loiter"}
    else:  # one pad for two
        south = south | {"goal": {"east_m": 500, "north_m": 5}}
    file = write(tmp_path, ARRIVAL | arrival, vehicles=[west, south])
    code, out, err = run("plan", file, "--json")
    told = json.loads(out)["error"]
    assert (code, told["code"], told["reason"]) == (3, 3, reason)
    assert words in err or words in told["message"]
    assert not (tmp_path / "cross").exists()


@pytest.mark.parametrize("time", ["noon", "1999-12-31T23:59:59", "2020-01-01T00:00:00Z"])
def test_a_gate_that_cannot_be_is_exit_2(run: Any, tmp_path: Path, time: str) -> None:
    code, _, err = run("plan", write(tmp_path), "--gate-utc", time)
    assert code == 2
    assert "--gate-utc" in err


@pytest.mark.slow
def test_a_rehearsal_flies_the_fleet_and_ends_with_0_where_all_went_well(run: Any, tmp_path: Path) -> None:
    code, out, err = run("rehearse", write(tmp_path), "--json")
    assert code == 0, err
    told = json.loads(out)
    assert told["safe"] is True
    assert told["fleet"]["order_flown"] == ["west", "south"]
    assert all(abs(v["error_s"]) < 0.5 for v in told["vehicles"])


@pytest.mark.slow
def test_a_report_and_the_way_home_stand_beside_the_missions(run: Any, tmp_path: Path) -> None:
    code, out, err = run("plan", write(tmp_path), "--report")
    assert code == 0, err
    page = (tmp_path / "cross" / "report.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert "west" in page
    assert "way home" in out
    summary = json.loads((tmp_path / "cross" / "summary.json").read_text())
    assert all("lowest_rel_home_m" in v["way_home"] for v in summary["vehicles"])
