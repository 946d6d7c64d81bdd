"""A crossing of a valley for tests of commands: its mission, what a plan of it writes, and a vehicle at its start."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gcsplan.sim.vehicle.loopback import LoopbackVehicle
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from gcsplan.vehicle import Autopilot
from tests.support.paths import DATA

CROSSING = DATA / "crossing.yaml"


OUTPUTS = {"uav1.waypoints", "uav1.plan", "uav1.param", "mission.kml", "mission.geojson", "profile.csv", "summary.json"}


def changed(tmp_path: Path, old: str, new: str) -> Path:
    text = CROSSING.read_text()
    assert old in text
    file = tmp_path / "changed.yaml"
    file.write_text(text.replace(old, new))
    return file


def vehicle(autopilot: Autopilot = Autopilot.ARDUCOPTER, amsl_m: float = 471.0, **trouble: Any) -> LoopbackVehicle:
    return LoopbackVehicle(1, autopilot, lat_deg=36.6, lon_deg=-84.38, amsl_m=amsl_m, misbehave=Misbehaviour(**trouble))
