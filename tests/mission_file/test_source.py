"""What a mission is read from: a file, a text, and what is neither."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from gcsplan.errors import InputError
from gcsplan.mission_file import load_mission
from tests.mission_file.test_load import PLANNERS, base, problems


def test_a_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    (tmp_path / "latin.yaml").write_bytes(b"name: \xe9")
    (tmp_path / "big.yaml").write_bytes(b"#" * 5_000_001)
    cases = {
        "none.yaml": "no such file",
        "": "folder",
        "latin.yaml": "UTF-8",
        "big.yaml": "at most",
        "a\0b": "cannot be read",
    }
    for name, words in cases.items():
        with pytest.raises(InputError, match=words):
            load_mission(tmp_path / name if name else tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"), ("- 1", "keys"), ("5", "keys"), ("a", "keys"), ("version: 1\nversion: 1", "stands twice"),
        ("\tversion: 1", "tab"), ("version: 1\n  x: [", "line 2"),
    ],
)  # fmt: skip
def test_text_that_is_no_mission_is_told(text: str, words: str) -> None:
    (problem,) = problems(text)
    assert words in problem.message


def test_a_byte_order_mark_is_no_key(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + yaml.safe_dump(base()).encode())
    assert load_mission(path, planner_names=PLANNERS).stem == "m"
