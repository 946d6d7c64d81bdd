"""The product without its research: `optimal` plans, and what is named of research says what it needs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.process.test_memory import FLAT

WITHOUT_RESEARCH = """
import sys
from importlib.abc import MetaPathFinder

class Absent(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name == "gcsplan.research" or name.startswith("gcsplan.research."):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Absent())
sys.argv = ["gcsplan", *sys.argv[1:]]
from gcsplan.cli import main as cli
cli.main()
"""


def without_research(*arguments: str) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own, in which no module of `gcsplan.research` can be imported."""
    return subprocess.run([sys.executable, "-c", WITHOUT_RESEARCH, *arguments], capture_output=True, text=True)


@pytest.fixture
def flat(tmp_path: Path) -> Path:
    mission = tmp_path / "flat.yaml"
    mission.write_text(FLAT)
    return mission


def test_optimal_plans_without_the_research_folder(flat: Path, tmp_path: Path) -> None:
    done = without_research("plan", str(flat), "-o", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    assert list((tmp_path / "out").glob("*.waypoints"))


def test_a_planner_of_research_that_is_named_is_bad_input_that_says_what_it_needs(flat: Path, tmp_path: Path) -> None:
    words = "the planner 'krill' needs gcsplan.research.swarm, which is not installed"
    by_option = without_research("plan", str(flat), "--planner", "krill", "-o", str(tmp_path / "out"))
    assert (by_option.returncode, words in by_option.stderr) == (2, True), by_option.stderr
    flat.write_text(FLAT + "planner: {name: krill}\n")
    by_file = without_research("plan", str(flat), "-o", str(tmp_path / "out"))
    assert (by_file.returncode, words in by_file.stderr) == (2, True), by_file.stderr


def test_an_unknown_planner_is_still_told_from_one_that_is_not_installed(flat: Path, tmp_path: Path) -> None:
    done = without_research("plan", str(flat), "--planner", "kril", "-o", str(tmp_path / "out"))
    assert done.returncode == 2
    assert "Did you mean 'krill'?" in done.stderr


def test_the_planners_that_are_not_installed_are_listed_as_such() -> None:
    from gcsplan.planners.registry import names

    done = without_research("planners", "--json")
    rows = {row["name"]: row for row in json.loads(done.stdout)["planners"]}
    assert tuple(rows) == names()
    assert rows.pop("optimal")["defaults"]["gap_percent"] == 0.1
    assert {row["summary"] for row in rows.values()} == {"not installed: it needs gcsplan.research.swarm"}


@pytest.mark.parametrize("bench", ["functions", "metabox", "papers", "swarms"])
def test_a_bench_of_research_says_what_it_needs(bench: str) -> None:
    done = without_research("bench", bench)
    assert done.returncode == 2
    assert "this benchmark needs gcsplan.research, which is not installed" in done.stderr


def test_the_schema_is_the_same_without_research() -> None:
    with_research = subprocess.run([sys.executable, "-m", "gcsplan", "schema"], capture_output=True, text=True)
    assert without_research("schema").stdout == with_research.stdout != ""
