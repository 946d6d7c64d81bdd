"""A vehicle made of MAVSDK's mission_raw_server, to be run in a process of its own: it can hang, and then dies alone.

    python mavsdk_vehicle.py udpin://127.0.0.1:PORT [SYSID]

Says {"ready": true} and then one JSON line for each list it was given: {"result": …, "items": [row, …]}.
Ends when its standard input is closed.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
import threading
from typing import Any

from mavsdk import Configuration, ConnectionResult, Mavsdk
from mavsdk.plugins.mission_raw_server.mission_raw_server import MissionRawServer
from wire_json import row_of

_out = os.fdopen(os.dup(1), "w")  # MAVSDK writes its log to standard output: that goes to standard error from here on
os.dup2(2, 1)
_saying = threading.Lock()


def say(document: dict[str, Any]) -> None:
    """One line, whole: MAVSDK calls from threads of its own."""
    with _saying:
        _out.write(json.dumps(document) + "\n")
        _out.flush()


def main(url: str, sysid: int) -> None:
    """Listen until standard input ends."""
    mavsdk = Mavsdk(Configuration.create_manual(sysid, 1, True))
    server = MissionRawServer(mavsdk.server_component_by_id(1))
    server.subscribe_incoming_mission(
        lambda result, plan, _: say({"result": result.name, "items": [row_of(i) for i in plan.mission_items]})
    )
    result = mavsdk.add_any_connection(url)
    if result != ConnectionResult.SUCCESS:
        raise SystemExit(f"MAVSDK cannot open {url}: {result.name}")
    say({"ready": True})
    with contextlib.suppress(KeyboardInterrupt):
        sys.stdin.read()
    os._exit(0)  # its own shutdown can hang


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 1)
