"""`gcsplan rehearse`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import typer

from gcsplan.cli.commands.rehearse import rehearse as command
from gcsplan.errors import UsageError
from tests.app.test_rehearse import FLEET


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("rehearsing") / "fleet.yaml"
    path.write_text(FLEET, encoding="utf-8")
    return path


@pytest.mark.slow
def test_the_command_prints_one_document_and_its_code(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit) as ended:
        command(file, as_json=True)
    assert ended.value.exit_code == 0
    document = json.loads(capsys.readouterr().out)
    assert document["name"] == "Three in the valley"
    assert [v["name"] for v in document["vehicles"]] == ["uav1", "uav2", "uav3"]
    assert document["violations"] == []
    assert "error" not in document


@pytest.mark.nightly
def test_a_violation_ends_the_command_with_four_and_is_said_in_both_ways(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def lost(as_json: bool) -> None:
        command(file, noise_m=15.0, runs=2, as_json=as_json)

    with pytest.raises(typer.Exit) as ended:
        lost(True)
    assert ended.value.exit_code == 4
    document = json.loads(capsys.readouterr().out)
    assert document["error"]["code"] == 4
    assert "min_agl" in {v["kind"] for v in document["violations"]}
    with pytest.raises(typer.Exit) as ended:
        lost(False)
    assert ended.value.exit_code == 4
    said = " ".join(capsys.readouterr().out.split())
    assert "came too low above ground" in said
    assert "(in 2 of 2 runs)" in said


@pytest.mark.parametrize(
    "more",
    [
        {"sitl": ["uav1=tcp:127.0.0.1:5760"], "runs": 3},
        {"sitl": ["uav1=tcp:127.0.0.1:5760"], "wind": 3.0, "noise_m": 1.0},
        {"speedup": 3.0},
        {"airspeed": 0.0},
        {"sitl": ["tcp:127.0.0.1:5760"]},
        {"sitl": ["uav9=tcp:127.0.0.1:5760"]},
    ],
)
def test_words_that_do_not_go_together_are_refused_before_anything_is_planned(
    file: Path, more: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gcsplan.app.fleet.pipeline.plan", lambda *_, **__: pytest.fail("it was planned"))
    with pytest.raises(UsageError):
        command(file, **more)
