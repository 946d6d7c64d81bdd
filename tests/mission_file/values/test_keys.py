"""The base of every section of a mission file, by the sections that it is the base of."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from gcsplan.mission_file.values.keys import LARGEST_KEY_M
from gcsplan.mission_file.values.schema import LimitKeys


def test_only_the_keys_that_are_written_count_as_given() -> None:
    assert LimitKeys().given == {}
    assert LimitKeys(min_agl_m=5.0).given == {"min_agl_m": 5.0}
    assert LimitKeys(min_agl_m=None).given == {"min_agl_m": None}


@pytest.mark.parametrize(
    "keys",
    [
        {"min_agl_m": -1.0}, {"min_agl_m": math.inf}, {"max_amsl_m": math.nan}, {"max_amsl_m": -2.0 * LARGEST_KEY_M},
        {"min_agl_m": "5"}, {"lowest_agl_m": 5.0},
    ],
)  # fmt: skip
def test_texts_slips_of_size_and_unknown_keys_are_refused(keys: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        LimitKeys.model_validate(keys)


def test_a_section_does_not_change() -> None:
    with pytest.raises(ValidationError):
        LimitKeys().min_agl_m = 3.0
