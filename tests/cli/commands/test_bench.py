"""`gcsplan bench`: each command gives its options to one call of `gcsplan.bench`, and tells what that returns."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import pytest

from gcsplan.cli.commands.bench import bench_app
from gcsplan.research.bench import functions


@pytest.mark.slow
def test_legs_are_checked_and_told_in_words_or_as_a_document(run: Any) -> None:
    code, out, _ = run("bench", "check", "--legs", 500, "--seed", 3, "--json")
    assert code == 0
    document = json.loads(out)
    assert document["legs"] == 500
    code, out, _ = run("bench", "check", "--legs", 500, "--seed", 3)
    assert code == 0
    assert "500 random legs of 1000 m" in out


def test_a_directory_that_cannot_be_made_is_found_before_the_long_run(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(functions, "run", lambda **_: pytest.fail("it was run"))
    (tmp_path / "taken").write_text("a file")
    code, out, err = run("bench", "functions", "-o", "taken")
    assert (code, out) == (2, "")
    assert "taken: cannot be made" in err


def test_every_command_says_in_its_help_what_it_measures(run: Any) -> None:
    named = [command.name for command in bench_app.registered_commands]
    assert len(named) == len(set(named)) == 13
    overview = run("bench", "--help")[1]
    for name in named:
        assert str(name) in overview
        code, out, _ = run("bench", name, "--help")
        assert code == 0
        assert "Usage: gcsplan bench" in out


@pytest.mark.parametrize(
    ("command", "module", "options", "given"),
    [
        ("fleet", "fleet", ("--vehicles", 7, "--interval", 2), {"interval_s": 2.0, "seed": 1, "upload": False}),
        ("upload", "upload", ("--runs", 2), {"items": 600, "runs": 2}),
    ],
)
def test_options_reach_the_measurement(
    run: Any, monkeypatch: pytest.MonkeyPatch, command: str, module: str, options: Any, given: dict[str, Any]
) -> None:
    bench = importlib.import_module(f"gcsplan.bench.{module}")
    seen: list[tuple[Any, dict[str, Any]]] = []

    def measure(*arguments: object, **named: object) -> dict[str, int]:
        seen.append((arguments, named))
        return {"measured": 1}

    monkeypatch.setattr(bench, "run", measure)
    code, out, _ = run("bench", command, *options, "--json")
    assert code == 0
    assert json.loads(out)["measured"] == 1
    [(_, named)] = seen
    assert {key: named[key] for key in given} == given


def test_words_that_are_no_numbers_are_refused_before_anything_runs(run: Any, tmp_path: Path) -> None:
    code, out, err = run("bench", "terrain", "-o", "none", "--seconds", "soon")
    assert (code, out) == (2, "")
    assert "--seconds takes numbers such as 1,10, given 'soon'" in err
    assert not (tmp_path / "none").exists()
