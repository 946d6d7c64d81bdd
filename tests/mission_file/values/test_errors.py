"""The kinds of mistakes, as programs tell them apart, and which of two are one."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from gcsplan.errors import InputError, Mistake
from gcsplan.mission_file import load_mission
from gcsplan.mission_file.values.errors import listed_once
from tests.check.test_energy import mission


def refused(**changes: Any) -> tuple[Mistake, ...]:
    """The problems of a mission with changed keys; None takes one away. Those of a vehicle begin with an underscore."""
    content = copy.deepcopy(mission({}))
    for key, value in changes.items():
        section = content["vehicles"][0] if key.startswith("_") else content
        section[key.removeprefix("_")] = value
        if value is None:
            del section[key.removeprefix("_")]
    with pytest.raises(InputError) as error:
        load_mission(content)
    return error.value.problems


def test_an_unknown_key_has_a_code_and_the_names_that_may_be_meant() -> None:
    [problem] = refused(_takeof_agl_m=65)
    assert (problem.code, problem.meant) == ("unknown_key", ("takeoff_agl_m",))
    assert problem.as_dict()["code"] == "unknown_key"
    [strange] = refused(_zzzzz=1)
    assert (strange.code, strange.meant) == ("unknown_key", ())


def test_a_missing_key_has_a_code_unless_an_unknown_one_stands_for_it() -> None:
    assert [p.code for p in refused(_sysid=None)] == ["missing"]
    [slip] = refused(_sysid=None, _system_number=1)
    assert (slip.code, slip.meant) == ("unknown_key", ("sysid",))
    assert "did you mean sysid" in slip.message


def test_limits_that_stand_under_another_name_are_not_missing() -> None:
    assert [p.code for p in refused(limits=None)] == ["missing_limit"]
    [slip] = refused(limits=None, limitz={"min_agl_m": 50})
    assert (slip.code, slip.meant) == ("unknown_key", ("limits",))


def test_swapped_places_are_one_problem_whatever_its_words_are() -> None:
    swapped = [Mistake(f"m.yaml: vehicles[{i}].start", f"words {i}", "swapped") for i in range(3)]
    [one] = listed_once(swapped)
    assert one.code == "swapped"
    assert one.message == "words 0 (the same at vehicles[1].start, vehicles[2].start)"
    alike = [Mistake(p.where, "latitude and longitude look swapped") for p in swapped]
    assert listed_once(alike) == alike  # the words alone decide nothing


def test_a_problem_without_a_kind_has_no_code_in_json() -> None:
    assert Mistake("a", "b").as_dict() == {"where": "a", "message": "b"}
