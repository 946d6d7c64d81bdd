"""The table of commands: help, version, and a command that is none."""

from __future__ import annotations

from typing import Any

from tests.cli.test_hostile import Run


def test_no_command_shows_the_help_and_a_wrong_option_its_commands_help(run: Run) -> None:
    code, _, err = run()
    assert code == 2
    assert "Commands:" in err
    assert "see gcsplan plan --help" in run("plan", "m.yaml", "--nope")[2]


def test_help_and_version(run: Any) -> None:
    assert "plan" in run("--help")[1]
    assert run("--version")[1].startswith("0.")
