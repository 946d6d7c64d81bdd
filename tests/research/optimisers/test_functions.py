"""SSGWO's nine functions: their formulas, optima and noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.research.optimisers.functions import FUNCTIONS

POINT = [0.5, -1.0, 1.5]
# Worked out from table 1 at POINT, term by term.
BY_HAND = {
    "f1": 0.25 + 1.0 + 2.25,
    "f2": (0.5 + 1.0 + 1.5) + 0.5 * 1.0 * 1.5,
    "f3": 100.0 * (-1.0 - 0.25) ** 2 + 0.25 + 100.0 * (1.5 - 1.0) ** 2 + 4.0,
    "f4": 1.5,
    "f5": 0.5**2 + (0.5 - 1.0) ** 2 + (0.5 - 1.0 + 1.5) ** 2,
    "f6": 0.5**4 + 2.0 * 1.0 + 3.0 * 1.5**4,
    "f7": (0.25 + 10.0 + 10.0) + (1.0 - 10.0 + 10.0) + (2.25 + 10.0 + 10.0),
    "f8": -20.0 * math.exp(-0.2 * math.sqrt(3.5 / 3.0)) - math.exp((-1.0 + 1.0 - 1.0) / 3.0) + 20.0 + math.e,
    "f9": 3.5 / 4000.0 - math.cos(0.5) * math.cos(-1.0 / math.sqrt(2.0)) * math.cos(1.5 / math.sqrt(3.0)) + 1.0,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_has_the_value_of_its_formula(name: str) -> None:
    assert FUNCTIONS[name].value(np.array([POINT]))[0] == pytest.approx(BY_HAND[name])


@pytest.mark.parametrize("shifted", [False, True])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_optimum_is_nought_lies_in_the_box_and_nothing_near_is_less(name: str, shifted: bool) -> None:
    function = FUNCTIONS[name]
    place = function.optimum_unit(30, shifted=shifted)
    cost = function.on_unit_box(30, shifted=shifted)
    assert ((place > 0.0) & (place < 1.0)).all()
    assert cost(place[None])[0] == pytest.approx(0.0, abs=1e-9)
    around = np.clip(place + np.random.default_rng(1).normal(0.0, 0.05, (200, 30)), 0.0, 1.0)
    assert (cost(around) > 0.0).all()
    if shifted:
        # Off the middle in every dimension, and not along the diagonal.
        assert np.abs(place - 0.5).max() > 0.2
        assert np.std(place) > 0.1


def test_only_the_sixth_function_is_noisy_and_its_noise_is_of_the_given_stream() -> None:
    x = np.full((4, 5), 0.5)
    for name, function in FUNCTIONS.items():
        one = function.on_unit_box(5, noise=np.random.default_rng(1))(x)
        bare = function.on_unit_box(5)(x)
        if name == "f6":
            assert np.array_equal(one - bare, np.random.default_rng(1).random(4))
        else:
            assert np.array_equal(one, bare)
