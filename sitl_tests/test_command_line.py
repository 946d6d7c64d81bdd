"""The command line with MAVSDK vehicles: it plans a mission file and uploads the missions."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import pytest

from gcsplan.mavlink.files.formats import read_mission_file
from gcsplan.vehicle import Autopilot
from sitl_tests.peers import MavsdkVehicle, item_of

MISSION = """
    version: 1
    name: two over a field
    frame: {origin: [36.6, -84.3], amsl_m: 300}
    terrain: {flat_m: 0}
    limits: {min_agl_m: 30}
    no_fly:
      - {name: tower, center: {east_m: 450, north_m: 200}, radius_m: 120}
    vehicles:
      - {name: uav1, sysid: 1, autopilot: arducopter, speed_m_s: [3, 12],
         start: {east_m: 0, north_m: 0, up_m: 0}, goal: {east_m: 900, north_m: 400, up_m: 0}}
      - {name: uav2, sysid: 2, autopilot: px4, speed_m_s: [3, 12],
         start: {east_m: 0, north_m: 500, up_m: 0}, goal: {east_m: 900, north_m: 900, up_m: 0}}
    arrival: {mode: none}
"""


def gcsplan(*words: str, cwd: Path) -> tuple[int, dict[str, Any], str]:
    """Run gcsplan with ``--json``; return exit code, the JSON document, and the text on standard error."""
    program = "import sys; from gcsplan.cli.main import main; sys.exit(main())"
    done = subprocess.run(
        [sys.executable, "-c", program, *words, "--json"],
        cwd=cwd, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    return done.returncode, json.loads(done.stdout), done.stderr


@pytest.mark.nightly
def test_a_plan_reaches_mavsdk_vehicles_with_the_same_wire_numbers(tmp_path: Path) -> None:
    (tmp_path / "field.yaml").write_text(textwrap.dedent(MISSION))
    with MavsdkVehicle(sysid=1) as one, MavsdkVehicle(sysid=2) as two:
        code, document, words = gcsplan(
            "plan", "field.yaml", "--upload", f"uav1={one.url}", "--upload", f"uav2={two.url}", cwd=tmp_path
        )
        assert code == 0, words
        rows = [one.received(), two.received()]
    copter = read_mission_file(tmp_path / "field" / "uav1.waypoints", autopilot=Autopilot.ARDUCOPTER).mission
    px4 = read_mission_file(tmp_path / "field" / "uav2.plan", autopilot=Autopilot.PX4).mission
    assert len(copter.items) >= 5
    for got, mission in zip(rows, (copter, px4), strict=True):
        assert [item_of(row).wire for row in got] == [item.wire for item in mission.wire_items()]
    uploads = [vehicle["upload"] for vehicle in document["vehicles"]]
    assert [(u["outcome"], u["verified"], u["simulated"]) for u in uploads] == [("accepted", True, False)] * 2
