"""One SITL for each vehicle of a mission: started at its start, over its terrain, and stopped afterwards.

It flies an airframe with parameters with which it can fly its plan. A parameter that ArduPilot 4.7 renamed is given by
both names: an instance passes over a name that it does not know.

The ground under it is the mission's terrain as ArduPilot's own files, which an instance reads from ./terrain
(`write_ground`). Without them its ground is flat at the altitude of home: what flies below home hits it, and what lands
above home sinks into the hill. SITL takes the ground at a place as home's altitude and the difference of the terrain
there to that at home (SIM_TERRAIN, with TERRAIN_ENABLE), so its ground at home is right whatever the datum of the
terrain is.
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
from itertools import pairwise
from pathlib import Path

import numpy as np

from gcsplan.arrays import Floats
from gcsplan.check.motion.stretch import offset_m
from gcsplan.dem.dat_file import file_name, packed
from gcsplan.errors import InputError, LinkError, UsageError
from gcsplan.mavlink.mission import commands as cmd
from gcsplan.mavlink.mission.mission import TERRAIN
from gcsplan.mavlink.mission.parameter_list import parameter_list
from gcsplan.sim.outcome import RehearsalPart
from gcsplan.sim.vehicle.server import TcpTransport
from gcsplan.vehicle import Autopilot
from gcsplan.world.terrain.grid import SPACING_M, Block, PostHeights, TerrainGrid, known_parts
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
"""Parameters that let a vehicle arm without pilot or calibration (from ArduPilot's SITL defaults)."""

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
        raise UsageError(f"--speedup {speedup:g}: give 0.1 to 100, times as fast as real time")
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
        raise UsageError(f"--sitl-binary {found}: give a program that can be run, an {autopilot} built for SITL")
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
    """The start of one instance."""

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
    with open(own / "output.txt", "wb") as output:
        process = subprocess.Popen(command, cwd=own, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT)
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


def _await(process: subprocess.Popen[bytes], output: Path, name: str) -> None:
    """Wait until its output says that it listens; a trial connection would end it when closed."""
    end = time.monotonic() + _START_S
    while time.monotonic() < end:
        words = output.read_text(encoding="utf-8", errors="replace")
        if "Waiting for connection" in words or "bind port" in words:
            return
        if process.poll() is not None:
            raise LinkError(f"{name}: the SITL ended at once with code {process.returncode}: {words[-300:].strip()}")
        time.sleep(0.05)
    raise LinkError(f"{name}: the SITL does not listen after {_START_S:g} s")


def parameters_of(part: RehearsalPart) -> dict[str, float]:
    """Return an instance's parameters: its airframe's, and the list of its plan as a pilot sets it."""
    given = dict(PLANE if part.vehicle.autopilot is Autopilot.ARDUPLANE else COPTER)
    for s in parameter_list(part.mission, part.vehicle, rtl_rel_home_m=part.rtl_rel_home_m):
        for name in s.parameter.names:
            listed = name.value(s.value)
            own = given.get(name.name, listed)
            kept = (s.rule == "at least" and own >= listed) or (s.rule == "at most" and own <= listed)
            given[name.name] = own if kept else listed
    return given


def heading_of(part: RehearsalPart) -> float:
    """The direction, degrees, in which a vehicle stands: a plane faces along its take-off, for it rolls straight."""
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


FINE_SPACING_M = 30
"""Posts are so near each other, m, where no leg is flown in terrain frame: the ground is then nearly the mission's."""
COARSER_SPACING = 1.5
MOST_IN_FILES = 3000
"""Blocks of one vehicle, of 2 KB each and 0.6 km² at 30 m; a longer mission gets posts farther apart."""
COARSEST_SPACING_M = 500
ALONG_STEP_M, BESIDE_FLIGHT_M = 250.0, 1000.0
"""Steps along the flight, and how far beside it there is ground, m: SITL also looks up the blocks around."""


def write_ground(part: RehearsalPart, world: World, directory: Path) -> dict[str, float]:
    """Write the terrain around a vehicle's flight into ``directory``/terrain; return the parameters that use it.

    Raises InputError for a flight so long that its terrain would be too coarse.
    """
    grid, blocks = _blocks(part, world)
    posts = PostHeights(grid, lambda lat, lon: _ground(world, lat, lon))
    known = {block: heights for block in blocks if known_parts(heights := posts.block(block))}
    if not known:
        return {"TERRAIN_ENABLE": 0, "SIM_TERRAIN": 0}
    folder = directory / "terrain"
    folder.mkdir()
    for cell in dict.fromkeys(block.cell for block in known):
        mine = {block: heights for block, heights in known.items() if block.cell == cell}
        (folder / file_name(cell)).write_bytes(packed(grid, cell, mine))
    return {"TERRAIN_ENABLE": 1, "TERRAIN_SPACING": grid.spacing_m, "SIM_TERRAIN": 1}


def _ground(world: World, lat_deg: Floats, lon_deg: Floats) -> Floats:
    plane = world.frame.to_plane(lat_deg, lon_deg)
    return np.asarray(world.airspace.surface.ground_at(plane[..., 0], plane[..., 1]), float)


def _blocks(part: RehearsalPart, world: World) -> tuple[TerrainGrid, Sequence[Block]]:
    """The blocks around the flight, of the finest grid of which there are not too many."""
    lat, lon = _around(part, world)
    in_terrain = any(item.frame == TERRAIN for item in part.mission.items)
    spacing_m = SPACING_M if in_terrain else FINE_SPACING_M
    while spacing_m <= COARSEST_SPACING_M:
        grid = TerrainGrid(spacing_m)
        blocks = grid.blocks_over(1e7 * lat, 1e7 * lon)
        if len(blocks) <= MOST_IN_FILES:
            return grid, blocks
        if in_terrain:  # the heights that it flies depend on the grid
            break
        spacing_m = math.ceil(spacing_m * COARSER_SPACING)
    raise InputError(
        f"{part.vehicle.name}: its flight is too long for an SITL's terrain: more than {MOST_IN_FILES} blocks with "
        f"posts every {min(spacing_m, COARSEST_SPACING_M)} m"
    )


def _around(part: RehearsalPart, world: World) -> tuple[Floats, Floats]:
    """Latitudes and longitudes, degrees, in steps along the flight and beside it."""
    home = part.mission.home
    places = [(home.lat_e7 / 1e7, home.lon_e7 / 1e7)]
    places += [place[:2] for leg in part.verdict.legs for place in (leg.start, leg.end)]
    plane = world.frame.to_plane([p[0] for p in places], [p[1] for p in places])
    track = np.concatenate([plane[:1], *(_steps(a, b) for a, b in pairwise(plane))])
    aside = np.arange(-BESIDE_FLIGHT_M, BESIDE_FLIGHT_M + 1.0, 0.5 * BESIDE_FLIGHT_M)
    spread = np.array([(east, north) for east in aside for north in aside])
    points = (track[:, None, :] + spread).reshape(-1, 2)
    degrees = world.frame.to_degrees(points[:, 0], points[:, 1])
    return degrees[:, 0], degrees[:, 1]


def _steps(a: Floats, b: Floats) -> Floats:
    count = max(1, math.ceil(float(np.hypot(*(b - a))) / ALONG_STEP_M))
    return np.linspace(a, b, count + 1)
