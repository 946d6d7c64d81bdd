"""What an aircraft can do in a wind: the triangle, its bounds over sets of winds, and circles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcsplan.wind.ability import Ability, WindsAlong, circle_ratio
from gcsplan.wind.declared import DeclaredWind

ONE = np.zeros(1)


def on_one_part(course_deg: float, slope: float, air_m_s: float, most_m_s: float = math.inf) -> Ability:
    angle = math.radians(course_deg)
    air = np.array([air_m_s])
    return Ability(
        np.array([[math.sin(angle), math.cos(angle)]]), np.array([slope]), air, air, np.array([most_m_s])
    )  # fmt: skip


def along(ability: Ability, speed: tuple[float, float], from_deg: tuple[float, float]) -> WindsAlong:
    wind = DeclaredWind(np.array([[speed]], dtype=float), np.array([[from_deg]], dtype=float))
    return WindsAlong(wind, ability, np.zeros(1, dtype=np.intp), ONE, ONE, ONE)


def flown_m_s(ability: Ability, wind: np.ndarray) -> float:
    """The ground speed by bisection: the largest at which the speed through the air is no more than the airspeed."""
    course, slope = ability.course[0], float(ability.slope[0])
    low, high = 0.0, float(ability.most_air_m_s[0]) + float(np.hypot(*wind)) + 1.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        through = math.hypot(*(middle * course - wind), slope * middle)
        low, high = (middle, high) if through <= ability.most_air_m_s[0] else (low, middle)
    return min(low, float(ability.most_m_s[0]))


def test_a_multicopter_keeps_its_ground_speed_until_its_lean_forbids_it():
    able = on_one_part(90.0, 0.0, 12.0, 10.0)
    speeds = [along(able, (w, w), (90, 90)).speeds_m_s(np.zeros((1, 2, 2)))[0][0, 0] for w in (0, 2, 5)]
    assert speeds == pytest.approx([10.0, 10.0, 7.0])


def test_a_wing_flies_the_wind_triangle_and_not_at_all_in_too_strong_a_wind():
    able = on_one_part(0.0, 0.0, 20.0)
    slow = [
        along(able, (w, w), (f, f)).speeds_m_s(np.zeros((1, 2, 2)))[0][0, 0] for w, f in ((8, 0), (12, 90), (8, 180))
    ]
    assert slow == pytest.approx([12.0, 16.0, 28.0])
    assert not along(able, (21, 21), (90, 90)).speeds_m_s(np.zeros((1, 2, 2)))[0][0, 0] > 0.0
    assert not along(able, (20.5, 20.5), (0, 0)).speeds_m_s(np.zeros((1, 2, 2)))[0][0, 0] > 0.0


CELLS = st.tuples(*[st.floats(0, 1)] * 4)


@given(
    st.floats(0, 360), st.floats(-0.4, 0.4), st.sampled_from([math.inf, 14.0]), st.floats(0, 9), st.floats(0, 4),
    st.floats(0, 360), st.floats(0, 360), CELLS, st.floats(0, 1), st.floats(0, 1),
)  # fmt: skip
def test_bounds_of_a_cell_hold_every_wind_in_it(course, slope, most, low, more, begin, turn, ends, u, v):
    able = on_one_part(course, slope if most == math.inf else 0.0, 16.0, most)
    winds = along(able, (low, low + more), (begin, begin + turn))
    cell = np.array([sorted(ends[:2]), sorted(ends[2:])])
    share = cell[:, 0] + np.array([u, v]) * (cell[:, 1] - cell[:, 0])
    wind = winds.wind.vectors_m_s(share[None], ONE, ONE, ONE)[0, 0]
    slow, fast = (float(s[0, 0]) for s in winds.speeds_m_s(cell[None]))
    g = flown_m_s(able, wind)
    assert not slow > g + 1e-6
    assert fast >= g - 1e-6
    if slow > 0.0:
        air_m, seconds = (float(c[0, 0]) for c in winds.costs(cell[None]))
        assert seconds >= 1.0 / g - 1e-9
        if most < math.inf or slope == 0.0:
            assert air_m >= math.hypot(*(g * able.course[0] - wind)) / g - 1e-6
    if slope == 0.0 or most < math.inf:
        free = replace(winds, ability=on_one_part(course, 0.0, 16.0))
        least, most_air = free.advance_per_air(cell[None])[0]
        assert least - 1e-9 <= flown_m_s(free.ability, wind) / 16.0 <= most_air + 1e-9


def test_the_bounds_of_a_single_wind_are_its_speed():
    able = on_one_part(30.0, 0.2, 18.0)
    slow, fast = along(able, (6, 6), (200, 200)).speeds_m_s(np.zeros((1, 2, 2)))
    wind = 6.0 * np.array([-math.sin(math.radians(200)), -math.cos(math.radians(200))])
    assert float(slow[0, 0]) == float(fast[0, 0]) == pytest.approx(flown_m_s(able, wind), abs=1e-9)


def test_a_circle_in_a_wind_takes_its_integral():
    m = (6.0 / 18.0) ** 2
    share = np.linspace(0.0, 0.5 * math.pi, 20_001)
    root = np.sqrt(1.0 - m * np.sin(share) ** 2)
    elliptic = float((0.5 * (root[1:] + root[:-1])).mean())  # 2/pi of the complete integral of the second kind
    assert circle_ratio(6.0, 18.0, math.inf) == pytest.approx(elliptic / (1.0 - m), rel=1e-8)
    assert circle_ratio(2.0, 15.0, 10.0) == 1.0
    assert circle_ratio(18.0, 18.0, math.inf) == math.inf


@given(
    st.floats(0.0, 6.0), st.floats(0.0, 360.0), st.floats(0.0, 3.5), st.floats(0.0, 2.0 * math.pi), st.floats(0.0, 0.3)
)
def test_no_gust_makes_an_aircraft_slower_than_the_bound_with_gusts(speed_m_s, from_deg, gust_m_s, towards, slope):
    able = on_one_part(0.0, slope, 14.0)
    wind = along(able, (speed_m_s, speed_m_s), (from_deg, from_deg))
    slow = wind.speeds_m_s(np.zeros((1, 2, 2)), gust_m_s)[0][0, 0]
    angle = math.radians(from_deg)
    blown = -speed_m_s * np.array([math.sin(angle), math.cos(angle)])
    assert slow <= flown_m_s(able, blown + gust_m_s * np.array([math.cos(towards), math.sin(towards)])) + 1e-6


def test_gusts_alone_leave_the_airspeed_less_the_gust():
    able = along(on_one_part(0.0, 0.0, 10.0), (0, 0), (0, 0))
    assert able.speeds_m_s(np.zeros((1, 2, 2)), 8.0)[0][0, 0] == pytest.approx(2.0)
