"""What a command's process does with memory, and what it leaves unimported."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.support.paths import DATA

CROSSING = DATA / "crossing.yaml"

PLAN = """
import gc, sys
sys.argv = ["gcsplan", "plan", sys.argv[1], "-o", sys.argv[2]]
from gcsplan.cli import main as cli
from gcsplan.cli import memory
try:
    cli.main()
except SystemExit as ended:
    print(ended.code, gc.get_threshold()[0] == memory.OBJECTS)
others = ("numba", "scipy", "pymavlink", "matplotlib", "gcsplan.app.uploads", "gcsplan.check.rtl.rally",
          "gcsplan.fleet.resolve", "gcsplan.report")
print([name for name in others if name in sys.modules])
"""


def test_a_plan_that_is_sent_nowhere_imports_nothing_of_what_sends_or_draws(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PLAN, str(CROSSING), str(tmp_path / "out")], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-2:] == ["0 True", "[]"]


def test_a_process_can_settle_its_memory_more_than_once_and_where_the_c_library_cannot() -> None:
    words = """
import ctypes, gc
from gcsplan.cli.memory import OBJECTS, settle_memory
settle_memory()
def none(name):
    raise OSError("no such library")
ctypes.CDLL = none
settle_memory()
print(gc.get_threshold()[0] == OBJECTS, sum(range(10)))
"""
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert done.stdout == "True 45\n"
