"""One SITL for each vehicle of a mission: started at its start, over its terrain, and stopped afterwards."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from gcsplan.errors import LinkError, UsageError
from gcsplan.sim.part import Part
from gcsplan.sim.sitl.airframes import MODELS, heading_of, parameters_of
from gcsplan.sim.sitl.terrain_files import write_ground
from gcsplan.sim.vehicle.sockets import TcpTransport
from gcsplan.vehicle import Autopilot
from gcsplan.world.world import World

_BASE_PORT = 5760
_FIRST_INSTANCE, _LAST_INSTANCE = 20, 255
"""An SITL keeps its number in a byte: 320 would listen at the port of 64 (SITL_State.h)."""
_START_S, _STOP_S = 30.0, 10.0
SPEEDUP = 5.0
"""Factor by which the instances' clocks run faster than real time, if the machine is fast enough."""


@contextmanager
def sitl_instances(
    binary: Path, parts: Sequence[Part], *, speedup: float = SPEEDUP, world: World | None = None
) -> Iterator[dict[str, str]]:
    """Start one instance for each part, each in its own directory; yield the URLs by vehicle; stop all at the end.

    ``binary``: an arducopter or arduplane, or a folder that holds them. ``world``: its terrain is the ground; None: the
    ground is flat at the altitude of home. Raises UsageError for a file that cannot be executed and for too many
    vehicles, LinkError if an instance does not start.
    """
    if not 0.1 <= speedup <= 100.0:
        raise UsageError(f"--speedup {speedup:g}: 0.1 to 100 times as fast as ours is wanted")
    most = _LAST_INSTANCE - _FIRST_INSTANCE + 1
    if len(parts) > most:
        raise UsageError(f"--sitl-binary flies at most {most} vehicles at once, and there are {len(parts)}")
    programs = {kind: _program(binary, kind) for kind in dict.fromkeys(p.vehicle.autopilot for p in parts)}
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="gcsplan-sitl-")))
        seats: dict[str, str] = {}
        number = _FIRST_INSTANCE
        for part in parts:
            number = _free(number)
            start = _Start(programs[part.vehicle.autopilot], number, speedup, directory / part.vehicle.name)
            seats[part.vehicle.name] = stack.enter_context(_instance(start, part, world))
            number += 1
        yield seats


def _program(binary: Path, autopilot: Autopilot) -> Path:
    """The program for one kind of vehicle."""
    found = binary / autopilot.value if binary.is_dir() else binary
    if not found.is_file() or not os.access(found, os.X_OK):
        raise UsageError(f"--sitl-binary {found}: a program that can be run is wanted, an {autopilot} built for SITL")
    return found


def _free(number: int) -> int:
    """Return the next instance number whose port is free; nobody is called, for an SITL ends when its caller leaves."""
    while number <= _LAST_INSTANCE:
        try:
            TcpTransport(("127.0.0.1", _port(number))).close()
            return number
        except OSError:
            number += 1
    raise LinkError("all ports for SITL instances are taken: end those that still run")


def _port(number: int) -> int:
    return _BASE_PORT + 10 * number


@dataclass(frozen=True, slots=True)
class _Start:
    """How one instance is started."""

    program: Path
    number: int
    speedup: float
    directory: Path

    @property
    def url(self) -> str:
        return f"tcp:127.0.0.1:{_port(self.number)}"


@contextmanager
def _instance(start: _Start, part: Part, world: World | None) -> Iterator[str]:
    name, home, own = part.vehicle.name, part.mission.home, start.directory
    own.mkdir()
    given = parameters_of(part) | ({} if world is None else write_ground(part, world, own))
    parameters = own / "defaults.parm"
    parameters.write_text("".join(f"{key} {value:g}\n" for key, value in given.items()), encoding="ascii")
    place = f"{home.lat_e7 / 1e7:.7f},{home.lon_e7 / 1e7:.7f},{home.amsl_m:.2f},{heading_of(part):.1f}"
    command = [
        str(start.program.resolve()), "--model", MODELS[part.vehicle.autopilot], "--speedup", f"{start.speedup:g}",
        "--home", place, "-I", str(start.number), "--sysid", str(part.vehicle.sysid), "--defaults", str(parameters),
    ]  # fmt: skip
    with open(own / "output.txt", "wb") as said:
        process = subprocess.Popen(command, cwd=own, stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT)
        try:
            _await(process, own / "output.txt", name)
            yield start.url
        finally:
            process.terminate()
            with suppress(subprocess.TimeoutExpired):
                process.wait(_STOP_S)
            if process.poll() is None:
                process.kill()
                process.wait(_STOP_S)


def _await(process: subprocess.Popen[bytes], said: Path, name: str) -> None:
    """Wait until its output says that it listens; a trial connection would end it when closed."""
    end = time.monotonic() + _START_S
    while time.monotonic() < end:
        words = said.read_text(encoding="utf-8", errors="replace")
        if "Waiting for connection" in words or "bind port" in words:
            return
        if process.poll() is not None:
            raise LinkError(f"{name}: the SITL ended at once with code {process.returncode}: {words[-300:].strip()}")
        time.sleep(0.05)
    raise LinkError(f"{name}: the SITL does not listen after {_START_S:g} s")
