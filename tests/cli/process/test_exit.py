"""How a command ends: what it prints is plain, an output that takes nothing is an error, Ctrl-C is told."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import pytest

from gcsplan.app.fleet import pipeline
from tests.cli.test_hostile import MISSION, Run


@pytest.fixture
def run(run: Run, tmp_path: Path) -> Run:
    """`run` of the folder, in a directory with m.yaml."""
    (tmp_path / "m.yaml").write_text(MISSION)
    return run


def test_no_name_in_a_file_speaks_to_the_terminal(run: Run, tmp_path: Path) -> None:
    features = {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {"name": "[/x]\ud800\u001b[31m\nred", "radius_m": 50},
                "geometry": {"type": "Point", "coordinates": [-84.375, 36.605]},
            }
        ],
    }
    (tmp_path / "z.geojson").write_text(json.dumps(features))
    text = MISSION.replace("version: 1", 'version: 1\nname: "[/] $\\\\frac$ \\e[31m"')
    (tmp_path / "m.yaml").write_text(text.replace("no_fly:", "no_fly:\n  - {file: z.geojson}"))
    code, out, err = run("plan", "m.yaml", "-o", "out", "--png", "out/map.png")
    assert code == 0, err
    assert "\x1b" not in out + err
    assert "[/]" in out
    assert (tmp_path / "out" / "map.png").read_bytes().startswith(b"\x89PNG")
    code, out, _ = run("check", "m.yaml", "out/uav1.plan")
    assert code == 0
    assert "[/x]" in out
    code, out, err = run("check", "m.yaml", "\x1b[2Jx.plan")
    assert code == 2
    assert "\x1b" not in out + err


@pytest.mark.parametrize("stream", ["full", "closed"])
def test_a_standard_output_that_takes_nothing_is_an_error_of_its_own(
    run: Run, monkeypatch: pytest.MonkeyPatch, stream: str
) -> None:
    class Full(io.StringIO):
        def write(self, text: str, /) -> int:
            raise OSError(28, "No space left on device")

    check = ("check", "m.yaml", "uav1.waypoints")
    whole = run(*check)
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", Full() if stream == "full" else None)
        for arguments in ((*check, "--json"), check):
            code, _, err = run(*arguments)
            assert code == 2
            assert err.splitlines()[-1].startswith("gcsplan: standard output: cannot be written")
    assert run(*check) == whole  # without the words that could not be written


def test_ctrl_c_says_so_in_words_and_in_json(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def plainly(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    def in_compiled_code(*_: object, **__: object) -> None:
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    for interrupted in (plainly, in_compiled_code):
        monkeypatch.setattr(pipeline, "load_mission", interrupted)
        code, out, err = run("plan", "m.yaml", "--json")
        assert code == 130
        assert err == "gcsplan: interrupted\n"
        assert json.loads(out)["error"]["code"] == 130


@pytest.mark.parametrize("why", [MemoryError(), RuntimeError("can't start new thread")])
def test_no_memory_is_an_error_that_can_be_cured(run: Run, monkeypatch: pytest.MonkeyPatch, why: Exception) -> None:
    def hungry(*_: object, **__: object) -> None:
        raise why

    monkeypatch.setattr(pipeline, "load_mission", hungry)
    code, _, err = run("plan", "m.yaml")
    assert code == 2
    assert "not enough memory" in err


@pytest.mark.skipif(sys.platform == "win32", reason="a folder that is in use cannot be removed")
def test_a_current_folder_that_was_removed_is_named(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    code, _, err = run("verify", "x.plan", "--to", "udpout:127.0.0.1:9")
    assert code == 2
    assert "the current folder was removed" in err
