"""Files that are no log say so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gcsplan.errors import InputError
from gcsplan.logs.reader import read_log
from tests.support.flight_logs import csv_of


def test_files_that_are_none_say_so(tmp_path: Path) -> None:
    (tmp_path / "x.bin").write_bytes(b"hello, this is text")
    (tmp_path / "x.ulg").write_bytes(b"ULog")
    (tmp_path / "x.tlog").write_bytes(bytes(range(0, 128, 2)))
    for name, words in (
        ("gone.bin", "no such file"), ("x.bin", "A3 95"), ("x.ulg", "is no PX4 log"), ("x.tlog", "no places|damaged"),
        (".", "folder"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words):
            read_log(tmp_path / name)
    with pytest.raises(InputError, match="did you mean power_w"):
        read_log(csv_of(tmp_path / "y.csv", "a,b", [np.zeros(3)] * 2), columns={"power": "a"})
