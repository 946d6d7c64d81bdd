"""The product without its research: `optimal` plans, and what is named of research says what it needs."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.cli.process.test_memory import FLAT

COMMANDS = """
import contextlib, io, json, sys
from importlib.abc import MetaPathFinder

class Absent(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name == "gcsplan.research" or name.startswith("gcsplan.research."):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

if sys.argv[1] == "without":
    sys.meta_path.insert(0, Absent())
from gcsplan.cli import main as cli
ended = {}
for name, arguments in json.loads(sys.argv[2]).items():
    sys.argv = ["gcsplan", *arguments]
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        try:
            cli.main()
        except SystemExit as end:
            ended[name] = end.code, out.getvalue(), err.getvalue()
print(json.dumps(ended))
"""
"""Runs commands one after the other in a process of its own, in which `gcsplan.research` is or cannot be imported."""


class Ended(NamedTuple):
    """What a command left: its exit code, and what it printed."""

    code: int
    out: str
    err: str


def ended(research: str, commands: dict[str, list[str]]) -> dict[str, Ended]:
    """Each command's end by its name, ``research`` being 'with' or 'without'."""
    arguments = [sys.executable, "-c", COMMANDS, research, json.dumps(commands)]
    done = subprocess.run(arguments, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return {name: Ended(*end) for name, end in json.loads(done.stdout).items()}


BENCHES = ["functions", "metabox", "papers", "swarms"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("apart")


@pytest.fixture(scope="module")
def without_research(folder: Path) -> dict[str, Ended]:
    """The commands of this file where no module of `gcsplan.research` can be imported."""
    flat, krill, out, refused = (str(folder / name) for name in ("flat.yaml", "krill.yaml", "out", "refused"))
    Path(flat).write_text(FLAT)
    Path(krill).write_text(FLAT + "planner: {name: krill}\n")
    return ended("without", {
        "optimal": ["plan", flat, "-o", out],
        "by option": ["plan", flat, "--planner", "krill", "-o", refused],
        "by file": ["plan", krill, "-o", refused],
        "misspelt": ["plan", flat, "--planner", "kril", "-o", refused],
        "planners": ["planners", "--json"],
        "schema": ["schema"],
        **{bench: ["bench", bench] for bench in BENCHES},
    })  # fmt: skip


@pytest.mark.slow
def test_optimal_plans_without_the_research_folder(without_research: dict[str, Ended], folder: Path) -> None:
    assert without_research["optimal"].code == 0, without_research["optimal"].err
    assert list((folder / "out").glob("*.waypoints"))


@pytest.mark.parametrize("named", ["by option", "by file"])
def test_a_planner_of_research_that_is_named_is_bad_input_that_says_what_it_needs(
    without_research: dict[str, Ended], named: str
) -> None:
    end = without_research[named]
    assert end.code == 2
    assert "the planner 'krill' needs gcsplan.research.swarm, which is not installed" in end.err


def test_an_unknown_planner_is_still_told_from_one_that_is_not_installed(without_research: dict[str, Ended]) -> None:
    end = without_research["misspelt"]
    assert end.code == 2
    assert "Did you mean 'krill'?" in end.err


def test_the_planners_that_are_not_installed_are_listed_as_such(without_research: dict[str, Ended]) -> None:
    from gcsplan.planners.registry import names

    rows = {row["name"]: row for row in json.loads(without_research["planners"].out)["planners"]}
    assert tuple(rows) == names()
    assert rows.pop("optimal")["defaults"]["gap_percent"] == 0.1
    assert {row["summary"] for row in rows.values()} == {"not installed: it needs gcsplan.research.swarm"}


@pytest.mark.parametrize("bench", BENCHES)
def test_a_bench_of_research_says_what_it_needs(without_research: dict[str, Ended], bench: str) -> None:
    end = without_research[bench]
    assert end.code == 2
    assert "this benchmark needs gcsplan.research, which is not installed" in end.err


@pytest.mark.slow
def test_the_schema_is_the_same_without_research(without_research: dict[str, Ended]) -> None:
    assert without_research["schema"] == ended("with", {"schema": ["schema"]})["schema"]
    assert without_research["schema"].out != ""
