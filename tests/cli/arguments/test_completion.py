"""What the shell completes, asked as bash asks."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from gcsplan.cli import main
from gcsplan.cli.arguments import completion
from gcsplan.mission_file.source import sample_names
from gcsplan.planners import registry
from gcsplan.vehicle import Autopilot


@pytest.fixture
def complete(run: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The words that may follow ``line``, whose last word is being typed."""

    def call(line: str) -> list[str]:
        monkeypatch.setenv("_GCSPLAN_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", f"gcsplan {line}")
        monkeypatch.setenv("COMP_CWORD", str(len(line.split(" "))))
        code, out, err = run()
        assert (code, err) == (0, "")
        words: list[str] = out.split()
        return words

    return call


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("plan --planner ", list(registry.names())),
        ("rehearse --planner msf", ["msfoa"]),
        ("plan --objective ", ["length", "energy", "time"]),
        ("plan --units a", ["aviation"]),
        ("plan --encoding b", ["box", "bspline"]),
        ("plan --cost k", ["krill"]),
        ("plan --upload ", ["sim", "link"]),
        ("new --autopilot ", list(Autopilot)),
        ("check --autopilot p", ["px4"]),
        ("sim --autopilot ardu", ["arducopter", "arduplane"]),
        ("new --dem s", ["sample:jacksboro"]),
        ("clear --type f", ["fence"]),
        ("plan sample:jacksboro-", ["sample:jacksboro-high", "sample:jacksboro-wing"]),
        ("verify uav1.plan --mission sample:fleet-1", ["sample:fleet-100"]),
        ("plan ", []),
        ("plan ridge", []),
        ("sche", ["schema"]),
    ],
)
def test_values_are_completed(complete: Any, line: str, words: list[str]) -> None:
    assert complete(line) == words


@pytest.mark.parametrize(
    "complete", [completion.autopilots, completion.planners, completion.encodings, completion.costs,
                 completion.words("length", "energy")],
)  # fmt: skip
def test_what_is_completed_is_each_word_that_begins_alike(complete: completion.Complete) -> None:
    every = complete("")
    assert len(every) == len(set(every)) > 1
    for word in every:
        for end in range(len(word) + 1):
            assert complete(word[:end]) == [other for other in every if other.startswith(word[:end])]
    assert complete("no such word") == []


def test_where_a_file_is_meant_nothing_is_completed_but_samples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sample[1].tif").write_text("")
    assert completion.missions("") == completion.dems("") == completion.dems("other") == []
    assert completion.dems("sample[") == []  # it does not begin like a sample
    assert completion.dems("sample") == ["sample[1].tif", "sample:jacksboro"]


def test_files_that_begin_like_a_sample_are_completed_too(complete: Any, tmp_path: Path) -> None:
    (tmp_path / "sam.yaml").write_text("")
    found = complete("plan sam")
    assert found[0] == "sam.yaml"
    assert found[1:] == [f"sample:{name}" for name in sample_names()]


@pytest.mark.slow
def test_the_command_line_starts_without_what_completes_its_values() -> None:
    words = """
import sys
import gcsplan.cli.main
heavy = ("pydantic", "numpy", "gcsplan.planners.registry", "gcsplan.mission_file", "gcsplan.vehicle")
print([name for name in heavy if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.slow
def test_a_command_is_made_without_the_options_of_the_others() -> None:
    every = set(main.command_of("").commands)
    assert {"plan", "fit-energy", "dem"} <= every
    assert every == set(main.command_of("no such command").commands)
    for name in every:
        assert set(main.command_of(name).commands) == {name}
