"""`gcsplan map`: its address on standard output, Ctrl-C that loses no edit, and words for what is missing."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import gcsplan

pytest.importorskip("starlette", reason="the extra map is not installed")

FLAT = (
    "version: 1\nterrain: {flat_m: 100}\nlimits: {min_agl_m: 30}\nvehicles:\n"
    "  - {name: a, sysid: 1, autopilot: arducopter, start: [46.5, 8.5], goal: [46.51, 8.5]}\n"
)


@pytest.mark.slow
def test_ctrl_c_ends_the_server_and_keeps_edits_and_address(tmp_path: Path) -> None:
    connect = pytest.importorskip("websockets.sync.client", reason="the extra map is not installed").connect
    (tmp_path / "m.yaml").write_text(FLAT)
    command = [sys.executable, "-m", "gcsplan", "map", "m.yaml", "--no-browser"]

    @contextmanager
    def start() -> Iterator[subprocess.Popen[str]]:
        pipe = subprocess.PIPE
        with subprocess.Popen(command, cwd=tmp_path, stdout=pipe, stderr=pipe, text=True) as process:
            try:
                yield process
                process.wait(60)
            finally:
                process.kill()

    with start() as running:
        assert running.stdout is not None
        url = running.stdout.readline().split()[-1]
        origin = url.split("/", 3)
        with connect(url.replace("http", "ws") + "socket", additional_headers={"Origin": "/".join(origin[:3])}) as page:
            page.send(json.dumps({"type": "change", "n": 1, "changes": {"vehicles[0].goal": [46.52, 8.5]}}))
            assert json.loads(page.recv(timeout=60))["type"] == "state"
            running.send_signal(signal.SIGINT)
            _, err = running.communicate(timeout=60)
    assert running.returncode == 130
    assert ".m.yaml.edits" in err
    assert (tmp_path / "m.yaml").read_text() == FLAT
    kept = json.loads((tmp_path / ".m.yaml.edits").read_text())
    assert kept["mission"]["vehicles"][0]["goal"] == [46.52, 8.5]
    with start() as again:
        assert again.stdout is not None
        assert again.stdout.readline().split()[-1] == url
        again.send_signal(signal.SIGINT)


@pytest.mark.parametrize("package", ["starlette.applications", "pmtiles.reader"])
def test_a_missing_package_is_one_line_with_its_cure(run: Any, monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    monkeypatch.setattr(gcsplan, "page", sys.modules.get("gcsplan.page"), raising=False)  # put back with its modules
    for name in [name for name in sys.modules if name.startswith("gcsplan.page")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    code, out, err = run("map", "--no-browser")
    assert (code, out) == (2, "")
    assert "pip install 'gcsplan[map]'" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere.yaml",), "no such file"),
        (("--port", "99999"), "--port 99999"),
        (("--base", "x.pmtiles"), "no such file"),
        (("--base", "x.mb"), "an .mbtiles or .pmtiles file"),
    ],
)
def test_bad_input_ends_with_two_before_anything_is_served(
    run: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run("map", *arguments, "--no-browser")
    assert (code, out) == (2, "")
    assert words in err
