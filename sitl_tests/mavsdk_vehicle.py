"""A vehicle that uses MAVSDK's mission_raw_server, in a process of its own, so that the tests can kill it if it hangs.

    python mavsdk_vehicle.py udpin://127.0.0.1:PORT [SYSID]

Prints {"ready": true}, and then one JSON line for each mission that it receives: {"result": …, "items": [row, …]}.
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

_out = os.fdopen(os.dup(1), "w")  # MAVSDK logs to standard output: from here on that is standard error
os.dup2(2, 1)
_saying = threading.Lock()


def say(document: dict[str, Any]) -> None:
    """Write one JSON line, under a lock because MAVSDK calls from its own threads."""
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
