"""One ArduCopter SITL for each vehicle of a mission: started at its start, with its speeds, and stopped afterwards."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from gcsplan.errors import LinkError, UsageError
from gcsplan.mavlink.link.link import Link
from gcsplan.sim.outcome import Part

_BASE_PORT = 5760
_FIRST_INSTANCE, _LAST_INSTANCE = 20, 900
_START_S, _STOP_S = 30.0, 10.0
SPEEDUP = 5.0
"""Factor by which the instances' clocks run faster than real time, if the machine is fast enough."""

FRAME = {
    "FRAME_CLASS": 1, "FRAME_TYPE": 0, "ARMING_CHECK": 0, "FS_THR_ENABLE": 0, "DISARM_DELAY": 0, "TERRAIN_ENABLE": 0,
    "SIM_BARO_RND": 0, "COMPASS_OFS_X": 5, "COMPASS_OFS_Y": 13, "COMPASS_OFS_Z": -18, "INS_ACCOFFS_X": 0.001,
    "INS_ACCOFFS_Y": 0.001, "INS_ACCOFFS_Z": 0.001, "INS_ACCSCAL_X": 1.001, "INS_ACCSCAL_Y": 1.001,
    "INS_ACCSCAL_Z": 1.001, "MOT_THST_EXPO": 0.65, "MOT_THST_HOVER": 0.39, "MOT_BAT_VOLT_MIN": 9.6,
    "MOT_BAT_VOLT_MAX": 12.8, "ATC_RAT_YAW_P": 0.3, "FENCE_ENABLE": 0,
}  # fmt: skip
"""Parameters of a quadrotor that arms without pilot, calibration or terrain data (from ArduPilot's SITL defaults)."""

FAST_M_S, FAST_ANGLE_CD = 9.0, 4500
"""Cruise speed (m/s) above which ANGLE_MAX is raised to this (0.01°): ANGLE_MAX 3000 was measured to limit the speed
to about 10 m/s."""


def parameters_of(part: Part) -> dict[str, float]:
    """Return an instance's parameters: `FRAME` and the vehicle's own speeds and rates, so that it can fly the plan."""
    v = part.vehicle
    given = FRAME | {
        "WPNAV_SPEED": 100.0 * v.speed_max_m_s, "WPNAV_SPEED_UP": 100.0 * v.climb_m_s,
        "WPNAV_SPEED_DN": 100.0 * v.descent_m_s, "LAND_SPEED": 100.0 * v.land_m_s,
    }  # fmt: skip
    if v.lean_angle_deg is not None:  # the planned times count with it
        given["ANGLE_MAX"] = 100.0 * v.lean_angle_deg
    elif v.speed_max_m_s > FAST_M_S:
        given["ANGLE_MAX"] = FAST_ANGLE_CD
    if part.rtl_rel_home_m is not None:
        given["RTL_ALT"] = 100.0 * part.rtl_rel_home_m
    return given


@contextmanager
def sitl_instances(binary: Path, parts: Sequence[Part], *, speedup: float = SPEEDUP) -> Iterator[dict[str, str]]:
    """Start one instance for each part, each in its own directory; yield the URLs by vehicle; stop all at the end.

    Raises UsageError for a file that cannot be executed, LinkError if an instance does not start.
    """
    if not binary.is_file() or not os.access(binary, os.X_OK):
        raise UsageError(f"--sitl-binary {binary}: a program that can be run is wanted, an arducopter built for SITL")
    if not 0.1 <= speedup <= 100.0:
        raise UsageError(f"--speedup {speedup:g}: 0.1 to 100 times as fast as ours is wanted")
    with ExitStack() as stack:
        directory = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="gcsplan-sitl-")))
        seats: dict[str, str] = {}
        number = _FIRST_INSTANCE
        for part in parts:
            number = _free(number)
            seats[part.vehicle.name] = stack.enter_context(_instance(binary, part, number, speedup, directory))
            number += 1
        yield seats


def _free(number: int) -> int:
    """Return the next instance number on whose port nobody answers."""
    while number <= _LAST_INSTANCE:
        try:
            Link(_url(number)).close()
        except LinkError:
            return number
        number += 1
    raise LinkError("all ports for SITL instances are taken: end those that still run")


def _url(number: int) -> str:
    return f"tcp:127.0.0.1:{_BASE_PORT + 10 * number}"


@contextmanager
def _instance(binary: Path, part: Part, number: int, speedup: float, directory: Path) -> Iterator[str]:
    name, home = part.vehicle.name, part.mission.home
    own = directory / name
    own.mkdir()
    parameters = own / "defaults.parm"
    parameters.write_text("".join(f"{key} {value:g}\n" for key, value in parameters_of(part).items()), encoding="ascii")
    place = f"{home.lat_e7 / 1e7:.7f},{home.lon_e7 / 1e7:.7f},{home.amsl_m:.2f},0"
    command = [
        str(binary.resolve()), "--model", "+", "--speedup", f"{speedup:g}", "--home", place, "-I", str(number),
        "--sysid", str(part.vehicle.sysid), "--defaults", str(parameters),
    ]  # fmt: skip
    with open(own / "output.txt", "wb") as said:
        process = subprocess.Popen(command, cwd=own, stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT)
        try:
            _await(process, own / "output.txt", name)
            yield _url(number)
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
