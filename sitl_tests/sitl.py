"""A real autopilot for tests: a SITL that is running already, or a binary that is started and stopped.

Set ``GCSPLAN_SITL`` to a folder with ``arducopter`` and ``arduplane``, to one of these programs, or to the URL of a
running SITL (``tcp:127.0.0.1:5760``). Each test names its vehicle: `needs` skips it where there is none.
"""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pymavlink.dialects.v20.ardupilotmega as dialect
import pytest

from gcsplan.errors import LinkError
from gcsplan.mavlink.link.link import Link, LinkSteps, run
from gcsplan.mavlink.link.session.session import discover
from gcsplan.mavlink.link.watch import VehicleState
from gcsplan.mavlink.mission.autopilots import autopilot_of
from gcsplan.sim.vehicle.firmware import ARDUPILOT_FAMILY, KNOWN_FIRMWARE, Firmware
from gcsplan.vehicle import Autopilot
from sitl_tests.peers import free_port

VARIABLE = "GCSPLAN_SITL"
SPEEDUP = 4.0
_MODELS = {Autopilot.ARDUCOPTER: "+", Autopilot.ARDUPLANE: "plane"}
_DEFAULTS = {
    Autopilot.ARDUCOPTER: {},
    # It stands still, and does not renew its home all the time.
    Autopilot.ARDUPLANE: {"SERVO3_MIN": 1000, "RC3_MIN": 1000, "RC3_TRIM": 1000, "HOME_RESET_ALT": -1},
}
_HOME = "36.6000123,-84.3799877,371.25,90"
_PORTS = ("--base-port", "--rc-in-port", "--irlock-port", "--sim-port-in", "--sim-port-out")
_START_S, _READY_S, _STOP_S, _ANSWER_S = 20.0, 120.0, 10.0, 10.0


def sitl_variable() -> str:
    """The value of GCSPLAN_SITL, or an empty string."""
    return os.environ.get(VARIABLE, "").strip()


def binary(autopilot: Autopilot) -> Path | None:
    """The program of that vehicle, None if there is none."""
    if not sitl_variable():
        return None
    given = Path(sitl_variable())
    found = given / autopilot.value if given.is_dir() else given
    return found if found.is_file() and found.stem == autopilot.value else None


def needs(autopilot: Autopilot, *, program: bool = False) -> pytest.MarkDecorator:
    """Skip a test for this vehicle where GCSPLAN_SITL names none; ``program``: where it names no program of it."""
    url = ":" in sitl_variable() and not Path(sitl_variable()).exists() and not program
    form = "a folder with it, or its path" if program else "a folder with it, its path, or a running SITL's URL"
    reason = f"for {autopilot}, and there is none: set {VARIABLE} to {form}"
    return pytest.mark.skipif(binary(autopilot) is None and not url, reason=reason)


def either(*, program: bool = False) -> pytest.MarkDecorator:
    """Run a test once for each of ArduPilot's vehicles, under the parameter ``autopilot``."""
    kinds = [pytest.param(a, marks=needs(a, program=program), id=a.value) for a in _MODELS]
    return pytest.mark.parametrize("autopilot", kinds)


@contextmanager
def running(autopilot: Autopilot, directory: Path) -> Iterator[Link]:
    """Open a link to such an autopilot. Tests share it: SITL ends when its console's link closes."""
    program = binary(autopilot)
    if program is None:
        with Link(sitl_variable()) as link:
            yield link
        return
    ports = [free_port(socket.SOCK_STREAM) for _ in _PORTS]
    options = [word for name, port in zip(_PORTS, ports, strict=True) for word in (name, str(port))]
    defaults = directory / "defaults.parm"
    defaults.write_text("".join(f"{name} {value}\n" for name, value in _DEFAULTS[autopilot].items()), encoding="ascii")
    options += ["--model", _MODELS[autopilot], "--speedup", str(SPEEDUP), "--home", _HOME, "--defaults", str(defaults)]
    process = subprocess.Popen(
        [str(program.resolve()), *options],
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


def ready(link: Link, sysid: int, autopilot: Autopilot) -> VehicleState:
    """Wait until the autopilot has a position and a home; return its state. Skips the test for another vehicle."""
    end = time.monotonic() + _READY_S
    while True:
        state = discover(link, sysid, 20.0, listen_s=0.0, standby_s=60.0)
        if autopilot_of(state.mav_autopilot, state.mav_type) is not autopilot:
            pytest.skip(f"for {autopilot}, and {sitl_variable()} is {state.what}")
        if state.located and state.home is not None:
            return state
        assert time.monotonic() < end, f"the autopilot has no position after {_READY_S} s: {state}"


def firmware(link: Link, state: VehicleState) -> Firmware:
    """The simulated version that is to behave like it: its own, or the newest that is not newer."""
    number = run(link.channel(state.address.sysid), _flight_sw_version(link, state))
    version = (number >> 24, number >> 16 & 255)
    return max((f for f in KNOWN_FIRMWARE[ARDUPILOT_FAMILY] if f.version <= version), key=lambda f: f.version)


def _flight_sw_version(link: Link, state: VehicleState) -> LinkSteps[int]:
    channel = link.channel(state.address.sysid)
    request = dialect.MAVLink_command_long_message(
        *state.address, dialect.MAV_CMD_REQUEST_MESSAGE, 0, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION, *[0.0] * 6
    )
    end = link.clock() + _ANSWER_S
    while link.clock() < end:
        channel.send(request, state.address)
        again = link.clock() + 1.0
        while link.clock() < again:
            yield again
            for heard in channel.take():
                if heard.message.get_type() == "AUTOPILOT_VERSION":
                    return int(heard.message.flight_sw_version)
    raise AssertionError(f"it does not report its version within {_ANSWER_S} s")
