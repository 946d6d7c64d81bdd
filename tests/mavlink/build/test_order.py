"""Altitudes in whole centimetres: no leg is too steep if that is possible at all, and none is moved without need."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcsplan.mavlink.build.order import MOVED_CM, most_cm, none_zero, whole_cm
from tests.support.effort import draws

LEGS = st.lists(st.tuples(st.floats(0.0, 6.0), st.floats(0.0, 6.0), st.floats(-5.0, 5.0)), min_size=1, max_size=4)


def fits(cm: np.ndarray, up: np.ndarray, down: np.ndarray) -> bool:
    rise = np.diff(cm)
    return bool((rise <= up).all() and (-rise <= down).all())


@pytest.mark.nightly
@settings(max_examples=draws(300))
@given(LEGS, st.integers(0, 31))
def test_the_altitudes_that_are_moved_least_are_found(legs: list[tuple[float, float, float]], mask: int) -> None:
    """Beside all whole centimetres within 4 cm."""
    up, down, rise = (np.array(column) for column in zip(*legs, strict=True))
    wanted = 1000.3 + np.concatenate([[0.0], np.cumsum(rise)])
    fixed = np.array([bool(mask >> k & 1) for k in range(len(wanted))])
    found = whole_cm(wanted, up, down, fixed)
    near = np.rint(wanted).astype(int)
    held = fixed.copy()
    held[[0, -1]] = True
    assert (found[held] == near[held]).all()
    choices = [[n] if h else range(n - 4, n + 5) for n, h in zip(near.tolist(), held.tolist(), strict=True)]
    least = min(
        (
            np.abs(np.array(c) - wanted)[~held].max(initial=0.0)
            for c in product(*choices)
            if fits(np.array(c), up, down)
        ),
        default=np.inf,
    )
    if least <= 4.0:
        assert fits(found, up, down)
        step = next(step for step in MOVED_CM if least <= step)
        assert np.abs(found - wanted)[~held].max(initial=0.0) <= step
    if fits(near, up, down):
        assert (found == near).all()


def test_a_leg_without_length_stays_level_and_one_without_limit_is_free() -> None:
    assert most_cm(np.array([0.0, 10.0]), 0.2).tolist() == [0.0, 199.95]
    assert np.isinf(most_cm(np.array([0.0]), np.inf)).all()
    wanted = np.array([0.0, 700.2, 0.0])
    free = np.full(2, np.inf)
    assert whole_cm(wanted, free, free, np.zeros(3, bool)).tolist() == [0, 700, 0]


def test_altitudes_that_cannot_be_reached_are_the_nearest_centimetres() -> None:
    wanted = np.array([0.0, 50.4, 100.4])
    ten = np.full(2, 10.0)
    assert whole_cm(wanted, ten, ten, np.zeros(3, bool)).tolist() == [0, 50, 100]


@given(st.lists(st.sampled_from([-101, -1, 0, 1, 2, 101]), min_size=2, max_size=6), st.integers(0, 300))
def test_no_altitude_is_zero_where_zero_keeps_the_altitude(cm: list[int], most: int) -> None:
    near, steep = np.array(cm), np.full(len(cm) - 1, float(most))
    found = none_zero(near, near + 0.3, steep, steep)
    assert (found != 0).all()
    assert (np.abs(found - near) <= (near == 0)).all()
    others = [np.where(near == 0, side, near) for side in (1, -1)]
    if (near == 0).sum() == 1 and any((np.abs(np.diff(other)) <= most).all() for other in others):
        assert (np.abs(np.diff(found)) <= most).all()
