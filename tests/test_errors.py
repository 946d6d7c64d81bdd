"""The exception tree: what is what, which exit code it ends in, and what its message says."""

from __future__ import annotations

import pickle
import re
import typing

import pytest

from gcsplan import errors
from gcsplan.errors import (
    CheckFailed,
    GcsplanError,
    InputError,
    LinkError,
    Mistake,
    NoMission,
    NoMissionReason,
    ReadBackDiffers,
    UsageError,
    VehicleRefused,
    unknown_name,
)

TREE: list[tuple[type[GcsplanError], type[Exception], int, str]] = [
    (InputError, ValueError, 2, "bad_input"),
    (UsageError, InputError, 2, "usage"),
    (CheckFailed, RuntimeError, 4, "violation"),
    (VehicleRefused, ConnectionError, 5, "refused"),
    (LinkError, ConnectionError, 6, "unknown"),
    (ReadBackDiffers, RuntimeError, 7, "differs"),
]


@pytest.mark.parametrize(("kind", "base", "code", "reason"), TREE)
def test_each_error_is_what_python_calls_it_and_ends_in_its_code(
    kind: type[GcsplanError], base: type[Exception], code: int, reason: str
) -> None:
    error = kind("too high", where="m.yaml: limits.min_agl_m")
    assert isinstance(error, GcsplanError)
    assert isinstance(error, base)
    assert (error.exit_code, error.reason) == (code, reason)
    assert str(error) == "m.yaml: limits.min_agl_m: too high"
    assert str(kind("too high")) == "too high"
    assert kind("x", reason="other").reason == "other"


def test_what_fits_no_branch_is_our_bug() -> None:
    assert (GcsplanError("x").exit_code, GcsplanError("x").reason) == (70, "internal")


def test_no_mission_always_says_why() -> None:
    for reason in typing.get_args(NoMissionReason):
        error = NoMission("the ridge is higher than the ceiling", reason=reason)
        assert isinstance(error, RuntimeError)
        assert (error.exit_code, error.reason) == (3, reason)
    with pytest.raises(TypeError):
        NoMission("no reason given")  # type: ignore[call-arg]


def test_the_table_in_the_docstring_is_the_tree() -> None:
    kinds = {k for k in vars(errors).values() if isinstance(k, type) and issubclass(k, GcsplanError)}
    told = {name: int(code) for name, code in re.findall(r"(\w+)(?: +\(\w+\))? +(\d+)  ", errors.__doc__ or "")}
    assert told == {kind.__name__: kind.exit_code for kind in kinds}


def test_an_input_error_carries_its_problem_even_when_it_is_only_one() -> None:
    error = InputError("must be positive", where="m.yaml: a")
    assert error.problems == (Mistake("m.yaml: a", "must be positive"),)
    assert InputError("x", problems=iter([Mistake("a", "b"), Mistake("c", "d")])).problems[1].where == "c"


def test_one_problem_is_told_as_itself() -> None:
    error = InputError.of([Mistake("m.yaml: a", "must be positive")])
    assert (error.message, error.where) == ("must be positive", "m.yaml: a")
    assert str(error) == "m.yaml: a: must be positive"


def test_many_problems_are_told_at_once_one_a_line() -> None:
    problems = [Mistake("m.yaml: a", "must be positive"), Mistake("", "and a last thing")]
    error = InputError.of(p for p in problems)
    assert error.problems == tuple(problems)
    assert str(error).splitlines() == [
        "2 mistakes in the input:", "  m.yaml: a: must be positive", "  and a last thing",
    ]  # fmt: skip
    assert str(InputError.of(problems[:1], headline="f is damaged")).splitlines()[0] == "f is damaged:"
    usage = UsageError.of(problems)
    assert isinstance(usage, UsageError)


def test_a_problem_without_a_place_is_its_message_alone() -> None:
    assert str(Mistake("", "x")) == "x"
    assert str(Mistake("a", "x")) == "a: x"


def test_errors_survive_the_way_between_processes() -> None:
    problems = (Mistake("a", "b"), Mistake("c", "d"))
    for error in (
        GcsplanError("m", where="w", reason="r"),
        InputError("m", where="w", problems=problems),
        InputError.of(problems),
        NoMission("m", reason="battery", where="w"),
        LinkError("m"),
    ):
        copy = pickle.loads(pickle.dumps(error))
        assert type(copy) is type(error)
        assert str(copy) == str(error)
        assert (copy.reason, copy.where, copy.exit_code) == (error.reason, error.where, error.exit_code)
        assert getattr(copy, "problems", None) == getattr(error, "problems", None)


def test_an_unknown_name_is_told_the_nearest_and_all() -> None:
    error = unknown_name("there is no planner 'krll'", "krll", ["optimal", "krill"])
    assert type(error) is InputError
    assert str(error) == "there is no planner 'krll'. Did you mean 'krill'? Known: optimal, krill"
    assert str(unknown_name("there is no x 'q'", "q", ["optimal"])) == "there is no x 'q'. Known: optimal"
    assert str(unknown_name("it has no y 'q'", "q", [])) == "it has no y 'q'. Known: none"


def test_what_failed_in_a_check_is_told_apart_from_where() -> None:
    failed = CheckFailed("limits are broken", lines=["uav1:", "  item 3: too low"], reason="violation")
    assert (failed.headline, failed.message) == ("limits are broken", "limits are broken\nuav1:\n  item 3: too low")
    again = pickle.loads(pickle.dumps(failed))
    assert (again.headline, str(again), again.reason) == (failed.headline, str(failed), "violation")
