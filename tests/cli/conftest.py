"""The command line as a test calls it, in this process."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from gcsplan.cli import main as cli
from tests.support.impatient import be_impatient


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> Any:
    """Call ``gcsplan ARGUMENTS`` in an empty directory; gives (exit code, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)
    be_impatient(monkeypatch)

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["gcsplan", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        out, err = capfd.readouterr()
        code = ended.value.code
        assert isinstance(code, int)
        return code, out, err

    return call
