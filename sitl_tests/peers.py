"""MAVSDK in separate processes, with bounded waits: `MavsdkVehicle`, and `mavsdk_station` for one conversation."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import queue
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from gcsplan.mavlink.mission.mission import MissionItem
from sitl_tests.wire_json import Row, numbers_of

_HERE = Path(__file__).parent
_START_S = 30.0
_STOP_S = 5.0
_CONVERSATION_S = 60.0


_worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % 10
_ports = itertools.cycle(range(20_000 + 1_000 * _worker, 21_000 + 1_000 * _worker))


def free_port(kind: socket.SocketKind) -> int:
    """A free port of 127.0.0.1 for a program that takes a moment to open it.

    It is outside of the range of ports that the system assigns, and each worker has its own range, so no other test
    takes the port before the program has opened it.
    """
    for port in itertools.islice(_ports, 1_000):
        with socket.socket(socket.AF_INET, kind) as one, contextlib.suppress(OSError):
            one.bind(("127.0.0.1", port))
            return port
    raise AssertionError("no port is free")


def row_for(seq: int, item: MissionItem, mission_type: int = 0, *, current: int = 0) -> Row:
    """An item as a row for the MAVSDK processes."""
    floats = [float(p).hex() for p in item.params]
    return [
        seq, item.frame, item.command, current, int(item.autocontinue), *floats, item.x, item.y, float(item.z).hex(),
        mission_type,
    ]  # fmt: skip


def item_of(row: Row) -> MissionItem:
    """The item of a row, without seq, current flag and mission type."""
    _, frame, command, _, autocontinue, p1, p2, p3, p4, x, y, z, _ = numbers_of(row)
    return MissionItem(command, frame, (p1, p2, p3, p4), x, y, z, bool(autocontinue))


class MavsdkVehicle:
    """A vehicle that uses MAVSDK's mission_raw_server and listens on a free port."""

    def __init__(self, sysid: int = 1) -> None:
        self.port = free_port(socket.SOCK_DGRAM)
        self.url = f"udpout:127.0.0.1:{self.port}"
        self._sysid = sysid
        self._heard: queue.Queue[dict[str, Any]] = queue.Queue()

    def __enter__(self) -> MavsdkVehicle:
        script = [sys.executable, str(_HERE / "mavsdk_vehicle.py"), f"udpin://127.0.0.1:{self.port}", str(self._sysid)]
        self._process = subprocess.Popen(
            script, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        assert self._next(_START_S) == {"ready": True}
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait(_STOP_S)
        self._reader.join(_STOP_S)
        self._process.stdout.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._heard.put(json.loads(line))

    def _next(self, within_s: float) -> dict[str, Any]:
        try:
            return self._heard.get(timeout=within_s)
        except queue.Empty:
            raise AssertionError(f"the MAVSDK vehicle sent nothing within {within_s} s") from None

    def received(self, within_s: float = 10.0) -> list[Row]:
        """The rows of the next list that is uploaded to it completely; AssertionError after ``within_s``."""
        end = time.monotonic() + within_s
        while True:
            document = self._next(max(0.0, end - time.monotonic()))
            if document["result"] == "SUCCESS":
                rows: list[Row] = document["items"]
                return rows


def mavsdk_station(url: str, steps: list[list[Any]]) -> list[Any]:
    """Let MAVSDK carry out steps with the vehicle at ``url`` (udpout:HOST:PORT); return the answer to each step."""
    theirs = url.replace("udpout:", "udpout://")
    done = subprocess.run(
        [sys.executable, str(_HERE / "mavsdk_station.py"), theirs],
        input=json.dumps(steps), capture_output=True, text=True, timeout=_CONVERSATION_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    answers: list[Any] = json.loads(done.stdout)
    return answers
