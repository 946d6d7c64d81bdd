"""MAVSDK as a ground station, in a process of its own.

    python mavsdk_station.py udpout://127.0.0.1:PORT < steps.json

Standard input is a JSON list of steps, each ``[name, argument …]``: ``["upload", mission_type, [row, …]]``,
``["download", mission_type]``, ``["clear"]``, ``["import_plan", path]``, ``["import_waypoints", path]``. The answer is
one JSON line, a list with one entry per step: "SUCCESS", rows, the three lists of an import, or {"failed": …}.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from typing import Any

from mavsdk import ComponentType, Configuration, ConnectionResult, Mavsdk
from mavsdk.plugins.mission_raw.mission_raw import MissionItem, MissionRaw, MissionRawError
from wire_json import numbers_of, row_of

_out = os.fdopen(os.dup(1), "w")  # MAVSDK logs to standard output: from here on that is standard error
os.dup2(2, 1)

HEARTBEAT_WITHIN_S = 15.0


def carry_out(raw: MissionRaw, step: list[Any]) -> Any:
    """Carry out one step; return its answer."""
    name, arguments = step[0], step[1:]
    uploads: list[Callable[[Any], Any]] = [raw.upload_mission, raw.upload_geofence, raw.upload_rally_points]
    downloads: list[Callable[[], Any]] = [raw.download_mission, raw.download_geofence, raw.download_rallypoints]
    if name == "upload":
        mission_type, rows = arguments
        return uploads[mission_type]([MissionItem(*numbers_of(row)) for row in rows]).name
    if name == "download":
        return [row_of(item) for item in downloads[arguments[0]]()]
    if name == "clear":
        return raw.clear_mission().name
    read = raw.import_qgroundcontrol_mission if name == "import_plan" else raw.import_mission_planner_mission
    data = read(arguments[0])
    return [[row_of(i) for i in items] for items in (data.mission_items, data.geofence_items, data.rally_items)]


def main(url: str, steps: list[list[Any]]) -> list[Any]:
    """Connect, carry out every step, and return the answers."""
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    result = mavsdk.add_any_connection(url)
    if result != ConnectionResult.SUCCESS:
        raise SystemExit(f"MAVSDK cannot open {url}: {result.name}")
    system = mavsdk.first_autopilot(HEARTBEAT_WITHIN_S)
    if system is None:
        raise SystemExit(f"MAVSDK finds no autopilot at {url}")
    raw = MissionRaw(system)
    answers: list[Any] = []
    for step in steps:
        try:
            answers.append(carry_out(raw, step))
        except MissionRawError as error:
            answers.append({"failed": error.result.name})
    return answers


if __name__ == "__main__":
    _out.write(json.dumps(main(sys.argv[1], json.load(sys.stdin))) + "\n")
    _out.flush()
    os._exit(0)  # its own shutdown can hang
