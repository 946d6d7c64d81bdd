"""One SITL for each vehicle of a mission: started at its start, over its terrain, and stopped afterwards.

It flies an airframe with parameters with which it can fly its plan. A parameter that ArduPilot 4.7 renamed is given by
both names: an instance passes over a name that it does not know.
"""

from __future__ import annotations

import math
import os
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from gcsplan.check.motion.geodesy import offset_m
from gcsplan.errors import LinkError, UsageError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.parameter_list import parameter_list
from gcsplan.sim.part import RehearsalPart
from gcsplan.sim.sitl.terrain_files import write_ground
from gcsplan.sim.vehicle.sockets import TcpTransport
from gcsplan.vehicle import Autopilot
from gcsplan.world.world import World

_BASE_PORT = 5760
_FIRST_INSTANCE, LAST_INSTANCE = 20, 255
"""An SITL keeps its number in a byte: 320 would listen at the port of 64 (SITL_State.h)."""
_START_S, _STOP_S = 30.0, 10.0
SPEEDUP = 5.0
"""Factor by which the instances' clocks run faster than real time, if the machine is fast enough."""

MODELS = {Autopilot.ARDUCOPTER: "+", Autopilot.ARDUPLANE: "plane"}
"""The name of each vehicle's model in SITL."""

_EITHER: dict[str, float] = {
    "ARMING_CHECK": 0, "ARMING_SKIPCHK": -1, "TERRAIN_ENABLE": 0, "FENCE_ENABLE": 0, "SIM_BARO_RND": 0,
    "INS_ACCOFFS_X": 0.001, "INS_ACCOFFS_Y": 0.001, "INS_ACCOFFS_Z": 0.001, "INS_ACCSCAL_X": 1.001,
    "INS_ACCSCAL_Y": 1.001, "INS_ACCSCAL_Z": 1.001,
}  # fmt: skip
"""What lets a vehicle arm without pilot or calibration (from ArduPilot's SITL defaults)."""

COPTER: dict[str, float] = _EITHER | {
    "FRAME_CLASS": 1, "FRAME_TYPE": 0, "FS_THR_ENABLE": 0, "DISARM_DELAY": 0, "COMPASS_OFS_X": 5, "COMPASS_OFS_Y": 13,
    "COMPASS_OFS_Z": -18, "MOT_THST_EXPO": 0.65, "MOT_THST_HOVER": 0.39, "MOT_BAT_VOLT_MIN": 9.6,
    "MOT_BAT_VOLT_MAX": 12.8, "ATC_RAT_YAW_P": 0.3,
}  # fmt: skip
"""Parameters of a quadrotor."""

PLANE: dict[str, float] = _EITHER | {
    "THR_FAILSAFE": 0, "ARSPD_USE": 1, "AIRSPEED_MIN": 10, "AIRSPEED_MAX": 30, "KFF_RDDRMIX": 0.5, "TRIM_THROTTLE": 50,
    "RC3_MIN": 1000, "RC3_TRIM": 1000, "SERVO3_MIN": 1000, "SERVO3_MAX": 2000, "PTCH_LIM_MAX_DEG": 25,
    "PTCH_LIM_MIN_DEG": -20, "RLL2SRV_TCONST": 0.25, "RLL2SRV_RMAX": 90, "RLL_RATE_FF": 0.237, "RLL_RATE_P": 0.3,
    "RLL_RATE_I": 0.25, "RLL_RATE_D": 0.0174, "PTCH2SRV_TCONST": 0.25, "PTCH2SRV_RMAX_UP": 90, "PTCH2SRV_RMAX_DN": 90,
    "PTCH_RATE_FF": 0.596, "PTCH_RATE_P": 0.15, "PTCH_RATE_I": 0.11, "PTCH_RATE_D": 0.0073, "LAND_FLARE_SEC": 3,
    "LAND_PITCH_DEG": 1,
}  # fmt: skip
"""Parameters of SITL's plane: its limits, and controllers tuned for it."""


@contextmanager
def sitl_instances(
    binary: Path, parts: Sequence[RehearsalPart], *, speedup: float = SPEEDUP, world: World | None = None
) -> Iterator[dict[str, str]]:
    """Start one instance for each part, each in its own directory; yield the URLs by vehicle; stop all at the end.

    ``binary``: an arducopter or arduplane, or a folder that holds them. ``world``: its terrain is the ground; None: the
    ground is flat at the altitude of home. Raises UsageError for a file that cannot be executed and for too many
    vehicles, LinkError if an instance does not start.
    """
    if not 0.1 <= speedup <= 100.0:
        raise UsageError(f"--speedup {speedup:g}: 0.1 to 100 times as fast as ours is wanted")
    most = LAST_INSTANCE - _FIRST_INSTANCE + 1
    if len(parts) > most:
        raise UsageError(f"--sitl-binary flies at most {most} vehicles at once, and there are {len(parts)}")
    programs = {kind: _program(binary, kind) for kind in dict.fromkeys(p.vehicle.autopilot for p in parts)}
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="gcsplan-sitl-")))
        seats: dict[str, str] = {}
        number = _FIRST_INSTANCE
        for part in parts:
            number = free_instance(number)
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


def free_instance(number: int) -> int:
    """Return the next instance number whose port is free; nobody is called, for an SITL ends when its caller leaves."""
    while number <= LAST_INSTANCE:
        try:
            TcpTransport(("127.0.0.1", port_of(number))).close()
            return number
        except OSError:
            number += 1
    raise LinkError("all ports for SITL instances are taken: end those that still run")


def port_of(number: int) -> int:
    """Return the port at which an instance listens."""
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
        return f"tcp:127.0.0.1:{port_of(self.number)}"


@contextmanager
def _instance(start: _Start, part: RehearsalPart, world: World | None) -> Iterator[str]:
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


def parameters_of(part: RehearsalPart) -> dict[str, float]:
    """Return an instance's parameters: those of its airframe, and the list of its plan as a pilot sets it."""
    given = dict(PLANE if part.vehicle.autopilot is Autopilot.ARDUPLANE else COPTER)
    for s in parameter_list(part.mission, part.vehicle, rtl_rel_home_m=part.rtl_rel_home_m):
        for name in s.parameter.names:
            listed = name.value(s.value)
            own = given.get(name.name, listed)
            kept = (s.rule == "at least" and own >= listed) or (s.rule == "at most" and own <= listed)
            given[name.name] = own if kept else listed
    return given


def heading_of(part: RehearsalPart) -> float:
    """The direction, degrees, in which a vehicle stands: a plane in that of its take-off, for it rolls straight."""
    if part.vehicle.autopilot is not Autopilot.ARDUPLANE:
        return 0.0
    home = part.mission.home
    start = (home.lat_e7 / 1e7, home.lon_e7 / 1e7, home.amsl_m)
    for item in part.mission.items:
        if cmd.is_nav(item.command) and (item.x or item.y):
            east, north = offset_m(start, (item.lat_deg, item.lon_deg, 0.0))
            if math.hypot(north, east) > 1.0:
                return math.degrees(math.atan2(east, north)) % 360.0
    return 0.0
