"""A real ArduCopter asks for terrain, gets the mission's own, and reads it as it was sent.

Needs an arducopter binary: the vehicle must start in the mission's terrain, with no terrain of its own.
"""

from __future__ import annotations

import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from gcsplan.app.upload.terrain_service import compare, serve
from gcsplan.dem.dat_file import read_dat
from gcsplan.mavlink.link.terrain import TerrainComparison
from gcsplan.mission_file import load_mission
from gcsplan.vehicle import Autopilot
from sitl_tests import sitl

pytestmark = sitl.needs(Autopilot.ARDUCOPTER, program=True)

MISSION = {
    "version": 1, "terrain": {"dem": "sample:jacksboro"}, "limits": {"min_agl_m": 60},
    "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "start": [36.59, -84.25],
                  "goal": [36.60, -84.24], "speed_m_s": [3, 9]}],
}  # fmt: skip


def free_instance() -> int:
    """An instance number whose port nobody has."""
    for number in range(30, 200):
        with socket.socket() as one:
            try:
                one.bind(("127.0.0.1", 5760 + 10 * number))
            except OSError:
                continue
            return number
    raise AssertionError("no port is free")


@pytest.fixture
def copter(tmp_path: Path) -> Iterator[str]:
    number = free_instance()
    output = tmp_path / "output.txt"
    program = sitl.binary(Autopilot.ARDUCOPTER)
    assert program is not None
    command = [
        str(program.resolve()),
        "--model",
        "+",
        "--speedup",
        "8",
        "-I",
        str(number),
        "--home",
        "36.59,-84.25,552,0",
    ]
    with output.open("wb") as out:
        process = subprocess.Popen(command, cwd=tmp_path, stdin=subprocess.DEVNULL, stdout=out, stderr=out)
        try:
            end = time.monotonic() + 30.0
            while "Waiting for connection" not in output.read_text(errors="replace") and time.monotonic() < end:
                assert process.poll() is None, output.read_text(errors="replace")[-300:]
                time.sleep(0.1)
            yield f"tcp:127.0.0.1:{5760 + 10 * number}"
        finally:
            process.terminate()
            process.wait(10.0)


def test_a_real_arducopter_reads_the_terrain_that_it_was_sent(copter: str, tmp_path: Path) -> None:
    source = load_mission(MISSION)
    result = compare(source, [f"uav1={copter}"], points=200, seed=2)["uav1"]
    assert isinstance(result, TerrainComparison), result
    assert result.read == 200
    assert result.worst_m < 0.05
    # The blocks on its card are ours.
    [file] = [read_dat(path, where="") for path in (tmp_path / "terrain").glob("*.DAT")]
    assert file.notes == ()
    assert len(file.blocks) > 4


def test_a_real_arducopter_gets_all_that_it_asks_for(copter: str) -> None:
    [served] = serve(load_mission(MISSION), [f"uav1={copter}"], seconds=120.0, until_loaded=True)
    assert served.complete
    assert (served.pending, served.unknown_parts, served.notes) == (0, 0, ())
    assert served.loaded >= 4 * 56
