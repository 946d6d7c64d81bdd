"""What a command's process does with memory, and what it leaves unimported."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import DATA

CROSSING = DATA / "crossing.yaml"

FLAT = """
version: 1
terrain: {flat_m: 0}
limits: {min_agl_m: 30}
vehicles:
  - {name: a, sysid: 1, autopilot: arducopter, start: [36.3, -84.2], goal: [36.3, -84.195]}
"""

COMMAND = """
import gc, sys
sys.argv = ["gcsplan", *sys.argv[1:]]
from gcsplan.cli import main as cli
from gcsplan.cli.process import memory
try:
    cli.main()
except SystemExit as ended:
    print(ended.code, gc.get_threshold()[0] == memory.OBJECTS)
print(*sorted(sys.modules))
"""

SENDS_OR_DRAWS = {
    "PIL", "asyncio", "contourpy", "distributed", "matplotlib", "multiprocessing", "numba", "pymavlink", "rasterio",
    "scipy", "serial", "gcsplan.app.upload.run", "gcsplan.bench", "gcsplan.check.returns.rally",
    "gcsplan.check.returns.verdict", "gcsplan.fleet.resolve", "gcsplan.native.compile", "gcsplan.report",
    "gcsplan.research", "gcsplan.sim",
}  # fmt: skip
"""What sends, draws, rehearses, compiles, or belongs to another planner or command."""

READS_FILES_OR_A_FLEET = {
    "defusedxml", "shapely", "gcsplan.app.plan.wings", "gcsplan.dem.terrain", "gcsplan.fleet.separation",
    "gcsplan.mission_file.published.policy", "gcsplan.mission_file.zone_reader", "gcsplan.planners.turns.ends",
}  # fmt: skip
"""What reads terrain or zones from files, and what several vehicles or a fixed wing need."""


def imported_by(*arguments: str) -> set[str]:
    """The modules that a command of its own process has imported at its end."""
    done = subprocess.run([sys.executable, "-c", COMMAND, *arguments], capture_output=True, text=True, check=True)
    *_, ended, modules = done.stdout.splitlines()
    assert ended == "0 True"
    return set(modules.split())


def test_a_plan_that_is_sent_nowhere_imports_nothing_of_what_sends_or_draws(tmp_path: Path) -> None:
    assert imported_by("plan", str(CROSSING), "-o", str(tmp_path / "out")) & SENDS_OR_DRAWS == set()


@pytest.mark.nightly
def test_a_leg_over_flat_ground_imports_no_file_reader_and_no_separation(tmp_path: Path) -> None:
    mission = tmp_path / "flat.yaml"
    mission.write_text(FLAT)
    used = imported_by("plan", str(mission), "-o", str(tmp_path / "out"))
    assert used & (SENDS_OR_DRAWS | READS_FILES_OR_A_FLEET) == set()


@pytest.mark.slow
def test_the_version_is_told_without_what_reads_other_options() -> None:
    assert imported_by("--version") & {"numpy", "pydantic", "rich.console", "yaml"} == set()


def test_memory_is_settled_more_than_once_and_without_help_of_the_c_library() -> None:
    words = """
import ctypes, gc
from gcsplan.cli.process.memory import OBJECTS, settle_memory
settle_memory()
def none(name):
    raise OSError("no such library")
ctypes.CDLL = none
settle_memory()
print(gc.get_threshold()[0] == OBJECTS, sum(range(10)))
"""
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert done.stdout == "True 45\n"
