"""Options that commands share: their help."""

from __future__ import annotations

import dataclasses

import pytest

from gcsplan.cli.arguments.options import MISBEHAVIOURS
from gcsplan.sim.vehicle.misbehaviour import Misbehaviour
from tests.cli.test_hostile import Run


@pytest.mark.parametrize("command", ["plan", "check", "upload", "verify", "download", "clear", "sim", "bench check"])
def test_help_speaks_of_files_and_urls_and_not_of_types(run: Run, command: str) -> None:
    code, out, _ = run(*command.split(), "--help")
    assert code == 0
    options = out.partition("Options:")[2]
    for word in ("<str>", "<path>", "<int", "list["):
        assert word not in options


def test_help_of_sim_lists_every_misbehaviour() -> None:
    listed = set(MISBEHAVIOURS.replace(",", " ").replace("(", " ").replace(")", " ").split())
    assert {f.name for f in dataclasses.fields(Misbehaviour)} <= listed
