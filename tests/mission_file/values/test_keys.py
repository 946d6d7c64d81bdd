"""The base of every section of a mission file."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from gcsplan.mission_file.values.keys import LARGEST_KEY_M, FiniteMetres, Keys, Length


class Sizes(Keys):
    wide_m: Length = 5.0
    up_m: FiniteMetres = 0.0


def test_only_the_keys_that_are_written_count_as_given() -> None:
    assert Sizes().given == {}
    assert Sizes(wide_m=5.0).given == {"wide_m": 5.0}


@pytest.mark.parametrize(
    "keys",
    [
        {"wide_m": -1.0}, {"wide_m": math.inf}, {"up_m": math.nan}, {"up_m": -2.0 * LARGEST_KEY_M},
        {"wide_m": "5"}, {"wider_m": 5.0},
    ],
)  # fmt: skip
def test_texts_slips_of_size_and_unknown_keys_are_refused(keys: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Sizes.model_validate(keys)


def test_a_section_does_not_change() -> None:
    with pytest.raises(ValidationError):
        Sizes().wide_m = 3.0
