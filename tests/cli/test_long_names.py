"""Names that no disk can hold are bad input, wherever a command takes a name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., tuple[int, str, str]]

LONG = "x" * 290


@pytest.mark.parametrize(
    "arguments",
    [
        ["check", "sample:jacksboro", LONG],
        ["check", "sample:jacksboro", LONG + "*"],
        ["check", LONG + ".plan", "--dem", "sample:jacksboro"],
        ["check", "a.plan", "--dem", LONG, "--min-agl", "30"],
        ["batch", LONG, "-o", "out"],
        ["batch", "**x", "-o", "out"],
        ["plan", "sample:fleet-4", "--cluster", LONG],
        ["plan", LONG],
    ],
)
def test_a_name_too_long_is_bad_input(
    run: Run, arguments: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    code, _, err = run(*arguments)
    assert code == 2
    assert "bug" not in err
