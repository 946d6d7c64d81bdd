"""Wrong types at the door of the functions for scripts: gcsplan's own errors, with place and cure."""

from __future__ import annotations

from typing import Any

import pytest

import gcsplan
from gcsplan.errors import InputError, UsageError
from tests.support.paths import DATA


def no_planner(problem: object) -> None:
    """A function that plans nothing."""


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"planner": 7}, r"plan\(\).*planner is the name of a planner.*given int"),
        ({"seed": "1"}, "seed is a whole number; given str '1'"),
        ({"seed": True}, "seed is a whole number"),
        ({"options": 3}, "options is a mapping"),
        ({"objective": 3}, "objective is 'length', 'energy' or 'time'"),
        ({"progress": 3}, "progress is a function"),
        ({"gate_utc": "18:30"}, "gate_utc is a datetime"),
    ],
)
def test_plan_refuses_arguments_of_another_type(given: dict[str, Any], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        gcsplan.plan(DATA / "crossing.yaml", **given)


def test_a_function_that_plans_nothing_is_refused_by_its_name() -> None:
    with pytest.raises(InputError, match="planner no_planner: a planner returns a Solution, given NoneType"):
        gcsplan.plan(DATA / "crossing.yaml", planner=no_planner)  # type: ignore[arg-type]


@pytest.mark.parametrize("function", ["write", "report", "rehearse", "upload", "check"])
def test_a_plan_is_a_plan(function: str) -> None:
    arguments: tuple[Any, ...] = (5, "folder") if function == "write" else (5,)
    with pytest.raises(UsageError, match=rf"{function}\(\).* is .*plan.*; given int 5"):
        getattr(gcsplan, function)(*arguments)
