"""The earliest and latest times over a set of winds, against many winds of the set."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gcsplan.arrays import Floats
from gcsplan.wind.ability import Ability, WindsAlong
from gcsplan.wind.declared import DeclaredWind
from gcsplan.wind.window import MOST_WIND_CELLS, TimeWindow, window

RUN_M = np.array([3000.0, 4000.0, 1500.0])
COURSE_DEG = np.array([70.0, 200.0, 300.0])


def blown(speed: tuple[float, float], from_deg: tuple[float, float], **more: object) -> WindsAlong:
    angle = np.radians(COURSE_DEG)
    air, none = np.full(3, 15.0), np.zeros(3)
    able = Ability(np.column_stack([np.sin(angle), np.cos(angle)]), none, air, air, np.full(3, math.inf))
    wind = DeclaredWind(np.array([[speed]], dtype=float), np.array([[from_deg]], dtype=float), **more)  # type: ignore[arg-type]
    return WindsAlong(wind, able, np.arange(3), none, none, none)


class Timer:
    """A flight without acceleration; counts how often it was timed."""

    run_m = RUN_M

    def __init__(self) -> None:
        self.timed = 0

    def even_m_s(self, slow_m_s: Floats, fast_m_s: Floats) -> tuple[Floats, Floats]:
        return slow_m_s, fast_m_s

    def between(self, slow_m_s: Floats, fast_m_s: Floats) -> TimeWindow:
        self.timed += slow_m_s.size // len(RUN_M)
        return TimeWindow(np.cumsum(RUN_M / fast_m_s, axis=-1), np.cumsum(RUN_M / slow_m_s, axis=-1))

    def summed(self, seconds: Floats) -> Floats:
        return np.cumsum(seconds, axis=-1)

    def loose_s(self, slow_m_s: Floats, fast_m_s: Floats) -> Floats:
        return np.zeros(3)


clock = Timer()


def drawn_s(winds: WindsAlong, count: int) -> Floats:
    shares = np.random.default_rng(7).random((count, 2))
    slow, _ = winds.speeds_m_s(np.repeat(shares[:, :, None], 2, axis=2))
    return np.cumsum(RUN_M / slow, axis=1)


@pytest.mark.parametrize(("speed", "from_deg"), [((0, 5), (0, 360)), ((4, 7), (250, 290)), ((0, 13), (30, 50))])
def test_one_unknown_wind_has_a_window_just_around_all_of_them(speed, from_deg):
    winds = blown(speed, from_deg)
    found, times = window(winds, clock), drawn_s(winds, 1000)
    assert (found.earliest_s <= times.min(axis=0)).all()
    assert (found.latest_s >= times.max(axis=0)).all()
    assert found.latest_s[-1] - found.earliest_s[-1] <= 1.1 * np.ptp(times[:, -1])


def test_a_single_wind_has_one_time_at_each_point():
    found = window(blown((5, 5), (270, 270)), clock)
    assert found.earliest_s.tolist() == found.latest_s.tolist()


def test_a_varying_wind_may_be_the_worst_on_each_leg():
    found, one = window(blown((0, 5), (0, 360), varying=True), clock), window(blown((0, 5), (0, 360)), clock)
    assert found.latest_s[-1] == pytest.approx(RUN_M.sum() / 10.0, rel=2e-3)
    assert found.earliest_s[-1] == pytest.approx(RUN_M.sum() / 20.0, rel=2e-3)
    assert found.latest_s[-1] > one.latest_s[-1]


def test_the_search_ends_after_so_many_cells():
    timer = Timer()
    window(blown((0, 14), (0, 360)), timer)
    assert 0 < timer.timed <= 2 * 2 * MOST_WIND_CELLS
