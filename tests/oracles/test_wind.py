"""The second implementation of flights in a wind, against flights that one can compute by hand."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest

from tests.oracles.wind import Craft, Extremes, Winds, fly, leaning_air_m_s, path_of, still, true_air_m_s

WEST = Winds([[(4.0, 4.0)]], [[(270.0, 270.0)]])
WING = Craft(20.0, radius_m=100.0)
COPTER = Craft(8.0, air_m_s=10.0)


def test_a_wing_is_as_fast_as_the_wind_triangle_says() -> None:
    for way, speed_m_s in (((2000.0, 0.0), 24.0), ((-2000.0, 0.0), 16.0), ((0.0, 2000.0), math.sqrt(20.0**2 - 16.0))):
        flown = fly(path_of([(0.0, 0.0, 0.0), (*way, 0.0)], WING), WING, WEST, lambda leg: (0.0, 0.0))
        assert flown.arrive_s[-1] == pytest.approx(2000.0 / speed_m_s, rel=1e-6)
        assert flown.air_m == pytest.approx(20.0 * flown.arrive_s[-1], rel=1e-6)


def test_a_copter_keeps_its_speed_until_its_airspeed_forbids_it() -> None:
    steady = 2 * 8.0 / 1.5
    for way, speed_m_s in (((2000.0, 0.0), 8.0), ((-2000.0, 0.0), 6.0)):
        flown = fly(path_of([(0.0, 0.0, 0.0), (*way, 0.0)], COPTER), COPTER, WEST, lambda leg: (0.0, 0.0))
        takes_s = 2000.0 / speed_m_s + (steady / 2 if speed_m_s == 8.0 else 6.0 / 1.5)
        assert flown.arrive_s[-1] == pytest.approx(takes_s, abs=0.15)


def test_an_arc_is_as_long_as_it_is_and_a_way_point_its_middle() -> None:
    path = path_of([(0.0, 0.0, 0.0), (1000.0, 0.0, 0.0), (1000.0, 1000.0, 0.0)], WING)
    flown = still(WING, path)
    arc = 0.5 * math.pi * 100.0
    assert flown.arrive_s[-1] == pytest.approx((2 * 900.0 + arc) / 20.0, rel=1e-4)
    assert flown.arrive_s[1] == pytest.approx(0.5 * flown.arrive_s[-1], rel=1e-4)


def test_one_that_cannot_advance_never_arrives() -> None:
    gale = Winds([[(12.0, 12.0)]], [[(90.0, 90.0)]])
    flown = fly(path_of([(0.0, 0.0, 0.0), (900.0, 0.0, 0.0)], COPTER), COPTER, gale, lambda leg: (0.0, 0.0))
    assert math.isinf(flown.arrive_s[-1])


def test_the_search_finds_head_and_tail_wind_and_varying_is_wider() -> None:
    anywhere = Winds([[(0.0, 5.0)]], [[(0.0, 360.0)]])
    there_and_back = path_of([(0.0, 0.0, 0.0), (3000.0, 0.0, 0.0), (3000.0, 3000.0, 0.0)], WING)
    one = Extremes.of(there_and_back, WING, anywhere, random.Random(1))
    each = Extremes.of(there_and_back, WING, anywhere, random.Random(1), varying=True)
    assert each.earliest_s[-1] < one.earliest_s[-1] < still(WING, there_and_back).arrive_s[-1] < one.latest_s[-1]
    assert one.latest_s[-1] < each.latest_s[-1]
    assert each.latest_s[-1] == pytest.approx(6000.0 / 15.0, rel=0.04)


def test_airspeeds_are_those_that_were_measured() -> None:
    assert leaning_air_m_s(45.0, 593.0) == pytest.approx(15.08, abs=0.1)
    assert true_air_m_s(20.0, 0.0) == pytest.approx(20.0)
    assert true_air_m_s(20.0, 1800.0) == pytest.approx(20.0 * 1.092, rel=2e-3)


def test_a_profile_and_a_forecast_are_linear_and_constant_beyond() -> None:
    winds = replace(WEST, speed_m_s=[[(2.0, 2.0), (4.0, 4.0)], [(6.0, 6.0), (8.0, 8.0)]],
                    from_deg=[[(0.0, 0.0)] * 2] * 2, heights_m=[10.0, 110.0], times_s=[0.0, 3600.0])  # fmt: skip
    cases = ((60.0, 0.0, 3.0), (0.0, 0.0, 2.0), (500.0, 7200.0, 8.0), (60.0, 1800.0, 5.0))
    for agl_m, at_s, speed_m_s in cases:
        assert winds.at((0.0, 0.0), 900.0, agl_m, at_s) == pytest.approx((0.0, -speed_m_s))
