"""Wrong types at the door of the functions for scripts: gcsplan's own errors, with place and cure."""

from __future__ import annotations

from typing import Any

import pytest

import gcsplan
from gcsplan.errors import UsageError
from tests.support.paths import DATA


def no_planner(problem: object) -> None:
    """A function where a name belongs."""


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"planner": no_planner}, r"plan\(\).*planner is the name of a planner.*given function no_planner"),
        ({"seed": "1"}, "seed is a whole number; given str '1'"),
        ({"seed": True}, "seed is a whole number"),
        ({"options": 3}, "options is a mapping"),
        ({"objective": 3}, "objective is 'length' or 'energy'"),
        ({"progress": 3}, "progress is a function"),
        ({"gate_utc": "18:30"}, "gate_utc is a datetime"),
    ],
)
def test_plan_refuses_arguments_of_another_type(given: dict[str, Any], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        gcsplan.plan(DATA / "crossing.yaml", **given)


@pytest.mark.parametrize("function", ["write", "report", "rehearse", "upload", "check"])
def test_a_plan_is_a_plan(function: str) -> None:
    arguments: tuple[Any, ...] = (5, "folder") if function == "write" else (5,)
    with pytest.raises(UsageError, match=rf"{function}\(\).* is .*plan.*; given int 5"):
        getattr(gcsplan, function)(*arguments)
