"""Declared winds: the vectors of a share, and how far a cell of shares reaches."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcsplan.wind.declared import DeclaredWind

NOWHERE = np.zeros(1)


def of(speed, direction, **rest):
    return DeclaredWind(np.array([[speed]], dtype=float), np.array([[direction]], dtype=float), **rest)


def test_a_west_wind_blows_towards_the_east():
    blows = of((8, 8), (270, 270)).vectors_m_s(np.zeros((1, 2)), NOWHERE, NOWHERE, NOWHERE)
    assert blows[0, 0] == pytest.approx([8.0, 0.0], abs=1e-12)


def test_shares_choose_between_the_ends_of_both_ranges():
    wind = of((2, 6), (0, 90))
    blows = wind.vectors_m_s(np.array([[0.0, 0.0], [1.0, 1.0], [0.5, 0.0]]), NOWHERE, NOWHERE, NOWHERE)[:, 0]
    assert blows == pytest.approx(np.array([[0.0, -2.0], [-6.0, 0.0], [0.0, -4.0]]), abs=1e-12)
    assert not wind.single
    assert of((3, 3), (7, 7)).single
    assert of((0, 0), (0, 360)).still


def test_vectors_are_linear_in_height_and_time_and_constant_beyond():
    wind = DeclaredWind(
        np.array([[[2, 2], [4, 4]], [[6, 6], [8, 8]]], dtype=float), np.zeros((2, 2, 2)),
        np.array([10.0, 110.0]), "agl", np.array([0.0, 3600.0]),
    )  # fmt: skip
    agl, at = np.array([60.0, 0.0, 500.0, 60.0]), np.array([0.0, 0.0, 7200.0, 1800.0])
    north = wind.vectors_m_s(np.zeros((1, 2)), np.full(4, 900.0), agl, at)[0, :, 1]
    assert north == pytest.approx([-3.0, -2.0, -8.0, -5.0])


def test_gusts_add_what_exceeds_the_highest_speed():
    assert of((0, 5), (0, 360), gust_m_s=8.0).gusts_add_m_s == 3.0
    assert of((0, 5), (0, 360)).gusts_add_m_s == 0.0


@pytest.mark.parametrize(
    ("speed", "direction"),
    [((3, 2), (0, 0)), ((-1, 2), (0, 0)), ((1, 2), (10, 0)), ((1, 2), (0, 361)), ((1, math.nan), (0, 0))],
)
def test_ranges_that_are_none_are_refused(speed, direction):
    with pytest.raises(ValueError, match=r"range|speeds"):
        of(speed, direction)


@given(
    st.tuples(st.floats(0, 20), st.floats(0, 20)).map(sorted),
    st.tuples(st.floats(0, 180), st.floats(0, 180)).map(sorted),
    st.lists(st.floats(0, 1), min_size=4, max_size=4),
    st.floats(0, 1),
    st.floats(0, 1),
)
def test_every_wind_of_a_cell_is_near_the_quadrangle_of_its_corners(speed, direction, ends, u, v):
    wind = of(speed, direction)
    cell = np.array([sorted(ends[:2]), sorted(ends[2:])])
    bow = wind.bow_m_s(cell[None], NOWHERE, NOWHERE, NOWHERE)[0, 0]
    corners = wind.vectors_m_s(np.array([[s, d] for s in cell[0] for d in cell[1]]), NOWHERE, NOWHERE, NOWHERE)[:, 0]
    share = cell[:, 0] + np.array([u, v]) * (cell[:, 1] - cell[:, 0])
    drawn = wind.vectors_m_s(share[None], NOWHERE, NOWHERE, NOWHERE)[0, 0]
    low, high = ((1.0 - v) * corners[k] + v * corners[k + 1] for k in (0, 2))
    assert math.dist(drawn, (1.0 - u) * low + u * high) <= bow + 1e-9


def test_a_scaled_set_has_all_its_speeds_and_gusts_scaled():
    half = of((2, 6), (0, 90), gust_m_s=8.0).scaled(0.5)
    assert half.speed_m_s.ravel().tolist() == [1.0, 3.0]
    assert half.gust_m_s == 4.0
