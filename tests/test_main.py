"""`python -m gcsplan`."""

from __future__ import annotations

import subprocess
import sys

import gcsplan


def test_the_package_runs_as_a_module() -> None:
    ran = subprocess.run([sys.executable, "-m", "gcsplan", "--version"], capture_output=True, text=True, timeout=60)
    assert (ran.returncode, ran.stdout.strip(), ran.stderr) == (0, gcsplan.__version__, "")
