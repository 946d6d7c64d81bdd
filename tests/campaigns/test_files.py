"""A short run of the campaign `files`, and what it counts as a fault."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.campaigns import files
from tests.support.paths import REPOSITORY


@pytest.mark.nightly
@pytest.mark.skipif(os.name != "posix", reason="measures memory as POSIX does")
def test_a_short_campaign_of_hostile_files_finds_nothing() -> None:
    command = [sys.executable, "-m", "tests.campaigns.files", "--seconds", "60", "--seed", "1", "--inputs", "40"]
    ended = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert re.match(r"40 inputs, 0 faults, \d+ MB at most\n", ended.stdout)
    for kind in ("yaml", "waypoints", "plan", "zones", "terrain"):
        assert f"  {kind}: " in ended.stdout


def test_what_a_run_owes() -> None:
    good, bad = '{"verdicts": []}', '{"error": {"code": 2}}'
    assert files.civil(0, good, "note: all is well\n") == []
    assert files.civil(2, bad, "gcsplan: m.yaml: is missing\n") == []
    for code, out, err in (
        (70, '{"error": {"code": 70}}', "gcsplan: internal error"),
        (0, bad, ""),
        (2, good, "gcsplan: x"),
        (4, bad, ""),
        (0, "", ""),
        (0, good + good, ""),
        (2, bad, ""),
        (0, good, "x.py:1: RuntimeWarning: overflow"),
        (0, good, "Traceback (most recent call last):"),
        ("KeyError: 1", good, ""),
    ):
        assert files.civil(code, out, err), (code, out, err)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="needs signals")
def test_an_input_that_ends_the_process_is_named_by_its_seed(tmp_path: Path) -> None:
    with files.Worker(tmp_path, 1) as worker:
        assert worker.answer() is not None
        os.kill(worker.process.pid, signal.SIGFPE)
        until = time.monotonic() + 60.0
        while worker.answer() is not None:
            assert time.monotonic() < until
        assert worker.seed >= 1
        assert worker.fate() == f"the process ended with {-signal.SIGFPE}"
