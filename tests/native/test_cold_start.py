"""The first run, without any cache: the shipped form is read by every LLVM that pyproject.toml allows."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path

import pytest

from gcsplan.native.__main__ import KERNEL_UNITS, kernel_unit
from tests.support.paths import REPOSITORY

FLOOR_LLVM = 22
"""The major version of LLVM in the oldest llvmlite that is allowed."""

FIRST_RUN = """
import json, sys, time
import gcsplan
from gcsplan.native.kernel_unit import SLOW_NOTICE, compilation_reported
from gcsplan.native.__main__ import KERNEL_UNITS, kernel_unit
import llvmlite, llvmlite.binding

said, began = [], time.perf_counter()
with compilation_reported(said.append):
    for name in KERNEL_UNITS:
        unit = kernel_unit(name)
        unit.digest()
        unit[sorted(unit.forms)[0]]
    took_s = time.perf_counter() - began
    planned = gcsplan.plan({
        "version": 1, "terrain": {"peaks": [{"center": [500, 0], "height_m": 90, "decay_m": [90, 90]}]},
        "frame": {"origin": [36.6, -84.3], "amsl_m": 0}, "limits": {"min_agl_m": 30, "max_amsl_m": 80},
        "vehicles": [{"name": "uav1", "sysid": 1, "autopilot": "arducopter", "speed_m_s": [3, 15],
                      "start": {"east_m": 0, "north_m": 0}, "goal": {"east_m": 1000, "north_m": 0}}],
    })
print(json.dumps({
    "llvmlite": llvmlite.__version__, "llvm": llvmlite.binding.llvm_version_info[0], "seconds": took_s,
    "slow": [words for words in said if words.startswith(SLOW_NOTICE)], "quick": len(said),
    "numba": "numba" in sys.modules, "safe": planned.vehicles[0].verdict.safe,
    "points": [list(map(repr, p)) for p in planned.vehicles[0].solution.path.points.tolist()],
}))
"""


def floors() -> dict[str, str]:
    """The oldest numba and llvmlite that pyproject.toml allows."""
    wanted = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    found = [re.match(r"(numba|llvmlite)>=([0-9.]+)", line) for line in wanted]
    return {match[1]: match[2] for match in found if match}


@pytest.mark.parametrize("name", KERNEL_UNITS)
def test_every_shipped_form_names_its_llvm_and_the_oldest_allowed_one_reads_it(name: str) -> None:
    head = json.loads(kernel_unit(name).shipped.read_bytes().partition(b"\n")[0])
    assert set(head) == {"llvm", "llvmlite", "numba", "sources"}
    assert int(head["llvm"].split(".")[0]) <= FLOOR_LLVM, "raise the floor of llvmlite, or make it with an older one"
    assert set(floors()) == {"numba", "llvmlite"}


@pytest.fixture(scope="module")
def seen() -> dict[str, dict[str, object]]:
    return {}


@pytest.mark.nightly
@pytest.mark.parametrize("which", ["oldest", "newest"])
def test_a_first_run_needs_no_numba(which: str, tmp_path: Path, seen: dict[str, dict[str, object]]) -> None:
    """In an environment of its own, whose other packages are those of this one."""
    venv.create(tmp_path / "env", with_pip=False)
    scripts = "Scripts" if os.name == "nt" else "bin"
    python = tmp_path / "env" / scripts / "python"
    purelib = Path(sysconfig.get_path("purelib", vars={"base": str(tmp_path / "env")}))
    (purelib / "others.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    wanted = [f"{name}=={v}" if which == "oldest" else f"{name}>={v}" for name, v in floors().items()]
    install = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--only-binary", ":all:", "--target",
               str(purelib), *wanted]  # fmt: skip
    done = subprocess.run(install, capture_output=True, text=True, timeout=600)
    if done.returncode:
        pytest.skip(f"packages cannot be installed here: {done.stderr.strip().splitlines()[-1:]}")
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(REPOSITORY)}
    run = subprocess.run(
        [python, "-c", FIRST_RUN], capture_output=True, text=True, timeout=600, env=environment, cwd=tmp_path
    )
    assert run.returncode == 0, run.stderr
    found = seen[which] = json.loads(run.stdout)
    print(which, {key: found[key] for key in ("llvmlite", "llvm", "seconds")})
    assert found["slow"] == []
    assert found["quick"] == len(KERNEL_UNITS)
    assert (found["numba"], found["safe"]) == (False, True)
    if which == "oldest":
        assert found["llvm"] == FLOOR_LLVM
    assert len({json.dumps(each["points"]) for each in seen.values()}) == 1
