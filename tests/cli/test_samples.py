"""The sample missions by name, wherever a command takes a mission file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

NAME = "sample:papers/krill-mound"


@pytest.mark.slow
def test_a_sample_is_planned_into_a_directory_of_its_name_and_checked(run: Any, tmp_path: Path) -> None:
    code, out, _ = run("plan", NAME)
    assert code == 0
    assert "written to krill-mound" in out
    assert [p.name for p in tmp_path.iterdir()] == ["krill-mound"]
    (plan,) = (tmp_path / "krill-mound").glob("*.plan")
    assert run("check", NAME, plan, "-q")[0] == 0


@pytest.mark.parametrize(
    "arguments",
    [
        ("plan", "sample:krill"),
        ("rehearse", "sample:krill"),
        ("sim", "sample:krill"),
        ("check", "sample:krill", "uav1.plan"),
        ("upload", "uav1.plan", "--to", "sim", "--mission", "sample:krill"),
    ],
)
def test_an_unknown_sample_ends_with_the_list_of_them_and_changes_nothing(
    run: Any, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    (tmp_path / "uav1.plan").write_text("mine")
    code, _, err = run(*arguments)
    assert code == 2
    assert "sample:krill: there is no such sample" in err
    assert "There are: fleet-100, fleet-4, jacksboro, " in err
    assert [p.name for p in tmp_path.iterdir()] == ["uav1.plan"]
