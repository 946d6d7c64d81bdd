"""A real autopilot for tests: a SITL that is running already, or an `arducopter` binary that is started and stopped.

Set ``GCSPLAN_SITL=tcp:127.0.0.1:5760`` (any link URL), or ``GCSPLAN_SITL=/path/to/arducopter``.
"""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gcsplan.errors import LinkError
from gcsplan.mavlink.link.link import Link
from gcsplan.mavlink.link.session import discover
from gcsplan.mavlink.link.watch import VehicleState
from sitl_tests.peers import free_port

VARIABLE = "GCSPLAN_SITL"
WHY_SKIPPED = f"no autopilot: set {VARIABLE}=tcp:127.0.0.1:5760 (a running SITL) or to the path of an arducopter binary"
SPEEDUP = 4.0
_HOME = "36.6000123,-84.3799877,371.25,90"
_PORTS = ("--base-port", "--rc-in-port", "--irlock-port", "--sim-port-in", "--sim-port-out")
_START_S, _READY_S, _STOP_S = 20.0, 120.0, 10.0


def wanted() -> str:
    """The value of GCSPLAN_SITL, or an empty string."""
    return os.environ.get(VARIABLE, "").strip()


@contextmanager
def running(where: str, directory: Path) -> Iterator[Link]:
    """Open a link to the autopilot that ``where`` names. Tests share it: SITL ends when its console's link closes."""
    if not os.path.isfile(where):
        with Link(where) as link:
            yield link
        return
    ports = [free_port(socket.SOCK_STREAM) for _ in _PORTS]
    options = [word for name, port in zip(_PORTS, ports, strict=True) for word in (name, str(port))]
    process = subprocess.Popen(
        [os.path.abspath(where), "--model", "+", "--speedup", str(SPEEDUP), "--home", _HOME, *options],
        cwd=directory, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        with _connected(f"tcp:127.0.0.1:{ports[0]}", process) as link:
            yield link
    finally:
        process.terminate()
        try:
            process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(_STOP_S)


def _connected(url: str, process: subprocess.Popen[bytes]) -> Link:
    end = time.monotonic() + _START_S
    while True:
        try:
            return Link(url)
        except LinkError:
            if process.poll() is not None:
                raise AssertionError(f"the autopilot ended at once with code {process.returncode}") from None
            if time.monotonic() > end:
                raise
            time.sleep(0.1)


def ready(link: Link, sysid: int) -> VehicleState:
    """Wait until the autopilot has a position and a home; return its state."""
    end = time.monotonic() + _READY_S
    while True:
        state = discover(link, sysid, 20.0, listen_s=0.0, standby_s=60.0)
        if state.located and state.home is not None:
            return state
        assert time.monotonic() < end, f"the autopilot has no position after {_READY_S} s: {state}"
